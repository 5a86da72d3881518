//! Hierarchical occlusion maps: a pyramid of opacities and, apart from it, an estimate of depth (Zhang,
//! Manocha, Hudson and Hoff, "Visibility Culling using Hierarchical Occlusion Maps", 1997; Cohen-Or,
//! Chrysanthou, Silva and Durand, "A Survey of Visibility for Walkthrough Applications", 2003, section 6.2).
//!
//! Occluders are drawn by the raster of the z-buffer. A box is hidden if its screen rectangle is opaque
//! (`overlap.rs`, over the counts of `opacity_pyramid.rs`, with `opacity_thresholds.rs`) and the box
//! lies behind all occluders that cover pixels of the rectangle (`depth_estimate.rs`).

use super::depth_estimate::{DepthBoundary, DepthEstimate};
use super::opacity_pyramid::OpacityPyramid;
use super::opacity_thresholds::{TILE, Thresholds};
use super::overlap;
use super::tile_range::TileRange;
use crate::buffer::tile_layout::Rectangle;
use crate::buffer_size::SizeError;
use crate::coverage::Coverage;
use crate::hzb::Hzb;
use crate::lanes::WIDTH;
use crate::query::box_projection::{ProjectedBoxes, project};
use crate::query::box_queue::BoxQueue;
use crate::simd_dispatch::Kernels;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::scene::FAN_OUT;
use visibility_core::{
    Aabb, Accuracy, OccluderMesh, OcclusionMap, View,
    occlusion::{Occlusion, Occlusion64},
    scene::Boxes64,
    simd::Simd,
};

/// Hierarchical occlusion maps: an [`OcclusionMap`] that tests the coverage and the depth of a box's screen
/// rectangle separately.
///
/// With an opacity threshold of 1, the default, a texel is opaque only if all its pixels are covered, and
/// nothing visible is ever hidden. With a lesser threshold small holes count as covered, and objects that are
/// visible only through them are hidden by mistake.
///
/// Memory is 4 bytes for each pixel, plus the memory of [`Hzb`] for convex occluders.
///
/// ```
/// use visibility_core::{
///     glam::{Affine3A, DVec3}, occlusion::Occlusion, Aabb, OccluderMesh, OcclusionMap, Pose,
///     View,
/// };
/// use visibility_hzb::Hom;
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?;
/// let mut hom = Hom::new(320, 180)?;
/// hom.begin(&view, DVec3::ZERO);
/// // Two halves of a wall, with a slit of a few pixels between them.
/// for [left, right] in [[-4.0, -0.05], [0.05, 4.0]] {
///     let half = OccluderMesh::cuboid(&Aabb::from_arrays([5.0, left, -4.0], [5.2, right, 4.0]))?;
///     hom.add(&half, &Affine3A::IDENTITY);
/// }
/// hom.flush();
/// let behind = Aabb::from_arrays([8.0, -2.0, -1.0], [9.0, 2.0, 1.0]);
/// assert_eq!(hom.test(&behind), Occlusion::Partial);
/// assert_eq!(hom.with_threshold(0.5).test(&behind), Occlusion::Hidden);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
#[must_use]
pub struct Hom {
    /// Z-buffer that draws occluders. Also holds the view's projection, by which boxes are projected.
    raster: Hzb,
    /// Covered pixels, and the number of covered pixels in each texel of the coarser levels, as of the last
    /// flush.
    opacity: OpacityPyramid,
    /// Lower bounds on the depth keys of the drawn occluders.
    boundary: DepthBoundary,
    /// Boxes around added occluders that `boundary` and `stale` do not take into account yet.
    queue: BoxQueue,
    /// Range of the tiles whose counts of covered pixels and depth bounds may be out of date since the last
    /// flush.
    stale: TileRange,
}

impl Default for Hom {
    /// Creates conservative maps of 512 x 288 pixels.
    fn default() -> Self {
        Self::over(Hzb::default())
    }
}

impl Hom {
    /// Creates empty maps. The finest map has `width` columns and `height` rows of pixels. The maps hide
    /// nothing until the first [`begin`](OcclusionMap::begin).
    ///
    /// # Errors
    /// [`SizeError`] if a side is not between [`MIN_SIDE`](crate::MIN_SIDE) and
    /// [`MAX_SIDE`](crate::MAX_SIDE).
    pub fn new(width: usize, height: usize) -> Result<Self, SizeError> {
        Hzb::new(width, height).map(Self::over)
    }

    /// Creates maps that draw into `raster`, which must hold no occluder.
    fn over(raster: Hzb) -> Self {
        let opacity = OpacityPyramid::new([raster.width(), raster.height()]);
        let boundary = DepthBoundary::new(&raster.tiles);
        Self { raster, opacity, boundary, queue: BoxQueue::EMPTY, stale: TileRange::NONE }
    }

    /// Sets the opacity threshold of texels of 8 x 8 pixels: the fraction of pixels, 0 to 1, that must be
    /// covered for the texel to count as opaque. NaN and numbers above 1 count as 1, negative numbers as 0.
    /// An opaque coarser texel may have at most as many uncovered pixels as an opaque texel of 8 x 8, an
    /// opaque finer texel none. Replaces the thresholds of all levels. A threshold below 1 makes the maps
    /// approximate. Takes effect at once.
    pub fn with_threshold(mut self, threshold: f32) -> Self {
        self.opacity.set(Thresholds::from_tile_threshold(threshold));
        self
    }

    /// Sets the opacity threshold, 0 to 1, of one [level](Self::levels): 1 for texels of 2 x 2 pixels, 2 for
    /// 4 x 4 and so on. Level 0, that of pixels, and levels beyond the last are ignored. NaN and numbers
    /// above 1 count as 1, negative numbers as 0. A threshold below 1 makes the maps approximate. Takes
    /// effect at once.
    pub fn with_level_threshold(mut self, level: usize, threshold: f32) -> Self {
        let mut thresholds = self.opacity.thresholds.clone();
        thresholds.set(level, threshold);
        self.opacity.set(thresholds);
        self
    }

    /// Sets the estimate of the depth of occluders. Call it between frames: until the next
    /// [`begin`](OcclusionMap::begin), maps that already hold occluders may hide fewer boxes.
    #[cfg(feature = "papers")]
    pub fn with_depth_estimate(mut self, estimate: DepthEstimate) -> Self {
        self.boundary.set(estimate);
        self
    }

    /// Sets the rule of which pixels an occluder covers. Call it between frames: pixels that are already
    /// drawn are kept. [`Coverage::Sampled`] makes the maps approximate.
    pub fn with_coverage(self, coverage: Coverage) -> Self {
        Self { raster: self.raster.with_coverage(coverage), ..self }
    }

    /// Sets the instruction set of the maps' inner loops. Answers do not depend on it. For tests and
    /// benchmarks.
    pub fn with_simd(self, simd: Simd) -> Self {
        Self { raster: self.raster.with_simd(simd), ..self }
    }

    /// Returns the width of the finest map in pixels.
    pub fn width(&self) -> usize {
        self.raster.width()
    }

    /// Returns the height of the finest map in pixels.
    pub fn height(&self) -> usize {
        self.raster.height()
    }

    /// Returns the rule of which pixels an occluder covers.
    pub fn coverage(&self) -> Coverage {
        self.raster.coverage()
    }

    /// Returns the opacity threshold of a level, as a fraction from 0 to 1. Level 0 is the pixels. 1 beyond
    /// the last level.
    pub fn threshold(&self, level: usize) -> f32 {
        self.opacity.thresholds.get(level)
    }

    /// Returns the number of levels. Level 0 is the pixels, level 1 texels of 2 x 2 pixels, and so on, down
    /// to one texel.
    pub fn levels(&self) -> usize {
        TILE + self.opacity.levels.len()
    }

    /// Returns the fraction of a texel's pixels that is covered, as of the last
    /// [`flush`](OcclusionMap::flush): 1 only if all pixels are covered. Level 0 is the pixels. `None` if the
    /// level, column or row does not exist.
    pub fn opacity(&self, level: usize, column: usize, row: usize) -> Option<f64> {
        let [count, area] = self.opacity.texel(level, column, row)?;
        Some(f64::from(count) / f64::from(area))
    }

    /// Queues the box around an occluder, or around a part of an occluder. `bounds` is in the occluder's own
    /// coordinates, `transform` maps to scene coordinates. Processes the queue when it is full.
    fn queue_box(&mut self, bounds: &Aabb, transform: &Affine3A) {
        if self.queue.push(bounds, transform, true) {
            self.process_queue();
        }
    }

    /// Projects the queued boxes, lowers `boundary` for those that nearer occluders do not hide, adds their
    /// tiles to `stale`, and empties the queue.
    fn process_queue(&mut self) {
        let count = core::mem::take(&mut self.queue.count);
        if count == 0 {
            return;
        }
        let Self { raster, boundary, queue, stale, .. } = self;
        raster.simd.project_boxes(&raster.projection32, &queue.around, &mut queue.projected);
        let seen = &queue.projected;
        for i in (0..count.min(WIDTH)).filter(|&i| !seen.outside[i]) {
            let whole = [raster.width() as u32, raster.height() as u32];
            let rectangle = match seen.known[i] {
                true => seen.rectangle(i),
                false => Rectangle { columns: [0, whole[0]], lines: [0, whole[1]] },
            };
            let region = TileRange::of(&rectangle);
            stale.join(&region);
            let shows = || {
                !seen.known[i]
                    || raster.simd.rectangle_may_be_seen(&raster.tiles, &rectangle, seen.nearest[i])
            };
            if boundary.estimate != DepthEstimate::NoBackground && shows() {
                boundary.move_behind(&region, seen.farthest[i]);
            }
        }
    }

    /// Tests the boxes whose bit is set in `lanes`: bit i stands for box i. `seen` holds the projected boxes,
    /// `boxes` their least x, y, z and greatest x, y, z in scene coordinates. Returns the mask of hidden
    /// boxes and the mask of visible boxes: those that no occluder in the maps can hide any part of, and
    /// improper (inverted or NaN) boxes. A bit in neither mask means undecided.
    #[inline(always)]
    fn decide<const N: usize>(
        &self,
        seen: &ProjectedBoxes<N>,
        lanes: u64,
        boxes: &[[f32; N]; 6],
    ) -> (u64, u64) {
        let (mut hidden, mut visible) = (0, 0);
        for i in (0..N).filter(|i| lanes >> i & 1 != 0) {
            let proper =
                boxes[0][i] <= boxes[3][i] && boxes[1][i] <= boxes[4][i] && boxes[2][i] <= boxes[5][i];
            if proper && seen.outside[i] {
                hidden |= 1 << i;
            } else if !proper || seen.inside[i] && seen.farthest[i] >= self.raster.nearest {
                visible |= 1 << i;
            } else if seen.known[i] && seen.nearest[i] < self.raster.nearest {
                hidden |= u64::from(self.hides(&seen.rectangle(i), seen.nearest[i])) << i;
            }
        }
        (hidden, visible)
    }

    /// Returns whether the maps hide a rectangle of pixels at depth keys up to `depth_key`: whether the
    /// rectangle is opaque and all occluders that cover pixels of it are strictly nearer.
    #[inline(always)]
    fn hides(&self, rectangle: &Rectangle, depth_key: f32) -> bool {
        let plane = self.boundary.estimate == DepthEstimate::Plane;
        let before = || self.boundary.is_nearer_than(&self.opacity, &self.raster.tiles, rectangle, depth_key);
        (!plane || before()) && overlap::is_opaque(&self.opacity, rectangle, true) && (plane || before())
    }
}

impl OcclusionMap for Hom {
    fn name(&self) -> &str {
        "hom"
    }

    fn accuracy(&self) -> Accuracy {
        match self.coverage() {
            Coverage::Conservative if self.opacity.thresholds.all_opaque() => Accuracy::Conservative,
            _ => Accuracy::Approximate,
        }
    }

    fn begin(&mut self, view: &View, origin: DVec3) {
        self.raster.begin(view, origin);
        self.opacity.clear();
        self.boundary.clear();
        self.queue.count = 0;
        self.stale = TileRange::NONE;
    }

    fn cost(&self, occluder: &OccluderMesh) -> usize {
        self.raster.cost(occluder)
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        self.raster.add(occluder, transform);
        // One box around the occluder is enough to find the tiles that may change. The boxes around its parts
        // give a tighter bound on its depth.
        if self.boundary.estimate == DepthEstimate::NoBackground || occluder.parts().is_empty() {
            return self.queue_box(occluder.bounds(), transform);
        }
        for part in occluder.parts() {
            self.queue_box(part.bounds(), transform);
        }
    }

    fn flush(&mut self) {
        self.raster.flush();
        self.process_queue();
        if !self.stale.is_empty() {
            let Self { raster, opacity, boundary, stale, .. } = self;
            raster.simd.update_maps(opacity, boundary, &raster.tiles, stale);
            self.stale = TileRange::NONE;
        }
    }

    fn test(&self, bounds: &Aabb) -> Occlusion {
        let ([x0, y0, z0], [x1, y1, z1]) = (bounds.min.to_array(), bounds.max.to_array());
        let boxes = [x0, y0, z0, x1, y1, z1].map(|side| [side]);
        match self.decide(&project(&self.raster.projection32, &boxes), 1, &boxes) {
            (0, 0) => Occlusion::Partial,
            (0, _) => Occlusion::Visible,
            _ => Occlusion::Hidden,
        }
    }

    fn test_64(&self, boxes: &Boxes64, candidates: u64) -> Occlusion64 {
        let mut answer = Occlusion64::default();
        let mut seen = ProjectedBoxes::NONE;
        for chunk in 0..FAN_OUT / WIDTH {
            let lanes = candidates >> (chunk * WIDTH) & ((1 << WIDTH) - 1);
            if lanes == 0 {
                continue;
            }
            let mut part = [[0.0; WIDTH]; 6];
            for (out, row) in part.iter_mut().zip(boxes.coordinates()) {
                *out = row.as_chunks::<WIDTH>().0[chunk];
            }
            self.raster.simd.project_boxes(&self.raster.projection32, &part, &mut seen);
            let (hidden, visible) = self.decide(&seen, lanes, &part);
            answer.hidden |= hidden << (chunk * WIDTH);
            answer.visible |= visible << (chunk * WIDTH);
        }
        answer
    }

    fn reset(&mut self) {
        self.raster.reset();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Vec3;
    use visibility_core::{Pose, scene::Boxes64};

    /// Boxes that are inverted along one axis, or have a side that is no number, are visible wherever they
    /// are: behind a wall that hides the proper box, and outside of the view.
    #[test]
    fn improper_boxes_are_visible() {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, 900.0).unwrap();
        let mut hom = Hom::new(64, 36).unwrap();
        hom.begin(&view, DVec3::ZERO);
        let wall = Aabb::from_arrays([5.0, -40.0, -40.0], [5.2, 40.0, 40.0]);
        hom.add(&OccluderMesh::cuboid(&wall).unwrap(), &Affine3A::IDENTITY);
        hom.flush();
        for at in [[8.0, 0.0, 0.0], [-8.0, 0.0, 0.0], [8.0, 900.0, 0.0]] {
            let min = Vec3::from_array(at);
            let own = Aabb { min, max: min + 0.25 };
            assert_eq!(hom.test(&own), Occlusion::Hidden, "a proper box at {min}");
            for (axis, side) in (0..3).flat_map(|axis| [-1.0, f32::NAN].map(|side| (axis, side))) {
                let mut wrong = own;
                wrong.max[axis] = wrong.min[axis] + side;
                assert_eq!(hom.test(&wrong), Occlusion::Visible, "{wrong:?}");
                let mut boxes = Boxes64::EMPTY;
                boxes.set(3, &wrong);
                let answer = hom.test_64(&boxes, 1 << 3);
                assert_eq!((answer.hidden, answer.visible), (0, 1 << 3), "{wrong:?} among 64");
            }
        }
    }

    /// A box that reaches behind the eye has no bounds on the screen, and is not hidden. An occluder that
    /// does covers pixels at its far end, which a box may be before, whatever the estimate of depth.
    #[test]
    fn boxes_through_the_plane_of_the_eye_are_not_hidden_and_hide_at_their_far_ends() {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, 900.0).unwrap();
        // A wall before the right part of the picture, and a long one through the plane of the eye that is
        // seen at a slant in the left part.
        let right = Aabb::from_arrays([5.0, -40.0, -40.0], [5.2, 0.2, 40.0]);
        let left = Aabb::from_arrays([-1.0, 3.0, -500.0], [300.0, 4.0, 500.0]);
        for estimate in [DepthEstimate::Plane, DepthEstimate::Buffer, DepthEstimate::NoBackground] {
            let mut hom = Hom::new(128, 72).unwrap();
            hom.boundary.set(estimate);
            hom.begin(&view, DVec3::ZERO);
            for wall in [right, left] {
                hom.add(&OccluderMesh::cuboid(&wall).unwrap(), &Affine3A::IDENTITY);
                hom.flush();
            }
            let answer = |min: [f32; 3], max: [f32; 3]| hom.test(&Aabb::from_arrays(min, max));
            let before_left = answer([20.0, 1.0, -0.5], [21.0, 1.5, 0.5]);
            assert_ne!(before_left, Occlusion::Hidden, "{estimate:?}: a box before the far end of a wall");
            let around_eye = answer([-1.0, -1.0, -1.0], [9.0, 1.0, 1.0]);
            assert_ne!(around_eye, Occlusion::Hidden, "{estimate:?}: a box around the eye");
            if estimate == DepthEstimate::NoBackground {
                let behind = [
                    answer([8.0, -1.0, -0.5], [9.0, -0.5, 0.5]),
                    answer([80.0, 40.0, -0.5], [81.0, 41.0, 0.5]),
                ];
                assert_eq!(behind, [Occlusion::Hidden; 2], "boxes behind the walls");
            }
        }
    }
}
