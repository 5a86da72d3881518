//! Build script that passes the folder of the reference scenes to the tests, and sets the cfg
//! `reference_scenes` if the folder exists. Without the folder, the tests that need the scenes are reported
//! as ignored.

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
