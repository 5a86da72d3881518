//! Building the hierarchy from nothing: objects are sorted along a space-filling curve and cut into nodes of 64, and so are
//! the nodes, level by level (Kamel and Faloutsos, "On Packing R-trees", 1993).

use super::boxes64::{Boxes64, lanes};
use super::curve::Curve;
use super::tree::{Payload, Slot, Tree, UNCULLED};
use crate::{Aabb, ObjectId};
use alloc::vec::Vec;

/// An object on its way into the tree. Two of them fill a cache line and none straddles one, since sorting reads them in
/// no order.
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

impl Tree {
    /// Throws the hierarchy away and builds it anew from the same objects and those given.
    pub(super) fn rebuild(&mut self, given: Vec<Entry>, generations: &[u32]) {
        let mut objects = given;
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
        // Place and number in one word, so that sorting is as fast as it gets. What the number takes from the place is not
        // missed: a million objects leave more than 14 bits an axis.
        let bits = usize::BITS - objects.len().leading_zeros();
        let key = |(number, entry): (usize, &Entry)| {
            curve.place(entry.bounds.center()) >> bits << bits | number as u64
        };
        let mut order: Vec<u64> = objects.iter().enumerate().map(key).collect();
        order.sort_unstable();

        let leaves = order.len().div_ceil(64);
        self.reserve(leaves + leaves.div_ceil(63) + 8);
        let number = |&key: &u64| (key & ((1 << bits) - 1)) as usize;
        for chunk in order.chunks(64) {
            self.push_leaf(chunk.iter().map(|key| &objects[number(key)]), generations);
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

    /// Adds a leaf at the end of all arrays, each written once.
    fn push_leaf<'a>(&mut self, entries: impl ExactSizeIterator<Item = &'a Entry>, generations: &[u32]) {
        let node = self.node_count() as u32;
        let occupied = if entries.len() < 64 { (1 << entries.len()) - 1 } else { u64::MAX };
        let (mut boxes, mut ids, mut layers) = (Boxes64::EMPTY, [ObjectId::NONE; 64], [0; 64]);
        let mut occluders = 0;
        for (lane, entry) in entries.enumerate() {
            let payload = entry.payload(generations);
            boxes.set(lane, &entry.bounds);
            ids[lane] = payload.id;
            layers[lane] = payload.layers;
            occluders |= u64::from(payload.occluder) << lane;
            self.slots[payload.id.index()] = Slot::new(node, lane);
        }
        self.push_node(boxes, occupied, ids, layers, occluders, 0);
    }
}
