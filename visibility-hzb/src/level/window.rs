//! A part of a row of tiles: which of its pixels an outline winds round, and which it comes near.

use super::edges::{Edges, Edges16};
use super::prepared::NO_EDGE;
use super::seams::Seams;
use crate::buffer::tile_layout::SIDE;
use crate::lanes::{WIDTH, bits, greatest, least, round_to_i32};
use alloc::vec::Vec;

/// Width in pixels of the part of a row of tiles that is filled at once: one bit of a word for each column.
const WINDOW: i32 = 64;

/// A column to the right of all buffers. Its negative is to the left of all.
const NEVER: i32 = 1 << 24;

/// Row numbers 0 to 7 within a tile.
const ROWS: [f32; SIDE] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// Returns a word whose bits from `column` on are set: all bits if `column` is 0 or less, none if it is 64 or
/// more.
#[inline(always)]
fn bits_from(column: i32) -> u64 {
    let column = least(greatest(column, 0), WINDOW) as u32;
    if column < 64 { u64::MAX << column } else { 0 }
}

/// Pixels of a window, the part of a row of tiles that is filled at once: [`WINDOW`] columns of the [`SIDE`]
/// rows of pixels. Element `i` of an array stands for pixel row `i` from the top, bit `j` of it for the
/// `j`-th column from the left.
#[derive(Default)]
pub(super) struct Window {
    /// Pixels of the window that at least one edge comes near.
    pub(super) near: [u64; SIDE],
    /// Pixels of the window that at least two edges come near.
    pub(super) near_two: [u64; SIDE],
    /// Pixels of the window whose centres have an odd number of edges to their left.
    pub(super) odd: [u64; SIDE],
}

impl Window {
    /// Returns the window that begins at column `left`, in pixels, of the row of tiles whose edges are `row`.
    /// Its pixels near shared edges are added to `seams`.
    #[inline(always)]
    pub(super) fn new(row: &[RowEdge], left: i32, seams: &mut Seams) -> Self {
        let mut window = Self::default();
        for edge in row {
            // Without a branch for edges beside the window: processors cannot foresee which these are.
            let (mut near, mut any) = ([0; SIDE], 0);
            for row in 0..SIDE {
                window.odd[row] ^= bits_from(edge.step[row] - left);
                near[row] = bits_from(edge.first[row] - left) & !bits_from(edge.end[row] - left);
                window.near_two[row] |= near[row] & window.near[row];
                window.near[row] |= near[row];
                any |= near[row];
            }
            if (edge.shared != NO_EDGE) & (any != 0) {
                seams.add(edge.shared, &near);
            }
        }
        window
    }
}

/// An edge in a row of tiles. Arrays have an element for each row of pixels, from the top. Their columns are
/// limited to those of the polygon's tiles.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowEdge {
    /// First column of pixels that the edge comes near.
    first: [i32; SIDE],
    /// End, exclusive, of the columns of pixels that the edge comes near. -[`NEVER`] in rows that it does not
    /// come near.
    end: [i32; SIDE],
    /// First column whose pixel centre counts as to the right of the edge. [`NEVER`] in rows whose centres
    /// the edge does not cross.
    step: [i32; SIDE],
    /// Index in the frame of an edge that two polygons share, as in [`Edges16::shared`].
    shared: u32,
}

impl RowEdge {
    /// Returns the edge in lane `i` of `edges`, as it is in the row of tiles whose first pixel row is `top`.
    /// The polygon's tiles have the columns from `start` to `finish`, in pixels. Pixels within `slack` of the
    /// edge are near it.
    #[inline(always)]
    fn new(edges: &Edges16, i: usize, top: f32, slack: f32, [start, finish]: [f32; 2]) -> Self {
        let (y, bottom, level) = (edges.top[i], edges.bottom[i], edges.level[i]);
        let (mut first, mut end, mut step) = ([0; SIDE], [0; SIDE], [0; SIDE]);
        for row in 0..SIDE {
            let line = top + ROWS[row];
            let (from, to) = (greatest(line - slack, y), least(line + 1.0 + slack, bottom));
            let (p, q) = (edges.column(i, from), edges.column(i, to));
            let (l, r) = (least(p, q) - slack, greatest(p, q) + slack + level);
            let meets = from <= to;
            first[row] = round_to_i32(least(greatest(l, start), finish) - 0.5);
            let after = round_to_i32(least(greatest(r, start), finish) + 0.5);
            end[row] = if meets { after } else { -NEVER };
            let centre = line + 0.5;
            let crosses = (y < centre) & (centre <= bottom);
            let column = round_to_i32(least(greatest(edges.column(i, centre), start), finish));
            step[row] = if crosses { column } else { NEVER };
        }
        Self { first, end, step, shared: edges.shared[i] }
    }
}

/// Replaces `row` by the edges that meet the row of tiles whose first pixel row is `top`. The polygon's tiles
/// have `columns` (first and end, in pixels), and pixels within `slack` of an edge are near it. Returns the
/// least and the greatest column that the outline may cover or come near; the greatest is infinity for an
/// outline that is cut at the right.
#[inline(always)]
pub(super) fn edges_of_row(
    edges: &Edges,
    top: f32,
    slack: f32,
    columns: [f32; 2],
    row: &mut Vec<RowEdge>,
) -> [f32; 2] {
    row.clear();
    let (above, below) = (top - slack, top + SIDE as f32 + slack);
    let mut bounds = [f32::INFINITY, f32::NEG_INFINITY];
    for lanes in &edges.drawn {
        let (mut left, mut right, mut meeting) = ([0.0; WIDTH], [0.0; WIDTH], [0; WIDTH]);
        for i in 0..WIDTH {
            // The part of each edge in this row of tiles, widened by the slack, and the columns that this
            // part spans.
            let (from, to) = (greatest(above, lanes.top[i]), least(below, lanes.bottom[i]));
            let (p, q) = (lanes.column(i, from), lanes.column(i, to));
            left[i] = least(p, q) - slack;
            right[i] = greatest(p, q) + slack + lanes.level[i];
            meeting[i] = u8::from(from <= to);
        }
        let mut meeting = bits(&meeting);
        while meeting != 0 {
            let i = meeting.trailing_zeros() as usize % WIDTH;
            meeting &= meeting - 1;
            bounds = [least(left[i], bounds[0]), greatest(right[i], bounds[1])];
            row.push(RowEdge::new(lanes, i, top, slack, columns));
        }
    }
    if edges.is_cut_at_right() {
        bounds[1] = f32::INFINITY;
    }
    bounds
}
