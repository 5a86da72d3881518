//! Edges of one outline on the screen, in lanes.

use crate::lanes::{WIDTH, greatest, least};
use alloc::vec::Vec;

/// Height in pixels below which an edge counts as level: it may pass any of its columns in any of its rows.
const LEVEL_EDGE_PX: f32 = 1.0 / 64.0;

/// Edges of an outline as they are drawn, [`WIDTH`] at a time, in pixels of the buffer. Lanes without an edge
/// lie below all rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edges16 {
    /// Column of the upper end; of an edge that counts as level, the least column.
    pub(super) x: [f32; WIDTH],
    /// Row of the upper end.
    pub(super) top: [f32; WIDTH],
    /// Row of the lower end.
    pub(super) bottom: [f32; WIDTH],
    /// Change of the column from one row to the next; 0 for an edge that counts as level.
    pub(super) slope: [f32; WIDTH],
    /// Least column.
    pub(super) low: [f32; WIDTH],
    /// Greatest column.
    pub(super) high: [f32; WIDTH],
    /// Width of an edge that counts as level, else 0.
    pub(super) level: [f32; WIDTH],
    /// All bits of an edge at which the union of the cluster's polygons may end; 0 of an edge that two of
    /// them share.
    pub(super) ends_union: [u64; WIDTH],
}

impl Edges16 {
    /// Returns the column of lane `i` at `row`.
    #[inline(always)]
    pub(super) fn column(&self, i: usize, row: f32) -> f32 {
        let column = self.x[i] + (row - self.top[i]) * self.slope[i];
        least(greatest(column, self.low[i]), self.high[i])
    }
}

/// The edges of one outline, as pushed and as drawn.
#[derive(Clone, Debug, Default)]
pub(super) struct Edges {
    /// Ends of each edge: column and row of one end, then of the other, [`WIDTH`] edges at a time.
    ends: Vec<[[f32; WIDTH]; 4]>,
    /// Whether the union of the cluster's polygons may end at each edge, as [`Edges16::ends_union`].
    ends_union: Vec<[u64; WIDTH]>,
    /// Number of edges.
    count: usize,
    /// Edges as drawn. Valid after [`finish`](Self::finish).
    pub(super) drawn: Vec<Edges16>,
    /// Least column, least row, greatest column, greatest row of all edges, in pixels. Valid after
    /// [`finish`](Self::finish).
    pub(super) bounds: [f32; 4],
}

impl Edges {
    /// Removes all edges.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.count = 0;
        self.ends.clear();
        self.ends_union.clear();
    }

    /// Appends an edge between two points, given by column and row. `shared` tells whether another drawn
    /// polygon of the cluster has the edge, between the same two points.
    #[inline(always)]
    pub(super) fn push(&mut self, [ax, ay]: [f32; 2], [bx, by]: [f32; 2], shared: bool) {
        let lane = self.count % WIDTH;
        if lane == 0 {
            // A lane that stays empty has its ends at one point: it crosses no row of pixel centres and is
            // marked nowhere, since that point is beyond all rows.
            self.ends.push([[0.0; WIDTH], [f32::INFINITY; WIDTH], [0.0; WIDTH], [f32::INFINITY; WIDTH]]);
            self.ends_union.push([0; WIDTH]);
        }
        if let (Some(ends), Some(ends_union)) = (self.ends.last_mut(), self.ends_union.last_mut()) {
            ends_union[lane] = if shared { 0 } else { u64::MAX };
            (ends[0][lane], ends[1][lane], ends[2][lane], ends[3][lane]) = (ax, ay, bx, by);
        }
        self.count += 1;
    }

    /// Computes the edges as they are drawn, and their bounds.
    #[inline(always)]
    pub(super) fn finish(&mut self) {
        self.drawn.clear();
        let mut left = [f32::INFINITY; WIDTH];
        let mut above = [f32::INFINITY; WIDTH];
        let (mut right, mut below) = ([f32::NEG_INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        for ([ax, ay, bx, by], &ends_union) in self.ends.iter().zip(&self.ends_union) {
            let mut out = Edges16 {
                x: [0.0; WIDTH],
                top: [0.0; WIDTH],
                bottom: [0.0; WIDTH],
                slope: [0.0; WIDTH],
                low: [0.0; WIDTH],
                high: [0.0; WIDTH],
                level: [0.0; WIDTH],
                ends_union,
            };
            for i in 0..WIDTH {
                let downwards = ay[i] <= by[i];
                let (x0, x1) = if downwards { (ax[i], bx[i]) } else { (bx[i], ax[i]) };
                let (top, bottom) = if downwards { (ay[i], by[i]) } else { (by[i], ay[i]) };
                let (low, high) = (least(x0, x1), greatest(x0, x1));
                let height = bottom - top;
                // False for the NaN of an empty lane, which has no width either.
                let steep = height >= LEVEL_EDGE_PX;
                out.x[i] = if steep { x0 } else { low };
                out.slope[i] = if steep { (x1 - x0) / height } else { 0.0 };
                out.level[i] = if steep { 0.0 } else { high - low };
                (out.top[i], out.bottom[i], out.low[i], out.high[i]) = (top, bottom, low, high);
                let used = top < f32::INFINITY;
                left[i] = if used { least(low, left[i]) } else { left[i] };
                right[i] = if used { greatest(high, right[i]) } else { right[i] };
                above[i] = least(top, above[i]);
                below[i] = if used { greatest(bottom, below[i]) } else { below[i] };
            }
            self.drawn.push(out);
        }
        self.bounds = [f32::INFINITY, f32::INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY];
        for i in 0..WIDTH {
            self.bounds[0] = least(left[i], self.bounds[0]);
            self.bounds[1] = least(above[i], self.bounds[1]);
            self.bounds[2] = greatest(right[i], self.bounds[2]);
            self.bounds[3] = greatest(below[i], self.bounds[3]);
        }
    }
}
