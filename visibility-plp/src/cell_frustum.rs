//! Frustum tests for the cells of a tessellation and for single triangles, with bounds on rounding.
//!
//! All coordinates are relative to the scene's origin, in metres.

use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{
    Aabb, View,
    scene::Triangle,
    view::{Eye, MAX_PLANES, ViewPlane},
};

/// Half-space `normal . p + offset >= 0`, with a bound on the rounding error of that distance.
#[derive(Clone, Copy, Debug)]
struct BoundedPlane {
    normal: DVec3,
    offset: f64,
    /// Maximum error of a computed distance, in metres.
    slack: f64,
}

impl BoundedPlane {
    /// `reach`: greatest coordinate, in absolute value, of any point that is tested.
    fn new(plane: &ViewPlane, reach: f64) -> Self {
        let (normal, offset) = (plane.plane.normal, plane.plane.offset);
        // Centre and half size of a box, three products and sums of each: a dozen roundings by 2^-53 of no
        // more than this.
        Self { normal, offset, slack: plane.error + 1e-14 * (4.0 * reach + offset.abs()) }
    }

    fn distance(&self, p: DVec3) -> f64 {
        self.normal.x * p.x + self.normal.y * p.y + self.normal.z * p.z + self.offset
    }

    /// Greatest distance, along the normal, between the centre of a box and any point of it. `half` is half
    /// its size.
    fn extent(&self, half: DVec3) -> f64 {
        let n = self.normal.abs();
        n.x * half.x + n.y * half.y + n.z * half.z
    }
}

/// Position of a cell's box relative to the view frustum.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum CellPlace {
    /// No line of sight to anything in view passes through the box.
    Outside,
    /// Lines of sight may pass through the box. One bit for each plane of which the box is not surely on the
    /// inner side; 0 for a box surely in view. A box before the near plane, between the eye and what is in
    /// view, has that plane's bit.
    Crossing(u16),
}

/// The planes of a view, split by whether lines of sight start on their inner side.
#[derive(Clone, Debug)]
pub(crate) struct CellFrustum {
    /// Eye point, or viewing direction of a parallel view.
    pub(crate) eye: Eye,
    planes: [BoundedPlane; MAX_PLANES],
    /// Number of `planes` in use.
    count: usize,
    /// The first `side_count` planes have the eye on their inner side, so a box outside of one of them is
    /// not on the way to anything in view. Lines of sight cross the remaining planes (near plane,
    /// portals, mirrors) before they are in view.
    side_count: usize,
    /// Least signed distance of a face from the eye, along the face's outward normal, at which lines of
    /// sight may leave a cell through it. Negative, to allow for rounding. In metres, or a cosine for a
    /// parallel view.
    exit_margin: f64,
}

impl CellFrustum {
    /// Planes of a view of the scene with that `origin`, for cells and triangles within `bounds`.
    pub(crate) fn new(view: &View, origin: DVec3, bounds: &Aabb) -> Self {
        let reach = f64::from(bounds.min.abs().max(bounds.max.abs()).max_element());
        let eye = view.eye(origin);
        let exit_margin = match eye {
            // Point and normal are known to a few times 2^-52 of the greatest coordinate. 1e-9 of it is a
            // million times as much, and costs nothing.
            Eye::Point(eye) => -1e-9 * (reach + eye.abs().max_element()),
            // The cosine of two unit vectors is known to a few times 2^-52.
            Eye::Direction(_) => -1e-9,
        };
        let none = BoundedPlane { normal: DVec3::ZERO, offset: 0.0, slack: 0.0 };
        let mut frustum = Self { eye, planes: [none; MAX_PLANES], count: 0, side_count: 0, exit_margin };
        for with_eye_inside in [true, false] {
            for plane in view.planes(origin).as_slice() {
                let bounded = BoundedPlane::new(plane, reach);
                // The products and sums of a distance are rounded by less than 1e-15 of these terms; the
                // plane's own numbers have their error besides.
                let eye_is_inside = match eye {
                    Eye::Point(eye) => {
                        bounded.distance(eye)
                            >= -plane.error - 1e-15 * (4.0 * eye.abs().max_element() + bounded.offset.abs())
                    }
                    // An eye at infinity is outside of every plane that lines of sight run into.
                    Eye::Direction(along) => bounded.normal.dot(along) <= 1e-12,
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

    /// Classifies a box. Conservative: [`CellPlace::Outside`] and cleared bits are certain. A box with NaN
    /// coordinates crosses all planes.
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
            // A distance that is NaN is not inside.
            let inside = distance - extent > plane.slack;
            crossed |= u16::from(!inside) << i;
        }
        CellPlace::Crossing(crossed)
    }

    /// Whether lines of sight may leave a cell through the face that contains `point` and has the outward
    /// unit `normal`. False only if the eye is surely on the outer side of the face's plane.
    #[inline]
    pub(crate) fn may_exit_through(&self, point: DVec3, normal: DVec3) -> bool {
        match self.eye {
            Eye::Point(eye) => normal.dot(point - eye) >= self.exit_margin,
            Eye::Direction(along) => normal.dot(along) >= self.exit_margin,
        }
    }

    /// Whether a box is surely inside all planes that lines of sight cross on their way into view, such as
    /// the near plane.
    pub(crate) fn is_beyond_near(&self, bounds: &Aabb) -> bool {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
        self.planes[self.side_count..self.count]
            .iter()
            .all(|plane| plane.distance(center) - plane.extent(half) > plane.slack)
    }

    /// Whether all corners of all triangles are surely outside of the same plane. `planes` has a bit for each
    /// plane that is tested. False for NaN coordinates.
    #[inline]
    pub(crate) fn is_outside<'a>(
        &self,
        triangles: impl Iterator<Item = &'a Triangle> + Clone,
        planes: u16,
    ) -> bool {
        // No branch on a distance: it would be mispredicted half of the time.
        let mut outside = false;
        for (i, plane) in self.planes[..self.count].iter().enumerate() {
            if planes >> i & 1 != 0 {
                let beyond = |p: &Vec3| plane.distance(p.as_dvec3()) < -plane.slack;
                outside |= triangles.clone().flatten().fold(true, |all, p| all & beyond(p));
            }
        }
        outside
    }

    /// Whether every triangle surely faces away from the eye. False for degenerate triangles and for NaN.
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
            // Differences are rounded once, the products of three of them a few times more: 16 roundings of
            // 2^-53 of the product of magnitudes are 2e-15 of it, and the sum of nine such products is no
            // more than nine times that of the greatest.
            let size = u.abs().max_element() * v.abs().max_element() * to_eye.abs().max_element();
            normal.dot(to_eye) < -2e-14 * size
        })
    }

    /// Unit direction of the line of sight to a point; zero for a point in the eye.
    #[inline]
    pub(crate) fn direction(&self, point: DVec3) -> DVec3 {
        match self.eye {
            Eye::Point(eye) => (point - eye).normalize_or_zero(),
            Eye::Direction(along) => along,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_exact::{IntVector, Random, RandomExact, cross, dot, fine, minus, within};
    use visibility_core::{Pose, geometry::Plane, view::Window};

    /// All planes but the near one have the eye on their inner side, or in them: they bound what is on the
    /// way to anything in view.
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

    /// Boxes and triangles with a corner in a plane, or on one side of it by less than can be told: neither
    /// outside nor inside.
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
            // In units of 2^-53, rounded to what f64 can hold.
            let exact = -(0..3).map(|i| i128::from(normal[i]) * i128::from(corner[i])).sum::<i128>();
            for sign in [1, -1] {
                let nearest = exact as f64;
                let too_small = (nearest as i128 - exact) * sign < 0;
                let offset = match (too_small, sign) {
                    (false, _) => nearest,
                    (true, 1) => nearest.next_up(),
                    _ => nearest.next_down(),
                };
                // All of the box beyond the corner: on the outer side, but for the corner, or on the inner
                // one.
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
                // What a plane says of its own error counts too.
                let unsure = ViewPlane { error: 1e3, ..plane };
                assert_eq!(BoundedPlane::new(&unsure, 0.0).slack, 1e3 + 1e-14 * plane.plane.offset.abs());
                frustum.planes[0] = BoundedPlane::new(
                    &plane,
                    f64::from(bounds.min.abs().max(bounds.max.abs()).max_element()),
                );
                (frustum.count, frustum.side_count) = (1, 1);
                assert_eq!(frustum.classify(&bounds), CellPlace::Crossing(1), "{plane:?} {bounds:?}");
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

    /// Triangles of whole numbers and eyes so near their planes that rounding would tell the wrong side:
    /// never a back that is a front.
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
            // In steps of 2^-30, the eye is in the plane or beside it, by a step or by many.
            let beside = if round % 2 == 0 { random.whole(2) } else { random.whole(1 << 34) };
            let mut eye = within([a, b, c], s, t);
            eye[0] += beside;
            // Where f64 has no more digits, the eye is not there.
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
