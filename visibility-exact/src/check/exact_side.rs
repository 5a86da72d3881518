//! Sides on which lines pass edges, as signs of determinants in double-double arithmetic.

use crate::line_side::U;
use visibility_core::geometry::DoubleDouble;
use visibility_core::glam::DVec3;

/// Number with 106 bits of precision.
pub(super) type D = DoubleDouble;

pub(super) fn difference(a: DVec3, b: DVec3) -> [D; 3] {
    [D::difference(a.x, b.x), D::difference(a.y, b.y), D::difference(a.z, b.z)]
}

pub(super) fn cross(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i].times(b[j]).plus(a[j].times(b[i]).negated()))
}

pub(super) fn dot(a: [D; 3], b: [D; 3]) -> D {
    a[0].times(b[0]).plus(a[1].times(b[1])).plus(a[2].times(b[2]))
}

/// Returns the sum of the magnitudes of the components of a vector.
pub(super) fn norm(a: [D; 3]) -> f64 {
    a.iter().map(|x| x.hi.abs()).sum()
}

/// Least sum of the products of a side, in cubic metres, that underflow does not reach.
const LEAST: f64 = 1e-200;

/// Returns det(q - p, a - p, b - p), and a bound on its change if each coordinate changes by at most `delta`.
///
/// To first order the change is delta times the sum of the magnitudes of the derivatives. The derivative by a
/// point is the cross product of two differences of the others. The bound is twice this change: that covers
/// higher orders where the value is not smaller than the bound.
///
/// Rounding, with E the relative error of a double-double operation: differences are exact, a component of
/// the cross product is wrong by 2 E of the sum of the magnitudes of its two products, and the product with
/// the difference and two sums add 3 E. Together this is less than 8 E of the sum of the magnitudes of the
/// six terms. A bound from the lengths of the vectors would be too wide: in proofs by the search, lines may
/// pass an edge so closely that the determinant is only 16 U times the sum of the magnitudes of the six
/// terms, with U the unit round-off of `f64`.
pub(super) fn side(p: DVec3, q: DVec3, a: DVec3, b: DVec3, delta: f64) -> (f64, f64) {
    let (r, u, w) = (difference(q, p), difference(a, p), difference(b, p));
    let normal = cross(u, w);
    let value = dot(r, normal).hi;
    let term = |i: usize, j: usize, k: usize| (r[i].hi * u[j].hi * w[k].hi).abs();
    let terms: f64 =
        [(0, 1, 2), (1, 2, 0), (2, 0, 1)].map(|(i, j, k)| term(i, j, k) + term(i, k, j)).iter().sum();
    // Where products come near the least number, nothing is known but that a product with 0 is 0. Coordinates
    // of triangles have differences of at least 2^-149, but those of a viewcell may be smaller.
    let is_product = |i: usize, j: usize, k: usize| r[i].hi != 0.0 && u[j].hi != 0.0 && w[k].hi != 0.0;
    let has_products = [(0, 1, 2), (1, 2, 0), (2, 0, 1)]
        .into_iter()
        .any(|(i, j, k)| is_product(i, j, k) || is_product(i, k, j));
    let rounding = if terms < LEAST && has_products { f64::INFINITY } else { 8.0 * D::ERROR * terms };
    let opposite = cross(difference(a, q), difference(b, q));
    let slopes = norm(normal) + norm(opposite) + norm(cross(r, w)) + norm(cross(r, u));
    (value, 2.0 * delta * slopes + rounding)
}

/// Returns the side and its error bound as [`side`] does, but computed in `f64` where `f64` decides the sign.
/// The sign always equals that of [`side`].
///
/// Rounding, with U the unit round-off of `f64` and E the relative error of a double-double operation:
/// differences round by U of their magnitude. A component of a cross product is a difference of two products.
/// It is wrong by 5 U m, with m the sum of the magnitudes of the two products, including the errors of their
/// factors. The product with a difference and two sums add 4 U, so the value is wrong by 9 U of the sum of
/// the magnitudes of the six terms. The bound takes 16 U. A derivative is wrong by 5 U m, and the bound adds
/// 8 U m to it. The remaining error of the double-double value, 8 E of the terms, is far less than the
/// difference between 16 U and 9 U.
pub(super) fn quick_side(p: DVec3, q: DVec3, a: DVec3, b: DVec3, delta: f64) -> (f64, f64) {
    let (r, u, w) = (q - p, a - p, b - p);
    let products = |x: DVec3, y: DVec3| {
        let (x, y) = (x.abs(), y.abs());
        DVec3::new(x.y * y.z + x.z * y.y, x.z * y.x + x.x * y.z, x.x * y.y + x.y * y.x)
    };
    let normal = u.cross(w);
    let slope = |x: DVec3, y: DVec3| (x.cross(y).abs() + products(x, y) * (8.0 * U)).element_sum();
    let slopes = slope(u, w) + slope(a - q, b - q) + slope(r, w) + slope(r, u);
    let (value, terms) = (r.dot(normal), r.abs().dot(products(u, w)));
    let error = 2.0 * delta * slopes + 16.0 * U * terms;
    if value.abs() > error && terms >= LEAST { (value, error) } else { side(p, q, a, b, delta) }
}

/// Returns whether a point `x` is certainly before the front of triangle a, b, c. That is so if the
/// determinant det(a - x, b - x, c - x) is below -`slack` by more than its rounding error.
pub(super) fn is_before(x: DVec3, [a, b, c]: [DVec3; 3], slack: f64) -> bool {
    let below = |(value, rounding): (f64, f64)| value < -(rounding + slack);
    below(quick_side(x, a, b, c, 0.0)) || below(side(x, a, b, c, 0.0))
}

#[cfg(test)]
mod tests {
    use super::super::surface::crosses;
    use super::*;
    use visibility_testing::Random;

    fn sign((value, error): (f64, f64)) -> i32 {
        i32::from(value > error) - i32::from(value < -error)
    }

    /// A determinant that is below the least number is unsure, one whose products have a factor of 0 is 0.
    #[test]
    fn sides_that_underflow_are_unsure() {
        for least in [1e-170, 5e-324] {
            let (y, z) = (DVec3::Y * least, DVec3::Z * least);
            for side in [side, quick_side] {
                assert_eq!(
                    side(DVec3::ZERO, DVec3::X, y, z, 0.0),
                    (0.0, f64::INFINITY),
                    "a side of {least}^2"
                );
                assert_eq!(side(DVec3::ZERO, DVec3::X, y, 2.0 * y, 0.0), (0.0, 0.0), "in one plane, {least}");
                assert_eq!(
                    side(DVec3::ZERO, DVec3::Y, y, z, 0.0),
                    (0.0, 0.0),
                    "in the plane of axes, {least}"
                );
                for (i, j, k) in [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)] {
                    let (r, u, w) = (DVec3::AXES[i], DVec3::AXES[j] * least, DVec3::AXES[k] * least);
                    let found = side(DVec3::ZERO, r, u, w, 0.0);
                    assert_eq!(found, (0.0, f64::INFINITY), "{least}, axes {i}, {j} and {k}");
                }
            }
        }
    }

    /// Products of 1.4 and 1.3 times the least number both round to it. The long line makes their sum, which
    /// has the wrong sign, as large as a side that is certain.
    #[test]
    fn products_that_underflow_decide_no_side() {
        let least = 2f64.powi(-537);
        let (u, w) = (DVec3::new(1.3, 1.4, 0.0) * least, DVec3::Z * least);
        let r = DVec3::new(1.0, 1.05, 0.0) * 2f64.powi(100);
        assert!(1.4 > 1.05 * 1.3 && r.dot(u.cross(w)) < 0.0, "the sign in `f64` is wrong");
        for side in [side, quick_side] {
            assert_eq!(sign(side(DVec3::ZERO, r, u, w, 0.0)), 0, "a line past an edge of that size");
        }
    }

    /// Positions of few digits, so that determinants are exact, moved by up to `delta` to where the
    /// determinant changes most.
    #[test]
    fn sides_that_moved_positions_change_are_unsure() {
        let mut random = Random(71);
        let exact = |p: DVec3, q: DVec3, a: DVec3, b: DVec3| (q - p).dot((a - p).cross(b - p));
        let mut changed = 0;
        for round in 0..100_000 {
            let mut int = || DVec3::from_array([(); 3].map(|()| f64::from(random.between(-6, 6))));
            let (p, q, a, b) = (int(), int(), int(), int());
            let delta = [0.125, 0.25, 0.5, 1.0][round % 4];
            let value = exact(p, q, a, b);
            // The derivatives by a, b, q and p.
            let slopes = [(q - p, b - p), (a - p, q - p), (a - p, b - p), (b - q, a - q)];
            let slopes = slopes.map(|(x, y)| x.cross(y));
            let slopes = [-slopes[0], -slopes[1], slopes[2], slopes[3]];
            let by = slopes.map(|slope| slope.signum() * (-value.signum() * delta));
            let moved = exact(p + by[3], q + by[2], a + by[0], b + by[1]);
            changed += u32::from(value * moved < 0.0);
            if value * moved <= 0.0 {
                let found = [side, quick_side].map(|side| sign(side(p, q, a, b, delta)));
                assert_eq!(found, [0; 2], "{round}: {value} becomes {moved} by moves of {delta}");
            }
        }
        assert!(changed > 1000, "{changed} sides change");
    }

    /// Four points in a plane, in integers of 53 bits, so that the determinant is 0 up to rounding.
    #[test]
    fn sides_of_points_in_a_plane_are_unsure() {
        let mut random = Random(72);
        let mut rounded = [0; 4];
        for round in 0..10_000 {
            let mut int = |bits: u32| {
                DVec3::from_array([(); 3].map(|()| ((random.bits() as i64) >> (64 - bits)) as f64))
            };
            let (u, w, parts) = (int(40), int(40), int(11));
            let r = u * parts.x + w * parts.y;
            let found = [side, quick_side].map(|side| side(DVec3::ZERO, r, u, w, 0.0));
            assert_eq!(found.map(sign), [0; 2], "{round}: {r} {u} {w}");
            assert!(!is_before(DVec3::ZERO, [r, u, w], 0.0), "{round}: a point in the plane of a triangle");
            // Off the plane by so little that `f64` does not decide the side.
            let beside = [side, quick_side].map(|side| side(DVec3::ZERO, r + DVec3::X, u, w, 0.0));
            assert_eq!(sign(beside[0]), sign(beside[1]), "{round}: sides beside {r} {u} {w}");
            let far = [side, quick_side].map(|side| side(DVec3::ZERO, r + u.cross(w), u, w, 0.0));
            assert!((far[0].0 - far[1].0).abs() <= far[1].1, "{round}: {far:?}");
            rounded[2] += u32::from(far[0].0 != far[1].0);
            // The line through a point of an edge crosses no triangle at this edge for sure.
            let third = DVec3::splat(-1.0) * (u + w) + u.cross(w) * 2f64.powi(-45);
            for k in 0..6 {
                let mut t = if k < 3 { [u, w, third] } else { [w, u, third] };
                t.rotate_left(k % 3);
                let found = crosses([DVec3::ZERO, r], &t);
                assert_ne!(found, Some(true), "{round}: {r} meets an edge of {t:?}");
                rounded[3] += u32::from(found.is_none());
            }
            rounded[0] += u32::from(found[0].0 != 0.0);
            rounded[1] += u32::from(r.dot(u.cross(w)) != 0.0);
        }
        assert!(rounded.iter().all(|&rounded| rounded > 1000), "{rounded:?} are rounded");
    }

    /// A corner of a viewcell 3e-11 m before the plane of a triangle, from a proof of a village: the
    /// determinant is 4.66e-12, and its error in `f64` 4e-12.
    #[test]
    fn what_f64_leaves_open_is_decided() {
        let x = DVec3::new(217.6320253986512, 1.3300600802307243, 107.2);
        let triangle = [
            DVec3::new(202.08712768554688, 2.4815409183502197, 127.35625457763672),
            DVec3::new(201.8103790283203, 2.48138427734375, 127.65131378173828),
            DVec3::new(201.65684509277344, 2.325841188430786, 127.33496856689453),
        ];
        assert!(is_before(x, triangle, 1.757e-12), "the point is 1.757e-12 before the triangle at least");
        assert!(!is_before(x, triangle, 4.7e-12), "the point is 4.7e-12 before the triangle at least");
        let [a, b, c] = triangle;
        assert!(!is_before(x, [a, c, b], 0.0), "its back");
    }
}
