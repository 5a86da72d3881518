//! Edges of one outline on the screen, in lanes.

use super::prepared::NO_EDGE;
use crate::lanes::{WIDTH, greatest, least, of_all};
use alloc::vec::Vec;

/// Height in pixels below which an edge counts as horizontal. Such an edge is taken to pass all of its
/// columns in each of its rows.
const LEVEL_EDGE_PX: f32 = 1.0 / 64.0;

/// Edges of an outline as they are drawn, [`WIDTH`] at a time, in pixels of the buffer. Lanes without an edge
/// lie below all rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edges16 {
    /// Column of the upper end, in pixels. For an edge that counts as horizontal, the least column.
    pub(super) x: [f32; WIDTH],
    /// Row of the upper end, in pixels.
    pub(super) top: [f32; WIDTH],
    /// Row of the lower end, in pixels.
    pub(super) bottom: [f32; WIDTH],
    /// Change of the column from one row to the next. 0 for an edge that counts as horizontal.
    pub(super) slope: [f32; WIDTH],
    /// Least column of each edge, in pixels.
    pub(super) low: [f32; WIDTH],
    /// Greatest column of each edge, in pixels.
    pub(super) high: [f32; WIDTH],
    /// Length in columns of an edge that counts as horizontal, since its height is below [`LEVEL_EDGE_PX`]. 0
    /// for any other edge.
    pub(super) level: [f32; WIDTH],
    /// Index of an edge that two polygons share, counted over the edges of all levels in the frame.
    /// [`NO_EDGE`] for any other edge.
    pub(super) shared: [u32; WIDTH],
}

impl Edges16 {
    /// Lanes without an edge.
    const NONE: Self = {
        let none = [0.0; WIDTH];
        Self {
            x: none,
            top: none,
            bottom: none,
            slope: none,
            low: none,
            high: none,
            level: none,
            shared: [NO_EDGE; WIDTH],
        }
    };

    /// Returns the column at which the edge in lane `i` passes `row`, clamped to the edge's own columns.
    #[inline(always)]
    pub(super) fn column(&self, i: usize, row: f32) -> f32 {
        let column = self.x[i] + (row - self.top[i]) * self.slope[i];
        least(greatest(column, self.low[i]), self.high[i])
    }
}

/// The edges of one outline, as they were added and as they are drawn.
#[derive(Clone, Debug, Default)]
pub(crate) struct Edges {
    /// Ends of each edge: column and row of one end, then of the other, [`WIDTH`] edges at a time.
    ends: Vec<[[f32; WIDTH]; 4]>,
    /// Index in the frame of each edge that two polygons share, as in [`Edges16::shared`].
    shared: Vec<[u32; WIDTH]>,
    /// Number of edges.
    count: usize,
    /// Column to which the outline's bounds must extend at the right, if edges beyond that column are left
    /// out. `None` if no edge is left out.
    right: Option<f32>,
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
        self.shared.clear();
        self.right = None;
    }

    /// Records that edges, or parts of edges, at or beyond the column `right` are not pushed, so that the
    /// outline reaches that column. Without this the [bounds](Self::bounds) might exclude covered pixels.
    #[inline(always)]
    pub(super) fn reach(&mut self, right: f32) {
        self.right = Some(right);
    }

    /// Returns whether edges, or parts of edges, beyond the right side of the guard band were left out. In
    /// any row, the outline may then cover all pixels to the right of the remaining edges.
    #[inline(always)]
    pub(super) fn is_cut_at_right(&self) -> bool {
        self.right.is_some()
    }

    /// Appends an edge between two points, given by column and row. `shared` is its index in the frame if
    /// another polygon may have the edge too, between the same two points, else [`NO_EDGE`].
    #[inline(always)]
    pub(super) fn push(&mut self, [ax, ay]: [f32; 2], [bx, by]: [f32; 2], shared: u32) {
        let lane = self.count % WIDTH;
        if lane == 0 {
            // An empty lane has both ends at one point beyond all rows, so it crosses no row of pixel centres
            // and marks no pixel.
            self.ends.push([[0.0; WIDTH], [f32::INFINITY; WIDTH], [0.0; WIDTH], [f32::INFINITY; WIDTH]]);
            self.shared.push([NO_EDGE; WIDTH]);
        }
        if let (Some(ends), Some(all_shared)) = (self.ends.last_mut(), self.shared.last_mut()) {
            all_shared[lane] = shared;
            (ends[0][lane], ends[1][lane], ends[2][lane], ends[3][lane]) = (ax, ay, bx, by);
        }
        self.count += 1;
    }

    /// Computes the edges as they are drawn, and their bounds.
    #[inline(always)]
    pub(crate) fn finish(&mut self) {
        self.drawn.resize(self.ends.len(), Edges16::NONE);
        let mut all = Bounds::EMPTY;
        for ((out, [ax, ay, bx, by]), &shared_edges) in
            self.drawn.iter_mut().zip(&self.ends).zip(&self.shared)
        {
            out.shared = shared_edges;
            for i in 0..WIDTH {
                let downwards = ay[i] <= by[i];
                let (x0, x1) = if downwards { (ax[i], bx[i]) } else { (bx[i], ax[i]) };
                let (top, bottom) = if downwards { (ay[i], by[i]) } else { (by[i], ay[i]) };
                let (low, high) = (least(x0, x1), greatest(x0, x1));
                let height = bottom - top;
                // False for the NaN of an empty lane, whose width is NaN too.
                let steep = height >= LEVEL_EDGE_PX;
                out.x[i] = if steep { x0 } else { low };
                out.slope[i] = if steep { (x1 - x0) / height } else { 0.0 };
                out.level[i] = if steep { 0.0 } else { high - low };
                (out.top[i], out.bottom[i], out.low[i], out.high[i]) = (top, bottom, low, high);
                let used = top < f32::INFINITY;
                all.add(i, used, [low, top, high, bottom]);
            }
        }
        self.bounds = all.joined();
        self.bounds[2] = greatest(self.right.unwrap_or(f32::NEG_INFINITY), self.bounds[2]);
    }
}

/// Least column, least row, greatest column and greatest row of the edges in each lane, in pixels.
struct Bounds([[f32; WIDTH]; 4]);

impl Bounds {
    /// Bounds of an outline without edges.
    const EMPTY: Self = Self([
        [f32::INFINITY; WIDTH],
        [f32::INFINITY; WIDTH],
        [f32::NEG_INFINITY; WIDTH],
        [f32::NEG_INFINITY; WIDTH],
    ]);

    /// Extends the bounds of lane `i` by those of an edge. Does nothing if `used` is false, for a lane
    /// without an edge.
    #[inline(always)]
    fn add(&mut self, i: usize, used: bool, edge: [f32; 4]) {
        for side in 0..2 {
            let (low, high) =
                (least(edge[side], self.0[side][i]), greatest(edge[side + 2], self.0[side + 2][i]));
            self.0[side][i] = if used { low } else { self.0[side][i] };
            self.0[side + 2][i] = if used { high } else { self.0[side + 2][i] };
        }
    }

    /// Returns the bounds of the edges of all lanes together: least column, least row, greatest column and
    /// greatest row, in pixels. Without edges the least are infinity and the greatest are negative infinity.
    #[inline(always)]
    fn joined(&self) -> [f32; 4] {
        let [left, top, right, bottom] = &self.0;
        [of_all(left, least), of_all(top, least), of_all(right, greatest), of_all(bottom, greatest)]
    }
}
