//! Copying of columns of tiles that were drawn apart, in a buffer of their own.

use super::tiles::{Layers, Tiles, join};

impl Tiles {
    /// Creates an empty buffer of the same size.
    pub(crate) fn new_like(other: &Self) -> Self {
        let mut tiles = other.clone();
        tiles.clear();
        tiles
    }

    /// Replaces the tiles in the half-open range `first..end` of tile columns by those of `from`, a buffer of
    /// the same size in which nothing is drawn in other columns.
    pub(crate) fn take_columns(&mut self, from: &Self, [first, end]: [usize; 2]) {
        let offset = self.depth_planes.len() as u32 - 1;
        let index = |own: u32| if own == 0 { 0 } else { own + offset };
        self.depth_planes.extend_from_slice(&from.depth_planes[1..]);
        for row in 0..self.rows {
            self.changed[row] = join(self.changed[row], from.changed[row]);
            let tiles = row * self.columns + first..row * self.columns + end;
            self.tile_min[tiles.clone()].copy_from_slice(&from.tile_min[tiles.clone()]);
            self.counts[tiles.clone()].copy_from_slice(&from.counts[tiles.clone()]);
            let indices = self.depth_planes_index[tiles.clone()].iter_mut();
            indices.zip(&from.depth_planes_index[tiles.clone()]).for_each(|(to, &own)| *to = index(own));
            let layers = self.layers[tiles.clone()].iter_mut().zip(&from.layers[tiles.clone()]);
            for ((to, from), &count) in layers.zip(&from.counts[tiles]) {
                if count > 0 {
                    *to = Layers { depth_planes: from.depth_planes.map(index), ..*from };
                }
            }
        }
        self.changed_rows = join(self.changed_rows, from.changed_rows);
    }
}
