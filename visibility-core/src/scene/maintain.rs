//! Keeping the hierarchy in shape while objects move, a bounded amount of work at a time.
//!
//! Moving an object enlarges bounds at once, since answers must stay right, but never shrinks them. What else should
//! happen waits in a queue of nodes to look at: bounds are tightened, and objects that have strayed from their neighbours
//! are given a new home, as in the forced reinsertion of Beckmann et al., "The R*-tree", 1990.

use super::boxes64::lanes;
use super::tree::{Slot, Tree};
use alloc::vec::Vec;
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
    /// Objects that were taken out and put where they fit best. Making room for them may have moved others too.
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
    /// Looks at up to `budget` blocks. Slots have changed if any object was re-homed.
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
                homeless.push((self.bounds[slot.node()].get(lane), self.payload(slot)));
                self.remove(slot);
            }
            done.rehomed += homeless.len();
            for (bounds, payload) in homeless {
                self.insert(&bounds, payload);
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
        // Column by column, so that it compiles to SIMD: most blocks have no stray, and saying so should cost little.
        let taken: [f32; 64] = core::array::from_fn(|lane| (occupied >> lane & 1) as f32);
        let c = &self.bounds[leaf].coordinates;
        let mut distance = [0.0f32; 64];
        for axis in 0..3 {
            let mut center = [0.0f32; 64];
            for lane in 0..64 {
                let middle = c[axis][lane] * 0.5 + c[axis + 3][lane] * 0.5;
                center[lane] = if taken[lane] > 0.0 { middle } else { 0.0 };
            }
            let mean = sum(&center) / count as f32;
            for lane in 0..64 {
                distance[lane] += (center[lane] - mean).abs() * taken[lane];
            }
        }
        let limit = STRAY * sum(&distance) / count as f32;
        (0..64).fold(0, |mask, lane| mask | u64::from(distance[lane] > limit) << lane)
    }
}

/// In sixteen columns, then those: a fixed order, on every processor.
fn sum(values: &[f32; 64]) -> f32 {
    let mut columns = [0.0f32; 16];
    for chunk in values.chunks_exact(16) {
        for (column, &value) in columns.iter_mut().zip(chunk) {
            *column += value;
        }
    }
    columns.into_iter().sum()
}
