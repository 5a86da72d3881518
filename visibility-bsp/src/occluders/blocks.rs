//! Grouping of items that are near each other in space into runs of fixed length.

use visibility_core::glam::DVec3;

/// Number of polygons or boxes in a full block.
pub(super) const BLOCK: usize = 32;

/// Reorders `order`, indices into `centers`, so that consecutive runs of [`BLOCK`] indices are compact in
/// space. Splits recursively at the median of the longest axis.
pub(super) fn halve(order: &mut [u32], centers: &[DVec3]) {
    if order.len() <= BLOCK {
        return;
    }
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &i in order.iter() {
        (min, max) = (min.min(centers[i as usize]), max.max(centers[i as usize]));
    }
    let size = max - min;
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    // The left part consists of whole blocks, so that only the last block is not full.
    let half = (order.len() / 2).next_multiple_of(BLOCK).min(order.len() - 1);
    order.select_nth_unstable_by(half, |&a, &b| {
        centers[a as usize][axis].total_cmp(&centers[b as usize][axis]).then(a.cmp(&b))
    });
    let (left, right) = order.split_at_mut(half);
    halve(left, centers);
    halve(right, centers);
}
