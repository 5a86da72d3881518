//! Draw lists: visible objects in groups of one key, with the command that draws each group at once.

use crate::error::{Error, border, vis_status};
use crate::handle::Guarded;
use crate::lods::vis_lods;
use crate::object_data::GREATEST_KEY;
use crate::pointer::{array, buffer, create, destroy, out, reference};
use crate::scene::{State, vis_scene};
use crate::visible::vis_visible;
use visibility_core::ObjectId;
use visibility_frame::draw_list::{DrawGroup, DrawIndexedIndirect, DrawList};
use visibility_frame::lod::Lod;

/// Visible objects grouped by the keys of `vis_scene_set_draw_keys`. Kept from frame to frame, it allocates
/// nothing once it has held the largest frame.
pub struct vis_draw_list(Guarded<DrawList>);

/// The objects of a draw list that have one key: a range of its instances.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct vis_draw_group {
    /// Key of the objects; with levels of detail, the sum of key and level.
    pub key: u32,
    /// Position of the first object among the instances.
    pub first: u32,
    /// Number of objects, at least 1.
    pub count: u32,
}

impl From<DrawGroup> for vis_draw_group {
    fn from(DrawGroup { key, first, count }: DrawGroup) -> Self {
        Self { key, first, count }
    }
}

/// Arguments of one indexed indirect draw call, laid out as `VkDrawIndexedIndirectCommand`,
/// `D3D12_DRAW_INDEXED_ARGUMENTS` and the argument buffers of OpenGL and WebGPU.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct vis_draw_command {
    /// Number of indices of the mesh.
    pub index_count: u32,
    /// Number of instances to draw.
    pub instance_count: u32,
    /// Position of the mesh's first index in the index buffer.
    pub first_index: u32,
    /// Number added to each index of the mesh before the vertex is read.
    pub base_vertex: i32,
    /// Position of the first object among the instances of the draw list.
    pub first_instance: u32,
}

impl From<vis_draw_command> for DrawIndexedIndirect {
    fn from(command: vis_draw_command) -> Self {
        let vis_draw_command { index_count, instance_count, first_index, base_vertex, first_instance } =
            command;
        Self { index_count, instance_count, first_index, base_vertex, first_instance }
    }
}

impl From<DrawIndexedIndirect> for vis_draw_command {
    fn from(command: DrawIndexedIndirect) -> Self {
        let DrawIndexedIndirect { index_count, instance_count, first_index, base_vertex, first_instance } =
            command;
        Self { index_count, instance_count, first_index, base_vertex, first_instance }
    }
}

/// Gives `count` objects their keys in draw lists: the number of the mesh, the material, the first level of
/// the mesh, or several of them in one number; at most 4294967040. New objects have key 0. If an id is
/// unknown, nothing changes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_draw_keys(
    scene: *mut vis_scene,
    ids: *const u64,
    keys: *const u32,
    count: usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, ids) = unsafe { (reference(scene, "scene")?, array(ids, count, "ids")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let keys = unsafe { array(keys, count, "keys") }?;
        if let Some(key) = keys.iter().find(|&&key| key > GREATEST_KEY) {
            return Err(Error::argument(format_args!("the key {key} is more than {GREATEST_KEY}")));
        }
        let State { scene, data, .. } = &mut *scene.write()?;
        Ok(data.set_keys(scene, ids, keys)?)
    })
}

/// Creates an empty draw list.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_draw_list_create(list: *mut *mut vis_draw_list) -> vis_status {
    border(|| {
        // SAFETY: by rule P2 of `visibility.h`, the pointer is null or valid to write.
        let place = unsafe { out(list, "list") }?;
        create(place, vis_draw_list(Guarded::new(DrawList::new())));
        Ok(())
    })
}

/// Destroys a draw list. Does nothing for a null pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_draw_list_destroy(list: *mut vis_draw_list) {
    // SAFETY: by rule P3 of `visibility.h`, the handle is null, or made by this library and unused.
    unsafe { destroy(list) }
}

/// Replaces the content of a draw list with the visible objects that are still in the scene, in groups of
/// one key. Groups are in the order of their keys, the objects of a group in the order of the visible set.
/// Takes a few nanoseconds per object if keys are small: up to about four times the number of objects.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_draw_list_group(
    list: *mut vis_draw_list,
    scene: *const vis_scene,
    visible: *const vis_visible,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (list, scene) = unsafe { (reference(list, "list")?, reference(scene, "scene")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let visible = unsafe { reference(visible, "visible") }?;
        let (state, visible) = (scene.read()?, visible.finished()?);
        list.0.write()?.group(visible.iter(&state.scene), |id| state.data.key(id));
        Ok(())
    })
}

/// Replaces the content of a draw list with the objects of the last frame of `lods` that are still in the
/// scene. The key of a group is the sum of the objects' key and the level to draw, so the levels of a mesh
/// have keys one after another: a mesh of 3 levels has keys k to k + 2, and its objects were given k.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_draw_list_group_levels(
    list: *mut vis_draw_list,
    scene: *const vis_scene,
    lods: *const vis_lods,
) -> vis_status {
    // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
    border(|| unsafe { group_lods(list, scene, lods, |lod| Some(lod.level)) })
}

/// As `vis_draw_list_group_levels`, for the objects that are in a cross-fade alone, by the level that fades
/// out: what is drawn a second time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_draw_list_group_fading(
    list: *mut vis_draw_list,
    scene: *const vis_scene,
    lods: *const vis_lods,
) -> vis_status {
    // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
    border(|| unsafe { group_lods(list, scene, lods, |lod| (lod.fade < 1.0).then_some(lod.previous)) })
}

/// Groups the objects of `lods` for which `level` returns a level, by the sum of their key and this level.
///
/// # Safety
/// Each pointer must be null or valid to read, by rule P1 of `visibility.h`.
unsafe fn group_lods(
    list: *mut vis_draw_list,
    scene: *const vis_scene,
    lods: *const vis_lods,
    level: fn(&Lod) -> Option<u8>,
) -> Result<(), Error> {
    // SAFETY: the caller's promise.
    let (list, scene) = unsafe { (reference(list, "list")?, reference(scene, "scene")?) };
    // SAFETY: the caller's promise.
    let lods = unsafe { reference(lods, "lods") }?;
    let (state, lods) = (scene.read()?, lods.read()?);
    let drawn = lods.selected().iter().filter(|(id, lod)| level(lod).is_some() && state.scene.contains(*id));
    let level = |id: ObjectId| lods.lod(id).as_ref().and_then(level).unwrap_or(0);
    list.0.write()?.group(drawn.map(|&(id, _)| id), |id| state.data.key(id) + u32::from(level(id)));
    Ok(())
}

/// Writes the groups by ascending key, like `vis_visible_ids`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_draw_list_groups(
    list: *const vis_draw_list,
    groups: *mut vis_draw_group,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (list, groups) = unsafe { (reference(list, "list")?, buffer(groups, capacity, count)?) };
        let list = list.0.read()?;
        groups.fill(list.groups().len(), list.groups().iter().copied().map(vis_draw_group::from))
    })
}

/// Writes the index of each object, group after group, like `vis_visible_indices`: the buffer in which a
/// shader looks up the object of an instance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_draw_list_instances(
    list: *const vis_draw_list,
    indices: *mut u32,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (list, indices) = unsafe { (reference(list, "list")?, buffer(indices, capacity, count)?) };
        let list = list.0.read()?;
        indices.fill(list.instances().len(), list.instances().iter().copied())
    })
}

/// Writes the commands that draw the groups, one each, in their order, like `vis_visible_ids`. `meshes[key]`
/// is the command that draws the mesh of a key; its `instance_count` and `first_instance` are replaced by
/// those of the group. Returns `VIS_ERROR_ARGUMENT` if a group's key is not below `mesh_count`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_draw_list_commands(
    list: *const vis_draw_list,
    meshes: *const vis_draw_command,
    mesh_count: usize,
    commands: *mut vis_draw_command,
    capacity: usize,
    count: *mut usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rules P1 and P2 of `visibility.h`, each pointer is null, or valid to read or write.
        let (list, commands) = unsafe { (reference(list, "list")?, buffer(commands, capacity, count)?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let meshes = unsafe { array(meshes, mesh_count, "meshes") }?;
        let list = list.0.read()?;
        let mesh = |key: u32| meshes.get(key as usize).copied().map(DrawIndexedIndirect::from);
        if let Some(group) = list.groups().iter().find(|group| mesh(group.key).is_none()) {
            return Err(Error::argument(format_args!("key {} is not below {mesh_count}", group.key)));
        }
        let made = list.commands(|key| mesh(key).unwrap_or_default()).map(vis_draw_command::from);
        commands.fill(list.groups().len(), made)
    })
}
