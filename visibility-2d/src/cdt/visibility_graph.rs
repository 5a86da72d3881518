//! Visibility graph of a plan: the corners at which shortest paths bend, and the free legs between them.
//!
//! A shortest path among walls bends only at a vertex whose walls leave free an angle of more than half a
//! turn, and only around the wedge of walls that is left (Fredo Durand, "3D Visibility: Analytical Study and
//! Applications", 1999, chapters 2 and 5; Tomas Lozano-Perez and Michael Wesley, "An Algorithm for Planning
//! Collision-Free Paths Among Polyhedral Obstacles", 1979). Walls have no thickness here, so a corner is a
//! vertex together with one free angle: a path that comes to a vertex in one free angle does not leave it
//! in another.
//!
//! All decisions are orientations of three given points, and are exact.

use super::error::PlanError;
use super::plan::{Plan, TWIN};
use super::predicates::{Point, is_same_way, orient};
use super::reach::Reach;
use super::triangulation::{Place, next};
use alloc::vec::Vec;
use visibility_core::stamp::Stamp;

/// Greatest number of legs, counted in both directions. A leg takes 4 bytes.
const MAX_LEGS: usize = 1 << 26;

/// Vertex with a free angle of half a turn or more between two walls.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    /// Index of the vertex in `Plan::points`.
    pub(super) vertex: u32,
    /// Half-edges from the vertex along the walls that bound the free angle: clockwise bound, then
    /// counter-clockwise bound. Equal at the free end of a single wall.
    walls: [u32; 2],
}

/// Corners of the walls of a plan, and the legs between them along which shortest paths lead.
///
/// A leg is a straight segment between two corners which no wall crosses or touches between its ends, and at
/// whose ends a taut string may bend around the walls (a "tangent" leg). Segments along walls are legs as
/// well. The graph has no legs of which no shortest path can make use.
///
/// Paths lead where lines of sight lead both ways: walls that are clear let them through, one-way walls do
/// not. To walk where glass stands, make another plan in which the glass is opaque. A mover has no size.
///
/// A graph belongs to the walls and opacities from which it was made: make it anew when a door opens.
/// Making it takes time in proportion to the triangles that all corners see together, `n s` for `n` corners
/// that see `s` triangles each: quadratic in the number of walls where all see all.
///
/// ```
/// use visibility_2d::cdt::{Plan, ShortestPath, VisibilityGraph, Wall};
/// let plan = Plan::new(&[Wall::new([0.0, -1.0], [0.0, 1.0])])?;
/// let graph = VisibilityGraph::new(&plan)?;
/// assert_eq!((graph.corner_count(), graph.leg_count()), (2, 1)); // both ends, and the wall itself
/// let mut path = ShortestPath::new();
/// graph.find_path(&plan, [-0.5, 0.5], [0.5, 0.5], &mut path)?;
/// assert_eq!(path.points(), [[-0.5, 0.5], [0.0, 1.0], [0.5, 0.5]]);
/// # Ok::<(), visibility_2d::cdt::PlanError>(())
/// ```
#[derive(Clone, Debug)]
pub struct VisibilityGraph {
    /// Stamp of the plan's walls and opacities.
    of: Stamp,
    pub(super) corners: Vec<Corner>,
    /// For each vertex, the start of its range in `corners`. One more entry is the end of the last range.
    first_corner: Vec<u32>,
    /// For each corner, the start of its range in `legs`. One more entry is the end of the last range.
    first_leg: Vec<u32>,
    /// Other end of each leg, an index into `corners`. Each leg is listed at both of its ends.
    legs: Vec<u32>,
    /// For each vertex, whether a wall that stops paths ends there or runs through.
    solid: Vec<bool>,
}

impl VisibilityGraph {
    /// Makes the graph of a plan, with its present opacities.
    ///
    /// # Errors
    /// [`PlanError::TooMany`] if there are more than 2^25 legs.
    pub fn new(plan: &Plan) -> Result<Self, PlanError> {
        let mut graph = Self {
            of: plan.stamp(),
            corners: Vec::new(),
            first_corner: Vec::with_capacity(plan.points.len() + 1),
            first_leg: alloc::vec![0],
            legs: Vec::new(),
            solid: Vec::with_capacity(plan.points.len()),
        };
        graph.first_corner.push(0);
        for vertex in 0..plan.points.len() as u32 {
            graph.push_corners(plan, vertex);
        }
        let mut reach = Reach::default();
        for index in 0..graph.corners.len() {
            let Corner { vertex, walls } = graph.corners[index];
            // The two corners of a vertex that a wall runs through share what the vertex reaches.
            if index == 0 || graph.corners[index - 1].vertex != vertex {
                let place = Place::Vertex(plan.out[vertex as usize]);
                reach.search(plan, plan.points[vertex as usize], place, |v| graph.solid[v as usize]);
            }
            let point = plan.points[vertex as usize];
            for &other in &reach.vertices {
                if !graph.solid[other as usize] {
                    continue;
                }
                let target = plan.points[other as usize];
                // A leg along a wall has the wall on its left or on its right, at both ends alike.
                let along = plan
                    .fan(plan.out[vertex as usize])
                    .find(|&h| plan.edges[next(h) as usize].origin == other && plan.is_solid(h));
                for number in graph.corners_of(other) {
                    let ends = graph.corners[number as usize].walls;
                    let is_leg = along.map_or_else(
                        || is_taut(plan, point, walls, target) && is_taut(plan, target, ends, point),
                        |h| {
                            let back = plan.edges[h as usize].twin & TWIN;
                            walls[0] == h && ends[1] == back || walls[1] == h && ends[0] == back
                        },
                    );
                    if is_leg {
                        graph.legs.push(number);
                    }
                }
            }
            if graph.legs.len() > MAX_LEGS {
                return Err(PlanError::TooMany { count: graph.legs.len() });
            }
            graph.first_leg.push(graph.legs.len() as u32);
        }
        Ok(graph)
    }

    /// Adds the corners of a vertex, in the order of their numbers.
    fn push_corners(&mut self, plan: &Plan, vertex: u32) {
        let walls: Vec<_> = plan.fan(plan.out[vertex as usize]).filter(|&h| plan.is_solid(h)).collect();
        let point = plan.points[vertex as usize];
        for (&right, &left) in walls.iter().zip(walls.iter().cycle().skip(1)) {
            let [a, b] = [right, left].map(|h| plan.start(next(h)));
            // Two walls in opposite directions leave half a turn free on either side. A single one leaves a
            // whole turn.
            if orient(point, a, b) <= 0.0 {
                self.corners.push(Corner { vertex, walls: [right, left] });
            }
        }
        self.solid.push(!walls.is_empty());
        self.first_corner.push(self.corners.len() as u32);
    }

    fn corners_of(&self, vertex: u32) -> core::ops::Range<u32> {
        self.first_corner[vertex as usize]..self.first_corner[vertex as usize + 1]
    }

    /// Replaces `out` by the corners that a point reaches by a leg whose far end is taut.
    pub(super) fn reached(
        &self,
        plan: &Plan,
        point: Point,
        place: Place,
        reach: &mut Reach,
        out: &mut Vec<u32>,
    ) {
        out.clear();
        reach.search(plan, point, place, |v| self.solid[v as usize]);
        for &vertex in &reach.vertices {
            let at = plan.points[vertex as usize];
            out.extend(self.corners_of(vertex).filter(|&corner| {
                let walls = self.corners[corner as usize].walls;
                // A point on a wall may leave to either side of the wall.
                let is_along = |&h: &u32| {
                    let end = plan.start(next(h));
                    orient(at, end, point) == 0.0 && is_same_way(at, end, point)
                };
                walls.iter().any(is_along) || is_taut(plan, at, walls, point)
            }));
        }
    }

    /// Returns whether the graph was made from the walls and opacities that the plan has now.
    pub fn is_of(&self, plan: &Plan) -> bool {
        self.of == plan.stamp()
    }

    /// Returns the number of corners.
    pub fn corner_count(&self) -> usize {
        self.corners.len()
    }

    /// Returns the number of legs, each counted once.
    pub fn leg_count(&self) -> usize {
        self.legs.len() / 2
    }

    /// Returns the point of a corner, in world units. `None` if the plan is another one or has changed, or
    /// for an unknown corner; corners are numbered from 0. Two corners have the same point where a wall runs
    /// through a vertex, one for each side of the wall.
    pub fn corner(&self, plan: &Plan, corner: u32) -> Option<[f64; 2]> {
        let corner = self.corners.get(corner as usize).filter(|_| self.is_of(plan))?;
        plan.points.get(corner.vertex as usize).copied()
    }

    /// Returns the corners at the other ends of a corner's legs; none for an unknown corner.
    pub fn legs(&self, corner: u32) -> &[u32] {
        let range =
            |start: usize| self.first_leg.get(start).copied().zip(self.first_leg.get(start + 1).copied());
        range(corner as usize).map_or(&[], |(start, end)| &self.legs[start as usize..end as usize])
    }
}

/// Returns whether a taut string may lead from the free angle of a corner straight to `target`: the target
/// lies strictly inside the free angle, and the segment, lengthened beyond the corner, does not enter the
/// wedge between the corner's walls.
fn is_taut(plan: &Plan, corner: Point, [right, left]: [u32; 2], target: Point) -> bool {
    if right == left {
        return true;
    }
    let is_inside = |h: u32, sign: f64| sign * orient(corner, plan.start(next(h)), target) > 0.0;
    // With the target on the inner side of both walls, the lengthened segment enters the wedge. With it on
    // the inner side of neither, the target lies in the wedge.
    is_inside(right, 1.0) != is_inside(left, -1.0)
}
