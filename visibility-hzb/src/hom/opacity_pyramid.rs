//! The opacity pyramid: the number of covered pixels of each texel, for texels of one pixel, of 2 x 2, of 4 x
//! 4, up to the whole picture (Zhang, Manocha, Hudson and Hoff, "Visibility Culling using Hierarchical
//! Occlusion Maps", 1997: "recursive averaging").
//!
//! Texels finer than a tile are read from the bits of the tile's mask. Each tile and each coarser texel has a
//! count. A count over an area is an average without rounding. Pixels of the last tiles that lie outside the
//! picture count neither as covered nor as part of the area.

use super::opacity_thresholds::{TILE, Thresholds};
use super::tile_range::TileRange;
use crate::buffer::tile_layout::SIDE;
use crate::buffer::tiles::Tiles;
use alloc::vec::Vec;

/// Counts of covered pixels on one level of the pyramid: that of tiles (8 x 8 pixels), or a coarser one.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    /// Number of texel columns of this level, at least 1.
    pub(crate) columns: usize,
    /// Number of texel rows of this level, at least 1.
    pub(crate) rows: usize,
    /// Number of covered pixels of each texel of this level, row by row from the top.
    pub(crate) counts: Vec<u32>,
    /// Minimum number of covered pixels of an opaque texel. Element 0 is for texels in neither the last
    /// column nor the last row, element 1 for the last column, element 2 for the last row, element 3 for the
    /// texel in both. Texels of the last column or row have fewer pixels in the picture.
    need: [u32; 4],
}

impl Level {
    /// Returns the number of covered pixels of the texel at column `x` and row `y`, and whether the texel is
    /// opaque. The texel must exist.
    #[inline(always)]
    pub(crate) fn texel(&self, x: usize, y: usize) -> (u32, bool) {
        let count = self.counts[y * self.columns + x];
        let last = usize::from(x + 1 == self.columns) | usize::from(y + 1 == self.rows) << 1;
        (count, count >= self.need[last])
    }
}

/// Counts of covered pixels on all levels, and the thresholds from which a texel is opaque.
#[derive(Clone, Debug)]
pub(crate) struct OpacityPyramid {
    /// Width and height of the picture in pixels.
    picture: [usize; 2],
    /// Mask of the covered pixels of each tile, row by row: bit `8 * y + x` for the pixel at column `x` and
    /// row `y` of the tile. Pixels outside the picture are 0.
    pub(crate) covered: Vec<u64>,
    /// Counts of the level of tiles, then of each coarser level, down to one texel.
    pub(crate) levels: Vec<Level>,
    /// Opacity thresholds of all levels. Changed by [`set`](Self::set) only, which keeps `Level::need`
    /// consistent.
    pub(crate) thresholds: Thresholds,
}

impl OpacityPyramid {
    /// Creates a pyramid without covered pixels, with thresholds of 1, for a picture of the given width and
    /// height in pixels.
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

    /// Replaces the opacity thresholds of all levels. Counts of covered pixels are kept.
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

    /// Marks all pixels as uncovered. Opacity thresholds are kept.
    pub(crate) fn clear(&mut self) {
        self.covered.fill(0);
        for level in &mut self.levels {
            level.counts.fill(0);
        }
    }

    /// Recomputes masks and counts, on all levels, of the texels that contain tiles of the inclusive range
    /// `region`, which must not be empty.
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
                // With an odd number of finer rows, the last row has no partner.
                for row in 2 * y..finer.rows.min(2 * y + 2) {
                    add_pairs(out, &finer.counts[row * finer.columns..][across.clone()]);
                }
            }
            finer = level;
        }
    }

    /// Returns the columns and rows of texels of a level. Level 0 is the pixels. `None` beyond the last
    /// level.
    pub(crate) fn size(&self, level: usize) -> Option<[usize; 2]> {
        match level.checked_sub(TILE) {
            Some(above) => self.levels.get(above).map(|level| [level.columns, level.rows]),
            None => Some(self.picture.map(|side| side.div_ceil(1 << level))),
        }
    }

    /// Returns the number of covered pixels of a texel, and the number of its pixels that lie in the picture.
    /// Level 0 is the pixels. `None` if the level, column `x` or row `y` does not exist.
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

    /// Returns the mask of the covered pixels of the tile at tile column `x` and row `y`, together with all
    /// pixels of opaque texels that are finer than the tile. Such a texel may have uncovered pixels if the
    /// threshold of its level is below 1. Bit `8 * v + u` stands for the pixel at column `u` and row `v` of
    /// the tile.
    pub(crate) fn opaque_pixels(&self, x: usize, y: usize) -> u64 {
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

/// Adds pairs of finer counts to coarser ones: `out[i] += row[2 * i] + row[2 * i + 1]`. With an odd number of
/// counts in `row`, the last one is added alone to the last element of `out`.
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

/// Returns the mask of the pixels in the upper left texel of a tile, for a level finer than tiles, whose
/// texels have `2^level` pixels a side. Bit `8 * y + x` stands for the pixel at column `x` and row `y` of the
/// tile.
fn block(level: usize) -> u64 {
    let row = (1u64 << (1 << level)) - 1;
    (0..1 << level).fold(0, |mask, line| mask | row << (line * SIDE))
}

/// Returns the mask of the pixels that lie in the picture, for a tile of the last column of tiles. `width` is
/// the width of the picture in pixels. Bit `8 * y + x` stands for the pixel at column `x` and row `y` of the
/// tile.
fn last_columns(width: usize) -> u64 {
    let wide = (width - 1) % SIDE + 1;
    ((1u64 << wide) - 1) * 0x0101_0101_0101_0101
}

/// Returns the mask of the pixels that lie in the picture, for a tile of the last row of tiles. `height` is
/// the height of the picture in pixels. Bit `8 * y + x` stands for the pixel at column `x` and row `y` of the
/// tile.
fn last_lines(height: usize) -> u64 {
    u64::MAX >> (SIDE * (SIDE - 1 - (height - 1) % SIDE))
}
