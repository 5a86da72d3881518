//! Contribution culling as a stage whose settings change from frame to frame.

use std::sync::{Arc, Mutex, PoisonError};
use visibility_core::glam::DVec3;
use visibility_core::{Accuracy, CullStats, Culler, Scene, View, VisibleSet};
use visibility_frame::lod::ContributionCuller;

/// Settings of a stage: the height of the pictures and the least size in pixels, and the point that distances
/// are measured from, `None` for the view's own eye.
#[derive(Debug)]
pub(crate) struct Contribution(Mutex<(f64, f64, Option<DVec3>)>);

impl Contribution {
    /// Sets what the next frame culls by.
    pub(crate) fn set(&self, picture_height: f64, min_pixels: f64, distance_eye: Option<DVec3>) {
        let settings = (picture_height, min_pixels, distance_eye);
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = settings;
    }

    /// Sets a culler to these settings. Distances are measured from `eye` if the settings have no point; with
    /// neither, from the view's own eye.
    pub(crate) fn apply(&self, culler: &mut ContributionCuller, eye: Option<DVec3>) {
        let (picture_height, min_pixels, distance_eye) =
            *self.0.lock().unwrap_or_else(PoisonError::into_inner);
        culler.set_picture_height(picture_height);
        culler.set_min_pixels(min_pixels);
        culler.set_distance_eye(distance_eye.or(eye));
    }
}

/// Settings of the contribution culling that was added last to a pipeline. `None` if there is none.
#[derive(Debug, Default)]
pub(crate) struct LastContribution(Mutex<Option<Arc<Contribution>>>);

impl LastContribution {
    pub(crate) fn get(&self) -> Option<Arc<Contribution>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub(crate) fn set(&self, settings: Arc<Contribution>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(settings);
    }
}

/// A [`ContributionCuller`] that takes its settings anew in each frame.
pub(crate) struct FollowingContribution {
    culler: ContributionCuller,
    settings: Arc<Contribution>,
}

impl FollowingContribution {
    /// Returns a stage and its settings, by which distances are measured from the view's own eye.
    pub(crate) fn new(picture_height: f64, min_pixels: f64) -> (Self, Arc<Contribution>) {
        let settings = Arc::new(Contribution(Mutex::new((picture_height, min_pixels, None))));
        let culler = ContributionCuller::new(picture_height, min_pixels);
        (Self { culler, settings: settings.clone() }, settings)
    }
}

impl Culler for FollowingContribution {
    fn name(&self) -> &str {
        self.culler.name()
    }

    fn accuracy(&self) -> Accuracy {
        self.culler.accuracy()
    }

    fn follows_draw_ranges(&self) -> bool {
        self.culler.follows_draw_ranges()
    }

    fn follows_sizes(&self) -> bool {
        // By the settings of the next frame: the culler has those of the last.
        let mut culler = ContributionCuller::new(0.0, 0.0);
        self.settings.apply(&mut culler, None);
        culler.follows_sizes()
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        self.settings.apply(&mut self.culler, None);
        self.culler.cull(scene, view, visible)
    }

    fn reset(&mut self) {
        self.culler.reset();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_followed_by_the_settings_of_the_next_frame() {
        let (culler, settings) = FollowingContribution::new(1080.0, 0.0);
        assert!(!culler.follows_sizes(), "no object is too small");
        settings.set(1080.0, 2.0, None);
        assert!(culler.follows_sizes(), "from the next frame on, small objects are removed");
        settings.set(0.0, 2.0, None);
        assert!(!culler.follows_sizes(), "without a height of the picture, no object is too small");
    }
}
