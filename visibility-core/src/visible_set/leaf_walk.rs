//! Traversal of a set's masks, leaf by leaf.

use crate::scene::{FAN_OUT, NONE, Token, Tree};
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
    /// Token of the state of the tree that is traversed; `None` for the present state.
    token: Option<&'a Token>,
    /// Stack of the children of the inner nodes from the root to the present leaf, each with a mask of the
    /// lanes that are still to be visited.
    path: SmallVec<[(&'a [ObjectId; FAN_OUT], u64); 8]>,
    /// Number of the present leaf; meaningless in an empty tree.
    pub(super) leaf: usize,
    /// Objects of the present leaf by lane; placeholders in an empty tree.
    pub(super) ids: &'a [ObjectId; FAN_OUT],
    /// Mask of the objects of the present leaf that are in the set and still to be visited, bit i for lane i.
    pub(super) mask: u64,
}

impl<'a> LeafWalk<'a> {
    /// Begins a traversal of the set that `masks` describe, or of the set of all objects on `layers` if
    /// `masks` is `None`.
    pub(super) fn new(masks: Option<&'a [u64]>, layers: u32, scene: &'a Scene) -> Self {
        Self::from_root(masks, layers, scene, scene.tree().root, None)
    }

    /// Begins a traversal of the set that `masks` describe, in the tree as it was at the state of `token`.
    /// `root` was the number of its root then.
    pub(super) fn of_state(masks: &'a [u64], scene: &'a Scene, root: u32, token: &'a Token) -> Self {
        Self::from_root(Some(masks), 0, scene, root, Some(token))
    }

    fn from_root(
        masks: Option<&'a [u64]>,
        layers: u32,
        scene: &'a Scene,
        root: u32,
        token: Option<&'a Token>,
    ) -> Self {
        let (tree, path, ids) = (scene.tree(), SmallVec::new(), &[ObjectId::PLACEHOLDER; FAN_OUT]);
        let mut walk = Self { masks, layers, scene, tree, token, path, leaf: 0, ids, mask: 0 };
        if root != NONE {
            walk.enter(root as usize);
        }
        walk
    }

    /// Enters a node: makes it the present leaf, or appends its children to `path`. Returns true for a leaf.
    fn enter(&mut self, node: usize) -> bool {
        let mask = match self.masks {
            Some(masks) => masks[node],
            None => lanes_on_layers(self.scene, node, self.layers),
        };
        let (level, ids) = match self.token {
            None => (self.tree.levels[node], &self.tree.ids[node]),
            token => self.tree.contents_at(node, token),
        };
        if level == 0 {
            (self.leaf, self.ids, self.mask) = (node, ids, mask);
        } else {
            self.path.push((ids, mask));
        }
        level == 0
    }

    /// Advances to the next leaf in hierarchy order and loads its mask of objects in the set, which may be 0.
    /// Returns false after the last leaf.
    pub(super) fn next_leaf(&mut self) -> bool {
        while let Some((children, rest)) = self.path.last_mut() {
            if *rest == 0 {
                self.path.pop();
                continue;
            }
            let lane = rest.trailing_zeros() as usize;
            *rest &= *rest - 1;
            let child = children[lane].index();
            if self.enter(child) {
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
        Some(self.ids[lane])
    }

    /// Folds all remaining objects, one leaf at a time. Several times as fast as calling `next`; used by
    /// `for_each` and `collect`.
    fn fold<B, F: FnMut(B, ObjectId) -> B>(mut self, start: B, mut f: F) -> B {
        let mut result = start;
        loop {
            if self.mask == u64::MAX {
                result = self.ids.iter().fold(result, |result, &id| f(result, id));
            } else {
                while self.mask != 0 {
                    let lane = self.mask.trailing_zeros() as usize;
                    self.mask &= self.mask - 1;
                    result = f(result, self.ids[lane]);
                }
            }
            if !self.next_leaf() {
                return result;
            }
        }
    }
}

/// Returns the mask of a node in the set of all objects on `layers`. Bit i stands for lane i. For a leaf,
/// these are the objects on the layers; for an inner node, all of its children.
pub(super) fn lanes_on_layers(scene: &Scene, node: usize, layers: u32) -> u64 {
    match scene.tree().levels[node] {
        0 => scene.lanes_on_layers(node, layers),
        _ => scene.tree().occupied[node],
    }
}
