//! The pyramid above the tiles: each texel holds the least nearness of the four below it, up to a single one (Greene, Kass and Miller,
//! "Hierarchical Z-Buffer Visibility", 1993; Cohen-Or, Chrysanthou, Silva and Durand, "A Survey of Visibility for Walkthrough
//! Applications", 2003, section 6.1).

use crate::tiles::{SIDE, Tiles};
use alloc::vec::Vec;

/// One level.
#[derive(Clone, Debug)]
struct Level {
    columns: usize,
    rows: usize,
    least: Vec<f32>,
}

/// The levels above the tiles, finest first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pyramid {
    levels: Vec<Level>,
}

/// A rectangle of pixels: first and end columns, first and end rows; not empty.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rectangle {
    pub(crate) columns: [u32; 2],
    pub(crate) lines: [u32; 2],
}

impl Pyramid {
    pub(crate) fn new(tiles: &Tiles) -> Self {
        let mut levels = Vec::new();
        let (mut columns, mut rows) = (tiles.columns, tiles.rows);
        while columns > 1 || rows > 1 {
            (columns, rows) = (columns.div_ceil(2), rows.div_ceil(2));
            levels.push(Level { columns, rows, least: alloc::vec![f32::NEG_INFINITY; columns * rows] });
        }
        Self { levels }
    }

    /// The number of levels.
    pub(crate) fn height(&self) -> usize {
        self.levels.len()
    }

    /// A level as columns, rows and values.
    pub(crate) fn level(&self, level: usize) -> Option<(usize, usize, &[f32])> {
        self.levels.get(level).map(|level| (level.columns, level.rows, &level.least[..]))
    }

    /// Brings all levels up to date: about a nanosecond for sixteen tiles.
    pub(crate) fn build(&mut self, tiles: &Tiles) {
        let (mut columns, mut rows) = (tiles.columns, tiles.rows);
        let mut finer: &[f32] = &tiles.whole[..columns * rows];
        for level in &mut self.levels {
            for row in 0..level.rows {
                let above = &finer[2 * row * columns..][..columns];
                // The last row of an odd number has no partner but itself.
                let below = &finer[(2 * row + 1).min(rows - 1) * columns..][..columns];
                let out = &mut level.least[row * level.columns..][..level.columns];
                let (pairs_above, rest_above) = above.as_chunks::<2>();
                let (pairs_below, rest_below) = below.as_chunks::<2>();
                for ((out, a), b) in out.iter_mut().zip(pairs_above).zip(pairs_below) {
                    *out = least(least(a[0], a[1]), least(b[0], b[1]));
                }
                if let (Some(last), [a], [b]) = (out.last_mut(), rest_above, rest_below) {
                    *last = least(*a, *b);
                }
            }
            (columns, rows) = (level.columns, level.rows);
            finer = &level.least;
        }
    }

    /// Whether all of a rectangle is covered by something nearer than `nearness`.
    ///
    /// Starts where the rectangle meets at most two by two texels, and goes down only where a texel does not decide.
    #[inline(always)]
    pub(crate) fn hides(&self, tiles: &Tiles, rectangle: &Rectangle, nearness: f32) -> bool {
        let [x0, x1] = [rectangle.columns[0] as usize / SIDE, (rectangle.columns[1] as usize - 1) / SIDE];
        let [y0, y1] = [rectangle.lines[0] as usize / SIDE, (rectangle.lines[1] as usize - 1) / SIDE];
        let size = (x1 - x0).max(y1 - y0);
        if size <= 3 {
            return hidden_tiles(tiles, rectangle, [x0, x1, y0, y1], nearness);
        }
        // The greatest shift that leaves at least two texels on the longer side.
        let level = ((usize::BITS - size.leading_zeros()) as usize - 1).min(self.levels.len());
        let walk = Walk { pyramid: self, tiles, rectangle, limits: [x0, x1, y0, y1], nearness };
        for y in y0 >> level..=y1 >> level {
            for x in x0 >> level..=x1 >> level {
                if !walk.hides(level, x, y) {
                    return false;
                }
            }
        }
        true
    }
}

#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Looks at tiles one by one.
#[inline(always)]
fn hidden_tiles(tiles: &Tiles, rectangle: &Rectangle, [x0, x1, y0, y1]: [usize; 4], nearness: f32) -> bool {
    for y in y0..=y1 {
        for x in x0..=x1 {
            let tile = y * tiles.columns + x;
            if !(tiles.whole[tile] > nearness) && !tiles.hides(tile, mask(rectangle, x, y), nearness) {
                return false;
            }
        }
    }
    true
}

/// The pixels of a tile that a rectangle meets.
#[inline(always)]
pub(crate) fn mask(rectangle: &Rectangle, x: usize, y: usize) -> u64 {
    let (left, right) = within(rectangle.columns, x);
    let (top, bottom) = within(rectangle.lines, y);
    let byte = (0xff_u64 << left) & 0xff & !(0xff00_u64 << right >> 8);
    let lines = below(bottom) & !below(top);
    (byte * 0x0101_0101_0101_0101) & lines
}

/// The part of a range of pixels within a tile.
#[inline(always)]
fn within([first, end]: [u32; 2], tile: usize) -> (i32, i32) {
    let start = (tile * SIDE) as i32;
    ((first as i32 - start).clamp(0, 8), (end as i32 - start).clamp(0, 8))
}

/// The first so many lines of a tile.
#[inline(always)]
fn below(lines: i32) -> u64 {
    if lines >= 8 { u64::MAX } else { (1 << (8 * lines)) - 1 }
}

struct Walk<'a> {
    pyramid: &'a Pyramid,
    tiles: &'a Tiles,
    rectangle: &'a Rectangle,
    /// First and last columns and rows of tiles.
    limits: [usize; 4],
    nearness: f32,
}

impl Walk<'_> {
    fn hides(&self, level: usize, x: usize, y: usize) -> bool {
        if level == 0 {
            let tile = y * self.tiles.columns + x;
            return self.tiles.hides(tile, mask(self.rectangle, x, y), self.nearness);
        }
        let Some(own) = self.pyramid.levels.get(level - 1) else { return false };
        if own.least[y * own.columns + x] > self.nearness {
            return true;
        }
        let [x0, x1, y0, y1] = self.limits.map(|limit| limit >> (level - 1));
        for y in (2 * y).max(y0)..=(2 * y + 1).min(y1) {
            for x in (2 * x).max(x0)..=(2 * x + 1).min(x1) {
                if !self.hides(level - 1, x, y) {
                    return false;
                }
            }
        }
        true
    }
}
