//! Occluders of a level: its surfaces as few large polygons, for the z-buffer.

use crate::error::{Error, border, vis_status};
use crate::pointer::{array, buffer, create, destroy, out, reference};
use std::sync::Arc;
use visibility_core::glam::Vec3;
use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};

/// Occluders of a level: few large polygons, joined from the level's opaque triangles that stand still. The
/// polygons hide only what the triangles hide.
pub struct vis_level(pub(super) Arc<LevelOccluders>);

/// Makes the occluders of a level from its opaque triangles that stand still, 9 finite coordinates each,
/// counter-clockwise from the front. `two_sided` is whether they hide from behind, too. Takes seconds for a
/// million triangles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_level_create(
    triangles: *const f32,
    triangle_count: usize,
    two_sided: bool,
    level: *mut *mut vis_level,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let place = unsafe { out(level, "level") }?;
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 9 numbers for each of
        // `triangle_count`.
        let given = unsafe { array(triangles.cast::<[[f32; 3]; 3]>(), triangle_count, "triangles") }?;
        let is_finite = |corners: &[[f32; 3]; 3]| corners.as_flattened().iter().all(|x| x.is_finite());
        if let Some(number) = given.iter().position(|corners| !is_finite(corners)) {
            return Err(Error::argument(format_args!("triangle {number} is not finite")));
        }
        let corners = given.iter().map(|corners| corners.map(Vec3::from_array));
        let made: Vec<_> = corners.map(|corners| LevelTriangle { corners, two_sided }).collect();
        create(place, vis_level(Arc::new(LevelOccluders::new(&made, LevelSettings::default())?)));
        Ok(())
    })
}

/// Loads the occluders of a level from a file that `vis_level_write` or a program of the crates wrote. The
/// library cannot tell whether the file is of the level as it is now: occluders of another level hide visible
/// objects. Returns `VIS_ERROR_FORMAT` for bytes that are no such file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_level_read(
    bytes: *const u8,
    length: usize,
    level: *mut *mut vis_level,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (bytes, place) = unsafe { (array(bytes, length, "bytes")?, out(level, "level")?) };
        create(place, vis_level(Arc::new(LevelOccluders::from_bytes(bytes, None)?)));
        Ok(())
    })
}

/// Writes the occluders of a level as a file. A null or too short buffer is handled as in `vis_visible_ids`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_level_write(
    level: *const vis_level,
    bytes: *mut u8,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (level, list) = unsafe { (reference(level, "level")?, buffer(bytes, capacity, count)?) };
        let file = level.0.to_bytes();
        list.fill(file.len(), file.into_iter())
    })
}

/// Destroys the occluders of a level; pipelines that use them keep them alive. Does nothing for a null
/// pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_level_destroy(level: *mut vis_level) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(level) }
}
