//! The beam tree: a binary partition of the picture into what is covered already and what is still open.
//!
//! Each line is the image of a plane through the eye and an edge, each leaf a beam of lines of visibility.
//! Polygons come nearest first. One that reaches an open leaf is seen there, and closes the part of the leaf
//! that it covers; one that reaches only closed leaves is hidden. A node both of whose sides are closed is
//! closed itself, so that the tree shrinks to one leaf as the picture fills.
//!
//! # Rounding
//! Corners are known up to an error `d`, for which whoever draws them answers. The line of an edge is taken
//! from its two ends as they were drawn, never from what cuts have left of it, so that two polygons that
//! share an edge have the same line for it, to the last bit. Where one has only a part of the edge, of length
//! `s`, the two lines differ by up to `d (1 + 2 r / s)` at a distance of `r`, and the picture is at most 2.9
//! wide. A point within 4 times that of a line is *on* it: once for the point, once for the line, and as much
//! again for points that were cut along another such line. An edge on a line of the tree divides nothing
//! again.
//!
//! So a polygon may fail to cover a strip as wide as the margin of a line, and what lies behind it reaches an
//! open leaf there. Margins are at most a quarter of [`NARROWEST`], and parts of wider polygons that are
//! narrower than that are not seen. A polygon that is itself so narrow is told apart: it is cut a margin
//! beyond each line, and where it then reaches an open leaf it is [glimpsed](Visibility::Glimpsed).

use alloc::vec::Vec;
use visibility_core::geometry::Side;

/// A leaf through which nothing is seen yet.
const OPEN: u32 = u32::MAX;
/// A leaf that is covered.
const CLOSED: u32 = u32::MAX - 1;

/// A vertex in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Corner {
    pub(super) x: f64,
    pub(super) y: f64,
    /// Whether the edge from here to the next corner lies on a line above in the tree.
    pub(super) on_line: bool,
    /// Which edge of the polygon it is a part of.
    edge: u32,
}

impl Corner {
    pub(super) fn new(x: f64, y: f64) -> Self {
        Self { x, y, on_line: false, edge: 0 }
    }
}

/// `a x + b y + c`, with `a` and `b` of unit length together.
#[derive(Clone, Copy, Debug)]
struct Line {
    a: f64,
    b: f64,
    c: f64,
    margin: f64,
}

impl Line {
    fn new(a: f64, b: f64, c: f64, error: f64) -> Self {
        Self { a, b, c, margin: 4.0 * error }
    }

    /// The line from one corner to another, in front on its left, and whether it is certain far from them
    /// too; `None` if they are so close that it could be any.
    fn through(p: Corner, q: Corner, error: f64) -> Option<(Self, bool)> {
        let (dx, dy) = (q.x - p.x, q.y - p.y);
        let length = visibility_core::glam::DVec2::new(dx, dy).length();
        if length.is_nan() || length < 64.0 * error {
            return None;
        }
        let margin = 4.0 * error * (1.0 + 5.8 / length);
        // From the end that comes first, whichever that is, so that both neighbours get the same.
        let (at, sign) = if (p.x, p.y) <= (q.x, q.y) { (p, 1.0) } else { (q, -1.0) };
        let (a, b) = (sign * -dy / length, sign * dx / length);
        let c = -(a * at.x + b * at.y);
        let widest = 0.25 * NARROWEST;
        let line = Self { a: sign * a, b: sign * b, c: sign * c, margin: margin.min(widest) };
        Some((line, margin <= widest))
    }

    #[inline]
    fn distance(&self, p: Corner) -> f64 {
        self.a * p.x + self.b * p.y + self.c
    }
}

/// Gaps that are narrower, in units of half the picture, are not seen through: at 2560 columns the 8000th
/// part of a pixel.
pub(super) const NARROWEST: f64 = 1e-7;

/// What there is to see of a polygon.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Visibility {
    /// Nothing, but for gaps that rounding may have made.
    Hidden,
    /// A part as narrow as such gaps, of a polygon that is as narrow itself.
    Glimpsed,
    /// A part that is wide enough.
    Seen,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    line: Line,
    /// Behind the line, and in front.
    children: [u32; 2],
    parent: u32,
}

/// A part of the polygon at hand, on its way into a side of a node.
#[derive(Clone, Copy, Debug)]
struct Task {
    parent: u32,
    side: u8,
    /// Whether it was once too thin to tell which side of a line it is on. It is then in the right place, up
    /// to rounding, but has no area to cover.
    thin: bool,
    /// Its corners are those from here to the end of the stack.
    begin: usize,
}

/// Where in the picture something was seen: the middle of a part that nothing nearer covers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Witness {
    /// From -1 on the left to 1 on the right.
    pub x: f64,
    /// From -1 at the bottom to 1 at the top.
    pub y: f64,
    /// How wide the part is, about, across its narrowest direction, in the same units.
    pub width: f64,
}

/// See the [module](self).
#[derive(Clone, Debug, Default)]
pub(super) struct Beams {
    nodes: Vec<Node>,
    root: u32,
    error: f64,
    tasks: Vec<Task>,
    /// All parts under way: a stack whose top belongs to the topmost task.
    corners: Vec<Corner>,
    /// Those of the edges of the polygon at hand, each with whether it is certain; none for edges too short
    /// to divide anything.
    lines: Vec<Option<(Line, bool)>>,
    part: Vec<Corner>,
    sides: Vec<f64>,
    witness: Witness,
}

const NO_PARENT: u32 = u32::MAX;

/// Lines that divide the picture to begin with, on each axis a power of two less one: whatever comes first,
/// the tree is no list.
const GRID: u32 = 3;

impl Beams {
    /// Opens the whole picture. `error` bounds that of the points to come.
    pub(super) fn begin(&mut self, error: f64) {
        self.error = error;
        self.nodes.clear();
        self.root = OPEN;
        let mut slot = (NO_PARENT, 0);
        // Outside the picture nothing is seen.
        for (a, b) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
            let node = self.push(slot, Line::new(a, b, 1.0, error), [CLOSED, OPEN]);
            slot = (node, 1);
        }
        self.divide(slot, [-1.0, -1.0], [2.0, 2.0], 2 * GRID);
    }

    /// A balanced tree over a rectangle.
    fn divide(&mut self, slot: (u32, u8), least: [f64; 2], size: [f64; 2], levels: u32) {
        if levels == 0 {
            return;
        }
        let axis = (levels % 2) as usize;
        let (mut half, mut upper) = (size, least);
        half[axis] *= 0.5;
        upper[axis] += half[axis];
        let [a, b] = if axis == 0 { [1.0, 0.0] } else { [0.0, 1.0] };
        let node = self.push(slot, Line::new(a, b, -upper[axis], self.error), [OPEN, OPEN]);
        self.divide((node, 0), least, half, levels - 1);
        self.divide((node, 1), upper, half, levels - 1);
    }

    fn push(&mut self, (parent, side): (u32, u8), line: Line, children: [u32; 2]) -> u32 {
        let node = self.nodes.len() as u32;
        self.nodes.push(Node { line, children, parent });
        self.set(parent, side, node);
        node
    }

    fn set(&mut self, parent: u32, side: u8, child: u32) {
        if parent == NO_PARENT {
            self.root = child;
        } else {
            self.nodes[parent as usize].children[usize::from(side)] = child;
        }
    }

    /// Whether nothing can be seen any more.
    pub(super) fn is_closed(&self) -> bool {
        self.root == CLOSED
    }

    /// Whether anything of a convex polygon, counter-clockwise in the picture, is seen.
    pub(super) fn look(&mut self, polygon: &[Corner]) -> Visibility {
        self.run(polygon, false)
    }

    /// The same, after which what lies behind the polygon is not seen any more. `error` bounds that of its
    /// corners.
    pub(super) fn add(&mut self, polygon: &[Corner], error: f64) -> Visibility {
        self.lines.clear();
        for (i, &p) in polygon.iter().enumerate() {
            self.lines.push(Line::through(p, polygon[(i + 1) % polygon.len()], error));
        }
        // A polygon with an area has two edges at least; one that is hardly more than a point covers nothing.
        let closing = self.lines.iter().flatten().count() >= 2;
        if !closing {
            return self.look(polygon);
        }
        self.end_strips(polygon, error);
        if !is_narrow(polygon) {
            return self.run(polygon, true);
        }
        // What is looked for beyond margins must not be covered there.
        let visibility = self.look(polygon);
        let witness = self.witness;
        self.run(polygon, true);
        self.witness = witness;
        visibility
    }

    /// Edges too short to have a line: their neighbours may be all but parallel, and would cover a strip
    /// without an end. It ends square to the edge before, at that end of the short edge which comes first.
    fn end_strips(&mut self, polygon: &[Corner], error: f64) {
        let count = polygon.len();
        for i in 0..count {
            if self.lines[i].is_some() {
                continue;
            }
            let before = (1..count).map(|back| (i + count - back) % count);
            let edge = before.map(|j| (j, (j + 1) % count));
            let Some((Line { a, b, margin, .. }, _)) =
                edge.filter_map(|(j, k)| Line::through(polygon[j], polygon[k], error)).next()
            else {
                continue;
            };
            // The edge before runs along (b, -a).
            let along = |p: Corner| b * p.x - a * p.y;
            let c = along(polygon[i]).min(along(polygon[(i + 1) % count]));
            self.lines[i] = Some((Line { a: -b, b: a, c, margin }, false));
        }
    }

    fn run(&mut self, polygon: &[Corner], closing: bool) -> Visibility {
        self.witness.width = -1.0;
        self.tasks.clear();
        self.corners.clear();
        let narrow = is_narrow(polygon);
        let mut visibility = Visibility::Hidden;
        if self.root == CLOSED {
            return visibility;
        }
        for (edge, &corner) in (0..).zip(polygon) {
            self.corners.push(Corner { edge, ..corner });
        }
        self.tasks.push(Task { parent: NO_PARENT, side: 0, thin: false, begin: 0 });
        while let Some(task) = self.tasks.pop() {
            let child = match task.parent {
                NO_PARENT => self.root,
                parent => self.nodes[parent as usize].children[usize::from(task.side)],
            };
            match child {
                CLOSED => self.corners.truncate(task.begin),
                OPEN => {
                    let witness = witness(&self.corners[task.begin..]);
                    if !task.thin && witness.width > NARROWEST {
                        visibility = Visibility::Seen;
                    } else if narrow && visibility == Visibility::Hidden {
                        visibility = Visibility::Glimpsed;
                    }
                    if witness.width > self.witness.width {
                        self.witness = witness;
                    }
                    if visibility == Visibility::Seen && !closing {
                        return visibility;
                    }
                    if closing && !task.thin {
                        self.close(task);
                    }
                    self.corners.truncate(task.begin);
                }
                node => self.pass(node, task, narrow && !closing),
            }
        }
        visibility
    }

    /// The widest place where the polygon at hand was seen.
    pub(super) fn witness(&self) -> Witness {
        self.witness
    }

    /// Sends the topmost part to the sides of a node.
    fn pass(&mut self, id: u32, task: Task, generous: bool) {
        let Node { line, children, .. } = self.nodes[id as usize];
        let (mut least, mut greatest, mut sum) = (0.0f64, 0.0f64, 0.0);
        self.sides.clear();
        for &corner in &self.corners[task.begin..] {
            let distance = line.distance(corner);
            least = if distance < least { distance } else { least };
            greatest = if distance > greatest { distance } else { greatest };
            sum += distance;
            self.sides.push(distance);
        }
        if generous {
            return self.pass_generously(id, task);
        }
        let (front, back) = (greatest > line.margin, least < -line.margin);
        if !(front && back) {
            let side = u8::from(if front || back { front } else { sum > 0.0 });
            let count = self.sides.len();
            let thin = task.thin || !(front || back);
            if children[usize::from(side)] == CLOSED {
                self.corners.truncate(task.begin);
                return;
            }
            for i in 0..count {
                let j = if i + 1 == count { 0 } else { i + 1 };
                if self.sides[i].abs().max(self.sides[j].abs()) <= line.margin {
                    self.corners[task.begin + i].on_line = true;
                }
            }
            self.tasks.push(Task { parent: id, side, thin, begin: task.begin });
            return;
        }
        self.part.clear();
        self.part.extend_from_slice(&self.corners[task.begin..]);
        self.corners.truncate(task.begin);
        for side in [0u8, 1] {
            if children[usize::from(side)] == CLOSED {
                continue;
            }
            let begin = self.corners.len();
            let sign = if side == 1 { 1.0 } else { -1.0 };
            let margin = line.margin;
            let side_of = |i: usize| Side::of(sign * self.sides[i], margin);
            for i in 0..self.part.len() {
                let j = if i + 1 == self.part.len() { 0 } else { i + 1 };
                let (p, q) = (self.part[i], self.part[j]);
                let along = Corner { on_line: true, ..p };
                match (side_of(i), side_of(j)) {
                    (Side::Front, Side::Front | Side::On) | (Side::On, Side::Front) => self.corners.push(p),
                    (Side::On, Side::On | Side::Back) => self.corners.push(along),
                    (Side::Front, Side::Back) => {
                        self.corners.push(p);
                        let cut = crossing(p, q, self.sides[i], self.sides[j]);
                        self.corners.push(Corner { on_line: true, ..cut });
                    }
                    (Side::Back, Side::Front) => {
                        let cut = crossing(p, q, self.sides[i], self.sides[j]);
                        self.corners.push(Corner { on_line: p.on_line, edge: p.edge, ..cut });
                    }
                    (Side::Back, Side::On | Side::Back) => {}
                }
            }
            self.tasks.push(Task { parent: id, side, begin, ..task });
        }
    }

    /// Sends what is in front of a node or less than its margin behind it to the front, and likewise to the
    /// back.
    fn pass_generously(&mut self, id: u32, task: Task) {
        let Node { line: Line { margin, .. }, children, .. } = self.nodes[id as usize];
        self.part.clear();
        self.part.extend_from_slice(&self.corners[task.begin..]);
        self.corners.truncate(task.begin);
        for side in [0u8, 1] {
            if children[usize::from(side)] == CLOSED {
                continue;
            }
            let begin = self.corners.len();
            let sign = if side == 1 { 1.0 } else { -1.0 };
            for i in 0..self.part.len() {
                let j = if i + 1 == self.part.len() { 0 } else { i + 1 };
                let (p, q) = (self.part[i], self.part[j]);
                let [dp, dq] = [self.sides[i], self.sides[j]].map(|distance| sign * distance + margin);
                if dp >= 0.0 {
                    self.corners.push(p);
                }
                if (dp >= 0.0) != (dq >= 0.0) {
                    self.corners.push(crossing(p, q, dp, dq));
                }
            }
            if self.corners.len() > begin {
                self.tasks.push(Task { parent: id, side, begin, ..task });
            }
        }
    }

    /// Closes the part of an open leaf that the topmost corners cover.
    fn close(&mut self, task: Task) {
        let mut slot = (task.parent, task.side);
        let mut divided = false;
        // Uncertain lines come last: they divide no more than the strip that the others leave, where they are
        // close to their edge.
        for certain in [true, false] {
            for i in task.begin..self.corners.len() {
                let Corner { on_line, edge, .. } = self.corners[i];
                match self.lines[edge as usize] {
                    Some((line, sure)) if !on_line && sure == certain => {
                        let node = self.push(slot, line, [OPEN, OPEN]);
                        slot = (node, 1);
                        divided = true;
                    }
                    _ => {}
                }
            }
        }
        self.set(slot.0, slot.1, CLOSED);
        if !divided {
            self.close_above(task.parent);
        }
    }

    /// Closes nodes both of whose sides are closed.
    fn close_above(&mut self, mut id: u32) {
        while id != NO_PARENT {
            let Node { children, parent, .. } = self.nodes[id as usize];
            if children != [CLOSED; 2] {
                return;
            }
            match parent {
                NO_PARENT => self.root = CLOSED,
                above => {
                    let of = &mut self.nodes[above as usize].children;
                    of[usize::from(of[1] == id)] = CLOSED;
                }
            }
            id = parent;
        }
    }
}

/// Whether a polygon is hardly wider than the gaps that are not seen through.
fn is_narrow(polygon: &[Corner]) -> bool {
    witness(polygon).width <= 4.0 * NARROWEST
}

/// The middle of a part, and its area by its longest side.
fn witness(part: &[Corner]) -> Witness {
    let (mut x, mut y, mut area, mut longest) = (0.0, 0.0, 0.0f64, 0.0f64);
    let first = part[0];
    for (i, p) in part.iter().enumerate() {
        let q = part[(i + 1) % part.len()];
        x += p.x / part.len() as f64;
        y += p.y / part.len() as f64;
        area += (p.x - first.x) * (q.y - first.y) - (p.y - first.y) * (q.x - first.x);
        longest = longest.max((q.x - p.x).abs().max((q.y - p.y).abs()));
    }
    Witness { x, y, width: if longest > 0.0 { 0.5 * area.abs() / longest } else { 0.0 } }
}

/// Where an edge meets a line, the same from both ends.
fn crossing(p: Corner, q: Corner, dp: f64, dq: f64) -> Corner {
    let (p, q, dp, dq) = if (p.x, p.y) <= (q.x, q.y) { (p, q, dp, dq) } else { (q, p, dq, dp) };
    let t = dp / (dp - dq);
    Corner::new(p.x + (q.x - p.x) * t, p.y + (q.y - p.y) * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(corners: &[(f64, f64)]) -> Vec<Corner> {
        corners.iter().map(|&(x, y)| Corner::new(x, y)).collect()
    }

    const ERROR: f64 = 1e-13;

    #[test]
    fn a_picture_covered_by_polygons_is_closed_though_their_corners_are_rounded() {
        // Rows of quadrangles, each divided at other places, their common edge slanted: corners of one row
        // lie on edges of the next, within rounding.
        let mut beams = Beams::default();
        beams.begin(ERROR);
        let (rows, slant) = (9, 0.0371);
        let height = |row: usize, x: f64| -1.2 + 2.4 * row as f64 / rows as f64 + slant * x;
        for row in 0..rows {
            let columns = 5 + row * 3 % 7;
            for column in 0..columns {
                assert!(!beams.is_closed());
                let at = |c: usize| -1.1 + 2.2 * c as f64 / columns as f64;
                let noise = |c: usize| if (c * 7 + row * 3) % 5 < 2 { 0.5 * ERROR } else { -0.5 * ERROR };
                let (left, right) = (at(column), at(column + 1));
                let quad = polygon(&[
                    (left, height(row, left) + noise(column)),
                    (right, height(row, right) + noise(column + 1)),
                    (right, height(row + 1, right) - noise(column + 1)),
                    (left, height(row + 1, left) - noise(column)),
                ]);
                assert_eq!(beams.add(&quad, ERROR), Visibility::Seen);
            }
        }
        assert!(beams.is_closed());
        assert_eq!(beams.look(&polygon(&[(-0.5, -0.5), (0.5, -0.5), (0.0, 0.5)])), Visibility::Hidden);
    }

    #[test]
    fn gaps_are_seen_through_down_to_the_tolerance() {
        for (gap, seen) in [(0.1, true), (1e-3, true), (1e-6, true), (1e-9, false)] {
            let mut beams = Beams::default();
            beams.begin(ERROR);
            let half = 0.5 * gap;
            beams.add(&polygon(&[(-2.0, -2.0), (0.3 - half, -2.0), (0.3 - half, 2.0), (-2.0, 2.0)]), ERROR);
            beams.add(&polygon(&[(0.3 + half, -2.0), (2.0, -2.0), (2.0, 2.0), (0.3 + half, 2.0)]), ERROR);
            let visibility = beams.look(&polygon(&[(-0.9, -0.9), (0.9, -0.8), (0.9, 0.9)]));
            assert_eq!(visibility, if seen { Visibility::Seen } else { Visibility::Hidden }, "{gap}");
            let witness = beams.witness();
            assert!(!seen || (witness.x - 0.3).abs() <= half && witness.width <= gap);
        }
    }

    #[test]
    fn polygons_with_short_edges_hide_what_is_behind_them() {
        // A spike without its tip, and a strip: their short edges have any direction.
        for shape in [
            &[(-0.9, -0.5), (0.9, 1e-9), (0.9, 2e-9), (-0.9, 0.5)][..],
            &[(-0.9, 0.0), (0.9, 0.0), (0.9, 1e-6), (-0.9, 1e-6)],
        ] {
            let mut beams = Beams::default();
            beams.begin(ERROR);
            let shape = polygon(shape);
            assert_eq!(beams.add(&shape, ERROR), Visibility::Seen);
            assert_eq!(beams.look(&shape), Visibility::Hidden);
            // And nothing beside them.
            assert_eq!(
                beams.look(&polygon(&[(0.91, -0.1), (0.95, -0.1), (0.95, 0.1), (0.91, 0.1)])),
                Visibility::Seen
            );
            assert_eq!(beams.look(&polygon(&[(-0.5, 0.6), (0.5, 0.6), (0.0, 0.7)])), Visibility::Seen);
        }
        // What is hardly more than a point hides nothing.
        let mut beams = Beams::default();
        beams.begin(ERROR);
        beams.add(&polygon(&[(0.3, 0.3), (0.3 + 1e-13, 0.3), (0.3, 0.3 + 1e-13)]), ERROR);
        assert_eq!(beams.look(&polygon(&[(0.2, 0.2), (0.4, 0.2), (0.3, 0.4)])), Visibility::Seen);
    }

    #[test]
    fn what_is_narrow_itself_is_glimpsed_unless_it_is_covered_for_sure() {
        let mut beams = Beams::default();
        beams.begin(ERROR);
        // Nothing is before it: a needle, in the middle of the picture, and one on a line of the tree.
        let needle = |x: f64, low: f64, high: f64| {
            polygon(&[(x, low), (x + 1e-12, low), (x + 1e-12, high), (x, high)])
        };
        assert_eq!(beams.look(&needle(0.3, -0.5, 0.5)), Visibility::Glimpsed);
        assert_eq!(beams.look(&needle(0.0, -0.5, 0.5)), Visibility::Glimpsed);
        // Half of it is covered, or all of it, or it is in the margin of the edge of what covers.
        assert_eq!(
            beams.add(&polygon(&[(0.2, -0.6), (0.4, -0.6), (0.4, 0.1), (0.2, 0.1)]), ERROR),
            Visibility::Seen
        );
        assert_eq!(beams.look(&needle(0.3, -0.5, 0.5)), Visibility::Glimpsed);
        assert_eq!(beams.look(&needle(0.3, -0.5, 0.0)), Visibility::Hidden);
        assert_eq!(beams.look(&needle(0.4, -0.5, 0.0)), Visibility::Glimpsed);
        assert_eq!(beams.look(&needle(0.4 - 5e-13, -0.5, 0.0)), Visibility::Glimpsed);
        // A needle covers, but not what is beside it.
        assert_eq!(beams.add(&needle(-0.3, -0.5, 0.5), 1e-16), Visibility::Glimpsed);
        assert_eq!(beams.look(&needle(-0.3 + 2e-12, -0.5, 0.5)), Visibility::Glimpsed);
    }

    #[test]
    fn strips_end_where_their_edge_is_too_short_for_a_line() {
        let (error, width) = (1e-8, 3e-7);
        let strip = |left: f64, right: f64| {
            polygon(&[(left, 0.3), (right, 0.3), (right, 0.3 + width), (left, 0.3 + width)])
        };
        for flip in [false, true] {
            let mut beams = Beams::default();
            beams.begin(error);
            let mut before = strip(-0.4, 0.4);
            if flip {
                before.rotate_left(2);
            }
            assert_eq!(beams.add(&before, error), Visibility::Seen);
            for (left, right) in [(0.41, 0.49), (-0.49, -0.41)] {
                assert_eq!(beams.look(&strip(left, right)), Visibility::Seen);
            }
        }
    }
}
