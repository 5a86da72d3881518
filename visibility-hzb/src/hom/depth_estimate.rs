//! The depth behind which opaque pixels hide.
//!
//! These are the three estimates of Zhang, Manocha, Hudson and Hoff ("Visibility Culling using Hierarchical
//! Occlusion Maps", 1997), in depth keys. Each bounds, for every covered pixel, the depth key of what covers
//! it from below. So each is conservative on its own.
//!
//! The first two go by the boxes around occluders, at their farthest points. An occluder whose rectangle is
//! hidden pixel by pixel behind nearer ones moves no boundary. That is sound: of all occluders that cover a
//! pixel, take the one whose nearest point is nearest. It cannot be hidden there, since what would hide it
//! covers the pixel too and reaches nearer still. So for every covered pixel, at least one occluder that
//! covers it has moved the boundary.

use super::opacity_pyramid::OpacityPyramid;
use super::tile_range::TileRange;
use crate::buffer::tile_layout::{Rectangle, mask};
use crate::buffer::tiles::Tiles;
use crate::lanes::all_above;
use alloc::vec::Vec;

/// How the depth of occluders is kept.
///
/// ```
/// use visibility_hzb::{DepthEstimate, Hom};
/// assert_eq!(Hom::default().depth_estimate(), DepthEstimate::NoBackground);
/// let map = Hom::default().with_depth_estimate(DepthEstimate::Plane);
/// assert_eq!(map.depth_estimate(), DepthEstimate::Plane);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
pub enum DepthEstimate {
    /// One plane behind all occluders that show. The cheapest. Hides no box that is nearer than the farthest
    /// of them.
    Plane,
    /// The depth-estimation buffer: for each 8 x 8 pixels, the farthest depth of the occluders whose
    /// rectangles meet them.
    Buffer,
    /// The no-background z-buffer: the z-buffer that occluders were drawn into, pixel by pixel where a tile
    /// does not decide. Pixels that nothing covers say nothing. The tightest.
    #[default]
    NoBackground,
}

/// The depth behind which opaque pixels hide.
#[derive(Clone, Debug)]
pub(crate) struct DepthBoundary {
    pub(crate) estimate: DepthEstimate,
    /// Columns of tiles.
    columns: usize,
    /// Lower bound on the depth keys of all occluders; infinity if there are none.
    plane: f32,
    /// The same for each tile, row by row.
    cells: Vec<f32>,
}

impl DepthBoundary {
    /// A boundary before all occluders.
    pub(crate) fn new(tiles: &Tiles) -> Self {
        Self {
            estimate: DepthEstimate::default(),
            columns: tiles.columns,
            plane: f32::INFINITY,
            cells: alloc::vec![f32::INFINITY; tiles.columns * tiles.rows],
        }
    }

    /// Forgets all occluders.
    pub(crate) fn clear(&mut self) {
        self.plane = f32::INFINITY;
        self.cells.fill(f32::INFINITY);
    }

    /// Changes the estimate. Hides nothing until [`clear`](Self::clear).
    pub(crate) fn set(&mut self, estimate: DepthEstimate) {
        self.estimate = estimate;
        self.plane = f32::NEG_INFINITY;
        self.cells.fill(f32::NEG_INFINITY);
    }

    /// Takes in an occluder whose pixels lie in `region` and whose depth keys are at least `depth_key`. NaN
    /// stands for an occluder of which nothing is known.
    pub(crate) fn move_behind(&mut self, region: &TileRange, depth_key: f32) {
        let depth_key = if depth_key.is_nan() { f32::NEG_INFINITY } else { depth_key };
        match self.estimate {
            DepthEstimate::Plane => self.plane = self.plane.min(depth_key),
            DepthEstimate::Buffer => {
                let [x0, x1, y0, y1] = region.0;
                for y in y0..=y1 {
                    for cell in &mut self.cells[y * self.columns + x0..=y * self.columns + x1] {
                        *cell = if *cell < depth_key { *cell } else { depth_key };
                    }
                }
            }
            DepthEstimate::NoBackground => {}
        }
    }

    /// Takes in what has been drawn into some tiles. Only [`DepthEstimate::NoBackground`] needs it.
    #[inline(always)]
    pub(crate) fn update(&mut self, tiles: &Tiles, region: &TileRange) {
        if self.estimate != DepthEstimate::NoBackground {
            return;
        }
        let [x0, x1, y0, y1] = region.0;
        for y in y0..=y1.min(tiles.rows - 1) {
            for x in x0..=x1.min(tiles.columns - 1) {
                self.cells[y * self.columns + x] = tiles.farthest(y * self.columns + x);
            }
        }
    }

    /// Whether everything that covers pixels of a rectangle has a depth key above `depth_key`.
    #[inline(always)]
    pub(crate) fn is_before(
        &self,
        opacity: &OpacityPyramid,
        tiles: &Tiles,
        rectangle: &Rectangle,
        depth_key: f32,
    ) -> bool {
        if self.estimate == DepthEstimate::Plane {
            return self.plane > depth_key;
        }
        let [x0, x1, y0, y1] = TileRange::of(rectangle).0;
        for y in y0..=y1 {
            let base = y * self.columns;
            let row = &self.cells[base + x0..=base + x1];
            if all_above(row, depth_key) {
                continue;
            }
            if self.estimate == DepthEstimate::Buffer {
                return false;
            }
            for x in x0..=x1 {
                let tile = base + x;
                if !(self.cells[tile] > depth_key)
                    && !tiles.hides(tile, mask(rectangle, x, y) & opacity.covered[tile], depth_key)
                {
                    return false;
                }
            }
        }
        true
    }
}

/// Takes in what has been drawn into some tiles, in opacity and depth.
#[inline(always)]
pub(crate) fn update_maps(
    opacity: &mut OpacityPyramid,
    boundary: &mut DepthBoundary,
    tiles: &Tiles,
    region: &TileRange,
) {
    opacity.update(tiles, region);
    boundary.update(tiles, region);
}
