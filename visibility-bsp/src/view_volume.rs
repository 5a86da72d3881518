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
    /// Number of planes of the view: the valid entries in `planes`.
    count: usize,
}

impl ViewVolume {
    /// Builds the volume of `view`, widened by `margin` metres, in metres relative to `scene.origin()`.
    ///
    /// Normals are off by up to `4 u` of each component beside a common factor, as
    /// [`ViewPlane`](visibility_core::view::ViewPlane) states. For a point on the exact plane, let `s` be the
    /// sum of the terms' magnitudes without the offset. The products are rounded by `u s` and the partial
    /// sums by `u s` and `u` of the offset. So the `6 u` of [`Plane::error_bound`] cover normals and
    /// arithmetic.
    pub(crate) fn new(view: &View, scene: &Scene, margin: f64) -> Self {
        let sides = view.planes(scene.origin());
        let mut volume =
            Self { planes: [Plane::new(DVec3::ZERO, 1.0); MAX_PLANES], count: sides.as_slice().len() };
        for (plane, side) in volume.planes.iter_mut().zip(sides.as_slice()) {
            *plane = Plane::new(side.plane.normal, side.plane.offset + side.error + margin);
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
        let is_beyond =
            |plane: &Plane| vertices.iter().all(|&v| plane.signed_distance(v) < -plane.error_bound(v.abs()));
        self.planes[..self.count].iter().any(is_beyond)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::{glam::DMat4, view::Depth};
    use visibility_testing::Random;

    /// Matrices and origins of whole numbers, and points within some units in the last place of the left
    /// plane. The oracle is exact 128-bit arithmetic.
    #[test]
    fn points_are_outside_only_if_they_exactly_are() {
        let mut random = Random(14);
        let mut whole = |bits: u32| (random.bits() >> (63 - bits)) as i64 - (1 << bits);
        let (mut outside, mut open) = (0, 0);
        for round in 0..40_000i64 {
            let rows = [(); 4].map(|()| [(); 3].map(|()| whole(51)));
            let point = [(); 3].map(|()| whole(22));
            // The view's origin relative to the scene's. Far away, terms cancel in the planes' offsets.
            let origin = [(); 3].map(|()| whole([0, 40][(round % 2) as usize]));
            let left = [0, 1, 2].map(|i| rows[3][i] + rows[0][i]);
            let dot =
                |a: [i64; 3], b: [i64; 3]| (0..3).map(|i| i128::from(a[i]) * i128::from(b[i])).sum::<i128>();
            let from_view = [0, 1, 2].map(|i| point[i] - origin[i]);
            let constant = -dot(left, from_view) as f64;
            let constant = constant * (1.0 + (round / 2 % 32 - 16) as f64 * f64::EPSILON);
            let exact = dot(left, from_view) + constant as i128;
            let vector = |v: [i64; 3]| DVec3::from_array(v.map(|x| x as f64));
            let row = |i: usize| vector(rows[i]).extend(if i == 3 { constant } else { 0.0 });
            let matrix = DMat4::from_cols(row(0), row(1), row(2), row(3)).transpose();
            let Ok(view) = View::from_clip_from_world(matrix, Depth::ZeroToOne) else { continue };
            let Ok(view) = view.relative_to(vector(origin)) else { continue };
            let volume = ViewVolume::new(&view, &Scene::new(), 0.0);
            let point = vector(point);
            let plane = ViewVolume { count: 1, ..volume };
            let is_outside = plane.is_outside(&Aabb::new(point.as_vec3(), point.as_vec3()));
            assert_eq!(is_outside, plane.is_polygon_outside(&[point]), "round {round}: box and point");
            assert!(!is_outside || exact < 0, "round {round}: {exact} at {point}, {:?}", plane.planes[0]);
            if is_outside { outside += 1 } else { open += 1 }
        }
        assert!(outside > 3_000 && open > 3_000, "{outside} points outside, {open} not");
    }

    #[test]
    fn a_volume_is_widened_by_its_margin() {
        let pose = visibility_core::Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.5, 9.0).unwrap();
        let point = |x: f32| Aabb::from_arrays([x, 0.0, 0.0], [x, 0.0, 0.0]);
        for (x, margin, is) in [(0.4, 0.0, true), (0.4, 0.11, false), (0.4, 0.09, true), (0.6, 0.0, false)] {
            let volume = ViewVolume::new(&view, &Scene::new(), margin);
            assert_eq!(volume.is_outside(&point(x)), is, "at {x}, margin {margin}");
            assert_eq!(volume.is_polygon_outside(&[DVec3::X * f64::from(x)]), is, "a polygon at {x}");
            assert_eq!(volume.inside_of(0, &point(x)).is_none(), is, "planes of a box at {x}");
        }
        let volume = ViewVolume::new(&view, &Scene::new(), 0.0);
        let known = volume.inside_of(0, &point(1.0)).unwrap();
        assert!(volume.is_inside(known), "a point in view");
        assert!(!volume.is_inside(volume.inside_of(0, &point(9.0)).unwrap()), "a point on the far plane");
        assert!(
            volume.meets_sphere(DVec3::X * 0.4, 0.11) && !volume.meets_sphere(DVec3::X * 0.4, 0.09),
            "spheres"
        );
    }
}
