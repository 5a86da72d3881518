//! Tests which side of a triangle faces every point of a viewcell.

use visibility_core::glam::DVec3;

/// Returns 1 if the front of a triangle faces all points of a box, and -1 if its back does. Returns 0 if the
/// plane of the triangle cuts the box or nearly does: such a triangle never occludes, since each of its sides
/// faces some viewpoint.
///
/// `center` and `half` describe the box, in the coordinates of the corners. Each corner is in error by up to
/// `error`. `mirrored` tells that these coordinates are left-handed, so that fronts run clockwise.
#[inline]
pub(crate) fn facing([a, b, c]: [DVec3; 3], center: DVec3, half: DVec3, error: f64, mirrored: bool) -> i8 {
    let (e, f, to) = (b - a, c - a, center - a);
    let normal = e.cross(f);
    // The height of the box's centre over the plane must exceed the heights of the box's corners over the
    // centre. Both are sums of products of e, f and `to`, each of which errs by 2 `error`. `size` bounds e
    // and f, so the products err by less than 16 `error` times the sizes of the other factors. Products and
    // sums round by less than 16 EPSILON of their sizes.
    let size = e.abs().max(f.abs()).element_sum();
    let distance = to.abs().element_sum() + half.element_sum();
    let margin = size * (size + distance) * (16.0 * error) + size * size * (distance * (16.0 * f64::EPSILON));
    let (height, reach) = (normal.dot(to), normal.abs().dot(half) + margin);
    let side = i8::from(height > reach) - i8::from(height < -reach);
    if mirrored { -side } else { side }
}
