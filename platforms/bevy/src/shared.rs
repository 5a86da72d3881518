//! Culler shared between a pipeline and the game.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use visibility_core::culler::Lack;
use visibility_core::jobs::Jobs;
use visibility_core::view::ViewRegion;
use visibility_core::{Accuracy, CullStats, Culler, Scene, View, VisibleSet};

/// Handle to a culler in a [`CullingPipeline`](crate::CullingPipeline) that the game keeps, to open doors,
/// change settings or read results. Clones are handles to the same culler. Culling for a camera locks it.
pub struct Shared<C> {
    name: Arc<str>,
    culler: Arc<Mutex<C>>,
}

impl<C: Culler> Shared<C> {
    /// Creates the first handle to a culler.
    pub fn new(culler: C) -> Self {
        Self { name: culler.name().into(), culler: Arc::new(Mutex::new(culler)) }
    }

    /// Locks the culler for exclusive access. Waits while another handle is in use.
    pub fn lock(&self) -> MutexGuard<'_, C> {
        // A panic does not make a culler unusable, since its stored state never hides a visible object.
        self.culler.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<C> Clone for Shared<C> {
    fn clone(&self) -> Self {
        Self { name: self.name.clone(), culler: self.culler.clone() }
    }
}

impl<C: Culler> Culler for Shared<C> {
    fn name(&self) -> &str {
        &self.name
    }

    fn accuracy(&self) -> Accuracy {
        self.lock().accuracy()
    }

    fn hides_behind_undrawn(&self) -> bool {
        self.lock().hides_behind_undrawn()
    }

    fn follows_sizes(&self) -> bool {
        self.lock().follows_sizes()
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        self.lock().cull(scene, view, visible)
    }

    fn cull_on(
        &mut self,
        jobs: &dyn Jobs,
        scene: &Scene,
        view: &View,
        visible: &mut VisibleSet,
    ) -> CullStats {
        self.lock().cull_on(jobs, scene, view, visible)
    }

    fn cull_region(
        &mut self,
        jobs: Option<&dyn Jobs>,
        scene: &Scene,
        region: &ViewRegion,
        visible: &mut VisibleSet,
    ) -> Option<CullStats> {
        self.lock().cull_region(jobs, scene, region, visible)
    }

    fn answer_holds(&self) -> bool {
        self.lock().answer_holds()
    }

    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        self.lock().for_each_lack(scene, each);
    }

    fn hides_behind_objects(&self) -> bool {
        self.lock().hides_behind_objects()
    }

    fn follows_draw_ranges(&self) -> bool {
        self.lock().follows_draw_ranges()
    }

    fn draws_other_view(&mut self) {
        self.lock().draws_other_view();
    }

    fn reset(&mut self) {
        self.lock().reset();
    }
}
