//! The queue of movers that have motion volumes, ordered by the deadline of each volume.

use alloc::collections::BinaryHeap;
use core::cmp::Ordering;

/// A heap of the deadlines of motion volumes, the earliest on top. The entry of a volume that no longer
/// exists stays until its deadline, or until a push finds the heap at least twice as long as the list of
/// movers.
#[derive(Clone, Debug)]
pub(super) struct Deadlines {
    heap: BinaryHeap<Entry>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    deadline: f64,
    place: u32,
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        // The order is reversed, since `BinaryHeap` has the greatest entry on top.
        other.deadline.total_cmp(&self.deadline).then(other.place.cmp(&self.place))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Entry {}

impl Deadlines {
    pub(super) const fn new() -> Self {
        Self { heap: BinaryHeap::new() }
    }

    /// Reserves memory for as many entries as [`push`](Self::push) keeps for `movers` movers, so that it need
    /// not allocate.
    pub(super) fn reserve(&mut self, movers: usize) {
        self.heap.reserve((2 * movers + 1).saturating_sub(self.heap.len()));
    }

    /// Adds the deadline of a mover that got a volume. `place` is the position of the mover in the list of
    /// movers, whose length is `movers`. `is_current` must return whether the mover at a position has a
    /// volume now, with the given deadline. Takes logarithmic time, amortized.
    pub(super) fn push(
        &mut self,
        deadline: f64,
        place: u32,
        movers: usize,
        is_current: impl Fn(f64, u32) -> bool,
    ) {
        if self.heap.len() >= 2 * movers {
            self.heap.retain(|entry| is_current(entry.deadline, entry.place));
        }
        self.heap.push(Entry { deadline, place });
    }

    /// Removes the earliest entry whose volume still exists and whose deadline is before `time`, and returns
    /// the position of its mover in the list of movers. `None` if there is none. `is_current` is as for
    /// [`push`](Self::push).
    pub(super) fn pop_before(&mut self, time: f64, is_current: impl Fn(f64, u32) -> bool) -> Option<u32> {
        while self.heap.peek().is_some_and(|entry| entry.deadline < time) {
            if let Some(entry) = self.heap.pop().filter(|entry| is_current(entry.deadline, entry.place)) {
                return Some(entry.place);
            }
        }
        None
    }
}
