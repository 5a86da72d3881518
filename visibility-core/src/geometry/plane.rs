//! Oriented planes, and the three-way classification of points and boxes against them.

use crate::{
    Aabb,
    geometry::{Containment, DoubleDouble},
};
use glam::DVec3;

/// Unit round-off of `f64`: half the distance from 1 to the next greater number, 2^-53.
const U: f64 = f64::EPSILON / 2.0;

/// An oriented plane in the coordinate space of the points that are tested against it, usually in metres. It
/// stands for the closed half-space of the points `p` with `normal . p + offset >= 0`.
///
/// The normal may have any length; distances are in metres only for a unit normal. A plane with a NaN
/// classifies every shape as `Crossing`.
///
/// ```
/// use visibility_core::{geometry::Plane, glam::DVec3};
/// let plane = Plane::through(DVec3::new(0.0, 0.0, 2.0), DVec3::Z);
/// assert_eq!(plane.signed_distance(DVec3::new(7.0, 7.0, 5.0)), 3.0);
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Plane {
    /// Normal vector, of any length, pointing into the half-space that is kept.
    pub normal: DVec3,
    /// Signed distance of the coordinate origin from the plane, positive if the origin is inside the
    /// half-space, times the length of the normal.
    pub offset: f64,
}

impl Plane {
    /// Returns the half-space `normal . p + offset >= 0`, unchecked.
    pub const fn new(normal: DVec3, offset: f64) -> Self {
        Self { normal, offset }
    }

    /// Returns the half-space whose boundary goes through `point` and whose inside is the side that `normal`
    /// points to. `normal` may have any length and is kept as given.
    pub fn through(point: DVec3, normal: DVec3) -> Self {
        Self::new(normal, -normal.dot(point))
    }

    /// Returns the plane through three points with a unit normal. The normal points to the side from which
    /// `a`, `b`, `c` run counter-clockwise (right-handed coordinates). `None` if the points are exactly
    /// collinear or not all finite. As exact as [`from_polygon`](Self::from_polygon).
    pub fn from_points(a: DVec3, b: DVec3, c: DVec3) -> Option<Self> {
        Self::from_polygon(&[a, b, c])
    }

    /// Returns the plane of a flat polygon with a unit normal, which points to the side from which `vertices`
    /// run counter-clockwise (right-handed coordinates). The plane goes through the first vertex. `None` for
    /// fewer than three vertices, an area of exactly zero, or vertices that are not all finite.
    ///
    /// Every point of the polygon has a [`signed_distance`](Self::signed_distance) of at most three times the
    /// [`error_bound`](Self::error_bound), however thin the polygon is. The normal is summed in
    /// [`DoubleDouble`] numbers: in `f64` the rounding of a cross product turns the normal of a triangle by
    /// `u` times the ratio of length to height, with `u = 2^-53`. In these numbers, rounding turns the normal
    /// by `2^-100` times that ratio: less than `u / 4` for ratios up to `2^45`. Rounding the normal to `f64`
    /// and dividing by its length changes each component by `2 u` of itself; a common factor does not turn
    /// the normal. The difference of two points has components of at most twice their magnitude `m`, so the
    /// turned normal moves the plane by at most `4 u |n| . m`: less than one error bound. The roundings of
    /// the offset and of the distance are one error bound each.
    pub fn from_polygon(vertices: &[DVec3]) -> Option<Self> {
        let (&first, others) = vertices.split_first()?;
        // The products are scaled by a power of two, so that they neither overflow nor lose their low parts.
        let reach = others.iter().fold(0.0f64, |most, v| most.max((*v - first).abs().max_element()));
        if !(reach > 0.0 && vertices.iter().all(|v| v.is_finite())) {
            return None;
        }
        let power = f64::from_bits((1.0 / reach).to_bits() & f64::INFINITY.to_bits());
        let edge = |v: &DVec3| [0, 1, 2].map(|i| DoubleDouble::difference(v[i], first[i]).scaled(power));
        let mut sum = [DoubleDouble::ZERO; 3];
        for pair in others.windows(2) {
            let (a, b) = (edge(&pair[0]), edge(&pair[1]));
            for (total, (i, j)) in sum.iter_mut().zip([(1, 2), (2, 0), (0, 1)]) {
                *total = total.plus(a[i].times(b[j])).plus(a[j].times(b[i]).negated());
            }
        }
        let normal = DVec3::from_array(sum.map(|x| x.hi));
        let plane = Self::through(first, Self::new(normal, 0.0).normalized()?.normal);
        plane.offset.is_finite().then_some(plane)
    }

    /// Returns the opposite half-space: the same boundary with the normal and the offset negated.
    #[must_use]
    pub fn flipped(&self) -> Self {
        Self::new(-self.normal, -self.offset)
    }

    /// Returns the half-space with its plane scaled to a unit normal. `None` if the normal is zero or not
    /// finite, or if the scaled offset overflows `f64`. The normal is divided by its greatest component
    /// before it is squared, so that lengths from 1e-300 to 1e300 work.
    pub fn normalized(&self) -> Option<Self> {
        let scale = self.normal.abs().max_element();
        if !(scale > 0.0 && scale.is_finite()) {
            return None;
        }
        let normal = self.normal / scale;
        let length = normal.length();
        let offset = self.offset / scale / length;
        offset.is_finite().then(|| Self::new(normal / length, offset))
    }

    /// Returns `normal . p + offset`: the signed distance of `p` from the plane times the length of the
    /// normal, positive inside the half-space. The rounding error is at most
    /// [`error_bound`](Self::error_bound).
    pub fn signed_distance(&self, p: DVec3) -> f64 {
        self.normal.x * p.x + self.normal.y * p.y + self.normal.z * p.z + self.offset
    }

    /// Returns an absolute upper bound on the rounding error of [`signed_distance`](Self::signed_distance)
    /// for points whose coordinates have absolute values of at most `magnitude` on each axis. The unit is
    /// that of the distance: metres times the length of the normal.
    ///
    /// The distance is three products and three additions in a row. Each term is rounded at most four times
    /// (once as a product, up to three times in sums), so the error is at most `4u / (1 - 4u)` times the sum
    /// of the terms' magnitudes, with `u = 2^-53`. The factor 6u also covers the rounding of that sum itself.
    /// A product that underflows loses at most the least normal number, also where denormals are flushed to
    /// zero.
    pub fn error_bound(&self, magnitude: DVec3) -> f64 {
        let n = self.normal.abs();
        6.0 * U * (n.x * magnitude.x + n.y * magnitude.y + n.z * magnitude.z + self.offset.abs())
            + 8.0 * f64::MIN_POSITIVE
    }

    /// Classifies a point against the half-space: `Crossing` if its distance from the boundary is within the
    /// error bound or NaN.
    pub(crate) fn classify_point(&self, p: DVec3) -> Containment {
        self.decide(self.signed_distance(p), self.signed_distance(p), self.error_bound(p.abs()))
    }

    /// Classifies a box against the half-space, by the box's corners of least and greatest signed distance. A
    /// box that touches the boundary, and an improper box, are `Crossing`.
    pub fn classify_aabb(&self, bounds: &Aabb) -> Containment {
        if !bounds.is_proper() {
            return Containment::Crossing;
        }
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let positive = self.normal.cmpge(DVec3::ZERO);
        let far = DVec3::select(positive, max, min);
        let near = DVec3::select(positive, min, max);
        let error = self.error_bound(min.abs().max(max.abs()));
        self.decide(self.signed_distance(near), self.signed_distance(far), error)
    }

    /// Classifies a shape against the half-space. The signed distances of its points span `least` to
    /// `greatest`; each of these two is computed with an absolute error of at most `error`. NaN gives
    /// `Crossing`.
    fn decide(&self, least: f64, greatest: f64, error: f64) -> Containment {
        if greatest < -error {
            Containment::Outside
        } else if least > error {
            Containment::Inside
        } else {
            Containment::Crossing
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use visibility_testing::Random;

    #[test]
    fn a_box_is_classified_by_its_extreme_corners() {
        let plane = Plane::new(DVec3::new(1.0, -1.0, 0.0), 0.0);
        let at = |x: f32, y: f32| Aabb::new(Vec3::new(x, y, 0.0), Vec3::new(x + 1.0, y + 1.0, 1.0));
        assert_eq!(
            plane.classify_aabb(&at(5.0, 0.0)),
            Containment::Inside,
            "a box whose nearest corner is in front"
        );
        assert_eq!(
            plane.classify_aabb(&at(0.0, 5.0)),
            Containment::Outside,
            "a box whose farthest corner is behind"
        );
        assert_eq!(
            plane.classify_aabb(&at(0.5, 0.0)),
            Containment::Crossing,
            "a box with corners on both sides"
        );
    }

    #[test]
    fn touching_and_non_finite_shapes_are_crossing() {
        let plane = Plane::new(DVec3::X, -1.0);
        let touching = Aabb::from_arrays([0.0; 3], [1.0; 3]);
        assert_eq!(plane.classify_aabb(&touching), Containment::Crossing, "a box that touches the plane");
        let nan = Aabb::from_arrays([f32::NAN; 3], [1.0; 3]);
        assert_eq!(plane.classify_aabb(&nan), Containment::Crossing, "a box with a corner that is NaN");
        assert_eq!(plane.classify_aabb(&Aabb::EMPTY), Containment::Crossing, "the empty box");
        let broken = Plane::new(DVec3::NAN, 0.0);
        assert_eq!(broken.classify_aabb(&touching), Containment::Crossing, "a plane that is NaN");
    }

    /// Distances of a few units of rounding are exact here; the error bound is `12u`, and `24u` for the box.
    #[test]
    fn shapes_within_the_error_bound_are_crossing() {
        let plane = Plane::new(DVec3::X, -1.0);
        for (units, expected) in [
            (-14.0, Containment::Outside),
            (-10.0, Containment::Crossing),
            (10.0, Containment::Crossing),
            (14.0, Containment::Inside),
        ] {
            let point = DVec3::new(1.0 + units * U, 0.0, 0.0);
            assert_eq!(plane.classify_point(point), expected, "a point {units} units beyond the plane");
            let plane = Plane::new(DVec3::new(1.0 + units * U, 0.0, 0.0), -2.0);
            let bounds = Aabb::from_arrays([2.0, 0.0, 0.0], [2.0, 1.0, 1.0]);
            assert_eq!(plane.classify_aabb(&bounds), expected, "a box {units} units of 2 beyond the plane");
        }
        // The error is that of the farthest corner: 24u, and 12u without its coordinate.
        let plane = Plane::new(DVec3::new(1.0 - 10.0 * U, 0.0, 0.0), -2.0);
        let bounds = Aabb::from_arrays([0.0; 3], [2.0, 1.0, 1.0]);
        assert_eq!(plane.classify_aabb(&bounds), Containment::Crossing, "a box up to 20u before the plane");
        // The greatest offset that is its own error bound.
        let least = 8.0 * f64::MIN_POSITIVE;
        for (offset, expected) in [
            (least * (1.0 + 6.0 * U), Containment::Crossing),
            (-least * (1.0 + 6.0 * U), Containment::Crossing),
            (least * (1.0 + 8.0 * U), Containment::Inside),
            (-least * (1.0 + 8.0 * U), Containment::Outside),
        ] {
            let plane = Plane::new(DVec3::ZERO, offset);
            assert_eq!(plane.classify_point(DVec3::ZERO), expected, "a distance of {offset}");
        }
    }

    /// Products and sums can be chosen so that all four roundings of a distance go one way.
    #[test]
    fn distances_err_by_more_than_half_of_their_bound() {
        let small = 2.0f64.powi(-27);
        // `(1 + s)^2` loses a quarter of its last digit, and each sum nearly half of it.
        let (a, lost) = (1.0 + small, U * (1.0 - small));
        let plane = Plane::new(DVec3::new(a, 1.0, 1.0), lost);
        let p = DVec3::new(a, lost, lost);
        // Exact: `(1 + 2 s + s^2) + 3 lost`, where `s^2 = u / 2`, and all but `1 + 2 s` is lost.
        let error = 0.5 * U + 3.0 * lost;
        assert_eq!(plane.signed_distance(p), 1.0 + 2.0 * small, "the sum without what is lost");
        let bound = plane.error_bound(p);
        assert!(0.5 * bound < error && error < bound, "off by {error} of at most {bound}");
    }

    #[test]
    fn normalizing_survives_extreme_magnitudes() {
        for scale in [1e-300, 1e-30, 1.0, 1e30, 1e300] {
            let plane = Plane::new(DVec3::new(3.0, 4.0, 0.0) * scale, 10.0 * scale).normalized().unwrap();
            assert!(
                (plane.normal.length() - 1.0).abs() < 1e-15,
                "the normal's length, with coefficients times {scale}"
            );
            assert!(
                (plane.offset - 2.0).abs() < 1e-15,
                "the distance to the origin in metres, with coefficients times {scale}"
            );
        }
        assert_eq!(Plane::new(DVec3::ZERO, 1.0).normalized(), None, "a normal of no length");
    }

    #[test]
    fn points_of_a_thin_polygon_are_within_three_error_bounds_of_its_plane() {
        let mut random = Random(21);
        let (mut thin, mut worst) = (0, 0.0f64);
        for scale in [1e-140, 1e-6, 1.0, 1e6, 1e140] {
            for _ in 0..5000 {
                // Coordinates are integers below 2^50, so differences, multiples and sums of the points are
                // exact.
                let whole = |random: &mut Random, size: f64| random.fine_vector(size).round();
                let (a, u) = (whole(&mut random, 1e13), whole(&mut random, 1e10));
                let v = u * random.between(-9, 9) as f64 + whole(&mut random, 2.0);
                let exact = |v: DVec3| v.to_array().map(|x| x as i128);
                let ([x, y, z], [p, q, r]) = (exact(u), exact(v));
                let area = [y * r - z * q, z * p - x * r, x * q - y * p];
                // The scale is rounded to a power of two, which changes no digit of a coordinate.
                let power = f64::from_bits(f64::to_bits(scale) & f64::INFINITY.to_bits());
                let points =
                    [a, a + u, a + v, a + u * 3.0 + v * 5.0, a - u * 7.0 + v * 2.0].map(|p| p * power);
                let Some(plane) = Plane::from_polygon(&points[..3]) else {
                    assert_eq!(area, [0; 3], "{u} {v}: a triangle with an area has no plane");
                    continue;
                };
                assert_ne!(area, [0; 3], "{u} {v}: collinear points have a plane");
                assert!(
                    (plane.normal.length() - 1.0).abs() < 1e-15,
                    "{u} {v}: the normal is {}",
                    plane.normal
                );
                assert_eq!(
                    Plane::from_points(points[0], points[1], points[2]),
                    Some(plane),
                    "{u} {v}: three points and the triangle of them have the same plane"
                );
                let magnitude = points.iter().fold(DVec3::ZERO, |most, p| most.max(p.abs()));
                for p in points {
                    let share = plane.signed_distance(p).abs() / plane.error_bound(magnitude);
                    assert!(share <= 3.0, "{u} {v} {p}: {share} error bounds off its plane");
                    worst = worst.max(share);
                }
                thin += 1;
            }
        }
        assert!(thin > 20_000 && worst > 0.1, "{thin} thin triangles, the worst is {worst} error bounds off");
    }

    #[test]
    fn polygons_without_an_area_have_no_plane() {
        let (x, y) = (DVec3::X, DVec3::Y);
        assert_eq!(Plane::from_polygon(&[]), None, "no vertices");
        assert_eq!(Plane::from_polygon(&[x, y]), None, "two vertices");
        assert_eq!(Plane::from_polygon(&[x; 3]), None, "three equal vertices");
        for broken in [f64::NAN, f64::INFINITY] {
            assert_eq!(
                Plane::from_polygon(&[x, y, DVec3::splat(broken)]),
                None,
                "a vertex with coordinates of {broken}"
            );
        }
        // A bow tie has no plane: its two halves have opposite area vectors.
        assert_eq!(Plane::from_polygon(&[DVec3::ZERO, x + y, x, y]), None, "two areas that cancel out");
        let square = [DVec3::ZERO, x, x + y, y].map(|p| p + DVec3::Z);
        assert_eq!(
            Plane::from_polygon(&square),
            Some(Plane::new(DVec3::Z, -1.0)),
            "the normal of a square whose vertices are counterclockwise seen from it"
        );
    }
}
