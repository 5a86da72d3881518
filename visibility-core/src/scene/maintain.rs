//! Incremental maintenance of the hierarchy while objects move, with a bounded amount of work per call.
//!
//! Moving an object enlarges the bounds of the nodes above it at once, which keeps query results correct. The
//! changed nodes are queued. For each queued node, maintenance tightens the bounds. If the node overlaps its
//! neighbours too much, the contents of a few neighbouring nodes are redistributed among them
//! ([`regroup`](super::tree)). The parents of redistributed nodes are queued in turn.

use super::queue::{MIN_OVERLAP, Queue};
use super::tree::Tree;

/// The work done by a call of [`Scene::maintain`](crate::Scene::maintain).
///
/// ```
/// use visibility_core::{Aabb, Scene};
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
/// scene.set_bounds(id, Aabb::from_arrays([2.0; 3], [3.0; 3]))?;
/// assert_eq!(scene.maintain(8).budget_used, 1);
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[non_exhaustive]
pub struct Maintenance {
    /// Part of the budget that was used: 1 for each inspected node, and 3 for each further node whose
    /// contents were redistributed.
    pub budget_used: usize,
    /// Number of objects that were moved to another leaf.
    pub rehomed: usize,
    /// Number of nodes still queued for inspection.
    pub waiting: usize,
}

/// After an attempt to redistribute the contents of a node and its neighbours has failed, the next attempt
/// waits until the neighbours overlap the node by at least this multiple of the overlap at the failed
/// attempt.
const RETRY_FACTOR: f32 = 1.5;
/// Factor by which the overlap limit of a node, the overlap that the next attempt waits for (see
/// [`RETRY_FACTOR`]), shrinks at each inspection without an attempt. So a node whose surroundings have
/// changed is tried again after a while.
const RETRY_DECAY: f32 = 0.97;
/// Greatest number of occupied lanes, of 64, at which a node is merged with its nearest neighbours if they
/// have free lanes.
const MERGE_BELOW: u32 = 32;
/// Cost of redistributing the contents of one node, in units of inspecting one node (measured).
const REGROUP_COST: usize = 3;

impl Tree {
    /// Inspects queued nodes until `budget` is used or the queue is empty. Increments `layout` for each
    /// redistribution, which changes slots. See [`Scene::maintain`](crate::Scene::maintain).
    pub(super) fn maintain(&mut self, queue: &mut Queue, budget: usize, layout: &mut u64) -> Maintenance {
        let mut done = Maintenance::default();
        while done.budget_used < budget {
            let Some(node) = queue.pop() else { break };
            // The node may have been freed since it was queued.
            if self.occupied[node as usize] == 0 || self.is_unculled_leaf(node as usize) {
                continue;
            }
            done.budget_used += 1;
            // Cheap work first: bounds as tight as they can be without moving objects.
            self.tighten(node);
            self.lower(node);
            // Redistributing nodes costs more. It is tried if neighbours overlap more than at the last failed
            // attempt, or if few objects are left in the node. The limit decays, so that a node whose
            // surroundings have changed is tried again.
            let mut group = self.neighbours(node);
            group.truncate(1 + (budget - done.budget_used) / REGROUP_COST);
            let sparse = self.occupied[node as usize].count_ones() <= MERGE_BELOW;
            let (overlap, overlap_limit) = (group.overlap(), &mut queue.overlap_limits[node as usize]);
            if group.nodes().len() < 2 || !sparse && overlap < *overlap_limit {
                *overlap_limit = (*overlap_limit * RETRY_DECAY).max(MIN_OVERLAP);
                continue;
            }
            *overlap_limit = overlap * RETRY_FACTOR;
            done.budget_used += (group.nodes().len() - 1) * REGROUP_COST;
            let leaves = self.levels[node as usize] == 0;
            if let Some(moved) = self.regroup(&group, sparse) {
                *layout += 1;
                done.rehomed += if leaves { moved } else { 0 };
                // The children of the nodes above have new bounds and may overlap less now, so the nodes
                // above are queued.
                for &node in group.nodes() {
                    queue.remove_regrouped(node as usize);
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
