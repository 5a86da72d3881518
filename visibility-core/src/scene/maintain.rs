//! Keeping the hierarchy in shape while objects move, a bounded amount of work at a time.
//!
//! Moving an object enlarges bounds at once, since answers must stay right, but never shrinks them. What else should
//! happen waits in a queue of nodes to look at: bounds are tightened, and objects that have strayed from their neighbours
//! are given a new home, as in the forced reinsertion of Beckmann et al., "The R*-tree", 1990.

use super::boxes64::lanes;
use super::tree::{Slot, Tree};
use alloc::vec::Vec;
use glam::Vec3;
use smallvec::SmallVec;

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
    /// Blocks of up to 64 objects that were looked at.
    pub blocks: usize,
    /// Objects that were moved to another block.
    pub rehomed: usize,
    /// Blocks that still wait to be looked at.
    pub waiting: usize,
}

/// Leaves that wait to be looked at, each once, first come first served.
#[derive(Clone, Debug, Default)]
pub(super) struct Queue {
    nodes: Vec<u32>,
    /// Where the next one is taken from.
    head: usize,
    /// A bit per node: whether it is in the queue.
    queued: Vec<u64>,
}

impl Queue {
    pub(super) fn push(&mut self, node: usize) {
        let (word, bit) = (node / 64, 1 << (node % 64));
        if word >= self.queued.len() {
            self.queued.resize(word + 1, 0);
        }
        if self.queued[word] & bit == 0 {
            self.queued[word] |= bit;
            self.nodes.push(node as u32);
        }
    }

    fn pop(&mut self) -> Option<u32> {
        let node = *self.nodes.get(self.head)?;
        self.queued[node as usize / 64] &= !(1 << (node % 64));
        self.head += 1;
        // Once most of the list is behind the head, the rest moves to the front: constant time on average, no growth.
        if self.head * 2 > self.nodes.len() {
            self.nodes.drain(..self.head);
            self.head = 0;
        }
        Some(node)
    }

    fn len(&self) -> usize {
        self.nodes.len() - self.head
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.queued[..])
    }

    pub(super) fn clear(&mut self) {
        self.nodes.clear();
        self.head = 0;
        self.queued.fill(0);
    }
}

/// An object strays when its centre is this many times as far from the mean centre of its block as the others are on average.
const STRAY: f32 = 3.0;
/// A block with fewer objects is dissolved.
const SPARSE: u32 = 8;

impl Tree {
    /// Looks at up to `budget` blocks. Whether any object changed its slot is in `rehomed`.
    pub(super) fn maintain(&mut self, queue: &mut Queue, budget: usize) -> Maintenance {
        let mut done = Maintenance::default();
        while done.blocks < budget {
            let Some(leaf) = queue.pop() else { break };
            // The node may have been freed since, and used again higher up.
            if self.occupied[leaf as usize] == 0 || self.levels[leaf as usize] > 0 {
                continue;
            }
            done.blocks += 1;
            let strays = self.strays(leaf);
            // All leave before the first returns, or a block to be dissolved would attract its own objects.
            let mut homeless = SmallVec::<[_; 64]>::new();
            for lane in lanes(strays) {
                let slot = Slot::new(leaf, lane);
                homeless.push((slot, self.bounds[slot.node()].get(lane), self.payload(slot)));
                self.remove(slot);
            }
            for (slot, bounds, payload) in homeless {
                self.insert(&bounds, payload);
                done.rehomed += usize::from(self.slots[payload.id.index()] != slot);
            }
            if self.occupied[leaf as usize] != 0 && self.levels[leaf as usize] == 0 {
                self.tighten(leaf);
            }
        }
        done.waiting = queue.len();
        done
    }

    /// The lanes of a leaf whose objects would better live elsewhere.
    fn strays(&self, leaf: u32) -> u64 {
        let leaf = leaf as usize;
        let occupied = self.occupied[leaf];
        let count = occupied.count_ones();
        if leaf as u32 == self.root {
            return 0;
        }
        if count < SPARSE {
            return occupied;
        }
        let mut mean = Vec3::ZERO;
        for lane in lanes(occupied) {
            mean += self.bounds[leaf].get(lane).center() / count as f32;
        }
        let distance = |lane: usize| (self.bounds[leaf].get(lane).center() - mean).abs().element_sum();
        let average = lanes(occupied).map(distance).sum::<f32>() / count as f32;
        lanes(occupied)
            .filter(|&lane| distance(lane) > STRAY * average)
            .fold(0, |mask, lane| mask | 1 << lane)
    }
}
