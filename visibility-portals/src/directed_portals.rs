//! The portals of a graph prepared for baking: each has a fitted plane, vertices projected onto that plane, a
//! polygon shrunk by part of the clearance, and one copy for each direction.
//!
//! # Margins
//! A pair of cells must be called visible if a line through the portals between them stays clear of all
//! portal edges by the clearance, and by as much more as vertices of a portal are off its plane: no point of
//! an edge moves farther when vertices are moved into the plane, so the line stays clear of the edges there
//! by the clearance. The thin cylinder around that line then passes as well. Each portal is shrunk by less
//! than the clearance, so the line stays inside each shrunk portal with a margin. Shrinking also separates
//! portals that share an edge, so that separating planes are never computed from coincident points. The rest
//! of the margin pays for rounding. Clipping keeps points up to [`keep`](Margins::keep) outside a plane.
//! Vertices nearer to each other than [`merge`](Margins::merge) become one, since the direction between them
//! is dominated by rounding.

use crate::coplanar_portals;
use crate::pluecker::{Edge, Opening, edges_of};
use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::glam::DVec3;
use visibility_core::{cells::CellGraph, geometry::Plane};

/// Bound on the rounding of the dot product of a unit vector and a position, divided by the greatest absolute
/// coordinate. Derived in [`Margins::new`].
const NOISE: f64 = 8.0 * f64::EPSILON;

/// Distances that decide which points count as touching, all in world units.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Margins {
    /// Distance by which portals are shrunk on all sides, less than the clearance.
    pub(crate) inset: f64,
    /// A point less than this distance in front of a plane (on the side of its normal) counts as on the
    /// plane.
    pub(crate) side: f64,
    /// Clipping to a plane keeps points up to this distance on the outer side of the plane, opposite to its
    /// normal.
    pub(crate) keep: f64,
    /// Clipped polygons: neighbouring vertices no farther apart than this become one.
    pub(crate) merge: f64,
    /// Absolute bound on the rounding error of the dot product of a unit vector and a position of the map.
    pub(crate) noise: f64,
    /// Distance that lines must keep from all portal edges:
    /// [`BakerSettings::with_clearance`](crate::BakerSettings::with_clearance).
    pub(crate) clearance: f64,
}

impl Margins {
    /// Returns the margins for coordinates of at most `extent` in absolute value. `clearance` and `extent`
    /// are in world units.
    fn new(clearance: f64, extent: f64) -> Self {
        let noise = Self::noise_of(extent);
        let keep = (12.0 * noise).max(1e-4 * clearance);
        Self { inset: 0.4 * clearance, side: keep, keep, merge: 20.0 * keep, noise, clearance }
    }

    /// Returns [`noise`](Self::noise) for coordinates of at most `extent` in absolute value.
    pub(crate) fn noise_of(extent: f64) -> f64 {
        // A unit vector times a position has three products and two sums, each rounded by 2^-53 of at most
        // sqrt(3) extent. The vector's length has an error of that order too. The total is less than 2^-49
        // extent: 1e-11 for coordinates of a few thousand.
        extent * NOISE
    }
}

/// A portal in one of its two directions, in world space.
#[derive(Clone, Debug)]
pub(crate) struct DirectedPortal {
    /// Plane of the portal. Its unit normal points in the direction of the portal, into the cell `to`.
    pub(crate) plane: Plane,
    /// Centre of a ball, in world space, that contains all shrunk vertices.
    pub(crate) center: DVec3,
    /// Radius of the ball around `center` that contains all shrunk vertices, in world units.
    pub(crate) radius: f64,
    /// The portal's shrunk vertices, a range of [`DirectedPortals::vertices`]. The vertices run
    /// counter-clockwise around the normal.
    vertices: Range<u32>,
    /// Index of the cell that the portal leads from.
    pub(crate) from: u32,
    /// Index of the cell that the portal leads to.
    pub(crate) to: u32,
    /// Index in [`DirectedPortals::all`] of the portal in the other direction.
    pub(crate) reverse: u32,
    /// The edges of the unshrunk polygon, a range of [`DirectedPortals::edges`]. The edges run
    /// counter-clockwise around the normal, or clockwise if `against`.
    edges: Range<u32>,
    /// Whether the `edges` run clockwise around this portal's normal; if false, counter-clockwise.
    against: bool,
}

/// All portals of a graph in both directions, sorted by the index of the cell that they lead from.
#[derive(Clone, Debug)]
pub(crate) struct DirectedPortals {
    pub(crate) all: Vec<DirectedPortal>,
    vertices: Vec<DVec3>,
    edges: Vec<Edge>,
    /// CSR offsets: by cell index, the index in `all` of the first portal that leads from the cell; one more
    /// entry marks the end of the last cell.
    pub(crate) first: Vec<u32>,
    pub(crate) margins: Margins,
}

impl DirectedPortals {
    /// Returns the greatest absolute coordinate of the portals' vertices, 0 without portals.
    pub(crate) fn extent(graph: &CellGraph) -> f64 {
        let positions = graph.portals().iter().flat_map(|p| p.polygon().vertices());
        positions.fold(0.0, |extent: f64, v| extent.max(v.abs().max_element()))
    }

    /// Prepares the portals of `graph`, whose coordinates are at most `extent` in absolute value, shrunk by
    /// part of `clearance` (world units). A portal that vanishes when it is shrunk is left out.
    pub(crate) fn new(graph: &CellGraph, clearance: f64, extent: f64) -> Self {
        let margins = Margins::new(clearance, extent);
        // By portal index: the ranges of the shrunk vertices in both directions, and the range of the edges.
        let mut shrunk = alloc::vec![None; graph.portals().len()];
        let (mut vertices, mut edges) = (Vec::new(), Vec::new());
        for (portal, shrunk) in graph.portals().iter().zip(&mut shrunk) {
            let (plane, given) = (portal.plane(), portal.polygon().vertices());
            // Vertices moved into the plane of the portal, then inwards: lines through the shrunk polygon
            // keep a distance from the true edges.
            let on_plane: Vec<DVec3> =
                given.iter().map(|&v| v - plane.normal * plane.signed_distance(v)).collect();
            let polygon = shrunk_polygon(&on_plane, plane.normal, &margins);
            if polygon.len() >= 3 {
                let start = vertices.len() as u32;
                vertices.extend_from_slice(&polygon);
                let middle = vertices.len() as u32;
                vertices.extend(polygon.iter().rev());
                let first_edge = edges.len() as u32;
                edges_of(given.iter().copied(), plane.normal, margins.inset, &mut edges);
                let ranges = [start..middle, middle..vertices.len() as u32];
                *shrunk = Some((ranges, first_edge..edges.len() as u32));
            }
        }
        let mut all: Vec<DirectedPortal> = Vec::new();
        let mut first = Vec::with_capacity(graph.cell_count() + 1);
        let mut halves = alloc::vec![[0; 2]; graph.portals().len()];
        // Directed portals are ordered by the cell they leave, so that those of one cell are a range.
        for cell in (0..graph.cell_count() as u32).map(visibility_core::cells::CellId) {
            first.push(all.len() as u32);
            for &id in graph.portals_of(cell) {
                let Some((ranges, edges)) = &shrunk[id.index()] else { continue };
                let portal = &graph.portals()[id.index()];
                let against = portal.cells()[0] != cell;
                let own = ranges[usize::from(against)].clone();
                let (center, radius) = bounding_ball(&vertices[own.start as usize..own.end as usize]);
                halves[id.index()][usize::from(against)] = all.len() as u32;
                all.push(DirectedPortal {
                    plane: if against { portal.plane().flipped() } else { portal.plane() },
                    center,
                    radius,
                    vertices: own,
                    from: cell.0,
                    to: portal.cells()[usize::from(!against)].0,
                    reverse: 0,
                    edges: edges.clone(),
                    against,
                });
            }
        }
        first.push(all.len() as u32);
        // Both directions of a portal know each other.
        for ([a, b], _) in halves.into_iter().zip(&shrunk).filter(|(_, shrunk)| shrunk.is_some()) {
            all[a as usize].reverse = b;
            all[b as usize].reverse = a;
        }
        Self { all, vertices, edges, first, margins }
    }

    /// Returns the cell count plus 1, the bits of the clearance, the cells of each directed portal and the
    /// bits of all shrunk vertices, for the bake's fingerprint.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = u64> + '_ {
        let cells = self.first.len() as u64;
        let ends = self.all.iter().map(|portal| u64::from(portal.from) << 32 | u64::from(portal.to));
        let vertices = self.vertices.iter().flat_map(|v| v.to_array()).map(f64::to_bits);
        [cells, self.margins.clearance.to_bits()].into_iter().chain(ends).chain(vertices)
    }

    /// Returns the shrunk vertices of a portal in world space, counter-clockwise around the portal's normal.
    pub(crate) fn vertices_of(&self, portal: &DirectedPortal) -> &[DVec3] {
        &self.vertices[portal.vertices.start as usize..portal.vertices.end as usize]
    }

    /// Returns the input polygon of a portal as an opening for the test in Pluecker space.
    pub(crate) fn pluecker_opening(&self, portal: &DirectedPortal) -> Opening<'_> {
        let edges = &self.edges[portal.edges.start as usize..portal.edges.end as usize];
        Opening { edges, against: portal.against, normal: portal.plane.normal }
    }

    /// Returns the portals that lead from a cell, as a range of `all`.
    pub(crate) fn from(&self, cell: u32) -> Range<u32> {
        self.first[cell as usize]..self.first[cell as usize + 1]
    }

    /// Tests whether a line may pass portal `a` and later portal `b`, each along its normal. That requires
    /// that part of `b` lies in front of the plane of `a`, that part of `a` lies behind the plane of `b`, and
    /// that the two do not lie side by side in one plane. `false` is certain, `true` is not.
    pub(crate) fn can_follow(&self, a: &DirectedPortal, b: &DirectedPortal) -> bool {
        self.reaches(b, &a.plane) && self.reaches(a, &b.plane.flipped()) && !self.lie_side_by_side(a, b)
    }

    /// Tests whether two portals lie side by side in one plane up to the rounding of their coordinates, so
    /// that no line passes both. `false` if undecided.
    fn lie_side_by_side(&self, a: &DirectedPortal, b: &DirectedPortal) -> bool {
        // Maximum distance of such portals off each other's planes. Coordinates rounded by half a millionth
        // of a unit tilt the plane of a portal, and the tilt grows with distance.
        let near = 512.0 * self.margins.clearance;
        if a.plane.signed_distance(b.center) > near || b.plane.signed_distance(a.center) < -near {
            return false;
        }
        // The edges end at the input vertices, in their order.
        let [first, second] =
            [a, b].map(|portal| self.pluecker_opening(portal).edges.iter().map(|edge| edge.b));
        let larger = if a.radius > b.radius { a } else { b };
        coplanar_portals::lie_side_by_side(first, second, larger.plane.normal, self.margins.clearance)
    }

    /// Tests whether some shrunk vertex of `portal` is more than [`Margins::side`] in front of `plane`, on
    /// the side that its normal points to. `false` if no vertex is.
    fn reaches(&self, portal: &DirectedPortal, plane: &Plane) -> bool {
        let (side, middle) = (self.margins.side, plane.signed_distance(portal.center));
        // The ball decides most cases: at least one vertex is as far inside as the mean of the vertices.
        if middle > side {
            return true;
        }
        middle + portal.radius > side
            && self.vertices_of(portal).iter().any(|&v| plane.signed_distance(v) > side)
    }
}

/// Returns the part of a convex world-space polygon that is farther than [`Margins::inset`] from the
/// polygon's edges, in order around `normal`. Empty if nothing is left. The vertices of the input run
/// counter-clockwise around the unit vector `normal`.
fn shrunk_polygon(vertices: &[DVec3], normal: DVec3, margins: &Margins) -> Vec<DVec3> {
    let mut polygon = vertices.to_vec();
    let mut next = Vec::new();
    for (i, &a) in vertices.iter().enumerate() {
        let b = vertices[(i + 1) % vertices.len()];
        // The direction of so short an edge is dominated by rounding. Its neighbours bound the polygon there.
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

/// Returns centre and radius of a ball that contains all `points` (world space), enlarged to cover rounding.
/// `points` must not be empty.
fn bounding_ball(points: &[DVec3]) -> (DVec3, f64) {
    let center = points.iter().fold(DVec3::ZERO, |sum, &p| sum + p) / points.len() as f64;
    let radius = points.iter().fold(0.0, |r: f64, &p| r.max((p - center).length()));
    (center, radius * (1.0 + 1e-12) + center.abs().max_element() * NOISE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::cells::CellId;
    use visibility_core::geometry::ConvexPolygon;
    use visibility_testing::Random;

    /// Returns the portals of a graph whose portal `i` leads from cell `i` to cell `i + 1`.
    fn in_a_row(polygons: &[&[DVec3]], clearance: f64) -> DirectedPortals {
        let portals = (0..).zip(polygons).map(|(i, polygon)| {
            (ConvexPolygon::new(polygon.iter().copied()).unwrap(), [CellId(i), CellId(i + 1)])
        });
        let graph = CellGraph::new(polygons.len() + 1, portals).unwrap();
        let extent = DirectedPortals::extent(&graph);
        DirectedPortals::new(&graph, clearance, extent)
    }

    fn window(x: [f64; 2], z: f64) -> [DVec3; 4] {
        [[x[0], 0.0], [x[1], 0.0], [x[1], 2.0], [x[0], 2.0]].map(|[x, y]| DVec3::new(x, y, z))
    }

    #[test]
    fn portals_are_shrunk_by_two_fifths_of_the_clearance() {
        let square = window([3.0, 5.0], 1.0);
        let portals = in_a_row(&[&square[..], &square[..3]], 1e-2);
        assert_eq!(portals.all.len(), 4, "a square and a triangle, both ways");
        for portal in &portals.all {
            let vertices = portals.vertices_of(portal);
            let (edges, inset) = (portals.pluecker_opening(portal).edges, 0.4e-2);
            // The edges of the square, or those of the triangle.
            assert_eq!(vertices.len(), edges.len(), "{vertices:?}");
            for edge in edges {
                let inward = if portal.against { -portal.plane.normal } else { portal.plane.normal };
                let inward = inward.cross(edge.b - edge.a).normalize();
                let least = vertices.iter().map(|&v| inward.dot(v - edge.a)).fold(f64::INFINITY, f64::min);
                assert!((least - inset).abs() < 1e-12, "{least} within an edge of {vertices:?}");
                assert!((edge.shift - inward * inset).length() < 1e-12, "{edge:?}");
            }
            let all = vertices.iter().all(|&v| v.distance(portal.center) <= portal.radius);
            assert!(all, "the ball around {vertices:?}: {} of {}", portal.radius, portal.center);
            assert_eq!(portals.all[portal.reverse as usize].to, portal.from, "the other direction");
        }
        // Vertices nearer than may be merged make no edge, and a portal narrower than 4/5 of the clearance
        // vanishes.
        let merge = portals.margins.merge;
        let near = [square[0], square[1], square[1] + DVec3::Y * merge * 0.5, square[2], square[3]];
        assert_eq!(in_a_row(&[&near], 1e-2).vertices.len(), 8, "a square with a short edge, both ways");
        let count = |width: f64| in_a_row(&[&window([3.0, 3.0 + width], 1.0)], 1e-2).all.len();
        assert_eq!((count(0.009), count(0.007)), (2, 0), "portals 9 mm and 7 mm wide");
    }

    #[test]
    fn balls_hold_their_points() {
        let mut random = Random(1);
        for i in 0..10_000 {
            let far = random.fine_vector(10f64.powi(i % 9));
            let points: Vec<DVec3> = (0..3 + i % 5).map(|_| far + random.fine_vector(1.0)).collect();
            let (center, radius) = bounding_ball(&points);
            let most = points.iter().map(|p| p.distance(center)).fold(0.0, f64::max);
            assert!(most <= radius && radius < most + 1e-6 && radius > 0.0, "{radius} of {most}: {points:?}");
        }
    }

    #[test]
    fn margins_exceed_the_rounding_and_grow_with_the_clearance() {
        for (extent, clearance) in [(1.0, 1e-3), (1000.0, 1e-6), (1e9, 0.2)] {
            let margins = Margins::new(clearance, extent);
            assert!(margins.keep >= 12.0 * margins.noise, "{margins:?}");
            assert!(margins.keep >= 0.9999e-4 * clearance, "{margins:?}");
            assert_eq!(margins.clearance, clearance, "{margins:?}");
            // Vertices that are merged stay within the part of the clearance that is left.
            assert!(margins.merge + margins.keep < 0.1 * clearance, "{margins:?}");
        }
    }

    #[test]
    fn portals_follow_each_other_where_a_line_may_pass_both() {
        let at = |x: [f64; 2], z: f64| window(x, z);
        let first = at([0.0, 2.0], 0.0);
        let follows = |second: &[DVec3]| {
            let portals = in_a_row(&[&first, second], 1e-4);
            let [a, b] = [0, 1].map(|cell| {
                portals.all.iter().find(|portal| portal.from == cell && portal.to == cell + 1).unwrap()
            });
            (portals.can_follow(a, b), portals.can_follow(b, a))
        };
        assert_eq!(follows(&at([0.0, 2.0], 3.0)), (true, false), "a window behind another");
        assert_eq!(follows(&at([0.0, 2.0], -3.0)), (false, true), "a window before another");
        assert_eq!(follows(&at([4.0, 6.0], 0.0)), (false, false), "windows in one plane");
        // Across each other's planes by 1/4 of the clearance, side by side and one behind the other.
        let tilted = |x: f64| {
            [[x, 0.0], [x + 2.0, 0.0], [x + 2.0, 2.0], [x, 2.0]]
                .map(|[x, y]| DVec3::new(x, y, (y - 1.0) * 2.5e-5))
        };
        assert_eq!(follows(&tilted(4.0)), (false, false), "windows side by side that are rounded");
        assert!(follows(&tilted(1.0)).0, "windows of which a part is behind each other");
        // 4 clearances off a plane, lines pass from one to the other.
        let steeper = tilted(4.0).map(|v| DVec3::new(v.x, v.y, v.z * 16.0));
        assert!(follows(&steeper).0, "windows that tilt");
        // A window across the plane of the first, and one that faces it from behind its plane.
        let across = [[1.0, 0.0, -1.0], [1.0, 2.0, -1.0], [1.0, 2.0, 3.0], [1.0, 0.0, 3.0]].map(DVec3::from);
        assert_eq!(follows(&across), (true, true), "a window across the plane of another");
        let beside = across.map(|v| v + DVec3::X * 5.0);
        let turned = [beside[3], beside[2], beside[1], beside[0]];
        assert_eq!(follows(&beside), (true, false), "a window whose plane has the other behind it");
        assert_eq!(follows(&turned), (false, true), "a window whose plane has the other before it");
    }
}
