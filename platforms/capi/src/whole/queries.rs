//! Queries of a scene without a view: objects by ray and box, for picking and game logic.

use crate::error::{Error, border, vis_status};
use crate::pointer::{buffer, out, reference};
use crate::scene::{VIS_NO_OBJECT, vis_box, vis_scene};
use visibility_core::ObjectId;
use visibility_core::glam::Vec3;
use visibility_frame::queries::{Ray, RayHit, SceneQuery};

/// An object whose bounds a ray hits.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct vis_ray_hit {
    /// Id of the object.
    pub object: u64,
    /// Distance in metres from the ray's origin to the object's bounds: 0 for bounds around the origin, and
    /// never more than the exact distance.
    pub distance: f32,
}

impl From<RayHit> for vis_ray_hit {
    fn from(hit: RayHit) -> Self {
        Self { object: hit.id.to_bits(), distance: hit.distance }
    }
}

/// Returns the ray of an origin and a direction.
///
/// # Safety
/// By rule P1 of `visibility.h`, each pointer is null, or valid to read: 3 numbers each.
unsafe fn ray_of(origin: *const f32, direction: *const f32, max_distance: f32) -> Result<Ray, Error> {
    // SAFETY: the caller promises what is asked for here.
    let (origin, direction) =
        unsafe { (reference(origin.cast(), "origin")?, reference(direction.cast(), "direction")?) };
    Ok(Ray::new(Vec3::from_array(*origin), Vec3::from_array(*direction), max_distance)?)
}

/// Writes the objects on `layers` whose bounds a ray hits, nearest first: first candidates for picking by
/// triangles, since no triangle of an object is nearer than its bounds. The ray leads from `origin`, relative
/// to the scene's origin, along `direction`, 3 coordinates each, up to `max_distance` metres, which may be
/// infinite. An object whose bounds are inverted, NaN or infinite is hit at distance 0. A null or too short
/// buffer is handled as in `vis_visible_ids`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_ray_hits(
    scene: *const vis_scene,
    origin: *const f32,
    direction: *const f32,
    max_distance: f32,
    layers: u32,
    hits: *mut vis_ray_hit,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (scene, list) = unsafe { (reference(scene, "scene")?, buffer(hits, capacity, count)?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 numbers each.
        let ray = unsafe { ray_of(origin, direction, max_distance) }?;
        let mut found = Vec::new();
        SceneQuery::new(&scene.read()?.scene).on_layers(layers).all_hits(&ray, &mut found);
        list.fill(found.len(), found.into_iter().map(vis_ray_hit::from))
    })
}

/// Writes the first of the objects that `vis_scene_ray_hits` would write. Its id is `VIS_NO_OBJECT`, and its
/// distance infinite, if there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_first_hit(
    scene: *const vis_scene,
    origin: *const f32,
    direction: *const f32,
    max_distance: f32,
    layers: u32,
    hit: *mut vis_ray_hit,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (scene, mut place) = unsafe { (reference(scene, "scene")?, out(hit, "hit")?) };
        // SAFETY: by rule P1 of `visibility.h`, null or valid to read: 3 numbers each.
        let ray = unsafe { ray_of(origin, direction, max_distance) }?;
        let found = SceneQuery::new(&scene.read()?.scene).on_layers(layers).first_hit(&ray);
        let none = vis_ray_hit { object: VIS_NO_OBJECT, distance: f32::INFINITY };
        place.set(found.map_or(none, vis_ray_hit::from));
        Ok(())
    })
}

/// Writes the ids of the objects on `layers` whose bounds touch a box, relative to the scene's origin, like
/// `vis_visible_ids`. Exact; an inverted or NaN box touches every object.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_in_box(
    scene: *const vis_scene,
    area: *const vis_box,
    layers: u32,
    ids: *mut u64,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (scene, list) = unsafe { (reference(scene, "scene")?, buffer(ids, capacity, count)?) };
        // SAFETY: by rule P1 of `visibility.h`, the pointer is null or valid to read.
        let area = unsafe { reference(area, "area") }?;
        let mut found = Vec::new();
        SceneQuery::new(&scene.read()?.scene).on_layers(layers).in_box(&(*area).into(), &mut found);
        list.fill(found.len(), found.iter().copied().map(ObjectId::to_bits))
    })
}
