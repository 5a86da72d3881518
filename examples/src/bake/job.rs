//! Job of a bake, as a user states it on the command line: scene, viewcells and settings.

use super::viewcells::Places;
use crate::arguments::{parse_bytes, parse_share};
use crate::source::parse_hint;
use crate::{Cameras, Hint, Reading};
use clap::Args;

/// Job of a bake, the same for all its shards.
#[derive(Args, Clone, Debug)]
pub struct Job {
    /// Scene: a built-in scene (plpcity, london, town, forest, office, each with sizes as in london:40,40),
    /// or a file (.vscn, .glb, .gltf).
    #[arg(value_name = "SCENE")]
    pub scene: String,

    /// How to read scene files.
    #[command(flatten)]
    pub reading: Reading,

    /// Where cameras come from.
    #[command(flatten)]
    pub cameras: Cameras,

    /// Where viewcells are.
    #[command(flatten)]
    pub places: Places,

    /// Hint for all objects whose names contain TEXT: `occluder`, `detail` or `door` (hide nothing), `mover`
    /// (hides nothing, and is visible from everywhere) or `never-cull`. May be given several times. Nodes of
    /// glTF files may carry a hint in their extra `visibility`.
    #[arg(long = "hint", value_name = "HINT=TEXT", value_parser = parse_hint)]
    pub hints: Vec<(Hint, String)>,

    /// Share of the reported triangles that may be neither seen nor proven hidden, as in 5% or 0.05.
    #[arg(long, value_parser = parse_share, default_value = "5%")]
    pub gap: f64,

    /// Distance in metres that a line of sight must keep from all occluders. With 0, the bake is
    /// conservative.
    #[arg(long, default_value_t = 1e-4)]
    pub clearance: f64,

    /// Number of rays aimed at each object.
    #[arg(long, default_value_t = 200)]
    pub rays: u32,

    /// Memory limit of the program, as in 512M or 2G. Triangles then lie in a file beside the output, from
    /// which the program reads those that it needs. The result is the same. The scene is made or read object
    /// by object, except for a .glb or .gltf file, which is in memory as a whole until its objects are
    /// written. By default everything is in memory.
    #[arg(long, value_name = "BYTES", value_parser = parse_bytes)]
    pub memory: Option<u64>,
}
