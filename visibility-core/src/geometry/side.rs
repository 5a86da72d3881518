//! Tests on which side of a plane a point or a polygon lies, decided only where rounding leaves no doubt.
//!
//! Structures that divide space by planes (BSP trees, occlusion trees, shadow frusta) ask one question over
//! and over: front, back, or too close to tell. This module has two forms of the test. [`SidePlane`] takes
//! the coefficients of a plane as given and adds a margin that is valid for all points up to a given
//! magnitude, cut points included. [`orientation`] takes three points instead and includes the rounding of
//! the plane itself in its bound (after Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast
//! Robust Geometric Predicates", 1997: the filter of its `orient3d`).

use super::Plane;
use glam::DVec3;

/// Unit round-off of `f64`, 2^-53.
const U: f64 = f64::EPSILON / 2.0;

/// Side of an oriented plane on which a point lies.
///
/// ```
/// use visibility_core::{geometry::{orientation, Side}, glam::DVec3};
/// assert_eq!(orientation(DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z), Side::Front);
/// assert_eq!(Side::Front.opposite(), Side::Back);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum Side {
    /// The point is certainly on the side that the normal points to.
    Front,
    /// The point is so close to the plane that rounding may have decided the sign of its distance, or the
    /// distance is NaN.
    On,
    /// The point is certainly on the side that the normal points away from.
    Back,
}

impl Side {
    /// Returns the side for a signed `distance` whose absolute error is at most `margin`, in the same unit.
    /// `On` if the distance is within the margin, or if either number is NaN.
    #[inline]
    pub fn of(distance: f64, margin: f64) -> Self {
        if distance > margin {
            Self::Front
        } else if distance < -margin {
            Self::Back
        } else {
            Self::On
        }
    }

    /// Returns the side of a point with respect to the flipped plane, given its side of the plane: exchanges
    /// `Front` and `Back`, keeps `On`.
    #[must_use]
    pub const fn opposite(self) -> Self {
        match self {
            Self::Front => Self::Back,
            Self::On => Self::On,
            Self::Back => Self::Front,
        }
    }
}

/// Side of an oriented plane on which a polygon, or any set of points, lies.
///
/// ```
/// use visibility_core::{geometry::{Plane, PolygonSide, SidePlane}, glam::DVec3};
/// let plane = SidePlane::new(Plane::new(DVec3::Z, 0.0), DVec3::ONE);
/// // The plane touches one corner of the polygon, so the polygon counts as in front.
/// assert_eq!(plane.side_of_polygon(&[DVec3::ZERO, DVec3::Z, DVec3::ONE]), PolygonSide::Front);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum PolygonSide {
    /// At least one point is certainly in front of the plane and none is certainly behind it. Points on the
    /// plane do not count.
    Front,
    /// No point is certainly off the plane: the polygon lies in the plane, is thinner than the margin, has no
    /// points or only NaN distances.
    On,
    /// At least one point is certainly behind the plane and none is certainly in front of it. Points on the
    /// plane do not count.
    Back,
    /// At least one point is certainly in front of the plane and at least one certainly behind it.
    Across,
}

/// A plane with the margin beyond which the side of a point is certain. Points within the margin are
/// [`Side::On`].
///
/// The margin also covers points computed by [`crossing`](Self::crossing), so that a polygon cut along the
/// plane lies wholly on one side of it and is never cut by the same plane again.
///
/// ```
/// use visibility_core::{geometry::{Plane, Side, SidePlane}, glam::DVec3};
/// let plane = Plane::from_points(DVec3::X, DVec3::Y, DVec3::Z).unwrap();
/// let plane = SidePlane::new(plane, DVec3::splat(10.0));
/// let (a, b) = (DVec3::splat(-7.0), DVec3::new(9.0, 1.0, 3.0));
/// assert_eq!((plane.side(a), plane.side(b)), (Side::Back, Side::Front));
/// assert_eq!(plane.side(plane.crossing(a, b)), Side::On);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SidePlane {
    /// The plane, with a normal of any length.
    pub plane: Plane,
    /// Greatest absolute value of [`Plane::signed_distance`] that counts as [`Side::On`], in metres times
    /// the length of the normal.
    pub margin: f64,
}

impl SidePlane {
    /// Returns a plane with a margin valid for points whose coordinates have absolute values of at most
    /// `magnitude` on each axis. For points beyond `magnitude` a side may be wrong.
    ///
    /// With `u = 2^-53` and `E` the [bound](Plane::error_bound) on the error of a signed distance at that
    /// magnitude, the margin is `8 E`:
    /// - A signed distance is computed with an error of at most `E`.
    /// - A cut point is `a + (b - a) t` with `t = da / (da - db)`, where `da` and `db` are the signed
    ///   distances of `a` and `b`. Errors of `E` in `da` and `db` move the point by at most `2 E` along the
    ///   normal. The rounding of the quotient, the product and the sum moves each coordinate by at most `6 u`
    ///   of its magnitude, which is `E` once more. So a cut point is found within `4 E` of the plane that it
    ///   was cut by.
    /// - The remaining `4 E` is for a second plane through the same polygon, computed from other vertices of
    ///   it. [`Plane::from_polygon`] is within `3 E` of all points of its polygon, however thin it is. The
    ///   plane of a rounded cross product is not.
    pub fn new(plane: Plane, magnitude: DVec3) -> Self {
        Self { plane, margin: 8.0 * plane.error_bound(magnitude) }
    }

    /// Returns the side of this plane on which the point `p` lies. `On` if the point is within the margin of
    /// the plane, or for NaN.
    #[inline]
    pub fn side(&self, p: DVec3) -> Side {
        Side::of(self.plane.signed_distance(p), self.margin)
    }

    /// Returns the side of a polygon given by its vertices; `On` without points. A polygon that reaches
    /// beyond the margin on one side only is wholly on that side, not `Across`. Points with a NaN distance
    /// are ignored.
    #[inline]
    pub fn side_of_polygon(&self, points: &[DVec3]) -> PolygonSide {
        let (mut least, mut greatest) = (0.0f64, 0.0f64);
        for &p in points {
            let distance = self.plane.signed_distance(p);
            least = if distance < least { distance } else { least };
            greatest = if distance > greatest { distance } else { greatest };
        }
        match (greatest > self.margin, least < -self.margin) {
            (false, false) => PolygonSide::On,
            (true, false) => PolygonSide::Front,
            (false, true) => PolygonSide::Back,
            (true, true) => PolygonSide::Across,
        }
    }

    /// Returns the point where the plane cuts the segment from `a` to `b`, which must lie on different sides
    /// of the plane. The result lies in the bounding box of the segment, and is the lexicographically smaller
    /// end if both distances are 0. The result is bit-identical if `a` and `b` are exchanged or the plane is
    /// flipped, so that two polygons that share an edge are cut without a crack.
    #[inline]
    pub fn crossing(&self, a: DVec3, b: DVec3) -> DVec3 {
        let (a, b) = if (a.x, a.y, a.z) <= (b.x, b.y, b.z) { (a, b) } else { (b, a) };
        let (da, db) = (self.plane.signed_distance(a), self.plane.signed_distance(b));
        let point = a + (b - a) * (da / (da - db));
        // Rounding must not move the point out of the segment's box, and a quotient of two zeros must not put
        // a NaN into the polygon.
        if point.is_nan() { a } else { point.clamp(a.min(b), a.max(b)) }
    }
}

/// Returns the side of the plane through `a`, `b` and `c` on which the point `p` lies. `Front` is the side
/// from which `a`, `b`, `c` run counter-clockwise (right-handed coordinates). `On` if rounding could have
/// decided the sign, which includes (almost) collinear `a`, `b`, `c`, and for NaN.
///
/// The determinant of the differences to `p` is a sum of six products of three factors. Each difference is
/// rounded once, each product of two differences once, the difference of two such products once, the product
/// with the third factor once, and the two sums once each: 3 + 1 + 1 + 1 + 2 roundings, so with `u = 2^-53`
/// the absolute error is at most `8u` times the sum of the terms' magnitudes. The factor used is `10u`, which
/// covers second-order terms and the rounding of the bound itself. Underflow of a product loses at most the
/// least normal number, times the differences that the product is multiplied by.
pub fn orientation(a: DVec3, b: DVec3, c: DVec3, p: DVec3) -> Side {
    let (a, b, c) = (a - p, b - p, c - p);
    let minors = [(b.y * c.z, b.z * c.y), (b.z * c.x, b.x * c.z), (b.x * c.y, b.y * c.x)];
    let [x, y, z] = minors.map(|(s, t)| s - t);
    let [mx, my, mz] = minors.map(|(s, t)| s.abs() + t.abs());
    let (abs, least) = (a.abs(), f64::MIN_POSITIVE);
    // `a`, `b`, `c` are now relative to `p`. Three points that run counter-clockwise as seen from `p` have a
    // negative determinant of these differences.
    let determinant = -(a.x * x + a.y * y + a.z * z);
    let magnitude = abs.x * mx + abs.y * my + abs.z * mz;
    Side::of(determinant, 10.0 * U * magnitude + 8.0 * least * (abs.x + abs.y + abs.z) + 8.0 * least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    fn point(random: &mut Random, scale: f64) -> DVec3 {
        DVec3::from_array(core::array::from_fn(|_| random.fine_range(-scale, scale)))
    }

    /// Returns the sign of the exact determinant in integer arithmetic: 1 for `Front`, -1 for `Back`, 0 for
    /// coplanar points. Coordinates must be multiples of 1/1024 with absolute values up to 1024.
    fn exact(a: DVec3, b: DVec3, c: DVec3, p: DVec3) -> i128 {
        let whole = |v: DVec3| v.to_array().map(|x| (x * 1024.0) as i128);
        let [a, b, c, p] = [a, b, c, p].map(whole);
        let d = |v: [i128; 3]| [v[0] - p[0], v[1] - p[1], v[2] - p[2]];
        let (a, b, c) = (d(a), d(b), d(c));
        -(a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0]))
            .signum()
    }

    #[test]
    fn distances_up_to_the_margin_are_on_the_plane() {
        for (distance, side) in [
            (-1.25, Side::Back),
            (-1.0, Side::On),
            (-0.75, Side::On),
            (0.75, Side::On),
            (1.0, Side::On),
            (1.25, Side::Front),
            (f64::NAN, Side::On),
        ] {
            assert_eq!(Side::of(distance, 1.0), side, "a distance of {distance} margins");
            let plane = SidePlane { plane: Plane::new(DVec3::X, 0.0), margin: 1.0 };
            assert_eq!(plane.side(DVec3::X * distance), side, "a point {distance} margins beyond the plane");
            let polygon = match side {
                Side::Back => PolygonSide::Back,
                Side::On => PolygonSide::On,
                Side::Front => PolygonSide::Front,
            };
            let found = plane.side_of_polygon(&[DVec3::ZERO, DVec3::X * distance]);
            assert_eq!(found, polygon, "a polygon that reaches {distance} margins beyond the plane");
        }
    }

    #[test]
    fn orientation_is_never_wrong_and_mostly_sure() {
        let mut random = Random(5);
        let (mut sure, mut flat) = (0, 0);
        for _ in 0..20_000 {
            let grid = |v: DVec3| (v * 1024.0).round() / 1024.0;
            let [a, b, c] = core::array::from_fn(|_| grid(point(&mut random, 1000.0)));
            let (s, t) = (random.fine_range(0.0, 1.0), random.fine_range(0.0, 1.0));
            let near = grid(a + (b - a) * s + (c - a) * t);
            for p in [grid(point(&mut random, 1000.0)), near, a] {
                let expected = match exact(a, b, c, p) {
                    1 => Side::Front,
                    -1 => Side::Back,
                    _ => Side::On,
                };
                let found = orientation(a, b, c, p);
                assert!(found == expected || found == Side::On, "{a} {b} {c} {p}: {found:?}");
                sure += usize::from(found != Side::On);
                flat += usize::from(expected == Side::On);
            }
        }
        assert!(sure > 39_000 && flat >= 20_000, "{sure} {flat}");
        // Scaling by powers of ten keeps these answers.
        for scale in [1e-60, 1e60] {
            let [a, b, c, p] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|v| v * scale);
            assert_eq!(orientation(a, b, c, p), Side::Front, "the point in front, coordinates times {scale}");
            assert_eq!(orientation(a, b, c, -p), Side::Back, "the point behind, coordinates times {scale}");
        }
        assert_eq!(
            orientation(DVec3::NAN, DVec3::X, DVec3::Y, DVec3::Z),
            Side::On,
            "a vertex that is NaN leaves the side open"
        );
    }

    #[test]
    fn points_of_one_plane_are_on_it_though_their_determinant_is_not_zero() {
        let mut random = Random(6);
        let mut rounded = 0;
        for _ in 0..10_000 {
            let whole = |v: DVec3| v.round();
            let [u, v] = [whole(point(&mut random, 1e6)), whole(point(&mut random, 1e6))];
            // Coordinates are integers below 2^41, so they and their differences are exact. Their products
            // are not.
            let [a, b, c, p] = core::array::from_fn(|_| {
                u * random.fine_range(-1e5, 1e5).round() + v * random.fine_range(-1e5, 1e5).round()
            });
            assert_eq!(
                orientation(a, b, c, p),
                Side::On,
                "the points {a} {b} {c} {p} lie in one plane exactly"
            );
            rounded += usize::from((a - p).dot((b - p).cross(c - p)) != 0.0);
        }
        assert!(rounded > 1000, "{rounded}");
    }

    #[test]
    fn cut_points_are_on_the_plane_and_the_same_from_both_ends() {
        let mut random = Random(7);
        let mut worst = 0.0f64;
        for scale in [1e-12, 1.0, 1e12] {
            for _ in 0..20_000 {
                let normal = point(&mut random, 1.0).normalize();
                let plane = Plane::through(point(&mut random, scale), normal);
                let plane = SidePlane::new(plane, DVec3::splat(scale));
                let (a, b) = (point(&mut random, scale), point(&mut random, scale));
                if plane.side_of_polygon(&[a, b]) != PolygonSide::Across {
                    continue;
                }
                let cut = plane.crossing(a, b);
                assert_eq!(cut, plane.crossing(b, a), "the cut of {a} and {b} depends on which comes first");
                assert_eq!(
                    cut,
                    SidePlane { plane: plane.plane.flipped(), ..plane }.crossing(a, b),
                    "the cut of {a} and {b} depends on the sign of the normal"
                );
                assert_eq!(
                    plane.side(cut),
                    Side::On,
                    "the cut of {a} and {b} is within the margin of the plane"
                );
                worst = worst.max(plane.plane.signed_distance(cut).abs() / plane.margin);
            }
        }
        // The error bound is at most 50 times the worst error seen.
        assert!(worst > 0.02, "{worst}");
    }

    #[test]
    fn polygons_touching_or_thinner_than_the_margin_are_whole() {
        let plane = SidePlane::new(Plane::new(DVec3::Z, 0.0), DVec3::ONE);
        let at = |heights: [f64; 3]| {
            let [a, b, c] = heights;
            plane.side_of_polygon(&[
                DVec3::new(0.0, 0.0, a),
                DVec3::new(1.0, 0.0, b),
                DVec3::new(0.0, 1.0, c),
            ])
        };
        assert_eq!(at([0.0, 0.0, 0.5]), PolygonSide::Front, "touching the plane from the front");
        assert_eq!(
            at([0.0, -1e-17, -0.5]),
            PolygonSide::Back,
            "touching the plane from behind, but for a rounding"
        );
        assert_eq!(at([plane.margin, -plane.margin, 0.0]), PolygonSide::On, "all vertices within the margin");
        assert_eq!(
            at([2.0 * plane.margin, -plane.margin, 0.0]),
            PolygonSide::Front,
            "one vertex in front, one within the margin behind"
        );
        assert_eq!(
            at([2.0 * plane.margin, -2.0 * plane.margin, 0.0]),
            PolygonSide::Across,
            "vertices beyond the margin on both sides"
        );
        assert_eq!(at([f64::NAN, 0.0, 0.0]), PolygonSide::On, "a vertex that is NaN");
        assert_eq!(plane.side_of_polygon(&[]), PolygonSide::On, "no vertices");
        assert!(
            !plane.crossing(DVec3::ZERO, DVec3::ZERO).is_nan(),
            "the cut of an edge without length is a number"
        );
    }
}
