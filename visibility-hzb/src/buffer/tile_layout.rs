//! The layout of tiles: 8 x 8 pixels, one bit of a `u64` each, row by row from the upper left.

/// Pixels along the side of a tile.
pub(crate) const SIDE: usize = 8;

/// Tiles that may be read beyond the end of any row.
pub(crate) const PADDING: usize = crate::lanes::WIDTH;

/// Depth key of an empty pixel or tile: farther than any occluder.
pub(crate) const EMPTY_DEPTH: f32 = f32::NEG_INFINITY;

/// A rectangle of pixels; never empty.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rectangle {
    /// Column range, half-open.
    pub(crate) columns: [u32; 2],
    /// Row range, half-open.
    pub(crate) lines: [u32; 2],
}

/// A one for each row of a tile. Times a byte, it repeats that byte in all rows.
pub(crate) const LINES: u64 = 0x0101_0101_0101_0101;

/// The pixels of the tile at column `x` and row `y` of tiles that a rectangle meets.
#[inline(always)]
pub(crate) fn mask(rectangle: &Rectangle, x: usize, y: usize) -> u64 {
    let (left, right) = within(rectangle.columns, x);
    let (top, bottom) = within(rectangle.lines, y);
    let byte = (0xff_u64 << left) & 0xff & !(0xff00_u64 << right >> 8);
    let lines = below(bottom) & !below(top);
    (byte * LINES) & lines
}

/// The part of a range of pixels that lies in a tile, counted from the first pixel of the tile.
#[inline(always)]
fn within([first, end]: [u32; 2], tile: usize) -> (i32, i32) {
    let start = (tile * SIDE) as i32;
    ((first as i32 - start).clamp(0, 8), (end as i32 - start).clamp(0, 8))
}

/// The first `lines` rows of a tile; none if negative, all from 8 on.
#[inline(always)]
pub(crate) fn below(lines: i32) -> u64 {
    if lines >= 8 { u64::MAX } else { (1 << (8 * lines.max(0))) - 1 }
}
