//! Arbitrary bytes as each kind of file that the programs read: scenes, descriptions, occlusion queries and
//! answers, and floor plans. The first byte chooses the kind.

use std::path::Path;
use visibility_examples::description::Description;
use visibility_examples::floor_plans::{geojson, svg, text};
use visibility_examples::visc::{scene_file, visibility_file};
use visibility_examples::{gltf_file, vscn};

/// Runs the target on some bytes. Returns whether the file was accepted.
pub fn run(bytes: &[u8]) -> bool {
    let Some((&which, bytes)) = bytes.split_first() else { return false };
    let path = Path::new("fuzz");
    let plan = || std::str::from_utf8(bytes).unwrap_or("no text");
    match which % 8 {
        0 => vscn::parse(bytes, path).is_ok(),
        1 => scene_file::parse(bytes, path).is_ok(),
        2 => visibility_file::parse(bytes, path).is_ok(),
        3 => gltf_file::parse(bytes, path).is_ok(),
        4 => Description::parse(bytes, path).is_ok(),
        5 => text::read(plan()).is_ok(),
        6 => svg::read(plan()).is_ok(),
        _ => geojson::read(plan()).is_ok(),
    }
}
