//! Floor plans: walls read from text, SVG paths or GeoJSON, and pictures of what is seen; used by the program
//! `plan`.

pub mod drawing;
pub mod geojson;
pub mod svg_paths;
pub mod text;

use crate::error::SourceError;
use std::path::Path;

/// Walls and eyes read from a file.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct PlanFile {
    /// Walls as pairs of ends, in the units of the file, numbered in the order of the file.
    pub walls: Vec<[[f64; 2]; 2]>,
    /// Eyes that the file brings.
    pub eyes: Vec<[f64; 2]>,
    /// True if the coordinate y of the file grows downwards, as in SVG.
    pub y_down: bool,
}

impl PlanFile {
    /// Adds the walls of a chain of points; when `closed`, also the wall from the last to the first.
    fn push_chain(&mut self, points: &[[f64; 2]], closed: bool) {
        self.walls.extend(points.windows(2).map(|pair| [pair[0], pair[1]]));
        if let (true, [first, .., last]) = (closed, points)
            && first != last
        {
            self.walls.push([*last, *first]);
        }
    }
}

/// Reads a plan: SVG by the extension `.svg`, GeoJSON by `.json` or `.geojson`, text otherwise.
///
/// # Errors
///
/// Returns [`SourceError`] when the file cannot be read, or its content is not of its format.
pub fn load(file: &Path) -> Result<PlanFile, SourceError> {
    let content = std::fs::read_to_string(file).map_err(|cause| SourceError::io(file, cause))?;
    let extension = file.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let read = match extension.as_str() {
        "svg" => svg_paths::read(&content),
        "json" | "geojson" => geojson::read(&content),
        _ => text::read(&content),
    };
    read.map_err(|Problem { place, problem }| SourceError::content(file, place, problem))
}

/// What is wrong with a file, and where.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Problem {
    /// Position in the file: a line, a byte offset or a key path.
    pub place: String,
    /// Description for a person.
    pub problem: String,
}

impl Problem {
    fn new(place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { place: place.into(), problem: problem.into() }
    }
}
