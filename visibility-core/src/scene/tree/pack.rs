//! Partitioning of a set of boxes into compact pieces of equal size, by repeatedly splitting the set across
//! its longest side (as in the k-d tree: Bentley, "Multidimensional Binary Search Trees Used for Associative
//! Searching", 1975).

use glam::Vec3A;

/// Partitions the items of `order` into `pieces` pieces of equal size, up to one item, each compact in space,
/// and calls `take` with each piece. The lower 32 bits of an item are an index into `centers`; the upper 32
/// bits are overwritten. Afterwards the items of a piece are consecutive in `order`.
pub(crate) fn pack(order: &mut [u64], centers: &[Vec3A], pieces: usize, take: &mut impl FnMut(&[u64])) {
    if pieces <= 1 {
        take(order);
        return;
    }
    let axis = most_spread_axis(order, centers);
    for word in order.iter_mut() {
        *word = u64::from(ascending(centers[number(*word)][axis])) << 32 | number(*word) as u64;
    }
    let low_pieces = pieces / 2;
    let middle = order.len() * low_pieces / pieces;
    if middle < order.len() {
        order.select_nth_unstable(middle);
    }
    let (low, high) = order.split_at_mut(middle);
    pack(low, centers, low_pieces, take);
    pack(high, centers, pieces - low_pieces, take);
}

/// Returns the index that a word of [`pack`] holds in its lower 32 bits.
pub(crate) fn number(word: u64) -> usize {
    word as u32 as usize
}

/// Maps a float to an integer such that integers are ordered as the floats are.
fn ascending(x: f32) -> u32 {
    let bits = x.to_bits();
    bits ^ ((bits as i32 >> 31) as u32 | 1 << 31)
}

fn most_spread_axis(order: &[u64], centers: &[Vec3A]) -> usize {
    let (mut min, mut max) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    for &word in order {
        let center = centers[number(word)];
        (min, max) = (min.min(center), max.max(center));
    }
    // Halved before subtracting, since the full extent may overflow.
    crate::geometry::longest_axis((max * 0.5 - min * 0.5).to_array())
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;
    use visibility_testing::Random;

    #[test]
    fn pieces_are_of_one_size_and_hold_each_item_once() {
        let mut rng = Random(1);
        for (count, pieces) in [(0, 1), (0, 2), (1, 1), (2, 2), (7, 2), (64, 5), (400, 7), (512, 8)] {
            let centers: Vec<_> = (0..count).map(|_| rng.vector(10.0).as_vec3a()).collect();
            let mut order: Vec<u64> = (0..count as u64).collect();
            let mut taken: Vec<Vec<usize>> = Vec::new();
            pack(&mut order, &centers, pieces, &mut |piece| {
                taken.push(piece.iter().map(|&word| number(word)).collect());
            });
            let sizes: Vec<usize> = taken.iter().map(Vec::len).collect();
            assert_eq!(sizes.len(), pieces, "{count} items: pieces");
            let is_even = sizes.iter().all(|&size| size == count / pieces || size == count.div_ceil(pieces));
            assert!(is_even, "{count} items in {pieces} pieces: {sizes:?}");
            let packed: Vec<usize> = order.iter().map(|&word| number(word)).collect();
            assert_eq!(taken.concat(), packed, "{count} items: pieces are consecutive in the order");
            let mut all = packed;
            all.sort_unstable();
            assert!(all.into_iter().eq(0..count), "{count} items are there once");
        }
    }

    #[test]
    fn sets_are_split_across_their_longest_side() {
        let centers: Vec<_> = (0..40).map(|i| Vec3A::new((i % 2) as f32, (i * 7 % 40) as f32, 0.5)).collect();
        let mut order: Vec<u64> = (0..40).collect();
        let mut highest = Vec::new();
        pack(&mut order, &centers, 4, &mut |piece| {
            let heights = piece.iter().map(|&word| centers[number(word)].y);
            highest.push(heights.fold(f32::NEG_INFINITY, f32::max));
        });
        assert_eq!(highest, [9.0, 19.0, 29.0, 39.0], "four layers along y");
    }
}
