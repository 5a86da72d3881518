//! Bulk loading of the hierarchy: objects are sorted along a space-filling curve and packed into leaves of
//! `FAN_OUT` objects. Nodes are packed likewise, level by level (Kamel and Faloutsos, "On Packing R-trees",
//! 1993).

use super::boxes64::{Boxes64, FAN_OUT, lanes};
use super::curve::Curve;
use super::tree::{Payload, Slot, Tree, UNCULLED};
use crate::{Aabb, ObjectId};
use alloc::vec::Vec;

/// An object to be inserted into the tree. Aligned to 32 bytes, so that two entries fill a cache line and
/// none straddles one, because packing reads entries in random order.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct Entry {
    bounds: Aabb,
    layers: u32,
    /// The object's index in the lower 31 bits; bit 31 is set for an occluder.
    tagged: u32,
}

impl Entry {
    const OCCLUDER: u32 = 1 << 31;

    const NONE: Self = Self { bounds: Aabb::EMPTY, layers: u32::MAX, tagged: 0 };

    pub(super) fn new(bounds: Aabb, payload: Payload) -> Self {
        let tag = if payload.occluder { Self::OCCLUDER } else { 0 };
        Self { bounds, layers: payload.layers, tagged: payload.id.index | tag }
    }

    fn payload(&self, generations: &[u32]) -> Payload {
        let index = self.tagged & !Self::OCCLUDER;
        let id = ObjectId { index, generation: generations[index as usize] };
        Payload { id, layers: self.layers, occluder: self.tagged != index }
    }
}

/// Returns the keys in ascending order: distributes them over buckets by their 10 highest bits, then sorts
/// each bucket, which usually fits into a near cache.
fn sorted(keys: impl ExactSizeIterator<Item = u64>) -> Vec<u64> {
    const BITS: u32 = 10;
    let bucket = |key: u64| (key >> (u64::BITS - BITS)) as usize;
    let mut ends = [0u32; 1 << BITS];
    let unsorted: Vec<u64> = keys.inspect(|&key| ends[bucket(key)] += 1).collect();
    let mut start = 0;
    for end in &mut ends {
        start += core::mem::replace(end, start);
    }
    let mut order = alloc::vec![0; unsorted.len()];
    for key in unsorted {
        let end = &mut ends[bucket(key)];
        order[*end as usize] = key;
        *end += 1;
    }
    let mut start = 0;
    for end in ends {
        order[start..end as usize].sort_unstable();
        start = end as usize;
    }
    order
}

impl Tree {
    /// Discards all nodes and builds the hierarchy anew from the objects of the tree and the new objects
    /// `given`. `generations` holds the present generation of each object index.
    pub(super) fn rebuild(&mut self, given: Vec<Entry>, generations: &[u32]) {
        let mut objects = given;
        objects.reserve_exact(self.slots.len().saturating_sub(objects.len()));
        let mut unculled: Vec<(Aabb, Payload)> = Vec::new();
        for (node, &level) in self.levels.iter().enumerate() {
            for lane in lanes(self.occupied[node]) {
                let slot = Slot::new(node as u32, lane);
                match level {
                    0 => objects.push(Entry::new(self.bounds[node].get(lane), self.payload(slot))),
                    UNCULLED => unculled.push((self.bounds[node].get(lane), self.payload(slot))),
                    _ => break,
                }
            }
        }
        self.clear();
        // Unculled objects lose their slots first: an object without a slot is not taken for an HLOD parent
        // while the leaves are measured.
        unculled.iter().for_each(|(_, payload)| self.slots[payload.id.index()] = Slot::NONE);
        self.fill(&objects, generations);
        for (bounds, payload) in &unculled {
            self.insert_unculled(bounds, *payload);
        }
    }

    pub(super) fn insert_entry(&mut self, entry: &Entry, generations: &[u32]) {
        self.insert(&entry.bounds, entry.payload(generations));
    }

    fn fill(&mut self, objects: &[Entry], generations: &[u32]) {
        let curve = Curve::through(objects.iter().map(|entry| entry.bounds.center()), objects.len());
        // The curve position and the entry's number share one word, so that sorting moves only words. The
        // number replaces the lowest bits of the position; with a million objects, more than 14 bits per axis
        // remain.
        let bits = usize::BITS - objects.len().leading_zeros();
        let key = |(number, entry): (usize, &Entry)| {
            curve.code(entry.bounds.center()) >> bits << bits | number as u64
        };
        let order = sorted(objects.iter().enumerate().map(key));

        let leaves = order.len().div_ceil(FAN_OUT);
        self.reserve(leaves + leaves.div_ceil(FAN_OUT - 1) + 8);
        let number = |key: u64| (key & ((1 << bits) - 1)) as usize;
        let mut taken = [Entry::NONE; FAN_OUT];
        for chunk in order.chunks(FAN_OUT) {
            // This loop does nothing but load, so that the processor can wait for many cache misses at once.
            for (entry, &key) in taken.iter_mut().zip(chunk) {
                *entry = objects[number(key)];
            }
            self.push_leaf(&taken[..chunk.len()], generations);
        }
        // The size of an object is measured by its HLOD parent, which may be in any leaf: all leaves must be
        // filled before.
        (0..leaves).for_each(|leaf| self.measure_leaf(leaf));
        let mut level: Vec<u32> = (0..leaves as u32).collect();
        let mut height = 0;
        while level.len() > 1 {
            height += 1;
            let mut above = Vec::with_capacity(level.len().div_ceil(FAN_OUT));
            for chunk in level.chunks(FAN_OUT) {
                let node = self.allocate(height);
                for (lane, &child) in chunk.iter().enumerate() {
                    self.attach(Slot::new(node, lane), child);
                }
                above.push(node);
            }
            level = above;
        }
        if let Some(&root) = level.first() {
            self.root = root;
        }
    }

    /// Appends a leaf with at most 64 entries, in lanes 0 and up. Each array that is read at random places is
    /// read in a loop of its own, in which the processor can wait for many cache misses at once.
    fn push_leaf(&mut self, entries: &[Entry], generations: &[u32]) {
        let node = self.node_count() as u32;
        let occupied = if entries.len() < FAN_OUT { (1 << entries.len()) - 1 } else { u64::MAX };
        let mut ids = [ObjectId::PLACEHOLDER; FAN_OUT];
        let mut occluders = 0;
        for (lane, (id, entry)) in ids.iter_mut().zip(entries).enumerate() {
            id.index = entry.tagged & !Entry::OCCLUDER;
            occluders |= u64::from(entry.tagged != id.index) << lane;
        }
        for id in &mut ids[..entries.len()] {
            id.generation = generations[id.index()];
        }
        for (lane, id) in ids[..entries.len()].iter().enumerate() {
            self.slots[id.index()] = Slot::new(node, lane);
        }
        let (mut boxes, mut layers) = (Boxes64::EMPTY, [u32::MAX; FAN_OUT]);
        for (lane, entry) in entries.iter().enumerate() {
            boxes.set(lane, &entry.bounds);
            layers[lane] = entry.layers;
        }
        self.push_node(boxes, occupied, ids, layers, occluders, 0);
    }
}
