//! Where the stored scenes are, when they lie beside the checkout. They are large and not part of the project.

use std::path::{Path, PathBuf};

/// The path of a stored scene file; without it, a line that the test skips, and `None`.
pub(crate) fn stored(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes").join(name);
    if path.is_file() {
        return Some(path);
    }
    println!("skipped: {name} is not beside the checkout");
    None
}
