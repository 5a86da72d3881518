//! The queue of hierarchy nodes that changed and wait for maintenance.

use crate::bits::Bits;
use alloc::vec::Vec;

/// Least overlap at which a node's group is redistributed: the sum, over the neighbours, of the fraction of
/// the node's bounds that each covers. Nodes of a newly built hierarchy come close to this value, since the
/// bounds of objects overlap too.
pub(super) const MIN_OVERLAP: f32 = 1.0;

/// Queue of nodes that wait for maintenance, one bit per node. Nodes are taken out by ascending number,
/// beginning again at 0 after the last.
#[derive(Clone, Debug, Default)]
pub(super) struct Queue {
    queued: Bits,
    /// Number of queued nodes.
    pub(super) waiting: usize,
    /// Number of the node from which the search for the next queued node starts.
    next: usize,
    /// Indexed by node: the overlap below which redistributing the node's group is not attempted, raised
    /// when an attempt did not help.
    pub(super) overlap_limits: Vec<f32>,
}

impl Queue {
    /// Queues a node. Does nothing if the node is queued already.
    pub(super) fn push(&mut self, node: usize) {
        self.queued.grow(node + 1);
        if self.overlap_limits.len() <= node {
            self.overlap_limits.resize(node + 1, MIN_OVERLAP);
        }
        self.waiting += usize::from(self.queued.insert(node));
    }

    /// Takes a node out of the queue. Does nothing if the node is not queued.
    pub(super) fn remove(&mut self, node: usize) {
        self.waiting -= usize::from(self.queued.remove(node));
    }

    /// Removes a node from the queue after its contents were redistributed, and resets its overlap limit to
    /// [`MIN_OVERLAP`].
    pub(super) fn remove_regrouped(&mut self, node: usize) {
        self.remove(node);
        if let Some(overlap_limits) = self.overlap_limits.get_mut(node) {
            *overlap_limits = MIN_OVERLAP;
        }
    }

    /// Takes the next node out of the queue; `None` if the queue is empty.
    pub(super) fn pop(&mut self) -> Option<u32> {
        if self.waiting == 0 {
            return None;
        }
        let node = self.queued.next(self.next).or_else(|| self.queued.next(0))?;
        self.remove(node);
        self.next = node + 1;
        Some(node as u32)
    }

    pub(super) fn memory(&self) -> usize {
        self.queued.memory() + size_of_val(&self.overlap_limits[..])
    }

    pub(super) fn clear(&mut self) {
        (self.waiting, self.next) = (0, 0);
        self.queued.clear();
        self.overlap_limits.fill(MIN_OVERLAP);
    }
}
