//! The answer of a frame that later frames keep while their views are within its region.
//!
//! An answer depends on the scene, on the view and on what the stages of the pipeline draw from. It is kept
//! with a cursor into the scene, with the region of views that it is good for, and with the stamp of the set
//! that holds it; the pipeline asks its stages for the rest. If any of these differs, the answer is dropped.

use crate::scene::SceneCursor;
use crate::stamp::Stamp;
use crate::view::{Reach, ViewRegion};
use crate::{Scene, View, VisibleSet};

/// Number of frames that cull for their own view after one in which a stage had no answer for a region:
/// trying costs up to a frame's work.
const PAUSE: u8 = 15;

/// The answer of a frame, with all that it depends on.
pub(crate) struct KeptAnswer {
    /// How far the camera may be from the view of the frame that culled.
    reach: Reach,
    /// Views that the answer is good for; `None` if it is good for none but that of its own frame.
    region: Option<ViewRegion>,
    /// State of the scene that the answer was made from.
    scene: SceneCursor,
    /// Stamp of the set that holds the answer.
    set: Stamp,
    /// Whether the last frame kept the answer.
    is_kept: bool,
    /// Number of frames until a region is tried again, after a stage that had no answer for one.
    pause: u8,
}

impl KeptAnswer {
    /// Makes a place for answers of the given reach, with none in it.
    pub(crate) fn new(reach: Reach) -> Self {
        Self { reach, region: None, scene: SceneCursor::START, set: Stamp::NONE, is_kept: false, pause: 0 }
    }

    /// Returns whether the last frame kept the answer.
    pub(crate) fn is_kept(&self) -> bool {
        self.is_kept
    }

    /// Returns the views that the answer is good for.
    pub(crate) fn region(&self) -> Option<&ViewRegion> {
        self.region.as_ref()
    }

    /// Returns the reach of the answers.
    pub(crate) fn reach(&self) -> Reach {
        self.reach
    }

    /// Drops the answer. The next frame is as a first one: it culls for its own view.
    pub(crate) fn forget(&mut self) {
        *self = Self::new(self.reach);
    }

    /// Returns whether the answer, which `visible` must hold, is good for `view` of `scene`, and records
    /// that. `holds` tells whether all stages say so.
    pub(crate) fn holds(&mut self, holds: bool, scene: &Scene, view: &View, visible: &VisibleSet) -> bool {
        self.is_kept = holds
            && self.scene.is_current(scene)
            && self.set != Stamp::NONE
            && self.set == visible.result_stamp()
            && self.region.as_ref().is_some_and(|region| region.contains(view));
        self.is_kept
    }

    /// Returns the region to cull for in a frame of `view`, after one of the view `before`. `None` to cull
    /// for this view alone: in the first frame, after a cut, while the camera is too fast for the reach,
    /// while the scene changes from one frame to the next, and for some frames after a stage had no answer.
    pub(crate) fn region_around(
        &mut self,
        scene: &Scene,
        view: &View,
        before: Option<&View>,
    ) -> Option<ViewRegion> {
        if self.pause > 0 || !self.scene.is_current(scene) {
            self.pause = self.pause.saturating_sub(1);
            return None;
        }
        let region = ViewRegion::around(view, self.reach)?;
        before.is_some_and(|before| region.contains(before)).then_some(region)
    }

    /// Records that a stage had no answer for a region, so that the frames to come do not try in vain.
    pub(crate) fn refuse(&mut self) {
        self.pause = PAUSE;
    }

    /// Keeps the answer of a frame that has culled for `region`.
    pub(crate) fn keep(&mut self, region: Option<ViewRegion>, scene: &Scene, visible: &VisibleSet) {
        (self.region, self.scene, self.set) = (region, SceneCursor::at(scene), visible.result_stamp());
    }
}
