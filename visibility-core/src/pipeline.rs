//! Runs the cullers of one view in sequence, with tools that show which culler removed an object.

use crate::kept_answer::KeptAnswer;
use crate::spans;
use crate::view::{Reach, ViewRegion};
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
    /// The answer that later frames may keep; `None` without a reach.
    kept: Option<KeptAnswer>,
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

    /// Makes each answer good for a while: it is made for all views within `reach` of the frame's view, and
    /// frames whose view is within that reach keep it and do no work. [`Reach::new(0.0, 0.0)`](Reach::new)
    /// keeps answers while the camera stands still; `None`, the default, culls in every frame.
    ///
    /// An answer is kept only if nothing that it depends on has changed: the scene, the set `visible`, the
    /// layers, window, near and far distance of the view, the stages, and what the stages
    /// [share](Culler::answer_holds) with the engine. A frame culls as without a reach if the camera has
    /// moved or turned by more than the reach since the frame before, if the scene has changed since then,
    /// and for views that have [no region](ViewRegion::around). If a stage has no answer for a
    /// [region](Culler::cull_region), the frame and the next 15 cull as without a reach: a pipeline with such
    /// a stage gains nothing.
    ///
    /// More objects are reported than in a frame that culls for its own view, since the set holds the objects
    /// that any view of the region sees.
    ///
    /// ```
    /// use visibility_core::{FrustumCuller, Pipeline, view::Reach};
    /// # use visibility_core::{glam::DVec3, Pose, Scene, View, VisibleSet};
    /// # let (scene, mut visible) = (Scene::new(), VisibleSet::new());
    /// let reach = Reach::new(0.15, 9f64.to_radians());
    /// let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with_reach(Some(reach));
    /// for frame in 0..5 {
    ///     let eye = DVec3::X * (0.023 * f64::from(frame));
    ///     let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
    ///     let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY)?;
    ///     pipeline.cull(&scene, &view, &mut visible);
    ///     // The first frame knows nothing of the camera's speed.
    ///     assert_eq!(pipeline.is_kept(), frame > 1);
    /// }
    /// # Ok::<(), visibility_core::view::ViewError>(())
    /// ```
    #[must_use]
    pub fn with_reach(mut self, reach: Option<Reach>) -> Self {
        self.set_reach(reach);
        self
    }

    /// Sets the reach as [`with_reach`](Self::with_reach) does. The next frame culls.
    /// Does nothing if the reach is the present one.
    pub fn set_reach(&mut self, reach: Option<Reach>) {
        if reach != self.kept.as_ref().map(KeptAnswer::reach) {
            self.kept = reach.map(KeptAnswer::new);
        }
    }

    /// Returns whether the last frame kept the answer of an earlier one. False without a reach.
    pub fn is_kept(&self) -> bool {
        self.kept.as_ref().is_some_and(KeptAnswer::is_kept)
    }

    /// Returns the region that the present answer is good for; `None` if it is good for one view alone.
    pub fn region(&self) -> Option<&ViewRegion> {
        self.kept.as_ref()?.region()
    }

    /// Appends a culler as the last stage.
    pub fn push(&mut self, culler: Box<dyn Culler + Send + Sync>) {
        self.stages.push((culler, CullStats::default()));
        self.forget_answer();
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
        self.run(None, scene, view, visible)
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
        self.run(Some(jobs), scene, view, visible)
    }

    /// Makes the next frame cull.
    fn forget_answer(&mut self) {
        if let Some(kept) = &mut self.kept {
            kept.forget();
        }
    }

    /// Fills `visible` and lets each stage cull, for a region if one is given. Returns the sum of the
    /// counters; `None` if a stage has no answer for the region.
    fn run_stages(
        &mut self,
        jobs: Option<&dyn Jobs>,
        scene: &Scene,
        view: &View,
        region: Option<&ViewRegion>,
        visible: &mut VisibleSet,
    ) -> Option<CullStats> {
        visible.fill(scene, view);
        if let Some(removals) = &mut self.removals {
            removals.begin(scene, visible);
        }
        let mut sum = CullStats::default();
        for (place, (culler, stats)) in self.stages.iter_mut().enumerate() {
            let span = spans::stage(culler.name());
            let answer = span.within(|| match (region, jobs) {
                (Some(region), _) => culler.cull_region(jobs, scene, region, visible),
                (None, Some(jobs)) => Some(culler.cull_on(jobs, scene, view, visible)),
                (None, None) => Some(culler.cull(scene, view, visible)),
            });
            *stats = answer?;
            span.record_stage(stats);
            sum += *stats;
            if let Some(removals) = &mut self.removals {
                removals.after_stage(place, scene, visible);
            }
        }
        Some(sum)
    }

    /// Runs a frame as [`answer`](Self::answer) does, within its span.
    fn run(
        &mut self,
        jobs: Option<&dyn Jobs>,
        scene: &Scene,
        view: &View,
        visible: &mut VisibleSet,
    ) -> CullStats {
        let span = spans::frame();
        let sum = span.within(|| self.answer(jobs, scene, view, visible));
        span.record_frame(self.is_kept(), sum.visible);
        sum
    }

    /// Fills `visible`, lets each stage cull and finishes `visible`, unless the answer of an earlier frame is
    /// kept. Returns the sum of the counters.
    fn answer(
        &mut self,
        jobs: Option<&dyn Jobs>,
        scene: &Scene,
        view: &View,
        visible: &mut VisibleSet,
    ) -> CullStats {
        if self.frozen.is_some() {
            self.draws_other_view();
        }
        let view = &self.frozen.unwrap_or(*view);
        let before = self.last.replace(*view);
        let mut region = None;
        if let Some(kept) = &mut self.kept {
            let holds = self.stages.iter().all(|(culler, _)| culler.answer_holds());
            if kept.holds(holds, scene, view, visible) {
                for (_, stats) in &mut self.stages {
                    *stats = CullStats::default().with_visible(stats.visible);
                }
                visible.repeat(scene);
                return CullStats::default().with_visible(visible.count(scene) as u64);
            }
            region = kept.region_around(scene, view, before.as_ref());
        }
        let of_region =
            region.as_ref().and_then(|region| self.run_stages(jobs, scene, view, Some(region), visible));
        if let (Some(_), None, Some(kept)) = (&region, &of_region, &mut self.kept) {
            kept.refuse();
            region = None;
        }
        let of_view = || self.run_stages(jobs, scene, view, None, visible);
        let mut sum = of_region.or_else(of_view).unwrap_or_default();
        visible.finish(scene);
        if let Some(kept) = &mut self.kept {
            kept.keep(region, scene, visible);
        }
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
    /// by draw range or size: what is hidden behind them is then missing. Where a stage removes [small
    /// objects](Culler::follows_sizes), names each stage that hides behind always drawn objects [whether or
    /// not they are in the set](Culler::hides_behind_undrawn): behind many small ones, such as the panels of
    /// a distant tower, objects are missing. Does not call `each` if nothing is lacking.
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
        let is_sized = !scene.is_empty() && self.stages.iter().any(|(culler, _)| culler.follows_sizes());
        for (culler, _) in self.stages.iter().filter(|(culler, _)| is_sized && culler.hides_behind_undrawn())
        {
            let what = "objects that may be hidden behind others that a stage removes as too small";
            each(culler.name(), Lack { what, count: scene.len() });
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
        self.forget_answer();
    }

    /// Starts (`true`) or stops (`false`) recording which stage removes which object; takes effect with the
    /// next frame. Records made so far are dropped. While recording, each frame costs time and memory in
    /// proportion to the number of objects of the scene.
    pub fn set_explaining(&mut self, explaining: bool) {
        self.removals = explaining.then(Removals::default);
        self.forget_answer();
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
    /// their current bounds. A stage that [asks the engine](crate::occlusion::HardwareQueries) about what is
    /// drawn hides nothing meanwhile, since the answers are about the other viewpoint. Does nothing before
    /// the first frame.
    pub fn freeze(&mut self) {
        self.frozen = self.last;
    }

    /// Ends [`freeze`](Self::freeze): `cull` uses the views passed to it again. Does nothing if the pipeline
    /// is not frozen.
    pub fn unfreeze(&mut self) {
        if self.frozen.take().is_some() {
            self.draws_other_view();
        }
    }

    /// Tells each stage that answers of the engine are about another view.
    fn draws_other_view(&mut self) {
        self.stages.iter_mut().for_each(|(culler, _)| culler.draws_other_view());
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
