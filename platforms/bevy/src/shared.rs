//! A culler that its pipeline shares with the game.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use visibility_core::culler::Lack;
use visibility_core::jobs::Jobs;
use visibility_core::{Accuracy, CullStats, Culler, Scene, View, VisibleSet};

/// A culler in a [`CullingPipeline`](crate::CullingPipeline) that the game keeps a handle to: to open doors,
/// to change settings, to read what it found. Clones are handles to one culler. Culling for a camera locks
/// it.
pub struct Shared<C> {
    name: Arc<str>,
    culler: Arc<Mutex<C>>,
}

impl<C: Culler> Shared<C> {
    /// Makes the first handle.
    pub fn new(culler: C) -> Self {
        Self { name: culler.name().into(), culler: Arc::new(Mutex::new(culler)) }
    }

    /// Waits until no other handle is in use, and gives access to the culler.
    pub fn lock(&self) -> MutexGuard<'_, C> {
        // A culler that panicked is no more wrong than before: what it keeps never hides what is visible.
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

    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        self.lock().for_each_lack(scene, each);
    }

    fn follows_draw_ranges(&self) -> bool {
        self.lock().follows_draw_ranges()
    }

    fn reset(&mut self) {
        self.lock().reset();
    }
}
