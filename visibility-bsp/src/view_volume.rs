//! The volume of a view, for boxes and polygons in scene coordinates: outside only beyond the error of its
//! planes.

use visibility_core::{
    Aabb, Scene, View,
    geometry::{Containment, Plane},
    glam::DVec3,
    view::MAX_PLANES,
};

#[derive(Clone, Debug)]
pub(crate) struct ViewVolume {
    /// The planes of the view, moved outwards by their errors.
    planes: [Plane; MAX_PLANES],
    count: usize,
}

impl ViewVolume {
    pub(crate) fn new(view: &View, scene: &Scene) -> Self {
        let mut volume = Self { planes: [Plane::new(DVec3::ZERO, 1.0); MAX_PLANES], count: 0 };
        for of_view in view.planes(scene.origin()).as_slice() {
            let Plane { normal, offset } = of_view.plane;
            // Each component of the normal is within 4 units of round-off, which the widest coordinate
            // multiplies.
            volume.planes[volume.count] =
                Plane::new(normal, offset + 2.0 * of_view.error + 16.0 * f64::EPSILON * offset.abs());
            volume.count += 1;
        }
        volume
    }

    /// The planes, one bit each, that a box is wholly inside of, given some of them: no others matter for
    /// what is in the box. `None` if no point of it is in view.
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

    /// Whether a mask of planes is that of all planes.
    #[inline]
    pub(crate) fn is_inside(&self, planes: u32) -> bool {
        planes == (1 << self.count) - 1
    }

    /// Whether no point of a box is in view.
    pub(crate) fn is_outside(&self, bounds: &Aabb) -> bool {
        self.planes[..self.count].iter().any(|plane| plane.classify_aabb(bounds) == Containment::Outside)
    }

    /// Whether all of a polygon is beyond one plane.
    pub(crate) fn is_polygon_outside(&self, vertices: &[DVec3]) -> bool {
        let is_beyond = |plane: &Plane| {
            vertices.iter().all(|&v| plane.signed_distance(v) < -4.0 * plane.error_bound(v.abs()))
        };
        self.planes[..self.count].iter().any(is_beyond)
    }
}
