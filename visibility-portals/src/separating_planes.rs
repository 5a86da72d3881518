//! Planes that bound the lines through two polygons.
//!
//! This work is based on: Seth Teller and Pat Hanrahan, "Global Visibility Algorithms for Illumination
//! Computations", 1993. There the antipenumbra of a source through portals is bounded by planes that separate
//! source and portal. Each plane contains an edge of one polygon and a vertex of the other.
//!
//! Let A and B be the polygons, `n` the normal of A towards B, and `m` the inward normal of an edge of A
//! within A's plane. The planes through the edge have the normals `-m + t n`, for any `t`. A lies on the
//! negative side of all of them. B lies on the positive side if `t >= u / w` for each vertex of B, at `u`
//! along `m` and `w > 0` along `n` from the edge. The greatest of these quotients gives the tangent plane, in
//! time linear in B's vertices.
//!
//! # Why rounding hides no line
//! Let `f(x) = normal . x`, with *any* normal. If `f <= d` on A and `f >= d` on B, then `f` does not decrease
//! along a line from A to B, so `f >= d` everywhere on the line after B. This holds however the normal was
//! computed. The offset is taken from the products evaluated over the polygons themselves, and a normal that
//! does not separate the polygons is not used.
//!
//! By rounding, `f` may seem to grow and still fall by the noise from A to B, and as much again on each such
//! length beyond. But a line keeps more than half the clearance from the edges of A and B, by which `f` grows
//! in the plane of A: at the share of `1 / t` of that way or more. A plane so steep, with so great a `t`,
//! that this is not several times the noise is not used.

use crate::directed_portals::Margins;
use alloc::vec::Vec;
use visibility_core::geometry::Plane;
use visibility_core::glam::{DVec2, DVec3};

/// A convex polygon in world space, and whether lines pass it along or against its normal.
#[derive(Clone, Copy)]
pub(crate) struct Facing<'a> {
    /// Vertices in world space, counter-clockwise around the normal.
    pub(crate) vertices: &'a [DVec3],
    /// Unit normal of the polygon's plane, in world axes. The vertices run counter-clockwise as seen from
    /// the side it points to.
    pub(crate) normal: DVec3,
    /// 1 if lines run along the normal, -1 if they run against it.
    pub(crate) sense: f64,
}

/// Appends to `planes` separating planes of polygons `a` and `b`, in world space. Every line that has passed
/// `a` and then `b` stays, from `b` onwards, on the inner side of each appended plane: the side that the
/// plane's normal points to. At most one plane for each edge of either polygon; none if a polygon has more
/// than 128 vertices.
pub(crate) fn push_separating_planes(a: Facing, b: Facing, margins: &Margins, planes: &mut Vec<Plane>) {
    // Edges of A with vertices of B, which lie in the direction of the lines. A is on the negative side.
    tangents(a, b, a.sense, -1.0, margins, planes);
    // Edges of B with vertices of A, which lie against the direction of the lines. B is on the positive side.
    tangents(b, a, -b.sense, 1.0, margins, planes);
}

/// Appends to `planes` the planes through an edge of polygon `of` and a vertex of polygon `to` that separate
/// the two polygons. `side` is the side of the plane of `of` on which `to` lies: 1 along the normal of `of`,
/// -1 against it. `own` is the side of each new plane on which `of` shall lie: 1 for the side that the new
/// plane's normal points to, -1 for the opposite side.
fn tangents(of: Facing, to: Facing, side: f64, own: f64, margins: &Margins, planes: &mut Vec<Plane>) {
    let toward = of.normal * side;
    // Maximum number of vertices. Polygons with more get no separating planes, which is conservative.
    const MAX_VERTICES: usize = 128;
    let count = to.vertices.len();
    if count > MAX_VERTICES || of.vertices.len() > MAX_VERTICES {
        return;
    }
    let mut inverse = [0.0; MAX_VERTICES];
    let base = toward.dot(of.vertices[0]);
    for (inverse, &p) in inverse.iter_mut().zip(to.vertices) {
        let w = toward.dot(p) - base;
        // A vertex in the plane of `of`, or behind it by rounding, gets 0: it prevents a tangent at every
        // edge on whose inner side it lies.
        *inverse = if w > margins.keep { 1.0 / w } else { 0.0 };
    }
    let mut a = of.vertices[of.vertices.len() - 1];
    for &b in of.vertices {
        let edge_start = core::mem::replace(&mut a, b);
        let inward = of.normal.cross(b - edge_start);
        let length = inward.length();
        if length <= margins.merge {
            continue;
        }
        let inward = inward / length;
        let at_edge = inward.dot(edge_start);
        let mut slope = f64::NEG_INFINITY;
        let mut stopped = false;
        for (&inverse, &p) in inverse.iter().zip(to.vertices) {
            let u = inward.dot(p) - at_edge;
            if inverse > 0.0 {
                slope = greater(slope, u * inverse);
            } else if u > -margins.keep {
                stopped = true;
            }
        }
        let is_steep = slope.abs() * margins.noise > 0.1 * margins.clearance;
        // Without a vertex on that side, the slope is negative infinity, which is steep.
        if stopped || is_steep {
            continue;
        }
        // The unit normal, oriented so that polygon `of` lies on the side `own`.
        let normal = (inward - toward * slope) * (own / DVec2::new(1.0, slope).length());
        let (before, after) = if own < 0.0 { (of, to) } else { (to, of) };
        let most = before.vertices.iter().fold(f64::NEG_INFINITY, |most, &p| greater(most, normal.dot(p)));
        let least = -after.vertices.iter().fold(f64::NEG_INFINITY, |most, &p| greater(most, -normal.dot(p)));
        if most <= least + margins.noise {
            planes.push(Plane::new(normal, margins.keep - least));
        }
    }
}

/// Returns the greater of two numbers, neither of them NaN. Compiles to one instruction, unlike `f64::max`.
fn greater(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::directed_portals::DirectedPortals;
    use visibility_core::cells::{CellGraph, CellId};
    use visibility_core::geometry::ConvexPolygon;

    /// Returns the margins for coordinates of up to 16, and a clearance of `clearance`.
    fn margins(clearance: f64) -> Margins {
        let corners = [[0.0, 0.0], [16.0, 0.0], [16.0, 16.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        let portal = (ConvexPolygon::new(corners).unwrap(), [CellId(0), CellId(1)]);
        DirectedPortals::new(&CellGraph::new(2, [portal]).unwrap(), clearance, 16.0).margins
    }

    fn rectangle(x: [f64; 2], y: [f64; 2], z: f64) -> Vec<DVec3> {
        [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]].map(|[x, y]| DVec3::new(x, y, z)).to_vec()
    }

    /// Returns the planes that separate polygon `a` from `b`, both across the z axis.
    fn planes(a: &[DVec3], b: &[DVec3], margins: &Margins) -> Vec<Plane> {
        let [a, b] = [a, b].map(|vertices| Facing { vertices, normal: DVec3::Z, sense: 1.0 });
        let mut planes = Vec::new();
        push_separating_planes(a, b, margins, &mut planes);
        planes
    }

    /// Returns where planes bound the points at `z` along x, as the greatest lower and the least upper bound.
    fn bounds_at(planes: &[Plane], z: f64) -> [f64; 2] {
        planes.iter().filter(|plane| plane.normal.x.abs() > 1e-3).fold([-1e9, 1e9], |[low, high], plane| {
            let at = -(plane.offset + plane.normal.z * z) / plane.normal.x;
            if plane.normal.x > 0.0 { [f64::max(low, at), high] } else { [low, f64::min(high, at)] }
        })
    }

    #[test]
    fn planes_bound_what_lines_reach_beyond_two_windows() {
        let margins = margins(1e-6);
        let first = rectangle([0.0, 2.0], [0.0, 2.0], 0.0);
        // The second window, 1 m behind the first, is smaller, larger, or beside it.
        for (x, beyond) in [([0.5, 1.5], [-1.0, 3.0]), ([-1.0, 4.0], [-4.0, 8.0]), ([3.0, 5.0], [4.0, 10.0])]
        {
            let found = planes(&first, &rectangle(x, [0.0, 2.0], 1.0), &margins);
            assert_eq!(found.len(), 8, "{x:?}: a plane for each edge of either window");
            let at = bounds_at(&found, 2.0);
            assert!((0..2).all(|i| (at[i] - beyond[i]).abs() < 1e-8), "{x:?}: {at:?}");
            // The planes keep what lines reach, and lie outside of it by the distance that clipping keeps.
            assert!(at[0] < beyond[0] && at[1] > beyond[1], "{x:?}: {at:?}");
        }
        // A window that the plane of the first one cuts: its vertices in front and behind bound nothing at
        // the edges on whose inner side they are.
        let across = [[0.5, 0.5, -1.0], [1.5, 0.5, 1.0], [1.5, 1.5, 1.0], [0.5, 1.5, -1.0]].map(DVec3::from);
        let [first, across] = [&first[..], &across[..]].map(|vertices| {
            let normal = (vertices[1] - vertices[0]).cross(vertices[2] - vertices[1]).normalize();
            Facing { vertices, normal, sense: 1.0 }
        });
        let mut found = Vec::new();
        tangents(first, across, 1.0, -1.0, &margins, &mut found);
        assert!(found.is_empty(), "planes at edges of the first window: {found:?}");
    }

    /// The second window lies beside the first one, the farther behind its plane, the less steep is a plane
    /// through an edge of the first and a vertex of the second.
    #[test]
    fn steep_planes_are_not_used() {
        let margins = margins(1e-6);
        let steepest = 0.1 * margins.clearance / margins.noise;
        let first = rectangle([0.0, 2.0], [0.0, 2.0], 0.0);
        for (steepness, is_used) in [(0.5, true), (0.99, true), (1.01, false), (2.0, false)] {
            // Planes through the edge at x = 0, with the vertices at x = 8.
            let second = rectangle([4.0, 8.0], [0.0, 2.0], 8.0 / (steepest * steepness));
            let [first, second] =
                [&first, &second].map(|vertices| Facing { vertices, normal: DVec3::Z, sense: 1.0 });
            let mut found = Vec::new();
            tangents(first, second, 1.0, -1.0, &margins, &mut found);
            let is_steep = |plane: &Plane| plane.normal.z.abs() > 0.9999 && plane.normal.x < 0.0;
            assert_eq!(found.iter().any(is_steep), is_used, "steepness {steepness}: {found:?}");
        }
    }

    #[test]
    fn windows_of_more_than_128_vertices_and_short_edges_bound_nothing() {
        let margins = margins(1e-6);
        let ring = |count: u32, z: f64| -> Vec<DVec3> {
            let angles = (0..count).map(|i| f64::from(i) / f64::from(count) * core::f64::consts::TAU);
            angles.map(|angle| DVec3::new(8.0 * angle.cos(), 8.0 * angle.sin(), z)).collect()
        };
        let square = rectangle([0.0, 2.0], [0.0, 2.0], 0.0);
        for (count, expected) in [(128, 132), (129, 0)] {
            assert_eq!(planes(&square, &ring(count, 1.0), &margins).len(), expected, "{count} behind");
            assert_eq!(planes(&ring(count, -1.0), &square, &margins).len(), expected, "{count} before");
        }
        let mut short = square.clone();
        short.insert(1, square[1] - DVec3::X * margins.merge * 0.9);
        assert_eq!(
            planes(&short, &rectangle([0.0, 2.0], [0.0, 2.0], 1.0), &margins).len(),
            8,
            "a short edge"
        );
        short[1] = square[1] - DVec3::X * margins.merge * 1.1;
        assert_eq!(
            planes(&short, &rectangle([0.0, 2.0], [0.0, 2.0], 1.0), &margins).len(),
            9,
            "a longer edge"
        );
    }
}
