//! Building the hierarchy from nothing: objects are sorted along a space-filling curve and cut into nodes of 64, and so are
//! the nodes, level by level (Kamel and Faloutsos, "On Packing R-trees", 1993).

use super::boxes64::lanes;
use super::curve::Curve;
use super::tree::{Payload, Slot, Tree};
use crate::Aabb;
use alloc::vec::Vec;

impl Tree {
    /// Throws the hierarchy away and builds it anew from the same objects, plus `more`.
    pub(super) fn rebuild(&mut self, more: impl IntoIterator<Item = (Aabb, Payload)>) {
        let mut objects: Vec<(Aabb, Payload)> = Vec::with_capacity(self.slots.len());
        for node in 0..self.node_count() {
            // Inner and free nodes hold no object.
            if self.levels[node] == 0 {
                for lane in lanes(self.occupied[node]) {
                    objects.push((self.bounds[node].get(lane), self.payload(Slot::new(node as u32, lane))));
                }
            }
        }
        objects.extend(more);
        let mut unculled: Vec<(Aabb, Payload)> = Vec::new();
        for &node in &self.unculled {
            for lane in lanes(self.occupied[node as usize]) {
                unculled.push((self.bounds[node as usize].get(lane), self.payload(Slot::new(node, lane))));
            }
        }
        let slots = core::mem::take(&mut self.slots);
        *self = Self::new();
        self.slots = slots;

        let centers = Aabb::from_points(objects.iter().map(|(bounds, _)| bounds.center()));
        let curve = Curve::through(&centers);
        let mut order: Vec<(u64, u32)> =
            objects.iter().zip(0..).map(|((bounds, _), i)| (curve.place(bounds.center()), i)).collect();
        order.sort_unstable();

        let leaves = order.len().div_ceil(64);
        self.reserve(leaves + leaves.div_ceil(63) + 8 + unculled.len().div_ceil(64));
        let mut level: Vec<u32> = Vec::with_capacity(leaves);
        for chunk in order.chunks(64) {
            let leaf = self.allocate(0);
            for (lane, &(_, i)) in chunk.iter().enumerate() {
                let (bounds, payload) = &objects[i as usize];
                self.write(Slot::new(leaf, lane), bounds, *payload);
            }
            level.push(leaf);
        }
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
        for (bounds, payload) in &unculled {
            self.insert_unculled(bounds, *payload);
        }
    }
}
