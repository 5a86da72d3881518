//! Floor plan: a constrained Delaunay triangulation of walls, ready for queries.

use super::constrain::{Constrainer, MAX_VERTICES};
use super::error::PlanError;
use super::hilbert::Curve;
use super::predicates::{MAX_MAGNITUDE, MIN_MAGNITUDE, Point, checked};
use super::triangulation::{NONE, Triangulation, next, previous};
use super::wall::{Opacity, Wall};
use alloc::vec::Vec;
use visibility_core::stamp::Stamp;

/// Greatest length of `Plan::walls_of_pieces`: enough for one wall along each edge of a triangulation, and
/// for some walls that overlap.
const MAX_WALLS: usize = 4 * MAX_VERTICES;

/// Half-edge of a plan. It takes only 8 bytes, since queries read half-edges in random order.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HalfEdge {
    /// Vertex at which the half-edge begins, an index into `Plan::points`.
    pub(crate) origin: u32,
    /// Index of the twin half-edge in the bits of [`TWIN`], with the flags [`WALL`] and [`BLOCKS`].
    pub(crate) twin: u32,
}

/// Flag of a half-edge across which lines of sight cannot leave the triangle.
pub(crate) const BLOCKS: u32 = 1 << 31;
/// Flag of a half-edge with a wall along it.
pub(crate) const WALL: u32 = 1 << 30;
/// Bits of `HalfEdge::twin` that hold the index of the twin. All ones on the outer rectangle, where there
/// is no twin.
pub(crate) const TWIN: u32 = WALL - 1;

impl HalfEdge {
    /// Returns the twin, or `None` on the outer rectangle.
    #[inline]
    pub(crate) fn twin(self) -> Option<u32> {
        let twin = self.twin & TWIN;
        (twin != TWIN).then_some(twin)
    }
}

/// Triangulated walls of a floor plan, for visibility queries from a point or a region of the plane.
///
/// Walls are closed segments without thickness. They may touch, cross, overlap, repeat and have zero length.
/// Two walls that cross are split at an `f64` point within a few units of rounding of their crossing; apart
/// from this, all answers are exact for the given wall ends. Coordinates of walls and queries that are below
/// 1e-40 in absolute value count as 0. A rectangle around all walls bounds the plan.
///
/// Building takes expected time `n log n` in the number of walls, crossings and overlaps (pairs of a wall and
/// a piece of another along which the wall lies). A query takes time proportional to the number of triangles
/// that it sees, plus a binary search to locate its eye. The search tells vertices apart by their cell in a
/// grid of 65,536 by 65,536 over the plan. If all walls but one faraway one share a cell, locating the eye
/// takes a walk through up to `sqrt(n)` triangles for `n` walls, or more if they are collinear.
///
/// ```
/// use visibility_2d::cdt::{Plan, PlanView, Visibility, Wall};
/// // A square room with a wall across half of it.
/// let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
/// let mut walls: Vec<_> = (0..4).map(|i| Wall::new(corners[i], corners[(i + 1) % 4])).collect();
/// walls.push(Wall::new([2.0, 0.0], [2.0, 2.0]));
/// let plan = Plan::new(&walls)?;
/// let mut visibility = Visibility::new();
/// plan.look(&PlanView::new([1.0, 1.0]), &mut visibility)?;
/// assert_eq!(visibility.walls(), [0, 4, 2, 3]); // all but the right side of the room
/// assert_eq!(visibility.area(), 16.0 - 6.0); // the shadow is 2 wide, and 2 to 4 long
/// # Ok::<(), visibility_2d::cdt::PlanError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Plan {
    stamp: Stamp,
    /// Stamp of the triangulation, which opening and closing doors does not change.
    pub(super) triangulated: Stamp,
    /// Position of each vertex in world units.
    pub(crate) points: Vec<Point>,
    /// Half-edges. Those of triangle `t` have the indices `3 t` to `3 t + 2`, counter-clockwise.
    pub(crate) edges: Vec<HalfEdge>,
    /// For each vertex, the index in `edges` of a half-edge that begins there.
    pub(crate) out: Vec<u32>,
    curve: Curve,
    /// For each vertex, the highest 32 bits of its position along the Hilbert curve ([`Curve::place`]).
    /// Vertices are sorted by this position, ascending.
    places: Vec<u32>,
    /// For each half-edge, the index of the piece of a wall along it, [`NONE`] without a wall. Both
    /// half-edges of an edge have the same piece. Pieces are the parts into which crossings and contacts
    /// split the walls.
    pub(crate) piece: Vec<u32>,
    /// For each piece of a wall, the start of the range of its walls in `walls_of_pieces`: several if walls
    /// overlap. One more entry is the end of the last range.
    first_wall: Vec<u32>,
    /// Numbers of the walls along each piece, ascending within a piece, piece after piece.
    walls_of_pieces: Vec<u32>,
    /// For each piece of a wall, the index in `edges` of one of its two half-edges.
    piece_edge: Vec<u32>,
    /// For each wall, the start of the range of its pieces in `pieces_of_walls`. One more entry is the end of
    /// the last range.
    first_piece: Vec<u32>,
    /// Indices of the pieces of each wall, wall after wall.
    pieces_of_walls: Vec<u32>,
    walls: Vec<Wall>,
    /// Least and greatest corner of the outer rectangle, in world units.
    bounds: [Point; 2],
    /// Indices in `edges` of the half-edges on the outer rectangle, counter-clockwise from its least corner.
    outer: [u32; 4],
}

impl Plan {
    /// Greatest number of walls. Their ends (two each) and the corners of the rectangle are then 2^24
    /// vertices. Crossings are vertices too, so fewer walls may already be too many.
    pub const LIMIT: usize = MAX_VERTICES / 2 - 2;

    /// Makes a plan of walls, which are numbered from 0 in the given order. The rectangle around the plan has
    /// a margin of a quarter of the larger extent of all walls, at least 1.
    ///
    /// # Errors
    /// - [`PlanError::Coordinate`] for a coordinate that is NaN, infinite or above 1e60 in absolute value.
    /// - [`PlanError::TooMany`] for more than [`LIMIT`](Self::LIMIT) walls, 2^24 vertices or 2^24 overlaps,
    ///   if the numbers of walls of all pieces sum to more than 2^26, or if rounding makes the pieces of a
    ///   wall cross other walls without end.
    pub fn new(walls: &[Wall]) -> Result<Self, PlanError> {
        Self::from_walls_within(walls, |[low, high]| {
            (0.25 * (high[0] - low[0]).max(high[1] - low[1])).max(1.0)
        })
    }

    /// Makes a plan like [`new`](Self::new), with the rectangle at a distance of `margin` world units around
    /// all walls. A margin that is NaN, not positive, or too small to change the coordinates is replaced by
    /// the least margin that keeps all walls strictly inside.
    ///
    /// # Errors
    /// Returns the errors of [`new`](Self::new), for the same reasons.
    pub fn from_walls(walls: &[Wall], margin: f64) -> Result<Self, PlanError> {
        Self::from_walls_within(walls, |_| margin)
    }

    /// Makes a plan like [`from_walls`](Self::from_walls). `margin` is called with the least and greatest
    /// coordinates of all walls and returns the margin in world units.
    fn from_walls_within(walls: &[Wall], margin: impl Fn([Point; 2]) -> f64) -> Result<Self, PlanError> {
        if walls.len() > Self::LIMIT {
            return Err(PlanError::TooMany { count: walls.len() });
        }
        let mut ends = Vec::with_capacity(2 * walls.len());
        for (index, wall) in walls.iter().enumerate() {
            for end in wall.ends {
                ends.push(checked(end, index)?);
            }
        }
        let [low, high] = bounds_of(&ends);
        // The margin is at least 4 units in the last place of the greatest coordinate, so that rectangle and
        // walls differ. It is clamped to the magnitudes that coordinates may have.
        let size = low.iter().chain(&high).fold(MIN_MAGNITUDE, |size, x| size.max(x.abs()));
        let margin = margin([low, high]).max(4.0 * f64::EPSILON * size).clamp(MIN_MAGNITUDE, MAX_MAGNITUDE);
        // The curve covers the walls without the margin. With a large margin, all walls could be at one
        // position of the curve.
        let curve = Curve::new(low, high);
        let (low, high) = (low.map(|x| x - margin), high.map(|x| x + margin));
        let mut triangulation = Triangulation::new(low, high);
        let vertices = triangulation.insert_all(&ends, &curve);
        let mut constrainer = Constrainer::default();
        let mut uses = alloc::vec![0_u32; triangulation.points.len()];
        vertices.iter().for_each(|&vertex| uses[vertex as usize] += 1);
        for (wall, ends) in (0u32..).zip(vertices.chunks_exact(2)) {
            // The search for a wall's way goes around its first vertex, which may be that of all walls.
            let [a, b] = [ends[0], ends[1]];
            let [a, b] = if uses[a as usize] / 8 > uses[b as usize] { [b, a] } else { [a, b] };
            constrainer.insert(&mut triangulation, a, b, wall)?;
        }
        Self::packed(triangulation, walls, curve, [low, high])
    }

    /// Makes the plan from a triangulation: renumbers vertices and triangles along the curve, and lists the
    /// walls of each piece.
    fn packed(
        from: Triangulation,
        walls: &[Wall],
        curve: Curve,
        bounds: [Point; 2],
    ) -> Result<Self, PlanError> {
        // Neighbours on the curve are neighbours in memory: a query then touches few cache lines.
        let order = |points: &mut dyn Iterator<Item = Point>| {
            let mut order: Vec<_> =
                points.zip(0u32..).map(|(point, i)| ((curve.place::<16>(point) >> 32) as u32, i)).collect();
            order.sort_unstable();
            order
        };
        let vertices = order(&mut from.points.iter().copied());
        let triangles = order(&mut from.edges.chunks_exact(3).map(|t| {
            let [a, b, c] = [0, 1, 2].map(|k| from.points[t[k].origin as usize]);
            [0, 1].map(|axis| (a[axis] + b[axis] + c[axis]) / 3.0)
        }));
        let new_number = |order: &[(u32, u32)]| {
            let mut new = alloc::vec![0u32; order.len()];
            order.iter().zip(0u32..).for_each(|(&(_, old), i)| new[old as usize] = i);
            new
        };
        let (new_vertex, new_triangle) = (new_number(&vertices), new_number(&triangles));
        let new_edge = |h: u32| 3 * new_triangle[h as usize / 3] + h % 3;

        let mut plan = Self {
            stamp: Stamp::new(),
            triangulated: Stamp::new(),
            points: vertices.iter().map(|&(_, old)| from.points[old as usize]).collect(),
            edges: Vec::with_capacity(from.edges.len()),
            out: vertices.iter().map(|&(_, old)| new_edge(from.out[old as usize])).collect(),
            curve,
            places: vertices.iter().map(|&(place, _)| place).collect(),
            piece: Vec::with_capacity(from.edges.len()),
            first_wall: alloc::vec![0],
            walls_of_pieces: Vec::new(),
            piece_edge: Vec::new(),
            first_piece: alloc::vec![0; walls.len() + 1],
            pieces_of_walls: Vec::new(),
            walls: walls.to_vec(),
            bounds,
            outer: [0; 4],
        };
        // Copies the half-edges in the new order. Both halves of a piece get the same piece number: the later
        // half takes that of its twin.
        for &(_, old) in &triangles {
            for h in 3 * old..3 * old + 3 {
                let edge = from.edges[h as usize];
                let here = plan.edges.len() as u32;
                let twin = if edge.twin == NONE { TWIN | BLOCKS } else { new_edge(edge.twin) };
                if edge.twin == NONE {
                    // Vertices 0 to 3 of the triangulation are the corners of the rectangle.
                    plan.outer[edge.origin as usize & 3] = here;
                }
                plan.edges.push(HalfEdge { origin: new_vertex[edge.origin as usize], twin });
                let mut piece = NONE;
                if twin < here {
                    piece = plan.piece[twin as usize];
                } else if edge.walls != NONE {
                    piece = plan.piece_edge.len() as u32;
                    plan.push_piece(here, &from.lists, edge.walls)?;
                }
                plan.piece.push(piece);
            }
        }
        plan.list_pieces_of_walls();
        for piece in 0..plan.piece_edge.len() as u32 {
            plan.set_flags(piece);
        }
        Ok(plan)
    }

    /// Appends a piece along half-edge `h`. `item` is the first item of the piece's list of walls in `lists`.
    /// The piece gets the walls of this list in ascending order, each once.
    fn push_piece(&mut self, h: u32, lists: &[(u32, u32)], mut item: u32) -> Result<(), PlanError> {
        let first = self.walls_of_pieces.len();
        while item != NONE {
            let (wall, rest) = lists[item as usize];
            self.walls_of_pieces.push(wall);
            item = rest;
        }
        let added = &mut self.walls_of_pieces[first..];
        added.sort_unstable();
        let mut kept = first;
        for index in first..self.walls_of_pieces.len() {
            let wall = self.walls_of_pieces[index];
            if kept == first || self.walls_of_pieces[kept - 1] != wall {
                self.walls_of_pieces[kept] = wall;
                kept += 1;
            }
        }
        self.walls_of_pieces.truncate(kept);
        self.first_wall.push(kept as u32);
        self.piece_edge.push(h);
        // Several pieces shared one list before the copying, so the copies may be much longer in total.
        if kept > MAX_WALLS { Err(PlanError::TooMany { count: kept }) } else { Ok(()) }
    }

    fn list_pieces_of_walls(&mut self) {
        for &wall in &self.walls_of_pieces {
            self.first_piece[wall as usize + 1] += 1;
        }
        for wall in 0..self.walls.len() {
            self.first_piece[wall + 1] += self.first_piece[wall];
        }
        let mut place = self.first_piece.clone();
        self.pieces_of_walls = alloc::vec![0; self.walls_of_pieces.len()];
        for piece in 0..self.piece_edge.len() {
            for index in self.first_wall[piece]..self.first_wall[piece + 1] {
                let place = &mut place[self.walls_of_pieces[index as usize] as usize];
                self.pieces_of_walls[*place as usize] = piece as u32;
                *place += 1;
            }
        }
    }

    /// Sets the flags [`WALL`] and [`BLOCKS`] of the two half-edges of a piece by the opacity of its walls.
    fn set_flags(&mut self, piece: u32) {
        let h = self.piece_edge[piece as usize];
        let (mut out, mut back) = (WALL, WALL);
        let ends = self.ends(h);
        for &wall in self.walls_of(piece) {
            let wall = &self.walls[wall as usize];
            // The triangle of a half-edge is on its left, so lines of sight that leave the triangle cross the
            // edge from left to right.
            if wall.stops(ends) {
                out |= BLOCKS;
            }
            if wall.stops([ends[1], ends[0]]) {
                back |= BLOCKS;
            }
        }
        let twin = self.edges[h as usize].twin & TWIN;
        self.edges[h as usize].twin = twin | out;
        if let Some(twin) = self.edges.get_mut(twin as usize) {
            twin.twin = twin.twin & TWIN | back;
        }
    }

    /// Changes the opacity of a wall, for instance of a door that opens. Takes time proportional to the
    /// number of the wall's pieces: one for a door that crosses no other wall.
    ///
    /// # Errors
    /// [`PlanError::UnknownWall`] if the plan has no wall of that number.
    pub fn set_opacity(&mut self, wall: u32, opacity: Opacity) -> Result<(), PlanError> {
        let walls = self.walls.len();
        let of = self.walls.get_mut(wall as usize).ok_or(PlanError::UnknownWall { wall, walls })?;
        if core::mem::replace(&mut of.opacity, opacity) != opacity {
            self.stamp = Stamp::new();
            for index in self.first_piece[wall as usize]..self.first_piece[wall as usize + 1] {
                self.set_flags(self.pieces_of_walls[index as usize]);
            }
        }
        Ok(())
    }

    /// Returns the stamp of the walls and their opacities. A clone has the same stamp until either of the two
    /// plans changes.
    pub fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// Returns the walls with their given ends and present opacities.
    pub fn walls(&self) -> &[Wall] {
        &self.walls
    }

    /// Returns the least and the greatest corner of the rectangle that bounds the plan, in world units.
    pub fn bounds(&self) -> [[f64; 2]; 2] {
        self.bounds
    }

    /// Returns the number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.edges.len() / 3
    }

    /// Returns the corners of a triangle in counter-clockwise order, in world units. `None` for an unknown
    /// triangle; triangles are numbered from 0.
    pub fn triangle(&self, triangle: u32) -> Option<[[f64; 2]; 3]> {
        (triangle < self.triangle_count() as u32).then(|| self.corners(triangle))
    }

    /// Returns the corners of a triangle of the plan, as [`triangle`](Self::triangle) does.
    pub(crate) fn corners(&self, triangle: u32) -> [Point; 3] {
        [0, 1, 2].map(|k| self.start(3 * triangle + k))
    }

    /// Returns the pieces into which crossings and contacts split the walls: the two ends of each piece, and
    /// the numbers of the walls along it, ascending.
    pub fn pieces(&self) -> impl ExactSizeIterator<Item = ([[f64; 2]; 2], &[u32])> {
        self.piece_edge.iter().enumerate().map(|(piece, &h)| (self.ends(h), self.walls_of(piece as u32)))
    }

    /// Returns the size of the plan's lists in bytes.
    pub fn memory(&self) -> usize {
        16 * self.points.len()
            + 12 * self.edges.len()
            + 8 * self.points.len()
            + 4 * (self.first_wall.len() + self.piece_edge.len() + self.first_piece.len())
            + 8 * self.walls_of_pieces.len()
            + size_of::<Wall>() * self.walls.len()
    }

    /// Returns the half-edges on the outer rectangle, counter-clockwise from the least corner.
    pub(crate) fn outer(&self) -> [u32; 4] {
        self.outer
    }

    /// Returns the numbers of the walls along the piece with index `piece`, ascending.
    pub(crate) fn walls_of(&self, piece: u32) -> &[u32] {
        let piece = piece as usize;
        &self.walls_of_pieces[self.first_wall[piece] as usize..self.first_wall[piece + 1] as usize]
    }

    /// Returns whether a wall along a half-edge stops lines of sight out of its triangle at all heights
    /// strictly between `low` and `high`. If both are equal, whether it stops those at this height: not where
    /// the wall's lower or upper end is at the same height.
    pub(crate) fn stops_between(&self, h: u32, [low, high]: [f64; 2]) -> bool {
        let piece = self.piece[h as usize];
        let stops = |&wall: &u32| {
            let wall = &self.walls[wall as usize];
            let [of_wall, to_wall] = wall.heights;
            let covers = of_wall <= low && high <= to_wall;
            covers && (low < high || of_wall < low && high < to_wall) && wall.stops(self.ends(h))
        };
        piece != NONE && self.walls_of(piece).iter().any(stops)
    }

    /// Returns the point at which a half-edge begins.
    #[inline]
    pub(crate) fn start(&self, h: u32) -> Point {
        self.points[self.edges[h as usize].origin as usize]
    }

    /// Returns both ends of a half-edge.
    #[inline]
    pub(crate) fn ends(&self, h: u32) -> [Point; 2] {
        [self.start(h), self.start(next(h))]
    }

    /// Returns the next half-edge counter-clockwise that begins at the same vertex. `None` at the outer
    /// rectangle.
    pub(crate) fn turned(&self, h: u32) -> Option<u32> {
        self.edges[previous(h) as usize].twin()
    }

    /// Returns a half-edge near a point, as start of a walk. It begins at the nearer of the two vertices just
    /// before and just after the point along the curve.
    pub(crate) fn near(&self, point: Point) -> u32 {
        let place = (self.curve.place::<16>(point) >> 32) as u32;
        let after = self.places.partition_point(|&p| p < place).min(self.points.len() - 1);
        let before = after.saturating_sub(1);
        let distance = |v: usize| {
            let [x, y] = [0, 1].map(|axis| self.points[v][axis] - point[axis]);
            x * x + y * y
        };
        self.out[if distance(before) < distance(after) { before } else { after }]
    }
}

/// Returns the least and greatest coordinates of points. The origin if there are none.
fn bounds_of(points: &[Point]) -> [Point; 2] {
    let all = |start: Point, of: fn(f64, f64) -> f64| {
        points.iter().fold(start, |sum, point| [of(sum[0], point[0]), of(sum[1], point[1])])
    };
    let first = points.first().copied().unwrap_or_default();
    [all(first, f64::min), all(first, f64::max)]
}
