//! Whether any line passes the edges of a sequence of portals, by a linear program in Pluecker space.
//!
//! This work is based on: Seth Teller, "Computing the Antipenumbra of an Area Light Source", 1992; Seth
//! Teller and Michael Hohmeyer, "Determining the Lines Through Four Lines", 1999; Durand's survey, chapter 8,
//! section 3. A directed line through the point `p` along `d` has the six coordinates `(d, m)`, `m = p x d`.
//! The edge from `a` to `b` lies to the right of the line, so that the line passes on the edge's left side,
//! if
//!
//! ```text
//! h . (d, m) > 0,    h = (a x b, b - a)
//! ```
//!
//! A line goes through a polygon if it passes all edges of the polygon on their left side. These are
//! half-spaces through the origin of six dimensions. If they have nothing in common, no line goes through all
//! polygons.
//!
//! # What is not decided
//! If the half-spaces have something in common, there may still be no line: lines satisfy `d . m = 0`, the
//! Pluecker quadric, which a polytope can miss. This is not tested here: such a sequence is a *maybe*, and so
//! is a sequence whose polytope is empty by so little that no certificate is found. The loss is small.
//! Splitting the first and the last portal each in two, recursively up to 256 parts, and testing all parts,
//! excluded 29 more of 26,000 chains of a map of 1,726 portals. It excluded no further pair of cells, for 3.4
//! times the time of the bake.
//!
//! # What is certified
//! A line that stays clear of all edges by a distance `c` passes each edge on the same side after the edge
//! has been moved by less than `c` in any direction. Here each edge is moved into the polygon by its
//! [`shift`](Edge::shift), which adds `shift x (b - a)` to the first half of `h`. With `d` of unit length,
//! lengths about an origin `o`, and a polygon of the sequence all of whose vertices are within `radius` of
//! `o`:
//! - `|d_k| <= 1`, and `|m_k| <= radius`, since the line meets the polygon;
//! - `N . d >= 6 c^2`, where `N` is the sum of `a x b` around that polygon, twice its area along its normal:
//!   seen along the line, the polygon has the area `N . d / 2` and contains a disc with radius `c`.
//!
//! A certificate is a set of edges with multipliers `l_i > 0`: `N + sum l_i h_i = r`, where `r` is so small
//! that the bounds on `d` and `m` keep the sum below `6 c^2`. All terms are evaluated from the input
//! vertices, in double-double numbers with every rounding counted (see `certificate`). The program that
//! proposes the edges is solved in plain `f64`, in the five dimensions that remain when lines are scaled to
//! `n . d = 1`.

mod certificate;
mod radius;
mod seidel;

pub(crate) use certificate::MAX_ROWS;

use alloc::vec::Vec;
use certificate::{Row, find};
use radius::radius_of;
use seidel::{SeidelSolver, Stop};
use visibility_core::geometry::DoubleDouble;
use visibility_core::glam::DVec3;

/// An edge of a portal, from `a` to `b`, in world space. Lines that pass the portal have the portal on the
/// left of the edge.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Edge {
    pub(crate) a: DVec3,
    pub(crate) b: DVec3,
    /// Displacement, in world units, that moves the edge into the portal. Its length is the inset (see
    /// [`edges_of`]) less the farthest distance by which a vertex lies beyond the edge, on the side away
    /// from the portal.
    pub(crate) shift: DVec3,
    /// Whether the edge is used as a constraint on lines through the portal. `false` for an edge without
    /// length, and for an edge beyond which another vertex lies by more than the inset (see [`edges_of`]).
    pub(crate) bounds: bool,
}

impl Edge {
    /// Returns the edge from `b` to `a`, with the shift and `bounds` unchanged.
    fn reversed(&self) -> Self {
        Self { a: self.b, b: self.a, ..*self }
    }
}

/// A portal, in world space, of a sequence of portals that a line shall pass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Opening<'a> {
    /// Edges of the portal, counter-clockwise around the direction in which lines pass; clockwise if
    /// `against`.
    pub(crate) edges: &'a [Edge],
    /// Whether the `edges` run clockwise around the direction in which lines pass; if false,
    /// counter-clockwise.
    pub(crate) against: bool,
    /// Unit normal of the portal's plane, in the direction in which lines pass.
    pub(crate) normal: DVec3,
}

impl Opening<'_> {
    /// Returns edge `i` with the orientation that is counter-clockwise around the direction in which lines
    /// pass.
    fn edge(&self, i: usize) -> Edge {
        if self.against { self.edges[i].reversed() } else { self.edges[i] }
    }
}

/// Appends to `edges` the edges of a convex polygon in world space. The vertices run counter-clockwise around
/// the unit `normal`. Each edge gets the shift that moves it inwards by `inset` world units, less the
/// farthest distance by which a vertex lies beyond the edge.
pub(crate) fn edges_of(
    vertices: impl Iterator<Item = DVec3> + Clone,
    normal: DVec3,
    inset: f64,
    edges: &mut Vec<Edge>,
) {
    let Some(mut a) = vertices.clone().last() else { return };
    for b in vertices.clone() {
        let inward = normal.cross(b - a).normalize_or_zero();
        // Vertices may lie on the outer side of an edge by rounding. Up to the inset the shift is reduced by
        // that distance; beyond, the edge is not used.
        let least = vertices.clone().fold(0.0, |least: f64, v| least.min(inward.dot(v - a)));
        let bounds = inward != DVec3::ZERO && -least <= inset;
        edges.push(Edge { a, b, shift: inward * (inset + least), bounds });
        a = b;
    }
}

/// Scratch memory of the test whether any line passes a sequence of portals, and the result of the last test.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pluecker {
    seidel: SeidelSolver,
    /// Constraints of the linear program, one for each used edge: half-spaces in the five variables of
    /// `frame`, each as a normal and an offset: `normal . variables + offset >= 0`.
    rows: Vec<([f64; 5], f64)>,
    /// By row: index of the opening, and index of the edge in the opening.
    of: Vec<(u32, u32)>,
    /// Indices of the openings that the last certificate names, each once. No line passes all of them.
    pub(crate) needed: Vec<u32>,
}

/// Least cosine between the approximate line and the normal of a portal, for the portal with the greatest
/// cosine. If it is not above this value, the line is nearly parallel to all portals and
/// [`Pluecker::excludes`] decides nothing: rounding could move the points where the line crosses them by a
/// billion times the error of the line.
const MIN_COSINE: f64 = 1e-9;

impl Pluecker {
    /// Tests whether it is certain that no line passes all `count` openings at least `clearance` (world
    /// units) away from their edges, and fills `needed` then. `opening` returns an opening by index.
    /// `(origin, direction)` is a point and a direction of an approximate line, in world space, from which
    /// the linear program starts. `false` if undecided, and if that line is nearly parallel to all openings.
    pub(crate) fn excludes<'a>(
        &mut self,
        opening: impl Fn(usize) -> Opening<'a>,
        count: usize,
        (origin, direction): (DVec3, DVec3),
        clearance: f64,
    ) -> bool {
        // Lines are scaled by the opening whose normal is most nearly along the direction.
        let Some(square) = (0..count).max_by(|&i, &j| {
            let along = |i: usize| opening(i).normal.dot(direction);
            along(i).total_cmp(&along(j))
        }) else {
            return false;
        };
        let normal = opening(square).normal;
        let along = normal.dot(direction);
        let is_square = along > MIN_COSINE;
        if !is_square {
            return false;
        }
        // Directions with a component of 1 along `normal`: two unknowns; the moment of the line has three
        // more. In these five a line passes an edge on its inner side if a linear inequality holds.
        let start = direction / along;
        let u = normal.any_orthonormal_vector();
        let v = normal.cross(u);
        self.rows.clear();
        self.of.clear();
        // Moments are divided by the size of the scene, so that all unknowns are of about the same size.
        let mut size = 0.0;
        for i in 0..count {
            for edge in opening(i).edges {
                let from = (edge.a - origin).abs().max_element();
                size = if from > size { from } else { size };
            }
        }
        for i in 0..count {
            let opening = opening(i);
            for j in 0..opening.edges.len() {
                let edge = opening.edge(j);
                let (a, e) = (edge.a - origin, edge.b - edge.a);
                if !edge.bounds {
                    continue;
                }
                let h = a.cross(e) + edge.shift.cross(e);
                let m = e * size;
                self.rows.push(([h.dot(u), h.dot(v), m.x, m.y, m.z], h.dot(start)));
                self.of.push((i as u32, j as u32));
            }
        }
        self.seidel.solve(&self.rows) == Err(Stop::Conflict)
            && self.is_certified(&opening, square, origin, clearance)
    }

    /// Searches a certificate for the conflict of the last run of the linear program, that is, for the edges
    /// whose half-spaces seem to contradict each other. Returns true, and fills `needed`, if one is found: no
    /// line passes all these edges and stays `clearance` away from them. `at` is the index of the opening
    /// that scales lines: with its unit normal `n`, a line's direction `d` has `n . d = 1`. `origin` is the
    /// world-space point about which moments are taken, `clearance` is in world units.
    fn is_certified<'a>(
        &mut self,
        opening: &impl Fn(usize) -> Opening<'a>,
        at: usize,
        origin: DVec3,
        clearance: f64,
    ) -> bool {
        let square = opening(at);
        let (radius, unit) = radius_of(square.edges.iter().map(|edge| (edge.a - origin).length()));
        let mut rows = [Row { normal: [DoubleDouble::ZERO; 6], error: 0.0, least: 0.0 }; MAX_ROWS];
        rows[0] = area_row(&square, origin, clearance);
        let mut count = 1;
        for row in self.seidel.conflict() {
            let (i, j) = self.of[row];
            rows[count] = edge_row(&opening(i as usize).edge(j as usize), origin, unit);
            count += 1;
        }
        let bounds = [1.0, 1.0, 1.0, radius / unit, radius / unit, radius / unit];
        let Some(multipliers) = find(&rows[..count], &bounds) else { return false };
        self.needed.clear();
        self.needed.push(at as u32);
        for (row, l) in self.seidel.conflict().zip(&multipliers[1..]) {
            let of = self.of[row].0;
            if l.hi > 0.0 && !self.needed.contains(&of) {
                self.needed.push(of);
            }
        }
        true
    }
}

/// A three-dimensional vector of double-double numbers.
type DoubleDoubleVector = [DoubleDouble; 3];

fn difference(a: DVec3, b: DVec3) -> DoubleDoubleVector {
    [0, 1, 2].map(|k| DoubleDouble::difference(a[k], b[k]))
}

fn cross(a: &DoubleDoubleVector, b: &DoubleDoubleVector) -> DoubleDoubleVector {
    [0, 1, 2].map(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        a[i].times(b[j]).plus(a[j].times(b[i]).negated())
    })
}

/// Returns an absolute bound on the error of each coordinate of the computed cross product of `a` and `b`:
/// two products and a difference, each off by at most [`DoubleDouble::ERROR`] of the product of the greatest
/// coordinates, or of the sum of two such products.
fn error_of_cross(a: &DoubleDoubleVector, b: &DoubleDoubleVector) -> f64 {
    let size = |a: &DoubleDoubleVector| a.iter().fold(0.0, |size: f64, a| size.max(a.hi.abs()));
    8.0 * DoubleDouble::ERROR * size(a) * size(b)
}

/// Returns the half-space `h . (d, m) >= 0` of the lines that pass on the left of an edge after the edge has
/// been moved by its shift. `d` is the direction of a line and `m` its moment about `origin` (world space),
/// in units of `unit` world units.
fn edge_row(edge: &Edge, origin: DVec3, unit: f64) -> Row<6> {
    // a x b = a x (b - a).
    let (a, e) = (difference(edge.a, origin), difference(edge.b, edge.a));
    let shift = [0, 1, 2].map(|k| DoubleDouble::from(edge.shift[k]));
    let (turn, moved) = (cross(&a, &e), cross(&shift, &e));
    let d = [0, 1, 2].map(|k| turn[k].plus(moved[k]));
    let m = e.map(|e| e.scaled(unit));
    // The sum of the errors of both cross products, doubled to cover the final sums.
    let error = 2.0 * (error_of_cross(&a, &e) + error_of_cross(&shift, &e)) + f64::MIN_POSITIVE;
    Row { normal: [d[0], d[1], d[2], m[0], m[1], m[2]], error, least: 0.0 }
}

/// Returns the half-space `N . d >= 6 c^2` of the lines that are not parallel to an opening's plane. `d` is
/// the direction of a line, `c` the clearance, and `N` the opening's normal times twice its area. Along a
/// line that passes the opening with this clearance, the opening looks at least as large as a disc of radius
/// `c`, so `N . d` is at least `2 pi c^2`. `origin` is the world-space point that edges are taken relative
/// to.
fn area_row(opening: &Opening, origin: DVec3, clearance: f64) -> Row<6> {
    let (mut sum, mut error) = ([DoubleDouble::ZERO; 3], f64::MIN_POSITIVE);
    for i in 0..opening.edges.len() {
        let edge = opening.edge(i);
        let (a, e) = (difference(edge.a, origin), difference(edge.b, edge.a));
        let part = cross(&a, &e);
        error += 2.0 * error_of_cross(&a, &e);
        for (sum, part) in sum.iter_mut().zip(part) {
            *sum = sum.plus(part);
            error += DoubleDouble::ERROR * (sum.hi.abs() + part.hi.abs());
        }
    }
    let zero = DoubleDouble::ZERO;
    // The least value is 2 pi c^2, rounded down.
    Row { normal: [sum[0], sum[1], sum[2], zero, zero, zero], error, least: 6.0 * clearance * clearance }
}

#[cfg(test)]
mod chains;
#[cfg(test)]
mod tests;
