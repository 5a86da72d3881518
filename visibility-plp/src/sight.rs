//! What a view sees of cells and of single primitives.

use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, Eye, MAX_PLANES, Triangle, View, ViewPlane};

/// A plane with the bound on what rounding may do to distances from it.
#[derive(Clone, Copy, Debug)]
struct Bound {
    normal: DVec3,
    offset: f64,
    slack: f64,
}

impl Bound {
    /// For points whose coordinates are no greater than `reach`.
    fn new(plane: &ViewPlane, reach: f64) -> Self {
        let (normal, offset) = (plane.plane.normal, plane.plane.offset);
        // Centre and half size of a box, three products and sums of each: a dozen roundings by 2^-53 of no more than this.
        Self { normal, offset, slack: plane.error + 1e-14 * (4.0 * reach + offset.abs()) }
    }

    fn distance(&self, p: DVec3) -> f64 {
        self.normal.x * p.x + self.normal.y * p.y + self.normal.z * p.z + self.offset
    }

    /// How far a box reaches to either side of its centre.
    fn reach(&self, half: DVec3) -> f64 {
        let n = self.normal.abs();
        n.x * half.x + n.y * half.y + n.z * half.z
    }
}

/// Where a cell lies with respect to a view.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Place {
    /// No line of sight to anything in view goes through it.
    Outside,
    /// Otherwise: those planes, by bit, that not all of it is surely on the inner side of. Without any, all of it is in view; before the near
    /// plane, between the eye and what is in view, there is one.
    Crossing(u16),
}

/// A view, for points relative to the origin of the scene.
#[derive(Clone, Debug)]
pub(crate) struct Sight {
    pub(crate) eye: Eye,
    planes: [Bound; MAX_PLANES],
    count: usize,
    /// The first so many planes have the eye on their inner side: what lies outside of them is not on the way to anything in view. The
    /// others (the near plane, those of portals and mirrors) are crossed by lines of sight before they are in view.
    sides: usize,
    /// Beyond the plane of a face by no more than this, the eye may lie before it.
    before: f64,
}

impl Sight {
    /// For cells and primitives within a box.
    pub(crate) fn new(view: &View, origin: DVec3, bounds: &Aabb) -> Self {
        let reach = f64::from(bounds.min.abs().max(bounds.max.abs()).max_element());
        let eye = view.eye(origin);
        let before = match eye {
            // Point and normal are known to a few times 2^-52 of the greatest coordinate. 1e-9 of it is a million times as much, and costs nothing.
            Eye::Point(eye) => -1e-9 * (reach + eye.abs().max_element()),
            // Two unit vectors: next to nothing goes out where they are at right angles, as far as can be told, and it goes out.
            Eye::Direction(_) => -1e-9,
        };
        let none = Bound { normal: DVec3::ZERO, offset: 0.0, slack: 0.0 };
        let mut sight = Self { eye, planes: [none; MAX_PLANES], count: 0, sides: 0, before };
        for at_side in [true, false] {
            for plane in view.planes(origin).as_slice() {
                let bound = Bound::new(plane, reach);
                // The products and sums of a distance are rounded by less than 1e-15 of these, beside what the plane's own numbers are.
                let eye_is_inside = match eye {
                    Eye::Point(eye) => {
                        bound.distance(eye)
                            >= -plane.error - 1e-15 * (4.0 * eye.abs().max_element() + bound.offset.abs())
                    }
                    // An eye at infinity is outside of what lines of sight run into.
                    Eye::Direction(along) => bound.normal.dot(along) <= 1e-12,
                };
                if eye_is_inside == at_side {
                    sight.planes[sight.count] = bound;
                    sight.count += 1;
                }
            }
            if at_side {
                sight.sides = sight.count;
            }
        }
        sight
    }

    /// Where a box lies.
    #[inline]
    pub(crate) fn place(&self, bounds: &Aabb) -> Place {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
        let mut crossed = 0;
        for (i, plane) in self.planes[..self.count].iter().enumerate() {
            let (distance, reach) = (plane.distance(center), plane.reach(half));
            if distance + reach < -plane.slack && i < self.sides {
                return Place::Outside;
            }
            // A distance that is NaN is not inside.
            let inside = distance - reach > plane.slack;
            crossed |= u16::from(!inside) << i;
        }
        Place::Crossing(crossed)
    }

    /// Whether lines of sight may go out through a plane, given by a point and the outward normal: not if the eye lies surely on its outer side.
    #[inline]
    pub(crate) fn may_leave(&self, point: DVec3, normal: DVec3) -> bool {
        match self.eye {
            Eye::Point(eye) => normal.dot(point - eye) >= self.before,
            Eye::Direction(along) => normal.dot(along) >= self.before,
        }
    }

    /// Whether a box lies surely beyond all planes that lines of sight cross on their way into view.
    pub(crate) fn is_beyond_near(&self, bounds: &Aabb) -> bool {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
        self.planes[self.sides..self.count]
            .iter()
            .all(|plane| plane.distance(center) - plane.reach(half) > plane.slack)
    }

    /// Whether triangles lie all together outside one of some planes, given by bit.
    #[inline]
    pub(crate) fn is_outside<'a>(
        &self,
        triangles: impl Iterator<Item = &'a Triangle> + Clone,
        planes: u16,
    ) -> bool {
        // No branch on a distance: it could not be foretold.
        let mut outside = false;
        for (i, plane) in self.planes[..self.count].iter().enumerate() {
            if planes >> i & 1 != 0 {
                let beyond = |p: &Vec3| plane.distance(p.as_dvec3()) < -plane.slack;
                outside |= triangles.clone().flatten().fold(true, |all, p| all & beyond(p));
            }
        }
        outside
    }

    /// Whether triangles turn their backs to the eye, all of them and surely. False for those without a side, and for NaN.
    #[inline]
    pub(crate) fn sees_backs<'a>(&self, mut triangles: impl Iterator<Item = &'a Triangle>) -> bool {
        triangles.all(|triangle| {
            let [a, b, c] = triangle.map(|p| p.as_dvec3());
            let (u, v) = (b - a, c - a);
            let toward = match self.eye {
                Eye::Point(eye) => eye - a,
                Eye::Direction(along) => -along,
            };
            let normal = u.cross(v);
            // Differences are rounded once, the products of three of them a few times more: 16 roundings of 2^-53 of the product of magnitudes
            // are 2e-15 of it, and the sum of nine such products is no more than nine times that of the greatest.
            let size = u.abs().max_element() * v.abs().max_element() * toward.abs().max_element();
            normal.dot(toward) < -2e-14 * size
        })
    }

    /// The unit direction of sight to a point; zero in the eye.
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
    use crate::whole::{Random, Whole, cross, dot, fine, minus, within};
    use visibility_core::{Plane, Pose, Window};

    /// All planes but the near one have the eye on their inner side, or in them: they bound what is on the way to anything in view.
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
            let sight = Sight::new(&view.unwrap(), DVec3::ZERO, &Aabb::from_arrays([-1.0; 3], [1.0; 3]));
            assert_eq!((sight.sides, sight.count), (5, 6), "round {round}, {pose:?}");
        }
    }

    /// Boxes and triangles with a corner in a plane, or on one side of it by less than can be told: neither outside nor inside.
    #[test]
    fn what_touches_a_plane_is_neither_outside_nor_inside() {
        let mut random = Random(32);
        let view = View::orthographic(
            Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z),
            Window::centered(1.0, 1.0),
            0.0,
            1.0,
        );
        let mut sight = Sight::new(&view.unwrap(), DVec3::ZERO, &Aabb::from_arrays([-1.0; 3], [1.0; 3]));
        let (mut outside, mut inside) = (0, 0);
        for _ in 0..20_000 {
            let normal = random.vector(1 << 52);
            let corner = random.vector(1 << 23);
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
                // All of the box beyond the corner: on the outer side, but for the corner, or on the inner one.
                let beyond = [0, 1, 2].map(|i| corner[i] - sign as i64 * normal[i].signum() * size[i]);
                let float = |p: Whole| Vec3::from_array(p.map(|x| x as f32));
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
                assert_eq!(Bound::new(&unsure, 0.0).slack, 1e3 + 1e-14 * plane.plane.offset.abs());
                sight.planes[0] =
                    Bound::new(&plane, f64::from(bounds.min.abs().max(bounds.max.abs()).max_element()));
                (sight.count, sight.sides) = (1, 1);
                assert_eq!(sight.place(&bounds), Place::Crossing(1), "{plane:?} {bounds:?}");
                let triangle = [float(corner), float(beyond), bounds.center()];
                assert!(!sight.is_outside([&triangle].into_iter(), 1), "{plane:?} {triangle:?}");
                let shifted = |by: f32| {
                    let by = float(normal.map(i64::signum)) * by;
                    Aabb::new(bounds.min + by, bounds.max + by)
                };
                outside += u32::from(sign > 0 && sight.place(&shifted(-1.0)) == Place::Outside);
                inside += u32::from(sign < 0 && sight.place(&shifted(1.0)) == Place::Crossing(0));
            }
        }
        assert!(outside > 19_900 && inside > 19_900, "{outside} {inside}");
    }

    /// Triangles of whole numbers and eyes so near their planes that rounding would tell the wrong side: never a back that is a front.
    #[test]
    fn no_front_passes_for_a_back() {
        let mut random = Random(3);
        let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 100.0);
        let mut sight = Sight::new(&view.unwrap(), DVec3::ZERO, &Aabb::from_arrays([-1.0; 3], [1.0; 3]));
        let (mut backs, mut wrong_without) = (0, 0);
        for round in 0..60_000 {
            let [a, b, c] = [(); 3].map(|()| random.vector(1 << 23));
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
            sight.eye = Eye::Point(eye);
            let triangle = [a, b, c].map(|p| float(p).as_vec3());
            if sight.sees_backs([&triangle].into_iter()) {
                assert!(exact < 0, "{triangle:?} from {eye}");
                backs += 1;
            }
            let [p, q, r] = triangle.map(|p| p.as_dvec3());
            wrong_without += i32::from((q - p).cross(r - p).dot(eye - p) < 0.0 && exact > 0);
        }
        assert!(backs > 100 && wrong_without > 5, "{backs} backs, {wrong_without} wrong without a margin");
    }
}
