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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_of_a_reach_holds_the_body_wherever_it_may_be() {
        // Sums that are rounded inwards to the nearest number.
        let reach = Reach { margin: 0.1, ..Reach::new(DVec3::splat(0.3), DVec3::splat(0.6)) };
        let [low, high] = reach.bounds();
        assert!(
            low.cmplt(DVec3::splat(0.3 - 0.1)).all() && high.cmpgt(DVec3::splat(0.6 + 0.1)).all(),
            "{low} to {high}"
        );
        let still = Reach::new(DVec3::ZERO, DVec3::ONE).bounds();
        assert!(still[0].x < 0.0 && still[1].x > 1.0 && still[1].x < 1.0 + 1e-15, "{still:?}");
        let at = Reach::new(DVec3::ZERO, DVec3::ONE);
        assert_eq!(at.within(0.5, 6.0).margin, 3.0, "half a second");
        assert_eq!([at.within(-0.5, 6.0).margin, at.within(0.0, 6.0).margin], [0.0; 2], "no time");
    }

    #[test]
    fn reaches_are_proper_or_not() {
        let of = |min: f64, max: f64, margin: f64| {
            Reach { margin, ..Reach::new(DVec3::new(0.0, min, 0.0), DVec3::new(1.0, max, 1.0)) }.is_proper()
        };
        assert!(of(0.0, 1.0, 0.0) && of(1.0, 1.0, 2.0), "a box, and a flat one");
        assert!(!of(1.5, 1.0, 2.0) && !of(0.0, 1.0, -0.1), "an inverted box and a negative margin");
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(!of(bad, 1.0, 0.0) && !of(0.0, bad, 0.0) && !of(0.0, 1.0, bad), "a number of {bad}");
        }
        assert!(!of(-f64::MAX, 1.0, 1e300) && !of(0.0, f64::MAX, 1e300), "a box that overflows");
    }
}
