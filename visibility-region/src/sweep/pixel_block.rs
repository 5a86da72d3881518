//! Pixels of a rectangle of a map, in memory of their own. What one piece of an occluder covers is drawn
//! here first: most pieces cover few pixels, and their rows are next to each other in the cache, while the
//! rows of a whole map are a cache line apart.

use super::ray_map::{PixelRect, RayMap, set_span};
use alloc::vec::Vec;

/// One bit for each pixel of a rectangle, and for the pixels that share a word with them.
#[derive(Clone, Debug)]
pub(super) struct PixelBlock {
    words: Vec<u64>,
    /// Number of words in a row.
    width: usize,
    /// Position in the map of the first word, in words, and of the first row.
    first: [usize; 2],
}

/// A row of a block.
pub(super) struct BlockRow<'a> {
    words: &'a mut [u64],
    /// Column of the map at which the row begins.
    left: usize,
}

impl BlockRow<'_> {
    /// Sets the pixels of the columns `first` to `last` of the map, both included. They must be in the
    /// block's rectangle.
    #[inline]
    pub(super) fn set_span(&mut self, first: usize, last: usize) {
        set_span(self.words, first - self.left, last - self.left);
    }
}

impl PixelBlock {
    pub(super) fn new() -> Self {
        Self { words: Vec::new(), width: 1, first: [0; 2] }
    }

    /// Begins anew with the pixels of `rect`, none of them set.
    pub(super) fn begin(&mut self, rect: PixelRect) {
        self.first = [rect.x[0] / 64, rect.y[0]];
        self.width = rect.x[1] / 64 - self.first[0] + 1;
        self.words.clear();
        self.words.resize(self.width * (rect.y[1] - rect.y[0] + 1), 0);
    }

    /// Returns the rows of the rectangle from `first` on, to be drawn on.
    #[inline]
    pub(super) fn rows_from(&mut self, first: usize) -> impl Iterator<Item = BlockRow<'_>> {
        let (start, left) = ((first - self.first[1]) * self.width, 64 * self.first[0]);
        let words = self.words.get_mut(start..).unwrap_or_default();
        words.chunks_exact_mut(self.width).map(move |words| BlockRow { words, left })
    }

    /// Sets the pixels `first` to `last`, both included, of a row. They must be in the rectangle.
    #[cfg(test)]
    pub(super) fn set_span(&mut self, row: usize, first: usize, last: usize) {
        self.rows_from(row).next().unwrap().set_span(first, last);
    }

    /// Tests whether any pixel is set here but not in `map`.
    pub(super) fn exceeds(&self, map: &RayMap) -> bool {
        let [x, y] = self.first;
        let mut rows = self.rows().zip(map.rows(y));
        rows.any(|(new, old)| new.iter().zip(&old[x..]).any(|(new, old)| new & !old != 0))
    }

    /// Sets in `map` the pixels that are set here and not in `contour`, a block of the same rectangle.
    /// Returns whether any of them was not set before.
    pub(super) fn add_without(&self, contour: &Self, map: &mut RayMap) -> bool {
        let mut added = 0;
        let [x, y] = self.first;
        for ((inside, contour), row) in self.rows().zip(contour.rows()).zip(map.rows_mut(y)) {
            for ((inside, contour), word) in inside.iter().zip(contour).zip(&mut row[x..]) {
                let new = inside & !contour;
                added |= new & !*word;
                *word |= new;
            }
        }
        added != 0
    }

    /// Returns the words of each row.
    fn rows(&self) -> impl Iterator<Item = &[u64]> {
        self.words.chunks_exact(self.width)
    }

    /// Returns whether a pixel of the rectangle is set.
    #[cfg(test)]
    pub(super) fn get(&self, x: usize, y: usize) -> bool {
        self.words[(y - self.first[1]) * self.width + x / 64 - self.first[0]] >> (x % 64) & 1 != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks of one to three words a row, with spans that begin and end at borders of words, bit by bit.
    #[test]
    fn spans_of_a_block_are_added_to_a_map_where_they_belong() {
        let (mut inside, mut contour) = (PixelBlock::new(), PixelBlock::new());
        for x in [[63, 64], [64, 127], [130, 140], [100, 260], [448, 511]] {
            let rect = PixelRect { x, y: [509, 511] };
            let [first, last] = x;
            let columns = || (first..=last).filter(|x| matches!(x % 64, 0..=1 | 10 | 62..=63));
            for (a, b) in columns().flat_map(|a| columns().map(move |b| (a, b))).filter(|(a, b)| a <= b) {
                let is_new = |x: usize, y: usize| y == 510 && (a..=b).contains(&x) && x != a + (b - a) / 2;
                inside.begin(rect);
                contour.begin(rect);
                inside.set_span(510, a, b);
                contour.set_span(510, a + (b - a) / 2, a + (b - a) / 2);
                contour.set_span(511, first, last);
                let mut map = RayMap::new();
                assert!(inside.exceeds(&map), "{a} to {b} is not in an empty map");
                map.set_span(509, 0, 511);
                inside.add_without(&contour, &mut map);
                for (x, y) in (500..512).flat_map(|y| (0..512).map(move |x| (x, y))) {
                    assert_eq!(map.get(x, y), y == 509 || is_new(x, y), "{x} {y} of {a} to {b} in {rect:?}");
                }
                assert!(inside.exceeds(&map), "the pixel of the contour is not added: {a} to {b}");
                map.set_span(510, a, b);
                assert!(!inside.exceeds(&map), "{a} to {b} is in the map");
            }
        }
    }
}
