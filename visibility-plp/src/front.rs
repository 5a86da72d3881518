//! The front: cells that are candidates for projection, least solid first, first come first served among equals.
//!
//! A binary heap with lazy deletion: a cell whose solidity changes is entered once more, and what the walk finds outdated it passes over.

use alloc::collections::BinaryHeap;
use core::cmp::Reverse;

/// A priority queue of cells.
///
/// ```
/// use visibility_plp::Front;
/// let mut front = Front::default();
/// front.push(0.5, 1);
/// front.push(0.25, 2);
/// front.push(0.25, 3);
/// assert_eq!([front.pop(), front.pop(), front.pop(), front.pop()].map(|entry| entry.map(|e| e.cell)), [Some(2), Some(3), Some(1), None]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Front {
    /// Solidity, then ticket, then cell.
    heap: BinaryHeap<Reverse<(u64, u32)>>,
    tickets: u32,
}

/// A cell in the front.
///
/// ```
/// let mut front = visibility_plp::Front::default();
/// let ticket = front.push(0.5, 7);
/// assert_eq!(front.pop(), Some(visibility_plp::Entry { cell: 7, ticket }));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Entry {
    /// The cell.
    pub cell: u32,
    /// What [`Front::push`] returned for it.
    pub ticket: u32,
}

impl Front {
    /// Empties it.
    pub fn clear(&mut self) {
        self.heap.clear();
        self.tickets = 0;
    }

    /// Adds a cell, also one that is in it already. Negative solidity counts as none, NaN as the greatest. Returns a ticket by which the
    /// caller knows the newest entry of a cell from older ones.
    #[inline]
    pub fn push(&mut self, solidity: f32, cell: u32) -> u32 {
        let ticket = self.tickets;
        // The bits of floats that are not negative are in their order.
        let bits = if solidity >= 0.0 {
            (solidity + 0.0).to_bits()
        } else if solidity < 0.0 {
            0
        } else {
            u32::MAX
        };
        self.heap.push(Reverse((u64::from(bits) << 32 | u64::from(ticket), cell)));
        self.tickets = ticket.wrapping_add(1);
        ticket
    }

    /// Takes out the least solid cell, the first that came among equals.
    #[inline]
    pub fn pop(&mut self) -> Option<Entry> {
        let Reverse((key, cell)) = self.heap.pop()?;
        Some(Entry { cell, ticket: key as u32 })
    }

    /// The cells in the front in no order, outdated entries included.
    pub fn entries(&self) -> impl Iterator<Item = Entry> + '_ {
        self.heap.iter().map(|Reverse((key, cell))| Entry { cell: *cell, ticket: *key as u32 })
    }

    /// How many entries there are.
    pub fn len(&self) -> usize {
        self.heap.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.heap.is_empty()
    }
}
