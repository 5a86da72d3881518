//! The buffer: tiles of 8 x 8 pixels that hold what is covered, and how far away at most, in a few layers.
//!
//! A tile has one nearness for all its pixels and up to [`LAYERS`] disjoint sets of pixels with a greater one each. That takes a
//! fraction of
//! the memory of a z-buffer and is as tight in practice, since one occluder mostly has one depth range in a tile (the idea is that of
//! Andersson, Hasselgren and Akenine-Möller, "Masked Depth Culling for Graphics Hardware", 2015, with more and disjoint layers).

use crate::faces::{LANES, Slabs};
use crate::fill::Spans;
use crate::pyramid::{Rectangle, UNCHANGED, join};
use crate::shape::{Shape, down};
use alloc::vec::Vec;

/// Pixels along the side of a tile.
pub(crate) const SIDE: usize = 8;

/// Sets of pixels that a tile can tell apart.
pub(crate) const LAYERS: usize = 4;

/// Tiles that can be read beyond the end of any row.
pub(crate) const PADDING: usize = 16;

/// Of nothing.
pub(crate) const NOTHING: f32 = f32::NEG_INFINITY;

/// Disjoint sets of pixels, each with the least nearness of what covers it.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Layers {
    masks: [u64; LAYERS],
    nearness: [f32; LAYERS],
    /// Of which surface that is the least.
    surfaces: [u32; LAYERS],
}

/// The tiles, row by row from the top.
#[derive(Clone, Debug)]
pub(crate) struct Tiles {
    pub(crate) columns: usize,
    pub(crate) rows: usize,
    /// Nearness that all pixels of a tile have at least; greater is nearer. Followed by padding.
    pub(crate) whole: Vec<f32>,
    /// Of which surface the nearness of the whole tile is, or was before something nearer: a surface stays where it is.
    pub(crate) surface: Vec<u32>,
    /// The first is none.
    surfaces: Vec<Surface>,
    /// How many layers count.
    counts: Vec<u8>,
    /// Those beyond the count are of earlier frames.
    layers: Vec<Layers>,
    /// Columns of each row of tiles whose `whole` may have changed since the pyramid was brought up to date, and such rows.
    pub(crate) changed: Vec<[usize; 2]>,
    pub(crate) changed_rows: [usize; 2],
    /// Of the row of tiles that is being filled.
    pub(crate) spans: Spans,
}

/// What bounds the nearness of a shape from below: the least of up to three planes, where that is greater than the floor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// Slopes along columns and rows, and the value at the upper left corner of the buffer.
    planes: [[f32; 3]; 3],
    count: usize,
}

impl Surface {
    pub(crate) const NONE: Self = Self { planes: [[0.0; 3]; 3], count: 0 };

    /// Of the planes of a shape; none if there are too many.
    #[inline(always)]
    pub(crate) fn of(shape: &Shape) -> Self {
        let [p, q, r, ..] = shape.planes;
        // All three whatever their number: a copy of known length.
        Self { planes: [p, q, r], count: if shape.plane_count <= 3 { shape.plane_count } else { 0 } }
    }

    /// The least nearness within a rectangle; [`NOTHING`] if this is no surface.
    ///
    /// In `f64`, where what this rounds is far below what the planes were lowered by ([`Shape::bound`](crate::shape::Shape::bound)).
    #[inline(always)]
    fn least(&self, [left, right, top, bottom]: [f64; 4]) -> f64 {
        const SHARE: f64 = 1.0 / SIDE as f64;
        let mut least = if self.count > 0 { f64::INFINITY } else { f64::NEG_INFINITY };
        for &[a, b, c] in &self.planes[..self.count] {
            let [a, b, c] = [f64::from(a), f64::from(b), f64::from(c)];
            // The value in a tile is that of its farthest corner: where the plane falls to the right, its right border.
            let x = if a < 0.0 { right * SHARE - 1.0 } else { left * SHARE };
            let y = if b < 0.0 { bottom * SHARE - 1.0 } else { top * SHARE };
            let value = a * x + b * y + c;
            // A NaN is the least of all.
            least = if value >= least { least } else { value };
        }
        least
    }

    /// Whether within a rectangle it is before all of one and the same side of a box. As in [`least`](Self::least), what is rounded is far below
    /// what either was moved by.
    #[inline(always)]
    fn is_before(&self, sides: [f64; 4], slabs: &Slabs) -> bool {
        const SHARE: f64 = 1.0 / SIDE as f64;
        let mut before = [self.count > 0; LANES];
        for &[a, b, c] in &self.planes[..self.count] {
            let [a, b, c] = [f64::from(a), f64::from(b), f64::from(c)];
            let lowest = if a < 0.0 { a } else { 0.0 } + if b < 0.0 { b } else { 0.0 };
            let below = slabs.below([a * SHARE, b * SHARE, c - lowest], sides);
            for i in 0..LANES {
                before[i] &= below[i];
            }
        }
        let mut any = false;
        for one in before {
            any |= one;
        }
        any
    }

    /// Whether all within a rectangle is nearer. A NaN hides nothing.
    #[inline(always)]
    fn hides(&self, sides: [f64; 4], nearness: f32) -> bool {
        self.least(sides) > f64::from(nearness)
    }
}

impl Tiles {
    pub(crate) fn new(width: usize, height: usize) -> Self {
        let (columns, rows) = (width.div_ceil(SIDE), height.div_ceil(SIDE));
        let layers = Layers { masks: [0; LAYERS], nearness: [0.0; LAYERS], surfaces: [0; LAYERS] };
        Self {
            columns,
            rows,
            whole: alloc::vec![NOTHING; columns * rows + PADDING],
            surface: alloc::vec![0; columns * rows + PADDING],
            surfaces: alloc::vec![Surface::NONE],
            counts: alloc::vec![0; columns * rows],
            layers: alloc::vec![layers; columns * rows],
            changed: alloc::vec![UNCHANGED; rows],
            changed_rows: UNCHANGED,
            spans: Spans::NONE,
        }
    }

    /// Forgets all.
    pub(crate) fn clear(&mut self) {
        self.whole.fill(NOTHING);
        self.counts.fill(0);
        self.surface.fill(0);
        self.surfaces.truncate(1);
        self.changed.fill(UNCHANGED);
        self.changed_rows = UNCHANGED;
    }

    /// Notes that `whole` changes between two columns of a row.
    #[inline(always)]
    pub(crate) fn note(&mut self, row: usize, columns: [usize; 2]) {
        self.changed[row] = join(self.changed[row], columns);
        self.changed_rows = join(self.changed_rows, [row, row + 1]);
    }

    /// Raises what all of a tile has at least.
    #[inline(always)]
    fn raise(&mut self, tile: usize, nearness: f32) {
        self.whole[tile] = nearness;
        let (row, column) = (tile / self.columns, tile % self.columns);
        self.note(row, [column, column + 1]);
    }

    /// Makes the surface of a shape known; the number stands for it in this frame.
    #[inline(always)]
    pub(crate) fn add_surface(&mut self, shape: &Shape) -> u32 {
        self.surfaces.push(Surface::of(shape));
        (self.surfaces.len() - 1) as u32
    }

    /// In which of some pixels a box may be seen, looked at through the surfaces that cover them. It is no nearer than `nearness` there, and within
    /// `slabs`; all pixels are within a rectangle: first and end columns, first and end rows, counted from the upper left corner of the buffer.
    #[inline(always)]
    pub(crate) fn undecided(
        &self,
        tile: usize,
        pixels: u64,
        sides: [f64; 4],
        nearness: f32,
        slabs: &Slabs,
    ) -> u64 {
        let hides = |surface: u32| {
            surface != 0
                && self
                    .surfaces
                    .get(surface as usize)
                    .is_some_and(|surface| surface.hides(sides, nearness) || surface.is_before(sides, slabs))
        };
        if self.whole[tile] > nearness || hides(self.surface[tile]) {
            return 0;
        }
        let layers = &self.layers[tile];
        let mut left = pixels;
        for i in 0..usize::from(self.counts[tile]).min(LAYERS) {
            if left & layers.masks[i] != 0 && (layers.nearness[i] > nearness || hides(layers.surfaces[i])) {
                left &= !layers.masks[i];
            }
        }
        left
    }

    /// Covers some pixels of a tile with something of at least the given nearness, that of a surface if this is known.
    #[inline(always)]
    pub(crate) fn cover(&mut self, tile: usize, mask: u64, nearness: f32, surface: u32) {
        let whole = self.whole[tile];
        // Written so that NaN covers nothing.
        if mask == 0 || !(nearness > whole) {
            return;
        }
        let count = usize::from(self.counts[tile]);
        if count == 0 && mask == u64::MAX {
            if surface != 0 {
                self.surface[tile] = surface;
            }
            return self.raise(tile, nearness);
        }
        let layers = &mut self.layers[tile];
        if count == 0 {
            layers.masks[0] = mask;
            layers.nearness[0] = nearness;
            layers.surfaces[0] = surface;
            self.counts[tile] = 1;
            return;
        }
        // Pixels that have something as near already stay with it.
        let (mut new, mut taken) = (mask, 0);
        for i in 0..count.min(LAYERS) {
            taken |= layers.masks[i];
            if layers.nearness[i] >= nearness {
                new &= !layers.masks[i];
            }
        }
        if new == 0 {
            return;
        }
        // What comes from front to back mostly fills pixels that nothing has covered yet.
        if new & taken == 0 && new | taken != u64::MAX && count < LAYERS {
            layers.masks[count] = new;
            layers.nearness[count] = nearness;
            layers.surfaces[count] = surface;
            self.counts[tile] = count as u8 + 1;
            return;
        }
        // Layers that the whole tile has overtaken are forgotten, and pixels that have something farther go over to the new layer.
        let mut all = [(0, 0.0, 0); LAYERS + 1];
        let mut raised = whole;
        let mut kept = 0;
        let mut union = new;
        for i in 0..count.min(LAYERS) {
            let rest = layers.masks[i] & !new;
            if rest != 0 && layers.nearness[i] >= whole {
                all[kept] = (rest, layers.nearness[i], layers.surfaces[i]);
                union |= rest;
                kept += 1;
            }
        }
        all[kept] = (new, nearness, surface);
        kept += 1;
        if union == u64::MAX {
            raised = f32::INFINITY;
            for &(_, nearness, _) in &all[..kept] {
                raised = if nearness < raised { nearness } else { raised };
            }
            // What is no nearer than the whole tile now is of use only as a surface.
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
            (layers.masks[i], layers.nearness[i], layers.surfaces[i]) = all[i];
        }
        self.counts[tile] = kept as u8;
        if raised > whole {
            self.raise(tile, raised);
        }
    }

    /// Whether everything in the given pixels of a tile is nearer than `nearness`.
    #[inline(always)]
    pub(crate) fn hides(&self, tile: usize, mask: u64, nearness: f32) -> bool {
        self.whole[tile] > nearness || self.hides_partly(tile, mask, nearness)
    }

    /// The same by what covers parts of the tile alone.
    #[inline(always)]
    pub(crate) fn hides_partly(&self, tile: usize, mask: u64, nearness: f32) -> bool {
        let (layers, count) = (&self.layers[tile], u32::from(self.counts[tile]));
        let mut nearer = [0; LAYERS];
        for i in 0..LAYERS {
            let counts = (layers.nearness[i] > nearness) & ((i as u32) < count);
            nearer[i] = if counts { layers.masks[i] } else { 0 };
        }
        mask & !((nearer[0] | nearer[1]) | (nearer[2] | nearer[3])) == 0
    }

    /// The pixels of a tile that anything covers.
    #[inline(always)]
    pub(crate) fn covered(&self, tile: usize) -> u64 {
        if self.whole[tile] > NOTHING {
            return u64::MAX;
        }
        let masks = &self.layers[tile].masks;
        let mut covered = 0;
        for i in 0..usize::from(self.counts[tile]).min(LAYERS) {
            covered |= masks[i];
        }
        covered
    }

    /// The least nearness of what covers pixels of a tile, whatever is left bare; infinite if all is.
    #[inline(always)]
    pub(crate) fn farthest(&self, tile: usize) -> f32 {
        if self.whole[tile] > NOTHING {
            return self.whole[tile];
        }
        let nearness = &self.layers[tile].nearness;
        let mut farthest = f32::INFINITY;
        for i in 0..usize::from(self.counts[tile]).min(LAYERS) {
            farthest = if nearness[i] < farthest { nearness[i] } else { farthest };
        }
        farthest
    }

    /// The nearness of the pixel in the middle of a rectangle.
    #[inline(always)]
    pub(crate) fn pixel_around(&self, rectangle: &Rectangle) -> f32 {
        let [x, y] = [rectangle.columns, rectangle.lines].map(|[first, end]| ((first + end) / 2) as usize);
        self.pixel(x, y)
    }

    /// The nearness of a pixel as the surfaces that cover it tell, [`NOTHING`] where nothing does.
    pub(crate) fn pixel_closely(&self, column: usize, row: usize) -> f32 {
        let tile = row / SIDE * self.columns + column / SIDE;
        let bit = (row % SIDE) * SIDE + column % SIDE;
        let sides = [column, column + 1, row, row + 1].map(|side| side as f64);
        let of = |surface: u32| {
            self.surfaces.get(surface as usize).map_or(NOTHING, |surface| down(surface.least(sides)))
        };
        let mut nearness = self.pixel(column, row).max(of(self.surface[tile]));
        let layers = &self.layers[tile];
        for i in 0..usize::from(self.counts[tile]).min(LAYERS) {
            if layers.masks[i] >> bit & 1 != 0 {
                nearness = nearness.max(of(layers.surfaces[i]));
            }
        }
        nearness
    }

    /// The nearness of a pixel as the tile has it, [`NOTHING`] where nothing covers it.
    #[inline(always)]
    pub(crate) fn pixel(&self, column: usize, row: usize) -> f32 {
        let tile = row / SIDE * self.columns + column / SIDE;
        let bit = (row % SIDE) * SIDE + column % SIDE;
        let (layers, mut nearness) = (&self.layers[tile], self.whole[tile]);
        for i in 0..usize::from(self.counts[tile]).min(LAYERS) {
            let own = layers.masks[i] >> bit & 1 != 0 && layers.nearness[i] > nearness;
            nearness = if own { layers.nearness[i] } else { nearness };
        }
        nearness
    }
}

/// Joins two of one layer too many: those whose joining gives away least, in pixels times nearness.
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
    let surface = if layers[i].2 == layers[j].2 { layers[i].2 } else { 0 };
    layers[j] = (layers[i].0 | layers[j].0, layers[i].1.min(layers[j].1), surface);
    layers[i] = layers[LAYERS];
    LAYERS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::Shape;

    #[test]
    fn surfaces_are_no_nearer_than_their_planes_and_hardly_farther() {
        for (a, b) in [(0.01, 0.02), (-0.01, 0.02), (0.01, -0.02), (-0.01, -0.02)] {
            let plane = [a, b, 5.0];
            let mut shape = Shape::EMPTY;
            assert!(shape.bound(plane, [64.0, 64.0]));
            let surface = Surface::of(&shape);
            for (left, top, size) in [(8.0, 16.0, 8.0), (11.0, 19.0, 1.0), (40.0, 50.0, 3.0), (0.0, 0.0, 1.0)]
            {
                let sides = [left, left + size, top, top + size];
                let at = |x: f64, y: f64| a * x + b * y + 5.0;
                let corners =
                    [at(left, top), at(left + size, top), at(left, top + size), at(left + size, top + size)];
                let least = corners.into_iter().fold(f64::INFINITY, f64::min);
                assert!(!surface.hides(sides, least as f32), "{a} {b} {sides:?}");
                assert!(surface.hides(sides, (least - 1e-4) as f32), "{a} {b} {sides:?}");
            }
        }
        assert!(!Surface::NONE.hides([0.0, 1.0, 0.0, 1.0], f32::NEG_INFINITY));
    }
}
