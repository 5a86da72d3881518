//! What a view sees of cells and of single primitives.

use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, Eye, MAX_PLANES, Triangle, View};

/// A plane with the bound on what rounding may do to distances from it.
#[derive(Clone, Copy, Debug)]
struct Bound {
    normal: DVec3,
    offset: f64,
    slack: f64,
}

impl Bound {
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
            Eye::Direction(_) => -1e-9,
        };
        let none = Bound { normal: DVec3::ZERO, offset: 0.0, slack: 0.0 };
        let mut sight = Self { eye, planes: [none; MAX_PLANES], count: 0, sides: 0, before };
        for at_side in [true, false] {
            for plane in view.planes(origin).as_slice() {
                let (normal, offset) = (plane.plane.normal, plane.plane.offset);
                // Centre and half size of a box, three products and sums of each: a dozen roundings by 2^-53 of no more than this.
                let slack = plane.error + 1e-14 * (4.0 * reach + offset.abs());
                let bound = Bound { normal, offset, slack };
                let eye_is_inside = match eye {
                    Eye::Point(eye) => {
                        bound.distance(eye)
                            >= -plane.error - 1e-15 * (4.0 * eye.abs().max_element() + offset.abs())
                    }
                    // An eye at infinity is outside of what lines of sight run into.
                    Eye::Direction(along) => normal.dot(along) <= 1e-12,
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
    use visibility_core::Pose;

    /// Triangles of whole numbers and eyes so near their planes that rounding would tell the wrong side: never a back that is a front.
    #[test]
    fn no_front_passes_for_a_back() {
        let mut state = 3u64;
        let mut random = move |below: i64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as i64 % (2 * below) - below
        };
        let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 100.0);
        let mut sight = Sight::new(&view.unwrap(), DVec3::ZERO, &Aabb::from_arrays([-1.0; 3], [1.0; 3]));
        let (mut backs, mut wrong_without) = (0, 0);
        for round in 0..60_000 {
            let [a, b, c] = [(); 3].map(|_| [(); 3].map(|_| random(1 << 23)));
            let (s, t) = (random(1 << 27), random(1 << 27));
            // In steps of 2^-20, the eye is in the plane or beside it, by a step or by many.
            let beside = if round % 2 == 0 { random(2) } else { random(1 << 24) };
            let eye = [0, 1, 2]
                .map(|i| (a[i] << 20) + s * (b[i] - a[i]) + t * (c[i] - a[i]) + beside * i64::from(i == 0));
            let minus = |p: [i64; 3], q: [i64; 3]| [0, 1, 2].map(|i| i128::from(p[i]) - i128::from(q[i]));
            let (u, v, w) = (minus(b, a), minus(c, a), minus(eye, a.map(|x| x << 20)));
            let cross = [0, 1, 2].map(|i| u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]);
            let exact: i128 = (0..3).map(|i| cross[i] * w[i]).sum();
            let float = |p: [i64; 3]| DVec3::from_array(p.map(|x| x as f64));
            let eye = float(eye) / f64::from(1 << 20);
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
