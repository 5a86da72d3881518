//! Where a mover is, and how far it may get.

use glam::DVec3;

/// Where a mover may be until the answer is used: the box in world space that contains its body, or its eyes,
/// now, and the distance that it may move from there in any direction. A mover does not pass through walls:
/// if the level knows its walls ([`PlanCells`], cells with portals), the space that a reach covers beyond a
/// wall does not count. The body itself counts on both sides of a wall that it sticks through.
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

    /// Returns the reach of the mover within `seconds` at a greatest speed in metres per second. `seconds`
    /// should be half a network round trip, plus the time until the next answer, plus the time that a client
    /// extrapolates. A negative product of `seconds` and `speed` counts as zero. For a mover that may be
    /// teleported, add its destination as another mover.
    pub fn within(self, seconds: f64, speed: f64) -> Self {
        let margin = seconds * speed;
        Self { margin: if margin < 0.0 { 0.0 } else { margin }, ..self }
    }

    /// Returns the least and the greatest corner of the box, rounded outwards, that holds the body wherever
    /// it may be.
    pub fn bounds(&self) -> [DVec3; 2] {
        [(self.min - self.margin).map(f64::next_down), (self.max + self.margin).map(f64::next_up)]
    }

    /// Returns whether the box is not inverted, the margin is not negative, and no number is NaN or infinite.
    /// A reach that is not proper sees and is seen by all.
    pub fn is_proper(&self) -> bool {
        let [low, high] = self.bounds();
        self.min.cmple(self.max).all() && self.margin >= 0.0 && low.is_finite() && high.is_finite()
    }
}
