//! Grouping of items that are near each other in space into runs of fixed length.

use visibility_core::glam::DVec3;

/// Number of polygons or boxes in a full block.
pub(super) const BLOCK: usize = 32;

/// Returns the minimum and maximum corner of the box around some points, in the points' own space. Without
/// points, the minimum is positive infinity and the maximum negative infinity.
pub(super) fn bounds_of(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), p| (min.min(p), max.max(p)))
}

/// Reorders `order`, indices into the points `centers` (metres relative to `Scene::origin`), so that
/// consecutive runs of [`BLOCK`] indices are compact in space. Splits recursively at the median of the
/// longest axis.
pub(super) fn halve(order: &mut [u32], centers: &[DVec3]) {
    if order.len() <= BLOCK {
        return;
    }
    let (min, max) = bounds_of(order.iter().map(|&i| centers[i as usize]));
    let axis = (max - min).max_position();
    // The left part consists of whole blocks, so that only the last block is not full.
    let half = (order.len() / 2).next_multiple_of(BLOCK).min(order.len() - 1);
    order.select_nth_unstable_by(half, |&a, &b| {
        centers[a as usize][axis].total_cmp(&centers[b as usize][axis]).then(a.cmp(&b))
    });
    let (left, right) = order.split_at_mut(half);
    halve(left, centers);
    halve(right, centers);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_hold_their_points_and_no_more() {
        let [a, b] = [DVec3::new(1.0, -5.0, 3.0), DVec3::new(2.0, 4.0, -3.0)];
        let expected = (DVec3::new(1.0, -5.0, -3.0), DVec3::new(2.0, 4.0, 3.0));
        assert_eq!(bounds_of([a, b].into_iter()), expected, "bounds of two points");
        assert_eq!(bounds_of([b, a].into_iter()), expected, "bounds of the same points");
        assert_eq!(bounds_of([].into_iter()), (DVec3::INFINITY, DVec3::NEG_INFINITY), "without points");
    }

    /// Points in a row, in a random order: each block but the last has a run of 32.
    #[test]
    fn blocks_are_runs_of_neighbours() {
        for count in [31, 32, 33, 64, 65, 96, 97, 250] {
            for axis in 0..3 {
                let mut random = visibility_testing::Random(count as u64);
                let keys: alloc::vec::Vec<u64> = (0..count).map(|_| random.bits()).collect();
                let rank = |i: usize| keys.iter().filter(|&&key| key < keys[i]).count();
                let centers: alloc::vec::Vec<DVec3> =
                    (0..count).map(|i| DVec3::AXES[axis] * rank(i) as f64).collect();
                let mut order: alloc::vec::Vec<u32> = (0..count as u32).collect();
                halve(&mut order, &centers);
                for (number, block) in order.chunks(BLOCK).enumerate() {
                    let (min, max) = bounds_of(block.iter().map(|&i| centers[i as usize]));
                    assert_eq!(min[axis], (number * BLOCK) as f64, "block {number} of {count}");
                    assert_eq!((max - min)[axis], (block.len() - 1) as f64, "block {number} of {count}");
                }
            }
        }
    }
}
