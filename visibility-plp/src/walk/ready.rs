//! Objects that a walk has looked up and not kept yet, highest priority first.

use alloc::collections::BinaryHeap;
use visibility_core::ObjectId;

/// Priority queue of objects, highest priority first. Among objects of equal priority the one pushed first
/// comes out first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ready {
    /// Key and object. The high 32 bits of a key are those of the priority, the low 32 bits the inverted
    /// number of pushes before, so that among objects of equal priority the one pushed first has the greatest
    /// key.
    heap: BinaryHeap<(u64, ObjectId)>,
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
        self.heap.push((u64::from(bits) << 32 | u64::from(!self.tickets), id));
        self.tickets = self.tickets.wrapping_add(1);
    }

    /// Returns the object of the highest priority with that priority, if the priority is at least `bound`.
    /// `None` for a `bound` of NaN.
    #[inline]
    pub(crate) fn peek(&self, bound: f32) -> Option<(ObjectId, f32)> {
        let &(key, id) = self.heap.peek()?;
        let priority = f32::from_bits((key >> 32) as u32);
        (priority >= bound).then_some((id, priority))
    }

    /// Removes and returns the object of the highest priority. O(log n).
    #[inline]
    pub(crate) fn pop(&mut self) -> Option<ObjectId> {
        self.heap.pop().map(|entry| entry.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;
    use visibility_core::{Aabb, Scene};

    #[test]
    fn the_highest_priority_comes_first_and_equals_in_turn() {
        let mut scene = Scene::new();
        let ids = scene.insert_batch((0..6).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 1.0; 3])));
        let mut ready = Ready::default();
        for round in 0..2 {
            ready.clear(6);
            for (priority, id) in [0.5, 0.25, 0.5, f32::NAN, 0.75, -1.0].into_iter().zip(&ids) {
                ready.push(priority, *id);
            }
            assert_eq!(ready.peek(0.75), Some((ids[4], 0.75)), "round {round}: an object at the bound");
            assert_eq!(ready.peek(0.8), None, "round {round}: no object above the bound");
            assert_eq!(ready.peek(f32::NAN), None, "round {round}: a bound of NaN");
            let order: Vec<_> = core::iter::from_fn(|| ready.pop()).collect();
            assert_eq!(order, [4, 0, 2, 1, 3, 5].map(|i| ids[i]), "round {round}: by priority, then in turn");
        }
    }
}
