//! A walk of the scene's hierarchy on several threads.
//!
//! The root and the nodes above the parents of leaves are few and are tested first, on one thread. The
//! subtrees that are left, of at most 64 leaves each, are dealt out to a fixed number of parts. In a small
//! tree the subtrees are the leaves. A part reads the masks of the set and keeps the masks that it finds in
//! memory of its own. At the end they are written to the set.

use super::{Block, Child, Children};
use crate::jobs::{Jobs, for_each_part};
use crate::scene::{NONE, lanes};
use crate::visible_set::{NewMasks, Part, SplitScratch};
use crate::{CullStats, Scene, VisibleSet};
use alloc::vec::Vec;

/// Number of parts that the subtrees of a walk are dealt out to. More parts share the work more evenly, but
/// each part takes an atomic exchange.
const PARTS: usize = 16;

/// Greatest level, counted from 0 at the leaves, of the nodes whose subtrees are distributed among the parts:
/// 1, the parents of leaves.
const MAX_SUBTREE_LEVEL: u8 = 1;

/// Value of `known` for a node whose descendants need no test: all candidates there are kept.
const ACCEPTED: u32 = 0;

/// A culler's test of 64 siblings, which threads share. Results of tests are passed down to children as a
/// number, `known`, whose meaning the culler defines. [`ACCEPTED`], 0, means that nothing below the node
/// needs a test.
pub(crate) trait NodeTest: Sync {
    /// Result of the test of a block for the children that it keeps. [`below`](Self::below) derives `known`
    /// from it.
    type Found;

    /// Tests the `candidates` among the children of a node. `known` is the number that the tests above have
    /// passed down to the node. Returns the mask of the children to keep, and data for
    /// [`below`](Self::below). Adds to the `tests` of `stats`.
    fn test(
        &self,
        block: &Block<'_>,
        candidates: u64,
        known: u32,
        stats: &mut CullStats,
    ) -> (u64, Self::Found);

    /// Returns the number `known` for the child in a lane that the test has kept: [`ACCEPTED`] if nothing
    /// below the child needs a test.
    fn below(&self, found: &Self::Found, known: u32, lane: usize) -> u32;
}

/// Removes from `visible` the objects that `test` does not keep, on the threads of a job system. `known` is
/// the number passed to the test of the root. Returns the work counters; their `visible` counts objects that
/// are never culled, too. The answer is that of a [`Walk`](super::Walk) with the same test.
pub(crate) fn retain_on<T: NodeTest>(
    jobs: &dyn Jobs,
    scene: &Scene,
    visible: &mut VisibleSet,
    test: &T,
    known: u32,
) -> CullStats {
    visible.prepare(scene);
    let mut stats = CullStats::default();
    if scene.tree().root != NONE {
        let (root, is_current) = (scene.tree().root as usize, visible.is_current(scene));
        let mut scratch = core::mem::replace(&mut visible.split_scratch, SplitScratch::EMPTY);
        scratch.parts.resize_with(PARTS, Part::default);
        scratch.subtrees.clear();
        // Tests the upper levels on this thread. Nodes whose subtrees are small enough are put into
        // `subtrees`.
        let mut top = Top { scene, is_current, test, subtrees: &mut scratch.subtrees, stats };
        top.visit(visible, root, known);
        stats = top.stats;
        let (subtrees, set) = (&scratch.subtrees, &*visible);
        // Part `index` takes every `PARTS`-th subtree. Subtrees that are neighbours in the scene cost about
        // the same, so parts do, too.
        if let Some(parts) = scratch.parts.first_chunk_mut::<PARTS>() {
            let mut index = 0;
            let numbered = parts.each_mut().map(|part| {
                index += 1;
                (index - 1, part)
            });
            for_each_part(jobs, numbered, |(index, part): (usize, &mut Part)| {
                part.masks.clear();
                part.is_any_left.clear();
                let mut walk = PartWalk {
                    scene,
                    set,
                    is_current,
                    test,
                    masks: &mut part.masks,
                    stats: CullStats::default(),
                };
                for &(node, known) in subtrees.iter().skip(index).step_by(PARTS) {
                    let node = node as usize;
                    let any = if known == ACCEPTED { walk.keep(node) } else { walk.visit(node, known) };
                    part.is_any_left.push(any);
                }
                part.stats = walk.stats;
            });
        }
        // Masks are written after all parts have ended, in the order of parts: the answer does not depend on
        // threads.
        for part in &scratch.parts {
            part.masks.runs().for_each(|(first, run)| visible.set_masks(first, run));
            let before = stats.visible;
            stats += part.stats;
            stats.visible += before;
        }
        // Drops subtrees in which no object is left from the nodes above them.
        let mut next = 0;
        drop_empty(visible, scene, root, &scratch.parts, &mut next);
        visible.split_scratch = scratch;
    }
    visible.use_masks();
    stats.visible += visible.unculled_count(scene);
    stats
}

/// Returns the greatest level, counted from 0 at the leaves, of the nodes whose subtrees are distributed
/// among the parts: [`MAX_SUBTREE_LEVEL`], or 0 if there are fewer such nodes than parts.
fn subtree_level(scene: &Scene) -> u8 {
    let tree = scene.tree();
    let (level, children) = (tree.levels[tree.root as usize], tree.occupied[tree.root as usize].count_ones());
    let is_large =
        level > MAX_SUBTREE_LEVEL + 1 || level == MAX_SUBTREE_LEVEL + 1 && children as usize >= PARTS;
    if is_large { MAX_SUBTREE_LEVEL } else { 0 }
}

/// The walk of the nodes above the subtrees.
struct Top<'a, T> {
    scene: &'a Scene,
    is_current: bool,
    test: &'a T,
    /// Nodes whose subtrees are distributed among the parts, each with its number `known`: see
    /// [`SplitScratch::subtrees`].
    subtrees: &'a mut Vec<(u32, u32)>,
    stats: CullStats,
}

impl<T: NodeTest> Top<'_, T> {
    /// Tests the children of a node, and lists the subtrees below that are kept. `known` is the number that
    /// the tests above have passed down to the node.
    fn visit(&mut self, visible: &mut VisibleSet, node: usize, known: u32) {
        let tree = self.scene.tree();
        if tree.levels[node] <= subtree_level(self.scene) {
            return self.subtrees.push((node as u32, known));
        }
        let candidates = visible.mask_if(self.is_current, self.scene, node);
        self.stats.nodes += 1;
        let (mask, found) = self.test.test(&block(self.scene, node), candidates, known, &mut self.stats);
        visible.set_mask(node, mask);
        for lane in lanes(mask) {
            let (child, known) = (tree.child(node, lane), self.test.below(&found, known, lane));
            if known == ACCEPTED {
                self.stats.accepted_subtrees += 1;
                self.keep(visible, child);
            } else {
                self.visit(visible, child, known);
            }
        }
    }

    /// Adds all subtrees with candidates in and below a node to `subtrees`, with the number [`ACCEPTED`]:
    /// their candidates are kept.
    fn keep(&mut self, visible: &mut VisibleSet, node: usize) {
        if self.scene.tree().levels[node] <= subtree_level(self.scene) {
            return self.subtrees.push((node as u32, ACCEPTED));
        }
        let mask = visible.mask_if(self.is_current, self.scene, node);
        visible.set_mask(node, mask);
        lanes(mask).for_each(|lane| self.keep(visible, self.scene.tree().child(node, lane)));
    }
}

/// Clears the bits of children without objects in a node and in all nodes below it, down to the roots of the
/// subtrees that were distributed among `parts`. `next` is the number of the next of these subtrees. Returns
/// whether any object is left below the node.
fn drop_empty(
    visible: &mut VisibleSet,
    scene: &Scene,
    node: usize,
    parts: &[Part],
    next: &mut usize,
) -> bool {
    if scene.tree().levels[node] <= subtree_level(scene) {
        let left = &parts[*next % PARTS].is_any_left;
        *next += 1;
        return left.get((*next - 1) / PARTS).is_none_or(|&any| any);
    }
    let mut mask = visible.mask_if(true, scene, node);
    for lane in lanes(mask) {
        let any = drop_empty(visible, scene, scene.tree().child(node, lane), parts, next);
        mask &= !(u64::from(!any) << lane);
    }
    visible.set_mask(node, mask);
    mask != 0
}

/// Returns the children of a node.
#[inline(always)]
fn block(scene: &Scene, node: usize) -> Block<'_> {
    let tree = scene.tree();
    Block { boxes: &tree.bounds[node], children: Children::Node { tree, node, leaf: tree.levels[node] == 0 } }
}

/// The walk of the subtrees of one part.
struct PartWalk<'a, T> {
    scene: &'a Scene,
    /// The set, with the masks from before the walk.
    set: &'a VisibleSet,
    is_current: bool,
    test: &'a T,
    masks: &'a mut NewMasks,
    stats: CullStats,
}

impl<T: NodeTest> PartWalk<'_, T> {
    /// Tests everything below a node. `known` is the number that the tests above have passed down to the
    /// node. Returns whether any object is left.
    fn visit(&mut self, node: usize, known: u32) -> bool {
        let candidates = self.set.mask_if(self.is_current, self.scene, node);
        let block = block(self.scene, node);
        self.stats.nodes += 1;
        let (mut mask, found) = self.test.test(&block, candidates, known, &mut self.stats);
        self.stats.visible += u64::from(block.objects(mask).count_ones());
        for lane in lanes(mask & !block.objects(mask)) {
            let Child::Node(child) = block.child(lane) else { continue };
            let any = match self.test.below(&found, known, lane) {
                ACCEPTED => {
                    self.stats.accepted_subtrees += 1;
                    self.keep(child)
                }
                known => self.visit(child, known),
            };
            mask &= !(u64::from(!any) << lane);
        }
        self.masks.push(node, mask);
        mask != 0
    }

    /// Keeps all candidates in and below a node. Returns whether there are any.
    fn keep(&mut self, node: usize) -> bool {
        let mask = self.set.mask_if(self.is_current, self.scene, node);
        self.masks.push(node, mask);
        let tree = self.scene.tree();
        if tree.levels[node] == 0 {
            self.stats.visible += u64::from(mask.count_ones());
            return mask != 0;
        }
        lanes(mask).fold(false, |any, lane| self.keep(tree.child(node, lane)) | any)
    }
}
