//! Regrouping: what lies in a few neighbouring nodes is dealt out among them anew, so that their bounds
//! overlap no more.
//!
//! Objects that move carry the bounds of their nodes over one another. Giving one object after the other a
//! new home, as in the R*-tree (Beckmann et al., 1990), splits full nodes and leaves others half empty;
//! dealing out all objects of a neighbourhood keeps nodes as full as they were. The same is done for the
//! nodes of each level above.

use super::super::boxes64::{Boxes64, lanes};
use super::pack::{number, pack};
use super::{Slot, Tree, separation};
use crate::{Aabb, ObjectId};
use glam::Vec3A;

/// So many nodes are regrouped at once, at most.
pub(in crate::scene) const GROUP: usize = 8;

/// Nodes of one level, and how much each is in the way of the first.
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

    /// Puts a node where its nearness belongs, if it is near enough.
    fn offer(&mut self, node: u32, nearness: f32) {
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

    /// What share of the first node's bounds the others cover, counted as often as they do.
    pub(in crate::scene) fn overlap(&self) -> f32 {
        self.nearness[1..].iter().zip(1..self.count).map(|(n, _)| n.max(0.0)).sum()
    }

    pub(in crate::scene) fn truncate(&mut self, count: usize) {
        self.count = self.count.min(count);
    }
}

impl Tree {
    /// A node and those of its level that overlap it most, or, if too few do, that are nearest. The tree is
    /// searched from its root, keeping only the best few nodes on each level.
    pub(in crate::scene) fn neighbours(&self, node: u32) -> Group {
        let Some(above) = self.parent(node) else { return Group::EMPTY };
        let home = self.bounds[above.node()].get(above.lane());
        let level = self.levels[node as usize];
        // The ancestors of the node, which stay in the group come what may.
        let mut ancestors = [node; 16];
        let mut height = 0;
        let mut at = node;
        while let Some(above) = self.parent(at) {
            at = above.node() as u32;
            height += 1;
            ancestors[height] = at;
        }
        let mut group = Group::EMPTY;
        group.offer(at, f32::INFINITY);
        for depth in (0..height).rev() {
            let mut below = Group::EMPTY;
            below.offer(ancestors[depth], f32::INFINITY);
            for &node in group.nodes() {
                let node = node as usize;
                let nearness = nearness(&self.bounds[node], &home);
                for lane in lanes(self.occupied[node]) {
                    if below.count < GROUP || nearness[lane] > below.nearness[GROUP - 1] {
                        let child = self.child(node, lane) as u32;
                        if child != ancestors[depth] {
                            below.offer(child, nearness[lane]);
                        }
                    }
                }
            }
            group = below;
        }
        debug_assert!(group.nodes().iter().all(|&n| self.levels[n as usize] == level));
        group
    }

    /// Deals out what is in the nodes of a group anew, if that makes their bounds smaller or, with `merge`,
    /// takes fewer nodes. Returns how many objects (or nodes, above the leaves) have got another node;
    /// slots have changed if that is not `None`.
    pub(in crate::scene) fn regroup(&mut self, group: &Group, merge: bool) -> Option<usize> {
        let nodes = group.nodes();
        let mut boxes = [Aabb::EMPTY; 64 * GROUP];
        let mut centers = [Vec3A::ZERO; 64 * GROUP];
        let mut order = [0u64; 64 * GROUP];
        let mut hulls = [Aabb::EMPTY; GROUP];
        let mut count = 0;
        let mut before = 0.0;
        for (place, &node) in nodes.iter().enumerate() {
            for lane in lanes(self.occupied[node as usize]) {
                let bounds = self.bounds[node as usize].get(lane);
                let number = place * 64 + lane;
                (boxes[number], centers[number]) = (bounds, bounds.center().into());
                order[count] = number as u64;
                count += 1;
                hulls[place] = hulls[place].union(&bounds);
            }
            before += size(&hulls[place]);
        }
        let mut wanted = nodes.len();
        while wanted > 1 && count <= (wanted - 1) * FILL {
            wanted -= 1;
        }
        let mut pieces = [(0, 0, Aabb::EMPTY); GROUP];
        let (mut done, mut start, mut after) = (0, 0, 0.0);
        pack(&mut order[..count], &centers, wanted, &mut |piece| {
            let hull = piece.iter().fold(Aabb::EMPTY, |hull, &word| hull.union(&boxes[number(word)]));
            pieces[done] = (start, start + piece.len(), hull);
            after += size(&hull);
            done += 1;
            start += piece.len();
        });
        let better = after < before * WORTH || wanted < nodes.len() && (merge || after <= before);
        if !better {
            return None;
        }

        // Copies of what is dealt out, since a node is written before all are read.
        let level = self.levels[nodes[0] as usize];
        let mut ids = [[ObjectId::NONE; 64]; GROUP];
        let mut layers = [[0; 64]; GROUP];
        let mut occluders = [0; GROUP];
        for (place, &node) in nodes.iter().enumerate() {
            ids[place] = self.ids[node as usize];
            layers[place] = self.layers[node as usize];
            occluders[place] = self.occluders[node as usize];
        }
        let mut free = (1u32 << nodes.len()) - 1;
        let mut moved = 0;
        for &(start, end, hull) in &pieces[..wanted] {
            // To the node that was nearest, so that those above change little.
            let place = lanes(free.into())
                .min_by(|&a, &b| separation(&hulls[a], &hull).total_cmp(&separation(&hulls[b], &hull)))
                .unwrap_or(0);
            free &= !(1 << place);
            let node = nodes[place] as usize;
            let mut dealt = Boxes64::EMPTY;
            let mut dealt_ids = [ObjectId::NONE; 64];
            let mut dealt_layers = [0; 64];
            let mut dealt_occluders = 0;
            for (lane, &word) in order[start..end].iter().enumerate() {
                let (from, old) = (number(word) / 64, number(word) % 64);
                dealt.set(lane, &boxes[number(word)]);
                dealt_ids[lane] = ids[from][old];
                dealt_layers[lane] = layers[from][old];
                dealt_occluders |= (occluders[from] >> old & 1) << lane;
                moved += usize::from(from != place);
            }
            let slots = if level == 0 { &mut self.slots } else { &mut self.parents };
            for (lane, id) in dealt_ids[..end - start].iter().enumerate() {
                slots[id.index()] = Slot::new(node as u32, lane);
            }
            self.bounds[node] = dealt;
            self.ids[node] = dealt_ids;
            self.layers[node] = dealt_layers;
            self.occluders[node] = dealt_occluders;
            self.occupied[node] = if end - start == 64 { u64::MAX } else { (1 << (end - start)) - 1 };
        }
        for place in lanes(free.into()) {
            let node = nodes[place] as usize;
            self.bounds[node] = Boxes64::EMPTY;
            self.ids[node] = [ObjectId::NONE; 64];
            self.occluders[node] = 0;
            self.occupied[node] = 0;
            self.remove_empty(node as u32);
        }
        for (place, &node) in nodes.iter().enumerate() {
            if free >> place & 1 == 0 {
                self.tighten(node);
            }
        }
        Some(moved)
    }
}

/// Nodes are merged until they hold so many on average.
const FILL: usize = 60;
/// What regrouping must leave of the sum of sizes.
const WORTH: f32 = 0.97;

/// How likely a plane is to cut a box, but for a factor: its mean width.
fn size(bounds: &Aabb) -> f32 {
    let extent = bounds.half_extent();
    extent.x + extent.y + extent.z
}

/// For each lane, what share of `home` it overlaps, or, where it does not, how far it is from it, as a
/// negative multiple of its size.
fn nearness(boxes: &Boxes64, home: &Aabb) -> [f32; 64] {
    let c = &boxes.coordinates;
    let (min, max) = (home.min, home.max);
    let mut shared = [1.0f32; 64];
    let mut apart = [0.0f32; 64];
    let size = max - min;
    let least = size.max_element() * 1e-3 + f32::MIN_POSITIVE;
    for axis in 0..3 {
        let (low, high, scale) = (min[axis], max[axis], 1.0 / (size[axis] + least));
        for lane in 0..64 {
            let from = if c[axis][lane] > low { c[axis][lane] } else { low };
            let to = if c[axis + 3][lane] < high { c[axis + 3][lane] } else { high };
            let overlap = (to - from + least) * scale;
            shared[lane] *= if overlap > 0.0 { overlap } else { 0.0 };
            apart[lane] += if overlap < 0.0 { overlap } else { 0.0 };
        }
    }
    for lane in 0..64 {
        shared[lane] = if apart[lane] < 0.0 { apart[lane] } else { shared[lane] };
    }
    shared
}
