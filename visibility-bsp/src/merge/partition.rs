//! Dividing a tree by a plane.
//!
//! Only that part of a plane matters that lies within the region at hand, its *sub-hyperplane*, here a convex
//! polygon. Two of them, that of the dividing plane and that of the node, can lie to each other in seven
//! ways: in the same plane facing the same way or opposite ways; each in front of or behind the other's plane
//! (four ways); or across.

use crate::polygon_cut::cut;
use alloc::vec::Vec;
use visibility_core::{
    geometry::{Plane, PolygonSide, SidePlane},
    glam::DVec3,
};

/// A leaf outside the solid.
pub(super) const EMPTY: u32 = u32::MAX;
/// A leaf inside.
pub(super) const SOLID: u32 = u32::MAX - 1;

/// The most levels of a tree that is merged, since that recurses by levels.
pub(super) const MOST_LEVELS: usize = 1000;

fn is_leaf(child: u32) -> bool {
    child >= SOLID
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    plane: SidePlane,
    /// Behind and in front.
    pub(super) children: [u32; 2],
    sub: Sub,
}

impl Node {
    pub(super) fn with(self, children: [u32; 2]) -> Self {
        Self { children, ..self }
    }
}

/// A sub-hyperplane: where its corners begin, and how many they are. Without corners, its region was too thin
/// to have one.
#[derive(Clone, Copy, Debug)]
struct Sub {
    start: u32,
    len: u32,
}

/// Nodes of several trees; they are only ever added.
#[derive(Clone, Debug, Default)]
pub(super) struct Arena {
    nodes: Vec<Node>,
    points: Vec<DVec3>,
}

impl Arena {
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    pub(super) fn node(&self, id: u32) -> Node {
        self.nodes[id as usize]
    }

    /// Adds a node, or what it amounts to: where both sides are the same leaf, that leaf.
    pub(super) fn push(&mut self, node: Node) -> u32 {
        let [back, front] = node.children;
        if back == front && is_leaf(back) {
            return back;
        }
        self.nodes.push(node);
        self.nodes.len() as u32 - 1
    }

    /// Adds a node of which only the plane is known.
    pub(super) fn push_plane(&mut self, plane: &SidePlane, children: [u32; 2]) -> u32 {
        self.push(Node { plane: *plane, children, sub: Sub { start: 0, len: 0 } })
    }

    pub(super) fn locate(&self, mut child: u32, p: DVec3) -> u32 {
        while !is_leaf(child) {
            let node = &self.nodes[child as usize];
            child = node.children[usize::from(node.plane.plane.signed_distance(p) >= 0.0)];
        }
        child
    }

    pub(super) fn depth(&self, root: u32) -> usize {
        let (mut open, mut deepest) = (Vec::from([(root, 0)]), 0);
        while let Some((child, depth)) = open.pop() {
            deepest = deepest.max(depth);
            if !is_leaf(child) {
                open.extend(self.nodes[child as usize].children.map(|child| (child, depth + 1)));
            }
        }
        deepest
    }

    fn corners(&self, sub: Sub) -> &[DVec3] {
        &self.points[sub.start as usize..][..sub.len as usize]
    }

    fn keep(&mut self, corners: &[DVec3]) -> Sub {
        let start = self.points.len() as u32;
        self.points.extend_from_slice(corners);
        Sub { start, len: corners.len() as u32 }
    }

    /// Copies a tree of another arena, with the sub-hyperplanes within a box of the given reach.
    pub(super) fn load(&mut self, from: &Self, root: u32, reach: DVec3) -> u32 {
        let mut above = Vec::new();
        // A little wider, so that what lies in the sides of the box is well inside.
        self.load_below(from, root, reach * 1.25 + f64::MIN_POSITIVE, &mut above)
    }

    fn load_below(
        &mut self,
        from: &Self,
        child: u32,
        reach: DVec3,
        above: &mut Vec<(SidePlane, bool)>,
    ) -> u32 {
        if is_leaf(child) {
            return child;
        }
        let Node { plane, children: [back, front], .. } = from.node(child);
        let plane = SidePlane::new(plane.plane, reach);
        let mut corners = across_box(&plane.plane, reach);
        let (mut inside, mut outside) = (Vec::new(), Vec::new());
        for (side, is_front) in above.iter() {
            match (side.side_of_polygon(&corners), is_front) {
                (PolygonSide::Across, _) => {
                    cut(&corners, side, &mut inside, &mut outside);
                    if !is_front {
                        core::mem::swap(&mut inside, &mut outside);
                    }
                    core::mem::swap(&mut corners, &mut inside);
                }
                (PolygonSide::Front, true) | (PolygonSide::Back, false) => {}
                _ => corners.clear(),
            }
        }
        above.push((plane, false));
        let back = self.load_below(from, back, reach, above);
        above.pop();
        above.push((plane, true));
        let front = self.load_below(from, front, reach, above);
        above.pop();
        let sub = self.keep(&corners);
        self.push(Node { plane, children: [back, front], sub })
    }

    /// What is outside where the tree is inside, and inside where it is outside.
    pub(super) fn complement(&mut self, child: u32) -> u32 {
        match child {
            EMPTY => SOLID,
            SOLID => EMPTY,
            id => {
                let node = self.node(id);
                let children = node.children.map(|child| self.complement(child));
                self.push(Node { children, ..node })
            }
        }
    }

    /// The tree behind and the tree in front of the plane of another node, in the region that they share.
    pub(super) fn partition(&mut self, tree: u32, by: &Node) -> [u32; 2] {
        if is_leaf(tree) {
            return [tree; 2];
        }
        let node = self.node(tree);
        let of_by = node.plane.side_of_polygon(self.corners(by.sub));
        let of_node = by.plane.side_of_polygon(self.corners(node.sub));
        let [back, front] = node.children;
        if by.sub.len == 0 || node.sub.len == 0 {
            // Too thin to tell: dividing both sides is right whatever the planes do.
            return self.partition_across(&node, by);
        }
        match of_by {
            PolygonSide::On => {
                if node.plane.plane.normal.dot(by.plane.plane.normal) > 0.0 {
                    [back, front]
                } else {
                    [front, back]
                }
            }
            PolygonSide::Across => self.partition_across(&node, by),
            side => {
                // The dividing plane passes one side of the node only; the other side is whole, and the node
                // on one side of the plane.
                let divided = usize::from(side == PolygonSide::Front);
                let parts = self.partition(node.children[divided], by);
                let whole = |arena: &mut Self, part: u32| {
                    let mut children = node.children;
                    children[divided] = part;
                    arena.push(Node { children, ..node })
                };
                match of_node {
                    PolygonSide::Front => [parts[0], whole(self, parts[1])],
                    PolygonSide::Back => [whole(self, parts[0]), parts[1]],
                    // Which cannot be, but for rounding.
                    _ => [whole(self, parts[0]), whole(self, parts[1])],
                }
            }
        }
    }

    fn partition_across(&mut self, node: &Node, by: &Node) -> [u32; 2] {
        let of_by = self.halves(by.sub, &node.plane);
        let of_node = self.halves(node.sub, &by.plane);
        let [back, front] = node.children;
        let back = self.partition(back, &Node { sub: of_by[0], ..*by });
        let front = self.partition(front, &Node { sub: of_by[1], ..*by });
        [0, 1].map(|side| {
            self.push(Node { plane: node.plane, children: [back[side], front[side]], sub: of_node[side] })
        })
    }

    /// The parts of a polygon behind and in front of a plane; of one that is not across it, twice the whole.
    fn halves(&mut self, sub: Sub, plane: &SidePlane) -> [Sub; 2] {
        if plane.side_of_polygon(self.corners(sub)) != PolygonSide::Across {
            return [sub; 2];
        }
        let (mut front, mut back) = (Vec::new(), Vec::new());
        cut(self.corners(sub), plane, &mut front, &mut back);
        [self.keep(&back), self.keep(&front)]
    }
}

/// The part of a plane in a box around the origin.
fn across_box(plane: &Plane, reach: DVec3) -> Vec<DVec3> {
    let n = plane.normal.abs();
    // Along the axis that the plane is most across, every line through the box meets it once.
    let axis = if n.x >= n.y && n.x >= n.z {
        0
    } else if n.y >= n.z {
        1
    } else {
        2
    };
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut corners: Vec<DVec3> = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(s, t)| {
            let mut p = DVec3::ZERO;
            p[u] = s * reach[u];
            p[v] = t * reach[v];
            p[axis] = -(plane.normal[u] * p[u] + plane.normal[v] * p[v] + plane.offset) / plane.normal[axis];
            p
        })
        .into();
    let (mut inside, mut outside) = (Vec::new(), Vec::new());
    for sign in [1.0, -1.0] {
        // The ends that stick out of the box, with the margin that their distance asks for.
        let side = SidePlane::new(Plane::new(DVec3::AXES[axis] * sign, reach[axis]), reach * 3.0);
        match side.side_of_polygon(&corners) {
            PolygonSide::Across => {
                cut(&corners, &side, &mut inside, &mut outside);
                core::mem::swap(&mut corners, &mut inside);
            }
            PolygonSide::Front | PolygonSide::On => {}
            PolygonSide::Back => corners.clear(),
        }
    }
    corners
}
