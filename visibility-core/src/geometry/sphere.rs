//! Bounding spheres in `f32`.

use crate::Aabb;
use glam::Vec3;

/// A bounding sphere, in metres relative to the origin of its scene. A sphere with a negative radius or a NaN
/// is *improper* and is never culled.
///
/// ```
/// use visibility_core::{geometry::Sphere, glam::Vec3, Aabb};
/// let sphere = Sphere::around(&Aabb::from_arrays([-1.0; 3], [1.0; 3]));
/// assert!(sphere.radius >= 3f32.sqrt() && sphere.center == Vec3::ZERO);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sphere {
    /// Centre of the sphere, relative to the scene's origin.
    pub center: Vec3,
    /// Radius in metres. A negative or NaN radius makes the sphere improper.
    pub radius: f32,
}

impl Sphere {
    /// Returns the sphere with the given centre and radius, unchecked.
    pub const fn new(center: Vec3, radius: f32) -> Self {
        Self { center, radius }
    }

    /// Tests whether the sphere is proper: no coordinate is NaN, and `radius >= 0`.
    pub fn is_proper(&self) -> bool {
        !self.center.is_nan() && self.radius >= 0.0
    }

    /// Returns a sphere around the centre of a box that certainly contains the box if it is proper and
    /// finite: the radius is rounded upwards. An [improper](Aabb::is_proper) box, such as one with a NaN or
    /// [`Aabb::EMPTY`], gives an improper sphere. Other infinite coordinates give an unspecified sphere.
    pub fn around(bounds: &Aabb) -> Self {
        let center = bounds.center();
        if !bounds.is_proper() {
            return Self::new(center, f32::NAN);
        }
        let far = (bounds.max - center).max(center - bounds.min).as_dvec3();
        // `far` carries one `f32` rounding (2^-24 relative, or half the least denormal), and the `f64` length
        // is rounded to `f32`: less than two steps together. The third step is spare.
        Self::new(center, (far.length() as f32).next_up().next_up().next_up())
    }

    /// Returns the axis-aligned box around the sphere, rounded outwards. An improper sphere gives
    /// [`Aabb::EMPTY`].
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_improper_box_gives_a_sphere_that_is_never_culled() {
        let turned = Aabb::from_arrays([2.0, 0.0, 0.0], [1.0, 1.0, 1.0]);
        let nan = Aabb::from_arrays([f32::NAN, 0.0, 0.0], [1.0, 1.0, 1.0]);
        for bounds in [turned, nan, Aabb::EMPTY] {
            assert!(!Sphere::around(&bounds).is_proper(), "{bounds:?}");
        }
    }
}
