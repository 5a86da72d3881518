//! The front: cells that are candidates for projection, least solid first, first come first served among equals.
//!
//! A heap of four children a node that knows where each cell is in it, so that a cell whose solidity changes is moved. The bench `plp` holds it
//! against a binary heap with lazy deletion, in which such a cell is entered once more.

use alloc::vec::Vec;

/// Children of a node.
const CHILDREN: usize = 4;

/// The place of what is not in the front.
const NOWHERE: u32 = u32::MAX;

/// A priority queue of cells. It remembers four bytes for each up to the greatest that it ever held.
///
/// ```
/// use visibility_plp::Front;
/// let mut front = Front::default();
/// front.push(0.5, 1);
/// front.push(0.25, 2);
/// front.push(0.25, 3);
/// front.push(0.1, 1);
/// assert_eq!([front.pop(), front.pop(), front.pop(), front.pop()], [Some(1), Some(2), Some(3), None]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Front {
    /// Solidity with ticket, and cell. No entry comes before the one above it, at its place less one over [`CHILDREN`].
    heap: Vec<(u64, u32)>,
    /// By cell, its place in the heap.
    places: Vec<u32>,
    tickets: u32,
}

impl Front {
    /// Empties it.
    pub fn clear(&mut self) {
        for (_, cell) in self.heap.drain(..) {
            self.places[cell as usize] = NOWHERE;
        }
        self.tickets = 0;
    }

    /// Adds a cell, or moves one that is in it, behind all of equal solidity. Negative solidity counts as none, NaN as the greatest.
    #[inline]
    pub fn push(&mut self, solidity: f32, cell: u32) {
        // The bits of floats that are not negative are in their order.
        let bits = if solidity >= 0.0 {
            (solidity + 0.0).to_bits()
        } else if solidity < 0.0 {
            0
        } else {
            u32::MAX
        };
        let key = u64::from(bits) << 32 | u64::from(self.tickets);
        self.tickets = self.tickets.wrapping_add(1);
        if cell as usize >= self.places.len() {
            self.places.resize(cell as usize + 1, NOWHERE);
        }
        let place = self.places[cell as usize];
        if place == NOWHERE {
            self.heap.push((key, cell));
            self.rise(self.heap.len() - 1, (key, cell));
        } else if key < self.heap[place as usize].0 {
            self.rise(place as usize, (key, cell));
        } else {
            self.sink(place as usize, (key, cell));
        }
    }

    /// The least solidity in it; none if it is empty.
    #[inline]
    pub fn least(&self) -> Option<f32> {
        self.heap.first().map(|entry| f32::from_bits((entry.0 >> 32) as u32))
    }

    /// Takes out the least solid cell, the first that came among equals.
    #[inline]
    pub fn pop(&mut self) -> Option<u32> {
        let &(_, cell) = self.heap.first()?;
        self.places[cell as usize] = NOWHERE;
        let last = self.heap.pop()?;
        if !self.heap.is_empty() {
            self.sink(0, last);
        }
        Some(cell)
    }

    /// Moves what is above a place down as far as the entry must come before it.
    #[inline]
    fn rise(&mut self, mut place: usize, entry: (u64, u32)) {
        while place > 0 {
            let above = (place - 1) / CHILDREN;
            let other = self.heap[above];
            if other.0 <= entry.0 {
                break;
            }
            self.put(place, other);
            place = above;
        }
        self.put(place, entry);
    }

    /// Moves what is below a place up as long as it must come before the entry.
    #[inline]
    fn sink(&mut self, mut place: usize, entry: (u64, u32)) {
        loop {
            let first = place * CHILDREN + 1;
            let below = self.heap.len().saturating_sub(first).min(CHILDREN);
            let Some(least) = (first..first + below).min_by_key(|&child| self.heap[child].0) else { break };
            let other = self.heap[least];
            if entry.0 <= other.0 {
                break;
            }
            self.put(place, other);
            place = least;
        }
        self.put(place, entry);
    }

    /// Writes an entry to a place, and where it is now.
    #[inline]
    fn put(&mut self, place: usize, entry: (u64, u32)) {
        self.heap[place] = entry;
        self.places[entry.1 as usize] = place as u32;
    }

    /// How many cells are in it.
    pub fn len(&self) -> usize {
        self.heap.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.heap.is_empty()
    }
}
