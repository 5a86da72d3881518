//! Inserts walls as edges of the triangulation. Triangles that a wall crosses are removed, and their area is
//! triangulated again on both sides of the wall. Walls that cross are split.
//!
//! This work is based on: Marc Vigo Anglada, "An Improved Incremental Algorithm for Constructing Restricted
//! Delaunay Triangulations", 1997 (both sides of the wall are triangulated again); Godfried Toussaint and
//! David Avis, "On a Convex Hull Algorithm for Polygons and its Application to Triangulation Problems", 1982
//! (in one pass over the corners, since all of them see the wall).
//!
//! Two walls that cross are split at the `f64` point nearest to their crossing, and from there on both are
//! chains through that point. If a vertex is within [`rounding`] of the crossing, both walls pass through
//! that vertex instead. Otherwise their pieces might cross again beside it, without end. No gap opens,
//! because the chain still connects both ends of the wall.

use super::error::PlanError;
use super::predicates::{MIN_MAGNITUDE, Point, area, is_same_way, orient};
use super::triangulation::{NONE, Place, Triangulation, next, previous};
use alloc::vec::Vec;

/// Greatest number of vertices of a triangulation: ends of walls plus crossings. Also the greatest length of
/// `Triangulation::lists`.
pub(crate) const MAX_VERTICES: usize = 1 << 24;

/// Flag that tells indices of steps from indices of half-edges. If set, the other bits are an index into
/// `Constrainer::steps`; otherwise the number is an index into `Triangulation::edges`.
const STEP: u32 = 1 << 31;

/// Piece of a wall that is still to be inserted as an edge or a chain of edges.
#[derive(Clone, Debug)]
struct Task {
    /// Vertex at which the piece begins, an index into `Triangulation::points`.
    from: u32,
    /// Vertex at which the piece ends, an index into `Triangulation::points`.
    to: u32,
    /// Index, in `Triangulation::lists`, of the first item of the linked list of walls along the piece.
    walls: u32,
    /// True if the piece comes from a split at a crossing, false if it is on the line of a wall as given.
    is_part: bool,
}

/// Boundary edge of the hole left by the triangles that a wall crosses.
#[derive(Clone, Debug)]
struct Step {
    /// Index of the vertex to which the edge leads if the hole's boundary is followed clockwise. Half-edges
    /// run counter-clockwise in their triangle, so this is the vertex at which `inner` begins.
    vertex: u32,
    /// Index of the edge's half-edge inside the hole: first of the removed triangle, later of the triangle
    /// that [`fill_side`](Constrainer::fill_side) puts there.
    inner: u32,
    /// Index of the edge's half-edge outside the hole; [`NONE`] on the outer rectangle. If the triangles on
    /// both sides of the edge are removed, the edge appears as two steps: then [`STEP`] plus the index of the
    /// other step.
    outer: u32,
    /// Index, in `Triangulation::lists`, of the first item of the linked list of walls along the edge.
    /// [`NONE`] without a wall.
    walls: u32,
}

/// Next step of a wall that is followed through the triangulation from one of its ends to the other.
enum Way {
    /// The wall runs along this half-edge.
    Along(u32),
    /// The wall crosses the triangle that begins with this half-edge.
    Through(u32),
}

/// Inserts walls as edges of a triangulation. One value inserts all walls and reuses its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Constrainer {
    /// Stack of the pieces of walls that are still to be inserted.
    tasks: Vec<Task>,
    /// Steps around the hole that the removed triangles leave, clockwise: first those on the left of the
    /// wall, from its first end to its second, then those on the right, from its second end to its first.
    steps: Vec<Step>,
    /// Scratch of [`cross`](Self::cross): steps on the right of the wall, from its first end to its second.
    /// [`fill`](Self::fill) moves them to the end of `steps`, in reverse order.
    right: Vec<Step>,
    /// Indices of the triangles that the wall crosses. `fill_side` reuses these indices for the triangles
    /// that fill the hole.
    removed: Vec<u32>,
    /// Scratch of `fill_side`: vertices around the part of the hole that is not triangulated yet. Each entry
    /// is a vertex, and the half-edge (or [`STEP`] plus a step) that leads to the vertex from the vertex of
    /// the entry before; [`NONE`] in the first entry.
    chain: Vec<(u32, u32)>,
    /// Number of times that the wall being inserted was split at a crossing.
    splits: usize,
    /// Limit on `splits`. If a wall is split more often, its splitting counts as endless, which is an error.
    usual: usize,
}

impl Constrainer {
    /// Inserts the wall between two vertices as a chain of edges. Does nothing for equal vertices.
    ///
    /// # Errors
    /// [`PlanError::TooMany`] when crossings make more than [`MAX_VERTICES`] vertices, or overlaps more than
    /// [`MAX_VERTICES`] items in `Triangulation::lists`. The limits are checked before each piece is
    /// inserted. A piece at most doubles the number of items, so indices of items fit into `u32`.
    pub(crate) fn insert(
        &mut self,
        of: &mut Triangulation,
        from: u32,
        to: u32,
        wall: u32,
    ) -> Result<(), PlanError> {
        let walls = of.lists.len() as u32;
        of.lists.push((wall, NONE));
        self.insert_list(of, from, to, walls)
    }

    /// Inserts the segment between two vertices as a chain of edges, like [`insert`](Self::insert), but for
    /// all walls of a linked list. `walls` is the index of the list's first item in `Triangulation::lists`.
    /// It need not be an index if all segments of the triangulation are inserted with the same number: then
    /// it only marks their edges.
    pub(crate) fn insert_list(
        &mut self,
        of: &mut Triangulation,
        from: u32,
        to: u32,
        walls: u32,
    ) -> Result<(), PlanError> {
        self.tasks.push(Task { from, to, walls, is_part: false });
        (self.splits, self.usual) = (0, 16 * of.points.len() + 1024);
        while let Some(task) = self.tasks.pop() {
            // In very rare piles of walls, pieces at the limit of rounding would be bent back and forth
            // without end.
            let endless = if self.splits > self.usual { MAX_VERTICES + self.splits } else { 0 };
            let count = of.points.len().max(of.lists.len()).max(endless);
            if count > MAX_VERTICES {
                self.tasks.clear();
                return Err(PlanError::TooMany { count });
            }
            self.advance(of, task);
        }
        Ok(())
    }

    /// Inserts the first part of a task's piece as an edge, up to the next vertex on the way, and pushes the
    /// rest as a task. If another wall is in the way, no edge is inserted: both walls are split at their
    /// crossing, and the pieces become tasks.
    fn advance(&mut self, of: &mut Triangulation, task: Task) {
        let Task { from, to, walls, is_part } = task;
        if from == to {
            return;
        }
        let (h, rest) = match way(of, from, to) {
            None => return,
            Some(Way::Along(h)) => (h, of.edges[next(h) as usize].origin),
            Some(Way::Through(h)) => {
                let Some(reached) = self.cross(of, h, &task) else { return };
                (self.fill(of, from, reached), reached)
            }
        };
        mark(of, h, walls);
        // The number of flips is limited, because the flips near a long wall could take quadratic time.
        of.restore_delaunay(16 * self.steps.len() + 64);
        self.tasks.push(Task { from: rest, to, walls, is_part });
    }

    /// Walks from the origin of half-edge `h` through its triangle along the task's segment, to the first
    /// vertex on the segment or at its end, and collects the boundary of the triangles crossed. Returns that
    /// vertex. If a wall is in the way, both walls are split at their crossing, their pieces become tasks,
    /// and the result is `None`.
    fn cross(&mut self, of: &mut Triangulation, h: u32, task: &Task) -> Option<u32> {
        let (from, to) = (task.from, task.to);
        let [a, b] = [from, to].map(|v| of.points[v as usize]);
        self.steps.clear();
        self.right.clear();
        self.removed.clear();
        self.removed.push(h / 3);
        let mut crossed = next(h);
        self.steps.push(step(of, of.apex(h), previous(h)));
        self.right.push(step(of, from, h));
        loop {
            let edge = of.edges[crossed as usize];
            if edge.walls != NONE {
                self.split(of, task, crossed);
                return None;
            }
            let (twin, apex) = (edge.twin, of.apex(edge.twin));
            self.removed.push(twin / 3);
            let side = orient(a, b, of.points[apex as usize]);
            if side >= 0.0 {
                self.steps.push(step(of, apex, previous(twin)));
            }
            if side <= 0.0 {
                self.right.push(step(of, edge.origin, next(twin)));
            }
            if side == 0.0 {
                return Some(apex);
            }
            crossed = if side > 0.0 { next(twin) } else { previous(twin) };
        }
    }

    /// Splits two crossing segments at a vertex at or near their crossing: the one of the task, and the one
    /// along half-edge `crossed`, whose walls are removed from the edge. The four pieces become tasks.
    fn split(&mut self, of: &mut Triangulation, task: &Task, crossed: u32) {
        let &Task { from, to, walls, is_part } = task;
        let edge = of.edges[crossed as usize];
        let ends = [edge.origin, of.edges[edge.twin as usize].origin];
        let [a, b, c, d] = [from, to, ends[0], ends[1]].map(|v| of.points[v as usize]);
        let middle = crossing(a, b, c, d);
        mark_as(of, crossed, NONE);
        of.begin_at(crossed);
        self.splits += 1;
        let ends_of_both = [from, to, ends[0], ends[1]];
        let vertex = near_vertex(of, middle, ends_of_both, is_part);
        let vertex = vertex.unwrap_or_else(|| of.insert(middle));
        // The pieces of the other wall are pushed last and so inserted first, so that it is not crossed
        // again. A piece between equal vertices is dropped.
        for (from, to, walls) in [
            (vertex, to, walls),
            (from, vertex, walls),
            (vertex, ends[1], edge.walls),
            (ends[0], vertex, edge.walls),
        ] {
            self.tasks.push(Task { from, to, walls, is_part: true });
        }
    }

    /// Triangulates the hole that [`cross`](Self::cross) has collected, with the edge from `from` to `to`,
    /// and returns the half-edge from `from` to `to`.
    fn fill(&mut self, of: &mut Triangulation, from: u32, to: u32) -> u32 {
        of.unify(&self.removed);
        let left = self.steps.len();
        self.steps.extend(self.right.drain(..).rev());
        // An edge between two removed triangles appears as two steps.
        for (index, step) in (0u32..).zip(&self.steps) {
            of.edges[step.inner as usize].twin = STEP | index;
        }
        for step in &mut self.steps {
            if step.outer != NONE && of.edges[step.outer as usize].twin & STEP != 0 {
                step.outer = of.edges[step.outer as usize].twin;
            }
        }
        let upper = self.fill_side(of, from, 0, left);
        let lower = self.fill_side(of, to, left, self.steps.len());
        link(of, upper, lower);
        for index in 0..self.steps.len() {
            let Step { inner, outer, walls, .. } = self.steps[index];
            let outer = if outer == NONE || outer & STEP == 0 {
                outer
            } else {
                self.steps[(outer & !STEP) as usize].inner
            };
            of.edges[inner as usize].walls = walls;
            of.edges[inner as usize].twin = outer;
            if outer != NONE {
                of.edges[outer as usize].twin = inner;
            }
        }
        upper
    }

    /// Triangulates one side of the hole, between the wall and the steps with the indices `first..end` in
    /// `steps`, which begin at the vertex `from`. Returns the index of the new half-edge along the wall.
    fn fill_side(&mut self, of: &mut Triangulation, from: u32, first: usize, end: usize) -> u32 {
        self.chain.clear();
        self.chain.push((from, NONE));
        for index in first..end {
            let z = self.steps[index].vertex;
            let mut link_z = STEP | index as u32;
            while let [.., (x, _), (y, link_y)] = self.chain[..] {
                let [p, q, r] = [x, y, z].map(|v| of.points[v as usize]);
                if orient(p, q, r) >= 0.0 {
                    break;
                }
                // The corner is convex, so the triangle z y x is cut off.
                let Some(t) = self.removed.pop() else { break };
                let h = 3 * t;
                for (h, origin, link_to) in [(h, z, link_z), (h + 1, y, link_y)] {
                    new_edge(of, h, origin);
                    if link_to & STEP != 0 {
                        self.steps[(link_to & !STEP) as usize].inner = h;
                    } else {
                        link(of, h, link_to);
                    }
                }
                new_edge(of, h + 2, x);
                link_z = h + 2;
                self.chain.pop();
                of.suspect(h);
                of.suspect(h + 1);
            }
            self.chain.push((z, link_z));
        }
        debug_assert_eq!(self.chain.len(), 2, "a side of a wall is not triangulated");
        self.chain.last().map_or(NONE, |&(_, link)| link)
    }
}

fn step(of: &Triangulation, vertex: u32, inner: u32) -> Step {
    let edge = of.edges[inner as usize];
    Step { vertex, inner, outer: edge.twin, walls: edge.walls }
}

fn new_edge(of: &mut Triangulation, h: u32, origin: u32) {
    let edge = &mut of.edges[h as usize];
    (edge.origin, edge.walls) = (origin, NONE);
    of.out[origin as usize] = h;
}

fn link(of: &mut Triangulation, h: u32, g: u32) {
    of.edges[h as usize].twin = g;
    of.edges[g as usize].twin = h;
}

/// Sets the walls along half-edge `h` and its twin. `walls` is the index, in `Triangulation::lists`, of the
/// first item of their list, or [`NONE`].
fn mark_as(of: &mut Triangulation, h: u32, walls: u32) {
    let twin = of.edges[h as usize].twin;
    of.edges[h as usize].walls = walls;
    if twin != NONE {
        of.edges[twin as usize].walls = walls;
    }
}

/// Adds the walls of a list to the edge of half-edge `h`. `walls` is the index, in `Triangulation::lists`, of
/// the first item of the list. A wall may then be listed more than once.
fn mark(of: &mut Triangulation, h: u32, walls: u32) {
    let mut head = of.edges[h as usize].walls;
    if head == walls {
        return;
    }
    if head == NONE {
        head = walls;
    } else {
        let mut item = walls;
        while item != NONE {
            let (wall, rest) = of.lists[item as usize];
            if !lists_lately(of, head, wall) {
                of.lists.push((wall, head));
                head = of.lists.len() as u32 - 1;
            }
            item = rest;
        }
    }
    mark_as(of, h, head);
}

/// Returns whether a wall is among the 64 items that were last added to a list. New items come first, so
/// these are the items from `item` on. Without this test, walls that are bent onto each other repeatedly
/// would double their lists each time.
fn lists_lately(of: &Triangulation, mut item: u32, wall: u32) -> bool {
    for _ in 0..64 {
        if item == NONE {
            return false;
        }
        let (other, rest) = of.lists[item as usize];
        if other == wall {
            return true;
        }
        item = rest;
    }
    false
}

/// Returns how the segment from one vertex to another begins: along an edge, or through a triangle. `None`
/// only if the triangulation is broken.
fn way(of: &Triangulation, from: u32, to: u32) -> Option<Way> {
    let [a, b] = [from, to].map(|v| of.points[v as usize]);
    let first = of.out[from as usize];
    let mut h = first;
    // Visits the edges around the vertex counter-clockwise.
    loop {
        let end = of.edges[next(h) as usize].origin;
        let c = of.points[end as usize];
        let side = orient(a, c, b);
        if side == 0.0 && is_same_way(a, c, b) {
            return Some(Way::Along(h));
        }
        if side > 0.0 && orient(a, of.points[of.apex(h) as usize], b) < 0.0 {
            return Some(Way::Through(h));
        }
        h = of.edges[previous(h) as usize].twin;
        if h == first || h == NONE {
            return None;
        }
    }
}

/// Returns a vertex through which two segments that cross may both pass: one within [`rounding`] of their
/// crossing. `middle` is that crossing, rounded. `ends` are the vertices at the ends of the first segment,
/// then of the second. If `is_part`, the first segment is a piece of a wall that was split at a crossing. An
/// end of either segment within [`rounding`] of the other segment is then preferred, however far it is from
/// the crossing, because the crossing of segments at a small angle is hardly known. `None` if there is no
/// such vertex.
fn near_vertex(of: &Triangulation, middle: Point, ends: [u32; 4], is_part: bool) -> Option<u32> {
    let [a, b, c, d] = ends.map(|v| of.points[v as usize]);
    let is_on = |&(v, segment): &(u32, [Point; 2])| may_bend(segment, of.points[v as usize]);
    let ends_on = [(ends[0], [c, d]), (ends[1], [c, d]), (ends[2], [a, b]), (ends[3], [a, b])];
    if let Some((v, _)) = ends_on.into_iter().find(is_on).filter(|_| is_part) {
        return Some(v);
    }
    let is_near = |&v: &u32| {
        let p = of.points[v as usize];
        let rounding = rounding(&[a, b, c, d]);
        (0..2).all(|k| (p[k] - middle[k]).abs() <= rounding) && may_bend([a, b], p) && may_bend([c, d], p)
    };
    let corners = match of.locate(middle) {
        Place::Triangle(t) => [3 * t, 3 * t + 1, 3 * t + 2],
        Place::Edge(h) | Place::Vertex(h) => [h, next(h), previous(h)],
        Place::Outside => return None,
    };
    corners.map(|h| of.edges[h as usize].origin).into_iter().find(is_near)
}

/// Returns whether the piece of a wall from `a` to `b` may be bent so that it passes through the vertex
/// `through`. True if the vertex is `a` or `b`, or if it is within [`rounding`] of the segment `ab` and
/// strictly between `a` and `b` along the longer axis of `ab`. A segment parallel to an axis may not be bent,
/// so only vertices exactly on it count.
fn may_bend([a, b]: [Point; 2], through: Point) -> bool {
    if through == a || through == b {
        return true;
    }
    let along = [b[0] - a[0], b[1] - a[1]].map(f64::abs);
    let axis = usize::from(along[1] > along[0]);
    let is_between = a[axis].min(b[axis]) < through[axis] && through[axis] < a[axis].max(b[axis]);
    let is_in_box = a[1 - axis].min(b[1 - axis]) <= through[1 - axis]
        && through[1 - axis] <= a[1 - axis].max(b[1 - axis]);
    is_between && is_in_box && area(a, b, through).abs() <= rounding(&[a, b, through]) * along[axis]
}

/// Returns the distance within which points that were rounded several times count as one.
///
/// A crossing has an error of some units of rounding of the greatest coordinate. Pieces of walls that were
/// split at it may cross again a little beside it, and so on without end, if a coordinate rounds back to the
/// same number. Walls on top of each other cross at every vertex of either. To stop this, walls that cross
/// within this distance of a vertex are bent to pass through the vertex.
fn rounding(points: &[Point]) -> f64 {
    8.0 * f64::EPSILON * points.as_flattened().iter().fold(0.0, |size: f64, x| size.max(x.abs()))
}

/// Returns the `f64` point nearest to the crossing of `ab` and `cd`, up to a few units of rounding. The point
/// lies in the bounding boxes of both segments. If 106 bits cannot tell the lines from parallel ones, the
/// middle of `ab` is returned.
///
/// A coordinate of a magnitude below [`MIN_MAGNITUDE`] becomes 0. The point stays in both boxes, because the
/// coordinates of the ends are 0 or at least `MIN_MAGNITUDE` in magnitude.
fn crossing(a: Point, b: Point, c: Point, d: Point) -> Point {
    let (of_a, of_b) = (area(c, d, a), area(c, d, b));
    let share = of_a / (of_a - of_b);
    let share = if (0.0..=1.0).contains(&share) { share } else { 0.5 };
    core::array::from_fn(|axis| {
        let x = a[axis] + share * (b[axis] - a[axis]);
        let x = x.max(a[axis].min(b[axis])).min(a[axis].max(b[axis]));
        let x = x.max(c[axis].min(d[axis])).min(c[axis].max(d[axis]));
        if x.abs() < MIN_MAGNITUDE { 0.0 } else { x }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A crossing at the least coordinates stays on a wall there.
    #[test]
    fn crossings_keep_the_least_coordinates() {
        for least in [MIN_MAGNITUDE, -MIN_MAGNITUDE] {
            let found = crossing([-1.0, least], [1.0, least], [0.0, -1.0], [0.0, 1.0]);
            assert_eq!(found, [0.0, least], "on a wall at {least}");
        }
    }
}
