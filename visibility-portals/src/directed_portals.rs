//! Portals made ready for bakes: a plane fitted to each, its vertices put on that plane, the polygon drawn in
//! by part of the clearance, and a copy for each direction.
//!
//! # Margins
//! A pair of cells must be called visible if a line through portals between them stays clear of all portal
//! edges by the clearance; then so does a thin cylinder around the line. Drawing each portal in by less than
//! that leaves the line inside of each with room to spare. It also takes portals apart that share an edge, so
//! that separating planes are never found from points that coincide. The rest of the room pays for rounding:
//! planes that clip keep what is [`keep`](Margins::keep) beyond them, and vertices nearer to each other than
//! [`merge`](Margins::merge) become one, since the direction between them means nothing.

use crate::coplanar_portals;
use crate::stabbing::pluecker::{Edge, Opening, edges_of};
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::{cells::CellGraph, geometry::Plane};

/// Bound on the rounding of a product of a unit vector and a position, relative to the greatest coordinate:
/// see [`Margins::new`].
const NOISE: f64 = 8.0 * f64::EPSILON;

/// Distances that decide what counts as touching, in world units.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Margins {
    /// The distance by which portals are drawn in.
    pub(crate) inset: f64,
    /// A point less than this in front of a plane counts as on it.
    pub(crate) side: f64,
    /// Planes that clip keep points up to this distance beyond them.
    pub(crate) keep: f64,
    /// Vertices nearer to each other than this become one.
    pub(crate) merge: f64,
    /// Bound on the rounding of a product of a unit vector and a position.
    pub(crate) noise: f64,
    /// The distance that lines must keep from all edges.
    pub(crate) clearance: f64,
}

impl Margins {
    /// Margins for coordinates of at most `extent` in size.
    fn new(clearance: f64, extent: f64) -> Self {
        // A unit vector times a position: three products and two sums, each rounded by 2^-53 of at most
        // sqrt(3) extent, and the vector's length, wrong by as much: less than 2^-49 extent. With coordinates
        // of a few thousand that is 1e-11.
        let noise = extent * NOISE;
        let keep = (12.0 * noise).max(1e-4 * clearance);
        Self { inset: 0.4 * clearance, side: keep, keep, merge: 20.0 * keep, noise, clearance }
    }
}

/// A portal in one of its two directions.
#[derive(Clone, Debug)]
pub(crate) struct DirectedPortal {
    /// Its unit normal points in the direction of the portal.
    pub(crate) plane: Plane,
    /// Center of a ball that holds all vertices.
    pub(crate) center: DVec3,
    /// Radius of that ball.
    pub(crate) radius: f64,
    /// First of its vertices, an index into [`DirectedPortals::vertices`]; they run counter-clockwise around
    /// the normal.
    pub(crate) start: u32,
    /// End of that range, exclusive.
    pub(crate) end: u32,
    /// The cell that it leads from.
    pub(crate) from: u32,
    /// The cell that it leads to.
    pub(crate) to: u32,
    /// Index of the same portal in the other direction.
    pub(crate) reverse: u32,
    /// Range of its edges as they were given in [`DirectedPortals::edges`]: counter-clockwise around the
    /// normal, or clockwise if `against`.
    pub(crate) edges: (u32, u32),
    /// See `edges`.
    pub(crate) against: bool,
    /// Range of its vertices as they were given in [`DirectedPortals::given`].
    given: (u32, u32),
}

/// All portals in both directions, sorted by the cell that they lead from.
#[derive(Clone, Debug)]
pub(crate) struct DirectedPortals {
    pub(crate) all: Vec<DirectedPortal>,
    pub(crate) vertices: Vec<DVec3>,
    pub(crate) edges: Vec<Edge>,
    given: Vec<DVec3>,
    /// By cell: index of the first portal that leads from it; one more entry marks the end of the last.
    pub(crate) first: Vec<u32>,
    pub(crate) margins: Margins,
}

impl DirectedPortals {
    /// Makes the portals of a graph ready. Portals that nothing is left of once they are drawn in are left
    /// out.
    pub(crate) fn new(graph: &CellGraph, clearance: f64) -> Self {
        let positions = graph.portals().iter().flat_map(|p| p.polygon().vertices());
        let extent = positions.fold(0.0, |extent: f64, v| extent.max(v.abs().max_element()));
        let margins = Margins::new(clearance, extent);
        let mut insets = alloc::vec![None; graph.portals().len()];
        let (mut vertices, mut edges) = (Vec::new(), Vec::new());
        let mut all_given: Vec<DVec3> = Vec::new();
        for (portal, inset) in graph.portals().iter().zip(&mut insets) {
            let plane = portal.plane();
            let on_plane: Vec<DVec3> = portal
                .polygon()
                .vertices()
                .iter()
                .map(|&v| v - plane.normal * plane.signed_distance(v))
                .collect();
            let drawn_in = draw_in(&on_plane, plane.normal, &margins);
            if drawn_in.len() >= 3 {
                let start = vertices.len() as u32;
                vertices.extend_from_slice(&drawn_in);
                let middle = vertices.len() as u32;
                vertices.extend(drawn_in.iter().rev());
                let first_edge = edges.len() as u32;
                let given = portal.polygon().vertices().iter().copied();
                edges_of(given.clone(), plane.normal, margins.inset, &mut edges);
                let first_given = all_given.len() as u32;
                all_given.extend(given);
                let edges = (first_edge, edges.len() as u32);
                let given = (first_given, all_given.len() as u32);
                *inset = Some(([start, middle, vertices.len() as u32], edges, given));
            }
        }
        let mut all: Vec<DirectedPortal> = Vec::new();
        let mut first = Vec::with_capacity(graph.cell_count() + 1);
        let mut halves = alloc::vec![[0; 2]; graph.portals().len()];
        for cell in (0..graph.cell_count() as u32).map(visibility_core::cells::CellId) {
            first.push(all.len() as u32);
            for &id in graph.portals_of(cell) {
                let Some(([start, middle, end], edges, given)) = insets[id.index()] else { continue };
                let portal = &graph.portals()[id.index()];
                let backward = usize::from(portal.cells()[0] != cell);
                halves[id.index()][backward] = all.len() as u32;
                let (start, end) = [(start, middle), (middle, end)][backward];
                let plane = if backward == 0 { portal.plane() } else { portal.plane().flipped() };
                let (center, radius) = ball(&vertices[start as usize..end as usize]);
                let to = portal.cells()[1 - backward].0;
                let (from, against) = (cell.0, backward == 1);
                let reverse = 0;
                let directed = DirectedPortal {
                    plane,
                    center,
                    radius,
                    start,
                    end,
                    from,
                    to,
                    reverse,
                    edges,
                    against,
                    given,
                };
                all.push(directed);
            }
        }
        first.push(all.len() as u32);
        for [a, b] in halves.into_iter().zip(&insets).filter(|(_, inset)| inset.is_some()).map(|(h, _)| h) {
            all[a as usize].reverse = b;
            all[b as usize].reverse = a;
        }
        Self { all, vertices, edges, given: all_given, first, margins }
    }

    /// Cells, ends and vertices as numbers, for a fingerprint.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = u64> + '_ {
        let cells = self.first.len() as u64;
        let ends = self.all.iter().map(|portal| u64::from(portal.from) << 32 | u64::from(portal.to));
        let vertices = self.vertices.iter().flat_map(|v| v.to_array()).map(f64::to_bits);
        core::iter::once(cells).chain(ends).chain(vertices)
    }

    /// The vertices of a portal, drawn in.
    pub(crate) fn vertices_of(&self, portal: &DirectedPortal) -> &[DVec3] {
        &self.vertices[portal.start as usize..portal.end as usize]
    }

    /// A portal as it was given.
    pub(crate) fn opening(&self, portal: &DirectedPortal) -> Opening<'_> {
        let edges = &self.edges[portal.edges.0 as usize..portal.edges.1 as usize];
        Opening { edges, against: portal.against, normal: portal.plane.normal }
    }

    /// The portals that lead from a cell, as a range of `all`.
    pub(crate) fn from(&self, cell: u32) -> core::ops::Range<u32> {
        self.first[cell as usize]..self.first[cell as usize + 1]
    }

    /// Whether a line can pass `a` and later `b`: part of `b` lies before the plane of `a`, and part of `a`
    /// behind that of `b`.
    pub(crate) fn can_follow(&self, a: &DirectedPortal, b: &DirectedPortal) -> bool {
        self.reaches(b, &a.plane) && self.reaches(a, &b.plane.flipped()) && !self.lie_side_by_side(a, b)
    }

    /// Whether two portals lay side by side in one plane before coordinates were rounded.
    fn lie_side_by_side(&self, a: &DirectedPortal, b: &DirectedPortal) -> bool {
        // How far rounded portals can seem apart: half a millionth of a unit at one end of a portal is so
        // many times that, far from it.
        let near = 512.0 * self.margins.clearance;
        if a.plane.signed_distance(b.center) > near || b.plane.signed_distance(a.center) < -near {
            return false;
        }
        let [first, second] =
            [a, b].map(|portal| &self.given[portal.given.0 as usize..portal.given.1 as usize]);
        let larger = if a.radius > b.radius { a } else { b };
        coplanar_portals::lie_side_by_side(first, second, larger.plane.normal, self.margins.clearance)
    }

    /// Whether some vertex of a portal is on the inner side of a plane, by more than the margin.
    fn reaches(&self, portal: &DirectedPortal, plane: &Plane) -> bool {
        let (side, middle) = (self.margins.side, plane.signed_distance(portal.center));
        // Most are decided by the ball: where the mean of the vertices lies, or beyond, at least one of them
        // does.
        if middle > side {
            return true;
        }
        middle + portal.radius > side
            && self.vertices_of(portal).iter().any(|&v| plane.signed_distance(v) > side)
    }
}

/// The part of a polygon that is farther than the inset from its boundary.
fn draw_in(vertices: &[DVec3], normal: DVec3, margins: &Margins) -> Vec<DVec3> {
    let mut polygon = vertices.to_vec();
    let mut next = Vec::new();
    for (i, &a) in vertices.iter().enumerate() {
        let b = vertices[(i + 1) % vertices.len()];
        // An edge this short has no direction of its own, and its neighbours bound what it bounds.
        if (b - a).length_squared() <= margins.merge * margins.merge {
            continue;
        }
        let inward = normal.cross(b - a).normalize_or_zero();
        let offset = -inward.dot(a) - margins.inset;
        crate::clip_polygon::clip_into(&polygon, &Plane::new(inward, offset), margins.merge, &mut next);
        core::mem::swap(&mut polygon, &mut next);
    }
    polygon
}

/// A ball that holds some points, by center and radius, enlarged by more than rounding needs.
fn ball(points: &[DVec3]) -> (DVec3, f64) {
    let center = points.iter().fold(DVec3::ZERO, |sum, &p| sum + p) / points.len() as f64;
    let radius = points.iter().fold(0.0, |r: f64, &p| r.max((p - center).length()));
    (center, radius * (1.0 + 1e-12) + center.abs().max_element() * NOISE)
}
