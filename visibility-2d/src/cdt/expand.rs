//! Triangular expansion: the cone of sight from an eye grows through triangles until walls stop it.
//!
//! This work is based on: Francisc Bungiu, Michael Hemmer, John Hershberger, Kan Huang and Alexander
//! Kroeller, "Efficient Computation of Visibility Polygons", 2014.
//!
//! A cone is bounded by two rays from the eye through ends of walls. Every decision is on which side of a ray
//! a vertex lies, and is exact. A cone of zero width is not followed, so things visible only through a single
//! point do not count as seen.

use super::plan::{BLOCKS, Plan, TWIN, WALL};
use super::predicates::{ORIENTATION_ERROR, Point, orient, orient_slow};
use super::triangulation::{Place, next, previous};
use alloc::vec::Vec;

/// Ray from the eye through a point: a vertex, or a point of the sector's bounds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    /// Index of a vertex of the plan, or the number of its vertices plus an index into `Expansion::sector`.
    pub(crate) point: u32,
    /// Vector from the eye to the point, rounded, in world units.
    pub(crate) offset: Point,
}

/// Cone of sight where it leaves a triangle through an edge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    /// Index of the half-edge across which the cone leaves a triangle. If `enters`: of the half-edge on the
    /// outer rectangle across which the cone enters its triangle.
    pub(crate) edge: u32,
    /// Ray from the eye that bounds the cone on its right.
    pub(crate) right: Ray,
    /// Ray from the eye that bounds the cone on its left.
    pub(crate) left: Ray,
    /// Number of opaque walls that the cone may still cross.
    through: u32,
    /// True if the cone comes from outside the outer rectangle and enters the triangle of `edge`, false if it
    /// leaves that triangle.
    enters: bool,
}

impl Cone {
    /// Returns the triangle that the cone leaves, and the right and the left ray that bound it. `None` for a
    /// cone from outside the rectangle.
    pub(crate) fn inside(&self) -> Option<(u32, Ray, Ray)> {
        (!self.enters).then_some((self.edge / 3, self.right, self.left))
    }
}

/// Event of a cone of sight at an edge of a triangle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Met {
    /// The cone goes on beyond the wall. The wall does not block lines of sight, or it is opaque and one of
    /// the [`PlanView::through`](super::PlanView::through) opaque walls that the cone may cross.
    Passed,
    /// The cone ends at a wall or at the outer rectangle.
    Ended,
    /// The cone ends because the edge is farther away than the view's range.
    Far,
}

/// Eye and plan of a query, and other data that all its cones share.
#[derive(Clone, Copy)]
pub(crate) struct Expansion<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) eye: Point,
    /// Points whose directions from the eye divide the view's sector into parts of less than half a turn,
    /// from right to left; see [`PlanView::sector_points`](super::PlanView::sector_points). Empty without a
    /// sector.
    pub(crate) sector: &'a [Point],
}

impl Expansion<'_> {
    pub(crate) fn ray(&self, point: u32) -> Ray {
        let [x, y] = self.point(point);
        Ray { point, offset: [x - self.eye[0], y - self.eye[1]] }
    }

    pub(crate) fn point(&self, point: u32) -> Point {
        let vertices = self.plan.points.len();
        let point = point as usize;
        if point < vertices { self.plan.points[point] } else { self.sector[point - vertices] }
    }

    /// Returns whether the second ray is strictly to the left of the first, as seen from the eye.
    #[inline(always)]
    fn is_left(&self, first: Ray, second: Ray) -> bool {
        let (plus, minus) = (first.offset[0] * second.offset[1], first.offset[1] * second.offset[0]);
        let difference = plus - minus;
        if difference.abs() > ORIENTATION_ERROR * (plus.abs() + minus.abs()) {
            return difference > 0.0;
        }
        orient_slow(self.point(first.point), self.point(second.point), self.eye) > 0.0
    }

    /// Replaces `cones` by the first cones of sight, counter-clockwise around the eye. There is one cone for
    /// each edge across which lines of sight leave the triangles that contain the eye. If the eye is outside
    /// the rectangle, there is one for each side across which they enter the rectangle. Each cone may pass
    /// `through` opaque walls.
    pub(crate) fn start(&self, place: Place, through: u32, cones: &mut Vec<Cone>) {
        cones.clear();
        let plan = self.plan;
        let mut push = |edge: u32, enters: bool| {
            let (mut right, mut left) =
                (plan.edges[edge as usize].origin, plan.edges[next(edge) as usize].origin);
            if enters {
                (right, left) = (left, right);
            }
            cones.push(Cone { edge, right: self.ray(right), left: self.ray(left), through, enters });
        };
        match place {
            Place::Triangle(t) => (3 * t..3 * t + 3).for_each(|h| push(h, false)),
            Place::Edge(h) => {
                for h in [Some(h), plan.edges[h as usize].twin()].into_iter().flatten() {
                    push(next(h), false);
                    push(previous(h), false);
                }
            }
            Place::Vertex(h) => plan.fan(h).for_each(|h| push(next(h), false)),
            Place::Outside => {
                // The one or two outer edges that face the eye, the right one first.
                let mut outer = plan.outer();
                let faces = |h: u32| {
                    let [a, b] = plan.ends(h);
                    orient(a, b, self.eye) < 0.0
                };
                if faces(outer[3]) {
                    outer.rotate_left(1);
                }
                outer.into_iter().rev().filter(|&h| faces(h)).for_each(|h| push(h, true));
            }
        }
    }

    /// Clips the cones to the sector. Afterwards they are in counter-clockwise order, beginning at the right
    /// side of the sector.
    pub(crate) fn limit(&self, cones: &mut Vec<Cone>) {
        let count = cones.len();
        let vertices = self.plan.points.len() as u32;
        for part in 1..self.sector.len() as u32 {
            let (right, left) = (self.ray(vertices + part - 1), self.ray(vertices + part));
            let begins = |cone: &Cone| self.holds(cone.right, cone.left, right);
            let first = cones[..count].iter().position(begins).unwrap_or(0);
            for index in 0..count {
                let mut cone = cones[(first + index) % count];
                // Cone and sector part are both narrower than half a turn, so they overlap in at most one
                // cone.
                if self.holds(cone.right, cone.left, right) {
                    cone.right = right;
                } else if !self.holds(right, left, cone.right) {
                    continue;
                }
                if self.is_left(left, cone.left) {
                    cone.left = left;
                }
                cones.push(cone);
            }
        }
        cones.drain(..count);
    }

    /// Returns whether `ray` is strictly inside the cone from `right` to `left`, or on its right bound. The
    /// cone must be narrower than half a turn: then the ray opposite to `right` has `left` on its right.
    fn holds(&self, right: Ray, left: Ray, ray: Ray) -> bool {
        !self.is_left(ray, right) && self.is_left(ray, left)
    }

    /// Follows the cones on the stack, the last one first. Calls `meet(edge, right, left, met)` for each part
    /// of an edge, between the rays `right` and `left`, where a cone passes a wall or ends. The parts of one
    /// cone come from right to left. A cone ends at an edge for which `is_near` is false, and at the outer
    /// rectangle. It also ends at a blocking wall for which `stops` is true, unless it still has opaque walls
    /// to see through. Calls `enter(triangle, right, left)` for each triangle that a cone enters.
    #[inline(always)]
    pub(crate) fn run(
        &self,
        stack: &mut Vec<Cone>,
        is_near: impl Fn(u32) -> bool,
        stops: impl Fn(u32) -> bool,
        mut enter: impl FnMut(u32, Ray, Ray),
        mut meet: impl FnMut(u32, Ray, Ray, Met),
    ) {
        let plan = self.plan;
        while let Some(mut cone) = stack.pop() {
            loop {
                // A cone that `enters` starts inside the triangle of its edge. Any other cone first crosses
                // the edge, unless it ends there.
                let twin = if cone.enters {
                    cone.edge
                } else {
                    let twin = plan.edges[cone.edge as usize].twin;
                    if !is_near(cone.edge) {
                        meet(cone.edge, cone.right, cone.left, Met::Far);
                        break;
                    }
                    if twin & (WALL | BLOCKS) != 0 {
                        // The outer boundary (no twin) ends every cone. A wall ends it only after `through`
                        // other walls.
                        let blocks = twin & BLOCKS != 0 && (twin & TWIN == TWIN || stops(cone.edge));
                        let ends = blocks && (cone.through == 0 || twin & TWIN == TWIN);
                        if ends {
                            meet(cone.edge, cone.right, cone.left, Met::Ended);
                            break;
                        }
                        meet(cone.edge, cone.right, cone.left, Met::Passed);
                        cone.through -= u32::from(blocks);
                    }
                    twin & TWIN
                };
                enter(twin / 3, cone.right, cone.left);
                // In the new triangle, the ray through the apex (the corner opposite the crossed edge)
                // divides the cone. The part right of this ray leaves through one edge, the part left of it
                // through the other.
                let (to_right, to_left) = (next(twin), previous(twin));
                let apex = plan.edges[to_left as usize].origin;
                let [x, y] = plan.points[apex as usize];
                let middle = Ray { point: apex, offset: [x - self.eye[0], y - self.eye[1]] };
                cone.enters = false;
                if !self.is_left(middle, cone.left) {
                    cone.edge = to_right;
                } else if !self.is_left(cone.right, middle) {
                    cone.edge = to_left;
                } else {
                    stack.push(Cone { edge: to_left, right: middle, ..cone });
                    cone.edge = to_right;
                    cone.left = middle;
                }
            }
        }
    }

    /// Returns the point where a ray meets an edge, whose ends lie on either side of the ray or on it. Exact
    /// if the ray passes through an end; otherwise rounded, but between the ends.
    pub(crate) fn meet(&self, ray: Ray, edge: u32) -> Point {
        let (a, b) = (self.plan.edges[edge as usize].origin, self.plan.edges[next(edge) as usize].origin);
        if ray.point == a || ray.point == b {
            return self.plan.points[ray.point as usize];
        }
        let [a, b] = [a, b].map(|v| self.plan.points[v as usize]);
        let [of_a, of_b] =
            [a, b].map(|[x, y]| ray.offset[0] * (y - self.eye[1]) - ray.offset[1] * (x - self.eye[0]));
        let share = of_a / (of_a - of_b);
        let share = if share > 0.0 { share.min(1.0) } else { 0.0 };
        [0, 1].map(|axis| a[axis] + share * (b[axis] - a[axis]))
    }
}

/// Returns whether the ray from an eye through the second of two vertices of a plan is strictly to the left
/// of that through the first. `None` if a point is no vertex.
#[cfg(test)]
pub(super) fn is_left_of(plan: &Plan, eye: Point, points: [Point; 2]) -> Option<bool> {
    let expansion = Expansion { plan, eye, sector: &[] };
    let ray = |point| Some(expansion.ray(plan.points.iter().position(|p| *p == point)? as u32));
    Some(expansion.is_left(ray(points[0])?, ray(points[1])?))
}
