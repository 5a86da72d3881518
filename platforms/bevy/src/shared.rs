//! Culler shared between a pipeline and the game.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use visibility_core::culler::Lack;
use visibility_core::jobs::Jobs;
use visibility_core::stamp::Stamp;
use visibility_core::view::ViewRegion;
use visibility_core::{Accuracy, CullStats, Culler, Scene, View, VisibleSet};

/// Handle to a culler in a [`CullingPipeline`](crate::CullingPipeline) that the game keeps, to open doors,
/// change settings or read results. Clones are handles to the same culler. Culling for a camera locks it.
///
/// With a [reach](visibility_core::Pipeline::with_reach), [`lock`](Self::lock) ends all kept answers,
/// whatever it is for. So does culling by the same culler in another pipeline: those that share one keep no
/// answers.
pub struct Shared<C> {
    name: Arc<str>,
    shared: Arc<Locks<C>>,
    /// Stamp of this handle's last answer for a region; [`Stamp::NONE`] if there is none.
    own_answer: Stamp,
}

/// What all handles to a culler share.
struct Locks<C> {
    culler: Mutex<C>,
    /// Stamp of the culler's last answer for a region, for whatever handle; [`Stamp::NONE`] if the culler has
    /// been locked for anything else since that may change it. Changed by those alone who hold the lock of
    /// the culler.
    answer: Mutex<Stamp>,
}

impl<C> Locks<C> {
    fn culler(&self) -> MutexGuard<'_, C> {
        // A panic does not make a culler unusable, since its stored state never hides a visible object.
        self.culler.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn answer(&self) -> MutexGuard<'_, Stamp> {
        self.answer.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<C: Culler> Shared<C> {
    /// Creates the first handle to a culler.
    pub fn new(culler: C) -> Self {
        let name = culler.name().into();
        let shared = Arc::new(Locks { culler: Mutex::new(culler), answer: Mutex::new(Stamp::NONE) });
        Self { name, shared, own_answer: Stamp::NONE }
    }

    /// Locks the culler for exclusive access. Waits while another handle is in use.
    pub fn lock(&self) -> MutexGuard<'_, C> {
        let culler = self.shared.culler();
        // Through the guard, the game may put back a culler that has answered before, sources and all.
        *self.shared.answer() = Stamp::NONE;
        culler
    }
}

impl<C> Clone for Shared<C> {
    fn clone(&self) -> Self {
        Self { name: self.name.clone(), shared: self.shared.clone(), own_answer: Stamp::NONE }
    }
}

impl<C: Culler> Culler for Shared<C> {
    fn name(&self) -> &str {
        &self.name
    }

    fn accuracy(&self) -> Accuracy {
        self.shared.culler().accuracy()
    }

    fn hides_behind_undrawn(&self) -> bool {
        self.shared.culler().hides_behind_undrawn()
    }

    fn follows_sizes(&self) -> bool {
        self.shared.culler().follows_sizes()
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
        let mut culler = self.shared.culler();
        // Answers of other handles end: the culler knows its last answer alone.
        self.own_answer = Stamp::new();
        *self.shared.answer() = self.own_answer;
        culler.cull_region(jobs, scene, region, visible)
    }

    fn answer_holds(&self) -> bool {
        let culler = self.shared.culler();
        let is_own = self.own_answer != Stamp::NONE && self.own_answer == *self.shared.answer();
        is_own && culler.answer_holds()
    }

    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        self.shared.culler().for_each_lack(scene, each);
    }

    fn hides_behind_objects(&self) -> bool {
        self.shared.culler().hides_behind_objects()
    }

    fn follows_draw_ranges(&self) -> bool {
        self.shared.culler().follows_draw_ranges()
    }

    fn draws_other_view(&mut self) {
        self.shared.culler().draws_other_view();
    }

    fn reset(&mut self) {
        self.lock().reset();
    }
}
