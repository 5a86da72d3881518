//! The buffer: tiles of 8 x 8 pixels. Each tile stores, in a few layers, which of its pixels are covered and
//! how far away the covering occluders are at most.
//!
//! A tile has one depth key for all its pixels and up to [`LAYERS`] disjoint sets of pixels with a greater
//! key each. This layout takes a fraction of the memory of a z-buffer. It is as tight in practice, since one
//! occluder mostly has one depth range in a tile. The idea is that of Andersson, Hasselgren and
//! Akenine-Möller, "Masked Depth Culling for Graphics Hardware", 2015, with more layers, which are disjoint.

use super::depth_planes::DepthPlanes;
use super::row_spans::RowSpans;
use super::tile_layout::{EMPTY_DEPTH, PADDING, Rectangle, SIDE};
use crate::query::box_face_planes::BoxFacePlanes;
use crate::rounding::down;
use alloc::vec::Vec;

/// Maximum number of layers of a tile. A layer is a set of covered pixels with one bound on depth.
pub(crate) const LAYERS: usize = 4;

/// Layers of one tile: disjoint sets of covered pixels, each with a lower bound on its depth keys (greater is
/// nearer).
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Layers {
    /// Pixels of each layer: bit `8 * y + x` stands for the pixel at column `x` and row `y` of the tile.
    pub(super) masks: [u64; LAYERS],
    /// For each layer, a lower bound on the depth keys (greater is nearer) of the pixels that it covers.
    pub(super) depth_key: [f32; LAYERS],
    /// Index into [`Tiles::depth_planes`] of planes that bound each layer's depth keys more tightly. 0 means
    /// no planes.
    pub(super) depth_planes: [u32; LAYERS],
}

/// Coverage and depth of all tiles of the buffer. Arrays hold one element for each tile, row by row from the
/// top.
#[derive(Clone, Debug)]
pub(crate) struct Tiles {
    /// Number of tile columns of the buffer.
    pub(crate) columns: usize,
    /// Number of tile rows of the buffer.
    pub(crate) rows: usize,
    /// Lower bound on the depth keys of all 64 pixels of each tile. [`EMPTY_DEPTH`] if a pixel is not
    /// covered. Followed by [`PADDING`] unused elements.
    pub(crate) tile_min: Vec<f32>,
    /// For each tile, the index into `depth_planes` of the planes of an occluder that covers the whole tile,
    /// not always the nearest such occluder. 0 if there is none. Followed by [`PADDING`] unused elements.
    pub(crate) depth_planes_index: Vec<u32>,
    /// Depth planes of the occluders drawn since the last [`clear`](Self::clear). Element 0 is
    /// [`DepthPlanes::NONE`].
    pub(super) depth_planes: Vec<DepthPlanes>,
    /// Number of layers in use in each tile, 0 to [`LAYERS`]. A layer is a set of covered pixels with one
    /// bound on depth.
    pub(super) counts: Vec<u8>,
    /// Layers of each tile (disjoint sets of covered pixels, each with a bound on depth). Layers at or
    /// beyond the tile's element of `counts` are stale.
    pub(super) layers: Vec<Layers>,
    /// Half-open range of dirty tile columns of each row of tiles: tiles whose `tile_min` has changed since
    /// the last update of the pyramid. [`UNCHANGED`] if there are none.
    pub(crate) changed: Vec<[usize; 2]>,
    /// Half-open range of the rows of tiles that contain dirty tiles (`tile_min` has changed since the last
    /// update of the pyramid). [`UNCHANGED`] if there are none.
    pub(crate) changed_rows: [usize; 2],
    /// Scratch of `shape_fill.rs`: pixel masks of the row of tiles that is being filled.
    pub(crate) spans: RowSpans,
}

impl Tiles {
    /// Creates an empty buffer of `width` by `height` pixels, rounded up to whole tiles.
    pub(crate) fn new(width: usize, height: usize) -> Self {
        let (columns, rows) = (width.div_ceil(SIDE), height.div_ceil(SIDE));
        let layers = Layers { masks: [0; LAYERS], depth_key: [0.0; LAYERS], depth_planes: [0; LAYERS] };
        Self {
            columns,
            rows,
            tile_min: alloc::vec![EMPTY_DEPTH; columns * rows + PADDING],
            depth_planes_index: alloc::vec![0; columns * rows + PADDING],
            depth_planes: alloc::vec![DepthPlanes::NONE],
            counts: alloc::vec![0; columns * rows],
            layers: alloc::vec![layers; columns * rows],
            changed: alloc::vec![UNCHANGED; rows],
            changed_rows: UNCHANGED,
            spans: RowSpans::NONE,
        }
    }

    /// Marks all pixels as uncovered, removes all depth planes, and marks no tile as dirty (changed since the
    /// last update of the pyramid).
    pub(crate) fn clear(&mut self) {
        self.tile_min.fill(EMPTY_DEPTH);
        self.counts.fill(0);
        self.depth_planes_index.fill(0);
        self.depth_planes.truncate(1);
        self.changed.fill(UNCHANGED);
        self.changed_rows = UNCHANGED;
    }

    /// Marks the tile columns of the half-open range `columns` in row `row` of tiles as dirty (changed since
    /// the last update of the pyramid).
    #[inline(always)]
    pub(crate) fn mark_dirty(&mut self, row: usize, columns: [usize; 2]) {
        self.changed[row] = join(self.changed[row], columns);
        self.changed_rows = join(self.changed_rows, [row, row + 1]);
    }

    /// Sets `tile_min` (the lower bound on the depth keys of all 64 pixels) of the tile with index `tile`
    /// (row by row) to `depth_key`, and marks the tile as dirty.
    #[inline(always)]
    fn raise(&mut self, tile: usize, depth_key: f32) {
        self.tile_min[tile] = depth_key;
        let (row, column) = (tile / self.columns, tile % self.columns);
        self.mark_dirty(row, [column, column + 1]);
    }

    /// Appends the depth planes of an occluder to `depth_planes`. Returns their index, at least 1 and valid
    /// until [`clear`](Self::clear).
    #[inline(always)]
    pub(crate) fn add_depth_planes(&mut self, planes: DepthPlanes) -> u32 {
        self.depth_planes.push(planes);
        (self.depth_planes.len() - 1) as u32
    }

    /// Returns the subset of the mask `pixels` in which drawn occluders do not certainly hide a box. 0 means
    /// that the box is hidden in all of `pixels`. Equal depth keys hide nothing. `tile` is the index of the
    /// tile, row by row, and bit `8 * y + x` stands for the pixel at column `x` and row `y` of the tile.
    ///
    /// The caller guarantees that all of `pixels` lie within `sides` (left, right, top, bottom in pixels of
    /// the buffer), and that in these pixels the box has no depth key above `depth_key` and satisfies the
    /// bounds of `box_planes`.
    #[inline(always)]
    pub(crate) fn undecided(
        &self,
        tile: usize,
        pixels: u64,
        sides: [f64; 4],
        depth_key: f32,
        box_planes: &BoxFacePlanes,
    ) -> u64 {
        let hides = |depth_planes_index: u32| {
            depth_planes_index != 0
                && self.depth_planes.get(depth_planes_index as usize).is_some_and(|planes| {
                    planes.hides(sides, depth_key) || planes.is_nearer_than(sides, box_planes)
                })
        };
        if self.tile_min[tile] > depth_key || hides(self.depth_planes_index[tile]) {
            return 0;
        }
        let layers = &self.layers[tile];
        let mut left = pixels;
        for i in 0..usize::from(self.counts[tile]).min(LAYERS) {
            if left & layers.masks[i] != 0
                && (layers.depth_key[i] > depth_key || hides(layers.depth_planes[i]))
            {
                left &= !layers.masks[i];
            }
        }
        left
    }

    /// Covers the pixels `mask` of the tile with index `tile` (row by row) by an occluder. Its depth keys
    /// there are at least `depth_key`, and at least the least value of the depth planes at index
    /// `depth_planes_index` if that is not 0. In each pixel the greatest (nearest) key wins. Does nothing if
    /// `depth_key` is NaN or not above the tile's `tile_min`.
    #[inline(always)]
    pub(crate) fn cover(&mut self, tile: usize, mask: u64, depth_key: f32, depth_planes_index: u32) {
        let tile_min = self.tile_min[tile];
        // The negated comparison makes a NaN depth key cover no pixel.
        if mask == 0 || !(depth_key > tile_min) {
            return;
        }
        let count = usize::from(self.counts[tile]);
        if count == 0 && mask == u64::MAX {
            if depth_planes_index != 0 {
                self.depth_planes_index[tile] = depth_planes_index;
            }
            return self.raise(tile, depth_key);
        }
        let layers = &mut self.layers[tile];
        if count == 0 {
            layers.masks[0] = mask;
            layers.depth_key[0] = depth_key;
            layers.depth_planes[0] = depth_planes_index;
            self.counts[tile] = 1;
            return;
        }
        // Pixels of layers whose depth key is at least as great stay in those layers.
        let (mut new, mut taken) = (mask, 0);
        for i in 0..count.min(LAYERS) {
            taken |= layers.masks[i];
            if layers.depth_key[i] >= depth_key {
                new &= !layers.masks[i];
            }
        }
        if new == 0 {
            return;
        }
        // Occluders are added roughly from front to back, so most of them fill pixels that no layer covers
        // yet.
        if new & taken == 0 && new | taken != u64::MAX && count < LAYERS {
            layers.masks[count] = new;
            layers.depth_key[count] = depth_key;
            layers.depth_planes[count] = depth_planes_index;
            self.counts[tile] = count as u8 + 1;
            return;
        }
        // Layers behind `tile_min` are dropped. Pixels of farther layers move to the new layer.
        let mut all = [(0, 0.0, 0); LAYERS + 1];
        let mut raised = tile_min;
        let mut kept = 0;
        let mut union = new;
        for i in 0..count.min(LAYERS) {
            let rest = layers.masks[i] & !new;
            if rest != 0 && layers.depth_key[i] >= tile_min {
                all[kept] = (rest, layers.depth_key[i], layers.depth_planes[i]);
                union |= rest;
                kept += 1;
            }
        }
        all[kept] = (new, depth_key, depth_planes_index);
        kept += 1;
        if union == u64::MAX {
            raised = f32::INFINITY;
            for &(_, depth_key, _) in &all[..kept] {
                raised = if depth_key < raised { depth_key } else { raised };
            }
            // A layer no nearer than `tile_min` is kept only for its depth planes.
            let mut left = 0;
            for i in 0..kept {
                if all[i].1 > raised || all[i].2 != 0 {
                    all[left] = all[i];
                    left += 1;
                }
            }
            kept = left;
        }
        if kept > LAYERS {
            kept = merge(&mut all);
        }
        for i in 0..LAYERS {
            (layers.masks[i], layers.depth_key[i], layers.depth_planes[i]) = all[i];
        }
        self.counts[tile] = kept as u8;
        if raised > tile_min {
            self.raise(tile, raised);
        }
    }

    /// Covers all pixels of the tile at `column` and `row` as [`cover`](Self::cover) does, by an occluder
    /// whose `depth_key` is above the tile's `tile_min`. Layers of the tile stay as they are.
    #[inline(always)]
    pub(crate) fn cover_tile(&mut self, row: usize, column: usize, depth_key: f32, depth_planes_index: u32) {
        let tile = row * self.columns + column;
        self.depth_planes_index[tile] = depth_planes_index;
        self.tile_min[tile] = depth_key;
        self.mark_dirty(row, [column, column + 1]);
    }

    /// Returns whether all pixels of `mask` hold a depth key strictly greater (nearer) than `depth_key`, by
    /// `tile_min` and layers. `tile` is the index of the tile, row by row, and bit `8 * y + x` of `mask`
    /// stands for the pixel at column `x` and row `y` of the tile. True for an empty mask.
    #[inline(always)]
    pub(crate) fn hides(&self, tile: usize, mask: u64, depth_key: f32) -> bool {
        self.tile_min[tile] > depth_key || self.hides_partly(tile, mask, depth_key)
    }

    /// Returns whether all pixels of `mask` belong to layers with a depth key strictly greater (nearer) than
    /// `depth_key`. `tile` is the index of the tile, row by row. The caller has already found that its
    /// `tile_min` is not greater. True for an empty mask.
    #[inline(always)]
    pub(crate) fn hides_partly(&self, tile: usize, mask: u64, depth_key: f32) -> bool {
        let (layers, count) = (&self.layers[tile], u32::from(self.counts[tile]));
        let mut nearer = [0; LAYERS];
        for i in 0..LAYERS {
            let counts = (layers.depth_key[i] > depth_key) & ((i as u32) < count);
            nearer[i] = if counts { layers.masks[i] } else { 0 };
        }
        mask & !((nearer[0] | nearer[1]) | (nearer[2] | nearer[3])) == 0
    }

    /// Returns the mask of the covered pixels of the tile with index `tile` (row by row): bit `8 * y + x` for
    /// the pixel at column `x` and row `y`.
    #[inline(always)]
    pub(crate) fn covered(&self, tile: usize) -> u64 {
        if self.tile_min[tile] > EMPTY_DEPTH {
            return u64::MAX;
        }
        let masks = &self.layers[tile].masks;
        let mut covered = 0;
        for i in 0..usize::from(self.counts[tile]).min(LAYERS) {
            covered |= masks[i];
        }
        covered
    }

    /// Returns a lower bound on the depth keys of the covered pixels of the tile with index `tile` (row by
    /// row). Positive infinity if no pixel is covered.
    #[inline(always)]
    pub(crate) fn farthest(&self, tile: usize) -> f32 {
        if self.tile_min[tile] > EMPTY_DEPTH {
            return self.tile_min[tile];
        }
        let depth_key = &self.layers[tile].depth_key;
        let mut farthest = f32::INFINITY;
        for i in 0..usize::from(self.counts[tile]).min(LAYERS) {
            farthest = if depth_key[i] < farthest { depth_key[i] } else { farthest };
        }
        farthest
    }

    /// Returns the lower bound on the depth key of the pixel at the centre of a rectangle, by `tile_min` and
    /// layers alone. [`EMPTY_DEPTH`] if the pixel is not covered.
    #[inline(always)]
    pub(crate) fn pixel_around(&self, rectangle: &Rectangle) -> f32 {
        let [x, y] = [rectangle.columns, rectangle.lines].map(|[first, end]| ((first + end) / 2) as usize);
        self.pixel(x, y)
    }

    /// Returns the greatest known lower bound on the depth key of the pixel at `column` and `row` of the
    /// buffer, by `tile_min`, layers and depth planes. [`EMPTY_DEPTH`] if the pixel is not covered. The pixel
    /// must lie in the buffer.
    pub(crate) fn pixel_closely(&self, column: usize, row: usize) -> f32 {
        let tile = row / SIDE * self.columns + column / SIDE;
        let bit = (row % SIDE) * SIDE + column % SIDE;
        let sides = [column, column + 1, row, row + 1].map(|side| side as f64);
        let of = |depth_planes_index: u32| {
            self.depth_planes
                .get(depth_planes_index as usize)
                .map_or(EMPTY_DEPTH, |planes| down(planes.least(sides)))
        };
        let mut depth_key = self.pixel(column, row).max(of(self.depth_planes_index[tile]));
        let layers = &self.layers[tile];
        for i in 0..usize::from(self.counts[tile]).min(LAYERS) {
            if layers.masks[i] >> bit & 1 != 0 {
                depth_key = depth_key.max(of(layers.depth_planes[i]));
            }
        }
        depth_key
    }

    /// Returns a lower bound on the depth key of the pixel at `column` and `row` of the buffer, by `tile_min`
    /// and layers alone. [`EMPTY_DEPTH`] if the pixel is not covered. The pixel must lie in the buffer.
    #[inline(always)]
    pub(crate) fn pixel(&self, column: usize, row: usize) -> f32 {
        let tile = row / SIDE * self.columns + column / SIDE;
        let bit = (row % SIDE) * SIDE + column % SIDE;
        let (layers, mut depth_key) = (&self.layers[tile], self.tile_min[tile]);
        for i in 0..usize::from(self.counts[tile]).min(LAYERS) {
            let own = layers.masks[i] >> bit & 1 != 0 && layers.depth_key[i] > depth_key;
            depth_key = if own { layers.depth_key[i] } else { depth_key };
        }
        depth_key
    }
}

/// Merges two of `LAYERS + 1` layers (pixel mask, lower bound on the depth keys, index of depth planes) into
/// one with the lesser bound. The pair is chosen for the least loss: difference of the bounds times the
/// number of pixels of the nearer layer. Returns the number of remaining layers, [`LAYERS`].
#[cold]
fn merge(layers: &mut [(u64, f32, u32); LAYERS + 1]) -> usize {
    let mut best = (f32::INFINITY, 0, 1);
    for i in 0..=LAYERS {
        for j in 0..i {
            let (near, far) = if layers[i].1 > layers[j].1 { (i, j) } else { (j, i) };
            let loss = (layers[near].1 - layers[far].1) * layers[near].0.count_ones() as f32;
            if loss < best.0 {
                best = (loss, i, j);
            }
        }
    }
    let (_, i, j) = best;
    let depth_planes_index = if layers[i].2 == layers[j].2 { layers[i].2 } else { 0 };
    layers[j] = (layers[i].0 | layers[j].0, layers[i].1.min(layers[j].1), depth_planes_index);
    layers[i] = layers[LAYERS];
    LAYERS
}

/// Empty half-open range of columns or rows, neutral in [`join`].
pub(crate) const UNCHANGED: [usize; 2] = [usize::MAX, 0];

/// Returns the smallest half-open range that contains the ranges `a` and `b`.
#[inline(always)]
pub(crate) fn join(a: [usize; 2], b: [usize; 2]) -> [usize; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}
