//! What can be seen from a box: by a sweep, and by rays and proofs.

use crate::error::{Error, border, vis_status};
use crate::pointer::{buffer, reference};
use crate::scene::vis_scene;
use std::cell::Cell;
use std::fmt::Display;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::{ObjectId, RegionCuller, Scene, VisibleSet};
use visibility_exact::{CellQuery, Effort, ExactSettings, SceneTriangles, Verdict};
use visibility_region::ExtendedProjectionCuller;

/// Returns the viewcell of two corners. An error that names the box if they are not finite, or inverted.
pub(super) fn viewcell(min: DVec3, max: DVec3, name: impl Display) -> Result<Viewcell, Error> {
    if !(min.is_finite() && max.is_finite() && min.cmple(max).all()) {
        return Err(Error::argument(format_args!("{name} is inverted or not finite")));
    }
    Ok(Viewcell::from_box(min, max))
}

/// Returns the viewcell of two corners.
///
/// # Safety
/// By rule P1 of `visibility.h`, each pointer is null, or valid to read: 3 numbers each.
unsafe fn viewcell_at(min: *const f64, max: *const f64) -> Result<Viewcell, Error> {
    // SAFETY: the caller promises what is asked for here.
    let (min, max) =
        unsafe { (reference(min.cast::<[f64; 3]>(), "min")?, reference(max.cast::<[f64; 3]>(), "max")?) };
    viewcell(DVec3::from_array(*min), DVec3::from_array(*max), "the box")
}

/// Sets the bit of an object.
fn set(words: &mut [u32], id: ObjectId) {
    let index = id.index();
    if let Some(word) = words.get_mut(index / 32) {
        *word |= 1 << (index % 32);
    }
}

/// Returns whether a view always shows an object: for its flag, or for its improper bounds.
fn is_unculled(scene: &Scene, id: ObjectId) -> bool {
    scene.object(id).map_or(true, |object| object.is_unculled())
}

/// Writes which objects can be seen from a box of the world. The box is swept over the occluder meshes of all
/// objects that have the flag `VIS_OBJECT_OCCLUDER`. Bit `index % 32` of word `index / 32` is clear if the
/// object is hidden from all points of the box, and if there is no object of this index. `min` and `max` are
/// the corners of the box, 3 finite coordinates each. Conservative for views that draw the layers of all
/// occluders. Takes milliseconds to a second. A null or too short `words` is handled as in `vis_visible_ids`;
/// null takes no time.
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
        let cell = unsafe { viewcell_at(min, max) }?;
        let scene = &scene.read()?.scene;
        let length = scene.index_limit().div_ceil(32);
        words.fill_with(length, || {
            let mut visible = VisibleSet::new();
            ExtendedProjectionCuller::new().cull(scene, &cell, &mut visible);
            let mut seen = vec![0; length];
            visible.iter(scene).for_each(|id| set(&mut seen, id));
            seen
        })
    })
}

/// Decides for each object whether it can be seen from a box of the world, by rays and proofs among the
/// triangles of `vis_scene_set_triangles`. Writes two bits for each index: bit `index % 32` of word `index /
/// 32` is set if a line of sight to the object was found; the bit in the second half of the words is set if
/// the object is proven hidden from all points of the box. Neither is set for objects that are not decided.
/// An object that is never culled is never hidden. An object without triangles is its bounds: no line of
/// sight to it is found, and it hides nothing. With a `clearance` of 0, an object is hidden if every segment
/// to it touches an occluder; with a clearance in metres, also if it is seen only through gaps narrower than
/// 12 clearances, or at grazing angles. Hidden objects are so for views that draw the layers of all
/// occluders.
///
/// The search ends after `most_steps` steps; 0 for no end, which may take minutes. A step is a search node of
/// some microseconds, or at most 200 rays. Each call first collects all triangles of the scene, which
/// `most_steps` does not bound: it takes about 150 bytes of memory a triangle until the call ends. A null or
/// too short `words` is handled as in `vis_visible_ids`; null takes no time.
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
        let cell = unsafe { viewcell_at(min, max) }?;
        if !(0.0..=1e6).contains(&clearance) {
            return Err(Error::argument(format_args!("the clearance cannot be {clearance}")));
        }
        let scene = &scene.read()?.scene;
        let length = scene.index_limit().div_ceil(32);
        words.fill_with(2 * length, || {
            let (mut seen, mut hidden) = (vec![0; length], vec![0; length]);
            let triangles = SceneTriangles::new(scene);
            let left = Cell::new(u64::from(most_steps));
            let stop = || {
                left.set(left.get().saturating_sub(1));
                most_steps != 0 && left.get() == 0
            };
            let settings = ExactSettings::new(Effort::Exact(clearance));
            if let Some(query) = CellQuery::new(&triangles, &cell, settings) {
                let mut query = query.with_stop(&stop);
                query.look(&|_| true);
                query.prove_boxes(&|_| true);
                query.prove_triangles(&|_| true);
                for (id, verdict) in query.verdicts() {
                    match verdict {
                        Verdict::Seen(_) => set(&mut seen, id),
                        Verdict::Hidden if !is_unculled(scene, id) => set(&mut hidden, id),
                        _ => {}
                    }
                }
            }
            seen.append(&mut hidden);
            seen
        })
    })
}
