//! Keeping the hierarchy in shape while objects move, a bounded amount of work at a time.
//!
//! Moving an object enlarges bounds at once, since answers must stay right. What else should happen waits in
//! a queue of nodes to look at: their bounds are tightened, and where they have come to lie across one
//! another, what is in a few neighbours is dealt out among them anew ([`regroup`](super::tree)). Nodes above
//! whose content was changed are queued in their turn.

use super::queue::{OVERLAP, Queue};
use super::tree::Tree;

/// What a call of [`Scene::maintain`](crate::Scene::maintain) did.
///
/// ```
/// use visibility_core::{Aabb, Scene};
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
/// scene.set_bounds(id, Aabb::from_arrays([2.0; 3], [3.0; 3]))?;
/// assert_eq!(scene.maintain(8).blocks, 1);
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Maintenance {
    /// Blocks of up to 64 objects that were looked at. One whose objects were dealt out anew counts as
    /// three.
    pub blocks: usize,
    /// Objects that were put into another block.
    pub rehomed: usize,
    /// Blocks that still wait to be looked at.
    pub waiting: usize,
}

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
