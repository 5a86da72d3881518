//! Shapes that objects are placed into cells by: their triangles, or the solid box of their bounds.

use visibility_core::glam::DVec3;
use visibility_core::{ObjectId, OccluderMesh, Scene};

/// One triangle or box of an object, in scene coordinates unless mapped.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    Triangle([DVec3; 3]),
    /// Everything between the least and the greatest corner of a box.
    Solid(DVec3, DVec3),
}

/// Corners of a shape: three or eight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corners {
    points: [DVec3; 8],
    count: usize,
}

impl Corners {
    pub(crate) fn as_slice(&self) -> &[DVec3] {
        &self.points[..self.count]
    }
}

impl Shape {
    pub(crate) fn corners(&self) -> Corners {
        let mut corners = Corners { points: [DVec3::ZERO; 8], count: 0 };
        match self {
            Self::Triangle(triangle) => {
                corners.points[..3].copy_from_slice(triangle);
                corners.count = 3;
            }
            Self::Solid(min, max) => {
                for (i, point) in corners.points.iter_mut().enumerate() {
                    let far = |axis: usize| if i >> axis & 1 != 0 { max[axis] } else { min[axis] };
                    *point = DVec3::new(far(0), far(1), far(2));
                }
                corners.count = 8;
            }
        }
        corners
    }

    /// The first corner.
    pub(crate) fn corner(&self) -> DVec3 {
        match self {
            Self::Triangle([a, ..]) | Self::Solid(a, _) => *a,
        }
    }

    /// The shape with `map` applied to its corners. `map` must act on each axis alone and keep the order of
    /// coordinates.
    pub(crate) fn map(&self, map: impl Fn(DVec3) -> DVec3) -> Self {
        match self {
            Self::Triangle(triangle) => Self::Triangle(triangle.map(map)),
            Self::Solid(min, max) => Self::Solid(map(*min), map(*max)),
        }
    }

    /// Calls `each` with the triangle itself, or with the twelve triangles of the box.
    pub(crate) fn for_each_triangle(&self, mut each: impl FnMut(&[DVec3; 3])) {
        match self {
            Self::Triangle(triangle) => each(triangle),
            Self::Solid(..) => {
                let corners = self.corners().points;
                for triangle in OccluderMesh::CUBOID {
                    each(&triangle.map(|corner| corners[corner as usize]));
                }
            }
        }
    }
}

/// Calls `each` for every shape of an object: its triangles, or its bounds if it has no triangles or one of
/// them is not finite. Calls nothing for bounds that are empty, infinite or NaN, and for an unknown object.
pub(crate) fn for_each_shape(scene: &Scene, id: ObjectId, each: &mut dyn FnMut(&Shape)) {
    let triangles = scene.triangles(id).unwrap_or(&[]);
    let Ok(bounds) = scene.bounds(id) else { return };
    if !bounds.is_finite() {
        return;
    }
    // A triangle that cannot be placed may yet be drawn, somewhere within the bounds.
    if triangles.is_empty() || !triangles.iter().flatten().all(|p| p.is_finite()) {
        return each(&Shape::Solid(bounds.min.as_dvec3(), bounds.max.as_dvec3()));
    }
    for triangle in triangles {
        each(&Shape::Triangle(triangle.map(|p| p.as_dvec3())));
    }
}
