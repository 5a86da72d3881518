//! Where a mover is, and how far it may get.

use glam::DVec3;

/// Where a mover may be until the answer is used: the box in world space that its body, or its eyes, are in
/// now, and the distance that it may move from there in any direction. It moves along paths: it does not go
/// through walls, so that a reach that sticks through a wall does not count beyond the wall where the level
/// knows its walls ([`PlanCells`], cells with portals). The body does count, on both sides of a wall that it
/// sticks through.
///
/// [`PlanCells`]: https://docs.rs/visibility-2d/latest/visibility_2d/cdt/struct.PlanCells.html
#[derive(Clone, Copy, PartialEq, Debug)]
#[must_use]
pub struct Reach {
    /// Least corner of the body's box in world space, in metres.
    pub min: DVec3,
    /// Greatest corner of the body's box in world space, in metres.
    pub max: DVec3,
    /// Greatest distance in metres that a point of the body moves until the answer is used.
    pub margin: f64,
}

impl Reach {
    /// Makes the reach of a mover at rest, from the least and the greatest corner of its body's box in world
    /// space.
    pub const fn new(min: DVec3, max: DVec3) -> Self {
        Self { min, max, margin: 0.0 }
    }

    /// Returns the reach within so many seconds at a greatest speed in metres per second: half a round trip
    /// and the time until the next answer, with whatever a client draws ahead. A negative product counts as
    /// 0. For who may be teleported, give the destination as a mover of its own.
    pub fn within(self, seconds: f64, speed: f64) -> Self {
        let margin = seconds * speed;
        Self { margin: if margin < 0.0 { 0.0 } else { margin }, ..self }
    }

    /// Returns the least and the greatest corner of the box that holds all points of the body in all its
    /// places, rounded outwards.
    pub fn bounds(&self) -> [DVec3; 2] {
        [(self.min - self.margin).map(f64::next_down), (self.max + self.margin).map(f64::next_up)]
    }

    /// Returns whether the box is not inverted, the margin is not negative, and no number is NaN or infinite. A
    /// reach that is not proper sees and is seen by all.
    pub fn is_proper(&self) -> bool {
        let [low, high] = self.bounds();
        self.min.cmple(self.max).all() && self.margin >= 0.0 && low.is_finite() && high.is_finite()
    }
}
