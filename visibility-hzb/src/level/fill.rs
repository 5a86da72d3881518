//! Fills an outline into tiles: the pixels that it winds round an odd number of times and does not come near.

use super::edges::{Edges, Edges16};
use super::union::UnionTiles;
use crate::buffer::depth_planes::DepthPlanes;
use crate::buffer::row_spans::STEPS;
use crate::buffer::tile_layout::SIDE;
use crate::buffer::tiles::Tiles;
use crate::coverage::Coverage;
use crate::lanes::{WHOLE, WIDTH, bits, greatest, least};
use alloc::vec::Vec;

/// Width in pixels of the part of a row of tiles that is filled at once: one bit of a word for each column.
const WINDOW: usize = 64;

/// Factor of depth keys by which a polygon must be nearer than what a tile holds to be drawn there: what is
/// nearer by less hides next to nothing more.
pub(super) const BARELY_NEARER: f32 = 1.05;

/// Row numbers 0 to 7 within a tile.
const ROWS: [f32; SIDE] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// Returns a word whose bits from `column` on are set: none from 64 on.
#[inline(always)]
fn from(column: u32) -> u64 {
    if column < 64 { u64::MAX << column } else { 0 }
}

/// Returns the integer nearest to `x`, which must lie between -0.5 and 64.
#[inline(always)]
fn nearest(x: f32) -> u32 {
    (x + WHOLE).to_bits() & 127
}

/// Returns the whole number nearest to `x`, whose magnitude must be below 2^22.
#[inline(always)]
fn nearest_whole(x: f32) -> f32 {
    (x + WHOLE) - WHOLE
}

/// Returns the part of a `column` from the left end of a window, limited to the window.
#[inline(always)]
fn within(column: f32) -> f32 {
    least(greatest(column, 0.0), WINDOW as f32)
}

/// Pixels of a window: a word for each row of pixels, a bit for each column.
struct Window {
    /// Pixels that an edge comes near at which the union of the cluster's polygons may end.
    near_end: [u64; SIDE],
    /// Pixels that another edge comes near, which two polygons of the cluster share.
    near_shared: [u64; SIDE],
    /// Pixels whose centres have an odd number of edges to their left.
    odd: [u64; SIDE],
}

impl Window {
    /// Adds lane `i` of `edges`, which lies to the left of the window. `top` is the window's first row of
    /// pixels.
    #[inline(always)]
    fn pass(&mut self, edges: &Edges16, i: usize, top: f32) {
        let (y, bottom) = (edges.top[i], edges.bottom[i]);
        for row in 0..SIDE {
            let centre = top + ROWS[row] + 0.5;
            self.odd[row] ^= if (y < centre) & (centre <= bottom) { u64::MAX } else { 0 };
        }
    }

    /// Adds lane `i` of `edges` to the window that begins at column `left` and row `top`, both in pixels.
    /// Pixels within `slack` of the edge are near it.
    #[inline(always)]
    fn add(&mut self, edges: &Edges16, i: usize, left: f32, top: f32, slack: f32) {
        let (x, y, slope) = (edges.x[i], edges.top[i], edges.slope[i]);
        let (bottom, low, high, level) = (edges.bottom[i], edges.low[i], edges.high[i], edges.level[i]);
        let at = |row: f32| least(greatest(x + (row - y) * slope, low), high) - left;
        let (mut first, mut end, mut step) = ([0; SIDE], [0; SIDE], [0; SIDE]);
        for row in 0..SIDE {
            let line = top + ROWS[row];
            let (from, to) = (greatest(line - slack, y), least(line + 1.0 + slack, bottom));
            let (p, q) = (at(from), at(to));
            let (l, r) = (least(p, q) - slack, greatest(p, q) + slack + level);
            let meets = from <= to;
            first[row] = nearest(within(l) - 0.5);
            end[row] = if meets { nearest(within(r + 1.0) - 0.5) } else { 0 };
            let centre = line + 0.5;
            let crosses = (y < centre) & (centre <= bottom);
            step[row] = if crosses { nearest(within(at(centre))) } else { WINDOW as u32 };
        }
        let ends_union = edges.ends_union[i];
        for row in 0..SIDE {
            let near = from(first[row]) & !from(end[row]);
            self.near_end[row] |= near & ends_union;
            self.near_shared[row] |= near & !ends_union;
            self.odd[row] ^= from(step[row]);
        }
    }
}

/// Returns the mask of the pixels of each of the eight tiles of a window: bit `8 * y + x` for the pixel at
/// column `x` and row `y` of the tile.
#[inline(always)]
fn tiles_of(rows: &[u64; SIDE]) -> [u64; SIDE] {
    let mut masks = [0; SIDE];
    for row in 0..SIDE {
        let bytes = rows[row].to_le_bytes();
        for tile in 0..SIDE {
            masks[tile] |= u64::from(bytes[tile]) << (SIDE * row);
        }
    }
    masks
}

/// Bounds on the depth keys of a polygon.
pub(super) struct DepthBound {
    /// Least key in a tile: `a * column + b * row + c` for the tile at tile column `column` and tile row
    /// `row`.
    pub(super) plane: [f32; 3],
    /// Lower bound on all keys.
    pub(super) floor: f32,
}

/// Scratch of [`fill`].
#[derive(Clone, Debug, Default)]
pub(super) struct FillScratch {
    /// Part of the depth key that depends on the tile column, [`WIDTH`] tiles at a time.
    across: Vec<[f32; WIDTH]>,
    /// Indices of the edges that meet a row of tiles.
    active: Vec<u32>,
}

/// Covers the pixels that the outline `edges` winds round an odd number of times and does not come within
/// `slack` pixels of, in the half-open range `rows` of tile rows. The polygon is added to `union` if there is one. Returns whether a tile may have
/// changed.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub(super) fn fill(
    edges: &Edges,
    slack: f32,
    rows: [usize; 2],
    &DepthBound { plane, floor }: &DepthBound,
    coverage: Coverage,
    FillScratch { across, active }: &mut FillScratch,
    mut union: Option<&mut UnionTiles>,
    tiles: &mut Tiles,
) -> bool {
    const STEP: f32 = SIDE as f32;
    let [left, above, right, below] = edges.bounds;
    let size = [tiles.columns as f32, tiles.rows as f32];
    // The pixels that the outline may come near, in tiles, which are exact numbers.
    let low = |pixel: f32| nearest_whole(pixel - slack - 0.5) / STEP;
    let high = |pixel: f32| nearest_whole(pixel + slack + 0.5) / STEP;
    let (left_end, right_end, above_end, below_end) = (low(left), high(right), low(above), high(below));
    // False where there are no edges.
    if !(left_end < size[0] && above_end < size[1] && right_end > 0.0 && below_end > 0.0) {
        return false;
    }
    let constant = plane[2] - (least(plane[0], 0.0) + least(plane[1], 0.0));
    // All tiles that the outline may come near, so that polygons that share an edge agree on them.
    let first = |side: f32| greatest(side, 0.0) as usize;
    let end = |side: f32, size: usize| ((greatest(side, 0.0) + 1.0) as usize).min(size);
    let (x0, x1) = (first(left_end), end(right_end, tiles.columns));
    let (y0, y1) = (first(above_end).max(rows[0]), end(below_end, tiles.rows).min(rows[1]));
    let mut planes_index = 0;
    across.clear();
    let mut column = x0;
    while column < x1 {
        let mut values = [0.0; WIDTH];
        let first = column as f32;
        // The greater of both corners for planes that fall to the right, else the lesser.
        let (rising, falling) = (greatest(plane[0], 0.0), least(plane[0], 0.0));
        for i in 0..WIDTH {
            let x = first + STEPS[i];
            values[i] = greatest(x, left_end) * rising + least(x + 1.0, right_end) * falling;
        }
        across.push(values);
        column += WIDTH;
    }
    for row in y0..y1 {
        let base = row * tiles.columns;
        // The least key of the plane in a part of a tile is at a corner of that part.
        let (upper, lower) = (row as f32, row as f32 + 1.0);
        let y = if plane[1] < 0.0 { least(lower, below_end) } else { greatest(upper, above_end) };
        let offset = y * plane[1] + constant;
        let top = (row * SIDE) as f32;
        let mut chosen = false;
        let mut column = x0;
        while column < x1 {
            // Tiles that the outline may meet and that hold nothing as near.
            let (mut keys, mut open) = ([0.0; WIDTH], [0; WIDTH]);
            let Some(values) = tiles.tile_min[base + column..].first_chunk::<WIDTH>() else { break };
            let Some(across) = across.get((column - x0) / WIDTH) else { break };
            let count = (x1 - column) as u32;
            for i in 0..WIDTH {
                keys[i] = greatest(across[i] + offset, floor);
                open[i] = u8::from(keys[i] > values[i] * BARELY_NEARER);
            }
            if let Some(union) = union.as_deref_mut() {
                union.lower([column, row], base, &keys, &open, x1);
            }
            let open = bits(&open) & if count < WIDTH as u32 { (1 << count) - 1 } else { u32::MAX };
            let mut left_open = open;
            while left_open != 0 {
                let skipped = left_open.trailing_zeros() as usize % WIDTH;
                let mut open = left_open >> skipped & 0xff;
                left_open &= !(0xff << skipped);
                if !chosen {
                    chosen = true;
                    choose(edges, top, slack, active);
                }
                let mut window = Window { near_end: [0; SIDE], near_shared: [0; SIDE], odd: [0; SIDE] };
                let first = column + skipped;
                let left = (first * SIDE) as f32;
                for &edge in active.iter() {
                    let Some(lanes) = edges.drawn.get(edge as usize / WIDTH) else { continue };
                    let lane = edge as usize % WIDTH;
                    // What lies beside the window comes near no pixel of it.
                    if lanes.low[lane] - slack >= left + WINDOW as f32 {
                        continue;
                    }
                    if lanes.high[lane] + slack + 1.0 < left {
                        window.pass(lanes, lane, top);
                    } else {
                        window.add(lanes, lane, left, top, slack);
                    }
                }
                let (mut covered, mut shared, mut any, mut all) = (window.odd, 0, 0, u64::MAX);
                let keep = if coverage == Coverage::Sampled { 0 } else { u64::MAX };
                for row in 0..SIDE {
                    covered[row] &= !((window.near_end[row] | window.near_shared[row]) & keep);
                    shared |= window.near_shared[row];
                    any |= covered[row];
                    all &= covered[row];
                }
                if any | shared == 0 {
                    continue;
                }
                let masks = if all == u64::MAX { [u64::MAX; SIDE] } else { tiles_of(&covered) };
                if let Some(union) = union.as_deref_mut()
                    && shared != 0
                {
                    let (odd, near_end) = (tiles_of(&window.odd), tiles_of(&window.near_end));
                    // Tiles beyond these are of the next windows.
                    let own = x1.min(column + WIDTH) - first;
                    union.add(base + first, own, shared, &odd, &near_end);
                }
                while open != 0 {
                    let i = open.trailing_zeros() as usize % SIDE;
                    open &= open - 1;
                    if masks[i] != 0 {
                        if planes_index == 0 {
                            planes_index = tiles.add_depth_planes(DepthPlanes::one(plane));
                        }
                        if masks[i] == u64::MAX {
                            tiles.cover_tile(row, first + i, keys[(skipped + i) % WIDTH], planes_index);
                            continue;
                        }
                        tiles.cover(base + first + i, masks[i], keys[(skipped + i) % WIDTH], planes_index);
                    }
                }
            }
            column += WIDTH;
        }
    }
    planes_index != 0
}

/// Replaces `active` by the indices of the edges that meet the row of tiles from row `top` of pixels on.
#[inline(always)]
fn choose(edges: &Edges, top: f32, slack: f32, active: &mut Vec<u32>) {
    active.clear();
    let (first, last) = (top - slack, top + SIDE as f32 + slack);
    for (chunk, lanes) in edges.drawn.iter().enumerate() {
        let mut meets = [0; WIDTH];
        for i in 0..WIDTH {
            meets[i] = u8::from((lanes.top[i] <= last) & (lanes.bottom[i] >= first));
        }
        let mut meets = bits(&meets);
        while meets != 0 {
            active.push((chunk * WIDTH) as u32 + meets.trailing_zeros());
            meets &= meets - 1;
        }
    }
}
