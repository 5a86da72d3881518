//! Visibility from a region: beams of lines through the triangulation, clipped in the dual plane.
//!
//! A directed line of the plan is a point in the dual plane, a vertex is a line, and the lines that pass a
//! vertex on its left are a half-plane. The lines of a beam pass through a sequence of edges, between the
//! vertices to the right and those to the left, so in the dual they form a convex polygon. A side of this
//! polygon is a vertex that lines of the beam touch, and a corner is a line through two vertices. The polygon
//! is stored as these vertices, not as coordinates. Clipping it at the next vertex asks on which side of each
//! corner line the vertex lies, which is an exact orientation of three given points.
//!
//! Related to the stabbing lines of Seth Teller and Carlo Sequin, "Visibility Preprocessing for Interactive
//! Walkthroughs", 1991, here without linear programs.

use super::error::PlanError;
use super::plan::{BLOCKS, Plan, TWIN, WALL};
use super::predicates::{Point, checked, orient};
use super::triangulation::{NONE, Place, next, previous};
use super::wall::add_walls;
use alloc::vec::Vec;

/// Maximum number of times that beams from one region may enter a triangle, all beams together. Each takes
/// about 40 ns.
const MAX_STEPS: usize = 1 << 24;

/// Side of the convex polygon that stands for a beam of lines of sight in the dual plane. A point of the dual
/// plane is a line of the plan, and a line of the dual plane is a vertex of the plan, so all lines of sight
/// on a side touch one vertex. The struct also holds the polygon's corner after the side, which is a line
/// through two vertices.
#[derive(Clone, Copy, Debug)]
struct Side {
    /// Vertex that all lines of sight on this side touch, an index into `Plan::points`.
    vertex: u32,
    /// Two vertices through which the line at the corner runs, in the line's direction, as indices into
    /// `Plan::points`.
    corner: [u32; 2],
}

/// Beam of lines of sight where it leaves a triangle across an edge.
#[derive(Clone, Copy, Debug)]
struct Beam {
    /// Half-edge across which the beam leaves a triangle, an index into `Plan::edges`.
    edge: u32,
    /// Range, in `RegionVisibility::sides`, of the sides of the beam's polygon in the dual plane: start, and
    /// exclusive end.
    sides: (u32, u32),
    /// Length to which `RegionVisibility::sides` is truncated when this beam is taken from the stack. The
    /// sides of this beam, and of the beams below it on the stack, have indices below this length.
    kept: u32,
}

/// Result of [`Plan::look_from_region`]: walls and triangles seen. Reuses its memory.
#[derive(Clone, Debug, Default)]
pub struct RegionVisibility {
    /// Indices of the triangles seen, each once. Those that the region overlaps come first.
    triangles: Vec<u32>,
    /// Numbers of the walls seen, each once.
    walls: Vec<u32>,
    /// For each triangle of the plan, the number of the last query that added it to `triangles`.
    triangle_marks: Vec<u32>,
    /// For each wall of the plan, the number of the last query that added it to `walls`.
    wall_marks: Vec<u32>,
    /// Number of the present query, with which triangles and walls are marked. 0 before the first query.
    query: u32,
    /// Sides of the polygons of all beams in `beams`. Each beam holds the range of its own.
    sides: Vec<Side>,
    /// Stack of the beams that are still to be followed.
    beams: Vec<Beam>,
    /// Points given by the caller, whose convex hull is the region, in world units. Without repetitions,
    /// ascending by x, then y. Points inside the hull are kept.
    pub(super) points: Vec<Point>,
    /// Corners of the region, the convex hull of `points`, counter-clockwise from the first point of
    /// `points`. One corner if the region is a point, two if it is a segment.
    pub(super) hull: Vec<Point>,
    /// Scratch: for each corner of the present beam's polygon, the side of the corner's line on which the
    /// next vertex lies: 1 for left, -1 for right, 0 for on the line.
    signs: Vec<i8>,
    /// Number of triangles that beams have entered in the present query.
    steps: usize,
}

impl RegionVisibility {
    /// Makes an empty result, without triangles and walls.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the numbers of the walls seen, each once, in no particular order.
    pub fn walls(&self) -> &[u32] {
        &self.walls
    }

    /// Returns the numbers of the triangles seen, each once. Triangles that the region overlaps come first.
    /// See [`Plan::triangle`].
    pub fn triangles(&self) -> &[u32] {
        &self.triangles
    }

    /// Returns the number of triangles that beams entered, a measure of the work.
    pub fn steps(&self) -> usize {
        self.steps
    }

    pub(super) fn begin(&mut self, plan: &Plan) {
        self.triangles.clear();
        self.walls.clear();
        self.beams.clear();
        self.sides.clear();
        self.points.clear();
        self.hull.clear();
        self.steps = 0;
        self.query = self.query.wrapping_add(1);
        let sizes = (plan.triangle_count(), plan.walls().len());
        if self.query == 0 || (self.triangle_marks.len(), self.wall_marks.len()) != sizes {
            for (marks, size) in [(&mut self.triangle_marks, sizes.0), (&mut self.wall_marks, sizes.1)] {
                marks.clear();
                marks.resize(size, 0);
            }
            self.query = 1;
        }
    }

    /// Adds a triangle to the result. Returns false if the result contains it already.
    fn add_triangle(&mut self, triangle: u32) -> bool {
        let mark = &mut self.triangle_marks[triangle as usize];
        let is_new = core::mem::replace(mark, self.query) != self.query;
        if is_new {
            self.triangles.push(triangle);
        }
        is_new
    }
}

impl Plan {
    /// Finds the walls and triangles visible from anywhere inside the convex hull of `points`, in world
    /// units: a point, a segment, a convex cell.
    ///
    /// Conservative in general, and exact if the region is inside one triangle of the plan: a wall or
    /// triangle is listed if a line through it meets the region, and crosses no wall on its way from the
    /// triangles that the region overlaps. For exact answers in other cases, add the region's outline to the
    /// plan as [clear](super::Opacity::Clear) walls, and unite the results of its triangles. Takes time
    /// proportional to the number of triangles that beams enter: see [`RegionVisibility::steps`].
    ///
    /// # Errors
    /// - [`PlanError::Coordinate`] if a coordinate of a point is NaN, infinite or above 1e60 in absolute
    ///   value.
    /// - [`PlanError::Region`] if there is no point, or a point is outside the rectangle around the plan.
    /// - [`PlanError::TooMany`] if beams enter more than 2^24 triangles.
    ///
    /// After an error the result is invalid: count everything as visible.
    ///
    /// ```
    /// use visibility_2d::cdt::{Plan, RegionVisibility, Wall};
    /// // A screen 2 wide, and a post of 0.2 far behind it.
    /// let post = Wall::new([-0.1, 9.0], [0.1, 9.0]);
    /// let plan = Plan::new(&[Wall::new([-1.0, 1.0], [1.0, 1.0]), post])?;
    /// let mut answer = RegionVisibility::new();
    /// plan.look_from_region(&[[0.0, 0.0]], &mut answer)?;
    /// assert!(!answer.walls().contains(&1));
    /// plan.look_from_region(&[[-2.0, 0.0], [2.0, 0.0]], &mut answer)?;
    /// assert!(answer.walls().contains(&1));
    /// # Ok::<(), visibility_2d::cdt::PlanError>(())
    /// ```
    pub fn look_from_region(
        &self,
        points: &[[f64; 2]],
        answer: &mut RegionVisibility,
    ) -> Result<(), PlanError> {
        answer.begin(self);
        for (index, &point) in points.iter().enumerate() {
            answer.points.push(checked(point, index)?);
        }
        convex_hull(&mut answer.points, &mut answer.hull);
        self.overlapped(answer)?;
        self.follow_all(answer)
    }

    /// Adds to `answer` the walls and triangles visible from the region `answer.hull`. The triangles that the
    /// region overlaps must already be listed in `answer`.
    pub(super) fn follow_all(&self, answer: &mut RegionVisibility) -> Result<(), PlanError> {
        for index in 0..answer.triangles.len() {
            let first = 3 * answer.triangles[index];
            for edge in first..first + 3 {
                // The region touches the triangle, so it sees all walls along its edges. It touches those on
                // whose line it lies, like an eye on a wall.
                let piece = self.piece[edge as usize];
                if piece != NONE {
                    let walls = self.walls_of(piece);
                    add_walls(&mut answer.walls, &mut answer.wall_marks, answer.query, walls);
                }
                self.follow_from(edge, answer)?;
            }
        }
        Ok(())
    }

    /// Adds to `answer` the triangles whose overlap with `answer.hull` has an area. For a hull without area,
    /// a point or a segment, adds all triangles that the hull touches.
    ///
    /// # Errors
    /// [`PlanError::Region`] if the hull is empty or reaches out of the rectangle around the plan.
    pub(super) fn overlapped(&self, answer: &mut RegionVisibility) -> Result<(), PlanError> {
        let first = *answer.hull.first().ok_or(PlanError::Region)?;
        if !self.is_inside(&answer.hull) {
            return Err(PlanError::Region);
        }
        let hull = core::mem::take(&mut answer.hull);
        let add = |h: u32, answer: &mut RegionVisibility| {
            if overlap(&self.corners(h / 3), &hull) {
                answer.add_triangle(h / 3);
            }
        };
        match self.locate(first, self.near(first)) {
            Place::Triangle(t) => add(3 * t, answer),
            Place::Edge(h) => {
                add(h, answer);
                if let Some(twin) = self.edges[h as usize].twin() {
                    add(twin, answer);
                }
            }
            Place::Vertex(h) => self.fan(h).for_each(|h| add(h, answer)),
            Place::Outside => {}
        }
        // The overlapped triangles are connected through edges, because the hull is convex. One without area
        // may pass through a vertex, and touches all triangles around it.
        let mut index = 0;
        while index < answer.triangles.len() {
            let first = 3 * answer.triangles[index];
            for h in first..first + 3 {
                if let Some(twin) = self.edges[h as usize].twin() {
                    add(twin, answer);
                }
            }
            index += 1;
        }
        answer.hull = hull;
        Ok(())
    }

    /// Finds the walls and triangles visible from anywhere in a triangle. Exact.
    pub(super) fn look_from_triangle(
        &self,
        triangle: u32,
        answer: &mut RegionVisibility,
    ) -> Result<(), PlanError> {
        answer.begin(self);
        answer.hull.extend(self.corners(triangle));
        answer.add_triangle(triangle);
        self.follow_all(answer)
    }

    /// Lists the triangles into which a mover can get. These are the triangles that the convex polygon `body`
    /// overlaps, and all that can be reached from there within the convex polygon `outer`, across edges that
    /// do not block lines of sight both ways. Both polygons are given by their corners, counter-clockwise,
    /// and have an area; `outer` contains `body`. Afterwards the hull of `answer` is `outer`.
    pub(super) fn reached(
        &self,
        body: &[Point],
        outer: &[Point],
        answer: &mut RegionVisibility,
    ) -> Result<(), PlanError> {
        answer.begin(self);
        if !self.is_inside(outer) {
            return Err(PlanError::Region);
        }
        answer.hull.extend_from_slice(body);
        self.overlapped(answer)?;
        answer.hull.clear();
        answer.hull.extend_from_slice(outer);
        let mut index = 0;
        while index < answer.triangles.len() {
            let first = 3 * answer.triangles[index];
            for h in first..first + 3 {
                let Some(twin) = self.edges[h as usize].twin() else { continue };
                let blocks = self.edges[h as usize].twin & self.edges[twin as usize].twin & BLOCKS != 0;
                if !blocks && overlap(&self.ends(h), outer) {
                    answer.add_triangle(twin / 3);
                }
            }
            index += 1;
        }
        Ok(())
    }

    /// Returns whether all points are inside the rectangle around the plan.
    fn is_inside(&self, points: &[Point]) -> bool {
        let [low, high] = self.bounds();
        points.iter().all(|p| (0..2).all(|axis| low[axis] <= p[axis] && p[axis] <= high[axis]))
    }

    /// Follows all lines of sight that meet the region and leave one of its triangles across half-edge
    /// `edge`, until walls stop them. Adds to `answer` the walls and triangles that the lines reach.
    ///
    /// # Errors
    /// [`PlanError::TooMany`] beyond [`MAX_STEPS`] triangles entered for the region.
    fn follow_from(&self, edge: u32, answer: &mut RegionVisibility) -> Result<(), PlanError> {
        answer.sides.clear();
        let (a, b) = (self.edges[edge as usize].origin, self.edges[next(edge) as usize].origin);
        // If both ends of the edge are in the hull, every line across the edge meets the hull.
        let is_in_hull = [a, b].iter().all(|&v| contains(&answer.hull, self.points[v as usize]));
        // The beam of all lines across the edge, from the direction along it to the opposite direction.
        answer.sides.push(Side { vertex: a, corner: [a, b] });
        answer.sides.push(Side { vertex: b, corner: [b, a] });
        answer.beams.clear();
        answer.beams.push(Beam { edge, sides: (0, 2), kept: 2 });
        while let Some(beam) = answer.beams.pop() {
            answer.sides.truncate(beam.kept as usize);
            if !is_in_hull && !self.meets_hull(beam, answer) {
                continue;
            }
            let twin = self.edges[beam.edge as usize].twin;
            if twin & WALL != 0 {
                let walls = self.walls_of(self.piece[beam.edge as usize]);
                add_walls(&mut answer.walls, &mut answer.wall_marks, answer.query, walls);
            }
            if twin & BLOCKS != 0 {
                continue;
            }
            answer.steps += 1;
            if answer.steps > MAX_STEPS {
                return Err(PlanError::TooMany { count: answer.steps });
            }
            let twin = twin & TWIN;
            answer.add_triangle(twin / 3);
            let apex = self.edges[previous(twin) as usize].origin;
            let point = self.points[apex as usize];
            answer.signs.clear();
            for side in &answer.sides[beam.sides.0 as usize..beam.sides.1 as usize] {
                let [from, to] = side.corner.map(|v| self.points[v as usize]);
                let side = orient(from, to, point);
                answer.signs.push(if side > 0.0 { 1 } else { -i8::from(side < 0.0) });
            }
            // Splits the beam into the lines on the left and on the right of the apex.
            clip(answer, beam, apex, -1, previous(twin));
            clip(answer, beam, apex, 1, next(twin));
        }
        Ok(())
    }

    /// Returns whether a line of a beam meets the hull. If the lines at all corners of the beam pass the hull
    /// on the same side, no line meets it. If some pass it on the left and some on the right, a line between
    /// these meets it.
    fn meets_hull(&self, beam: Beam, answer: &RegionVisibility) -> bool {
        let mut common = 0;
        for side in &answer.sides[beam.sides.0 as usize..beam.sides.1 as usize] {
            let [from, to] = side.corner.map(|v| self.points[v as usize]);
            for &point in &answer.hull {
                let side = orient(from, to, point);
                let sign = if side > 0.0 { 1 } else { -i8::from(side < 0.0) };
                if common != 0 && sign == -common {
                    return true;
                }
                if sign != 0 {
                    common = sign;
                }
            }
        }
        false
    }
}

/// Returns whether two convex polygons overlap. A segment or a point counts as a polygon without area. False
/// only if a side of either separates them. If one has no area, touching counts as overlapping.
fn overlap(one: &[Point], other: &[Point]) -> bool {
    let have_area = one.len() > 2 && other.len() > 2;
    let is_apart = |of: &[Point], others: &[Point]| {
        // The only side of a hull of one point has equal ends, and no point is strictly beside that side.
        (0..of.len()).any(|k| {
            let (a, b) = (of[k], of[(k + 1) % of.len()]);
            others.iter().all(|&p| {
                let side = orient(a, b, p);
                if have_area { side <= 0.0 } else { side < 0.0 }
            })
        })
    };
    !is_apart(one, other) && !is_apart(other, one)
}

/// Returns whether a convex polygon, counter-clockwise, contains a point inside or on its outline. False for
/// a polygon without area.
fn contains(hull: &[Point], point: Point) -> bool {
    let after = hull.iter().cycle().skip(1);
    hull.len() > 2
        && hull.iter().zip(after).all(|(&a, &b)| a == point || b == point || orient(a, b, point) >= 0.0)
}

/// Pushes the part of a beam whose lines pass the vertex `apex` on one side, as the beam that leaves by
/// half-edge `edge`. `sign` is 1 for lines with the vertex to their left, -1 for lines with it to their
/// right. `answer.signs` must hold, for each corner of the beam, on which side of the corner's line the
/// vertex lies.
fn clip(answer: &mut RegionVisibility, beam: Beam, apex: u32, sign: i8, edge: u32) {
    let (first, count) = (beam.sides.0 as usize, answer.signs.len());
    let kept = answer.sides.len() as u32;
    let stay = answer.signs.iter().filter(|&&other| other == sign).count();
    if stay == 0 {
        return;
    }
    if !answer.signs.contains(&-sign) {
        answer.beams.push(Beam { edge, sides: beam.sides, kept });
        return;
    }
    // The corners that stay are contiguous in cyclic order. If the last corner stays, they end at the first
    // one that does not.
    let keeps = |&other: &i8| other == sign;
    let end = if keeps(&answer.signs[count - 1]) {
        answer.signs.iter().position(|other| !keeps(other)).unwrap_or(count)
    } else {
        answer.signs.iter().rposition(keeps).map_or(0, |last| last + 1)
    };
    let begin = if end >= stay { end - stay } else { end + count - stay };
    if begin < end {
        answer.sides.extend_from_within(first + begin..first + end);
    } else {
        answer.sides.extend_from_within(first + begin..first + count);
        answer.sides.extend_from_within(first..first + end);
    }
    let before = answer.sides[first + begin].vertex;
    let after = answer.sides[first + if end == count { 0 } else { end }].vertex;
    // Lines pass the vertices of earlier edges before the apex, so corner lines run from these vertices to
    // the apex.
    answer.sides.push(Side { vertex: after, corner: [after, apex] });
    answer.sides.push(Side { vertex: apex, corner: [before, apex] });
    let sides = (kept, answer.sides.len() as u32);
    answer.beams.push(Beam { edge, sides, kept: sides.1 });
}

/// Writes the corners of the convex hull of some points, counter-clockwise: one for equal points, two for
/// collinear ones. Sorts the points. This work is based on: A. M. Andrew, "Another Efficient Algorithm for
/// Convex Hulls in Two Dimensions", 1979.
pub(super) fn convex_hull(points: &mut Vec<Point>, hull: &mut Vec<Point>) {
    hull.clear();
    points.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    for is_upper in [false, true] {
        let base = hull.len().max(1);
        let mut push = |point: Point| {
            while hull.len() > base && orient(hull[hull.len() - 2], hull[hull.len() - 1], point) <= 0.0 {
                hull.pop();
            }
            hull.push(point);
        };
        if is_upper {
            points.iter().rev().skip(1).for_each(|&p| push(p));
        } else {
            points.iter().for_each(|&p| push(p));
        }
    }
    // The upper chain ends where the lower one begins.
    if hull.len() > 1 {
        hull.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_without_area_overlap_what_they_touch() {
        let triangle = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]];
        let beside = [[0.0, -2.0], [4.0, -2.0], [4.0, 0.0], [0.0, 0.0]];
        let across = [[1.0, -2.0], [2.0, -2.0], [2.0, 1.0], [1.0, 1.0]];
        assert!(
            !overlap(&triangle, &beside) && overlap(&triangle, &across),
            "with an area, more than touching"
        );
        for (ends, touches) in [
            ([[0.0, 0.0], [4.0, 0.0]], true),
            ([[4.0, 0.0], [9.0, 0.0]], true),
            ([[4.0, -1.0], [4.0, 1.0]], true),
            ([[4.5, -1.0], [4.5, 1.0]], false),
            ([[5.0, 0.0], [9.0, 0.0]], false),
        ] {
            assert_eq!(overlap(&ends, &triangle), touches, "{ends:?} and the triangle");
            assert_eq!(overlap(&triangle, &ends), touches, "the triangle and {ends:?}");
        }
        for (point, touches) in
            [([0.0, 4.0], true), ([2.0, 2.0], true), ([2.0, 2.5], false), ([1.0, 1.0], true)]
        {
            assert_eq!(overlap(&triangle, &[point]), touches, "the triangle and {point:?}");
            assert_eq!(contains(&triangle, point), touches, "{point:?} in the triangle");
        }
        assert!(!contains(&[[0.0, 0.0], [4.0, 0.0]], [2.0, 0.0]), "a segment contains no point");
    }

    #[test]
    fn hulls_have_no_corner_on_a_side() {
        let mut hull = Vec::new();
        let mut corners = |points: &[Point]| {
            convex_hull(&mut points.to_vec(), &mut hull);
            hull.clone()
        };
        let ends = [[0.0, 0.0], [4.0, 2.0]];
        assert_eq!(corners(&[ends[1], [2.0, 1.0], ends[0]]), ends, "points on a line");
        assert_eq!(corners(&[ends[1], ends[1]]), [ends[1]], "equal points");
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let more = [[1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [1.0, 2.0], [0.0, 1.0]];
        assert_eq!(corners(&[&square[..], &more].concat()), square, "points inside and on sides");
    }

    /// Marks of queries before the number of queries wraps count no more.
    #[test]
    fn marks_are_forgotten_when_queries_wrap() {
        let plan = Plan::new(&[super::super::Wall::new([-1.0, 1.0], [1.0, 1.0])]).unwrap();
        let mut answer = RegionVisibility::new();
        plan.look_from_region(&[[0.0, 0.0]], &mut answer).unwrap();
        answer.query = u32::MAX;
        answer.triangle_marks.fill(0);
        answer.wall_marks.fill(0);
        plan.look_from_region(&[[0.0, 0.0]], &mut answer).unwrap();
        assert_eq!(answer.walls(), [0], "the wall that the region sees");
    }
}
