//! Content of a floor plan file, and the error for invalid content, with its position.

/// Walls and eyes read from a file.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct PlanFile {
    /// Walls as pairs of ends, in the units of the file, numbered in the order of the file.
    pub walls: Vec<[[f64; 2]; 2]>,
    /// Positions of the eyes listed in the file, in the units of the file.
    pub eyes: Vec<[f64; 2]>,
    /// True if y grows downwards in the file, as in SVG.
    pub y_down: bool,
}

impl PlanFile {
    /// Adds walls between consecutive points. When `closed`, also adds the wall from the last to the first
    /// point.
    pub(super) fn push_chain(&mut self, points: &[[f64; 2]], closed: bool) {
        self.walls.extend(points.windows(2).map(|pair| [pair[0], pair[1]]));
        if let (true, [first, .., last]) = (closed, points)
            && first != last
        {
            self.walls.push([*last, *first]);
        }
    }
}

/// Greatest absolute value of a coordinate in a plan.
const GREATEST: f64 = 1e60;

/// Returns an error if a coordinate is not finite or exceeds [`GREATEST`] in magnitude.
pub(super) fn check(x: f64) -> Result<(), String> {
    if x.abs() <= GREATEST { Ok(()) } else { Err(format!("the coordinate {x:?} is no number up to 1e60")) }
}

/// Error in the content of a plan file, with its position.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Problem {
    /// Position in the file: a line or a key path.
    pub place: String,
    /// Description for a person.
    pub problem: String,
}

impl Problem {
    pub(super) fn new(place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { place: place.into(), problem: problem.into() }
    }
}
