//! Rows of tiles that are drawn apart, each range of rows in a buffer of its own, and copied to one buffer.

use super::depth_planes::DepthPlanes;
use super::tiles::{Layers, Tiles};

/// A range of rows of tiles of a buffer that is split into several.
#[derive(Debug)]
pub(crate) struct TileRows<'a> {
    /// Number of this range among all, and number of ranges.
    number: [usize; 2],
    /// Half-open range of rows.
    rows: [usize; 2],
    columns: usize,
    /// Elements of the arrays of [`Tiles`] for these rows.
    tile_min: &'a mut [f32],
    depth_planes_index: &'a mut [u32],
    counts: &'a mut [u8],
    layers: &'a mut [Layers],
    changed: &'a mut [[usize; 2]],
}

impl TileRows<'_> {
    /// Returns the half-open range of rows.
    pub(crate) fn range(&self) -> [usize; 2] {
        self.rows
    }

    /// Replaces these rows by those of `from`, a buffer of the same size. Its depth planes are taken over by
    /// [`Tiles::take_depth_planes`].
    pub(crate) fn copy(&mut self, from: &Tiles) {
        let [number, count] = self.number.map(|number| number as u32);
        let index = |own: u32| if own == 0 { 0 } else { (own - 1) * count + number + 1 };
        let tiles = self.rows[0] * self.columns..self.rows[1] * self.columns;
        self.tile_min.copy_from_slice(&from.tile_min[tiles.clone()]);
        self.counts.copy_from_slice(&from.counts[tiles.clone()]);
        self.changed.copy_from_slice(&from.changed[self.rows[0]..self.rows[1]]);
        let indices = &from.depth_planes_index[tiles.clone()];
        self.depth_planes_index.iter_mut().zip(indices).for_each(|(to, &own)| *to = index(own));
        for ((to, from), &layers) in self.layers.iter_mut().zip(&from.layers[tiles]).zip(&*self.counts) {
            if layers > 0 {
                *to = Layers { depth_planes: from.depth_planes.map(index), ..*from };
            }
        }
    }
}

impl Tiles {
    /// Creates an empty buffer of the same size.
    pub(crate) fn new_like(other: &Self) -> Self {
        let mut tiles = other.clone();
        tiles.clear();
        tiles
    }

    /// Splits the rows of tiles into ranges, each of which ends where the next begins. `ends` are the ends of
    /// the ranges, ascending; the last one is the number of rows.
    pub(crate) fn split_rows<const COUNT: usize>(&mut self, ends: [usize; COUNT]) -> [TileRows<'_>; COUNT] {
        let columns = self.columns;
        self.changed_rows = [0, self.rows];
        let (mut tile_min, mut depth_planes_index) =
            (&mut self.tile_min[..], &mut self.depth_planes_index[..]);
        let (mut counts, mut layers) = (&mut self.counts[..], &mut self.layers[..]);
        let (mut changed, mut first, mut number) = (&mut self.changed[..], 0, 0);
        ends.map(|end| {
            let tiles = (end - first) * columns;
            let part = TileRows {
                number: [number, COUNT],
                rows: [first, end],
                columns,
                tile_min: split(&mut tile_min, tiles),
                depth_planes_index: split(&mut depth_planes_index, tiles),
                counts: split(&mut counts, tiles),
                layers: split(&mut layers, tiles),
                changed: split(&mut changed, end - first),
            };
            (first, number) = (end, number + 1);
            part
        })
    }

    /// Replaces the depth planes of an empty buffer by those of the buffers that its ranges of rows were
    /// [copied](TileRows::copy) from, in the order of the ranges: the first one of each, the second one of
    /// each, and so on.
    pub(crate) fn take_depth_planes<const COUNT: usize>(&mut self, from: [&Self; COUNT]) {
        let most = from.iter().map(|tiles| tiles.depth_planes.len() - 1).fold(0, usize::max);
        self.depth_planes.truncate(1);
        self.depth_planes.resize(1 + most * COUNT, DepthPlanes::NONE);
        for (number, tiles) in from.iter().enumerate() {
            for (own, planes) in tiles.depth_planes[1..].iter().enumerate() {
                self.depth_planes[1 + own * COUNT + number] = *planes;
            }
        }
    }
}

/// Takes the first `count` elements off a slice.
fn split<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let (first, others) = core::mem::take(rest).split_at_mut(count);
    *rest = others;
    first
}
