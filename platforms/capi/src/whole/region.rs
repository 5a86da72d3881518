//! What can be seen from a box: by a sweep, and by rays and proofs.

use crate::error::{Error, border, vis_status};
use crate::pointer::{buffer, reference};
use crate::scene::vis_scene;
use std::cell::Cell;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::{ObjectId, RegionCuller, VisibleSet};
use visibility_exact::{CellQuery, Effort, ExactSettings, SceneTriangles, Verdict};
use visibility_region::ExtendedProjectionCuller;

/// Returns the viewcell of two corners. An error if they are not finite, or inverted.
///
/// # Safety
/// By rule P1 of `visibility.h`, each pointer is null, or valid to read: 3 numbers each.
unsafe fn viewcell(min: *const f64, max: *const f64) -> Result<Viewcell, Error> {
    // SAFETY: the caller promises what is asked for here.
    let (min, max) =
        unsafe { (reference(min.cast::<[f64; 3]>(), "min")?, reference(max.cast::<[f64; 3]>(), "max")?) };
    let [min, max] = [*min, *max].map(DVec3::from_array);
    if !(min.is_finite() && max.is_finite() && min.cmple(max).all()) {
        return Err(Error::argument("the box is inverted or not finite"));
    }
    Ok(Viewcell::from_box(min, max))
}

fn set(words: &mut [u32], id: ObjectId) {
    let index = id.index();
    if let Some(word) = words.get_mut(index / 32) {
        *word |= 1 << (index % 32);
    }
}

/// Writes which objects can be seen from a box of the world, by a sweep of it over the occluders, their
/// meshes and flags as in a frame: bit `index % 32` of word `index / 32` is clear if the object is hidden
/// from all points of the box, and if there is no object of this index. `min` and `max` are the corners of
/// the box, 3 finite coordinates each. Conservative. Takes milliseconds to a second. A null or too short
/// `words` is handled as in `vis_visible_ids`; null takes no time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_seen_from(
    scene: *const vis_scene,
    min: *const f64,
    max: *const f64,
    words: *mut u32,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (scene, words) = unsafe { (reference(scene, "scene")?, buffer(words, capacity, count)?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 numbers each.
        let cell = unsafe { viewcell(min, max) }?;
        let scene = &scene.read()?.scene;
        let Some(words) = words.words(scene.index_limit().div_ceil(32))? else { return Ok(()) };
        let mut visible = VisibleSet::new();
        ExtendedProjectionCuller::new().cull(scene, &cell, &mut visible);
        visible.iter(scene).for_each(|id| set(words, id));
        Ok(())
    })
}

/// Decides for each object whether it can be seen from a box of the world, by rays and proofs among the
/// triangles of `vis_scene_set_triangles`. Writes two bits for each index: bit `index % 32` of word `index /
/// 32` is set if a line of sight to the object was found; the bit in the second half of the words is set if
/// the object is proven hidden from all points of the box. Neither is set for objects that are not decided.
/// An object without triangles is its bounds: no line of sight to it is found, and it hides nothing. With a
/// `clearance` of 0, an object is hidden if every segment to it touches an occluder; with a clearance in
/// metres, also if gaps between occluders are narrower than 12 clearances. The work ends after `most_steps`
/// rays and pieces of searches, some microseconds each; 0 for no end, which may take minutes. A null or too
/// short `words` is handled as in `vis_visible_ids`; null takes no time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_prove_from(
    scene: *const vis_scene,
    min: *const f64,
    max: *const f64,
    clearance: f64,
    most_steps: u32,
    words: *mut u32,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (scene, words) = unsafe { (reference(scene, "scene")?, buffer(words, capacity, count)?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 numbers each.
        let cell = unsafe { viewcell(min, max) }?;
        if !(0.0..=1e6).contains(&clearance) {
            return Err(Error::argument(format_args!("the clearance cannot be {clearance}")));
        }
        let scene = &scene.read()?.scene;
        let length = scene.index_limit().div_ceil(32);
        let Some(words) = words.words(2 * length)? else { return Ok(()) };
        let triangles = SceneTriangles::new(scene);
        let left = Cell::new(u64::from(most_steps));
        let stop = || {
            left.set(left.get().saturating_sub(1));
            most_steps != 0 && left.get() == 0
        };
        let settings = ExactSettings::new(Effort::Exact(clearance));
        let Some(query) = CellQuery::new(&triangles, &cell, settings) else { return Ok(()) };
        let mut query = query.with_stop(&stop);
        query.look(&|_| true);
        query.prove_boxes(&|_| true);
        query.prove_triangles(&|_| true);
        let (seen, hidden) = words.split_at_mut(length);
        for (id, verdict) in query.verdicts() {
            match verdict {
                Verdict::Seen(_) => set(seen, id),
                Verdict::Hidden => set(hidden, id),
                _ => {}
            }
        }
        Ok(())
    })
}
