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

    /// Changes the posts of all solids.
    #[cfg(test)]
    pub(crate) fn change_posts(&mut self, change: impl FnMut(&mut Post)) {
        self.posts.iter_mut().for_each(change);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::horizon::UpAxis;
    use visibility_core::glam::{Affine3A, Vec3};
    use visibility_core::{Aabb, Object, OccluderMesh, Scene};
    use visibility_testing::{Random, sign_of_sum};

    /// Distances are a lower bound, and the reach an upper one, of square roots that are not whole.
    #[test]
    fn distances_and_reaches_are_bounds_exactly() {
        let mut random = Random(1);
        let mut rounded = [0; 2];
        for round in 0..20_000 {
            let mut whole = |from: i32, to: i32| f64::from(random.between(from, to));
            let cell = CellBox { min: [-5.0, -7.0, 0.0], max: [3.0, 2.0, 1.0] };
            let (x, y) = (whole(-1000, 1000), whole(-1000, 1000));
            let max = [x + whole(0, 9), y + whole(0, 9)];
            let gap = |axis: usize, min: f64, max: f64| {
                if min > cell.max[axis] {
                    min - cell.max[axis]
                } else if max < cell.min[axis] {
                    cell.min[axis] - max
                } else {
                    0.0
                }
            };
            let (gx, gy) = (gap(0, x, max[0]), gap(1, y, max[1]));
            let distance = cell.distance([x, y], max);
            let sign = |d: f64, dx: f64, dy: f64| sign_of_sum([(d, d), (-dx, dx), (-dy, dy)]);
            assert!(sign(distance, gx, gy) <= 0, "{round}: {distance} is the distance of {x} {y} at most");
            assert!(distance >= (gx * gx + gy * gy).sqrt() * (1.0 - 1e-14), "{round}: {distance} of {x} {y}");
            rounded[0] += usize::from(sign((gx * gx + gy * gy).sqrt(), gx, gy) > 0);
            let far = |at: f64, axis: usize| (at - cell.min[axis]).abs().max((cell.max[axis] - at).abs());
            let (fx, fy) = (far(x, 0), far(y, 1));
            let reach = cell.reach(x, y);
            assert!(sign(reach, fx, fy) >= 0, "{round}: {reach} is the reach of {x} {y} at least");
            assert!(reach <= (fx * fx + fy * fy).sqrt() * (1.0 + 1e-14), "{round}: {reach} of {x} {y}");
            rounded[1] += usize::from(sign((fx * fx + fy * fy).sqrt(), fx, fy) < 0);
        }
        assert!(rounded.iter().all(|&count| count > 1_000), "{rounded:?}");
    }

    const CELL: CellBox = CellBox { min: [-1.0, -1.0, 1.0], max: [1.0, 1.0, 2.0] };

    /// Returns the solids of upright boxes, as they are before errors.
    fn solids_of(boxes: &[Aabb]) -> PlanSolids {
        let mut scene = Scene::new();
        for bounds in boxes {
            let id = scene.insert(Object { occluder: true, ..Object::new(*bounds) });
            let mesh = scene.add_mesh(OccluderMesh::cuboid(bounds).unwrap());
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        }
        let mut solids = PlanSolids::new(UpAxis::Z);
        solids.sync(&scene);
        assert_eq!(solids.solids.len(), boxes.len(), "a solid for each of {boxes:?}");
        solids
    }

    fn filled(solids: &PlanSolids) -> CellSolids {
        let mut filled = CellSolids::new();
        filled.fill(solids, &CELL, |_| true);
        filled
    }

    /// Posts that err are lower, farther away and begin higher than they seem.
    #[test]
    fn errors_of_posts_count_in_slopes_and_lower_ends() {
        for (high, error) in [(8.0f32, 0.25f64), (100.0, 0.25), (8.0, 0.0)] {
            let mut all = solids_of(&[Aabb::from_arrays([10.0, -1.0, 0.5], [12.0, 1.0, high])]);
            all.solids[0].error = error;
            let solids = filled(&all);
            let posts = solids.posts(0);
            assert_eq!(posts.len(), 4, "posts of a box");
            for post in posts {
                let reach = (post.at.x + 1.0).hypot(post.at.y.abs() + 1.0) + 1.414 * error;
                let exact = (f64::from(high) - error - 2.0) / reach;
                assert!(post.slope <= exact && post.slope > 0.9 * exact, "{post:?} rises by {exact} at most");
                assert!(
                    post.low >= 0.5 + error && post.low < 0.51 + error,
                    "{post:?} begins at {error} more"
                );
                assert_eq!(post.at.error, error, "the error of {post:?}");
            }
            let greatest = posts.iter().map(|post| post.slope).fold(-1.0, f64::max);
            assert_eq!(solids.solids()[0].slope, greatest, "the greatest slope");
        }
    }

    #[test]
    fn solids_that_may_touch_the_viewcell_or_are_below_it_are_left_out() {
        let count = |boxes: &[Aabb], error: f64, moved: f64| {
            let mut all = solids_of(boxes);
            (all.solids[0].error, all.solids[0].moved) = (error, moved);
            filled(&all).solids().len()
        };
        let wall = Aabb::from_arrays([10.0, -1.0, 0.0], [12.0, 1.0, 99.0]);
        assert_eq!(count(&[wall], 0.0, 0.0), 1, "a wall at nine metres");
        assert_eq!(count(&[wall], 4.4, 0.0), 1, "twice its error is less than nine metres");
        assert_eq!(count(&[wall], 9.5, 0.0), 0, "a wall that may touch the viewcell");
        assert_eq!(count(&[wall], 0.0, 9.5), 0, "a vertex of the wall may touch the viewcell");
        let around = Aabb::from_arrays([0.5, -9.0, 0.0], [12.0, 9.0, 99.0]);
        assert_eq!(count(&[around], 0.0, 0.0), 0, "a wall that meets the viewcell");
        let low = Aabb::from_arrays([10.0, -1.0, 0.0], [12.0, 1.0, 1.9]);
        assert_eq!(count(&[low], 0.0, 0.0), 0, "a wall lower than the highest eye");
    }

    #[test]
    fn solids_of_objects_that_are_no_candidates_are_left_out() {
        let wall = |x: f32| Aabb::from_arrays([x, -1.0, 0.0], [x + 2.0, 1.0, 99.0]);
        let all = solids_of(&[wall(10.0), wall(20.0)]);
        let mut solids = CellSolids::new();
        for candidate in 0..2 {
            solids.fill(&all, &CELL, |object| object == candidate);
            let middles: Vec<[f64; 2]> = solids.solids().iter().map(|solid| solid.middle).collect();
            assert_eq!(middles, [[11.0 + 10.0 * f64::from(candidate), 0.0]], "object {candidate} alone");
        }
    }

    /// A side of the viewcell alone, or a side of the ring alone, may separate the two.
    #[test]
    fn a_side_of_either_separates() {
        let ring = |points: &[[f64; 2]]| -> Vec<Post> {
            let post = |&[x, y]: &[f64; 2]| Post { at: Point::exact(x, y), low: 0.0, slope: 1.0 };
            points.iter().map(post).collect()
        };
        let corners = CELL.corners();
        let tip = ring(&[[1.1, 0.0], [9.0, -8.0], [9.0, 8.0]]);
        assert!(is_apart(&tip, 0.0, &corners), "a tip before the middle of a side of the viewcell");
        assert!(!is_apart(&tip, 0.2, &corners), "a tip that may be in the viewcell");
        let slanted = ring(&[[3.0, -0.8], [3.0, 3.0], [-0.8, 3.0]]);
        assert!(is_apart(&slanted, 0.0, &corners), "a side of a ring before a corner of the viewcell");
        assert!(!is_apart(&slanted, 0.2, &corners), "a side that may cut the corner");
        let over = ring(&[[0.9, 0.0], [9.0, -8.0], [9.0, 8.0]]);
        assert!(!is_apart(&over, 0.0, &corners), "a tip in the viewcell");
    }

    #[test]
    fn posts_in_use_are_steep_enough_and_of_use() {
        let mut solids = filled(&solids_of(&[
            Aabb::from_arrays([10.0, -1.0, 0.0], [20.0, 1.0, 22.0]),
            Aabb::from_arrays([-99.0, -1.0, 0.0], [-98.0, 1.0, 3.0]),
        ]));
        let steep = (0..2u32).find(|&i| solids.solids()[i as usize].middle[0] > 0.0).unwrap();
        solids.restrict(1.2, |_| true);
        assert_eq!(solids.ring(steep).len(), 2, "the near posts rise by 1.8, the far ones by 0.95");
        assert!(!solids.is_whole(steep) && solids.ring(1 - steep).is_empty(), "a low solid far away");
        solids.restrict(0.0, |_| true);
        assert!(solids.is_whole(steep) && solids.is_whole(1 - steep), "all posts");
        solids.restrict(0.0, |post| post.at.y > 0.0);
        assert_eq!([0, 1].map(|i| solids.ring(i).len()), [2, 2], "posts on one side");
        solids.restrict(1.2, |post| post.at.y > 0.0);
        assert_eq!(solids.ring(steep).len(), 1, "the near post on one side");
    }

    /// Rows of posts on a field: a segment meets the boxes that it crosses, and no others.
    #[test]
    fn segments_meet_the_boxes_that_they_cross() {
        let mut random = Random(2);
        let boxes: Vec<Aabb> = (0..300)
            .map(|i| {
                let at = Vec3::new(4.0 * (i % 20) as f32 + 5.0, 4.0 * (i / 20) as f32 - 30.0, 0.0);
                Aabb::new(at, at + Vec3::new(1.0, 1.0, 30.0))
            })
            .collect();
        let solids = filled(&solids_of(&boxes));
        assert_eq!(solids.solids().len(), boxes.len(), "all posts are apart from the viewcell");
        for round in 0..40 {
            let [from, to] = [(); 2].map(|()| {
                let p = random.vec3(-40.0, 90.0).as_dvec3();
                [p.x, p.y]
            });
            let slope = random.unit();
            let mut met = Vec::new();
            solids.along(from, to, slope, &mut |index| met.push(index));
            let [x, y] = [0, 1].map(|axis| to[axis] - from[axis]);
            for (index, solid) in (0..).zip(solids.solids()) {
                let [cx, cy] = [0, 1].map(|axis| solid.middle[axis] - from[axis]);
                let beside = (x * cy - y * cx).abs() / x.hypot(y);
                let part = (cx * x + cy * y) / (x * x + y * y);
                let is_crossed = beside < 0.49 && part > 0.0 && part < 1.0;
                let is_met = met.contains(&index);
                assert!(is_met || !is_crossed || solid.slope < slope, "{round}: {solid:?} is crossed");
                assert!(
                    !is_met || beside < 0.75 && solid.slope >= slope,
                    "{round}: {solid:?} is not crossed"
                );
            }
        }
    }
}
