//! Rectangles of tiles.

use crate::buffer::tile_layout::{Rectangle, SIDE};

/// A range of tiles: first and last columns, first and last rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TileRange(pub(crate) [usize; 4]);

impl TileRange {
    pub(crate) const NONE: Self = Self([usize::MAX, 0, usize::MAX, 0]);

    /// The tiles that a rectangle meets.
    #[inline(always)]
    pub(crate) fn of(rectangle: &Rectangle) -> Self {
        let Rectangle { columns: [left, right], lines: [top, bottom] } = *rectangle;
        let [left, right, top, bottom] = [left, right - 1, top, bottom - 1].map(|side| side as usize / SIDE);
        Self([left, right, top, bottom])
    }

    pub(crate) fn join(&mut self, other: &Self) {
        let ([x0, x1, y0, y1], [u0, u1, v0, v1]) = (self.0, other.0);
        self.0 = [x0.min(u0), x1.max(u1), y0.min(v0), y1.max(v1)];
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0[0] > self.0[1]
    }
}
