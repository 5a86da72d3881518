//! The eye of a view, a point or a direction, with a bound on its rounding error.

use super::depth::Depth;
use glam::{DMat4, DVec3, DVec4};

/// Unit round-off of `f64`: 2^-53, the relative error of one rounded operation.
const U: f64 = f64::EPSILON / 2.0;

/// Where a view is seen from: a point for perspective views, a direction for parallel ones. Points are in
/// metres, relative to the origin that was passed to [`View::eye`](crate::View::eye).
///
/// ```
/// use visibility_core::{glam::DVec3, view::Eye, Pose, View};
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY)?;
/// assert!(matches!(view.eye(DVec3::ZERO), Eye::Point(_)));
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Eye {
    /// Perspective view: the point in which all view rays start, in metres relative to the chosen origin.
    Point(DVec3),
    /// Parallel (orthographic) view: the unit direction of all view rays, away from the viewer.
    Direction(DVec3),
}

/// Returns the eye of the clip matrix `m`: for a perspective view a point, in the coordinates of the points
/// that `m` maps to clip space; for a parallel view the unit direction of the view rays, away from the
/// viewer. `depth` tells which of two opposite directions points away.
pub(super) fn eye_of(m: &DMat4, depth: Depth) -> Eye {
    // The matrix maps the eye to x = y = w = 0. The eye is the vector orthogonal to these three rows, which
    // exists for every projection, whatever its depth row holds.
    let rows = [m.row(0), m.row(1), m.row(3)].map(scaled_by_power_of_two);
    let eye = orthogonal(rows, |a, b| a - b);
    let position = eye.truncate() / eye.w;
    if eye.w != 0.0 && position.is_finite() {
        return Eye::Point(position);
    }
    // The rays of a parallel projection run along the direction that the three rows map to zero. Of its two
    // senses, the one in which depth grows (shrinks, if reversed) points away from the viewer.
    let scale = eye.truncate().abs().max_element();
    let direction = (eye.truncate() / scale).normalize_or_zero();
    let depth = m.row(2).truncate().dot(direction) * if depth.is_reversed() { -1.0 } else { 1.0 };
    Eye::Direction(if depth < 0.0 { -direction } else { direction })
}

/// Returns a bound on the error of the eye of the clip matrix `m`: in metres for a point; for a direction,
/// the length of the difference of unit vectors. Infinite where rounding leaves the eye undecided.
///
/// `eye_from_view` is the result of [`eye_of`] for `m`, `view_origin` the point of the world that `m` is
/// relative to, and `origin` the point of the world that the caller takes the eye relative to. See
/// [`ViewProjection::eye_error`](super::ViewProjection::eye_error).
pub(super) fn eye_error(m: &DMat4, eye_from_view: Eye, view_origin: DVec3, origin: DVec3) -> f64 {
    // The eye is orthogonal to three rows of the matrix. With the rows scaled by powers of two, each
    // component is a sum of six products of three numbers. Each product is rounded twice as a product and at
    // most four times in sums, so `12u` (`u = 2^-53`) of the sum of the products' magnitudes exceeds the
    // error.
    let rows = [m.row(0), m.row(1), m.row(3)].map(scaled_by_power_of_two);
    let eye = orthogonal(rows, |a, b| a - b);
    let size = orthogonal(rows.map(DVec4::abs), |a, b| a + b);
    let error = size * (16.0 * U) + DVec4::splat(1e-290);
    match eye_from_view {
        Eye::Direction(_) => {
            let length = eye.truncate().length();
            let direction = eye.truncate() / length;
            // Length and quotient round by at most 6u. The factor 2 covers this, since it doubles the 16u of
            // each component's terms.
            let error = 2.0 * error.truncate().length() / length;
            // The depth row decides which of the two senses points away from the viewer. If its product with
            // the direction is within the error, or NaN, the direction is unknown.
            let depth = m.row(2).truncate();
            let is_certain =
                size.w == 0.0 && depth.dot(direction).abs() > 2.0 * error * depth.abs().element_sum();
            if is_certain { error } else { f64::INFINITY }
        }
        Eye::Point(_) => {
            let position = eye.truncate() / eye.w;
            let off = (error.truncate() + position.abs() * error.w) / eye.w.abs();
            let sums = position.abs() + view_origin.abs() + origin.abs();
            let error = 1.01 * off.length() + 8.0 * U * sums.element_sum();
            // The error of the quotient is linear in the error of the divisor only if the divisor's error is
            // small.
            let is_certain = eye.w.abs() > 1024.0 * size.w * (16.0 * U) && error.is_finite();
            if is_certain { error } else { f64::INFINITY }
        }
    }
}

/// Returns a row of the clip matrix divided by the greatest power of two that does not exceed its largest
/// magnitude. The division is exact unless that magnitude is subnormal. It does not change the eye. It keeps
/// products of rows within the range of `f64` where the magnitudes of the rows differ by many orders.
fn scaled_by_power_of_two(row: DVec4) -> DVec4 {
    let most = row.abs().max_element();
    let power = f64::from_bits(most.to_bits() & (0x7ff << 52));
    row / if power.is_normal() { power } else { most }
}

/// Returns the 4D vector orthogonal to three vectors, by cofactors; `subtract` must then be subtraction. With
/// addition for `subtract` and the magnitudes of the vectors' components, returns the sum of the magnitudes
/// of the terms of each component instead.
fn orthogonal([a, b, c]: [DVec4; 3], subtract: impl Fn(f64, f64) -> f64) -> DVec4 {
    let minor = |i: usize, j: usize, k: usize| {
        let x = subtract(b[j] * c[k], b[k] * c[j]);
        let y = subtract(b[i] * c[k], b[k] * c[i]);
        let z = subtract(b[i] * c[j], b[j] * c[i]);
        subtract(a[i] * x, a[j] * y) + a[k] * z
    };
    let negative = subtract(0.0, 1.0);
    DVec4::new(minor(1, 2, 3), negative * minor(0, 2, 3), minor(0, 1, 3), negative * minor(0, 1, 2))
}
