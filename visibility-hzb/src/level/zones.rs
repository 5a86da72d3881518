//! Zones of the picture in which edges appear from a ball of eyes, for the polygons of a level.
//!
//! # The rule
//! A polygon's surface goes on beyond an edge if the edge's other polygon faces the eye too and lies on the
//! other side of the edge in the picture. Other edges end the surface, and so do cuts at the near plane. A
//! pixel of a polygon stays uncovered if an edge that ends its surface appears there, from an eye of the
//! ball. Edges of neighbours count as well: a narrow polygon beyond a shared edge ends soon after it.
//!
//! # Why it is sound
//! As in [`parallax`](crate::raster::parallax), with the point of the surface that hides the moving end. That
//! point begins in the polygon and goes on into the neighbour where it crosses a shared edge, until it meets
//! an edge that ends the surface. Each edge that it crosses appears, from some eye of the ball, where the
//! hidden point does. So the search for ends goes on beyond a shared edge only if the zone of that edge meets
//! the polygon. Neighbours are surfaces of the level whether or not they are drawn.

use super::draw::{eye_side, far_side};
use super::frame::LevelFrame;
use super::prepared::{NO_EDGE, PreparedLevel};
use crate::raster::parallax::{EdgeZone, Parallax};
use crate::setup::near_clip::{NEAR, cut_edge};
use alloc::sync::Arc;
use alloc::vec::Vec;
use visibility_occluders::OccluderPolygon;

/// Greatest number of polygons that are searched for one. A polygon with more of them in reach is not drawn.
const MAX_POLYGONS: usize = 512;

/// Index of the depth `w` among the five values of a corner.
const W: usize = 2;

/// Memory of the search, kept from frame to frame.
#[derive(Clone, Debug, Default)]
pub(super) struct ZoneScratch {
    /// For each level, one byte for each of its polygons: [`UNKNOWN`], or a side.
    sides: Vec<Vec<i8>>,
    /// Polygons that the search has come to, by index. Those from `next` on are still to be looked at.
    found: Vec<u32>,
    /// Points at which edges of a polygon are cut.
    cuts: Vec<[f64; 5]>,
}

/// Value of a polygon whose side is not known yet.
const UNKNOWN: i8 = 2;

impl ZoneScratch {
    /// Forgets which polygons face the eye.
    pub(super) fn begin_frame(&mut self, levels: &[Arc<PreparedLevel>], frames: &[Option<LevelFrame>]) {
        if !frames.iter().flatten().any(|frame| frame.parallax.is_some()) {
            return;
        }
        self.sides.resize_with(self.sides.len().max(levels.len()), Vec::new);
        for ((sides, level), frame) in self.sides.iter_mut().zip(levels).zip(frames) {
            sides.clear();
            if frame.is_some() {
                sides.resize(level.level.polygons().len(), UNKNOWN);
            }
        }
    }

    /// Appends to `zones` those of all edges that end the surface of a polygon and that may appear in the
    /// polygon's bounds (least column and row, greatest column and row). `place` holds the index of the level
    /// and that of the polygon. Returns false if the polygon must not be drawn.
    pub(super) fn collect(
        &mut self,
        level: &PreparedLevel,
        frame: &LevelFrame,
        parallax: &Parallax,
        place: (usize, usize),
        bounds: [f32; 4],
        zones: &mut Vec<EdgeZone>,
    ) -> bool {
        let Self { sides, found, cuts } = self;
        let Some(sides) = sides.get_mut(place.0) else { return false };
        let [left, above, right, below] = bounds.map(f64::from);
        let ([width, height], slack) = (frame.projection.size, 4.0 * f64::from(frame.slack) + 2.0);
        let (left, right) = (left.max(0.0) - slack, right.min(width) + slack);
        let (above, below) = (above.max(0.0) - slack, below.min(height) + slack);
        let meets = |zone: &EdgeZone| {
            let [from, to, top, bottom] = zone.bounds();
            !(to < left || from > right || bottom < above || top > below)
        };
        let (polygons, edges) = (level.level.polygons(), level.level.edges());
        let mut side_of = |index: usize| {
            let (Some(side), Some(polygon)) = (sides.get_mut(index), polygons.get(index)) else { return 0 };
            if *side == UNKNOWN {
                *side = side_to_eye(frame, polygon);
            }
            *side
        };
        found.clear();
        found.push(place.1 as u32);
        let mut next = 0;
        while let Some(&index) = found.get(next) {
            next += 1;
            let own_side = side_of(index as usize);
            let Some(polygon) = polygons.get(index as usize) else { return false };
            cuts.clear();
            for edge in polygon.edges[0]..polygon.edges[1] {
                let (Some(ends), Some(prepared)) = (edges.get(edge as usize), level.edges.get(edge as usize))
                else {
                    return false;
                };
                let corner = |end: usize| {
                    let vertex = level.level.vertices().get(ends[end] as usize)?;
                    Some(frame.object.at(vertex.as_dvec3().to_array()))
                };
                let (Some(mut a), Some(mut b)) = (corner(0), corner(1)) else { return false };
                if !cut(&mut a, &mut b, frame, cuts) {
                    continue;
                }
                let zone = parallax.zone(&a, &b);
                if !meets(&zone) {
                    continue;
                }
                let partner = prepared.partner;
                let other = polygons.partition_point(|polygon| polygon.edges[1] <= partner);
                let goes_on = partner != NO_EDGE && {
                    let other_side = side_of(other);
                    let start = |edge: u32| {
                        let vertex = edges.get(edge as usize).map(|ends| ends[0] as usize);
                        vertex.and_then(|vertex| level.level.vertices().get(vertex))
                    };
                    // A polygon lies to the left of its edges if its front is seen.
                    let same_direction = start(edge) == start(partner);
                    let other_left = (other_side > 0) == same_direction;
                    own_side != 0 && other_side != 0 && (own_side > 0) != other_left
                };
                if !goes_on {
                    zones.push(zone);
                } else if !found.contains(&(other as u32)) {
                    if found.len() >= MAX_POLYGONS {
                        return false;
                    }
                    found.push(other as u32);
                }
            }
            // All cuts of one plane lie on one line, so the zones from the first cut to all others contain
            // those between any two.
            if let Some((first, others)) = cuts.split_first() {
                zones.extend(
                    others.iter().map(|other| parallax.zone(first, other)).filter(|zone| meets(zone)),
                );
            }
        }
        true
    }
}

/// Cuts an edge at the distances at which outlines are cut, and appends the cuts to `cuts`. Returns whether
/// any of the edge is left.
fn cut(a: &mut [f64; 5], b: &mut [f64; 5], frame: &LevelFrame, cuts: &mut Vec<[f64; 5]>) -> bool {
    for (of, limit) in [(NEAR, frame.least_near), (W, frame.least_w)] {
        match (a[of] > limit, b[of] > limit) {
            (true, true) => {}
            (false, false) => return false,
            (a_stays, _) => {
                let point = cut_edge(a, b, of, limit);
                cuts.push(point);
                *(if a_stays { &mut *b } else { &mut *a }) = point;
            }
        }
    }
    true
}

/// Returns 1 if a polygon hides what is behind it from the eye with its front, -1 with its back, and 0 if it
/// may not hide anything.
fn side_to_eye(frame: &LevelFrame, polygon: &OccluderPolygon) -> i8 {
    match far_side(frame, polygon) {
        Some(far) if eye_side(frame, polygon.normal, far) > 0.0 => 1,
        Some(_) => -1,
        None => 0,
    }
}
