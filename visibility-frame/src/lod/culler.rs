//! The culler of objects that are too small, out of their draw range, or replaced by their HLOD parent.

use super::eye_box::EyeBox;
use super::{PixelScale, SizeTest};
use crate::simd_dispatch::Kernels;
use visibility_core::bits::Bits;
use visibility_core::glam::DVec3;
use visibility_core::scene::{DetailBounds, DetailedObject, SceneCursor, lanes};
use visibility_core::walk::{Child, SceneHierarchy, Walk};
use visibility_core::{Aabb, Accuracy, CullStats, Culler, Scene, View, VisibleSet, simd::Simd};

/// Width of the hysteresis at the ends of a draw range, as a fraction of the distance of the end. An object
/// that was beyond `begin` stays until it is nearer than `begin` by that fraction; an object within `end`
/// stays until it is farther than `end` by that fraction.
const HYSTERESIS: f64 = 0.05;

/// Removes objects that contribute too little: objects smaller than a number of pixels, out of their [draw
/// range](Scene::set_draw_range), or replaced by an [HLOD parent](Scene::set_hlod_parent). The
/// [module](super) defines size and distance. Objects that are never culled stay.
///
/// In a pipeline this culler comes before the stages that hide objects behind others: objects that it removes
/// are not drawn, so they must not serve as occluders. Stages that hide behind a level, or by sets or cells
/// made beforehand, do not ask what is left: with a limit in pixels, what is behind many small objects may be
/// missing, and [`Pipeline::for_each_lack`](visibility_core::Pipeline::for_each_lack) says so.
///
/// Approximate: objects that it removes may be visible. The greater the pixel limit, the more is removed. It
/// never removes an object that is as large as the limit, in its range and not replaced by a parent.
///
/// A parent is drawn at distances from its range's `begin` on, and its children at smaller distances: in
/// every frame either the parent or the children. The distance of a child is measured to the parent's box for
/// this. Exceptions are objects that are too small, and children whose own range ends before the parent's
/// begins. The ends of a range have a hysteresis of 5 %: an object that was drawn stays until the distance
/// exceeds `end` by that share, and a parent that was drawn stays until the distance falls below `begin` by
/// that share. So nothing flickers while the camera trembles. The answer depends on earlier frames only for
/// distances within 5 % of `begin` or `end`.
///
/// # Cost
/// A node without an object that is large enough and in range is dropped in one test. Objects of other leaves
/// take a few nanoseconds each, and an object with a range or a parent some ten more. A million objects of
/// like size, of which 1 % remain, take 0.2 ms; if most leaves hold a large object, 4 ms. Memory: 2 bits for
/// each object index.
///
/// ```
/// use visibility_core::glam::DVec3;
/// use visibility_frame::lod::ContributionCuller;
/// use visibility_core::{Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
/// let mut scene = Scene::new();
/// let house = scene.insert(Aabb::from_arrays([300.0, 0.0, 0.0], [310.0, 10.0, 10.0]));
/// let _cup = scene.insert(Aabb::from_arrays([300.0, 0.0, 20.0], [300.1, 0.1, 20.1]));
/// // For pictures of 1080 rows: objects smaller than two pixels are not drawn.
/// let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(ContributionCuller::new(1080.0, 2.0));
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 2.0, 1.5, 0.1, f64::INFINITY)?;
/// let mut visible = VisibleSet::new();
/// pipeline.cull(&scene, &view, &mut visible);
/// assert_eq!(visible.iter(&scene).collect::<Vec<_>>(), [house]);
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ContributionCuller {
    simd: Simd,
    picture_height: f64,
    min_pixels: f64,
    /// World-space point that distances of draw ranges and HLOD parents are measured from. `None` for the
    /// view's own eye.
    distance_eye: Option<DVec3>,
    /// The scene that `far` and `near` belong to.
    scene: SceneCursor,
    /// One bit per object index: whether the object was at or beyond the begin of its range when it was last
    /// tested.
    far: Bits,
    /// One bit per object index: whether the object was within the end of its range when it was last tested.
    near: Bits,
}

impl ContributionCuller {
    /// Makes a culler for pictures that are `picture_height` pixels high, which removes objects whose
    /// [size](super) is less than `min_pixels` pixels. If either argument is NaN, zero or negative, no object
    /// is too small: objects are removed by draw ranges and HLOD parents only.
    pub fn new(picture_height: f64, min_pixels: f64) -> Self {
        Self {
            simd: Simd::best(),
            picture_height,
            min_pixels,
            distance_eye: None,
            scene: SceneCursor::START,
            far: Bits::EMPTY,
            near: Bits::EMPTY,
        }
    }

    /// Sets the SIMD instructions, for tests and comparisons. Results are the same with all.
    #[must_use]
    pub fn with_simd(self, simd: Simd) -> Self {
        Self { simd, ..self }
    }

    /// Sets the height in pixels of the pictures of later frames.
    pub fn set_picture_height(&mut self, picture_height: f64) {
        self.picture_height = picture_height;
    }

    /// Sets the [size](super) in pixels below which objects are removed, for later frames.
    pub fn set_min_pixels(&mut self, min_pixels: f64) {
        self.min_pixels = min_pixels;
    }

    /// Sets the point of the world that distances for draw ranges and HLOD parents are measured from, for
    /// later frames. `None`, the default, is the view's own eye; parallel views have none, and every distance
    /// is then 0. For shadow maps, give the eye of the main camera, so that the objects that cast shadows are
    /// those that are drawn. Sizes are always those in the view.
    pub fn set_distance_eye(&mut self, eye: Option<DVec3>) {
        self.distance_eye = eye;
    }

    fn visit(&mut self, walk: &mut Walk<SceneHierarchy>, node: Option<usize>, frame: &Frame) -> bool {
        walk.visit(node, |walk, block, candidates| {
            let scene = walk.scene();
            let mut mask = candidates;
            walk.stats.tests += u64::from(candidates.count_ones());
            if let Some((leaf, _)) = block.leaf() {
                if let Some(size) = &frame.size
                    && candidates != 0
                {
                    mask &= !self.simd.small_boxes(block.boxes(), size);
                }
                for lane in lanes(mask & scene.detailed_lanes(leaf)) {
                    let is_drawn = self.is_drawn(scene, leaf, lane, frame);
                    mask &= !(u64::from(!is_drawn) << lane);
                }
                return mask;
            }
            for lane in lanes(candidates) {
                let Child::Node(child) = block.child(lane) else { continue };
                let is_dropped = frame.drops(&block.boxes().get(lane), &scene.detail_bounds(child));
                let any = !is_dropped && self.visit(walk, Some(child), frame);
                mask &= !(u64::from(!any) << lane);
            }
            mask
        })
    }

    /// Tests whether the object in a lane of a leaf is in its draw range and not replaced by a parent.
    fn is_drawn(&mut self, scene: &Scene, leaf: usize, lane: usize, frame: &Frame) -> bool {
        let Some(object) = scene.detail_at(leaf, lane) else { return true };
        let above =
            |object: &DetailedObject| object.stand_in.and_then(|(leaf, lane)| scene.detail_at(leaf, lane));
        let (index, end) = (object.id.index(), f64::from(object.range.end));
        let mut next = above(&object);
        if end.is_finite() {
            let end = if self.near.contains(index) { end * (1.0 + HYSTERESIS) } else { end };
            // The end of this level and the begin of the next are measured to the same box, the parent's.
            // Between boxes of different sizes there would be distances at which neither is drawn.
            let around = next.map_or(object.bounds, |above| above.bounds);
            let is_beyond = frame.eye.is_beyond(&around, end);
            self.near.set(index, !is_beyond);
            if is_beyond {
                return false;
            }
        }
        if self.is_before(&object, frame) {
            return false;
        }
        // Of an object and the chain of its parents exactly one is drawn: the last that is beyond its begin,
        // or else the object.
        while let Some(stand_in) = next {
            if !self.is_before(&stand_in, frame) {
                return false;
            }
            next = above(&stand_in);
        }
        true
    }

    /// Tests whether an object is nearer than the begin of its draw range. Several calls for one object in a
    /// frame give the same answer.
    fn is_before(&mut self, object: &DetailedObject, frame: &Frame) -> bool {
        let (index, begin) = (object.id.index(), f64::from(object.range.begin));
        let begin = if self.far.contains(index) { begin * (1.0 - HYSTERESIS) } else { begin };
        let is_before = frame.eye.is_within(&object.bounds, begin);
        self.far.set(index, !is_before);
        is_before
    }
}

/// What a frame needs to test sizes and distances.
struct Frame {
    /// Test for objects that are too small. `None` if no object is too small: the limit or the picture height
    /// is NaN, zero or negative.
    size: Option<SizeTest>,
    eye: EyeBox,
}

impl Frame {
    /// Returns true if the culler certainly removes every object below a node. `bounds` is the box of the
    /// node, `below` bounds the size and the draw distance of these objects.
    fn drops(&self, bounds: &Aabb, below: &DetailBounds) -> bool {
        self.size.is_some_and(|size| size.is_small(bounds, below.diagonal_squared))
            || self.eye.is_beyond(bounds, f64::from(below.end) * (1.0 + HYSTERESIS))
    }
}

impl Culler for ContributionCuller {
    fn name(&self) -> &str {
        "contribution"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Approximate
    }

    fn follows_draw_ranges(&self) -> bool {
        true
    }

    fn follows_sizes(&self) -> bool {
        self.picture_height > 0.0 && self.min_pixels > 0.0
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        if !self.scene.is_in(scene) {
            self.reset();
        }
        self.scene = SceneCursor::at(scene);
        self.far.grow(scene.index_limit());
        self.near.grow(scene.index_limit());
        let scale = PixelScale::new(view, scene.origin(), self.picture_height);
        let eye = self.distance_eye.map_or(*scale.eye(), |eye| EyeBox::of_point(eye, scene.origin()));
        let frame = Frame { size: scale.smaller_than(self.min_pixels), eye };
        let mut walk = Walk::new(scene, &SceneHierarchy, visible);
        self.visit(&mut walk, None, &frame);
        walk.finish()
    }

    fn reset(&mut self) {
        self.scene = SceneCursor::START;
        self.far.clear();
        self.near.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Pose;

    #[test]
    fn sizes_count_with_a_height_and_a_limit() {
        let follows = |height: f64, limit: f64| ContributionCuller::new(height, limit).follows_sizes();
        for height in [0.0, -1.0, f64::NAN] {
            assert!(!follows(height, 2.0) && !follows(1000.0, height), "height or limit {height}");
        }
        assert!(follows(1000.0, 2.0), "a height and a limit");
    }

    /// Small objects below inner nodes are removed, and the large one among them stays.
    #[test]
    fn small_objects_of_many_nodes_are_removed() {
        let mut scene = Scene::new();
        let cups = (0..5000).map(|i| {
            let at = [100.0, (i % 70) as f32, (i / 70) as f32];
            Aabb::from_arrays(at, at.map(|x| x + 0.01))
        });
        scene.insert_batch(cups);
        let house = scene.insert(Aabb::from_arrays([100.0, 3.0, 3.0], [110.0, 9.0, 9.0]));
        let view =
            View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 2.0, 1.0, 0.1, 1e3).unwrap();
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        ContributionCuller::new(1000.0, 4.0).cull(&scene, &view, &mut visible);
        assert_eq!(visible.iter(&scene).collect::<alloc::vec::Vec<_>>(), [house], "what is large enough");
    }
}
