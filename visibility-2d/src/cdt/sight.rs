//! Lines of sight between two points, and the first wall on a ray.
//!
//! Both queries walk from triangle to triangle along the segment, and decide by exact orientations of three
//! given points.
//!
//! A segment through a vertex passes if it could be pushed aside there to the left or to the right without
//! crossing a wall. A segment that runs along walls must not change sides until it leaves them.

use super::error::PlanError;
use super::plan::{BLOCKS, Plan};
use super::predicates::{Point, are_heights, area, area_error, checked, is_same_way, orient};
use super::triangulation::{NONE, Place, next, previous};

/// Point where a ray ends at a wall or at the rectangle around the plan.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub struct WallHit {
    /// Point in world units where the ray ends, rounded.
    pub point: [f64; 2],
    /// Number of the wall where the ray ends, the least if several stop it there. `None` at the rectangle
    /// around the plan.
    pub wall: Option<u32>,
}

/// Bit for the left side of a vertex, as seen along the segment. In a mask of sides, it is set if the segment
/// may pass the vertex on its left side.
const LEFT: u8 = 1;
/// Bit for the right side of a vertex: see [`LEFT`].
const RIGHT: u8 = 2;

/// Position of a walk from triangle to triangle along a segment.
#[derive(Clone, Copy, Debug)]
enum At {
    /// The walk is in the triangle of this half-edge, about to cross the half-edge.
    Edge(u32),
    /// The walk is at the origin of this half-edge. The second number is a mask of [`LEFT`] and [`RIGHT`]:
    /// the sides on which the segment may pass as far as this vertex. Both, unless it came along a blocking
    /// wall and must stay on one side of the wall.
    Vertex(u32, u8),
}

/// Reason why a walk along a segment ended.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Stop {
    /// The walk has reached the second point, or no more triangle is on the way.
    Reached,
    /// A wall or the outer rectangle stops the segment at this half-edge, between its ends.
    Edge(u32),
    /// A wall or the outer rectangle stops the segment at the origin of this half-edge. The second number is
    /// the mask of sides of [`At::Vertex`] with which the segment came to the vertex; 0 at the rectangle.
    Vertex(u32, u8),
}

impl Plan {
    /// Returns whether `a` sees `b`: whether no wall stops the segment between them. Exact, and symmetric
    /// unless one-way walls are in the way. Coordinates below 1e-40 in absolute value count as 0. A point on
    /// a wall sees both sides of the wall. A segment may touch the end of a wall, and may run along a wall.
    /// Points outside the rectangle around the plan are allowed. Takes time proportional to the number of
    /// triangles crossed.
    ///
    /// ```
    /// use visibility_2d::cdt::{Plan, Wall};
    /// let plan = Plan::new(&[Wall::new([0.0, -1.0], [0.0, 1.0])])?;
    /// assert!(!plan.sees([-1.0, 0.0], [1.0, 0.0])?);
    /// assert!(plan.sees([-1.0, 0.0], [0.0, 0.0])?); // the wall itself is seen
    /// assert!(plan.sees([-1.0, 1.0], [1.0, 1.0])?); // past the end of the wall
    /// # Ok::<(), visibility_2d::cdt::PlanError>(())
    /// ```
    ///
    /// # Errors
    /// [`PlanError::Coordinate`] with index 0 or 1 if a coordinate of `a` or `b` is NaN, infinite or above
    /// 1e60 in absolute value.
    pub fn sees(&self, a: impl Into<[f64; 2]>, b: impl Into<[f64; 2]>) -> Result<bool, PlanError> {
        let (a, b) = (checked(a.into(), 0)?, checked(b.into(), 1)?);
        let walk = Walk { plan: self, a, b, is_ray: false, both_ways: false, heights: None };
        Ok(a == b || walk.run() == Stop::Reached)
    }

    /// Returns whether a straight path leads from `a` to `b`: as [`sees`](Self::sees), but one-way walls stop
    /// paths from both sides. Both points must be [`checked`].
    pub(super) fn is_straight_path(&self, a: Point, b: Point) -> bool {
        let walk = Walk { plan: self, a, b, is_ray: false, both_ways: true, heights: None };
        a == b || walk.run() == Stop::Reached
    }

    /// Returns whether two points with heights see each other. Like [`sees`](Self::sees), but a line of sight
    /// may also pass over or under walls with [heights](super::Wall::heights). A wall stops the segment if
    /// the segment's height at their crossing is above the wall's lower end and below its upper end. If
    /// rounding (about 2^-49 of the heights) leaves this undecided, the segment passes, so visible points are
    /// never called hidden.
    ///
    /// ```
    /// use visibility_2d::cdt::{Plan, Wall};
    /// // A parapet 1 m high, halfway between two people.
    /// let plan = Plan::new(&[Wall::new([0.0, -1.0], [0.0, 1.0]).with_heights(0.0, 1.0)])?;
    /// assert!(plan.sees_at(([-2.0, 0.0], 1.7), ([2.0, 0.0], 1.7))?);
    /// assert!(!plan.sees_at(([-2.0, 0.0], 1.7), ([2.0, 0.0], 0.2))?); // passes at 0.95
    /// # Ok::<(), visibility_2d::cdt::PlanError>(())
    /// ```
    ///
    /// # Errors
    /// [`PlanError::Coordinate`] with index 0 or 1 if a coordinate of `a` or `b` is NaN, infinite or above
    /// 1e60 in absolute value, and [`PlanError::Heights`] if a height is.
    pub fn sees_at(
        &self,
        (a, of_a): (impl Into<[f64; 2]>, f64),
        (b, of_b): (impl Into<[f64; 2]>, f64),
    ) -> Result<bool, PlanError> {
        let (a, b) = (checked(a.into(), 0)?, checked(b.into(), 1)?);
        if !are_heights([of_a, of_b]) {
            return Err(PlanError::Heights);
        }
        let walk = Walk { plan: self, a, b, is_ray: false, both_ways: false, heights: Some([of_a, of_b]) };
        Ok(a == b || walk.run() == Stop::Reached)
    }

    /// Follows a ray from an eye through a point, to the first wall that stops the ray or to the rectangle
    /// around the plan. `None` if the two points are equal, or if the ray does not enter the rectangle; a ray
    /// along a side of the rectangle may end anywhere on the side. Walls stop a ray as in
    /// [`sees`](Self::sees), which is exact.
    ///
    /// # Errors
    /// [`PlanError::Coordinate`] with index 0 or 1 if a coordinate of `eye` or `through` is NaN, infinite or
    /// above 1e60 in absolute value.
    pub fn ray(
        &self,
        eye: impl Into<[f64; 2]>,
        through: impl Into<[f64; 2]>,
    ) -> Result<Option<WallHit>, PlanError> {
        let (a, b) = (checked(eye.into(), 0)?, checked(through.into(), 1)?);
        if a == b {
            return Ok(None);
        }
        let walk = Walk { plan: self, a, b, is_ray: true, both_ways: false, heights: None };
        Ok(match walk.run() {
            Stop::Reached => None,
            Stop::Edge(h) => {
                let [p, q] = self.ends(h);
                let (of_p, of_q) = (orient(a, b, p), orient(a, b, q));
                let share = of_p / (of_p - of_q);
                let point = [0, 1].map(|axis| p[axis] + share * (q[axis] - p[axis]));
                Some(WallHit { point, wall: self.wall_that_stops(h) })
            }
            Stop::Vertex(h, came) => {
                let stops = self.fan(h).filter_map(|h| walk.stop_at(h, came));
                Some(WallHit {
                    point: self.start(h),
                    wall: stops.filter_map(|h| self.wall_that_stops(h)).min(),
                })
            }
        })
    }

    /// Returns the number of the wall along half-edge `h` that stops lines of sight out of its triangle, the
    /// least if there are several. `None` if there is none.
    fn wall_that_stops(&self, h: u32) -> Option<u32> {
        let piece = self.piece[h as usize];
        let walls = if piece == NONE { &[] } else { self.walls_of(piece) };
        walls.iter().copied().find(|&wall| self.walls()[wall as usize].stops(self.ends(h)))
    }
}

/// A walk along the segment from `a` to `b`, which differ, or along the ray from `a` through `b`.
struct Walk<'a> {
    plan: &'a Plan,
    /// Start of the segment or ray.
    a: Point,
    /// End of the segment, or a point that the ray passes.
    b: Point,
    /// True for a ray, which does not end at `b`; false for the segment.
    is_ray: bool,
    /// True if one-way walls stop the walk from both sides, false if from their right side alone.
    both_ways: bool,
    /// Heights at `a` and `b`. With `None`, walls stop the walk at any height.
    heights: Option<[f64; 2]>,
}

impl Walk<'_> {
    fn run(&self) -> Stop {
        let plan = self.plan;
        let Some(mut at) = self.begin() else { return Stop::Reached };
        loop {
            at = match at {
                At::Edge(h) => {
                    let [p, q] = plan.ends(h);
                    let edge = plan.edges[h as usize];
                    if !self.is_ray && (edge.twin().is_none() || orient(p, q, self.b) >= 0.0) {
                        return Stop::Reached;
                    }
                    match edge.twin() {
                        Some(twin) if !self.is_stopped(h, None) => match self.cross(twin) {
                            Some(at) => at,
                            None => return Stop::Reached,
                        },
                        _ => return Stop::Edge(h),
                    }
                }
                At::Vertex(h, came) => {
                    let is_start = plan.start(h) == self.a;
                    if !self.is_ray && plan.start(h) == self.b {
                        return Stop::Reached;
                    }
                    let sides = if is_start { came } else { came & self.open_sides(h) };
                    if sides == 0 {
                        return Stop::Vertex(h, came);
                    }
                    match self.leave(h, sides) {
                        Some(at) => at,
                        // A ray leaves the rectangle at a corner; a segment has ended on an edge.
                        None if self.is_ray => return Stop::Vertex(h, 0),
                        None => return Stop::Reached,
                    }
                }
            };
        }
    }

    /// Returns whether a wall along half-edge `h` stops the walk on its way out of the triangle of `h`.
    /// Without `end`, the walk crosses `h` between its ends. With `end`, the walk passes that end of `h`.
    fn is_stopped(&self, h: u32, end: Option<Point>) -> bool {
        let blocks =
            self.plan.edges[h as usize].twin & BLOCKS != 0 || self.both_ways && self.plan.is_solid(h);
        if !blocks {
            return false;
        }
        let Some([of_a, of_b]) = self.heights else { return true };
        // The share of the way is wrong by 8 u, and by the errors of areas that nearly cancel: a quotient of
        // numbers b / d from 0 to 1 by two errors over d. The height adds the error of the difference of
        // heights, and two roundings.
        let (share, doubt) = end.map_or_else(
            || {
                let [p, q] = self.plan.ends(h);
                let [(before, of_before), (after, of_after)] =
                    [self.a, self.b].map(|end| (area(p, q, end), area_error(p, q, end)));
                let whole = before - after;
                let doubt = 2.0 * (of_before + of_after) / whole.abs();
                ((before / whole).clamp(0.0, 1.0), if doubt < 1.0 { doubt } else { 1.0 })
            },
            |end| {
                let axis = self.longer_axis();
                ((end[axis] - self.a[axis]) / (self.b[axis] - self.a[axis]), 0.0)
            },
        );
        let height = of_a + share * (of_b - of_a);
        let error =
            16.0 * f64::EPSILON * (of_a.abs() + of_b.abs()) + doubt * (of_b - of_a).abs() + f64::MIN_POSITIVE;
        self.plan.stops_between(h, [height - error, height + error])
    }

    fn longer_axis(&self) -> usize {
        let [x, y] = [0, 1].map(|axis| (self.b[axis] - self.a[axis]).abs());
        usize::from(y > x)
    }

    /// Returns the side of the segment's line on which a point lies: positive to the left.
    fn side(&self, point: Point) -> f64 {
        orient(self.a, self.b, point)
    }

    fn is_ahead(&self, point: Point) -> bool {
        is_same_way(self.a, self.b, point)
    }

    /// Returns the walk's first position. `None` if the walk does not cross the rectangle, or if the position
    /// would be a vertex beyond the end of the segment.
    fn begin(&self) -> Option<At> {
        let plan = self.plan;
        match plan.locate(self.a, plan.near(self.a)) {
            Place::Triangle(t) => self.leave_triangle(3 * t),
            Place::Edge(h) => {
                let [p, q] = plan.ends(h);
                let side = orient(p, q, self.b);
                if side > 0.0 {
                    return self.leave_triangle(h);
                }
                if side < 0.0 {
                    // At the outer rectangle (no twin), a ray ends and a segment leaves.
                    return match plan.edges[h as usize].twin() {
                        Some(twin) => self.leave_triangle(twin),
                        None if self.is_ray => Some(At::Edge(h)),
                        None => None,
                    };
                }
                let end = if self.is_ahead(p) { h } else { next(h) };
                self.runs_to(end).then_some(At::Vertex(end, LEFT | RIGHT))
            }
            Place::Vertex(h) => Some(At::Vertex(h, LEFT | RIGHT)),
            Place::Outside => self.enter(),
        }
    }

    /// Returns whether the walk reaches the origin of half-edge `h`, which lies ahead on the segment's line.
    /// Always true for a ray. True for a segment that ends exactly there.
    fn runs_to(&self, h: u32) -> bool {
        let axis = usize::from(self.a[0] == self.b[0]);
        let (from, to, end) = (self.a[axis], self.b[axis], self.plan.start(h)[axis]);
        self.is_ray || if to > from { to >= end } else { to <= end }
    }

    /// Returns the position where the walk's line leaves the triangle of `h`, in which or on whose boundary
    /// the walk is. `None` if this is a vertex beyond the end of the segment.
    fn leave_triangle(&self, h: u32) -> Option<At> {
        [h, next(h), previous(h)].into_iter().find_map(|h| {
            let [p, q] = self.plan.ends(h);
            let side = self.side(p);
            if side == 0.0 && self.is_ahead(p) {
                return Some(At::Vertex(h, LEFT | RIGHT)).filter(|_| self.runs_to(h));
            }
            (side < 0.0 && self.side(q) > 0.0).then_some(At::Edge(h))
        })
    }

    /// Returns the next position of a walk that has entered the triangle of `h` across `h`, whose first end
    /// is to the left. `None` if the next position would be a vertex beyond the end of the segment.
    fn cross(&self, h: u32) -> Option<At> {
        let apex = previous(h);
        let side = self.side(self.plan.start(apex));
        if side == 0.0 {
            return self.runs_to(apex).then_some(At::Vertex(apex, LEFT | RIGHT));
        }
        Some(At::Edge(if side > 0.0 { next(h) } else { apex }))
    }

    /// Returns the first position of a walk that begins outside the rectangle. `None` if the walk does not
    /// enter the rectangle, or if the position would be a vertex beyond the end of the segment.
    fn enter(&self) -> Option<At> {
        let plan = self.plan;
        for h in plan.outer() {
            let [p, q] = plan.ends(h);
            // A side whose first end is to the left and whose second end is to the right is ahead.
            let before = orient(p, q, self.a) < 0.0;
            if before && self.side(p) > 0.0 && self.side(q) < 0.0 {
                let reaches = self.is_ray || orient(p, q, self.b) > 0.0;
                return if reaches { self.cross(h) } else { None };
            }
        }
        // A line through two corners enters the rectangle at the nearer one.
        let axis = usize::from(self.a[0] == self.b[0]);
        let distance = |h: &u32| (plan.start(*h)[axis] - self.a[axis]).abs();
        let is_met = |h: &u32| {
            let corner = plan.start(*h);
            self.side(corner) == 0.0 && self.is_ahead(corner) && self.runs_to(*h)
        };
        let corners = plan.outer().into_iter().filter(is_met);
        let corner = corners.min_by(|g, h| distance(g).total_cmp(&distance(h)));
        corner.map(|h| At::Vertex(h, LEFT | RIGHT))
    }

    /// Returns the sides on which the segment may pass the origin of half-edge `h`: [`LEFT`], [`RIGHT`], both
    /// or 0. A side is missing if a wall at the vertex stops the segment there. Left and right are as seen
    /// along the segment, from `a` to `b`.
    fn open_sides(&self, h: u32) -> u8 {
        let is_closed = |side: u8| self.plan.fan(h).any(|h| self.stop_at(h, side).is_some());
        [LEFT, RIGHT].into_iter().filter(|&side| !is_closed(side)).sum()
    }

    /// Returns the half-edge, `h` or its twin, at which a wall along this edge stops a walk that passes the
    /// origin of `h`. `sides` are the sides on which the walk passes that vertex. `None` if no wall along the
    /// edge stops the walk, or if the edge lies on none of these sides.
    fn stop_at(&self, h: u32, sides: u8) -> Option<u32> {
        let plan = self.plan;
        let twin = plan.edges[h as usize].twin()?;
        let side = self.side(plan.start(next(h)));
        // On the left, the segment passes the edges clockwise, so it leaves the triangle of this half-edge.
        let passed = if side > 0.0 && sides & LEFT != 0 {
            h
        } else if side < 0.0 && sides & RIGHT != 0 {
            twin
        } else {
            return None;
        };
        self.is_stopped(passed, Some(plan.start(h))).then_some(passed)
    }

    /// Returns the next position from the origin of `h` in the direction of `b`, if the segment may pass this
    /// vertex on `sides`. `None` if no triangle lies in this direction, or if `b` is on the edge along which
    /// the segment runs.
    fn leave(&self, h: u32, sides: u8) -> Option<At> {
        let plan = self.plan;
        let from = plan.start(h);
        let ahead = |point: Point| {
            let axis = usize::from(self.a[0] == self.b[0]);
            (self.b[axis] > self.a[axis]) == (point[axis] > from[axis])
        };
        // The segment continues along an edge of the vertex, or between the other two corners of exactly one
        // triangle around the vertex.
        plan.fan(h)
            .find_map(|h| {
                let side = self.side(plan.start(next(h)));
                if side == 0.0 && ahead(plan.start(next(h))) {
                    return Some((h, true));
                }
                let is_through = side < 0.0 && self.side(plan.start(previous(h))) > 0.0;
                is_through.then_some((h, false))
            })
            .and_then(|(h, along)| {
                // The segment leaves through the triangle's far edge.
                if !along {
                    return Some(At::Edge(next(h)));
                }
                // The segment runs along an edge. If the edge is a blocking wall, only the sides that were
                // open remain open.
                let edge = plan.edges[h as usize];
                let back = edge.twin().map_or(0, |twin| plan.edges[twin as usize].twin);
                let is_wall = edge.twin().is_some_and(|twin| {
                    let stops = |h, flags: u32| {
                        flags & BLOCKS != 0
                            && self.heights.is_none_or(|[a, b]| plan.stops_between(h, [a.min(b), a.max(b)]))
                    };
                    stops(h, edge.twin) || stops(twin, back)
                });
                self.runs_to(next(h))
                    .then_some(At::Vertex(next(h), if is_wall { sides } else { LEFT | RIGHT }))
            })
    }
}
