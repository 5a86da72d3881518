//! Rectangular ranges of tiles.

use crate::buffer::tile_layout::{Rectangle, SIDE};

/// A rectangle of tiles: first column, last column, first row, last row, all inclusive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TileRange(pub(crate) [usize; 4]);

impl TileRange {
    /// The empty range, neutral in [`join`](Self::join).
    pub(crate) const NONE: Self = Self([usize::MAX, 0, usize::MAX, 0]);

    /// Returns the tiles that a rectangle of pixels meets.
    #[inline(always)]
    pub(crate) fn of(rectangle: &Rectangle) -> Self {
        let Rectangle { columns: [left, right], lines: [top, bottom] } = *rectangle;
        let [left, right, top, bottom] = [left, right - 1, top, bottom - 1].map(|side| side as usize / SIDE);
        Self([left, right, top, bottom])
    }

    /// Extends this range to the smallest one that also contains `other`.
    pub(crate) fn join(&mut self, other: &Self) {
        let ([x0, x1, y0, y1], [u0, u1, v0, v1]) = (self.0, other.0);
        self.0 = [x0.min(u0), x1.max(u1), y0.min(v0), y1.max(v1)];
    }

    /// Returns whether the range contains no tile.
    pub(crate) fn is_empty(&self) -> bool {
        self.0[0] > self.0[1]
    }
}
