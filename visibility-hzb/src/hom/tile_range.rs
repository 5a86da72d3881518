//! Rectangles of tiles.

use crate::buffer::tile_layout::{Rectangle, SIDE};

/// First and last column, first and last row of some tiles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TileRange(pub(crate) [usize; 4]);

impl TileRange {
    /// No tiles.
    pub(crate) const NONE: Self = Self([usize::MAX, 0, usize::MAX, 0]);

    /// The tiles that a rectangle of pixels meets.
    #[inline(always)]
    pub(crate) fn of(rectangle: &Rectangle) -> Self {
        let Rectangle { columns: [left, right], lines: [top, bottom] } = *rectangle;
        let [left, right, top, bottom] = [left, right - 1, top, bottom - 1].map(|side| side as usize / SIDE);
        Self([left, right, top, bottom])
    }

    /// Extends this to contain `other`.
    pub(crate) fn join(&mut self, other: &Self) {
        let ([x0, x1, y0, y1], [u0, u1, v0, v1]) = (self.0, other.0);
        self.0 = [x0.min(u0), x1.max(u1), y0.min(v0), y1.max(v1)];
    }

    /// Whether this is no tile.
    pub(crate) fn is_empty(&self) -> bool {
        self.0[0] > self.0[1]
    }
}
