//! Cutting a crowd of boxes into compact pieces of equal size, by halving it across its longest side again
//! and again (as the k-d tree: Bentley, "Multidimensional Binary Search Trees Used for Associative
//! Searching", 1975).

use glam::Vec3A;

/// Arranges `order`, which holds numbers of `centers`, so that the pieces lie one after another, and gives
/// each to `take`. All pieces have the same number of items, or one less. What is in the upper half of a word
/// means nothing.
pub(crate) fn pack(order: &mut [u64], centers: &[Vec3A], pieces: usize, take: &mut impl FnMut(&[u64])) {
    if pieces <= 1 {
        take(order);
        return;
    }
    let axis = longest_axis(order, centers);
    for word in order.iter_mut() {
        *word = u64::from(ascending(centers[number(*word)][axis])) << 32 | number(*word) as u64;
    }
    let left = pieces / 2;
    let middle = order.len() * left / pieces;
    if middle < order.len() {
        order.select_nth_unstable(middle);
    }
    let (low, high) = order.split_at_mut(middle);
    pack(low, centers, left, take);
    pack(high, centers, pieces - left, take);
}

pub(crate) fn number(word: u64) -> usize {
    word as u32 as usize
}

/// Bits that are ordered as the numbers are.
fn ascending(x: f32) -> u32 {
    let bits = x.to_bits();
    bits ^ ((bits as i32 >> 31) as u32 | 1 << 31)
}

fn longest_axis(order: &[u64], centers: &[Vec3A]) -> usize {
    let (mut min, mut max) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    for &word in order {
        let center = centers[number(word)];
        (min, max) = (min.min(center), max.max(center));
    }
    // Halves, since the whole may be more than the greatest number.
    let extent = max * 0.5 - min * 0.5;
    if extent.x >= extent.y && extent.x >= extent.z { 0 } else { 1 + usize::from(extent.z > extent.y) }
}
