//! The point that distances are measured from, with its rounding error.

use visibility_core::glam::DVec3;
use visibility_core::view::{Eye, ViewProjection};
use visibility_core::{Aabb, geometry::sqrt};

/// Unit round-off of `f64`.
const U: f64 = f64::EPSILON / 2.0;

/// Relative margin of the comparisons, greater than all rounding in them. With `u = 2^-53`: a gap between eye
/// and box has one rounding, its square three, the sum of three squares five; the same holds for the squared
/// diagonal; the products with the scale have one each, and the scale itself less than 40. Together at most
/// 52u; the margin is 8192u. Squares of `f32` coordinates neither overflow nor underflow in `f64`; the least
/// normal number is added to the scale, in case the scale underflows.
pub(super) const MARGIN: f64 = 1.0 / (1u64 << 40) as f64;

/// A box that certainly contains the point that distances are measured from, relative to the scene's origin.
/// All of space for parallel views, and where rounding leaves the eye undecided: every distance is then taken
/// as 0.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct EyeBox {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
}

impl EyeBox {
    pub(super) fn of_view(projection: &ViewProjection) -> Self {
        match projection.eye() {
            Eye::Point(eye) => Self::around(eye, projection.eye_error()),
            Eye::Direction(_) => Self { low: DVec3::NEG_INFINITY, high: DVec3::INFINITY },
        }
    }

    /// Returns the box around a point of the world. `origin` is the world point that the box is relative to.
    pub(super) fn of_point(point: DVec3, origin: DVec3) -> Self {
        Self::around(point - origin, 0.0)
    }

    /// Returns a box that contains all points within `error` metres of `point`, whose coordinates were
    /// rounded once. The box is rounded outwards.
    fn around(point: DVec3, error: f64) -> Self {
        // The factors cover the rounding of the point and of the two sums.
        let error = point.abs() * (4.0 * U) + DVec3::splat(error * (1.0 + 8.0 * U));
        Self { low: point - error, high: point + error }
    }

    /// Returns the squared distance, in square metres, between this box and `bounds`, up to rounding. The
    /// eye, a point of this box, is not nearer to `bounds`. 0 if the boxes touch or overlap, or for NaN.
    pub(super) fn gap_squared(&self, bounds: &Aabb) -> f64 {
        let gap = |axis: usize| {
            let below = f64::from(bounds.min[axis]) - self.high[axis];
            let above = self.low[axis] - f64::from(bounds.max[axis]);
            let gap = if below > above { below } else { above };
            if gap > 0.0 { gap } else { 0.0 }
        };
        gap(0) * gap(0) + gap(1) * gap(1) + gap(2) * gap(2)
    }

    /// Returns the distance in metres between this box and `bounds`, up to rounding: the eye is not nearer to
    /// `bounds`. 0 if the boxes touch or overlap.
    pub(super) fn distance(&self, bounds: &Aabb) -> f64 {
        sqrt(self.gap_squared(bounds))
    }

    /// Tests whether `bounds` are certainly more than `distance` metres from the eye.
    pub(super) fn is_beyond(&self, bounds: &Aabb, distance: f64) -> bool {
        self.gap_squared(bounds) > distance * distance * (1.0 + MARGIN)
    }

    /// Tests whether `bounds` are certainly less than `distance` metres from the eye. For an eye that may be
    /// anywhere, true for any distance above 0.
    pub(super) fn is_within(&self, bounds: &Aabb, distance: f64) -> bool {
        if !(self.high - self.low).is_finite() {
            return distance > 0.0;
        }
        // With `low` and `high` exchanged, the gaps computed are those of this box's farthest points.
        let farthest = Self { low: self.high, high: self.low };
        farthest.gap_squared(bounds) < distance * distance * (1.0 - MARGIN)
    }
}
