//! Access to the fragments of polygons in a tree.

use super::bsp_tree::BspTree;
use super::node::NONE;
use super::store::Record;
use visibility_core::{geometry::Plane, glam::DVec3};

/// A fragment: a convex part of one polygon that lies in the plane of one node of a [`BspTree`].
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
    /// The tree that holds the fragment.
    pub(super) tree: &'a BspTree,
    /// Index of the fragment in the tree's store.
    pub(super) id: u32,
}

impl<'a> Fragment<'a> {
    /// Returns the fragment's record in the tree's store.
    fn record(&self) -> &'a Record {
        self.tree.store.record(self.id)
    }

    /// Returns the owner number of the polygon that the fragment is a part of.
    #[inline]
    pub fn owner(&self) -> u32 {
        self.record().owner
    }

    /// Returns the index of the fragment's polygon among the polygons of the same `build` or `insert` call,
    /// from 0; rejected polygons count too.
    pub fn polygon(&self) -> u32 {
        self.record().polygon
    }

    /// Returns the vertices of the fragment in the tree's coordinates, in boundary order, counter-clockwise
    /// as seen from the polygon's front.
    #[inline]
    pub fn vertices(&self) -> &'a [DVec3] {
        self.tree.store.vertices(self.record())
    }

    /// Returns the plane in which the fragment lies, in the tree's coordinates. The unit normal points to the
    /// front of the fragment's polygon.
    pub fn plane(&self) -> Plane {
        let record = self.record();
        let plane = self.tree.nodes[record.node as usize].plane.plane;
        if record.same_way { plane } else { plane.flipped() }
    }
}

impl BspTree {
    /// Calls `each` for every fragment of an owner, in no particular order. Takes time proportional to the
    /// number of these fragments; an unknown owner has none.
    pub fn for_each_fragment(&self, owner: u32, mut each: impl FnMut(Fragment<'_>)) {
        let mut id = self.store.first_of(owner);
        while id != NONE {
            #[cfg(test)]
            visibility_testing::step();
            each(Fragment { tree: self, id });
            id = self.store.record(id).next_of_owner;
        }
    }
}

/// Iterator over the fragments in the plane of one node, in no particular order. They do not hide each other.
#[derive(Clone, Debug)]
pub struct Fragments<'a> {
    pub(super) tree: &'a BspTree,
    /// Index in the tree's store of the next fragment, `NONE` at the end.
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
