//! Sets of visible objects around an eye on the move, made ahead of it.

use crate::error::{Error, border, vis_status};
use crate::numbers::{finite, not_negative};
use crate::pointer::{array, buffer, create, destroy, optional_out, out, reference};
use crate::scene::vis_scene;
use crate::stats::vis_stats;
use std::sync::{Arc, Mutex, MutexGuard};
use vis_answer::*;
use visibility_core::culler::Lack;
use visibility_core::glam::DVec3;
use visibility_core::{Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet};
use visibility_region::OnlinePvs;

/// Sets of the objects that are visible from small boxes around one eye, made ahead of it while the scene
/// changes. Its functions wait for one another and for frames that use the sets, so they never return
/// `VIS_ERROR_BUSY` because of it.
pub struct vis_online(Arc<Mutex<OnlinePvs>>);

impl vis_online {
    /// Returns a shared handle to the sets.
    pub(crate) fn shared(&self) -> Arc<Mutex<OnlinePvs>> {
        self.0.clone()
    }

    fn lock(&self) -> Result<MutexGuard<'_, OnlinePvs>, Error> {
        lock(&self.0)
    }
}

/// Locks sets. An error if a panic has left them.
pub(crate) fn lock(online: &Mutex<OnlinePvs>) -> Result<MutexGuard<'_, OnlinePvs>, Error> {
    let message = "an earlier call with these online sets failed inside: destroy them";
    online.lock().map_err(|_| Error::new(vis_status::VIS_ERROR_PANIC, message))
}

/// Culler of a pipeline that shares its sets with a handle. Hides nothing once a panic has left them.
pub(crate) struct SharedOnline(pub(crate) Arc<Mutex<OnlinePvs>>);

impl Culler for SharedOnline {
    fn name(&self) -> &str {
        "online pvs"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }

    fn hides_behind_undrawn(&self) -> bool {
        true
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        match lock(&self.0) {
            Ok(mut online) => online.cull(scene, view, visible),
            Err(_) => visible.retain(scene, |_, _| true),
        }
    }

    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        match lock(&self.0) {
            Ok(online) => online.for_each_lack(scene, each),
            Err(_) => each(Lack { what: "objects not culled, for want of usable sets", count: scene.len() }),
        }
    }
}

/// Work that one call of `vis_online_step` has done.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct vis_online_work {
    /// Whether there was any. False if all places have viewcells; all else is then false or 0.
    pub worked: bool,
    /// Whether the step worked on a wide box, not on a viewcell.
    pub wide: bool,
    /// Whether the step has finished its box, which answers frames from now on.
    pub finished: bool,
    /// Counters of the step.
    pub stats: vis_stats,
}

/// What answered a frame of online sets.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum vis_answer {
    /// No box, so that nothing was hidden: none is finished around the eye and its near plane, or the view's
    /// layers leave out an occluder of the boxes.
    VIS_ANSWER_NONE = 0,
    /// A wide box, which hides less than a viewcell: the viewcell is not ready.
    VIS_ANSWER_WIDE = 1,
    /// A viewcell.
    VIS_ANSWER_VIEWCELL = 2,
}

/// Creates sets for one eye. `viewcell` and `wide` are the sizes along x, y and z, in metres, of the
/// viewcells and of the wide boxes that these lie in: 3 numbers each, positive and finite, those of `wide` at
/// least those of `viewcell`. A viewcell of 0.6 m lasts for a quarter of a second of walking; a wide box
/// should be several times as wide, but not higher. `margin` is how far a viewcell extends at least around
/// each place that it holds: to the corners of the near plane, and to both eyes of a headset. At most half
/// the least size of the viewcell counts; 0 for the default, an eighth of it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_online_create(
    viewcell: *const f64,
    wide: *const f64,
    margin: f64,
    online: *mut *mut vis_online,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 numbers each.
        let (viewcell, wide) = unsafe { (array(viewcell, 3, "viewcell")?, array(wide, 3, "wide")?) };
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let place = unsafe { out(online, "online") }?;
        not_negative(margin, "the margin")?;
        let made = OnlinePvs::new(DVec3::from_slice(viewcell), DVec3::from_slice(wide));
        let made = made.map_err(|error| Error::argument(format_args!("{error}")))?;
        let made = if margin == 0.0 { made } else { made.with_margin(margin) };
        create(place, vis_online(Arc::new(Mutex::new(made))));
        Ok(())
    })
}

/// Destroys sets; pipelines and sight cells that use them keep them alive. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_online_destroy(online: *mut vis_online) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(online) }
}

/// Works ahead, in or between frames, on the box that is needed soonest. `places` are points of the world, 3
/// coordinates each: the eye, then where it may be next, such as its place after 0.1, 0.2, 0.4 and 0.8
/// seconds at its present velocity. All must be finite. `budget` is the work to do in microseconds of a core
/// of 3 GHz, counted and not timed; a step does a little work even with 0, and may exceed it by one
/// indivisible part. Answers do not depend on budgets. Writes what was done to `work`, which may be null:
/// call this until `worked` is false to have viewcells at all places.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_online_step(
    online: *mut vis_online,
    scene: *const vis_scene,
    places: *const f64,
    place_count: usize,
    budget: u32,
    work: *mut vis_online_work,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (online, scene) = unsafe { (reference(online, "online")?, reference(scene, "scene")?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 numbers for each of `place_count`.
        let places = unsafe { array(places.cast::<[f64; 3]>(), place_count, "places") }?;
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let place_of_work = unsafe { optional_out(work, "work") }?;
        let places = places.iter().enumerate().map(|(i, place)| finite(place, &format!("place {i}")));
        let places = places.collect::<Result<Vec<_>, Error>>()?;
        let step = online.lock()?.step(&scene.read()?.scene, &places, budget);
        let done = step.map_or_else(vis_online_work::default, |step| vis_online_work {
            worked: true,
            wide: step.is_wide,
            finished: step.is_last,
            stats: step.stats.into(),
        });
        place_of_work.into_iter().for_each(|mut place| place.set(done));
        Ok(())
    })
}

/// Writes what answered the last frame of a pipeline with these sets. `VIS_ANSWER_NONE` before the first.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_online_answer(online: *const vis_online, answer: *mut vis_answer) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (online, mut place) = unsafe { (reference(online, "online")?, out(answer, "answer")?) };
        let online = online.lock()?;
        place.set(match online.answer() {
            None => VIS_ANSWER_NONE,
            Some(_) if online.is_ready() => VIS_ANSWER_VIEWCELL,
            Some(_) => VIS_ANSWER_WIDE,
        });
        Ok(())
    })
}

/// Writes one of the lists of `online`.
///
/// # Safety
/// By rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
unsafe fn write_ids(
    online: *const vis_online,
    ids: *mut u64,
    capacity: usize,
    count: *mut usize,
    list: fn(&OnlinePvs) -> &[ObjectId],
) -> vis_status {
    border(|| {
        // SAFETY: the caller promises what is asked for here.
        let (online, ids) = unsafe { (reference(online, "online")?, buffer(ids, capacity, count)?) };
        let online = online.lock()?;
        let list = list(&online);
        ids.fill(list.len(), list.iter().copied().map(ObjectId::to_bits))
    })
}

/// Writes the ids of objects that the box of the last frame sees, wherever the view looks, and the box of the
/// frame before did not, like `vis_visible_ids`. The largest for their distance come first, so a stream sends
/// as many of the first as fit. It begins with all objects of the scene and adds those that are inserted,
/// since what was never hidden is not listed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_online_came(
    online: *const vis_online,
    ids: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    // SAFETY: the caller keeps rules P1 and P2 of `visibility.h`.
    unsafe { write_ids(online, ids, capacity, count, OnlinePvs::came) }
}

/// Writes the ids of objects that the box of the frame before saw and the box of the last frame does not see,
/// in the order of `vis_online_came`, so the last can be unloaded first. Removed objects are not listed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_online_went(
    online: *const vis_online,
    ids: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    // SAFETY: the caller keeps rules P1 and P2 of `visibility.h`.
    unsafe { write_ids(online, ids, capacity, count, OnlinePvs::went) }
}

/// Writes which objects are hidden from all points of a box of the world, without a view: bit `index % 32` of
/// word `index / 32` is set if the object is hidden. `min` and `max` are the corners of the box, 3 finite
/// coordinates each. Nothing is hidden if no finished box holds this one, or if `min` exceeds `max`. A null
/// or too short `words` is handled as in `vis_visible_ids`; `vis_scene_index_limit` tells the number of
/// words. Only for observers to whom all layers of occluders are drawn.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_online_write_hidden(
    online: *mut vis_online,
    scene: *const vis_scene,
    min: *const f64,
    max: *const f64,
    words: *mut u32,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (online, scene) = unsafe { (reference(online, "online")?, reference(scene, "scene")?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 numbers each.
        let (min, max) = unsafe { (reference(min.cast(), "min")?, reference(max.cast(), "max")?) };
        // SAFETY: by rule P2 of `visibility.h`, each pointer is null or valid to write.
        let words = unsafe { buffer(words, capacity, count) }?;
        let (min, max) = (finite(min, "`min`")?, finite(max, "`max`")?);
        let scene = &scene.read()?.scene;
        let mut online = online.lock()?;
        let Some(words) = words.words(scene.index_limit().div_ceil(32))? else { return Ok(()) };
        for index in online.hidden_from(scene, min, max).into_iter().flat_map(|bits| bits.iter()) {
            words[index / 32] |= 1 << (index % 32);
        }
        Ok(())
    })
}
