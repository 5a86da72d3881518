//! Pipelines: the cullers of one view, and what they did in the last frame.

use crate::cells::vis_cells;
use crate::error::{Error, border, vis_status};
use crate::handle::Guarded;
use crate::pointer::{buffer, create, destroy, optional_out, out, reference};
use crate::pvs::vis_scene_pvs;
use crate::scene::vis_scene;
use crate::view::vis_view;
use crate::visible::vis_visible;
use std::ffi::c_char;
use std::fmt::Write;
use visibility_core::pvs::PvsCuller;
use visibility_core::{Accuracy, CullStats, Culler, FrustumCuller, ObjectId, Pipeline};
use visibility_frame::lod::ContributionCuller;
use visibility_hzb::{Hzb, HzbCuller};
use visibility_portals::SharedPortalCuller;

/// A pipeline: the cullers of one view, in the order in which they were added, with their memory of earlier
/// frames. Two eyes, or two players, have two pipelines over one scene.
pub struct vis_pipeline(Guarded<Pipeline>);

/// Counters of the work of a frame. They depend neither on the machine nor on time.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct vis_stats {
    /// Number of nodes of the hierarchy whose children were tested.
    pub nodes: u64,
    /// Number of nodes whose candidates were all kept without further tests.
    pub accepted_subtrees: u64,
    /// Number of tests of one box against one plane, one occlusion map or similar.
    pub tests: u64,
    /// Number of occluders drawn.
    pub occluders: u64,
    /// Number of objects left.
    pub visible: u64,
}

impl From<CullStats> for vis_stats {
    fn from(stats: CullStats) -> Self {
        Self {
            nodes: stats.nodes,
            accepted_subtrees: stats.accepted_subtrees,
            tests: stats.tests,
            occluders: stats.occluders,
            visible: stats.visible,
        }
    }
}

/// What a pipeline promises of its result.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum vis_accuracy {
    /// Reports what is visible and nothing else.
    VIS_ACCURACY_EXACT = 0,
    /// Never hides a visible object.
    VIS_ACCURACY_CONSERVATIVE = 1,
    /// Never reports a hidden object.
    VIS_ACCURACY_AGGRESSIVE = 2,
    /// May err both ways, within what its stages say.
    VIS_ACCURACY_APPROXIMATE = 3,
}

/// Creates a pipeline without stages, which reports every object on the view's layers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_create(pipeline: *mut *mut vis_pipeline) -> vis_status {
    border(|| {
        // SAFETY: rule P2 of `visibility.h`.
        let place = unsafe { out(pipeline, "pipeline") }?;
        create(place, vis_pipeline(Guarded::new(Pipeline::new())));
        Ok(())
    })
}

/// Destroys a pipeline. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_destroy(pipeline: *mut vis_pipeline) {
    // SAFETY: rule P3 of `visibility.h`.
    unsafe { destroy(pipeline) }
}

/// Appends a stage to a pipeline.
///
/// # Safety
/// Rule P1 of `visibility.h`.
unsafe fn push(
    pipeline: *mut vis_pipeline,
    culler: impl Culler + Send + Sync + 'static,
) -> Result<(), Error> {
    // SAFETY: the caller's promise.
    let pipeline = unsafe { reference(pipeline, "pipeline") }?;
    pipeline.0.write()?.push(Box::new(culler));
    Ok(())
}

/// Appends frustum culling, which should come first: it removes what is outside the view. Conservative.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_frustum(pipeline: *mut vis_pipeline) -> vis_status {
    // SAFETY: rule P1 of `visibility.h`.
    border(|| unsafe { push(pipeline, FrustumCuller::new()) })
}

/// Appends the removal of objects that are smaller than `min_pixels` pixels in pictures `picture_height`
/// pixels high, out of their draw range, or stood in for by an HLOD parent. If one of the two numbers is
/// zero, no object is too small. Approximate.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_contribution(
    pipeline: *mut vis_pipeline,
    picture_height: f64,
    min_pixels: f64,
) -> vis_status {
    // SAFETY: rule P1 of `visibility.h`.
    border(|| unsafe { push(pipeline, ContributionCuller::new(picture_height, min_pixels)) })
}

/// Appends occlusion culling by a hierarchical z-buffer in software, which removes what objects with
/// `VIS_OBJECT_OCCLUDER` and a mesh hide. `width` and `height` are the buffer's in pixels, 16 to 4096; 0 and
/// 0 for the default, 512 x 288. Conservative.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_z_buffer(
    pipeline: *mut vis_pipeline,
    width: usize,
    height: usize,
) -> vis_status {
    border(|| {
        let map = if (width, height) == (0, 0) { Hzb::default() } else { Hzb::new(width, height)? };
        // SAFETY: rule P1 of `visibility.h`.
        unsafe { push(pipeline, HzbCuller::new(map)) }
    })
}

/// Appends portal culling, which removes what cannot be seen through the open portals of a building. Several
/// pipelines may share the cells, which live as long as any of them, even if destroyed. Conservative.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_portals(
    pipeline: *mut vis_pipeline,
    cells: *const vis_cells,
) -> vis_status {
    border(|| {
        // SAFETY: rule P1 of `visibility.h`.
        let cells = unsafe { reference(cells, "cells") }?;
        // SAFETY: rule P1 of `visibility.h`.
        unsafe { push(pipeline, SharedPortalCuller::new(cells.shared())) }
    })
}

/// Appends culling by a baked set, which removes what the set excludes for the viewcells of the eye. Several
/// pipelines may share the set, which lives as long as any of them, even if destroyed. Conservative if the
/// set is.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_pvs(
    pipeline: *mut vis_pipeline,
    pvs: *const vis_scene_pvs,
) -> vis_status {
    border(|| {
        // SAFETY: rule P1 of `visibility.h`.
        let pvs = unsafe { reference(pvs, "pvs") }?;
        // SAFETY: rule P1 of `visibility.h`.
        unsafe { push(pipeline, PvsCuller::new(pvs.shared())) }
    })
}

/// Culls: fills `visible` with the objects of the scene that the view may see. Writes the sum of the stages'
/// counters to `stats`, which may be null. Once per frame and view; several views of one scene may be culled
/// at once on several threads, each with a pipeline and a set of its own.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_cull(
    pipeline: *mut vis_pipeline,
    scene: *const vis_scene,
    view: *const vis_view,
    visible: *mut vis_visible,
    stats: *mut vis_stats,
) -> vis_status {
    border(|| {
        // SAFETY: rule P1 of `visibility.h`.
        let (pipeline, scene) = unsafe { (reference(pipeline, "pipeline")?, reference(scene, "scene")?) };
        // SAFETY: rule P1 of `visibility.h`.
        let (view, visible) = unsafe { (reference(view, "view")?, reference(visible, "visible")?) };
        // SAFETY: rule P2 of `visibility.h`.
        let place = unsafe { optional_out(stats, "stats") }?;
        let (view, scene) = (view.get()?, scene.read()?);
        let (mut pipeline, mut visible) = (pipeline.0.write()?, visible.write()?);
        let stats = pipeline.cull(&scene.scene, &view, &mut visible);
        place.into_iter().for_each(|mut place| place.set(stats.into()));
        Ok(())
    })
}

/// Makes all stages forget earlier frames. Never needed for correct results.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_reset(pipeline: *mut vis_pipeline) -> vis_status {
    border(|| {
        // SAFETY: rule P1 of `visibility.h`.
        let pipeline = unsafe { reference(pipeline, "pipeline") }?;
        pipeline.0.write()?.reset();
        Ok(())
    })
}

/// Writes what all stages together promise.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_accuracy(
    pipeline: *const vis_pipeline,
    accuracy: *mut vis_accuracy,
) -> vis_status {
    border(|| {
        // SAFETY: rules P1 and P2 of `visibility.h`.
        let (pipeline, mut place) = unsafe { (reference(pipeline, "pipeline")?, out(accuracy, "accuracy")?) };
        place.set(match pipeline.0.read()?.accuracy() {
            Accuracy::Exact => vis_accuracy::VIS_ACCURACY_EXACT,
            Accuracy::Conservative => vis_accuracy::VIS_ACCURACY_CONSERVATIVE,
            Accuracy::Aggressive => vis_accuracy::VIS_ACCURACY_AGGRESSIVE,
            Accuracy::Approximate => vis_accuracy::VIS_ACCURACY_APPROXIMATE,
        });
        Ok(())
    })
}

/// Writes the counters of one stage in the last frame; stages count from 0 in the order in which they were
/// added.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_stage_stats(
    pipeline: *const vis_pipeline,
    stage: usize,
    stats: *mut vis_stats,
) -> vis_status {
    border(|| {
        // SAFETY: rules P1 and P2 of `visibility.h`.
        let (pipeline, mut place) = unsafe { (reference(pipeline, "pipeline")?, out(stats, "stats")?) };
        let pipeline = pipeline.0.read()?;
        let absent = || Error::argument(format_args!("the pipeline has no stage {stage}"));
        place.set(pipeline.stages().nth(stage).ok_or_else(absent)?.1.into());
        Ok(())
    })
}

/// Makes later frames keep culling for the view of the last one (`true`), so that an engine can look from
/// elsewhere at what was culled, or for the views passed to them (`false`).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_freeze(pipeline: *mut vis_pipeline, frozen: bool) -> vis_status {
    border(|| {
        // SAFETY: rule P1 of `visibility.h`.
        let pipeline = unsafe { reference(pipeline, "pipeline") }?;
        let mut pipeline = pipeline.0.write()?;
        if frozen {
            pipeline.freeze()
        } else {
            pipeline.unfreeze()
        }
        Ok(())
    })
}

/// Starts or stops recording which stage removes which object, from the next frame on. Frames cost time in
/// proportion to the scene meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_set_explaining(
    pipeline: *mut vis_pipeline,
    explaining: bool,
) -> vis_status {
    border(|| {
        // SAFETY: rule P1 of `visibility.h`.
        let pipeline = unsafe { reference(pipeline, "pipeline") }?;
        pipeline.0.write()?.set_explaining(explaining);
        Ok(())
    })
}

/// Writes why an object was, or was not, visible in the last frame, such as "visible" or "removed by
/// frustum": a text with a zero byte at its end, and its length with that byte to `count`. With a null `text`
/// writes the length alone. "unknown" unless the pipeline was explaining.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_explain(
    pipeline: *const vis_pipeline,
    object: u64,
    text: *mut c_char,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: rules P1 and P2 of `visibility.h`.
        let (pipeline, text) = unsafe { (reference(pipeline, "pipeline")?, buffer(text, capacity, count)?) };
        text.text(&pipeline.0.read()?.explain(ObjectId::from_bits(object)).to_string())
    })
}

/// Writes what the stages lack to cull a scene, a line each, such as "hzb: occluders without a mesh: 12";
/// empty if nothing. Text and length as in `vis_pipeline_explain`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_lacks(
    pipeline: *const vis_pipeline,
    scene: *const vis_scene,
    text: *mut c_char,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: rule P1 of `visibility.h`.
        let (pipeline, scene) = unsafe { (reference(pipeline, "pipeline")?, reference(scene, "scene")?) };
        // SAFETY: rule P2 of `visibility.h`.
        let text = unsafe { buffer(text, capacity, count) }?;
        let mut lines = String::new();
        pipeline.0.read()?.for_each_lack(&scene.read()?.scene, |stage, lack| {
            // Writing to a string cannot fail.
            let _ = writeln!(lines, "{stage}: {lack}");
        });
        text.text(&lines)
    })
}
