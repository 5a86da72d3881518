//! Open tiles of a polygon: tiles within the bounds of its outline in which the polygon is clearly nearer
//! than the tile's depth key.

use super::edges::Edges;
use super::frame::LevelFrame;
use crate::buffer::row_spans::STEPS;
use crate::buffer::tile_layout::SIDE;
use crate::buffer::tiles::Tiles;
use crate::lanes::{WHOLE, WIDTH, bits, greatest, least};
use alloc::vec::Vec;

/// Least ratio of a polygon's depth key to that of a tile for the polygon to be drawn in that tile. A polygon
/// that is barely nearer hides next to nothing more.
pub(super) const BARELY_NEARER: f32 = 1.05;

/// Returns the whole number nearest to `x`, whose magnitude must be below 2^22.
#[inline(always)]
fn nearest_whole(x: f32) -> f32 {
    (x + WHOLE) - WHOLE
}

/// Returns the index of the tile that holds the position `side`, in tiles. 0 for a negative position or NaN.
#[inline(always)]
pub(super) fn first_tile(side: f32) -> usize {
    greatest(side, 0.0) as usize
}

/// Returns the end, exclusive, of the tiles that begin at or before the position `side`, in tiles. A negative
/// position or NaN counts as 0. At most `count`, the number of tiles of the buffer.
#[inline(always)]
pub(super) fn end_tile(side: f32, count: usize) -> usize {
    ((greatest(side, 0.0) + 1.0) as usize).min(count)
}

/// Returns a mask of the first `count` of [`WIDTH`] tiles.
#[inline(always)]
pub(super) fn first_tiles(count: u32) -> u32 {
    if count < WIDTH as u32 { (1 << count) - 1 } else { u32::MAX }
}

/// Lower bounds on the depth keys of a polygon (greater is nearer).
pub(crate) struct DepthBound {
    /// Coefficients `[a, b, c]` of the polygon's least depth key in a tile: `a * column + b * row + c`, in
    /// tile columns and tile rows.
    pub(super) plane: [f32; 3],
    /// Lower bound on the polygon's depth keys in all tiles.
    pub(super) floor: f32,
}

/// Tiles that an outline may come near, and the least depth keys of its polygon there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TileKeys {
    /// Columns of tiles that the outline may come near, half-open.
    pub(super) columns: [usize; 2],
    /// Rows of tiles that the outline may come near, half-open.
    pub(super) rows: [usize; 2],
    /// Left, upper, right and lower side of the pixels that the outline may come near, in tiles.
    sides: [f32; 4],
    /// Coefficients `[a, b, c]` of the polygon's least depth key in a whole tile: `a * column + b * row + c`,
    /// in tile columns and tile rows.
    pub(super) plane: [f32; 3],
    /// Constant term of that plane for single positions instead of whole tiles: the depth key at `x` and `y`,
    /// in tiles, is at least `plane[0] * x + plane[1] * y + constant`.
    constant: f32,
    /// Lower bound on the polygon's depth keys in all tiles.
    floor: f32,
}

impl TileKeys {
    /// Returns the tiles, within the frame's columns, that the bounds of an outline meet when widened by the
    /// slack. `None` if there are none.
    #[inline(always)]
    pub(super) fn new(
        edges: &Edges,
        frame: &LevelFrame,
        &DepthBound { plane, floor }: &DepthBound,
        tiles: &Tiles,
    ) -> Option<Self> {
        let [left, above, right, below] = edges.bounds;
        let slack = frame.slack;
        // Sides of the range of pixels that the outline may come near, in tiles. These numbers are exact.
        let low = |pixel: f32| nearest_whole(pixel - slack - 0.5) / SIDE as f32;
        let high = |pixel: f32| nearest_whole(pixel + slack + 0.5) / SIDE as f32;
        let sides @ [left, above, right, below] = [low(left), low(above), high(right), high(below)];
        let size = [tiles.columns as f32, tiles.rows as f32];
        // The comparisons are false for an outline without edges.
        if !(left < size[0] && above < size[1] && right > 0.0 && below > 0.0) {
            return None;
        }
        // Contains all tiles that the outline may come near, so that polygons that share an edge agree on its
        // tiles.
        let columns = [first_tile(left).max(frame.columns[0]), end_tile(right, frame.columns[1])];
        (columns[0] < columns[1]).then_some(Self {
            columns,
            rows: [first_tile(above), end_tile(below, tiles.rows)],
            sides,
            plane,
            constant: plane[2] - (least(plane[0], 0.0) + least(plane[1], 0.0)),
            floor,
        })
    }

    /// Returns the terms of the least depth key that are equal for all tiles of row `row`: the term in the
    /// row, and the constant.
    #[inline(always)]
    pub(super) fn of_row(&self, row: usize) -> f32 {
        let [_, above, _, below] = self.sides;
        // The least depth key of the plane in a part of a tile is at a corner of that part.
        let (upper, lower) = (row as f32, row as f32 + 1.0);
        let y = if self.plane[1] < 0.0 { least(lower, below) } else { greatest(upper, above) };
        y * self.plane[1] + self.constant
    }

    /// Returns the least depth key of the polygon in the part of the tile at `column` that the outline may
    /// come near. `of_row` are the terms that [`of_row`](Self::of_row) returns for the tile's row.
    #[inline(always)]
    pub(super) fn at(&self, column: f32, of_row: f32) -> f32 {
        let [left, _, right, _] = self.sides;
        let slope = self.plane[0];
        let x = if slope < 0.0 { least(column + 1.0, right) } else { greatest(column, left) };
        greatest(x * slope + of_row, self.floor)
    }
}

/// Replaces `open` by the open tiles of an outline: for each row of tiles, one mask for each [`WIDTH`]
/// columns. Returns the number of open tiles.
#[inline(always)]
pub(crate) fn find_open_tiles(keys: &TileKeys, tiles: &Tiles, open: &mut Vec<u32>) -> u32 {
    open.clear();
    let [first, end] = keys.columns;
    let mut count = 0;
    for row in keys.rows[0]..keys.rows[1] {
        let (base, of_row) = (row * tiles.columns, keys.of_row(row));
        let mut column = first;
        while column < end {
            let (mut own, mut is_open) = ([0.0; WIDTH], [0; WIDTH]);
            let Some(held) = tiles.tile_min[base + column..].first_chunk::<WIDTH>() else { break };
            let left = column as f32;
            for i in 0..WIDTH {
                own[i] = keys.at(left + STEPS[i], of_row);
                // Depth keys of parallel views may be negative, so the first comparison is needed too.
                is_open[i] = u8::from((own[i] > held[i]) & (own[i] > held[i] * BARELY_NEARER));
            }
            let mask = bits(&is_open) & first_tiles((end - column) as u32);
            count += mask.count_ones();
            open.push(mask);
            column += WIDTH;
        }
    }
    count
}
