//! Objects that a walk has looked up and not kept yet, highest priority first.

use alloc::collections::BinaryHeap;
use core::cmp::Reverse;
use visibility_core::ObjectId;

/// Priority queue of objects, highest priority first. Among objects of equal priority the one pushed first
/// comes out first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ready {
    /// Bits of the priority, number of pushes before, and object.
    heap: BinaryHeap<(u32, Reverse<u32>, ObjectId)>,
    /// Number of pushes since the last [`clear`](Self::clear), wrapping at 2^32.
    tickets: u32,
}

impl Ready {
    /// Removes all objects, and reserves capacity for `count` objects.
    pub(crate) fn clear(&mut self, count: usize) {
        self.heap.clear();
        self.heap.reserve(count);
        self.tickets = 0;
    }

    /// Inserts an object. A priority that is NaN or not positive counts as 0.
    #[inline]
    pub(crate) fn push(&mut self, priority: f32, id: ObjectId) {
        // The bit patterns of floats that are not negative have the order of the floats.
        let bits = priority.max(0.0).to_bits();
        self.heap.push((bits, Reverse(self.tickets), id));
        self.tickets = self.tickets.wrapping_add(1);
    }

    /// Returns the object of the highest priority with that priority, if the priority is at least `bound`.
    /// `None` for a `bound` of NaN.
    #[inline]
    pub(crate) fn peek(&self, bound: f32) -> Option<(ObjectId, f32)> {
        let &(bits, _, id) = self.heap.peek()?;
        let priority = f32::from_bits(bits);
        (priority >= bound).then_some((id, priority))
    }

    /// Removes and returns the object of the highest priority. O(log n).
    #[inline]
    pub(crate) fn pop(&mut self) -> Option<ObjectId> {
        self.heap.pop().map(|entry| entry.2)
    }
}
