//! Tells the tests where the reference scenes are, and, by the cfg `reference_scenes`, whether they are there
//! at all: tests that need them are reported as ignored if not.

use std::env;
use std::path::Path;

fn main() {
    let default = || Path::new(&env::var("CARGO_MANIFEST_DIR").unwrap()).join("../../shared/scenes");
    let folder = env::var("VISIBILITY_SCENES").map_or_else(|_| default(), |folder| folder.into());
    println!("cargo::rerun-if-env-changed=VISIBILITY_SCENES");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(reference_scenes)");
    println!("cargo::rustc-env=REFERENCE_SCENES={}", folder.display());
    if folder.is_dir() {
        println!("cargo::rustc-cfg=reference_scenes");
        println!("cargo::rerun-if-changed={}", folder.display());
    }
}
