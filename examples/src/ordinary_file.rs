//! Refusal of scene paths that name a pipe, a device or a folder.

use crate::error::SourceError;
use std::path::Path;

/// Returns an error if the path is a pipe, a device or a folder. Reading from a pipe without a writer would
/// wait forever.
pub(crate) fn require_ordinary_file(path: &Path) -> Result<(), SourceError> {
    let facts = std::fs::metadata(path).map_err(|cause| SourceError::io(path, cause))?;
    if facts.is_file() {
        return Ok(());
    }
    Err(SourceError::content(path, "file", "it is no ordinary file, but a folder, a pipe or a device"))
}
