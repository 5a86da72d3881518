//! Cullers one after another.

use crate::{Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet};
use alloc::{boxed::Box, vec::Vec};

/// A list of cullers, each of which sees what those before it left. This is what an engine calls once per
/// frame and view.
///
/// To understand what it does, let it [explain](Self::set_explaining) which stage removed which object, or
/// [freeze](Self::freeze) its view and look at the result from elsewhere.
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
    stages: Vec<(Box<dyn Culler + Send>, CullStats)>,
    /// The view of the last frame.
    last: Option<View>,
    frozen: Option<View>,
    /// Present while explaining.
    removals: Option<Removals>,
}

/// Why an object is in the set or not.
///
/// ```
/// use visibility_core::pipeline::Explanation;
/// assert_eq!(Explanation::RemovedBy("frustum").to_string(), "removed by frustum");
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Explanation<'a> {
    /// No stage removed it.
    Visible,
    /// It shares no layer with the view.
    OnOtherLayers,
    /// This stage removed it.
    RemovedBy(&'a str),
    /// It was not there in the last frame, or nothing was noted then.
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

/// For each object of a frame, the stage that removed it.
#[derive(Default)]
struct Removals {
    /// By index: the object of the last frame that had it, and how far it came.
    fates: Vec<Option<(ObjectId, Fate)>>,
    /// What was still there before the stage at hand.
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
    /// No stage: everything on the view's layers is visible.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a stage at the end.
    pub fn with(mut self, culler: impl Culler + Send + 'static) -> Self {
        self.push(Box::new(culler));
        self
    }

    /// Adds a stage at the end.
    pub fn push(&mut self, culler: Box<dyn Culler + Send>) {
        self.stages.push((culler, CullStats::default()));
    }

    /// What all stages together promise.
    pub fn accuracy(&self) -> Accuracy {
        self.stages.iter().fold(Accuracy::Conservative, |all, (culler, _)| all.and(culler.accuracy()))
    }

    /// Fills `visible` with the objects on the view's layers and lets each stage remove what it can. What is
    /// left is drawn.
    ///
    /// Returns the sum of the stages' counters.
    pub fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let view = self.frozen.as_ref().unwrap_or(view);
        self.last = Some(*view);
        visible.fill(scene, view);
        if let Some(removals) = &mut self.removals {
            removals.begin(scene, visible);
        }
        let mut sum = CullStats::default();
        for (place, (culler, stats)) in self.stages.iter_mut().enumerate() {
            *stats = culler.cull(scene, view, visible);
            sum += *stats;
            if let Some(removals) = &mut self.removals {
                removals.after_stage(place, scene, visible);
            }
        }
        if self.stages.is_empty() {
            sum.visible = visible.count(scene) as u64;
        }
        visible.finish(scene);
        sum
    }

    /// Name and counters of each stage in the last frame.
    pub fn stages(&self) -> impl Iterator<Item = (&str, CullStats)> {
        self.stages.iter().map(|(culler, stats)| (culler.name(), *stats))
    }

    /// Lets every stage forget what it remembers of earlier frames.
    pub fn reset(&mut self) {
        for (culler, _) in &mut self.stages {
            culler.reset();
        }
    }

    /// Notes from the next frame on which stage removes which object, or stops doing so. While on, a frame
    /// costs time and memory for every object of the scene; while off, nothing.
    pub fn set_explaining(&mut self, explaining: bool) {
        self.removals = explaining.then(Removals::default);
    }

    /// What became of an object in the last frame, if the pipeline was [explaining](Self::set_explaining).
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

    /// Goes on culling for the view of the last frame, whatever views come: draw from elsewhere, and look at
    /// what was culled. Objects that move meanwhile are culled where they are. Before the first frame
    /// there is nothing to freeze, and nothing happens.
    pub fn freeze(&mut self) {
        self.frozen = self.last;
    }

    /// Culls for the views that come again.
    pub fn unfreeze(&mut self) {
        self.frozen = None;
    }

    /// The view that culling is frozen at.
    pub fn frozen(&self) -> Option<&View> {
        self.frozen.as_ref()
    }
}

impl core::fmt::Debug for Pipeline {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.stages()).finish()
    }
}
