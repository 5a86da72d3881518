//! Judge of a frame's result: comparison with a software renderer.

use crate::error::{border, vis_status};
use crate::handle::Guarded;
use crate::pointer::{create, destroy, out, reference};
use crate::scene::vis_scene;
use crate::view::vis_view;
use crate::visible::vis_visible;
use visibility_measure::{Comparison, DrawnObject, ItemBuffer};

/// Software renderer that finds the objects with at least one visible pixel, for tests and tools, not for
/// frames.
pub struct vis_measure(Guarded<ItemBuffer>);

/// Differences between a result and the renderer's picture. Pixels are samples, so the numbers of falsely
/// hidden objects are lower bounds, and those of falsely visible objects upper bounds.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct vis_comparison {
    /// Number of objects in the result that have triangles.
    pub reported_objects: u32,
    /// Number of objects with a visible pixel that are missing from the result. Always 0 for a conservative
    /// pipeline.
    pub false_hidden_objects: u32,
    /// Number of objects in the result without a visible pixel.
    pub false_visible_objects: u32,
    /// Number of pixels that are wrong if only the objects in the result are drawn.
    pub wrong_pixels: u32,
}

/// Creates a renderer with an image of `width` by `height` pixels.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_measure_create(
    width: u32,
    height: u32,
    measure: *mut *mut vis_measure,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let place = unsafe { out(measure, "measure") }?;
        create(place, vis_measure(Guarded::new(ItemBuffer::new(width, height)?)));
        Ok(())
    })
}

/// Destroys a renderer. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_measure_destroy(measure: *mut vis_measure) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(measure) }
}

/// Draws all triangles of the scene's objects (`vis_scene_set_triangles`) for a view, and compares the
/// picture with a pipeline's result for the same view. Objects without triangles are not compared.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_measure_compare(
    measure: *mut vis_measure,
    scene: *const vis_scene,
    view: *const vis_view,
    visible: *const vis_visible,
    comparison: *mut vis_comparison,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (measure, scene) = unsafe { (reference(measure, "measure")?, reference(scene, "scene")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (view, visible) = unsafe { (reference(view, "view")?, reference(visible, "visible")?) };
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let mut place = unsafe { out(comparison, "comparison") }?;
        let (view, state, visible) = (view.get()?, scene.read()?, visible.finished()?);
        let (scene, mut buffer) = (&state.scene, measure.0.write()?);
        let objects = || scene.ids().filter(|&id| scene.triangles(id).is_ok_and(|of| !of.is_empty()));
        let drawn = objects().filter_map(|id| DrawnObject::of_scene(scene, id, &view));
        let seen = buffer.draw(&view, scene.origin(), drawn)?;
        let mut found = Comparison::default();
        let reported = |_, key: u32| scene.id_at(key as usize).is_some_and(|id| visible.contains(scene, id));
        seen.compare(reported, &mut found);
        place.set(vis_comparison {
            reported_objects: found.reported_objects,
            false_hidden_objects: found.false_hidden_objects,
            false_visible_objects: found.false_visible_objects,
            wrong_pixels: found.wrong_pixels,
        });
        Ok(())
    })
}
