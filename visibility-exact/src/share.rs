//! Certified upper bounds on the share of the segments to a target that may be unblocked: its visible share.
//!
//! The segments from P, a face of the viewcell, to Q, a face of the target, are measured by area of P times
//! area of Q. Nodes, pairs of parts of P and Q, are subtracted if a surface blocks them, largest nodes first,
//! until the remaining share is below a bound. A node that is not proven blocked counts as unblocked.

use crate::chain_scratch::Obstacle;
use crate::search::{Budget, Halving, Search, Segment, best_halving};
use crate::shaft::Shaft;
use crate::sight::{Sight, Target, sights};
use alloc::collections::BinaryHeap;
use core::cmp::Ordering;

/// A part of a viewcell face with a part of a target face, between which segments are not proven blocked.
/// Nodes are ordered by their share of all segments to the target.
struct Node {
    /// Share of all segments from the viewcell to the target that are in the node, from 0 to 1, measured by
    /// area at both ends.
    share: f64,
    /// Number that no other node has. It breaks ties between nodes with equal shares.
    number: u32,
    /// The two parts: viewcell polygon and target polygon.
    sight: Sight,
    /// Edge that kept a surface from blocking this node's parent, or its nearest ancestor for which a surface
    /// was grown, and the line from which the surface was grown. `None` if no surface was grown.
    obstacle: Option<(Obstacle, Segment)>,
}

impl Ord for Node {
    fn cmp(&self, other: &Self) -> Ordering {
        self.share.total_cmp(&other.share).then(other.number.cmp(&self.number))
    }
}

impl PartialOrd for Node {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Node {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Node {}

impl Search<'_> {
    /// Returns an upper bound on the unblocked share of the segments to a target, from 0 to 1. Stops once the
    /// bound is at most `enough`, or after `nodes` nodes.
    pub(crate) fn share(&mut self, target: Target, enough: f64, nodes: u32) -> f64 {
        if !self.begin(target, Budget { nodes, divided: 0, halvings: 0 }) {
            return 1.0;
        }
        // Cuts without a margin: polygons in one plane, between which nothing is seen, must not count.
        let all = sights(self.triangles, &self.cell, target, self.clearance, 0.0);
        let Some(all) = all else { return 1.0 };
        let measure = |sight: &Sight| sight.p.normal().length() * sight.q.normal().length();
        let total: f64 = all.iter().map(measure).sum();
        if total == 0.0 {
            // The viewcell or target is flat, so segments cannot be measured by area.
            return if all.is_empty() { 0.0 } else { 1.0 };
        }
        let mut open: BinaryHeap<Node> = (0..)
            .zip(all)
            .map(|(number, sight)| Node { share: measure(&sight) / total, number, sight, obstacle: None })
            .collect();
        let mut left = 1.0;
        for number in 0..nodes {
            if left <= enough || self.must_stop() {
                break;
            }
            let Some(node) = open.pop() else { break };
            self.stats.nodes += 1;
            let (blocked, obstacle) = self.is_blocked(&node.sight);
            if blocked {
                left -= node.share;
                continue;
            }
            // If nothing blocks the sample line, the edge that was in the way of an ancestor chooses the
            // halving.
            let obstacle = obstacle.or(node.obstacle);
            let Halving { of_p, across } = best_halving(&node.sight, obstacle);
            let halves = node.sight.halves(of_p, across);
            let measures = halves.each_ref().map(measure);
            for (k, (sight, part)) in halves.into_iter().zip(measures).enumerate() {
                let share = node.share * part / (measures[0] + measures[1]);
                open.push(Node { share, number: 64 + 2 * number + k as u32, sight, obstacle });
            }
        }
        // The summand allows for rounding of the sums. Areas far from the origin may be wrong by more.
        if open.is_empty() { 0.0 } else { (left + 1e-9).clamp(0.0, 1.0) }
    }

    /// Returns whether a surface certainly blocks all segments of a node. If not, also returns the edge that
    /// kept the first surface from blocking, and the line from which that surface was grown, if one was
    /// grown.
    fn is_blocked(&mut self, sight: &Sight) -> (bool, Option<(Obstacle, Segment)>) {
        let mut hits = core::mem::take(&mut self.hits);
        let (mut blocked, mut obstacle) = (false, None);
        if let Ok(line) = self.crossed_line(sight, &mut hits) {
            self.sort_starts(&mut hits);
            let shaft = Shaft::new(&sight.p, &sight.q, self.pad());
            for &start in hits.iter().take(2) {
                match self.close(sight, &shaft, start, line) {
                    Ok(_) => {
                        self.hint = start;
                        blocked = true;
                        break;
                    }
                    Err(edge) => obstacle = obstacle.or(Some((edge, line))),
                }
            }
        }
        self.hits = hits;
        (blocked, obstacle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sight::CellBox;
    use crate::triangles::SceneTriangles;
    use visibility_core::glam::{DVec3, Vec3};
    use visibility_core::{Aabb, Object, Scene};

    /// Walls across x at 5 m from `y[0]` to `y[1]` each.
    fn walls(all: &[[f32; 2]]) -> SceneTriangles {
        let mut scene = Scene::new();
        for y in all {
            let [a, b, c, d] =
                [(0, -9.0), (1, -9.0), (1, 9.0), (0, 9.0)].map(|(i, z)| Vec3::new(5.0, y[i], z));
            let bounds = Aabb::from_points([a, b, c, d]);
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            scene.set_triangles(id, [[a, b, c], [a, c, d]]).unwrap();
        }
        SceneTriangles::new(&scene)
    }

    const CELL: CellBox = CellBox { min: DVec3::new(-1.0, 0.0, 0.0), max: DVec3::new(0.0, 1.0, 1.0) };
    const TARGET: Target = Target::Box { min: DVec3::new(10.0, 0.0, 0.0), max: DVec3::new(11.0, 1.0, 1.0) };

    /// Walls in the middle between two squares: half of the segments pass above the middle, and an eighth by
    /// its upper quarter.
    #[test]
    fn bounds_are_above_the_share_and_near() {
        for (all, share) in [
            (&[[-9.0, 9.0]][..], 0.0),
            (&[[-9.0, 0.5]], 0.5),
            (&[[0.5, 9.0]], 0.5),
            (&[[-9.0, 0.75]], 0.125),
            (&[[-9.0, 0.25], [0.75, 9.0]], 0.75),
            (&[[20.0, 30.0]], 1.0),
        ] {
            let triangles = walls(all);
            for c in [0.0, 1e-6] {
                let mut search = Search::new(&triangles, CELL, c, None);
                let found = search.share(TARGET, 0.0, 3000);
                assert!(
                    (share - 1e-4..=share + 0.1).contains(&found),
                    "walls {all:?} leave {share}, bounded by {found} with clearance {c}"
                );
                // It stops as soon as the bound is enough.
                let nodes = search.stats.nodes;
                assert!(search.share(TARGET, 1.0, 3000) >= 1.0, "walls {all:?}: a bound of 1");
                assert_eq!(search.stats.nodes, nodes, "walls {all:?}: nodes for a bound of 1");
                let enough = search.share(TARGET, 0.9, 3000);
                assert!(enough <= 0.9 + 1e-8 || share > 0.9, "walls {all:?}: {enough} for 0.9");
            }
        }
    }

    /// No bound is found of what cannot be searched: after a stop, where the clearance is within the error
    /// of positions, where no viewpoint is a clearance over a face, and of or from what has no area.
    #[test]
    fn without_a_search_all_may_be_visible() {
        let triangles = walls(&[[-9.0, 9.0]]);
        let stop = || true;
        let mut search = Search::new(&triangles, CELL, 1e-6, None);
        search.stop = &stop;
        assert_eq!(search.share(TARGET, 0.5, 3000), 1.0, "after a stop");
        let share = |cell: CellBox, target: Target, c: f64| {
            Search::new(&triangles, cell, c, None).share(target, 0.5, 3000)
        };
        let wide = Target::Box { min: DVec3::new(10.0, -1.0, -1.0), max: DVec3::new(11.0, 2.0, 2.0) };
        assert_eq!(share(CELL, wide, 1e-16), 1.0, "a clearance within the error of positions");
        assert!(share(CELL, wide, 1e-6) <= 0.5, "a clearance beyond it");
        assert_eq!(share(CELL, TARGET, 1e-6), 0.0, "a target that is hidden");
        for below in [0.125, 0.75] {
            let max = DVec3::new(11.0, 1.0, 1.0 - below * 1e-5);
            let grazed = Target::Box { min: DVec3::new(10.0, 0.0, -1.0), max };
            assert_eq!(
                share(CELL, grazed, 1e-5),
                1.0,
                "a target {below} clearances below the viewcell's top"
            );
        }
        let point = CellBox { min: DVec3::ZERO, max: DVec3::ZERO };
        assert_eq!(share(point, TARGET, 1e-6), 1.0, "a viewcell without area");
    }
}
