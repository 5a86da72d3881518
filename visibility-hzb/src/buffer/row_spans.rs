//! Pixel masks of tiles, made from the range of columns that a shape covers in each row of pixels.

use super::tile_layout::SIDE;
use crate::lanes::{WHOLE, WIDTH, greatest, least};

/// Lane indices 0 to 15 as `f32`.
pub(crate) const STEPS: [f32; WIDTH] =
    [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];

/// Spans (column ranges) that a shape covers in the eight rows of pixels of one row of tiles. Each span is
/// stored twice, so that the masks of two tiles are made at once, which fills the vector lanes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowSpans {
    /// Column at which the span of each row of pixels begins, in pixels of the buffer, plus 0.5, so that
    /// rounding to the nearest integer gives the first column that lies wholly in the span. Elements 8 to 15
    /// repeat elements 0 to 7.
    low: [f32; 2 * SIDE],
    /// Column at which the span of each row of pixels ends, in pixels of the buffer, less 0.5, so that
    /// rounding to the nearest integer gives the end (exclusive) of the columns that lie wholly in the span.
    /// Elements 8 to 15 repeat elements 0 to 7.
    high: [f32; 2 * SIDE],
    /// Pixel masks of [`WIDTH`] tiles, one byte for each row of pixels, bit i for column i of the tile.
    /// Masks that [`make_masks`](Self::make_masks) has not written for the current spans are stale.
    pub(crate) masks: [[u8; SIDE]; WIDTH],
}

impl RowSpans {
    /// Spans that cover no column, and masks without pixels.
    pub(crate) const NONE: Self =
        Self { low: [0.0; 2 * SIDE], high: [0.0; 2 * SIDE], masks: [[0; SIDE]; WIDTH] };

    /// Replaces the spans of the eight rows of pixels in a row of tiles: the span of each row goes from
    /// column `low` to column `high`, in pixels of the buffer, not rounded to whole pixels.
    #[inline(always)]
    pub(crate) fn set(&mut self, [low, high]: &[[f32; SIDE]; 2]) {
        for i in 0..SIDE {
            (self.low[i], self.low[i + SIDE]) = (low[i] + 0.5, low[i] + 0.5);
        }
        for i in 0..SIDE {
            (self.high[i], self.high[i + SIDE]) = (high[i] - 0.5, high[i] - 0.5);
        }
    }

    /// Writes the masks of two tiles of the row: that of tile column `column + first` to `masks[first]`, that
    /// of tile column `column + second` to `masks[second]`. `first` and `second` may be equal.
    ///
    /// Ends of spans are rounded to pixels exactly as `shape_fill.rs` rounds them to find the tiles that are
    /// covered entirely: subtracting the tile's first column from an end within the tile is exact.
    #[inline(always)]
    pub(crate) fn make_masks(&mut self, column: usize, first: usize, second: usize) {
        let start = (column * SIDE) as f32;
        let (mut left, mut bytes) = ([start + STEPS[first] * 8.0; 2 * SIDE], [0; 2 * SIDE]);
        for i in SIDE..2 * SIDE {
            left[i] = start + STEPS[second] * 8.0;
        }
        for i in 0..2 * SIDE {
            let (low, high) = (self.low[i] - left[i], self.high[i] - left[i]);
            let (low, high) = (least(greatest(low, 0.0), 8.0), least(greatest(high, 0.0), 8.0));
            let (first, end) = ((low + WHOLE).to_bits() & 15, (high + WHOLE).to_bits() & 15);
            bytes[i] = ((0xff_u32 << first) & !(0xff << end)) as u8;
        }
        let (masks, _) = bytes.as_chunks::<SIDE>();
        self.masks[second] = masks[1];
        self.masks[first] = masks[0];
    }
}
