//! Options for reading a scene file: the unit of its coordinates, the axis that points up, and whether
//! triangles are drawn from both sides.

use crate::SceneSource;
use crate::eprintln;
use clap::Args;
use glam::Vec3;

/// Options for reading a scene file. Built-in scenes ignore them: they are in metres, with z up, and drawn
/// from both sides.
#[derive(Args, Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Unit of the coordinates in scene files and their cameras: mm, cm, m, km, in, ft, or its length in
    /// metres. By default metres, and in .bsp files inches.
    #[arg(long, value_name = "UNIT", value_parser = parse_unit)]
    pub unit: Option<f64>,

    /// Axis that points up in scene files: x, y or z. By default y in glTF files; in .vscn files the axis in
    /// the description, else z. Coordinates are not rotated.
    #[arg(long, value_name = "AXIS", value_parser = parse_axis)]
    pub up: Option<Vec3>,

    /// Draw all triangles from both sides, as a renderer without backface culling does. By default, triangles
    /// of glTF files whose material is not `doubleSided` are drawn only from their front: from behind they
    /// are invisible, and hide nothing.
    #[arg(long)]
    pub two_sided: bool,

    /// Divide objects into pieces of at most N triangles, each of which then counts as an object: 64 for
    /// clusters, 1 for triangles. By default objects stay whole.
    #[arg(long, value_name = "N", value_parser = crate::arguments::count())]
    pub pieces: Option<usize>,
}

impl Reading {
    /// Returns the length of the unit in metres.
    pub fn metres(&self) -> f64 {
        self.unit.unwrap_or(1.0)
    }

    /// Returns these options as command-line arguments, each after a space.
    pub fn arguments(&self) -> String {
        let unit = self.unit.map_or(String::new(), |unit| format!(" --unit {unit}"));
        let up = self.up.map_or("", |up| [" --up x", " --up y", " --up z"][up.abs().max_position()]);
        let pieces = self.pieces.map_or(String::new(), |most| format!(" --pieces {most}"));
        format!("{unit}{up}{}{pieces}", if self.two_sided { " --two-sided" } else { "" })
    }
}

// Kept apart from the scene's other methods, because every crate that includes their module would need
// `eprintln`.
impl SceneSource {
    /// Prints each of the scene's notes as a line on standard error.
    pub fn print_notes(&self) {
        for note in &self.notes {
            eprintln!("{}: {note}", self.name);
        }
    }
}

/// Reads the name of a unit or a number, and returns the unit's length in metres.
fn parse_unit(text: &str) -> Result<f64, String> {
    let metres = match text {
        "mm" => 0.001,
        "cm" => 0.01,
        "m" => 1.0,
        "km" => 1000.0,
        "in" => 0.0254,
        "ft" => 0.3048,
        number => number.parse().unwrap_or(f64::NAN),
    };
    let is_usable = (1e-9..=1e9).contains(&metres);
    is_usable.then_some(metres).ok_or_else(|| "a unit is mm, cm, m, km, in, ft, or a length in metres".into())
}

/// Reads the name of an axis, and returns its unit vector.
fn parse_axis(text: &str) -> Result<Vec3, String> {
    match text {
        "x" => Ok(Vec3::X),
        "y" => Ok(Vec3::Y),
        "z" => Ok(Vec3::Z),
        _ => Err("an axis is x, y or z".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_and_axes_are_read_or_refused() {
        assert_eq!(
            (parse_unit("mm"), parse_unit("0.5")),
            (Ok(0.001), Ok(0.5)),
            "units by name and by number"
        );
        assert_eq!(parse_axis("z"), Ok(Vec3::Z), "an axis");
        for wrong in ["", "0", "-1", "nan", "inf", "inch", "1e-300"] {
            assert!(parse_unit(wrong).is_err(), "{wrong}");
        }
        assert!(parse_axis("-z").is_err(), "a negative axis");
    }
}
