//! The view volume as planes in scene coordinates, for tests of boxes and polygons. A box or polygon counts
//! as outside only if it is beyond a plane by more than the plane's rounding error.

use visibility_core::{
    Aabb, Scene, View,
    geometry::{Containment, Plane},
    glam::DVec3,
    view::MAX_PLANES,
};

/// The view volume of one frame in metres relative to `Scene::origin`. A point is in view if it is in front
/// of every plane.
#[derive(Clone, Debug)]
pub(crate) struct ViewVolume {
    /// Planes of the view volume, normals inwards, each moved outwards by a bound on its rounding error.
    /// Only the first `count` are valid.
    planes: [Plane; MAX_PLANES],
    /// Number of valid entries in `planes`.
    count: usize,
}

impl ViewVolume {
    /// Builds the volume of `view` in metres relative to `scene.origin()`.
    pub(crate) fn new(view: &View, scene: &Scene) -> Self {
        let mut volume = Self { planes: [Plane::new(DVec3::ZERO, 1.0); MAX_PLANES], count: 0 };
        for of_view in view.planes(scene.origin()).as_slice() {
            let Plane { normal, offset } = of_view.plane;
            // Each normal component is within 4 units of round-off of its exact value, and the widest
            // coordinate multiplies that error. `16 EPSILON |offset|` covers the product.
            volume.planes[volume.count] =
                Plane::new(normal, offset + 2.0 * of_view.error + 16.0 * f64::EPSILON * offset.abs());
            volume.count += 1;
        }
        volume
    }

    /// Returns a mask of the planes that a box is surely inside of; bit i stands for plane i. Planes set in
    /// `known` (from an enclosing box) are not tested again and stay set. A box that is inverted or NaN, or
    /// too close to a plane to tell, leaves that plane's bit clear. Returns `None` if the box is surely
    /// outside one plane, so that no point of the box is in view.
    #[inline]
    pub(crate) fn inside_of(&self, mut known: u32, bounds: &Aabb) -> Option<u32> {
        for (i, plane) in self.planes[..self.count].iter().enumerate() {
            if known & 1 << i != 0 {
                continue;
            }
            match plane.classify_aabb(bounds) {
                Containment::Outside => return None,
                Containment::Crossing => {}
                Containment::Inside => known |= 1 << i,
            }
        }
        Some(known)
    }

    /// Tests whether a mask returned by [`inside_of`](Self::inside_of) has every plane set: all of the box is
    /// in view.
    #[inline]
    pub(crate) fn is_inside(&self, planes: u32) -> bool {
        planes == (1 << self.count) - 1
    }

    /// Tests whether a box is surely outside one plane, so that no point of the box is in view. False for an
    /// inverted or NaN box.
    pub(crate) fn is_outside(&self, bounds: &Aabb) -> bool {
        self.planes[..self.count].iter().any(|plane| plane.classify_aabb(bounds) == Containment::Outside)
    }

    /// Tests whether all vertices of a polygon in metres relative to `Scene::origin` are beyond one and the
    /// same plane by more than rounding. False when undecided; true for a polygon without vertices.
    pub(crate) fn is_polygon_outside(&self, vertices: &[DVec3]) -> bool {
        let is_beyond = |plane: &Plane| {
            vertices.iter().all(|&v| plane.signed_distance(v) < -4.0 * plane.error_bound(v.abs()))
        };
        self.planes[..self.count].iter().any(is_beyond)
    }
}
