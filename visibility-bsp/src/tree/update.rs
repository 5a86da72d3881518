//! Owners that come and go, without a new tree (Chrysanthou and Slater, "Computing Dynamic Changes to BSP
//! Trees", 1992): what comes is sorted down to the leaves, what goes is taken out of its nodes, and nodes
//! that neither hold nor divide anything any more are closed.

use super::bsp_tree::{BspError, BspTree};
use super::node::{EMPTY, NONE, bounds_of, is_leaf};
use super::subtree::Subtree;
use visibility_core::glam::DVec3;

impl BspTree {
    /// Adds polygons of an owner, in addition to those that it has. Returns how many were
    /// [accepted](Self::accepts).
    ///
    /// Costs some 100 ns a polygon and level of the tree, and no allocation once an owner as large has been
    /// removed.
    ///
    /// # Errors
    /// [`BspError::TooManyFragments`]; the owner then has no polygons in the tree.
    pub fn insert<P: AsRef<[DVec3]>>(
        &mut self,
        owner: u32,
        polygons: impl IntoIterator<Item = P>,
    ) -> Result<usize, BspError> {
        let result = self.sort_in(polygons.into_iter().map(|polygon| (owner, polygon)));
        if result.is_err() {
            self.remove(owner);
        }
        result
    }

    /// Takes out all polygons of an owner. Returns whether it had any.
    ///
    /// Planes that no polygon lies in any more stay only while they divide polygons of others on both sides:
    /// never more than there are nodes with polygons.
    pub fn remove(&mut self, owner: u32) -> bool {
        let first = self.store.take_owner(owner);
        let mut id = first;
        while id != NONE {
            let record = self.store.free(id);
            let node = &mut self.nodes[record.node as usize];
            if node.first == id {
                node.first = record.next;
            }
            if node.first == NONE {
                self.close(record.node);
            } else {
                self.shrink(record.node);
            }
            id = record.next_of_owner;
        }
        first != NONE
    }

    /// Takes a node without polygons out of the tree if one of its sides is a leaf, and then those above it
    /// that were waiting for that.
    fn close(&mut self, mut id: u32) {
        loop {
            let node = &self.nodes[id as usize];
            let [back, front] = node.children;
            let parent = node.parent;
            if node.first != NONE || (!is_leaf(back) && !is_leaf(front)) {
                return self.shrink(id);
            }
            // What is left in its place: the side that is not a leaf. Of two leaves, the one in front, where
            // there was nothing solid.
            let rest = if is_leaf(front) && !is_leaf(back) { back } else { front };
            if !is_leaf(rest) {
                self.nodes[rest as usize].parent = parent;
            }
            if parent == NONE {
                self.root = rest;
            } else {
                let children = &mut self.nodes[parent as usize].children;
                children[usize::from(children[1] == id)] = rest;
            }
            self.nodes[id as usize].children = [EMPTY; 2];
            self.free_nodes.push(id);
            if parent == NONE {
                return;
            }
            id = parent;
        }
    }

    /// Makes the summary of a node and of those above contain another.
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

    /// Makes the summary of a node and of those above as tight as it can be.
    fn shrink(&mut self, mut id: u32) {
        while id != NONE {
            let mut subtree = Subtree::NOTHING;
            let node = &self.nodes[id as usize];
            for child in node.children.into_iter().filter(|&child| !is_leaf(child)) {
                subtree = subtree.union(&self.subtrees[child as usize]);
            }
            let mut fragment = node.first;
            // Most often nothing changes; then there is no need to look at all of the fragments.
            while fragment != NONE && subtree != self.subtrees[id as usize] {
                let record = self.store.record(fragment);
                let bounds = bounds_of(self.store.vertices(record));
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
