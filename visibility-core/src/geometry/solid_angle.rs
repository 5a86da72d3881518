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

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    #[test]
    fn angles_are_right_to_a_few_thousandths() {
        let mut rng = Random(1);
        let mut wide = 0;
        for case in 0..20_000 {
            let first = rng.direction();
            let reach = rng.pick(&[0.01, 0.3, 1.0, 3.0, 100.0]);
            let [b, c] = [(); 2].map(|()| (first + rng.direction() * reach).normalize());
            let y = first.dot(b.cross(c)).abs();
            let x = 1.0 + first.dot(b) + b.dot(c) + c.dot(first);
            let exact = 2.0 * y.atan2(x);
            wide += u32::from(exact > PI);
            let found = solid_angle([first, b, c]);
            assert!((found - exact).abs() <= 0.01, "case {case}: {found} is not {exact}");
            assert!((solid_angle([c, first, b]) - found).abs() <= 1e-9, "case {case}: another order");
        }
        assert!(wide > 200, "{wide} triangles are wider than half of all directions");
    }

    #[test]
    fn degenerate_triangles_have_no_angle() {
        assert_eq!(solid_angle([DVec3::NAN, DVec3::X, DVec3::Y]), 0.0, "a NaN");
        assert_eq!(solid_angle([DVec3::X; 3]), 0.0, "all corners in one direction");
        assert_eq!(solid_angle([DVec3::X, DVec3::NEG_X, DVec3::X]), 0.0, "opposite corners");
        let high = 0.75f64.sqrt();
        let around = [DVec3::X, DVec3::new(-0.5, high, 0.0), DVec3::new(-0.5, -high, 0.0)];
        assert!((solid_angle(around) - 2.0 * PI).abs() < 0.01, "a triangle around the eye is half of all");
    }
}
