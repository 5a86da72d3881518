//! A part of a row of tiles: which of its pixels an outline winds round, and which it comes near.

use super::edges::{Edges, Edges16};
use super::prepared::NO_EDGE;
use super::seams::Seams;
use crate::buffer::tile_layout::SIDE;
use crate::lanes::{WHOLE, WIDTH, bits, greatest, least, xor};
use alloc::vec::Vec;

/// Width in pixels of the part of a row of tiles that is filled at once: one bit of a word for each column.
const WINDOW: usize = 64;

/// Row numbers 0 to 7 within a tile.
const ROWS: [f32; SIDE] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// Returns a word whose bits from `column` on are set: none from 64 on.
#[inline(always)]
fn bits_from(column: u32) -> u64 {
    if column < 64 { u64::MAX << column } else { 0 }
}

/// Returns the integer nearest to `x`, which must lie between -0.5 and 64.
#[inline(always)]
fn nearest(x: f32) -> u32 {
    (x + WHOLE).to_bits() & 127
}

/// Returns the part of a `column` from the left end of a window, limited to the window.
#[inline(always)]
fn within(column: f32) -> f32 {
    least(greatest(column, 0.0), WINDOW as f32)
}

/// Pixels of a window: a word for each row of pixels, a bit for each column.
#[derive(Default)]
pub(super) struct Window {
    /// Pixels that an edge comes near.
    pub(super) near: [u64; SIDE],
    /// Pixels that two edges or more come near.
    pub(super) near_two: [u64; SIDE],
    /// Pixels whose centres have an odd number of edges to their left.
    pub(super) odd: [u64; SIDE],
}

impl Window {
    /// Returns the window that begins at column `left` and row `top`, both in pixels. `row` are the edges of
    /// that row of tiles, and pixels within `slack` of an edge are near it. Those near shared edges are
    /// added to `seams`.
    #[inline(always)]
    pub(super) fn new(
        edges: &Edges,
        row: &[RowEdges],
        left: f32,
        top: f32,
        slack: f32,
        seams: &mut Seams,
    ) -> Self {
        let mut window = Self::default();
        let mut passed = 0;
        for own in row {
            // What lies beside the window comes near no pixel of it.
            let (mut crosses, mut meets) = ([0; WIDTH], [0; WIDTH]);
            for i in 0..WIDTH {
                let is_left = own.right[i] + 1.0 < left;
                crosses[i] = if is_left { own.crosses[i] } else { 0 };
                meets[i] = u8::from(!is_left & (own.left[i] < left + WINDOW as f32));
            }
            passed ^= xor(&crosses);
            let mut meets = bits(&meets);
            let Some(lanes) = edges.drawn.get(own.chunk as usize) else { continue };
            while meets != 0 {
                window.add(lanes, meets.trailing_zeros() as usize % WIDTH, left, top, slack, seams);
                meets &= meets - 1;
            }
        }
        for row in 0..SIDE {
            window.odd[row] ^= if passed >> row & 1 != 0 { u64::MAX } else { 0 };
        }
        window
    }

    /// Adds lane `i` of `edges` to the window that begins at column `left` and row `top`, both in pixels.
    /// Pixels within `slack` of the edge are near it.
    #[inline(always)]
    fn add(&mut self, edges: &Edges16, i: usize, left: f32, top: f32, slack: f32, seams: &mut Seams) {
        let (y, bottom, level) = (edges.top[i], edges.bottom[i], edges.level[i]);
        let (mut first, mut end, mut step) = ([0; SIDE], [0; SIDE], [0; SIDE]);
        for row in 0..SIDE {
            let line = top + ROWS[row];
            let (from, to) = (greatest(line - slack, y), least(line + 1.0 + slack, bottom));
            let (p, q) = (edges.column(i, from) - left, edges.column(i, to) - left);
            let (l, r) = (least(p, q) - slack, greatest(p, q) + slack + level);
            let meets = from <= to;
            first[row] = nearest(within(l) - 0.5);
            end[row] = if meets { nearest(within(r + 1.0) - 0.5) } else { 0 };
            let centre = line + 0.5;
            let crosses = (y < centre) & (centre <= bottom);
            step[row] = if crosses { nearest(within(edges.column(i, centre) - left)) } else { WINDOW as u32 };
        }
        let mut near = [0; SIDE];
        for row in 0..SIDE {
            near[row] = bits_from(first[row]) & !bits_from(end[row]);
            self.near_two[row] |= near[row] & self.near[row];
            self.near[row] |= near[row];
            self.odd[row] ^= bits_from(step[row]);
        }
        if edges.shared[i] != NO_EDGE {
            seams.add(edges.shared[i], &near);
        }
    }
}

/// Edges that meet a row of tiles.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowEdges {
    /// Index into [`Edges::drawn`] of the 16 edges that the lanes of the other fields stand for.
    chunk: u32,
    /// Least column that each edge comes near in the row. Infinity for an edge that does not meet it.
    left: [f32; WIDTH],
    /// Greatest column that each edge comes near in the row. Negative infinity for an edge that does not meet
    /// it.
    right: [f32; WIDTH],
    /// Rows of pixels whose centres each edge crosses: bit i for row i of the tiles.
    crosses: [u32; WIDTH],
}

/// Replaces `row` by the edges that meet the row of tiles from row `top` of pixels on. Returns the least and
/// the greatest column that the outline may cover or come near. The latter is infinity for an outline that is
/// cut at the right.
#[inline(always)]
pub(super) fn edges_of_row(edges: &Edges, top: f32, slack: f32, row: &mut Vec<RowEdges>) -> [f32; 2] {
    row.clear();
    let (first, last) = (top - slack, top + SIDE as f32 + slack);
    let (mut least_left, mut most_right) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
    let mut odd = [0; WIDTH];
    for (chunk, lanes) in (0..).zip(&edges.drawn) {
        let (mut left, mut right) = ([0.0; WIDTH], [0.0; WIDTH]);
        let (mut crosses, mut any) = ([0; WIDTH], false);
        for i in 0..WIDTH {
            // The part of each edge in this row of tiles, widened by the slack, and the columns that this
            // part spans.
            let (from, to) = (greatest(first, lanes.top[i]), least(last, lanes.bottom[i]));
            let meets = from <= to;
            let (p, q) = (lanes.column(i, from), lanes.column(i, to));
            left[i] = if meets { least(p, q) - slack } else { f32::INFINITY };
            right[i] = if meets { greatest(p, q) + slack + lanes.level[i] } else { f32::NEG_INFINITY };
            any |= meets;
        }
        if !any {
            continue;
        }
        for i in 0..WIDTH {
            least_left[i] = least(left[i], least_left[i]);
            most_right[i] = greatest(right[i], most_right[i]);
            for row in 0..SIDE {
                let centre = top + ROWS[row] + 0.5;
                let is_crossed = (lanes.top[i] < centre) & (centre <= lanes.bottom[i]);
                crosses[i] |= if is_crossed { 1 << row } else { 0 };
            }
            odd[i] ^= crosses[i];
        }
        row.push(RowEdges { chunk, left, right, crosses });
    }
    let mut bounds = [f32::INFINITY, f32::NEG_INFINITY];
    for i in 0..WIDTH {
        bounds = [least(least_left[i], bounds[0]), greatest(most_right[i], bounds[1])];
    }
    if xor(&odd) != 0 {
        bounds[1] = f32::INFINITY;
    }
    bounds
}
