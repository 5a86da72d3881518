//! The hierarchy: a tree of fan-out 64 whose leaves hold the objects, and whose every test answers 64
//! children as one mask.
//!
//! It is an R-tree (Guttman, "R-Trees: A Dynamic Index Structure for Spatial Searching", 1984) with wide
//! nodes: bulk-loaded along a space-filling curve ([`build`](super::build)), changed one object at a time
//! here, and kept in shape by [`maintain`](super::maintain). Bounds in a node always contain what lies below,
//! so any state of the tree gives right answers; a good one gives them faster.
//!
//! The fields of nodes live in separate arrays, because a frame touches the bounds of the nodes that it
//! tests, but only the `occupied` masks of those that it takes whole.

mod moving;
pub(super) mod pack;
mod regroup;
mod scratch;
mod slot;

pub(super) use scratch::Scratch;
pub(crate) use slot::{NONE, Slot};

use super::boxes64::{Boxes64, lanes};
use crate::{Aabb, ObjectId};
use alloc::vec::Vec;

/// The level of leaves outside the tree.
pub(crate) const UNCULLED: u8 = u8::MAX;

/// What a lane of a leaf holds besides bounds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Payload {
    pub(crate) id: ObjectId,
    pub(crate) layers: u32,
    pub(crate) occluder: bool,
}

/// All nodes of the hierarchy, and the leaves outside it that hold what is never culled.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    /// The topmost node, or `NONE` in an empty tree.
    pub(crate) root: u32,
    pub(crate) bounds: Vec<Boxes64>,
    /// Which lanes hold something.
    pub(crate) occupied: Vec<u64>,
    /// In leaves the objects; in inner nodes `index` is the child.
    pub(crate) ids: Vec<[ObjectId; 64]>,
    /// In leaves, the layers of each object; all of them in free lanes, so that these never make a
    /// difference.
    pub(crate) layers: Vec<[u32; 64]>,
    /// In leaves, which objects are occluders.
    pub(crate) occluders: Vec<u64>,
    /// The lane of the parent that points here; `NONE` for the root. For leaves outside the tree, the place
    /// in `unculled`.
    pub(super) parents: Vec<Slot>,
    /// 0 for leaves, [`UNCULLED`] for leaves outside the tree.
    pub(crate) levels: Vec<u8>,
    /// Leaves outside the tree, whose objects no culler sees.
    pub(crate) unculled: Vec<u32>,
    free: Vec<u32>,
    /// Where each object is, by index.
    pub(crate) slots: Vec<Slot>,
    pub(super) scratch: Scratch,
}

impl Tree {
    pub(crate) const fn new() -> Self {
        Self {
            root: NONE,
            bounds: Vec::new(),
            occupied: Vec::new(),
            ids: Vec::new(),
            layers: Vec::new(),
            occluders: Vec::new(),
            parents: Vec::new(),
            levels: Vec::new(),
            unculled: Vec::new(),
            free: Vec::new(),
            slots: Vec::new(),
            scratch: Scratch::EMPTY,
        }
    }

    /// Forgets all nodes, but not their memory.
    pub(super) fn clear(&mut self) {
        self.root = NONE;
        self.bounds.clear();
        self.occupied.clear();
        self.ids.clear();
        self.layers.clear();
        self.occluders.clear();
        self.parents.clear();
        self.levels.clear();
        self.unculled.clear();
        self.free.clear();
    }

    /// Makes room for so many nodes at once.
    pub(super) fn reserve(&mut self, nodes: usize) {
        self.bounds.reserve(nodes);
        self.occupied.reserve(nodes);
        self.ids.reserve(nodes);
        self.layers.reserve(nodes);
        self.occluders.reserve(nodes);
        self.parents.reserve(nodes);
        self.levels.reserve(nodes);
    }

    /// Number of nodes, free ones included: masks by node have this length.
    pub(crate) fn node_count(&self) -> usize {
        self.occupied.len()
    }

    pub(super) fn parent(&self, node: u32) -> Option<Slot> {
        let slot = self.parents[node as usize];
        (slot != Slot::NONE && self.levels[node as usize] != UNCULLED).then_some(slot)
    }

    pub(crate) fn child(&self, node: usize, lane: usize) -> usize {
        self.ids[node][lane].index()
    }

    pub(super) fn allocate(&mut self, level: u8) -> u32 {
        if let Some(node) = self.free.pop() {
            self.levels[node as usize] = level;
            return node;
        }
        self.push_node(Boxes64::EMPTY, 0, [ObjectId::NONE; 64], [u32::MAX; 64], 0, level)
    }

    /// Adds a node at the end of all arrays.
    pub(super) fn push_node(
        &mut self,
        bounds: Boxes64,
        occupied: u64,
        ids: [ObjectId; 64],
        layers: [u32; 64],
        occluders: u64,
        level: u8,
    ) -> u32 {
        let node = self.occupied.len() as u32;
        self.bounds.push(bounds);
        self.occupied.push(occupied);
        self.ids.push(ids);
        self.layers.push(layers);
        self.occluders.push(occluders);
        self.parents.push(Slot::NONE);
        self.levels.push(level);
        node
    }

    /// Writes a lane of a leaf, without touching what is above.
    pub(super) fn write(&mut self, slot: Slot, bounds: &Aabb, payload: Payload) {
        let (node, lane) = (slot.node(), slot.lane());
        self.bounds[node].set(lane, bounds);
        self.occupied[node] |= 1 << lane;
        self.ids[node][lane] = payload.id;
        self.layers[node][lane] = payload.layers;
        self.occluders[node] = self.occluders[node] & !(1 << lane) | u64::from(payload.occluder) << lane;
        self.slots[payload.id.index()] = slot;
    }

    pub(super) fn payload(&self, slot: Slot) -> Payload {
        let (node, lane) = (slot.node(), slot.lane());
        Payload {
            id: self.ids[node][lane],
            layers: self.layers[node][lane],
            occluder: self.occluders[node] >> lane & 1 != 0,
        }
    }

    /// Points a lane of an inner node to a child.
    pub(super) fn attach(&mut self, parent: Slot, child: u32) {
        let hull = self.bounds[child as usize].hull();
        self.bounds[parent.node()].set(parent.lane(), &hull);
        self.occupied[parent.node()] |= 1 << parent.lane();
        self.ids[parent.node()][parent.lane()] = ObjectId { index: child, generation: 0 };
        self.parents[child as usize] = parent;
    }

    fn clear_lane(&mut self, slot: Slot) {
        self.bounds[slot.node()].set(slot.lane(), &Aabb::EMPTY);
        self.occupied[slot.node()] &= !(1 << slot.lane());
        self.occluders[slot.node()] &= !(1 << slot.lane());
        self.ids[slot.node()][slot.lane()] = ObjectId::NONE;
        self.layers[slot.node()][slot.lane()] = u32::MAX;
    }

    /// Adds an object to the tree, in time logarithmic in the number of objects.
    pub(super) fn insert(&mut self, bounds: &Aabb, payload: Payload) {
        if self.root == NONE {
            self.root = self.allocate(0);
        }
        let mut node = self.root;
        while self.levels[node as usize] > 0 {
            let lane = closest_lane(&self.bounds[node as usize], self.occupied[node as usize], bounds);
            node = self.child(node as usize, lane) as u32;
        }
        let slot = self.free_lane(node, bounds);
        self.write(slot, bounds, payload);
        self.grow(slot.node() as u32, bounds);
    }

    /// Adds an object outside the tree, where no culler sees it.
    pub(super) fn insert_unculled(&mut self, bounds: &Aabb, payload: Payload) {
        let node = match self.unculled.last() {
            Some(&node) if self.occupied[node as usize] != u64::MAX => node,
            _ => {
                let node = self.allocate(UNCULLED);
                self.parents[node as usize] = Slot(self.unculled.len() as u32);
                self.unculled.push(node);
                node
            }
        };
        let lane = self.occupied[node as usize].trailing_ones() as usize;
        self.write(Slot::new(node, lane), bounds, payload);
    }

    /// Removes what is in the slot of a leaf, and every node that is thereby left empty. Bounds above stay as
    /// they are.
    pub(super) fn remove(&mut self, slot: Slot) {
        let id = self.ids[slot.node()][slot.lane()];
        self.slots[id.index()] = Slot::NONE;
        self.clear_lane(slot);
        if self.levels[slot.node()] == UNCULLED {
            // To the end of the list, where the next one that is inserted finds the free lane.
            let (place, last) = (self.parents[slot.node()].0 as usize, self.unculled.len() - 1);
            self.parents[self.unculled[last] as usize] = Slot(place as u32);
            self.parents[slot.node()] = Slot(last as u32);
            self.unculled.swap(place, last);
            if self.occupied[slot.node()] == 0 {
                self.unculled.pop();
                self.release(slot.node() as u32);
            }
            return;
        }
        self.remove_empty(slot.node() as u32);
    }

    /// Frees a node if it is empty, and every node that is thereby left empty.
    pub(super) fn remove_empty(&mut self, node: u32) {
        let mut node = node;
        while self.occupied[node as usize] == 0 {
            let above = self.parent(node);
            self.release(node);
            let Some(above) = above else {
                self.root = NONE;
                return;
            };
            self.clear_lane(above);
            node = above.node() as u32;
        }
    }

    fn release(&mut self, node: u32) {
        self.parents[node as usize] = Slot::NONE;
        self.free.push(node);
    }

    pub(super) fn is_unculled(&self, slot: Slot) -> bool {
        self.is_unculled_leaf(slot.node())
    }

    pub(crate) fn is_unculled_leaf(&self, leaf: usize) -> bool {
        self.levels[leaf] == UNCULLED
    }

    /// The lanes that lead from a lane of a node up to the root, that lane first.
    pub(crate) fn path(&self, node: usize, lane: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let start = Slot::new(node as u32, lane);
        core::iter::successors(Some(start), |slot| self.parent(slot.node() as u32))
            .map(|slot| (slot.node(), slot.lane()))
    }

    /// Bytes held.
    pub(super) fn memory(&self) -> usize {
        use core::mem::size_of_val;
        size_of_val(&self.bounds[..])
            + size_of_val(&self.occupied[..])
            + size_of_val(&self.ids[..])
            + size_of_val(&self.layers[..])
            + size_of_val(&self.occluders[..])
            + size_of_val(&self.parents[..])
            + size_of_val(&self.levels[..])
            + size_of_val(&self.unculled[..])
            + size_of_val(&self.free[..])
            + size_of_val(&self.slots[..])
            + self.scratch.memory()
    }

    /// A free lane in `node`, or, if it is full, in the half of it that suits `bounds` better.
    fn free_lane(&mut self, node: u32, bounds: &Aabb) -> Slot {
        let mut node = node;
        if self.occupied[node as usize] == u64::MAX {
            let other = self.split(node);
            let hull = |n: u32| self.bounds[n as usize].hull();
            if separation(&hull(other), bounds) < separation(&hull(node), bounds) {
                node = other;
            }
        }
        Slot::new(node, self.occupied[node as usize].trailing_ones() as usize)
    }

    /// Moves the upper half of a full node, along the axis on which its content spreads most, to a new
    /// sibling.
    fn split(&mut self, node: u32) -> u32 {
        let level = self.levels[node as usize];
        let other = self.allocate(level);
        let mut order: [usize; 64] = core::array::from_fn(|lane| lane);
        let centers: [_; 64] = core::array::from_fn(|lane| self.bounds[node as usize].get(lane).center());
        let spread = Aabb::from_points(centers);
        let extent = spread.half_extent();
        let axis = if extent.x >= extent.y && extent.x >= extent.z {
            0
        } else {
            1 + usize::from(extent.z > extent.y)
        };
        order.sort_unstable_by(|&a, &b| centers[a][axis].total_cmp(&centers[b][axis]).then(a.cmp(&b)));
        for (lane, &from) in order[32..].iter().enumerate() {
            let (from, to) = (Slot::new(node, from), Slot::new(other, lane));
            if level == 0 {
                let (bounds, payload) = (self.bounds[from.node()].get(from.lane()), self.payload(from));
                self.write(to, &bounds, payload);
            } else {
                self.attach(to, self.child(from.node(), from.lane()) as u32);
            }
            self.clear_lane(from);
        }
        if node == self.root {
            self.root = self.allocate(level + 1);
            self.attach(Slot::new(self.root, 0), node);
        }
        // The hull of `node` stays a bound on both halves until `tighten`; no ancestor grows.
        if let Some(above) = self.parent(node) {
            let hull = self.bounds[other as usize].hull();
            let lane = self.free_lane(above.node() as u32, &hull);
            self.attach(lane, other);
            self.grow(lane.node() as u32, &hull);
            self.tighten(node);
        }
        other
    }
}

/// How far `b` is from `a`, as the sum over axes of twice the distance of centres: where nothing must be
/// enlarged, and where everything must, the nearest centre is a good home.
pub(super) fn separation(a: &Aabb, b: &Aabb) -> f32 {
    let d = ((a.min - b.min) + (a.max - b.max)).abs();
    d.x + d.y + d.z
}

/// The occupied lane whose box must be enlarged least, in the sum of its sides, to hold `bounds`; among
/// equals, the one with the nearest centre.
fn closest_lane(boxes: &Boxes64, occupied: u64, bounds: &Aabb) -> usize {
    let c = &boxes.coordinates;
    let (min, max) = (bounds.min, bounds.max);
    let mut cost = [0.0f32; 64];
    let mut distance = [0.0f32; 64];
    for axis in 0..3 {
        let (low, high) = (min[axis], max[axis]);
        for lane in 0..64 {
            let below = c[axis][lane] - low;
            let above = high - c[axis + 3][lane];
            cost[lane] += if below > 0.0 { below } else { 0.0 } + if above > 0.0 { above } else { 0.0 };
            distance[lane] += (below - above).abs();
        }
    }
    let mut best = occupied.trailing_zeros() as usize & 63;
    for lane in lanes(occupied) {
        if (cost[lane], distance[lane]) < (cost[best], distance[best]) {
            best = lane;
        }
    }
    best
}

#[cfg(test)]
mod tests;
