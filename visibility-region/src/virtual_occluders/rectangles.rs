//! Largest rectangles of set pixels in a map of rays.

use crate::sweep::ray_map::{PixelRect, RayMap, SIDE};
use alloc::vec::Vec;

/// Side in pixels of the blocks that rectangles consist of. Blocks of 4 pixels lose the rims of umbrae, and
/// with them, in a city, a sixth of the occlusion (measured).
const BLOCK: usize = 2;
const COUNT: usize = SIDE / BLOCK;

/// Returns up to `most` disjoint rectangles of set pixels, the largest first. They consist of blocks of
/// `BLOCK` by `BLOCK` pixels.
pub(super) fn largest(map: &RayMap, most: usize) -> Vec<PixelRect> {
    let block = |x: usize, y: usize| PixelRect {
        x: [x * BLOCK, x * BLOCK + BLOCK - 1],
        y: [y * BLOCK, y * BLOCK + BLOCK - 1],
    };
    let mut set: Vec<bool> = (0..COUNT * COUNT).map(|i| map.all_set(block(i % COUNT, i / COUNT))).collect();
    let mut all = Vec::new();
    while all.len() < most {
        let Some([x0, x1, y0, y1]) = largest_of(&set) else { break };
        for y in y0..=y1 {
            set[y * COUNT + x0..=y * COUNT + x1].fill(false);
        }
        all.push(PixelRect {
            x: [block(x0, 0).x[0], block(x1, 0).x[1]],
            y: [block(0, y0).y[0], block(0, y1).y[1]],
        });
    }
    all
}

/// Returns the largest rectangle of set blocks: first and last column, first and last row. Linear in the
/// number of blocks: for each row, a stack of the rectangles that may still grow to the right.
fn largest_of(set: &[bool]) -> Option<[usize; 4]> {
    let mut height = [0usize; COUNT + 1];
    let (mut best, mut area) = (None, 0);
    let mut stack: Vec<(usize, usize)> = Vec::new();
    for y in 0..COUNT {
        for x in 0..=COUNT {
            if x < COUNT {
                height[x] = if set[y * COUNT + x] { height[x] + 1 } else { 0 };
            }
            let mut start = x;
            while let Some(&(first, tall)) = stack.last().filter(|top| top.1 >= height[x]) {
                stack.pop();
                if tall * (x - first) > area {
                    area = tall * (x - first);
                    best = Some([first, x - 1, y + 1 - tall, y]);
                }
                start = first;
            }
            if height[x] > 0 {
                stack.push((start, height[x]));
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_are_set_and_largest_first() {
        let mut map = RayMap::new();
        for row in 10..210 {
            map.set_span(row, 5, 300);
        }
        for row in 150..400 {
            map.set_span(row, 100, 180);
        }
        let all = largest(&map, 3);
        assert_eq!(all[0], PixelRect { x: [6, 299], y: [10, 209] }, "the largest rectangle");
        assert_eq!(all[1], PixelRect { x: [100, 179], y: [210, 399] }, "the second: what is left below it");
        assert_eq!(all.len(), 2, "rectangles found");
        assert!(all.iter().all(|&rect| map.all_set(rect)), "a rectangle holds a pixel that is not set");
        assert!(largest(&RayMap::new(), 3).is_empty(), "an empty map has no rectangles");
    }
    /// Spans whose ends are in each half of a block, at the first and the last blocks.
    #[test]
    fn rectangles_end_where_whole_blocks_end() {
        let ends = [0, 1, 2, 3, 4, 62, 63, 64, 65, SIDE - 4, SIDE - 3, SIDE - 2, SIDE - 1];
        for (a, b) in ends.into_iter().flat_map(|a| ends.map(|b| (a, b))).filter(|(a, b)| a <= b) {
            let mut map = RayMap::new();
            let rows = if a % 3 == 0 { [0, 1] } else { [SIDE - 2, SIDE - 1] };
            (rows[0]..=rows[1]).for_each(|row| map.set_span(row, a, b));
            let x = [a.next_multiple_of(2), ((b + 1) & !1).wrapping_sub(1)];
            let expected = (x[1] != usize::MAX && x[0] < x[1]).then_some(PixelRect { x, y: rows });
            assert_eq!(largest(&map, 2).first().copied(), expected, "{a} to {b}");
        }
    }
}
