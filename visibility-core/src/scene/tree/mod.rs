//! The hierarchy of a scene: a tree of fan-out 64. Its leaves hold the objects, and a test of a node answers
//! for 64 children with one mask.
//!
//! The tree is an R-tree (Guttman, "R-Trees: A Dynamic Index Structure for Spatial Searching", 1984) with
//! wide nodes. It is bulk-loaded along a space-filling curve ([`build`](super::build)), changed object by
//! object here, and improved by [`maintain`](super::maintain). The bounds in a node always contain everything
//! below it, so queries are correct in any state of the tree; tighter bounds only make them faster.
//!
//! Each field of the nodes has an array of its own, because a frame reads the bounds of the nodes that it
//! tests, but only the `occupied` masks of the nodes that it accepts whole.

mod bounding;
mod detail_bounds;
mod history;
mod moving;
pub(super) mod pack;
mod refit;
mod regroup;
mod scratch;
mod slot;

pub use detail_bounds::DetailBounds;
use history::History;
pub(crate) use history::Token;
pub(super) use scratch::Scratch;
pub(crate) use slot::{NONE, Slot};

use super::boxes64::{Boxes64, FAN_OUT, lanes};
use super::draw_range::Detail;
use crate::{Aabb, ObjectId, geometry::longest_axis};
use alloc::vec::Vec;

/// Level of the leaves outside the tree, which hold the objects that are never culled.
pub(crate) const UNCULLED: u8 = u8::MAX;

/// The data of an object in a lane of a leaf, without its bounds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Payload {
    pub(crate) id: ObjectId,
    pub(crate) layers: u32,
    pub(crate) occluder: bool,
}

/// All nodes of the hierarchy, in arrays indexed by node, and the leaves outside it that hold the objects
/// that are never culled.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    /// Number of the root node, or `NONE` in an empty tree.
    pub(crate) root: u32,
    /// Bounds of what each lane holds, relative to the origin of the scene: of an object in leaves, of
    /// everything below the child in inner nodes.
    pub(crate) bounds: Vec<Boxes64>,
    /// Mask of the lanes that hold an object or a child node, for each node; bit i stands for lane i.
    pub(crate) occupied: Vec<u64>,
    /// For leaves, the object in each lane. For inner nodes, the child in each lane: `index` is the child's
    /// node number. [`ObjectId::PLACEHOLDER`] in free lanes.
    pub(crate) ids: Vec<[ObjectId; FAN_OUT]>,
    /// For leaves, the layer mask of the object in each lane. Free lanes, and all lanes of
    /// inner nodes, have all bits set, so that they do not affect the AND over a leaf.
    pub(crate) layers: Vec<[u32; FAN_OUT]>,
    /// For leaves, a mask of the objects flagged as occluders, bit i for lane i; 0 for inner nodes.
    pub(crate) occluders: Vec<u64>,
    /// For each node, the slot of its parent that holds the node; `NONE` for the root and free nodes. For
    /// leaves outside the tree, the leaf's position in `unculled`.
    pub(super) parents: Vec<Slot>,
    /// Height of each node above the leaves: 0 for leaves, [`UNCULLED`] for leaves outside the tree.
    pub(crate) levels: Vec<u8>,
    /// Numbers of the leaves outside the tree, whose objects are never culled and visited by no walk.
    pub(crate) unculled: Vec<u32>,
    /// Number of leaves at the beginning of `unculled` that are full. All others have a free lane.
    pub(super) full_unculled: usize,
    free: Vec<u32>,
    /// For each object index, the slot that holds the object; `Slot::NONE` for indices that no object has.
    pub(crate) slots: Vec<Slot>,
    /// For each node, bounds on the size and the draw distance of the objects below.
    pub(crate) detail_bounds: Vec<DetailBounds>,
    /// For leaves, a mask of the objects whose details are set, bit i for lane i; 0 for inner nodes.
    pub(crate) detailed: Vec<u64>,
    /// Draw range and HLOD parent of each object, indexed by object index. Shorter than the index range, and
    /// empty until an object first gets either.
    pub(crate) details: Vec<Detail>,
    history: History,
    pub(super) scratch: Scratch,
}

impl Tree {
    pub(crate) fn new() -> Self {
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
            full_unculled: 0,
            free: Vec::new(),
            slots: Vec::new(),
            detail_bounds: Vec::new(),
            detailed: Vec::new(),
            details: Vec::new(),
            history: History::default(),
            scratch: Scratch::EMPTY,
        }
    }

    /// Returns the bounds of the object, or the box of the node, in a slot.
    #[inline]
    pub(super) fn bounds_in(&self, slot: Slot) -> Aabb {
        self.bounds[slot.node()].get(slot.lane())
    }

    /// Removes all nodes but keeps their memory. `slots` and `details` are left as they are.
    pub(super) fn clear(&mut self) {
        (0..self.node_count()).for_each(|node| self.before_change(node));
        self.root = NONE;
        self.bounds.clear();
        self.occupied.clear();
        self.ids.clear();
        self.layers.clear();
        self.occluders.clear();
        self.parents.clear();
        self.levels.clear();
        self.detail_bounds.clear();
        self.detailed.clear();
        self.unculled.clear();
        self.full_unculled = 0;
        self.free.clear();
    }

    /// Reserves capacity for `nodes` more nodes in all arrays.
    pub(super) fn reserve(&mut self, nodes: usize) {
        self.bounds.reserve(nodes);
        self.occupied.reserve(nodes);
        self.ids.reserve(nodes);
        self.layers.reserve(nodes);
        self.occluders.reserve(nodes);
        self.parents.reserve(nodes);
        self.levels.reserve(nodes);
        self.detail_bounds.reserve(nodes);
        self.detailed.reserve(nodes);
    }

    /// Returns the number of nodes, free ones included: the length of arrays indexed by node.
    pub(crate) fn node_count(&self) -> usize {
        self.occupied.len()
    }

    /// Returns the slot of the parent that holds `node`. `None` for the root and for leaves outside the tree.
    pub(super) fn parent(&self, node: u32) -> Option<Slot> {
        let slot = self.parents[node as usize];
        (slot != Slot::NONE && self.levels[node as usize] != UNCULLED).then_some(slot)
    }

    /// Returns the number of the child node in a lane. `node` must be an inner node and the lane occupied.
    pub(crate) fn child(&self, node: usize, lane: usize) -> usize {
        self.ids[node][lane].index()
    }

    /// Returns an empty node at `level` without a parent: a free one if there is any, otherwise a new one.
    pub(super) fn allocate(&mut self, level: u8) -> u32 {
        if let Some(node) = self.free.pop() {
            self.levels[node as usize] = level;
            return node;
        }
        self.push_node(Boxes64::EMPTY, 0, [ObjectId::PLACEHOLDER; FAN_OUT], [u32::MAX; FAN_OUT], 0, level)
    }

    /// Appends a node without a parent to all arrays and returns its number.
    pub(super) fn push_node(
        &mut self,
        bounds: Boxes64,
        occupied: u64,
        ids: [ObjectId; FAN_OUT],
        layers: [u32; FAN_OUT],
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
        self.detail_bounds.push(DetailBounds::NONE);
        self.detailed.push(0);
        node
    }

    /// Writes an object into a lane of a leaf and records its slot. The boxes of the nodes above are not
    /// updated.
    pub(super) fn write(&mut self, slot: Slot, bounds: &Aabb, payload: Payload) {
        let (node, lane) = (slot.node(), slot.lane());
        self.before_change(node);
        self.bounds[node].set(lane, bounds);
        self.occupied[node] |= 1 << lane;
        self.ids[node][lane] = payload.id;
        self.layers[node][lane] = payload.layers;
        self.occluders[node] = self.occluders[node] & !(1 << lane) | u64::from(payload.occluder) << lane;
        self.slots[payload.id.index()] = slot;
        self.raise_to_object(slot);
    }

    /// Returns the id, the layers and the occluder flag in a lane of a leaf. The slot must be occupied.
    pub(super) fn payload(&self, slot: Slot) -> Payload {
        let (node, lane) = (slot.node(), slot.lane());
        Payload {
            id: self.ids[node][lane],
            layers: self.layers[node][lane],
            occluder: self.occluders[node] >> lane & 1 != 0,
        }
    }

    /// Returns a mask of the objects of a leaf that hide others where they are drawn: those flagged as
    /// occluders, but for those that [fade](crate::scene::DrawRange::fades). Bit i stands for lane i; 0 for
    /// inner nodes.
    #[inline]
    pub(crate) fn occluding(&self, leaf: usize) -> u64 {
        let flagged = self.occluders[leaf];
        let fades = |&lane: &usize| self.detail(self.ids[leaf][lane].index()).range.fades();
        lanes(flagged & self.detailed[leaf]).filter(fades).fold(flagged, |mask, lane| mask & !(1 << lane))
    }

    /// Makes a node the child in a lane of an inner node, with the hull of the child as the lane's bounds.
    /// The boxes of the nodes above are not updated.
    pub(super) fn attach(&mut self, parent: Slot, child: u32) {
        self.before_change(parent.node());
        let hull = self.bounds[child as usize].hull();
        self.bounds[parent.node()].set(parent.lane(), &hull);
        self.occupied[parent.node()] |= 1 << parent.lane();
        self.ids[parent.node()][parent.lane()] = ObjectId { index: child, generation: 0 };
        self.parents[child as usize] = parent;
        self.raise(parent.node() as u32, self.detail_bounds[child as usize]);
    }

    fn clear_lane(&mut self, slot: Slot) {
        self.before_change(slot.node());
        self.bounds[slot.node()].set(slot.lane(), &Aabb::EMPTY);
        self.occupied[slot.node()] &= !(1 << slot.lane());
        self.occluders[slot.node()] &= !(1 << slot.lane());
        self.detailed[slot.node()] &= !(1 << slot.lane());
        self.ids[slot.node()][slot.lane()] = ObjectId::PLACEHOLDER;
        self.layers[slot.node()][slot.lane()] = u32::MAX;
    }

    /// Inserts an object into the tree, and enlarges the bounds above it. Takes time logarithmic in the
    /// number of objects.
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

    /// Inserts an object into a leaf outside the tree, where no culler visits it.
    pub(super) fn insert_unculled(&mut self, bounds: &Aabb, payload: Payload) {
        let node = match self.unculled.get(self.full_unculled) {
            Some(&node) => node,
            None => {
                let node = self.allocate(UNCULLED);
                self.parents[node as usize] = Slot(self.unculled.len() as u32);
                self.unculled.push(node);
                node
            }
        };
        let lane = self.occupied[node as usize].trailing_ones() as usize;
        self.write(Slot::new(node, lane), bounds, payload);
        self.full_unculled += usize::from(self.occupied[node as usize] == u64::MAX);
    }

    /// Exchanges two leaves outside the tree.
    fn swap_unculled(&mut self, a: usize, b: usize) {
        self.unculled.swap(a, b);
        for position in [a, b] {
            self.parents[self.unculled[position] as usize] = Slot(position as u32);
        }
    }

    /// Removes the object in a slot of a leaf, and frees every node that becomes empty by this. Bounds of the
    /// remaining nodes are not tightened.
    pub(super) fn remove(&mut self, slot: Slot) {
        let id = self.ids[slot.node()][slot.lane()];
        self.slots[id.index()] = Slot::NONE;
        self.clear_lane(slot);
        if self.levels[slot.node()] == UNCULLED {
            let mut position = self.parents[slot.node()].0 as usize;
            if position < self.full_unculled {
                self.full_unculled -= 1;
                self.swap_unculled(position, self.full_unculled);
                position = self.full_unculled;
            }
            if self.occupied[slot.node()] == 0 {
                self.swap_unculled(position, self.unculled.len() - 1);
                self.unculled.pop();
                self.release(slot.node() as u32);
            }
            return;
        }
        self.remove_empty(slot.node() as u32);
    }

    /// Frees a node if it is empty, removes it from its parent, and continues with the parent. Freeing the
    /// root empties the tree.
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
        self.detail_bounds[node as usize] = DetailBounds::NONE;
        self.free.push(node);
    }

    /// Iterates over the bounds and ids of the objects that are never culled.
    pub(super) fn unculled_objects(&self) -> impl Iterator<Item = (Aabb, ObjectId)> + '_ {
        self.unculled.iter().map(|&leaf| leaf as usize).flat_map(move |leaf| {
            lanes(self.occupied[leaf]).map(move |lane| (self.bounds[leaf].get(lane), self.ids[leaf][lane]))
        })
    }

    pub(super) fn is_unculled(&self, slot: Slot) -> bool {
        self.is_unculled_leaf(slot.node())
    }

    /// Returns whether a leaf is outside the tree, so that its objects are never culled.
    pub(crate) fn is_unculled_leaf(&self, leaf: usize) -> bool {
        self.levels[leaf] == UNCULLED
    }

    /// Returns a token for a set that was finished at the present state of the tree. As long as the token
    /// lives, [`contents_at`](Self::contents_at) returns the nodes as they were at this state. `None` on
    /// processors without atomic counts.
    pub(crate) fn token(&self) -> Option<Token> {
        self.history.token()
    }

    /// Returns the level and the ids of a node, as they were at the state of `token`; for `None`, as they are
    /// now.
    pub(crate) fn contents_at(&self, node: usize, token: Option<&Token>) -> (u8, &[ObjectId; FAN_OUT]) {
        self.history.at(node, token).unwrap_or_else(|| (self.levels[node], &self.ids[node]))
    }

    /// Keeps the ids of a node for [`contents_at`](Self::contents_at), if a set that holds a
    /// [token](Self::token) may still read them. To be called before the ids are changed.
    #[inline]
    pub(super) fn before_change(&mut self, node: usize) {
        if self.history.is_needed() {
            self.history.copy(node, self.occupied.len(), self.levels[node], &self.ids[node]);
        }
    }

    /// Iterates over the pairs of node and lane from `(node, lane)` up to the root, beginning with that pair.
    pub(crate) fn path(&self, node: usize, lane: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let start = Slot::new(node as u32, lane);
        core::iter::successors(Some(start), |slot| self.parent(slot.node() as u32))
            .map(|slot| (slot.node(), slot.lane()))
    }

    /// Returns the number of bytes in use, without reserved capacity.
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
            + size_of_val(&self.detail_bounds[..])
            + size_of_val(&self.detailed[..])
            + size_of_val(&self.details[..])
            + self.history.memory()
            + self.scratch.memory()
    }

    /// Returns a free lane in `node`. A full node is split first, and the free lane is then in the half whose
    /// centre is nearer to that of `bounds`.
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

    /// Splits a full node at the median of the axis along which the centres of its children spread most.
    /// Moves the upper half to a new sibling and returns the sibling's number.
    fn split(&mut self, node: u32) -> u32 {
        let level = self.levels[node as usize];
        let other = self.allocate(level);
        let mut order: [usize; FAN_OUT] = core::array::from_fn(|lane| lane);
        let centers: [_; FAN_OUT] =
            core::array::from_fn(|lane| self.bounds[node as usize].get(lane).center());
        let spread = Aabb::from_points(centers);
        let axis = longest_axis(spread.half_extent().to_array());
        order.sort_unstable_by(|&a, &b| centers[a][axis].total_cmp(&centers[b][axis]).then(a.cmp(&b)));
        for (lane, &from) in order[32..].iter().enumerate() {
            let (from, to) = (Slot::new(node, from), Slot::new(other, lane));
            if level == 0 {
                let (bounds, payload) = (self.bounds_in(from), self.payload(from));
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
        // The bounds of `node` in its parent contain both halves until `tighten`; no ancestor grows.
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

/// Returns twice the distance between the centres of two boxes, summed over the axes, in metres; the factor
/// saves halving. Used to compare nodes when one is chosen for a box.
pub(super) fn separation(a: &Aabb, b: &Aabb) -> f32 {
    let d = ((a.min - b.min) + (a.max - b.max)).abs();
    d.x + d.y + d.z
}

/// Returns the occupied lane whose box needs the least enlargement, summed over the axes, to contain
/// `bounds`; among equals, the lane with the nearest centre. `occupied` must not be 0.
fn closest_lane(boxes: &Boxes64, occupied: u64, bounds: &Aabb) -> usize {
    let c = &boxes.coordinates;
    let (min, max) = (bounds.min, bounds.max);
    let mut cost = [0.0f32; FAN_OUT];
    let mut distance = [0.0f32; FAN_OUT];
    for axis in 0..3 {
        let (low, high) = (min[axis], max[axis]);
        for lane in 0..FAN_OUT {
            let below = c[axis][lane] - low;
            let above = high - c[axis + 3][lane];
            cost[lane] += if below > 0.0 { below } else { 0.0 } + if above > 0.0 { above } else { 0.0 };
            distance[lane] += (below - above).abs();
        }
    }
    let mut best = occupied.trailing_zeros() as usize % FAN_OUT;
    for lane in lanes(occupied) {
        if (cost[lane], distance[lane]) < (cost[best], distance[best]) {
            best = lane;
        }
    }
    best
}

#[cfg(test)]
mod tests;
