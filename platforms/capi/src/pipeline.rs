//! Pipelines: the cullers of one view, and their counters of the last frame.

use crate::contribution::{FollowingContribution, LastContribution};
use crate::error::{Error, border, vis_status};
use crate::handle::Guarded;
use crate::numbers::finite;
use crate::pointer::{buffer, create, destroy, optional_out, out, reference};
use crate::scene::vis_scene;
use crate::stats::vis_stats;
use crate::view::{optional_point, vis_view};
use crate::visible::vis_visible;
use std::ffi::c_char;
use std::fmt::Write;
use std::sync::Arc;
use visibility_core::view::Reach;
use visibility_core::{Accuracy, Culler, FrustumCuller, ObjectId, Pipeline};
use visibility_hzb::{Hzb, HzbCuller};

/// Pipeline: the cullers of one view in the order in which they were added, with their state from earlier
/// frames. Two eyes, or two players, need two pipelines over one scene.
pub struct vis_pipeline(Guarded<Pipeline>, Arc<LastContribution>);

impl vis_pipeline {
    /// Returns the settings of the contribution culling that was added last, for stages that follow them.
    pub(crate) fn contribution(&self) -> &Arc<LastContribution> {
        &self.1
    }
}

/// Accuracy that a pipeline promises for its result.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum vis_accuracy {
    /// Reports exactly the visible objects.
    VIS_ACCURACY_EXACT = 0,
    /// Never hides a visible object.
    VIS_ACCURACY_CONSERVATIVE = 1,
    /// Never reports a hidden object.
    VIS_ACCURACY_AGGRESSIVE = 2,
    /// May hide visible objects and report hidden ones, within the limits stated by its stages.
    VIS_ACCURACY_APPROXIMATE = 3,
}

/// Creates a pipeline without stages, which reports every object on the view's layers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_create(pipeline: *mut *mut vis_pipeline) -> vis_status {
    border(|| {
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let place = unsafe { out(pipeline, "pipeline") }?;
        create(place, vis_pipeline(Guarded::new(Pipeline::new()), Arc::default()));
        Ok(())
    })
}

/// Destroys a pipeline. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_destroy(pipeline: *mut vis_pipeline) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(pipeline) }
}

/// Appends a culler as the last stage of a pipeline.
///
/// # Safety
/// `pipeline` must be null or valid to read, by rule P1 of `visibility.h`.
pub(crate) unsafe fn push(
    pipeline: *mut vis_pipeline,
    culler: impl Culler + Send + Sync + 'static,
) -> Result<(), Error> {
    // SAFETY: the caller's promise.
    let pipeline = unsafe { reference(pipeline, "pipeline") }?;
    pipeline.0.write()?.push(Box::new(culler));
    Ok(())
}

/// Appends frustum culling, which removes objects outside the view and should be the first stage.
/// Conservative.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_frustum(pipeline: *mut vis_pipeline) -> vis_status {
    // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
    border(|| unsafe { push(pipeline, FrustumCuller::new()) })
}

/// Appends contribution culling. It removes objects that are smaller than `min_pixels` pixels in a picture
/// `picture_height` pixels high, outside of their draw range, or replaced by an HLOD parent. If one of the
/// two numbers is zero, no object is too small. Goes before the z-buffer: an object that is not drawn must
/// not hide others. Approximate.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_contribution(
    pipeline: *mut vis_pipeline,
    picture_height: f64,
    min_pixels: f64,
) -> vis_status {
    border(|| {
        let (culler, settings) = FollowingContribution::new(picture_height, min_pixels);
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        unsafe { push(pipeline, culler) }?;
        // SAFETY: as before.
        unsafe { reference(pipeline, "pipeline") }?.contribution().set(settings);
        Ok(())
    })
}

/// Changes the contribution culling that was added last for later frames: the height of the pictures and the
/// least size, as for `vis_pipeline_add_contribution`, and the point of the world, 3 finite coordinates, from
/// which the distances of draw ranges and HLOD parents are measured; null for the view's own eye. A view of a
/// light gets the eye of the camera, so that it shows the objects that the camera shows; the reflections of
/// `vis_pipeline_add_reflections` have it anyway. Returns `VIS_ERROR_STATE` if the pipeline has no
/// contribution culling.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_set_contribution(
    pipeline: *mut vis_pipeline,
    picture_height: f64,
    min_pixels: f64,
    distance_eye: *const f64,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 numbers of `distance_eye`.
        let (pipeline, eye) =
            unsafe { (reference(pipeline, "pipeline")?, optional_point(distance_eye, "distance_eye")?) };
        let distance_eye = eye.map(|eye| finite(eye, "`distance_eye`")).transpose()?;
        // Refused while the pipeline culls.
        let _alone = pipeline.0.write()?;
        let none = || Error::new(vis_status::VIS_ERROR_STATE, "the pipeline has no contribution culling");
        pipeline.contribution().get().ok_or_else(none)?.set(picture_height, min_pixels, distance_eye);
        Ok(())
    })
}

/// Returns a z-buffer of a size in pixels, of the default size for 0 and 0.
pub(crate) fn z_buffer(width: usize, height: usize) -> Result<Hzb, Error> {
    Ok(if (width, height) == (0, 0) { Hzb::default() } else { Hzb::new(width, height)? })
}

/// Appends occlusion culling by a software hierarchical z-buffer. It removes objects hidden behind objects
/// that have a mesh and the flag `VIS_OBJECT_OCCLUDER`. `width` and `height` are the size of the buffer in
/// pixels, 16 to 4096; 0 and 0 for the default, 512 x 288. Conservative.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_add_z_buffer(
    pipeline: *mut vis_pipeline,
    width: usize,
    height: usize,
) -> vis_status {
    border(|| {
        let map = z_buffer(width, height)?;
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        unsafe { push(pipeline, HzbCuller::new(map)) }
    })
}

/// Makes answers of later frames good for a while: they are made for all views whose eye is within `metres`
/// and whose direction is within `radians` of the frame's view, and a frame with such a view keeps the answer
/// and does no work. 0 and 0, the default: each frame culls for its own view. Frames also do so after a
/// change of the scene, after a cut, and if a stage has no answer for a region: the frustum, portals and the
/// z-buffer have one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_set_reach(
    pipeline: *mut vis_pipeline,
    metres: f64,
    radians: f64,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let pipeline = unsafe { reference(pipeline, "pipeline") }?;
        let reach = Reach::new(metres, radians);
        pipeline.0.write()?.set_reach((reach != Reach::new(0.0, 0.0)).then_some(reach));
        Ok(())
    })
}

/// Writes whether the last frame kept the answer of an earlier one. A third frame of one view and one scene
/// keeps it if there is an answer for the whole reach.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_is_kept(pipeline: *const vis_pipeline, kept: *mut bool) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (pipeline, mut place) = unsafe { (reference(pipeline, "pipeline")?, out(kept, "kept")?) };
        place.set(pipeline.0.read()?.is_kept());
        Ok(())
    })
}

/// Culls: fills `visible` with the objects of the scene that the view may see. Writes the sum of the stages'
/// counters to `stats`, which may be null. Call this once per frame and view. Several threads may cull views
/// of one scene at once, each with its own pipeline and visible set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_cull(
    pipeline: *mut vis_pipeline,
    scene: *const vis_scene,
    view: *const vis_view,
    visible: *mut vis_visible,
    stats: *mut vis_stats,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (pipeline, scene) = unsafe { (reference(pipeline, "pipeline")?, reference(scene, "scene")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (view, visible) = unsafe { (reference(view, "view")?, reference(visible, "visible")?) };
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
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
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let pipeline = unsafe { reference(pipeline, "pipeline") }?;
        pipeline.0.write()?.reset();
        Ok(())
    })
}

/// Writes the accuracy that all stages together promise.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_accuracy(
    pipeline: *const vis_pipeline,
    accuracy: *mut vis_accuracy,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
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
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (pipeline, mut place) = unsafe { (reference(pipeline, "pipeline")?, out(stats, "stats")?) };
        let pipeline = pipeline.0.read()?;
        let absent = || Error::argument(format_args!("the pipeline has no stage {stage}"));
        place.set(pipeline.stages().nth(stage).ok_or_else(absent)?.1.into());
        Ok(())
    })
}

/// With `true`, later frames keep culling for the view of the last frame, so that an engine can look at the
/// culled scene from elsewhere. With `false`, they cull for the views passed to them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_freeze(pipeline: *mut vis_pipeline, frozen: bool) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
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

/// Starts or stops recording, from the next frame on, which stage removes each object. While recording, a
/// frame takes time proportional to the size of the scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_set_explaining(
    pipeline: *mut vis_pipeline,
    explaining: bool,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let pipeline = unsafe { reference(pipeline, "pipeline") }?;
        pipeline.0.write()?.set_explaining(explaining);
        Ok(())
    })
}

/// Writes why an object was visible or not in the last frame, such as "visible" or "removed by frustum".
/// Writes a text that ends with a zero byte, and its length including this byte to `count`. With a null
/// `text`, writes only the length. The text is "unknown" unless the pipeline was explaining.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_explain(
    pipeline: *const vis_pipeline,
    object: u64,
    text: *mut c_char,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (pipeline, text) = unsafe { (reference(pipeline, "pipeline")?, buffer(text, capacity, count)?) };
        text.text(&pipeline.0.read()?.explain(ObjectId::from_bits(object)).to_string())
    })
}

/// Writes what the stages need and the scene lacks, one line each, such as "hzb: occluders without a mesh:
/// 12". Empty if nothing is missing. Text and length as in `vis_pipeline_explain`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pipeline_lacks(
    pipeline: *const vis_pipeline,
    scene: *const vis_scene,
    text: *mut c_char,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (pipeline, scene) = unsafe { (reference(pipeline, "pipeline")?, reference(scene, "scene")?) };
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let text = unsafe { buffer(text, capacity, count) }?;
        let mut lines = String::new();
        pipeline.0.read()?.for_each_lack(&scene.read()?.scene, |stage, lack| {
            // Writing to a string cannot fail.
            let _ = writeln!(lines, "{stage}: {lack}");
        });
        text.text(&lines)
    })
}
