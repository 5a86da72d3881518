//! Surfaces that block all segments from a polygon P to a polygon Q. A surface is a chain of triangles: it
//! grows from one triangle that a segment crosses, over edges that segments meet, until no segment meets an
//! edge of its boundary.
//!
//! Take all segments from a point of P to a point of Q. The number of times that a segment crosses a surface
//! can only change, modulo 2, where a segment meets the surface's boundary or an end of a segment touches the
//! surface. Where neither happens and one segment has an odd number of crossings, all segments are blocked.
//! Shared edges, silhouettes and welded meshes need no extraction: an edge that two triangles of the chain
//! share is not on its boundary.
//!
//! With a clearance c, corners of the boundary move outwards by about c, and by 3 c at most. The surface
//! grows by the strips between the old boundary and the new, all of whose points are within 3 c of the chain.

use crate::chain_scratch::{ChainScratch, KNOWN, MISSED, ODD, Obstacle};
use crate::half::Half;
use crate::line_side::{Crossing, Edge, NO_CORNER, segment_triangle};
use crate::polygon::Polygon;
use crate::proof::Step;
use crate::search::{Search, Segment};
use crate::shaft::Shaft;
use crate::side_signs::{NEGATIVE, POSITIVE, signs};
use crate::sight::Sight;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// Greatest number of triangles of a chain, the surface that is to block all segments of a node.
const MAX_CHAIN: usize = 3000;
/// Greatest number of occluding triangles at one edge that are tried as the next triangle of a chain.
const AT_EDGE: usize = 64;

impl Search<'_> {
    /// Grows a surface from triangle `start` that blocks all segments between the polygons of `sight`, and
    /// returns it as a step of the proof. `line` is one of the segments. `Err` with an edge that is in the
    /// way if no such surface is found.
    pub(crate) fn close(
        &mut self,
        sight: &Sight,
        shaft: &Shaft,
        start: u32,
        line: Segment,
    ) -> Result<Step, Obstacle> {
        let mut scratch = core::mem::take(&mut self.chain);
        let found = self.close_with(&mut scratch, sight, shaft, start, line);
        self.chain = scratch;
        found
    }

    fn close_with(
        &mut self,
        scratch: &mut ChainScratch,
        sight: &Sight,
        shaft: &Shaft,
        start: u32,
        line: Segment,
    ) -> Result<Step, Obstacle> {
        let all = self.triangles;
        if !self.blocks(sight, start) {
            let t = all.corners(start);
            return Err([t[0], t[1]]);
        }
        // The surface grows from `start` across every edge that lines of sight may meet, until no line of
        // sight meets its boundary.
        scratch.begin();
        scratch.push(start, all.edges(start));
        let mut at = 0;
        while let Some(&t) = scratch.chain.get(at) {
            at += 1;
            let corners = all.corners(t);
            if shaft.misses(&corners) {
                // No segment meets an edge of this triangle.
                for edge in all.edges(t) {
                    scratch.set_state(edge, scratch.state(edge) | KNOWN | MISSED);
                }
                continue;
            }
            // A triangle that may touch polygon P or Q does not separate them.
            let tags = self.tags(t);
            if !self.apart(&corners, tags, sight) {
                return Err([corners[0], corners[1]]);
            }
            for k in 0..3 {
                let edge = all.edges(t)[k];
                let state = scratch.state(edge);
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                if state & ODD == 0 || self.misses(scratch, edge, &edge_of(&corners, &tags, k), sight, shaft)
                {
                    continue;
                }
                // An edge without a next triangle stays open here. Below, the clearance may move it out of
                // the way.
                if let Some(next) = self.next_across(scratch, sight, t, k, line) {
                    scratch.push(next, all.edges(next));
                    if scratch.chain.len() > MAX_CHAIN {
                        return Err([a, b]);
                    }
                } else if self.is_hopeless(&corners, k, sight) {
                    return Err([a, b]);
                }
            }
        }
        self.find_open(scratch, sight, shaft);
        if !scratch.open.is_empty() {
            self.move_boundary(scratch, sight, shaft)?;
        }
        // If no line meets the boundary, either all lines are blocked or none is. One line decides: it must
        // cross the surface an odd number of times.
        if !self.crosses_oddly(scratch, line) {
            let t = all.corners(start);
            return Err([t[0], t[1]]);
        }
        Ok(Step::Surface {
            triangles: scratch.chain.as_slice().into(),
            moved: scratch.moved.as_slice().into(),
            line: [line.p, line.q],
        })
    }

    /// Returns, for each corner of triangle `t`, which corner of the target triangle it is (0, 1 or 2), or
    /// [`NO_CORNER`](crate::line_side::NO_CORNER).
    pub(crate) fn tags(&self, t: u32) -> [u8; 3] {
        self.triangles.vertices(t).map(|vertex| self.tag(vertex))
    }

    /// Returns which corner of the target triangle a vertex is (0, 1 or 2), or [`NO_CORNER`].
    pub(crate) fn tag(&self, vertex: u32) -> u8 {
        self.target_vertices.iter().position(|&v| v == vertex).map_or(NO_CORNER, |k| k as u8)
    }

    /// Returns whether no segment of `sight` meets the edge with index `number`, and caches the answer in
    /// `scratch`.
    fn misses(
        &self,
        scratch: &mut ChainScratch,
        number: u32,
        edge: &Edge,
        sight: &Sight,
        shaft: &Shaft,
    ) -> bool {
        let state = scratch.state(number);
        if state & KNOWN != 0 {
            return state & MISSED != 0;
        }
        let missed = self.edge_misses(edge, sight, shaft);
        scratch.set_state(number, state | KNOWN | if missed { MISSED } else { 0 });
        missed
    }

    /// Returns whether certainly no segment from a point inside the viewcell polygon P to a point inside the
    /// target polygon Q meets an edge.
    pub(crate) fn edge_misses(&self, edge: &Edge, sight: &Sight, shaft: &Shaft) -> bool {
        if shaft.misses(&edge.ends) {
            return true;
        }
        // Segments do not meet edges behind the target polygon Q, except at corners of the target triangle,
        // which are on Q's boundary. By the error of heights, the viewcell polygon P may have points behind
        // Q's plane, from which segments do meet the edge. The line between the centres of P and Q shows that
        // other segments exist.
        let behind = |k: usize| edge.tags[k] < 3 || sight.before_q.height(edge.ends[k]) < -shaft.pad;
        let from_before = || sight.before_q.height(sight.p.center()) > 2.0 * shaft.pad;
        if (edge.tags[0] < 3 || edge.tags[1] < 3) && behind(0) && behind(1) && from_before() {
            return true;
        }
        // An edge in one plane with the viewcell and target polygons, whose sides are all exactly 0, counts
        // as met. The check of proofs refuses it too.
        matches!(signs(sight, edge, sight.side_error(self.delta)), POSITIVE | NEGATIVE)
    }

    /// Returns whether an occluding triangle with the corners `corners` certainly touches neither the
    /// viewcell polygon P nor the target polygon Q. `tags` tell which of its corners are corners of the
    /// target triangle, which contains Q (0, 1 or 2; [`NO_CORNER`] for none). At such a corner the occluding
    /// triangle may touch the boundary of Q.
    pub(crate) fn apart(&self, corners: &[DVec3; 3], tags: [u8; 3], sight: &Sight) -> bool {
        let pad = self.pad();
        apart(corners, &sight.p, &sight.before_p, pad)
            && (touches_from_one_side(corners, tags, &sight.before_q, pad)
                || apart(corners, &sight.q, &sight.before_q, pad))
    }

    /// Returns the triangle that continues the surface across edge `k` of triangle `t`. Candidates occlude
    /// for all points of the viewcell polygon and continue the surface as seen along `line`; the one that
    /// folds back least is taken. `None` without a candidate.
    fn next_across(
        &mut self,
        scratch: &ChainScratch,
        sight: &Sight,
        t: u32,
        k: usize,
        line: Segment,
    ) -> Option<u32> {
        let all = self.triangles;
        let corners = all.corners(t);
        let (a, b, apex) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
        let across = (b - a).cross(line.q - line.p);
        let here = across.dot(apex - a);
        let normal = (b - a).cross(apex - a).normalize_or_zero();
        let mut best: Option<(f64, u32)> = None;
        // With more triangles at one edge, only the first `AT_EDGE` are tried.
        for &next in all.triangles_at(all.edges(t)[k]).iter().take(AT_EDGE) {
            if scratch.holds(next) || next == self.skip {
                continue;
            }
            let Some(m) = (0..3).find(|&m| all.edges(next)[m] == all.edges(t)[k]) else { continue };
            let other = all.corners(next)[(m + 2) % 3];
            if across.dot(other - a) * here < 0.0 {
                let flatness = normal.dot((other - a).cross(b - a).normalize_or_zero());
                if best.is_none_or(|(most, _)| flatness > most) && self.blocks(sight, next) {
                    best = Some((flatness, next));
                }
            }
        }
        best.map(|(_, next)| next)
    }

    /// Returns whether segments may still meet edge `k` of a triangle after the edge has moved outwards by
    /// the clearance.
    fn is_hopeless(&self, corners: &[DVec3; 3], k: usize, sight: &Sight) -> bool {
        let (a, b, apex) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
        let out = outwards(a, b, apex) * self.clearance;
        self.clearance == 0.0
            || !matches!(
                signs(sight, &Edge::new(a + out, b + out), sight.side_error(self.delta)),
                POSITIVE | NEGATIVE
            )
    }

    /// Collects in `scratch.open` the edges of the chain's boundary that segments may meet.
    fn find_open(&self, scratch: &mut ChainScratch, sight: &Sight, shaft: &Shaft) {
        for at in 0..scratch.chain.len() {
            let t = scratch.chain[at];
            let (corners, tags) = (self.triangles.corners(t), self.tags(t));
            for k in 0..3 {
                let number = self.triangles.edges(t)[k];
                if scratch.state(number) & ODD != 0
                    && !self.misses(scratch, number, &edge_of(&corners, &tags, k), sight, shaft)
                {
                    scratch.open.push((t, k));
                }
            }
        }
    }

    /// Moves the corners of open edges outwards by the clearance, and tests the moved boundary. `Err` with an
    /// edge that segments may still meet.
    fn move_boundary(
        &self,
        scratch: &mut ChainScratch,
        sight: &Sight,
        shaft: &Shaft,
    ) -> Result<(), Obstacle> {
        let all = self.triangles;
        let mut vertices: Vec<u32> = scratch
            .open
            .iter()
            .flat_map(|&(t, k)| [all.vertices(t)[k], all.vertices(t)[(k + 1) % 3]])
            .collect();
        vertices.sort_unstable();
        vertices.dedup();
        // For each vertex: its position, the sum of the outward unit vectors of its boundary edges, and their
        // count.
        let mut sums: Vec<(DVec3, DVec3, u32)> = alloc::vec![(DVec3::ZERO, DVec3::ZERO, 0); vertices.len()];
        // First, the outward direction at each corner of an open edge: the mitre of the boundary edges that
        // meet there.
        let boundary = |scratch: &ChainScratch, t: u32, k: usize| scratch.state(all.edges(t)[k]) & ODD != 0;
        for &t in &scratch.chain {
            for k in (0..3).filter(|&k| boundary(scratch, t, k)) {
                let (corners, numbers) = (all.corners(t), all.vertices(t));
                let out = outwards(corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
                for end in [k, (k + 1) % 3] {
                    if let Ok(at) = vertices.binary_search(&numbers[end]) {
                        let (position, sum, count) = &mut sums[at];
                        (*position, *sum, *count) = (corners[end], *sum + out, *count + 1);
                    }
                }
            }
        }
        for (&vertex, &(position, sum, count)) in vertices.iter().zip(&sums) {
            let shift = mitre(sum, count, self.clearance);
            // Without a clearance no corner may move. The first open edge is then returned as the obstacle.
            // With one, lines end before the target, and corners of the target may move as any other.
            if self.clearance == 0.0 {
                let (t, k) = scratch.open[0];
                let corners = all.corners(t);
                return Err([corners[k], corners[(k + 1) % 3]]);
            }
            scratch.moved.push((vertex, position + shift));
        }
        // Second, the boundary with its corners moved. The strip between an old edge and the new edge counts
        // as a part of the surface, so it must be apart from the viewcell and target polygons as well.
        let pad = self.pad();
        for &t in &scratch.chain {
            for k in (0..3).filter(|&k| boundary(scratch, t, k)) {
                let (corners, numbers) = (all.corners(t), all.vertices(t));
                let ends = [k, (k + 1) % 3];
                let [a, b] = ends.map(|end| moved_to(&scratch.moved, numbers[end], corners[end]));
                let [old_a, old_b] = ends.map(|end| corners[end]);
                if a == old_a && b == old_b {
                    // The mitres at both ends of an open edge may be nothing: the edge is the long side of a
                    // sliver.
                    if scratch.state(all.edges(t)[k]) & MISSED == 0 {
                        return Err([a, b]);
                    }
                    continue;
                }
                let strip = [old_a, old_b, b, a];
                let is_apart = shaft.misses(&strip)
                    || (apart(&strip, &sight.p, &sight.before_p, pad)
                        && apart(&strip, &sight.q, &sight.before_q, pad));
                if !is_apart || !self.edge_misses(&Edge::new(a, b), sight, shaft) {
                    return Err([a, b]);
                }
            }
        }
        Ok(())
    }

    /// Returns whether the line certainly crosses the surface an odd number of times. The surface consists of
    /// the triangles of the chain and of the [`strip`] between each boundary edge and its moved copy.
    fn crosses_oddly(&self, scratch: &ChainScratch, line: Segment) -> bool {
        let all = self.triangles;
        let mut odd = false;
        let mut count = |t: &[DVec3; 3]| match segment_triangle(line.p, line.q, t) {
            Crossing::Yes => {
                odd = !odd;
                true
            }
            Crossing::No => true,
            Crossing::Unsure => false,
        };
        for &t in &scratch.chain {
            let (corners, numbers) = (all.corners(t), all.vertices(t));
            if !count(&corners) {
                return false;
            }
            if scratch.moved.is_empty() {
                continue;
            }
            for k in (0..3).filter(|&k| scratch.state(all.edges(t)[k]) & ODD != 0) {
                let [a, b] = [k, (k + 1) % 3].map(|end| (numbers[end], corners[end]));
                for triangle in strip(a, b, &scratch.moved) {
                    if !count(&triangle) {
                        return false;
                    }
                }
            }
        }
        odd
    }
}

fn edge_of(corners: &[DVec3; 3], tags: &[u8; 3], k: usize) -> Edge {
    let j = (k + 1) % 3;
    Edge { ends: [corners[k], corners[j]], tags: [tags[k], tags[j]] }
}

/// Returns the unit vector in a triangle's plane that is perpendicular to its edge from `a` to `b` and points
/// away from its third corner `apex`.
fn outwards(a: DVec3, b: DVec3, apex: DVec3) -> DVec3 {
    let along = (b - a).normalize_or_zero();
    let inwards = (apex - a) - along * along.dot(apex - a);
    -inwards.normalize_or_zero()
}

/// Returns the vector by which a corner moves so that its boundary edges move outwards by `c`. It is at most
/// 2.5 c long, so edges at sharp corners move less than `c`. `sum` is the sum of the outward unit vectors of
/// the corner's `count` edges.
pub(crate) fn mitre(sum: DVec3, count: u32, c: f64) -> DVec3 {
    // For two unit vectors o1 and o2 the mitre is c (o1 + o2) / (1 + o1 . o2), and 1 + o1 . o2 = |o1 + o2|^2
    // / 2.
    let length = sum.length();
    if length < 1e-3 {
        return DVec3::ZERO;
    }
    sum / length * (f64::from(count) / length).min(2.5) * c
}

fn moved_to(moved: &[(u32, DVec3)], vertex: u32, position: DVec3) -> DVec3 {
    moved.binary_search_by_key(&vertex, |entry| entry.0).map_or(position, |at| moved[at].1)
}

/// Returns the two triangles between an edge and the moved edge. A triangle without area, at an end that did
/// not move, is left out.
fn strip(a: (u32, DVec3), b: (u32, DVec3), moved: &[(u32, DVec3)]) -> impl Iterator<Item = [DVec3; 3]> {
    let (a2, b2) = (moved_to(moved, a.0, a.1), moved_to(moved, b.0, b.1));
    // Both triangles of a strip share the diagonal from the end with the lower number, so that the strip is
    // the same for either direction of the edge.
    let (first, second) =
        if a.0 < b.0 { ([a.1, b.1, b2], [a.1, b2, a2]) } else { ([b.1, a.1, a2], [b.1, a2, b2]) };
    [first, second].into_iter().filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
}

/// Returns whether a triangle that has one or two corners of the target triangle certainly touches no point
/// inside the target polygon: its remaining corners are all more than `pad` metres in front of the polygon's
/// `plane`, or all more than `pad` metres behind it. False for a triangle with no or with three corners of
/// the target triangle.
fn touches_from_one_side(corners: &[DVec3; 3], tags: [u8; 3], plane: &Half, pad: f64) -> bool {
    let others = || (0..3).filter(|&k| tags[k] == NO_CORNER).map(|k| plane.height(corners[k]));
    (1..3).contains(&others().count()) && (others().all(|h| h > pad) || others().all(|h| h < -pad))
}

/// Returns whether a plane certainly separates some points from a polygon, by more than `pad` metres. The
/// planes tried are the polygon's own plane, the planes perpendicular to it along the polygon's sides, the
/// plane of the first three points, and the planes that are parallel to a side of the polygon and to the line
/// from one point to the next.
pub(crate) fn apart(points: &[DVec3], polygon: &Polygon, plane: &Half, pad: f64) -> bool {
    let separates = |normal: DVec3| {
        let range = |points: &[DVec3]| {
            points.iter().map(|x| normal.dot(*x)).fold((f64::MAX, f64::MIN), |(a, b), h| (a.min(h), b.max(h)))
        };
        let ((a, b), (c, d)) = (range(points), range(polygon.corners()));
        a > d + pad || b < c - pad
    };
    let n = points.len();
    let side = |k: usize| points[(k + 1) % n] - points[k];
    let own = side(0).cross(side(1)).normalize_or_zero();
    if separates(plane.normal) || separates(own) {
        return true;
    }
    let corners = polygon.corners();
    (0..corners.len()).any(|i| {
        let along = corners[(i + 1) % corners.len()] - corners[i];
        separates(plane.normal.cross(along).normalize_or_zero())
            || (0..n).any(|k| separates(along.cross(side(k)).normalize_or_zero()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::{Answer, Budget, NONE};
    use crate::sight::{CellBox, Target};
    use crate::triangles::SceneTriangles;
    use visibility_core::glam::Vec3;
    use visibility_core::{Aabb, Object, Scene};

    /// A triangle that has a corner of the target is beside the target if its other corners are all on one
    /// side of the target's plane, farther than the error.
    #[test]
    fn triangles_at_a_corner_of_the_target_are_beside_it_if_they_are_on_one_side() {
        let plane = Half { normal: DVec3::Z, offset: 0.0 };
        for (tags, heights, is_beside) in [
            ([0, 3, 3], [0.0, 0.2, 0.3], true),
            ([3, 1, 3], [-0.2, 0.0, -0.3], true),
            ([0, 2, 3], [0.0, 0.0, -0.3], true),
            ([0, 3, 3], [0.0, 0.2, -0.3], false),
            ([0, 3, 3], [0.0, 0.125, 0.3], false),
            ([0, 3, 3], [0.0, -0.125, -0.3], false),
            ([0, 1, 3], [0.0, 0.0, 0.0], false),
            ([3, 3, 3], [0.2, 0.2, 0.3], false),
            ([3, 3, 3], [-0.2, -0.2, -0.3], false),
            ([0, 1, 2], [0.0, 0.0, 0.0], false),
        ] {
            let corners = [0, 1, 2].map(|k| DVec3::new(k as f64, (k * k) as f64, heights[k]));
            let found = touches_from_one_side(&corners, tags, &plane, 0.125);
            assert_eq!(found, is_beside, "corners {tags:?} at heights {heights:?}");
        }
    }

    /// Edges at a corner moved by a mitre move outwards by the clearance, unless the corner is sharp.
    #[test]
    fn mitres_move_edges_outwards() {
        for turn in [0.0, 0.5, 1.0, 2.0, 2.2] {
            let [a, b] = [DVec3::X, DVec3::new(f64::cos(turn), f64::sin(turn), 0.0)];
            let shift = mitre(a + b, 2, 0.25);
            let by = [a, b].map(|out| out.dot(shift));
            assert!(by.iter().all(|by| (by - 0.25).abs() < 1e-12), "edges at {turn} move by {by:?}");
        }
        let sharp = mitre(DVec3::X + DVec3::new(-0.999, f64::sqrt(1.0 - 0.999 * 0.999), 0.0), 2, 0.25);
        assert!((sharp.length() - 0.625).abs() < 1e-12, "a sharp corner moves by 2.5 clearances: {sharp}");
        assert_eq!(mitre(DVec3::X * 1e-4, 2, 0.25), DVec3::ZERO, "a corner of opposite directions");
        assert!(mitre(DVec3::X * 1e-3, 2, 0.25) != DVec3::ZERO, "a corner of almost opposite directions");
    }

    /// An edge from a corner of the target to a point behind its plane is met by no line to the target, in
    /// either direction; if it leads to the front, or if lines start in the plane, lines may meet it.
    #[test]
    fn edges_behind_the_target_are_missed_from_the_front() {
        let t = [[0.0, 0.0], [0.0, 4.0], [4.0, 0.0]].map(|[y, z]| Vec3::new(30.0, y, z));
        let mut scene = Scene::new();
        let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points(t)) });
        scene.set_triangles(id, [t]).unwrap();
        let triangles = SceneTriangles::new(&scene);
        let cell = CellBox { min: DVec3::ZERO, max: DVec3::ONE };
        let mut search = Search::new(&triangles, cell, 0.0, None);
        let budget = Budget { nodes: 0, divided: 0, halvings: 0 };
        assert!(search.begin(Target::Triangle(0), budget), "the search begins");
        assert_eq!((search.skip, search.tags(0)), (0, [0, 1, 2]), "without clearance, the target is told");
        let square = |x: f64| {
            Polygon::new(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[y, z]| DVec3::new(x, y, z)))
        };
        let sight = |x: f64| Sight {
            p: square(x),
            q: Polygon::target(&triangles.corners(0)),
            before_p: Half { normal: DVec3::X, offset: -1.0 },
            before_q: Half { normal: DVec3::NEG_X, offset: 30.0 },
            near: None,
        };
        let misses = |sight: &Sight, ends: [DVec3; 2], tags: [u8; 2]| {
            let shaft = Shaft::new(&sight.p, &sight.q, search.pad());
            search.edge_misses(&Edge { ends, tags }, sight, &shaft)
        };
        let corner = triangles.corners(0)[0];
        let [behind, before] = [32.0, 16.0].map(|x| DVec3::new(x, 2.0, 1.5));
        for (x, end, is_missed) in [(1.0, behind, true), (1.0, before, false), (30.0, behind, false)] {
            let found = [
                misses(&sight(x), [corner, end], [0, NO_CORNER]),
                misses(&sight(x), [end, corner], [NO_CORNER, 0]),
            ];
            assert_eq!(found, [is_missed; 2], "an edge to {end} from lines that start at {x}");
        }
        assert!(search.begin(Target::Box { min: DVec3::ZERO, max: DVec3::ONE }, budget), "a box");
        assert_eq!((search.skip, search.tags(0)), (NONE, [NO_CORNER; 3]), "a box has no corners to tell");
        let mut search = Search::new(&triangles, cell, 1e-3, None);
        assert!(search.begin(Target::Triangle(0), budget), "the search begins with a clearance");
        assert_eq!((search.skip, search.tags(0)), (NONE, [NO_CORNER; 3]), "with clearance, none is told");
    }

    /// A sliver whose long side z = 0.5 does not move with the clearance, since its angles at both ends are
    /// small, and lines on either side of that side, below the corner that moves. They are not blocked.
    #[test]
    fn long_sides_of_slivers_are_met_though_they_do_not_move() {
        let scene_of = |lower: f32| {
            let t = [[-5.0, lower], [5.0, lower], [0.0, 0.504]].map(|[y, z]| Vec3::new(5.0, y, z));
            let mut scene = Scene::new();
            let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points(t)) });
            scene.set_triangles(id, [t]).unwrap();
            SceneTriangles::new(&scene)
        };
        let cell = CellBox { min: DVec3::ZERO, max: DVec3::ONE };
        let sight = |y: [f64; 2], z: [f64; 2]| {
            let rectangle = |x: f64| {
                let corners = [[y[0], z[0]], [y[1], z[0]], [y[1], z[1]], [y[0], z[1]]];
                Polygon::new(&corners.map(|[y, z]| DVec3::new(x, y, z)))
            };
            Sight {
                p: rectangle(1.0),
                q: rectangle(9.0),
                before_p: Half { normal: DVec3::X, offset: -1.0 },
                before_q: Half { normal: DVec3::NEG_X, offset: 9.0 },
                near: Some(0.0),
            }
        };
        // The second triangle is no sliver: its corners move, but the sharp one hardly moves its sides.
        for (lower, y, z, is_blocked) in [
            (0.5, [0.0, 0.1], [0.496, 0.508], false),
            (0.48, [0.0, 0.1], [0.496, 0.508], true),
            (0.48, [-5.005, -4.9], [0.4751, 0.4851], false),
        ] {
            let sight = sight(y, z);
            let triangles = scene_of(lower);
            let mut search = Search::new(&triangles, cell, 0.01, None);
            let target = Target::Box { min: DVec3::X * 9.0, max: DVec3::ONE + DVec3::X * 9.0 };
            let budget = Budget { nodes: 0, divided: 0, halvings: 0 };
            assert!(search.begin(target, budget), "the search begins");
            let shaft = Shaft::new(&sight.p, &sight.q, search.pad());
            let line = Segment { p: sight.p.center(), q: sight.q.center() };
            let found = search.close(&sight, &shaft, 0, line);
            assert_eq!(found.is_ok(), is_blocked, "a long side at {lower}, lines at {y:?}: {found:?}");
        }
    }

    /// A surface does not grow over a triangle that shows the viewcell its back.
    #[test]
    fn surfaces_do_not_grow_over_backs() {
        let [a, b, c, d] =
            [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]].map(|[y, z]| Vec3::new(5.0, y, z));
        for (other, is_blocked) in [([a, d, c], true), ([a, c, d], false)] {
            let mut scene = Scene::new();
            for (t, one_sided) in [([a, b, c], false), (other, true)] {
                let bounds = Aabb::from_points(t);
                let id = scene.insert(Object { occluder: true, one_sided, ..Object::new(bounds) });
                scene.set_triangles(id, [t]).unwrap();
            }
            let triangles = SceneTriangles::new(&scene);
            let cell = CellBox { min: DVec3::ZERO, max: DVec3::ONE };
            let mut search = Search::new(&triangles, cell, 0.0, None);
            let target = Target::Box { min: DVec3::X * 9.0, max: DVec3::ONE + DVec3::X * 9.0 };
            let (answer, _) = search.solve_target(target, Budget { nodes: 20, divided: 0, halvings: 0 });
            assert_eq!(
                answer == Answer::Hidden,
                is_blocked,
                "a triangle {other:?} beside one with two sides"
            );
            let [p, q] = [1.0, 9.0].map(|x| {
                let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
                Polygon::new(&corners.map(|[y, z]| DVec3::new(x, y, z)))
            });
            let before_p = Half { normal: DVec3::X, offset: -1.0 };
            let before_q = Half { normal: DVec3::NEG_X, offset: 9.0 };
            let sight = Sight { p, q, before_p, before_q, near: None };
            let shaft = Shaft::new(&sight.p, &sight.q, search.pad());
            let line = Segment { p: DVec3::new(1.0, 0.75, 0.25), q: DVec3::new(9.0, 0.75, 0.25) };
            let found = search.close(&sight, &shaft, 0, line);
            assert_eq!(found.is_ok(), is_blocked, "a triangle {other:?}: {found:?}");
        }
    }
}
