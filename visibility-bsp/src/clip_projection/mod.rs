//! Projection of scene points to homogeneous view-ray directions with bounds on their rounding errors, and
//! planes through the eye.
//!
//! # Directions
//! A point `p` of the scene is mapped to the three numbers `(x, y, w)` of clip space, which are linear in
//! `p`. Up to a positive factor they identify the view ray through `p`, for perspective and parallel views
//! alike. A plane through the eye (for a parallel view: parallel to the view direction) is one linear
//! function of `(x, y, w)`. The convex cone of the directions of several points contains the directions of
//! their convex hull. So the tests below need no eye position, only the matrix that the engine draws with.
//! The shadow frustum of a parallel view, a prism, is no special case.
//!
//! # Bounds
//! Every direction is scaled so that its largest component is 1 in magnitude, and carries `error`, an
//! absolute bound on the error of each component. The bounds are therefore relative and hold at any magnitude
//! of coordinates. A component that underflows loses at most the least normal number, which is added to the
//! bound.

use visibility_core::glam::{BVec3, DMat3, DVec3};
use visibility_core::view::{ClipRow, ViewProjection};
use visibility_core::{Aabb, View, view::Eye};

/// Unit round-off of `f64`: 2^-53, half of `f64::EPSILON`.
pub(crate) const U: f64 = f64::EPSILON / 2.0;

/// Maximum absolute error of a component of a direction or plane whose largest component is 1. A direction or
/// plane with a larger error is not used: the function that would make it returns `None`.
const MAX_RELATIVE_ERROR: f64 = 1.0 / (1u64 << 24) as f64;

/// The view ray through a point as homogeneous clip-space `(x, y, w)`, scaled so that the largest component
/// is 1 in magnitude.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Direction {
    /// Clip-space x, y and w of the point, divided by `size`.
    pub(crate) v: [f64; 3],
    /// Bound on the absolute error of each component of `v`.
    pub(crate) error: f64,
    /// Largest magnitude among the point's clip-space x, y and w, by which these were divided to make `v`.
    pub(crate) size: f64,
}

/// A plane through the eye, seen as a line in the image: the linear function `n . v` of clip-space directions
/// `v = (x, y, w)`. The inner side of the plane is the side on which `n . v` is positive. For an exact
/// direction with components up to 1, the sign is certain if the magnitude of the value exceeds `slack`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    /// Coefficients of x, y and w, the largest 1 in magnitude.
    pub(crate) n: [f64; 3],
    /// Bound on the absolute error of `n . v` (no unit) for an exact direction `v` with components up to 1.
    pub(crate) slack: f64,
}

/// Returns a bound on the absolute error of `n . v` for a direction `v` whose components are each off by up
/// to `error`, and line coefficients `n` of at most 1 in magnitude.
pub(crate) fn slack_of(error: f64) -> f64 {
    // Three components with coefficients of at most 1 give `3 error`. The remaining eighth covers the
    // rounding of `error` and its product with the error of the line.
    3.125 * error
}

/// Returns the dot product of `a` and `b`, each product and sum rounded on its own.
pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Line {
    /// Returns the plane through the eye and two view rays, positive on the side of directions `c` for which
    /// `det(a, b, c) > 0`. `None` if the rays are too close together to determine the plane.
    pub(crate) fn through(a: &Direction, b: &Direction) -> Option<Self> {
        let (p, q) = (a.v, b.v);
        let n = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
        // Each component of the cross product: two products of factors up to 1, off by the errors of both
        // directions, and roundings of `4 U`. The quotients and `n . v` are rounded by `11 U` in sum, which
        // is up to `22 U / size`. Of the `37 U / size` of the slack, these take `34 U / size`.
        let size = n[0].abs().max(n[1].abs()).max(n[2].abs());
        let error = (2.0 * (a.error + b.error) + 12.0 * U) / size;
        // The comparison also refuses NaN.
        (error < MAX_RELATIVE_ERROR).then(|| Self { n: n.map(|x| x / size), slack: slack_of(error) })
    }

    /// Returns this line's plane, the plane through the eye that projects to the line, with its inner and
    /// outer sides exchanged.
    pub(crate) fn flipped(&self) -> Self {
        Self { n: self.n.map(|x| -x), ..*self }
    }

    /// Returns `n . v` at clip-space direction `v`, positive on the inner side. The sign is certain only if
    /// the magnitude exceeds `slack` plus the effect of the direction's own error.
    pub(crate) fn at(&self, v: [f64; 3]) -> f64 {
        dot(self.n, v)
    }
}

/// Returns the eight corners of the box from `min` to `max`, in the same space, in order of their numbers:
/// bits 0, 1 and 2 of a number choose max x, y and z.
pub(crate) fn corners_of([min, max]: [DVec3; 2]) -> impl Iterator<Item = DVec3> {
    (0..8).map(move |i| DVec3::select(BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), max, min))
}

/// A projected box: the clip-space direction of its minimum corner and what each of its three edges adds to
/// that direction, all scaled by one factor so that no corner has a component above 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoxProjection {
    /// Clip-space x, y and w of the box's minimum corner, times the common scale.
    pub(crate) base: [f64; 3],
    /// Change of clip-space x, y and w along each of the box's edges in x, y and z, times the common scale:
    /// `sides[axis][value]`.
    pub(crate) sides: [[f64; 3]; 3],
    /// Bound on the absolute error of `n . v` for the clip-space direction `v` of any corner and any line
    /// coefficients `n` of at most 1 in magnitude.
    pub(crate) slack: f64,
}

impl BoxProjection {
    /// Returns the least and the greatest value of `n . v` over the corners `v` of the projected box, for the
    /// coefficients `n` of a line. Each is off by at most `slack` of this box plus `slack` of the line.
    #[inline]
    pub(crate) fn span(&self, n: [f64; 3]) -> (f64, f64) {
        let base = dot(n, self.base);
        let [x, y, z] = [dot(n, self.sides[0]), dot(n, self.sides[1]), dot(n, self.sides[2])];
        (base + x.min(0.0) + y.min(0.0) + z.min(0.0), base + x.max(0.0) + y.max(0.0) + z.max(0.0))
    }

    /// Returns the clip-space direction of a corner, numbered as in [`Aabb::corners`]: bits 0, 1 and 2 choose
    /// max x, y and z.
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

/// The projection of one frame's view: clip-space rows as linear functions of points in metres relative to an
/// anchor, with bounds on their rounding errors.
#[derive(Clone, Debug)]
pub(crate) struct ClipProjection {
    /// Clip-space x, y and w as linear functions of a point relative to `anchor`.
    rows: [ClipRow; 3],
    /// Linear function of a point relative to `anchor` that is positive beyond the near plane and 0 on it;
    /// its scale has no meaning.
    near: ClipRow,
    /// Origin of the points that `rows` and `near` are applied to, in metres relative to `Scene::origin`: the
    /// eye of a perspective view, the view's own origin for a parallel view.
    anchor: DVec3,
    /// The eye point in metres relative to `Scene::origin`, or the unit view direction of a parallel view.
    pub(crate) eye: Eye,
    /// Bound on the distance in metres of the exact eye from `eye`. For a parallel view, bound on the length
    /// of the error of the unit direction.
    pub(crate) eye_error: f64,
    /// Matrix from a clip-space direction `(x, y, w)` to a direction along the scene's axes, in metres: the
    /// inverse of the linear parts of `rows`. Zero for parallel views.
    back: DMat3,
    /// Bound on the magnitude of each component of `back * v` in metres, for directions `v` with components
    /// up to 1.
    back_size: f64,
    /// Bound in metres on the absolute error of each component of `back * v`, for exact `v` with components
    /// up to 1.
    back_error: f64,
    /// Sign of the determinant of the clip-space directions of a triangle's three corners, if the triangle's
    /// normal points away from the eye: 1, or -1 for a mirrored camera. Tells on which side of a polygon's
    /// projected edges its shadow lies. 0 if rounding leaves the sign unknown.
    pub(crate) turn: f64,
}

impl ClipProjection {
    /// A projection in which every test is undecided, so that nothing is hidden. Used before the first frame.
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

    /// Builds the projection of `view` for points relative to `origin` (world coordinates, usually the
    /// scene's origin).
    pub(crate) fn new(view: &View, origin: DVec3) -> Self {
        let projection = ViewProjection::new(view, origin);
        let rows = [projection.x(), projection.y(), projection.w()];
        let (near, anchor, turn) = (projection.near(), projection.anchor(), projection.orientation());
        let (eye, eye_error) = (projection.eye(), projection.eye_error());
        let forth = DMat3::from_cols(rows[0].linear, rows[1].linear, rows[2].linear).transpose();
        let back = if let Eye::Point(_) = eye { forth.inverse() } else { DMat3::ZERO };
        let (back_size, back_error) = inverse_error_bounds(forth, back);
        Self { rows, near, anchor, eye, eye_error, back, back_size, back_error, turn }
    }

    /// Returns the view ray through a point in metres relative to `Scene::origin`, each coordinate of which
    /// may be off by `placing_error` metres. `None` if the point is so close to the eye that rounding leaves
    /// the direction undetermined, or is NaN.
    pub(crate) fn direction(&self, p: DVec3, placing_error: f64) -> Option<Direction> {
        let q = p - self.anchor;
        let [(x, ex), (y, ey), (w, ew)] = self.rows.map(|row| placed_at(&row, q, placing_error));
        let size = x.abs().max(y.abs()).max(w.abs());
        // The quotients are rounded once more. The rows' bounds of `8 U` have two roundings to spare.
        let error = ex.max(ey).max(ew) / size;
        (error < MAX_RELATIVE_ERROR).then(|| Direction { v: [x / size, y / size, w / size], error, size })
    }

    /// Returns clip-space x, y and w of a point in metres relative to `Scene::origin`, without error bounds.
    pub(crate) fn values(&self, p: DVec3) -> [f64; 3] {
        let q = p - self.anchor;
        self.rows.map(|row| row.linear.dot(q) + row.constant)
    }

    /// Returns the greatest change of clip-space x, and that of clip-space y, when a point moves by one
    /// metre.
    pub(crate) fn scale(&self) -> [f64; 2] {
        [self.rows[0].linear.length(), self.rows[1].linear.length()]
    }

    /// Returns the near-plane function at a point in metres relative to `Scene::origin`, each coordinate of
    /// which may be off by `placing_error` metres, and a bound on the absolute error of the function. The
    /// function is positive beyond the near plane and 0 on it; its unit is arbitrary.
    pub(crate) fn beyond_near(&self, p: DVec3, placing_error: f64) -> (f64, f64) {
        placed_at(&self.near, p - self.anchor, placing_error)
    }

    /// Returns a value of the near-plane function. A view ray that has a point with a greater value between
    /// the front and the back plane of an uneven patch is beyond the near plane all the way between these
    /// planes, and so where it meets the patch. The planes have the unit normal `normal`, to the eye's side,
    /// and the offsets `front` and `back` in metres; the eye is surely in front of both. Rounding may halve
    /// the value.
    pub(crate) fn near_unevenness(&self, normal: DVec3, front: f64, back: f64) -> f64 {
        match self.eye {
            // The function falls from the ray's point to the eye at an even rate. Of that way, the patch is
            // met after at least the eye's height over the front plane, as a share of its height over the
            // back plane.
            Eye::Point(eye) => {
                let (at_eye, _) = self.near.at(eye - self.anchor);
                at_eye.abs() * (back - front) / (normal.dot(eye) + front)
            }
            Eye::Direction(along) => {
                self.near.linear.dot(along).abs() * (back - front) / normal.dot(along).abs()
            }
        }
    }

    /// Tests whether a whole box in metres relative to `Scene::origin` is surely beyond the near plane. False
    /// if undecided or NaN.
    pub(crate) fn is_beyond_near(&self, bounds: &Aabb) -> bool {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        self.is_point_beyond_near(DVec3::select(self.near.linear.cmpge(DVec3::ZERO), min, max))
    }

    /// Tests whether a point in metres relative to `Scene::origin` is surely beyond the near plane. False if
    /// undecided or NaN.
    pub(crate) fn is_point_beyond_near(&self, p: DVec3) -> bool {
        let (value, error) = self.beyond_near(p, 0.0);
        value > error
    }

    /// Projects a box in metres relative to `Scene::origin` to the cone of its view rays. `None` if rounding
    /// leaves its directions too uncertain to use, or the box is NaN.
    pub(crate) fn cone(&self, bounds: &Aabb) -> Option<BoxProjection> {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (q, size) = (min - self.anchor, max - min);
        // Each corner is the value at the minimum corner plus up to three products. Any term of `n . v`
        // passes through at most twelve roundings: of the 50 `U` of the slack, these take 36.
        let magnitude = q.abs() + size;
        let (mut base, mut sides, mut error) = ([0.0; 3], [[0.0; 3]; 3], 0.0f64);
        let mut largest = 0.0f64;
        for i in 0..3 {
            let row = &self.rows[i];
            let l = row.linear;
            base[i] = l.x * q.x + l.y * q.y + l.z * q.z + row.constant;
            sides[0][i] = l.x * size.x;
            sides[1][i] = l.y * size.y;
            sides[2][i] = l.z * size.z;
            let sum = l.x.abs() * magnitude.x
                + l.y.abs() * magnitude.y
                + l.z.abs() * magnitude.z
                + row.constant.abs();
            error = error.max(16.0 * U * sum + row.error);
            // At least as large as the components of any corner.
            largest = largest.max(sum);
        }
        let error = error / largest;
        let scale = 1.0 / largest;
        let scaled = |v: [f64; 3]| [v[0] * scale, v[1] * scale, v[2] * scale];
        (error < MAX_RELATIVE_ERROR).then(|| BoxProjection {
            base: scaled(base),
            sides: sides.map(scaled),
            slack: slack_of(error),
        })
    }

    /// Returns a distance in metres from the eye beyond which every point inside the image is beyond the near
    /// plane. Infinite for parallel views, and if the near plane is not surely in front of the eye.
    pub(crate) fn clearance(&self) -> f64 {
        let Eye::Point(eye) = self.eye else { return f64::INFINITY };
        // The distance is greatest at a corner of the image. The near-plane function is least for an eye that
        // is off by its error, and rises least for a ray that is. The added tenth far exceeds rounding.
        let (at_eye, error) = self.beyond_near(eye, self.eye_error);
        let slack = self.near.linear.abs().element_sum() * self.back_error;
        let mut farthest = 0.0f64;
        for corner in [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]] {
            let along = self.in_space([corner[0], corner[1], 1.0]);
            let rise = self.near.linear.dot(along) - slack;
            let reached = (error - at_eye) / rise * (along.length() + 2.0 * self.back_error);
            // If the near plane is not in front of the eye along a corner's ray, no bound is known.
            farthest = if rise > 0.0 && reached >= 0.0 { farthest.max(reached) } else { f64::INFINITY };
        }
        1.1 * farthest
    }

    /// Tests whether the eye is surely outside a box (`[min, max]` in metres relative to `Scene::origin`),
    /// and every point of the box inside the image surely beyond the near plane. `clear` is the result of
    /// [`clearance`](Self::clearance). False if undecided.
    pub(crate) fn is_outside(&self, &[min, max]: &[DVec3; 2], clear: f64) -> bool {
        match self.eye {
            Eye::Point(eye) => {
                let away = (min - eye).max(eye - max).max(DVec3::ZERO);
                // Rounding costs four units of the distance, which the clearance and the added tenth have to
                // spare. A NaN eye or box is not outside.
                away.length() > clear.max(f64::MIN_POSITIVE) + 1.1 * self.eye_error
            }
            Eye::Direction(_) => corners_of([min, max]).all(|p| self.is_point_beyond_near(p)),
        }
    }

    /// Returns a clip-space direction `(x, y, w)` as a direction along the scene's axes, not normalized. Zero
    /// for parallel views.
    pub(crate) fn in_space(&self, v: [f64; 3]) -> DVec3 {
        self.back * DVec3::from_array(v)
    }

    /// Returns the plane `normal . p + offset = 0`, for `p` in metres relative to `Scene::origin` and a unit
    /// normal, in the form that tells where view rays meet the plane; see [`Approach`]. `None` for parallel
    /// views.
    pub(crate) fn approach(&self, normal: DVec3, offset: f64) -> Option<Approach> {
        let Eye::Point(eye) = self.eye else { return None };
        let [x, y, z] = [self.back.x_axis, self.back.y_axis, self.back.z_axis];
        let height = normal.dot(eye) + offset;
        let size = normal.abs().dot(eye.abs()) + offset.abs();
        let height_error = 8.0 * U * size + self.eye_error;
        Some(Approach { height, height_error, speed: [-normal.dot(x), -normal.dot(y), -normal.dot(z)] })
    }

    /// Tests whether, along every view ray of a convex cone, the plane `first` is surely met before the plane
    /// `second`. `part` lists the clip-space directions `(x, y, w)` of the cone's corners, and `error` bounds
    /// the absolute error of their components. The eye must be surely in front of `first`, and every ray of
    /// the cone must meet `second` from the front. False if undecided, or if the eye is not surely in front
    /// of `second`.
    pub(crate) fn is_met_first(
        &self,
        first: &Approach,
        second: &Approach,
        part: &[[f64; 3]],
        error: f64,
    ) -> bool {
        // A ray with direction `v` meets a plane at the ray parameter `height / (speed . v)`. The first plane
        // is met earlier if `height' (speed . v) > height (speed' . v)`, where the prime marks the second
        // plane. This inequality is linear in `v`, so testing the corners suffices. Rays meet the second
        // plane from the front, so `speed' . v > 0`, and then `speed . v > 0` as well. The heights are taken
        // at the worse end of their errors. For unit normals, `speed . v` is off by less than twice the sum
        // of the error of `back * v` and the effect of the error of `v` on it. Rounding takes less than half
        // of what `back_error` has to spare.
        let (height, other) = (first.height + first.height_error, second.height - second.height_error);
        let slack = 2.0 * (height + other) * (self.back_error + self.back_size * error);
        let speed = [0, 1, 2].map(|i| other * first.speed[i] - height * second.speed[i]);
        other > 0.0 && part.iter().all(|&v| dot(speed, v) > slack)
    }

    /// Tests whether the eye is surely in front of the plane `normal . p + offset = 0` in metres relative to
    /// `Scene::origin`, with a unit normal. For parallel views, tests whether the view direction surely runs
    /// against the normal. False if undecided.
    pub(crate) fn is_before(&self, normal: DVec3, offset: f64) -> bool {
        match self.eye {
            Eye::Point(eye) => {
                let distance = normal.dot(eye) + offset;
                let size = normal.abs().dot(eye.abs()) + offset.abs();
                // The error once more, so that the true distance is more than half of the computed one: see
                // `near_unevenness`.
                distance > 8.0 * U * size + 2.0 * self.eye_error + f64::MIN_POSITIVE
            }
            Eye::Direction(along) => normal.dot(along) < -(8.0 * U + 2.0 * self.eye_error),
        }
    }
}

/// Returns the value of a linear function at a point, and a bound on its absolute error, if each coordinate
/// of the point may be off by `placing_error` metres.
fn placed_at(row: &ClipRow, point: DVec3, placing_error: f64) -> (f64, f64) {
    let (value, error) = row.at(point);
    (value, error + row.linear.abs().element_sum() * placing_error)
}

/// A plane and the eye of a perspective view: the eye's signed distance `height` from the plane, and the
/// linear function `speed . v` of a view ray's clip-space direction `v = (x, y, w)`. The ray's points are
/// `eye + t d`, with `d` the direction `v` converted to metres along the scene's axes. The ray meets the
/// plane at `t = height / (speed . v)`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Approach {
    /// Signed distance in metres of the eye from the plane, positive on the side that the plane's normal
    /// points to.
    height: f64,
    /// Bound on the absolute error of `height`, in metres.
    height_error: f64,
    /// Coefficients of `speed . v = -normal . d`: metres by which a ray with clip-space direction `v` sinks
    /// towards the plane per unit of `t`. Positive if the ray runs against the plane's normal.
    speed: [f64; 3],
}

/// Bounds the error of a numerically inverted matrix: `back` is the computed inverse of `forth`. The bounds
/// are for products `back * v` with vectors `v` whose components are at most 1 in magnitude. Returns a bound
/// on the magnitude of each component of the product, and a bound on each component's absolute error. The
/// second is infinite if `back` is not a usable inverse.
fn inverse_error_bounds(forth: DMat3, back: DMat3) -> (f64, f64) {
    // `back . forth` equals the identity plus a residue matrix `R`, so the computed product is off by at most
    // `|R|` times the exact one. `R` is computed from three products, their sums and one difference, whose
    // rounding is added.
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
    // The magnitude with the exact inverse is at most size / (1 - R).
    if residue < 0.5 { (2.0 * size, 2.0 * size * residue) } else { (size, f64::INFINITY) }
}

#[cfg(test)]
mod tests;
