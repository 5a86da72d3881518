//! The triangulated image as an occlusion map for core's driver.

use super::image::Image;
use super::screen::{BoxPlace, Projected, Screen};
use super::shape::Shapes;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::occlusion::Occlusion;
use visibility_core::view::ViewPlanes;
use visibility_core::{Aabb, Accuracy, OccluderMesh, OcclusionMap, View};

/// Default and greatest number of vertices of the image.
const MAX_VERTICES: usize = 3072;

/// Occlusion map at object precision: a triangulation of the image with the outlines of occluders.
///
/// It has no pixels: two occluders that overlap by a millionth of the image leave no gap. Occluders that only
/// touch leave one. Conservative. A convex solid is entered as one outline, other meshes as groups of
/// neighbouring triangles that look convex from the eye.
///
/// # Cost
/// About 10 us for an occluder, and more where outlines cross; less than a microsecond for a visible box, and
/// up to about 10 us for a hidden one. Memory: about 300 bytes per vertex.
///
/// ```
/// use visibility_2d::view_cdt::ViewCdt;
/// use visibility_core::glam::{Affine3A, DVec3};
/// use visibility_core::{occlusion::Occlusion, Aabb, OccluderMesh, OcclusionMap, Pose, View};
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY)?;
/// let mut map = ViewCdt::new();
/// map.begin(&view, DVec3::ZERO);
/// // Two slabs that overlap in the middle: neither alone hides what is behind both.
/// for y in [-3.0, -0.5] {
///     let slab = Aabb::from_arrays([4.0, y, -3.0], [4.5, y + 3.5, 3.0]);
///     map.add(&OccluderMesh::cuboid(&slab)?, &Affine3A::IDENTITY);
/// }
/// map.flush();
/// assert_eq!(map.test(&Aabb::from_arrays([8.0, -1.0, -1.0], [9.0, 1.0, 1.0])), Occlusion::Hidden);
/// assert_eq!(map.test(&Aabb::from_arrays([2.0, -1.0, -1.0], [3.0, 1.0, 1.0])), Occlusion::Partial);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct ViewCdt {
    /// Number of vertices of the image at which no further occluder is added.
    most: usize,
    screen: Screen,
    clip_planes: ViewPlanes,
    shapes: Shapes,
    /// Number of shapes, from the start of `shapes.list`, whose outlines are already in `image`.
    entered: usize,
    image: Image,
    /// Scratch: projected corners of the occluder that is being added.
    projected: Projected,
}

impl Default for ViewCdt {
    fn default() -> Self {
        Self::new()
    }
}

impl ViewCdt {
    /// Makes an empty map, which hides nothing until a frame begins.
    pub fn new() -> Self {
        let mut image = Image::default();
        image.clear();
        Self {
            most: MAX_VERTICES,
            screen: Screen::BLIND,
            clip_planes: ViewPlanes::NONE,
            shapes: Shapes::default(),
            entered: 0,
            image,
            projected: Projected::default(),
        }
    }

    /// Sets the number of vertices of the image after which no more occluder is added: at most 3,072, the
    /// default. An occluder adds about six vertices, and one for each crossing with an outline.
    #[must_use]
    pub fn with_vertices(self, most: usize) -> Self {
        Self { most: most.min(MAX_VERTICES), ..self }
    }

    /// Returns the number of vertices of the image. Four of them are its corners.
    pub fn vertices(&self) -> usize {
        self.image.len()
    }
}

impl OcclusionMap for ViewCdt {
    fn name(&self) -> &str {
        "view-cdt"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        self.screen = Screen::new(view, origin);
        self.clip_planes = view.clip_planes_from(origin);
        self.shapes.clear();
        self.entered = 0;
        self.image.clear();
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        if self.image.len() >= self.most || !occluder.is_inside(&self.clip_planes, transform) {
            return;
        }
        let Some(facing) = self.screen.facing(transform) else { return };
        let parts = occluder.parts();
        for part in if parts.is_empty() { core::slice::from_ref(occluder) } else { parts } {
            if self.screen.project(part.positions(), transform, &mut self.projected) {
                self.shapes.add(part, &self.projected, facing);
            }
        }
    }

    fn flush(&mut self) {
        for number in self.entered..self.shapes.list.len() {
            if self.image.len() < self.most {
                self.image.add(&self.shapes, number as u32);
            }
        }
        self.entered = self.shapes.list.len();
    }

    fn test(&self, bounds: &Aabb) -> Occlusion {
        if !bounds.is_proper() {
            return Occlusion::Visible;
        }
        match self.screen.place(bounds) {
            BoxPlace::Outside => Occlusion::Hidden,
            BoxPlace::Inside(place) if self.image.hides(&self.shapes, &place) => Occlusion::Hidden,
            BoxPlace::Inside(_) if self.image.is_empty() => Occlusion::Visible,
            _ => Occlusion::Partial,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Pose;
    use visibility_core::geometry::Plane;

    /// Returns a map with some of two walls that overlap, and the number of vertices of its image.
    fn drawn(map: ViewCdt, planes: &[Plane]) -> (ViewCdt, usize) {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).unwrap();
        let mut map = map;
        map.begin(&view.with_clip_planes(planes).unwrap(), DVec3::ZERO);
        for y in [-3.0, -0.5] {
            let slab = Aabb::from_arrays([4.0, y, -3.0], [4.5, y + 3.5, 3.0]);
            map.add(&OccluderMesh::cuboid(&slab).unwrap(), &Affine3A::IDENTITY);
        }
        map.flush();
        let vertices = map.vertices();
        (map, vertices)
    }

    /// An image that has as many vertices as it may have takes no further occluder.
    #[test]
    fn images_have_as_many_vertices_as_they_may() {
        let all = drawn(ViewCdt::new(), &[]).1;
        assert_eq!(drawn(ViewCdt::new().with_vertices(4), &[]).1, 4, "the corners alone");
        let one = drawn(ViewCdt::new().with_vertices(5), &[]).1;
        assert!(4 < one && one < all, "{one} vertices with one wall, {all} with two");
        assert_eq!(drawn(ViewCdt::new().with_vertices(one), &[]).1, one, "as many as one wall takes");
        assert_eq!(ViewCdt::new().with_vertices(usize::MAX).most, MAX_VERTICES, "the greatest number");
        assert_eq!(ViewCdt::new().with_vertices(9).most, 9, "a lower number");
    }

    /// Occluders that a clip plane may cut hide nothing.
    #[test]
    fn occluders_at_a_clip_plane_hide_nothing() {
        let target = Aabb::from_arrays([8.0, -1.0, -1.0], [9.0, 1.0, 1.0]);
        for (least, is_hidden) in [(3.9, true), (4.1, false)] {
            let plane = Plane::through(DVec3::X * least, DVec3::X);
            let (map, _) = drawn(ViewCdt::new(), &[plane]);
            assert_eq!(map.test(&target) == Occlusion::Hidden, is_hidden, "a plane at {least}");
        }
    }
}
