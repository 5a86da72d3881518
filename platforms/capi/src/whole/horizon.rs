//! Horizon culling as a stage that finds the solids of its scene by itself.

use std::sync::Arc;
use visibility_2d::horizon::{HorizonCuller, HorizonOccluders, UpAxis};
use visibility_core::culler::Lack;
use visibility_core::scene::SceneCursor;
use visibility_core::{Accuracy, CullStats, Culler, Scene, View, VisibleSet};

/// A [`HorizonCuller`] whose occluders follow the scene of each frame.
pub(crate) struct FollowingHorizon {
    culler: HorizonCuller,
    /// Occluders of the culler. Shared with it between frames.
    occluders: Arc<HorizonOccluders>,
    /// State of the scene that the occluders were last synchronised with.
    cursor: SceneCursor,
    up: UpAxis,
}

impl FollowingHorizon {
    /// Makes a stage without occluders, which the first frame finds.
    pub(crate) fn new(up: UpAxis) -> Self {
        let occluders = Arc::new(HorizonOccluders::new(&Scene::new(), up));
        let culler = HorizonCuller::new(occluders.clone());
        Self { culler, occluders, cursor: SceneCursor::START, up }
    }
}

impl Culler for FollowingHorizon {
    fn name(&self) -> &str {
        self.culler.name()
    }

    fn accuracy(&self) -> Accuracy {
        self.culler.accuracy()
    }

    fn hides_behind_objects(&self) -> bool {
        self.culler.hides_behind_objects()
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        if !self.cursor.is_current(scene) {
            // The culler lets go of the occluders while they change, so that they are not copied.
            self.culler.set_occluders(Arc::new(HorizonOccluders::new(&Scene::new(), self.up)));
            Arc::make_mut(&mut self.occluders).sync(scene);
            self.culler.set_occluders(self.occluders.clone());
            self.cursor = SceneCursor::at(scene);
        }
        self.culler.cull(scene, view, visible)
    }

    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        self.culler.for_each_lack(scene, each);
    }
}
