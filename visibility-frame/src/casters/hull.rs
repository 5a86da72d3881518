//! The planes around the convex hull of a volume and a light. The hull contains every segment from a point of
//! the volume to the light.
//!
//! Let the volume be where all planes `A . p >= 0`. Here `A . p` stands for `normal . p + offset` of a plane
//! `A`, and for a light `L` at infinity, `A . L` for `normal . direction`. A plane bounds the hull of volume
//! and light if both are on its inner side. Such planes are
//!
//! - each plane `A` of the volume that has the light on its inner side, `A . L >= 0`, and
//! - for each of these and each `B` with `B . L < 0`, the plane `C = (-B . L) A + (A . L) B`. As a sum of `A`
//!   and `B` with non-negative weights, it has the whole volume on its inner side, and `C . L = 0`: it goes
//!   through the light and the edge in which `A` and `B` meet, the silhouette of the volume as the light sees
//!   it.
//!
//! No other planes are needed (one step of the double description method: Motzkin, Raiffa, Thompson and
//! Thrall, "The Double Description Method", 1953). Pairs of planes that meet in no edge give valid but
//! redundant planes, so neither vertices nor edges need to be found. There are no special cases: infinite
//! volumes, lights in, behind or on a plane of the volume, and all kinds of cameras are treated alike.
//! Leaving planes out is conservative: it keeps more casters.
//!
//! An infinite volume is also bounded by the plane at infinity, normal 0 and offset 1, which has a light at a
//! finite position on its inner side. Its pair with `B` is the plane through the light parallel to `B`.

use smallvec::SmallVec;
use visibility_core::geometry::Plane;
use visibility_core::glam::DVec3;
use visibility_core::view::ViewPlane;

/// Greatest number of planes that casters are tested against. One walk of the hierarchy takes at most 16
/// planes, so these are four walks. Further planes are dropped, which keeps more casters.
pub(super) const MAX_HULL_PLANES: usize = 64;

/// Planes that bound the region of possible casters, such as the hull of a view volume and a light: relative
/// to the scene's origin, with normals pointing inwards. Stored inline: at most [`MAX_HULL_PLANES`], never on
/// the heap.
pub(super) type HullPlanes = SmallVec<[ViewPlane; MAX_HULL_PLANES]>;

/// Position or direction of a light relative to the scene's origin.
#[derive(Clone, Copy)]
pub(super) enum Source {
    /// Parallel light. The vector points towards the light and is scaled so that its component of greatest
    /// magnitude is 1 or -1.
    Direction(DVec3),
    Point(DVec3),
}

/// A plane with absolute error bounds for each component of its normal and for its offset: the exact plane is
/// within these bounds.
#[derive(Clone, Copy)]
struct RoundedPlane {
    plane: Plane,
    normal_error: DVec3,
    offset_error: f64,
}

/// A plane of the volume whose hull with the light is to be found, or the plane at infinity, with the signed
/// distance of the light from the plane: positive on the inner side, to which the plane's normal points.
#[derive(Clone, Copy)]
struct Facet {
    slot: u8,
    plane: RoundedPlane,
    /// Signed distance of the light from the plane in metres, off by up to `error`: positive on the inner
    /// side (`A . L` at the head of this module). For a light at infinity, the dot product of its direction
    /// with the plane's normal.
    distance: f64,
    error: f64,
}

const EPSILON: f64 = f64::EPSILON;

impl Source {
    fn facet(&self, slot: u8, view_plane: &ViewPlane) -> Facet {
        let ViewPlane { plane, error: offset_error } = *view_plane;
        // Each component of the exact normal is within 8 epsilon of the stored one. A sum of planes rounds by
        // 1 epsilon of their magnitudes, also where components cancel, and its scaling by half of one: see
        // `toward` and `settle`. The bounds on errors round by 4 of themselves, and a bound above 1.5 times
        // all magnitudes admits every point.
        let normal_error = plane.normal.abs() * (16.0 * EPSILON);
        // The light is rounded by half an epsilon when it is made relative to the scene; products and sums
        // are rounded by 3 epsilon, as in `Plane::error_bound`. With the 8 epsilon of the normal, that is 12
        // of the magnitudes. 16 also cover the rounding of the bound itself and of its use: `toward` below
        // rounds distance and error three times each.
        let (distance, size, shift) = match *self {
            Self::Direction(d) => {
                (Plane::new(plane.normal, 0.0).signed_distance(d), plane.normal.abs().dot(d.abs()), 0.0)
            }
            Self::Point(p) => (
                plane.signed_distance(p),
                plane.normal.abs().dot(p.abs()) + plane.offset.abs(),
                2.0 * offset_error,
            ),
        };
        let error = 16.0 * EPSILON * size + shift + 16.0 * f64::MIN_POSITIVE;
        let offset_error = offset_error + plane.offset.abs() * (8.0 * EPSILON);
        Facet { slot, plane: RoundedPlane { plane, normal_error, offset_error }, distance, error }
    }

    /// Returns the plane at infinity, the far plane of an infinite volume: a point light is on its inner
    /// side, a direction lies in it.
    fn infinity(&self) -> Facet {
        let plane = Plane::new(DVec3::ZERO, 1.0);
        let plane = RoundedPlane { plane, normal_error: DVec3::ZERO, offset_error: 8.0 * EPSILON };
        let distance = if matches!(self, Self::Point(_)) { 1.0 } else { 0.0 };
        Facet { slot: FAR, plane, distance, error: 0.0 }
    }
}

/// Slot number of a view's far plane, and of the plane at infinity. Slots number the planes of a view or box
/// from 0; slots that differ only in bit 0 are opposite planes.
const FAR: u8 = 5;

impl Facet {
    /// Tests whether the light is certainly on the inner side of the plane, the side that its normal points
    /// to. False if undecided.
    fn faces_light(&self) -> bool {
        self.distance > self.error
    }

    /// Tests whether two planes are opposite sides of a view or box (slots 0 to 5 that differ in bit 0),
    /// which meet in no edge.
    fn is_opposite(&self, other: &Self) -> bool {
        self.slot <= FAR && self.slot ^ 1 == other.slot
    }

    /// Returns the plane through the light `L` and the common edge of two planes, `self` (`A` below) and
    /// `other` (`B` below). The light must be certainly on the inner side of `self`, and not certainly on
    /// that of `other`.
    ///
    /// The result is `a A + b B`. Here `A.L` and `B.L` are the signed distances of the light from the planes,
    /// and `error(A)` and `error(B)` bound the absolute errors of their computed values. The weights `a` and
    /// `b` are rounded so that the exact planes, taken with these very weights, have the light on the inner
    /// side of their sum. With `a >= error(B) - B.L` and `b <= A.L - error(A)` for the computed distances,
    /// the exact distances satisfy `A.L >= b` and `B.L >= -a`, so `a (A . L) + b (B . L) >= a b - b a = 0`.
    /// So the sum is a valid plane whatever the errors are, and where the light is nearly on `other`, the sum
    /// is nearly `other`.
    fn toward(&self, other: &Self) -> RoundedPlane {
        let (a, b) = (other.error - other.distance, self.distance - self.error);
        let scale = a.max(b);
        // A larger share of `self` is always valid, and its weight must not underflow to zero.
        let (a, b) = ((a / scale).max(1e-200), b / scale);
        let (p, q) = (&self.plane, &other.plane);
        let normal = p.plane.normal * a + q.plane.normal * b;
        let offset = p.plane.offset * a + q.plane.offset * b;
        RoundedPlane {
            plane: Plane::new(normal, offset),
            normal_error: p.normal_error * a + q.normal_error * b,
            offset_error: p.offset_error * a + q.offset_error * b,
        }
    }
}

impl RoundedPlane {
    /// Returns the plane scaled to a unit normal, with one absolute error bound of a point's signed distance,
    /// which covers the errors of normal and offset. The bound holds for points whose coordinates have
    /// absolute values of at most `reach`, since an error `e` of the normal's x moves the
    /// plane by at most `e * reach.x` there. `None` if the normal is (almost) zero or NaN, or if the offset
    /// or its error overflows.
    fn settle(&self, reach: DVec3) -> Option<ViewPlane> {
        let length = self.plane.normal.length();
        // Squares of lengths below 1e-140 underflow. Opposite planes of a volume without extent give such a
        // normal. A length of NaN gives an error of NaN.
        if length < 1e-140 {
            return None;
        }
        let error = (self.offset_error + self.normal_error.dot(reach)) / length + 16.0 * f64::MIN_POSITIVE;
        let plane = Plane::new(self.plane.normal / length, self.plane.offset / length);
        (plane.offset.is_finite() && error.is_finite()).then_some(ViewPlane { plane, error })
    }
}

/// Appends the planes around the hull of a volume and a light to `out`, up to its capacity. `volume` yields
/// the planes of the volume with their slots; slots below 6 that differ only in bit 0 are opposite planes.
/// Only the first 16 planes are used, which keeps more casters. The result is valid for points whose
/// coordinates have absolute values of at most `reach`.
pub(super) fn push_hull<'a>(
    out: &mut HullPlanes,
    volume: impl Iterator<Item = (u8, &'a ViewPlane)>,
    source: Source,
    reach: DVec3,
) {
    let mut facets: SmallVec<[Facet; 17]> =
        volume.take(16).map(|(slot, plane)| source.facet(slot, plane)).collect();
    if !facets.iter().any(|facet| facet.slot == FAR) {
        facets.push(source.infinity());
    }
    for facet in facets.iter().filter(|facet| facet.faces_light()) {
        push(out, &facet.plane, reach);
    }
    for inner in facets.iter().filter(|facet| facet.faces_light()) {
        for outer in facets.iter().filter(|facet| !facet.faces_light()) {
            if !inner.is_opposite(outer) {
                push(out, &inner.toward(outer), reach);
            }
        }
    }
}

fn push(out: &mut HullPlanes, plane: &RoundedPlane, reach: DVec3) {
    if out.len() < MAX_HULL_PLANES {
        out.extend(plane.settle(reach));
    }
}

/// Appends eight planes of a pyramid around the cone of a spot light to `out`. The cross-section of the
/// pyramid is at most 8 % wider than the cone. `axis` may have any length, `tangent` is that of the half
/// angle; nothing is appended if `axis` cannot be normalized.
///
/// The planes go through the light and touch the cone along eight lines. For half angle `t`, unit axis `s`
/// and a unit vector `e` perpendicular to it, the inner normal is `s tan t - e`. Vectors are unit and
/// orthogonal to within 8 epsilon, the tangent is off by a few units in its last place: each component of the
/// normal is within `32 epsilon (1 + tan t)` of a plane that holds the cone,
/// with room for scaling it.
pub(super) fn push_cone(out: &mut HullPlanes, light: DVec3, axis: DVec3, tangent: f64, reach: DVec3) {
    use core::f64::consts::FRAC_1_SQRT_2 as D;
    let Some(axis) = (axis / axis.abs().max_element()).try_normalize() else { return };
    let (u, v) = axis.any_orthonormal_pair();
    for (x, y) in [(1.0, 0.0), (D, D), (0.0, 1.0), (-D, D), (-1.0, 0.0), (-D, -D), (0.0, -1.0), (D, -D)] {
        let normal = axis * tangent - (u * x + v * y);
        push_through(out, light, normal, 32.0 * EPSILON * (1.0 + tangent), reach);
    }
}

/// Appends to `out` the half-space whose boundary goes through `point` and whose inside is the side that
/// `normal` points to. `normal_error` bounds the absolute error of each component of the normal. The result
/// is valid for points whose coordinates have absolute values of at most `reach`.
fn push_through(out: &mut HullPlanes, point: DVec3, normal: DVec3, normal_error: f64, reach: DVec3) {
    let size = normal.abs().dot(point.abs());
    // Errors of the normal turn the plane about the point. The rounding of the offset and of its products
    // shifts it.
    let offset_error = normal_error * (point.abs().element_sum()) + 8.0 * EPSILON * size;
    let plane = Plane::new(normal, -normal.dot(point));
    push(out, &RoundedPlane { plane, normal_error: DVec3::splat(normal_error), offset_error }, reach);
}

/// Appends the six sides of the axis-aligned box around a ball to `out`, up to its capacity. `center` is
/// relative to the scene's origin; `radius` is in metres. The error bound of each plane covers the rounding
/// of `center` and of the sum that is the plane's offset, half an epsilon for each.
pub(super) fn push_ball(out: &mut HullPlanes, center: DVec3, radius: f64) {
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for side in [axis, -axis] {
            let offset = radius - side.dot(center);
            let error = 4.0 * EPSILON * (radius + side.dot(center).abs()) + f64::MIN_POSITIVE;
            if out.len() < MAX_HULL_PLANES && offset.is_finite() && error.is_finite() {
                out.push(ViewPlane { plane: Plane::new(side, offset), error });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::geometry::DoubleDouble;
    use visibility_testing::Random;

    /// Returns the distance of a point from a plane in double-double arithmetic.
    fn distance(plane: &Plane, p: DVec3) -> f64 {
        let term = |k: usize| DoubleDouble::product(plane.normal[k], p[k]);
        term(0).plus(term(1)).plus(term(2)).plus(plane.offset.into()).hi
    }

    /// Volumes with three pairs of parallel sides, whose corners and normals are integers. The planes of the
    /// hull have all corners and the light on their inner side, up to the error that they state, which is no
    /// more than some roundings.
    #[test]
    fn planes_of_the_hull_hold_volume_and_light() {
        let mut random = Random(81);
        let (mut found, mut behind, mut wide) = (0, 0, 0);
        for round in 0..20_000 {
            let size = 1 << random.between(2, 12);
            let mut whole =
                |size: i32| DVec3::from_array([(); 3].map(|()| f64::from(random.between(-size, size))));
            let (first, far, beside) = (whole(1 << 20), whole(1 << 20), whole(3));
            let edges = [whole(size), whole(size), whole(size)];
            // Lights are anywhere, or about as far from some sides as these may be misplaced.
            let light = if round % 5 < 3 { far } else { first + edges[round % 3] + beside };
            let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|corner: usize| {
                first + (0..3).map(|k| edges[k] * (corner >> k & 1) as f64).sum::<DVec3>()
            });
            if edges[0].cross(edges[1]).dot(edges[2]) == 0.0 {
                continue;
            }
            let sides = [0, 1, 2].map(|k| {
                let normal = edges[(k + 1) % 3].cross(edges[(k + 2) % 3]);
                let normal = if normal.dot(edges[k]) < 0.0 { -normal } else { normal };
                [(normal, first), (-normal, first + edges[k])]
            });
            let volume: SmallVec<[(u8, ViewPlane); 6]> = (0..)
                .zip(sides.as_flattened())
                .map(|(slot, &(normal, at))| {
                    // A third of the volumes have exact planes, and a third have offsets that are off by
                    // their errors. The normals of these are no unit vectors.
                    let offset = -normal.dot(at);
                    let error = [0.0, normal.abs().element_sum()][round / 2 % 2];
                    if round / 2 % 3 != 0 {
                        let by = if (round / 4 + usize::from(slot)) % 2 == 0 { error } else { -error };
                        return (slot, ViewPlane { plane: Plane::new(normal, offset + by), error });
                    }
                    let unit = normal.normalize();
                    // The offset rounds, and the rounded normal turns the plane about the origin.
                    let error = 8.0 * EPSILON * unit.abs().dot(at.abs());
                    (slot, ViewPlane { plane: Plane::new(unit, -unit.dot(at)), error })
                })
                .collect();
            let source = match round % 2 {
                0 => Source::Point(light),
                _ if light == DVec3::ZERO => continue,
                _ => Source::Direction(light / light.abs().max_element()),
            };
            let reach = corners.iter().fold(light.abs(), |reach, p| reach.max(p.abs()));
            let mut planes = HullPlanes::new();
            push_hull(&mut planes, volume.iter().map(|(slot, plane)| (*slot, plane)), source, reach);
            for ViewPlane { plane, error } in &planes {
                found += 1;
                let least = corners.map(|p| distance(plane, p)).into_iter().fold(f64::MAX, f64::min);
                assert!(least >= -error, "{round}: {plane:?} cuts {least} off, its error is {error}");
                behind += u32::from(least < 0.0);
                let light_at = match source {
                    Source::Point(_) => distance(plane, light),
                    Source::Direction(_) => distance(&Plane::new(plane.normal, 0.0), light),
                };
                assert!(light_at >= -error, "{round}: the light is {light_at} off, the error is {error}");
                let most = plane.normal.abs().dot(reach) + plane.offset.abs();
                wide += u32::from(*error < 1e3 * EPSILON * most);
            }
        }
        assert!(found > 50_000 && wide > found / 3, "{found} planes, {wide} with errors of some roundings");
        assert!(behind > 10_000, "{behind} of {found} need their error");
    }

    /// The sides of the box around a ball are within their errors, with room for the rounding of the centre.
    /// Planes that are not finite, or beyond the greatest number, are not added.
    #[test]
    fn sides_of_balls_are_within_their_errors() {
        let mut random = Random(82);
        for round in 0..2_000 {
            let [far, size] = [(); 2].map(|()| 10f64.powi(random.between(-3, 9)));
            let (center, radius) = (random.fine_vector(far), random.fine_range(0.0, size));
            let mut planes = HullPlanes::new();
            push_ball(&mut planes, center, radius);
            assert_eq!(planes.len(), 6, "{round}: sides of a ball");
            for ViewPlane { plane, error } in planes {
                let along = plane.normal.dot(center);
                let off = DoubleDouble::difference(radius, along).plus((-plane.offset).into()).hi.abs();
                let needed = off + 0.5 * EPSILON * along.abs();
                assert!(error >= needed, "{round}: {error} of a side that is {needed} off");
            }
        }
        for (x, radius, wanted) in [(0.0, f64::INFINITY, 0), (1.7e308, 1.7e308, 4), (f64::NAN, 1.0, 4)] {
            let mut planes = HullPlanes::new();
            push_ball(&mut planes, DVec3::new(x, 0.0, 0.0), radius);
            assert!(planes.len() <= wanted, "{} sides of a ball of {radius} at {x}", planes.len());
            let is_finite = |of: &ViewPlane| of.plane.offset.is_finite() && of.error.is_finite();
            assert!(planes.iter().all(is_finite), "sides of a ball of {radius} at {x}");
        }
        let mut planes = HullPlanes::new();
        for _ in 0..20 {
            push_ball(&mut planes, DVec3::ONE, 1.0);
            push_cone(&mut planes, DVec3::ONE, DVec3::X, 1.0, DVec3::ONE);
        }
        assert_eq!(planes.len(), MAX_HULL_PLANES, "planes of many balls and cones");
    }

    /// The planes around the cone of a light hold all points that are in the cone by double-double
    /// arithmetic, next to the lines along which they touch it.
    #[test]
    fn planes_around_a_cone_hold_it() {
        let (mut random, mut inside, mut wide) = (Random(83), 0, 0);
        for round in 0..4_000 {
            let light = random.fine_vector(1e6) * if round % 2 == 0 { 0.0 } else { 1.0 };
            let axis = random.fine_vector(1.0) * 2f64.powi(random.between(-300, 300));
            let tangent = random.fine_range(0.01, 3.0);
            let Some(unit) = (axis / axis.abs().max_element()).try_normalize() else { continue };
            let (u, v) = unit.any_orthonormal_pair();
            let points: SmallVec<[DVec3; 16]> = (0..16)
                .map(|i| {
                    let (sine, cosine) = (f64::from(i) * core::f64::consts::FRAC_PI_4).sin_cos();
                    let within = 1.0 - 2.0 * EPSILON * f64::from(i);
                    let along = unit + (u * cosine + v * sine) * (tangent * within);
                    light + along * 10f64.powi(random.between(0, 6))
                })
                .collect();
            let reach = points.iter().fold(DVec3::ZERO, |reach, p| reach.max(p.abs()));
            let mut planes = HullPlanes::new();
            push_cone(&mut planes, light, axis, tangent, reach);
            assert_eq!(planes.len(), 8, "{round}: planes around a cone");
            for p in points {
                let d = [0, 1, 2].map(|k| DoubleDouble::difference(p[k], light[k]));
                let dot = |a: [DoubleDouble; 3], b: [DoubleDouble; 3]| {
                    (0..3).fold(DoubleDouble::ZERO, |sum, k| sum.plus(a[k].times(b[k])))
                };
                let s = unit.to_array().map(DoubleDouble::from);
                let (along, size, square) = (dot(d, s), dot(d, d), DoubleDouble::product(tangent, tangent));
                // The square of the distance from the axis, against that of the cone. The unit axis is off by
                // some roundings, as the planes allow for.
                let across = size.times(dot(s, s)).plus(along.times(along).negated());
                let room = along.times(along).times(square).plus(across.negated()).hi;
                if along.hi < 0.0 || room < 0.0 {
                    continue;
                }
                inside += 1;
                for ViewPlane { plane, error } in &planes {
                    let distance = distance(plane, p);
                    assert!(distance >= -error, "{round}: {p} is {distance} beyond {plane:?}, error {error}");
                    wide += u32::from(distance < 0.0);
                }
            }
        }
        assert!(inside > 10_000 && wide > 1_000, "{inside} points of cones, {wide} need the error");
    }
}
