//! The triangulated image as an occlusion map of core's driver.

use super::image::Image;
use super::screen::{BoxPlace, Projected, Screen};
use super::shape::Shapes;
use super::{DepthOrder, PartlyHidden};
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::occlusion::Occlusion;
use visibility_core::view::ViewPlanes;
use visibility_core::{Aabb, Accuracy, OccluderMesh, OcclusionMap, View};

/// Default and greatest number of vertices of the image.
const MOST_VERTICES: usize = 3072;

/// Slices of the depth range of a parallel view, for [`DepthOrder::Cells`].
const SLICES: f64 = 16.0;

/// An occlusion map at object precision: outlines of occluders in a triangulation of the image.
///
/// Independent of any resolution: two occluders that overlap by a millionth of the image leave no gap.
/// Occluders that only touch do. Conservative. Convex solids are entered by their outline, other meshes by
/// groups of neighbouring triangles that look convex from the eye.
///
/// # Cost
/// Some 10 us for an occluder, and more where outlines cross; below a microsecond for a box that is visible,
/// and up to some 10 us for a hidden one. Memory is about 300 bytes for each vertex.
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
    most: usize,
    partly_hidden: PartlyHidden,
    order: DepthOrder,
    screen: Screen,
    clip_planes: ViewPlanes,
    shapes: Shapes,
    /// Number of shapes that are in the image.
    entered: usize,
    image: Image,
    projected: Projected,
}

impl Default for ViewCdt {
    fn default() -> Self {
        Self::new()
    }
}

impl ViewCdt {
    /// Makes an empty map, which hides nothing inside the image before the first frame.
    pub fn new() -> Self {
        let mut image = Image::default();
        image.clear();
        Self {
            most: MOST_VERTICES,
            partly_hidden: PartlyHidden::default(),
            order: DepthOrder::default(),
            screen: Screen::BLIND,
            clip_planes: ViewPlanes::NONE,
            shapes: Shapes::default(),
            entered: 0,
            image,
            projected: Projected::default(),
        }
    }

    /// Sets the number of vertices of the image from which on no occluder is entered, at most 3,072, which
    /// is the default. An occluder has some six, and as many as it crosses outlines.
    #[must_use]
    pub fn with_vertices(self, most: usize) -> Self {
        Self { most: most.min(MOST_VERTICES), ..self }
    }

    /// Sets what becomes of partly hidden occluders.
    #[must_use]
    pub fn with_partly_hidden(self, partly_hidden: PartlyHidden) -> Self {
        Self { partly_hidden, ..self }
    }

    /// Sets how the map tells near from far.
    #[must_use]
    pub fn with_order(self, order: DepthOrder) -> Self {
        Self { order, ..self }
    }

    /// Returns the number of vertices of the image, four of which bound it.
    pub fn vertices(&self) -> usize {
        self.image.len()
    }

    /// Replaces the depth of shapes by that of their cells, from a shape on. Shapes that are incident on
    /// several are left out or keep their depth.
    fn sort_into_cells(&mut self, first: usize, incident: bool) {
        let mut kept = first;
        for index in first..self.shapes.list.len() {
            let shape = &mut self.shapes.list[index];
            let [floor, ceiling] =
                [shape.floor, shape.ceiling].map(|key| far_end(key, self.screen.is_perspective));
            if floor == ceiling && ceiling.is_finite() {
                (shape.floor, shape.planes) = (floor, 0..0);
            } else if !incident {
                continue;
            }
            self.shapes.list.swap(kept, index);
            kept += 1;
        }
        self.shapes.list.truncate(kept);
    }
}

/// Returns the far end of the cell of a depth key: at most the key.
fn far_end(key: f64, is_perspective: bool) -> f64 {
    let slice = key * SLICES;
    if is_perspective && key > 0.0 {
        // A power of two: the key is the reciprocal of a distance.
        f64::from_bits(key.to_bits() & (0x7ff << 52))
    } else if !is_perspective && slice.abs() < 1e15 {
        let whole = slice as i64 as f64;
        (if whole > slice { whole - 1.0 } else { whole }) / SLICES
    } else {
        f64::NEG_INFINITY
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
        let first = self.shapes.list.len();
        let parts = occluder.parts();
        for part in if parts.is_empty() { core::slice::from_ref(occluder) } else { parts } {
            if self.screen.project(part.positions(), transform, &mut self.projected) {
                self.shapes.add(part, &self.projected, facing);
            }
        }
        if let DepthOrder::Cells { incident } = self.order {
            self.sort_into_cells(first, incident);
        }
    }

    fn flush(&mut self) {
        let split = self.partly_hidden == PartlyHidden::Split;
        for number in self.entered..self.shapes.list.len() {
            if self.image.len() < self.most {
                self.image.add(&self.shapes, number as u32, split);
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
    use visibility_testing::{UNIT, ends};

    /// Depth keys around every border of cells: the far end of the cell that holds the key.
    #[test]
    fn depth_keys_are_in_the_cell_of_their_far_end() {
        for end in ends(-5, 5).into_iter().filter(|end| end.value == 0.0 || end.value.is_normal()) {
            let far = far_end(end.value / SLICES, false);
            assert_eq!(far * SLICES, end.rank.div_euclid(UNIT) as f64, "{end:?}");
            let (key, far) = (end.value, far_end(end.value, true));
            let is_cell = far <= key && (key < 2.0 * far || key < f64::MIN_POSITIVE);
            assert!(is_cell && (far <= 0.0 || far.log2().fract() == 0.0), "{end:?}: {far}");
        }
        for key in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300] {
            assert_eq!(far_end(key, false), f64::NEG_INFINITY);
        }
        assert_eq!([f64::NAN, 0.0, -1.0].map(|key| far_end(key, true)), [f64::NEG_INFINITY; 3]);
    }
}
