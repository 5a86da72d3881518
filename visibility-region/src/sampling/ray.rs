//! Tests of a ray against boxes and triangles with error margins: a triangle is missed, possibly met or
//! certainly met.
//!
//! The sides on which the ray passes a triangle's three edges decide (Woop, Benthin and Wald, "Watertight
//! Ray/Triangle Intersection", 2013). An aggressive answer needs both margins: a triangle that the ray *may*
//! meet counts as blocking, and only a triangle that it *certainly* meets counts as seen.

use visibility_core::glam::{DVec3, Vec3};

/// Unit round-off of `f64`, 2^-53.
const U: f64 = f64::EPSILON / 2.0;

/// A ray that starts at a viewpoint, in metres relative to the scene's origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    /// Start of the ray, at parameter 0.
    pub(super) origin: DVec3,
    /// Direction of the ray in scene axes, scaled so that its component of the greatest magnitude is about 1
    /// or -1. The point at *parameter* t of the ray is the start plus t times this vector.
    pub(super) along: DVec3,
    /// Inverse of each component of `along`. Infinite for a component of 0.
    inverse: DVec3,
    /// Squared length of `along`: about 1 if one component has the magnitude 1 and the others are 0, up to
    /// about 3 if all three have it.
    length_squared: f64,
}

/// Bounds on the ray's parameter at the point where the ray meets a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meeting {
    /// Lower bound of the ray's parameter, possibly negative.
    pub(super) least: f64,
    /// Upper bound of the ray's parameter. Infinite if the ray may miss the triangle.
    pub(super) most: f64,
}

impl Meeting {
    /// Returns whether the ray certainly meets the triangle.
    pub(super) fn is_certain(&self) -> bool {
        self.most < f64::INFINITY
    }
}

impl Ray {
    /// Makes the ray from `origin` through `target`. `None` if the two are equal or not finite.
    pub(super) fn through(origin: DVec3, target: DVec3) -> Option<Self> {
        let along = target - origin;
        let greatest = along.abs().max_element();
        if !(greatest > 1e-250 && greatest.is_finite()) {
            return None;
        }
        let along = along / greatest;
        Some(Self { origin, along, inverse: along.recip(), length_squared: along.length_squared() })
    }

    /// Returns the point of the ray at a parameter.
    pub(super) fn at(&self, parameter: f64) -> DVec3 {
        self.origin + self.along * parameter
    }

    /// Returns a lower bound, at least 0, of the parameter at which the ray enters a box. `None` if the ray
    /// certainly misses the box.
    ///
    /// The computed bound of a slab errs by less than 4 times the unit round-off of itself: by a difference,
    /// an inverse and a product. The comparison of entry and exit allows twice that.
    pub(super) fn enter(&self, min: Vec3, max: Vec3) -> Option<f64> {
        let (mut enter, mut exit) = (0.0f64, f64::INFINITY);
        for axis in 0..3 {
            let (o, along) = (self.origin[axis], self.along[axis]);
            let (low, high) = (f64::from(min[axis]), f64::from(max[axis]));
            if along == 0.0 {
                if o < low || o > high {
                    return None;
                }
                continue;
            }
            let (near, far) = if along > 0.0 { (low, high) } else { (high, low) };
            enter = enter.max((near - o) * self.inverse[axis]);
            exit = exit.min((far - o) * self.inverse[axis]);
        }
        let lower = enter * (1.0 - 8.0 * U);
        (lower <= exit + exit.abs() * (8.0 * U)).then_some(lower)
    }

    /// Returns bounds on the ray's parameter at the point where the ray meets a triangle. The corners are
    /// known up to `slack` metres on each axis. `None` if the ray certainly misses the triangle, or certainly
    /// meets the back of a one-sided triangle.
    ///
    /// # Rounding
    /// Let `p` and `q` be corners relative to the ray's origin, `d` the direction, and u the unit round-off
    /// of `f64`. The ray passes the edge from `p` to `q` on the side of the sign of `d . (p x q)`. `|d| <= 1`
    /// on each axis; let `P` and `Q` be the greatest magnitudes of the coordinates of `p` and `q`.
    /// Differences err by u of themselves, so each of the two products in a component of the cross product
    /// errs by less than 3.1u P Q, and the component by less than 8.3u P Q. The three terms of the dot
    /// product have magnitudes up to 2 P Q and err by 10.4u P Q each, and their sum by another 12u P Q: less
    /// than 44u P Q in all. The margin is 128u P Q. The error of the corners adds `12 slack (P + Q + slack)`
    /// to the margin, twice what is needed.
    ///
    /// The point where the ray meets the triangle is the mean of the corners, each weighted by the value `d .
    /// (p x q)` of the opposite edge. Let `sum` be the sum of the three weights and `m` the sum of their
    /// three margins. Weights within their margins of the exact ones move the point, within the triangle, by
    /// less than `4 m / sum` of the difference of the corners' parameters. A corner's parameter is a dot
    /// product of three terms over the squared length of `d`, which is at least about 1, since one component
    /// of `d` has a magnitude of about 1. So the parameter errs by less than 32u P, and by 2 slack.
    pub(super) fn meet(&self, corners: &[Vec3; 3], slack: f64, is_one_sided: bool) -> Option<Meeting> {
        let p = corners.map(|corner| corner.as_dvec3() - self.origin);
        let size = p.map(|p| p.abs().max_element());
        let (mut sides, mut margins) = ([0.0; 3], [0.0; 3]);
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            sides[i] = self.along.dot(p[j].cross(p[k]));
            margins[i] = 128.0 * U * size[j] * size[k]
                + 12.0 * (size[j] + size[k] + slack) * slack
                + f64::MIN_POSITIVE;
        }
        let every = |test: &dyn Fn(usize) -> bool| (0..3).all(test);
        if !(every(&|i| sides[i] >= -margins[i]) || every(&|i| sides[i] <= margins[i])) {
            return None;
        }
        // From behind, the corners run clockwise around the ray.
        if is_one_sided && every(&|i| sides[i] > margins[i]) {
            return None;
        }
        let t = p.map(|p| p.dot(self.along) / self.length_squared);
        let (first, last) = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
        let rounding = 32.0 * U * size[0].max(size[1]).max(size[2]) + 2.0 * slack;
        if last + rounding < 0.0 {
            return None;
        }
        let sum = sides[0] + sides[1] + sides[2];
        let margin = margins[0] + margins[1] + margins[2];
        let certain = every(&|i| sides[i] > margins[i]) || every(&|i| sides[i] < -margins[i]);
        // Where the ray runs almost in the plane of the triangle, the place of the meeting is not known.
        if !certain || sum.abs() < 1024.0 * margin {
            return Some(Meeting { least: first - rounding, most: f64::INFINITY });
        }
        let at = (sides[0] * t[0] + sides[1] * t[1] + sides[2] * t[2]) / sum;
        let doubt = 4.0 * margin / sum.abs() * (last - first) + 2.0 * rounding;
        if at + doubt < 0.0 {
            return None;
        }
        Some(Meeting { least: (at - doubt).max(first - rounding), most: at + doubt })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;
    use visibility_testing::sign_of_sum;

    /// Returns the exact sign of the side on which a ray passes the edge from `p` to `q`. The origin must
    /// have coordinates of `f32`, so that their products are exact.
    fn exact_side(ray: &Ray, p: Vec3, q: Vec3) -> i32 {
        let (o, p, q) = (ray.origin, p.as_dvec3(), q.as_dvec3());
        // (p - o) x (q - o) = p x q - p x o - o x q
        let terms = [(p, q, 1.0), (p, o, -1.0), (o, q, -1.0)].into_iter().flat_map(|(a, b, sign)| {
            (0..3).flat_map(move |i| {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                [(ray.along[i], sign * a[j] * b[k]), (ray.along[i], -sign * a[k] * b[j])]
            })
        });
        sign_of_sum(terms)
    }

    #[test]
    fn rays_at_edges_are_decided_as_exact_arithmetic_does() {
        let mut rng = Random(11);
        let mut counts = [0; 3];
        for _ in 0..30_000 {
            let corners = [(); 3].map(|()| rng.vec3(-9.0, 9.0));
            let origin = (rng.direction() * 20.0).as_vec3().as_dvec3();
            let [p, q] = [corners[0], corners[1]].map(|p| p.as_dvec3());
            let Some(ray) = Ray::through(origin, p + (q - p) * rng.unit()) else { continue };
            let sides: [i32; 3] =
                core::array::from_fn(|i| exact_side(&ray, corners[(i + 1) % 3], corners[(i + 2) % 3]));
            let is_hit = sides.iter().all(|&side| side > 0) || sides.iter().all(|&side| side < 0);
            let is_missed = sides.contains(&1) && sides.contains(&-1);
            match ray.meet(&corners, 0.0, false) {
                None => {
                    assert!(is_missed, "{ray:?} {corners:?}: {sides:?}");
                    counts[0] += 1;
                }
                Some(meeting) if meeting.is_certain() => {
                    assert!(is_hit, "{ray:?} {corners:?}: {sides:?}");
                    counts[1] += 1;
                }
                Some(_) => counts[2] += 1,
            }
            // A thousandth aside, the ray is decided.
            let aside = (corners[2].as_dvec3() - p).normalize() * 1e-3;
            let middle = p.lerp(q, 0.5);
            let is_certain = |target: DVec3| {
                let ray = Ray::through(origin, target).unwrap();
                ray.meet(&corners, 0.0, false).is_none_or(|meeting| meeting.is_certain())
            };
            counts[0] += usize::from(is_certain(middle + aside)) + usize::from(is_certain(middle - aside));
        }
        // Hardly any ray at the edge itself is decided, and nearly every ray beside it.
        assert!(counts[0] > 58_000 && counts[2] > 29_000, "{counts:?}");
    }

    #[test]
    fn rays_need_two_finite_points() {
        let o = DVec3::splat(2.0);
        assert!(Ray::through(o, o + DVec3::X).is_some(), "two points");
        assert!(Ray::through(o, o).is_none(), "equal points");
        assert!(Ray::through(o, o.with_x(f64::INFINITY)).is_none(), "an infinite point");
        assert!(Ray::through(o, DVec3::NAN).is_none(), "no number");
    }

    /// A ray in the plane of a side, or that starts there, may meet what lies in that side.
    #[test]
    fn rays_along_the_sides_of_a_box_enter_it() {
        let (min, max) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(5.0, 6.0, 7.0));
        for axis in 0..3 {
            let across = (axis + 1) % 3;
            for (at, is_met) in [(min[axis], true), (max[axis], true)] {
                let mut from = DVec3::new(3.0, 4.0, 5.0);
                from[axis] = f64::from(at);
                from[across] = 0.0;
                let mut to = from;
                to[across] = 1.0;
                let ray = Ray::through(from, to).unwrap();
                assert_eq!(ray.enter(min, max).is_some(), is_met, "along a side across axis {axis} at {at}");
                for beyond in [-1e-9, 1e-9] {
                    let mut beside = from;
                    beside[axis] += beyond;
                    let ray = Ray::through(beside, beside + to - from).unwrap();
                    let is_inside =
                        beside[axis] > f64::from(min[axis]) && beside[axis] < f64::from(max[axis]);
                    assert_eq!(ray.enter(min, max).is_some(), is_inside, "axis {axis}, {beyond} beside {at}");
                }
            }
            let mut from = DVec3::new(3.0, 4.0, 5.0);
            from[axis] = f64::from(max[axis]);
            let mut to = from;
            to[axis] += 1.0;
            let out = Ray::through(from, to).unwrap();
            assert_eq!(out.enter(min, max), Some(0.0), "out of the side across axis {axis}");
            let behind = Ray::through(to, to + (to - from)).unwrap();
            assert_eq!(behind.enter(min, max), None, "a box behind a ray along axis {axis}");
        }
    }

    /// Rays are aimed at edges of a box. The exact parameters of entry and exit are compared as products.
    #[test]
    fn rays_enter_boxes_no_later_than_exactly() {
        let mut rng = Random(12);
        let mut counts = [0; 3];
        for _ in 0..30_000 {
            let (a, b) = (rng.vec3(-9.0, 9.0), rng.vec3(-9.0, 9.0));
            let (min, max) = (a.min(b), a.max(b));
            let origin = (rng.direction() * 20.0).as_vec3().as_dvec3();
            let corner = |x: usize| f64::from(if x == 0 { a[0] } else { b[0] });
            let mut edge = DVec3::new(corner(rng.below(2)), f64::from(a.y), f64::from(a.z));
            let along_edge = rng.below(3);
            edge[along_edge] += f64::from(b[along_edge] - a[along_edge]) * rng.unit();
            let Some(ray) = Ray::through(origin, edge) else { continue };
            let d = ray.along;
            // Distances, by axis, to the planes where the ray enters and leaves the slab: exact differences.
            let ends: [[f64; 2]; 3] = core::array::from_fn(|i| {
                let [low, high] = [min[i], max[i]].map(|at| f64::from(at) - origin[i]);
                if d[i] > 0.0 { [low, high] } else { [high, low] }
            });
            let is_missed = (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).any(|(i, j)| {
                // ends[i][0] / d[i] > ends[j][1] / d[j]
                let sign = (d[i] * d[j]).signum();
                sign_of_sum([(sign * ends[i][0], d[j]), (-sign * ends[j][1], d[i])]) > 0
            });
            match ray.enter(min, max) {
                None => {
                    counts[0] += 1;
                    assert!(is_missed, "{ray:?} meets {min} {max}");
                }
                Some(lower) => {
                    counts[if is_missed { 2 } else { 1 }] += 1;
                    // lower <= ends[i][0] / d[i] for one axis
                    let is_bound =
                        |i: usize| sign_of_sum([(lower, d[i].abs()), (-ends[i][0], d[i].signum())]) <= 0;
                    assert!(lower >= 0.0 && (0..3).any(is_bound), "{ray:?} enters {min} {max} after {lower}");
                    let nearest = (0..3).map(|i| ends[i][0] / d[i]).fold(0.0, f64::max);
                    assert!(lower >= nearest * (1.0 - 1e-14), "{ray:?} enters {min} {max} at {nearest}");
                }
            }
        }
        assert!(counts[0] > 1_000 && counts[1] > 10_000 && counts[2] > 1_000, "{counts:?}");
    }

    /// Returns the parameter at which a ray meets a triangle, and whether it comes from the front. `None` if
    /// it misses, or if rounding of `f64` could decide.
    fn met(ray: &Ray, corners: [DVec3; 3]) -> Option<(f64, bool)> {
        let p = corners.map(|p| p - ray.origin);
        let sides: [f64; 3] = core::array::from_fn(|i| ray.along.dot(p[(i + 1) % 3].cross(p[(i + 2) % 3])));
        let sum = sides[0] + sides[1] + sides[2];
        let is_met = sides.iter().all(|&side| side > 1e-9) || sides.iter().all(|&side| side < -1e-9);
        let normal = (p[1] - p[0]).cross(p[2] - p[0]);
        let at = normal.dot(p[0]) / normal.dot(ray.along);
        (is_met && sum.abs() > 1e-6 && at > 1e-9).then_some((at, sum < 0.0))
    }

    /// Corners that are known up to a slack are moved by it along each axis: every ray is told what holds for
    /// all triangles that these may be.
    #[test]
    fn corners_may_be_anywhere_within_the_slack() {
        let mut rng = Random(13);
        let mut counts = [0; 4];
        for round in 0..20_000 {
            let slack = [1e-5, 1e-4, 0.1, 0.4][round % 4];
            let is_one_sided = rng.one_in(2);
            let origin = rng.vec3(-3.0, 3.0).as_dvec3();
            // Triangles of all slopes, some of them around the origin of the ray.
            let size = [1.0, 4.0][rng.below(2)];
            let middle = if rng.one_in(2) { origin } else { rng.vec3(-6.0, 6.0).as_dvec3() };
            let corners = [(); 3].map(|()| (middle + rng.vector(size)).as_vec3());
            // Every other ray is aimed near an edge.
            let beside = if rng.one_in(2) { 1.0 } else { 30.0 * slack / size };
            let weights = [rng.unit() + 1e-3, rng.unit() + 1e-3, (rng.unit() - 0.5) * beside];
            let sum = weights[0] + weights[1] + weights[2];
            let aim: DVec3 = (0..3).map(|i| corners[i].as_dvec3() * (weights[i] / sum)).sum();
            let Some(ray) = Ray::through(origin, aim) else { continue };
            let told = ray.meet(&corners, slack, is_one_sided);
            for trial in 0..24 {
                let mut by = || DVec3::from_array([(); 3].map(|()| slack * [-1.0, 1.0][rng.below(2)]));
                let one = by();
                // All corners are moved alike, one alone, or each by itself.
                let moved: [DVec3; 3] = match trial % 4 {
                    0 => [one; 3],
                    1 => [one, DVec3::ZERO, DVec3::ZERO],
                    2 => [one, by(), DVec3::ZERO],
                    _ => [one, by(), by()],
                };
                let shift = rng.below(3);
                let moved = core::array::from_fn(|i| corners[i].as_dvec3() + moved[(i + shift) % 3]);
                let exact = met(&ray, moved);
                match told {
                    None => {
                        let is_missed = exact.is_none_or(|(_, is_front)| is_one_sided && !is_front);
                        assert!(is_missed, "{round}: {ray:?} meets {moved:?}, which is {corners:?}");
                        counts[0] += 1;
                    }
                    Some(Meeting { least, most }) => {
                        if let Some((at, _)) = exact {
                            assert!(at >= least - 1e-9 && at <= most + 1e-9, "{round}: {at} of {told:?}");
                            counts[1] += 1;
                        }
                        if most < f64::INFINITY {
                            let is_behind = least < 1e-6;
                            assert!(exact.is_some() || is_behind, "{round}: {ray:?} misses {moved:?}");
                            let is_front = exact.is_none_or(|(_, is_front)| is_front);
                            assert!(is_front || !is_one_sided, "{round}: the back of {moved:?}");
                            counts[2] += 1;
                        } else {
                            counts[3] += 1;
                        }
                    }
                }
            }
        }
        assert!(counts.iter().all(|&count| count > 5_000), "{counts:?}");
    }

    /// Triangles across the ray, whose corners have one parameter: bounds on it hold for the exact one.
    #[test]
    fn parameters_of_triangles_across_the_ray_are_within_their_bounds() {
        let d = [3.0, 7.0, 5.0];
        let ray = Ray::through(DVec3::ZERO, DVec3::from_array(d)).unwrap();
        for k in 1..200u8 {
            let k = f64::from(k);
            // Steps across the ray, around a point of it.
            let steps = [[7.0, -3.0, 0.0], [0.0, 5.0, -7.0], [-7.0, -2.0, 7.0]];
            let corner = |u: [f64; 3]| Vec3::from_array([0, 1, 2].map(|i| (k * d[i] + 50.0 * u[i]) as f32));
            let meeting = ray.meet(&steps.map(corner), 0.0, false).unwrap();
            assert!(meeting.is_certain(), "{k}: the ray passes the middle of the triangle");
            // The sign of t (d . along) - k (d . d), exactly: which side of the triangle the ray is on at t.
            let side = |t: f64| {
                let terms = (0..3).flat_map(|i| {
                    let product = t * d[i];
                    let rest = t.mul_add(d[i], -product);
                    [(product, ray.along[i]), (rest, ray.along[i]), (-k, d[i] * d[i])]
                });
                sign_of_sum(terms)
            };
            assert!(side(meeting.least) <= 0 && side(meeting.most) >= 0, "{k}: {meeting:?}");
            assert!(meeting.most - meeting.least < 1e-9, "{k}: {meeting:?}");
        }
    }

    /// Triangles with corners of whole coordinates, some near and some far: bounds on the parameter hold for
    /// the exact plane.
    #[test]
    fn parameters_are_within_their_bounds_exactly() {
        let mut rng = Random(14);
        let mut counts = [0; 2];
        for round in 0..60_000 {
            let scales = [(); 3].map(|()| [1e1, 1e3, 1e5][rng.below(3)]);
            let mut corners = scales.map(|scale| (rng.vector(scale) + DVec3::splat(5.0)).round().as_vec3());
            let inwards = [0.0, 1e-9, 1e-4, 0.3][rng.below(4)];
            let mut target = corners[0].as_dvec3().lerp(corners[1].as_dvec3(), rng.unit());
            target = target.lerp(corners[2].as_dvec3(), inwards);
            if round % 2 == 0 {
                // Two corners far to either side of the ray, about where it passes between them.
                target = DVec3::new(3.0, 7.0, 5.0);
                let [k, s] = [rng.between(1, 5), rng.between(1, 10_000)].map(f64::from);
                let (across, beside) = (DVec3::new(7.0, -3.0, 0.0) * s, DVec3::new(0.0, 5.0, -7.0));
                let near = target * k;
                corners =
                    [near + across, near - across - beside, near * 5.0 + beside * 9.0].map(|p| p.as_vec3());
                corners.rotate_left(round / 2 % 3);
            }
            let p = corners.map(|p| p.as_dvec3());
            let Some(ray) = Ray::through(DVec3::ZERO, target) else { continue };
            let Some(meeting) = ray.meet(&corners, 0.0, false) else { continue };
            let sides: [i32; 3] =
                core::array::from_fn(|i| exact_side(&ray, corners[(i + 1) % 3], corners[(i + 2) % 3]));
            if sides.iter().any(|&side| side != sides[0] || side == 0) {
                continue;
            }
            // t (n . along) against n . p, with a normal n of whole numbers.
            let n = (p[1] - p[0]).cross(p[2] - p[0]).to_array();
            let along = ray.along.to_array();
            let front = sign_of_sum([0, 1, 2].map(|i| (n[i], along[i])));
            let side = |t: f64| {
                let terms = (0..3).flat_map(|i| {
                    let product = t * n[i];
                    let rest = t.mul_add(n[i], -product);
                    [(product, along[i]), (rest, along[i]), (-n[i], p[0][i])]
                });
                front * sign_of_sum(terms)
            };
            counts[usize::from(meeting.is_certain())] += 1;
            assert!(side(meeting.least) <= 0, "{round}: {ray:?} meets {corners:?} before {meeting:?}");
            if meeting.is_certain() {
                assert!(side(meeting.most) >= 0, "{round}: {ray:?} meets {corners:?} after {meeting:?}");
            }
        }
        assert!(counts.iter().all(|&count| count > 200), "{counts:?}");
    }

    /// Triangles across a ray along (1, 0.37, 0.37), the direction in which moving all corners by the slack
    /// along each axis moves the meeting most, by 1.366 slack.
    #[test]
    fn parameters_move_by_more_than_the_slack() {
        let d = DVec3::new(1.0, 0.37, 0.37);
        let ray = Ray::through(DVec3::ZERO, d).unwrap();
        let (u, v) = (d.cross(DVec3::Z).normalize(), d.cross(d.cross(DVec3::Z)).normalize());
        let across = |t: f64| [u * 3.0, v * 3.0 - u * 2.0, -v * 3.0 - u * 2.0].map(|p| (p + d * t).as_vec3());
        let behind = across(-0.12);
        assert!(ray.meet(&behind, 0.1, false).is_some(), "a triangle that may be before the ray");
        assert!(ray.meet(&behind, 0.05, false).is_none(), "a triangle that is behind the ray");
        let slack = 1e-5;
        let meeting = ray.meet(&across(5.0), slack, false).unwrap();
        assert!(meeting.is_certain(), "{meeting:?} in the middle of a triangle");
        assert!(meeting.least <= 5.0 - 1.36 * slack, "{meeting:?}: the triangle may be nearer");
        assert!(meeting.most >= 5.0 + 1.36 * slack, "{meeting:?}: the triangle may be farther");
    }
}
