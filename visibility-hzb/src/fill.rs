//! Fills shapes into tiles: eight rows of pixels at a time, whole tiles in runs.

use crate::pyramid::{Rectangle, mask as mask_of};
use crate::shape::{MAX_PLANES, Shape};
use crate::tiles::{SIDE, Surface, Tiles};

/// Added to a number below 2^22, leaves the nearest whole number in the low bits.
const WHOLE: f32 = 12_582_912.0;

#[inline(always)]
fn whole(x: f32) -> i32 {
    (x + WHOLE).to_bits() as i32 - WHOLE.to_bits() as i32
}

/// Fills a shape. Whether any of it was in front of what there was, at the first glance.
#[inline(always)]
pub(crate) fn fill(shape: &Shape, tiles: &mut Tiles) -> bool {
    let columns = tiles.columns;
    let first_row = shape.lines[0] / SIDE;
    let end_row = shape.lines[1].div_ceil(SIDE).min(tiles.rows);
    let first_column = (shape.columns[0] as usize) / SIDE;
    let end_column = (shape.columns[1] as usize).div_ceil(SIDE).min(columns);
    if first_row >= end_row || first_column >= end_column {
        return false;
    }
    // Hidden by what there is?
    let mut seen = false;
    for row in first_row..end_row {
        seen |= any_farther(
            &tiles.whole[row * columns + first_column..row * columns + end_column],
            shape.ceiling,
        );
        if seen {
            break;
        }
    }
    if !seen {
        return false;
    }
    let surface = tiles.add_surface(Surface::of(&shape.planes[..shape.plane_count]));
    for row in first_row..end_row {
        fill_row(shape, tiles, row, surface);
    }
    true
}

/// Whether something of the given nearness could be in front of what there is, somewhere in a rectangle.
#[inline(always)]
pub(crate) fn still_seen(tiles: &Tiles, rectangle: &Rectangle, nearness: f32) -> bool {
    let [x0, x1] = [rectangle.columns[0] as usize / SIDE, (rectangle.columns[1] as usize).div_ceil(SIDE)];
    let [y0, y1] = [rectangle.lines[0] as usize / SIDE, (rectangle.lines[1] as usize).div_ceil(SIDE)];
    let x1 = x1.min(tiles.columns);
    // Plain loops here and below: a closure handed to an iterator is compiled apart, for the narrowest instructions.
    for y in y0..y1.min(tiles.rows) {
        let base = y * tiles.columns;
        if any_farther(&tiles.whole[base + x0..base + x1], nearness) {
            for x in x0..x1 {
                if tiles.whole[base + x] <= nearness
                    && !tiles.hides(base + x, mask_of(rectangle, x, y), nearness)
                {
                    return true;
                }
            }
        }
    }
    false
}

/// Whether any of the numbers is below a limit.
#[inline(always)]
fn any_farther(values: &[f32], limit: f32) -> bool {
    let (chunks, rest) = values.as_chunks::<16>();
    for chunk in chunks {
        let mut any = false;
        for &value in chunk {
            any |= value < limit;
        }
        if any {
            return true;
        }
    }
    let mut any = false;
    for &value in rest {
        any |= value < limit;
    }
    any
}

#[inline(always)]
fn fill_row(shape: &Shape, tiles: &mut Tiles, row: usize, surface: u32) {
    // The span of each of eight rows of pixels.
    // A quarter of a pixel keeps limits, which are whole, away from where rounding to whole numbers could go either way.
    let (mut low, mut high) = ([shape.columns[0] - 0.25; SIDE], [shape.columns[1] + 0.25; SIDE]);
    let mut y = [0.0; SIDE];
    for i in 0..SIDE {
        y[i] = (row * SIDE + i) as f32;
    }
    for line in &shape.left[..shape.lefts] {
        for i in 0..SIDE {
            let x = y[i] * line.slope + line.offset;
            // A NaN excludes the row.
            low[i] = if x <= low[i] { low[i] } else { x };
        }
    }
    for line in &shape.right[..shape.rights] {
        for i in 0..SIDE {
            let x = y[i] * line.slope + line.offset;
            high[i] = if x >= high[i] { high[i] } else { x };
        }
    }
    let limit = shape.columns[1] + 1.0;
    let (mut first, mut end) = ([0i32; SIDE], [0i32; SIDE]);
    for i in 0..SIDE {
        // Both limits are finite; a NaN fails the first comparison and empties the row.
        let l = if low[i] <= limit { low[i] } else { limit };
        let h = if high[i] >= -1.0 { high[i] } else { -1.0 };
        first[i] = whole(l + 0.5);
        end[i] = whole(h - 0.5);
    }
    if row * SIDE < shape.lines[0] || (row + 1) * SIDE > shape.lines[1] {
        for i in 0..SIDE {
            if row * SIDE + i < shape.lines[0] || row * SIDE + i >= shape.lines[1] {
                end[i] = -1;
            }
        }
    }
    // Rows without a pixel do not stretch the span.
    let (mut wide_first, mut wide_end) = (first, end);
    for i in 0..SIDE {
        let empty = first[i] >= end[i];
        wide_first[i] = if empty { i32::MAX } else { first[i] };
        wide_end[i] = if empty { i32::MIN } else { end[i] };
    }
    let (least_first, most_end) = (fold(wide_first, i32::min), fold(wide_end, i32::max));
    let (most_first, least_end) = (fold(first, i32::max), fold(end, i32::min));
    if least_first >= most_end {
        return;
    }
    let side = SIDE as i32;
    let start = (least_first.max(0) / side) as usize;
    let stop = (((most_end + side - 1) / side).max(0) as usize).min(tiles.columns);
    // Tiles that all eight rows cover.
    let whole_start = ((most_first.max(0) + side - 1) / side) as usize;
    let whole_stop = ((least_end.max(0) / side) as usize).min(tiles.columns);
    let (whole_start, whole_stop) =
        if whole_start < whole_stop { (whole_start, whole_stop) } else { (stop, stop) };

    let mut offsets = [0.0; MAX_PLANES];
    for plane in 0..shape.plane_count {
        offsets[plane] = row as f32 * shape.planes[plane][1] + shape.planes[plane][2];
    }
    let base = row * tiles.columns;
    let mut column = start;
    while column < stop {
        let nearness = depths(shape, &offsets, column);
        let values = &mut tiles.whole[base + column..base + column + WIDTH];
        let surfaces = &mut tiles.surface[base + column..base + column + WIDTH];
        // Beyond the last tile of the shape, nothing is touched.
        let (limit, whole_start, whole_stop) = (stop as f32, whole_start as f32, whole_stop as f32);
        let (mut part, first_column) = ([0u8; WIDTH], column as f32);
        for i in 0..WIDTH {
            let x = first_column + STEPS[i];
            let nearer = (nearness[i] > values[i]) & (x < limit);
            let inner = nearer & (x >= whole_start) & (x < whole_stop);
            values[i] = if inner { nearness[i] } else { values[i] };
            surfaces[i] = if inner { surface } else { surfaces[i] };
            part[i] = u8::from(nearer & !inner);
        }
        let mut part = bits(&part);
        while part != 0 {
            let i = part.trailing_zeros() as usize % WIDTH;
            part &= part - 1;
            tiles.cover(base + column + i, mask(&first, &end, column + i), nearness[i]);
        }
        column += WIDTH;
    }
}

/// Tiles that are worked on together; reading so many beyond the end of a row is allowed.
const WIDTH: usize = crate::tiles::PADDING;

const STEPS: [f32; WIDTH] =
    [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];

/// A bit for each byte that is one. The product puts byte `i` into bit `56 + i`.
#[inline(always)]
pub(crate) fn bits(bytes: &[u8; WIDTH]) -> u32 {
    let ([low, high], _) = bytes.as_chunks::<8>() else { return 0 };
    let low = u64::from_le_bytes(*low).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    let high = u64::from_le_bytes(*high).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    (low | high << 8) as u32
}

/// Reduces by halves, which stays in registers.
#[inline(always)]
fn fold(mut values: [i32; SIDE], better: impl Fn(i32, i32) -> i32) -> i32 {
    for width in [4, 2, 1] {
        for i in 0..width {
            values[i] = better(values[i], values[i + width]);
        }
    }
    values[0]
}

/// The least nearness of a shape in each tile of a run that starts at a column.
#[inline(always)]
fn depths(shape: &Shape, offsets: &[f32; MAX_PLANES], column: usize) -> [f32; WIDTH] {
    let mut least = [shape.ceiling; WIDTH];
    let first = column as f32;
    for plane in 0..shape.plane_count {
        let (slope, offset) = (shape.planes[plane][0], offsets[plane]);
        for i in 0..WIDTH {
            let nearness = (first + STEPS[i]) * slope + offset;
            // A NaN bounds by nothing but the floor.
            least[i] = if nearness >= least[i] { least[i] } else { nearness };
        }
    }
    for value in &mut least {
        *value = if *value >= shape.floor { *value } else { shape.floor };
    }
    least
}

/// The pixels of a tile that lie in the spans.
#[inline(always)]
fn mask(first: &[i32; SIDE], end: &[i32; SIDE], column: usize) -> u64 {
    let left = (column * SIDE) as i32;
    let mut bytes = [0u8; SIDE];
    for i in 0..SIDE {
        let l = (first[i] - left).clamp(0, 8);
        let r = (end[i] - left).clamp(0, 8);
        bytes[i] = ((0xff << l) & !(0xff << r)) as u8;
    }
    u64::from_le_bytes(bytes)
}
