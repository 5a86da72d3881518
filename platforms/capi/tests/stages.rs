//! Tests of stages, layers and explanations through the C interface. Programs in `samples` test scenes,
//! portals, baked sets and the judge.

mod common;

use common::{make, ok, returns};
use std::ffi::{CStr, c_char};
use std::ptr::{null, null_mut};
use visibility::vis_status::*;
use visibility::*;
use visibility_bake::BakedSet;
use visibility_core::Aabb;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};

fn new_visible(with_changes: bool) -> *mut vis_visible {
    let mut handle = null_mut();
    // SAFETY: `handle` is memory for the result.
    ok(unsafe { vis_visible_create(with_changes, &raw mut handle) });
    handle
}

/// Returns the bounds of a cube of 1 m at a distance ahead of the eye.
fn cube_at(x: f32) -> vis_box {
    vis_box { min: [x, -0.5, -0.5], max: [x + 1.0, 0.5, 0.5] }
}

fn insert(scene: *mut vis_scene, desc: vis_object_desc) -> u64 {
    let mut id = VIS_NO_OBJECT;
    // SAFETY: the scene is live.
    ok(unsafe { vis_scene_insert(scene, &raw const desc, &raw mut id) });
    id
}

/// Creates a view from the origin along x, a scene, and a pipeline that starts with frustum culling.
fn setting() -> (*mut vis_scene, *mut vis_view, *mut vis_pipeline) {
    let (view, pipeline) = (make(vis_view_create), make(vis_pipeline_create));
    let pose = vis_pose { eye: [0.0; 3], target: [1.0, 0.0, 0.0], up: [0.0, 0.0, 1.0] };
    // SAFETY: handles are live.
    unsafe {
        ok(vis_view_set_perspective(view, &raw const pose, 1.0, 1.0, 0.1, f64::INFINITY));
        ok(vis_pipeline_add_frustum(pipeline));
    }
    (make(vis_scene_create), view, pipeline)
}

/// Culls and returns the ids of the visible objects, ascending.
fn visible_ids(
    pipeline: *mut vis_pipeline,
    scene: *mut vis_scene,
    view: *mut vis_view,
    visible: *mut vis_visible,
) -> Vec<u64> {
    let mut count = 0;
    // SAFETY: handles are live, and the list is as long as said.
    unsafe {
        ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
        ok(vis_visible_sort_by_index(visible, scene));
        ok(vis_visible_count(visible, scene, &raw mut count));
        let mut ids = vec![0; count];
        ok(vis_visible_ids(visible, scene, ids.as_mut_ptr(), count, &raw mut count));
        ids
    }
}

/// Reads a text by calling `write` twice: first for the length, then for the text.
fn text(write: impl Fn(*mut c_char, usize, *mut usize) -> vis_status) -> String {
    let mut length = 0;
    ok(write(null_mut(), 0, &raw mut length));
    let mut bytes: Vec<c_char> = vec![0; length];
    ok(write(bytes.as_mut_ptr(), length, &raw mut length));
    // SAFETY: the text ends with a zero byte.
    unsafe { CStr::from_ptr(bytes.as_ptr()) }.to_str().expect("UTF-8").to_owned()
}

#[test]
fn layers_flags_ranges_and_parents_decide_what_is_drawn() {
    let (scene, view, pipeline) = setting();
    let visible = new_visible(true);
    let [near, far] = [5.0, 500.0].map(|x| insert(scene, vis_object_default(cube_at(x))));
    let behind = insert(scene, vis_object_default(cube_at(-9.0)));
    let mut accuracy = vis_accuracy::VIS_ACCURACY_EXACT;
    let see = || visible_ids(pipeline, scene, view, visible);
    // SAFETY: handles are live.
    unsafe {
        ok(vis_pipeline_accuracy(pipeline, &raw mut accuracy));
        assert_eq!(accuracy, vis_accuracy::VIS_ACCURACY_CONSERVATIVE, "the frustum is conservative");
        assert_eq!(see(), [near, far], "what is ahead");
        ok(vis_scene_set_flags(scene, behind, VIS_OBJECT_NEVER_CULL));
        assert_eq!(see(), [near, far, behind], "what is behind is never culled");
        ok(vis_scene_set_flags(scene, behind, 0));
        ok(vis_scene_set_layers(scene, near, 1));
        ok(vis_view_set_layers(view, 2));
        assert_eq!(see(), [far], "what shares a layer with the view");
        let (mut id, mut count) = (0, 0);
        returns(vis_visible_newly_hidden(visible, &raw mut id, 1, &raw mut count), VIS_ERROR_TOO_SHORT);
        assert_eq!(count, 2, "near and what was behind");
        let pose = vis_pose { eye: [0.1, 0.0, 0.0], target: [1.0, 0.0, 0.0], up: [0.0, 0.0, 1.0] };
        ok(vis_view_set_perspective(view, &pose, 1.0, 1.0, 0.1, 900.0));
        assert_eq!(see(), [far], "layers outlast the camera");
        ok(vis_view_set_layers(view, VIS_ALL_LAYERS));
        assert_eq!(see(), [near, far], "all layers");
        ok(vis_visible_newly_visible(visible, &raw mut id, 1, &raw mut count));
        assert_eq!((count, id), (1, near), "one object has appeared, the near one");
        // A clip plane across the view keeps only what is beyond 100 m.
        let plane = [1.0, 0.0, 0.0, -100.0_f64]; // relative to the eye
        ok(vis_view_set_clip_planes(view, plane.as_ptr(), 1));
        assert_eq!(see(), [far], "what is beyond the clip plane");
        ok(vis_view_set_clip_planes(view, null(), 0));
        // The far cube is 2 pixels high in a picture of 1080 rows, below the least size of 8.
        ok(vis_pipeline_add_contribution(pipeline, 1080.0, 8.0));
        assert_eq!(see(), [near], "the far cube is too small");
        ok(vis_pipeline_accuracy(pipeline, &raw mut accuracy));
        assert_eq!(
            accuracy,
            vis_accuracy::VIS_ACCURACY_APPROXIMATE,
            "with a limit of size the pipeline is approximate"
        );
        ok(vis_scene_set_draw_range(scene, near, 0.0, 3.0));
        assert_eq!(see(), [], "the near cube is beyond its range");
        // An HLOD parent from 20 m on: at smaller distances, its child is drawn instead.
        let coarse = insert(scene, vis_object_default(cube_at(5.0)));
        ok(vis_scene_set_draw_range(scene, near, 0.0, f32::INFINITY));
        ok(vis_scene_set_draw_range(scene, coarse, 20.0, f32::INFINITY));
        ok(vis_scene_set_hlod_parent(scene, near, coarse));
        assert_eq!(see(), [near], "the coarse stand-in begins at 20 m");
        ok(vis_scene_set_draw_range(scene, coarse, 2.0, f32::INFINITY));
        assert_eq!(see(), [coarse], "the coarse stand-in begins at 2 m");
        ok(vis_scene_set_hlod_parent(scene, near, VIS_NO_OBJECT));
        let mut contains = false;
        assert_eq!(see(), [near, coarse], "without a parent both are drawn");
        ok(vis_visible_contains(visible, scene, near, &raw mut contains));
        assert!(contains, "the near cube is visible");
        ok(vis_scene_remove_batch(scene, [near, far].as_ptr(), 2));
        ok(vis_visible_contains(visible, scene, near, &raw mut contains));
        assert!(!contains, "the near cube was removed");
        ok(vis_scene_contains(scene, coarse, &raw mut contains));
        assert!(contains, "the coarse cube is in the scene");
    }
}

#[test]
fn each_depth_convention_has_its_near_and_far_plane() {
    use vis_depth::*;
    let (scene, view, pipeline) = setting();
    let visible = new_visible(false);
    let [_before, between, beyond] = [-0.2, 4.0, 50.0].map(|x| insert(scene, vis_object_default(cube_at(x))));
    // Clip depth is a x + b, with w = x, for a near plane at n and a far plane at f.
    let (n, f) = (1.0, 10.0);
    for (depth, a, b) in [
        (VIS_DEPTH_NEGATIVE_ONE_TO_ONE, (f + n) / (f - n), -2.0 * f * n / (f - n)),
        (VIS_DEPTH_NEGATIVE_ONE_TO_ONE_INFINITE, 1.0, -2.0 * n),
        (VIS_DEPTH_ZERO_TO_ONE, f / (f - n), -f * n / (f - n)),
        (VIS_DEPTH_ZERO_TO_ONE_INFINITE, 1.0, -n),
        (VIS_DEPTH_REVERSED, -n / (f - n), f * n / (f - n)),
        (VIS_DEPTH_REVERSED_INFINITE, 0.0, n),
    ] {
        let mut matrix = [0.0_f32; 16];
        (matrix[3], matrix[4], matrix[9]) = (1.0, -1.0, 1.0);
        (matrix[2], matrix[14]) = (a, b);
        // SAFETY: the view is live, and the matrix has 16 numbers.
        ok(unsafe { vis_view_set_matrix(view, matrix.as_ptr(), depth as u32, null()) });
        let is_infinite = depth as u32 % 2 == 1;
        let expected = if is_infinite { vec![between, beyond] } else { vec![between] };
        assert_eq!(visible_ids(pipeline, scene, view, visible), expected, "{depth:?}");
    }
}

#[test]
fn pipelines_explain_freeze_and_say_what_they_lack() {
    let (scene, view, pipeline) = setting();
    let visible = new_visible(false);
    let wall = vis_box { min: [4.0, -5.0, -5.0], max: [4.5, 5.0, 5.0] };
    let wall = insert(scene, vis_object_desc { flags: VIS_OBJECT_OCCLUDER, ..vis_object_default(wall) });
    let [hidden, behind] = [9.0, -9.0].map(|x| insert(scene, vis_object_default(cube_at(x))));
    let see = || visible_ids(pipeline, scene, view, visible);
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        let explain =
            |id| text(|text, capacity, count| vis_pipeline_explain(pipeline, id, text, capacity, count));
        let lacks =
            || text(|text, capacity, count| vis_pipeline_lacks(pipeline, scene, text, capacity, count));
        ok(vis_pipeline_add_z_buffer(pipeline, 64, 64));
        ok(vis_pipeline_set_explaining(pipeline, true));
        let bounds = vis_box { min: [f32::NAN; 3], max: [1.0; 3] };
        let lost = insert(scene, vis_object_default(bounds));
        ok(vis_scene_set_flags(scene, wall, VIS_OBJECT_ONE_SIDED));
        let lines = lacks();
        assert!(
            lines.contains("pipeline: objects whose bounds are NaN or inverted, never culled: 1\n"),
            "bounds of NaN are reported: {lines}"
        );
        assert!(lines.contains("hzb: objects of which none is flagged as an occluder: 4\n"), "{lines}");
        ok(vis_scene_remove(scene, lost));
        ok(vis_scene_set_flags(scene, wall, VIS_OBJECT_OCCLUDER));
        assert_eq!(see(), [wall, hidden], "a wall without a mesh hides nothing");
        assert_eq!(lacks(), "hzb: occluders without a mesh: 1\n", "the wall lacks a mesh");
        // Occluder prepared from the wall's triangles. The first triangle faces the eye.
        let quad = [[4.0, -5.0, -5.0], [4.0, 5.0, 5.0], [4.0, 5.0, -5.0], [4.0, -5.0, 5.0_f32]];
        let triangles = [quad[0], quad[1], quad[2], quad[0], quad[3], quad[1]];
        let mut made = 0;
        ok(vis_scene_set_triangles(scene, wall, triangles.as_ptr().cast(), 2));
        ok(vis_scene_prepare_occluders(scene, &raw mut made));
        assert_eq!((made, lacks().as_str()), (1, ""), "one occluder is made, and nothing is lacking");
        assert_eq!(see(), [wall], "the wall hides");
        assert_eq!(explain(wall), "visible", "the wall's explanation");
        assert_eq!(explain(hidden), "removed by hzb", "the hidden cube's explanation");
        assert_eq!(explain(behind), "removed by frustum", "the explanation of what is behind");
        // The eye turns, but the frozen pipeline does not.
        ok(vis_pipeline_freeze(pipeline, true));
        let pose = vis_pose { eye: [0.0; 3], target: [-1.0, 0.0, 0.0], up: [0.0, 0.0, 1.0] };
        ok(vis_view_set_orthographic(view, &raw const pose, 5.0, 5.0, 0.0, 50.0));
        assert_eq!(see(), [wall], "the frozen pipeline sees what it saw");
        ok(vis_pipeline_freeze(pipeline, false));
        ok(vis_pipeline_reset(pipeline));
        assert_eq!(see(), [behind], "the eye has turned");
        // Far from the origin of the world, scene and camera move together.
        let far = [6.4e6, 0.0, 0.0];
        ok(vis_scene_set_origin(scene, far.as_ptr()));
        assert_eq!(see(), [], "the scene has moved away with its origin");
        let mut matrix = [0.0_f64; 16];
        (matrix[3], matrix[4], matrix[9], matrix[14]) = (1.0, -1.0, 1.0, 0.1);
        let depth = vis_depth::VIS_DEPTH_REVERSED_INFINITE as u32;
        ok(vis_view_set_matrix_f64(view, matrix.as_ptr(), depth, far.as_ptr()));
        assert_eq!(see(), [wall], "the camera has followed");
        // A two-sided mesh on an object. A change of the object's bounds removes the mesh.
        let (mut mesh, corners) = (0, quad.map(|[_, y, z]| [4.0, y, z]));
        let indices = [0, 2, 1, 0, 1, 3_u32];
        let positions = corners.as_ptr().cast();
        ok(vis_scene_add_mesh(scene, positions, 4, indices.as_ptr(), 2, true, &raw mut mesh));
        ok(vis_scene_set_mesh(scene, wall, mesh, null()));
        // A removed mesh still occludes until the object loses it.
        let (mut before, mut after) = (0, 0);
        ok(vis_scene_mesh_count(scene, &raw mut before));
        ok(vis_scene_remove_mesh(scene, mesh));
        assert_eq!(see(), [wall], "the removed mesh still hides");
        ok(vis_scene_set_bounds(scene, wall, &cube_at(2.0)));
        assert_eq!(see(), [wall, hidden], "the wall has lost its mesh");
        ok(vis_scene_mesh_count(scene, &raw mut after));
        assert_eq!(after + 1, before, "meshes before and after");
    }
}

#[test]
fn doors_shut_for_all_views_that_share_the_cells() {
    let (scene, view, first) = setting();
    let (second, visible) = (make(vis_pipeline_create), [new_visible(false), new_visible(false)]);
    let lamp = insert(scene, vis_object_default(cube_at(5.0)));
    let portal = vis_portal { first_vertex: 0, vertex_count: 4, cells: [0, 1] };
    let door = [[3.0, -1.0, -1.0], [3.0, 1.0, -1.0], [3.0, 1.0, 1.0], [3.0, -1.0, 1.0_f64]];
    let cell = |x: f64, planes: u32| vis_volume {
        min: [x, -5.0, -5.0],
        max: [x + 5.0, 5.0, 5.0],
        first_plane: 0,
        plane_count: planes,
    };
    // A plane at the door cuts the first cell's box.
    let (volumes, plane) = ([cell(-1.0, 1), cell(3.0, 0)], [-1.0, 0.0, 0.0, 3.0_f64]);
    let (mut graph, mut cells, mut sees) = (null_mut(), null_mut(), false);
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        let vertices = door.as_ptr().cast();
        returns(vis_graph_create(2, &raw const portal, 1, vertices, 3, &raw mut graph), VIS_ERROR_ARGUMENT);
        ok(vis_graph_create(2, &raw const portal, 1, vertices, 4, &raw mut graph));
        let make = |count, planes, cells: *mut *mut vis_cells| {
            vis_cells_create(graph, volumes.as_ptr(), count, plane.as_ptr(), planes, 1e-6, cells)
        };
        assert_eq!(make(1, 1, &raw mut cells), VIS_ERROR_ARGUMENT, "a cell without a volume");
        assert_eq!(make(2, 0, &raw mut cells), VIS_ERROR_ARGUMENT, "a plane that is not there");
        ok(make(2, 1, &raw mut cells));
        ok(vis_pipeline_add_portals(first, cells));
        ok(vis_pipeline_add_portals(second, cells));
        let see = || {
            [(first, visible[0]), (second, visible[1])]
                .map(|(pipeline, visible)| visible_ids(pipeline, scene, view, visible).len())
        };
        assert_eq!(see(), [1, 1], "the door is open for both");
        ok(vis_cells_set_open(cells, 0, false));
        assert_eq!(see(), [0, 0], "the door is shut for both");
        ok(vis_cells_can_see(cells, 0, 1, &raw mut sees));
        assert!(!sees, "through a shut door cells do not see each other");
        ok(vis_cells_set_open(cells, 0, true));
        ok(vis_cells_set_passage(cells, 0, false, true));
        assert_eq!(see(), [0, 0], "the door is seen through from the other side only");
        ok(vis_cells_set_passage(cells, 0, true, false));
        assert_eq!(see(), [1, 1], "the door is seen through from this side");
        returns(vis_cells_set_passage(cells, 0, false, false), VIS_ERROR_ARGUMENT);
        returns(vis_cells_set_open(cells, 7, true), VIS_ERROR_UNKNOWN_ID);
        // A change of bounds moves the lamp out of the cells, and both pipelines notice the change.
        ok(vis_scene_set_bounds(scene, lamp, &cube_at(-9.0)));
        assert_eq!(see(), [0, 1], "outside all cells nothing is hidden but by the frustum");
        // Meanwhile, another scene uses the same cells.
        let elsewhere = crate::make(vis_scene_create);
        insert(elsewhere, vis_object_default(cube_at(5.0)));
        ok(vis_cells_set_passage(cells, 0, false, true));
        assert_eq!(
            visible_ids(first, elsewhere, view, visible[0]).len(),
            0,
            "the lamp elsewhere, behind a one-way door"
        );
        assert_eq!(see(), [0, 1], "the own lamp, after another scene");
        assert_eq!(
            visible_ids(first, elsewhere, view, visible[0]).len(),
            0,
            "the lamp elsewhere, after the own scene"
        );
        vis_scene_destroy(elsewhere);
        // A baked set of objects does not fit cells, so it is refused.
        let (mut pvs, ends, targets) = (null_mut(), [1_usize, 3], [0, 0, 1_u32]);
        ok(vis_pvs_create(2, ends.as_ptr(), 2, targets.as_ptr(), 3, &raw mut pvs));
        returns(vis_cells_set_pvs(cells, pvs), VIS_ERROR_ARGUMENT);
        let (mut rows, mut columns) = (0, 0);
        ok(vis_pvs_counts(pvs, &raw mut rows, &raw mut columns));
        assert_eq!((rows, columns), (2, 2), "rows and targets of the set");
        ok(vis_pvs_sees(pvs, 0, 1, &raw mut sees));
        assert!(!sees, "target 1 from viewcell 0");
        let mut row = 0;
        ok(vis_pvs_write_row(pvs, 1, &mut row, 1, &mut rows));
        assert_eq!((rows, row), (1, 3), "one word, and both targets");
        returns(vis_pvs_write_row(pvs, 2, &mut row, 1, &mut rows), VIS_ERROR_UNKNOWN_ID);
        // Targets in each half of a 64-bit word of the set. The row ends in the first half.
        let (mut wide, targets) = (null_mut(), [0, 31, 32, 63, 64, 69_u32]);
        ok(vis_pvs_create(70, &6, 1, targets.as_ptr(), 6, &mut wide));
        let mut words = [0; 3];
        returns(vis_pvs_write_row(wide, 0, words.as_mut_ptr(), 2, &mut rows), VIS_ERROR_TOO_SHORT);
        ok(vis_pvs_write_row(wide, 0, words.as_mut_ptr(), 3, &mut rows));
        assert_eq!(words, [1 << 31 | 1, 1 << 31 | 1, 1 << 5 | 1], "the targets as bits");
        vis_pvs_destroy(wide);
        assert_eq!(see(), [0, 1], "a refused set leaves the cells as they were");
        vis_cells_destroy(cells);
        vis_graph_destroy(graph);
        vis_pvs_destroy(pvs);
        assert_eq!(see(), [0, 1], "pipelines keep the cells");
        visible.into_iter().for_each(|visible| vis_visible_destroy(visible));
        [first, second].into_iter().for_each(|pipeline| vis_pipeline_destroy(pipeline));
        vis_view_destroy(view);
        vis_scene_destroy(scene);
    }
}

#[test]
fn a_baked_file_is_read_for_its_scene_alone() {
    let (mut baked, viewcell) = (visibility_core::Scene::new(), DVec3::splat(2.0));
    for x in [5.0, 9.0] {
        let vis_box { min, max } = cube_at(x);
        baked.insert(Aabb::from_arrays(min, max));
    }
    let viewcells = Viewcells::new([Viewcell::from_box(-viewcell, viewcell)]);
    let set = BakedSet::from_rows(&baked, viewcells, &[[1]]).expect("rows of the scene");
    let (file, version) = (set.to_bytes(), set.version());

    let (scene, view, pipeline) = setting();
    let (mut set, visible) = (null_mut(), new_visible(false));
    let read = |bytes: &[u8], set: *mut *mut vis_scene_pvs| {
        // SAFETY: the scene is live, and the bytes are as many as said.
        unsafe { vis_scene_pvs_read(scene, bytes.as_ptr(), bytes.len(), set) }
    };
    insert(scene, vis_object_default(cube_at(5.0)));
    assert_eq!(read(&file, &raw mut set), VIS_ERROR_ARGUMENT, "an object is missing");
    let lamp = insert(scene, vis_object_default(cube_at(9.0)));
    returns(read(&file[1..], &raw mut set), VIS_ERROR_FORMAT);
    let read_version = |version: u64, set: *mut *mut vis_scene_pvs| {
        // SAFETY: as before.
        unsafe { vis_scene_pvs_read_version(scene, file.as_ptr(), file.len(), version, set) }
    };
    assert_eq!(read_version(version ^ 1, &raw mut set), VIS_ERROR_ARGUMENT, "the level was edited");
    ok(read_version(version, &raw mut set));
    // SAFETY: handles are live.
    unsafe {
        let mut accuracy = vis_accuracy::VIS_ACCURACY_EXACT;
        let before = {
            ok(vis_pipeline_accuracy(pipeline, &raw mut accuracy));
            accuracy
        };
        ok(vis_pipeline_add_pvs(pipeline, set));
        assert_eq!(
            visible_ids(pipeline, scene, view, visible),
            [lamp],
            "the lamp, by a set of a known version"
        );
        ok(vis_pipeline_accuracy(pipeline, &raw mut accuracy));
        assert_eq!(accuracy, before, "a set of a known version keeps the accuracy");
        vis_scene_pvs_destroy(set);
        ok(read(&file, &raw mut set));
        ok(vis_pipeline_add_pvs(pipeline, set));
        assert_eq!(
            visible_ids(pipeline, scene, view, visible),
            [lamp],
            "the lamp, by a set of an unknown version"
        );
        ok(vis_pipeline_accuracy(pipeline, &raw mut accuracy));
        assert_eq!(accuracy, vis_accuracy::VIS_ACCURACY_APPROXIMATE, "without a version");
        vis_scene_pvs_destroy(set);
        vis_visible_destroy(visible);
        vis_pipeline_destroy(pipeline);
        vis_view_destroy(view);
        vis_scene_destroy(scene);
    }
}
