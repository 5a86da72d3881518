//! Point location, and copying of a tree's planes.

use super::bsp_tree::{BspTree, Leaf};
use super::node::{EMPTY, SOLID, is_leaf};
use alloc::vec::Vec;
use visibility_core::{geometry::SidePlane, glam::DVec3};

impl BspTree {
    /// Returns the kind of leaf that contains a point: free space or the inside of a solid. A point on a
    /// plane counts as in front of it. A NaN point counts as behind every plane. Costs one plane test per
    /// level.
    ///
    /// Only trees of [solids](Self::build_solid) have solid leaves; in any other tree the result is
    /// [`Leaf::Empty`].
    pub fn locate(&self, p: DVec3) -> Leaf {
        let mut child = self.root;
        while !is_leaf(child) {
            let node = &self.nodes[child as usize];
            child = node.children[usize::from(node.plane.plane.signed_distance(p) >= 0.0)];
        }
        if child == SOLID { Leaf::Solid } else { Leaf::Empty }
    }

    /// Calls `make` for every plane of the tree (in the tree's coordinates), children before parents. The
    /// second argument of `make` holds the results for the subtrees behind and in front of the plane, in this
    /// order; an empty leaf is `u32::MAX` and a solid leaf `u32::MAX - 1`. Returns the result for the root.
    pub(crate) fn copy_planes(&self, make: &mut dyn FnMut(&SidePlane, [u32; 2]) -> u32) -> u32 {
        let (mut open, mut made) = (Vec::from([(self.root, false)]), Vec::new());
        while let Some((child, visited)) = open.pop() {
            if is_leaf(child) {
                made.push(child);
                continue;
            }
            let node = &self.nodes[child as usize];
            if visited {
                if let (Some(front), Some(back)) = (made.pop(), made.pop()) {
                    made.push(make(&node.plane, [back, front]));
                }
            } else {
                open.extend([(child, true), (node.children[1], false), (node.children[0], false)]);
            }
        }
        made.pop().unwrap_or(EMPTY)
    }
}
