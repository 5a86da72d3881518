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
    /// radius grows by at most 2^-22 times the sum of itself and the distance of the centre from `origin`. An
    /// improper sphere stays improper.
    pub fn from_world(center: DVec3, radius: f64, origin: DVec3) -> Self {
        let exact = center - origin;
        let rounded = exact.as_vec3();
        // The difference is rounded by 2^-53 of itself on each axis, its conversion by 2^-24 or half of the
        // least denormal: less than 2^-23 of the sum of the axes. One step up covers the conversion of the
        // radius, the second step the sums in f64.
        let shift = exact.abs().element_sum() * (0.5 * f64::from(f32::EPSILON));
        let grown = ((radius + 2.0 * shift) as f32).next_up().next_up();
        Self::new(rounded, if radius >= 0.0 { grown } else { f32::NAN })
    }

    /// Tests whether the sphere is proper: no coordinate is NaN, and `radius >= 0`.
    pub fn is_proper(&self) -> bool {
        !self.center.is_nan() && self.radius >= 0.0
    }
}
