//! Runs the cullers of one view in sequence, with tools that show which culler removed an object.

use crate::{Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet, culler::Lack, jobs::Jobs};
use alloc::{boxed::Box, vec::Vec};

/// A sequence of cullers for one view. Each stage receives the objects that the stages before it left in the
/// set. An engine calls [`cull`](Self::cull) once per frame and view.
///
/// Two tools help to find out why an object is or is not drawn. [`set_explaining`](Self::set_explaining)
/// records which stage removed each object, and [`freeze`](Self::freeze) keeps culling for one view while the
/// engine draws from another.
///
/// ```
/// use visibility_core::{glam::DVec3, Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
/// let mut scene = Scene::new();
/// let ahead = scene.insert(Aabb::from_arrays([5.0, -1.0, -1.0], [6.0, 1.0, 1.0]));
/// let _behind = scene.insert(Aabb::from_arrays([-6.0, -1.0, -1.0], [-5.0, 1.0, 1.0]));
/// let mut pipeline = Pipeline::new().with(FrustumCuller::new());
/// let mut visible = VisibleSet::new();
/// // Each frame:
/// let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
/// let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?;
/// pipeline.cull(&scene, &view, &mut visible);
/// assert_eq!(visible.iter(&scene).collect::<Vec<_>>(), [ahead]);
/// # Ok::<(), visibility_core::view::ViewError>(())
/// ```
#[derive(Default)]
pub struct Pipeline {
    stages: Vec<(Box<dyn Culler + Send + Sync>, CullStats)>,
    /// View that the last call of `cull` used; `None` before the first call.
    last: Option<View>,
    /// View to cull for instead of the one passed to `cull`; `None` unless frozen.
    frozen: Option<View>,
    /// Which stage removed each object of the last frame; `None` unless the pipeline is explaining.
    removals: Option<Removals>,
}

/// Why an object is, or is not, in the visible set of the last frame of a [`Pipeline`].
///
/// ```
/// use visibility_core::pipeline::Explanation;
/// assert_eq!(Explanation::RemovedBy("frustum").to_string(), "removed by frustum");
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Explanation<'a> {
    /// The object is in the set: no stage removed it.
    Visible,
    /// The object shares no layer with the view, so it was no candidate.
    OnOtherLayers,
    /// The stage with this [name](Culler::name) removed the object.
    RemovedBy(&'a str),
    /// The object was not in the scene in the last frame, or the pipeline was not explaining then.
    Unknown,
}

impl core::fmt::Display for Explanation<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Visible => write!(f, "visible"),
            Self::OnOtherLayers => write!(f, "on other layers"),
            Self::RemovedBy(stage) => write!(f, "removed by {stage}"),
            Self::Unknown => write!(f, "unknown"),
        }
    }
}

/// Records, for each object of a frame, which stage removed it.
#[derive(Default)]
struct Removals {
    /// Indexed by object index: the id that had this index in the last frame, and its fate. `None` where no
    /// object had the index.
    fates: Vec<Option<(ObjectId, Fate)>>,
    /// Objects that all stages so far have kept, in the order of the set.
    left: Vec<ObjectId>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Fate {
    OnOtherLayers,
    RemovedBy(usize),
    Visible,
}

impl Removals {
    fn begin(&mut self, scene: &Scene, visible: &VisibleSet) {
        self.fates.clear();
        self.fates.resize(scene.index_limit(), None);
        for id in scene.ids() {
            self.fates[id.index()] = Some((id, Fate::OnOtherLayers));
        }
        self.left.clear();
        self.left.extend(visible.iter(scene));
        for &id in &self.left {
            self.fates[id.index()] = Some((id, Fate::Visible));
        }
    }

    fn after_stage(&mut self, stage: usize, scene: &Scene, visible: &VisibleSet) {
        self.left.retain(|&id| {
            let stays = visible.contains(scene, id);
            if !stays {
                self.fates[id.index()] = Some((id, Fate::RemovedBy(stage)));
            }
            stays
        });
    }
}

impl Pipeline {
    /// Creates a pipeline without stages, which leaves every object on the view's layers in the set.
    pub fn new() -> Self {
        Self::default()
    }

    /// Appends a culler as the last stage and returns the pipeline.
    #[must_use]
    pub fn with(mut self, culler: impl Culler + Send + Sync + 'static) -> Self {
        self.push(Box::new(culler));
        self
    }

    /// Appends a culler as the last stage.
    pub fn push(&mut self, culler: Box<dyn Culler + Send + Sync>) {
        self.stages.push((culler, CullStats::default()));
    }

    /// Returns the accuracy of all stages in sequence; conservative without stages, since every object on the
    /// view's layers is then reported.
    pub fn accuracy(&self) -> Accuracy {
        self.stages.iter().fold(Accuracy::Conservative, |all, (culler, _)| all.and(culler.accuracy()))
    }

    /// Replaces the content of `visible` with the objects on the view's layers, and lets each stage remove
    /// the objects that it finds hidden. The objects left in `visible` are to be drawn. While
    /// [frozen](Self::freeze), `view` is ignored in favour of the frozen view.
    ///
    /// Returns the sum of the stages' work counters; its `visible` is the number of objects left.
    pub fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        self.run(scene, view, visible, |culler, view, visible| culler.cull(scene, view, visible))
    }

    /// Culls like [`cull`](Self::cull), on the threads of the engine's own [job system](Jobs). The answer is
    /// the same bit for bit with any job system and any number of threads. Worth its overhead for large
    /// scenes and for occlusion maps with many occluders. Several views are best culled with
    /// [`cull`](Self::cull), one view per thread.
    ///
    /// ```
    /// use visibility_core::{jobs::Jobs, FrustumCuller, Pipeline};
    /// # use visibility_core::{glam::DVec3, Pose, Scene, View, VisibleSet};
    /// # let (scene, mut visible) = (Scene::new(), VisibleSet::new());
    /// # let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 9.0)?;
    /// /// A new thread for each job. An engine has its own threads wait for jobs.
    /// struct EngineJobs;
    /// impl Jobs for EngineJobs {
    ///     fn run(&self, count: usize, job: &(dyn Fn(usize) + Sync)) {
    ///         std::thread::scope(|scope| (0..count).for_each(|index| {
    ///             scope.spawn(move || job(index));
    ///         }));
    ///     }
    /// }
    /// let mut pipeline = Pipeline::new().with(FrustumCuller::new());
    /// pipeline.cull_on(&EngineJobs, &scene, &view, &mut visible);
    /// # Ok::<(), visibility_core::view::ViewError>(())
    /// ```
    pub fn cull_on(
        &mut self,
        jobs: &dyn Jobs,
        scene: &Scene,
        view: &View,
        visible: &mut VisibleSet,
    ) -> CullStats {
        self.run(scene, view, visible, |culler, view, visible| culler.cull_on(jobs, scene, view, visible))
    }

    /// Fills `visible`, calls `cull` for each stage and finishes `visible`. Returns the sum of the counters.
    fn run(
        &mut self,
        scene: &Scene,
        view: &View,
        visible: &mut VisibleSet,
        mut cull: impl FnMut(&mut dyn Culler, &View, &mut VisibleSet) -> CullStats,
    ) -> CullStats {
        let view = self.frozen.as_ref().unwrap_or(view);
        self.last = Some(*view);
        visible.fill(scene, view);
        if let Some(removals) = &mut self.removals {
            removals.begin(scene, visible);
        }
        let mut sum = CullStats::default();
        for (place, (culler, stats)) in self.stages.iter_mut().enumerate() {
            *stats = cull(culler.as_mut(), view, visible);
            sum += *stats;
            if let Some(removals) = &mut self.removals {
                removals.after_stage(place, scene, visible);
            }
        }
        visible.finish(scene);
        if self.stages.is_empty() {
            sum.visible = visible.count(scene) as u64;
        }
        sum
    }

    /// Iterates over the stages in order of execution: the name of each and its counters in the last frame,
    /// all zero before the first frame.
    pub fn stages(&self) -> impl Iterator<Item = (&str, CullStats)> {
        self.stages.iter().map(|(culler, stats)| (culler.name(), *stats))
    }

    /// Calls `each` with the name of a stage and each thing that the stage [lacks](Culler::for_each_lack) to
    /// cull `scene`, such as "occluders without a mesh: 12". Calls `each` with the name "pipeline" for
    /// problems that no stage can solve: objects that are never culled only because their bounds are NaN or
    /// inverted, and objects with draw ranges if no stage follows draw ranges. Also names each stage that
    /// [hides objects behind others](Culler::hides_behind_objects) before a later stage removes some of these
    /// by draw range or size: what is hidden behind them is then missing. Does not call `each` if nothing is
    /// lacking.
    ///
    /// Takes up to a millisecond, and time in proportion to the number of objects that are never culled. For
    /// overlays and logs, once in a while rather than every frame.
    pub fn for_each_lack(&self, scene: &Scene, mut each: impl FnMut(&str, Lack)) {
        let count = scene.improper_bounds_count();
        if count > 0 {
            each("pipeline", Lack { what: "objects whose bounds are NaN or inverted, never culled", count });
        }
        for (culler, _) in &self.stages {
            culler.for_each_lack(scene, &mut |lack| each(culler.name(), lack));
        }
        let last = self.stages.iter().rposition(|(culler, _)| culler.follows_draw_ranges());
        let too_early = self.stages[..last.unwrap_or(0)].iter().map(|(culler, _)| culler);
        let count = scene.occluder_count();
        for culler in too_early.filter(|culler| count > 0 && culler.hides_behind_objects()) {
            let what =
                "occluders that hide others before a later stage may remove them by draw range or size";
            each(culler.name(), Lack { what, count });
        }
        let count = scene.draw_range_count();
        if count > 0 && !self.stages.iter().any(|(culler, _)| culler.follows_draw_ranges()) {
            each("pipeline", Lack { what: "objects with a draw range that no stage follows", count });
        }
    }

    /// Makes every stage forget its state from earlier frames. Never needed for correct results, even after a
    /// camera cut.
    pub fn reset(&mut self) {
        for (culler, _) in &mut self.stages {
            culler.reset();
        }
    }

    /// Starts (`true`) or stops (`false`) recording which stage removes which object; takes effect with the
    /// next frame. Records made so far are dropped. While recording, each frame costs time and memory in
    /// proportion to the number of objects of the scene.
    pub fn set_explaining(&mut self, explaining: bool) {
        self.removals = explaining.then(Removals::default);
    }

    /// Returns why an object was, or was not, in the visible set of the last frame. [`Explanation::Unknown`]
    /// unless the pipeline was [explaining](Self::set_explaining) in that frame and the object was in the
    /// scene.
    pub fn explain(&self, id: ObjectId) -> Explanation<'_> {
        let fate = self.removals.as_ref().and_then(|removals| *removals.fates.get(id.index())?);
        match fate {
            Some((known, fate)) if known == id => match fate {
                Fate::Visible => Explanation::Visible,
                Fate::OnOtherLayers => Explanation::OnOtherLayers,
                Fate::RemovedBy(stage) => Explanation::RemovedBy(self.stages[stage].0.name()),
            },
            _ => Explanation::Unknown,
        }
    }

    /// Makes later calls of `cull` use the view of the last frame and ignore the view passed to them, so that
    /// an engine can look at this view's visible objects from another viewpoint. Objects are culled with
    /// their current bounds. Does nothing before the first frame.
    pub fn freeze(&mut self) {
        self.frozen = self.last;
    }

    /// Ends [`freeze`](Self::freeze): `cull` uses the views passed to it again. Does nothing if the pipeline
    /// is not frozen.
    pub fn unfreeze(&mut self) {
        self.frozen = None;
    }

    /// Returns the view that culling is [frozen](Self::freeze) at, or `None` if `cull` uses the views passed
    /// to it.
    pub fn frozen(&self) -> Option<&View> {
        self.frozen.as_ref()
    }
}

impl core::fmt::Debug for Pipeline {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.stages()).finish()
    }
}
