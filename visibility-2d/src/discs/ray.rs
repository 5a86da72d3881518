//! Rays to the first k discs.

use super::tree::{Discs, FAN};
use super::{MAX_NUMBER, ROUNDING};
use crate::median_order::LEAF;
use alloc::vec::Vec;
use smallvec::SmallVec;

/// A disc that a ray meets.
///
/// ```
/// use visibility_2d::discs::RayDisc;
/// assert!(RayDisc { disc: 3, distance: 1.0 } != RayDisc { disc: 3, distance: 2.0 });
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RayDisc {
    /// Index of the disc in the order that [`Discs::new`] was given them.
    pub disc: u32,
    /// Distance in metres from the origin to the point where the ray enters; 0 if it begins in the disc.
    pub distance: f64,
}

impl Discs {
    /// Replaces `hits` with the first `count` discs that a ray meets within `range` metres, nearest first.
    /// `direction` may have any length. A ray that touches a disc meets it as far as rounding tells. No hits
    /// if a number is NaN, the direction zero or infinite, or the origin beyond 1e150. Takes time in
    /// proportion to the nodes along the ray up to the last hit.
    ///
    /// ```
    /// use visibility_2d::discs::{Disc, Discs};
    /// let disc = |x: f64| Disc { center: [x, 0.5], radius: 1.0 };
    /// let discs = Discs::new(&[disc(20.0), disc(5.0), disc(10.0)])?;
    /// let mut hits = Vec::new();
    /// discs.first_hits([0.0, 0.0], [1.0, 0.0], 2, f64::INFINITY, &mut hits);
    /// assert!(hits.iter().map(|hit| hit.disc).eq([1, 2]));
    /// # Ok::<(), visibility_2d::discs::DiscError>(())
    /// ```
    pub fn first_hits(
        &self,
        origin: [f64; 2],
        direction: [f64; 2],
        count: usize,
        range: f64,
        hits: &mut Vec<RayDisc>,
    ) {
        hits.clear();
        // By the larger component, so that squares neither vanish nor overflow.
        let larger = direction[0].abs().max(direction[1].abs());
        let [x, y] = direction.map(|x| x / larger);
        let length = visibility_core::geometry::sqrt(x * x + y * y);
        // NaN for directions that are zero, infinite or NaN.
        let is_good = length > 0.0 && origin.iter().all(|x| x.abs() <= MAX_NUMBER);
        let Some(top) = self.levels.len().checked_sub(1) else { return };
        if !is_good || count == 0 || range.is_nan() {
            return;
        }
        // A walk of the tree, nearest node first. Once `count` discs are known, the farthest of them is the
        // limit.
        let along = [x / length, y / length];
        let mut stack: SmallVec<[(f64, u32, u32); 64]> = SmallVec::new();
        stack.push((0.0, top as u32, 0));
        let mut limit = range;
        while let Some((begin, level, index)) = stack.pop() {
            if begin > limit {
                continue;
            }
            let below = |fan: usize, length: usize| {
                let first = index as usize * fan;
                first..(first + fan).min(length)
            };
            if level == 0 {
                for index in below(LEAF, self.discs.len()) {
                    if let Some(distance) = self.entry(index, origin, along)
                        && distance <= limit
                    {
                        let hit = RayDisc { disc: self.indices[index], distance };
                        let place = hits.partition_point(|other| other.distance <= distance);
                        hits.insert(place, hit);
                        hits.truncate(count);
                        if hits.len() == count {
                            limit = limit.min(hits[count - 1].distance);
                        }
                    }
                }
                continue;
            }
            let nodes = &self.levels[level as usize - 1];
            let first = stack.len();
            for child in below(FAN, nodes.len()) {
                let [x0, y0, x1, y1] = nodes[child].around(origin);
                if let Some(begin) = slab([x0, y0], [x1, y1], along) {
                    stack.push((begin, level - 1, child as u32));
                }
            }
            // The nearest on top.
            stack[first..].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        }
    }

    /// Returns the distance at which a ray of unit direction `along` enters a disc; 0 if it begins there.
    fn entry(&self, index: usize, origin: [f64; 2], along: [f64; 2]) -> Option<f64> {
        let disc = &self.discs[index];
        let (x, y) = (disc.center[0] - origin[0], disc.center[1] - origin[1]);
        let (ahead, aside) = (x * along[0] + y * along[1], x * along[1] - y * along[0]);
        let half_squared = disc.radius * disc.radius - aside * aside;
        if half_squared < 0.0 {
            return None;
        }
        let half = visibility_core::geometry::sqrt(half_squared);
        (ahead + half >= 0.0).then(|| (ahead - half).max(0.0))
    }
}

/// Returns a distance at which a ray from the origin may enter a rectangle, at most the true one. `None` if
/// it surely misses the rectangle.
fn slab(min: [f64; 2], max: [f64; 2], along: [f64; 2]) -> Option<f64> {
    let (mut begin, mut end) = (0.0f64, f64::INFINITY);
    for axis in 0..2 {
        if along[axis].abs() < 1e-300 {
            if min[axis] > 0.0 || max[axis] < 0.0 {
                return None;
            }
            continue;
        }
        let (a, b) = (min[axis] / along[axis], max[axis] / along[axis]);
        (begin, end) = (begin.max(a.min(b)), end.min(a.max(b)));
    }
    // Rounding of the quotients and of the unit direction.
    (begin * (1.0 - ROUNDING) <= end * (1.0 + ROUNDING)).then_some(begin * (1.0 - ROUNDING))
}
