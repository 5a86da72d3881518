//! Refusal of scene paths that name a pipe, a device or a folder.

use crate::error::SourceError;
use std::path::Path;

/// Returns an error for a path of a pipe, a device or a folder. A pipe that nobody writes to would be waited
/// for without end.
pub(crate) fn require_ordinary_file(path: &Path) -> Result<(), SourceError> {
    let facts = std::fs::metadata(path).map_err(|cause| SourceError::io(path, cause))?;
    if facts.is_file() {
        return Ok(());
    }
    Err(SourceError::content(path, "file", "it is no ordinary file, but a folder, a pipe or a device"))
}
