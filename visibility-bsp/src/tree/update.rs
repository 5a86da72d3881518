//! Incremental changes of a tree (Chrysanthou and Slater, "Computing Dynamic Changes to BSP Trees", 1992).
//! New polygons are sorted down to the leaves. Removed polygons are taken out of their nodes. A node without
//! polygons is removed once one of its sides is a leaf.

use super::bsp_tree::{BspError, BspTree};
use super::node::{EMPTY, NONE, is_leaf};
use super::subtree::Subtree;
use visibility_core::{Aabb, glam::DVec3};

impl BspTree {
    /// Inserts polygons of an owner, in the tree's coordinates, in addition to those that the owner has.
    /// Returns the number of [accepted](Self::accepts) polygons; the others are left out.
    ///
    /// Costs some 100 ns per polygon and level of the tree. Allocates nothing if an owner with as many
    /// polygons has been removed before.
    ///
    /// # Errors
    /// [`BspError::TooManyFragments`] if the polygons are cut more than 4,096 times plus 256 times for each.
    /// All polygons of the owner are then removed from the tree, including earlier ones.
    pub fn insert<P: AsRef<[DVec3]>>(
        &mut self,
        owner: u32,
        polygons: impl IntoIterator<Item = P>,
    ) -> Result<usize, BspError> {
        let magnitude = self.magnitude;
        let result = self.sort_in(polygons.into_iter().map(|polygon| (owner, polygon)));
        if result.is_err() {
            self.remove(owner);
            if self.magnitude != magnitude {
                self.set_magnitude(magnitude);
            }
        }
        result
    }

    /// Removes all polygons of an owner. Returns true if the owner had any, false if the tree is unchanged.
    ///
    /// A plane in which no polygon is left stays in the tree only while it separates other polygons on both
    /// of its sides. There are never more such planes than nodes with polygons.
    pub fn remove(&mut self, owner: u32) -> bool {
        let first = self.store.take_owner(owner);
        let mut touched = core::mem::take(&mut self.touched);
        let mut id = first;
        while id != NONE {
            let record = self.store.free(id);
            let node = &mut self.nodes[record.node as usize];
            if node.first == id {
                node.first = record.next;
            }
            touched.push(record.node);
            id = record.next_of_owner;
        }
        // Each node once, however many of the polygons were in its plane. Closing one may free others.
        touched.sort_unstable();
        touched.dedup();
        for node in touched.drain(..) {
            let is_free = self.nodes[node as usize].parent == node;
            if !is_free {
                self.close(node);
            }
        }
        self.touched = touched;
        first != NONE
    }

    /// Removes a node from the tree if no polygon is in its plane and one of its sides is a leaf, and repeats
    /// with its ancestors. Tightens the bounds of the first ancestor that stays, and of those above.
    pub(super) fn close(&mut self, mut id: u32) {
        loop {
            let node = &self.nodes[id as usize];
            let [back, front] = node.children;
            let parent = node.parent;
            if node.first != NONE || (!is_leaf(back) && !is_leaf(front)) {
                return self.shrink(id);
            }
            // One of the children is a leaf: the node is replaced by the other.
            let rest = if is_leaf(front) { back } else { front };
            if !is_leaf(rest) {
                self.nodes[rest as usize].parent = parent;
            }
            if parent == NONE {
                self.root = rest;
            } else {
                let children = &mut self.nodes[parent as usize].children;
                children[usize::from(children[1] == id)] = rest;
            }
            let free = &mut self.nodes[id as usize];
            (free.children, free.parent) = ([EMPTY; 2], id);
            self.free_nodes.push(id);
            if parent == NONE {
                return;
            }
            id = parent;
        }
    }

    /// Extends the bounds and owner of node `node` and of its ancestors to include `by`.
    pub(super) fn grow(&mut self, mut node: u32, by: &Subtree) {
        while node != NONE {
            let of = &mut self.subtrees[node as usize];
            let grown = of.union(by);
            if grown == *of {
                return;
            }
            *of = grown;
            node = self.nodes[node as usize].parent;
        }
    }

    /// Recomputes the bounds and owner of node `id` and of its ancestors from their fragments and children.
    /// Stops at the first node that does not change.
    fn shrink(&mut self, mut id: u32) {
        while id != NONE {
            let mut subtree = Subtree::NOTHING;
            let node = &self.nodes[id as usize];
            for child in node.children.into_iter().filter(|&child| !is_leaf(child)) {
                subtree = subtree.union(&self.subtrees[child as usize]);
            }
            let mut fragment = node.first;
            // Most often nothing changes; the comparison then ends the loop before all fragments are visited.
            while fragment != NONE && subtree != self.subtrees[id as usize] {
                let record = self.store.record(fragment);
                let bounds = Aabb::around(self.store.vertices(record).iter().copied());
                subtree = subtree.union(&Subtree::of(bounds, record.owner));
                fragment = record.next;
            }
            if core::mem::replace(&mut self.subtrees[id as usize], subtree) == subtree {
                return;
            }
            id = node.parent;
        }
    }
}
