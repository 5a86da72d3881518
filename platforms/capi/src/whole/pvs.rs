//! Baked sets: the targets that may be visible from each viewcell.

use super::volume::{vis_volume, volumes};
use crate::error::{Error, border, vis_status};
use crate::pointer::{array, buffer, create, destroy, out, reference};
use crate::scene::vis_scene;
use std::sync::Arc;
use visibility_bake::BakedSet;
use visibility_core::ObjectId;
use visibility_core::pvs::{Pvs, PvsTargets, ScenePvs, ViewcellId};

/// Potentially visible set: for each viewcell the targets, cells or objects, that may be visible from there.
/// It never changes.
pub struct vis_pvs(pub(crate) Pvs);

/// Potentially visible set prepared for a scene. It never changes.
pub struct vis_scene_pvs(Arc<ScenePvs>);

impl vis_scene_pvs {
    pub(crate) fn shared(&self) -> Arc<ScenePvs> {
        self.0.clone()
    }
}

/// Loads a set from the `length` bytes that `vis_pvs_write` has written. The bytes are checked. For files of
/// the program `bake`, use `vis_scene_pvs_read_version`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pvs_read(bytes: *const u8, length: usize, pvs: *mut *mut vis_pvs) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (bytes, place) = unsafe { (array(bytes, length, "bytes")?, out(pvs, "pvs")?) };
        create(place, vis_pvs(Pvs::from_bytes(bytes)?));
        Ok(())
    })
}

/// Makes a set of objects from rows, for sets of your own baker. Viewcell `i` sees the targets from
/// `targets[row_ends[i - 1]]` (0 for the first) up to `targets[row_ends[i]]`, exclusive. The targets of each
/// row are strictly ascending and below `target_count`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pvs_create(
    target_count: usize,
    row_ends: *const usize,
    viewcell_count: usize,
    targets: *const u32,
    targets_length: usize,
    pvs: *mut *mut vis_pvs,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (ends, place) = unsafe { (array(row_ends, viewcell_count, "row_ends")?, out(pvs, "pvs")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let targets = unsafe { array(targets, targets_length, "targets") }?;
        let starts = std::iter::once(&0).chain(ends);
        let rows = starts.zip(ends).map(|(&start, &end)| {
            let bad = || Error::argument(format_args!("a row cannot end at {end} after {start}"));
            targets.get(start..end).ok_or_else(bad)
        });
        let rows = rows.collect::<Result<Vec<_>, Error>>()?;
        let before = |viewcell: ViewcellId| viewcell.0.checked_sub(1).map(ViewcellId);
        create(place, vis_pvs(Pvs::new(PvsTargets::Objects, target_count, &rows, before)?));
        Ok(())
    })
}

/// Destroys a set. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pvs_destroy(pvs: *mut vis_pvs) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(pvs) }
}

/// Writes the bytes of a set, to be stored unchanged, and their number to `count`. With a null `bytes`,
/// writes only the number. Returns `VIS_ERROR_TOO_SHORT` if `bytes` is too short.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pvs_write(
    pvs: *const vis_pvs,
    bytes: *mut u8,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (pvs, bytes) = unsafe { (reference(pvs, "pvs")?, buffer(bytes, capacity, count)?) };
        bytes.fill(pvs.0.as_bytes().len(), pvs.0.as_bytes().iter().copied())
    })
}

/// Writes the number of viewcells and the number of targets.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pvs_counts(
    pvs: *const vis_pvs,
    viewcells: *mut usize,
    targets: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (pvs, mut viewcells) = unsafe { (reference(pvs, "pvs")?, out(viewcells, "viewcells")?) };
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let mut targets = unsafe { out(targets, "targets") }?;
        viewcells.set(pvs.0.viewcell_count());
        targets.set(pvs.0.target_count());
        Ok(())
    })
}

/// Writes whether a target may be visible from a viewcell; false if the set has no such target or viewcell.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pvs_sees(
    pvs: *const vis_pvs,
    viewcell: u32,
    target: u32,
    sees: *mut bool,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (pvs, mut sees) = unsafe { (reference(pvs, "pvs")?, out(sees, "sees")?) };
        sees.set(pvs.0.sees(ViewcellId(viewcell), target));
        Ok(())
    })
}

/// Writes the row of a viewcell as one bit per target: bit `target % 32` of word `target / 32` is set if the
/// target may be visible from there. Writes the number of words to `count`. A null or too short `words` is
/// handled as in `vis_pvs_write`. Faster than `vis_pvs_sees` for many targets.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_pvs_write_row(
    pvs: *const vis_pvs,
    viewcell: u32,
    words: *mut u32,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (pvs, words) = unsafe { (reference(pvs, "pvs")?, buffer(words, capacity, count)?) };
        if viewcell as usize >= pvs.0.viewcell_count() {
            let message = format_args!("the set has no viewcell {viewcell}");
            return Err(Error::new(vis_status::VIS_ERROR_UNKNOWN_ID, message));
        }
        // The number of targets may be forged, so memory is only used if the caller's buffer has room for all
        // bits.
        let row = std::iter::once_with(|| {
            let mut row = Vec::new();
            pvs.0.write_bits(ViewcellId(viewcell), &mut row);
            row
        });
        let halves = row.flatten().flat_map(|word| [word as u32, (word >> 32) as u32]);
        words.fill(pvs.0.target_count().div_ceil(32), halves)
    })
}

/// Prepares a set for the present state of a scene, for `vis_pipeline_add_pvs`. Viewcell `i` of the set is
/// the region `viewcells[i]`; `planes` as in `vis_cells_create`. The arrays `objects` and `targets`, both of
/// length `pair_count`, assign targets to objects; an object may have several. Objects without a target, and
/// objects that change later, are never hidden. The set may be destroyed afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_pvs_create(
    scene: *const vis_scene,
    pvs: *const vis_pvs,
    viewcells: *const vis_volume,
    viewcell_count: usize,
    planes: *const f64,
    plane_count: usize,
    objects: *const u64,
    targets: *const u32,
    pair_count: usize,
    scene_pvs: *mut *mut vis_scene_pvs,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, pvs) = unsafe { (reference(scene, "scene")?, reference(pvs, "pvs")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let given = unsafe { array(viewcells, viewcell_count, "viewcells") }?;
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 4 numbers for each of `plane_count`.
        let planes = unsafe { array(planes.cast::<[f64; 4]>(), plane_count, "planes") }?;
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let objects = unsafe { array(objects, pair_count, "objects") }?;
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (targets, place) =
            unsafe { (array(targets, pair_count, "targets")?, out(scene_pvs, "scene_pvs")?) };
        if pvs.0.viewcell_count() != viewcell_count {
            let rows = pvs.0.viewcell_count();
            let message = format_args!("{viewcell_count} viewcells for a set that has {rows}");
            return Err(Error::argument(message));
        }
        let pairs = objects.iter().copied().map(ObjectId::from_bits).zip(targets.iter().copied());
        let regions = volumes(given, planes)?;
        let prepared = ScenePvs::new(&scene.read()?.scene, pvs.0.clone(), regions, pairs);
        create(place, vis_scene_pvs(Arc::new(prepared)));
        Ok(())
    })
}

/// Loads the `length` bytes of a file that the program `bake` has written, for `vis_pipeline_add_pvs`. The
/// bytes are checked. The scene must have exactly the objects of the baked scene, inserted in the same order
/// with the same bounds. Objects that change later are never hidden. `version` is the level's version as
/// printed by `bake`: a hash of everything the bake depends on, triangles included. Returns
/// `VIS_ERROR_ARGUMENT` for another scene or version.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_pvs_read_version(
    scene: *const vis_scene,
    bytes: *const u8,
    length: usize,
    version: u64,
    scene_pvs: *mut *mut vis_scene_pvs,
) -> vis_status {
    // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
    unsafe { read(scene, bytes, length, Some(version), scene_pvs) }
}

/// Loads a file like `vis_scene_pvs_read_version`, for a level without a stored version. An edit that changes
/// no bounds, such as a new door in a wall, is not noticed, and objects that it makes visible are hidden. So
/// pipelines with the set are `VIS_ACCURACY_APPROXIMATE`, and `vis_pipeline_lacks` reports the reason.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_pvs_read(
    scene: *const vis_scene,
    bytes: *const u8,
    length: usize,
    scene_pvs: *mut *mut vis_scene_pvs,
) -> vis_status {
    // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
    unsafe { read(scene, bytes, length, None, scene_pvs) }
}

/// Loads a file. Compares its version with that of the level, if given.
///
/// # Safety
/// Pointers are null, or valid to read or write, by rules P1 and P2 of `visibility.h`.
unsafe fn read(
    scene: *const vis_scene,
    bytes: *const u8,
    length: usize,
    version: Option<u64>,
    scene_pvs: *mut *mut vis_scene_pvs,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, bytes) = unsafe { (reference(scene, "scene")?, array(bytes, length, "bytes")?) };
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let place = unsafe { out(scene_pvs, "scene_pvs") }?;
        let prepared = BakedSet::from_bytes(bytes)?.for_level(&scene.read()?.scene, version)?;
        create(place, vis_scene_pvs(Arc::new(prepared)));
        Ok(())
    })
}

/// Destroys a prepared set; pipelines that use it keep it alive. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_pvs_destroy(pvs: *mut vis_scene_pvs) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(pvs) }
}
