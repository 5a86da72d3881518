//! Moving objects: bounds, transforms, and the upkeep of the hierarchy.

use crate::error::{Error, border, vis_status};
use crate::pointer::{array, optional_out, out, reference};
use crate::scene::{State, vis_box, vis_scene};
use visibility_core::{Aabb, ObjectId};

/// Writes the bounds of an object, relative to the scene's origin.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_bounds(
    scene: *const vis_scene,
    object: u64,
    bounds: *mut vis_box,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (scene, mut bounds) = unsafe { (reference(scene, "scene")?, out(bounds, "bounds")?) };
        let Aabb { min, max } = scene.read()?.scene.bounds(ObjectId::from_bits(object))?;
        bounds.set(vis_box { min: min.to_array(), max: max.to_array() });
        Ok(())
    })
}

/// Sets the bounds of an object that has moved or changed its shape. If the bounds change, the object loses
/// its occluder mesh, its triangles and its local bounds, which would no longer match. Move objects that have
/// these with `vis_scene_set_transforms_batch`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_bounds(
    scene: *mut vis_scene,
    object: u64,
    bounds: *const vis_box,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, bounds) = unsafe { (reference(scene, "scene")?, reference(bounds, "bounds")?) };
        Ok(scene.write()?.scene.set_bounds(ObjectId::from_bits(object), (*bounds).into())?)
    })
}

/// Sets the bounds of `count` objects, like `vis_scene_set_bounds`. If an id is unknown, no bounds are set.
/// For objects that move in each frame.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_bounds_batch(
    scene: *mut vis_scene,
    ids: *const u64,
    bounds: *const vis_box,
    count: usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, ids) = unsafe { (reference(scene, "scene")?, array(ids, count, "ids")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let bounds = unsafe { array(bounds, count, "bounds") }?;
        let State { scene, moved, .. } = &mut *scene.write()?;
        moved.clear();
        let pairs = ids.iter().zip(bounds);
        moved.extend(pairs.map(|(&id, &bounds)| (ObjectId::from_bits(id), bounds.into())));
        Ok(scene.set_bounds_batch(moved)?)
    })
}

/// Sets the bounds of an object in its own coordinates. `vis_scene_set_transforms_batch` can then move its
/// bounds and occluder mesh together.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_local_bounds(
    scene: *mut vis_scene,
    object: u64,
    bounds: *const vis_box,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, bounds) = unsafe { (reference(scene, "scene")?, reference(bounds, "bounds")?) };
        Ok(scene.write()?.scene.set_local_bounds(ObjectId::from_bits(object), (*bounds).into())?)
    })
}

/// Moves `count` objects that have local bounds. On an error, moves none. `transforms` has 16 numbers per
/// object: a matrix from the object's coordinates to the scene's, column-major, with the last row 0 0 0 1.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_transforms_batch(
    scene: *mut vis_scene,
    ids: *const u64,
    transforms: *const f32,
    count: usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, ids) = unsafe { (reference(scene, "scene")?, array(ids, count, "ids")?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 16 numbers for each of `count`.
        let transforms = unsafe { array(transforms.cast::<[f32; 16]>(), count, "transforms") }?;
        let State { scene, placed, .. } = &mut *scene.write()?;
        placed.clear();
        for (&id, matrix) in ids.iter().zip(transforms) {
            placed.push((ObjectId::from_bits(id), affine(matrix)?));
        }
        Ok(scene.set_transforms_batch(placed)?)
    })
}

/// Returns the first three rows of a column-major matrix whose fourth row is 0 0 0 1. An error for another
/// fourth row.
pub(crate) fn affine(matrix: &[f32; 16]) -> Result<[f32; 12], Error> {
    let [a, b, c, 0.0, d, e, f, 0.0, g, h, i, 0.0, x, y, z, 1.0] = *matrix else {
        return Err(Error::argument("the last row of a transform is not 0 0 0 1: is it column-major?"));
    };
    Ok([a, b, c, d, e, f, g, h, i, x, y, z])
}

/// Tightens the hierarchy where objects have moved. Call this once per frame. `budget` is the approximate
/// time limit in microseconds. Writes the number of nodes still waiting to `waiting`, which may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_maintain(
    scene: *mut vis_scene,
    budget: usize,
    waiting: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let scene = unsafe { reference(scene, "scene") }?;
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let place = unsafe { optional_out(waiting, "waiting") }?;
        let done = scene.write()?.scene.maintain(budget);
        place.into_iter().for_each(|mut place| place.set(done.waiting));
        Ok(())
    })
}

/// Builds the best hierarchy for the present objects. Call this once after loading, not in each frame. Ids
/// stay valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_rebuild(scene: *mut vis_scene) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let scene = unsafe { reference(scene, "scene") }?;
        scene.write()?.scene.rebuild();
        Ok(())
    })
}
