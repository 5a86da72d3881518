//! Tiles of 8 x 8 pixels: one bit of a `u64` for each pixel, row by row from the upper left.

/// Pixels along the side of a tile.
pub(crate) const SIDE: usize = 8;

/// Tiles that can be read beyond the end of any row.
pub(crate) const PADDING: usize = crate::lanes::WIDTH;

/// Of nothing.
pub(crate) const EMPTY_DEPTH: f32 = f32::NEG_INFINITY;

/// A rectangle of pixels: first and end columns, first and end rows; not empty.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rectangle {
    pub(crate) columns: [u32; 2],
    pub(crate) lines: [u32; 2],
}

/// Of a byte, makes the same in each line of a tile.
pub(crate) const LINES: u64 = 0x0101_0101_0101_0101;

/// The pixels of a tile that a rectangle meets.
#[inline(always)]
pub(crate) fn mask(rectangle: &Rectangle, x: usize, y: usize) -> u64 {
    let (left, right) = within(rectangle.columns, x);
    let (top, bottom) = within(rectangle.lines, y);
    let byte = (0xff_u64 << left) & 0xff & !(0xff00_u64 << right >> 8);
    let lines = below(bottom) & !below(top);
    (byte * LINES) & lines
}

/// The part of a range of pixels within a tile.
#[inline(always)]
fn within([first, end]: [u32; 2], tile: usize) -> (i32, i32) {
    let start = (tile * SIDE) as i32;
    ((first as i32 - start).clamp(0, 8), (end as i32 - start).clamp(0, 8))
}

/// The first so many lines of a tile.
#[inline(always)]
pub(crate) fn below(lines: i32) -> u64 {
    if lines >= 8 { u64::MAX } else { (1 << (8 * lines.max(0))) - 1 }
}
