//! Where the edge of an occluder can appear, from every eye of a ball, and what that proves.
//!
//! # The rule
//! An occluder that is drawn for a ball of eyes covers the pixels that it covers from the middle of the ball,
//! except those at which one of its contour edges appears from some eye of the ball. Edges that two drawn
//! triangles share stay covered however far the eye moves, so a wall of many pieces is eroded along its
//! outline only. (Wonka, Wimmer and Schmalstieg, "Visibility Preprocessing with Occluder Fusion for Urban
//! Walkthroughs", 2000, shrink each occluder by the ball; Décoret, Debunne and Sillion, "Erosion Based
//! Visibility Preprocessing", 2003, erode what occluders cover together. Here the erosion is that of an
//! edge's parallax alone, at the distance of the edge, and none where a neighbour continues the surface.)
//!
//! # Why it is sound
//! Let `c` be the middle of the ball, `e` another eye of it, and `p` a point that is hidden from `c` by the
//! drawn triangles `T` of one mesh: the segment from `c` to `p` crosses `T` from the front. No triangle of
//! `T` comes as near to `c` as any point at which sight of an eye of the ball begins; so the segment from `c`
//! to `e` does not meet `T`. Move the end of a segment from `c` along the line from `e` to `p`. At `e` the
//! segment misses `T`, at `p` it crosses `T`. So somewhere on the way the moving end crosses `T`, from the
//! front since that is the side on which `c` lies, and `p` is hidden from `e`; or the moving segment, from
//! `c` to a point `q`, meets a contour edge of `T` in a point `s`. In the second case `q = k s` with `k >=
//! 1`, relative to `c`. The line through `e` and `q` has `p` beyond `q`, so from `a e` with some `a` between
//! 0 and 1, `p` appears in the picture of `c` where `q` does: `p` is in the direction of `k s - a e`, which
//! is that of `s - (a / k) e`. This is the direction in which `s` appears from the point `(a / k) e` of the
//! ball. So if no contour edge of `T` appears, from any point of the ball, where `p` appears from `c`, then
//! `p` is hidden from all eyes of the ball. (Directions are carried from one eye to another without turning
//! them.)
//!
//! # Where a point appears
//! Let `x` and `w` be the screen coordinates of a point from `c` and `X` and `W` the gradients of the two.
//! From `e` the point appears at the column `v = (x - X e) / (w - W e)`. The extreme columns over the ball of
//! radius `r` are those at which the plane `(x - v w) - (X - v W) e = 0` touches the ball:
//! `|x - v w| = r |X - v W|`, a quadratic equation in `v`. Its discriminant is written without cancellation.
//! An edge appears from each eye as a straight segment between places of its ends, so it stays in the convex
//! hull of the two rectangles in which its ends appear. All this needs `w` to be positive from all eyes;
//! geometry is cut at twice the radius.

use crate::setup::screen_projection::{ObjectProjection, ScreenProjection};
use visibility_core::glam::DVec3;

/// Relative margin for rounding. The columns of a point nearer than the square root of two times the radius
/// are not used, so the leading coefficient of the quadratic equation is at least half of `w^2`, and nothing
/// cancels.
const ROUNDING: f64 = 1e-9;

/// The ball of eyes, as the projection of its middle sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parallax {
    radius: f64,
    /// Greatest change of `w` between the middle of the ball and another eye.
    change_of_w: f64,
    /// Gradients of `x`, `y` and `w` (see [`ScreenProjection`]).
    gradients: [DVec3; 3],
}

/// Range of columns, then of rows, in pixels, in which a point appears from the eyes of a ball.
pub(crate) type Places = [f64; 4];

impl Parallax {
    /// Returns the parallax for a perspective projection from the middle of a ball of the given radius in
    /// metres.
    pub(crate) fn new(projection: &ScreenProjection, radius: f64) -> Self {
        let [x, y, w, _] = projection.rows;
        let (radius, gradients) = (radius * (1.0 + ROUNDING), [x, y, w].map(|row| DVec3::from(row.linear)));
        Self { radius, change_of_w: radius * gradients[2].length() * (1.0 + ROUNDING), gradients }
    }

    /// Returns where a point appears, given by its `x`, `y` and `w` from the middle of the ball and by bounds
    /// on the errors of these. The ranges are unbounded for a point nearer to the middle's plane than the
    /// square root of two times the radius, or that may be nearer than the eyes of the ball.
    ///
    /// From an eye at which the computed `x` and `w` are `X` and `W`, the exact ones appear at `(X + dx) / (W
    /// + dw)`. That is `(dx - v dw) / (W + dw)` beside `v = X / W`. The eye may be another than the middle,
    /// and `v` far from the place that the middle sees.
    pub(crate) fn places(&self, [x, y, w]: [f64; 3], [x_error, y_error, w_error]: [f64; 3]) -> Places {
        let [of_x, of_y, of_w] = self.gradients;
        let squared = self.radius * self.radius;
        let leading = w * w - squared * of_w.length_squared();
        let nearest = w - self.change_of_w - w_error;
        if !(leading >= 0.5 * w * w && nearest > 0.0) {
            return [f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY];
        }
        let range = |value: f64, gradient: DVec3, error: f64| {
            let middle = value * w - squared * gradient.dot(of_w);
            let crossed = gradient.cross(of_w).length_squared();
            let quarter = (gradient * w - of_w * value).length_squared() - squared * crossed;
            let half = self.radius * visibility_core::geometry::sqrt(quarter.max(0.0));
            let farthest = (middle.abs() + half) / leading;
            let margin = ROUNDING * (value.abs() * w + half) / leading
                + (1.0 + ROUNDING) * (error + farthest * w_error) / nearest;
            [(middle - half) / leading - margin, (middle + half) / leading + margin]
        };
        let ([left, right], [above, below]) = (range(x, of_x, x_error), range(y, of_y, y_error));
        [left, right, above, below]
    }

    /// Returns the zone in which an edge of an object appears, given by its ends in homogeneous screen
    /// coordinates.
    pub(crate) fn zone(&self, object: &ObjectProjection, a: &[f64; 5], b: &[f64; 5]) -> EdgeZone {
        let [x, y, w, ..] = object.error;
        EdgeZone { ends: [a, b].map(|end| self.places([end[0], end[1], end[2]], [x, y, w])) }
    }
}

/// The zone of the picture in which an edge can appear: the convex hull of two rectangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeZone {
    pub(crate) ends: [Places; 2],
}

impl EdgeZone {
    /// Returns the bounds of the zone: least and greatest column, least and greatest row.
    pub(crate) fn bounds(&self) -> Places {
        let [a, b] = self.ends;
        [a[0].min(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].max(b[3])]
    }

    /// Returns the least and the greatest column of the zone between the rows `top` and `bottom`, all in
    /// pixels. `None` if the zone does not reach these rows.
    pub(crate) fn columns(&self, top: f64, bottom: f64) -> Option<[f64; 2]> {
        let [a, b] = self.ends;
        if !(a.iter().chain(&b).all(|place| place.is_finite())) {
            return Some([f64::NEG_INFINITY, f64::INFINITY]);
        }
        // The hull is the union of rectangles whose sides go linearly from those at one end to those at the
        // other. The share `t` of the way at which a rectangle meets the rows is an interval.
        let mut share = [0.0f64, 1.0];
        for (at_a, at_b) in [(bottom - a[2], bottom - b[2]), (a[3] - top, b[3] - top)] {
            if at_a < 0.0 && at_b < 0.0 {
                return None;
            }
            let crossing = at_a / (at_a - at_b);
            if at_a < 0.0 {
                share[0] = share[0].max(crossing - ROUNDING);
            } else if at_b < 0.0 {
                share[1] = share[1].min(crossing + ROUNDING);
            }
        }
        if share[0] > share[1] {
            return None;
        }
        let at = |side: usize| share.map(|t| a[side] + (b[side] - a[side]) * t.clamp(0.0, 1.0));
        let ([p, q], [r, s]) = (at(0), at(1));
        Some([p.min(q), r.max(s)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::random;
    use visibility_core::{Pose, View};

    /// Points appear, from every eye of a ball, within the places that are computed for them, whichever way
    /// their coordinates are off by their errors. These are made large here.
    #[test]
    fn points_appear_in_their_places_if_their_coordinates_are_off() {
        let mut random = random(17);
        let (mut bounded, mut beyond) = (0, 0);
        for trial in 0..4_000 {
            let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
            let view = View::perspective(pose, random(0.1, 2.0), 16.0 / 9.0, 0.1, 100.0).unwrap();
            let projection = ScreenProjection::new(&view, DVec3::ZERO, [640, 360], [640, 360]);
            let parallax = Parallax::new(&projection, random(0.0, 0.5));
            let [x, y, w] = [random(-1000.0, 1000.0), random(-1000.0, 1000.0), random(0.9, 2.0)];
            let errors = [random(0.0, 0.5), random(0.0, 0.5), random(0.0, 2e-3)];
            let places = parallax.places([x, y, w], errors);
            let exact = parallax.places([x, y, w], [0.0; 3]);
            if !places.iter().all(|place| place.is_finite()) {
                continue;
            }
            bounded += 1;
            for case in 0..64 {
                let [dx, dy, dw] = [0, 1, 2].map(|i| if case >> i & 1 == 0 { errors[i] } else { -errors[i] });
                // The eye for which the point is farthest to one side, or any eye on the ball.
                let [of_x, _, of_w] = parallax.gradients;
                let any = DVec3::new(random(-1.0, 1.0), random(-1.0, 1.0), random(-1.0, 1.0));
                let farthest = of_x - of_w * exact[case >> 3 & 1];
                let eye = [any, farthest, -farthest][case % 3].normalize() * parallax.radius;
                let [of_x, of_y, of_w] = parallax.gradients.map(|gradient| gradient.dot(eye));
                let w = w + dw - of_w;
                let (column, row) = ((x + dx - of_x) / w, (y + dy - of_y) / w);
                let [left, right, above, below] = places;
                let is_in = left <= column && column <= right && above <= row && row <= below;
                assert!(is_in, "trial {trial}, case {case}: {column}, {row} in {places:?}");
                beyond += u32::from(column < exact[0] || column > exact[1]);
            }
        }
        assert!(bounded > 2_000 && beyond > 10_000, "{bounded} {beyond}: too few to show the errors");
    }

    /// Places of points without errors hold the columns and rows at which eyes of the ball see them, in
    /// double-double arithmetic. Balls down to no radius leave no room beside the margin for rounding.
    #[test]
    fn points_appear_in_their_places_to_the_last_digit() {
        use visibility_core::geometry::DoubleDouble;
        let mut random = random(18);
        let (pose, mut beside) = (Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 0);
        let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, 100.0).unwrap();
        let projection = ScreenProjection::new(&view, DVec3::ZERO, [640, 360], [640, 360]);
        let exact = |row: DVec3, eye: DVec3, value: f64, error: f64| {
            let terms = row.to_array().into_iter().zip(eye.to_array());
            let sum = DoubleDouble::sum(value, error);
            terms.fold(sum, |sum, (a, b)| sum.plus(DoubleDouble::product(-a, b)))
        };
        for trial in 0..10_000 {
            let parallax = Parallax::new(&projection, [0.0, 1e-9, 1e-3, 0.5][trial % 4]);
            let value = if trial % 3 == 0 { 0.0 } else { random(-1000.0, 1000.0) };
            let (w, error) = (random(0.9, 2.0), if trial % 2 == 0 { random(0.0, 0.5) } else { 0.0 });
            let [left, right, ..] = parallax.places([value, 0.0, w], [error, 0.0, 0.0]);
            let [of_x, _, of_w] = parallax.gradients;
            for (side, sign) in [(left, -1.0), (right, 1.0)] {
                // The eye for which the point is farthest to this side, not farther away than the radius.
                let eye = (of_x - of_w * side).normalize() * (-sign * parallax.radius * (1.0 - 2e-9));
                let (x, w) = (exact(of_x, eye, value, sign * error), exact(of_w, eye, w, 0.0));
                let over = x.plus(w.times((-side).into())).hi * sign;
                assert!(over <= 0.0, "trial {trial}: {over} beyond {side}");
                beside += u32::from(over > -1e-5);
            }
        }
        assert!(beside > 10_000, "{beside} sides are close");
    }

    /// Places are bounded from the square root of two times the radius on, and not if the point may be as
    /// near as an eye of the ball.
    #[test]
    fn points_that_may_be_too_near_appear_anywhere() {
        let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 9.0);
        let projection = ScreenProjection::new(&view.unwrap(), DVec3::ZERO, [64, 64], [64, 64]);
        let parallax = Parallax::new(&projection, 1.0);
        let w = parallax.gradients[2].length();
        for (distance, error, bounded) in
            [(1.41, 0.0, false), (1.42, 0.0, true), (2.0, 0.9, true), (2.0, 1.1, false), (-2.0, 0.0, false)]
        {
            let places = parallax.places([0.0, 0.0, distance * w], [0.0, 0.0, error * w]);
            assert_eq!(places.map(f64::is_finite), [bounded; 4], "{distance} m away, {error} m off");
        }
    }
}
