//! Spheres.

use crate::Aabb;
use glam::Vec3;

/// A sphere, in metres relative to the origin of its scene.
///
/// ```
/// use visibility_core::{geometry::Sphere, glam::Vec3, Aabb};
/// let sphere = Sphere::around(&Aabb::from_arrays([-1.0; 3], [1.0; 3]));
/// assert!(sphere.radius >= 3f32.sqrt() && sphere.center == Vec3::ZERO);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sphere {
    /// The middle.
    pub center: Vec3,
    /// A sphere with a negative or NaN radius is improper, and never culled.
    pub radius: f32,
}

impl Sphere {
    /// A sphere, taken as it is.
    pub const fn new(center: Vec3, radius: f32) -> Self {
        Self { center, radius }
    }

    /// Whether the sphere bounds something: no NaN, and `radius >= 0`.
    pub fn is_proper(&self) -> bool {
        !self.center.is_nan() && self.radius >= 0.0
    }

    /// A sphere that surely contains the box: its radius is rounded upwards.
    pub fn around(bounds: &Aabb) -> Self {
        let center = bounds.center();
        let far = (bounds.max - center).max(center - bounds.min).as_dvec3();
        // `far` carries one f32 rounding (2^-24 relative, or half the least denormal), the f64 length
        // next to nothing; two steps up cover both.
        Self::new(center, (far.length() as f32).next_up().next_up().next_up())
    }

    /// The box around the sphere, rounded outwards; improper when the sphere is.
    pub fn bounds(&self) -> Aabb {
        if !self.is_proper() {
            return Aabb::EMPTY;
        }
        let r = Vec3::splat(self.radius);
        let down = (self.center - r).to_array().map(f32::next_down);
        let up = (self.center + r).to_array().map(f32::next_up);
        Aabb::from_arrays(down, up)
    }
}
