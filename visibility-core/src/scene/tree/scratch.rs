//! Scratch memory for moving many objects at once.

use super::slot::{NONE, Slot};
use crate::scene::FAN_OUT;
use crate::{Aabb, ObjectId};
use alloc::vec::Vec;

/// Buffers for moving many objects at once, kept between frames so that frames do not allocate.
#[derive(Clone, Debug)]
pub(in crate::scene) struct Scratch {
    /// Ids and new bounds, relative to the scene's origin, of the objects of a batch of transforms, in batch
    /// order.
    pub(in crate::scene) placed: Vec<(ObjectId, Aabb)>,
    /// Indexed by slot: the last position in the batch at which the slot's object is listed, `NONE` if the
    /// batch does not have the object.
    pub(super) positions: Vec<u32>,
    /// Slot of each object of the batch before the first move, in batch order.
    pub(in crate::scene) slots: Vec<Slot>,
    /// The objects of the batch, sorted by leaf: the position in the batch in the upper 26 bits, the
    /// object's lane in the lower 6.
    pub(super) sorted: Vec<u32>,
    /// Indexed by node: the end, exclusive, of the node's range in `sorted`.
    pub(super) ends: Vec<u32>,
    /// Positions in the batch of the objects that must leave their leaf and be moved one by one.
    pub(in crate::scene) leavers: Vec<u32>,
}

impl Scratch {
    /// Greatest number of objects in a batch: 2^26, since a position in the batch and a lane of 6 bits share
    /// a 32-bit word.
    pub(in crate::scene) const MAX_BATCH: usize = 1 << 26;

    pub(in crate::scene) const EMPTY: Self = Self {
        placed: Vec::new(),
        positions: Vec::new(),
        slots: Vec::new(),
        sorted: Vec::new(),
        ends: Vec::new(),
        leavers: Vec::new(),
    };

    /// Sets the positions for all slots of `nodes` nodes to `NONE` and returns them.
    pub(in crate::scene) fn clear_positions(&mut self, nodes: usize) -> &mut [u32] {
        self.positions.clear();
        self.positions.resize(nodes * FAN_OUT, NONE);
        &mut self.positions
    }

    pub(in crate::scene) fn memory(&self) -> usize {
        size_of_val(&self.placed[..])
            + size_of_val(&self.positions[..])
            + size_of_val(&self.slots[..])
            + size_of_val(&self.sorted[..])
            + size_of_val(&self.ends[..])
            + size_of_val(&self.leavers[..])
    }
}
