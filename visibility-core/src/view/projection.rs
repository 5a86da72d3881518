//! Points of the world in clip space, with bounds on their rounding: derived here once for every culler that
//! projects.
//!
//! # Linear functions
//! Clip-space `x`, `y` and `w`, pixel coordinates times `w`, the distance beyond the near plane and the depth
//! key are all linear in the point. A [`ClipRow`] is such a function of points relative to the *anchor*: the
//! eye of a perspective view, the view's own origin otherwise. So precision does not depend on where in the
//! scene the camera is.
//!
//! A clip matrix may come with any factor; at 1e-43 its rows would be denormals in `f32`, and at 1e-105 the
//! determinants of three rows would be in `f64`. So all rows are scaled by the power of two that gives `w` a
//! slope of about one, which rounds nothing.
//!
//! # Bounds
//! With `u = 2^-53`, and the view's matrix and the difference of origins taken as they are given:
//! - A row's elements are one element of the matrix, or a sum of two, scaled once or twice: at most `3u` of
//!   their size.
//! - The constant is the row at the eye, in the view's own coordinates: three products, three sums, `6u` of
//!   the sum of magnitudes.
//! - The anchor is off by `u` of itself and `u` of the difference of origins, which the row's elements
//!   multiply.
//! - The value at a point adds five roundings for each term: the difference that made the point, a product
//!   and three sums.
//!
//! The bounds below take `16u`, `4u` and `8u` for these `9u`, `2u` and `5u`. What underflows loses less than
//! the least normal number, which is added.

use super::eye::eye_error;
use super::{Depth, Eye, View};
use glam::{DVec3, DVec4};

/// Unit round-off of `f64`.
const U: f64 = f64::EPSILON / 2.0;

/// A linear function of points, such as clip-space `w`.
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
    /// What one metre along each axis adds to the value.
    pub linear: DVec3,
    /// The value at the anchor.
    pub constant: f64,
    /// Bound on the absolute error of `constant`, the effect of rounding the anchor included.
    pub error: f64,
}

impl ClipRow {
    /// The value at a point relative to the anchor, and a bound on its error. The point may be a difference
    /// rounded once.
    #[inline]
    pub fn at(&self, point: DVec3) -> (f64, f64) {
        let (l, p) = (self.linear, point);
        let value = l.x * p.x + l.y * p.y + l.z * p.z + self.constant;
        let size =
            l.x.abs() * p.x.abs() + l.y.abs() * p.y.abs() + l.z.abs() * p.z.abs() + self.constant.abs();
        (value, 8.0 * U * size + self.error)
    }
}

/// The projection of a view, for points relative to an origin of the caller's choice: usually the scene's.
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
    /// The rows of the clip matrix, for points relative to the view's origin, times a power of two.
    rows: [DVec4; 4],
    depth: Depth,
    /// The anchor relative to the view's origin.
    local: DVec3,
    /// The view's origin relative to the caller's.
    offset: DVec3,
    eye: Eye,
    eye_error: f64,
}

impl ViewProjection {
    /// The projection of a view for points relative to `origin`.
    pub fn new(view: &View, origin: DVec3) -> Self {
        // The view's own matrix: subtracting origins later keeps the precision of a camera far from the
        // caller's origin.
        let matrix = view.clip_from(view.origin());
        let local = match view.eye(view.origin()) {
            Eye::Point(eye) => eye,
            Eye::Direction(_) => DVec3::ZERO,
        };
        let scale = scale_to_one(matrix.row(3));
        let rows = [0, 1, 2, 3].map(|i| matrix.row(i) * scale);
        let (eye, eye_error) = (view.eye(origin), eye_error(&matrix, view.depth(), view.origin(), origin));
        Self { rows, depth: view.depth(), local, offset: view.origin() - origin, eye, eye_error }
    }

    /// The point that [`ClipRow`]s take points relative to, itself relative to the origin.
    pub fn anchor(&self) -> DVec3 {
        self.local + self.offset
    }

    /// The eye, relative to the origin; the anchor of a perspective view.
    pub fn eye(&self) -> Eye {
        self.eye
    }

    /// Bound on the distance of [`eye`](Self::eye) from the eye of the exact matrix: in metres for a point;
    /// for a direction, the length of the difference of the unit vectors. Infinite where rounding leaves
    /// open where the eye is, or whether it is a point.
    pub fn eye_error(&self) -> f64 {
        self.eye_error
    }

    /// Clip-space `x`.
    pub fn x(&self) -> ClipRow {
        self.row(self.rows[0])
    }

    /// Clip-space `y`.
    pub fn y(&self) -> ClipRow {
        self.row(self.rows[1])
    }

    /// Clip-space `w`: positive before the eye; constant for parallel views.
    pub fn w(&self) -> ClipRow {
        self.row(self.rows[3])
    }

    /// Positive beyond the near plane, zero on it; in no unit, since only its sign counts.
    pub fn near(&self) -> ClipRow {
        let near = self.depth.rows(self.rows[2], self.rows[3]).0;
        self.row(near * scale_to_one(near))
    }

    /// The depth key times `w`. The key is linear on the screen over a plane, and falls along every line of
    /// sight: `1 / w` for perspective views, whose row is the constant 1; clip depth for parallel ones,
    /// negated unless [reversed](Depth::is_reversed).
    pub fn depth_key(&self) -> ClipRow {
        self.row(match (self.eye, self.depth.is_reversed()) {
            (Eye::Point(_), _) => DVec4::W,
            (Eye::Direction(_), true) => self.rows[2],
            (Eye::Direction(_), false) => -self.rows[2],
        })
    }

    /// Pixel coordinates times `w`, in a picture of the given width and height in pixels: columns to the
    /// right, rows downwards, the first pixel between 0 and 1.
    pub fn pixels(&self, width: f64, height: f64) -> [ClipRow; 2] {
        let [x, y, _, w] = self.rows;
        [self.row((x + w) * (0.5 * width)), self.row((w - y) * (0.5 * height))]
    }

    /// The sign of the determinant of clip-space `(x, y, w)` of three points in view whose triangle turns its
    /// normal away from the eye: 1 for the matrix of an unmirrored camera, -1 for a mirrored one, 0 where
    /// rounding leaves nothing of it.
    pub fn orientation(&self) -> f64 {
        let [x, y, w] = [self.rows[0], self.rows[1], self.rows[3]].map(DVec4::truncate);
        let turn = match self.eye {
            Eye::Point(_) => x.cross(y).dot(w),
            // Lines of sight run along one direction, and w is the same everywhere.
            Eye::Direction(along) => x.cross(y).dot(along) * self.rows[3].w,
        };
        if turn.is_nan() || turn == 0.0 { 0.0 } else { turn.signum() }
    }

    fn row(&self, row: DVec4) -> ClipRow {
        let (local, linear) = (self.local, row.truncate());
        let size = linear.abs().dot(local.abs()) + row.w.abs();
        let moved = linear.abs().dot(self.anchor().abs() + self.offset.abs());
        let error = 16.0 * U * size + 4.0 * U * moved + f64::MIN_POSITIVE;
        ClipRow { linear, constant: linear.dot(local) + row.w, error }
    }
}

/// The power of two that scales the linear part of a row to a sum of magnitudes from 1 to 2, or the constant
/// of a row whose linear part is zero. Multiplying by it is exact. It is 1 for a row of unit length: that sum
/// is then from 1 to the square root of 3, and the factor in the code outweighs its rounding.
fn scale_to_one(row: DVec4) -> f64 {
    let linear = row.truncate().abs().element_sum();
    let size = if linear > 0.0 { linear } else { row.w.abs() } * (1.0 + 1.0 / 524_288.0);
    let exponent = (size.to_bits() >> 52) as i64 - 1023;
    f64::from_bits(((1023 - exponent.clamp(-1000, 1000)) as u64) << 52)
}
