//! Views on a plan: an eye, and limits on what it sees.

use super::error::PlanError;
use super::predicates::{Point, checked, is_same_way, orient};
use alloc::vec::Vec;

/// Eye on a plan, with limits on its sight: a range, a sector, heights, and a number of walls to see through.
#[derive(Clone, Copy, PartialEq, Debug)]
#[must_use]
pub struct PlanView {
    /// Position of the eye in world units. An eye on a wall sees both sides of the wall.
    pub eye: [f64; 2],
    /// Greatest distance that the eye sees, in world units. Infinite by default; NaN counts as infinite, a
    /// negative number as 0.
    pub range: f64,
    /// Two points in world units. The eye sees the directions from that of the first point counter-clockwise
    /// to that of the second, and nothing if both points lie in the same direction. `None` by default: the
    /// eye sees all directions. So it does if a point is equal to the eye.
    pub sector: Option<[[f64; 2]; 2]>,
    /// Heights of the eye and of its targets, in world units. `None` by default: all walls block. With
    /// heights, a wall only blocks if it extends at least from the lower to the upper of the two heights, and
    /// so stops every line of sight between them. If the two heights are equal, a wall that begins or ends at
    /// this height does not block. Targets visible over or under a wall are therefore never left out. For
    /// walls that cover a part of the heights, use [`Plan::sees_at`].
    ///
    /// [`Plan::sees_at`]: super::Plan::sees_at
    pub heights: Option<[f64; 2]>,
    /// Number of opaque walls that a line of sight may pass through. 0 by default. Walls along the same piece
    /// count as one.
    pub through: u32,
}

impl PlanView {
    /// Makes a view from an eye in world units, without limits.
    pub fn new(eye: impl Into<[f64; 2]>) -> Self {
        Self { eye: eye.into(), range: f64::INFINITY, sector: None, heights: None, through: 0 }
    }

    /// Returns the view with a greatest distance, in world units.
    pub fn with_range(self, range: f64) -> Self {
        Self { range, ..self }
    }

    /// Returns the view limited to the directions counter-clockwise from the point `right` to the point
    /// `left`, in world units. Points are exact, unlike angles.
    pub fn with_sector(self, right: impl Into<[f64; 2]>, left: impl Into<[f64; 2]>) -> Self {
        Self { sector: Some([right.into(), left.into()]), ..self }
    }

    /// Returns the view with heights of the eye and of its targets, in world units.
    pub fn with_heights(self, eye: f64, target: f64) -> Self {
        Self { heights: Some([eye, target]), ..self }
    }

    /// Returns the view with a number of opaque walls that lines of sight may pass through.
    pub fn with_through(self, through: u32) -> Self {
        Self { through, ..self }
    }

    /// Returns the eye, with coordinates rounded to ones that the exact predicates accept.
    ///
    /// # Errors
    /// [`PlanError::Coordinate`] with index 0 if a coordinate of the eye is NaN, infinite or above 1e60 in
    /// absolute value.
    pub(crate) fn checked_eye(&self) -> Result<Point, PlanError> {
        checked(self.eye, 0)
    }

    /// Replaces `out` by points whose directions from the eye divide the sector into parts of less than half
    /// a turn each, from right to left. An empty sector gives a single point. Returns false if the view has
    /// no sector, or a sector point equals the eye: then all directions count.
    ///
    /// # Errors
    /// [`PlanError::Coordinate`] with index 1 or 2 if a coordinate of the sector's first or second point is
    /// NaN, infinite or above 1e60 in absolute value.
    pub(crate) fn sector_points(&self, eye: Point, out: &mut Vec<Point>) -> Result<bool, PlanError> {
        out.clear();
        let Some([right, left]) = self.sector else { return Ok(false) };
        let (right, left) = (checked(right, 1)?, checked(left, 2)?);
        if right == eye || left == eye {
            return Ok(false);
        }
        let mut at = right;
        out.push(at);
        if orient(eye, right, left) == 0.0 && is_same_way(eye, right, left) {
            return Ok(true);
        }
        // Quarter turns are added while half a turn or more is left. A step is as long as the coordinates, so
        // that rounding changes its direction by only about 2^-51.
        while orient(eye, at, left) <= 0.0 && out.len() < 5 {
            let [x, y] = [at[0] - eye[0], at[1] - eye[1]];
            let length = x.abs() + y.abs();
            let scale = (eye[0].abs() + eye[1].abs() + length) / length;
            at = [eye[0] - y * scale, eye[1] + x * scale];
            out.push(at);
        }
        out.push(left);
        Ok(true)
    }
}
