//! Floor plans: walls read from text, SVG paths, GeoJSON, maps of Tiled and LDtk or a cut through a scene,
//! and pictures of what can be seen. Used by the program `plan`.

pub mod drawing;
pub mod forest_walk;
pub mod geojson;
pub mod ldtk;
mod plan_file;
pub mod questions;
pub mod slice;
pub mod svg;
pub mod text;
pub mod tiled;
mod tiles;

pub use plan_file::{PlanFile, Problem};

use crate::error::SourceError;
use crate::ordinary_file;
use std::path::Path;

/// Reads a plan: SVG by the extension `.svg`, GeoJSON by `.json` or `.geojson`, a map of Tiled by `.tmx`, one
/// of LDtk by `.ldtk` or `.ldtkl`, text otherwise. Of a map, the layers with a name such as "Walls" or
/// "Collisions" are walls, or all if there is none.
///
/// # Errors
///
/// Returns [`SourceError`] when the file cannot be read, or its content is not valid in its format.
pub fn load(file: &Path) -> Result<PlanFile, SourceError> {
    load_layers(file, &[])
}

/// Reads a plan, like [`load`]. Of a map, the layers that `layers` names are walls, unless it is empty.
///
/// # Errors
///
/// Returns the errors of [`load`], and [`SourceError::Content`] for the name of a layer that the file lacks,
/// as a plan of another format does.
pub fn load_layers(file: &Path, layers: &[String]) -> Result<PlanFile, SourceError> {
    let content = ordinary_file::open(file).and_then(std::io::read_to_string);
    let content = content.map_err(|cause| SourceError::io(file, cause))?;
    // Some editors begin a file with a byte order mark.
    let content = content.trim_start_matches('\u{feff}');
    let extension = file.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let read = match extension.as_str() {
        "tmx" => tiled::read(content, layers),
        "ldtk" => ldtk::read(content, layers),
        "ldtkl" => ldtk::read_level(content, layers),
        _ if !layers.is_empty() => Err(Problem::new("layers", "only maps of Tiled and LDtk have layers")),
        "svg" => svg::read(content),
        "json" | "geojson" => geojson::read(content),
        _ => text::read(content),
    };
    read.map_err(|Problem { place, problem }| SourceError::content(file, place, problem))
}
