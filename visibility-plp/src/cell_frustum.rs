//! Tests of cells, faces and single triangles against a view's planes and eye, with bounds on rounding.
//!
//! All coordinates are in metres relative to the scene's origin.

use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{
    Aabb, View,
    geometry::sqrt,
    scene::Triangle,
    view::{Eye, MAX_PLANES, ViewPlane, ViewPlanes, ViewProjection},
};

/// Half-space `normal . p + offset >= 0`, with a bound on the rounding error of that signed distance.
#[derive(Clone, Copy, Debug)]
struct BoundedPlane {
    /// Unit normal, pointing into the view.
    normal: DVec3,
    /// Signed distance of the scene's origin from the plane in metres, positive inside of the view.
    offset: f64,
    /// Upper bound on the error of a computed signed distance, in metres.
    slack: f64,
}

impl BoundedPlane {
    /// Makes the half-space of a view plane. `reach` bounds the absolute value of every coordinate that is
    /// tested, in metres.
    fn new(plane: &ViewPlane, reach: f64) -> Self {
        let (normal, offset) = (plane.plane.normal, plane.plane.offset);
        // The centre and half size of a box, and three products and sums of each, are rounded about a dozen
        // times by 2^-53 of at most this magnitude.
        Self { normal, offset, slack: plane.error + 1e-14 * (4.0 * reach + offset.abs()) }
    }

    /// Returns the signed distance of a point from the plane in metres, positive inside of the view, up to
    /// rounding.
    fn distance(&self, p: DVec3) -> f64 {
        self.normal.x * p.x + self.normal.y * p.y + self.normal.z * p.z + self.offset
    }

    /// Returns the greatest distance along the normal between the centre of a box and any point of the box,
    /// in metres. `half` is half the box's size along each axis.
    fn extent(&self, half: DVec3) -> f64 {
        let n = self.normal.abs();
        n.x * half.x + n.y * half.y + n.z * half.z
    }
}

/// Result of classifying a cell's box against the view frustum.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum CellPlace {
    /// Certainly no view ray to anything in view passes through the box.
    Outside,
    /// View rays may pass through the box. Bit i is cleared only if the box is certainly on the inner side of
    /// plane i of the [`CellFrustum`], so 0 stands for a box certainly in view. A box between the eye and the
    /// near plane has the near plane's bit set.
    Crossing(u16),
}

/// Planes of a view, relative to the scene's origin. The planes that have the eye on their inner side, to
/// which their normals point, come first.
#[derive(Clone, Debug)]
pub(crate) struct CellFrustum {
    /// Eye point in metres, or viewing direction of a parallel view, relative to the scene's origin.
    pub(crate) eye: Eye,
    /// Bound on the error of `eye`: in metres for a point; for a direction, the length of the difference of
    /// unit vectors. Infinite where rounding leaves the eye undecided.
    pub(crate) eye_error: f64,
    /// False for an eye point that is not finite, or whose error is not certainly below half of its distance
    /// from the near plane. Its cell may then be another than that of the exact eye, with things in view
    /// between.
    knows_eye: bool,
    /// View planes; only the first `count` are valid.
    planes: [BoundedPlane; MAX_PLANES],
    /// Number of planes of the view: the valid entries of `planes`.
    count: usize,
    /// Number of leading `planes` that have the eye on their inner side, to which their normals point. No
    /// view ray to anything in view passes through a box outside of one of these planes. View rays cross
    /// each remaining plane (the near plane, portals, mirrors) before reaching anything in view.
    side_count: usize,
    /// View rays may leave a cell through a face if the face's plane is at least this far from the eye, in
    /// metres along the face's outward normal. For a parallel view: if the cosine between that normal and the
    /// viewing direction is at least this value. Slightly negative, to cover rounding.
    exit_margin: f64,
}

impl CellFrustum {
    /// Takes the planes of a view. `origin` is the scene's origin; `bounds` is the scene-relative box that
    /// contains all cells and triangles to be tested.
    pub(crate) fn new(view: &View, origin: DVec3, bounds: &Aabb) -> Self {
        let reach = f64::from(bounds.min.abs().max(bounds.max.abs()).max_element());
        let projection = ViewProjection::new(view, origin);
        let (eye, eye_error) = (projection.eye(), projection.eye_error());
        let exit_margin = match eye {
            // Point and normal have errors of a few times 2^-52 of the greatest coordinate, beside that of
            // the eye. 1e-9 of this coordinate is a million times as much, and drops no face.
            Eye::Point(eye) => -1e-9 * (reach + eye.abs().max_element()) - eye_error,
            // The cosine of two unit vectors has an error of a few times 2^-52, beside that of the direction.
            Eye::Direction(_) => -1e-9 - eye_error,
        };
        let sides = view.planes(origin);
        let knows_eye = match eye {
            Eye::Point(eye) => {
                sides.in_slot(ViewPlanes::NEAR).is_some_and(|near| is_far_before(near, eye, eye_error))
            }
            // Tests of boxes reckon with rays of any direction within the error.
            Eye::Direction(_) => true,
        };
        let none = BoundedPlane { normal: DVec3::ZERO, offset: 0.0, slack: 0.0 };
        let planes = [none; MAX_PLANES];
        let mut frustum = Self { eye, eye_error, knows_eye, planes, count: 0, side_count: 0, exit_margin };
        for with_eye_inside in [true, false] {
            for plane in sides.as_slice() {
                let mut bounded = BoundedPlane::new(plane, reach);
                let eye_is_inside = match eye {
                    Eye::Point(eye) => {
                        bounded.distance(eye) >= -plane.error - distance_rounding(eye, bounded.offset)
                    }
                    // An eye at infinity lies outside of every plane whose inner side view rays enter. The
                    // cosine is rounded by a few times 2^-53, beside the error of the direction.
                    Eye::Direction(along) => {
                        let lean = bounded.normal.dot(along);
                        let is_side = lean <= 1e-15 + eye_error;
                        if is_side {
                            // Rays that lean inwards by rounding come from this far outside of the plane.
                            bounded.slack += 4.0 * reach * (lean + eye_error).max(0.0);
                        }
                        is_side
                    }
                };
                if eye_is_inside == with_eye_inside {
                    frustum.planes[frustum.count] = bounded;
                    frustum.count += 1;
                }
            }
            if with_eye_inside {
                frustum.side_count = frustum.count;
            }
        }
        frustum
    }

    /// Returns whether the cell of the computed eye stands for that of the exact eye: no visible point is
    /// between both. True for parallel views, which begin at the boundary.
    pub(crate) fn knows_eye(&self) -> bool {
        self.knows_eye
    }

    /// Classifies a scene-relative box. Conservative: [`CellPlace::Outside`] and cleared bits of
    /// [`CellPlace::Crossing`] are certain. A box with NaN coordinates crosses all planes.
    #[inline]
    pub(crate) fn classify(&self, bounds: &Aabb) -> CellPlace {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
        let mut crossed = 0;
        for (i, plane) in self.planes[..self.count].iter().enumerate() {
            let (distance, extent) = (plane.distance(center), plane.extent(half));
            if distance + extent < -plane.slack && i < self.side_count {
                return CellPlace::Outside;
            }
            // A NaN distance does not count as inside.
            let inside = distance - extent > plane.slack;
            crossed |= u16::from(!inside) << i;
        }
        CellPlace::Crossing(crossed)
    }

    /// Tests whether view rays may leave a cell through a face. `point` is a scene-relative point of the
    /// face's plane, and `normal` the outward unit normal. False only if the eye is certainly on the outer
    /// side of the plane, to which `normal` points (for a parallel view: the rays certainly enter through the
    /// face). True for an eye in the plane and for NaN.
    #[inline]
    #[expect(clippy::neg_cmp_op_on_partial_ord, reason = "`!(a < b)` also holds for NaN")]
    pub(crate) fn may_exit_through(&self, point: DVec3, normal: DVec3) -> bool {
        match self.eye {
            Eye::Point(eye) => !(normal.dot(point - eye) < self.exit_margin),
            Eye::Direction(along) => !(normal.dot(along) < self.exit_margin),
        }
    }

    /// Tests whether a scene-relative box is certainly on the inner side (the side that the normal points to)
    /// of all planes that view rays cross before reaching anything in view, such as the near plane. False if
    /// the box touches such a plane and for NaN.
    #[cfg(feature = "papers")]
    pub(crate) fn is_beyond_near(&self, bounds: &Aabb) -> bool {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
        self.planes[self.side_count..self.count]
            .iter()
            .all(|plane| plane.distance(center) - plane.extent(half) > plane.slack)
    }

    /// Tests whether one of the selected view planes certainly has all corners of all triangles on its outer
    /// side, away from which its normal points. Bit i of `planes` selects plane i of this frustum. Triangles
    /// are scene-relative. False for NaN coordinates and if no plane is selected; without triangles, true if
    /// any plane is selected.
    #[inline]
    pub(crate) fn is_outside<'a>(
        &self,
        triangles: impl Iterator<Item = &'a Triangle> + Clone,
        planes: u16,
    ) -> bool {
        // The loop does not branch on distances, since such branches would be mispredicted half of the time.
        let mut outside = false;
        for (i, plane) in self.planes[..self.count].iter().enumerate() {
            if planes >> i & 1 != 0 {
                let beyond = |p: &Vec3| plane.distance(p.as_dvec3()) < -plane.slack;
                outside |= triangles.clone().flatten().fold(true, |all, p| all & beyond(p));
            }
        }
        outside
    }

    /// Tests whether every triangle certainly faces away from the eye. The front is the side from which the
    /// corners run anticlockwise. Triangles are scene-relative. False for degenerate triangles, an eye in a
    /// triangle's plane, and NaN. True without triangles.
    #[inline]
    pub(crate) fn sees_backs<'a>(&self, mut triangles: impl Iterator<Item = &'a Triangle>) -> bool {
        triangles.all(|triangle| {
            let [a, b, c] = triangle.map(|p| p.as_dvec3());
            let (u, v) = (b - a, c - a);
            let to_eye = match self.eye {
                Eye::Point(eye) => eye - a,
                Eye::Direction(along) => -along,
            };
            let normal = u.cross(v);
            // Differences are rounded once, and products of three differences a few more times. 16 roundings
            // of 2^-53 are 2e-15 of the product of magnitudes. The sum of nine such products is at most nine
            // times the greatest. An eye that is off by its error is that much lower or higher.
            let size = u.abs().max_element() * v.abs().max_element() * to_eye.abs().max_element();
            normal.dot(to_eye) < -(2e-14 * size + self.eye_error * normal.length())
        })
    }

    /// Returns the distance in metres from the eye to a scene-relative box: 0 inside. Infinite for a parallel
    /// view.
    #[inline]
    pub(crate) fn distance(&self, bounds: &Aabb) -> f32 {
        match self.eye {
            Eye::Point(eye) => eye.distance(eye.max(bounds.min.as_dvec3()).min(bounds.max.as_dvec3())) as f32,
            Eye::Direction(_) => f32::INFINITY,
        }
    }

    /// Returns the solid angle in steradians that some triangles cover as seen from `eye`, summed over the
    /// triangles, and the distance in metres from the eye to the box around them. No triangle covers more
    /// than a steradian or so, however near it is.
    #[inline]
    pub(crate) fn appearance<'a>(
        &self,
        eye: DVec3,
        triangles: impl Iterator<Item = &'a Triangle>,
    ) -> (f32, f32) {
        let (mut angle, mut bounds) = (0.0, Aabb::EMPTY);
        for triangle in triangles {
            let [a, b, c] = triangle.map(|p| p.as_dvec3());
            let normal = (b - a).cross(c - a) * 0.5;
            let from_center = eye - (a + b + c) / 3.0;
            let squared = from_center.length_squared();
            let cosine_area = normal.dot(from_center).abs() / sqrt(squared);
            angle += cosine_area / squared.max(normal.length());
            bounds = bounds.union(&Aabb::from_points(*triangle));
        }
        (angle as f32, self.distance(&bounds))
    }

    /// Returns the unit direction of the view ray to a scene-relative point. Zero for a point in the eye. The
    /// viewing direction for a parallel view.
    #[inline]
    pub(crate) fn direction(&self, point: DVec3) -> DVec3 {
        match self.eye {
            Eye::Point(eye) => (point - eye).normalize_or_zero(),
            Eye::Direction(along) => along,
        }
    }
}

/// Returns whether an eye with this error is certainly farther than twice the error before a view plane, on
/// its outer side.
fn is_far_before(plane: &ViewPlane, eye: DVec3, eye_error: f64) -> bool {
    let distance = -plane.plane.signed_distance(eye);
    eye_error < 0.5 * (distance - plane.error - distance_rounding(eye, plane.plane.offset))
}

/// Returns a bound on the error in metres of the signed distance of an eye from a view plane, beside the
/// error of the plane's own offset. The normal's components have relative errors of 8 * 2^-52. The magnitudes
/// of the three products sum up to at most 1.74 times the greatest coordinate, and are rounded three times by
/// 2^-53. Together this is less than 3.7 * 10^-15 of that coordinate. The sum with the offset is rounded
/// once.
fn distance_rounding(eye: DVec3, offset: f64) -> f64 {
    1e-15 * (4.0 * eye.abs().max_element() + offset.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_exact::{IntVector, Random, RandomExact, cross, dot, fine, minus, within};
    use alloc::vec::Vec;
    use visibility_core::view::{Depth, Window};
    use visibility_core::{Pose, geometry::Plane};

    /// In perspective and orthographic views, only the near plane counts as crossed by view rays. All other
    /// planes have the eye on their inner side or in the plane.
    #[test]
    fn only_the_near_plane_is_crossed_before_the_view() {
        let mut random = Random(31);
        for round in 0..3000 {
            let eye = random.direction() * 10f64.powi(round % 7);
            let pose = Pose::look_at(eye, eye + random.direction(), random.direction());
            let (angle, shape) = (1.6 + random.float(), 1.5 + random.float());
            let view = match round % 2 {
                0 => View::perspective(pose, angle, shape, 0.1, 1000.0),
                _ => View::orthographic(pose, Window::centered(angle * 10.0, shape * 10.0), -10.0, 300.0),
            };
            let frustum =
                CellFrustum::new(&view.unwrap(), DVec3::ZERO, &Aabb::from_arrays([-1.0; 3], [1.0; 3]));
            assert_eq!((frustum.side_count, frustum.count), (5, 6), "round {round}, {pose:?}");
        }
    }

    /// Parallel rays that enter a clip plane at a very small angle pass through a box outside of the plane
    /// before they are in view.
    #[test]
    fn boxes_before_a_plane_that_rays_enter_are_crossed() {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::orthographic(pose, Window::centered(10.0, 10.0), -1000.0, 1000.0).unwrap();
        let bounds = Aabb::from_arrays([-1000.0; 3], [1000.0; 3]);
        // The ray along the upper edge of the box enters the view where x is 920.
        let clipped = view.with_clip_planes(&[Plane::new(DVec3::new(5e-13, 1.0, 0.0), 0.0)]).unwrap();
        let frustum = CellFrustum::new(&clipped, DVec3::ZERO, &bounds);
        let crossed = Aabb::from_arrays([-1000.0, -1.0, -1.0], [-900.0, -4.6e-10, 1.0]);
        assert_ne!(frustum.classify(&crossed), CellPlace::Outside, "a box that rays pass through");
        let along = view.with_clip_planes(&[Plane::new(DVec3::Y, 0.0)]).unwrap();
        let frustum = CellFrustum::new(&along, DVec3::ZERO, &bounds);
        assert_eq!(frustum.classify(&crossed), CellPlace::Outside, "a box of which no ray comes into view");
    }

    /// Where rounding leaves the direction of rays uncertain, they may come into view from outside of planes
    /// that count as sides: boxes there are crossed, as far outside as rays may lean.
    #[test]
    fn boxes_from_which_uncertain_rays_come_are_crossed() {
        let bounds = Aabb::from_arrays([-1000.0; 3], [1000.0; 3]);
        let uncertain = |large: f64| {
            let rows = [[large + 1.0, large, large], [large, large + 1.0, large], [0.0, 0.0, 1e-3], [0.0; 3]];
            let at = |i: usize| if i == 15 { 1.0 } else { rows[i % 4].get(i / 4).copied().unwrap_or(0.0) };
            View::from_clip_from_world(core::array::from_fn::<f64, 16, _>(at), Depth::ZeroToOne).unwrap()
        };
        // Nothing is known of the direction: no box is outside, wherever the planes are.
        let frustum = CellFrustum::new(&uncertain(2f64.powi(48)), DVec3::ZERO, &bounds);
        assert_eq!(frustum.eye_error, f64::INFINITY, "the direction is undecided");
        for corner in bounds.corners() {
            let cell = Aabb::from_points([corner, corner * 0.9]);
            assert_ne!(frustum.classify(&cell), CellPlace::Outside, "a cell at {corner}");
        }
        // A clip plane that computed rays enter by less than the direction's error.
        let view = uncertain(f64::from(1 << 29));
        let projection = ViewProjection::new(&view, DVec3::ZERO);
        let (Eye::Direction(along), error) = (projection.eye(), projection.eye_error()) else {
            panic!("rays")
        };
        assert!((1e-6..1e-4).contains(&error), "the direction's error is {error}");
        let across = along.cross(DVec3::Z).normalize();
        let normal = (across + along * (0.8 * error)).normalize();
        let clipped = view.with_clip_planes(&[Plane::new(normal, 0.0)]).unwrap();
        let frustum = CellFrustum::new(&clipped, DVec3::ZERO, &bounds);
        // A kilometre before the plane, rays that enter it are this far outside.
        let at = (along * -900.0 - across * (900.0 * error)).as_vec3();
        let cell = Aabb::new(at - 1e-4, at + 1e-4);
        assert_ne!(frustum.classify(&cell), CellPlace::Outside, "a cell that rays may pass through");
    }

    /// An eye is known if the near plane, with the plane's error, is farther than twice the eye's error.
    #[test]
    fn eyes_are_known_before_the_near_plane() {
        let near = ViewPlane { plane: Plane::new(DVec3::X, -12.0), error: 4.0 };
        for (x, error, expected) in [
            (2.0, 2.75, true),
            (2.0, 3.0, false),
            (2.0, 3.25, false),
            (2.0, 4.5, false),
            (22.0, 0.0, false),
            (2.0, f64::NAN, false),
            (2.0, f64::INFINITY, false),
        ] {
            let found = is_far_before(&near, DVec3::new(x, 7.0, -9.0), error);
            assert_eq!(found, expected, "an eye at {x} with an error of {error}");
        }
        let far = DVec3::new(2.0, -1e15, 9.0);
        assert_eq!(
            [0.9, 1.1].map(|error| is_far_before(&near, far, error)),
            [true, false],
            "an eye at {far}"
        );
        // A clip plane far from the eye is not the near plane: cells between both eyes may be beyond that,
        // where maps are asked about cells.
        let bounds = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let clip = Plane::new(DVec3::X, -900.0);
        for (near, expected) in [(1e-18, false), (0.1, true)] {
            let view = View::perspective(pose, 1.0, 1.0, near, 1000.0).unwrap();
            for view in [view, view.with_clip_planes(&[clip]).unwrap()] {
                let frustum = CellFrustum::new(&view, DVec3::splat(-9.0), &bounds);
                assert!((1e-17..1e-3).contains(&frustum.eye_error), "{near}: the error of {frustum:?}");
                assert_eq!(frustum.knows_eye(), expected, "a near plane at {near}: {frustum:?}");
            }
        }
    }

    /// The error of an uncertain eye decides how far the near plane must be.
    #[test]
    fn uncertain_eyes_are_known_from_two_errors_before_the_near_plane() {
        let bounds = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
        for number in 0..7 {
            let error = ViewProjection::new(&uncertain_views(0.1)[number], DVec3::ZERO).eye_error();
            for (part, expected) in [(1.5, false), (2.5, true)] {
                // w is the distance from the eye's plane times the root of 3.
                let view = &uncertain_views(part * error * sqrt(3.0))[number];
                let found = CellFrustum::new(view, DVec3::ZERO, &bounds).knows_eye();
                assert_eq!(found, expected, "view {number}: a near plane at {part} errors of {error}");
            }
        }
    }

    /// Eyes in a plane, up to rounding, that are not certainly before it.
    #[test]
    fn eyes_that_rounding_puts_before_the_near_plane_are_unknown() {
        let mut random = Random(74);
        let mut wrong_without = 0;
        for _ in 0..10_000 {
            let (normal, eye) = (random.integers(1 << 52), random.integers(1 << 40));
            let float = |p: IntVector| DVec3::from_array(p.map(|x| x as f64));
            // In units of 2^-53. The offset is rounded, which puts the eye on one of the plane's sides.
            let products: i128 = (0..3).map(|i| i128::from(normal[i]) * i128::from(eye[i])).sum();
            let offset = -products as f64;
            let unit = 2f64.powi(53);
            let near = ViewPlane { plane: Plane::new(float(normal) / unit, offset / unit), error: 0.0 };
            let is_inside = products + offset as i128 >= 0;
            wrong_without += u32::from(is_inside && near.plane.signed_distance(float(eye)) < 0.0);
            assert!(!is_inside || !is_far_before(&near, float(eye), 0.0), "{near:?} from {eye:?}");
        }
        assert!(wrong_without > 100, "{wrong_without} eyes seem to be before a plane");
    }

    /// Boxes and triangles with one corner in a plane, or nearer to the plane than the error bound, are
    /// classified as neither outside nor inside.
    #[test]
    fn what_touches_a_plane_is_neither_outside_nor_inside() {
        let mut random = Random(32);
        let view = View::orthographic(
            Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z),
            Window::centered(1.0, 1.0),
            0.0,
            1.0,
        );
        let mut frustum =
            CellFrustum::new(&view.unwrap(), DVec3::ZERO, &Aabb::from_arrays([-1.0; 3], [1.0; 3]));
        let (mut outside, mut inside) = (0, 0);
        for _ in 0..20_000 {
            let normal = random.integers(1 << 52);
            let corner = random.integers(1 << 23);
            let size = [(); 3].map(|()| random.whole(1 << 22).abs());
            // The exact offset, in units of 2^-53, rounded to a number that f64 can represent.
            let exact = -(0..3).map(|i| i128::from(normal[i]) * i128::from(corner[i])).sum::<i128>();
            for sign in [1, -1] {
                let nearest = exact as f64;
                let too_small = (nearest as i128 - exact) * sign < 0;
                let offset = match (too_small, sign) {
                    (false, _) => nearest,
                    (true, 1) => nearest.next_up(),
                    _ => nearest.next_down(),
                };
                // The box touches the plane only at this corner and lies on the outer side, or it lies on the
                // inner side.
                let beyond = [0, 1, 2].map(|i| corner[i] - sign as i64 * normal[i].signum() * size[i]);
                let float = |p: IntVector| Vec3::from_array(p.map(|x| x as f32));
                let bounds = Aabb::from_points([float(corner), float(beyond)]);
                let plane = ViewPlane {
                    plane: Plane::new(
                        DVec3::from_array(normal.map(|x| x as f64 / 2f64.powi(53))),
                        offset / 2f64.powi(53),
                    ),
                    error: 0.0,
                };
                // The plane's own error is added to the bound.
                let unsure = ViewPlane { error: 1e3, ..plane };
                assert_eq!(
                    BoundedPlane::new(&unsure, 0.0).slack,
                    1e3 + 1e-14 * plane.plane.offset.abs(),
                    "the plane's own error adds to the slack"
                );
                frustum.planes[0] = BoundedPlane::new(
                    &plane,
                    f64::from(bounds.min.abs().max(bounds.max.abs()).max_element()),
                );
                (frustum.count, frustum.side_count) = (1, 1);
                assert_eq!(frustum.classify(&bounds), CellPlace::Crossing(1), "{plane:?} {bounds:?}");
                #[cfg(feature = "papers")]
                {
                    (frustum.count, frustum.side_count) = (1, 0);
                    assert!(!frustum.is_beyond_near(&bounds), "{plane:?} {bounds:?}");
                    (frustum.count, frustum.side_count) = (1, 1);
                }
                let triangle = [float(corner), float(beyond), bounds.center()];
                assert!(!frustum.is_outside([&triangle].into_iter(), 1), "{plane:?} {triangle:?}");
                let shifted = |by: f32| {
                    let by = float(normal.map(i64::signum)) * by;
                    Aabb::new(bounds.min + by, bounds.max + by)
                };
                outside += u32::from(sign > 0 && frustum.classify(&shifted(-1.0)) == CellPlace::Outside);
                inside += u32::from(sign < 0 && frustum.classify(&shifted(1.0)) == CellPlace::Crossing(0));
            }
        }
        assert!(outside > 19_900 && inside > 19_900, "{outside} {inside}");
    }

    /// Returns views whose rows of the matrix are so nearly parallel that the eye's error is far greater than
    /// rounding: seven perspective views, whose w is `near` at the near plane, then seven parallel views.
    fn uncertain_views(near: f64) -> Vec<View> {
        let mut random = Random(71);
        let of = |rows: [[f64; 4]; 4], depth| {
            let matrix: [f64; 16] = core::array::from_fn(|i| rows[i % 4][i / 4]);
            View::from_clip_from_world(matrix, depth).unwrap()
        };
        let large = f64::from(1 << 29);
        let plus = |a: [f64; 4], by: [f64; 4]| [0, 1, 2, 3].map(|i| large * a[i] + by[i]);
        let perspective = (0..7).map(|_| random.vector(9.0)).map(|eye| {
            let w = [1.0, 1.0, 1.0, -eye.element_sum()];
            let (x, y) = ([1.0, 0.0, 0.0, -eye.x], [0.0, 1.0, 0.0, -eye.y]);
            of([plus(w, x), y, [0.0, 0.0, 0.0, near], w], Depth::ReversedInfinite)
        });
        let perspective: Vec<View> = perspective.collect();
        let parallel = (0..7).map(|_| random.vector(1.0)).map(|off| {
            let row = [1.0 + off.x, 1.0 + off.y, 1.0 + off.z, 0.0];
            let (x, y) = ([1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]);
            of([plus(row, x), plus(row, y), [0.0, 0.0, 1e-3, 0.0], [0.0, 0.0, 0.0, 1.0]], Depth::ZeroToOne)
        });
        perspective.into_iter().chain(parallel).collect()
    }

    /// View rays may leave a cell through faces that the exact eye may be within. All side planes of a
    /// parallel view count as such, though its computed direction may enter them.
    #[test]
    fn the_error_of_the_eye_closes_no_face() {
        let bounds = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
        let (mut random, mut largest) = (Random(72), [0.0f64; 2]);
        for (number, view) in uncertain_views(0.1).iter().enumerate() {
            let error = ViewProjection::new(view, DVec3::ZERO).eye_error();
            let frustum = CellFrustum::new(view, DVec3::ZERO, &bounds);
            assert_eq!(frustum.eye_error, error, "view {number}: the error of the eye");
            let is_parallel = number >= 7;
            largest[usize::from(is_parallel)] = largest[usize::from(is_parallel)].max(error);
            assert!(!is_parallel || frustum.side_count == 5, "view {number}: {frustum:?}");
            for _ in 0..100 {
                let normal = random.direction();
                for (part, expected) in [(-1.0, true), (0.99, true), (2.0, false)] {
                    let (point, normal) = match frustum.eye {
                        Eye::Point(eye) => (eye - normal * (part * error), normal),
                        // A normal that is as much more than perpendicular to the direction.
                        Eye::Direction(along) => {
                            let across = along.cross(normal).normalize();
                            (DVec3::ZERO, (across - along * (part * error)).normalize())
                        }
                    };
                    let is_exit = frustum.may_exit_through(point, normal);
                    assert_eq!(is_exit, expected, "view {number}: the eye is {part} errors beyond a face");
                }
            }
        }
        assert!(
            largest.iter().all(|&error| (3e-8..1e-4).contains(&error)),
            "the largest errors: {largest:?}"
        );
    }

    /// Faces in whose plane the eye lies, up to rounding, are exits, from near and far eyes and faces.
    #[test]
    fn faces_in_the_plane_of_the_eye_are_exits() {
        let mut random = Random(73);
        let mut below = 0;
        for round in 0..20_000 {
            let size = 10f64.powi(round % 9 - 2);
            let (eye, normal) = (random.fine_vector(size), random.direction());
            let far = random.fine_vector(size).as_vec3();
            // The far corner of the bounds is on one side of the origin alone.
            let bounds = match round % 2 {
                0 => Aabb::new(Vec3::ZERO, far.abs()),
                _ => Aabb::new(-far.abs(), Vec3::ZERO),
            };
            let view = View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 100.0);
            let frustum = CellFrustum::new(&view.unwrap(), DVec3::ZERO, &bounds);
            let reach = f64::from(far.abs().max_element());
            assert!(frustum.planes[0].slack >= 4e-14 * reach, "{bounds:?}: the slack of {frustum:?}");
            let along = random.fine_vector(size);
            let point = eye + (along - normal * normal.dot(along));
            assert!(frustum.may_exit_through(point, normal), "{point} {normal} from {eye}");
            below += u32::from(normal.dot(point - eye) < 0.0);
        }
        assert!(below > 5_000, "{below} faces seem to be on the wrong side");
    }

    /// Faces as far behind the eye as the margin are exits. Nothing is known of a face at NaN, nor of an eye.
    #[test]
    fn faces_at_the_margin_and_at_nan_are_exits() {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let window = Window::centered(1.0, 1.0);
        let views = [View::perspective(pose, 1.0, 1.0, 0.1, 9.0), View::orthographic(pose, window, 0.0, 9.0)];
        for view in views.map(Result::unwrap) {
            let mut frustum = CellFrustum::new(&view, DVec3::ZERO, &Aabb::from_arrays([-1.0; 3], [1.0; 3]));
            let point = DVec3::new(-1.0, 0.0, 0.0);
            assert!(frustum.may_exit_through(point, DVec3::NAN), "a face at NaN of {view:?}");
            for (margin, expected) in [(-1.0, 2), (-0.875, 1)] {
                frustum.exit_margin = margin;
                let exits = [DVec3::X, DVec3::NEG_X].map(|normal| frustum.may_exit_through(point, normal));
                let count = exits.into_iter().filter(|&exit| exit).count();
                assert_eq!(count, expected, "exits of two with a margin of {margin}: {view:?}");
            }
            frustum.exit_margin = f64::NAN;
            assert!(frustum.may_exit_through(point, DVec3::NEG_X), "an eye at NaN of {view:?}");
        }
    }

    /// Boxes between the eye and the near plane are passed by view rays.
    #[test]
    fn boxes_before_the_near_plane_are_crossed() {
        let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 10.0, 100.0);
        let bounds = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
        let frustum = CellFrustum::new(&view.unwrap(), DVec3::ZERO, &bounds);
        let at = |x: f32| Aabb::from_arrays([x, -0.1, -0.1], [x + 1.0, 0.1, 0.1]);
        assert_eq!(frustum.classify(&at(2.0)), CellPlace::Crossing(1 << 5), "before the near plane");
        assert_eq!(frustum.classify(&at(20.0)), CellPlace::Crossing(0), "in view");
        assert_eq!(frustum.classify(&at(101.0)), CellPlace::Outside, "beyond the far plane");
        #[cfg(feature = "papers")]
        for (x, expected) in [(2.0, false), (9.5, false), (10.5, true), (20.0, true)] {
            assert_eq!(frustum.is_beyond_near(&at(x)), expected, "a box at {x}");
        }
    }

    /// Distances of boxes, and solid angles of triangles: that of a far triangle is its area by the squared
    /// distance, and that of a triangle around the eye is at most a steradian or so.
    #[test]
    fn distances_and_solid_angles_are_those_of_the_eye() {
        let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 100.0);
        let bounds = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
        let frustum = CellFrustum::new(&view.unwrap(), DVec3::ZERO, &bounds);
        for (min, max, expected) in [
            ([-1.0; 3], [1.0; 3], 0.0),
            ([3.0, 4.0, -1.0], [9.0, 9.0, 1.0], 5.0),
            ([-9.0, -9.0, -1.0], [-3.0, -4.0, 1.0], 5.0),
            ([-1.0, -1.0, 2.0], [1.0, 1.0, 3.0], 2.0),
        ] {
            assert_eq!(frustum.distance(&Aabb::from_arrays(min, max)), expected, "{min:?} to {max:?}");
        }
        for (x, size, angle) in [(100.0, 1.0, 0.5e-4), (-100.0, 2.0, 2e-4), (0.001, 1.0, 0.5)] {
            let triangle = [[x, 0.0, 0.0], [x, size, 0.0], [x, 0.0, size]].map(Vec3::from);
            let (found, distance) = frustum.appearance(DVec3::ZERO, [&triangle].into_iter());
            assert!(found <= angle * 1.01, "a triangle of {size} m at {x}: {found} sr of {angle}");
            assert!(x < 1.0 && x > 0.0 || found >= angle * 0.99, "a triangle of {size} m at {x}: {found} sr");
            assert_eq!(distance, x.abs(), "the distance of the triangle at {x}");
        }
    }

    /// No triangle is a back if the exact eye may be on the other side. The error of the eye is made large
    /// here, so that half of it would not do.
    #[test]
    fn eyes_within_their_error_of_a_plane_may_be_on_either_side() {
        let view = View::perspective(Pose::look_at(DVec3::X, DVec3::ZERO, DVec3::Z), 1.0, 1.0, 0.1, 100.0);
        let bounds = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
        let mut frustum = CellFrustum::new(&view.unwrap(), DVec3::ZERO, &bounds);
        frustum.eye_error = 0.01;
        for (height, is_back) in [(0.009, false), (0.011, true)] {
            let triangle = [[-1.0, 0.0, height], [0.0, 1.0, height], [0.0, -1.0, height]].map(Vec3::from);
            let turned = [triangle[0], triangle[2], triangle[1]];
            let backs = [triangle, turned].map(|triangle| frustum.sees_backs([&triangle].into_iter()));
            assert!(!(backs[0] && backs[1]), "a triangle of two backs at {height}");
            assert_eq!(backs[0] || backs[1], is_back, "a triangle at {height} above the eye");
        }
    }

    /// Triangles with integer corners and eyes so close to their planes that unguarded rounding would give
    /// the wrong side: no front is ever reported as a back.
    #[test]
    fn no_front_passes_for_a_back() {
        let mut random = Random(3);
        let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 100.0);
        let mut frustum =
            CellFrustum::new(&view.unwrap(), DVec3::ZERO, &Aabb::from_arrays([-1.0; 3], [1.0; 3]));
        let (mut backs, mut wrong_without) = (0, 0);
        for round in 0..60_000 {
            let [a, b, c] = [(); 3].map(|()| random.integers(1 << 23));
            let (s, t) = (random.whole(1 << 30), random.whole(1 << 30));
            // The eye is in the plane, or beside it by one or many steps of 2^-30.
            let beside = if round % 2 == 0 { random.whole(2) } else { random.whole(1 << 34) };
            let mut eye = within([a, b, c], s, t);
            eye[0] += beside;
            // The round is skipped if f64 cannot represent the eye exactly.
            if eye.iter().any(|x| x.abs() > 1 << 53) {
                continue;
            }
            let exact = dot(cross(minus(b, a), minus(c, a)), minus(eye, a.map(|x| x << 30)));
            let float = |p: [i64; 3]| DVec3::from_array(p.map(|x| x as f64));
            let eye = fine(eye);
            frustum.eye = Eye::Point(eye);
            let triangle = [a, b, c].map(|p| float(p).as_vec3());
            if frustum.sees_backs([&triangle].into_iter()) {
                assert!(exact < 0, "{triangle:?} from {eye}");
                backs += 1;
            }
            let [p, q, r] = triangle.map(|p| p.as_dvec3());
            wrong_without += i32::from((q - p).cross(r - p).dot(eye - p) < 0.0 && exact > 0);
        }
        assert!(backs > 100 && wrong_without > 5, "{backs} backs, {wrong_without} wrong without a margin");
    }
}
