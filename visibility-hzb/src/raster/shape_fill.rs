//! Fills screen shapes into tiles. Column ranges are set up for eight rows of tiles at once, and tiles that a
//! shape covers entirely are written in runs.

use crate::buffer::depth_planes::DepthPlanes;
use crate::buffer::row_spans::STEPS;
use crate::buffer::tile_layout::{SIDE, below as lines_below};
use crate::buffer::tiles::Tiles;
use crate::lanes::{WIDTH, any_below, bits, round_to_i32};
use crate::setup::screen_shape::{MAX_PLANES, ScreenShape};

/// Fills a shape into the tiles. The greatest (nearest) depth key wins in each pixel. Returns false, without
/// a change, if the shape's rectangle meets no tile whose `tile_min` is less than the shape's greatest depth
/// key.
#[inline(always)]
pub(crate) fn fill_shape(shape: &ScreenShape, tiles: &mut Tiles) -> bool {
    let columns = tiles.columns;
    let first_row = shape.lines[0] / SIDE;
    let end_row = shape.lines[1].div_ceil(SIDE).min(tiles.rows);
    let first_column = (shape.columns[0] as usize) / SIDE;
    let end_column = (shape.columns[1] as usize).div_ceil(SIDE).min(columns);
    if first_row >= end_row || first_column >= end_column {
        return false;
    }
    // Skip the shape if all tiles of its rectangle are at least as near already.
    let mut seen = false;
    for row in first_row..end_row {
        seen |= any_below(
            &tiles.tile_min[row * columns + first_column..row * columns + end_column],
            shape.ceiling,
        );
        if seen {
            break;
        }
    }
    if !seen {
        return false;
    }
    let depth_planes_index = tiles.add_depth_planes(DepthPlanes::of(shape));
    let mut row = first_row;
    while row < end_row {
        let bands = bands(shape, row, columns);
        for i in 0..SIDE.min(end_row - row) {
            fill_row(shape, tiles, row + i, &bands, i, depth_planes_index);
        }
        row += SIDE;
    }
    true
}

/// Ranges of tile columns that a shape meets, and that it covers entirely, in each of eight rows of tiles.
struct Bands {
    /// Half-open range of the columns of tiles that the shape may meet, for each of the eight rows of tiles:
    /// `met[0][i]` is the first column in row `i`, `met[1][i]` the end. An end not after the first means that
    /// the shape meets no tile in the row.
    met: [[i32; SIDE]; 2],
    /// Half-open range of the columns of tiles that the shape covers entirely, for each of the eight rows of
    /// tiles: `covered[0][i]` is the first column in row `i`, `covered[1][i]` the end. The end is not after
    /// the first if the shape covers no whole tile in the row. It is -1 in a row of tiles in which the shape
    /// begins or ends.
    covered: [[i32; SIDE]; 2],
}

/// Computes the tile column ranges that a shape meets and covers in the eight rows of tiles from tile row
/// `first_row` on. `columns` is the number of tile columns of the buffer. The bounds of a shape on its
/// columns are monotonic in the row of pixels, also after rounding, so the first and the last row of pixels
/// of a tile give the extremes.
#[inline(always)]
fn bands(shape: &ScreenShape, first_row: usize, columns: usize) -> Bands {
    let (mut top, mut bottom) = ([0.0; SIDE], [0.0; SIDE]);
    let (first, last) = (shape.lines[0] as f32, shape.lines[1] as f32 - 1.0);
    let start = (first_row * SIDE) as f32;
    for i in 0..SIDE {
        let y = start + TILE_ROW_STARTS[i];
        top[i] = if y > first { y } else { first };
        bottom[i] = if y + 7.0 < last { y + 7.0 } else { last };
    }
    // Element 0 holds outer bounds, element 1 inner bounds. The limits are those of `spans`, so that both
    // round alike.
    let (left, right) = (shape.columns[0] - 0.25, shape.columns[1] + 0.25);
    let (mut low, mut high) = ([[left; SIDE]; 2], [[right; SIDE]; 2]);
    for line in &shape.left[..shape.lefts] {
        for i in 0..SIDE {
            let (a, b) = (top[i] * line.slope + line.offset, bottom[i] * line.slope + line.offset);
            let (least, most) = if a < b { (a, b) } else { (b, a) };
            // The comparisons are written so that a NaN bound covers no pixel.
            low[0][i] = if least <= low[0][i] { low[0][i] } else { least };
            low[1][i] = if most <= low[1][i] { low[1][i] } else { most };
        }
    }
    for line in &shape.right[..shape.rights] {
        for i in 0..SIDE {
            let (a, b) = (top[i] * line.slope + line.offset, bottom[i] * line.slope + line.offset);
            let (least, most) = if a < b { (a, b) } else { (b, a) };
            high[0][i] = if most >= high[0][i] { high[0][i] } else { most };
            high[1][i] = if least >= high[1][i] { high[1][i] } else { least };
        }
    }
    let limit = shape.columns[1] + 1.0;
    let mut bands = Bands { met: [[0; SIDE]; 2], covered: [[0; SIDE]; 2] };
    for i in 0..SIDE {
        let (first, end) = (first_pixel(low[0][i], limit), end_pixel(high[0][i]));
        bands.met[0][i] = first.max(0) / SIDE as i32;
        bands.met[1][i] = ((end + SIDE as i32 - 1).max(0) / SIDE as i32).min(columns as i32);
        let (first, end) = (first_pixel(low[1][i], limit), end_pixel(high[1][i]));
        bands.covered[0][i] = (first.max(0) + SIDE as i32 - 1) / SIDE as i32;
        // In rows of tiles where the shape begins or ends, no tile is covered entirely.
        let all = (bottom[i] - top[i] >= 7.0) & (first < end);
        bands.covered[1][i] = if all { end.max(0) / SIDE as i32 } else { -1 };
    }
    bands
}

/// First pixel row of each of eight rows of tiles, in pixels relative to the first pixel row of the first of
/// these rows of tiles.
const TILE_ROW_STARTS: [f32; SIDE] = [0.0, 8.0, 16.0, 24.0, 32.0, 40.0, 48.0, 56.0];
/// Indices 0 to 7 of the rows of pixels of a tile, as `f32`.
const PIXEL_ROWS: [f32; SIDE] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// Returns the first pixel column whose left border is at or to the right of `low`, a column bound in pixels:
/// `low` rounded up. `limit` rounded up if `low` is greater than `limit` or NaN. `limit` must be finite.
#[inline(always)]
fn first_pixel(low: f32, limit: f32) -> i32 {
    round_to_i32(if low <= limit { low } else { limit } + 0.5)
}

/// Returns the exclusive end of the pixel columns that lie wholly to the left of `high`, a column bound in
/// pixels: `high` rounded down. A negative number if `high` is below 0 or NaN.
#[inline(always)]
fn end_pixel(high: f32) -> i32 {
    round_to_i32(if high >= -1.0 { high } else { -1.0 } - 0.5)
}

/// Returns the columns, in pixels and not rounded, between which the shape covers each of the eight pixel
/// rows of row `row` of tiles: element 0 holds the left ends, element 1 the right ends. A left end greater
/// than the right end means that the row has no covered column. The shape's own row range is not considered.
/// The column limits of the shape's rectangle, which are whole numbers, are moved outwards by a quarter of a
/// pixel, so that rounding to whole pixels always gives the limits themselves.
#[inline(always)]
fn spans(shape: &ScreenShape, row: usize) -> [[f32; SIDE]; 2] {
    let (mut low, mut high) = ([shape.columns[0] - 0.25; SIDE], [shape.columns[1] + 0.25; SIDE]);
    let mut y = [0.0; SIDE];
    let start = (row * SIDE) as f32;
    for i in 0..SIDE {
        y[i] = start + PIXEL_ROWS[i];
    }
    for line in &shape.left[..shape.lefts] {
        for i in 0..SIDE {
            let x = y[i] * line.slope + line.offset;
            low[i] = if x > low[i] { x } else { low[i] };
        }
    }
    for line in &shape.right[..shape.rights] {
        for i in 0..SIDE {
            let x = y[i] * line.slope + line.offset;
            high[i] = if x < high[i] { x } else { high[i] };
        }
    }
    [low, high]
}

/// Fills row `row` of the buffer's tiles with the shape. `i` is the index of that row in `bands`, 0 to 7.
/// `depth_planes_index` is the index of the shape's depth planes in the tiles.
#[inline(always)]
fn fill_row(
    shape: &ScreenShape,
    tiles: &mut Tiles,
    row: usize,
    bands: &Bands,
    i: usize,
    depth_planes_index: u32,
) {
    let (start, stop) = (bands.met[0][i] as usize, bands.met[1][i] as usize);
    if start >= stop {
        return;
    }
    if bands.covered[0][i] < bands.covered[1][i] {
        tiles.mark_dirty(
            row,
            [start.max(bands.covered[0][i] as usize), stop.min(bands.covered[1][i] as usize)],
        );
    }
    let covered = [bands.covered[0][i] as f32, bands.covered[1][i] as f32];
    let mut offsets = [0.0; MAX_PLANES];
    for plane in 0..shape.plane_count {
        offsets[plane] = row as f32 * shape.planes[plane][1] + shape.planes[plane][2];
    }
    let base = row * tiles.columns;
    let mut column = start;
    while column < stop {
        let depth_key = depths(shape, &offsets, column);
        let values = &mut tiles.tile_min[base + column..base + column + WIDTH];
        let depth_planes = &mut tiles.depth_planes_index[base + column..base + column + WIDTH];
        // Tiles from `stop` on keep their values.
        let (limit, first_column) = (stop as f32, column as f32);
        let mut part = [0u8; WIDTH];
        for i in 0..WIDTH {
            let x = first_column + STEPS[i];
            let nearer = (depth_key[i] > values[i]) & (x < limit);
            let inner = nearer & (x >= covered[0]) & (x < covered[1]);
            values[i] = if inner { depth_key[i] } else { values[i] };
            depth_planes[i] = if inner { depth_planes_index } else { depth_planes[i] };
            part[i] = u8::from(nearer & !inner);
        }
        let mut part = bits(&part);
        if part != 0 {
            tiles.spans.set(&spans(shape, row));
            // Mask of the rows of pixels within the shape's row range.
            let start = (row * SIDE) as i32;
            let lines =
                lines_below(shape.lines[1] as i32 - start) & !lines_below(shape.lines[0] as i32 - start);
            // Masks are made for two tiles at a time, and all masks before any tile is covered, so that
            // latencies overlap.
            let mut left = part;
            while left != 0 {
                let first = left.trailing_zeros() as usize % WIDTH;
                left &= left - 1;
                let second = left.trailing_zeros() as usize % WIDTH;
                left &= left.wrapping_sub(1);
                tiles.spans.make_masks(column, first, second);
            }
            while part != 0 {
                let i = part.trailing_zeros() as usize % WIDTH;
                part &= part - 1;
                let mask = u64::from_le_bytes(tiles.spans.masks[i]) & lines;
                tiles.cover(base + column + i, mask, depth_key[i], depth_planes_index);
            }
        }
        column += WIDTH;
    }
}

/// Returns a lower bound on the depth key (greater is nearer) of a shape in each of [`WIDTH`] tiles from tile
/// column `column` on: the least value of the shape's depth planes in that tile, limited to the range from
/// the shape's `floor` to its `ceiling`. `offsets` are the values of the planes in tile column 0 of the row
/// of tiles.
#[inline(always)]
fn depths(shape: &ScreenShape, offsets: &[f32; MAX_PLANES], column: usize) -> [f32; WIDTH] {
    let mut least = [shape.ceiling; WIDTH];
    let first = column as f32;
    for plane in 0..shape.plane_count {
        let (slope, offset) = (shape.planes[plane][0], offsets[plane]);
        for i in 0..WIDTH {
            let depth_key = (first + STEPS[i]) * slope + offset;
            least[i] = if depth_key < least[i] { depth_key } else { least[i] };
        }
    }
    for value in &mut least {
        *value = if *value >= shape.floor { *value } else { shape.floor };
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A depth plane whose coefficients or values overflow `f32` bounds nothing, whatever planes are added
    /// after it: the shape is drawn at its floor.
    #[test]
    fn planes_that_overflow_bound_nothing_in_any_order() {
        let (size, finite) = ([64.0; 2], [0.0, 0.0, 50.0]);
        // These planes give infinity times column 0, infinity less infinity, and NaN.
        let planes = [[1e39, 0.0, -1e40], [1e38 / 2.0, -1e38 / 2.0, -5.0], [0.0, 0.0, f64::NAN]];
        for plane in planes {
            for order in [[plane, finite], [finite, plane]] {
                let (mut shape, mut tiles) = (ScreenShape::default(), Tiles::new(64, 64));
                shape.begin([0.0, 64.0], [0.0, 64.0], 1.0, 100.0);
                for plane in order {
                    assert!(shape.add_depth_plane(plane, size), "{plane:?} is kept");
                }
                assert!(fill_shape(&shape, &mut tiles), "{order:?} covers the tiles");
                for at in [3, 60] {
                    assert_eq!(tiles.pixel_closely(at, at), 1.0, "{order:?} at {at}, {at}");
                }
            }
        }
    }

    /// Shapes without columns or rows, also with ends in the wrong order, cover nothing; those that reach
    /// beyond the buffer are cut off there.
    #[test]
    fn shapes_fill_their_rectangle_within_the_buffer() {
        let (ends, mut filled) = ([0.0, 3.0, 8.0, 15.0, 24.0, 70.0], 0);
        for case in 0..6usize.pow(4) {
            let [left, right, top, bottom] = [1, 6, 36, 216].map(|divisor| ends[case / divisor % 6]);
            let (mut shape, mut tiles) = (ScreenShape::default(), Tiles::new(24, 16));
            shape.begin([left, right.min(24.0)], [top, bottom.min(16.0)], 1.0, 1.0);
            let is_filled = fill_shape(&shape, &mut tiles);
            let rectangle = [left, right, top, bottom];
            for (x, y) in (0..16).flat_map(|y| (0..24).map(move |x| (x, y))) {
                let [column, line] = [x, y].map(|at| at as f64);
                let is_in = left <= column && column < right && top <= line && line < bottom;
                assert_eq!(tiles.pixel(x, y) == 1.0, is_in, "pixel {x}, {y} of {rectangle:?}");
                assert!(is_filled || !is_in, "{rectangle:?} has pixels");
                filled += u32::from(is_in);
            }
        }
        assert!(filled > 10_000, "{filled} pixels are filled");
    }
}
