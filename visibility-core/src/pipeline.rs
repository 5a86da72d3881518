//! Cullers one after another.

use crate::{Accuracy, CullStats, Culler, Scene, View, VisibleSet};
use alloc::{boxed::Box, vec::Vec};

/// A list of cullers, each of which sees what those before it left. This is what an engine calls once per frame and view.
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
/// # Ok::<(), visibility_core::ViewError>(())
/// ```
#[derive(Default)]
pub struct Pipeline {
    stages: Vec<(Box<dyn Culler + Send>, CullStats)>,
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

    /// Fills `visible` with the objects on the view's layers and lets each stage remove what it can. What is left is drawn.
    ///
    /// Returns the sum of the stages' counters.
    pub fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        visible.fill(scene, view);
        let mut sum = CullStats::default();
        if self.stages.is_empty() {
            sum.visible = visible.count(scene) as u64;
        }
        for (culler, stats) in &mut self.stages {
            *stats = culler.cull(scene, view, visible);
            sum += *stats;
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
}

impl core::fmt::Debug for Pipeline {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.stages()).finish()
    }
}
