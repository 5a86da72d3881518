//! Judge of cell-to-cell visibility by random lines: if a line passes from one cell to another clear of all
//! portal edges, a matrix that hides this pair of cells is wrong.
//!
//! The judge shares only the portals with the code that it judges. A line passes through a polygon if it is
//! on the inner side of each edge, which one triple product per edge decides (the side operator of Pluecker
//! coordinates; Durand's survey, chapter 8, section 3).

use visibility_core::cells::{CellGraph, CellId, PortalId};
use visibility_core::glam::DVec3;
use visibility_portals::CellMatrix;

/// Random number generator: [`visibility_core::random`] with the kinds of draws that maps and lines need. The
/// field is the state; every seed is permitted.
pub struct Random(pub u64);

impl Random {
    /// Draws 64 random bits.
    pub fn bits(&mut self) -> u64 {
        let mut random = visibility_core::random::Random(self.0);
        let bits = random.bits();
        self.0 = random.0;
        bits
    }

    /// Draws a number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * 2f64.powi(-53)
    }

    /// Draws an index below `count`; 0 when `count` is 0.
    pub fn below(&mut self, count: usize) -> usize {
        (self.unit() * count as f64) as usize
    }

    /// Draws a number in [low, high), up to rounding.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Draws a unit vector, uniformly over the sphere.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = DVec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0));
            if v.length_squared() <= 1.0 && v.length_squared() > 1e-4 {
                return v.normalize();
            }
        }
    }
}

/// Counts from testing a cell-to-cell visibility matrix with lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Verdict {
    /// Number of lines that passed through at least one portal.
    pub lines: u64,
    /// Number of pairs of cells on one line, summed over all lines.
    pub pairs: u64,
    /// Number of such pairs that the matrix calls hidden in at least one direction.
    pub false_hidden: u64,
}

/// Tests whether a line passes through a portal in the direction of its normal (`forward`) or against it, at
/// a distance of at least `clearance` plus a bound on rounding from all edges. The line is a point and a unit
/// direction. False for a portal that does not exist.
pub fn goes_through(
    graph: &CellGraph,
    portal: PortalId,
    forward: bool,
    (point, direction): (DVec3, DVec3),
    clearance: f64,
) -> bool {
    let Some(portal) = graph.portal(portal) else { return false };
    let sense = if forward { 1.0 } else { -1.0 };
    if portal.plane().normal.dot(direction) * sense <= 0.0 {
        return false;
    }
    let vertices = portal.polygon().vertices();
    let mut a = vertices[vertices.len() - 1];
    vertices.iter().all(|&b| {
        let (start, edge) = (a, b - a);
        a = b;
        let across = direction.cross(edge);
        let length = across.length();
        // Coinciding vertices bound no edge.
        if edge.length() < 1e-9 {
            return true;
        }
        let error = 1e-15 * ((point - start).length() + 1.0) * edge.length() / length;
        // Signed distance of the line from the edge, positive inside for a polygon that runs
        // counter-clockwise around the direction.
        sense * across.dot(point - start) / length >= clearance + error
    })
}

/// Appends to `cells` the cells that a line passes through from `cell` on, `cell` included. `entry` is the
/// portal through which the line came in. The walk ends in the cell where the line passes through no further
/// portal with `clearance`.
pub fn walk(
    graph: &CellGraph,
    mut cell: CellId,
    mut entry: PortalId,
    line: (DVec3, DVec3),
    clearance: f64,
    cells: &mut Vec<CellId>,
) {
    // A line passes through each portal once, so a longer walk would be an error of the map.
    for _ in 0..graph.portals().len() {
        cells.push(cell);
        let next = graph.portals_of(cell).iter().find(|&&id| {
            id != entry
                && goes_through(graph, id, graph.portals()[id.index()].cells()[0] == cell, line, clearance)
        });
        let Some(&id) = next else { return };
        let ends = graph.portals()[id.index()].cells();
        (cell, entry) = (if ends[0] == cell { ends[1] } else { ends[0] }, id);
    }
}

/// Follows a line through a portal in both directions, checks all pairs of cells on the line, and adds the
/// counts to `verdict`. A line that misses the portal is not counted. `cells` is scratch space.
fn judge(
    graph: &CellGraph,
    matrix: &CellMatrix,
    portal: PortalId,
    line: (DVec3, DVec3),
    clearance: f64,
    cells: &mut Vec<CellId>,
    verdict: &mut Verdict,
) {
    let forward = graph.portals()[portal.index()].plane().normal.dot(line.1) > 0.0;
    if !goes_through(graph, portal, forward, line, clearance) {
        return;
    }
    let [mut behind, mut ahead] = graph.portals()[portal.index()].cells();
    if !forward {
        core::mem::swap(&mut behind, &mut ahead);
    }
    cells.clear();
    walk(graph, ahead, portal, line, clearance, cells);
    walk(graph, behind, portal, (line.0, -line.1), clearance, cells);
    verdict.lines += 1;
    for (i, &a) in cells.iter().enumerate() {
        for &b in &cells[..i] {
            verdict.pairs += 1;
            verdict.false_hidden += u64::from(!(matrix.sees(a, b) && matrix.sees(b, a)));
        }
    }
}

/// Returns a random point in a portal, as a weighted mean of its vertices; often very close to a vertex or an
/// edge.
fn point_in(graph: &CellGraph, portal: PortalId, random: &mut Random) -> DVec3 {
    let vertices = graph.portals()[portal.index()].polygon().vertices();
    // High powers make single weights dominate, so the point is close to a vertex or an edge.
    let power = [1.0, 4.0, 16.0, 40.0][random.below(4)];
    let weights: Vec<f64> = vertices.iter().map(|_| random.unit().powf(power) + 1e-30).collect();
    let sum: f64 = weights.iter().sum();
    vertices.iter().zip(&weights).fold(DVec3::ZERO, |p, (&v, w)| p + v * (w / sum))
}

/// Tests `matrix` with `lines` random lines, each through a random portal. Equal seeds give equal lines.
pub fn random_lines(
    graph: &CellGraph,
    matrix: &CellMatrix,
    lines: u64,
    clearance: f64,
    seed: u64,
) -> Verdict {
    let (mut random, mut verdict, mut cells) = (Random(seed), Verdict::default(), Vec::new());
    for _ in 0..if graph.portals().is_empty() { 0 } else { lines } {
        let portal = PortalId(random.below(graph.portals().len()) as u32);
        let line = (point_in(graph, portal, &mut random), random.direction());
        judge(graph, matrix, portal, line, clearance, &mut cells, &mut verdict);
    }
    verdict
}

/// Tests `matrix` with `lines` lines for each pair of cells that `matrix` hides and `theirs` shows. A line
/// passes through a random point in a portal of one cell and a random point in a portal of the other.
pub fn directed_lines(
    graph: &CellGraph,
    matrix: &CellMatrix,
    theirs: &CellMatrix,
    lines: u64,
    clearance: f64,
    seed: u64,
) -> Verdict {
    let (mut random, mut verdict, mut cells) = (Random(seed), Verdict::default(), Vec::new());
    for a in (0..graph.cell_count() as u32).map(CellId) {
        for b in theirs.seen_from(a).filter(|&b| !matrix.sees(a, b)) {
            let (from, to) = (graph.portals_of(a), graph.portals_of(b));
            for _ in 0..if from.is_empty() || to.is_empty() { 0 } else { lines } {
                let (p, q) = (from[random.below(from.len())], to[random.below(to.len())]);
                let (start, end) = (point_in(graph, p, &mut random), point_in(graph, q, &mut random));
                if let Some(direction) = (end - start).try_normalize() {
                    judge(graph, matrix, p, (start, direction), clearance, &mut cells, &mut verdict);
                }
            }
        }
    }
    verdict
}
