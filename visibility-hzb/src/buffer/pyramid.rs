//! The pyramid above the tiles: each texel holds the least depth key of 2 x 2 texels of the next finer level.
//! The coarsest level is a single texel (Greene, Kass and Miller, "Hierarchical Z-Buffer Visibility", 1993;
//! Cohen-Or, Chrysanthou, Silva and Durand, "A Survey of Visibility for Walkthrough Applications", 2003,
//! section 6.1).

use super::tile_layout::{EMPTY_DEPTH, LINES, Rectangle, SIDE, mask};
use super::tiles::{Tiles, UNCHANGED, join};
use crate::lanes::{all_above, least};
use alloc::vec::Vec;

/// One level of the pyramid of least depth keys, half as wide and half as high as the next finer one, rounded
/// up.
#[derive(Clone, Debug)]
struct Level {
    /// Number of texel columns of this level.
    columns: usize,
    /// Number of texel rows of this level.
    rows: usize,
    /// Least depth key (the farthest) of all pixels under each texel, row by row from the top. Negative
    /// infinity if a pixel is not covered.
    least: Vec<f32>,
}

/// Levels of least depth keys above the tiles. A pyramid that was not updated since the tiles last changed
/// culls less and stays conservative, since depth keys only grow during a frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pyramid {
    /// Levels above the tiles, finest first, down to one texel.
    levels: Vec<Level>,
    /// Scratch of [`update`](Self::update): for each row of the finer level, the half-open range of the
    /// columns whose texels have changed.
    changed: Vec<[usize; 2]>,
}

impl Pyramid {
    /// Creates the levels above `tiles`, with all texels at negative infinity.
    pub(crate) fn new(tiles: &Tiles) -> Self {
        let mut levels = Vec::new();
        let (mut columns, mut rows) = (tiles.columns, tiles.rows);
        while columns > 1 || rows > 1 {
            (columns, rows) = (columns.div_ceil(2), rows.div_ceil(2));
            levels.push(Level { columns, rows, least: alloc::vec![f32::NEG_INFINITY; columns * rows] });
        }
        Self { levels, changed: alloc::vec![UNCHANGED; tiles.rows] }
    }

    /// Sets all texels to negative infinity, so that no box is hidden.
    pub(crate) fn clear(&mut self) {
        for level in &mut self.levels {
            level.least.fill(f32::NEG_INFINITY);
        }
    }

    /// Returns the number of levels above the tiles. 0 if the buffer is a single tile.
    pub(crate) fn height(&self) -> usize {
        self.levels.len()
    }

    /// Returns the columns, the rows and the texels (least depth keys, row by row from the top) of a level.
    /// Level 0 is the first above the tiles. `None` beyond the last level.
    pub(crate) fn level(&self, level: usize) -> Option<(usize, usize, &[f32])> {
        self.levels.get(level).map(|level| (level.columns, level.rows, &level.least[..]))
    }

    /// Returns the least depth keys of `N` texels from `column` on in row `row` of a level. Level 1 is the
    /// first above the tiles. Negative infinity where there are no texels, and on level 0, which is the
    /// tiles.
    #[inline(always)]
    pub(crate) fn texels<const N: usize>(&self, level: usize, column: usize, row: usize) -> [f32; N] {
        let mut texels = [EMPTY_DEPTH; N];
        if let Some(level) = self.levels.get(level.wrapping_sub(1))
            && let Some(own) = level.least.get(row * level.columns + column..(row + 1) * level.columns)
        {
            texels.iter_mut().zip(own).for_each(|(texel, own)| *texel = *own);
        }
        texels
    }

    /// Recomputes all texels above the dirty tiles (those changed since the last update) of `tiles`, and
    /// marks all tiles as clean. The cost is proportional to the number of texels within the dirty ranges.
    pub(crate) fn update(&mut self, tiles: &mut Tiles) {
        let [mut first_row, mut end_row] = core::mem::replace(&mut tiles.changed_rows, UNCHANGED);
        if first_row >= end_row {
            return;
        }
        self.changed[first_row..end_row].copy_from_slice(&tiles.changed[first_row..end_row]);
        tiles.changed[first_row..end_row].fill(UNCHANGED);
        let (mut columns, mut rows) = (tiles.columns, tiles.rows);
        let mut finer: &[f32] = &tiles.tile_min[..columns * rows];
        for level in &mut self.levels {
            let (first, end) = (first_row / 2, end_row.div_ceil(2));
            for row in first..end {
                // With an odd number of rows, the last row is paired with itself.
                let (upper, lower) = (2 * row, (2 * row + 1).min(rows - 1));
                let mut changed = UNCHANGED;
                for row in [upper, lower] {
                    if (first_row..end_row).contains(&row) {
                        changed = join(changed, self.changed[row]);
                    }
                }
                let changed = [changed[0] / 2, changed[1].div_ceil(2)];
                if changed[0] < changed[1] {
                    let out = &mut level.least[row * level.columns..][..level.columns];
                    halve(
                        &finer[upper * columns..][..columns],
                        &finer[lower * columns..][..columns],
                        changed,
                        out,
                    );
                }
                // Element `row` still holds the range of the finer row `row`. It can be overwritten, since
                // finer rows up to `2 * row + 1` have been read already.
                self.changed[row] = if changed[0] < changed[1] { changed } else { UNCHANGED };
            }
            (first_row, end_row) = (first, end);
            (columns, rows) = (level.columns, level.rows);
            finer = &level.least;
        }
    }

    /// Returns the least depth keys of the texels of a level, row by row, and the number of columns. Level 0,
    /// and any level beyond the last, is the tiles.
    #[inline(always)]
    fn all_texels<'a>(&'a self, tiles: &'a Tiles, level: usize) -> (&'a [f32], usize) {
        match self.levels.get(level.wrapping_sub(1)) {
            Some(level) => (&level.least, level.columns),
            None => (&tiles.tile_min, tiles.columns),
        }
    }

    /// Returns whether one level of the pyramid hides a rectangle of pixels: whether the texels that the
    /// rectangle meets, at most 2 x 2, have least depth keys strictly greater (nearer) than `depth_key`.
    /// False means undecided. The level is chosen by the size of the rectangle, so the cost is constant.
    #[inline(always)]
    pub(crate) fn hides_coarsely(&self, tiles: &Tiles, rectangle: &Rectangle, depth_key: f32) -> bool {
        let [x0, x1] = [rectangle.columns[0] as usize / SIDE, (rectangle.columns[1] as usize - 1) / SIDE];
        let [y0, y1] = [rectangle.lines[0] as usize / SIDE, (rectangle.lines[1] as usize - 1) / SIDE];
        let size = (x1 - x0).max(y1 - y0);
        let level = (usize::BITS - size.saturating_sub(1).leading_zeros()) as usize;
        let (texels, columns) = self.all_texels(tiles, level);
        let [x0, x1, y0, y1] = [x0 >> level, x1 >> level, y0 >> level, y1 >> level];
        let [above, below] = [y0 * columns, y1 * columns];
        let least = least(
            least(texels[above + x0], texels[above + x1]),
            least(texels[below + x0], texels[below + x1]),
        );
        least > depth_key
    }

    /// Returns whether all pixels of a rectangle hold a depth key strictly greater (nearer) than `depth_key`.
    ///
    /// A rectangle that meets at most four tiles a side is tested tile by tile. For a larger one the test
    /// starts on the finest level where the rectangle meets at most 65 texels along its longer side, row by
    /// row, and descends only below texels that do not decide. Coarser levels would seldom decide more than
    /// [`hides_coarsely`](Self::hides_coarsely) has.
    #[inline(always)]
    pub(crate) fn hides(&self, tiles: &Tiles, rectangle: &Rectangle, depth_key: f32) -> bool {
        let [x0, x1] = [rectangle.columns[0] as usize / SIDE, (rectangle.columns[1] as usize - 1) / SIDE];
        let [y0, y1] = [rectangle.lines[0] as usize / SIDE, (rectangle.lines[1] as usize - 1) / SIDE];
        let size = (x1 - x0).max(y1 - y0);
        if size <= 3 {
            return hidden_tiles(tiles, rectangle, [x0, x1, y0, y1], depth_key);
        }
        let level = ((usize::BITS - size.leading_zeros()) as usize).saturating_sub(6).min(self.levels.len());
        let (texels, columns) = self.all_texels(tiles, level);
        let walk = Walk { pyramid: self, tiles, rectangle, limits: [x0, x1, y0, y1], depth_key };
        let [x0, x1, y0, y1] = walk.limits.map(|limit| limit >> level);
        for y in y0..=y1 {
            if all_above(&texels[y * columns..][x0..=x1], depth_key) {
                continue;
            }
            for x in x0..=x1 {
                let hidden = if level == 0 { walk.hides_in_tile(x, y) } else { walk.hides(level, x, y) };
                if !hidden {
                    return false;
                }
            }
        }
        true
    }
}

/// Writes texels `first..end` of one row `out` of a level. Each becomes the minimum of two texels of the
/// finer row `above` and two of the finer row `below`. With an odd number of finer columns, the last texel
/// becomes the minimum of one texel of each row.
fn halve(above: &[f32], below: &[f32], [first, end]: [usize; 2], out: &mut [f32]) {
    let ((pairs_above, rest_above), (pairs_below, rest_below)) =
        (above.as_chunks::<2>(), below.as_chunks::<2>());
    let (last, end) = (end, end.min(pairs_above.len()));
    let first = first.min(end);
    for ((out, a), b) in
        out[first..end].iter_mut().zip(&pairs_above[first..end]).zip(&pairs_below[first..end])
    {
        *out = least(least(a[0], a[1]), least(b[0], b[1]));
    }
    // With an odd number of finer columns, the last texel has only one finer texel in each row.
    if let (true, Some(out), [a], [b]) = (last > end, out.last_mut(), rest_above, rest_below) {
        *out = least(*a, *b);
    }
}

/// Returns whether all pixels of a rectangle hold a depth key strictly greater (nearer) than `depth_key`.
/// `x0..=x1` and `y0..=y1` are the columns and rows of all tiles that the rectangle meets. Each tile is
/// tested.
#[inline(always)]
fn hidden_tiles(tiles: &Tiles, rectangle: &Rectangle, [x0, x1, y0, y1]: [usize; 4], depth_key: f32) -> bool {
    let ([left, right], [top, bottom]) = (rectangle.columns, rectangle.lines);
    let right = (0xff >> (7 - (right - 1) % SIDE as u32)) * LINES;
    let left = (0xff << (left % SIDE as u32) & 0xff) * LINES;
    let (top, bottom) =
        (u64::MAX << (top % SIDE as u32 * 8), u64::MAX >> (56 - (bottom - 1) % SIDE as u32 * 8));
    let mut y = y0;
    while y <= y1 {
        let lines = if y == y0 { top } else { u64::MAX } & if y == y1 { bottom } else { u64::MAX };
        let mut x = x0;
        while x <= x1 {
            let tile = y * tiles.columns + x;
            let pixels = if x == x0 { left } else { u64::MAX } & if x == x1 { right } else { u64::MAX };
            if !(tiles.tile_min[tile] > depth_key) && !tiles.hides_partly(tile, lines & pixels, depth_key) {
                return false;
            }
            x += 1;
        }
        y += 1;
    }
    true
}

/// Arguments of the recursive descent of [`Pyramid::hides`].
struct Walk<'a> {
    pyramid: &'a Pyramid,
    tiles: &'a Tiles,
    /// The tested rectangle, in pixels of the buffer.
    rectangle: &'a Rectangle,
    /// Tiles that the rectangle meets: first column, last column, first row and last row, all inclusive.
    limits: [usize; 4],
    /// Upper bound on the depth keys of the tested box (greater is nearer).
    depth_key: f32,
}

impl Walk<'_> {
    /// Returns whether all pixels of the rectangle within one texel hold a greater (nearer) depth key than
    /// the tested box. Level 0 is the tiles, level `i` is `levels[i - 1]`, and `x` and `y` are the texel's
    /// column and row. False beyond the last level.
    fn hides(&self, level: usize, x: usize, y: usize) -> bool {
        if level == 0 {
            return self.hides_in_tile(x, y);
        }
        let Some(own) = self.pyramid.levels.get(level - 1) else { return false };
        if own.least[y * own.columns + x] > self.depth_key {
            return true;
        }
        let [x0, x1, y0, y1] = self.limits.map(|limit| limit >> (level - 1));
        for y in (2 * y).max(y0)..=(2 * y + 1).min(y1) {
            for x in (2 * x).max(x0)..=(2 * x + 1).min(x1) {
                if !self.hides(level - 1, x, y) {
                    return false;
                }
            }
        }
        true
    }

    /// Returns whether all pixels of the rectangle in the tile at column `x` and row `y` hold a greater
    /// (nearer) depth key than the tested box.
    #[inline(always)]
    fn hides_in_tile(&self, x: usize, y: usize) -> bool {
        self.tiles.hides(y * self.tiles.columns + x, mask(self.rectangle, x, y), self.depth_key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::Random;

    /// Returns a random half-open range of pixels within `0..size`, never empty. Half of the ranges are at
    /// most 12 pixels long.
    fn range(random: &mut Random, size: usize) -> [u32; 2] {
        let (a, b) = (random.below(size), random.below(size));
        let end = if random.below(2) == 0 { a.max(b) } else { (a.min(b) + random.below(12)).min(size - 1) };
        [a.min(b) as u32, end as u32 + 1]
    }

    /// Asserts that each texel has the least key of the finer texels under it.
    fn assert_texels_are_least(pyramid: &Pyramid, tiles: &Tiles) {
        let (mut columns, mut rows) = (tiles.columns, tiles.rows);
        let mut finer = &tiles.tile_min[..columns * rows];
        for level in 0..pyramid.height() {
            let (across, down, texels) = pyramid.level(level).unwrap();
            assert_eq!([across, down], [columns.div_ceil(2), rows.div_ceil(2)], "size of level {level}");
            for (at, &texel) in texels.iter().enumerate() {
                let [x, y] = [2 * (at % across), 2 * (at / across)];
                let under = (y..rows.min(y + 2)).flat_map(|y| (x..columns.min(x + 2)).map(move |x| [x, y]));
                let least = under.map(|[x, y]| finer[y * columns + x]).fold(f32::INFINITY, f32::min);
                assert_eq!(texel, least, "texel {at} of level {level}");
            }
            (columns, rows, finer) = (across, down, texels);
        }
        assert_eq!([columns, rows], [1, 1], "the coarsest level is a texel");
    }

    #[test]
    fn rectangles_are_hidden_where_all_their_pixels_are() {
        let mut random = Random(1);
        let (mut hidden, mut coarsely) = (0, 0);
        for size in [[100, 60], [24, 200], [64, 64], [1100, 40]] {
            for round in 0..60 {
                let mut tiles = Tiles::new(size[0], size[1]);
                // Most tiles are covered entirely, some with a nearer depth key, and parts of some tiles with
                // a still nearer one.
                for tile in 0..tiles.columns * tiles.rows {
                    if random.below([40, 2000][round % 2]) > 0 {
                        tiles.cover(tile, u64::MAX, 1.0 + random.below(2) as f32, 0);
                    }
                    for _ in 0..random.below(4) {
                        let mask = (random.below(1 << 62) as u64) << random.below(32);
                        tiles.cover(tile, mask, 1.0 + random.below(5) as f32, 0);
                    }
                }
                let mut pyramid = Pyramid::new(&tiles);
                pyramid.update(&mut tiles);
                // More is drawn afterwards, in one tile and in a few.
                for more in 0..4 {
                    for _ in 0..[1, 1, 5, 0][more] {
                        let tile = random.below(tiles.columns * tiles.rows);
                        tiles.cover(tile, u64::MAX, 2.0 + random.below(4) as f32, 0);
                    }
                    pyramid.update(&mut tiles);
                    assert_texels_are_least(&pyramid, &tiles);
                }
                for _ in 0..200 {
                    let rectangle = Rectangle {
                        columns: range(&mut random, size[0]),
                        lines: range(&mut random, size[1]),
                    };
                    let depth_key = 0.5 * (1 + random.below(6)) as f32;
                    let [x, y] = [rectangle.columns, rectangle.lines].map(|[a, b]| a as usize..b as usize);
                    let all = y.clone().all(|y| x.clone().all(|x| tiles.pixel(x, y) > depth_key));
                    assert_eq!(pyramid.hides(&tiles, &rectangle, depth_key), all, "{rectangle:?}");
                    let coarse = pyramid.hides_coarsely(&tiles, &rectangle, depth_key);
                    assert!(all || !coarse, "{rectangle:?}");
                    (hidden, coarsely) = (hidden + usize::from(all), coarsely + usize::from(coarse));
                }
            }
        }
        assert!(hidden > 1000 && coarsely > 500, "{hidden} hidden, {coarsely} at first glance");
    }
}
