//! Depth estimates of occlusion maps: the depth behind which opaque pixels hide a box.
//!
//! These are the three estimates of Zhang, Manocha, Hudson and Hoff ("Visibility Culling using Hierarchical
//! Occlusion Maps", 1997), in depth keys (greater is nearer). Each estimate is, for every covered pixel, a
//! lower bound on the depth key of an occluder that covers the pixel. So each estimate alone is conservative.
//!
//! [`DepthEstimate::Plane`] and [`DepthEstimate::Buffer`] use the farthest points of the boxes around
//! occluders. An occluder whose screen rectangle is hidden pixel by pixel behind nearer occluders does not
//! change these estimates. Leaving it out is sound. Of all occluders that cover a pixel, take the one whose
//! nearest point is nearest. No other occluder can hide it in that pixel, since the other would cover the
//! pixel too and reach nearer still. So for every covered pixel, at least one occluder that covers the pixel
//! has been taken into the estimate.

use super::opacity_pyramid::OpacityPyramid;
use super::tile_range::TileRange;
use crate::buffer::tile_layout::{Rectangle, mask};
use crate::buffer::tiles::Tiles;
use crate::lanes::all_above;
use alloc::vec::Vec;

/// Estimate of the depth of occluders. A box is hidden only where all covered pixels of its screen rectangle
/// are certainly nearer than the box by this estimate.
///
/// ```
/// # #[cfg(feature = "papers")] {
/// use visibility_hzb::{DepthEstimate, Hom};
/// let map = Hom::default().with_depth_estimate(DepthEstimate::Plane);
/// # }
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
#[cfg_attr(not(feature = "papers"), expect(unreachable_pub, reason = "exported with the feature alone"))]
pub enum DepthEstimate {
    /// One plane behind all occluders that are not hidden by nearer ones. A box is hidden only if the box is
    /// farther than the farthest point of all these occluders. The cheapest estimate.
    Plane,
    /// Depth-estimation buffer: for each tile of 8 x 8 pixels, the depth of the farthest point of all
    /// occluders whose screen rectangles meet the tile.
    Buffer,
    /// No-background z-buffer: the depth at which occluders were drawn, for each tile and, where a tile does
    /// not decide, for each pixel. Uncovered pixels are ignored. The tightest estimate.
    #[default]
    NoBackground,
}

/// Lower bounds on the depth keys (greater is nearer) of the occluders drawn in a frame, by one of three
/// estimates. A box whose greatest depth key is less than the bound lies behind these occluders.
#[derive(Clone, Debug)]
pub(crate) struct DepthBoundary {
    /// Estimate that is in use.
    pub(crate) estimate: DepthEstimate,
    /// Number of tile columns of the buffer, the row length of `cells`.
    columns: usize,
    /// For [`DepthEstimate::Plane`]: lower bound on the depth keys of all points of drawn occluders.
    /// Positive infinity if there are no occluders.
    plane: f32,
    /// For [`DepthEstimate::Buffer`] and [`DepthEstimate::NoBackground`]: lower bound on the depth keys of
    /// the occluders in each tile, row by row. Positive infinity if no occluder meets the tile.
    cells: Vec<f32>,
}

impl DepthBoundary {
    /// Creates the depth bounds of a buffer laid out like `tiles`, without occluders (all bounds positive
    /// infinity) and with the default estimate.
    pub(crate) fn new(tiles: &Tiles) -> Self {
        Self {
            estimate: DepthEstimate::default(),
            columns: tiles.columns,
            plane: f32::INFINITY,
            cells: alloc::vec![f32::INFINITY; tiles.columns * tiles.rows],
        }
    }

    /// Removes all occluders: all bounds on depth keys become positive infinity.
    pub(crate) fn clear(&mut self) {
        self.plane = f32::INFINITY;
        self.cells.fill(f32::INFINITY);
    }

    /// Changes the estimate and sets all bounds to negative infinity. Until the next [`clear`](Self::clear),
    /// the estimates `Plane` and `Buffer` hide no box, and `NoBackground` hides only what the drawn depths of
    /// single pixels hide.
    #[cfg(any(feature = "papers", test))]
    pub(crate) fn set(&mut self, estimate: DepthEstimate) {
        self.estimate = estimate;
        self.plane = f32::NEG_INFINITY;
        self.cells.fill(f32::NEG_INFINITY);
    }

    /// Lowers the bounds of `Plane` and `Buffer` for an occluder whose pixels lie in the tiles `region` and
    /// whose depth keys are at least `depth_key`. A NaN key counts as negative infinity. Does nothing for
    /// `NoBackground`.
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

    /// Recomputes the bounds of the tiles `region` from the tiles' drawn depths, for
    /// [`DepthEstimate::NoBackground`]. Does nothing for the other estimates.
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

    /// Returns whether all occluders that cover pixels of a rectangle are certainly nearer than a box whose
    /// depth keys are at most `depth_key`: whether the occluders' bounds are strictly greater. Uncovered
    /// pixels are ignored, so the caller must test coverage apart.
    #[inline(always)]
    pub(crate) fn is_nearer_than(
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

/// Updates the opacity pyramid and the depth estimate from the pixels drawn in the tiles of the inclusive
/// range `region`, which must not be empty.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::buffer::tile_layout::SIDE;

    /// The estimates of the farthest points of occluders: one bound for all, and one for each tile that their
    /// rectangles meet. What is as near as a bound is not behind it.
    #[test]
    fn bounds_are_those_of_the_farthest_occluder() {
        let tiles = Tiles::new(4 * SIDE, 3 * SIDE);
        let opacity = OpacityPyramid::new([4 * SIDE, 3 * SIDE]);
        let all = [([0, 1, 0, 1], 3.0), ([1, 2, 1, 2], 2.0), ([1, 1, 0, 0], 5.0)];
        for estimate in [DepthEstimate::Plane, DepthEstimate::Buffer] {
            let mut boundary = DepthBoundary::new(&tiles);
            boundary.set(estimate);
            boundary.clear();
            for (region, depth_key) in all {
                boundary.move_behind(&TileRange(region), depth_key);
            }
            for (x, y) in (0..3).flat_map(|y| (0..4).map(move |x| (x, y))) {
                let is_in = |[x0, x1, y0, y1]: [usize; 4]| (x0..=x1).contains(&x) && (y0..=y1).contains(&y);
                let own = all.iter().filter(|(region, _)| estimate == DepthEstimate::Plane || is_in(*region));
                let bound = own.fold(f32::INFINITY, |least, &(_, key)| least.min(key));
                let [columns, lines] = [x, y].map(|at| [(at * SIDE) as u32, (at * SIDE + 3) as u32]);
                let rectangle = Rectangle { columns, lines };
                for depth_key in [1.0, 2.0, 2.5, 3.0, 4.0, 5.0] {
                    let is_nearer = boundary.is_nearer_than(&opacity, &tiles, &rectangle, depth_key);
                    assert_eq!(is_nearer, bound > depth_key, "{estimate:?}, tile {x}, {y} at {depth_key}");
                }
            }
            boundary.move_behind(&TileRange([0, 3, 0, 2]), f32::NAN);
            let rectangle = Rectangle { columns: [0, 8], lines: [0, 8] };
            let is_nearer = boundary.is_nearer_than(&opacity, &tiles, &rectangle, -1e30);
            assert!(!is_nearer, "{estimate:?}: an occluder without a key is behind all");
        }
    }
}
