//! Sets of visible objects: the result of a frame.

use crate::error::{Error, border, vis_status, vis_status::VIS_ERROR_STATE};
use crate::handle::Guarded;
use crate::pointer::{buffer, create, destroy, out, reference};
use crate::scene::vis_scene;
use std::sync::{RwLockReadGuard, RwLockWriteGuard};
use visibility_core::visible_set::BitsError;
use visibility_core::{ObjectId, VisibleSet};

/// Set of the objects that a view sees, the result of `vis_pipeline_cull`. Changes of the scene do not change
/// the set. Once listed, a render thread can read it while the scene changes.
pub struct vis_visible(Guarded<VisibleSet>, bool);

impl vis_visible {
    /// Returns the set of the last frame. An error if no frame was culled yet, since an empty list would mean
    /// that nothing is visible.
    pub(crate) fn finished(&self) -> Result<RwLockReadGuard<'_, VisibleSet>, Error> {
        let visible = self.0.read()?;
        if visible.is_finished() {
            return Ok(visible);
        }
        Err(Error::new(VIS_ERROR_STATE, "no pipeline has culled into the set of visible objects"))
    }

    /// Calls `read` with the number of visible objects and an iterator over them. With a scene, these are the
    /// objects that are still in it; with a null `scene`, the objects in the list.
    ///
    /// # Safety
    /// `scene` is null, or a handle that is not destroyed.
    unsafe fn read(
        &self,
        scene: *const vis_scene,
        read: impl FnOnce(usize, &mut dyn Iterator<Item = ObjectId>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let visible = self.finished()?;
        if !scene.is_null() {
            // SAFETY: the caller promises that `scene` is null or a live handle.
            let scene = &unsafe { reference(scene, "scene") }?.read()?.scene;
            return read(visible.count(scene), &mut visible.iter(scene));
        }
        match visible.listed() {
            Some(ids) => read(ids.len(), &mut ids.iter().copied()),
            None => {
                Err(Error::new(VIS_ERROR_STATE, "the set of visible objects is not listed: pass the scene"))
            }
        }
    }

    /// Replaces the set by a copy of `other`, which has no changes, once `before` has succeeded. Whether the
    /// set records changes stays.
    pub(crate) fn copy(
        &self,
        other: &VisibleSet,
        before: impl FnOnce() -> Result<(), Error>,
    ) -> Result<(), Error> {
        let mut set = self.write()?;
        before()?;
        set.clone_from(other);
        if self.1 {
            *set = std::mem::take(&mut *set).with_changes();
        }
        Ok(())
    }

    pub(crate) fn write(&self) -> Result<RwLockWriteGuard<'_, VisibleSet>, Error> {
        self.0.write()
    }
}

/// Creates a set for the results of one view. With `with_changes`, it also records which objects became
/// visible or hidden since the last frame, for a few nanoseconds per visible object.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_create(
    with_changes: bool,
    visible: *mut *mut vis_visible,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let place = unsafe { out(visible, "visible") }?;
        let set = if with_changes { VisibleSet::new().with_changes() } else { VisibleSet::new() };
        create(place, vis_visible(Guarded::new(set), with_changes));
        Ok(())
    })
}

/// Destroys a set. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_destroy(visible: *mut vis_visible) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(visible) }
}

/// Lists the visible objects, unless they are listed already, by `vis_visible_sort_by_index` or in a set with
/// changes. The functions below can read a listed set without a scene, so that a render thread can read it
/// while the scene changes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_list(visible: *mut vis_visible, scene: *const vis_scene) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (visible, scene) = unsafe { (reference(visible, "visible")?, reference(scene, "scene")?) };
        let scene = &scene.read()?.scene;
        drop(visible.finished()?);
        visible.write()?.ids(scene);
        Ok(())
    })
}

/// Writes the number of visible objects that are still in the scene. `scene` may be null if the set is
/// listed; objects removed after the listing then count too.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_count(
    visible: *const vis_visible,
    scene: *const vis_scene,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (visible, mut count) = unsafe { (reference(visible, "visible")?, out(count, "count")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        unsafe {
            visible.read(scene, |length, _| {
                count.set(length);
                Ok(())
            })
        }
    })
}

/// Writes whether an object is visible. False if it was removed from the scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_contains(
    visible: *const vis_visible,
    scene: *const vis_scene,
    object: u64,
    contains: *mut bool,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (visible, scene) = unsafe { (reference(visible, "visible")?, reference(scene, "scene")?) };
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let mut contains = unsafe { out(contains, "contains") }?;
        let scene = &scene.read()?.scene;
        contains.set(visible.finished()?.contains(scene, ObjectId::from_bits(object)));
        Ok(())
    })
}

/// Sorts the visible objects by ascending index, the fastest order for reading arrays indexed by object.
/// Drops objects that were removed from the scene. In an unsorted set, neighbours in space follow each other.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_sort_by_index(
    visible: *mut vis_visible,
    scene: *const vis_scene,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (visible, scene) = unsafe { (reference(visible, "visible")?, reference(scene, "scene")?) };
        let scene = &scene.read()?.scene;
        drop(visible.finished()?);
        visible.write()?.sort_by_index(scene);
        Ok(())
    })
}

/// Writes the ids of the visible objects that are still in the scene, and their number to `count`. With a
/// null `ids`, writes only the number. Returns `VIS_ERROR_TOO_SHORT` if `ids` is too short. `scene` may be
/// null if the set is listed; objects removed after the listing are then written too.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_ids(
    visible: *const vis_visible,
    scene: *const vis_scene,
    ids: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (visible, ids) = unsafe { (reference(visible, "visible")?, buffer(ids, capacity, count)?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        unsafe { visible.read(scene, |count, objects| ids.fill(count, objects.map(ObjectId::to_bits))) }
    })
}

/// Writes the indices of the visible objects, like `vis_visible_ids`. Indices take half the memory of ids,
/// for engines with arrays indexed by object.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_indices(
    visible: *const vis_visible,
    scene: *const vis_scene,
    indices: *mut u32,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (visible, indices) =
            unsafe { (reference(visible, "visible")?, buffer(indices, capacity, count)?) };
        let index = |id: ObjectId| id.index() as u32;
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        unsafe { visible.read(scene, |count, objects| indices.fill(count, objects.map(index))) }
    })
}

/// Writes one bit per object index: bit `index % 32` of word `index / 32` is set for visible objects that are
/// still in the scene. Writes the number of words to `count`, which follows from `vis_scene_index_limit`. A
/// null or too short `words` is handled as in `vis_visible_ids`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_write_bits(
    visible: *const vis_visible,
    scene: *const vis_scene,
    words: *mut u32,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (visible, words) = unsafe { (reference(visible, "visible")?, buffer(words, capacity, count)?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let scene = &unsafe { reference(scene, "scene") }?.read()?.scene;
        let visible = visible.finished()?;
        let needed = match visible.write_bits(scene, &mut []) {
            Err(BitsError::Length { needed }) => needed,
            _ => 0,
        };
        match words.words(needed)? {
            Some(words) => Ok(visible.write_bits(scene, words)?),
            None => Ok(()),
        }
    })
}

/// Writes the ids of objects that are visible and were not in the last frame, like `vis_visible_ids`. None
/// unless the set was created with changes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_newly_visible(
    visible: *const vis_visible,
    ids: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (visible, ids) = unsafe { (reference(visible, "visible")?, buffer(ids, capacity, count)?) };
        let visible = visible.finished()?;
        ids.fill(visible.newly_visible().count(), visible.newly_visible().map(ObjectId::to_bits))
    })
}

/// Writes the ids of objects that were visible in the last frame and are not now, like `vis_visible_ids`.
/// Includes removed objects. None unless the set was created with changes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_newly_hidden(
    visible: *const vis_visible,
    ids: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (visible, ids) = unsafe { (reference(visible, "visible")?, buffer(ids, capacity, count)?) };
        let visible = visible.finished()?;
        ids.fill(visible.newly_hidden().count(), visible.newly_hidden().map(ObjectId::to_bits))
    })
}
