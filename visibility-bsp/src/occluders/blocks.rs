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
