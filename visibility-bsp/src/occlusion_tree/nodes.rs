//! The tree itself: planes through the eye that part lit directions from shadowed ones, and how shadows are
//! added.

use super::screen_density::ScreenDensity;
use crate::clip_projection::{Approach, ClipProjection, Line, U, slack_of};
use crate::occluders::angle_of;
use crate::shadow::{BackPlane, Corner, Shadow, Shadows};
use alloc::vec::Vec;
use core::ops::Range;
use visibility_core::glam::DVec3;

/// A child of a node: the number of another node, or one of the leaves `LIT`, `AWAY` and `HIDDEN | number`.
pub(crate) type Child = u32;
/// A leaf in whose directions nothing hides.
pub(crate) const LIT: Child = u32::MAX;
/// A leaf of directions outside the picture.
pub(crate) const AWAY: Child = u32::MAX - 1;
/// Flag of a leaf in shadow. The other bits are an index into `Nodes::hides`; what is behind the back planes
/// listed there is hidden.
pub(crate) const HIDDEN: Child = 1 << 31;

/// Maximum number of nodes: a bound on time and memory for hostile occluders.
const MOST_NODES: usize = 1 << 16;
/// Maximum depth of a node, which bounds the recursion of tests.
const DEEPEST: u16 = 480;

/// Maximum number of polygons of one leaf that are tested, the last added first.
pub(crate) const MOST_PLANES: usize = 16;

/// A node: a plane through the eye and an edge of an occluder, or a side of the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub(crate) line: Line,
    /// The children outside and inside of the plane.
    pub(crate) children: [Child; 2],
    /// Twice the number of the parent, plus which of its children this is; `NO_PARENT` for the root.
    parent: u32,
    depth: u16,
    ends: [DVec3; 2],
}

/// A fragment of a polygon and the place in the tree that it has reached: `parent` is twice a node plus the
/// child, `first` and `count` are a range of corners.
#[derive(Clone, Copy, Debug)]
struct Task {
    parent: u32,
    first: u32,
    count: u32,
}

impl Task {
    fn range(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

/// A polygon that hides in a leaf, and the leaf that was there before it was added. The leaf is inside the
/// shadows of both, so whatever is behind either is hidden; of polygons that cross, neither is nearer
/// everywhere.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hide {
    pub(crate) plane: u32,
    pub(crate) under: Child,
}

/// The occlusion tree of one frame. The memory is kept from frame to frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct Nodes {
    pub(crate) nodes: Vec<Node>,
    pub(crate) planes: Vec<BackPlane>,
    /// The back planes as functions of the direction, `None` for parallel views.
    pub(crate) approaches: Vec<Option<Approach>>,
    pub(crate) hides: Vec<Hide>,
    pub(crate) root: Child,
    corners: Vec<Corner>,
    /// Scratch: values of a plane at the corners of the fragment that it divides.
    values: Vec<f64>,
    tasks: Vec<Task>,
    /// Fragments of shadows at the leaves that they reached, with their corners in `arrived`. The next call
    /// of `reach` for the same shadow goes on from there.
    arrivals: Vec<Task>,
    arrived: Vec<Corner>,
    /// By shadow, the range of its fragments in `arrivals`; `None` before the first call of `reach` and
    /// after `add`.
    reached: Vec<Option<Range<usize>>>,
}

const NO_PARENT: u32 = u32::MAX;

/// How the benefit of putting a part of the picture in shadow is measured.
#[derive(Clone, Copy, Debug)]
pub(super) enum Worth<'a> {
    /// By its solid angle in steradians.
    Angle,
    /// By the objects whose centres are there.
    Density(&'a ScreenDensity),
}

impl Worth<'_> {
    pub(super) fn of(self, projection: &ClipProjection, corners: &[Corner]) -> f32 {
        match self {
            Worth::Angle => angle_of(projection, corners),
            Worth::Density(density) => density.within(corners),
        }
    }
}

impl Nodes {
    /// Empties the tree: one lit leaf inside the four sides of the picture.
    pub(crate) fn clear(&mut self) {
        self.nodes.clear();
        self.planes.clear();
        self.approaches.clear();
        self.hides.clear();
        self.arrivals.clear();
        self.arrived.clear();
        self.reached.clear();
        self.root = LIT;
        // -w <= x <= w and -w <= y <= w: what violates one of them is not in view, and these numbers are
        // exact.
        let mut parent = NO_PARENT;
        for n in [[1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, -1.0, 1.0]] {
            let line = Line { n, slack: 16.0 * U };
            parent = self.add_node(parent, line, AWAY, [DVec3::NAN; 2]) << 1 | 1;
        }
    }

    /// Replaces a leaf by a node with `outside` as its outer child and a lit leaf as its inner one; returns
    /// its number.
    fn add_node(&mut self, parent: u32, line: Line, outside: Child, ends: [DVec3; 2]) -> u32 {
        let number = self.nodes.len() as u32;
        let depth = if parent == NO_PARENT { 0 } else { self.nodes[(parent >> 1) as usize].depth + 1 };
        self.nodes.push(Node { line, children: [outside, LIT], parent, depth, ends });
        self.set_child(parent, number);
        number
    }

    fn set_child(&mut self, parent: u32, child: Child) {
        match parent {
            NO_PARENT => self.root = child,
            _ => self.nodes[(parent >> 1) as usize].children[(parent & 1) as usize] = child,
        }
    }

    /// Takes a shadow's polygon down to the leaves that it reaches, and says how much of the picture it would
    /// put in shadow: what of it comes to lit leaves, and a tenth of what comes to shadows of what is
    /// farther, since only what is between is gained there.
    pub(super) fn reach(
        &mut self,
        projection: &ClipProjection,
        shadows: &Shadows,
        number: usize,
        worth: Worth<'_>,
    ) -> f32 {
        self.corners.clear();
        self.tasks.clear();
        if self.reached.len() <= number {
            self.reached.resize(number + 1, None);
        }
        // Leaves only ever get nearer, so what did not count the last time does not now.
        if let Some(before) = self.reached[number].take() {
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
                let child = self.child(task.parent);
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
                AWAY => continue,
                LIT => (task, 1.0),
                // The order of occluders is approximate, and those that cross one another have none: so
                // something nearer may come late.
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
        self.reached[number] = Some(begin..self.arrivals.len());
        gain
    }

    /// Adds a shadow that has just been taken down: the leaves that are lit, or hidden by something farther,
    /// are parted by its edges.
    pub(crate) fn add(&mut self, projection: &ClipProjection, shadows: &Shadows, number: usize) {
        let shadow = &shadows.list[number];
        let plane = self.planes.len() as u32;
        self.planes.push(shadow.back);
        self.approaches.push(projection.approach(shadow.back.normal, shadow.back.offset));
        for arrival in self.reached[number].take().unwrap_or_default() {
            let task = self.arrivals[arrival];
            self.corners.clear();
            self.corners.extend_from_slice(&self.arrived[task.range()]);
            let old = self.child(task.parent);
            self.augment(shadows, shadow, &Task { first: 0, ..task }, old, plane);
        }
    }

    /// The part of a fragment that is in front of all back planes of a leaf, `None` if there is none.
    fn before(&mut self, task: &Task, leaf: Child) -> Option<Task> {
        let (mut task, mut leaf) = (*task, leaf);
        for _ in 0..MOST_PLANES {
            let Some(&hide) = self.hides.get((leaf & !HIDDEN) as usize).filter(|_| leaf < AWAY) else {
                break;
            };
            task = self.before_plane(&task, hide.plane)?;
            leaf = hide.under;
        }
        Some(task)
    }

    fn before_plane(&mut self, task: &Task, plane: u32) -> Option<Task> {
        let plane = self.planes[plane as usize];
        let size = plane.offset.abs() * 1e-12;
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
        let corner = |corners: &[Corner], i: usize| corners[range.start + i % range.len()];
        let is_before = |corners: &[Corner], i: usize| plane.at(corner(corners, i).p) > 0.0;
        let start =
            (0..range.len()).find(|&i| !is_before(&self.corners, i) && is_before(&self.corners, i + 1))?;
        let first = self.corners.len();
        for i in start..start + range.len() {
            let (a, b) = (corner(&self.corners, i), corner(&self.corners, i + 1));
            let (at_a, at_b) = (plane.at(a.p), plane.at(b.p));
            if at_a > 0.0 {
                self.corners.push(a);
            }
            if (at_a > 0.0) != (at_b > 0.0) {
                let edge = if at_a > 0.0 { u8::MAX } else { a.edge };
                self.corners.push(Corner { edge, ..between(&a, &b, at_a / (at_a - at_b))? });
            }
        }
        let count = (self.corners.len() - first) as u32;
        (count >= 3).then_some(Task { first: first as u32, count, ..*task })
    }

    fn child(&self, parent: u32) -> Child {
        match parent {
            NO_PARENT => self.root,
            _ => self.nodes[(parent >> 1) as usize].children[(parent & 1) as usize],
        }
    }

    /// On which side of a plane a fragment is; where on both, its two parts. Nothing depends on these being
    /// exact: what is hidden is decided by the planes above a leaf, and the fragments only choose which to
    /// add.
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
                    // An edge that leads from the plane itself away from here is none of this part's.
                    let edge = if !in_b && sa <= slack { u8::MAX } else { a.edge };
                    self.corners.push(Corner { edge, ..a });
                }
                let crosses = (in_a && sa > slack && !in_b) || (in_b && sb > slack && !in_a);
                if crosses && let Some(corner) = crossing(&a, &self.corners[range.start + next], sa, sb) {
                    let edge = if in_a { u8::MAX } else { a.edge };
                    self.corners.push(Corner { edge, ..corner });
                }
            }
            let count = self.corners.len() - first;
            parts[side] = Task { parent: 0, first: first as u32, count: count as u32 };
        }
        Parted::Both(parts[0], parts[1])
    }

    /// Puts the edges of a shadow below a leaf, so that what is inside all of them is hidden behind its
    /// plane; outside, the leaf stays what it was. Edges that surely do not reach into the leaf are left out.
    fn augment(&mut self, shadows: &Shadows, shadow: &Shadow, task: &Task, old: Child, plane: u32) {
        let parent = task.parent;
        let corners = &self.corners[task.range()];
        let depth = if parent == NO_PARENT { 0 } else { self.nodes[(parent >> 1) as usize].depth };
        let edges = shadows.edges_of(shadow);
        if corners.len() < 3
            || self.nodes.len() + edges.len() > MOST_NODES
            || usize::from(depth) + edges.len() > usize::from(DEEPEST)
        {
            return;
        }
        let mut present = 0u32;
        let mut middle = [0.0; 3];
        for corner in corners {
            if corner.edge != u8::MAX {
                present |= 1 << corner.edge;
            }
            for (sum, v) in middle.iter_mut().zip(corner.v) {
                *sum += v / corners.len() as f64;
            }
        }
        let wanted = !self.needless(edges, middle, present, parent);
        let mut parent = parent;
        for (i, edge) in edges.iter().enumerate() {
            if wanted >> i & 1 != 0 {
                parent = self.add_node(parent, edge.line, old, edge.ends) << 1 | 1;
            }
        }
        // With no edge at all the whole leaf is in shadow.
        let hide = self.hides.len() as u32;
        self.hides.push(Hide { plane, under: old });
        self.set_child(parent, HIDDEN | hide);
    }

    /// The edges, as a mask, without which the rest of a leaf's directions still are in the shadow.
    ///
    /// Let a direction be surely inside all edges and all planes above the leaf: the leaf and the shadow
    /// meet. If the leaf also reached beyond an edge (and not beyond another), the way there from that
    /// direction would cross the edge itself, between its ends, within the leaf. So an edge is needless if no
    /// point of it can be in the leaf; and also if a plane above is that very edge, of a neighbour or of
    /// another part of the polygon.
    fn needless(
        &self,
        edges: &[crate::shadow::ShadowEdge],
        middle: [f64; 3],
        present: u32,
        parent: u32,
    ) -> u32 {
        let sure = slack_of(64.0 * U);
        if edges.iter().any(|edge| !(edge.line.at(middle) > edge.line.slack + sure)) {
            return 0;
        }
        let mut spans = [[0.0f64, 1.0]; crate::shadow::MOST_EDGES + 1];
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
                    // Its inner side is the leaf's: the middle says so, of both.
                    needless |= 1 << i;
                    continue;
                }
                if (present | needless) >> i & 1 != 0 {
                    continue;
                }
                let [a, b] = &edge.directions;
                let slack = node.line.slack + slack_of(a.error.max(b.error)) + 8.0 * U;
                let (sa, sb) = (node.line.at(a.v) * sign + slack, node.line.at(b.v) * sign + slack);
                let span = &mut spans[i];
                // Directions between the ends are a.v + t (b.v - a.v) up to a factor: where that is below
                // zero they are outside.
                if sa < 0.0 && sb < 0.0 {
                    *span = [1.0, 0.0];
                } else if sa < 0.0 {
                    span[0] = span[0].max(sa / (sa - sb) - 1e-9);
                } else if sb < 0.0 {
                    span[1] = span[1].min(sa / (sa - sb) + 1e-9);
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

/// Where a fragment lies relative to a plane.
enum Parted {
    /// On one side: 0 is outside, 1 is inside.
    Side(u32),
    /// Across the plane: the parts outside and inside.
    Both(Task, Task),
}

/// Where a segment meets a plane through the eye that has these values at its ends. Directions are scaled one
/// by one, points are not: so the values are taken back to the points.
fn crossing(a: &Corner, b: &Corner, at_a: f64, at_b: f64) -> Option<Corner> {
    let (at_a, at_b) = (at_a * a.size, at_b * b.size);
    between(a, b, at_a / (at_a - at_b))
}

/// The corner at `a + t (b - a)`, `None` if `t` is not from 0 to 1 or the point has no direction.
fn between(a: &Corner, b: &Corner, t: f64) -> Option<Corner> {
    let v = [0, 1, 2].map(|i| a.v[i] * a.size * (1.0 - t) + b.v[i] * b.size * t);
    let size = v[0].abs().max(v[1].abs()).max(v[2].abs());
    let found = (0.0..=1.0).contains(&t) && size > 0.0 && size.is_finite();
    found.then(|| Corner { p: a.p + (b.p - a.p) * t, v: v.map(|x| x / size), size, edge: u8::MAX })
}
