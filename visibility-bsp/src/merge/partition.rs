//! Splitting of a BSP tree by a plane.
//!
//! Only the part of a plane inside a node's region matters. This part is the node's *sub-hyperplane*, here a
//! convex polygon. The sub-hyperplanes of the splitting plane and of a node have seven possible relations: in
//! the same plane, facing the same way or opposite ways (two); each wholly in front of or behind the other's
//! plane (four); or crossing (one).

use crate::polygon_cut::cut;
use crate::tree::{EMPTY, SOLID, depth_of, is_leaf};
use alloc::vec::Vec;
use visibility_core::{
    geometry::{Plane, PolygonSide, SidePlane},
    glam::DVec3,
};

/// Maximum number of levels of a merged tree. Merging recurses by level, so this bounds the stack.
pub(super) const MOST_LEVELS: usize = 1000;

/// An inner node of a solid's BSP tree. The plane is in the solid's coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// The dividing plane in the solid's coordinates, with the margin within which points count as on the
    /// plane.
    plane: SidePlane,
    /// Children behind and in front of the plane: node indices, [`EMPTY`] or [`SOLID`].
    pub(super) children: [u32; 2],
    /// Part of the dividing plane inside the node's region.
    sub: Sub,
}

impl Node {
    /// Returns a copy of the node with other children (behind, in front).
    pub(super) fn with(self, children: [u32; 2]) -> Self {
        Self { children, ..self }
    }
}

/// A sub-hyperplane, the part of a node's plane inside the node's region, as a range of `Arena::points`.
#[derive(Clone, Copy, Debug)]
struct Sub {
    /// Index in `Arena::points` of the first corner.
    start: u32,
    /// Number of corners; 0 if the region was too thin to determine the polygon, or if the polygon was never
    /// computed.
    len: u32,
}

/// Nodes of any number of trees. Nodes are only added, never removed.
#[derive(Clone, Debug, Default)]
pub(super) struct Arena {
    /// Inner nodes of all trees, children before parents.
    nodes: Vec<Node>,
    /// Corners of all sub-hyperplanes, in the solids' coordinates.
    points: Vec<DVec3>,
}

impl Arena {
    /// Returns the number of inner nodes of all trees.
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Returns a copy of the inner node with index `id`.
    pub(super) fn node(&self, id: u32) -> Node {
        self.nodes[id as usize]
    }

    /// Adds a node and returns its index. If both children are the same leaf, adds nothing and returns that
    /// leaf.
    pub(super) fn push(&mut self, node: Node) -> u32 {
        let [back, front] = node.children;
        if back == front && is_leaf(back) {
            return back;
        }
        self.nodes.push(node);
        self.nodes.len() as u32 - 1
    }

    /// Adds a node with the given plane (in the solid's coordinates) and children (behind, in front) but
    /// without a sub-hyperplane, and returns its index. If both children are the same leaf, returns that leaf
    /// instead.
    pub(super) fn push_plane(&mut self, plane: &SidePlane, children: [u32; 2]) -> u32 {
        self.push(Node { plane: *plane, children, sub: Sub { start: 0, len: 0 } })
    }

    /// Returns the leaf, [`EMPTY`] or [`SOLID`], that contains the point `p`, in the solid's coordinates, in
    /// the tree with root `child`. A point on a plane counts as in front of it.
    pub(super) fn locate(&self, mut child: u32, p: DVec3) -> u32 {
        while !is_leaf(child) {
            let node = &self.nodes[child as usize];
            child = node.children[usize::from(node.plane.plane.signed_distance(p) >= 0.0)];
        }
        child
    }

    /// Returns the greatest number of nodes on a path from `root` to a leaf; 0 for a leaf.
    pub(super) fn depth(&self, root: u32) -> usize {
        depth_of(root, |node| self.nodes[node as usize].children)
    }

    /// Returns the corners of a sub-hyperplane, in the solid's coordinates, in boundary order.
    fn corners(&self, sub: Sub) -> &[DVec3] {
        &self.points[sub.start as usize..][..sub.len as usize]
    }

    /// Stores the corners of a sub-hyperplane, in the solid's coordinates, and returns their range in
    /// `Arena::points`.
    fn add_corners(&mut self, corners: &[DVec3]) -> Sub {
        let start = self.points.len() as u32;
        self.points.extend_from_slice(corners);
        Sub { start, len: corners.len() as u32 }
    }

    /// Copies the tree with root `root` from the arena `from`, and computes the sub-hyperplanes of its
    /// nodes within a box around the origin. `magnitude` bounds the absolute coordinates of the tree's
    /// solid on each axis. Returns the copy's root.
    pub(super) fn load(&mut self, from: &Self, root: u32, magnitude: DVec3) -> u32 {
        let mut above = Vec::new();
        // The box is a little wider than `magnitude`, so that faces on its sides are well inside.
        self.load_below(from, root, magnitude * 1.25 + f64::MIN_POSITIVE, &mut above)
    }

    /// Copies the subtree `child` of another arena and returns the copy's root. `above` lists the planes of
    /// the ancestors, each with true if the subtree is in front of the plane, false if behind; the list is
    /// restored on return. `magnitude` bounds the absolute coordinates on each axis.
    fn load_below(
        &mut self,
        from: &Self,
        child: u32,
        magnitude: DVec3,
        above: &mut Vec<(SidePlane, bool)>,
    ) -> u32 {
        if is_leaf(child) {
            return child;
        }
        let Node { plane, children: [back, front], .. } = from.node(child);
        let plane = SidePlane::new(plane.plane, magnitude);
        let mut corners = across_box(&plane.plane, magnitude);
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
        let back = self.load_below(from, back, magnitude, above);
        above.pop();
        above.push((plane, true));
        let front = self.load_below(from, front, magnitude, above);
        above.pop();
        let sub = self.add_corners(&corners);
        self.push(Node { plane, children: [back, front], sub })
    }

    /// Returns the complement of a tree: a copy with [`SOLID`] and [`EMPTY`] leaves exchanged.
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

    /// Splits a tree by the plane of the node `by`, whose region must be that of the tree. Returns the roots
    /// of the parts behind and in front of the plane, in this order.
    pub(super) fn partition(&mut self, tree: u32, by: &Node) -> [u32; 2] {
        if is_leaf(tree) {
            return [tree; 2];
        }
        let node = self.node(tree);
        let of_by = node.plane.side_of_polygon(self.corners(by.sub));
        let of_node = by.plane.side_of_polygon(self.corners(node.sub));
        let [back, front] = node.children;
        if by.sub.len == 0 || node.sub.len == 0 {
            // Too thin to tell: splitting both children is correct whatever the relation of the planes.
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
                // The splitting plane passes through one child's region only. The other child stays whole,
                // and the node goes to one side of the splitting plane.
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
                    // Possible only by rounding.
                    _ => [whole(self, parts[0]), whole(self, parts[1])],
                }
            }
        }
    }

    /// Splits the tree of `node` by the plane of `by` where the two planes cross. Returns the roots of the
    /// parts behind and in front of the plane of `by`; each has its own copy of the node.
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

    /// Returns the parts of a sub-hyperplane behind and in front of a plane, in this order. All are in the
    /// solid's coordinates. If the polygon is not across the plane, both parts are the whole polygon.
    fn halves(&mut self, sub: Sub, plane: &SidePlane) -> [Sub; 2] {
        if plane.side_of_polygon(self.corners(sub)) != PolygonSide::Across {
            return [sub; 2];
        }
        let (mut front, mut back) = (Vec::new(), Vec::new());
        cut(self.corners(sub), plane, &mut front, &mut back);
        [self.add_corners(&back), self.add_corners(&front)]
    }
}

/// Returns the polygon in which a plane cuts the box from `-magnitude` to `magnitude`, in the solid's
/// coordinates and in boundary order. Empty if the plane misses the box.
fn across_box(plane: &Plane, magnitude: DVec3) -> Vec<DVec3> {
    let n = plane.normal.abs();
    // Every line through the box along the axis of the normal's largest component meets the plane once.
    let axis = n.max_position();
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut corners: Vec<DVec3> = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(s, t)| {
            let mut p = DVec3::ZERO;
            p[u] = s * magnitude[u];
            p[v] = t * magnitude[v];
            p[axis] = -(plane.normal[u] * p[u] + plane.normal[v] * p[v] + plane.offset) / plane.normal[axis];
            p
        })
        .into();
    let (mut inside, mut outside) = (Vec::new(), Vec::new());
    for sign in [1.0, -1.0] {
        // Clips the polygon's ends that stick out of the box, with a margin for their distance from the
        // origin.
        let side = SidePlane::new(Plane::new(DVec3::AXES[axis] * sign, magnitude[axis]), magnitude * 3.0);
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
