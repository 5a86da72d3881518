//! Which leaf a point is in.

use super::{BspTree, Leaf, SOLID, is_leaf};
use visibility_core::glam::DVec3;

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
}
