//! Masks of the pixels of a tile from where each of its rows begins and ends.

use super::tile_layout::SIDE;
use crate::lanes::WIDTH;

/// Added to a number below 2^22, leaves the nearest whole number in the low bits.
const WHOLE: f32 = 12_582_912.0;

pub(crate) const STEPS: [f32; WIDTH] =
    [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];

/// What masks are made of, for two tiles side by side: so many lanes that the compiler keeps them together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowSpans {
    /// Where each row begins and ends, moved by half a pixel for rounding; twice.
    low: [f32; 2 * SIDE],
    high: [f32; 2 * SIDE],
    /// A byte for each row of a tile.
    pub(crate) masks: [[u8; SIDE]; WIDTH],
}

impl RowSpans {
    pub(crate) const NONE: Self =
        Self { low: [0.0; 2 * SIDE], high: [0.0; 2 * SIDE], masks: [[0; SIDE]; WIDTH] };

    #[inline(always)]
    pub(crate) fn set(&mut self, [low, high]: &[[f32; SIDE]; 2]) {
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
