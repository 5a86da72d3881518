//! Tests of draw lists through the C interface: groups, instances and commands are those of the Rust crates.

mod common;

use common::{make, message, ok, returns};
use std::ptr::null_mut;
use visibility::vis_status::*;
use visibility::*;
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, FrustumCuller, ObjectId, Pipeline, Pose, Scene, View, VisibleSet};
use visibility_frame::draw_list::{DrawIndexedIndirect, DrawList};
use visibility_frame::lod::LodSelector;
use visibility_testing::Random;

const COUNT: usize = 400;
const SIZES: [f32; 2] = [120.0, 40.0];
/// Number of meshes, each of three levels.
const MESHES: u32 = 5;

/// Reads a list by calling `write` twice: first for the length, then for the list.
fn list<T: Copy>(empty: T, write: impl Fn(*mut T, usize, *mut usize) -> vis_status) -> Vec<T> {
    let mut length = 0;
    ok(write(null_mut(), 0, &raw mut length));
    let mut items = vec![empty; length];
    ok(write(items.as_mut_ptr(), length, &raw mut length));
    items
}

const NO_GROUP: vis_draw_group = vis_draw_group { key: 0, first: 0, count: 0 };

/// Returns the groups of a list as key, first and count, and its instances.
fn content(draw: *const vis_draw_list) -> (Vec<[u32; 3]>, Vec<u32>) {
    // SAFETY: the handle is live, and the lists as long as said.
    let groups = list(NO_GROUP, |to, room, count| unsafe { vis_draw_list_groups(draw, to, room, count) });
    // SAFETY: as before.
    let instances = list(0, |to, room, count| unsafe { vis_draw_list_instances(draw, to, room, count) });
    (groups.iter().map(|group| [group.key, group.first, group.count]).collect(), instances)
}

/// The same of the Rust crates' list.
fn own_content(list: &DrawList) -> (Vec<[u32; 3]>, Vec<u32>) {
    let groups = list.groups().iter().map(|group| [group.key, group.first, group.count]).collect();
    (groups, list.instances().to_vec())
}

/// Returns the command of a mesh's level, with numbers of instances that are to be replaced.
fn mesh(key: u32) -> vis_draw_command {
    let base_vertex = -(key as i32);
    vis_draw_command {
        index_count: 36 * (key + 1),
        instance_count: 77,
        first_index: 1000 * key,
        base_vertex,
        first_instance: 77,
    }
}

#[test]
fn groups_are_those_of_the_crates() {
    let mut random = Random(3);
    let boxes: Vec<vis_box> = (0..COUNT)
        .map(|_| {
            let at = [random.range(-10.0, 90.0), random.range(-30.0, 30.0), 0.0].map(|x| x as f32);
            vis_box { min: at, max: at.map(|x| x + 1.0) }
        })
        .collect();
    let descs: Vec<_> = boxes.iter().map(|&bounds| vis_object_default(bounds)).collect();
    let (scene, view, pipeline) = (make(vis_scene_create), make(vis_view_create), make(vis_pipeline_create));
    let [draw, fading] = [(); 2].map(|()| make(vis_draw_list_create));
    let (mut ids, mut visible, mut lods) = (vec![0; COUNT], null_mut(), null_mut());
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        ok(vis_scene_insert_batch(scene, descs.as_ptr(), COUNT, ids.as_mut_ptr()));
        ok(vis_scene_set_lod_sizes(scene, ids.as_ptr(), COUNT, SIZES.as_ptr(), SIZES.len()));
        ok(vis_visible_create(false, &raw mut visible));
        ok(vis_lods_create(1080.0, 0.1, 0.25, &raw mut lods));
        ok(vis_pipeline_add_frustum(pipeline));
    }
    let mut rust = Scene::new();
    rust.insert_batch(boxes.iter().map(|&vis_box { min, max }| Aabb::from_arrays(min, max)));
    let (mut own, mut selector) = (Pipeline::new().with(FrustumCuller::new()), LodSelector::new(1080.0));
    let (mut set, mut own_list, mut own_fading) = (VisibleSet::new(), DrawList::new(), DrawList::new());
    let (mut faded, mut widest) = (0, 0);
    for frame in 0..60 {
        // In some frames keys are far apart, up to the greatest. Objects 0 to 9 have no key at first.
        let first = if frame < 5 { 10 } else { 0 };
        let spread = if frame % 7 == 3 { u32::MAX / 15 } else { 3 };
        let key = |index: usize| if index < first { 0 } else { index as u32 % MESHES * spread };
        let keys: Vec<u32> = (first..COUNT).map(key).collect();
        let eye = [f64::from(frame), 0.0, 0.5];
        let pose = vis_pose { eye, target: [eye[0] + 1.0, 0.0, 0.5], up: [0.0, 0.0, 1.0] };
        let [eye, target, up] = [pose.eye, pose.target, pose.up].map(DVec3::from_array);
        let camera = View::perspective(Pose::look_at(eye, target, up), 1.0, 1.5, 0.1, 500.0).expect("a view");
        // SAFETY: handles are live, and arrays as long as said.
        unsafe {
            ok(vis_scene_set_draw_keys(scene, ids[first..].as_ptr(), keys.as_ptr(), keys.len()));
            ok(vis_view_set_perspective(view, &raw const pose, 1.0, 1.5, 0.1, 500.0));
            ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
            ok(vis_lods_select(lods, scene, view, visible, 0.03));
            ok(vis_draw_list_group(draw, scene, visible));
        }
        own.cull(&rust, &camera, &mut set);
        selector.select(&rust, &camera, &set, 0.03, |_| &SIZES);
        own_list.group(set.iter(&rust), |id| key(id.index()));
        assert_eq!(content(draw), own_content(&own_list), "frame {frame}: by key");
        widest = widest.max(own_list.groups().len());
        let of_level = |id: ObjectId, level: u8| key(id.index()) + u32::from(level);
        own_list.group(set.iter(&rust), |id| of_level(id, selector.lod(id).expect("visible").level));
        let in_fade = selector.selected().iter().filter(|(_, lod)| lod.fade < 1.0).map(|&(id, _)| id);
        own_fading.group(in_fade, |id| of_level(id, selector.lod(id).expect("visible").previous));
        // SAFETY: handles are live, and arrays as long as said.
        unsafe {
            ok(vis_draw_list_group_levels(draw, scene, lods));
            ok(vis_draw_list_group_fading(fading, scene, lods));
        }
        assert_eq!(content(draw), own_content(&own_list), "frame {frame}: by key and level");
        assert_eq!(content(fading), own_content(&own_fading), "frame {frame}: by the level that fades out");
        faded += own_fading.instances().len();
        if spread > 3 {
            continue;
        }
        let meshes: Vec<_> = (0..3 * MESHES).map(mesh).collect();
        let write = |to, room, count: *mut usize| {
            // SAFETY: handles are live, and arrays as long as said.
            unsafe { vis_draw_list_commands(draw, meshes.as_ptr(), meshes.len(), to, room, count) }
        };
        let expected: Vec<vis_draw_command> = own_list
            .commands(|key| DrawIndexedIndirect::from(mesh(key)))
            .map(vis_draw_command::from)
            .collect();
        assert_eq!(list(mesh(0), write), expected, "frame {frame}: commands");
    }
    assert!(faded > 30 && widest == MESHES as usize, "{faded} objects in a fade, {widest} groups");

    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        // A removed object is drawn no more, neither by its level nor by the set.
        let shown = content(draw).1;
        let gone = shown[0];
        ok(vis_scene_remove(scene, ids[gone as usize]));
        ok(vis_draw_list_group_levels(draw, scene, lods));
        let by_level = content(draw).1;
        ok(vis_draw_list_group(draw, scene, visible));
        for left in [by_level, content(draw).1] {
            assert_eq!(left.len(), shown.len() - 1, "instances without the removed object");
            assert!(!left.contains(&gone), "the removed object {gone}");
        }
        vis_draw_list_destroy(draw);
        vis_draw_list_destroy(fading);
        vis_draw_list_destroy(null_mut());
        vis_lods_destroy(lods);
        vis_visible_destroy(visible);
        vis_pipeline_destroy(pipeline);
        vis_view_destroy(view);
        vis_scene_destroy(scene);
    }
}

#[test]
fn what_is_wrong_with_draw_lists_is_refused_by_name() {
    let (scene, view, pipeline) = (make(vis_scene_create), make(vis_view_create), make(vis_pipeline_create));
    let (draw, mut visible, mut ids) = (make(vis_draw_list_create), null_mut(), [0; 2]);
    let cube = vis_box { min: [5.0, -1.0, -1.0], max: [6.0, 1.0, 1.0] };
    let pose = vis_pose { eye: [0.0; 3], target: [1.0, 0.0, 0.0], up: [0.0, 0.0, 1.0] };
    let greatest = u32::MAX - 255;
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        ok(vis_visible_create(false, &raw mut visible));
        ok(vis_scene_insert_batch(scene, [vis_object_default(cube); 2].as_ptr(), 2, ids.as_mut_ptr()));
        ok(vis_view_set_perspective(view, &raw const pose, 1.0, 1.5, 0.1, 500.0));
        returns(vis_draw_list_group(draw, scene, visible), VIS_ERROR_STATE);
        ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
        let keys = |ids: &[u64], keys: &[u32]| {
            vis_scene_set_draw_keys(scene, ids.as_ptr(), keys.as_ptr(), keys.len())
        };
        ok(keys(&ids, &[2, greatest]));
        returns(keys(&ids, &[3, greatest + 1]), VIS_ERROR_ARGUMENT);
        assert_eq!(message(), "the key 4294967041 is more than 4294967040", "a key that is too great");
        returns(keys(&[ids[0], VIS_NO_OBJECT], &[7, 7]), VIS_ERROR_UNKNOWN_ID);
        ok(vis_draw_list_group(draw, scene, visible));
        let expected = (vec![[2, 0, 1], [greatest, 1, 1]], vec![0, 1]);
        assert_eq!(content(draw), expected, "keys after calls that were refused");
        let (mut one, mut count) = (mesh(9), 0);
        let status = vis_draw_list_commands(draw, [mesh(0); 3].as_ptr(), 3, &raw mut one, 1, &raw mut count);
        returns(status, VIS_ERROR_ARGUMENT);
        assert_eq!(message(), "key 4294967040 is not below 3", "a key without a mesh");
        ok(keys(&ids, &[0, 1]));
        ok(vis_draw_list_group(draw, scene, visible));
        let status = vis_draw_list_commands(draw, [mesh(0); 2].as_ptr(), 2, &raw mut one, 1, &raw mut count);
        returns(status, VIS_ERROR_TOO_SHORT);
        assert_eq!((one, count), (mesh(9), 2), "a buffer that is too short, and the length that it needs");
        returns(vis_draw_list_group_levels(draw, scene, null_mut()), VIS_ERROR_NULL);
        assert_eq!(content(draw).1, [0, 1], "the list after calls that were refused");
        vis_draw_list_destroy(draw);
        vis_visible_destroy(visible);
        vis_pipeline_destroy(pipeline);
        vis_view_destroy(view);
        vis_scene_destroy(scene);
    }
}
