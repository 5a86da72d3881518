//! Search nodes that are divided by the edges of occluders. A node is the set of segments from P, a part of a
//! face of the viewcell, to Q, a part of a face of the target, that pass some edges on given sides. P x Q is
//! the set of all segments between the polygons.
//!
//! A blocked line of the node crosses an occluder, whose boundary is a closed loop. All segments that pass
//! the loop's edges on the same sides are blocked too, since the loop winds around them and every surface
//! bounded by the loop is crossed. All other segments pass outside of some edge, and for each edge those
//! outside of it are a node of their own. Linear programs tell which of these nodes have no segments.

use crate::check;
use crate::corner_proof;
use crate::half::Half;
use crate::line_side::{Edge, NO_CORNER, Row, SideFrom, side, sign};
use crate::matrix_game::{Matrix, Value};
use crate::proof::{LoopEdge, Step};
use crate::search::{self, Answer, SPLITS, Search, Segment};
use crate::side_signs::{NEGATIVE, POSITIVE, Zeros, signs};
use crate::sight::Sight;
use alloc::{boxed::Box, vec::Vec};
use visibility_core::glam::DVec3;

/// Greatest number of divisions, by loops or in halves, on the way from the root of an attempt to a node.
/// Deeper nodes stay undecided. Each level takes 4 to 6 KB of the stack. Tests and scenes need 63 at most.
const LEVELS: u32 = 100;

// The check refuses proofs whose nodes are deeper. An attempt begins at a node of the search by halving.
const _: () = assert!(search::DEPTH + SPLITS + LEVELS < check::DEPTH as u32, "deep proofs are refused");

/// Corner of a loop: its position, and the number of the target triangle's corner that it is, or
/// [`NO_CORNER`].
type RingCorner = (DVec3, u8);

/// A loop of edges on an occluder, inside of which a line of the node certainly passes.
struct Loop {
    /// Index of the occluder in `SceneTriangles::pieces`: a convex polygon of coplanar triangles.
    piece: u32,
    /// Corners of the loop in order.
    ring: Vec<RingCorner>,
    /// Sign (1 or -1) of the side on which lines inside the loop pass all its edges.
    side: f64,
    /// For each edge of the ring, from each corner to the next: true if lines of the node may pass outside of
    /// the edge, so that it divides the node.
    divides: Vec<bool>,
}

impl Loop {
    fn edge(&self, k: usize) -> Edge {
        let (a, b) = (self.ring[k], self.ring[(k + 1) % self.ring.len()]);
        Edge { ends: [a.0, b.0], tags: [a.1, b.1] }
    }

    fn row(&self, k: usize, side: f64) -> Row {
        Row { edge: self.edge(k), side }
    }

    fn dividing(&self) -> usize {
        self.divides.iter().filter(|&&divides| divides).count()
    }
}

/// A node of the search: the segments between the polygons of `sight` that pass the edges of `rows` on the
/// given sides.
struct RowNode {
    /// The viewcell polygon and the target polygon between which the segments run.
    sight: Sight,
    /// Bound in metres on the error of each coordinate of a position, to be used for the sides of edges.
    delta: f64,
    /// Dividing edges of the node, each with the side on which all segments of the node pass it.
    rows: Vec<Row>,
    /// For each of `rows`, the sides on which the lines from each corner of the viewcell polygon to each
    /// corner of the target polygon pass the row's edge.
    matrix: Matrix,
    /// Solution of the linear program whose constraints are all of `rows`. `None` until it is computed.
    solution: Option<Solution>,
}

/// Value of a linear program, and its weights: of the rows for a negative value, of the columns otherwise.
type Solution = (Value, Box<[f64]>);

impl RowNode {
    fn new(sight: Sight, delta: f64, rows: &[Row]) -> Self {
        let mut matrix = Matrix::default();
        matrix.start(sight.p.corners().len() * sight.q.corners().len());
        let mut node =
            Self { sight, delta, rows: Vec::with_capacity(rows.len() + 4), matrix, solution: None };
        rows.iter().for_each(|row| node.push(*row));
        node
    }

    fn push(&mut self, row: Row) {
        let (sight, delta) = (&self.sight, self.delta);
        let [a, b] = row.edge.ends;
        let zeros = &Zeros::new(sight, &row.edge);
        self.matrix.push(|entries| {
            let mut greatest = 0.0f64;
            for &from in sight.p.corners() {
                let from_here = SideFrom::new(from, a, b, delta);
                for (&to, &zero) in sight.q.corners().iter().zip(&sight.q.zero) {
                    let is_zero = zeros.hold(sight, from, to, zero);
                    let (value, error) = if is_zero { (0.0, 0.0) } else { from_here.to(to) };
                    entries.push(value * row.side);
                    greatest = greatest.max(error);
                }
            }
            greatest
        });
        self.rows.push(row);
    }

    fn truncate(&mut self, rows: usize) {
        self.matrix.truncate(rows);
        self.rows.truncate(rows);
    }
}

impl Search<'_> {
    /// Decides all segments of `sight` by dividing them by loops. `left` is the number of nodes that may
    /// still be used.
    pub(crate) fn divide(&mut self, sight: &Sight, left: &mut u32) -> Answer {
        self.divide_rows(&mut RowNode::new(*sight, sight.side_error(self.delta), &[]), left, 0, 0)
    }

    /// Decides the segments of a node. `left` is the number of nodes that may still be used, `halvings` the
    /// number of halvings on the way to the node, `levels` that of halvings and divisions by loops.
    fn divide_rows(&mut self, node: &mut RowNode, left: &mut u32, halvings: u32, levels: u32) -> Answer {
        if *left == 0 || levels > LEVELS || self.must_stop() {
            return Answer::Undecided;
        }
        *left -= 1;
        self.stats.divided_nodes += 1;
        let mut line = Some(self.middle(&node.sight));
        if !node.rows.is_empty() {
            let solution = node.solution.take();
            match solution.unwrap_or_else(|| self.solve(&node.matrix)) {
                (Value::Negative, weights) => {
                    self.steps.push(Step::Empty { weights });
                    return Answer::Hidden;
                }
                (Value::Open, _) => return Answer::Undecided,
                (Value::Positive, weights) => line = self.line_inside(node, &weights),
            }
        }
        let sight = &node.sight;
        let Some(line) = line else {
            // No line was found that satisfies all rows, though weights of pairs of corners do.
            if let Some(edges) = corner_proof::find(sight, &node.rows, node.delta) {
                self.steps.push(Step::Corner { edges });
                return Answer::Hidden;
            }
            return self.halve_divided(node, left, halvings, levels);
        };
        let mut hits = core::mem::take(&mut self.hits);
        let unsure = self.probe(line, &mut hits);
        let best = if hits.is_empty() { None } else { self.best_loop(sight, node.rows.len(), line, &hits) };
        let is_clear = hits.is_empty() && !unsure;
        self.hits = hits;
        if is_clear {
            return Answer::Visible(line);
        }
        let Some(best) = best else { return self.halve_divided(node, left, halvings, levels) };
        self.divide_by(node, &best, left, halvings, levels)
    }

    /// Divides a node by the edges of a loop, and decides the parts that pass outside of an edge.
    fn divide_by(
        &mut self,
        node: &mut RowNode,
        by: &Loop,
        left: &mut u32,
        halvings: u32,
        levels: u32,
    ) -> Answer {
        let base = node.rows.len();
        let mut edges = Vec::with_capacity(by.ring.len());
        for (k, &divides) in by.divides.iter().enumerate() {
            let mut found = if divides { LoopEdge::Divides } else { LoopEdge::Inside };
            // An edge that no line of the node passes on the outer side, given the rows so far, needs no part
            // of its own.
            if divides && base > 0 {
                node.push(by.row(k, -by.side));
                if let (Value::Negative, weights) = self.solve(&node.matrix) {
                    found = LoopEdge::Never { weights };
                }
                node.truncate(base);
            }
            edges.push(found);
        }
        let mark = self.steps.len();
        let dividing: Vec<usize> = (0..edges.len()).filter(|&k| edges[k] == LoopEdge::Divides).collect();
        self.steps.push(Step::Loop {
            piece: by.piece,
            ring: by.ring.as_slice().into(),
            side: by.side,
            edges: edges.into_boxed_slice(),
        });
        let mut answer = Answer::Hidden;
        // Part k holds the segments inside the edges before k and outside edge k. The check makes the same
        // parts.
        for (count, &k) in dividing.iter().enumerate() {
            node.truncate(base + count.saturating_sub(1));
            if count > 0 {
                node.push(by.row(dividing[count - 1], by.side));
            }
            node.push(by.row(k, -by.side));
            answer = self.divide_rows(node, left, halvings, levels + 1);
            if !matches!(answer, Answer::Hidden) {
                break;
            }
        }
        node.truncate(base);
        if !matches!(answer, Answer::Hidden) {
            self.steps.truncate(mark);
        }
        answer
    }

    /// Halves the viewcell polygon or the target polygon of a node, and decides both halves. A way to halve
    /// that leaves one half without lines is preferred.
    fn halve_divided(&mut self, node: &RowNode, left: &mut u32, halvings: u32, levels: u32) -> Answer {
        if halvings >= self.budget.halvings {
            return Answer::Undecided;
        }
        let sight = &node.sight;
        let p_is_larger = sight.p.size() >= sight.q.size();
        let mut best: Option<(u32, Step, [RowNode; 2])> = None;
        for (of_p, across) in [(true, false), (false, false), (true, true), (false, true)] {
            let polygon = if of_p { &sight.p } else { &sight.q };
            if across && !polygon.has_two_ways() {
                continue;
            }
            // A half whose rows exclude all lines scores highest. Otherwise the larger polygon is halved.
            let mut score = u32::from(of_p == p_is_larger);
            let halves = sight.halves(of_p, across).map(|half| {
                let mut half = RowNode::new(half, half.side_error(self.delta), &node.rows);
                if !node.rows.is_empty() {
                    let solution = self.solve(&half.matrix);
                    score += if solution.0 == Value::Negative { 4 } else { 0 };
                    half.solution = Some(solution);
                }
                half
            });
            if best.as_ref().is_none_or(|(most, ..)| score > *most) {
                best = Some((score, Step::Halves { of_p, across }, halves));
            }
            if score >= 4 {
                break;
            }
        }
        let Some((_, step, halves)) = best else { return Answer::Undecided };
        let mark = self.steps.len();
        self.steps.push(step);
        for mut half in halves {
            let answer = self.divide_rows(&mut half, left, halvings + 1, levels + 1);
            if !matches!(answer, Answer::Hidden) {
                self.steps.truncate(mark);
                return answer;
            }
        }
        Answer::Hidden
    }

    /// Solves the linear program of a node's rows, given as a matrix.
    fn solve(&mut self, matrix: &Matrix) -> Solution {
        self.stats.programs += 1;
        let value = self.game.solve(matrix);
        let is_negative = value == Value::Negative;
        let weights = if is_negative { &self.game.row_weights } else { &self.game.column_weights };
        (value, weights.as_slice().into())
    }

    /// Returns a segment of the node that satisfies all rows. `weights` are weights of pairs of corners that
    /// make all rows positive, and give a first segment. Its ends are then improved in turn by linear
    /// programs. `None` if no segment is found.
    fn line_inside(&mut self, node: &RowNode, weights: &[f64]) -> Option<Segment> {
        let RowNode { sight, rows, .. } = node;
        let delta = node.delta;
        let (p, q) = (sight.p.corners(), sight.q.corners());
        let (mut from, mut to, mut total) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for (k, weight) in weights.iter().enumerate() {
            from += p[k / q.len()] * *weight;
            to += q[k % q.len()] * *weight;
            total += weight;
        }
        if total.is_nan() || total <= 0.5 {
            return None;
        }
        // The weights belong to pairs of corners. The weighted means of the corners of the viewcell polygon
        // and of the target polygon are the ends of a first segment.
        let mut line = self.segment(from / total, to / total);
        let satisfies = |line: Segment| {
            rows.iter().all(|row| {
                let (value, error) = side(line.p, line.q, row.edge.ends[0], row.edge.ends[1], delta);
                value * row.side > error
            })
        };
        for round in 0..5 {
            if satisfies(line) {
                // Linear programs end at corners. A segment further inside is preferred.
                let (p, q) = (sight.p.center(), sight.q.center());
                let towards =
                    |part: f64| self.segment(line.p + (p - line.p) * part, line.q + (q - line.q) * part);
                let inner = [0.5, 0.2, 0.05, 0.01, 0.001].into_iter().map(towards).find(|&l| satisfies(l));
                return Some(inner.unwrap_or(line));
            }
            // With one end fixed, the rows are linear in the other end: a small matrix game finds the best
            // end.
            let of_q = round % 2 == 0;
            let corners = if of_q { q } else { p };
            self.matrix.start(corners.len());
            for row in rows {
                let [a, b] = row.edge.ends;
                self.matrix.push(|entries| {
                    let mut greatest = 0.0f64;
                    for &x in corners {
                        let (from, to) = if of_q { (line.p, x) } else { (x, line.q) };
                        let (value, error) = side(from, to, a, b, delta);
                        entries.push(value * row.side);
                        greatest = greatest.max(error);
                    }
                    greatest
                });
            }
            self.game.solve(&self.matrix);
            let weights = &self.game.column_weights;
            let total: f64 = weights.iter().sum();
            if total.is_nan() || total <= 0.5 {
                return None;
            }
            let x = corners.iter().zip(weights).map(|(x, w)| *x * *w).sum::<DVec3>() / total;
            line = if of_q { self.segment(line.p, x) } else { self.segment(x, line.q) };
        }
        satisfies(line).then_some(line)
    }

    /// Returns the loop with the fewest dividing edges, among loops on the occluders that a line crosses.
    /// `hits` are the indices of these occluders' triangles, `depth` is the number of the node's rows: loops
    /// are moved outwards by less the more rows there are, so that two loops on one edge are apart. `None` if
    /// no loop can be used.
    fn best_loop(&mut self, sight: &Sight, depth: usize, line: Segment, hits: &[u32]) -> Option<Loop> {
        // The growth decreases with each row: two loops on one edge are then certainly apart, and a line
        // outside of the first is not inside of the second.
        let part = (0..depth.min(60)).fold(1.0, |part, _| part * 0.9);
        let grow = self.clearance * (0.5 + 0.5 * part);
        let mut best: Option<Loop> = None;
        for (k, &hit) in hits.iter().enumerate() {
            let piece = self.triangles.piece_of(hit);
            if hits[..k].iter().any(|&other| self.triangles.piece_of(other) == piece) {
                continue;
            }
            let triangles = self.triangles;
            if !triangles.piece(piece).triangles.iter().all(|&t| self.blocks(sight, t)) {
                continue;
            }
            let Some(found) = self.loop_around(sight, piece, line, grow) else { continue };
            if best.as_ref().is_none_or(|best| found.dividing() < best.dividing()) {
                best = Some(found);
            }
            if best.as_ref().is_some_and(|best| best.dividing() == 0) {
                break;
            }
        }
        best
    }

    /// Returns the loop around a convex occluder polygon, moved outwards by `grow` metres and cut off at the
    /// planes of the viewcell and target polygons. `None` if `line` does not certainly pass inside the loop.
    fn loop_around(&self, sight: &Sight, piece: u32, line: Segment, grow: f64) -> Option<Loop> {
        let around = self.triangles.piece(piece);
        let corners = around.ring.iter().zip(&around.positions);
        let mut ring: Vec<RingCorner> = corners.map(|(&v, &position)| (position, self.tag(v))).collect();
        if grow > 0.0 {
            ring = grown(&ring, grow);
        }
        // The viewcell polygon lies exactly in its plane, a face of the viewcell: an occluder in this plane
        // blocks the segments that leave through it. Points of the target polygon lie off their plane by
        // rounding: an occluder in this plane, such as the back of a card or the target box's own front,
        // blocks nothing. Heights are wrong by less than the error of positions, which the check allows for,
        // so a height of four such errors is certainly in front of the plane. Corners of the target triangle
        // are in its plane; a loop of only such corners bounds nothing in front of it.
        let before_q = sight.cut_before_q(self.pad());
        ring = cut(ring, &sight.before_p, |half, corner| half.height(corner.0));
        ring = cut(ring, &before_q, |half, &(x, tag)| if tag == NO_CORNER { half.height(x) } else { 0.0 });
        drop_straight(&mut ring);
        let is_before = |&(x, tag): &RingCorner| tag == NO_CORNER && sight.before_q.height(x) >= self.pad();
        if ring.len() < 3 || !ring.iter().any(is_before) {
            return None;
        }
        let mut found = Loop { piece, side: 1.0, divides: Vec::with_capacity(ring.len()), ring };
        let mut sides = 0;
        for k in 0..found.ring.len() {
            let [a, b] = found.edge(k).ends;
            sides |= match sign(side(line.p, line.q, a, b, sight.side_error(self.delta))) {
                1 => POSITIVE,
                -1 => NEGATIVE,
                _ => return None,
            };
        }
        found.side = match sides {
            POSITIVE => 1.0,
            NEGATIVE => -1.0,
            _ => return None,
        };
        for k in 0..found.ring.len() {
            let occurring = signs(sight, &found.edge(k), sight.side_error(self.delta));
            found.divides.push(occurring != sides);
        }
        Some(found)
    }
}

/// Moves the corners of a planar convex ring outwards so that its sides move by `grow` metres, or by less at
/// sharp corners.
fn grown(ring: &[RingCorner], grow: f64) -> Vec<RingCorner> {
    let n = ring.len();
    let normal: DVec3 = (1..n - 1).map(|k| (ring[k].0 - ring[0].0).cross(ring[k + 1].0 - ring[0].0)).sum();
    let out = |k: usize| {
        let (a, b) = (ring[k % n].0, ring[(k + 1) % n].0);
        (b - a).cross(normal).normalize_or_zero()
    };
    let moved = |k: usize| ring[k].0 + crate::chain::mitre(out(k + n - 1) + out(k), 2, grow);
    (0..n).map(|k| (moved(k), NO_CORNER)).collect()
}

/// Returns the part of a ring in front of the plane of `half` or on it. `height` returns the height of a
/// corner over that plane, or 0 for a corner that counts as on the plane.
fn cut(ring: Vec<RingCorner>, half: &Half, height: impl Fn(&Half, &RingCorner) -> f64) -> Vec<RingCorner> {
    let heights: Box<[f64]> = ring.iter().map(|corner| height(half, corner)).collect();
    if heights.iter().all(|h| *h >= 0.0) {
        return ring;
    }
    let mut out = Vec::with_capacity(ring.len() + 1);
    for k in 0..ring.len() {
        let next = (k + 1) % ring.len();
        let (here, there) = (heights[k], heights[next]);
        if here >= 0.0 {
            out.push(ring[k]);
        }
        if (here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0) {
            let (a, b) = (ring[k].0, ring[next].0);
            out.push((half.crossing(a, b, [here, there]), NO_CORNER));
        }
    }
    out
}

/// Removes each corner that is equal to the one before or lies on a straight side, where two edges on one
/// line would give two equal rows.
fn drop_straight(ring: &mut Vec<RingCorner>) {
    let mut k = 0;
    while ring.len() >= 3 && k < ring.len() {
        let n = ring.len();
        let (u, v) = (ring[k].0 - ring[(k + n - 1) % n].0, ring[(k + 1) % n].0 - ring[k].0);
        if ring[k].1 == NO_CORNER && u.cross(v).length() <= 1e-12 * u.length() * v.length() {
            ring.remove(k);
            k = k.saturating_sub(1);
        } else {
            k += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polygon::Polygon;
    use crate::search::Budget;
    use crate::sight::{CellBox, Target, sights};
    use crate::triangles::SceneTriangles;
    use std::vec;
    use visibility_core::glam::Vec3;
    use visibility_core::pvs::Viewcell;
    use visibility_core::{Aabb, Object, Scene};

    /// Nodes below the deepest level stay undecided: two walls that overlap hide a target, which takes one
    /// division by the edge of a wall.
    #[test]
    fn nodes_below_the_deepest_level_are_undecided() {
        let plate = |x: f32, y: [f32; 2], r: f32| {
            let [a, b, c, d] =
                [(y[0], -r), (y[1], -r), (y[1], r), (y[0], r)].map(|(y, z)| Vec3::new(x, y, z));
            vec![[a, b, c], [a, c, d]]
        };
        let mut scene = Scene::new();
        for triangles in
            [plate(20.0, [-0.5, 0.5], 0.5), plate(5.0, [-30.0, 0.2], 30.0), plate(6.0, [-0.2, 30.0], 30.0)]
        {
            let bounds = Aabb::from_points(triangles.iter().flatten().copied());
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            scene.set_triangles(id, triangles).unwrap();
        }
        let triangles = SceneTriangles::new(&scene);
        let cell = Viewcell::from_box(DVec3::new(0.0, -0.5, -0.5), DVec3::new(1.0, 0.5, 0.5));
        let cell = CellBox::new(&cell, DVec3::ZERO).unwrap();
        let target = Target::Triangle(0);
        let mut search = Search::new(&triangles, cell, 1e-4, None);
        search.begin(target, Budget { nodes: 1000, divided: 200, halvings: 0 });
        let all = sights(&triangles, &cell, target, 1e-4, search.pad()).unwrap();
        for (levels, expected) in [(0, true), (LEVELS - 1, true), (LEVELS, false), (LEVELS + 1, false)] {
            let mut node = RowNode::new(all[0], all[0].side_error(search.delta), &[]);
            let answer = search.divide_rows(&mut node, &mut 200, 0, levels);
            assert_eq!(answer == Answer::Hidden, expected, "at level {levels}: {answer:?}");
        }
        // Nor is a node decided without nodes left, or after a stop.
        let node = || RowNode::new(all[0], all[0].side_error(1e-9), &[]);
        assert_eq!(search.divide_rows(&mut node(), &mut 0, 0, 0), Answer::Undecided, "without nodes left");
        search.stop = &|| true;
        assert_eq!(search.divide_rows(&mut node(), &mut 200, 0, 0), Answer::Undecided, "after a stop");
    }

    /// A line that touches the edge of a triangle is not clear, and one that passes beside it is.
    #[test]
    fn lines_that_touch_an_edge_are_not_clear() {
        let cell = CellBox { min: DVec3::new(0.0, -0.5, -0.5), max: DVec3::new(1.0, 0.5, 0.5) };
        let [p, q] = [1.0, 9.0].map(|x| {
            let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
            Polygon::new(&corners.map(|[y, z]| DVec3::new(x, y, z)))
        });
        let before_p = Half { normal: DVec3::X, offset: -1.0 };
        let before_q = Half { normal: DVec3::NEG_X, offset: 9.0 };
        let sight = Sight { p, q, before_p, before_q, near: None };
        for (edge, is_clear) in [(0.0, false), (0.125, true)] {
            let t = [[-9.0, edge], [9.0, edge], [0.0, 9.0]].map(|[y, z]| Vec3::new(5.0, y, z));
            let mut scene = Scene::new();
            let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points(t)) });
            scene.set_triangles(id, [t]).unwrap();
            let triangles = SceneTriangles::new(&scene);
            let mut search = Search::new(&triangles, cell, 0.0, None);
            let target = Target::Box { min: DVec3::new(9.0, -0.5, -0.5), max: DVec3::new(10.0, 0.5, 0.5) };
            search.begin(target, Budget { nodes: 0, divided: 0, halvings: 0 });
            let mut node = RowNode::new(sight, sight.side_error(search.delta), &[]);
            let answer = search.divide_rows(&mut node, &mut 5, 0, 0);
            assert_eq!(matches!(answer, Answer::Visible(_)), is_clear, "an edge at {edge}: {answer:?}");
        }
    }
}
