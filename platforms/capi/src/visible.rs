//! Sets of visible objects: the result of a frame.

use crate::error::{Error, border, vis_status};
use crate::handle::Guarded;
use crate::pointer::{buffer, create, destroy, out, reference};
use crate::scene::vis_scene;
use std::sync::{RwLockReadGuard, RwLockWriteGuard};
use visibility_core::visible_set::BitsError;
use visibility_core::{ObjectId, VisibleSet};

/// The objects that a view sees: the result of `vis_pipeline_cull`. It stays what it is while the scene
/// changes, so that a render thread can read it.
pub struct vis_visible(Guarded<VisibleSet>);

impl vis_visible {
    /// Returns the set of the last frame, or an error if no frame was culled yet: the empty list would say
    /// that nothing is visible.
    pub(crate) fn finished(&self) -> Result<RwLockReadGuard<'_, VisibleSet>, Error> {
        let visible = self.0.read()?;
        if visible.is_finished() { Ok(visible) } else { Err(BitsError::Unfinished.into()) }
    }

    pub(crate) fn write(&self) -> Result<RwLockWriteGuard<'_, VisibleSet>, Error> {
        self.0.write()
    }
}

/// Creates a set for the results of one view. With `with_changes` it also tells what became visible and
/// hidden since the frame before, for a few nanoseconds per visible object.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_create(
    with_changes: bool,
    visible: *mut *mut vis_visible,
) -> vis_status {
    border(|| {
        // SAFETY: the header's rules for pointers.
        let place = unsafe { out(visible, "visible") }?;
        let set = if with_changes { VisibleSet::with_changes() } else { VisibleSet::new() };
        create(place, vis_visible(Guarded::new(set)));
        Ok(())
    })
}

/// Destroys a set. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_destroy(visible: *mut vis_visible) {
    // SAFETY: the header's rules for pointers.
    unsafe { destroy(visible) }
}

/// Writes the number of visible objects.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_count(visible: *const vis_visible, count: *mut usize) -> vis_status {
    border(|| {
        // SAFETY: the header's rules for pointers.
        let (visible, mut count) = unsafe { (reference(visible, "visible")?, out(count, "count")?) };
        count.set(visible.finished()?.ids().len());
        Ok(())
    })
}

/// Writes whether an object is visible. False if it has been removed from the scene since.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_contains(
    visible: *const vis_visible,
    scene: *const vis_scene,
    object: u64,
    contains: *mut bool,
) -> vis_status {
    border(|| {
        // SAFETY: the header's rules for pointers.
        let (visible, scene) = unsafe { (reference(visible, "visible")?, reference(scene, "scene")?) };
        // SAFETY: as before.
        let mut contains = unsafe { out(contains, "contains") }?;
        let scene = &scene.read()?.scene;
        contains.set(visible.finished()?.contains(scene, ObjectId::from_bits(object)));
        Ok(())
    })
}

/// Sorts the visible objects by ascending index, the order in which arrays that are indexed by object are
/// read fastest, and drops those removed from the scene since. Without it, neighbours in space follow each
/// other.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_sort_by_index(
    visible: *mut vis_visible,
    scene: *const vis_scene,
) -> vis_status {
    border(|| {
        // SAFETY: the header's rules for pointers.
        let (visible, scene) = unsafe { (reference(visible, "visible")?, reference(scene, "scene")?) };
        let scene = &scene.read()?.scene;
        drop(visible.finished()?);
        visible.write()?.sort_by_index(scene);
        Ok(())
    })
}

/// Writes the ids of the visible objects, and their number to `count`. With a null `ids` writes the number
/// alone; returns `VIS_ERROR_TOO_SHORT` if `ids` has room for fewer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_ids(
    visible: *const vis_visible,
    ids: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: the header's rules for pointers.
        let (visible, ids) = unsafe { (reference(visible, "visible")?, buffer(ids, capacity, count)?) };
        let visible = visible.finished()?;
        ids.fill(visible.ids().len(), visible.ids().iter().map(|id| id.to_bits()))
    })
}

/// Like `vis_visible_ids`, writes the indices of the visible objects: half the memory, for engines whose data
/// is in arrays.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_indices(
    visible: *const vis_visible,
    indices: *mut u32,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: the header's rules for pointers.
        let (visible, indices) =
            unsafe { (reference(visible, "visible")?, buffer(indices, capacity, count)?) };
        let visible = visible.finished()?;
        indices.fill(visible.ids().len(), visible.ids().iter().map(|id| id.index() as u32))
    })
}

/// Writes one bit per object index, `index % 32` of word `index / 32`, set for visible objects, and the
/// number of words to `count`. Null and too short as for `vis_visible_ids`; the number of words follows from
/// `vis_scene_index_limit`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_write_bits(
    visible: *const vis_visible,
    words: *mut u32,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: the header's rules for pointers.
        let (visible, words) = unsafe { (reference(visible, "visible")?, buffer(words, capacity, count)?) };
        let visible = visible.finished()?;
        let needed = match visible.write_bits(&mut []) {
            Err(BitsError::TooShort { needed }) => needed,
            other => other.map(|()| 0)?,
        };
        match words.words(needed)? {
            Some(words) => Ok(visible.write_bits(words)?),
            None => Ok(()),
        }
    })
}

/// Writes the ids of the objects that are visible and were not in the frame before, as `vis_visible_ids`
/// does. None unless the set was created with changes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_newly_visible(
    visible: *const vis_visible,
    ids: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: the header's rules for pointers.
        let (visible, ids) = unsafe { (reference(visible, "visible")?, buffer(ids, capacity, count)?) };
        let visible = visible.finished()?;
        ids.fill(visible.newly_visible().count(), visible.newly_visible().map(ObjectId::to_bits))
    })
}

/// Writes the ids of the objects that were visible in the frame before and are not, as `vis_visible_ids`
/// does; removed objects too. None unless the set was created with changes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_visible_newly_hidden(
    visible: *const vis_visible,
    ids: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: the header's rules for pointers.
        let (visible, ids) = unsafe { (reference(visible, "visible")?, buffer(ids, capacity, count)?) };
        let visible = visible.finished()?;
        ids.fill(visible.newly_hidden().count(), visible.newly_hidden().map(ObjectId::to_bits))
    })
}
