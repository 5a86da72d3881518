//! The scene: its objects and their properties.

use crate::error::{Error, border, vis_status};
use crate::handle::Guarded;
use crate::object_data::ObjectData;
use crate::pointer::{array, buffer, create, destroy, out, reference};
use std::sync::{RwLockReadGuard, RwLockWriteGuard};
use visibility_core::glam::DVec3;
use visibility_core::scene::DrawRange;
use visibility_core::{Aabb, Object, ObjectId, Scene};

/// Scene: objects, their hierarchy and their occluder meshes.
pub struct vis_scene(Guarded<State>);

/// Scene with what draw lists and levels of detail know of its objects, and scratch memory for batches. Once
/// the scratch memory has grown, frames allocate nothing.
pub(crate) struct State {
    pub(crate) scene: Scene,
    pub(crate) moved: Vec<(ObjectId, Aabb)>,
    pub(crate) placed: Vec<(ObjectId, [f32; 12])>,
    pub(crate) data: ObjectData,
    removed: Vec<ObjectId>,
}

impl vis_scene {
    pub(crate) fn read(&self) -> Result<RwLockReadGuard<'_, State>, Error> {
        self.0.read()
    }

    pub(crate) fn write(&self) -> Result<RwLockWriteGuard<'_, State>, Error> {
        self.0.write()
    }
}

/// Id that no object in any scene has.
pub const VIS_NO_OBJECT: u64 = 0xFFFF_FFFF;

/// Mask of all layers, the default for objects and views.
pub const VIS_ALL_LAYERS: u32 = 0xFFFF_FFFF;

/// Flag of an object that is visible in every view of its layers, whatever the cullers find.
pub const VIS_OBJECT_NEVER_CULL: u32 = 1;

/// Flag of an opaque object that may occlude others. Only an object with an occluder mesh occludes.
pub const VIS_OBJECT_OCCLUDER: u32 = 2;

/// Flag of an object that others are visible through: glass, blended and alpha-tested surfaces. It must not
/// be an occluder. Only the judge (`vis_measure_compare`), which draws triangles, uses this flag.
pub const VIS_OBJECT_SEE_THROUGH: u32 = 4;

/// Flag of an object whose triangles are drawn only from their front, as with backface culling. The judge,
/// proofs and bakes use this flag, and the version of a baked set depends on it. Occluder meshes made by
/// `vis_scene_prepare_occluders` only occlude from the front, with or without this flag.
pub const VIS_OBJECT_ONE_SIDED: u32 = 8;

/// Axis-aligned box.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct vis_box {
    /// Minimum corner: x, y, z.
    pub min: [f32; 3],
    /// Maximum corner: x, y, z.
    pub max: [f32; 3],
}

impl From<vis_box> for Aabb {
    fn from(bounds: vis_box) -> Self {
        Self::from_arrays(bounds.min, bounds.max)
    }
}

/// Description of an object to insert. Start from `vis_object_default`: a description of zeros would put the
/// object on no layer, so that it is never visible.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct vis_object_desc {
    /// Bounds relative to the scene's origin. An object whose bounds are inverted, NaN or infinite is never
    /// culled.
    pub bounds: vis_box,
    /// Layers of the object, one bit per layer. A view shows objects that share a layer with it.
    pub layers: u32,
    /// Cost of drawing the object, in triangles or any other unit.
    pub cost: u32,
    /// Any of the flags `VIS_OBJECT_...`, or 0.
    pub flags: u32,
}

impl vis_object_desc {
    fn object(&self) -> Result<Object, Error> {
        let object = Object::new(self.bounds.into());
        flagged(Object { layers: self.layers, cost: self.cost, ..object }, self.flags)
    }
}

/// Returns the object with exactly these flags. An error for an unknown flag.
fn flagged(object: Object, flags: u32) -> Result<Object, Error> {
    let all = VIS_OBJECT_NEVER_CULL | VIS_OBJECT_OCCLUDER | VIS_OBJECT_SEE_THROUGH | VIS_OBJECT_ONE_SIDED;
    if flags & !all != 0 {
        return Err(Error::argument(format_args!("the flags of an object cannot be {flags:#x}")));
    }
    Ok(Object {
        never_cull: flags & VIS_OBJECT_NEVER_CULL != 0,
        occluder: flags & VIS_OBJECT_OCCLUDER != 0,
        see_through: flags & VIS_OBJECT_SEE_THROUGH != 0,
        one_sided: flags & VIS_OBJECT_ONE_SIDED != 0,
        ..object
    })
}

/// Returns the description of an object on all layers, of cost 1 and without flags.
#[unsafe(no_mangle)]
pub extern "C" fn vis_object_default(bounds: vis_box) -> vis_object_desc {
    vis_object_desc { bounds, layers: VIS_ALL_LAYERS, cost: 1, flags: 0 }
}

/// Creates an empty scene whose origin is the origin of the world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_create(scene: *mut *mut vis_scene) -> vis_status {
    border(|| {
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let place = unsafe { out(scene, "scene") }?;
        let (moved, placed, removed) = (Vec::new(), Vec::new(), Vec::new());
        let (scene, data) = (Scene::new(), ObjectData::default());
        create(place, vis_scene(Guarded::new(State { scene, moved, placed, data, removed })));
        Ok(())
    })
}

/// Destroys a scene. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_destroy(scene: *mut vis_scene) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(scene) }
}

/// Moves the whole scene so that its origin is at the point `origin` of the world (3 numbers). Bounds,
/// triangles and transforms are relative to the origin and keep their values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_origin(scene: *mut vis_scene, origin: *const f64) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, origin) = unsafe { (reference(scene, "scene")?, array(origin, 3, "origin")?) };
        Ok(scene.write()?.scene.set_origin(DVec3::from_slice(origin))?)
    })
}

/// Writes the number of objects.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_count(scene: *const vis_scene, count: *mut usize) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (scene, mut count) = unsafe { (reference(scene, "scene")?, out(count, "count")?) };
        count.set(scene.read()?.scene.len());
        Ok(())
    })
}

/// Writes an upper bound, exclusive, on the index (`(uint32_t)id`) of every object so far: the length of an
/// array indexed by object. `(limit + 31) / 32` words hold one bit per object.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_index_limit(scene: *const vis_scene, limit: *mut usize) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (scene, mut limit) = unsafe { (reference(scene, "scene")?, out(limit, "limit")?) };
        limit.set(scene.read()?.scene.index_limit());
        Ok(())
    })
}

/// Writes whether an id names an object of the scene: false once the object is removed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_contains(
    scene: *const vis_scene,
    object: u64,
    contains: *mut bool,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (scene, mut contains) = unsafe { (reference(scene, "scene")?, out(contains, "contains")?) };
        contains.set(scene.read()?.scene.contains(ObjectId::from_bits(object)));
        Ok(())
    })
}

/// Adds an object and writes its id. The lower half of an id, `(uint32_t)id`, is the object's index: small
/// and dense, for arrays. A later object may get the index of a removed one, never the id.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_insert(
    scene: *mut vis_scene,
    object: *const vis_object_desc,
    id: *mut u64,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, object) = unsafe { (reference(scene, "scene")?, reference(object, "object")?) };
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let mut id = unsafe { out(id, "id") }?;
        let object = object.object()?;
        id.set(scene.write()?.scene.insert(object).to_bits());
        Ok(())
    })
}

/// Adds `count` objects and writes their ids to `ids`, an array of `count`. On an error, adds none. Much
/// faster than single calls for a new scene.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_insert_batch(
    scene: *mut vis_scene,
    objects: *const vis_object_desc,
    count: usize,
    ids: *mut u64,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, objects) = unsafe { (reference(scene, "scene")?, array(objects, count, "objects")?) };
        if count == 0 {
            return Ok(());
        }
        let mut written = 0;
        // SAFETY: by rule P2 of `visibility.h`, null or valid to write: `count` ids.
        let ids = unsafe { out(ids, "ids").and_then(|_| buffer(ids, count, &raw mut written)) }?;
        let objects: Vec<Object> = objects.iter().map(vis_object_desc::object).collect::<Result<_, _>>()?;
        let inserted = scene.write()?.scene.insert_batch(objects);
        ids.fill(inserted.len(), inserted.into_iter().map(ObjectId::to_bits))
    })
}

/// Removes an object. Its id becomes invalid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_remove(scene: *mut vis_scene, object: u64) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let scene = unsafe { reference(scene, "scene") }?;
        Ok(scene.write()?.scene.remove(ObjectId::from_bits(object))?)
    })
}

/// Removes `count` objects. If an id is unknown or listed twice, removes none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_remove_batch(
    scene: *mut vis_scene,
    ids: *const u64,
    count: usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, ids) = unsafe { (reference(scene, "scene")?, array(ids, count, "ids")?) };
        let State { scene, removed, .. } = &mut *scene.write()?;
        removed.clear();
        removed.extend(ids.iter().copied().map(ObjectId::from_bits));
        Ok(scene.remove_batch(removed)?)
    })
}

/// Sets the layers of an object, one bit per layer. With 0 the object is in no view.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_layers(scene: *mut vis_scene, object: u64, layers: u32) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let scene = unsafe { reference(scene, "scene") }?;
        Ok(scene.write()?.scene.set_layers(ObjectId::from_bits(object), layers)?)
    })
}

/// Sets the flags of an object to any of the flags `VIS_OBJECT_...`, or 0, and clears all others. To open a
/// door that occludes, clear `VIS_OBJECT_OCCLUDER` of the door.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_flags(scene: *mut vis_scene, object: u64, flags: u32) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let scene = unsafe { reference(scene, "scene") }?;
        let (scene, id) = (&mut scene.write()?.scene, ObjectId::from_bits(object));
        let former = scene.object(id)?;
        let object = flagged(former, flags)?;
        if former.never_cull != object.never_cull {
            scene.set_never_cull(id, object.never_cull)?;
        }
        scene.set_see_through(id, object.see_through)?;
        scene.set_one_sided(id, object.one_sided)?;
        Ok(scene.set_occluder(id, object.occluder)?)
    })
}

/// Sets the distances from the eye, in metres, at which an object is drawn, for the stage
/// `vis_pipeline_add_contribution`: from `begin` to `end`, which may be infinite. Other stages ignore the
/// range. If two levels of detail have different bounds, adjoining ranges leave distances at which neither is
/// drawn. To avoid this, make the far level the parent of the near one with `vis_scene_set_hlod_parent`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_draw_range(
    scene: *mut vis_scene,
    object: u64,
    begin: f32,
    end: f32,
) -> vis_status {
    let range = DrawRange { begin, end, ..DrawRange::ALWAYS };
    // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
    border(|| unsafe { set_draw_range(scene, object, range) })
}

/// Sets the distances at which an object is drawn, as `vis_scene_set_draw_range` does, and the length
/// `margin` in metres, finite, inside of the range, over which the object fades in from `begin` on and out up
/// to `end`. A range from 0 does not fade in. `vis_lod` has the opacity. An object that fades hides nothing
/// at any distance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_draw_range_with_margin(
    scene: *mut vis_scene,
    object: u64,
    begin: f32,
    end: f32,
    margin: f32,
) -> vis_status {
    // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
    border(|| unsafe { set_draw_range(scene, object, DrawRange { begin, end, margin }) })
}

/// Sets the draw range of an object.
///
/// # Safety
/// `scene` must be null or valid to read, by rule P1 of `visibility.h`.
unsafe fn set_draw_range(scene: *mut vis_scene, object: u64, range: DrawRange) -> Result<(), Error> {
    // SAFETY: the caller's promise.
    let scene = unsafe { reference(scene, "scene") }?;
    Ok(scene.write()?.scene.set_draw_range(ObjectId::from_bits(object), range)?)
}

/// Makes `parent` replace an object beyond the begin of the parent's draw range, for the stage
/// `vis_pipeline_add_contribution`; `VIS_NO_OBJECT` for no parent. Distances of both are measured from the
/// parent's bounds, which must contain the object's bounds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_hlod_parent(
    scene: *mut vis_scene,
    object: u64,
    parent: u64,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let scene = unsafe { reference(scene, "scene") }?;
        let parent = (parent != VIS_NO_OBJECT).then(|| ObjectId::from_bits(parent));
        Ok(scene.write()?.scene.set_hlod_parent(ObjectId::from_bits(object), parent)?)
    })
}
