//! Building the hierarchy from nothing: objects are sorted along a space-filling curve and cut into nodes of 64, and so are
//! the nodes, level by level (Kamel and Faloutsos, "On Packing R-trees", 1993).

use super::boxes64::{Boxes64, lanes};
use super::curve::Curve;
use super::tree::{Payload, Slot, Tree, UNCULLED};
use crate::{Aabb, ObjectId};
use alloc::vec::Vec;

impl Tree {
    /// Throws the hierarchy away and builds it anew from the same objects and those given.
    pub(super) fn rebuild(&mut self, given: Vec<(Aabb, Payload)>) {
        let mut objects = given;
        let mut unculled: Vec<(Aabb, Payload)> = Vec::new();
        for (node, &level) in self.levels.iter().enumerate() {
            let list = match level {
                0 => &mut objects,
                UNCULLED => &mut unculled,
                _ => continue,
            };
            for lane in lanes(self.occupied[node]) {
                list.push((self.bounds[node].get(lane), self.payload(Slot::new(node as u32, lane))));
            }
        }
        self.clear();
        self.fill(&objects);
        for (bounds, payload) in &unculled {
            self.insert_unculled(bounds, *payload);
        }
    }

    fn fill(&mut self, objects: &[(Aabb, Payload)]) {
        let curve = Curve::through(objects.iter().map(|(bounds, _)| bounds.center()), objects.len());
        // Place and number in one word, so that sorting is as fast as it gets. What the number takes from the place is not
        // missed: a million objects leave more than 14 bits an axis.
        let bits = usize::BITS - objects.len().leading_zeros();
        let key = |(number, (bounds, _)): (usize, &(Aabb, Payload))| {
            curve.place(bounds.center()) >> bits << bits | number as u64
        };
        let mut order: Vec<u64> = objects.iter().enumerate().map(key).collect();
        order.sort_unstable();

        let leaves = order.len().div_ceil(64);
        self.reserve(leaves + leaves.div_ceil(63) + 8);
        let number = |&key: &u64| (key & ((1 << bits) - 1)) as usize;
        for chunk in order.chunks(64) {
            self.push_leaf(chunk.iter().map(|key| &objects[number(key)]));
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
    fn push_leaf<'a>(&mut self, objects: impl ExactSizeIterator<Item = &'a (Aabb, Payload)>) {
        let node = self.node_count() as u32;
        let occupied = if objects.len() < 64 { (1 << objects.len()) - 1 } else { u64::MAX };
        let (mut boxes, mut ids, mut layers) = (Boxes64::EMPTY, [ObjectId::NONE; 64], [0; 64]);
        let mut occluders = 0;
        for (lane, (bounds, payload)) in objects.enumerate() {
            boxes.set(lane, bounds);
            ids[lane] = payload.id;
            layers[lane] = payload.layers;
            occluders |= u64::from(payload.occluder) << lane;
            self.slots[payload.id.index()] = Slot::new(node, lane);
        }
        self.push_node(boxes, occupied, ids, layers, occluders, 0);
    }
}
