//! Construction of a Delaunay triangulation: half-edges, and insertion of points by flips.
//!
//! This work is based on: C. L. Lawson, "Software for C1 Surface Interpolation", 1977 (insertion by flips);
//! Nina Amenta, Sunghee Choi and Guenter Rote, "Incremental Constructions con BRIO", 2003 (points in random
//! rounds, each along a space-filling curve, so that the expected number of flips is not quadratic for any
//! input).
//!
//! Points at the same position along the curve are inserted in the order of x, so that collinear points
//! follow each other. If one point is farther away than 2^32 times the extent of the `n` others, these may
//! all have the same position. Unless they are collinear, locating each of them then takes a walk through up
//! to `sqrt(n)` triangles.
//!
//! Triangles have labels, set by the user of the triangulation. Parts of a split triangle keep its label. If
//! a flip would extend a label to other points, the label is erased and reported.
//!
//! Triangle `t` has the half-edges `3 t`, `3 t + 1` and `3 t + 2`, counter-clockwise. All points lie strictly
//! inside the rectangle of the first four, so every insertion splits a triangle or an inner edge.

use super::hilbert::Curve;
use super::predicates::{Point, in_circle, orient};
use alloc::vec::Vec;

/// Value that stands for no half-edge, vertex, label or item of a list, where an index of one is stored.
pub(crate) const NONE: u32 = u32::MAX;

/// Returns the half-edge that follows `h` in its triangle.
#[inline(always)]
pub(crate) fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// Returns the half-edge that precedes `h` in its triangle.
#[inline(always)]
pub(crate) fn previous(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

/// Place of a point in a triangulation: a triangle, a half-edge or a vertex.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Place {
    /// The point is strictly inside the triangle with this index.
    Triangle(u32),
    /// The point is on the half-edge with this index, between its ends.
    Edge(u32),
    /// The point is at the vertex at which the half-edge with this index begins.
    Vertex(u32),
    /// The point is outside all triangles.
    Outside,
}

/// Half-edge during construction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BuildEdge {
    /// Vertex at which the half-edge begins, an index into `Triangulation::points`.
    pub(crate) origin: u32,
    /// Index of the half-edge of the neighbouring triangle between the same two vertices. [`NONE`] on the
    /// outer rectangle.
    pub(crate) twin: u32,
    /// Index, in `Triangulation::lists`, of the first item of the linked list of walls along the edge.
    /// [`NONE`] without a wall.
    pub(crate) walls: u32,
}

/// A triangulation of points, with walls along some edges.
#[derive(Clone, Debug, Default)]
pub(crate) struct Triangulation {
    /// Position of each vertex. The first four are the corners of the outer rectangle.
    pub(crate) points: Vec<Point>,
    /// Half-edges. Those of triangle `t` have the indices `3 t` to `3 t + 2`, counter-clockwise.
    pub(crate) edges: Vec<BuildEdge>,
    /// For each vertex, the index in `edges` of a half-edge that begins there.
    pub(crate) out: Vec<u32>,
    /// Items of linked lists of walls: the number of a wall, and the index of the next item, [`NONE`] in the
    /// last. Items never change, so several lists may end in the same items.
    pub(crate) lists: Vec<(u32, u32)>,
    /// Label of each triangle, [`NONE`] without one. The user of the triangulation sets labels, for instance
    /// the index of an occluder that covers the triangle. What a label says must hold at all points of its
    /// triangle.
    pub(crate) labels: Vec<u32>,
    /// Labels that triangles have lost since the user of the triangulation last took labels from here. A
    /// label may occur several times.
    pub(crate) erased: Vec<u32>,
    /// Bounds (least and greatest corner) of the triangles that have lost their labels. The user of the
    /// triangulation resets them to [`NOWHERE`].
    pub(crate) erased_bounds: [Point; 2],
    /// Index of the half-edge in whose triangle the next walk to a point begins: see
    /// [`locate`](Self::locate).
    last: u32,
    /// Indices of half-edges that may have to be flipped: see [`restore_delaunay`](Self::restore_delaunay).
    stack: Vec<u32>,
}

/// Bounds of an empty set of points: least and greatest coordinates.
pub(crate) const NOWHERE: [Point; 2] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];

impl Triangulation {
    /// Makes the two triangles of a rectangle, given by its least and greatest corner.
    pub(crate) fn new(low: Point, high: Point) -> Self {
        let mut new = Self::default();
        new.restart(low, high);
        new
    }

    /// Resets the triangulation to the two triangles of a rectangle. Reuses its memory.
    pub(crate) fn restart(&mut self, low: Point, high: Point) {
        let edge = |origin, twin| BuildEdge { origin, twin, walls: NONE };
        let lists = [&mut self.out, &mut self.labels, &mut self.erased, &mut self.stack].into_iter();
        lists.for_each(Vec::clear);
        self.points.clear();
        self.edges.clear();
        self.lists.clear();
        self.points.extend([low, [high[0], low[1]], high, [low[0], high[1]]]);
        let diagonal = [edge(0, NONE), edge(1, NONE), edge(2, 3), edge(0, 2)];
        self.edges.extend(diagonal.into_iter().chain([edge(2, NONE), edge(3, NONE)]));
        self.out.extend([0, 1, 2, 5]);
        self.labels.extend([NONE; 2]);
        self.last = 0;
        self.erased_bounds = NOWHERE;
    }

    /// Gives triangles the same label: if their labels differ, all of them lose their labels. Called before
    /// the area of these triangles is divided differently, since each new triangle may contain points of
    /// several old ones, and a label must hold at all points of its triangle. Adds the labels lost to
    /// `erased`, and the triangles that had them to `erased_bounds`.
    pub(crate) fn unify(&mut self, triangles: &[u32]) {
        let label = |of: &Self, t: u32| of.labels[t as usize];
        if triangles.windows(2).all(|pair| label(self, pair[0]) == label(self, pair[1])) {
            return;
        }
        for &t in triangles {
            let label = core::mem::replace(&mut self.labels[t as usize], NONE);
            if label != NONE {
                self.erased.push(label);
                for corner in [0, 1, 2].map(|k| self.start(3 * t + k)) {
                    for axis in 0..2 {
                        let [low, high] = &mut self.erased_bounds;
                        (low[axis], high[axis]) = (low[axis].min(corner[axis]), high[axis].max(corner[axis]));
                    }
                }
            }
        }
    }

    /// Returns the point at which a half-edge begins.
    pub(crate) fn start(&self, h: u32) -> Point {
        self.points[self.edges[h as usize].origin as usize]
    }

    /// Returns the vertex of the triangle of `h` that is not on `h`.
    pub(crate) fn apex(&self, h: u32) -> u32 {
        self.edges[previous(h) as usize].origin
    }

    /// Inserts points in an order with expected time `n log n`, and returns the vertex of each. Equal points
    /// share a vertex.
    pub(crate) fn insert_all(&mut self, points: &[Point], curve: &Curve) -> Vec<u32> {
        let mut order: Vec<_> = (0u32..)
            .zip(points)
            .map(|(index, &point)| {
                // A multiplicative hash of the index selects the round: a point is in a later round with
                // probability 7 / 8.
                let hash = (u64::from(index) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                let round = 10 - (hash >> 32 | 1 << 30).trailing_zeros() / 3;
                (round, curve.place::<32>(point), index)
            })
            .collect();
        order.sort_unstable_by(|a, b| {
            let [p, q] = [a.2, b.2].map(|index| points[index as usize]);
            let by_point = || p[0].total_cmp(&q[0]).then(p[1].total_cmp(&q[1])).then(a.2.cmp(&b.2));
            (a.0, a.1).cmp(&(b.0, b.1)).then_with(by_point)
        });
        self.points.reserve(points.len());
        self.out.reserve(points.len());
        self.edges.reserve(6 * points.len());
        let mut vertices = alloc::vec![NONE; points.len()];
        for (_, _, index) in order {
            vertices[index as usize] = self.insert(points[index as usize]);
        }
        vertices
    }

    /// Inserts a point strictly inside the outer rectangle and returns its vertex, or the existing vertex at
    /// the point. A wall through the point is split there.
    pub(crate) fn insert(&mut self, point: Point) -> u32 {
        let place = self.locate(point);
        if let Place::Vertex(h) = place {
            self.last = h;
            return self.edges[h as usize].origin;
        }
        let vertex = self.points.len() as u32;
        self.points.push(point);
        self.out.push(NONE);
        match place {
            Place::Triangle(t) => self.split_triangle(t, vertex),
            Place::Edge(h) => self.split_edge(h, vertex),
            Place::Vertex(_) | Place::Outside => {}
        }
        self.restore_delaunay(usize::MAX);
        self.last = self.out[vertex as usize];
        vertex
    }

    /// Returns the triangle, half-edge or vertex that a point lies on, [`Place::Outside`] if there is none.
    /// Walks there from the triangle of half-edge `last`. Each step crosses an edge that has the point on its
    /// other side. The steps test the edges in varying order, so that the walk hardly ever goes in a circle;
    /// after as many steps as there are half-edges, all triangles are searched.
    pub(crate) fn locate(&self, point: Point) -> Place {
        let mut t = self.last / 3;
        'walk: for step in 0..self.edges.len() as u32 + 16 {
            for turn in 0..3 {
                let h = 3 * t + (turn + step) % 3;
                if orient(self.start(h), self.start(next(h)), point) < 0.0 {
                    let twin = self.edges[h as usize].twin;
                    if twin == NONE {
                        return Place::Outside;
                    }
                    t = twin / 3;
                    continue 'walk;
                }
            }
            return self.place_in(t, point).unwrap_or(Place::Outside);
        }
        (0..self.edges.len() as u32 / 3).find_map(|t| self.place_in(t, point)).unwrap_or(Place::Outside)
    }

    /// Returns the place of a point inside a triangle or on its boundary. `None` if the point is outside.
    fn place_in(&self, t: u32, point: Point) -> Option<Place> {
        place_in(core::array::from_fn(|k| self.start(3 * t + k as u32)), t, point)
    }

    fn set(&mut self, h: u32, origin: u32, (twin, walls): (u32, u32)) {
        self.edges[h as usize] = BuildEdge { origin, twin, walls };
        self.out[origin as usize] = h;
        if twin != NONE {
            self.edges[twin as usize].twin = h;
        }
    }

    /// Returns the twin of a half-edge, and the first item of the list of walls along the edge.
    fn across(&self, h: u32) -> (u32, u32) {
        let edge = self.edges[h as usize];
        (edge.twin, edge.walls)
    }

    /// Appends a labelled triangle whose half-edges are set afterwards, and returns its first half-edge.
    fn push_triangle(&mut self, label: u32) -> u32 {
        let first = self.edges.len() as u32;
        self.labels.push(label);
        self.edges.extend([BuildEdge { origin: 0, twin: NONE, walls: NONE }; 3]);
        first
    }

    fn split_triangle(&mut self, t: u32, v: u32) {
        let h = 3 * t;
        let [a, b, c] = [h, h + 1, h + 2].map(|h| self.edges[h as usize].origin);
        let (of_b, of_c) = (self.across(h + 1), self.across(h + 2));
        let label = self.labels[t as usize];
        let (f, g) = (self.push_triangle(label), self.push_triangle(label));
        self.set(h, a, self.across(h));
        self.set(h + 1, b, (f + 2, NONE));
        self.set(h + 2, v, (g + 1, NONE));
        self.set(f, b, of_b);
        self.set(f + 1, c, (g + 2, NONE));
        self.set(f + 2, v, (h + 1, NONE));
        self.set(g, c, of_c);
        self.set(g + 1, a, (h + 2, NONE));
        self.set(g + 2, v, (f + 1, NONE));
        self.stack.extend([h, f, g]);
    }

    fn split_edge(&mut self, h: u32, v: u32) {
        let g = self.edges[h as usize].twin;
        let [hn, hp, gn, gp] = [next(h), previous(h), next(g), previous(g)];
        let [a, b, c, d] = [h, hn, hp, gp].map(|h| self.edges[h as usize].origin);
        let walls = self.edges[h as usize].walls;
        let (of_bc, of_ad) = (self.across(hn), self.across(gn));
        let [of_h, of_g] = [h, g].map(|h| self.labels[h as usize / 3]);
        let (e, f) = (self.push_triangle(of_h), self.push_triangle(of_g));
        // Of the four triangles around the new vertex v, those of h (a v c) and g (b v d) keep their index.
        // New are (v b c) and (v a d).
        self.set(h, a, (f, walls));
        self.set(hn, v, (e + 2, NONE));
        self.set(e, v, (g, walls));
        self.set(e + 1, b, of_bc);
        self.set(e + 2, c, (hn, NONE));
        self.set(g, b, (e, walls));
        self.set(gn, v, (f + 2, NONE));
        self.set(f, v, (h, walls));
        self.set(f + 1, a, of_ad);
        self.set(f + 2, d, (gn, NONE));
        self.stack.extend([hp, e + 1, gp, f + 1]);
    }

    /// Flips the edges on the stack, and the edges around each flip, until all are Delaunay or walls, or
    /// until `limit` edges have been tested. Edges left over cost speed, not correctness.
    pub(crate) fn restore_delaunay(&mut self, limit: usize) {
        for _ in 0..limit {
            let Some(h) = self.stack.pop() else { return };
            let BuildEdge { origin, twin, walls } = self.edges[h as usize];
            if walls != NONE || twin == NONE {
                continue;
            }
            let [a, v, d] = [origin, self.apex(h), self.apex(twin)].map(|v| self.points[v as usize]);
            if in_circle(a, self.start(twin), v, d) {
                self.flip(h);
                self.stack.extend([h, previous(twin)]);
            }
        }
        self.stack.clear();
    }

    /// Sets the half-edge at which the next walk to a point begins.
    pub(crate) fn begin_at(&mut self, h: u32) {
        self.last = h;
    }

    /// Pushes the half-edge `h` on the stack of edges that [`restore_delaunay`](Self::restore_delaunay) tests
    /// and flips.
    pub(crate) fn suspect(&mut self, h: u32) {
        self.stack.push(h);
    }

    /// Replaces the edge `a b` of `h` by the other diagonal of the convex quadrilateral that its two
    /// triangles form. Afterwards `h` begins at `a`, the twin at `b`, and the new edge is `next(h)`.
    pub(crate) fn flip(&mut self, h: u32) {
        let g = self.edges[h as usize].twin;
        self.unify(&[h / 3, g / 3]);
        let (hn, gn) = (next(h), next(g));
        let [a, b, v, d] = [h, g, previous(h), previous(g)].map(|h| self.edges[h as usize].origin);
        let (of_h, of_g) = (self.across(gn), self.across(hn));
        self.set(h, a, of_h);
        self.set(g, b, of_g);
        self.set(hn, d, (gn, NONE));
        self.set(gn, v, (hn, NONE));
    }
}

/// Returns the place of a point inside triangle `t` with the given corners, or on its boundary. `None` if the
/// point is outside.
pub(crate) fn place_in(corners: [Point; 3], t: u32, point: Point) -> Option<Place> {
    let sides = [0, 1, 2].map(|k| orient(corners[k], corners[(k + 1) % 3], point));
    if sides.iter().any(|side| *side < 0.0) {
        return None;
    }
    let on = |k: usize| sides[k] == 0.0;
    // A point at corner k is on the sides k and k - 1.
    Some(match (0..3).find(|&k| on(k) && on((k + 2) % 3)) {
        Some(k) => Place::Vertex(3 * t + k as u32),
        None => (0..3).find(|&k| on(k)).map_or(Place::Triangle(t), |k| Place::Edge(3 * t + k as u32)),
    })
}
