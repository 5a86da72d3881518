//! Walking a tree in the order of depth, whole or only what is in view.

use super::{BspTree, Fragments, NONE, Node, is_leaf};
use alloc::vec::Vec;
use visibility_core::{Aabb, Eye, glam::DVec4};

/// The memory of a walk, kept from frame to frame so that a walk allocates nothing.
///
/// ```
/// use visibility_bsp::{BspTree, Order};
/// use visibility_core::{Eye, glam::DVec3};
/// let mut order = Order::new(); // one a view
/// BspTree::new().back_to_front(Eye::Point(DVec3::ZERO), &mut order, |_| unreachable!());
/// ```
#[derive(Clone, Debug, Default)]
pub struct Order {
    /// Nodes whose near side is being walked: twice the node, plus which side that is.
    path: Vec<u32>,
}

impl Order {
    /// No memory yet.
    pub const fn new() -> Self {
        Self { path: Vec::new() }
    }
}

/// What happens on a [walk](BspTree::walk).
pub trait Walk {
    /// Asked before anything of a node or below is looked at, with a box around all that: whether to go there.
    fn enter(&mut self, bounds: &Aabb) -> bool {
        let _ = bounds;
        true
    }

    /// The fragments in the plane of one node, none of which hides another.
    fn visit(&mut self, fragments: Fragments<'_>);
}

impl<F: FnMut(Fragments<'_>)> Walk for F {
    #[inline]
    fn visit(&mut self, fragments: Fragments<'_>) {
        self(fragments);
    }
}

impl BspTree {
    /// Calls `visit` with the fragments of node after node, nearest first: none of a later node hides any of an earlier one, seen from the eye,
    /// in any direction. An eye in the plane of a node sees the node's fragments edge on, and neither side through the other, so that
    /// every order of the two is right.
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
        // The eye is in front where normal . eye + offset > 0; an eye at infinity where it looks against the normal.
        let eye = match eye {
            Eye::Point(eye) => eye.extend(1.0),
            Eye::Direction(direction) => (-direction).extend(0.0),
        };
        order.path.clear();
        let mut child = self.root;
        loop {
            while !is_leaf(child) && walk.enter(&self.bounds[child as usize]) {
                let node = &self.nodes[child as usize];
                let side = usize::from((in_front(node, eye)) != reverse);
                order.path.push(child << 1 | side as u32);
                child = node.children[side];
            }
            let Some(entry) = order.path.pop() else { return };
            let node = &self.nodes[(entry >> 1) as usize];
            if node.first != NONE {
                walk.visit(Fragments { tree: self, next: node.first });
            }
            child = node.children[(entry & 1 ^ 1) as usize];
        }
    }
}

#[inline]
fn in_front(node: &Node, eye: DVec4) -> bool {
    let plane = &node.plane.plane;
    plane.normal.x * eye.x + plane.normal.y * eye.y + plane.normal.z * eye.z + plane.offset * eye.w > 0.0
}
