//! Occlusion culling: a trait for maps to which occluders are added and against which boxes are tested, and
//! the one culler that drives such maps.
//!
//! A z-pyramid, an opacity map, an occlusion tree, a set of shadow frusta and hardware occlusion queries
//! share one interface: add occluders, test boxes (Cohen-Or, Chrysanthou, Silva and Durand, "A Survey of
//! Visibility for Walkthrough Applications", 2003, sections 5 and 6). Each implements [`OcclusionMap`].
//! [`OcclusionCuller`] chooses occluders, walks the hierarchy and removes hidden objects.

mod budget;
mod clip_planes;
mod culler;
mod mesh;
mod mesh_build;
mod parts;
mod prepare;
mod queries;
mod seams;
mod selection;

pub use culler::OcclusionCuller;
pub use mesh::{Edge, MeshError, OccluderMesh};
pub use prepare::{Preparation, prepare};
pub use queries::{HardwareQueries, LateAnswers, QueryDevice};
pub use seams::occluders_with_seams;

use crate::scene::{Boxes64, lanes};
use crate::{Aabb, Accuracy, ObjectId, Scene, View, culler::Lack, jobs::Jobs, view::ViewRegion};
use glam::{Affine3A, DVec3};

/// Result of testing a box against an occlusion map.
///
/// ```
/// use visibility_core::occlusion::Occlusion;
/// assert!(Occlusion::Hidden < Occlusion::Partial);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Hash)]
pub enum Occlusion {
    /// No point of the box can be seen: all of its part in the picture lies strictly behind occluders.
    Hidden,
    /// Some part of the box may be visible. Smaller boxes within the box may still be hidden and are worth
    /// testing.
    Partial,
    /// No part of the box is hidden by the map. Smaller boxes within the box need not be tested.
    Visible,
}

/// Result of testing 64 boxes against an occlusion map, as bit masks. Bit `i` stands for box `i`. A tested
/// box in neither mask is [`Occlusion::Partial`].
///
/// ```
/// use visibility_core::occlusion::Occlusion64;
/// let answer = Occlusion64 { hidden: 0b01, visible: 0b10 };
/// assert_eq!(answer.hidden & answer.visible, 0);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Occlusion64 {
    /// Bit `i` is set if box `i` is [`Occlusion::Hidden`].
    pub hidden: u64,
    /// Bit `i` is set if box `i` is [`Occlusion::Visible`].
    pub visible: u64,
}

impl Occlusion64 {
    /// Calls `test` with each lane of `candidates`, in ascending order, and collects the results.
    pub fn of_each(candidates: u64, mut test: impl FnMut(usize) -> Occlusion) -> Self {
        let mut answer = Self::default();
        for lane in lanes(candidates) {
            match test(lane) {
                Occlusion::Hidden => answer.hidden |= 1 << lane,
                Occlusion::Visible => answer.visible |= 1 << lane,
                Occlusion::Partial => {}
            }
        }
        answer
    }
}

/// An occlusion map of one view: occluders are added to it, and boxes are tested against the occluders.
///
/// A frame calls [`begin`](Self::begin), then [`add`](Self::add) any number of times and
/// [`flush`](Self::flush). After that, [`test`](Self::test) takes the added occluders into account. More
/// occluders may be added and flushed later in the frame.
///
/// ```
/// use visibility_core::{
///     glam::{Affine3A, DVec3}, occlusion::Occlusion, Aabb, Accuracy, OccluderMesh, OcclusionMap,
///     View,
/// };
/// /// A map that never hides a box.
/// struct Blank;
/// impl OcclusionMap for Blank {
///     fn name(&self) -> &str { "blank" }
///     fn accuracy(&self) -> Accuracy { Accuracy::Conservative }
///     fn begin(&mut self, _: &View, _: DVec3) {}
///     fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}
///     fn flush(&mut self) {}
///     fn test(&self, _: &Aabb) -> Occlusion { Occlusion::Partial }
/// }
/// ```
pub trait OcclusionMap {
    /// Returns a short name of the map for tables and explanations.
    fn name(&self) -> &str;

    /// Returns the guarantee for boxes that the map reports as [`Occlusion::Hidden`].
    fn accuracy(&self) -> Accuracy;

    /// Empties the map for a new frame of `view`. Occluders and boxes of the frame are relative to `origin`,
    /// the world-space origin of the scene.
    fn begin(&mut self, view: &View, origin: DVec3);

    /// As [`begin`](Self::begin), for a map that [draws](Self::draws) occluders by itself, nearest first.
    /// Draws on the threads of a job system if there is one. `_work` is about the greatest work to be spent,
    /// in triangles, the unit of the [price](OcclusionCuller::with_price) of hiding an object. If it is 0,
    /// negative or NaN, no occluder is drawn. Occluders that are not drawn hide nothing in this frame.
    /// Returns the work spent.
    ///
    /// The content of the map does not depend on the job system or its number of threads. Without a job
    /// system, the content may differ within the [accuracy](Self::accuracy). The default calls
    /// [`begin`](Self::begin) and returns 0; a map that wraps another passes on `begin`, `begin_within` and
    /// `draws`.
    fn begin_within(&mut self, view: &View, origin: DVec3, _work: f32, _jobs: Option<&dyn Jobs>) -> f32 {
        self.begin(view, origin);
        0.0
    }

    /// Empties the map for a frame whose answers are to hold for all views of `region`: a box is then
    /// [`Occlusion::Hidden`] only if no view of the region can see any part of it. Otherwise like
    /// [`begin_within`](Self::begin_within). Returns `None` if the map has no such answers, as the default
    /// does; its content is then unspecified until the next frame begins. A map that wraps another passes the
    /// call on.
    fn begin_region(
        &mut self,
        _region: &ViewRegion,
        _origin: DVec3,
        _work: f32,
        _jobs: Option<&dyn Jobs>,
    ) -> Option<f32> {
        None
    }

    /// Adds an occluder to the map. `transform` takes mesh coordinates to scene-relative coordinates. Under a
    /// mirroring transform the front of each triangle stays its front, though its corners then run clockwise.
    /// The occluder takes effect at the next [`flush`](Self::flush).
    ///
    /// The map must handle the [clip planes](View::with_clip_planes) of its view, which the clip matrix does
    /// not contain: an occluder that is not [inside](OccluderMesh::is_inside) all clip planes must be left
    /// out, since the parts that the planes cut away are not drawn.
    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A);

    /// Returns an upper bound on the cost of adding an occluder, in triangles, the unit of the
    /// [price](OcclusionCuller::with_price) of hiding an object. The default is the number of triangles of
    /// the mesh. Maps that draw some meshes more cheaply than triangle by triangle return less.
    fn cost(&self, occluder: &OccluderMesh) -> usize {
        occluder.triangles().len()
    }

    /// Returns whether an object is part of a level that the map draws by itself when a frame
    /// [begins](Self::begin). The culler then never adds the object's occluder to the map, even in a frame
    /// whose work runs out before the map draws the object. False by default.
    fn draws(&self, object: ObjectId) -> bool {
        let _ = object;
        false
    }

    /// Returns whether the map has a level: occluders that it draws by itself when a frame
    /// [begins](Self::begin), whether or not objects of the frame stand there. False by default. A map that
    /// wraps another passes the call on.
    fn has_level(&self) -> bool {
        false
    }

    /// Returns whether a test takes into account the occluders flushed earlier in the same frame. If false,
    /// as for a device whose answers arrive some frames later, the culler adds all occluders of a frame
    /// before it tests the first box.
    fn answers_at_once(&self) -> bool {
        true
    }

    /// Makes the occluders added so far take effect in [`test`](Self::test).
    fn flush(&mut self);

    /// Tests a box, relative to the origin given to [`begin`](Self::begin), against the flushed occluders. A
    /// box without a part in the picture, because it is beside the view or nearer than the near plane, may be
    /// [`Occlusion::Hidden`]. A box that crosses the near plane is hidden only if occluders hide all of its
    /// part beyond that plane. An improper box is [`Occlusion::Visible`].
    fn test(&self, bounds: &Aabb) -> Occlusion;

    /// Tests the boxes whose bits are set in `candidates`, of 64 boxes. Bit `i` stands for box `i`. All other
    /// bits are clear in both masks of the result.
    fn test_64(&self, boxes: &Boxes64, candidates: u64) -> Occlusion64 {
        Occlusion64::of_each(candidates, |lane| self.test(&boxes.get(lane)))
    }

    /// Tests a box like [`test`](Self::test), but may change the map: maps that remember answers or send
    /// queries to a device do so here. Called by the culler that owns the map. The default calls
    /// [`test`](Self::test).
    fn test_mut(&mut self, bounds: &Aabb) -> Occlusion {
        self.test(bounds)
    }

    /// Tests boxes like [`test_64`](Self::test_64), but may change the map, as [`test_mut`](Self::test_mut)
    /// may. A map that implements `test_mut` or `test_64_mut` implements both. The default calls
    /// [`test_64`](Self::test_64).
    fn test_64_mut(&mut self, boxes: &Boxes64, candidates: u64) -> Occlusion64 {
        self.test_64(boxes, candidates)
    }

    /// Returns the map for tests on several threads at once by [`test_64`](Self::test_64). `None`, the
    /// default, for a map whose tests must come one after the other by [`test_64_mut`](Self::test_64_mut).
    fn shared(&self) -> Option<&(dyn OcclusionMap + Sync)> {
        None
    }

    /// Calls `each` with each reason why occluders of `scene` are of no use to this map, as
    /// [`Culler::for_each_lack`](crate::Culler::for_each_lack) does for a culler. The default reports
    /// occluders without a usable mesh, meshes of objects that are not flagged as occluders, and a scene
    /// without occluders. A map with occluders of its own does not report a scene without occluders.
    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        Lack::of_no_occluder(scene, each);
        Lack::of_occluders(scene, each);
    }

    /// Tells the map that the scene has changed since the frame before. The culler calls it before it
    /// [begins](Self::begin) a frame. A map that remembers what was drawn in earlier frames must not hide
    /// boxes by that any longer. A map that wraps another passes the call on. The default does nothing.
    fn scene_changed(&mut self) {}

    /// Tells a map that does not [answer at once](Self::answers_at_once) that the objects to be culled are
    /// not those of the frame before. The culler calls it after it has [begun](Self::begin) a frame. Earlier
    /// answers are about a picture of other objects: what hid a box may not be drawn any longer. A map that
    /// wraps another passes the call on. The default does nothing.
    fn candidates_changed(&mut self) {}

    /// Forgets what the map remembers of earlier frames. The culler calls it before the first frame of
    /// another scene. The default does nothing.
    fn reset(&mut self) {}
}
