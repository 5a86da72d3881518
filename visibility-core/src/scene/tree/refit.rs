//! Moving most objects at once: one pass over all leaves that takes each object's new bounds from the batch,
//! then one over the nodes above.

use super::moving::is_far;
use super::{NONE, Scratch, Tree};
use crate::scene::boxes64::{Boxes64, FAN_OUT, lanes};
use crate::scene::queue::Queue;
use crate::{Aabb, ObjectId};

impl Tree {
    /// Moves the objects of a batch within their leaves, as [`move_batch_by_leaf`](Self::move_batch_by_leaf)
    /// does, in one pass over all leaves of the tree: faster if the batch has a good part of all objects.
    /// Sorts nothing. If an object is listed several times, only its last bounds count. If with these the
    /// object must leave its leaf, it is not moved: the position of its last bounds in `moved` is written to
    /// `scratch.leavers`.
    pub(in crate::scene) fn refit_batch(
        &mut self,
        moved: &[(ObjectId, Aabb)],
        scratch: &mut Scratch,
        queue: &mut Queue,
    ) {
        let Scratch { positions, leavers, .. } = scratch;
        leavers.clear();
        for (leaf, of_lane) in positions.as_chunks::<FAN_OUT>().0.iter().enumerate() {
            let mask =
                of_lane.iter().zip(0..).fold(0, |mask, (&at, lane)| mask | u64::from(at != NONE) << lane);
            if mask == 0 {
                continue;
            }
            if self.is_unculled_leaf(leaf) {
                leavers.extend(lanes(mask).map(|lane| of_lane[lane]));
                continue;
            }
            // The new boxes go into a copy, so that lanes of objects that leave can take their old boxes
            // back.
            fetch(moved, of_lane);
            let mut boxes = self.bounds[leaf].clone();
            for lane in lanes(mask) {
                boxes.set(lane, &moved[of_lane[lane] as usize].1);
            }
            let above = self.parent(leaf as u32);
            let home = above.map(|above| self.bounds_in(above));
            // One vectorised test for the usual case that no object leaves its leaf. Otherwise a test for
            // each lane.
            let free = !self.occupied[leaf];
            if !all_stay(&boxes, free, home.as_ref()) {
                for lane in lanes(mask) {
                    let bounds = boxes.get(lane);
                    if !bounds.is_finite() || home.as_ref().is_some_and(|home| is_far(home, &bounds)) {
                        leavers.push(of_lane[lane]);
                        boxes.set(lane, &self.bounds[leaf].get(lane));
                    }
                }
            }
            if let Some(above) = above {
                self.bounds[above.node()].set(above.lane(), &boxes.hull());
            }
            self.bounds[leaf] = boxes;
            self.detail_bounds[leaf] = self.measured(leaf);
            queue.push(leaf);
        }
        self.tighten_all();
    }

    /// Level by level from the leaves up, sets the bounds of all inner nodes to the hulls of their contents,
    /// and recomputes their bounds on size and draw distance. The boxes of the lanes that hold leaves must be
    /// right already.
    fn tighten_all(&mut self) {
        let height = if self.root == NONE { 0 } else { self.levels[self.root as usize] };
        for level in 1..=height {
            for node in 0..self.node_count() {
                if self.levels[node] != level || self.occupied[node] == 0 {
                    continue;
                }
                self.detail_bounds[node] = self.measured(node);
                if let Some(above) = self.parent(node as u32) {
                    let hull = self.bounds[node].hull();
                    self.bounds[above.node()].set(above.lane(), &hull);
                }
            }
        }
    }
}

/// Loads the boxes at the given positions of a batch into the cache. The processor waits for all of these
/// cache misses at once, whereas copying a box before the next is loaded lets it wait for few at a time.
fn fetch(moved: &[(ObjectId, Aabb)], positions: &[u32; FAN_OUT]) {
    let mut sum = 0;
    for &position in positions {
        if let Some((_, bounds)) = moved.get(position as usize) {
            // Reads both ends of the box, since they may lie in two cache lines.
            sum ^= bounds.min.x.to_bits() ^ bounds.max.z.to_bits();
        }
    }
    core::hint::black_box(sum);
}

/// Returns whether every box, except in the lanes of the mask `free`, is finite and has its centre near
/// `home`: [`is_far`] is false. `home` of `None` stands for all of space. The result may be false even if no
/// box has moved, since an unmoved box may be far.
fn all_stay(boxes: &Boxes64, free: u64, home: Option<&Aabb>) -> bool {
    let mut bad = [0u32; FAN_OUT];
    for axis in 0..3 {
        let (min, max) = (&boxes.coordinates[axis], &boxes.coordinates[axis + 3]);
        let (low, high) = home.map_or((-f32::MAX, f32::MAX), |home| {
            let size = home.max[axis] - home.min[axis];
            (home.min[axis] - size, home.max[axis] + size)
        });
        for lane in 0..FAN_OUT {
            let center = min[lane] * 0.5 + max[lane] * 0.5;
            let is_finite = (min[lane] <= max[lane]) & (min[lane] >= -f32::MAX) & (max[lane] <= f32::MAX);
            bad[lane] |= u32::from(!(is_finite & (center >= low) & (center <= high)));
        }
    }
    let bad = bad.iter().enumerate().fold(0, |mask, (lane, &bad)| mask | u64::from(bad) << lane);
    bad & !free == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use visibility_testing::Random;

    #[test]
    fn one_test_of_all_lanes_agrees_with_a_test_of_each() {
        let mut rng = Random(1);
        let (mut stays, mut leaves) = (0, 0);
        for case in 0..20_000 {
            let corner = rng.vector(100.0).as_vec3();
            let size = rng.vector(10.0).abs().as_vec3() + 1.0;
            let home = (!rng.one_in(4)).then(|| Aabb::new(corner, corner + size));
            let mut boxes = Boxes64::EMPTY;
            let taken = rng.bits() & rng.bits() & rng.bits() & rng.bits();
            for lane in lanes(taken) {
                // Centres up to the size of `home` beside it, and some on the very limit.
                let mut at = corner + size * rng.fine_vector(1.49).as_vec3() + 0.5 * size;
                let axis = rng.below(3);
                match rng.below(40) {
                    0 => at[axis] = corner[axis] - size[axis],
                    1 => at[axis] = corner[axis] + size[axis] + size[axis],
                    _ => {}
                }
                let mut bounds = Aabb::new(at, at);
                match rng.below(300) {
                    0 => bounds.max[axis] = f32::NAN,
                    1 => bounds.min[axis] = f32::NEG_INFINITY,
                    2 => bounds.max[axis] = f32::INFINITY,
                    3 => bounds.max[axis] -= 1.0,
                    4 => bounds = Aabb::new(at - f32::MAX, at + f32::MAX),
                    5 => bounds.min[axis] = bounds.max[axis] - 3.0 * size[axis],
                    _ => {}
                }
                boxes.set(lane, &bounds);
            }
            let free = !taken | if rng.one_in(2) { rng.bits() } else { 0 };
            let leaves_home = |lane: usize| {
                let bounds = boxes.get(lane);
                !bounds.is_finite() || home.is_some_and(|home| is_far(&home, &bounds))
            };
            let expected = !lanes(!free).any(leaves_home);
            assert_eq!(all_stay(&boxes, free, home.as_ref()), expected, "case {case}: {home:?}");
            (stays, leaves) = (stays + u32::from(expected), leaves + u32::from(!expected));
        }
        assert!(stays > 1000 && leaves > 1000, "{stays} blocks stay, of {leaves} a box leaves");
        let far = |x: f32| is_far(&Aabb::new(Vec3::ZERO, Vec3::ONE), &Aabb::new(Vec3::X * x, Vec3::X * x));
        let found = [(-1f32).next_down(), -1.0, 2.0, 2f32.next_up()].map(far);
        assert_eq!(found, [true, false, false, true], "a box is far beyond the size of its home");
    }
}
