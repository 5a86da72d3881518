//! The layout of tiles: 8 x 8 pixels. The pixel at column `x` and row `y` of a tile, from the upper left, is
//! bit `8 * y + x` of a `u64`.

/// Width and height of a tile, in pixels.
pub(crate) const SIDE: usize = 8;

/// Number of extra elements at the end of each per-tile array. Loops that start at any tile may read a whole
/// group of [`WIDTH`](crate::lanes::WIDTH) tiles.
pub(crate) const PADDING: usize = crate::lanes::WIDTH;

/// Depth key of an uncovered pixel or of a tile with an uncovered pixel: farther than any occluder.
pub(crate) const EMPTY_DEPTH: f32 = f32::NEG_INFINITY;

/// A rectangle of whole pixels of the buffer, never empty.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rectangle {
    /// Column range in pixels, half-open.
    pub(crate) columns: [u32; 2],
    /// Row range in pixels, half-open. Row 0 is at the top.
    pub(crate) lines: [u32; 2],
}

impl Rectangle {
    /// Returns whether the rectangle is at most one pixel wide or at most one pixel high. A shape whose
    /// bounds, rounded outwards, are that thin covers no pixel entirely.
    #[inline(always)]
    pub(crate) fn is_thin(&self) -> bool {
        self.columns[1] - self.columns[0] <= 1 || self.lines[1] - self.lines[0] <= 1
    }

    /// Returns the part of the rectangle in a half-open range of tile columns. `None` if it is empty.
    #[inline(always)]
    pub(crate) fn within_columns(&self, columns: [usize; 2]) -> Option<Self> {
        let [first, end] = columns.map(|column| (column * SIDE) as u32);
        let columns = [self.columns[0].max(first), self.columns[1].min(end)];
        (columns[0] < columns[1]).then_some(Self { columns, ..*self })
    }
}

/// A `u64` whose eight bytes are 1, one byte for each row of a tile. Multiplying by a byte repeats that byte
/// in all rows.
pub(crate) const LINES: u64 = 0x0101_0101_0101_0101;

/// Returns the mask of the pixels that a rectangle meets in the tile at tile column `x` and tile row `y`. The
/// pixel at column `u` and row `v` of the tile is bit `8 * v + u`. 0 if the rectangle does not meet the tile.
#[inline(always)]
pub(crate) fn mask(rectangle: &Rectangle, x: usize, y: usize) -> u64 {
    let (left, right) = within(rectangle.columns, x);
    let (top, bottom) = within(rectangle.lines, y);
    let byte = (0xff_u64 << left) & 0xff & !(0xff00_u64 << right >> 8);
    let lines = below(bottom) & !below(top);
    (byte * LINES) & lines
}

/// Returns the part of a half-open pixel range within the tile of index `tile` along one axis, as first and
/// end pixel from 0 to 8 relative to the tile. First and end are equal if the range does not meet the tile.
#[inline(always)]
fn within([first, end]: [u32; 2], tile: usize) -> (i32, i32) {
    let start = (tile * SIDE) as i32;
    ((first as i32 - start).clamp(0, 8), (end as i32 - start).clamp(0, 8))
}

/// Returns the mask of the first `lines` rows of a tile: no pixels for 0 or less, all pixels for 8 or more.
#[inline(always)]
pub(crate) fn below(lines: i32) -> u64 {
    if lines >= 8 { u64::MAX } else { (1 << (8 * lines.max(0))) - 1 }
}

/// Returns the masks of eight tiles side by side from their eight common rows of pixels: bit `i` of `rows[y]`
/// stands for the pixel at column `i` of all tiles together. In each mask, bit `8 * y + x` stands for the
/// pixel at column `x` and row `y` of the tile.
#[inline(always)]
pub(crate) fn tiles_of(rows: &[u64; SIDE]) -> [u64; SIDE] {
    let mut masks = [0; SIDE];
    for row in 0..SIDE {
        let bytes = rows[row].to_le_bytes();
        for tile in 0..SIDE {
            masks[tile] |= u64::from(bytes[tile]) << (SIDE * row);
        }
    }
    masks
}
