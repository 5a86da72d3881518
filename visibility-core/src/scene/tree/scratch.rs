//! Memory that moving many objects at once takes.

use super::slot::Slot;
use alloc::vec::Vec;

/// What moving many objects needs for a while, kept so that no frame allocates.
#[derive(Clone, Debug)]
pub(in crate::scene) struct Scratch {
    /// Where each object that moves was when all were looked up.
    pub(in crate::scene) slots: Vec<Slot>,
    /// Places in the batch and lanes, by leaf.
    pub(super) sorted: Vec<u32>,
    /// By node, where its part of `sorted` ends.
    pub(super) ends: Vec<u32>,
    /// Places in the batch of those who must be moved one by one.
    pub(in crate::scene) left: Vec<u32>,
}

impl Scratch {
    /// A place in the batch and a lane fill a word.
    pub(in crate::scene) const MOST: usize = 1 << 26;

    pub(in crate::scene) const EMPTY: Self =
        Self { slots: Vec::new(), sorted: Vec::new(), ends: Vec::new(), left: Vec::new() };

    pub(in crate::scene) fn memory(&self) -> usize {
        size_of_val(&self.slots[..])
            + size_of_val(&self.sorted[..])
            + size_of_val(&self.ends[..])
            + size_of_val(&self.left[..])
    }
}
