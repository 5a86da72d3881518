//! The reference scenes. They are large and not part of the project; a test that needs them carries
//! `#[cfg_attr(not(reference_scenes), ignore = "...")]`, a cfg that the build script sets where they are
//! found.
#![allow(dead_code)] // No test uses all of it.

use std::path::{Path, PathBuf};
use visibility_examples::{SceneSource, cars5, load};

/// Path of a file among the reference scenes. Panics if it is missing.
pub(crate) fn stored(name: &str) -> PathBuf {
    let path = Path::new(env!("REFERENCE_SCENES")).join(name);
    assert!(path.is_file(), "{} is missing", path.display());
    path
}

/// A reference scene by the stem of its file; five cars in a row by `cars5`; a clinic with its thousands of
/// pipes and lamps, most of them above the ceilings, by `clinic and its pipes`.
pub(crate) fn scene(name: &str) -> SceneSource {
    match name {
        "cars5" => cars5(&stored("car.vscn")).unwrap(),
        "clinic and its pipes" => {
            let mut clinic = scene("clinic");
            clinic.objects.extend(scene("clinic_mep").objects);
            clinic
        }
        _ => load(&stored(&format!("{name}.vscn"))).unwrap(),
    }
}
