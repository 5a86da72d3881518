//! The union of the polygons of one cluster: pixels along edges that two of them share.

use crate::buffer::tile_layout::SIDE;
use crate::buffer::tiles::Tiles;
use crate::lanes::{WIDTH, least};
use alloc::vec::Vec;

/// Part of each tile that the polygons of one cluster cover together. Empty between clusters.
#[derive(Clone, Debug, Default)]
pub(crate) struct UnionTiles {
    /// Least depth key of the polygons with a shared edge near the row of each tile, row by row. Infinity
    /// where there is none, negative infinity where a polygon was left out.
    least: Vec<f32>,
    /// Pixels of each tile whose centres an odd number of polygons cover.
    odd: Vec<u64>,
    /// Pixels of each tile that are near an edge at which the union may end.
    near_end: Vec<u64>,
    /// First tiles of the groups of eight tiles that a polygon was added to.
    touched: Vec<u32>,
    /// First and end column, first and end row of the tiles that a polygon may meet.
    used: [usize; 4],
}

/// No tiles, neutral when joined with others.
const UNUSED: [usize; 4] = [usize::MAX, 0, usize::MAX, 0];

impl UnionTiles {
    /// Prepares for the tiles of a buffer. Allocates only for a larger buffer than before.
    pub(super) fn prepare(&mut self, tiles: &Tiles) {
        let count = tiles.tile_min.len();
        if self.least.len() != count {
            self.least.clear();
            self.least.resize(count, f32::INFINITY);
            self.odd.clear();
            self.odd.resize(count, 0);
            self.near_end.clear();
            self.near_end.resize(count, 0);
        }
        self.used = UNUSED;
    }

    /// Lowers the least depth keys of the [`WIDTH`] tiles from `column` on, as far as column `end`, in row
    /// `row`, which begins at tile `base`: to `keys`, and to negative infinity where a polygon is not `open`:
    /// it is left out, since the tile holds nearer ones.
    #[inline(always)]
    pub(super) fn lower(
        &mut self,
        [column, row]: [usize; 2],
        base: usize,
        keys: &[f32; WIDTH],
        open: &[u8; WIDTH],
        end: usize,
    ) {
        let [x0, x1, y0, y1] = self.used;
        self.used = [x0.min(column), x1.max(end), y0.min(row), y1.max(row + 1)];
        let values = &mut self.least[base + column..base + column + WIDTH];
        let count = (end - column) as u32;
        for i in 0..WIDTH {
            let key = if open[i] != 0 { keys[i] } else { f32::NEG_INFINITY };
            values[i] = if (i as u32) < count { least(key, values[i]) } else { values[i] };
        }
    }

    /// Lets the union cover nothing in the tiles of `columns`, a half-open range of tile columns, that meet
    /// `bounds` (least column, least row, greatest column, greatest row), widened by `slack`: a polygon there
    /// is left out.
    #[inline(always)]
    pub(super) fn leave_out(&mut self, bounds: [f32; 4], slack: f32, columns: [usize; 2], tiles: &Tiles) {
        let low = [bounds[0] - slack, bounds[1] - slack];
        let high = [bounds[2] + slack, bounds[3] + slack];
        // Casts limit numbers below 0 to 0.
        let range = |axis: usize, size: usize| {
            [(low[axis] as usize / SIDE).min(size), ((high[axis] + 1.0) as usize).div_ceil(SIDE).min(size)]
        };
        let ([x0, x1], [y0, y1]) = (range(0, columns[1]), range(1, tiles.rows));
        let x0 = x0.max(columns[0]);
        if x0 >= x1 || y0 >= y1 {
            return;
        }
        let used = self.used;
        self.used = [used[0].min(x0), used[1].max(x1), used[2].min(y0), used[3].max(y1)];
        for row in y0..y1 {
            self.least[row * tiles.columns + x0..row * tiles.columns + x1].fill(f32::NEG_INFINITY);
        }
    }

    /// Adds a polygon to those of the eight tiles from tile `first` on that an edge comes near which the
    /// polygon shares with another: byte i of `shared` is not 0 for tile i. Only the first `count` tiles are
    /// in the row. `odd` are the pixels of each tile whose centres the polygon covers, `near_end` those near
    /// an edge at which the union may end.
    #[inline(always)]
    pub(super) fn add(
        &mut self,
        first: usize,
        count: usize,
        shared: u64,
        odd: &[u64; SIDE],
        near_end: &[u64; SIDE],
    ) {
        let shared = if count < SIDE { shared & ((1 << (8 * count)) - 1) } else { shared };
        let shared = shared.to_le_bytes();
        let (odds, ends) = (&mut self.odd[first..first + SIDE], &mut self.near_end[first..first + SIDE]);
        for i in 0..SIDE {
            let own = if shared[i] != 0 { u64::MAX } else { 0 };
            odds[i] ^= odd[i] & own;
            ends[i] |= near_end[i] & own;
        }
        self.touched.push(first as u32);
    }

    /// Covers the pixels that the union covers, at the least depth key of the tile, and empties the union.
    /// With `draw` false it only empties.
    #[inline(always)]
    pub(crate) fn finish(&mut self, draw: bool, tiles: &mut Tiles) {
        for i in 0..self.touched.len() {
            let first = self.touched[i] as usize;
            let (odds, ends) = (&mut self.odd[first..first + SIDE], &mut self.near_end[first..first + SIDE]);
            let mut masks = [0; SIDE];
            for i in 0..SIDE {
                masks[i] = odds[i] & !ends[i];
            }
            odds.fill(0);
            ends.fill(0);
            for i in 0..SIDE {
                if draw && masks[i] != 0 && self.least[first + i] < f32::INFINITY {
                    tiles.cover(first + i, masks[i], self.least[first + i], 0);
                }
            }
        }
        self.touched.clear();
        let [x0, x1, y0, y1] = core::mem::replace(&mut self.used, UNUSED);
        for row in y0..y1 {
            self.least[row * tiles.columns + x0..row * tiles.columns + x1].fill(f32::INFINITY);
        }
    }
}
