//! The depth key of a face as a linear function of pixel coordinates, lowered (moved away from the eye) by
//! its error.

use super::screen_projection::{ObjectProjection, ScreenProjection};
use crate::vector::{cross, dot, less, point};

/// Returns the depth key of the triangle with corners `a`, `b` and `c` as a plane `p x + q y + r` in pixel
/// coordinates, lowered by its error bound: the coefficients `[p, q, r]`. Cramer's rule gives the plane from
/// the homogeneous coordinates of the three corners. `certain` bounds the absolute error of the corners'
/// determinant ([`determinant_error`](ObjectProjection::determinant_error)), `products` that of their cross
/// products ([`cross_error`](ObjectProjection::cross_error)). All coefficients are NaN if that determinant is
/// not certain to differ from zero.
#[inline(always)]
pub(crate) fn plane(
    [a, b, c]: [&[f64; 5]; 3],
    object: &ObjectProjection,
    projection: &ScreenProjection,
    &[certain, products]: &[f64; 2],
) -> [f64; 3] {
    let (second, third) = (less(b, a), less(c, a));
    let normal = cross(point(&second), point(&third));
    let height = dot(normal, point(a));
    // The triangle was chosen by the sign of its area on the screen, which is more certain than the sign of
    // this determinant.
    let mut plane = [f64::NAN; 3];
    if !(height.abs() > certain) {
        return plane;
    }
    let over = 1.0 / height;
    if projection.perspective {
        for i in 0..3 {
            plane[i] = normal[i] * over;
        }
    } else {
        let (p, q) = (cross(point(&third), point(a)), cross(point(a), point(&second)));
        for i in 0..3 {
            plane[i] = (a[3] * normal[i] + second[3] * p[i] + third[3] * q[i]) * over;
        }
    }
    lower(plane, over, object, projection, certain, products)
}

/// Lowers a depth plane `a x + b y + c` (pixel coordinates) by the bound on its absolute error in the buffer.
/// `over` is the reciprocal of the determinant of three corners; the coefficients of the plane were divided
/// by that determinant. `determinant_error` and `cross_error` bound the absolute errors of that determinant
/// and of cross products of corners.
///
/// A coefficient is a numerator over the determinant. Over the picture, the numerator is off by the error of
/// cross products times the magnitude of `n` (depth key times `w`). In parallel views, where differences of
/// `n` multiply cross products too, a corner that is a sum has three errors: 40 of 64 units of errors in all,
/// since steps have no error of the constant. The error of `n` times the product of two other coordinates is
/// then added. The error of the determinant counts as a relative error of the quotient.
#[inline(always)]
pub(crate) fn lower(
    [a, b, c]: [f64; 3],
    over: f64,
    object: &ObjectProjection,
    projection: &ScreenProjection,
    determinant_error: f64,
    cross_error: f64,
) -> [f64; 3] {
    let ([sx, sy, sw, sn, _], [.., en, _]) = (object.size, object.error);
    let [width, rows] = projection.size;
    let size = a.abs() * width + b.abs() * rows + c.abs();
    let of_n =
        if projection.perspective { 0.0 } else { 32.0 * en * (width * sy * sw + rows * sx * sw + sx * sy) };
    let numerator = 2.0 * cross_error * sn + of_n;
    [a, b, c - 2.0 * (numerator + size * determinant_error) * over.abs()]
}
