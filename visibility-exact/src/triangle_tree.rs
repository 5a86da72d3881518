//! A tree of boxes over the occluding triangles. It finds the triangles that a segment crosses, and the first
//! that a ray meets.

use crate::line_side::{Crossing, segment_triangle, side, sign};
use alloc::{vec, vec::Vec};
use visibility_core::glam::{DVec3, Vec3};

/// A binary tree of bounding boxes, split by the surface-area heuristic. Triangles that are added later are
/// in a second tree of the same kind.
#[derive(Clone, Debug, Default)]
pub(crate) struct TriangleTree {
    nodes: Vec<Node>,
    /// Indices of the tree's triangles among all triangles of the scene, leaf after leaf. Each leaf has a
    /// range of this list.
    order: Vec<u32>,
    /// For each entry of `order`, the corners of the triangle in scene coordinates.
    corners: Vec<[Vec3; 3]>,
    /// For each entry of `order`, from which sides the triangle stops segments.
    stops: Vec<Stops>,
    /// Number of nodes of the first tree, which come before those of the tree over added triangles.
    first_nodes: usize,
    /// Number of entries of `order` of the first tree, which come before those of added triangles.
    first_count: usize,
    /// For each triangle, its position in `order` if the first tree has it, `u32::MAX` if not. Empty until a
    /// triangle is removed.
    places: Vec<u32>,
}

/// Sides of a triangle from which it stops segments and rays.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Stops {
    /// Both sides.
    Both,
    /// The front alone: segments from behind pass a one-sided triangle.
    Front,
    /// No side: the triangle was removed.
    Neither,
}

impl Stops {
    fn new(is_one_sided: bool) -> Self {
        if is_one_sided { Self::Front } else { Self::Both }
    }
}

/// A node of the tree. The first child of an inner node is the next node in the list.
#[derive(Clone, Copy, Debug)]
struct Node {
    min: Vec3,
    max: Vec3,
    /// For an inner node, the index in `nodes` of its second child. For a leaf, the index in `order` of its
    /// first triangle.
    link: u32,
    /// Number of triangles of a leaf, which follow each other in `order`. 0 for an inner node.
    count: u32,
}

/// Bounding box of one triangle, used while the tree is built.
struct LeafBox {
    min: Vec3,
    max: Vec3,
    /// Index of the triangle.
    number: u32,
}

impl LeafBox {
    /// Returns the middle of the box. Each corner is halved before the sum, which then cannot overflow.
    fn middle(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }
}

/// Greatest number of triangles in a leaf.
const LEAF: usize = 4;
/// Depth in the tree (0 for the root) from which nodes are split at the median. This bounds the depth of the
/// tree.
const DEEP: usize = 48;
/// Upper bound on the depth of a tree: [`DEEP`] levels, then at most 32 halvings of up to 2^32 triangles. One
/// more entry is the root of the second tree, and two are reserve.
const STACK: usize = DEEP + 35;
/// Greatest number of triangles that a segment may touch without certainly crossing them. A search ends after
/// more.
const TOUCHED: u32 = 4096;
/// Number of bins along an axis into which the surface-area heuristic sorts boxes to choose a split.
const BINS: usize = 16;

impl TriangleTree {
    /// Builds the tree over the triangles whose indices are in `order`. Segments and rays pass a one-sided
    /// triangle from behind.
    pub(crate) fn new(all: &[[Vec3; 3]], order: Vec<u32>, is_one_sided: impl Fn(u32) -> bool) -> Self {
        let mut tree = Self::default();
        tree.append(all, &order, is_one_sided);
        (tree.first_nodes, tree.first_count) = (tree.nodes.len(), tree.order.len());
        tree
    }

    /// Builds a tree over the triangles whose indices are in `numbers`, behind the nodes and entries so far.
    fn append(&mut self, all: &[[Vec3; 3]], numbers: &[u32], is_one_sided: impl Fn(u32) -> bool) {
        let leaf = |&number: &u32| {
            let (min, max) = bounds(&all[number as usize]);
            LeafBox { min, max, number }
        };
        let mut boxes: Vec<LeafBox> = numbers.iter().map(leaf).collect();
        if boxes.is_empty() {
            return;
        }
        self.build(&mut boxes, self.order.len(), 0);
        for leaf in boxes {
            self.order.push(leaf.number);
            self.corners.push(all[leaf.number as usize]);
            self.stops.push(Stops::new(is_one_sided(leaf.number)));
        }
    }

    /// Replaces the added triangles by those whose indices are in `numbers`, and builds the second tree over
    /// them. Time is O(n log n) in their number.
    pub(crate) fn set_added(
        &mut self,
        all: &[[Vec3; 3]],
        numbers: &[u32],
        is_one_sided: impl Fn(u32) -> bool,
    ) {
        self.nodes.truncate(self.first_nodes);
        self.order.truncate(self.first_count);
        self.corners.truncate(self.first_count);
        self.stops.truncate(self.first_count);
        self.append(all, numbers, is_one_sided);
    }

    /// Returns the number of triangles of the first tree, removed ones included.
    pub(crate) fn first_count(&self) -> usize {
        self.first_count
    }

    /// Removes a triangle from the first tree. Nothing happens if the first tree does not contain it. The
    /// first removal takes time in proportion to the tree's size, any other a constant time.
    pub(crate) fn remove(&mut self, number: u32) {
        #[cfg(test)]
        visibility_testing::step();
        if self.places.is_empty() {
            let order = &self.order[..self.first_count];
            self.places = vec![u32::MAX; order.iter().map(|&t| t as usize + 1).max().unwrap_or(0)];
            for (&t, place) in order.iter().zip(0..) {
                #[cfg(test)]
                visibility_testing::step();
                self.places[t as usize] = place;
            }
        }
        let place = self.places.get(number as usize).copied().filter(|&place| place != u32::MAX);
        if let Some(stops) = place.and_then(|place| self.stops.get_mut(place as usize)) {
            *stops = Stops::Neither;
        }
    }

    /// Returns the roots of both trees, as indices in `nodes`, and their number.
    fn roots(&self) -> ([u32; 2], usize) {
        let second = self.first_nodes as u32;
        match (second > 0, self.nodes.len() > self.first_nodes) {
            (true, true) => ([0, second], 2),
            (false, false) => ([0, 0], 0),
            _ => ([0, 0], 1),
        }
    }

    /// Adds the nodes over `boxes`, and sorts `boxes` into the order of the leaves. `first` is the position
    /// of `boxes[0]` in the list of all boxes.
    fn build(&mut self, boxes: &mut [LeafBox], first: usize, depth: usize) {
        let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (mut least, mut greatest) = (min, max);
        for leaf in &*boxes {
            (min, max) = (min.min(leaf.min), max.max(leaf.max));
            (least, greatest) = (least.min(leaf.middle()), greatest.max(leaf.middle()));
        }
        let node = self.nodes.len();
        self.nodes.push(Node { min, max, link: first as u32, count: boxes.len() as u32 });
        if boxes.len() <= LEAF {
            return;
        }
        let extent = greatest - least;
        let axis = extent.max_position();
        // Binned surface-area heuristic, along the longest axis of the boxes' centres.
        let bin = |leaf: &LeafBox| {
            let place = (leaf.middle()[axis] - least[axis]) / extent[axis];
            ((place * BINS as f32) as usize).min(BINS - 1)
        };
        let mut split = 0;
        if extent[axis] > 0.0 && depth < DEEP {
            let best = best_bin(boxes, bin);
            for k in 0..boxes.len() {
                if bin(&boxes[k]) < best {
                    boxes.swap(split, k);
                    split += 1;
                }
            }
        }
        // Equal centres, or too deep a tree: the boxes are halved by count.
        if split == 0 || split == boxes.len() {
            split = boxes.len() / 2;
            let key = |leaf: &LeafBox| leaf.middle()[axis];
            boxes.select_nth_unstable_by(split, |a, b| {
                key(a).total_cmp(&key(b)).then(a.number.cmp(&b.number))
            });
        }
        let (one, other) = boxes.split_at_mut(split);
        self.build(one, first, depth + 1);
        self.nodes[node].link = self.nodes.len() as u32;
        self.nodes[node].count = 0;
        self.build(other, first + split, depth + 1);
    }

    /// Collects up to `most` triangles that the segment from p to q certainly crosses. Leaves out triangle
    /// `skip`, and one-sided triangles that p is certainly behind. Returns whether the segment may touch
    /// triangles that are not in `hits`. This is also true if the search ended early, after `most` triangles
    /// or after [`TOUCHED`] uncertain ones.
    pub(crate) fn crossed(&self, p: DVec3, q: DVec3, skip: u32, most: usize, hits: &mut Vec<u32>) -> bool {
        hits.clear();
        let (mut unsure, mut touched) = (false, 0);
        self.walk(p, q, |first, count| {
            for k in first..first + count {
                let stops = self.stops[k];
                if self.order[k] == skip || stops == Stops::Neither {
                    continue;
                }
                let corners = self.corners[k].map(Vec3::as_dvec3);
                match segment_triangle(p, q, &corners) {
                    Crossing::Yes | Crossing::Unsure if stops == Stops::Front && is_behind(p, &corners) => {}
                    Crossing::Yes => {
                        hits.push(self.order[k]);
                        unsure |= hits.len() >= most;
                        if hits.len() >= most {
                            return false;
                        }
                    }
                    Crossing::Unsure => {
                        (unsure, touched) = (true, touched + 1);
                        if most == 1 || touched >= TOUCHED {
                            return false;
                        }
                    }
                    Crossing::No => {}
                }
            }
            true
        });
        unsure
    }

    /// Calls `visit` for each leaf whose box the segment from `p` to `q` may touch, until `visit` returns
    /// false. Its arguments are the position of the leaf's first triangle in `order`, and the number of
    /// triangles.
    ///
    /// The distance to a face of a box along the segment is one rounded difference divided by another: its
    /// relative error is at most 4 times the unit round-off. Two such distances from 0 to 1 are compared, and
    /// 1e-12 covers their errors.
    fn walk(&self, p: DVec3, q: DVec3, mut visit: impl FnMut(usize, usize) -> bool) {
        let direction = q - p;
        let inverse = direction.map(|x| if x.abs() < 1e-200 { 1e200 } else { 1.0 / x });
        let (low, high) = (p.min(q), p.max(q));
        let (roots, mut top) = self.roots();
        let mut stack = [0u32; STACK];
        stack[..2].copy_from_slice(&roots);
        while top > 0 {
            top -= 1;
            let at = stack[top];
            let node = &self.nodes[at as usize];
            let (min, max) = (node.min.as_dvec3(), node.max.as_dvec3());
            if !(min.cmple(high).all() && max.cmpge(low).all()) {
                continue;
            }
            let (a, b) = ((min - p) * inverse, (max - p) * inverse);
            // The comparison of boxes above has decided the axes along which the segment does not move.
            let still = direction.abs().cmplt(DVec3::splat(1e-200));
            let enter = DVec3::select(still, DVec3::ZERO, a.min(b)).max_element().max(0.0);
            let leave = DVec3::select(still, DVec3::ONE, a.max(b)).min_element().min(1.0);
            if enter > leave + 1e-12 {
                continue;
            }
            if node.count > 0 {
                if !visit(node.link as usize, node.count as usize) {
                    return;
                }
            } else {
                stack[top] = node.link;
                stack[top + 1] = at + 1;
                top += 2;
            }
        }
    }

    /// Returns the triangle that the ray from p along d meets first, and its distance in multiples of d's
    /// length. `None` if the ray meets no triangle. Computed in ordinary floating point without error bounds,
    /// so the caller must verify the answer.
    pub(crate) fn nearest(&self, p: DVec3, d: DVec3) -> Option<(f64, u32)> {
        let inverse = d.map(|x| if x.abs() < 1e-200 { 1e200 } else { 1.0 / x });
        let enter = |node: &Node| {
            let (a, b) = ((node.min.as_dvec3() - p) * inverse, (node.max.as_dvec3() - p) * inverse);
            let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
            if enter <= leave { enter } else { f64::INFINITY }
        };
        let mut best: Option<(f64, u32)> = None;
        let mut reach = f64::MAX;
        let (roots, mut top) = self.roots();
        let mut stack = [(0u32, 0.0f64); STACK];
        for (entry, root) in stack.iter_mut().zip(roots) {
            entry.0 = root;
        }
        while top > 0 {
            top -= 1;
            let (at, distance) = stack[top];
            if distance > reach {
                continue;
            }
            let node = &self.nodes[at as usize];
            if node.count > 0 {
                for k in node.link as usize..(node.link + node.count) as usize {
                    if let Some(distance) = hit(p, d, &self.corners[k], self.stops[k])
                        && distance < reach
                    {
                        (reach, best) = (distance, Some((distance, self.order[k])));
                    }
                }
                continue;
            }
            // The nearer child is pushed last, so it is visited first.
            let (first, second) = (at + 1, node.link);
            let (x, y) = (enter(&self.nodes[first as usize]), enter(&self.nodes[second as usize]));
            let pair = if x <= y { [(second, y), (first, x)] } else { [(first, x), (second, y)] };
            for entry in pair {
                if entry.1 <= reach {
                    stack[top] = entry;
                    top += 1;
                }
            }
        }
        best
    }
}

/// Returns the least and the greatest corner of the box around a triangle.
fn bounds(t: &[Vec3; 3]) -> (Vec3, Vec3) {
    (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]))
}

/// Returns the split with the least cost, as the number of the first bin of the second child.
fn best_bin(boxes: &[LeafBox], bin: impl Fn(&LeafBox) -> usize) -> usize {
    let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY, 0usize);
    let mut bins = [empty; BINS];
    let join = |a: (Vec3, Vec3, usize), b: (Vec3, Vec3, usize)| (a.0.min(b.0), a.1.max(b.1), a.2 + b.2);
    for leaf in boxes {
        let into = &mut bins[bin(leaf)];
        *into = join(*into, (leaf.min, leaf.max, 1));
    }
    let cost = |(min, max, count): (Vec3, Vec3, usize)| {
        let d = (max - min).max(Vec3::ZERO).as_dvec3();
        (d.x * d.y + d.y * d.z + d.z * d.x) * count as f64
    };
    let mut after = [empty; BINS + 1];
    for k in (0..BINS).rev() {
        after[k] = join(after[k + 1], bins[k]);
    }
    let (mut before, mut best, mut least) = (empty, 0, f64::INFINITY);
    for k in 1..BINS {
        before = join(before, bins[k - 1]);
        let sum = cost(before) + cost(after[k]);
        if before.2 > 0 && after[k].2 > 0 && sum < least {
            (best, least) = (k, sum);
        }
    }
    best
}

/// Returns whether a point is certainly behind a triangle: on the side from which the corners run clockwise.
fn is_behind(p: DVec3, &[a, b, c]: &[DVec3; 3]) -> bool {
    sign(side(p, a, b, c, 0.0)) > 0
}

/// Returns the distance at which a ray meets a triangle, in multiples of d's length. `None` if the ray misses
/// the triangle, or meets a side that does not stop it. Computed in floating point without error bounds
/// (Moeller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997).
fn hit(p: DVec3, d: DVec3, t: &[Vec3; 3], stops: Stops) -> Option<f64> {
    let t = t.map(Vec3::as_dvec3);
    let (e, f) = (t[1] - t[0], t[2] - t[0]);
    let h = d.cross(f);
    let determinant = e.dot(h);
    if stops == Stops::Neither || (stops == Stops::Front && determinant <= 0.0) {
        return None;
    }
    let s = p - t[0];
    let u = s.dot(h) / determinant;
    let c = s.cross(e);
    let v = d.dot(c) / determinant;
    let distance = f.dot(c) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0).then_some(distance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{vec, vec::Vec};
    use visibility_testing::Random;

    /// Axis-parallel rectangles far from the origin, and segments that start or end at their corners, or run
    /// in their planes. The tree finds each triangle that the triangle's own test does not rule out.
    #[test]
    fn triangles_that_touch_a_segment_are_found() {
        let mut random = Random(5);
        for round in 0..2000 {
            let far = random.vec3(-1.0, 1.0) * 10f64.powi(random.between(0, 6)) as f32;
            let mut all = Vec::new();
            for _ in 0..12 {
                let axis = random.below(3);
                let corner = far + random.vec3(-8.0, 8.0);
                let (mut a, mut b) = (Vec3::ZERO, Vec3::ZERO);
                a[(axis + 1) % 3] = random.range(0.5, 4.0) as f32;
                b[(axis + 2) % 3] = random.range(0.5, 4.0) as f32;
                all.push([corner, corner + a, corner + b]);
            }
            let tree = TriangleTree::new(&all, (0..12).collect(), |_| false);
            for _ in 0..20 {
                // The segment passes exactly through a corner of a triangle, or a point on its axis-parallel
                // side.
                let number = random.below(12) as u32;
                let t = all[number as usize].map(Vec3::as_dvec3);
                let part = f64::from(random.between(0, 4)) / 4.0;
                let x = t[0] + (t[1] - t[0]) * part;
                // Coordinates are multiples of 1 / 1024, so that sums are exact.
                let mut d = (random.fine_vector(8.0) * 1024.0).round() / 1024.0;
                if random.one_in(2) {
                    d[random.below(3)] = 0.0;
                }
                let (p, q) = match random.below(3) {
                    0 => (x, x + d),
                    1 => (x - d, x),
                    _ => (x - d, x + d),
                };
                let mut hits = vec![];
                let unsure = tree.crossed(p, q, u32::MAX, 100, &mut hits);
                for (k, t) in (0..).zip(&all) {
                    let is_crossed = segment_triangle(p, q, &t.map(Vec3::as_dvec3)) == Crossing::Yes;
                    assert!(!is_crossed || hits.contains(&k), "{round}: {p} {q}");
                }
                assert!(unsure || hits.contains(&number), "{round}: {p} {q}");
            }
        }
    }

    /// Right triangles of side 1 in planes x = 1, 2, ..., whose corners run counter-clockwise as seen from
    /// greater x.
    fn pages(count: usize) -> Vec<[Vec3; 3]> {
        let page = |x: f32| [Vec3::ZERO, Vec3::Y, Vec3::Z].map(|v| v + Vec3::X * x);
        (1..=count).map(|k| page(k as f32)).collect()
    }

    /// Segments that cross one-sided triangles from their fronts are stopped, those from behind pass, and one
    /// that begins in the plane may be stopped. Triangle `skip` stops none.
    #[test]
    fn one_sided_triangles_stop_segments_from_their_fronts() {
        let all = pages(3);
        let tree = TriangleTree::new(&all, (0..3).collect(), |t| t != 1);
        let at = |x: f64| DVec3::new(x, 0.25, 0.25);
        let crossed = |p: f64, q: f64, skip: u32| {
            let mut hits = vec![];
            let unsure = tree.crossed(at(p), at(q), skip, 100, &mut hits);
            hits.sort_unstable();
            (hits, unsure)
        };
        assert_eq!(crossed(4.0, 0.0, u32::MAX), (vec![0, 1, 2], false), "from the fronts");
        assert_eq!(crossed(0.0, 4.0, u32::MAX), (vec![1], false), "from behind");
        assert_eq!(crossed(4.0, 0.0, 2), (vec![0, 1], false), "without triangle 2");
        assert_eq!(crossed(3.0, 2.5, u32::MAX), (vec![], true), "from a point of triangle 2");
        assert_eq!(crossed(3.0, 3.5, 2), (vec![], false), "from a point of triangle 2, without it");
    }

    /// A search ends with as many triangles as are asked for, and counts as unsure then. One for a single
    /// triangle ends so too.
    #[test]
    fn searches_end_with_as_many_triangles_as_are_asked_for() {
        let all = pages(9);
        let tree = TriangleTree::new(&all, (0..9).collect(), |_| false);
        for most in 1..12 {
            let mut hits = vec![];
            let unsure = tree.crossed(
                DVec3::new(0.0, 0.25, 0.25),
                DVec3::new(20.0, 0.25, 0.25),
                u32::MAX,
                most,
                &mut hits,
            );
            assert_eq!((hits.len(), unsure), (most.min(9), most <= 9), "at most {most} of 9 triangles");
        }
    }

    /// Triangles that were added to an empty tree, or to none, are found once.
    #[test]
    fn each_triangle_of_both_trees_is_found_once() {
        let all = pages(20);
        for first in [0, 1, 10, 20] {
            let mut tree = TriangleTree::new(&all, (0..first).collect(), |_| false);
            tree.set_added(&all, &(first..20).collect::<Vec<u32>>(), |_| false);
            let mut hits = vec![];
            let (p, q) = (DVec3::new(0.0, 0.25, 0.25), DVec3::new(30.0, 0.25, 0.25));
            tree.crossed(p, q, u32::MAX, 100, &mut hits);
            hits.sort_unstable();
            assert_eq!(hits, (0..20).collect::<Vec<u32>>(), "{first} in the first tree");
            assert_eq!(
                tree.nearest(p, q - p).map(|hit| hit.1),
                Some(0),
                "{first} in the first tree: nearest"
            );
        }
    }

    /// Points at powers of 2 along each axis, of which a split by the heuristic takes a few off: the tree is
    /// no deeper than a walk allows.
    #[test]
    fn trees_of_points_at_all_scales_are_not_too_deep() {
        let powers = (-126..100).flat_map(|k| [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| axis * 2f32.powi(k)));
        let all: Vec<[Vec3; 3]> = powers.map(|p| [p; 3]).collect();
        let tree = TriangleTree::new(&all, (0..all.len() as u32).collect(), |_| false);
        let mut deepest = 0;
        let mut waiting = vec![(0, 1)];
        while let Some((at, depth)) = waiting.pop() {
            deepest = deepest.max(depth);
            let node = tree.nodes[at];
            if node.count == 0 {
                waiting.extend([(at + 1, depth + 1), (node.link as usize, depth + 1)]);
            }
        }
        assert!((DEEP..STACK - 2).contains(&deepest), "{deepest} nodes on a way from the root");
        let mut hits = vec![];
        assert!(tree.crossed(DVec3::ZERO, DVec3::X, u32::MAX, 10, &mut hits), "points that a segment meets");
        assert!(tree.nearest(-DVec3::ONE, DVec3::ONE).is_none(), "points stop no ray");
    }

    /// Triangles whose boxes all overlap are removed, and only those, in a step for each, and one for each
    /// triangle of the tree.
    #[test]
    fn removals_take_a_step_each() {
        for count in [250, 500, 1000] {
            let all: Vec<[Vec3; 3]> = (0..count)
                .map(|i| i as f32 / 1000.0)
                .map(|x| {
                    [[x, 0.0, 0.0], [x + 0.0005, 50.0, 0.0], [50.0 - x, 25.0, 3.0]].map(Vec3::from_array)
                })
                .collect();
            let mut tree = TriangleTree::new(&all, (0..count).collect(), |_| false);
            let steps = visibility_testing::steps_of(|| {
                (0..count).filter(|t| t % 3 > 0).for_each(|t| tree.remove(t));
            });
            std::println!("steps to remove two thirds of {count} triangles: {steps}");
            tree.remove(count);
            let mut hits = vec![];
            // A line along x, below the top corners, meets all triangles.
            tree.crossed(
                DVec3::new(-1.0, 25.0, 1.0),
                DVec3::new(60.0, 25.0, 1.001),
                u32::MAX,
                2000,
                &mut hits,
            );
            hits.sort_unstable();
            let left: Vec<u32> = (0..count).filter(|t| t % 3 == 0).collect();
            assert_eq!(hits, left, "triangles left of {count}");
            assert!(steps <= 2 * u64::from(count), "{steps} steps for {count} triangles");
        }
    }
}
