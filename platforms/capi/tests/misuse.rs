//! Tests of mistakes in C programs: null and misaligned pointers, removed ids, short buffers, invalid
//! matrices, conflicting threads. Each call must return a status code, and a message that names the mistake.

mod common;

use common::{make, message, ok, returns};
use std::ffi::{CStr, CString};
use std::ptr::{null, null_mut};
use visibility::vis_depth::*;
use visibility::vis_status::*;
use visibility::*;

/// Asserts that a call failed with the expected status and a message that contains `said`.
#[track_caller]
fn refused(status: vis_status, expected: vis_status, said: &str) {
    returns(status, expected);
    assert_eq!(message(), said, "message of a call that was refused with {expected:?}");
}

static BOX: vis_box = vis_box { min: [5.0, -1.0, -1.0], max: [6.0, 1.0, 1.0] };

/// Scene of some boxes ahead of the eye, with all handles needed to cull it. The handles are never destroyed,
/// since tests end soon.
struct Setting {
    scene: *mut vis_scene,
    view: *mut vis_view,
    pipeline: *mut vis_pipeline,
    visible: *mut vis_visible,
    ids: Vec<u64>,
}

impl Setting {
    fn new(count: usize) -> Self {
        let (scene, view) = (make(vis_scene_create), make(vis_view_create));
        let pipeline = make(vis_pipeline_create);
        let (mut visible, mut ids) = (null_mut(), vec![0; count]);
        let descs = vec![vis_object_default(BOX); count];
        let pose = vis_pose { eye: [0.0; 3], target: [1.0, 0.0, 0.0], up: [0.0, 0.0, 1.0] };
        // SAFETY: handles are live, and arrays as long as said.
        unsafe {
            ok(vis_visible_create(false, &raw mut visible));
            ok(vis_scene_insert_batch(scene, descs.as_ptr(), count, ids.as_mut_ptr()));
            ok(vis_pipeline_add_frustum(pipeline));
            ok(vis_view_set_perspective(view, &raw const pose, 1.0, 1.0, 0.1, f64::INFINITY));
        }
        Self { scene, view, pipeline, visible, ids }
    }

    fn cull(&self) -> vis_status {
        // SAFETY: handles are live.
        unsafe { vis_pipeline_cull(self.pipeline, self.scene, self.view, self.visible, null_mut()) }
    }
}

#[test]
fn null_pointers_are_refused_by_name() {
    let Setting { scene, view, pipeline, visible, .. } = Setting::new(1);
    // SAFETY: null is allowed everywhere; all other pointers are live.
    unsafe {
        for (status, name) in [
            (vis_scene_create(null_mut()), "scene"),
            (vis_scene_insert(null_mut(), &vis_object_default(BOX), &mut 0), "scene"),
            (vis_scene_insert(scene, null(), &mut 0), "object"),
            (vis_scene_insert(scene, &vis_object_default(BOX), null_mut()), "id"),
            (vis_scene_insert_batch(scene, &vis_object_default(BOX), 1, null_mut()), "ids"),
            (vis_scene_remove_batch(scene, null(), 1), "ids"),
            (vis_scene_set_origin(scene, null()), "origin"),
            (vis_scene_set_transforms_batch(scene, null(), null(), 3), "ids"),
            (vis_view_set_matrix(view, null(), 0, null()), "matrix"),
            (vis_view_set_matrix(null_mut(), null(), 0, null()), "view"),
            (vis_pipeline_add_portals(pipeline, null()), "cells"),
            (vis_pipeline_add_pvs(pipeline, null()), "pvs"),
            (vis_pipeline_cull(null_mut(), scene, view, visible, null_mut()), "pipeline"),
            (vis_pipeline_cull(pipeline, null(), view, visible, null_mut()), "scene"),
            (vis_pipeline_cull(pipeline, scene, null(), visible, null_mut()), "view"),
            (vis_pipeline_cull(pipeline, scene, view, null_mut(), null_mut()), "visible"),
            (vis_visible_ids(visible, scene, null_mut(), 0, null_mut()), "count"),
            (vis_graph_read_prt(null(), 5, &mut null_mut()), "text"),
            (vis_pvs_read(null(), 5, &mut null_mut()), "bytes"),
        ] {
            // All calls have run before this loop, so only the last message can be checked.
            assert_eq!(status, VIS_ERROR_NULL, "{name}");
        }
        assert_eq!(message(), "the pointer `bytes` is null", "the message names the last pointer");
        let mut count = 9;
        ok(vis_scene_count(scene, &raw mut count));
        assert_eq!(count, 1, "refused calls change nothing");
        // A null array of length 0 is valid, and destroying a null handle does nothing.
        ok(vis_scene_insert_batch(scene, null(), 0, null_mut()));
        ok(vis_scene_set_bounds_batch(scene, null(), null(), 0));
        vis_scene_destroy(null_mut());
        vis_visible_destroy(null_mut());
    }
}

#[test]
fn sizes_and_places_that_memory_cannot_have_are_refused() {
    let Setting { scene, ids, .. } = Setting::new(2);
    // SAFETY: the calls are refused before anything is read.
    unsafe {
        let huge = usize::MAX / 2;
        refused(
            vis_scene_remove_batch(scene, ids.as_ptr(), huge),
            VIS_ERROR_ARGUMENT,
            &format!("{huge} elements of `ids` are more than memory holds"),
        );
        let odd = ids.as_ptr().cast::<u8>().add(1).cast::<u64>();
        refused(
            vis_scene_remove_batch(scene, odd, 1),
            VIS_ERROR_ARGUMENT,
            "the pointer `ids` is not aligned",
        );
    }
}

#[test]
fn removed_ids_are_unknown_and_batches_do_all_or_nothing() {
    let Setting { scene, ids, .. } = Setting::new(3);
    let mut other = 0;
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        ok(vis_scene_remove(scene, ids[1]));
        refused(
            vis_scene_remove(scene, ids[1]),
            VIS_ERROR_UNKNOWN_ID,
            "object 1 is not, or no longer, in the scene",
        );
        // The index is reused, the id is not.
        ok(vis_scene_insert(scene, &vis_object_default(BOX), &raw mut other));
        assert_eq!(other as u32, ids[1] as u32, "the new object takes the index of the old");
        returns(vis_scene_set_layers(scene, ids[1], 1), VIS_ERROR_UNKNOWN_ID);
        returns(vis_scene_set_layers(scene, VIS_NO_OBJECT, 1), VIS_ERROR_UNKNOWN_ID);
        let boxes = [vis_box { min: [50.0; 3], max: [51.0; 3] }; 3];
        let status = vis_scene_set_bounds_batch(scene, ids.as_ptr(), boxes.as_ptr(), 3);
        returns(status, VIS_ERROR_UNKNOWN_ID);
        let mut bounds = boxes[0];
        ok(vis_scene_bounds(scene, ids[0], &raw mut bounds));
        assert_eq!(bounds, BOX, "a refused batch changes no box");
        returns(vis_scene_remove_batch(scene, [ids[0], ids[0]].as_ptr(), 2), VIS_ERROR_UNKNOWN_ID);
        // Ids of another scene's objects and meshes are unknown.
        let (stranger, mut mesh) = (make(vis_scene_create), 0);
        returns(vis_scene_set_layers(stranger, ids[0], 1), VIS_ERROR_UNKNOWN_ID);
        ok(vis_scene_add_box_mesh(stranger, &raw const BOX, &raw mut mesh));
        refused(
            vis_scene_set_mesh(scene, ids[0], mesh, null()),
            VIS_ERROR_UNKNOWN_ID,
            "mesh 0 is not, or no longer, in the scene",
        );
        returns(vis_scene_remove_mesh(scene, mesh), VIS_ERROR_UNKNOWN_ID);
        ok(vis_scene_remove_mesh(stranger, mesh));
        returns(vis_scene_remove_mesh(stranger, mesh), VIS_ERROR_UNKNOWN_ID);
    }
}

#[test]
fn values_out_of_range_are_refused_and_named() {
    let Setting { scene, pipeline, ids, .. } = Setting::new(1);
    let identity: [f32; 16] = std::array::from_fn(|i| if i % 5 == 0 { 1.0 } else { 0.0 });
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        let desc = vis_object_desc { flags: 16, ..vis_object_default(BOX) };
        refused(
            vis_scene_insert(scene, &raw const desc, &mut 0),
            VIS_ERROR_ARGUMENT,
            "the flags of an object cannot be 0x10",
        );
        returns(vis_scene_set_flags(scene, ids[0], 32), VIS_ERROR_ARGUMENT);
        refused(
            vis_pipeline_add_z_buffer(pipeline, 8, 600),
            VIS_ERROR_ARGUMENT,
            "a buffer has 16 to 4096 pixels on a side, not 8 x 600",
        );
        returns(vis_scene_set_draw_range(scene, ids[0], 5.0, 1.0), VIS_ERROR_ARGUMENT);
        returns(vis_scene_set_hlod_parent(scene, ids[0], ids[0]), VIS_ERROR_ARGUMENT);
        returns(vis_scene_set_origin(scene, [0.0, f64::NAN, 0.0].as_ptr()), VIS_ERROR_ARGUMENT);
        // Invalid transforms: for an object without local bounds, row-major instead of column-major, not
        // finite.
        let id = ids.as_ptr();
        returns(vis_scene_set_transforms_batch(scene, id, identity.as_ptr(), 1), VIS_ERROR_STATE);
        ok(vis_scene_set_local_bounds(scene, ids[0], &raw const BOX));
        let mut by_rows = identity;
        by_rows[3] = 7.0;
        refused(
            vis_scene_set_transforms_batch(scene, id, by_rows.as_ptr(), 1),
            VIS_ERROR_ARGUMENT,
            "the last row of a transform is not 0 0 0 1: is it column-major?",
        );
        let mut infinite = identity;
        infinite[12] = f32::INFINITY;
        refused(
            vis_scene_set_transforms_batch(scene, id, infinite.as_ptr(), 1),
            VIS_ERROR_ARGUMENT,
            "the transform of object 0 is not finite",
        );
        ok(vis_scene_set_transforms_batch(scene, id, identity.as_ptr(), 1));
        // Invalid meshes.
        let (mut mesh, corners) = (0, [0.0_f32; 9]);
        let add = |indices: &[u32; 3], mesh: *mut u64| {
            vis_scene_add_mesh(scene, corners.as_ptr(), 3, indices.as_ptr(), 1, false, mesh)
        };
        refused(add(&[0, 1, 3], &raw mut mesh), VIS_ERROR_ARGUMENT, "triangle 0 has no vertex 3");
        assert_eq!(add(&[0, 1, 2], &raw mut mesh), VIS_ERROR_ARGUMENT, "no area");
        // Invalid stages.
        let mut stats = vis_stats::default();
        refused(
            vis_pipeline_stage_stats(pipeline, 1, &raw mut stats),
            VIS_ERROR_ARGUMENT,
            "the pipeline has no stage 1",
        );
    }
}

#[test]
fn matrices_that_are_no_camera_are_refused_and_the_view_stays() {
    let setting = Setting::new(1);
    let view = setting.view;
    let set = |matrix: [f32; 16], depth: u32| {
        // SAFETY: the view is live, and the matrix has 16 numbers.
        unsafe { vis_view_set_matrix(view, matrix.as_ptr(), depth, null()) }
    };
    let mut matrix = [0.0; 16];
    (matrix[3], matrix[4], matrix[9], matrix[14]) = (1.0, -1.0, 1.0, 0.1);
    ok(set(matrix, VIS_DEPTH_REVERSED_INFINITE as u32));
    refused(set(matrix, 6), VIS_ERROR_ARGUMENT, "6 is no vis_depth");
    for (place, value) in [(0, f32::NAN), (15, f32::INFINITY)] {
        let mut bad = matrix;
        bad[place] = value;
        refused(
            set(bad, 0),
            VIS_ERROR_ARGUMENT,
            &format!("the clip matrix is not finite at row {0}, column {0}", place % 4),
        );
    }
    refused(set([0.0; 16], 0), VIS_ERROR_ARGUMENT, "the clip matrix is singular");
    let pose = vis_pose { eye: [0.0; 3], target: [1.0, 0.0, 0.0], up: [0.0, 0.0, 1.0] };
    // SAFETY: handles are live.
    unsafe {
        refused(
            vis_view_set_perspective(view, &raw const pose, 9.0, 1.0, 0.1, 1.0),
            VIS_ERROR_ARGUMENT,
            "the camera's fov_y cannot be 9: it is in radians, above 0 and below pi; was it meant in degrees?",
        );
        returns(vis_view_set_orthographic(view, &raw const pose, 0.0, 1.0, 0.1, 1.0), VIS_ERROR_ARGUMENT);
        returns(vis_view_set_clip_planes(view, [0.0_f64; 4].as_ptr(), 1), VIS_ERROR_ARGUMENT);
        let nowhere = [f64::NAN; 3];
        let depth = VIS_DEPTH_REVERSED_INFINITE as u32;
        returns(vis_view_set_matrix(view, matrix.as_ptr(), depth, nowhere.as_ptr()), VIS_ERROR_ARGUMENT);
    }
    assert_eq!(setting.cull(), VIS_OK, "the camera set first is still there");
}

#[test]
fn results_before_the_first_frame_are_an_error_not_nothing() {
    let setting = Setting::new(1);
    let mut count = 7;
    // SAFETY: handles are live.
    unsafe {
        refused(
            vis_visible_count(setting.visible, setting.scene, &raw mut count),
            VIS_ERROR_STATE,
            "no pipeline has culled into the set of visible objects",
        );
        returns(vis_visible_sort_by_index(setting.visible, setting.scene), VIS_ERROR_STATE);
        let blind = make(vis_view_create);
        let status = vis_pipeline_cull(setting.pipeline, setting.scene, blind, setting.visible, null_mut());
        refused(status, VIS_ERROR_STATE, "the view has no camera yet");
        returns(vis_view_set_clip_planes(blind, null(), 0), VIS_ERROR_STATE);
    }
    assert_eq!(count, 7, "a refused call writes no count");
}

#[test]
fn sets_need_no_scene_once_they_are_listed() {
    let setting = Setting::new(9);
    let (visible, scene) = (setting.visible, setting.scene);
    let (mut ids, mut count) = ([0_u64; 9], 7);
    // SAFETY: handles are live, and the array is as long as said.
    unsafe {
        returns(vis_visible_list(visible, scene), VIS_ERROR_STATE);
        for sorts in [false, true] {
            let list = if sorts { vis_visible_sort_by_index } else { vis_visible_list };
            ok(setting.cull());
            refused(
                vis_visible_count(visible, null(), &raw mut count),
                VIS_ERROR_STATE,
                "the set of visible objects is not listed: pass the scene",
            );
            returns(vis_visible_ids(visible, null(), ids.as_mut_ptr(), 9, &raw mut count), VIS_ERROR_STATE);
            ok(list(visible, scene));
            ok(vis_visible_ids(visible, null(), ids.as_mut_ptr(), 9, &raw mut count));
            assert_eq!(count, 9, "sorted: {sorts}: objects in the list");
        }
        // A listed set keeps objects that have left the scene. If read with the scene, it only has the
        // remaining ones.
        ok(vis_scene_remove(scene, setting.ids[4]));
        ok(vis_visible_count(visible, null(), &raw mut count));
        assert_eq!(count, 9, "objects in the list after one was removed");
        ok(vis_visible_count(visible, scene, &raw mut count));
        assert_eq!(count, 8, "objects left in the scene");
        ok(vis_visible_ids(visible, scene, ids.as_mut_ptr(), 9, &raw mut count));
        assert!(
            count == 8 && !ids[..8].contains(&setting.ids[4]),
            "the removed object is not among the {count} read"
        );
    }
}

#[test]
fn short_buffers_stay_as_they_are_and_learn_the_length() {
    let setting = Setting::new(70);
    ok(setting.cull());
    let (visible, scene) = (setting.visible, setting.scene);
    let (mut ids, mut words, mut count) = (vec![1_u64; 70], [9_u32; 3], 0);
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        returns(vis_visible_ids(visible, scene, ids.as_mut_ptr(), 69, &raw mut count), VIS_ERROR_TOO_SHORT);
        assert_eq!((count, ids[0]), (70, 1), "the count is told, the buffer stays as it was");
        assert_eq!(
            message(),
            "a buffer of 69 elements is too short for 70",
            "the message tells both lengths"
        );
        assert_eq!(
            vis_visible_ids(visible, scene, null_mut(), 0, &raw mut count),
            VIS_OK,
            "asks for the length"
        );
        ok(vis_visible_sort_by_index(visible, scene));
        ok(vis_visible_ids(visible, scene, ids.as_mut_ptr(), 70, &raw mut count));
        assert_eq!(ids, setting.ids, "ids sorted by index");
        returns(
            vis_visible_write_bits(visible, scene, words.as_mut_ptr(), 2, &raw mut count),
            VIS_ERROR_TOO_SHORT,
        );
        assert_eq!((count, words), (3, [9; 3]), "the count is told, the words stay as they were");
        ok(vis_visible_write_bits(visible, scene, words.as_mut_ptr(), 3, &raw mut count));
        assert_eq!(words, [u32::MAX, u32::MAX, 63], "a bit for each of 70 objects");
        let mut text = [1; 8];
        let explain = |text: *mut _, capacity, count| {
            vis_pipeline_explain(setting.pipeline, setting.ids[0], text, capacity, count)
        };
        returns(explain(text.as_mut_ptr(), 7, &raw mut count), VIS_ERROR_TOO_SHORT);
        assert_eq!((count, text[0]), (8, 1), "the length is told, the text stays as it was");
        ok(explain(text.as_mut_ptr(), 8, &raw mut count));
        assert_eq!(CStr::from_ptr(text.as_ptr()), CString::from(c"unknown").as_c_str(), "the explanation");
    }
}

#[test]
fn files_that_are_damaged_are_refused_with_the_place() {
    let (mut graph, mut pvs) = (null_mut(), null_mut());
    let text = "PRT1\n2\n1\n4 0 1 (0 0 0) (0 1 0)\n";
    // SAFETY: arrays are as long as said.
    unsafe {
        refused(
            vis_graph_read_prt(text.as_ptr(), text.len(), &raw mut graph),
            VIS_ERROR_FORMAT,
            "line 4: vertex 3 of 4 is missing",
        );
        assert!(graph.is_null(), "no graph is made");
        let bytes = [7_u8; 40];
        returns(vis_pvs_read(bytes.as_ptr(), bytes.len(), &raw mut pvs), VIS_ERROR_FORMAT);
        assert!(pvs.is_null() && !message().is_empty(), "no set is made, and a message says why");
        let (ends, targets) = ([2_usize, 1], [0_u32, 1]);
        let status = vis_pvs_create(2, ends.as_ptr(), 2, targets.as_ptr(), 2, &raw mut pvs);
        refused(status, VIS_ERROR_ARGUMENT, "a row cannot end at 1 after 2");
    }
}

#[test]
fn a_handle_in_use_elsewhere_is_busy() {
    // Many objects, so that a call on one thread runs while another thread tries: the second call is refused
    // as busy, or comes after the first has ended. No call waits, and none reads what another changes.
    let setting = Setting::new(1000);
    struct Shared(*mut vis_scene);
    // SAFETY: handles may go to any thread.
    unsafe impl Sync for Shared {}
    let shared = Shared(setting.scene);
    let (mut succeeded, mut busy) = (0, 0);
    std::thread::scope(|scope| {
        let shared = &shared;
        let other = scope.spawn(move || {
            // SAFETY: the handle is live. That two threads change the scene at once is what this test tries.
            (0..300).map(|_| unsafe { vis_scene_rebuild(shared.0) }).collect::<Vec<_>>()
        });
        // SAFETY: as before.
        let mut all: Vec<_> = (0..300).map(|_| unsafe { vis_scene_rebuild(shared.0) }).collect();
        all.extend(other.join().expect("no panic"));
        for status in all {
            match status {
                VIS_OK => succeeded += 1,
                VIS_ERROR_BUSY => busy += 1,
                other => panic!("{other:?}"),
            }
        }
    });
    assert_eq!(succeeded + busy, 600, "each call has succeeded or was busy");
    assert!(succeeded > 0, "at least one call has succeeded");
    ok(setting.cull());
}
