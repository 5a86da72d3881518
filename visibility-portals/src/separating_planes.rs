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
        if stopped || is_steep || slope == f64::NEG_INFINITY {
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
