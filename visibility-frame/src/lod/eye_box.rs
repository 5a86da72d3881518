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

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::glam::Vec3;
    use visibility_core::view::Window;
    use visibility_core::{Pose, View};
    use visibility_testing::Random;

    /// The eye is within an error of a point whose coordinates were rounded once. In double-double arithmetic
    /// it is in the box, whatever the ratio of error and coordinates.
    #[test]
    fn the_box_holds_the_eye_wherever_rounding_leaves_it() {
        let mut random = Random(31);
        for round in 0..20_000 {
            let [far, error] = [0, 1].map(|_| 2f64.powi(random.between(-60, 20)));
            let point = random.fine_vector(far);
            let error = if random.one_in(4) { 0.0 } else { error * random.fine_range(0.5, 1.0) };
            let found = EyeBox::around(point, error);
            for k in 0..3 {
                let room = |beyond: DoubleDouble| {
                    beyond.plus(DoubleDouble::from(-error)).plus(DoubleDouble::from(-U * point[k].abs())).hi
                };
                let below = room(DoubleDouble::difference(point[k], found.low[k]));
                let above = room(DoubleDouble::difference(found.high[k], point[k]));
                assert!(below >= 0.0 && above >= 0.0, "{round}: {found:?} around {point}, off by {error}");
            }
        }
    }

    /// The box of a perspective view reaches as far around its eye as the eye may be off; that of a parallel
    /// view, everywhere.
    #[test]
    fn the_box_of_a_view_holds_the_error_of_its_eye() {
        let mut errors = 0.0;
        for place in [DVec3::ZERO, DVec3::new(1e9, 0.0, 0.0), DVec3::new(0.0, -1e7, 3.0)] {
            let pose = Pose::look_at(place, place + DVec3::new(1.0, 0.3, 0.2), DVec3::Z);
            let projection =
                ViewProjection::new(&View::perspective(pose, 1.0, 1.5, 0.1, 9.0).unwrap(), DVec3::ZERO);
            let (Eye::Point(eye), error) = (projection.eye(), projection.eye_error()) else {
                panic!("a perspective view from {place} has no eye")
            };
            let EyeBox { low, high } = EyeBox::of_view(&projection);
            for k in 0..3 {
                // Differences beside large coordinates are rounded.
                let rounding = 4.0 * U * place[k].abs();
                for reach in [high[k] - eye[k], eye[k] - low[k]] {
                    let is = error - rounding <= reach && reach <= 2.0 * error + 4.0 * rounding;
                    assert!(is, "axis {k}: {reach} around {eye}, off by {error}");
                }
            }
            errors += error;
            let parallel = View::orthographic(pose, Window::centered(1.0, 1.0), 0.1, 9.0).unwrap();
            let EyeBox { low, high } = EyeBox::of_view(&ViewProjection::new(&parallel, DVec3::ZERO));
            assert_eq!((low, high), (DVec3::NEG_INFINITY, DVec3::INFINITY), "the eye of a parallel view");
        }
        assert!(errors > 1e-9, "errors of {errors}");
    }

    /// Distances that are just below or above those of boxes, by squares in double-double arithmetic.
    #[test]
    fn boxes_at_a_distance_are_neither_beyond_nor_within_it() {
        let mut random = Random(32);
        for round in 0..20_000 {
            let at = random.fine_vector(0.25);
            let eye = EyeBox { low: at, high: at };
            // A box of one point, so that the nearest point of the box is the farthest one.
            let point = random.vec3(0.5, 1.0);
            let bounds = Aabb::new(point, point);
            let square = |x: f64| DoubleDouble::product(x, x);
            let [x, y, z] = [0, 1, 2].map(|k| DoubleDouble::difference(point[k].into(), at[k]));
            let exact = x.times(x).plus(y.times(y)).plus(z.times(z));
            let excess = |distance: f64| square(distance).plus(exact.negated()).hi;
            let mut above = sqrt(exact.hi).next_down();
            while excess(above) < 0.0 {
                above = above.next_up();
            }
            assert!(!eye.is_beyond(&bounds, above), "{round}: {point} is less than {above} m from {at}");
            let mut below = sqrt(exact.hi).next_up();
            while excess(below) > 0.0 {
                below = below.next_down();
            }
            assert!(!eye.is_within(&bounds, below), "{round}: {point} is more than {below} m from {at}");
        }
        let anywhere = EyeBox { low: DVec3::NEG_INFINITY, high: DVec3::INFINITY };
        let bounds = Aabb::new(Vec3::ZERO, Vec3::ONE);
        assert!(anywhere.is_within(&bounds, 1e-30), "an eye that may be anywhere is within any distance");
        assert!(!anywhere.is_within(&bounds, 0.0), "no eye is less than 0 m away");
        assert!(!anywhere.is_beyond(&bounds, 0.0), "an eye that may be anywhere is beyond no distance");
        let around = EyeBox { low: DVec3::splat(-1.0), high: DVec3::splat(2.0) };
        let is_within = [1.732, 1.733].map(|distance| around.is_within(&bounds, distance));
        assert_eq!(is_within, [false, true], "corners of the box of the eye are the root of 3 m away");
        assert_eq!(around.gap_squared(&Aabb::new(Vec3::splat(3.0), Vec3::splat(4.0))), 3.0, "a box above");
        assert_eq!(around.gap_squared(&Aabb::new(Vec3::splat(-4.0), Vec3::splat(-3.0))), 12.0, "a box below");
    }
}
