//! Depth-ordered walks of a tree, over all nodes or only those that the visitor enters.

use super::bsp_tree::BspTree;
use super::fragments::Fragments;
use super::node::{NONE, Node, is_leaf};
use super::subtree::Subtree;
use alloc::vec::Vec;
use visibility_core::{glam::DVec4, view::Eye};

/// Reusable memory of a tree walk: a stack of the nodes whose first visited side is being walked. A walk
/// reserves one entry per level of the tree, so later walks of the same tree allocate nothing.
///
/// ```
/// use visibility_bsp::{BspTree, TraversalStack};
/// use visibility_core::{glam::DVec3, view::Eye};
/// let mut stack = TraversalStack::new(); // one a view
/// BspTree::new().front_to_back(Eye::Point(DVec3::ZERO), &mut stack, |_| unreachable!());
/// ```
#[derive(Clone, Debug, Default)]
pub struct TraversalStack {
    /// Stack of the nodes whose first visited side is being walked, root first. A step copies what the walk
    /// needs later, which is cheaper than reading the node again.
    path: Vec<Step>,
}

/// What remains to be visited of a node after the child on its first visited side: the node's fragments and
/// the other child.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// Index of the first fragment in the node's plane, `NONE` if there is none.
    first: u32,
    /// Child visited second: the child on the far side of the node's plane, or on the near side in a
    /// back-to-front walk.
    far: u32,
    /// The visitor's value for the node, returned by `TreeVisitor::enter` and passed on to
    /// `TreeVisitor::visit`.
    marks: u32,
}

impl TraversalStack {
    /// Creates a stack without allocated memory; the first walk allocates.
    pub const fn new() -> Self {
        Self { path: Vec::new() }
    }
}

/// Visitor of a [walk](BspTree::walk) through a BSP tree in depth order.
pub trait TreeVisitor {
    /// Decides whether the walk enters a node, before anything in the node or below it is visited. `subtree`
    /// describes the node and everything below. `above` is the value returned for the parent node, 0 for the
    /// root. Returns a value of the visitor's choice (marks, which the walk only passes on) to enter the
    /// node, or `None` to skip the whole subtree.
    fn enter(&mut self, subtree: &Subtree, above: u32) -> Option<u32> {
        let _ = subtree;
        Some(above)
    }

    /// Receives the fragments in the plane of one node, which do not hide each other, and the marks returned
    /// by [`enter`](Self::enter) for that node. Not called for nodes without fragments.
    fn visit(&mut self, fragments: Fragments<'_>, marks: u32);
}

impl<F: FnMut(Fragments<'_>)> TreeVisitor for F {
    #[inline]
    fn visit(&mut self, fragments: Fragments<'_>, _: u32) {
        self(fragments);
    }
}

impl BspTree {
    /// Calls `visit` with the fragments of each node, nearest node first. Seen from `eye` (in the tree's
    /// coordinates), no fragment of a later node hides any part of one of an earlier node, in any direction.
    /// An eye in a node's plane sees the node's fragments edge on and neither side through the other, so
    /// either order of the sides is correct. `stack` is scratch memory.
    ///
    /// Costs some nanoseconds per node.
    pub fn front_to_back(&self, eye: Eye, stack: &mut TraversalStack, mut visit: impl FnMut(Fragments<'_>)) {
        self.walk(eye, stack, &mut visit);
    }

    /// Walks the nodes front to back as seen from `eye`, in the tree's coordinates. Skips the subtrees that
    /// [`TreeVisitor::enter`] rejects, such as those outside the view or already hidden. `stack` is scratch
    /// memory.
    pub fn walk(&self, eye: Eye, stack: &mut TraversalStack, walk: &mut impl TreeVisitor) {
        // The eye as homogeneous coordinates. A point is in front of a plane if normal . eye + offset > 0; an
        // eye at infinity, if the view direction runs against the normal.
        let eye = match eye {
            Eye::Point(eye) => eye.extend(1.0),
            Eye::Direction(direction) => (-direction).extend(0.0),
        };
        stack.path.clear();
        stack.path.reserve(self.most_levels as usize);
        let (mut child, mut above) = (self.root, 0);
        loop {
            while !is_leaf(child)
                && let Some(marks) = walk.enter(&self.subtrees[child as usize], above)
            {
                let node = &self.nodes[child as usize];
                let side = usize::from(in_front(node, eye));
                stack.path.push(Step { first: node.first, far: node.children[side ^ 1], marks });
                child = node.children[side];
                above = marks;
            }
            let Some(Step { first, far, marks }) = stack.path.pop() else { return };
            if first != NONE {
                walk.visit(Fragments { tree: self, next: first }, marks);
            }
            child = far;
            above = marks;
        }
    }
}

/// Tests whether a homogeneous eye `(x, y, z, w)` in the tree's coordinates is strictly in front of a node's
/// plane. False on the plane, behind it, and for NaN.
#[inline]
fn in_front(node: &Node, eye: DVec4) -> bool {
    let plane = &node.plane.plane;
    plane.normal.x * eye.x + plane.normal.y * eye.y + plane.normal.z * eye.z + plane.offset * eye.w > 0.0
}
