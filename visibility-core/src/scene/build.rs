//! Building the hierarchy from nothing: objects are sorted along a space-filling curve and cut into nodes of
//! 64, and so are the nodes, level by level (Kamel and Faloutsos, "On Packing R-trees", 1993).

use super::boxes64::{Boxes64, lanes};
use super::curve::Curve;
use super::tree::{Payload, Slot, Tree, UNCULLED};
use crate::{Aabb, ObjectId};
use alloc::vec::Vec;

/// An object on its way into the tree. Two of them fill a cache line and none straddles one, since sorting
/// reads them in no order.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct Entry {
    bounds: Aabb,
    layers: u32,
    /// Its index, and in the highest bit whether it is an occluder.
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

/// Sorts keys of 64 bits: spreads them over buckets by their highest bits, and sorts what fits in a near
/// cache.
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
        let place = &mut ends[bucket(key)];
        order[*place as usize] = key;
        *place += 1;
    }
    let mut start = 0;
    for end in ends {
        order[start..end as usize].sort_unstable();
        start = end as usize;
    }
    order
}

impl Tree {
    /// Throws the hierarchy away and builds it anew from the same objects and those given.
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
        // Place and number in one word, so that sorting is as fast as it gets. What the number takes from the
        // place is not missed: a million objects leave more than 14 bits an axis.
        let bits = usize::BITS - objects.len().leading_zeros();
        let key = |(number, entry): (usize, &Entry)| {
            curve.place(entry.bounds.center()) >> bits << bits | number as u64
        };
        let order = sorted(objects.iter().enumerate().map(key));

        let leaves = order.len().div_ceil(64);
        self.reserve(leaves + leaves.div_ceil(63) + 8);
        let number = |key: u64| (key & ((1 << bits) - 1)) as usize;
        let mut taken = [Entry::NONE; 64];
        for chunk in order.chunks(64) {
            // A loop that does nothing else, in which the processor waits for many objects at once.
            for (entry, &key) in taken.iter_mut().zip(chunk) {
                *entry = objects[number(key)];
            }
            self.push_leaf(&taken[..chunk.len()], generations);
        }
        let mut level: Vec<u32> = (0..leaves as u32).collect();
        let mut height = 0;
        while level.len() > 1 {
            height += 1;
            let mut above = Vec::with_capacity(level.len().div_ceil(64));
            for chunk in level.chunks(64) {
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

    /// Adds a leaf at the end of all arrays, each written once. One tight loop for each array that is read or
    /// written in no order, in which the processor waits for many lanes at once.
    fn push_leaf(&mut self, entries: &[Entry], generations: &[u32]) {
        let node = self.node_count() as u32;
        let occupied = if entries.len() < 64 { (1 << entries.len()) - 1 } else { u64::MAX };
        let mut ids = [ObjectId::NONE; 64];
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
        let (mut boxes, mut layers) = (Boxes64::EMPTY, [u32::MAX; 64]);
        for (lane, entry) in entries.iter().enumerate() {
            boxes.set(lane, &entry.bounds);
            layers[lane] = entry.layers;
        }
        self.push_node(boxes, occupied, ids, layers, occluders, 0);
    }
}
