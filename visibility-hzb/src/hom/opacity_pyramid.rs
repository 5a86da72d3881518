//! The opacity pyramid: how many pixels of each texel are covered, for texels of one pixel, of 2 x 2, of 4 x
//! 4, up to the whole picture (Zhang, Manocha, Hudson and Hoff, "Visibility Culling using Hierarchical
//! Occlusion Maps", 1997: "recursive averaging").
//!
//! Texels finer than a tile are the bits of its mask; each coarser texel has a count. A count over an area is
//! an average without rounding. Pixels of the last tiles that lie outside the picture count neither as
//! covered nor as part of the area.

use super::thresholds::{TILE, Thresholds};
use super::tile_range::TileRange;
use crate::buffer::tile_layout::SIDE;
use crate::buffer::tiles::Tiles;
use alloc::vec::Vec;

/// One level: that of tiles, or a coarser one.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    /// Columns of texels.
    pub(crate) columns: usize,
    /// Rows of texels.
    pub(crate) rows: usize,
    /// Covered pixels of each texel, row by row.
    pub(crate) counts: Vec<u32>,
    /// Number of covered pixels from which a texel is opaque: of texels elsewhere, in the last column, in
    /// the last row, in both.
    need: [u32; 4],
}

impl Level {
    /// Covered pixels of a texel, and whether it is opaque.
    #[inline(always)]
    pub(crate) fn texel(&self, x: usize, y: usize) -> (u32, bool) {
        let count = self.counts[y * self.columns + x];
        let last = usize::from(x + 1 == self.columns) | usize::from(y + 1 == self.rows) << 1;
        (count, count >= self.need[last])
    }
}

/// The pyramid.
#[derive(Clone, Debug)]
pub(crate) struct OpacityPyramid {
    /// Columns and rows of the picture in pixels.
    picture: [usize; 2],
    /// Covered pixels of each tile, a bit each, row by row.
    pub(crate) covered: Vec<u64>,
    /// Levels from tiles upwards.
    pub(crate) levels: Vec<Level>,
    /// Of all levels; changed by [`set`](Self::set) only.
    pub(crate) thresholds: Thresholds,
}

impl OpacityPyramid {
    /// An empty pyramid, with thresholds of 1.
    pub(crate) fn new(picture: [usize; 2]) -> Self {
        let [mut columns, mut rows] = picture.map(|side| side.div_ceil(SIDE));
        let covered = alloc::vec![0; columns * rows];
        let mut levels = Vec::new();
        loop {
            levels.push(Level { columns, rows, counts: alloc::vec![0; columns * rows], need: [0; 4] });
            if columns == 1 && rows == 1 {
                break;
            }
            (columns, rows) = (columns.div_ceil(2), rows.div_ceil(2));
        }
        let mut new = Self { picture, covered, levels, thresholds: Thresholds::OPAQUE };
        new.set(Thresholds::OPAQUE);
        new
    }

    /// Changes the thresholds.
    pub(crate) fn set(&mut self, thresholds: Thresholds) {
        for above in 0..self.levels.len() {
            let last = [self.levels[above].columns - 1, self.levels[above].rows - 1];
            for which in 0..4 {
                let full = 1 << (TILE + above);
                let side = |axis: usize| {
                    if which >> axis & 1 != 0 { self.picture[axis] - last[axis] * full } else { full }
                };
                self.levels[above].need[which] = thresholds.need(TILE + above, (side(0) * side(1)) as u32);
            }
        }
        self.thresholds = thresholds;
    }

    /// Empties the pyramid.
    pub(crate) fn clear(&mut self) {
        self.covered.fill(0);
        for level in &mut self.levels {
            level.counts.fill(0);
        }
    }

    /// Takes in what has been drawn into a range of tiles, on all levels.
    #[inline(always)]
    pub(crate) fn update(&mut self, tiles: &Tiles, region: &TileRange) {
        let [mut x0, mut x1, mut y0, mut y1] = region.0;
        let Some((finest, coarser)) = self.levels.split_first_mut() else { return };
        (x1, y1) = (x1.min(finest.columns - 1), y1.min(finest.rows - 1));
        let right = last_columns(self.picture[0]);
        let bottom = last_lines(self.picture[1]);
        for y in y0..=y1 {
            let lines = if y + 1 == finest.rows { bottom } else { u64::MAX };
            let base = y * finest.columns;
            for x in x0..=x1 {
                let columns = if x + 1 == finest.columns { right } else { u64::MAX };
                let covered = tiles.covered(base + x) & lines & columns;
                self.covered[base + x] = covered;
                finest.counts[base + x] = covered.count_ones();
            }
        }
        let mut finer: &Level = finest;
        for level in coarser {
            [x0, x1, y0, y1] = [x0 / 2, x1 / 2, y0 / 2, y1 / 2];
            let across = 2 * x0..finer.columns.min(2 * x1 + 2);
            for y in y0..=y1 {
                let out = &mut level.counts[y * level.columns..][x0..=x1];
                out.fill(0);
                // The last row of an odd number has no partner.
                for row in 2 * y..finer.rows.min(2 * y + 2) {
                    add_pairs(out, &finer.counts[row * finer.columns..][across.clone()]);
                }
            }
            finer = level;
        }
    }

    /// Columns and rows of a level, 0 being that of pixels. `None` beyond the last.
    pub(crate) fn size(&self, level: usize) -> Option<[usize; 2]> {
        match level.checked_sub(TILE) {
            Some(above) => self.levels.get(above).map(|level| [level.columns, level.rows]),
            None => Some(self.picture.map(|side| side.div_ceil(1 << level))),
        }
    }

    /// Number of covered pixels of a texel, and of all its pixels. `None` outside the picture and beyond the
    /// last level.
    pub(crate) fn texel(&self, level: usize, x: usize, y: usize) -> Option<[u32; 2]> {
        let [columns, rows] = self.size(level)?;
        if x >= columns || y >= rows {
            return None;
        }
        let side = |axis: usize, at: usize| (self.picture[axis] - (at << level)).min(1 << level);
        let area = (side(0, x) * side(1, y)) as u32;
        let count = match level.checked_sub(TILE) {
            Some(above) => self.levels[above].counts[y * columns + x],
            None => {
                let shift = TILE - level;
                let tile = (y >> shift) * self.levels[0].columns + (x >> shift);
                let (left, top) = ((x << level) % SIDE, (y << level) % SIDE);
                (self.covered[tile] & (block(level) << (top * SIDE + left))).count_ones()
            }
        };
        Some([count, area])
    }

    /// The covered pixels of a tile, and all pixels of those texels finer than the tile that are opaque.
    pub(crate) fn dissolved(&self, x: usize, y: usize) -> u64 {
        let covered = self.covered[y * self.levels[0].columns + x];
        let mut out = covered;
        for level in 1..TILE {
            let texels = SIDE >> level;
            for i in 0..texels * texels {
                let (u, v) = (x * texels + i % texels, y * texels + i / texels);
                if let Some([count, area]) = self.texel(level, u, v)
                    && count >= self.thresholds.need(level, area)
                {
                    out |= block(level) << ((i / texels * SIDE + i % texels) << level);
                }
            }
        }
        out
    }
}

/// Adds to each number of `out` a pair of numbers of `row`, and to the last the one that is left over.
#[inline(always)]
fn add_pairs(out: &mut [u32], row: &[u32]) {
    let (pairs, rest) = row.as_chunks::<2>();
    for (out, [a, b]) in out.iter_mut().zip(pairs) {
        *out += a + b;
    }
    if let (Some(last), [a]) = (out.last_mut(), rest) {
        *last += a;
    }
}

/// The pixels of the upper left texel of a level within a tile.
fn block(level: usize) -> u64 {
    let row = (1u64 << (1 << level)) - 1;
    (0..1 << level).fold(0, |mask, line| mask | row << (line * SIDE))
}

/// The pixels of a tile in the last column of tiles that lie in a picture of this width.
fn last_columns(width: usize) -> u64 {
    let wide = (width - 1) % SIDE + 1;
    ((1u64 << wide) - 1) * 0x0101_0101_0101_0101
}

/// The pixels of a tile in the last row of tiles that lie in a picture of this height.
fn last_lines(height: usize) -> u64 {
    u64::MAX >> (SIDE * (SIDE - 1 - (height - 1) % SIDE))
}
