//! Fills shapes into tiles: eight rows of pixels at a time, whole tiles in runs.

use crate::pyramid::{Rectangle, mask as mask_of};
use crate::shape::Shape;
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
    if !(first_row..end_row).any(|row| {
        let row = &tiles.whole[row * columns + first_column..row * columns + end_column];
        any_farther(row, shape.ceiling)
    }) {
        return false;
    }
    for row in first_row..end_row {
        fill_row(shape, tiles, row);
    }
    true
}

/// Whether something of the given nearness could be in front of what there is, somewhere in a rectangle.
#[inline(always)]
pub(crate) fn still_seen(tiles: &Tiles, rectangle: &Rectangle, nearness: f32) -> bool {
    let [x0, x1] = [rectangle.columns[0] as usize / SIDE, (rectangle.columns[1] as usize).div_ceil(SIDE)];
    let [y0, y1] = [rectangle.lines[0] as usize / SIDE, (rectangle.lines[1] as usize).div_ceil(SIDE)];
    (y0..y1.min(tiles.rows)).any(|y| {
        let row = &tiles.whole[y * tiles.columns + x0..y * tiles.columns + x1.min(tiles.columns)];
        any_farther(row, nearness)
            && (x0..x1.min(tiles.columns))
                .any(|x| !tiles.hides(y * tiles.columns + x, mask_of(rectangle, x, y), nearness))
    })
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
    rest.iter().any(|&value| value < limit)
}

#[inline(always)]
fn fill_row(shape: &Shape, tiles: &mut Tiles, row: usize) {
    // The span of each of eight rows of pixels.
    // A quarter of a pixel keeps limits, which are whole, away from where rounding to whole numbers could go either way.
    let (mut low, mut high) = ([shape.columns[0] - 0.25; SIDE], [shape.columns[1] + 0.25; SIDE]);
    let y: [f32; SIDE] = core::array::from_fn(|i| (row * SIDE + i) as f32);
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
    let (mut least_first, mut most_first) = (i32::MAX, i32::MIN);
    let (mut least_end, mut most_end) = (i32::MAX, i32::MIN);
    for i in 0..SIDE {
        // Rows without a pixel do not stretch the span.
        let empty = first[i] >= end[i];
        least_first = least_first.min(if empty { i32::MAX } else { first[i] });
        most_end = most_end.max(if empty { i32::MIN } else { end[i] });
        most_first = most_first.max(first[i]);
        least_end = least_end.min(end[i]);
    }
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

    let depth = Depths::of_row(shape, row);
    let base = row * tiles.columns;
    for column in (start..whole_start.min(stop)).chain(whole_stop..stop) {
        let nearness = depth.at(column);
        if nearness > tiles.whole[base + column] {
            tiles.cover(base + column, mask(&first, &end, column), nearness);
        }
    }
    if whole_start < whole_stop {
        depth.fill(&mut tiles.whole[base + whole_start..base + whole_stop], whole_start);
    }
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

/// The planes of a shape along a row of tiles.
struct Depths<'a> {
    shape: &'a Shape,
    offsets: [f32; crate::shape::MAX_PLANES],
}

impl<'a> Depths<'a> {
    #[inline(always)]
    fn of_row(shape: &'a Shape, row: usize) -> Self {
        let mut offsets = [0.0; crate::shape::MAX_PLANES];
        for (offset, plane) in offsets.iter_mut().zip(&shape.planes[..shape.plane_count]) {
            *offset = row as f32 * plane[1] + plane[2];
        }
        Self { shape, offsets }
    }

    #[inline(always)]
    fn at(&self, column: usize) -> f32 {
        let mut least = self.shape.ceiling;
        for (plane, offset) in self.shape.planes[..self.shape.plane_count].iter().zip(&self.offsets) {
            let nearness = column as f32 * plane[0] + offset;
            // A NaN bounds by nothing but the floor.
            least = if nearness >= least { least } else { nearness };
        }
        if least >= self.shape.floor { least } else { self.shape.floor }
    }

    /// Takes the nearer of what the tiles hold and the shape, for a run of tiles that starts at a column.
    #[inline(always)]
    fn fill(&self, run: &mut [f32], column: usize) {
        let steps: [f32; 16] = core::array::from_fn(|i| i as f32);
        for (chunk, values) in run.chunks_mut(16).enumerate() {
            let mut least = [self.shape.ceiling; 16];
            let first = (column + 16 * chunk) as f32;
            for (plane, offset) in self.shape.planes[..self.shape.plane_count].iter().zip(&self.offsets) {
                for i in 0..16 {
                    let nearness = (first + steps[i]) * plane[0] + offset;
                    least[i] = if nearness >= least[i] { least[i] } else { nearness };
                }
            }
            for value in &mut least {
                *value = if *value >= self.shape.floor { *value } else { self.shape.floor };
            }
            if let Ok(values) = <&mut [f32; 16]>::try_from(&mut *values) {
                for i in 0..16 {
                    values[i] = if least[i] > values[i] { least[i] } else { values[i] };
                }
            } else {
                for (value, new) in values.iter_mut().zip(least) {
                    *value = if new > *value { new } else { *value };
                }
            }
        }
    }
}
