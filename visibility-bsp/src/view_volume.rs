//! The view volume as planes in scene coordinates, for tests of boxes and polygons. A box or polygon counts
//! as outside only if it is beyond a plane by more than the plane's rounding error.

use visibility_core::{
    Aabb, Scene, View,
    geometry::{Containment, Plane},
    glam::DVec3,
    view::{MAX_PLANES, ViewPlane},
};

/// The view volume of one frame in metres relative to `Scene::origin`. A point is in view if it is in front
/// of every plane.
#[derive(Clone, Debug)]
pub(crate) struct ViewVolume {
    /// Planes of the view volume, normals inwards, each moved outwards by a bound on its rounding error.
    /// Only the first `count` are valid.
    planes: [Plane; MAX_PLANES],
    /// Number of planes of the view: the valid entries in `planes`.
    count: usize,
}

impl ViewVolume {
    /// Builds the volume of `view` in metres relative to `scene.origin()`, for tests of boxes and polygons at
    /// any distance.
    pub(crate) fn new(view: &View, scene: &Scene) -> Self {
        // Each normal component is within 4 units of round-off of its exact value, and the widest coordinate
        // multiplies that error. `16 EPSILON |offset|` covers the product.
        Self::with_offsets(view, scene, |ViewPlane { plane: Plane { offset, .. }, error }| {
            offset + 2.0 * error + 16.0 * f64::EPSILON * offset.abs()
        })
    }

    /// Builds the volume of `view` in metres relative to `scene.origin()`, for choosing occluders. Each plane
    /// is moved outwards by the error of its offset only. The error of its normal, whose effect grows with
    /// distance, is covered by [`new`](Self::new) alone.
    pub(crate) fn for_selection(view: &View, scene: &Scene) -> Self {
        Self::with_offsets(view, scene, |side| side.plane.offset + side.error)
    }

    /// Builds the volume of `view` with the plane offsets in metres that `offset` returns.
    fn with_offsets(view: &View, scene: &Scene, offset: impl Fn(&ViewPlane) -> f64) -> Self {
        let sides = view.planes(scene.origin());
        let mut volume =
            Self { planes: [Plane::new(DVec3::ZERO, 1.0); MAX_PLANES], count: sides.as_slice().len() };
        for (plane, side) in volume.planes.iter_mut().zip(sides.as_slice()) {
            *plane = Plane::new(side.plane.normal, offset(side));
        }
        volume
    }

    /// Tests whether a sphere, in metres relative to `Scene::origin`, reaches to the inner side of every
    /// plane, up to rounding. False if NaN.
    pub(crate) fn meets_sphere(&self, center: DVec3, radius: f64) -> bool {
        self.planes[..self.count].iter().all(|plane| plane.signed_distance(center) > -radius)
    }

    /// Returns a mask of the planes that surely have all of a box, in metres relative to `Scene::origin`, on
    /// their inner side; bit i stands for plane i. Planes set in `known` (found for an enclosing box) are not
    /// tested again and stay set. A plane's bit stays clear if the box crosses the plane or rounding leaves
    /// this open, and for a box that is inverted or NaN. Returns `None` if the box is surely outside one
    /// plane, so that no point of the box is in view.
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
    /// in view. False if some plane is not set.
    #[inline]
    pub(crate) fn is_inside(&self, planes: u32) -> bool {
        planes == (1 << self.count) - 1
    }

    /// Tests whether a box in metres relative to `Scene::origin` is surely outside one plane, so that no
    /// point of the box is in view. False if undecided and for an inverted or NaN box.
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
