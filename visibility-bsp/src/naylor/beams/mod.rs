//! The beam tree: a binary partition of the image into covered (closed) and uncovered (open) convex leaves.
//!
//! Coordinates are normalized device coordinates (NDC): the image is the square from -1 to 1 on both axes.
//! Each tree line is the image of a plane through the eye and an edge; each leaf is the image of a beam of
//! view rays. Polygons are inserted nearest first. A polygon that reaches an open leaf is visible there, and
//! the part of the leaf that it covers becomes closed. A polygon that reaches only closed leaves is hidden. A
//! node whose children are both closed becomes a closed leaf, so the tree shrinks to one leaf as the image
//! fills.
//!
//! # Rounding
//! Polygon corners have an error of at most `d` in NDC, which the caller guarantees. The line of an edge is
//! computed from the edge's two ends as inserted, never from what cuts have left of the edge, so two polygons
//! that share an edge have the same line to the last bit. If one polygon has only a part of length `s` of the
//! edge, the two lines differ by up to `d (1 + 2 r / s)` at distance `r` from the part, and the image is at
//! most 2.9 across. A point counts as *on* a line within 4 times that bound: once for the point, once for the
//! line, and twice for points that were cut along another such line. An edge that lies on a line of the tree
//! does not divide a leaf again.
//!
//! So a polygon may fail to cover a strip as wide as a line's margin, and a farther polygon reaches an open
//! leaf there. Margins of edges are at most a quarter of [`MIN_VISIBLE_WIDTH`], those of the initial grid 4
//! times the corners' error, and a part of a wider polygon that is narrower than [`MIN_VISIBLE_WIDTH`] does
//! not count as seen. A polygon that is itself so narrow is treated separately: it is cut a margin beyond
//! each line, and where it then reaches an open leaf it is [glimpsed](Visibility::Glimpsed).
//!
//! # Short edges
//! An edge hardly longer than a line's margin has ends on that line whatever the edge's direction, so it
//! counts as an edge on the line only from 8 margins on. An edge too short to have a line gets a substitute
//! that bounds the polygon in one direction alone. A part of such a polygon is therefore bounded by the lines
//! of all the polygon's edges, also of those that cuts have left no piece of.

use alloc::vec::Vec;
use visibility_core::geometry::Side;

/// Child link of an open leaf: image area that no polygon covers yet.
const OPEN: u32 = u32::MAX;
/// Child link of a closed leaf: image area that is covered, or outside the image.
const CLOSED: u32 = u32::MAX - 1;

/// A polygon corner in NDC, -1 to 1 across the image, with the edge that leaves it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ImageCorner {
    /// Horizontal NDC coordinate, -1 at the left and 1 at the right edge of the image.
    pub(super) x: f64,
    /// Vertical NDC coordinate, -1 at the bottom and 1 at the top of the image.
    pub(super) y: f64,
    /// Whether the edge from this corner to the next lies on the line of a tree node that the polygon's part
    /// has passed. Such an edge divides no leaf, since the tree has its line already. If false, the edge is a
    /// part of the inserted polygon's edge `edge`.
    pub(super) on_line: bool,
    /// Index of the inserted polygon's edge that the edge from this corner is a part of. Unused if
    /// `on_line`.
    edge: u32,
}

impl ImageCorner {
    /// Creates a corner at NDC `(x, y)` from which an edge leaves that lies on no line of the tree.
    pub(super) fn new(x: f64, y: f64) -> Self {
        Self { x, y, on_line: false, edge: 0 }
    }
}

/// A line in NDC: the points `(x, y)` with `a x + b y + c = 0`. The normal `(a, b)` has unit length and
/// points to the front side of the line.
#[derive(Clone, Copy, Debug)]
struct Line {
    a: f64,
    b: f64,
    c: f64,
    /// Distance in NDC up to which a point counts as on the line.
    margin: f64,
}

impl Line {
    /// Creates the line `a x + b y + c = 0`, where `(a, b)` must have unit length. `error` bounds the
    /// absolute error in NDC of the points to be compared with the line.
    fn new(a: f64, b: f64, c: f64, error: f64) -> Self {
        Self { a, b, c, margin: 4.0 * error }
    }

    /// Returns the line through the corners `p` and `q`, and whether the line's `margin` covers the rounding
    /// errors in all of the image. The front of the line is on the left as one goes from `p` to `q`. `error`
    /// bounds the absolute error of the corners in NDC.
    ///
    /// The margin is at most a quarter of [`MIN_VISIBLE_WIDTH`]. The second value is false if the line needs
    /// a greater margin far from its corners. `None` if the distance between the corners is less than `64 *
    /// error`, which leaves the line's direction undetermined, or if a corner is NaN.
    fn through(p: ImageCorner, q: ImageCorner, error: f64) -> Option<(Self, bool)> {
        let (dx, dy) = (q.x - p.x, q.y - p.y);
        let length = visibility_core::glam::DVec2::new(dx, dy).length();
        if length.is_nan() || length < 64.0 * error {
            return None;
        }
        let margin = 4.0 * error * (1.0 + 5.8 / length);
        // Both neighbours of an edge compute its line from the lexicographically first end, so that both get
        // the same bits.
        let (at, sign) = if (p.x, p.y) <= (q.x, q.y) { (p, 1.0) } else { (q, -1.0) };
        let (a, b) = (sign * -dy / length, sign * dx / length);
        let c = -(a * at.x + b * at.y);
        let widest = 0.25 * MIN_VISIBLE_WIDTH;
        let line = Self { a: sign * a, b: sign * b, c: sign * c, margin: margin.min(widest) };
        Some((line, margin <= widest))
    }

    /// Tests whether an edge from `p` to `q`, corners on the line, has the line's direction: it is long
    /// enough beside the margin within which both lie.
    #[inline]
    fn is_along(&self, p: ImageCorner, q: ImageCorner) -> bool {
        (q.x - p.x).abs().max((q.y - p.y).abs()) > 8.0 * self.margin
    }

    /// Returns the signed distance of a corner from the line in NDC, positive in front.
    #[inline]
    fn distance(&self, p: ImageCorner) -> f64 {
        self.a * p.x + self.b * p.y + self.c
    }
}

/// Width in NDC (1 is half the image) below which a gap or a visible part may be missed: 1/8000 of a pixel at
/// 2560 columns.
pub(super) const MIN_VISIBLE_WIDTH: f64 = 1e-7;

/// Visibility of a polygon behind the polygons that the beam tree contains.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Visibility {
    /// The polygon reaches no open leaf, except in gaps that rounding may have made.
    Hidden,
    /// Whether the polygon is seen is uncertain. It is at most 4 [`MIN_VISIBLE_WIDTH`] wide, and each of its
    /// parts in an open leaf is at most [`MIN_VISIBLE_WIDTH`] wide, or lies within the margin of a line, so
    /// that rounding may have put it into the leaf.
    Glimpsed,
    /// A part of the polygon wider than [`MIN_VISIBLE_WIDTH`] reaches an open leaf.
    Seen,
}

/// What narrow polygons of one object show in open leaves: too narrow each, but together they may be wide.
#[derive(Clone, Copy, Debug)]
pub(super) struct Glimpse {
    /// Sum of the areas in open leaves in NDC. Parts within the margin of a line count on both its sides.
    area: f64,
    /// Least and greatest coordinates of the parts in NDC.
    least: [f64; 2],
    greatest: [f64; 2],
}

impl Default for Glimpse {
    fn default() -> Self {
        Self { area: 0.0, least: [f64::INFINITY; 2], greatest: [f64::NEG_INFINITY; 2] }
    }
}

impl Glimpse {
    /// Adds a part in an open leaf, and the part's area.
    fn add_part(&mut self, part: &[ImageCorner], area: f64) {
        self.area += area;
        for corner in part {
            for (axis, value) in [corner.x, corner.y].into_iter().enumerate() {
                self.least[axis] = self.least[axis].min(value);
                self.greatest[axis] = self.greatest[axis].max(value);
            }
        }
    }

    /// Adds what other polygons of the same object show.
    pub(super) fn add(&mut self, other: &Self) {
        self.area += other.area;
        for axis in 0..2 {
            self.least[axis] = self.least[axis].min(other.least[axis]);
            self.greatest[axis] = self.greatest[axis].max(other.greatest[axis]);
        }
    }

    /// Tests whether the parts together are wider than [`MIN_VISIBLE_WIDTH`]: their area divided by the
    /// longer side of the rectangle around them.
    pub(super) fn is_wide(&self) -> bool {
        let longest = (self.greatest[0] - self.least[0]).max(self.greatest[1] - self.least[1]);
        self.area > MIN_VISIBLE_WIDTH * longest
    }
}

/// An inner node of the beam tree: a line in NDC that divides an image region in two.
#[derive(Clone, Copy, Debug)]
struct Node {
    line: Line,
    /// Children behind and in front of the line: node indices, [`OPEN`] or [`CLOSED`].
    children: [u32; 2],
    /// Index of the parent node, [`NO_PARENT`] for the root.
    parent: u32,
}

/// A convex part of the polygon being tested, on its way into one child of a node.
#[derive(Clone, Copy, Debug)]
struct Task {
    /// Node whose child the part enters, [`NO_PARENT`] for the root of the tree.
    parent: u32,
    /// Child that the part enters: 0 behind the line, 1 in front.
    side: u8,
    /// Whether the part lay within the margin of a line of the tree, so that rounding may have put it on the
    /// wrong side of the line. If true, the part covers nothing and does not count as seen. If false, it can
    /// cover its area of an open leaf.
    thin: bool,
    /// Index of the part's first corner in `Beams::corners`; the part extends to the end of that stack.
    begin: usize,
}

/// A position in the image at which an object is visible: the centroid of the corners of an uncovered part.
/// NDC, -1 to 1 across the image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct VisiblePoint {
    /// Horizontal NDC coordinate, from -1 at the left to 1 at the right.
    pub x: f64,
    /// Vertical NDC coordinate, from -1 at the bottom to 1 at the top.
    pub y: f64,
    /// Approximate width of the uncovered part across its narrowest direction, in NDC units (half images).
    pub width: f64,
}

/// The beam tree of one frame; see the [module](self). Memory is kept from frame to frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Beams {
    /// Inner nodes of the tree. Nodes that have become closed leaves stay in the list unused.
    nodes: Vec<Node>,
    /// Child link of the tree's root: a node index, [`OPEN`] or [`CLOSED`].
    root: u32,
    /// Bound on the absolute error of the corners of this frame's polygons, in NDC, as passed to `begin`.
    error: f64,
    /// Stack of polygon parts that are still to be taken down the tree.
    tasks: Vec<Task>,
    /// Corners of all parts on the `tasks` stack; the top of this stack belongs to the topmost task.
    corners: Vec<ImageCorner>,
    /// By edge of the polygon being added: the edge's line, and whether the line's margin covers the rounding
    /// errors in all of the image. `None` for an edge too short to have a line.
    lines: Vec<Option<(Line, bool)>>,
    /// Sum of the lengths in NDC of those edges of the polygon being added that are too short to have a line
    /// of their own. `None` if there is no such edge.
    short_edges: Option<f64>,
    /// Scratch: copy of the corners of the part being cut.
    part: Vec<ImageCorner>,
    /// Scratch: signed distances in NDC of the part's corners from the node's line.
    sides: Vec<f64>,
    /// Widest uncovered part found by the last `test` or `test_and_cover`; its width is negative if none
    /// was found.
    pub(super) witness: VisiblePoint,
    /// What the last `test` or `test_and_cover` of a narrow polygon found in open leaves.
    pub(super) glimpse: Glimpse,
}

/// Value of `Node::parent` and `Task::parent` for the root of the tree, which has no parent.
const NO_PARENT: u32 = u32::MAX;

/// Number of times that each image axis is halved initially: an 8 by 8 grid of open leaves. The grid keeps
/// the tree from degenerating into a list, whatever polygons come first.
const GRID: u32 = 3;

impl Beams {
    /// Resets the tree to an open image. `error` bounds the absolute NDC error of the corners to come.
    pub(super) fn begin(&mut self, error: f64) {
        self.error = error;
        self.nodes.clear();
        self.root = OPEN;
        let mut slot = (NO_PARENT, 0);
        // Leaves outside the image are closed: nothing is visible there.
        for (a, b) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
            let node = self.push(slot, Line::new(a, b, 1.0, error), [CLOSED, OPEN]);
            slot = (node, 1);
        }
        self.divide(slot, [-1.0, -1.0], [2.0, 2.0], 2 * GRID);
    }

    /// Replaces the child link `slot` (parent and side) by a balanced tree that halves a rectangle `levels`
    /// times, alternating axes. `least` is the rectangle's minimum corner and `size` its extent, in NDC.
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

    /// Appends a node with the given line and children (behind, in front) and returns its index. Links the
    /// node into `slot`: a parent node and the side of the child (0 behind the parent's line, 1 in front), or
    /// [`NO_PARENT`] for the root.
    fn push(&mut self, slot: (u32, u8), line: Line, children: [u32; 2]) -> u32 {
        let node = self.nodes.len() as u32;
        self.nodes.push(Node { line, children, parent: slot.0 });
        *self.child_mut(slot) = node;
        node
    }

    /// Returns a reference to the link of node `parent` to its child on the given side (0 behind, 1 in
    /// front), or to the root if `parent` is [`NO_PARENT`].
    fn child_mut(&mut self, (parent, side): (u32, u8)) -> &mut u32 {
        if parent == NO_PARENT {
            &mut self.root
        } else {
            &mut self.nodes[parent as usize].children[usize::from(side)]
        }
    }

    /// Tests whether the whole image is covered, so that nothing more can be seen. False if an open leaf is
    /// left.
    pub(super) fn is_closed(&self) -> bool {
        self.root == CLOSED
    }

    /// Returns the margins of the lines that the tree begins with, and of the polygon that was added last.
    #[cfg(test)]
    pub(super) fn margins(&self) -> (Vec<f64>, Vec<f64>) {
        let grid = self.nodes.iter().take(4 + 63).map(|node| node.line.margin);
        (grid.collect(), self.lines.iter().flatten().map(|(line, _)| line.margin).collect())
    }

    /// Tests the visibility of a convex polygon against the open leaves without changing the tree. Corners
    /// run counter-clockwise in NDC and may lie outside the image.
    pub(super) fn test(&mut self, polygon: &[ImageCorner]) -> Visibility {
        self.run(polygon, false)
    }

    /// Tests the visibility of a convex polygon like [`test`](Self::test), then closes the image area that
    /// the polygon covers. `error` bounds the absolute NDC error of its corners. A polygon with fewer than
    /// two edges long enough to have a line covers nothing.
    pub(super) fn test_and_cover(&mut self, polygon: &[ImageCorner], error: f64) -> Visibility {
        self.lines.clear();
        for (i, &p) in polygon.iter().enumerate() {
            self.lines.push(Line::through(p, polygon[(i + 1) % polygon.len()], error));
        }
        // A polygon with an area has at least two edges; one that is hardly more than a point covers nothing.
        let closing = self.lines.iter().flatten().count() >= 2;
        if !closing {
            return self.test(polygon);
        }
        let short = polygon.iter().zip(polygon.iter().cycle().skip(1)).zip(&self.lines);
        let short = short.filter(|(_, line)| line.is_none());
        let lengths = short.map(|((p, q), _)| (q.x - p.x).abs() + (q.y - p.y).abs());
        self.short_edges = lengths.reduce(|sum, length| sum + length);
        self.end_strips(polygon, error);
        if !is_narrow(polygon) {
            return self.run(polygon, true);
        }
        // A narrow polygon is tested with margins but must cover without them, so it is run twice.
        let visibility = self.test(polygon);
        let found = (self.witness, self.glimpse);
        self.run(polygon, true);
        (self.witness, self.glimpse) = found;
        visibility
    }

    /// Gives each edge too short to have a line a substitute in `lines`. Without it, the polygon would cover
    /// an endless strip between the two neighbours of the edge where these are nearly parallel. The
    /// substitute is perpendicular to the last preceding edge that has a line. It passes through the end of
    /// the short edge that comes first in the direction of that preceding edge.
    fn end_strips(&mut self, polygon: &[ImageCorner], error: f64) {
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
            // The preceding edge runs along (b, -a).
            let along = |p: ImageCorner| b * p.x - a * p.y;
            let c = along(polygon[i]).min(along(polygon[(i + 1) % count]));
            self.lines[i] = Some((Line { a: -b, b: a, c, margin }, false));
        }
    }

    /// Takes a convex polygon down the tree and returns its visibility. If `closing` is true, also closes the
    /// area of the open leaves that the polygon covers; otherwise stops at the first part that is surely
    /// seen.
    fn run(&mut self, polygon: &[ImageCorner], closing: bool) -> Visibility {
        self.witness.width = -1.0;
        self.glimpse = Glimpse::default();
        self.tasks.clear();
        self.corners.clear();
        let narrow = is_narrow(polygon);
        let mut visibility = Visibility::Hidden;
        if self.root == CLOSED {
            return visibility;
        }
        // Each corner remembers the edge that leaves it: an open leaf is divided along such edges only.
        for (edge, &corner) in (0..).zip(polygon) {
            self.corners.push(ImageCorner { edge, ..corner });
        }
        self.tasks.push(Task { parent: NO_PARENT, side: 0, thin: false, begin: 0 });
        while let Some(task) = self.tasks.pop() {
            // A closed leaf hides the part. In an open leaf the part is seen, unless it is too thin to tell.
            match *self.child_mut((task.parent, task.side)) {
                CLOSED => self.corners.truncate(task.begin),
                OPEN => {
                    let part = &self.corners[task.begin..];
                    let (witness, area) = witness(part);
                    if narrow {
                        self.glimpse.add_part(part, area);
                    }
                    if !task.thin && witness.width > MIN_VISIBLE_WIDTH {
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

    /// Moves the topmost part of the corner stack into the children of node `id`. A part that extends beyond
    /// the line's margin on both sides is cut in two. Parts that would enter a closed leaf are dropped. If
    /// `generous` is true (for narrow polygons), each child gets the part on its own side and up to one
    /// margin beyond the line, so that the strip within the margin goes to both children.
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
        // A corner within the margin of the line is on neither side.
        let (front, back) = (greatest > line.margin, least < -line.margin);
        // The whole part goes to one child. A part within the margin altogether goes to the side where most
        // of it lies, and is `thin` from there on: rounding may have put it there.
        if !(generous || front && back) {
            let side = u8::from(if front || back { front } else { sum > 0.0 });
            let count = self.sides.len();
            let thin = task.thin || !(front || back);
            if children[usize::from(side)] == CLOSED {
                self.corners.truncate(task.begin);
                return;
            }
            for i in 0..count {
                let j = if i + 1 == count { 0 } else { i + 1 };
                let [p, q] = [i, j].map(|corner| self.corners[task.begin + corner]);
                if self.sides[i].abs().max(self.sides[j].abs()) <= line.margin && line.is_along(p, q) {
                    self.corners[task.begin + i].on_line = true;
                }
            }
            self.tasks.push(Task { parent: id, side, thin, begin: task.begin });
            return;
        }
        // The line cuts the part. Each half is clipped from a copy, since the halves go back onto the stack.
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
                let [dp, dq] = [self.sides[i], self.sides[j]].map(|distance| sign * distance);
                if generous {
                    let [dp, dq] = [dp, dq].map(|distance| distance + line.margin);
                    if dp >= 0.0 {
                        self.corners.push(p);
                    }
                    if (dp >= 0.0) != (dq >= 0.0) {
                        self.corners.push(crossing(p, q, dp, dq));
                    }
                    continue;
                }
                match [dp, dq].map(|distance| Side::of(distance, line.margin)) {
                    [Side::Front, Side::Front | Side::On] | [Side::On, Side::Front] => self.corners.push(p),
                    [Side::On, Side::On] => {
                        let on_line = p.on_line || line.is_along(p, q);
                        self.corners.push(ImageCorner { on_line, ..p });
                    }
                    [Side::On, Side::Back] => self.corners.push(ImageCorner { on_line: true, ..p }),
                    [Side::Front, Side::Back] => {
                        self.corners.push(p);
                        self.corners.push(ImageCorner { on_line: true, ..crossing(p, q, dp, dq) });
                    }
                    [Side::Back, Side::Front] => {
                        let ImageCorner { on_line, edge, .. } = p;
                        self.corners.push(ImageCorner { on_line, edge, ..crossing(p, q, dp, dq) });
                    }
                    [Side::Back, Side::On | Side::Back] => {}
                }
            }
            if self.corners.len() > begin {
                self.tasks.push(Task { parent: id, side, begin, ..task });
            }
        }
    }

    /// Closes the area of the open leaf reached by `task` that the topmost part of the corner stack covers.
    /// The leaf is replaced by a chain of nodes, one for each edge of the part that has a line and is not on
    /// a line of the tree already. If the polygon has an edge without a line of its own, one for each edge of
    /// the polygon that is not clear of the part. Without such an edge, the whole leaf becomes closed.
    fn close(&mut self, task: Task) {
        let mut slot = (task.parent, task.side);
        let mut divided = false;
        let count =
            if self.short_edges.is_some() { self.lines.len() } else { self.corners.len() - task.begin };
        // Lines whose margin does not hold everywhere are inserted last. They then divide only the strip that
        // the other lines leave, close to their own edge.
        for certain in [true, false] {
            for i in 0..count {
                let part = &self.corners[task.begin..];
                let edge = if self.short_edges.is_some() { i } else { part[i].edge as usize };
                let Some((line, sure)) = self.lines[edge] else { continue };
                let is_needed = match self.short_edges {
                    // The substitute of a short edge leaves what is beyond its ends to the edges beside it.
                    Some(length) => !part.iter().all(|&corner| line.distance(corner) > line.margin + length),
                    None => !part[i].on_line,
                };
                if is_needed && sure == certain {
                    let node = self.push(slot, line, [OPEN, OPEN]);
                    slot = (node, 1);
                    divided = true;
                }
            }
        }
        *self.child_mut(slot) = CLOSED;
        if !divided {
            self.close_above(task.parent);
        }
    }

    /// Replaces node `id` by a closed leaf if both its children are closed, and continues with its parent.
    /// Stops at the first node with an open side.
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

/// Tests whether a polygon is at most 4 [`MIN_VISIBLE_WIDTH`] wide, by area divided by the longest edge.
/// True for a degenerate polygon. `polygon` must not be empty.
fn is_narrow(polygon: &[ImageCorner]) -> bool {
    witness(polygon).0.width <= 4.0 * MIN_VISIBLE_WIDTH
}

/// Returns the mean of a part's corners with the part's approximate width in NDC, its area divided by the
/// greatest horizontal or vertical extent of an edge, 0 for a point; and the area. `part` must not be empty.
fn witness(part: &[ImageCorner]) -> (VisiblePoint, f64) {
    let (mut x, mut y, mut area, mut longest) = (0.0, 0.0, 0.0f64, 0.0f64);
    let first = part[0];
    for (i, p) in part.iter().enumerate() {
        let q = part[(i + 1) % part.len()];
        x += p.x / part.len() as f64;
        y += p.y / part.len() as f64;
        area += (p.x - first.x) * (q.y - first.y) - (p.y - first.y) * (q.x - first.x);
        longest = longest.max((q.x - p.x).abs().max((q.y - p.y).abs()));
    }
    let area = 0.5 * area.abs();
    (VisiblePoint { x, y, width: if longest > 0.0 { area / longest } else { 0.0 } }, area)
}

/// Returns the point in NDC at which the edge from `p` to `q` meets a line with signed distances `dp` and
/// `dq` (NDC) at its ends, which must have opposite signs. Swapping the ends gives the same bits.
fn crossing(p: ImageCorner, q: ImageCorner, dp: f64, dq: f64) -> ImageCorner {
    let (p, q, dp, dq) = if (p.x, p.y) <= (q.x, q.y) { (p, q, dp, dq) } else { (q, p, dq, dp) };
    let t = dp / (dp - dq);
    ImageCorner::new(p.x + (q.x - p.x) * t, p.y + (q.y - p.y) * t)
}

#[cfg(test)]
mod tests;
