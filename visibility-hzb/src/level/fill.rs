//! Fills an outline into tiles. A pixel is filled if the outline winds round its centre an odd number of
//! times and, for conservative coverage, stays away from the pixel.

use super::edges::Edges;
use super::open_tiles::{TileKeys, end_tile, first_tile, first_tiles};
use super::seams::Seams;
use super::window::{RowEdge, Window, edges_of_row};
use crate::buffer::depth_planes::DepthPlanes;
use crate::buffer::tile_layout::{SIDE, tiles_of};
use crate::buffer::tiles::Tiles;
use crate::coverage::Coverage;
use crate::lanes::WIDTH;
use alloc::vec::Vec;

/// Scratch memory of [`fill`].
#[derive(Clone, Debug, Default)]
pub(crate) struct FillScratch {
    /// Masks of the [open tiles](super::open_tiles) of the polygon: for each row of tiles, one mask for each
    /// [`WIDTH`] columns.
    pub(super) open: Vec<u32>,
    /// Edges of the outline that meet the row of tiles being filled.
    row: Vec<RowEdge>,
}

/// Covers pixels of [open tiles](super::open_tiles): those whose centres the outline `edges` winds round an
/// odd number of times, and which, for [`Coverage::Conservative`], are more than `slack` pixels away from all
/// edges. Adds the polygon of the outline to `seams`. Returns whether a tile may have changed.
#[inline(always)]
pub(crate) fn fill(
    edges: &Edges,
    slack: f32,
    keys: &TileKeys,
    coverage: Coverage,
    FillScratch { open, row: row_edges }: &mut FillScratch,
    seams: &mut Seams,
    tiles: &mut Tiles,
) -> bool {
    let [x0, x1] = keys.columns;
    let sides = keys.columns.map(|column| (column * SIDE) as f32);
    let keep = if coverage == Coverage::Sampled { 0 } else { u64::MAX };
    let mut planes_index = 0;
    seams.begin_polygon(keys);
    for (row, open) in (keys.rows[0]..).zip(open.chunks((x1 - x0).div_ceil(WIDTH))) {
        if open.iter().all(|&open| open == 0) {
            continue;
        }
        let (base, of_row, top) = (row * tiles.columns, keys.of_row(row), (row * SIDE) as f32);
        let [left, right] = edges_of_row(edges, top, slack, sides, row_edges).map(|side| side / SIDE as f32);
        // A margin of two pixels on each side, more than columns are rounded by.
        let (first_met, end) = (first_tile(left - 0.25), end_tile(right + 0.25, tiles.columns));
        for (column, open) in (x0..).step_by(WIDTH).zip(open) {
            let mut left_open = open
                & first_tiles(end.saturating_sub(column) as u32)
                & !first_tiles(first_met.saturating_sub(column) as u32);
            while left_open != 0 {
                let skipped = left_open.trailing_zeros() as usize % WIDTH;
                let mut open = left_open >> skipped & 0xff;
                left_open &= !(0xff << skipped);
                let first = column + skipped;
                let window = Window::new(row_edges, (first * SIDE) as i32, seams);
                seams.finish_window(&window.near_two, &window.odd, base + first, open);
                let (mut covered, mut any, mut all) = (window.odd, 0, u64::MAX);
                for row in 0..SIDE {
                    covered[row] &= !(window.near[row] & keep);
                    any |= covered[row];
                    all &= covered[row];
                }
                if any == 0 {
                    continue;
                }
                let masks = if all == u64::MAX { [u64::MAX; SIDE] } else { tiles_of(&covered) };
                while open != 0 {
                    let i = open.trailing_zeros() as usize % SIDE;
                    open &= open - 1;
                    if masks[i] == 0 {
                        continue;
                    }
                    if planes_index == 0 {
                        planes_index = tiles.add_depth_planes(DepthPlanes::one(keys.plane));
                    }
                    let key = keys.at((first + i) as f32, of_row);
                    if masks[i] == u64::MAX {
                        tiles.cover_tile(row, first + i, key, planes_index);
                    } else {
                        tiles.cover(base + first + i, masks[i], key, planes_index);
                    }
                }
            }
        }
    }
    planes_index != 0
}
