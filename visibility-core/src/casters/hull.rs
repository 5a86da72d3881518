//! The planes around a convex volume and a light: what bounds all segments from points of the volume to the
//! light.
//!
//! Let the volume be where all planes `A . p >= 0` (homogeneous: `A . p` stands for `normal . p + offset`;
//! for a light at infinity, `A . L` for `normal . direction`). A plane bounds the hull of volume and light if
//! both are on its inner side. Such are
//!
//! - the planes of the volume with the light on the inner side, `A . L >= 0`, and
//! - for each of these and each `B` with `B . L < 0`, the plane `C = (-B . L) A + (A . L) B`. As a sum of `A`
//!   and `B` with weights that are not negative, it has the whole volume on its inner side, and `C . L = 0`:
//!   it goes through the light and the edge in which `A` and `B` meet, the silhouette of the volume as the
//!   light sees it.
//!
//! No other planes are needed (one step of the double description method: Motzkin, Raiffa, Thompson and
//! Thrall, "The Double Description Method", 1953). Of the pairs, those that meet in no edge give planes that
//! are valid and only add nothing, so neither vertices nor edges need to be found, and no special case
//! exists: volumes without end, lights in, behind or on a plane of the volume, cameras of any kind are all
//! one. Leaving planes out can only keep more.
//!
//! A volume without end is also bounded by the plane at infinity, normal 0 and offset 1, which a light at a
//! finite place is inside of; its pair with `B` is the plane through the light parallel to `B`.

use crate::geometry::Plane;
use crate::view::ViewPlane;
use glam::DVec3;
use smallvec::SmallVec;

/// The most planes that casters are tested against: four walks.
pub(super) const MAX_HULL_PLANES: usize = 64;

/// Held in place; never grows beyond.
pub(super) type HullPlanes = SmallVec<[ViewPlane; MAX_HULL_PLANES]>;

/// Where light comes from, relative to the scene's origin.
#[derive(Clone, Copy)]
pub(super) enum Source {
    /// Parallel light from this direction, of which the greatest component is 1 or -1.
    Direction(DVec3),
    Point(DVec3),
}

/// A plane with bounds on the errors of its normal as well.
#[derive(Clone, Copy)]
struct RoundedPlane {
    plane: Plane,
    normal_error: DVec3,
    offset_error: f64,
}

/// A plane of the volume, seen from the light.
#[derive(Clone, Copy)]
struct Facet {
    slot: u8,
    plane: RoundedPlane,
    /// `A . L` as computed, and a bound on its error.
    distance: f64,
    error: f64,
}

const EPSILON: f64 = f64::EPSILON;

impl Source {
    fn facet(&self, slot: u8, view_plane: &ViewPlane) -> Facet {
        let ViewPlane { plane, error: offset_error } = *view_plane;
        // Exact planes have normals within 8 epsilon of these.
        let normal_error = plane.normal.abs() * (8.0 * EPSILON);
        // The light is rounded by half an epsilon when it is made relative to the scene; products and sums
        // are rounded as in `Plane::error_bound`, by 3 epsilon. With the 8 of the normal that is 12
        // of the magnitudes; 16 also cover that bound itself and what is done with it: `toward` below
        // rounds each of them three times.
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
        Facet { slot, plane: RoundedPlane { plane, normal_error, offset_error }, distance, error }
    }

    /// The plane at infinity.
    fn infinity(&self) -> Facet {
        let plane = Plane::new(DVec3::ZERO, 1.0);
        let plane = RoundedPlane { plane, normal_error: DVec3::ZERO, offset_error: 0.0 };
        let distance = if matches!(self, Self::Point(_)) { 1.0 } else { 0.0 };
        Facet { slot: FAR, plane, distance, error: 0.0 }
    }
}

/// The slot of the far plane of a view.
const FAR: u8 = 5;

impl Facet {
    /// Whether the light is surely on the inner side.
    fn faces_light(&self) -> bool {
        self.distance > self.error
    }

    /// Whether two planes are opposite sides of a view or box, which meet in no edge.
    fn is_opposite(&self, other: &Self) -> bool {
        self.slot <= FAR && self.slot ^ 1 == other.slot
    }

    /// The plane through the light and the edge between `self`, which the light is inside of, and `other`,
    /// which it is not surely inside of.
    ///
    /// The weights are rounded so that the exact planes, taken with these very weights, have the light on the
    /// inner side of their sum: with `a >= error(B) - B.L` and `b <= A.L - error(A)` and the exact values
    /// `A.L >= b`, `B.L >= -a`, `a (A . L) + b (B . L) >= a b - b a = 0`. So the sum is a valid plane
    /// whatever the errors are, and where the light is nearly on `other`, it is nearly that plane.
    fn toward(&self, other: &Self) -> RoundedPlane {
        let (a, b) = (other.error - other.distance, self.distance - self.error);
        let scale = a.max(b);
        // More of `self` is always valid: none of it must be lost to underflow.
        let (a, b) = ((a / scale).max(1e-200), b / scale);
        let (p, q) = (&self.plane, &other.plane);
        let normal = p.plane.normal * a + q.plane.normal * b;
        let offset = p.plane.offset * a + q.plane.offset * b;
        // Two roundings each on top of what the planes bring along; components that cancel keep the errors of
        // what they were.
        let size = p.plane.normal.abs() * a + q.plane.normal.abs() * b;
        let offset_size = p.plane.offset.abs() * a + q.plane.offset.abs() * b;
        RoundedPlane {
            plane: Plane::new(normal, offset),
            normal_error: p.normal_error * a + q.normal_error * b + size * (4.0 * EPSILON),
            offset_error: p.offset_error * a + q.offset_error * b + offset_size * (4.0 * EPSILON),
        }
    }
}

impl RoundedPlane {
    /// The plane with unit normal and all errors in the offset, for points with coordinates of at most
    /// `reach`: an error `e` of the normal's x moves the plane by at most `e reach.x` there. `None` if
    /// nothing is left of it.
    fn settle(&self, reach: DVec3) -> Option<ViewPlane> {
        let length = self.plane.normal.length();
        // Below, squares underflow: opposite planes of a volume without volume.
        if length.is_nan() || length < 1e-140 {
            return None;
        }
        // The divisions round normal, offset and errors once more each.
        let lost = self.normal_error + self.plane.normal.abs() * (4.0 * EPSILON);
        let error = (self.offset_error + self.plane.offset.abs() * (4.0 * EPSILON) + lost.dot(reach))
            / length
            * (1.0 + 16.0 * EPSILON)
            + 16.0 * f64::MIN_POSITIVE;
        let plane = Plane::new(self.plane.normal / length, self.plane.offset / length);
        (plane.offset.is_finite() && error.is_finite()).then_some(ViewPlane { plane, error })
    }
}

/// Adds the planes around a volume, given by its planes with their slots (opposite ones differ in the last
/// bit and are below 6), and a light. They are valid for points with coordinates of at most `reach`.
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

/// Adds the planes around the cone of a spot light that are left when it is replaced by a pyramid with eight
/// sides, 8 % wider in all.
///
/// The planes go through the light, touching the cone along eight sides; for half angle `t`, axis `s` and a
/// unit vector `e` across it, the inner normal is `s tan t - e`. Vectors are unit and orthogonal to within 8
/// epsilon, the tangent is off by a few units in its last place: each component of the normal is within `32
/// epsilon (1 + tan t)` of a plane that holds the cone.
pub(super) fn push_cone(out: &mut HullPlanes, light: DVec3, axis: DVec3, tangent: f64, reach: DVec3) {
    use core::f64::consts::FRAC_1_SQRT_2 as D;
    let Some(axis) = (axis / axis.abs().max_element()).try_normalize() else { return };
    let (u, v) = axis.any_orthonormal_pair();
    for (x, y) in [(1.0, 0.0), (D, D), (0.0, 1.0), (-D, D), (-1.0, 0.0), (-D, -D), (0.0, -1.0), (D, -D)] {
        let normal = axis * tangent - (u * x + v * y);
        push_through(out, light, normal, 32.0 * EPSILON * (1.0 + tangent), reach);
    }
}

/// Adds the half-space on the side of `normal` of a plane through `point`.
fn push_through(out: &mut HullPlanes, point: DVec3, normal: DVec3, normal_error: f64, reach: DVec3) {
    let size = normal.abs().dot(point.abs());
    // Errors of the normal turn the plane about the point; its own rounding and that of the products shift
    // it.
    let offset_error = normal_error * (point.abs().element_sum()) + 4.0 * EPSILON * size;
    let plane = Plane::new(normal, -normal.dot(point));
    push(out, &RoundedPlane { plane, normal_error: DVec3::splat(normal_error), offset_error }, reach);
}

/// Adds the box around a ball. The light's place and the sums are rounded by half an epsilon each.
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
