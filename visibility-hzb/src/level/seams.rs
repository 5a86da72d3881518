//! Seams: the pixels along edges that two polygons share, within one cluster or between clusters of a level.
//!
//! In each window (64 columns of a row of tiles) where pixels are near a shared edge and near no other edge,
//! a polygon leaves a *piece*. Once the other polygon of the edge has left its pieces, pieces of the same
//! tiles are put together.

use super::open_tiles::TileKeys;
use super::prepared::{NO_EDGE, PreparedEdge};
use crate::buffer::depth_planes::DepthPlanes;
use crate::buffer::tile_layout::{SIDE, tiles_of};
use crate::buffer::tiles::Tiles;
use crate::lanes::least;
use alloc::vec::Vec;

/// Pixels along the shared edges of the polygons drawn in a frame, recorded for each polygon separately. Once
/// both polygons of an edge are drawn, these pixels tell which ones to cover along the edge.
#[derive(Clone, Debug, Default)]
pub(crate) struct Seams {
    /// Pieces of all shared edges of the polygons drawn so far in the frame, in the order in which they were
    /// recorded.
    pieces: Vec<Piece>,
    /// For each edge of the levels in view, the index of its last piece; [`NO_PIECE`] for an edge without
    /// pieces. As long as the edges of any frame so far; elements beyond the present edges are [`NO_PIECE`].
    last: Vec<u32>,
    /// Indices in the frame of the edges that have a piece, each once.
    met: Vec<u32>,
    /// Depth keys of the polygons drawn so far in the frame, in their order.
    polygons: Vec<TileKeys>,
    /// Pieces of the present window (64 columns of a row of tiles): for each, the index of its edge in the
    /// frame, and the pixels that the edge comes near, one word for each row of pixels from the top.
    /// [`finish_window`](Self::finish_window) decides which of these pixels the piece keeps.
    window: Vec<(u32, [u64; SIDE])>,
}

/// Index that stands for no piece.
const NO_PIECE: u32 = u32::MAX;

/// Pixels along a shared edge, recorded for one of its two polygons in one window of eight tiles side by
/// side. Bit sets of pixels have one word for each row of pixels from the top; bit i is column i of the
/// window.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// Index in the buffer of the leftmost tile of the window.
    first: u32,
    /// Index of the piece before this one of the same edge and polygon, in a window farther to the left or
    /// above. [`NO_PIECE`] for the first.
    before: u32,
    /// Index of the polygon in [`Seams::polygons`].
    polygon: u32,
    /// Pixels of [open tiles](super::open_tiles) that this edge of the polygon comes near, and no other edge
    /// of the polygon.
    alone: [u64; SIDE],
    /// Pixels of `alone` whose centres the polygon winds round an odd number of times.
    odd: [u64; SIDE],
}

impl Seams {
    /// Removes the pieces of all seams, and makes room for a frame whose levels in view have `edges` edges in
    /// all.
    pub(super) fn begin_frame(&mut self, edges: usize) {
        for edge in self.met.drain(..) {
            self.last[edge as usize] = NO_PIECE;
        }
        self.last.resize(self.last.len().max(edges), NO_PIECE);
        self.pieces.clear();
        self.polygons.clear();
    }

    /// Begins the next polygon, whose depth keys are `keys`. Windows finished from now on belong to this
    /// polygon.
    #[inline(always)]
    pub(super) fn begin_polygon(&mut self, keys: &TileKeys) {
        self.polygons.push(*keys);
    }

    /// Adds the pixels near a shared edge of the polygon to the present window (64 columns of a row of
    /// tiles).
    #[inline(always)]
    pub(super) fn add(&mut self, edge: u32, near: &[u64; SIDE]) {
        self.window.push((edge, *near));
    }

    /// Ends the window (64 columns of a row of tiles) whose leftmost tile has index `first` in the buffer,
    /// and makes a piece of each shared edge in it. A piece has only pixels of tiles in the mask `open`.
    /// `near_two` are the pixels that two or more edges of the polygon come near, `wound` the pixels whose
    /// centres the polygon winds round an odd number of times.
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

    /// Covers the seam of an edge that two polygons share. `p` and `q` are the indices of the last piece that
    /// each of the two polygons has of the edge.
    #[inline(always)]
    fn cover_seam(&self, mut p: u32, mut q: u32, tiles: &mut Tiles) -> bool {
        let mut planes_index = 0;
        // Goes from the last windows to the first. The open tiles of a window end before the polygon's next
        // window begins.
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
    /// Returns the pixels of a seam that two pieces, one of each polygon, cover together. The pixels are bits
    /// of one window: that of the piece farther to the right or below. Returns the index of this window's
    /// leftmost tile, then the pixels.
    #[inline(always)]
    fn together(&self, other: &Self) -> (usize, [u64; SIDE]) {
        let (left, right) = if self.first <= other.first { (self, other) } else { (other, self) };
        // `left` has no open tiles beyond the end of its row, so it shares none with a window in the next
        // row.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Two pieces share the tiles that both their windows of eight tiles have, at most all and at least none.
    #[test]
    fn pieces_share_the_tiles_of_both_windows() {
        let piece = |first: u32, odd: u64| Piece {
            first,
            before: NO_PIECE,
            polygon: 0,
            alone: [u64::MAX; SIDE],
            odd: [odd; SIDE],
        };
        for beside in 0..20 {
            let (left, right) = (piece(100, u64::MAX), piece(100 + beside, 0));
            let shared = if beside < 8 { u64::MAX >> (8 * beside) } else { 0 };
            for (one, other) in [(&left, &right), (&right, &left)] {
                let together = one.together(other);
                assert_eq!(together, (100 + beside as usize, [shared; SIDE]), "windows {beside} tiles apart");
            }
        }
    }
}
