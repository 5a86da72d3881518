//! Keeping the hierarchy in shape while objects move, a bounded amount of work at a time.
//!
//! Moving an object enlarges bounds at once, since answers must stay right. What else should happen waits in a queue of nodes to
//! look at: their bounds are tightened, and where they have come to lie across one another, what is in a few neighbours
//! is dealt out among them anew ([`regroup`](super::tree)). Nodes above whose content was changed are queued in their turn.

use super::tree::Tree;
use alloc::vec::Vec;

/// What a call of [`Scene::maintain`](crate::Scene::maintain) did.
///
/// ```
/// use visibility_core::{Aabb, Scene};
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
/// scene.set_bounds(id, Aabb::from_arrays([2.0; 3], [3.0; 3]))?;
/// assert_eq!(scene.maintain(8).blocks, 1);
/// # Ok::<(), visibility_core::SceneError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Maintenance {
    /// Blocks of up to 64 objects that were looked at. One whose objects were dealt out anew counts as three.
    pub blocks: usize,
    /// Objects that were put into another block.
    pub rehomed: usize,
    /// Blocks that still wait to be looked at.
    pub waiting: usize,
}

/// Nodes that wait to be looked at: a bit for each. They are taken in turns, by number.
#[derive(Clone, Debug, Default)]
pub(super) struct Queue {
    queued: Vec<u64>,
    waiting: usize,
    /// The node from which the next one is looked for.
    at: usize,
    /// By node, up to which overlap with others there is no point in dealing out anew, as was found when that was last tried.
    borne: Vec<f32>,
}

impl Queue {
    pub(super) fn push(&mut self, node: usize) {
        let word = node / 64;
        if word >= self.queued.len() {
            self.queued.resize(word + 1, 0);
            self.borne.resize(word * 64 + 64, OVERLAP);
        }
        self.waiting += usize::from(self.queued[word] >> (node % 64) & 1 == 0);
        self.queued[word] |= 1 << (node % 64);
    }

    fn remove(&mut self, node: usize) {
        if let Some(word) = self.queued.get_mut(node / 64) {
            self.waiting -= usize::from(*word >> (node % 64) & 1 != 0);
            *word &= !(1 << (node % 64));
        }
    }

    /// Takes out a node that was dealt out anew.
    fn settle(&mut self, node: usize) {
        self.remove(node);
        if let Some(borne) = self.borne.get_mut(node) {
            *borne = OVERLAP;
        }
    }

    fn pop(&mut self) -> Option<u32> {
        if self.waiting == 0 {
            return None;
        }
        let mut word = self.at / 64;
        let mut rest = self.queued.get(word).map_or(0, |bits| bits & u64::MAX << (self.at % 64));
        while rest == 0 {
            word = if word + 1 < self.queued.len() { word + 1 } else { 0 };
            rest = self.queued[word];
        }
        let node = word * 64 + rest.trailing_zeros() as usize;
        self.remove(node);
        self.at = node + 1;
        Some(node as u32)
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&self.queued[..]) + size_of_val(&self.borne[..])
    }

    pub(super) fn clear(&mut self) {
        (self.waiting, self.at) = (0, 0);
        self.queued.fill(0);
        self.borne.fill(OVERLAP);
    }
}

/// Neighbours that cover less of a node, all together, are left alone. Fresh blocks come close to this, for the bounds of objects
/// overlap too.
const OVERLAP: f32 = 1.0;
/// Where dealing out did not help, it is tried again once the overlap is so much greater,
const BEAR: f32 = 1.5;
/// or after a while: each time that the node is looked at, so much of that is forgotten.
const FORGET: f32 = 0.97;
/// A node with no more objects is merged with those nearest to it, where they have room.
const SPARSE: u32 = 32;
/// To deal out what is in a block takes as long as to look at so many.
const DEALT: usize = 3;

impl Tree {
    /// Looks at up to `budget` blocks. Counts `layout` up when slots change.
    pub(super) fn maintain(&mut self, queue: &mut Queue, budget: usize, layout: &mut u64) -> Maintenance {
        let mut done = Maintenance::default();
        while done.blocks < budget {
            let Some(node) = queue.pop() else { break };
            // The node may have been freed since.
            if self.occupied[node as usize] == 0 || self.is_unculled_leaf(node as usize) {
                continue;
            }
            done.blocks += 1;
            self.tighten(node);
            let mut group = self.neighbours(node);
            group.truncate(1 + (budget - done.blocks) / DEALT);
            let sparse = self.occupied[node as usize].count_ones() <= SPARSE;
            let (overlap, borne) = (group.overlap(), &mut queue.borne[node as usize]);
            if group.nodes().len() < 2 || !sparse && overlap < *borne {
                *borne = (*borne * FORGET).max(OVERLAP);
                continue;
            }
            *borne = overlap * BEAR;
            done.blocks += (group.nodes().len() - 1) * DEALT;
            let leaves = self.levels[node as usize] == 0;
            if let Some(moved) = self.regroup(&group, sparse) {
                *layout += 1;
                done.rehomed += if leaves { moved } else { 0 };
                for &node in group.nodes() {
                    queue.settle(node as usize);
                    if let Some(above) = self.parent(node) {
                        queue.push(above.node());
                    }
                }
            }
        }
        done.waiting = queue.waiting;
        done
    }
}
