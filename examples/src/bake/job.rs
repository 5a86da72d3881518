//! The job of a bake, as a user states it: scene, viewcells and settings.

use super::viewcells::Places;
use crate::source::parse_hint;
use crate::{Cameras, Hint, Reading};
use clap::Args;

/// What is baked: the same for all shards of a bake.
#[derive(Args, Clone, Debug)]
pub struct Job {
    /// Scene: a built-in scene (plpcity, london, town, forest, office, each with sizes as in london:40,40),
    /// or a file (.vscn, .glb, .gltf).
    #[arg(value_name = "SCENE")]
    pub scene: String,

    /// How scene files are read.
    #[command(flatten)]
    pub reading: Reading,

    /// Where cameras come from.
    #[command(flatten)]
    pub cameras: Cameras,

    /// Where viewcells are.
    #[command(flatten)]
    pub places: Places,

    /// What objects are whose names contain TEXT: `occluder`, `detail` or `door` (hide nothing), `mover`
    /// (hides nothing, and is visible from everywhere) or `never-cull`. May be given several times. Nodes of
    /// glTF files may say it themselves, by the extra `visibility`.
    #[arg(long = "hint", value_name = "HINT=TEXT", value_parser = parse_hint)]
    pub hints: Vec<(Hint, String)>,

    /// Part of the reported triangles that may be neither seen nor proven hidden, as in 5% or 0.05.
    #[arg(long, value_parser = share, default_value = "5%")]
    pub gap: f64,

    /// Distance in metres that a line of sight must keep from all occluders. 0 for a conservative bake.
    #[arg(long, default_value_t = 1e-4)]
    pub clearance: f64,

    /// Number of rays aimed at each object.
    #[arg(long, default_value_t = 200)]
    pub rays: u32,

    /// Limit of the program's memory, as in 512M or 2G: triangles are in a file beside the output, and those
    /// that are needed are read. The result is the same. The scene is made or read object by object, but for
    /// a .glb or .gltf file, which is in memory as a whole until its objects are written. By default all is
    /// in memory.
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    pub memory: Option<u64>,
}

/// Reads a number of bytes from text, as in 512M or 2G.
fn bytes(text: &str) -> Result<u64, String> {
    let (number, unit) = match text.char_indices().next_back() {
        Some((end, 'k' | 'K')) => (&text[..end], 10),
        Some((end, 'm' | 'M')) => (&text[..end], 20),
        Some((end, 'g' | 'G')) => (&text[..end], 30),
        _ => (text, 0),
    };
    let number: Option<u64> = number.parse().ok();
    let bytes = number.and_then(|number| number.checked_mul(1 << unit));
    bytes.ok_or_else(|| "a size is a number of bytes, or as in 512M or 2G".to_owned())
}

/// Reads a part from text: a number from 0 to 1, or a percentage up to 100%.
fn share(text: &str) -> Result<f64, String> {
    let (number, unit) = text.strip_suffix('%').map_or((text, 1.0), |number| (number, 0.01));
    match number.trim().parse::<f64>() {
        Ok(number) if (0.0..=1.0).contains(&(number * unit)) => Ok(number * unit),
        _ => Err("a part is a number from 0 to 1, or a percentage up to 100%".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_or_refused() {
        assert_eq!(
            (bytes("512M"), bytes("2g"), bytes("77")),
            (Ok(512 << 20), Ok(2 << 30), Ok(77)),
            "sizes in mebibytes, gibibytes and bytes"
        );
        for wrong in ["", "M", "1.5G", "-1", "99999999999G", "1T"] {
            assert!(bytes(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn parts_are_read_or_refused() {
        assert_eq!(
            (share("5%"), share("0.05"), share("1")),
            (Ok(0.05), Ok(0.05), Ok(1.0)),
            "parts in percent and as numbers"
        );
        for wrong in ["", "5", "-1%", "101%", "nan", "x"] {
            assert!(share(wrong).is_err(), "{wrong}");
        }
    }
}
