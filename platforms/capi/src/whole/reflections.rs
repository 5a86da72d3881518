//! Reflections in the mirrors of cells: what to draw in each mirror that a view sees.

use super::cells::vis_cells;
use crate::contribution::LastContribution;
use crate::error::{Error, border, vis_status};
use crate::pipeline::{push, vis_pipeline};
use crate::pointer::{buffer, create, destroy, out, reference};
use crate::view::vis_view;
use crate::visible::vis_visible;
use std::sync::{Arc, Mutex, MutexGuard};
use visibility_core::culler::Lack;
use visibility_core::glam::DVec3;
use visibility_core::jobs::Jobs;
use visibility_core::view::{Eye, ViewRegion};
use visibility_core::{Accuracy, CullStats, Culler, Scene, View, VisibleSet};
use visibility_frame::lod::ContributionCuller;
use visibility_portals::{PortalEye, Reflection, SharedPortalCuller};

/// Portal culling of one view with reflections in mirrors. Its functions wait for one another and for frames
/// of the pipeline, so they never return `VIS_ERROR_BUSY` because of it.
pub struct vis_reflections(Arc<Mutex<SharedPortalCuller>>);

impl vis_reflections {
    fn lock(&self) -> Result<MutexGuard<'_, SharedPortalCuller>, Error> {
        let message = "an earlier call with these reflections failed inside: destroy them";
        self.0.lock().map_err(|_| Error::new(vis_status::VIS_ERROR_PANIC, message))
    }
}

/// Portal culling of a pipeline that shares its eye with a handle. Hides nothing once a panic has left it.
struct ReflectingCuller {
    portals: Arc<Mutex<SharedPortalCuller>>,
    contribution: Arc<LastContribution>,
    /// Contribution culling of the views in mirrors.
    in_mirrors: ContributionCuller,
}

impl Culler for ReflectingCuller {
    fn name(&self) -> &str {
        "portals"
    }

    fn accuracy(&self) -> Accuracy {
        self.portals.lock().map_or(Accuracy::Conservative, |culler| culler.accuracy())
    }

    fn hides_behind_undrawn(&self) -> bool {
        self.portals.lock().map_or(true, |culler| culler.hides_behind_undrawn())
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let Ok(mut culler) = self.portals.lock() else { return visible.retain(scene, |_, _| true) };
        let stats = culler.cull(scene, view, visible);
        if let Some(settings) = self.contribution.get() {
            // Mirrors show the levels that the camera shows, so distances are measured from its eye.
            let eye = match view.eye(DVec3::ZERO) {
                Eye::Point(eye) => Some(eye),
                Eye::Direction(_) => None,
            };
            settings.apply(&mut self.in_mirrors, eye);
            culler.cull_reflections(scene, &mut self.in_mirrors);
        }
        stats
    }

    fn cull_region(
        &mut self,
        jobs: Option<&dyn Jobs>,
        scene: &Scene,
        region: &ViewRegion,
        visible: &mut VisibleSet,
    ) -> Option<CullStats> {
        self.portals.lock().ok()?.cull_region(jobs, scene, region, visible)
    }

    fn answer_holds(&self) -> bool {
        self.portals.lock().is_ok_and(|culler| culler.answer_holds())
    }

    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        match self.portals.lock() {
            Ok(culler) => culler.for_each_lack(scene, each),
            Err(_) => each(Lack { what: "objects not culled, for want of usable cells", count: scene.len() }),
        }
    }

    fn reset(&mut self) {
        self.in_mirrors.reset();
        if let Ok(mut culler) = self.portals.lock() {
            culler.reset();
        }
    }
}

/// Number of no reflection: the parent of a reflection in a mirror that the eye sees itself.
pub const VIS_NO_REFLECTION: u32 = 0xFFFF_FFFF;

/// A mirror that is seen in a frame.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct vis_reflection {
    /// Number of the mirror, as `vis_cells_add_mirror` wrote it.
    pub mirror: u32,
    /// Number of the reflection in which the mirror is seen; `VIS_NO_REFLECTION` if the eye sees it itself.
    pub parent: u32,
    /// Number of mirrors along the lines of sight: 1 if the eye sees the mirror itself.
    pub depth: u32,
}

impl From<&Reflection> for vis_reflection {
    fn from(one: &Reflection) -> Self {
        let parent = one.parent().and_then(|parent| u32::try_from(parent).ok());
        Self { mirror: one.mirror().0, parent: parent.unwrap_or(VIS_NO_REFLECTION), depth: one.depth() }
    }
}

/// Creates reflections of one view in the mirrors of cells, at most `max_count` in a frame and at most
/// `max_depth` mirrors along a line of sight: 8 and 2 are usual, with 1 mirrors in mirrors are left out. The
/// cells live as long as these reflections, even if destroyed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_reflections_create(
    cells: *const vis_cells,
    max_count: usize,
    max_depth: u32,
    reflections: *mut *mut vis_reflections,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (cells, place) = unsafe { (reference(cells, "cells")?, out(reflections, "reflections")?) };
        let eye = PortalEye::new().with_reflections(max_count, max_depth);
        let culler = SharedPortalCuller::new(cells.shared()).with_eye(eye);
        create(place, vis_reflections(Arc::new(Mutex::new(culler))));
        Ok(())
    })
}

/// Destroys reflections; a pipeline that uses them keeps them alive. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_reflections_destroy(reflections: *mut vis_reflections) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(reflections) }
}

/// Appends portal culling as `vis_pipeline_add_portals` does, which also finds the reflections. They are
/// those of the pipeline's last frame, so each pipeline needs reflections of its own: returns
/// `VIS_ERROR_STATE` if a pipeline has these. Conservative. If the pipeline has contribution culling, it
/// culls what mirrors show as well, by sizes in the mirror and distances from the eye of the camera, so that
/// mirrors show the objects that the camera shows.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_reflections(
    pipeline: *mut vis_pipeline,
    reflections: *const vis_reflections,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (reflections, of) =
            unsafe { (reference(reflections, "reflections")?, reference(pipeline, "pipeline")?) };
        let portals = {
            // Locked, so that two threads cannot both find the handle alone.
            let _alone = reflections.lock()?;
            if Arc::strong_count(&reflections.0) > 1 {
                let message = "a pipeline has these reflections: create others for each pipeline";
                return Err(Error::new(vis_status::VIS_ERROR_STATE, message));
            }
            reflections.0.clone()
        };
        let (contribution, in_mirrors) = (of.contribution().clone(), ContributionCuller::new(0.0, 0.0));
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        unsafe { push(pipeline, ReflectingCuller { portals, contribution, in_mirrors }) }
    })
}

/// Writes the reflections of the last frame, like `vis_visible_ids`. They are numbered from 0 in this order;
/// each comes after the one that it is seen in. None before the first frame. In the next frame, a number may
/// be that of another mirror: levels of detail of a mirror need a `vis_lods` for each chain of mirrors, from
/// `parent` to `parent`, or `vis_lods_reset` before each other chain.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_reflections_list(
    reflections: *const vis_reflections,
    list: *mut vis_reflection,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (reflections, list) =
            unsafe { (reference(reflections, "reflections")?, buffer(list, capacity, count)?) };
        let culler = reflections.lock()?;
        let all = culler.eye().reflections();
        list.fill(all.len(), all.iter().map(vis_reflection::from))
    })
}

/// Writes how many mirrors were seen in the last frame and have no reflection, since there were more than
/// `vis_reflections_create` allows, or since the reflected matrix was no view. Also counts each mirror that
/// has a reflection in which no mirrors are looked for, since its eye is unknown.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_reflections_left_out(
    reflections: *const vis_reflections,
    count: *mut u32,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (reflections, mut place) =
            unsafe { (reference(reflections, "reflections")?, out(count, "count")?) };
        place.set(reflections.lock()?.eye().stats().reflections_left_out);
        Ok(())
    })
}

/// Reads one of the reflections of `vis_reflections_list`. Sets `view` to the view to draw it with, to the
/// pixels that the mirror covers: `vis_view_matrix` and `vis_view_clip_planes` have its matrix and its clip
/// plane, which cuts away what is behind the mirror. The view mirrors space, so triangles change their
/// winding. Sets `visible` to the objects to draw in it, as they were at the end of the frame. A set with
/// changes has none then, and begins anew: its next frame lists all its objects as newly visible.
/// Conservative, but for what contribution culling removes. Returns `VIS_ERROR_UNKNOWN_ID` for a number
/// beyond the last.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_reflections_read(
    reflections: *const vis_reflections,
    number: u32,
    view: *mut vis_view,
    visible: *mut vis_visible,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (reflections, view) =
            unsafe { (reference(reflections, "reflections")?, reference(view, "view")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let visible = unsafe { reference(visible, "visible") }?;
        let culler = reflections.lock()?;
        let all = culler.eye().reflections();
        let absent = || {
            let message = format_args!("the frame has {} reflections, and no reflection {number}", all.len());
            Error::new(vis_status::VIS_ERROR_UNKNOWN_ID, message)
        };
        let one = all.get(number as usize).ok_or_else(absent)?;
        let (reflected, objects) = (*one.view(), one.visible());
        visible.copy(objects, || view.put(reflected))
    })
}
