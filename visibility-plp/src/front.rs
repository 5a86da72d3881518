//! The front: a priority queue of the cells that are candidates for projection, least solidity first.
//!
//! A heap with four children per node that stores the heap index of each cell, so that a cell whose solidity
//! changes is moved within the heap. A binary heap with lazy deletion, which inserts such a cell a second
//! time, took twice the time for the same operations.

use alloc::vec::Vec;

/// Number of children of a heap node.
const CHILDREN: usize = 4;

/// Heap index that stands for a cell that is not in the front.
const NOT_QUEUED: u32 = u32::MAX;

/// Priority queue of cells by solidity, least first, each cell at most once. Among cells of equal solidity
/// the cell pushed first comes out first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Front {
    /// Key and cell of each heap node. The parent of node i is node (i - 1) / [`CHILDREN`] and has no
    /// greater key. The high 32 bits of a key are those of the solidity, the low 32 bits the number of
    /// pushes before.
    heap: Vec<(u64, u32)>,
    /// Index in `heap` of each cell, by cell number; [`NOT_QUEUED`] for cells not in the front.
    heap_indices: Vec<u32>,
    /// Number of pushes since the last [`clear`](Self::clear), wrapping at 2^32. Each push uses the number
    /// as the low 32 bits of the cell's key in `heap`, so that among cells of equal solidity the one
    /// pushed first has the least key.
    tickets: u32,
}

impl Front {
    /// Reserves capacity for the cells numbered 0 to `cells` (exclusive), so that no later operation on those
    /// cells allocates.
    pub(crate) fn reserve(&mut self, cells: usize) {
        self.heap.reserve(cells.saturating_sub(self.heap.len()));
        if self.heap_indices.len() < cells {
            self.heap_indices.resize(cells, NOT_QUEUED);
        }
    }

    /// Removes all cells from the front. Keeps the capacity.
    pub(crate) fn clear(&mut self) {
        for (_, cell) in self.heap.drain(..) {
            self.heap_indices[cell as usize] = NOT_QUEUED;
        }
        self.tickets = 0;
    }

    /// Inserts a cell into the front, or gives a cell of the front a new solidity. The cell goes behind all
    /// cells of equal solidity. Negative solidity counts as 0, NaN as greater than any number. O(log n).
    #[inline]
    pub(crate) fn push(&mut self, solidity: f32, cell: u32) {
        // The bit patterns of floats that are not negative have the order of the floats.
        let bits = if solidity >= 0.0 {
            (solidity + 0.0).to_bits()
        } else if solidity < 0.0 {
            0
        } else {
            u32::MAX
        };
        let key = u64::from(bits) << 32 | u64::from(self.tickets);
        self.tickets = self.tickets.wrapping_add(1);
        if cell as usize >= self.heap_indices.len() {
            self.heap_indices.resize(cell as usize + 1, NOT_QUEUED);
        }
        let index = self.heap_indices[cell as usize];
        if index == NOT_QUEUED {
            self.heap.push((key, cell));
            self.rise(self.heap.len() - 1, (key, cell));
        } else if key < self.heap[index as usize].0 {
            self.rise(index as usize, (key, cell));
        } else {
            self.sink(index as usize, (key, cell));
        }
    }

    /// Returns the solidity of the cell that [`pop`](Self::pop) returns next; NaN if that cell was pushed
    /// with NaN. `None` if the front is empty.
    #[inline]
    pub(crate) fn least(&self) -> Option<f32> {
        self.heap.first().map(|entry| f32::from_bits((entry.0 >> 32) as u32))
    }

    /// Removes and returns the cell with the least solidity; the earliest push among equals. `None` if the
    /// front is empty. O(log n).
    #[inline]
    pub(crate) fn pop(&mut self) -> Option<u32> {
        let &(_, cell) = self.heap.first()?;
        self.heap_indices[cell as usize] = NOT_QUEUED;
        let last = self.heap.pop()?;
        if !self.heap.is_empty() {
            self.sink(0, last);
        }
        Some(cell)
    }

    /// Writes an entry (key and cell) to heap index `index` or to an ancestor of it, moving parents with
    /// greater keys down.
    #[inline]
    fn rise(&mut self, mut index: usize, entry: (u64, u32)) {
        while index > 0 {
            let above = (index - 1) / CHILDREN;
            let other = self.heap[above];
            if other.0 <= entry.0 {
                break;
            }
            self.put(index, other);
            index = above;
        }
        self.put(index, entry);
    }

    /// Writes an entry (key and cell) to heap index `index` or to a descendant of it, moving children with
    /// smaller keys up.
    #[inline]
    fn sink(&mut self, mut index: usize, entry: (u64, u32)) {
        loop {
            let first = index * CHILDREN + 1;
            let below = self.heap.len().saturating_sub(first).min(CHILDREN);
            let Some(least) = (first..first + below).min_by_key(|&child| self.heap[child].0) else { break };
            let other = self.heap[least];
            if entry.0 <= other.0 {
                break;
            }
            self.put(index, other);
            index = least;
        }
        self.put(index, entry);
    }

    /// Writes an entry (key and cell) at a heap index and records that index for the cell.
    #[inline]
    fn put(&mut self, index: usize, entry: (u64, u32)) {
        self.heap[index] = entry;
        self.heap_indices[entry.1 as usize] = index as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_exact::{Random, RandomExact};
    use std::vec;

    #[test]
    fn the_least_solid_cell_comes_first_and_equals_in_turn() {
        let mut front = Front::default();
        for (solidity, cell) in [(0.5, 1), (0.25, 2), (0.25, 3), (f32::NAN, 5), (-1.0, 4), (0.1, 1)] {
            front.push(solidity, cell);
        }
        assert_eq!(front.least(), Some(0.0), "a negative solidity counts as 0");
        let order: Vec<_> = core::iter::from_fn(|| front.pop()).collect();
        assert_eq!(order, [4, 1, 2, 3, 5], "cells by solidity, equal ones in their order");
        assert_eq!(front.least(), None, "an empty front");
    }

    /// Under random pushes, changes of solidity and pops, the front gives the answers of a list that is
    /// searched linearly.
    #[test]
    fn cells_may_move_both_ways() {
        let mut random = Random(17);
        let mut front = Front::default();
        let mut list: Vec<(f32, u32, u32)> = vec![];
        for ticket in 0..20_000 {
            let (cell, solidity) = (random.whole(100).unsigned_abs() as u32, random.whole(30).abs() as f32);
            front.push(solidity, cell);
            list.retain(|entry| entry.2 != cell);
            list.push((solidity, ticket, cell));
            if random.whole(5) > 1 {
                let least = list.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                assert_eq!(
                    front.least(),
                    least.map(|entry| entry.0),
                    "the least solidity after push {ticket}"
                );
                assert_eq!(
                    front.pop(),
                    least.map(|entry| entry.2),
                    "the cell of least solidity after push {ticket}"
                );
                list.retain(|entry| Some(*entry) != least);
            }
        }
        front.clear();
        assert_eq!(front.pop(), None, "a cleared front");
    }
}
