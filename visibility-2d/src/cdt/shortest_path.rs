//! Shortest paths between two points of a plan, along its visibility graph.
//!
//! This work is based on: Edsger Dijkstra, "A Note on Two Problems in Connexion with Graphs", 1959.

use super::error::PlanError;
use super::plan::Plan;
use super::predicates::{Point, checked};
use super::reach::Reach;
use super::triangulation::{NONE, Place};
use super::visibility_graph::VisibilityGraph;
use alloc::collections::BinaryHeap;
use alloc::vec::Vec;
use core::cmp::Reverse;

/// Result of [`VisibilityGraph::find_path`]: a shortest path. Reuses its memory.
#[derive(Clone, Debug, Default)]
pub struct ShortestPath {
    points: Vec<Point>,
    /// Length of the path in world units, `None` without a path.
    length: Option<f64>,
    /// For each corner: length of the shortest path found from the start, and the corner before it on this
    /// path, [`NONE`] for the start.
    found: Vec<(f64, u32)>,
    /// For each corner, length of its leg to the goal, infinite without one.
    to_goal: Vec<f64>,
    /// Corners that are still to be left, by the bits of the length of their path, which order as the length.
    queue: BinaryHeap<Reverse<(u64, u32)>>,
    reach: Reach,
    corners: Vec<u32>,
}

impl ShortestPath {
    /// Makes an empty result, without a path.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the points of the path in world units, from the start to the goal. In between are the corners
    /// at which it bends, and corners that it touches. Empty if walls part start and goal.
    pub fn points(&self) -> &[[f64; 2]] {
        &self.points
    }

    /// Returns the length of the path in world units. `None` if walls part start and goal.
    pub fn length(&self) -> Option<f64> {
        self.length
    }
}

fn distance(a: Point, b: Point) -> f64 {
    let [x, y] = [a[0] - b[0], a[1] - b[1]];
    visibility_core::geometry::sqrt(x * x + y * y)
}

impl VisibilityGraph {
    /// Finds a shortest path from `from` to `to`, both in world units. A path may touch walls and lead along
    /// them, and crosses none. A point on a wall may be left to either side. Which paths are free is exact;
    /// of two whose lengths differ by less than rounding, either may be found.
    ///
    /// Takes time in proportion to the triangles that both points see, and `e log n` for the `e` legs at the
    /// `n` corners that are nearer to the start than the goal is.
    ///
    /// # Errors
    /// - [`PlanError::VisibilityGraph`] if the plan is not the one from which the graph was made, or a wall's
    ///   opacity has changed since.
    /// - [`PlanError::Coordinate`] with index 0 or 1 if a coordinate of `from` or `to` is NaN, infinite or
    ///   above 1e60 in absolute value.
    /// - [`PlanError::Region`] if a point is outside the rectangle around the plan.
    ///
    /// The path is then empty.
    pub fn find_path(
        &self,
        plan: &Plan,
        from: impl Into<[f64; 2]>,
        to: impl Into<[f64; 2]>,
        path: &mut ShortestPath,
    ) -> Result<(), PlanError> {
        path.points.clear();
        path.length = None;
        if !self.is_of(plan) {
            return Err(PlanError::VisibilityGraph);
        }
        let (from, to) = (checked(from.into(), 0)?, checked(to.into(), 1)?);
        let places = [from, to].map(|point| plan.locate_near(point, NONE));
        if places.contains(&Place::Outside) {
            return Err(PlanError::Region);
        }
        if plan.is_straight_path(from, to) {
            path.points.push(from);
            if from != to {
                path.points.push(to);
            }
            path.length = Some(distance(from, to));
            return Ok(());
        }
        self.search(plan, [from, to], places, path);
        Ok(())
    }

    fn search(&self, plan: &Plan, [from, to]: [Point; 2], places: [Place; 2], path: &mut ShortestPath) {
        let count = self.corners.len();
        let ShortestPath { points, length, found, to_goal, queue, reach, corners } = path;
        let point = |corner: u32| plan.points[self.corners[corner as usize].vertex as usize];
        found.clear();
        found.resize(count, (f64::INFINITY, NONE));
        to_goal.clear();
        to_goal.resize(count, f64::INFINITY);
        queue.clear();
        self.reached(plan, to, places[1], reach, corners);
        for &corner in &*corners {
            to_goal[corner as usize] = distance(point(corner), to);
        }
        self.reached(plan, from, places[0], reach, corners);
        for &corner in &*corners {
            let length = distance(from, point(corner));
            found[corner as usize].0 = length;
            queue.push(Reverse((length.to_bits(), corner)));
        }
        let mut best = (f64::INFINITY, NONE);
        while let Some(Reverse((bits, corner))) = queue.pop() {
            let so_far = f64::from_bits(bits);
            if so_far >= best.0 {
                break;
            }
            if so_far > found[corner as usize].0 {
                continue;
            }
            let whole = so_far + to_goal[corner as usize];
            if whole < best.0 {
                best = (whole, corner);
            }
            let here = point(corner);
            for &other in self.legs(corner) {
                let length = so_far + distance(here, point(other));
                if length < found[other as usize].0 {
                    found[other as usize] = (length, corner);
                    queue.push(Reverse((length.to_bits(), other)));
                }
            }
        }
        if best.0 == f64::INFINITY {
            return;
        }
        *length = Some(best.0);
        points.push(to);
        let mut corner = best.1;
        while corner != NONE {
            points.push(point(corner));
            corner = found[corner as usize].1;
        }
        points.push(from);
        points.reverse();
    }
}
