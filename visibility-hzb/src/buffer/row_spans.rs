//! Pixel masks of tiles, from where each row of pixels begins and ends.

use super::tile_layout::SIDE;
use crate::lanes::WIDTH;

/// 1.5 times 2^23. A number below 2^22 in size, added to it, leaves the nearest integer in the low bits.
const WHOLE: f32 = 12_582_912.0;

/// The lane numbers.
pub(crate) const STEPS: [f32; WIDTH] =
    [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];

/// Spans of the eight rows of pixels of a row of tiles, twice in a row: masks of two tiles are made at once,
/// which fills the lanes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowSpans {
    /// The column at which each row of pixels begins, plus 0.5 for rounding.
    low: [f32; 2 * SIDE],
    /// The column at which it ends, less 0.5.
    high: [f32; 2 * SIDE],
    /// Masks of [`WIDTH`] tiles, a byte for each row of pixels. Those that [`make_masks`](Self::make_masks)
    /// has not made are stale.
    pub(crate) masks: [[u8; SIDE]; WIDTH],
}

impl RowSpans {
    /// Empty spans.
    pub(crate) const NONE: Self =
        Self { low: [0.0; 2 * SIDE], high: [0.0; 2 * SIDE], masks: [[0; SIDE]; WIDTH] };

    /// Sets where each row begins and ends.
    #[inline(always)]
    pub(crate) fn set(&mut self, [low, high]: &[[f32; SIDE]; 2]) {
        for i in 0..SIDE {
            (self.low[i], self.low[i + SIDE]) = (low[i] + 0.5, low[i] + 0.5);
        }
        for i in 0..SIDE {
            (self.high[i], self.high[i + SIDE]) = (high[i] - 0.5, high[i] - 0.5);
        }
    }

    /// Makes the masks of the tiles `first` and `second` columns after `column`. If both are the same, that
    /// tile.
    ///
    /// Rounds to pixels as whole tiles are found in `shape_fill.rs`: taking the first column of a tile off a
    /// bound within it is exact.
    #[inline(always)]
    pub(crate) fn make_masks(&mut self, column: usize, first: usize, second: usize) {
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
