//! Geometry by which objects are assigned to cells: their triangles, or the solid box of their bounds.

use visibility_core::glam::DVec3;
use visibility_core::{ObjectId, OccluderMesh, Scene};

/// One triangle of an object, or the solid box that stands for an object without triangles. Coordinates are
/// in metres relative to the scene's origin, unless [`map`](Self::map) changed them.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    /// Corners of a triangle, anticlockwise seen from its front. Metres relative to `Scene::origin`, unless
    /// mapped.
    Triangle([DVec3; 3]),
    /// Minimum and maximum corner of a solid box. Metres relative to `Scene::origin`, unless mapped.
    Solid(DVec3, DVec3),
}

/// Corners of a [`Shape`], in the coordinates of the shape (metres relative to `Scene::origin`, unless
/// mapped): three of a triangle or eight of a box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corners {
    /// Corner points in the coordinates of the shape (metres relative to `Scene::origin`, unless mapped).
    /// Only the first `count` are valid.
    points: [DVec3; 8],
    /// Number of corners of the shape, 3 or 8: the valid entries of `points`.
    count: usize,
}

impl Corners {
    /// Returns the valid corners, in the shape's coordinates.
    pub(crate) fn as_slice(&self) -> &[DVec3] {
        &self.points[..self.count]
    }
}

impl Shape {
    /// Returns the corners of the shape. Corner i of a box has the maximum coordinate on each axis whose bit
    /// of i is set.
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

    /// Returns the shape's first corner: the minimum corner of a box.
    pub(crate) fn corner(&self) -> DVec3 {
        match self {
            Self::Triangle([a, ..]) | Self::Solid(a, _) => *a,
        }
    }

    /// Returns the shape with `map` applied to its corners. For a box, `map` must act on each axis separately
    /// and preserve the order of coordinates.
    pub(crate) fn map(&self, map: impl Fn(DVec3) -> DVec3) -> Self {
        match self {
            Self::Triangle(triangle) => Self::Triangle(triangle.map(map)),
            Self::Solid(min, max) => Self::Solid(map(*min), map(*max)),
        }
    }

    /// Calls `each` with the shape's triangles: the triangle itself, or the twelve outward triangles of a
    /// box.
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

/// Calls `each` for every shape of an object: its triangles, or its bounds if it has no triangles or a
/// triangle has a NaN or infinite corner. Calls `each` for nothing if the bounds are empty, infinite or NaN,
/// or the object is unknown. Coordinates are relative to the scene's origin.
pub(crate) fn for_each_shape(scene: &Scene, id: ObjectId, each: &mut dyn FnMut(&Shape)) {
    let triangles = scene.triangles(id).unwrap_or_default();
    let Ok(bounds) = scene.bounds(id) else { return };
    if !bounds.is_finite() {
        return;
    }
    // A triangle that is not finite may still be drawn, somewhere within the bounds.
    if triangles.is_empty() || !triangles.iter().flatten().all(|p| p.is_finite()) {
        return each(&Shape::Solid(bounds.min.as_dvec3(), bounds.max.as_dvec3()));
    }
    for triangle in triangles {
        each(&Shape::Triangle(triangle.map(|p| p.as_dvec3())));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Aabb;
    use visibility_core::glam::Vec3;

    /// An object is its triangles, or its box if it has none or one of them has no place.
    #[test]
    fn objects_are_triangles_if_all_of_them_have_a_place() {
        let mut scene = Scene::new();
        let (good, bad) = ([Vec3::ZERO, Vec3::X, Vec3::Y], [Vec3::ZERO, Vec3::X, Vec3::NAN]);
        for (triangles, expected) in
            [(&[good, good][..], [2, 0]), (&[][..], [0, 1]), (&[good, bad][..], [0, 1])]
        {
            let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
            scene.set_triangles(id, triangles.to_vec()).unwrap();
            let mut counts = [0; 2];
            for_each_shape(&scene, id, &mut |shape| counts[usize::from(shape.corners().count == 8)] += 1);
            assert_eq!(counts, expected, "triangles and boxes of {triangles:?}");
        }
    }
}
