//! Fills shapes into tiles: eight rows of pixels at a time, whole tiles in runs.

use crate::pyramid::{Rectangle, below as lines_below, mask as mask_of};
use crate::shape::{MAX_PLANES, Shape};
use crate::tiles::{SIDE, Tiles};

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
    let surface = tiles.add_surface(shape);
    let mut row = first_row;
    while row < end_row {
        let bands = bands(shape, row, columns);
        for i in 0..SIDE.min(end_row - row) {
            fill_row(shape, tiles, row + i, &bands, i, surface);
        }
        row += SIDE;
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

/// What eight rows of tiles have of a shape: first and end columns of tiles that it meets, or somewhat more, and of those that it covers whole.
struct Bands {
    met: [[i32; SIDE]; 2],
    covered: [[i32; SIDE]; 2],
}

/// Bounds are monotonic in the row of pixels, also when rounded; so the first and the last row within a row of tiles tell the extremes of each.
#[inline(always)]
fn bands(shape: &Shape, first_row: usize, columns: usize) -> Bands {
    let (mut top, mut bottom) = ([0.0; SIDE], [0.0; SIDE]);
    let (first, last) = (shape.lines[0] as f32, shape.lines[1] as f32 - 1.0);
    let start = (first_row * SIDE) as f32;
    for i in 0..SIDE {
        let y = start + EIGHTS[i];
        top[i] = if y > first { y } else { first };
        bottom[i] = if y + 7.0 < last { y + 7.0 } else { last };
    }
    // Outer and inner bounds. Rows as in `spans`, from which a whole tile must not differ by a rounding.
    let (left, right) = (shape.columns[0] - 0.25, shape.columns[1] + 0.25);
    let (mut low, mut high) = ([[left; SIDE]; 2], [[right; SIDE]; 2]);
    for line in &shape.left[..shape.lefts] {
        for i in 0..SIDE {
            let (a, b) = (top[i] * line.slope + line.offset, bottom[i] * line.slope + line.offset);
            let (least, most) = if a < b { (a, b) } else { (b, a) };
            // A NaN covers nothing.
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
        // Rows of tiles that the shape begins or ends in are not covered to the border.
        let all = (bottom[i] - top[i] >= 7.0) & (first < end);
        bands.covered[1][i] = if all { end.max(0) / SIDE as i32 } else { -1 };
    }
    bands
}

const EIGHTS: [f32; SIDE] = [0.0, 8.0, 16.0, 24.0, 32.0, 40.0, 48.0, 56.0];
const ONES: [f32; SIDE] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// The first pixel at or after a bound; not beyond a limit, which is finite, while a NaN is.
#[inline(always)]
fn first_pixel(low: f32, limit: f32) -> i32 {
    whole(if low <= limit { low } else { limit } + 0.5)
}

/// The pixel after the last that ends before a bound. A NaN is before all.
#[inline(always)]
fn end_pixel(high: f32) -> i32 {
    whole(if high >= -1.0 { high } else { -1.0 } - 0.5)
}

/// Where the eight rows of pixels of a row of tiles begin and end, as far as bounds from the left and from the right tell.
///
/// A quarter of a pixel keeps limits, which are whole, away from where rounding to whole numbers could go either way.
#[inline(always)]
fn spans(shape: &Shape, row: usize) -> [[f32; SIDE]; 2] {
    let (mut low, mut high) = ([shape.columns[0] - 0.25; SIDE], [shape.columns[1] + 0.25; SIDE]);
    let mut y = [0.0; SIDE];
    let start = (row * SIDE) as f32;
    for i in 0..SIDE {
        y[i] = start + ONES[i];
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

#[inline(always)]
fn fill_row(shape: &Shape, tiles: &mut Tiles, row: usize, bands: &Bands, i: usize, surface: u32) {
    let (start, stop) = (bands.met[0][i] as usize, bands.met[1][i] as usize);
    if start >= stop {
        return;
    }
    if bands.covered[0][i] < bands.covered[1][i] {
        tiles.note(row, [start.max(bands.covered[0][i] as usize), stop.min(bands.covered[1][i] as usize)]);
    }
    let covered = [bands.covered[0][i] as f32, bands.covered[1][i] as f32];
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
        let (limit, first_column) = (stop as f32, column as f32);
        let mut part = [0u8; WIDTH];
        for i in 0..WIDTH {
            let x = first_column + STEPS[i];
            let nearer = (nearness[i] > values[i]) & (x < limit);
            let inner = nearer & (x >= covered[0]) & (x < covered[1]);
            values[i] = if inner { nearness[i] } else { values[i] };
            surfaces[i] = if inner { surface } else { surfaces[i] };
            part[i] = u8::from(nearer & !inner);
        }
        let mut part = bits(&part);
        if part != 0 {
            tiles.spans.set(&spans(shape, row));
            // The rows of pixels that the shape reaches.
            let start = (row * SIDE) as i32;
            let lines =
                lines_below(shape.lines[1] as i32 - start) & !lines_below(shape.lines[0] as i32 - start);
            // Two tiles at a time; all of them before any is covered, which hides how long each takes.
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
                tiles.cover(base + column + i, mask, nearness[i], surface);
            }
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

/// What masks are made of, for two tiles side by side: so many lanes that the compiler keeps them together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spans {
    /// Where each row begins and ends, moved by half a pixel for rounding; twice.
    low: [f32; 2 * SIDE],
    high: [f32; 2 * SIDE],
    /// A byte for each row of a tile.
    masks: [[u8; SIDE]; WIDTH],
}

impl Spans {
    pub(crate) const NONE: Self =
        Self { low: [0.0; 2 * SIDE], high: [0.0; 2 * SIDE], masks: [[0; SIDE]; WIDTH] };

    #[inline(always)]
    fn set(&mut self, [low, high]: &[[f32; SIDE]; 2]) {
        for i in 0..SIDE {
            (self.low[i], self.low[i + SIDE]) = (low[i] + 0.5, low[i] + 0.5);
        }
        for i in 0..SIDE {
            (self.high[i], self.high[i + SIDE]) = (high[i] - 0.5, high[i] - 0.5);
        }
    }

    /// Finds the pixels that lie in the spans, for two tiles so many columns after a given one. The first counts where both are the same.
    ///
    /// Bounds are rounded to pixels as in [`bands`]: within a tile, taking its place from a bound is exact.
    #[inline(always)]
    fn make_masks(&mut self, column: usize, first: usize, second: usize) {
        let start = (column * SIDE) as f32;
        let (mut left, mut bytes) = ([start + STEPS[first] * 8.0; 2 * SIDE], [0; 2 * SIDE]);
        for i in SIDE..2 * SIDE {
            left[i] = start + STEPS[second] * 8.0;
        }
        for i in 0..2 * SIDE {
            let (low, high) = (self.low[i] - left[i], self.high[i] - left[i]);
            let low = if low > 0.0 { low } else { 0.0 };
            let high = if high > 0.0 { high } else { 0.0 };
            let low = if low < 8.0 { low } else { 8.0 };
            let high = if high < 8.0 { high } else { 8.0 };
            let (first, end) = ((low + WHOLE).to_bits() & 15, (high + WHOLE).to_bits() & 15);
            bytes[i] = ((0xff_u32 << first) & !(0xff << end)) as u8;
        }
        let (masks, _) = bytes.as_chunks::<SIDE>();
        self.masks[second] = masks[1];
        self.masks[first] = masks[0];
    }
}
