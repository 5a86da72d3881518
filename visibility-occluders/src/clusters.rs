//! Clusters: polygons that lie close together, with a bounded number of edges.

use visibility_core::glam::DVec3;

/// A polygon to be put into a cluster: its index, its middle and its number of edges.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    /// Index of the polygon.
    pub(crate) polygon: u32,
    /// Middle of the polygon's box in metres.
    pub(crate) middle: DVec3,
    /// Number of the polygon's edges.
    pub(crate) edges: usize,
}

/// Sorts `items` so that the items of each cluster are adjacent, and calls `each` with the half-open range of
/// every cluster, counted from `first`, the index of the first item. A cluster has at most `max_edges` edges,
/// or a single polygon. Larger sets of polygons are halved by their middles, along the axis in which the
/// middles extend farthest. Takes n log n steps.
pub(crate) fn divide(items: &mut [Item], max_edges: usize, first: usize, each: &mut impl FnMut([usize; 2])) {
    let edges: usize = items.iter().map(|item| item.edges).sum();
    if edges <= max_edges || items.len() <= 1 {
        if !items.is_empty() {
            each([first, first + items.len()]);
        }
        return;
    }
    let middles = || items.iter().map(|item| item.middle);
    let extent =
        middles().fold(DVec3::NEG_INFINITY, DVec3::max) - middles().fold(DVec3::INFINITY, DVec3::min);
    let (axis, half) = (extent.max_position(), items.len() / 2);
    items.select_nth_unstable_by(half, |a, b| {
        a.middle[axis].total_cmp(&b.middle[axis]).then(a.polygon.cmp(&b.polygon))
    });
    let (low, high) = items.split_at_mut(half);
    divide(low, max_edges, first, each);
    divide(high, max_edges, first + half, each);
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;
    use visibility_testing::Random;

    /// Each cluster has at most as many edges as allowed, or one polygon. What has no more is not divided.
    #[test]
    fn clusters_have_few_edges_or_one_polygon() {
        let mut random = Random(1);
        for round in 0..200 {
            let mut items: Vec<Item> = (0..random.below(12) as u32)
                .map(|polygon| Item { polygon, middle: random.vector(9.0), edges: 1 + random.below(9) })
                .collect();
            let all: usize = items.iter().map(|item| item.edges).sum();
            let most = if round % 2 == 0 { all } else { random.below(20) };
            let mut ranges = Vec::new();
            divide(&mut items, most, 5, &mut |range| ranges.push(range));
            let mut next = 5;
            for &[first, end] in &ranges {
                let own = &items[first - 5..end - 5];
                let edges: usize = own.iter().map(|item| item.edges).sum();
                assert!(!own.is_empty() && first == next, "round {round}: {ranges:?}");
                assert!(edges <= most || own.len() == 1, "round {round}: {edges} edges of {most}");
                next = end;
            }
            assert_eq!(next, 5 + items.len(), "round {round}: the end of {ranges:?}");
            assert!(all > most || ranges.len() <= 1, "round {round}: {all} edges of {most} are divided");
            let mut polygons: Vec<u32> = items.iter().map(|item| item.polygon).collect();
            polygons.sort_unstable();
            assert!(polygons.into_iter().eq(0..items.len() as u32), "round {round}: polygons are missing");
        }
    }
}
