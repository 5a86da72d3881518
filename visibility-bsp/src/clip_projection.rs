//! The camera as object space needs it: directions from the eye with bounds on their rounding, and planes
//! through the eye.
//!
//! # Directions
//! A point `p` of the scene becomes the three numbers `(x, y, w)` of clip space, linear in `p`. Up to a
//! positive factor they name the line of sight through `p`, for perspective and parallel views alike: a plane
//! through the eye (or along the direction of sight) is one linear function of them, and the convex hull of
//! points spans the cone of sight of their hull. So the tests below need no eye, only the matrix that the
//! engine draws with, and a shadow frustum of a parallel view, a prism, is no special case.
//!
//! # Bounds
//! Every direction is scaled so that its largest number is 1, and carries `error`, a bound on how far any of
//! its numbers is off. The bounds are relative, so they hold at any magnitude; what underflows loses at most
//! the least normal number, which is added.

use visibility_core::glam::{BVec3, DMat3, DVec3};
use visibility_core::view::{ClipRow, ViewProjection};
use visibility_core::{Aabb, View, view::Eye};

/// Unit round-off of `f64`.
pub(crate) const U: f64 = f64::EPSILON / 2.0;

/// Maximum error of a direction or a plane, relative to its largest number; those with more are not used.
const TOO_WRONG: f64 = 1.0 / (1u64 << 24) as f64;

/// A line of sight, its largest number 1 in magnitude.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Direction {
    pub(crate) v: [f64; 3],
    pub(crate) error: f64,
    /// What clip-space x, y and w of the point were divided by.
    pub(crate) size: f64,
}

/// A plane through the eye: `n . v` is positive on the inner side, and its sign is certain for an exact
/// direction of numbers up to 1 where it is beyond `slack`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) n: [f64; 3],
    pub(crate) slack: f64,
}

/// `n . v` of a direction that is off by `error` is off by at most `slack` of the line and this: three
/// numbers of at most 1 times it, and a little for the error's own rounding and its product with that of the
/// line.
pub(crate) fn slack_of(error: f64) -> f64 {
    3.125 * error
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Line {
    /// The plane through the eye and two lines of sight, if they are far enough apart to tell it.
    pub(crate) fn through(a: &Direction, b: &Direction) -> Option<Self> {
        let (p, q) = (a.v, b.v);
        let n = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
        // Each number: two products of factors up to 1, off by the errors of both, and three roundings of
        // numbers up to 2.
        let error = 2.0 * (a.error + b.error) + 8.0 * U;
        Self::scaled(n, error)
    }

    fn scaled(n: [f64; 3], error: f64) -> Option<Self> {
        let size = n[0].abs().max(n[1].abs()).max(n[2].abs());
        let error = error / size + 2.0 * U;
        // Also refuses NaN. `n . v` itself: three products and two sums of numbers up to 3.
        (error < TOO_WRONG).then(|| Self { n: n.map(|x| x / size), slack: slack_of(error) + 16.0 * U })
    }

    pub(crate) fn flipped(&self) -> Self {
        Self { n: self.n.map(|x| -x), ..*self }
    }

    pub(crate) fn at(&self, v: [f64; 3]) -> f64 {
        dot(self.n, v)
    }
}

/// The corners of a box.
pub(crate) fn corners_of([min, max]: [DVec3; 2]) -> impl Iterator<Item = DVec3> {
    (0..8).map(move |i| DVec3::select(BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), max, min))
}

/// A box as seen: the direction of its least corner, what its sides add to that, and a bound on the error of
/// `n . v` for any corner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoxProjection {
    pub(crate) base: [f64; 3],
    pub(crate) sides: [[f64; 3]; 3],
    pub(crate) slack: f64,
}

impl BoxProjection {
    /// The least and greatest `n . v` over the box.
    #[inline]
    pub(crate) fn span(&self, n: [f64; 3]) -> (f64, f64) {
        let base = dot(n, self.base);
        let [x, y, z] = [dot(n, self.sides[0]), dot(n, self.sides[1]), dot(n, self.sides[2])];
        (base + x.min(0.0) + y.min(0.0) + z.min(0.0), base + x.max(0.0) + y.max(0.0) + z.max(0.0))
    }

    /// A corner, numbered as [`Aabb::corners`] does.
    pub(crate) fn corner(&self, number: usize) -> [f64; 3] {
        let mut v = self.base;
        for (axis, side) in self.sides.iter().enumerate() {
            if number >> axis & 1 != 0 {
                v = [v[0] + side[0], v[1] + side[1], v[2] + side[2]];
            }
        }
        v
    }
}

/// A view for one frame: its clip-space rows relative to an anchor, with bounds on their rounding.
#[derive(Clone, Debug)]
pub(crate) struct ClipProjection {
    rows: [ClipRow; 3],
    /// Positive beyond the near plane.
    near: ClipRow,
    /// The point that rows are relative to, in scene coordinates: the eye of a perspective view.
    anchor: DVec3,
    pub(crate) eye: Eye,
    /// Bound on the distance of the true eye from `eye` in metres; for parallel views on the error of the
    /// unit direction.
    pub(crate) eye_error: f64,
    /// From clip-space x, y and w to directions in space, for perspective views.
    back: DMat3,
    /// Bounds on the numbers that `back` makes of a direction, and on their error.
    back_size: f64,
    back_error: f64,
    /// The sign of the determinant of three points' directions where that of the points, seen from the eye,
    /// is positive.
    turn: f64,
}

impl ClipProjection {
    /// A view in which nothing is hidden.
    pub(crate) const BLIND: Self = Self {
        rows: [ClipRow { linear: DVec3::ZERO, constant: 0.0, error: 0.0 }; 3],
        near: ClipRow { linear: DVec3::ZERO, constant: 0.0, error: 0.0 },
        anchor: DVec3::ZERO,
        eye: Eye::Point(DVec3::ZERO),
        eye_error: f64::INFINITY,
        back: DMat3::ZERO,
        back_size: 0.0,
        back_error: f64::INFINITY,
        turn: 0.0,
    };

    /// The projection of a view for points relative to `origin`.
    pub(crate) fn new(view: &View, origin: DVec3) -> Self {
        let projection = ViewProjection::new(view, origin);
        let rows = [projection.x(), projection.y(), projection.w()];
        let (near, anchor, turn) = (projection.near(), projection.anchor(), projection.orientation());
        let (eye, eye_error) = (projection.eye(), projection.eye_error());
        let forth = DMat3::from_cols(rows[0].linear, rows[1].linear, rows[2].linear).transpose();
        let back = if let Eye::Point(_) = eye { forth.inverse() } else { DMat3::ZERO };
        let (back_size, back_error) = wrong_by(forth, back);
        Self { rows, near, anchor, eye, eye_error, back, back_size, back_error, turn }
    }

    /// The line of sight through a point; none if it is too close to the eye to tell.
    pub(crate) fn direction(&self, p: DVec3) -> Option<Direction> {
        let q = p - self.anchor;
        let [(x, ex), (y, ey), (w, ew)] = [self.rows[0].at(q), self.rows[1].at(q), self.rows[2].at(q)];
        let size = x.abs().max(y.abs()).max(w.abs());
        let error = ex.max(ey).max(ew) / size + 2.0 * U;
        (error < TOO_WRONG).then(|| Direction { v: [x / size, y / size, w / size], error, size })
    }

    /// Clip-space x, y and w of a point.
    pub(crate) fn values(&self, p: DVec3) -> [f64; 3] {
        let q = p - self.anchor;
        self.rows.map(|row| row.linear.dot(q) + row.constant)
    }

    /// Lengths of the rows of x and y: clip-space units per metre.
    pub(crate) fn scale(&self) -> [f64; 2] {
        [self.rows[0].linear.length(), self.rows[1].linear.length()]
    }

    /// Value of the near plane's row at a point, positive beyond the plane, and the bound on its error.
    pub(crate) fn beyond_near(&self, p: DVec3) -> (f64, f64) {
        self.near.at(p - self.anchor)
    }

    /// Whether a box lies surely beyond the near plane.
    pub(crate) fn is_beyond_near(&self, bounds: &Aabb) -> bool {
        let (min, max) = (bounds.min.as_dvec3() - self.anchor, bounds.max.as_dvec3() - self.anchor);
        let nearest = DVec3::select(self.near.linear.cmpge(DVec3::ZERO), min, max);
        let (value, error) = self.near.at(nearest);
        value > error
    }

    /// Projects a box; `None` if rounding leaves its directions too uncertain.
    pub(crate) fn cone(&self, bounds: &Aabb) -> Option<BoxProjection> {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (q, size) = (min - self.anchor, max - min);
        // Each corner is a value at the least corner and up to three products, summed: any term passes at
        // most eight roundings.
        let reach = q.abs() + size;
        let (mut base, mut sides, mut error) = ([0.0; 3], [[0.0; 3]; 3], 0.0f64);
        let mut largest = 0.0f64;
        for i in 0..3 {
            let row = &self.rows[i];
            let l = row.linear;
            base[i] = l.x * q.x + l.y * q.y + l.z * q.z + row.constant;
            sides[0][i] = l.x * size.x;
            sides[1][i] = l.y * size.y;
            sides[2][i] = l.z * size.z;
            let sum = l.x.abs() * reach.x + l.y.abs() * reach.y + l.z.abs() * reach.z + row.constant.abs();
            error = error.max(16.0 * U * sum + row.error);
            // Larger than any corner.
            largest = largest.max(sum);
        }
        let error = error / largest + 2.0 * U;
        let scale = 1.0 / largest;
        let scaled = |v: [f64; 3]| [v[0] * scale, v[1] * scale, v[2] * scale];
        // Spans add up four numbers instead of one: a few roundings more.
        let slack = slack_of(error) + 32.0 * U;
        (error < TOO_WRONG).then(|| BoxProjection { base: scaled(base), sides: sides.map(scaled), slack })
    }

    /// How far from the eye something in view can be and yet be before the near plane, in metres; infinite
    /// for parallel views.
    pub(crate) fn clearance(&self) -> f64 {
        let Eye::Point(eye) = self.eye else { return f64::INFINITY };
        // The distance grows towards the corners of the picture. Rounding is far below the tenth that is
        // added.
        let (at_eye, _) = self.near.at(eye - self.anchor);
        let mut farthest = 0.0f64;
        for corner in [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]] {
            let along = self.in_space([corner[0], corner[1], 1.0]);
            let reached = -at_eye / self.near.linear.dot(along) * along.length();
            // Where that is no place before the eye, nothing is known.
            farthest =
                if reached >= 0.0 && farthest.is_finite() { farthest.max(reached) } else { f64::INFINITY };
        }
        1.1 * farthest
    }

    /// Whether the eye is outside of a box, and all of the box that is in the picture surely beyond the near
    /// plane; `clear` is the clearance.
    pub(crate) fn is_outside(&self, &[min, max]: &[DVec3; 2], clear: f64) -> bool {
        match self.eye {
            Eye::Point(eye) => {
                let away = (min - eye).max(eye - max).max(DVec3::ZERO);
                // Rounding takes four units of the distance, which the clearance has to spare; NaN is not
                // outside.
                away.length() > clear.max(f64::MIN_POSITIVE) + 4.0 * self.eye_error
            }
            Eye::Direction(_) => corners_of([min, max]).all(|p| {
                let (value, error) = self.beyond_near(p);
                value > error
            }),
        }
    }

    /// 1 or -1: the sign of the determinant of the directions of three points whose normal points away from
    /// the eye; 0 if unknown.
    pub(crate) fn turn(&self) -> f64 {
        self.turn
    }

    /// The direction in space of a line of sight, of any length; for perspective views.
    pub(crate) fn in_space(&self, v: [f64; 3]) -> DVec3 {
        self.back * DVec3::from_array(v)
    }

    /// A plane as directions meet it: how far before it the eye is, and how fast a direction comes nearer to
    /// it, as a function of the direction. None for parallel views.
    pub(crate) fn approach(&self, normal: DVec3, offset: f64) -> Option<Approach> {
        let Eye::Point(eye) = self.eye else { return None };
        let [x, y, z] = [self.back.x_axis, self.back.y_axis, self.back.z_axis];
        let height = normal.dot(eye) + offset;
        let size = normal.abs().dot(eye.abs()) + offset.abs();
        let height_error = 8.0 * U * size + 2.0 * self.eye_error;
        Some(Approach { height, height_error, speed: [-normal.dot(x), -normal.dot(y), -normal.dot(z)] })
    }

    /// Whether of all directions of a convex part, given by its corners, each comes through one plane before
    /// it comes to another.
    ///
    /// At direction `v` a plane is met after `height / speed . v`; the first is met earlier if `height'
    /// (speed . v) > height (speed' . v)`, which is linear in `v`, so that the corners decide. The second
    /// plane is surely met by the directions that count, from before: `speed' . v > 0`; then the first one
    /// is, too. Heights are off by `height_error`; `speed . v` for unit normals by no more than three times
    /// the error of the direction taken back, and what that of `v` makes of it.
    pub(crate) fn is_met_first(
        &self,
        first: &Approach,
        second: &Approach,
        part: &[[f64; 3]],
        error: f64,
    ) -> bool {
        if !(second.height > second.height_error && first.height > first.height_error) {
            return false;
        }
        let size = 3.0 * self.back_size;
        let slow = 3.0 * (self.back_error + self.back_size * (error + 16.0 * U));
        let slack = 2.0
            * ((first.height + second.height) * slow
                + (first.height_error + second.height_error) * (size + slow));
        let (a, b) = (second.height, first.height);
        let speed = [0, 1, 2].map(|i| a * first.speed[i] - b * second.speed[i]);
        part.iter().all(|&v| dot(speed, v) > slack)
    }

    /// Whether the eye is surely on the side of a plane that its unit normal points to.
    pub(crate) fn is_before(&self, normal: DVec3, offset: f64) -> bool {
        match self.eye {
            Eye::Point(eye) => {
                let distance = normal.dot(eye) + offset;
                let size = normal.abs().dot(eye.abs()) + offset.abs();
                distance > 8.0 * U * size + 2.0 * self.eye_error + f64::MIN_POSITIVE
            }
            Eye::Direction(along) => normal.dot(along) < -(8.0 * U + 2.0 * self.eye_error),
        }
    }
}

/// A plane as a function of the direction: the eye's distance from it in metres, a bound on the error of
/// that, and the speed `speed . v` at which direction `v` approaches it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Approach {
    height: f64,
    height_error: f64,
    speed: [f64; 3],
}

/// Bounds on the numbers that an inverse makes of a direction, and on their error.
///
/// `back . forth` is `1 + R`; so what it makes of a direction is off by at most `R` times the truth. `R` is
/// computed with three products and sums, and a difference.
fn wrong_by(forth: DMat3, back: DMat3) -> (f64, f64) {
    let (mut size, mut residue) = (0.0f64, 0.0f64);
    for row in 0..3 {
        let b = back.row(row).abs();
        size = size.max(b.x + b.y + b.z);
        let mut sum = 0.0;
        for column in 0..3 {
            let (r, c) = (back.row(row), forth.col(column));
            let one = if row == column { 1.0 } else { 0.0 };
            sum += (r.dot(c) - one).abs() + 8.0 * U * (r.abs().dot(c.abs()) + one);
        }
        residue = residue.max(sum);
    }
    // The true one is at most size / (1 - R).
    if residue < 0.5 { (2.0 * size, 2.0 * size * residue) } else { (size, f64::INFINITY) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whole numbers from -2^bits to 2^bits.
    struct Whole(u64);

    impl Whole {
        fn next(&mut self, bits: u32) -> i64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> (63 - bits)) as i64 - (1 << bits)
        }
    }

    fn determinant(a: [i64; 3], b: [i64; 3], c: [i64; 3]) -> i128 {
        let [a, b, c] = [a, b, c].map(|v| v.map(i128::from));
        (a[1] * b[2] - a[2] * b[1]) * c[0]
            + (a[2] * b[0] - a[0] * b[2]) * c[1]
            + (a[0] * b[1] - a[1] * b[0]) * c[2]
    }

    /// Directions in units of 2^-40, close together, so that products are rounded and 128 bits hold their
    /// determinants.
    #[test]
    fn planes_through_close_directions_tell_sides_only_where_they_exactly_are() {
        let mut whole = Whole(5);
        let unit = (1i64 << 40) as f64;
        let direction = |v: [i64; 3]| Direction { v: v.map(|x| x as f64 / unit), error: 0.0, size: 1.0 };
        let mut decided = 0;
        for round in 0..100_000 {
            let a = [whole.next(39), whole.next(39), 1 << 40];
            let step = [whole.next(28), whole.next(28)];
            let b = [a[0] + step[0], a[1] + step[1], a[2]];
            let times = whole.next(6);
            // In the plane, or a little beside it.
            let aside = if round % 2 == 0 { 0 } else { whole.next(round % 12) };
            let c = [a[0] + times * step[0] + aside, a[1] + times * step[1], a[2]];
            let Some(line) = Line::through(&direction(a), &direction(b)) else { continue };
            let at = line.at(direction(c).v);
            if at.abs() > line.slack {
                decided += 1;
                assert_eq!(at.signum() as i128, determinant(a, b, c).signum(), "{a:?} {b:?} {c:?}");
            }
        }
        assert!(decided > 10_000, "{decided}");
    }

    /// Eyes within a few units of the last place of a plane.
    #[test]
    fn an_eye_is_before_a_plane_only_if_it_exactly_is() {
        let mut whole = Whole(6);
        let mut before = 0;
        for round in 0..100_000 {
            let (n, p) = ([(); 3].map(|()| whole.next(50)), [(); 3].map(|()| whole.next(23)));
            let [normal, eye] = [n, p].map(|v| DVec3::from_array(v.map(|x| x as f64)));
            let offset = -normal.dot(eye) * (1.0 + f64::from(round % 64 - 32) * U);
            let view = ClipProjection { eye: Eye::Point(eye), eye_error: 0.0, ..ClipProjection::BLIND };
            let exact = (0..3).map(|i| i128::from(n[i]) * i128::from(p[i])).sum::<i128>() + offset as i128;
            if view.is_before(normal, offset) {
                before += 1;
                assert!(exact > 0, "{eye} is {exact} before {normal} {offset}");
            }
        }
        assert!(before > 5000, "{before}");
    }
}
