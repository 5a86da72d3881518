//! What objects are placed by: their triangles, or, where the scene has none, all that their bounds contain.

use crate::overlap::triangle_meets_box;
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, ObjectId, OccluderMesh, Scene};

/// A part of an object, in scene coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Part {
    Triangle([DVec3; 3]),
    /// Everything in a box.
    Solid(Aabb),
}

impl Part {
    pub(crate) fn for_each_corner(&self, mut each: impl FnMut(DVec3)) {
        match self {
            Self::Triangle(triangle) => triangle.iter().for_each(|&p| each(p)),
            Self::Solid(bounds) => bounds.corners().iter().for_each(|p| each(p.as_dvec3())),
        }
    }

    /// The part itself, or its surface.
    pub(crate) fn for_each_triangle(&self, mut each: impl FnMut(&[DVec3; 3])) {
        match self {
            Self::Triangle(triangle) => each(triangle),
            Self::Solid(bounds) => {
                let corners = bounds.corners().map(|p| p.as_dvec3());
                for triangle in OccluderMesh::CUBOID {
                    each(&triangle.map(|corner| corners[corner as usize]));
                }
            }
        }
    }

    /// Whether it meets a cube. True where rounding could tell otherwise.
    pub(crate) fn meets_box(&self, center: DVec3, half: f64) -> bool {
        match self {
            Self::Triangle(triangle) => triangle_meets_box(triangle, center, DVec3::splat(half)),
            Self::Solid(bounds) => {
                // The cube's faces are each rounded twice, by 2^-53 of `center` and `half`.
                let reach = DVec3::splat(half * (1.0 + 1e-12)) + center.abs() * 1e-12;
                let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
                min.cmple(center + reach).all() && max.cmpge(center - reach).all()
            }
        }
    }
}

/// Calls `each` for all that an object is placed by; for nothing if its bounds bound nothing.
pub(crate) fn for_each_part(scene: &Scene, id: ObjectId, each: &mut dyn FnMut(&Part)) {
    let triangles = scene.triangles(id).unwrap_or(&[]);
    let Ok(bounds) = scene.bounds(id) else { return };
    if !bounds.is_finite() {
        return;
    }
    // A triangle that cannot be placed may yet be drawn, somewhere within the bounds.
    if triangles.is_empty() || !triangles.iter().flatten().all(|p| p.is_finite()) {
        return each(&Part::Solid(bounds));
    }
    for triangle in triangles {
        each(&Part::Triangle(triangle.map(|p| p.as_dvec3())));
    }
}
