//! Walls of a plan, as input.

use super::predicates::Point;
use alloc::vec::Vec;
use visibility_core::glam::DVec2;

/// Effect of a wall on lines of sight that cross it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
pub enum Opacity {
    /// Lines of sight end at the wall, such as a solid wall or a closed door.
    #[default]
    Opaque,
    /// Lines of sight pass through the wall, and the wall itself is seen: glass, an open door, a line that
    /// only marks a place.
    Clear,
    /// Lines of sight pass from the left side of the wall to its right side, and end when they come from the
    /// right. Left is as seen along the wall from its first to its second end.
    OneWay,
}

/// Wall of a plan: a segment between two ends, in world units.
#[derive(Clone, Copy, PartialEq, Debug)]
#[must_use]
pub struct Wall {
    /// Ends of the wall in world units. A wall with equal ends is never seen and hides nothing.
    pub ends: [[f64; 2]; 2],
    /// Lines of sight that the wall stops: all, none, or those from one side.
    pub opacity: Opacity,
    /// Heights of the wall's lower and upper end, in world units. From negative to positive infinity by
    /// default, so that the wall stops lines of sight at any height. Only queries with heights use them.
    pub heights: [f64; 2],
}

impl Wall {
    /// Makes an opaque wall between two points in world units, given as arrays or as `DVec2`.
    pub fn new(from: impl Into<[f64; 2]>, to: impl Into<[f64; 2]>) -> Self {
        let heights = [f64::NEG_INFINITY, f64::INFINITY];
        Self { ends: [from.into(), to.into()], opacity: Opacity::Opaque, heights }
    }

    /// Returns the wall with another opacity.
    pub fn with_opacity(self, opacity: Opacity) -> Self {
        Self { opacity, ..self }
    }

    /// Returns the wall with a lower and an upper height: a parapet, a crate, the wall above a door. If `low`
    /// is not below `high`, or one is NaN, the wall stops no line of sight that has heights.
    pub fn with_heights(self, low: f64, high: f64) -> Self {
        Self { heights: [low, high], ..self }
    }

    /// Returns whether the wall extends from negative to positive infinity in height.
    pub(crate) fn is_endless(&self) -> bool {
        self.heights == [f64::NEG_INFINITY, f64::INFINITY]
    }

    /// Returns whether the wall stops lines of sight that cross a piece of it from the piece's left side to
    /// its right side.
    pub(crate) fn stops(&self, piece: [Point; 2]) -> bool {
        match self.opacity {
            Opacity::Opaque => true,
            Opacity::Clear => false,
            Opacity::OneWay => !is_along(self.ends, piece),
        }
    }
}

impl From<[DVec2; 2]> for Wall {
    /// Makes an opaque wall.
    fn from([from, to]: [DVec2; 2]) -> Self {
        Self::new(from, to)
    }
}

/// Returns whether a piece of a wall runs in the direction from the wall's first end to its second. One
/// coordinate decides, since both are monotonic along a wall's pieces.
pub(crate) fn is_along(wall: [Point; 2], piece: [Point; 2]) -> bool {
    let axis = usize::from(piece[0][0] == piece[1][0]);
    (wall[0][axis] < wall[1][axis]) == (piece[0][axis] < piece[1][axis])
}

/// Appends to `to` each wall of `walls` that is not marked with `query` in `marks`, and marks it.
pub(crate) fn add_walls(to: &mut Vec<u32>, marks: &mut [u32], query: u32, walls: &[u32]) {
    for &wall in walls {
        let mark = &mut marks[wall as usize];
        if *mark != query {
            *mark = query;
            to.push(wall);
        }
    }
}
