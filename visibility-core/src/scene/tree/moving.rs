//! Moving objects within the tree, one at a time or many at once, leaf by leaf.

use super::{NONE, Scratch, Slot, Tree};
use crate::scene::FAN_OUT;
use crate::scene::queue::Queue;
use crate::{Aabb, ObjectId};

impl Tree {
    /// Sets the bounds of the object in a slot of the tree, and enlarges the bounds of the nodes above as
    /// necessary. `bounds` must be finite. Returns true if the bounds were set.
    ///
    /// Returns false and changes nothing if the centre of `bounds` is outside of the leaf's bounds by more
    /// than the size of the leaf's bounds. The object would then stretch all nodes above, so it should be
    /// inserted anew.
    pub(in crate::scene) fn move_within(&mut self, slot: Slot, bounds: &Aabb) -> bool {
        let Some(above) = self.parent(slot.node() as u32) else {
            self.bounds[slot.node()].set(slot.lane(), bounds);
            self.raise_to_object(slot);
            return true;
        };
        let home = self.bounds_in(above);
        if is_far(&home, bounds) {
            return false;
        }
        self.bounds[slot.node()].set(slot.lane(), bounds);
        self.raise_to_object(slot);
        let new = home.union(bounds);
        if new != home {
            self.bounds[above.node()].set(above.lane(), &new);
            self.grow(above.node() as u32, bounds);
        }
        true
    }

    /// Loads the boxes in the given slots into the cache. The processor waits for many cache misses at once,
    /// whereas moving one object after the other would wait for each.
    pub(in crate::scene) fn fetch(&self, slots: &[Slot]) {
        let mut sum = 0u32;
        for &slot in slots {
            for row in &self.bounds[slot.node()].coordinates {
                sum = sum.wrapping_add(row[slot.lane()].to_bits());
            }
        }
        core::hint::black_box(sum);
    }

    /// Moves many objects within their leaves, leaf by leaf, and makes the bounds above as tight as possible.
    /// `moved` has at most [`Scratch::MAX_BATCH`] elements, and `scratch.slots` holds the slot of each. An
    /// element that would take its object out of its leaf is left out, and so are later elements for the same
    /// object: their positions in `moved` are written to `scratch.leavers`, ascending for each object.
    /// Changed leaves are queued for maintenance.
    pub(in crate::scene) fn move_batch_by_leaf(
        &mut self,
        moved: &[(ObjectId, Aabb)],
        scratch: &mut Scratch,
        queue: &mut Queue,
    ) {
        let Scratch { slots, sorted, ends, leavers, .. } = scratch;
        // Counting sort of the batch by leaf: counts per leaf, then starts, then each object's position in
        // `moved` with its lane. Afterwards `ends` holds the end of each leaf's range.
        ends.clear();
        ends.resize(self.node_count(), 0);
        for slot in slots.iter() {
            ends[slot.node()] += 1;
        }
        let mut start = 0;
        for end in ends.iter_mut() {
            start += core::mem::replace(end, start);
        }
        sorted.clear();
        sorted.resize(slots.len(), 0);
        for (position, slot) in slots.iter().enumerate() {
            let end = &mut ends[slot.node()];
            sorted[*end as usize] = (position * FAN_OUT + slot.lane()) as u32;
            *end += 1;
        }

        leavers.clear();
        let mut start = 0;
        let mut grown = NONE;
        for (leaf, &end) in ends.iter().enumerate() {
            let leaf_batch = &sorted[core::mem::replace(&mut start, end as usize)..end as usize];
            if leaf_batch.is_empty() {
                continue;
            }
            if self.is_unculled_leaf(leaf) {
                leavers.extend(leaf_batch.iter().map(|&word| word / FAN_OUT as u32));
                continue;
            }
            // `home` is the leaf's box, as stored in its parent before the moves. An object that moves far
            // from this box leaves the leaf.
            let above = self.parent(leaf as u32);
            let home = above.map(|above| self.bounds_in(above));
            // Lanes of objects that must leave, one bit each. If the batch lists such an object twice, the
            // later element must not move it either.
            let mut leaving = 0u64;
            for &word in leaf_batch {
                let (position, lane) = (word / FAN_OUT as u32, word % FAN_OUT as u32);
                let bounds = &moved[position as usize].1;
                let leaves_home =
                    !bounds.is_finite() || home.as_ref().is_some_and(|home| is_far(home, bounds));
                leaving |= u64::from(leaves_home) << lane;
                if leaving >> lane & 1 != 0 {
                    leavers.push(position);
                } else {
                    self.bounds[leaf].set(lane as usize, bounds);
                    self.raise_to_object(Slot::new(leaf as u32, lane as usize));
                }
            }
            queue.push(leaf);
            let Some(above) = above else { continue };
            let hull = self.bounds[leaf].hull();
            self.bounds[above.node()].set(above.lane(), &hull);
            // Leaves with consecutive numbers usually share their parent, which is then tightened once.
            if grown != NONE && grown != above.node() as u32 {
                self.tighten(grown);
            }
            grown = above.node() as u32;
        }
        if grown != NONE {
            self.tighten(grown);
        }
    }

    /// Enlarges the bounds of the nodes above `node` until all contain `bounds`, stopping at the first that
    /// contains them already.
    pub(super) fn grow(&mut self, node: u32, bounds: &Aabb) {
        let mut node = node;
        while let Some(above) = self.parent(node) {
            let old = self.bounds_in(above);
            let new = old.union(bounds);
            if new == old {
                return;
            }
            self.bounds[above.node()].set(above.lane(), &new);
            node = above.node() as u32;
        }
    }

    /// Shrinks the bounds of the nodes above `node` to the hulls of their contents, stopping at the first
    /// node whose bounds do not change.
    pub(in crate::scene) fn tighten(&mut self, node: u32) {
        let mut node = node;
        while let Some(above) = self.parent(node) {
            let hull = self.bounds[node as usize].hull();
            if self.bounds_in(above) == hull {
                return;
            }
            self.bounds[above.node()].set(above.lane(), &hull);
            node = above.node() as u32;
        }
    }
}

/// Returns whether the centre of `bounds` is outside of `home` by more than the size of `home` on some axis.
pub(super) fn is_far(home: &Aabb, bounds: &Aabb) -> bool {
    let size = home.max - home.min;
    let center = bounds.center();
    center.cmplt(home.min - size).any() || center.cmpgt(home.max + size).any()
}
