//! Sides on which lines pass edges, with bounds on rounding errors.
//!
//! A line through p and q passes an edge a-b on the side of the sign of det(q - p, a - p, b - p). This
//! determinant is affine in p, in q, in a and in b. For a point p of a convex polygon P and a point q of a
//! convex polygon Q it is therefore a weighted mean, with positive weights, of its values at pairs of
//! corners. If these values have one sign, all lines from P to Q pass the edge on one side.

use visibility_core::glam::DVec3;

/// Unit round-off of `f64`, 2^-53.
pub(crate) const U: f64 = f64::EPSILON / 2.0;

/// Tag of a vertex, or of an end of an edge, that is no corner of the target triangle. The tag of a corner is
/// its number, 0 to 2.
pub(crate) const NO_CORNER: u8 = 3;

/// An edge in scene coordinates.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Edge {
    /// Positions of the ends.
    pub(crate) ends: [DVec3; 2],
    /// For each end, the number of the target triangle's corner that it is (0, 1 or 2), or [`NO_CORNER`].
    pub(crate) tags: [u8; 2],
}

impl Edge {
    pub(crate) fn new(a: DVec3, b: DVec3) -> Self {
        Self { ends: [a, b], tags: [NO_CORNER; 2] }
    }
}

/// Constraint on lines: they must pass an edge on the given side.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Row {
    pub(crate) edge: Edge,
    /// Required sign of the determinant of [`side`](crate::line_side::side), 1 or -1.
    pub(crate) side: f64,
}

/// Determinant of [`side`] with one edge and one start p of the lines held fixed.
pub(crate) struct SideFrom {
    p: DVec3,
    normal: DVec3,
    bound: DVec3,
    slack: f64,
}

/// Positions are given with an absolute error of at most `delta` on each axis. With U the unit round-off of
/// `f64`, and u = a - p, w = b - p and r = q - p, of absolute errors 2 delta + U |x|, the parts of the bound
/// are, with S = |u|_1 + |w|_1:
/// - The cross product n = u x w: each component is a difference of two products of rounded differences, 5 U
///   of the sum m of the products' magnitudes, and at most 2 delta S + 8 delta^2 from the positions.
/// - The product r . n rounds 3 times and r once: 4 U |r| . m. The positions in r give 2 delta |n|_1.
///
/// The sum is at most |r| . (9 U m + 2 delta S) + 2 delta |n|_1 and terms of second order. The bound takes
/// 16 U, 4 delta S and 4 delta |n|_1, which covers those terms if S >= 4 delta, and 16 delta^2 S for r of
/// the size of delta. If S < 4 delta, then |r . n| <= |r|_1 S^2 is below the bound, and the side is unsure.
/// The coordinates are f32 and cells of their magnitude, so no product overflows or underflows.
impl SideFrom {
    #[inline]
    pub(crate) fn new(p: DVec3, a: DVec3, b: DVec3, delta: f64) -> Self {
        let (u, w) = (a - p, b - p);
        let (x, y) = (u.abs(), w.abs());
        let normal = u.cross(w);
        let products = DVec3::new(x.y * y.z + x.z * y.y, x.z * y.x + x.x * y.z, x.x * y.y + x.y * y.x);
        let sum = x.element_sum() + y.element_sum();
        let bound = products * (16.0 * U) + DVec3::splat(4.0 * delta * sum);
        let slack = 4.0 * delta * normal.abs().element_sum() + 16.0 * delta * delta * sum;
        Self { p, normal, bound, slack }
    }

    /// Returns det(q - p, a - p, b - p), whose sign is the side of the line from p to `q`, and a bound on its
    /// error.
    #[inline]
    pub(crate) fn to(&self, q: DVec3) -> (f64, f64) {
        let r = q - self.p;
        (r.dot(self.normal), r.abs().dot(self.bound) + self.slack)
    }
}

/// Returns det(q - p, a - p, b - p) and a bound on its absolute error, where the positions have errors of at
/// most `delta` on each axis.
#[inline]
pub(crate) fn side(p: DVec3, q: DVec3, a: DVec3, b: DVec3, delta: f64) -> (f64, f64) {
    SideFrom::new(p, a, b, delta).to(q)
}

/// Returns 1 or -1 for a value certainly positive or negative, and 0 if its error leaves that open or if it
/// is NaN.
#[inline]
pub(crate) fn sign((value, error): (f64, f64)) -> i32 {
    i32::from(value > error) - i32::from(value < -error)
}

/// Relation between a segment and a triangle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Crossing {
    /// The segment certainly crosses the inside of the triangle.
    Yes,
    /// The segment certainly does not touch the triangle.
    No,
    /// Rounding decides nothing, or the segment touches the triangle's boundary.
    Unsure,
}

/// Tells whether the segment from p to q crosses the inside of a triangle. All points are taken as exact.
#[inline]
pub(crate) fn segment_triangle(p: DVec3, q: DVec3, t: &[DVec3; 3]) -> Crossing {
    let s = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| sign(side(p, q, t[i], t[j], 0.0)));
    let (least, greatest) = (s[0].min(s[1]).min(s[2]), s[0].max(s[1]).max(s[2]));
    if least * greatest < 0 {
        return Crossing::No;
    }
    // Twice the triangle's area times the heights of p and q over the triangle's plane, negated.
    let heights = [p, q].map(|x| sign(side(x, t[0], t[1], t[2], 0.0)));
    match heights[0] * heights[1] {
        1 => Crossing::No,
        -1 if !s.contains(&0) => Crossing::Yes,
        _ => Crossing::Unsure,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    fn moved(v: DVec3, delta: f64, random: &mut Random) -> DVec3 {
        v + DVec3::from_array(core::array::from_fn(|_| if random.one_in(2) { delta } else { -delta }))
    }

    /// Lines that meet the edge, in exact integers, count as on no side. The cases need every part of the
    /// error bound: for a short line the error of its direction, for an edge that points at p the error of
    /// the edge's ends, and with exact positions the rounding errors.
    #[test]
    fn lines_that_meet_an_edge_are_on_no_side() {
        let mut random = Random(2);
        let mut int = |r: i32| DVec3::from_array(core::array::from_fn(|_| f64::from(random.between(-r, r))));
        let mut random = Random(3);
        for round in 0..20_000 {
            let (p, a, d) = (int(1000), int(1000), int(100));
            // Point b lies behind or beside a as seen from p; q lies on the line from p through a point of
            // the edge.
            let b = match round % 3 {
                0 => a + (a - p) + int(1),
                _ => a + d,
            };
            let q = match round % 3 {
                1 => p + (a - p) / 1024.0,
                _ => a + (a - p) * 3.0,
            };
            let delta = if round % 3 == 2 { 0.0 } else { 1e-7 };
            // Thirds are not representable, so these positions have rounding errors only.
            let scale = if round % 3 == 2 { 1.0 / 3.0 } else { 1.0 };
            let [p, q, a, b] = [p, q, a, b].map(|v| moved(v, delta, &mut random) * scale);
            let delta = if round % 3 == 2 { 400.0 * U } else { delta * 1.001 };
            assert_eq!(sign(side(p, q, a, b, delta)), 0, "{round}: {p} {q} {a} {b}");
        }
    }

    /// Positions of few digits, moved by up to `delta` to where the side changes most. Some are as near to
    /// each other as that.
    #[test]
    fn sides_that_moved_positions_change_are_unsure() {
        let mut random = Random(5);
        let exact = |p: DVec3, q: DVec3, a: DVec3, b: DVec3| (q - p).dot((a - p).cross(b - p));
        let mut changed = 0;
        for round in 0..100_000 {
            let mut int = |r: i32| DVec3::from_array([(); 3].map(|()| f64::from(random.between(-r, r))));
            let p = int(6);
            let near = [6, 1, 0][round % 3];
            let (q, a, b) = (p + int(near), p + int(6), p + int(6));
            let delta = [0.125, 0.25, 0.5, 1.0][round % 4];
            let value = exact(p, q, a, b);
            let (r, u, w) = (q - p, a - p, b - p);
            let slopes = [w.cross(r), r.cross(u), u.cross(w), (b - q).cross(a - q)];
            let by = slopes.map(|slope| slope.signum() * (-value.signum() * delta));
            let moved = exact(p + by[3], q + by[2], a + by[0], b + by[1]);
            changed += u32::from(value * moved < 0.0);
            let found = sign(side(p, q, a, b, delta));
            assert!(
                value * moved > 0.0 || found == 0,
                "{round}: {value} becomes {moved} by moves of {delta}"
            );
        }
        assert!(changed > 1000, "{changed} sides change");
    }

    /// Coordinates are integers of up to 40 bits, and sides are compared with exact determinants of 128 bits.
    #[test]
    fn sides_are_within_their_bounds_of_exact_ones() {
        let mut random = Random(4);
        for _ in 0..50_000 {
            let size = 1i64 << (10 + random.below(30));
            let mut point = || core::array::from_fn::<i64, 3, _>(|_| (random.bits() as i64) % size);
            let (p, a, b) = (point(), point(), point());
            // Point q lies near the plane of p, a and b.
            let (i, j) = (point()[0] % 3, point()[1] % 3);
            let near = point();
            let q = core::array::from_fn(|k| (p[k] + i * a[k] + j * b[k]) / 4 + near[k] % 4);
            let exact = {
                let [r, u, w] =
                    [q, a, b].map(|x| core::array::from_fn::<i128, 3, _>(|k| (x[k] - p[k]).into()));
                (0..3)
                    .map(|k| r[k] * (u[(k + 1) % 3] * w[(k + 2) % 3] - u[(k + 2) % 3] * w[(k + 1) % 3]))
                    .sum::<i128>()
            };
            let float = |x: [i64; 3]| DVec3::from_array(x.map(|x| x as f64));
            let found = sign(side(float(p), float(q), float(a), float(b), 0.0));
            assert!(found == 0 || i128::from(found) == exact.signum(), "{p:?} {q:?} {a:?} {b:?}");
        }
    }
}
