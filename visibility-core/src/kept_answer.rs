//! The answer of a frame that later frames keep while their views are within its region.
//!
//! An answer depends on the scene, on the view and on what the stages of the pipeline draw from. It is kept
//! with a cursor into the scene, with the region of views that it is good for, and with the stamp of the set
//! that holds it; the pipeline asks its stages for the rest. If any of these differs, the answer is dropped.

use crate::scene::SceneCursor;
use crate::stamp::Stamp;
use crate::view::{Reach, ViewRegion};
use crate::{Scene, View, VisibleSet};

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
}

impl KeptAnswer {
    /// Makes a place for answers of the given reach, with none in it.
    pub(crate) fn new(reach: Reach) -> Self {
        Self { reach, region: None, scene: SceneCursor::START, set: Stamp::NONE, is_kept: false }
    }

    /// Returns whether the last frame kept the answer.
    pub(crate) fn is_kept(&self) -> bool {
        self.is_kept
    }

    /// Returns the views that the answer is good for.
    pub(crate) fn region(&self) -> Option<&ViewRegion> {
        self.region.as_ref()
    }

    /// Drops the answer.
    pub(crate) fn forget(&mut self) {
        (self.region, self.is_kept) = (None, false);
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

    /// Returns the region to cull for in a frame of `view`, after one of the view `before`. `None` to cull for
    /// this view alone: in the first frame, after a cut, and while the camera is too fast for the reach.
    pub(crate) fn region_around(&self, view: &View, before: Option<&View>) -> Option<ViewRegion> {
        let region = ViewRegion::around(view, self.reach)?;
        before.is_some_and(|before| region.contains(before)).then_some(region)
    }

    /// Keeps the answer of a frame that has culled for `region`.
    pub(crate) fn keep(&mut self, region: Option<ViewRegion>, scene: &Scene, visible: &VisibleSet) {
        (self.region, self.scene, self.set) = (region, SceneCursor::at(scene), visible.result_stamp());
    }
}
