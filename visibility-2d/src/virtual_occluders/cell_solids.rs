//! Solids around a viewcell that may occlude, in a tree on the plan.

use super::lines::{Point, U, left_of};
use super::solids::PlanSolids;
use crate::median_order::{LEAF, put_in_order};
use alloc::vec::Vec;
use visibility_core::geometry::sqrt;

/// Maximum number of children of an inner node.
const FAN: usize = 8;

/// Maximum number of solids of a viewcell. The solids that look largest are used.
const MAX_SOLIDS: usize = 2048;

/// Box that contains all viewpoints, relative to the scene's origin: the plan's two coordinates and the
/// height.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct CellBox {
    pub(crate) min: [f64; 3],
    pub(crate) max: [f64; 3],
}

impl CellBox {
    /// Returns the corners on the plan.
    pub(crate) fn corners(&self) -> [Point; 4] {
        let ([x0, y0, _], [x1, y1, _]) = (self.min, self.max);
        [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|[x, y]| Point::exact(x, y))
    }

    /// Returns a lower bound in metres on the distance on the plan between the viewcell and a rectangle.
    pub(crate) fn distance(&self, min: [f64; 2], max: [f64; 2]) -> f64 {
        let gap = |axis: usize| (min[axis] - self.max[axis]).max(self.min[axis] - max[axis]).max(0.0);
        sqrt(gap(0) * gap(0) + gap(1) * gap(1)) * (1.0 - 8.0 * U)
    }

    /// Returns an upper bound in metres on the distance on the plan between a point and any point of the
    /// viewcell.
    fn reach(&self, x: f64, y: f64) -> f64 {
        let along = |at: f64, axis: usize| (at - self.min[axis]).abs().max((at - self.max[axis]).abs());
        let (dx, dy) = (along(x, 0), along(y, 1));
        sqrt(dx * dx + dy * dy) * (1.0 + 8.0 * U)
    }
}

/// Upright edge of a solid, as seen from a viewcell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Post {
    pub(crate) at: Point,
    /// Upper bound on the height of the post's lower end.
    pub(crate) low: f64,
    /// Greatest slope, in metres of rise per metre on the plan, up to which lines of sight from the viewcell
    /// certainly meet the post instead of passing above it. -1 if the post's top is below the highest
    /// viewpoint.
    pub(crate) slope: f64,
}

/// Solid around a viewcell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellSolid {
    first: u32,
    count: u32,
    /// Estimate of the solid angle at the nearest point of the viewcell: width times height over squared
    /// distance.
    pub(crate) size: f64,
    /// Middle of the solid's bounds on the plan, in metres.
    pub(crate) middle: [f64; 2],
    /// Distance in metres between the middles of the solid and of the viewcell.
    pub(crate) distance: f64,
    min: [f64; 2],
    max: [f64; 2],
    /// Greatest slope of the solid's posts.
    pub(crate) slope: f64,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    min: [f64; 2],
    max: [f64; 2],
    slope: f64,
}

/// Solids around a viewcell. On the plan, no solid meets the viewcell.
#[derive(Clone, Debug)]
pub(crate) struct CellSolids {
    /// Chosen solids, in the order of the tree's leaves.
    solids: Vec<CellSolid>,
    posts: Vec<Post>,
    /// Posts in use after the last [`restrict`](Self::restrict), solid by solid. `used_ends` has the end of
    /// each solid's range.
    used: Vec<Post>,
    used_ends: Vec<u32>,
    levels: Vec<Vec<Node>>,
    /// Scratch: solids of candidate objects that reach above the viewpoints, as (size, index in
    /// `PlanSolids`).
    ranked: Vec<(f64, u32)>,
    order: Vec<([f64; 2], u32)>,
}

impl CellSolids {
    pub(crate) const fn new() -> Self {
        Self {
            solids: Vec::new(),
            posts: Vec::new(),
            used: Vec::new(),
            used_ends: Vec::new(),
            levels: Vec::new(),
            ranked: Vec::new(),
            order: Vec::new(),
        }
    }

    pub(crate) fn solids(&self) -> &[CellSolid] {
        &self.solids
    }

    /// Returns all posts of a solid, counter-clockwise.
    pub(crate) fn posts(&self, index: u32) -> &[Post] {
        let solid = &self.solids[index as usize];
        &self.posts[solid.first as usize..][..solid.count as usize]
    }

    /// Returns the posts of a solid that are in use after the last [`restrict`](Self::restrict),
    /// counter-clockwise.
    pub(crate) fn ring(&self, index: u32) -> &[Post] {
        let end = |index: usize| self.used_ends[index] as usize;
        let first = (index as usize).checked_sub(1).map_or(0, end);
        &self.used[first..end(index as usize)]
    }

    /// Returns whether all posts of a solid are in use after the last [`restrict`](Self::restrict).
    pub(crate) fn is_whole(&self, index: u32) -> bool {
        self.ring(index).len() == self.solids[index as usize].count as usize
    }

    /// Keeps in use only the posts whose slope is at least `slope` and for which `is_of_use` returns true.
    pub(crate) fn restrict(&mut self, slope: f64, is_of_use: impl Fn(&Post) -> bool) {
        self.used.clear();
        self.used_ends.clear();
        for solid in &self.solids {
            if solid.slope >= slope {
                let posts = &self.posts[solid.first as usize..][..solid.count as usize];
                self.used.extend(posts.iter().filter(|post| post.slope >= slope && is_of_use(post)));
            }
            self.used_ends.push(self.used.len() as u32);
        }
    }

    /// Returns whether the bounds of two solids on the plan touch.
    pub(crate) fn bounds_meet(&self, a: u32, b: u32) -> bool {
        let (a, b) = (&self.solids[a as usize], &self.solids[b as usize]);
        (0..2).all(|axis| a.min[axis] <= b.max[axis] && b.min[axis] <= a.max[axis])
    }

    /// Replaces the solids by those that look largest from a viewcell, among the objects for which
    /// `is_candidate` returns true. Solids that may touch the viewcell on the plan are left out.
    pub(crate) fn fill(&mut self, all: &PlanSolids, cell: &CellBox, is_candidate: impl Fn(u32) -> bool) {
        let middle = [0, 1].map(|axis| 0.5 * cell.min[axis] + 0.5 * cell.max[axis]);
        self.ranked.clear();
        // Approximate solid angle from the nearest eye of the viewcell, which only orders the solids.
        for (index, solid) in (0..).zip(&all.solids) {
            let height = solid.high - cell.max[2];
            if height > 0.0 && is_candidate(solid.object) {
                let distance = cell.distance(solid.min, solid.max).max(1e-3);
                let width = (solid.max[0] - solid.min[0]).max(solid.max[1] - solid.min[1]);
                let size = width * height / (distance * distance);
                if size > 0.0 {
                    self.ranked.push((size, index));
                }
            }
        }
        // Only the largest `MAX_SOLIDS` solids are kept. Equal sizes are ordered by index, so that the choice
        // is always the same.
        if self.ranked.len() > MAX_SOLIDS {
            self.ranked.select_nth_unstable_by(MAX_SOLIDS, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            self.ranked.truncate(MAX_SOLIDS);
        }
        self.order.clear();
        self.order.extend((0..).zip(&self.ranked).map(|(i, &(_, index))| {
            let solid = &all.solids[index as usize];
            ([0, 1].map(|axis| 0.5 * solid.min[axis] + 0.5 * solid.max[axis]), i)
        }));
        // Sorted so that neighbours share nodes of the tree made by `build`.
        put_in_order(&mut self.order);
        self.solids.clear();
        self.posts.clear();
        let corners = cell.corners();
        for &(at, i) in &self.order {
            let (size, index) = self.ranked[i as usize];
            let solid = &all.solids[index as usize];
            let ring = all.ring(solid);
            let first = self.posts.len();
            // The height above the eyes is rounded once, the distance is an upper bound, and sum and quotient
            // are rounded once each.
            self.posts.extend(ring.iter().map(|post| {
                // The least tangent, over all eyes of the cell, of the elevation of the post's top.
                let slope = ((post.high - cell.max[2]) * (1.0 - 4.0 * U) - 2.0 * solid.error)
                    / (cell.reach(post.x, post.y) + 2.0 * solid.error);
                let at = Point { x: post.x, y: post.y, error: solid.error };
                // A NaN slope, from infinite numbers, becomes -1.
                let slope = if slope >= 0.0 { slope * (1.0 - 8.0 * U) } else { -1.0 };
                Post { at, low: post.low + solid.error * (1.0 + 4.0 * U), slope }
            }));
            let ring = &self.posts[first..];
            // A solid that may touch the viewcell, or that is below the highest eye, hides nothing.
            // Twice the distance of vertices from posts holds its rounding.
            let doubt = 2.0 * (solid.error + solid.moved);
            if !is_apart(ring, doubt, &corners) || ring.iter().all(|post| post.slope < 0.0) {
                self.posts.truncate(first);
                continue;
            }
            let (dx, dy) = (at[0] - middle[0], at[1] - middle[1]);
            self.solids.push(CellSolid {
                first: first as u32,
                count: ring.len() as u32,
                size,
                middle: at,
                distance: sqrt(dx * dx + dy * dy),
                min: solid.min,
                max: solid.max,
                slope: ring.iter().map(|post| post.slope).fold(-1.0, f64::max),
            });
        }
        self.build();
    }

    fn build(&mut self) {
        self.levels.clear();
        if self.solids.is_empty() {
            return;
        }
        let of = |solid: &CellSolid| Node { min: solid.min, max: solid.max, slope: solid.slope };
        let join = |a: Node, b: Node| Node {
            min: [a.min[0].min(b.min[0]), a.min[1].min(b.min[1])],
            max: [a.max[0].max(b.max[0]), a.max[1].max(b.max[1])],
            slope: a.slope.max(b.slope),
        };
        let leaf = |solids: &[CellSolid]| solids.iter().map(of).reduce(join);
        self.levels.push(self.solids.chunks(LEAF).filter_map(leaf).collect());
        while let Some(below) = self.levels.last().filter(|level| level.len() > 1) {
            let above = below.chunks(FAN).filter_map(|nodes| nodes.iter().copied().reduce(join)).collect();
            self.levels.push(above);
        }
    }

    /// Calls `each` with the solids whose bounds a segment meets and whose greatest slope is at least
    /// `slope`.
    pub(crate) fn along(&self, from: [f64; 2], to: [f64; 2], slope: f64, each: &mut impl FnMut(u32)) {
        let segment = Segment::new(from, to);
        if let Some(top) = self.levels.len().checked_sub(1) {
            self.along_below(&segment, slope, top, 0, each);
        }
    }

    fn along_below(
        &self,
        segment: &Segment,
        slope: f64,
        level: usize,
        node: usize,
        each: &mut impl FnMut(u32),
    ) {
        let is_met = |min: [f64; 2], max: [f64; 2], reach: f64| reach >= slope && segment.meets(min, max);
        if level == 0 {
            for (index, solid) in (node * LEAF..).zip(self.solids.iter().skip(node * LEAF).take(LEAF)) {
                if is_met(solid.min, solid.max, solid.slope) {
                    each(index as u32);
                }
            }
            return;
        }
        let below = self.levels[level - 1].iter().skip(node * FAN).take(FAN);
        for (child, below) in (node * FAN..).zip(below) {
            if is_met(below.min, below.max, below.slope) {
                self.along_below(segment, slope, level - 1, child, each);
            }
        }
    }
}

/// Returns whether a solid and the viewcell are certainly separate on the plan: whether a side of the ring or
/// the viewcell separates the viewcell from all points within `doubt` metres of the ring.
fn is_apart(ring: &[Post], doubt: f64, corners: &[Point; 4]) -> bool {
    let at = |post: &Post| Point { error: doubt, ..post.at };
    let next = |i: usize| if i + 1 == ring.len() { 0 } else { i + 1 };
    let beside_cell = |i: usize| {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        ring.iter().all(|post| left_of(b, a, at(post)) > 0.0)
    };
    let beside_ring = |i: usize| {
        let (a, b) = (at(&ring[i]), at(&ring[next(i)]));
        corners.iter().all(|&corner| left_of(b, a, corner) > 0.0)
    };
    (0..4).any(beside_cell) || (0..ring.len()).any(beside_ring)
}

/// Segment that is tested against boxes. Rounding may miss a box; its solids then do not occlude.
struct Segment {
    min: [f64; 2],
    max: [f64; 2],
    from: [f64; 2],
    along: [f64; 2],
}

impl Segment {
    fn new(from: [f64; 2], to: [f64; 2]) -> Self {
        let axis = |i: usize| (from[i].min(to[i]), from[i].max(to[i]));
        let ((x0, x1), (y0, y1)) = (axis(0), axis(1));
        Self { min: [x0, y0], max: [x1, y1], from, along: [to[0] - from[0], to[1] - from[1]] }
    }

    #[inline]
    fn meets(&self, min: [f64; 2], max: [f64; 2]) -> bool {
        let overlap = |i: usize| self.min[i] <= max[i] && min[i] <= self.max[i];
        let (cx, cy) = (0.5 * (min[0] + max[0]) - self.from[0], 0.5 * (min[1] + max[1]) - self.from[1]);
        let (hx, hy) = (0.5 * (max[0] - min[0]), 0.5 * (max[1] - min[1]));
        let across = (self.along[0] * cy - self.along[1] * cx).abs();
        let reach = self.along[0].abs() * hy + self.along[1].abs() * hx;
        overlap(0) && overlap(1) && across <= reach * (1.0 + 1e-9)
    }
}
