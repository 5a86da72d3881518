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
