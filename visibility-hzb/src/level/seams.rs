//! Seams: the pixels along edges that two polygons share, of whatever clusters of a level.
//!
//! A polygon leaves a *piece* for each of its shared edges and each window where pixels are near that edge
//! alone. Once the other polygon has left its own, pieces of the same tiles are put together.

use super::open_tiles::TileKeys;
use super::prepared::{NO_EDGE, PreparedEdge};
use crate::buffer::depth_planes::DepthPlanes;
use crate::buffer::tile_layout::{SIDE, tiles_of};
use crate::buffer::tiles::Tiles;
use crate::lanes::least;
use alloc::vec::Vec;

/// Pixels along the shared edges of the polygons drawn in a frame, as each polygon by itself knows them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Seams {
    /// Pieces of all shared edges of the polygons drawn so far in the frame, in the order in which they were
    /// left.
    pieces: Vec<Piece>,
    /// For each edge of all levels the index of its last piece; [`NO_PIECE`] for an edge without.
    last: Vec<u32>,
    /// Indices in the frame of the edges that have pieces, each once.
    met: Vec<u32>,
    /// Depth keys of the polygons drawn so far in the frame, in their order.
    polygons: Vec<TileKeys>,
    /// Pieces of the present window: for each, the index of its edge in the frame, and the pixels that the
    /// edge comes near, one word for each row of pixels from the top. It is not yet known whether any of
    /// these pixels count.
    window: Vec<(u32, [u64; SIDE])>,
}

/// Index that stands for no piece.
const NO_PIECE: u32 = u32::MAX;

/// What one of the two polygons that share an edge knows of the pixels along the edge, in one window of eight
/// tiles side by side. Bit sets of pixels have one word for each row of pixels from the top; bit i is column
/// i of the window.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// Index in the buffer of the leftmost tile of the window.
    first: u32,
    /// Index of the piece before this one of the same edge and polygon, in a window farther to the left or
    /// above. [`NO_PIECE`] for the first.
    before: u32,
    /// Index of the polygon in [`Seams::polygons`].
    polygon: u32,
    /// Pixels of open tiles that this edge of the polygon comes near, and no other edge of the polygon.
    alone: [u64; SIDE],
    /// Pixels of `alone` whose centres the polygon winds round an odd number of times.
    odd: [u64; SIDE],
}

impl Seams {
    /// Forgets all pieces, for a frame of levels with `edges` edges in all.
    pub(super) fn begin_frame(&mut self, edges: usize) {
        for edge in self.met.drain(..) {
            self.last[edge as usize] = NO_PIECE;
        }
        self.last.resize(edges, NO_PIECE);
        self.pieces.clear();
        self.polygons.clear();
    }

    /// Begins the next polygon, whose depth keys are `keys`. Windows that are finished from now on are its
    /// own.
    #[inline(always)]
    pub(super) fn begin_polygon(&mut self, keys: &TileKeys) {
        self.polygons.push(*keys);
    }

    /// Adds the pixels near a shared edge of the polygon to the window.
    #[inline(always)]
    pub(super) fn add(&mut self, edge: u32, near: &[u64; SIDE]) {
        self.window.push((edge, *near));
    }

    /// Ends the window whose leftmost tile has index `first` in the buffer. Only its tiles in the mask `open`
    /// count. Two edges of the polygon or more come near the pixels `near_two`, and it winds round the
    /// centres of the pixels `wound` an odd number of times.
    #[inline(always)]
    pub(super) fn finish_window(
        &mut self,
        near_two: &[u64; SIDE],
        wound: &[u64; SIDE],
        first: usize,
        open: u32,
    ) {
        // The bits of the open tiles in a row of pixels.
        let mut open_columns = [0; SIDE];
        for i in 0..SIDE {
            open_columns[i] = if open >> i & 1 != 0 { 0xff } else { 0 };
        }
        let open_columns = u64::from_le_bytes(open_columns);
        for (edge, near) in self.window.drain(..) {
            let (mut alone, mut odd, mut any) = ([0; SIDE], [0; SIDE], 0);
            for row in 0..SIDE {
                alone[row] = near[row] & !near_two[row] & open_columns;
                odd[row] = alone[row] & wound[row];
                any |= alone[row];
            }
            // No pixel of this piece counts.
            if any == 0 {
                continue;
            }
            let Some(last) = self.last.get_mut(edge as usize) else { continue };
            if *last == NO_PIECE {
                self.met.push(edge);
            }
            let polygon = self.polygons.len() as u32 - 1;
            let before = core::mem::replace(last, self.pieces.len() as u32);
            self.pieces.push(Piece { first: first as u32, before, polygon, alone, odd });
        }
    }

    /// Covers the seams between the polygon that was drawn last, whose edges are `outline`, and polygons
    /// drawn before. `first` is the index of the first of these edges in their level. `base` is added to the
    /// indices of a level's edges to get those in the frame. Returns whether a tile may have changed.
    #[inline(always)]
    pub(crate) fn cover(&self, outline: &[PreparedEdge], first: u32, base: u32, tiles: &mut Tiles) -> bool {
        let last = |edge: u32| self.last.get(base as usize + edge as usize).copied().unwrap_or(NO_PIECE);
        let mut covered = false;
        for (edge, &PreparedEdge { partner, .. }) in (first..).zip(outline) {
            let own = last(edge);
            if own != NO_PIECE && partner != NO_EDGE {
                covered |= self.cover_seam(own, last(partner), tiles);
            }
        }
        covered
    }

    /// Covers the seam of an edge, given the last pieces that its two polygons have of it.
    #[inline(always)]
    fn cover_seam(&self, mut p: u32, mut q: u32, tiles: &mut Tiles) -> bool {
        let mut planes_index = 0;
        // From the last windows to the first. The open tiles of a window end before the polygon's next one.
        while let (Some(a), Some(b)) = (self.pieces.get(p as usize), self.pieces.get(q as usize)) {
            let (first, pixels) = a.together(b);
            let mut any = 0;
            for row in pixels {
                any |= row;
            }
            if any != 0 {
                let keys = [a, b].map(|piece| &self.polygons[piece.polygon as usize]);
                if planes_index == 0 {
                    planes_index = tiles.add_depth_planes(DepthPlanes::two(keys.map(|keys| keys.plane)));
                }
                let (row, column) = (first / tiles.columns, first % tiles.columns);
                let [of_a, of_b] = keys.map(|keys| keys.of_row(row));
                for (i, mask) in tiles_of(&pixels).into_iter().enumerate() {
                    if mask != 0 {
                        let at = (column + i) as f32;
                        let key = least(keys[0].at(at, of_a), keys[1].at(at, of_b));
                        tiles.cover(first + i, mask, key, planes_index);
                    }
                }
            }
            let (at_p, at_q) = (a.first, b.first);
            p = if at_p >= at_q { a.before } else { p };
            q = if at_q >= at_p { b.before } else { q };
        }
        planes_index != 0
    }
}

impl Piece {
    /// Returns the pixels of the seam that pieces of its two polygons cover together. They are those of the
    /// window that is farther to the right or below of the two: the index of its leftmost tile comes first.
    #[inline(always)]
    fn together(&self, other: &Self) -> (usize, [u64; SIDE]) {
        let (left, right) = if self.first <= other.first { (self, other) } else { (other, self) };
        // Tiles of `left` beyond its row are not open, so that what begins in the next row shares none.
        let beside = right.first - left.first;
        let mut pixels = [0; SIDE];
        if beside < SIDE as u32 {
            for row in 0..SIDE {
                let [alone, odd] =
                    [left.alone[row], left.odd[row]].map(|bits| bits >> (SIDE as u32 * beside));
                pixels[row] = alone & right.alone[row] & (odd ^ right.odd[row]);
            }
        }
        (right.first as usize, pixels)
    }
}
