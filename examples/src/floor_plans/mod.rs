//! Floor plans: walls read from text, SVG paths, GeoJSON or a cut through a scene, and pictures of what can
//! be seen. Used by the program `plan`.

pub mod drawing;
pub mod forest_walk;
pub mod geojson;
mod plan_file;
pub mod questions;
pub mod slice;
pub mod svg;
pub mod text;

pub use plan_file::{PlanFile, Problem};

use crate::error::SourceError;
use crate::ordinary_file;
use std::path::Path;

/// Reads a plan: SVG by the extension `.svg`, GeoJSON by `.json` or `.geojson`, text otherwise.
///
/// # Errors
///
/// Returns [`SourceError`] when the file cannot be read, or its content is not valid in its format.
pub fn load(file: &Path) -> Result<PlanFile, SourceError> {
    let content = ordinary_file::open(file).and_then(std::io::read_to_string);
    let content = content.map_err(|cause| SourceError::io(file, cause))?;
    // Some editors begin a file with a byte order mark.
    let content = content.trim_start_matches('\u{feff}');
    let extension = file.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let read = match extension.as_str() {
        "svg" => svg::read(content),
        "json" | "geojson" => geojson::read(content),
        _ => text::read(content),
    };
    read.map_err(|Problem { place, problem }| SourceError::content(file, place, problem))
}
