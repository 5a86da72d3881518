//! Regrouping: the contents of a few neighbouring nodes are redistributed among these nodes, so that their
//! bounds overlap less.
//!
//! Moving objects make the bounds of their nodes overlap. Reinserting one object after the other, as in the
//! R*-tree (Beckmann et al., 1990), splits full nodes and leaves others half empty. Redistributing all
//! objects of a neighbourhood keeps nodes as full as they were. The same is done with the nodes of each level
//! above.

use super::super::boxes64::{Boxes64, FAN_OUT, lanes};
use super::pack::{number, pack};
use super::{Slot, Tree, separation};
use crate::{Aabb, ObjectId};
use glam::Vec3A;

/// Greatest number of nodes that are regrouped at once.
pub(in crate::scene) const GROUP: usize = 8;

/// At most [`GROUP`] nodes of one level, by descending nearness to the group's first node. See [`nearness`]
/// for that measure.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Group {
    nodes: [u32; GROUP],
    nearness: [f32; GROUP],
    count: usize,
}

impl Group {
    const EMPTY: Self = Self { nodes: [0; GROUP], nearness: [0.0; GROUP], count: 0 };

    pub(in crate::scene) fn nodes(&self) -> &[u32] {
        &self.nodes[..self.count]
    }

    /// Inserts a node into the group by descending nearness. If the group is full, its node of least nearness
    /// is dropped, which may be the new one.
    fn insert_by_nearness(&mut self, node: u32, nearness: f32) {
        let mut at = self.count;
        while at > 0 && self.nearness[at - 1] < nearness {
            at -= 1;
        }
        if at == GROUP {
            return;
        }
        self.count = (self.count + 1).min(GROUP);
        self.nodes.copy_within(at..self.count - 1, at + 1);
        self.nearness.copy_within(at..self.count - 1, at + 1);
        (self.nodes[at], self.nearness[at]) = (node, nearness);
    }

    /// Returns the sum, over all nodes but the first, of the fraction of the first node's bounds that the
    /// node covers. Exceeds 1 where several nodes cover the same part.
    pub(in crate::scene) fn overlap(&self) -> f32 {
        self.nearness[1..].iter().zip(1..self.count).map(|(n, _)| n.max(0.0)).sum()
    }

    pub(in crate::scene) fn truncate(&mut self, count: usize) {
        self.count = self.count.min(count);
    }
}

impl Tree {
    /// Returns the group of a node: the node itself first, then the nodes of its level that overlap it most,
    /// or that are nearest if too few overlap. Found by a search from the root that keeps only the best few
    /// nodes on each level, so better neighbours may be missed. The root has an empty group.
    pub(in crate::scene) fn neighbours(&self, node: u32) -> Group {
        let Some(above) = self.parent(node) else { return Group::EMPTY };
        let home = self.bounds_in(above);
        let level = self.levels[node as usize];
        // The node and its ancestors, indexed by height above the node. Each stays in the group of its level
        // whatever its nearness.
        let mut ancestors = [node; 16];
        let mut height = 0;
        let mut at = node;
        while let Some(above) = self.parent(at) {
            at = above.node() as u32;
            height += 1;
            ancestors[height] = at;
        }
        let mut group = Group::EMPTY;
        group.insert_by_nearness(at, f32::INFINITY);
        // From the root down, level by level: children of the best nodes found above, ranked by overlap with
        // the node's box or by distance from it.
        for depth in (0..height).rev() {
            let mut below = Group::EMPTY;
            below.insert_by_nearness(ancestors[depth], f32::INFINITY);
            for &node in group.nodes() {
                let node = node as usize;
                let nearness = nearness(&self.bounds[node], &home);
                for lane in lanes(self.occupied[node]) {
                    if below.count < GROUP || nearness[lane] > below.nearness[GROUP - 1] {
                        let child = self.child(node, lane) as u32;
                        if child != ancestors[depth] {
                            below.insert_by_nearness(child, nearness[lane]);
                        }
                    }
                }
            }
            group = below;
        }
        debug_assert!(
            group.nodes().iter().all(|&n| self.levels[n as usize] == level),
            "the group of node {node} is of level {level}"
        );
        group
    }

    /// Redistributes the contents of a group's nodes if the sum of the sizes of their bounds shrinks below
    /// [`MIN_SHRINK`] of the former sum, or if fewer nodes suffice and that sum does not grow. With `merge`
    /// true, it is enough that fewer nodes suffice, whatever the sizes. Nodes left empty are freed.
    ///
    /// Returns the number of objects that moved to another node; for nodes above the leaves, the number of
    /// child nodes. After `Some(0)` objects may still have changed lanes. `None` if nothing was changed.
    pub(in crate::scene) fn regroup(&mut self, group: &Group, merge: bool) -> Option<usize> {
        let nodes = group.nodes();
        // Collects the contents of all nodes of the group, numbered by member and lane, and the sum of the
        // sizes of the nodes' boxes before the change.
        let mut boxes = [Aabb::EMPTY; FAN_OUT * GROUP];
        let mut centers = [Vec3A::ZERO; FAN_OUT * GROUP];
        let mut order = [0u64; FAN_OUT * GROUP];
        let mut hulls = [Aabb::EMPTY; GROUP];
        let mut count = 0;
        let mut before = 0.0;
        for (member, &node) in nodes.iter().enumerate() {
            for lane in lanes(self.occupied[node as usize]) {
                let bounds = self.bounds[node as usize].get(lane);
                let number = member * FAN_OUT + lane;
                (boxes[number], centers[number]) = (bounds, bounds.center().into());
                order[count] = number as u64;
                count += 1;
                hulls[member] = hulls[member].union(&bounds);
            }
            before += size(&hulls[member]);
        }
        // Chooses the smallest number of nodes that hold the contents with some lanes to spare.
        let mut wanted = nodes.len();
        while wanted > 1 && count <= (wanted - 1) * MERGE_FILL {
            wanted -= 1;
        }
        // A trial: divides the contents anew, and compares the sums of box sizes before anything is written.
        let mut pieces = [(0, 0, Aabb::EMPTY); GROUP];
        let (mut done, mut start, mut after) = (0, 0, 0.0);
        pack(&mut order[..count], &centers, wanted, &mut |piece| {
            let hull = piece.iter().fold(Aabb::EMPTY, |hull, &word| hull.union(&boxes[number(word)]));
            pieces[done] = (start, start + piece.len(), hull);
            after += size(&hull);
            done += 1;
            start += piece.len();
        });
        let better = after < before * MIN_SHRINK || wanted < nodes.len() && (merge || after <= before);
        if !better {
            return None;
        }

        // Copies of the old contents, since nodes are overwritten before all have been read.
        let level = self.levels[nodes[0] as usize];
        let mut ids = [[ObjectId::PLACEHOLDER; FAN_OUT]; GROUP];
        let mut layers = [[0; FAN_OUT]; GROUP];
        let (mut occluders, mut detailed) = ([0; GROUP], [0; GROUP]);
        for (member, &node) in nodes.iter().enumerate() {
            self.before_change(node as usize);
            ids[member] = self.ids[node as usize];
            layers[member] = self.layers[node as usize];
            occluders[member] = self.occluders[node as usize];
            detailed[member] = self.detailed[node as usize];
        }
        let mut free = (1u32 << nodes.len()) - 1;
        let mut moved = 0;
        for &(start, end, hull) in &pieces[..wanted] {
            // Each piece goes to the nearest free node of the group, so that bounds above change little.
            let member = lanes(free.into())
                .min_by(|&a, &b| separation(&hulls[a], &hull).total_cmp(&separation(&hulls[b], &hull)))
                .unwrap_or(0);
            free &= !(1 << member);
            let node = nodes[member] as usize;
            let mut new_boxes = Boxes64::EMPTY;
            let mut new_ids = [ObjectId::PLACEHOLDER; FAN_OUT];
            let mut new_layers = [u32::MAX; FAN_OUT];
            let (mut new_occluders, mut new_detailed) = (0, 0);
            for (lane, &word) in order[start..end].iter().enumerate() {
                let (from, old) = (number(word) / FAN_OUT, number(word) % FAN_OUT);
                new_boxes.set(lane, &boxes[number(word)]);
                new_ids[lane] = ids[from][old];
                new_layers[lane] = layers[from][old];
                new_occluders |= (occluders[from] >> old & 1) << lane;
                new_detailed |= (detailed[from] >> old & 1) << lane;
                moved += usize::from(from != member);
            }
            let slots = if level == 0 { &mut self.slots } else { &mut self.parents };
            for (lane, id) in new_ids[..end - start].iter().enumerate() {
                slots[id.index()] = Slot::new(node as u32, lane);
            }
            self.bounds[node] = new_boxes;
            self.ids[node] = new_ids;
            self.layers[node] = new_layers;
            self.occluders[node] = new_occluders;
            self.occupied[node] = if end - start == FAN_OUT { u64::MAX } else { (1 << (end - start)) - 1 };
            self.detailed[node] = new_detailed;
        }
        // Nodes left over become empty and are freed.
        for member in lanes(free.into()) {
            let node = nodes[member] as usize;
            self.bounds[node] = Boxes64::EMPTY;
            self.ids[node] = [ObjectId::PLACEHOLDER; FAN_OUT];
            self.layers[node] = [u32::MAX; FAN_OUT];
            self.occluders[node] = 0;
            self.detailed[node] = 0;
            self.occupied[node] = 0;
            self.remove_empty(node as u32);
        }
        for (member, &node) in nodes.iter().enumerate() {
            if free >> member & 1 == 0 {
                self.tighten(node);
                self.lower(node);
            }
        }
        Some(moved)
    }
}

/// Greatest average number of items per remaining node, out of 64 lanes, up to which the nodes of a group are
/// merged.
const MERGE_FILL: usize = 60;
/// Regrouping is carried out if it reduces the sum of the [sizes](size) of the nodes' bounds below this
/// fraction of the former sum.
const MIN_SHRINK: f32 = 0.97;

/// Returns the sum of the half sides of a box, which is proportional to its mean width, and so to the
/// probability that a random plane crosses the box.
fn size(bounds: &Aabb) -> f32 {
    let extent = bounds.half_extent();
    extent.x + extent.y + extent.z
}

/// For each lane, returns a measure of how near its box is to `home`. For a box that overlaps `home`, this is
/// the fraction of `home` that the box covers, up to 1. Otherwise it is negative: minus the gaps between the
/// boxes, summed over the axes and relative to the sides of `home`.
fn nearness(boxes: &Boxes64, home: &Aabb) -> [f32; FAN_OUT] {
    let c = &boxes.coordinates;
    let (min, max) = (home.min, home.max);
    let mut shared = [1.0f32; FAN_OUT];
    let mut apart = [0.0f32; FAN_OUT];
    let size = max - min;
    let least = size.max_element() * 1e-3 + f32::MIN_POSITIVE;
    for axis in 0..3 {
        let (low, high, scale) = (min[axis], max[axis], 1.0 / (size[axis] + least));
        for lane in 0..FAN_OUT {
            let from = if c[axis][lane] > low { c[axis][lane] } else { low };
            let to = if c[axis + 3][lane] < high { c[axis + 3][lane] } else { high };
            let overlap = (to - from + least) * scale;
            shared[lane] *= if overlap > 0.0 { overlap } else { 0.0 };
            apart[lane] += if overlap < 0.0 { overlap } else { 0.0 };
        }
    }
    for lane in 0..FAN_OUT {
        shared[lane] = if apart[lane] < 0.0 { apart[lane] } else { shared[lane] };
    }
    shared
}
