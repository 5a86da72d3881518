//! Vertices that a point reaches along straight segments that touch no wall on the way.
//!
//! Triangular expansion, as in `expand.rs`, with closed cones: a vertex on the bound of a cone counts, unless
//! an end of a wall lies on the bound before it.

use super::plan::{BLOCKS, Plan};
use super::predicates::{Point, orient};
use super::triangulation::{Place, next, previous};
use alloc::vec::Vec;

/// Ray from the point through a vertex, which bounds a cone.
#[derive(Clone, Copy, Debug)]
struct Bound {
    /// Index of the vertex in `Plan::points`.
    vertex: u32,
    /// Whether a vertex with a wall lies on the ray, at or before the edge that the cone leaves through.
    touches: bool,
}

/// Cone where it leaves a triangle.
#[derive(Clone, Copy, Debug)]
struct ClosedCone {
    /// Half-edge across which the cone leaves a triangle, an index into `Plan::edges`.
    edge: u32,
    right: Bound,
    left: Bound,
}

/// Search for the vertices that a point reaches. Reuses its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Reach {
    /// Vertices reached, each once.
    pub(super) vertices: Vec<u32>,
    cones: Vec<ClosedCone>,
    /// For each vertex, the number of the last search that reached it.
    marks: Vec<u32>,
    /// Number of the present search. 0 before the first.
    search: u32,
}

impl Plan {
    /// Returns whether a wall along a half-edge stops lines of sight from one side at least. False on the
    /// outer rectangle.
    pub(super) fn is_solid(&self, h: u32) -> bool {
        let edge = self.edges[h as usize];
        edge.twin().is_some_and(|twin| (edge.twin | self.edges[twin as usize].twin) & BLOCKS != 0)
    }
}

impl Reach {
    /// Finds the vertices to which a segment from `point` leads that crosses no wall and touches none between
    /// its ends. `place` is the place of the point; `is_corner` tells whether a wall ends at or runs through
    /// a vertex. A point on a wall reaches the vertices on both sides of it. Takes time in proportion to the
    /// triangles that the point sees.
    pub(super) fn search(
        &mut self,
        plan: &Plan,
        point: Point,
        place: Place,
        is_corner: impl Fn(u32) -> bool,
    ) {
        self.vertices.clear();
        self.cones.clear();
        self.search = self.search.wrapping_add(1);
        if self.search == 0 || self.marks.len() != plan.points.len() {
            self.marks.clear();
            self.marks.resize(plan.points.len(), 0);
            self.search = 1;
        }
        let origin = |h: u32| plan.edges[h as usize].origin;
        match place {
            Place::Triangle(t) => (3 * t..3 * t + 3).for_each(|h| self.begin(plan, h, &is_corner)),
            Place::Edge(h) => {
                self.find(origin(h));
                self.find(origin(next(h)));
                for h in [Some(h), plan.edges[h as usize].twin()].into_iter().flatten() {
                    self.begin(plan, next(h), &is_corner);
                    self.begin(plan, previous(h), &is_corner);
                }
            }
            Place::Vertex(h) => plan.fan(h).for_each(|h| self.begin(plan, next(h), &is_corner)),
            Place::Outside => {}
        }
        while let Some(cone) = self.cones.pop() {
            let Some(twin) = plan.edges[cone.edge as usize].twin().filter(|_| !plan.is_solid(cone.edge))
            else {
                continue;
            };
            let (to_right, to_left) = (next(twin), previous(twin));
            let apex = origin(to_left);
            let side =
                |bound: Bound| orient(point, plan.points[bound.vertex as usize], plan.points[apex as usize]);
            let touches = is_corner(apex);
            let beside = |bound: Bound| Bound { touches: bound.touches || touches, ..bound };
            let (of_left, of_right) = (side(cone.left), side(cone.right));
            if of_left < 0.0 && of_right > 0.0 {
                self.find(apex);
                let middle = Bound { vertex: apex, touches };
                self.cones.push(ClosedCone { edge: to_left, right: middle, ..cone });
                self.cones.push(ClosedCone { edge: to_right, left: middle, ..cone });
            } else if of_left >= 0.0 {
                let mut left = cone.left;
                if of_left == 0.0 {
                    if !left.touches {
                        self.find(apex);
                    }
                    left = beside(left);
                }
                self.cones.push(ClosedCone { edge: to_right, left, ..cone });
            } else {
                let mut right = cone.right;
                if of_right == 0.0 {
                    if !right.touches {
                        self.find(apex);
                    }
                    right = beside(right);
                }
                self.cones.push(ClosedCone { edge: to_left, right, ..cone });
            }
        }
    }

    /// Begins with the cone from the point to half-edge `edge` of a triangle that contains the point.
    fn begin(&mut self, plan: &Plan, edge: u32, is_corner: impl Fn(u32) -> bool) {
        let [right, left] = [edge, next(edge)].map(|h| plan.edges[h as usize].origin);
        self.find(right);
        self.find(left);
        let bound = |vertex| Bound { vertex, touches: is_corner(vertex) };
        self.cones.push(ClosedCone { edge, right: bound(right), left: bound(left) });
    }

    fn find(&mut self, vertex: u32) {
        let mark = &mut self.marks[vertex as usize];
        if core::mem::replace(mark, self.search) != self.search {
            self.vertices.push(vertex);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Wall;
    use super::*;

    /// Marks of searches before the number of searches wraps count no more.
    #[test]
    fn marks_are_forgotten_when_searches_wrap() {
        let plan = Plan::new(&[Wall::new([-1.0, 1.0], [1.0, 1.0])]).unwrap();
        let mut reach = Reach::default();
        let search = |reach: &mut Reach| {
            reach.search(
                &plan,
                [0.0, 0.0],
                plan.locate_near([0.0, 0.0], super::super::triangulation::NONE),
                |_| true,
            );
            reach.vertices.len()
        };
        let found = search(&mut reach);
        reach.search = u32::MAX;
        reach.marks.fill(0);
        assert_eq!(search(&mut reach), found, "vertices that the point reaches");
    }

    /// A point reaches the vertices on one ray up to the first vertex at which a wall ends, that vertex too.
    #[test]
    fn rays_end_where_they_touch_a_wall() {
        let walls = [1.0, 2.0, 3.0]
            .map(|k| Wall::new([k, k], [k + 0.5, k - 1.0]).with_opacity(super::super::Opacity::Clear));
        let plan = Plan::new(&walls).unwrap();
        let place = plan.locate_near([0.0, 0.0], super::super::triangulation::NONE);
        for corners in 0..8 {
            let is_corner = |v: u32| {
                let [x, y] = plan.points[v as usize];
                x == y && (1.0..4.0).contains(&x) && corners >> x as u32 & 1 != 0
            };
            let mut reach = Reach::default();
            reach.search(&plan, [0.0, 0.0], place, is_corner);
            let is_found = |k: f64| reach.vertices.iter().any(|&v| plan.points[v as usize] == [k; 2]);
            let expected = [true, corners & 2 == 0, corners & 6 == 0];
            assert_eq!([1.0, 2.0, 3.0].map(is_found), expected, "walls end at {corners:b}");
        }
    }
}
