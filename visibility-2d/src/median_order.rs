//! Order of points on the plan in which neighbours in the order are close in space, for building trees.

/// Maximum number of points in a leaf.
pub(crate) const LEAF: usize = 16;

/// Sorts centres, with their indices, into the order of the leaves. A range is halved at the median of the
/// longer axis of its bounds until it is a leaf. So a centre far away from the others widens only one leaf.
/// The number of leaves in the left half is a power of two. Therefore the leaves below an inner node of the
/// tree, 2^k successive ones from a multiple of 2^k on, are also one of the ranges.
pub(crate) fn put_in_order(centers: &mut [([f64; 2], u32)]) {
    if centers.len() <= LEAF {
        // Sorted by index, so that the order within a leaf does not depend on the selection algorithm.
        centers.sort_unstable_by_key(|&(_, index)| index);
        return;
    }
    let (mut min, mut max) = (centers[0].0, centers[0].0);
    for (center, _) in &*centers {
        for axis in 0..2 {
            (min[axis], max[axis]) = (min[axis].min(center[axis]), max[axis].max(center[axis]));
        }
    }
    let axis = usize::from(max[1] - min[1] > max[0] - min[0]);
    let half = LEAF * (centers.len().div_ceil(LEAF).next_power_of_two() / 2);
    centers.select_nth_unstable_by(half, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    let (left, right) = centers.split_at_mut(half);
    put_in_order(left);
    put_in_order(right);
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    /// Points along either axis, out of order: the first half of the leaves has the lesser ones. A leaf is in
    /// the order of its indices.
    #[test]
    fn leaves_are_halves_of_the_longer_axis() {
        for axis in 0..2 {
            for (count, half) in [(16, 16), (17, 16), (40, 32), (100, 64)] {
                let mut points: Vec<([f64; 2], u32)> = (0..count)
                    .map(|i| {
                        let mut at = [f64::from(i % 3); 2];
                        at[axis] = 10.0 * f64::from(i * 37 % count) - 50.0;
                        (at, i)
                    })
                    .collect();
                if axis == 1 {
                    points.reverse();
                }
                put_in_order(&mut points);
                let (left, right) = points.split_at(half);
                let most = left.iter().map(|(at, _)| at[axis]).fold(f64::NEG_INFINITY, f64::max);
                assert!(right.iter().all(|(at, _)| at[axis] > most), "{count} points along axis {axis}");
                for leaf in points.chunks(LEAF) {
                    assert!(leaf.is_sorted_by_key(|&(_, index)| index), "a leaf of {count} points");
                }
            }
        }
    }
}
