//! The tree of planes through the eye, which separates unshadowed view directions from shadowed ones, and the
//! insertion of shadows.

use super::screen_density::ScreenDensity;
use crate::clip_projection::{Approach, ClipProjection, Line, U, slack_of};
use crate::occluders::angle_of;
use crate::shadow::{BackPlane, Shadow, ShadowCorner, Shadows, mean_direction};
use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::glam::DVec3;

/// Child of a node: the index in `Nodes::nodes` of another node, or a leaf (`VISIBLE`, `OUTSIDE` or `HIDDEN |
/// index`).
pub(crate) type Child = u32;
/// Leaf of view directions in which no inserted polygon hides anything.
pub(crate) const VISIBLE: Child = u32::MAX;
/// Leaf of view directions outside the image; boxes there count as hidden.
pub(crate) const OUTSIDE: Child = u32::MAX - 1;
/// Flag of a shadow leaf: view directions inside the shadow of at least one polygon. The other bits are the
/// index in `Nodes::hiders` of the first of the leaf's back planes. A point in these directions is hidden if
/// it is behind any of the leaf's back planes.
pub(crate) const HIDDEN: Child = 1 << 31;

/// Distance from a back plane within which a corner counts as on the plane, as a fraction of the plane's
/// offset: 9,000 times the round-off of `f64`. It saves the work of cutting off slivers.
const ON_PLANE: f64 = 1e-12;

/// Margin for rounding, as a fraction of an edge. The range of an edge that may lie in a leaf is computed as
/// two fractions of the edge, and is widened by this margin at each end where a plane cuts the edge. The
/// division that gives the fractions rounds by less than a millionth of the margin; errors of the planes'
/// values are covered by a slack of their own.
const SHARE_ROUNDING: f64 = 1e-9;

/// Maximum number of nodes, which bounds time and memory for adversarial occluders. Polygons that would
/// exceed it are not inserted.
const MAX_NODES: usize = 1 << 16;
/// Maximum depth of a node. Bounds the recursion of box tests; polygons that would exceed it are not
/// inserted.
const DEEPEST: u16 = 480;

/// Maximum number of a leaf's occluders that one test visits, beginning with the one inserted last.
pub(crate) const MAX_LEAF_TESTS: usize = 16;

/// A node: the plane through the eye and an edge of an occluder, or a side of the image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    /// Plane through the eye, positive on the inner side: towards the inside of the occluder's shadow, or of
    /// the image.
    pub(crate) line: Line,
    /// Children outside (index 0) and inside (index 1) the plane.
    pub(crate) children: [Child; 2],
    /// Slot of this node in its parent: twice the parent's index, plus 1 if it is the inside child.
    /// `NO_PARENT` for the root.
    parent: u32,
    /// Number of nodes above this node.
    depth: u16,
    /// Ends of the occluder edge in metres relative to `Scene::origin`; NaN for a side of the image.
    ends: [DVec3; 2],
}

/// A fragment of a shadow's outline (a convex part of the image) and the child of a node that the fragment
/// has reached on its way down the tree.
#[derive(Clone, Copy, Debug)]
struct Task {
    /// Slot that the fragment enters: twice the parent's index, plus 1 for the inside child. `NO_PARENT` for
    /// the root.
    parent: u32,
    /// Index of the fragment's first corner in the list that holds the task's corners: `Nodes::corners` for
    /// a task in `tasks`, `Nodes::arrived` for one in `arrivals`.
    first: u32,
    /// Number of the fragment's corners.
    count: u32,
}

impl Task {
    /// Returns the half-open range of the fragment's corners in the list that holds them; see `first`.
    fn range(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

/// Entry of a leaf's list of occluders. The leaf is inside the shadows of all of them, so a point in the leaf
/// is hidden if it is behind the back plane of any one. All are kept, since none is the nearest in the whole
/// leaf where occluders cross each other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hider {
    /// Index in `Nodes::planes` of the occluder's back plane.
    pub(crate) plane: u32,
    /// The leaf before this occluder was inserted: `VISIBLE`, or the rest of the list.
    pub(crate) under: Child,
}

/// The occlusion tree of one frame. Memory is kept from frame to frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct Nodes {
    /// Inner nodes of the tree, the four sides of the image first.
    pub(crate) nodes: Vec<Node>,
    /// Back planes of the inserted polygons, in the order of insertion.
    pub(crate) planes: Vec<BackPlane>,
    /// By inserted polygon, as in `planes`: its back plane in the form that compares distances along view
    /// rays. `None` for parallel views.
    pub(crate) approaches: Vec<Option<Approach>>,
    /// Entries of the shadow leaves' occluder lists, linked by `Hider::under`.
    pub(crate) hiders: Vec<Hider>,
    /// Root of the tree: a node index or a leaf.
    pub(crate) root: Child,
    /// Scratch: corners of the fragments on the `tasks` stack.
    corners: Vec<ShadowCorner>,
    /// Scratch: values of the cutting plane at the corners of a fragment.
    values: Vec<f64>,
    /// Scratch: stack of fragments on their way down the tree.
    tasks: Vec<Task>,
    /// Fragments at the leaves that they have reached, with their corners in `arrived`. The next call of
    /// `descend` for the same shadow continues from them.
    arrivals: Vec<Task>,
    /// Corners of all fragments in `arrivals`.
    arrived: Vec<ShadowCorner>,
    /// By index of the shadow in `Shadows::list`: the range of its fragments in `arrivals`. `None` before
    /// the first call of `descend` and after `add`.
    arrival_ranges: Vec<Option<Range<usize>>>,
}

/// Value of a slot (twice the parent's index, plus 1 for the inside child) that stands for the root of the
/// tree.
const NO_PARENT: u32 = u32::MAX;

/// Measure of the benefit of putting a part of the image in shadow, by which polygons are ranked.
#[derive(Clone, Copy, Debug)]
pub(super) enum Worth<'a> {
    /// By the solid angle in steradians; for parallel views, by the area in square NDC units (4 for the whole
    /// image).
    Angle,
    /// By the number of objects whose centres are in the part.
    Density(&'a ScreenDensity),
}

impl Worth<'_> {
    /// Returns the benefit of shadowing a convex part of the image, in steradians or objects as the variant
    /// says. `corners` outline the part in boundary order.
    pub(super) fn of(self, projection: &ClipProjection, corners: &[ShadowCorner]) -> f32 {
        match self {
            Worth::Angle => angle_of(projection, corners),
            Worth::Density(density) => density.within(corners),
        }
    }
}

impl Nodes {
    /// Resets the tree to one visible leaf inside the four sides of the image, and keeps the memory.
    pub(crate) fn clear(&mut self) {
        self.nodes.clear();
        self.planes.clear();
        self.approaches.clear();
        self.hiders.clear();
        self.arrivals.clear();
        self.arrived.clear();
        self.arrival_ranges.clear();
        self.root = VISIBLE;
        // -w <= x <= w and -w <= y <= w: a direction that violates one of them is outside the image. The
        // coefficients are exact, and the errors of directions have the one rounding of the value to spare.
        let mut parent = NO_PARENT;
        for n in [[1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, -1.0, 1.0]] {
            let line = Line { n, slack: 0.0 };
            parent = self.add_node(parent, line, OUTSIDE, [DVec3::NAN; 2]) << 1 | 1;
        }
    }

    /// Replaces the leaf in slot `parent` by a node with the plane `line`, through the occluder edge with the
    /// given `ends` in metres relative to `Scene::origin`. The node's outer child is `outside`, its inner
    /// child a visible leaf. Returns the node's index.
    fn add_node(&mut self, parent: u32, line: Line, outside: Child, ends: [DVec3; 2]) -> u32 {
        let number = self.nodes.len() as u32;
        let depth = if parent == NO_PARENT { 0 } else { self.nodes[(parent >> 1) as usize].depth + 1 };
        self.nodes.push(Node { line, children: [outside, VISIBLE], parent, depth, ends });
        *self.child_mut(parent) = number;
        number
    }

    /// Takes the outline of shadow `number` (its index in `Shadows::list`) down to the leaves and returns the
    /// gain of inserting the shadow, measured by `worth`. Fragments in visible leaves count in full. Of a
    /// fragment in a shadow leaf, only the part in front of the leaf's occluders counts, with a tenth of its
    /// worth: there the shadow newly hides no more than the objects between its polygon and these occluders.
    pub(super) fn descend(
        &mut self,
        projection: &ClipProjection,
        shadows: &Shadows,
        number: usize,
        worth: Worth<'_>,
    ) -> f32 {
        self.corners.clear();
        self.tasks.clear();
        if self.arrival_ranges.len() <= number {
            self.arrival_ranges.resize(number + 1, None);
        }
        // Occluders in a leaf only become nearer, so fragments that did not count the last time do not count
        // now.
        if let Some(before) = self.arrival_ranges[number].take() {
            for task in &self.arrivals[before] {
                let first = self.corners.len() as u32;
                self.corners.extend_from_slice(&self.arrived[task.range()]);
                self.tasks.push(Task { first, ..*task });
            }
        } else {
            self.corners.extend_from_slice(&shadows.corners[shadows.list[number].corners.clone()]);
            self.tasks.push(Task { parent: NO_PARENT, first: 0, count: self.corners.len() as u32 });
        }
        let begin = self.arrivals.len();
        let mut gain = 0.0;
        while let Some(mut task) = self.tasks.pop() {
            let leaf = loop {
                let child = *self.child_mut(task.parent);
                let Some(line) = self.nodes.get(child as usize).map(|node| node.line) else { break child };
                match self.part(&task, &line) {
                    Parted::Side(side) => task.parent = child << 1 | side,
                    Parted::Both(outside, inside) => {
                        self.tasks.push(Task { parent: child << 1, ..outside });
                        task = Task { parent: child << 1 | 1, ..inside };
                    }
                }
            };
            let (front, weight) = match leaf {
                OUTSIDE => continue,
                VISIBLE => (task, 1.0),
                // The insertion order is only approximately front to back, and occluders that cross each
                // other have no order. A nearer one may therefore come later.
                _ => match self.before(&task, leaf) {
                    Some(front) => (front, 0.1),
                    None => continue,
                },
            };
            gain += weight * worth.of(projection, &self.corners[front.range()]);
            let first = self.arrived.len() as u32;
            self.arrived.extend_from_slice(&self.corners[task.range()]);
            self.arrivals.push(Task { first, ..task });
        }
        self.arrival_ranges[number] = Some(begin..self.arrivals.len());
        gain
    }

    /// Inserts shadow `number` (its index in `Shadows::list`), which must have been taken down by `descend`
    /// just before. In the leaves that its fragments have reached, directions inside all the shadow's edges
    /// become shadowed.
    pub(crate) fn add(&mut self, projection: &ClipProjection, shadows: &Shadows, number: usize) {
        let shadow = &shadows.list[number];
        let plane = self.planes.len() as u32;
        self.planes.push(shadow.back);
        self.approaches.push(projection.approach(shadow.back.normal, shadow.back.offset));
        for arrival in self.arrival_ranges[number].take().unwrap_or_default() {
            let task = self.arrivals[arrival];
            self.corners.clear();
            self.corners.extend_from_slice(&self.arrived[task.range()]);
            let old = *self.child_mut(task.parent);
            self.augment(shadows, shadow, &Task { first: 0, ..task }, old, plane);
        }
    }

    /// Returns the part of the shadow fragment `task` that lies in front of the back planes of all occluders
    /// of a leaf, on the eye's side of each. `None` if that part is empty. The corners of a new part are
    /// appended to `corners`.
    fn before(&mut self, task: &Task, leaf: Child) -> Option<Task> {
        let (mut task, mut leaf) = (*task, leaf);
        for _ in 0..MAX_LEAF_TESTS {
            let Some(hide) = self.hider(leaf) else { break };
            task = self.before_plane(&task, hide.plane)?;
            leaf = hide.under;
        }
        Some(task)
    }

    /// Returns the part of the shadow fragment `task` that lies in front of back plane `plane` (an index in
    /// `Nodes::planes`), on the eye's side. `None` if that part is empty. The corners of a new part are
    /// appended to `corners`.
    fn before_plane(&mut self, task: &Task, plane: u32) -> Option<Task> {
        let plane = self.planes[plane as usize];
        let size = plane.offset.abs() * ON_PLANE;
        let range = task.range();
        let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
        for corner in &self.corners[range.clone()] {
            let at = plane.at(corner.p);
            (least, greatest) = (least.min(at), greatest.max(at));
        }
        if !(greatest > size) {
            return None;
        }
        if least >= -size {
            return Some(*task);
        }
        // A convex fragment leaves the plane once: the walk around it starts at the edge on which it comes to
        // the front.
        let corner = |corners: &[ShadowCorner], i: usize| corners[range.start + i % range.len()];
        let is_before = |corners: &[ShadowCorner], i: usize| plane.at(corner(corners, i).p) > 0.0;
        let start =
            (0..range.len()).find(|&i| !is_before(&self.corners, i) && is_before(&self.corners, i + 1))?;
        let first = self.corners.len();
        for i in start..start + range.len() {
            let (a, b) = (corner(&self.corners, i), corner(&self.corners, i + 1));
            let (at_a, at_b) = (plane.at(a.p), plane.at(b.p));
            if at_a > 0.0 {
                self.corners.push(a);
            }
            // A corner on the plane begins the edge along the plane, which belongs to no edge of the
            // occluder.
            if (at_a > 0.0) != (at_b > 0.0) {
                let edge = if at_a > 0.0 { u8::MAX } else { a.edge };
                self.corners.push(ShadowCorner { edge, ..between(&a, &b, at_a / (at_a - at_b))? });
            }
        }
        let count = (self.corners.len() - first) as u32;
        (count >= 3).then_some(Task { first: first as u32, count, ..*task })
    }

    /// Returns a reference to the child in slot `parent`: twice the parent's index, plus 1 for the inside
    /// child, or `NO_PARENT`.
    fn child_mut(&mut self, parent: u32) -> &mut Child {
        match parent {
            NO_PARENT => &mut self.root,
            _ => &mut self.nodes[(parent >> 1) as usize].children[(parent & 1) as usize],
        }
    }

    /// Returns the first entry of the occluder list of a shadow leaf. `None` for a leaf without occluders,
    /// such as the end of a list.
    pub(crate) fn hider(&self, leaf: Child) -> Option<Hider> {
        self.hiders.get((leaf & !HIDDEN) as usize).copied().filter(|_| leaf < OUTSIDE)
    }

    /// Returns the side of the plane `line` that a shadow fragment is on, or the fragment's two parts if it
    /// is on both. Soundness does not depend on the parts being exact: the planes above a leaf decide what is
    /// hidden, and fragments only choose which planes to insert.
    fn part(&mut self, task: &Task, line: &Line) -> Parted {
        let range = task.range();
        let slack = 4.0 * line.slack + 64.0 * U;
        let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
        self.values.clear();
        for corner in &self.corners[range.clone()] {
            let at = line.at(corner.v);
            self.values.push(at);
            least = least.min(at);
            greatest = greatest.max(at);
        }
        if greatest <= slack {
            return Parted::Side(0);
        }
        if least >= -slack {
            return Parted::Side(1);
        }
        let mut parts = [Task { parent: 0, first: 0, count: 0 }; 2];
        for (side, sign) in [(0, -1.0), (1, 1.0)] {
            let first = self.corners.len();
            for i in 0..range.len() {
                let next = if i + 1 == range.len() { 0 } else { i + 1 };
                let (sa, sb) = (self.values[i] * sign, self.values[next] * sign);
                let (in_a, in_b) = (sa > -slack, sb > -slack);
                if !in_a && !in_b {
                    continue;
                }
                let a = self.corners[range.start + i];
                if in_a {
                    // A polygon edge that leads away from the plane, to the other side, does not belong to
                    // this part.
                    let edge = if !in_b && sa <= slack { u8::MAX } else { a.edge };
                    self.corners.push(ShadowCorner { edge, ..a });
                }
                let crosses = (in_a && sa > slack && !in_b) || (in_b && sb > slack && !in_a);
                if crosses && let Some(corner) = crossing(&a, &self.corners[range.start + next], sa, sb) {
                    let edge = if in_a { u8::MAX } else { a.edge };
                    self.corners.push(ShadowCorner { edge, ..corner });
                }
            }
            let count = self.corners.len() - first;
            parts[side] = Task { parent: 0, first: first as u32, count: count as u32 };
        }
        Parted::Both(parts[0], parts[1])
    }

    /// Inserts a shadow's edges below the leaf `old` that a fragment of the shadow has reached. Directions
    /// inside all edges become hidden behind back plane number `plane`; directions outside keep the leaf
    /// `old`. Edges that surely do not reach into the leaf are left out. Does nothing if the tree is full or
    /// too deep.
    fn augment(&mut self, shadows: &Shadows, shadow: &Shadow, task: &Task, old: Child, plane: u32) {
        let parent = task.parent;
        let corners = &self.corners[task.range()];
        let depth = if parent == NO_PARENT { 0 } else { self.nodes[(parent >> 1) as usize].depth };
        let edges = shadows.edges_of(shadow);
        if corners.len() < 3
            || self.nodes.len() + edges.len() > MAX_NODES
            || usize::from(depth) + edges.len() > usize::from(DEEPEST)
        {
            return;
        }
        let mut present = 0u32;
        let middle = mean_direction(corners);
        for corner in corners {
            if corner.edge != u8::MAX {
                present |= 1 << corner.edge;
            }
        }
        let wanted = !self.needless(edges, middle, present, parent);
        let mut parent = parent;
        for (i, edge) in edges.iter().enumerate() {
            if wanted >> i & 1 != 0 {
                parent = self.add_node(parent, edge.line, old, edge.ends) << 1 | 1;
            }
        }
        // Without any edge, the whole leaf is in shadow.
        let hide = self.hiders.len() as u32;
        self.hiders.push(Hider { plane, under: old });
        *self.child_mut(parent) = HIDDEN | hide;
    }

    /// Returns a mask of the edges of a shadow (bit i for `edges[i]`) for which no node is needed below a
    /// leaf: a direction of the leaf that is inside the other edges is inside these edges too. `middle` is a
    /// clip-space direction in the shadow's fragment that reached the leaf, `present` the mask of edges that
    /// bound this fragment, and `parent` the leaf's slot in its parent.
    fn needless(
        &self,
        edges: &[crate::shadow::ShadowEdge],
        middle: [f64; 3],
        present: u32,
        parent: u32,
    ) -> u32 {
        // Let a direction be surely inside all edges and all planes above the leaf, so that the leaf and the
        // shadow meet. If the leaf also reaches beyond one edge, and not beyond another, the path there from
        // that direction would cross the edge itself, between its ends and within the leaf. So an edge can be
        // left out if no point of it can be in the leaf. It can also be left out if a plane above is through
        // the same edge, of a neighbouring polygon or of another part of this polygon.
        let sure = slack_of(64.0 * U);
        if edges.iter().any(|edge| !(edge.line.at(middle) > edge.line.slack + sure)) {
            return 0;
        }
        let mut spans = [[0.0f64, 1.0]; crate::shadow::MAX_EDGES + 1];
        let mut needless = 0u32;
        let mut up = parent;
        while up != NO_PARENT {
            let node = &self.nodes[(up >> 1) as usize];
            let sign = if up & 1 != 0 { 1.0 } else { -1.0 };
            if !(node.line.at(middle) * sign > node.line.slack + sure) {
                return 0;
            }
            for (i, edge) in edges.iter().enumerate() {
                let same =
                    edge.ends == node.ends || (edge.ends[0] == node.ends[1] && edge.ends[1] == node.ends[0]);
                if same {
                    // `middle` is inside both, so the inner side of both planes is the leaf's side.
                    needless |= 1 << i;
                    continue;
                }
                if (present | needless) >> i & 1 != 0 {
                    continue;
                }
                let [a, b] = &edge.directions;
                let slack = node.line.slack + slack_of(a.error.max(b.error));
                let (sa, sb) = (node.line.at(a.v) * sign + slack, node.line.at(b.v) * sign + slack);
                let span = &mut spans[i];
                // Directions between the ends are a.v + t (b.v - a.v), up to a factor. Where the plane's
                // value is negative, they are outside the leaf.
                if sa < 0.0 && sb < 0.0 {
                    *span = [1.0, 0.0];
                } else if sa < 0.0 {
                    span[0] = span[0].max(sa / (sa - sb) - SHARE_ROUNDING);
                } else if sb < 0.0 {
                    span[1] = span[1].min(sa / (sa - sb) + SHARE_ROUNDING);
                }
                if span[0] > span[1] {
                    needless |= 1 << i;
                }
            }
            up = node.parent;
        }
        needless
    }
}

/// Position of a fragment relative to a plane through the eye.
enum Parted {
    /// The fragment is on one side: 0 outside, 1 inside.
    Side(u32),
    /// The fragment is on both sides and was cut: the parts outside and inside.
    Both(Task, Task),
}

/// Returns the corner at which the segment from `a` to `b` meets a plane through the eye; `at_a` and `at_b`
/// are the plane's values at the clip-space directions of `a` and `b`. Each direction has its own scale, so
/// the values are first multiplied by the corners' `size`. `None` if the segment does not meet the plane.
fn crossing(a: &ShadowCorner, b: &ShadowCorner, at_a: f64, at_b: f64) -> Option<ShadowCorner> {
    let (at_a, at_b) = (at_a * a.size, at_b * b.size);
    between(a, b, at_a / (at_a - at_b))
}

/// Returns the corner at the fraction `t` of the segment from corner `a` to corner `b`, interpolated in space
/// (metres relative to `Scene::origin`). Its `edge` is `u8::MAX`: no polygon edge follows. `None` if `t` is
/// not from 0 to 1, or if the point has no finite direction.
fn between(a: &ShadowCorner, b: &ShadowCorner, t: f64) -> Option<ShadowCorner> {
    let v = [0, 1, 2].map(|i| a.v[i] * a.size * (1.0 - t) + b.v[i] * b.size * t);
    let size = v[0].abs().max(v[1].abs()).max(v[2].abs());
    let found = (0.0..=1.0).contains(&t) && size > 0.0 && size.is_finite();
    found.then(|| ShadowCorner { p: a.p + (b.p - a.p) * t, v: v.map(|x| x / size), size, edge: u8::MAX })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip_projection::Direction;
    use crate::shadow::ShadowEdge;

    /// Edge between two directions, off by the given errors, on the plane with coefficients `n` and a slack.
    fn edge(ends: [[f64; 3]; 2], errors: [f64; 2], n: [f64; 3], slack: f64) -> ShadowEdge {
        let directions = [0, 1].map(|i| Direction { v: ends[i], error: errors[i], size: 1.0 });
        let line = Line { n, slack };
        ShadowEdge { line, ends: ends.map(DVec3::from_array), directions }
    }

    /// Tree of two planes of the given coefficients and slacks, the second on the inner side of the first,
    /// and the slot of the leaf on the inner side of both.
    fn leaf(planes: [([f64; 3], f64); 2]) -> (Nodes, u32) {
        let mut nodes = Nodes::default();
        let mut parent = NO_PARENT;
        for (n, slack) in planes {
            parent = nodes.add_node(parent, Line { n, slack }, VISIBLE, [DVec3::NAN; 2]) << 1 | 1;
        }
        (nodes, parent)
    }

    /// Plane x = 0, whose slack is given, and above it one that leaves all out.
    fn right_half(slack: f64) -> (Nodes, u32) {
        leaf([([0.0, 0.0, 1.0], 0.0), ([1.0, 0.0, 0.0], slack)])
    }

    #[test]
    fn an_edge_is_needless_only_if_all_of_it_is_surely_outside_the_leaf() {
        let middle = [0.5, 0.0, 1.0];
        for (slack, errors) in [(0.01, [0.0f64; 2]), (0.0, [0.003, 0.0]), (0.0, [0.0, 0.003])] {
            let total = slack + 3.125 * errors[0].max(errors[1]);
            let (nodes, parent) = right_half(slack);
            for (share, needless) in [(1.02, 1), (0.98, 0), (0.4, 0)] {
                let x = -share * total;
                // Both ends that far beside the leaf, or one of them in it.
                for (ends, needless) in [
                    ([[x, -1.0, 1.0], [x, 1.0, 1.0]], needless),
                    ([[x, -1.0, 1.0], [0.3, 1.0, 1.0]], 0),
                    ([[0.3, -1.0, 1.0], [x, 1.0, 1.0]], 0),
                    // One end is far from the leaf.
                    ([[x, -1.0, 1.0], [-1.0, 1.0, 1.0]], needless),
                    ([[-1.0, -1.0, 1.0], [x, 1.0, 1.0]], needless),
                ] {
                    let edge = edge(ends, errors, [1.0, 0.0, 2.0], 0.0);
                    assert_eq!(
                        nodes.needless(&[edge], middle, 0, parent),
                        needless,
                        "{share} of {total}, {ends:?}, slack of the plane {slack}"
                    );
                    assert_eq!(nodes.needless(&[edge], middle, 1, parent), 0, "an edge of the fragment");
                }
            }
        }
    }

    /// Two planes leave apart ranges of an edge, which are widened at both ends.
    #[test]
    fn an_edge_is_needless_if_planes_leave_ranges_apart_by_more_than_rounding() {
        let middle = [0.5, -0.5, 1.0];
        for (share, needless) in [(1.02, 1), (0.98, 0)] {
            // The first plane leaves the upper half of the edge, the second the lower but for this gap.
            let gap = share * 2.0 * SHARE_ROUNDING;
            for turn in [1.0, -1.0] {
                let (nodes, parent) = leaf([([1.0, 0.0, 0.0], 0.0), ([0.0, -1.0, -2.0 * gap], 0.0)]);
                let ends = [[-turn, -turn, 1.0], [turn, turn, 1.0]];
                let edge = edge(ends, [0.0; 2], [1.0, -1.0, 0.0], 0.0);
                let found = nodes.needless(&[edge], middle, 0, parent);
                assert_eq!(found, needless, "{share} of the margin, turned: {turn}");
            }
        }
    }

    #[test]
    fn no_edge_is_needless_unless_the_middle_is_surely_inside_all_planes() {
        // The middle is known to 200 units of round-off.
        let sure = 200.0 * U;
        let ends = [[-0.5, -1.0, 1.0], [-0.5, 1.0, 1.0]];
        for slack in [0.0, 0.01] {
            for (share, needless) in [(1.02, 1), (0.98, 0), (0.4, 0)] {
                let x = share * (slack + sure);
                let (nodes, parent) = right_half(slack);
                let far = edge(ends, [0.0; 2], [1.0, 0.0, 0.5], 0.0);
                let found = nodes.needless(&[far], [x, 0.0, 1.0], 0, parent);
                assert_eq!(found, needless, "{share} of {slack} from a plane of the tree");
                let (nodes, parent) = right_half(0.0);
                let edges = [far, edge(ends, [0.0; 2], [0.0, 1.0, 0.0], slack)];
                let found = nodes.needless(&edges, [0.5, x, 1.0], 2, parent);
                assert_eq!(found, needless, "{share} of {slack} from another edge");
            }
        }
    }

    #[test]
    fn the_edge_of_a_plane_above_is_needless_whichever_way_it_runs() {
        let ends = [[0.5, -1.0, 1.0], [0.5, 1.0, 1.0]];
        let other = [0.2, 0.3, 1.0];
        let (mut nodes, parent) = right_half(0.0);
        nodes.nodes[1].ends = ends.map(DVec3::from_array);
        for (ends, needless) in [
            (ends, 1),
            ([ends[1], ends[0]], 1),
            ([ends[0], other], 0),
            ([other, ends[1]], 0),
            ([ends[1], other], 0),
            ([other, ends[0]], 0),
        ] {
            let edge = edge(ends, [0.0; 2], [1.0, 0.0, 0.0], 0.0);
            assert_eq!(nodes.needless(&[edge], [0.7, 0.0, 1.0], 0, parent), needless, "{ends:?}");
        }
    }
}
