//! A line that proves what a flood found.

use super::{Known, Scratch};
use crate::portals::Directed;
use core::ops::Range;
use visibility_core::glam::DVec3;

impl Scratch {
    /// Whether the line from the middle of the source's part to the middle of the target's passes through all portals between, which
    /// proves that the cells at both ends see each other.
    pub(crate) fn witness(
        &self,
        known: &Known,
        target: u32,
        source: &Range<usize>,
        pass: &Range<usize>,
    ) -> bool {
        let [a, b] = [source, pass].map(|place| {
            let points = &self.points[place.clone()];
            points.iter().fold(DVec3::ZERO, |sum, &p| sum + p) / points.len() as f64
        });
        let chain = self.frames.iter().map(|frame| frame.portal).chain([target]);
        chain.into_iter().all(|portal| passes(known, &known.portals.all[portal as usize], a, b))
    }
}

/// Whether the line through two points passes through a portal, along its normal. No rounding says so wrongly by more than the portal
/// was drawn in.
fn passes(known: &Known, portal: &Directed, a: DVec3, b: DVec3) -> bool {
    let (da, db) = (portal.plane.signed_distance(a), portal.plane.signed_distance(b));
    // Over so short a way, or so nearly along the plane, the point where they meet is not known.
    let is_known = db - da > 1e3 * known.portals.margins.keep;
    if !is_known {
        return false;
    }
    let p = a + (b - a) * (da / (da - db));
    let vertices = known.portals.vertices_of(portal);
    let mut start = vertices[vertices.len() - 1];
    vertices.iter().all(|&end| {
        let edge = end - core::mem::replace(&mut start, end);
        // Inside of the edge, or on it.
        portal.plane.normal.cross(edge).dot(p - (end - edge)) >= -known.portals.margins.keep * edge.length()
    })
}
