//! Which leaf a point is in.

use super::bsp_tree::{BspTree, Leaf};
use super::node::{EMPTY, SOLID, is_leaf};
use alloc::vec::Vec;
use visibility_core::{geometry::SidePlane, glam::DVec3};

impl BspTree {
    /// Whether a point is in free space or inside a solid. A point in a plane counts as in front of it.
    ///
    /// Only trees of [solids](Self::build_solid) have solid leaves.
    pub fn locate(&self, p: DVec3) -> Leaf {
        let mut child = self.root;
        while !is_leaf(child) {
            let node = &self.nodes[child as usize];
            child = node.children[usize::from(node.plane.plane.signed_distance(p) >= 0.0)];
        }
        if child == SOLID { Leaf::Solid } else { Leaf::Empty }
    }

    /// Hands the planes of the tree to `make`, children before parents, each with what `make` returned for
    /// the tree behind it and in front; leaves are `u32::MAX` where empty and one less where solid. Returns
    /// what was made of the root.
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
