//! Projection of points to clip space with bounds on the rounding errors, derived here once for all cullers
//! that project.
//!
//! # Linear functions
//! Clip-space `x`, `y` and `w`, pixel coordinates times `w`, the distance beyond the near plane, and the
//! depth key times `w` are all linear in the point. A [`ClipRow`] is such a function of points relative to
//! the *anchor*: the eye of a perspective view, the view's own origin otherwise. Precision therefore does not
//! depend on the camera's position in the scene.
//!
//! A clip matrix may have any scale. With a factor of 1e-43 its rows would be denormals in `f32`, and with
//! 1e-105 the determinants of three rows would be denormals in `f64`. All rows are therefore scaled by the
//! power of two that gives `w` a slope of about one, which is exact.
//!
//! # Bounds
//! With `u = 2^-53`, and the view's matrix and the difference of origins taken as exact:
//! - The elements of a row are one element of the matrix or a sum of two, scaled once or twice: relative
//!   error at most `3u`.
//! - The constant is the row's value at the eye, in the view's own coordinates: three products and three
//!   sums, `6u` of the sum of magnitudes.
//! - The anchor has an error of `u` of itself and `u` of the difference of origins, which the row's elements
//!   multiply.
//! - Evaluating the row at a point adds five roundings to each term: the difference that made the point, a
//!   product and three sums.
//!
//! The code uses `16u`, `4u` and `8u` for these `9u`, `2u` and `5u`. Underflow loses less than the least
//! normal number, which is added.

use super::eye::eye_error;
use super::{Depth, Eye, View};
use glam::{DVec3, DVec4};

/// Unit round-off of `f64`: 2^-53, the relative error of one rounded operation.
const U: f64 = f64::EPSILON / 2.0;

/// An affine function of points in metres relative to a [`ViewProjection`]'s anchor, with a bound on its
/// rounding error. The value is that of a clip-space coordinate such as `w`, or of another function that a
/// method of `ViewProjection` states.
///
/// ```
/// use visibility_core::view::ViewProjection;
/// use visibility_core::{glam::DVec3, Pose, View};
/// let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 100.0)?;
/// let projection = ViewProjection::new(&view, DVec3::ZERO);
/// let point = DVec3::new(3.0, 1.0, 0.0) - projection.anchor();
/// let (w, error) = projection.w().at(point);
/// assert!((w - 3.0).abs() <= error && error < 1e-14);
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct ClipRow {
    /// Gradient: the change of the value per metre along each axis.
    pub linear: DVec3,
    /// Value of the function at the anchor.
    pub constant: f64,
    /// Bound on the absolute error of `constant`, in the unit of the value, including the effect of rounding
    /// the anchor.
    pub error: f64,
}

impl ClipRow {
    /// Returns the value at a point, in metres relative to the anchor (the eye of a perspective view), and a
    /// bound on the absolute error of that value. The bound also covers one rounding of each coordinate of
    /// `point`, which may be the difference of two points.
    #[inline]
    pub fn at(&self, point: DVec3) -> (f64, f64) {
        let (l, p) = (self.linear, point);
        let value = l.x * p.x + l.y * p.y + l.z * p.z + self.constant;
        let size =
            l.x.abs() * p.x.abs() + l.y.abs() * p.y.abs() + l.z.abs() * p.z.abs() + self.constant.abs();
        (value, 8.0 * U * size + self.error)
    }
}

/// The projection of a view, with error bounds. [`new`](Self::new) takes an origin, usually the scene's;
/// anchor and eye are relative to that origin, and [`ClipRow`]s take points relative to the anchor.
///
/// ```
/// use visibility_core::view::ViewProjection;
/// use visibility_core::{glam::DVec3, Pose, View};
/// let pose = Pose::look_at(DVec3::new(1e7, 0.0, 0.0), DVec3::new(1e7, 5.0, 0.0), DVec3::Z);
/// let view = View::perspective(pose, 1.0, 1.0, 0.1, 100.0)?;
/// let projection = ViewProjection::new(&view, DVec3::new(1e7, 0.0, 0.0));
/// assert_eq!(projection.anchor(), DVec3::ZERO);
/// assert!(projection.eye_error() < 1e-7);
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ViewProjection {
    /// Rows of the clip matrix for x, y, z and w, for points relative to the view's origin, all scaled by
    /// one power of two.
    rows: [DVec4; 4],
    depth: Depth,
    /// Anchor of the rows in metres, relative to the view's origin: the eye of a perspective view, zero
    /// otherwise.
    anchor_from_view: DVec3,
    /// Origin of the view in metres, relative to the origin passed to `new`.
    view_from_origin: DVec3,
    eye: Eye,
    eye_error: f64,
}

impl ViewProjection {
    /// Builds the projection of a view. `origin` is the point of the world that anchor and eye are to be
    /// relative to, usually the scene's origin.
    pub fn new(view: &View, origin: DVec3) -> Self {
        // The view's own matrix: with origins subtracted later, a camera far from the caller's origin keeps
        // its precision.
        let matrix = view.clip_from(view.origin());
        let eye_from_view = view.eye(view.origin());
        let view_from_origin = view.origin() - origin;
        let (anchor_from_view, eye) = match eye_from_view {
            Eye::Point(eye) => (eye, Eye::Point(eye + view_from_origin)),
            direction => (DVec3::ZERO, direction),
        };
        let scale = scale_to_one(matrix.row(3));
        let rows = [0, 1, 2, 3].map(|i| matrix.row(i) * scale);
        let eye_error = eye_error(&matrix, eye_from_view, view.origin(), origin);
        Self { rows, depth: view.depth(), anchor_from_view, view_from_origin, eye, eye_error }
    }

    /// Returns the point that [`ClipRow`]s take points relative to: the eye of a perspective view, the view's
    /// own origin otherwise. In metres, relative to the origin passed to [`new`](Self::new).
    pub fn anchor(&self) -> DVec3 {
        self.anchor_from_view + self.view_from_origin
    }

    /// Returns the eye, relative to the origin passed to [`new`](Self::new): the point of a perspective view,
    /// which is also the anchor up to rounding, or the direction of a parallel view.
    pub fn eye(&self) -> Eye {
        self.eye
    }

    /// Returns a bound on the distance of [`eye`](Self::eye) from the eye of the exact matrix: in metres for
    /// a point; for a direction, the length of the difference of the unit vectors. Infinite where rounding
    /// leaves undecided where the eye is, or whether it is a point.
    pub fn eye_error(&self) -> f64 {
        self.eye_error
    }

    /// Returns clip-space `x`, multiplied by the same power of two as [`w`](Self::w), as a function of points
    /// relative to the [anchor](Self::anchor): the eye in a perspective view.
    pub fn x(&self) -> ClipRow {
        self.row(self.rows[0])
    }

    /// Returns clip-space `y`, multiplied by the same power of two as [`w`](Self::w), as a function of points
    /// relative to the [anchor](Self::anchor): the eye in a perspective view.
    pub fn y(&self) -> ClipRow {
        self.row(self.rows[1])
    }

    /// Returns clip-space `w`, multiplied by a constant power of two, as a function of points relative to the
    /// [anchor](Self::anchor), which is the eye in a perspective view. Positive in front of the eye of a
    /// perspective view, constant for a parallel view.
    pub fn w(&self) -> ClipRow {
        self.row(self.rows[3])
    }

    /// Returns a function that is positive beyond the near plane and 0 on it, of points relative to the
    /// [anchor](Self::anchor): the eye in a perspective view. Its scale is arbitrary, so only the sign is
    /// meaningful.
    pub fn near(&self) -> ClipRow {
        let near = self.depth.rows(self.rows[2], self.rows[3]).0;
        self.row(near * scale_to_one(near))
    }

    /// Returns the depth key times [`w`](Self::w) as a function of points relative to the
    /// [anchor](Self::anchor). Over a plane, the depth key is linear in screen coordinates. Along every view
    /// ray, the key decreases with the distance from the eye. For perspective views the key is `1 / w`, so
    /// the function is the constant 1. For parallel views the key is clip depth, negated unless depth is
    /// [reversed](Depth::is_reversed).
    pub fn depth_key(&self) -> ClipRow {
        self.row(match (self.eye, self.depth.is_reversed()) {
            (Eye::Point(_), _) => DVec4::W,
            (Eye::Direction(_), true) => self.rows[2],
            (Eye::Direction(_), false) => -self.rows[2],
        })
    }

    /// Returns the pixel coordinates times [`w`](Self::w), column first, as functions of points relative to
    /// the [anchor](Self::anchor): the eye in a perspective view. `width` and `height` are the size of the
    /// picture in pixels. Columns grow to the right and rows downwards; the first pixel spans 0 to 1.
    pub fn pixels(&self, width: f64, height: f64) -> [ClipRow; 2] {
        let [x, y, _, w] = self.rows;
        [self.row((x + w) * (0.5 * width)), self.row((w - y) * (0.5 * height))]
    }

    /// Returns what [`pixels`](Self::pixels) leave to the right side of the picture and to its lower side:
    /// `width * w - x` and `height * w - y`. Differences of those rows would be rounded by `x`, which may be
    /// much larger.
    pub fn pixels_to_end(&self, width: f64, height: f64) -> [ClipRow; 2] {
        let [x, y, _, w] = self.rows;
        [self.row((w - x) * (0.5 * width)), self.row((w + y) * (0.5 * height))]
    }

    /// Returns 1 if the directions right, up and ahead of the picture are left-handed axes, -1 if they are
    /// right-handed. This is the sign of the determinant of the clip-space `(x, y, w)` of any three points
    /// `a`, `b`, `c` in view for which the normal `(b - a) x (c - a)` points away from the eye. Returns 0 if
    /// the computed determinant is 0 or NaN.
    pub fn orientation(&self) -> f64 {
        let [x, y, w] = [self.rows[0], self.rows[1], self.rows[3]].map(DVec4::truncate);
        let turn = match self.eye {
            Eye::Point(_) => x.cross(y).dot(w),
            // All view rays run along one direction, and w is constant.
            Eye::Direction(along) => x.cross(y).dot(along) * self.rows[3].w,
        };
        if turn.is_nan() || turn == 0.0 { 0.0 } else { turn.signum() }
    }

    fn row(&self, row: DVec4) -> ClipRow {
        let (anchor, linear) = (self.anchor_from_view, row.truncate());
        let size = linear.abs().dot(anchor.abs()) + row.w.abs();
        let moved = linear.abs().dot(self.anchor().abs() + self.view_from_origin.abs());
        let error = 16.0 * U * size + 4.0 * U * moved + f64::MIN_POSITIVE;
        ClipRow { linear, constant: linear.dot(anchor) + row.w, error }
    }
}

/// Returns the power of two by which to multiply a clip-matrix row `(x, y, z, constant)` so that `|x| + |y| +
/// |z|` is between 1 and 2. If the linear part is zero, `|constant|` is scaled instead. Multiplication by the
/// power is exact. The exponent is limited to +-1000, so the result is finite for every row, even a zero or
/// non-finite one.
fn scale_to_one(row: DVec4) -> f64 {
    // A row whose linear part has unit length should get exactly 1: the sum of its magnitudes is from 1 to
    // the square root of 3, and the small factor below keeps rounding from taking the sum under 1.
    let linear = row.truncate().abs().element_sum();
    let size = if linear > 0.0 { linear } else { row.w.abs() } * (1.0 + 1.0 / 524_288.0);
    let exponent = (size.to_bits() >> 52) as i64 - 1023;
    f64::from_bits(((1023 - exponent.clamp(-1000, 1000)) as u64) << 52)
}

#[cfg(test)]
mod tests {
    use super::scale_to_one;
    use glam::DVec4;

    #[test]
    fn rows_are_scaled_to_a_slope_of_about_one() {
        for scale in [1e-300, 1e-43, 1.0, 1e43, 1e300] {
            for (row, size) in [
                (DVec4::new(0.3, -0.5, 0.1, 7.0), 0.9),
                (DVec4::new(0.0, 0.0, 0.0, -7.0), 7.0),
                (DVec4::new(1.0, 0.0, 0.0, 0.0), 1.0),
            ] {
                let scaled = size * scale * scale_to_one(row * scale);
                assert!((1.0..2.0).contains(&scaled), "{row} times {scale} has a slope of {scaled}");
            }
        }
        for row in [DVec4::ZERO, DVec4::NAN, DVec4::INFINITY] {
            assert!(scale_to_one(row).is_finite(), "the power for {row}");
        }
    }
}
