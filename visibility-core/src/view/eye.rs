//! The eye of a view: a point or a direction, and a bound on how far rounding may have moved it.

use super::depth::Depth;
use glam::{DMat4, DVec3, DVec4};

/// Unit round-off of `f64`.
const U: f64 = f64::EPSILON / 2.0;

/// Where a view is seen from, relative to some origin.
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
    /// Perspective: all lines of sight start in this point.
    Point(DVec3),
    /// Orthographic: all lines of sight run along this unit direction, away from the viewer.
    Direction(DVec3),
}

/// Where a clip matrix is seen from, relative to its own origin.
pub(super) fn eye_of(m: &DMat4, depth: Depth) -> Eye {
    // The eye is what the matrix maps to x = y = w = 0: the vector orthogonal to those three rows, which
    // exists for every projection, whatever its depth row holds.
    let rows = [m.row(0), m.row(1), m.row(3)].map(scaled_by_power_of_two);
    let eye = orthogonal(rows, |a, b| a - b);
    let position = eye.truncate() / eye.w;
    if eye.w != 0.0 && position.is_finite() {
        return Eye::Point(position);
    }
    // A parallel projection sees along the null direction; of its two senses, the one in which depth grows
    // (shrinks, if reversed) leads away from the viewer.
    let scale = eye.truncate().abs().max_element();
    let direction = (eye.truncate() / scale).normalize_or_zero();
    let depth = m.row(2).truncate().dot(direction) * if depth.is_reversed() { -1.0 } else { 1.0 };
    Eye::Direction(if depth < 0.0 { -direction } else { direction })
}

/// Bound on the distance of [`eye_of`], moved from the origin of the view to `origin`, from the eye of the
/// exact matrix; see [`ViewProjection::eye_error`](super::ViewProjection::eye_error).
///
/// The eye is orthogonal to three rows of the matrix. With the rows scaled by powers of two, a component is a
/// sum of six products of three numbers, each rounded twice as a product and four times in sums (at most):
/// `12u` of the sum of their magnitudes is more than the error.
pub(super) fn eye_error(m: &DMat4, depth: Depth, view_origin: DVec3, origin: DVec3) -> f64 {
    let rows = [m.row(0), m.row(1), m.row(3)].map(scaled_by_power_of_two);
    let eye = orthogonal(rows, |a, b| a - b);
    let size = orthogonal(rows.map(DVec4::abs), |a, b| a + b);
    let error = size * (16.0 * U) + DVec4::splat(1e-290);
    match eye_of(m, depth) {
        Eye::Direction(_) => {
            let length = eye.truncate().length();
            let direction = eye.truncate() / length;
            // The rounding of length and quotient, 6u at most, is a fraction of the 16u of each component's
            // terms that are counted twice.
            let error = 2.0 * error.truncate().length() / length;
            // Which of the two senses leads away from the viewer is told by the depth row. Not so for NaN:
            // then nothing is known.
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
            // The quotient is linear in the error of the divisor only where that is small.
            let is_certain = eye.w.abs() > 1024.0 * size.w * (16.0 * U) && error.is_finite();
            if is_certain { error } else { f64::INFINITY }
        }
    }
}

/// A row of the clip matrix divided by the power of two in its largest element. Rows may differ by many
/// orders of magnitude, and only their directions matter to the eye; nothing is rounded, so the eye of a
/// scaled view is the scaled eye.
fn scaled_by_power_of_two(row: DVec4) -> DVec4 {
    let most = row.abs().max_element();
    let power = f64::from_bits(most.to_bits() & (0x7ff << 52));
    row / if power.is_normal() { power } else { most }
}

/// The vector orthogonal to three others in four dimensions, by cofactors; with a sum of magnitudes in place
/// of `subtract`, the sum of the magnitudes of all terms of each component.
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
