//! Spheres in `f32`, by centre and radius.

use glam::{DVec3, Vec3};

/// A closed ball, in metres relative to the origin of its scene. A sphere with a negative radius or a NaN is
/// *improper*: it bounds nothing that can be relied on, and queries count every object as touching it.
///
/// ```
/// use visibility_core::{geometry::Sphere, glam::Vec3};
/// assert!(Sphere::new(Vec3::ZERO, 0.0).is_proper());
/// assert!(!Sphere::new(Vec3::ZERO, -1.0).is_proper());
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::Pod, bytemuck::Zeroable))]
#[repr(C)]
pub struct Sphere {
    /// Centre of the sphere, relative to the scene's origin.
    pub center: Vec3,
    /// Radius in metres. 0 is a point, infinity all of space. A negative or NaN radius makes the sphere
    /// improper.
    pub radius: f32,
}

impl Sphere {
    /// Returns the sphere with the given centre and radius, unchecked.
    pub const fn new(center: Vec3, radius: f32) -> Self {
        Self { center, radius }
    }

    /// Converts a world-space `f64` sphere to an `f32` sphere relative to `origin` that contains it. The
    /// radius grows by at most 2^-21 times the sum of itself and the distance of the centre from `origin`,
    /// and by four times the least denormal number. An improper sphere stays improper.
    pub fn from_world(center: DVec3, radius: f64, origin: DVec3) -> Self {
        let exact = center - origin;
        let rounded = exact.as_vec3();
        // The difference is rounded by 2^-53 of itself on each axis, its conversion by 2^-24 or half of the
        // least denormal: less than 2^-23 of the sum of the axes. One step up covers the conversion of the
        // radius and the sums in f64, the second step the halves of the least denormal.
        let shift = exact.abs().element_sum() * (0.5 * f64::from(f32::EPSILON));
        let grown = ((radius + 2.0 * shift) as f32).next_up().next_up();
        Self::new(rounded, if radius >= 0.0 { grown } else { f32::NAN })
    }

    /// Tests whether the sphere is proper: no coordinate is NaN, and `radius >= 0`.
    pub fn is_proper(&self) -> bool {
        !self.center.is_nan() && self.radius >= 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::DoubleDouble;
    use visibility_testing::Random;

    /// Returns whether a sphere of `f32` certainly holds a ball of the world. The distance of the two centres
    /// is summed in twice the digits.
    fn holds(sphere: &Sphere, center: DVec3, radius: f64, origin: DVec3) -> bool {
        let off = |axis: usize| {
            let exact = DoubleDouble::difference(center[axis], origin[axis]);
            let off = exact.plus(DoubleDouble::from(-f64::from(sphere.center[axis])));
            off.hi
        };
        let off = DVec3::new(off(0), off(1), off(2)).length();
        let room = DoubleDouble::difference(f64::from(sphere.radius), radius);
        room.plus(DoubleDouble::from(-off)).hi >= -1e-15 * off
    }

    #[test]
    fn rounded_spheres_hold_the_given_ones() {
        let mut rng = Random(1);
        for case in 0..50_000 {
            let size = 2f64.powi(rng.between(-140, 60));
            let origin = rng.fine_vector(1.0) * rng.pick(&[0.0, 1.0, 1e7]) * size;
            // Half of the centres are half-way between two numbers of `f32`, where rounding is worst.
            let mut center = rng.fine_vector(size);
            if rng.one_in(2) {
                let ulp = |x: f64| f64::from((x as f32).abs().next_up()) - f64::from((x as f32).abs());
                let half = |x: f64| f64::from(x as f32) + 0.5 * ulp(x);
                center = DVec3::new(half(center.x), half(center.y), half(center.z));
            }
            if rng.one_in(4) {
                center[rng.below(3)] = 0.0;
            }
            let radius = rng.fine_unit() * size * rng.pick(&[0.0, 1e-9, 1.0]);
            let sphere = Sphere::from_world(center + origin, radius, origin);
            assert!(
                holds(&sphere, center + origin, radius, origin),
                "case {case}: {sphere:?} holds the ball of {radius} around {center} from {origin}"
            );
            let room = 2f64.powi(-21) * (radius + (center + origin - origin).abs().element_sum());
            let most = radius + room + 4.0 * f64::from(f32::from_bits(1));
            assert!(f64::from(sphere.radius) <= most, "case {case}: {sphere:?} is larger than {most}");
        }
    }

    #[test]
    fn spheres_of_which_only_the_radius_is_rounded_are_enlarged() {
        let (zero, mut rng) = (DVec3::ZERO, Random(2));
        for _ in 0..1000 {
            let radius = rng.fine_unit();
            let sphere = Sphere::from_world(zero, radius, zero);
            assert!(f64::from(sphere.radius) >= radius, "{sphere:?} holds a radius of {radius}");
        }
        // Half of the least number is rounded away along each axis, and nearly as much of the radius.
        let half = 0.5 * f64::from(f32::from_bits(1));
        let (center, radius) = (DVec3::splat(half), half.next_down());
        let least = Sphere::from_world(center, radius, zero);
        assert!(holds(&least, center, radius, zero), "{least:?} holds a ball of half the least number");
    }

    #[test]
    fn improper_spheres_stay_improper() {
        for radius in [-1.0, -1e-300, f64::NAN] {
            assert!(!Sphere::from_world(DVec3::ONE, radius, DVec3::ZERO).is_proper(), "radius {radius}");
        }
        assert!(Sphere::new(Vec3::ONE, 0.0).is_proper(), "a point is proper");
        for (center, radius) in [(Vec3::NAN, 1.0), (Vec3::ZERO, -1.0), (Vec3::ZERO, f32::NAN)] {
            assert!(!Sphere::new(center, radius).is_proper(), "{center} with radius {radius}");
        }
    }
}
