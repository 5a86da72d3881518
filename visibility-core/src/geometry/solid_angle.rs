//! The solid angle of a triangle, used to estimate how much of the view an occluder covers.

use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
use glam::DVec3;

/// Returns the solid angle in steradians of a triangle whose corners lie in the directions of three unit
/// vectors from the eye, to a few thousandths (Van Oosterom and Strackee, "The Solid Angle of a Plane
/// Triangle", 1983). The angle does not depend on the order of the corners. 0 for degenerate triangles and
/// NaN.
///
/// ```
/// use visibility_core::{geometry::solid_angle, glam::DVec3};
/// let octant = solid_angle([DVec3::X, DVec3::Y, DVec3::Z]);
/// assert!((octant - core::f64::consts::FRAC_PI_2).abs() < 0.01);
/// ```
pub fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let y = a.dot(b.cross(c)).abs();
    let x = 1.0 + a.dot(b) + b.dot(c) + c.dot(a);
    // The arc tangent of t from 0 to 1, to a few thousandths: t (1.0584 - 0.273 t).
    let arc = |t: f64| t * (FRAC_PI_4 + 0.273 * (1.0 - t));
    let angle = if x >= y {
        arc(y / x)
    } else if x >= -y {
        FRAC_PI_2 - (if x >= 0.0 { arc(x / y) } else { -arc(-x / y) })
    } else {
        PI - arc(-y / x)
    };
    if angle.is_finite() { 2.0 * angle } else { 0.0 }
}
