//! Whether a transform mirrors: the fronts of triangles are then on the side from which their corners run
//! clockwise.

use glam::{Affine3A, DVec3};

/// Returns whether a transform keeps the orientation of triangles (true) or mirrors them (false). `None` if
/// rounding leaves the sign of its determinant uncertain, as for a transform that flattens, and for NaN.
///
/// The determinant is computed in `f64`. In `f32` it underflows to zero where axes are shorter than about
/// 1e-15, and rounding may turn its sign where axes are nearly in a plane.
///
/// ```
/// use visibility_core::geometry::keeps_orientation;
/// use visibility_core::glam::{Affine3A, Vec3};
/// let scaled = |x, y, z| keeps_orientation(&Affine3A::from_scale(Vec3::new(x, y, z)));
/// assert_eq!(scaled(1e-16, 1e-16, 1e-16), Some(true));
/// assert_eq!(scaled(-1e-16, 1e-16, 1e-16), Some(false));
/// assert_eq!(scaled(1.0, 0.0, 1.0), None);
/// ```
#[inline(always)]
pub fn keeps_orientation(transform: &Affine3A) -> Option<bool> {
    let axes = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
    let [a, b, c] = axes.map(|axis| DVec3::from_array(axis.to_array().map(f64::from)));
    let (volume, most) = (
        a.dot(b.cross(c)),
        a.abs().dot(b.abs().cross(c.abs()).abs() + b.abs().max_element() * c.abs().max_element()),
    );
    // The volume is a sum of six products of three factors, each rounded a few times.
    (volume.abs() > 32.0 * f64::EPSILON * most).then_some(volume > 0.0)
}
