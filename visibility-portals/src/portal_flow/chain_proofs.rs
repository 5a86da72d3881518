//! The tests at the end of a chain of portals: for a line that proves that the last cell is seen, or a
//! certificate that no line passes the chain.

use super::flow_input::FlowInput;
use super::flow_scratch::FlowScratch;
use crate::directed_portals::{DirectedPortal, DirectedPortals};
use core::ops::Range;
use visibility_core::glam::DVec3;

/// Maximum number of certificates that the search from one source portal keeps, to test later chains by them.
const REMEMBERED: usize = 32;

impl FlowScratch {
    /// Returns two world-space points of a line through the chain: the mean of the vertices of a part of the
    /// source portal and that of a part of the last portal, given as ranges of the chain's points. Neither
    /// range may be empty.
    pub(crate) fn middle_line(&self, source: &Range<usize>, pass: &Range<usize>) -> [DVec3; 2] {
        [source, pass].map(|place| {
            let points = &self.chain.points[place.clone()];
            points.iter().fold(DVec3::ZERO, |sum, &p| sum + p) / points.len() as f64
        })
    }

    /// Tests whether the line through the world-space points `a` and `b` passes all portals of the chain and
    /// then directed portal `target`. `true` proves that the cells at both ends of the chain see each other;
    /// `false` proves nothing.
    pub(crate) fn witness(&self, input: &FlowInput, target: u32, [a, b]: [DVec3; 2]) -> bool {
        let chain = self.chain.frames.iter().map(|frame| frame.portal).chain([target]);
        chain.into_iter().all(|portal| passes(input.portals, &input.portals.all[portal as usize], a, b))
    }

    /// Tests whether it is certain that no line passes all portals of the chain and then directed portal
    /// `target`. The world-space points `a` and `b` lie on an approximate line from which the linear program
    /// starts. `false` if undecided, or if the test in Pluecker space is disabled (`input.exact` is `None`).
    pub(crate) fn is_excluded(&mut self, input: &FlowInput, target: u32, [a, b]: [DVec3; 2]) -> bool {
        let (Some(clearance), Some(direction)) = (input.exact, (b - a).try_normalize()) else { return false };
        if self.is_refuted(target) {
            return true;
        }
        let frames = &self.chain.frames;
        let opening = |i: usize| {
            let portal = frames.get(i).map_or(target, |frame| frame.portal);
            input.portals.pluecker_opening(&input.portals.all[portal as usize])
        };
        let line = (a, direction);
        if !self.pluecker.excludes(opening, frames.len() + 1, line, clearance) {
            return false;
        }
        let portal = |&i: &u32| frames.get(i as usize).map_or(target, |frame| frame.portal);
        let refuted = self.pluecker.needed.iter().map(portal).collect();
        if self.refuted.len() < REMEMBERED {
            self.refuted.push(refuted);
        } else {
            self.refuted[self.oldest] = refuted;
        }
        self.oldest = (self.oldest + 1) % REMEMBERED;
        true
    }

    /// Tests whether a certificate of this flow, kept in `refuted`, excludes the chain extended by directed
    /// portal `target`. `false` proves nothing.
    fn is_refuted(&self, target: u32) -> bool {
        let has =
            |portal: u32| portal == target || self.chain.frames.iter().any(|frame| frame.portal == portal);
        self.refuted.iter().any(|refuted| refuted.iter().all(|&portal| has(portal)))
    }
}

/// Least distance between two points, measured along a portal's normal, for which the point where their line
/// crosses the portal's plane is accurate enough to decide. In units of
/// [`keep`](crate::directed_portals::Margins::keep).
///
/// The signed distances of both points from the plane are each wrong by up to
/// [`noise`](crate::directed_portals::Margins::noise), and `keep` is at least 12 times that. The two points
/// are at least 12,000 times `noise` apart, so the fraction of the way at which the line crosses the plane is
/// wrong by less than 2 / 12,000. A wrong crossing may count a hidden cell as seen. It never hides one.
const KNOWN_RISE: f64 = 1e3;

/// Tests whether the infinite line through the world-space points `a` and `b` meets a portal, with the way
/// from `a` to `b` along the portal's normal. For the opposite direction the answer is `false`.
///
/// The vertices of a directed portal are those of the portal of the graph, shrunk by
/// [`inset`](crate::directed_portals::Margins::inset). Because of rounding, `true` is also possible for a
/// line that misses this shrunk polygon by less than `inset`, and so still meets the portal of the graph.
/// `false` if `a` and `b` differ so little along the normal that the intersection is inaccurate; see
/// [`KNOWN_RISE`].
fn passes(portals: &DirectedPortals, portal: &DirectedPortal, a: DVec3, b: DVec3) -> bool {
    let (da, db) = (portal.plane.signed_distance(a), portal.plane.signed_distance(b));
    // For so short a distance along the normal, the intersection with the plane is not accurate.
    let is_known = db - da > KNOWN_RISE * portals.margins.keep;
    if !is_known {
        return false;
    }
    let p = a + (b - a) * (da / (da - db));
    let vertices = portals.vertices_of(portal);
    let mut start = vertices[vertices.len() - 1];
    vertices.iter().all(|&end| {
        let edge = end - core::mem::replace(&mut start, end);
        // The intersection is on the inner side of the edge, or on it.
        portal.plane.normal.cross(edge).dot(p - (end - edge)) >= -portals.margins.keep * edge.length()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integer_vectors::{IntegerVector, Random};
    use visibility_core::cells::{CellGraph, CellId};
    use visibility_core::geometry::ConvexPolygon;

    /// Lines nearly in the plane of a portal. Each crosses the plane at a known point beside the portal. The
    /// computed distances of its ends from the plane are sums of roundings.
    #[test]
    fn a_line_nearly_in_the_plane_of_a_portal_proves_nothing() {
        let mut random = Random(5);
        let normal = IntegerVector([1, 2, 2]);
        let (u, v) = (IntegerVector([2, -2, 1]), IntegerVector([2, 1, -2]));
        for round in 0..200 {
            let center = random.vector(1 << 20);
            let corner = |i: i128, j: i128| center.plus(u.times(2 * i)).plus(v.times(2 * j)).to_f64();
            let polygon = ConvexPolygon::new([corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)]);
            let graph = CellGraph::new(2, [(polygon.unwrap(), [CellId(0), CellId(1)])]).unwrap();
            let portals = DirectedPortals::new(&graph, 1e-3, DirectedPortals::extent(&graph));
            // Exact multiples of 2^-30. The line crosses the plane at `beside`, half way from `a` to `b`.
            let unit = 1i128 << 30;
            let beside = center.plus(u.times(random.below(8).abs() + 3)).times(unit);
            let half = u.times(1024 * unit).plus(normal.times(1 + random.below(20).abs()));
            let at = |p: IntegerVector| p.to_f64() / unit as f64;
            let (a, b) = (at(beside.minus(half)), at(beside.plus(half)));
            for portal in &portals.all {
                assert!(!passes(&portals, portal, a, b), "round {round}: a line beside the portal");
                let through = [-4, 4].map(|by| center.plus(normal.times(by)).to_f64());
                let forth = portal.plane.normal.dot(normal.to_f64()) > 0.0;
                let [a, b] = if forth { through } else { [through[1], through[0]] };
                assert!(passes(&portals, portal, a, b), "round {round}: a line through its middle");
            }
        }
    }
}
