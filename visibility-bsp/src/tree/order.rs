//! Walking a tree in the order of depth, whole or only what is in view.

use super::bsp_tree::BspTree;
use super::fragments::Fragments;
use super::node::{NONE, Node, is_leaf};
use super::subtree::Subtree;
use alloc::vec::Vec;
use visibility_core::{glam::DVec4, view::Eye};

/// The memory of a walk: a stack of the nodes whose near side is being walked. A walk makes room for as many
/// as the tree has levels, so that later walks of the same tree allocate nothing.
///
/// ```
/// use visibility_bsp::{BspTree, Order};
/// use visibility_core::{glam::DVec3, view::Eye};
/// let mut order = Order::new(); // one a view
/// BspTree::new().back_to_front(Eye::Point(DVec3::ZERO), &mut order, |_| unreachable!());
/// ```
#[derive(Clone, Debug, Default)]
pub struct Order {
    /// Of the nodes whose near side is being walked, all that is still wanted: looking a node up again would
    /// cost more.
    path: Vec<Step>,
}

/// What remains to be visited of a node once its near side is done.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// Number of the first fragment in its plane, `NONE` if there is none.
    first: u32,
    /// The child on its far side.
    far: u32,
    /// The marks that `Walk::enter` returned for it.
    marks: u32,
}

impl Order {
    /// No memory yet.
    pub const fn new() -> Self {
        Self { path: Vec::new() }
    }
}

/// The visitor of a [walk](BspTree::walk).
pub trait Walk {
    /// Asked before anything of a node or below is looked at: whether to go there. The walk keeps some marks
    /// for every node, of which it knows no meaning; those of the node above, or 0 for the root, come in,
    /// those of this one are returned, and `None` passes it by.
    fn enter(&mut self, subtree: &Subtree, above: u32) -> Option<u32> {
        let _ = subtree;
        Some(above)
    }

    /// The fragments in the plane of one node, none of which hides another, and the marks of the node.
    fn visit(&mut self, fragments: Fragments<'_>, marks: u32);
}

impl<F: FnMut(Fragments<'_>)> Walk for F {
    #[inline]
    fn visit(&mut self, fragments: Fragments<'_>, _: u32) {
        self(fragments);
    }
}

impl BspTree {
    /// Calls `visit` with the fragments of node after node, nearest first: none of a later node hides any of
    /// an earlier one, seen from the eye, in any direction. An eye in the plane of a node sees the node's
    /// fragments edge on, and neither side through the other, so that every order of the two is right.
    ///
    /// Some nanoseconds a node.
    pub fn front_to_back(&self, eye: Eye, order: &mut Order, mut visit: impl FnMut(Fragments<'_>)) {
        self.walk_ordered(eye, false, order, &mut visit);
    }

    /// As [`front_to_back`](Self::front_to_back), farthest first: the painter's order.
    pub fn back_to_front(&self, eye: Eye, order: &mut Order, mut visit: impl FnMut(Fragments<'_>)) {
        self.walk_ordered(eye, true, order, &mut visit);
    }

    /// Front to back through what `walk` cares to enter: the view volume, what is not hidden yet.
    pub fn walk(&self, eye: Eye, order: &mut Order, walk: &mut impl Walk) {
        self.walk_ordered(eye, false, order, walk);
    }

    fn walk_ordered(&self, eye: Eye, reverse: bool, order: &mut Order, walk: &mut impl Walk) {
        // The eye is in front where normal . eye + offset > 0; an eye at infinity where it looks against the
        // normal.
        let eye = match eye {
            Eye::Point(eye) => eye.extend(1.0),
            Eye::Direction(direction) => (-direction).extend(0.0),
        };
        order.path.clear();
        order.path.reserve(self.most_levels as usize);
        let (mut child, mut above) = (self.root, 0);
        loop {
            while !is_leaf(child)
                && let Some(marks) = walk.enter(&self.subtrees[child as usize], above)
            {
                let node = &self.nodes[child as usize];
                let side = usize::from((in_front(node, eye)) != reverse);
                order.path.push(Step { first: node.first, far: node.children[side ^ 1], marks });
                child = node.children[side];
                above = marks;
            }
            let Some(Step { first, far, marks }) = order.path.pop() else { return };
            if first != NONE {
                walk.visit(Fragments { tree: self, next: first }, marks);
            }
            child = far;
            above = marks;
        }
    }
}

#[inline]
fn in_front(node: &Node, eye: DVec4) -> bool {
    let plane = &node.plane.plane;
    plane.normal.x * eye.x + plane.normal.y * eye.y + plane.normal.z * eye.z + plane.offset * eye.w > 0.0
}
