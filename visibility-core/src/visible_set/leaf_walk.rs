//! Traversal of a set's masks, leaf by leaf.

use crate::scene::{NONE, Tree};
use crate::{ObjectId, Scene};
use smallvec::SmallVec;

/// Traversal of the leaves that a set reaches, in hierarchy order, and iterator over the objects in them.
/// Objects that are never culled are not visited.
pub(super) struct LeafWalk<'a> {
    /// Masks of the set, indexed by node; `None` if the set holds every object on `layers`.
    masks: Option<&'a [u64]>,
    layers: u32,
    scene: &'a Scene,
    tree: &'a Tree,
    /// Stack of the inner nodes from the root to the present leaf, each with a mask of the lanes that are
    /// still to be visited.
    path: SmallVec<[(usize, u64); 8]>,
    /// The present leaf, meaningless in an empty tree, and the mask of its objects in the set that are still
    /// to be visited.
    pub(super) leaf: usize,
    pub(super) mask: u64,
}

impl<'a> LeafWalk<'a> {
    /// Begins a traversal of the set with these masks, or of all objects on `layers` if `masks` is `None`.
    pub(super) fn new(masks: Option<&'a [u64]>, layers: u32, scene: &'a Scene) -> Self {
        let tree = scene.tree();
        let mut walk = Self { masks, layers, scene, tree, path: SmallVec::new(), leaf: 0, mask: 0 };
        if tree.root != NONE {
            walk.enter(tree.root as usize);
        }
        walk
    }

    fn enter(&mut self, node: usize) {
        let mask = match self.masks {
            Some(masks) => masks[node],
            None => lanes_on_layers(self.scene, node, self.layers),
        };
        if self.tree.levels[node] == 0 {
            (self.leaf, self.mask) = (node, mask);
        } else {
            self.path.push((node, mask));
        }
    }

    /// Advances to the next leaf in hierarchy order and loads its mask of objects in the set, which may be 0.
    /// Returns false after the last leaf.
    pub(super) fn next_leaf(&mut self) -> bool {
        while let Some((node, rest)) = self.path.last_mut() {
            if *rest == 0 {
                self.path.pop();
                continue;
            }
            let lane = rest.trailing_zeros() as usize;
            *rest &= *rest - 1;
            let child = self.tree.child(*node, lane);
            self.enter(child);
            if self.tree.levels[child] == 0 {
                return true;
            }
        }
        self.mask = 0;
        false
    }
}

impl Iterator for LeafWalk<'_> {
    type Item = ObjectId;

    fn next(&mut self) -> Option<ObjectId> {
        while self.mask == 0 {
            if !self.next_leaf() {
                return None;
            }
        }
        let lane = self.mask.trailing_zeros() as usize;
        self.mask &= self.mask - 1;
        Some(self.tree.ids[self.leaf][lane])
    }

    /// Folds all remaining objects, one leaf at a time. Several times as fast as calling `next`; used by
    /// `for_each` and `collect`.
    fn fold<B, F: FnMut(B, ObjectId) -> B>(mut self, start: B, mut f: F) -> B {
        let mut result = start;
        loop {
            if self.mask == u64::MAX {
                result = self.tree.ids[self.leaf].iter().fold(result, |result, &id| f(result, id));
            } else {
                // In an empty tree the mask is 0 and no leaf is read.
                while self.mask != 0 {
                    let lane = self.mask.trailing_zeros() as usize;
                    self.mask &= self.mask - 1;
                    result = f(result, self.tree.ids[self.leaf][lane]);
                }
            }
            if !self.next_leaf() {
                return result;
            }
        }
    }
}

/// Returns the mask of a node of the set that holds every object on `layers`, bit i for lane i: the objects
/// on these layers (leaves) or all children (inner nodes).
pub(super) fn lanes_on_layers(scene: &Scene, node: usize, layers: u32) -> u64 {
    match scene.tree().levels[node] {
        0 => scene.lanes_on_layers(node, layers),
        _ => scene.tree().occupied[node],
    }
}
