//! Fuzz target: arbitrary bytes as each kind of file that the programs read: scenes, descriptions, occlusion
//! queries and answers.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::path::Path;
use visibility_examples::description::Description;
use visibility_examples::visc::{scene_file, visibility_file};
use visibility_examples::{gltf_file, vscn};

fuzz_target!(|bytes: &[u8]| {
    let Some((&which, bytes)) = bytes.split_first() else { return };
    let path = Path::new("fuzz");
    match which % 5 {
        0 => drop(vscn::parse(bytes, path)),
        1 => drop(scene_file::parse(bytes, path)),
        2 => drop(visibility_file::parse(bytes, path)),
        3 => drop(gltf_file::parse(bytes, path)),
        _ => drop(Description::parse(bytes, path)),
    }
});
