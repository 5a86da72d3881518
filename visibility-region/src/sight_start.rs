//! The box in which the lines of sight of a view begin.

use visibility_core::View;
use visibility_core::glam::DVec3;

/// Returns a box in world space, as minimum and maximum corner, that contains the starts of all lines of
/// sight of a view. `anchor` is a point near the eye. `None` if the starts are unknown or not finite.
pub(crate) fn sight_start(view: &View, anchor: DVec3) -> Option<(DVec3, DVec3)> {
    let mut starts = Starts { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY, finite: true };
    let known = view.for_each_sight_start(anchor, |corners, error| starts.extend(corners, error));
    if known { starts.in_world(anchor) } else { None }
}

/// A box around starts of lines of sight, relative to an anchor. Inverted while it holds none.
struct Starts {
    low: DVec3,
    high: DVec3,
    /// Whether all starts and their errors are finite.
    finite: bool,
}

impl Starts {
    /// Extends the box by points that are off by at most `error` metres.
    fn extend(&mut self, points: &[DVec3], error: f64) {
        for point in points {
            self.finite &= point.is_finite() && error.is_finite();
            (self.low, self.high) = (self.low.min(*point - error), self.high.max(*point + error));
        }
    }

    /// Returns the box in world space, widened by the roundings of its corners here and in
    /// [`extend`](Self::extend). `anchor` is in world space.
    fn in_world(&self, anchor: DVec3) -> Option<(DVec3, DVec3)> {
        let (low, high) = (self.low, self.high);
        // Each of the two sums rounds by half a unit in the last place of its result. The margin is at least
        // one such unit of either result, and so is what the corner is moved by once that is rounded.
        let margin = (anchor.abs() + low.abs().max(high.abs())) * f64::EPSILON;
        let (low, high) = (low + anchor - margin, high + anchor + margin);
        (self.finite && low.cmple(high).all()).then_some((low, high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::geometry::Plane;
    use visibility_core::{Pose, View};
    use visibility_testing::{Random, sign_of_sum};

    /// Boxes in world space hold their points, exactly: also where the sums cross a power of two, where their
    /// roundings are largest beside the margin.
    #[test]
    fn starts_in_world_space_are_in_their_box() {
        let (mut random, mut beyond) = (Random(5), [0; 2]);
        for round in 0..40_000 {
            let power = f64::from(random.between(-9, 9)).exp2();
            let sign = if random.one_in(2) { -1.0 } else { 1.0 };
            let mut vector = |least: f64, most: f64| {
                DVec3::from_array([(); 3].map(|()| sign * power * random.fine_range(least, most)))
            };
            let (point, anchor) = match round % 4 {
                0 => (vector(1.0, 1.001), vector(-0.01, -0.002)),
                1 => (vector(-1.0, 1.0), vector(-1.0, 1.0)),
                2 => (vector(1.0, 2.0), DVec3::ZERO),
                _ => (vector(1.0, 2.0), vector(0.0, 1.0)),
            };
            let error = [0.0, 1e-9, 1e-3][random.below(3)] * power * random.fine_unit();
            let mut starts = Starts { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY, finite: true };
            starts.extend(&[point], error);
            // A box of which one end is much nearer to the anchor.
            if random.one_in(2) {
                starts.extend(&[DVec3::ZERO], 0.0);
            }
            let (low, high) = starts.in_world(anchor).unwrap();
            for axis in 0..3 {
                let sign = |end: f64, error: f64| {
                    let all = [point[axis], error, anchor[axis], -end];
                    sign_of_sum(all.map(|x| (x, 1.0)))
                };
                let is_in = sign(low[axis], -error) >= 0 && sign(high[axis], error) <= 0;
                assert!(is_in, "round {round}, axis {axis}: {point}, {error} and {anchor}: {low} to {high}");
                let [low, high] = [starts.low, starts.high].map(|end| (end + anchor)[axis]);
                beyond[0] += usize::from(sign(low, -error) < 0);
                beyond[1] += usize::from(sign(high, error) > 0);
            }
        }
        assert!(beyond.iter().all(|&count| count > 10_000), "{beyond:?} are beyond ends without a margin");
    }

    #[test]
    fn starts_that_are_not_finite_are_none() {
        let of = |points: &[DVec3], error: f64| {
            let mut starts = Starts { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY, finite: true };
            starts.extend(points, error);
            starts.in_world(DVec3::ZERO)
        };
        assert_eq!(of(&[DVec3::ZERO], 0.0), Some((DVec3::ZERO, DVec3::ZERO)), "one point");
        assert_eq!(of(&[], 0.0), None, "no point");
        for broken in [f64::NAN, f64::INFINITY] {
            assert_eq!(of(&[DVec3::ONE, DVec3::new(0.0, broken, 0.0)], 0.0), None, "a point at {broken}");
            assert_eq!(of(&[DVec3::ONE], broken), None, "an error of {broken}");
        }
    }

    #[test]
    fn starts_are_on_the_near_plane() {
        let eye = DVec3::new(100.0, 20.0, -3.0);
        let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.5, 100.0).unwrap();
        let (low, high) = sight_start(&view, eye).unwrap();
        let half = 0.5 * 0.5f64.tan();
        let expected = [eye + DVec3::new(0.5, -half, -half), eye + DVec3::new(0.5, half, half)];
        for (end, expected) in [low, high].into_iter().zip(expected) {
            assert!((end - expected).abs().max_element() < 1e-9, "{end} instead of {expected}");
        }
        // The corners may be off by the error that is told with them.
        let view_at_zero =
            View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.5, 9.0);
        let view_at_zero = view_at_zero.unwrap();
        let (low, high) = sight_start(&view_at_zero, DVec3::ZERO).unwrap();
        let known = view_at_zero.for_each_sight_start(DVec3::ZERO, |corners, error| {
            let is_in = |p: &DVec3| low.cmple(*p - error).all() && high.cmpge(*p + error).all();
            assert!(
                error > 1e-14 && corners.iter().all(is_in),
                "{corners:?}, off by {error}: {low} to {high}"
            );
        });
        assert!(known, "starts of an ordinary view");
        let through_eye = Plane::new(DVec3::Y, -eye.y);
        let view = view.with_clip_planes(&[through_eye]);
        assert_eq!(view.ok().and_then(|view| sight_start(&view, eye)), None, "a clip plane through the eye");
    }
}
