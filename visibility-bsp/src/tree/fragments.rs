//! The parts of polygons in a tree, as they are given to callers.

use super::bsp_tree::BspTree;
use super::node::NONE;
use super::store::Record;
use visibility_core::{geometry::Plane, glam::DVec3};

/// A part of a polygon, in a node of a [`BspTree`].
///
/// ```
/// use visibility_bsp::BspTree;
/// use visibility_core::glam::DVec3;
/// let tree = BspTree::build([(7, &[DVec3::ZERO, DVec3::X, DVec3::Y][..])])?;
/// tree.for_each_fragment(7, |fragment| assert_eq!(fragment.vertices().len(), 3));
/// # Ok::<(), visibility_bsp::BspError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Fragment<'a> {
    pub(super) tree: &'a BspTree,
    pub(super) id: u32,
}

impl<'a> Fragment<'a> {
    fn record(&self) -> &'a Record {
        self.tree.store.record(self.id)
    }

    /// Owner of the polygon that it is a part of.
    #[inline]
    pub fn owner(&self) -> u32 {
        self.record().owner
    }

    /// Number of its polygon among those given in the same call of `build` or `insert`, counted from 0.
    pub fn polygon(&self) -> u32 {
        self.record().polygon
    }

    /// Its vertices, in order around it, counter-clockwise as seen from the front of the polygon.
    #[inline]
    pub fn vertices(&self) -> &'a [DVec3] {
        self.tree.store.vertices(self.record())
    }

    /// The plane that it lies in, with the normal to the front of the polygon.
    pub fn plane(&self) -> Plane {
        let record = self.record();
        let plane = self.tree.nodes[record.node as usize].plane.plane;
        if record.same_way { plane } else { plane.flipped() }
    }
}

impl BspTree {
    /// Calls `each` for every fragment of an owner, in no particular order.
    pub fn for_each_fragment(&self, owner: u32, mut each: impl FnMut(Fragment<'_>)) {
        let mut id = self.store.first_of(owner);
        while id != NONE {
            each(Fragment { tree: self, id });
            id = self.store.record(id).next_of_owner;
        }
    }
}

/// The fragments in the plane of one node.
#[derive(Clone, Debug)]
pub struct Fragments<'a> {
    pub(super) tree: &'a BspTree,
    pub(super) next: u32,
}

impl<'a> Iterator for Fragments<'a> {
    type Item = Fragment<'a>;

    #[inline]
    fn next(&mut self) -> Option<Fragment<'a>> {
        if self.next == NONE {
            return None;
        }
        let fragment = Fragment { tree: self.tree, id: self.next };
        self.next = self.tree.store.record(self.next).next;
        Some(fragment)
    }
}
