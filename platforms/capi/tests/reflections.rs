//! Tests of mirrors through the C interface: the reflections are those of the Rust crates, for a building
//! that both are given, frame by frame.

mod common;

use common::{make, message, ok, returns};
use std::ptr::{null, null_mut};
use visibility::vis_status::*;
use visibility::*;
use visibility_core::cells::{CellGraph, CellId, PortalId};
use visibility_core::geometry::ConvexPolygon;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_core::{Aabb, Culler, FrustumCuller, ObjectId, Pose, Scene, View, VisibleSet};
use visibility_portals::{MirrorId, PortalEye, SceneCells};

const ROOMS: usize = 3;

/// Returns the corners of a rectangle at x, counter-clockwise as seen from greater x.
fn rectangle(x: f64, [y, to_y]: [f64; 2], [z, to_z]: [f64; 2]) -> [[f64; 3]; 4] {
    [[x, y, z], [x, to_y, z], [x, to_y, to_z], [x, y, to_z]]
}

/// Returns the corners of a door at x between rooms of 4 by 4 by 3 m in a row.
fn door(x: f64) -> [[f64; 3]; 4] {
    rectangle(x, [1.0, 3.0], [0.0, 2.5])
}

/// Returns the corners of mirrors at both ends of the row, which face each other.
fn mirrors() -> [[[f64; 3]; 4]; 2] {
    let mut far = rectangle(4.0 * ROOMS as f64, [0.5, 3.5], [0.2, 2.8]);
    far.reverse();
    [far, rectangle(0.0, [1.0, 3.0], [0.5, 2.5])]
}

fn boxes() -> Vec<vis_box> {
    let at =
        |i: usize| [i as f32 * 0.9 + 0.3, (i * 7 % 5) as f32 * 0.7 + 0.4, (i * 3 % 4) as f32 * 0.5 + 0.2];
    (0..13).map(|i| vis_box { min: at(i), max: at(i).map(|x| x + 0.3) }).collect()
}

/// The same building for both: rooms in a row, a door between each two, and two mirrors.
struct Building {
    scene: *mut vis_scene,
    cells: *mut vis_cells,
    ids: Vec<u64>,
    rust: Scene,
    own: SceneCells,
}

impl Building {
    fn new() -> Self {
        let boxes = boxes();
        let corner = |i: usize| [4.0 * i as f64, 0.0, 0.0];
        let volumes = [0, 1, 2].map(|i| {
            let min = corner(i);
            vis_volume { min, max: [min[0] + 4.0, 4.0, 3.0], first_plane: 0, plane_count: 0 }
        });
        let vertices: Vec<[f64; 3]> = (1..ROOMS).flat_map(|i| door(corner(i)[0])).collect();
        let portals: Vec<vis_portal> = (1..ROOMS as u32)
            .map(|i| vis_portal { first_vertex: 4 * (i - 1), vertex_count: 4, cells: [i - 1, i] })
            .collect();
        let (scene, mut graph, mut cells) = (make(vis_scene_create), null_mut(), null_mut());
        let descs: Vec<_> = boxes.iter().map(|&bounds| vis_object_default(bounds)).collect();
        let mut ids = vec![0; boxes.len()];
        let polygon =
            |corners: [[f64; 3]; 4]| ConvexPolygon::new(corners.map(DVec3::from_array)).expect("convex");
        let joins =
            (1..ROOMS).map(|i| (polygon(door(corner(i)[0])), [CellId(i as u32 - 1), CellId(i as u32)]));
        let own_graph = CellGraph::new(ROOMS, joins).expect("a graph");
        let room = |i: usize| {
            let min = DVec3::from_array(corner(i));
            Viewcell::from_box(min, min + DVec3::new(4.0, 4.0, 3.0))
        };
        let mut own = SceneCells::new(own_graph, Viewcells::new((0..ROOMS).map(room)), 1e-6).expect("cells");
        // SAFETY: handles are live, and arrays as long as said.
        unsafe {
            ok(vis_scene_insert_batch(scene, descs.as_ptr(), descs.len(), ids.as_mut_ptr()));
            let (points, count) = (vertices.as_ptr().cast(), vertices.len());
            ok(vis_graph_create(ROOMS, portals.as_ptr(), portals.len(), points, count, &raw mut graph));
            ok(vis_cells_create(graph, volumes.as_ptr(), ROOMS, null(), 0, 1e-6, &raw mut cells));
            vis_graph_destroy(graph);
            for (number, (corners, cell)) in (0..).zip(mirrors().into_iter().zip([2, 0])) {
                let mut mirror = 9;
                ok(vis_cells_add_mirror(cells, cell, corners.as_ptr().cast(), 4, &raw mut mirror));
                assert_eq!(mirror, number, "the number of a mirror");
                own.add_mirror(CellId(cell), &polygon(corners)).expect("a mirror");
            }
        }
        let mut rust = Scene::new();
        rust.insert_batch(boxes.iter().map(|&vis_box { min, max }| Aabb::from_arrays(min, max)));
        own.sync(&rust);
        Self { scene, cells, ids, rust, own }
    }
}

fn reflections(of: *const vis_reflections) -> Vec<vis_reflection> {
    let mut count = 0;
    // SAFETY: the handle is live, and the list as long as said.
    unsafe {
        ok(vis_reflections_list(of, null_mut(), 0, &raw mut count));
        let mut list = vec![vis_reflection { mirror: 9, parent: 9, depth: 9 }; count];
        ok(vis_reflections_list(of, list.as_mut_ptr(), count, &raw mut count));
        list
    }
}

fn indices(visible: *const vis_visible, scene: *const vis_scene) -> Vec<u32> {
    let (mut list, mut count) = (vec![0; 200], 0);
    // SAFETY: handles are live, and the list is long enough.
    ok(unsafe { vis_visible_indices(visible, scene, list.as_mut_ptr(), list.len(), &raw mut count) });
    list.truncate(count);
    list.sort_unstable();
    list
}

fn own_indices(visible: &VisibleSet, scene: &Scene) -> Vec<u32> {
    let mut list: Vec<u32> = visible.iter(scene).map(|id: ObjectId| id.index() as u32).collect();
    list.sort_unstable();
    list
}

/// Returns the matrix and the clip planes of a view, relative to a point.
fn matrix_and_planes(view: *const vis_view, origin: Option<&[f64; 3]>) -> ([f64; 16], Vec<f64>) {
    let (mut matrix, mut planes, mut count) = ([0.0; 16], vec![0.0; 40], 0);
    let origin = origin.map_or(null(), |origin| origin.as_ptr());
    // SAFETY: the handle is live, and the lists are long enough.
    unsafe {
        ok(vis_view_matrix(view, origin, matrix.as_mut_ptr()));
        ok(vis_view_clip_planes(view, origin, planes.as_mut_ptr(), planes.len(), &raw mut count));
    }
    planes.truncate(count);
    (matrix, planes)
}

#[test]
fn reflections_are_those_of_the_crates_frame_by_frame() {
    let Building { scene, cells, ids, rust, mut own } = Building::new();
    let (view, pipeline) = (make(vis_view_create), make(vis_pipeline_create));
    let (mut of, mut visible, mirrored, mut shown) =
        (null_mut(), null_mut(), make(vis_view_create), null_mut());
    // SAFETY: handles are live.
    unsafe {
        ok(vis_visible_create(false, &raw mut visible));
        ok(vis_visible_create(true, &raw mut shown));
        ok(vis_reflections_create(cells, 3, 2, &raw mut of));
        ok(vis_pipeline_add_frustum(pipeline));
        ok(vis_pipeline_add_reflections(pipeline, of));
        // Kept answers, too: there is none with mirrors.
        ok(vis_pipeline_set_reach(pipeline, 0.2, 0.1));
    }
    assert_eq!(reflections(of), [], "before the first frame");
    let mut eye = PortalEye::new().with_reflections(3, 2);
    let mut set = VisibleSet::new();
    let (mut depths, mut left_out, mut fewer, mut turned) = ([0; 3], 0, 0, 0);
    for frame in 0..80 {
        let at = [0.5 + 0.14 * f64::from(frame), 2.0, 1.5];
        let angle = f64::from(frame) * 0.5;
        let target = [at[0] + angle.cos(), at[1] + 0.5 * angle.sin(), 1.4];
        let pose = vis_pose { eye: at, target, up: [0.0, 0.0, 1.0] };
        let is_open = frame % 10 < 7;
        let is_uncovered = frame % 8 != 5;
        // SAFETY: handles are live.
        unsafe {
            ok(vis_cells_set_open(cells, 0, is_open));
            ok(vis_cells_set_mirror(cells, 1, is_uncovered));
            ok(vis_view_set_layers(mirrored, 0));
            ok(vis_view_set_perspective(view, &raw const pose, 1.2, 1.5, 0.05, 100.0));
            ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
        }
        own.set_open(PortalId(0), is_open).expect("a door");
        own.set_mirror(MirrorId(1), is_uncovered).expect("a mirror");
        let [point, target, up] = [pose.eye, pose.target, pose.up].map(DVec3::from_array);
        let camera =
            View::perspective(Pose::look_at(point, target, up), 1.2, 1.5, 0.05, 100.0).expect("a view");
        set.fill(&rust, &camera);
        FrustumCuller::new().cull(&rust, &camera, &mut set);
        eye.cull(&own, &rust, &camera, &mut set);
        assert_eq!(indices(visible, scene), own_indices(&set, &rust), "frame {frame}: visible objects");
        let found = reflections(of);
        let expected: Vec<_> = eye
            .reflections()
            .iter()
            .map(|one| {
                let parent = one.parent().map_or(VIS_NO_REFLECTION, |parent| parent as u32);
                vis_reflection { mirror: one.mirror().0, parent, depth: one.depth() }
            })
            .collect();
        assert_eq!(found, expected, "frame {frame}: reflections");
        let mut count = 99;
        // SAFETY: handles are live.
        ok(unsafe { vis_reflections_left_out(of, &raw mut count) });
        assert_eq!(count, eye.stats().reflections_left_out, "frame {frame}: mirrors without a reflection");
        left_out += count;
        for (number, one) in (0..).zip(eye.reflections()) {
            // SAFETY: handles are live.
            ok(unsafe { vis_reflections_read(of, number, mirrored, shown) });
            let objects = own_indices(one.visible(), &rust);
            assert_eq!(indices(shown, scene), objects, "frame {frame}, reflection {number}: objects");
            fewer += usize::from(objects.len() < ids.len() && !objects.is_empty());
            let origin = (frame % 2 == 1).then_some([3.0, -5.0, 7.0]);
            let from = origin.map_or(DVec3::ZERO, DVec3::from_array);
            let (matrix, planes) = matrix_and_planes(mirrored, origin.as_ref());
            assert_eq!(matrix, one.view().clip_from(from).to_cols_array(), "frame {frame}: the matrix");
            let [clip] = one.view().clip_planes() else { panic!("a reflection has one clip plane") };
            let offset = clip.signed_distance(from - one.view().origin());
            assert_eq!(
                planes,
                [clip.normal.x, clip.normal.y, clip.normal.z, offset],
                "frame {frame}: clip plane"
            );
            depths[one.depth() as usize] += 1;
            // What the matrix mirrors turns its determinant.
            let m = one.view().clip_from(from).determinant() * camera.clip_from(from).determinant();
            turned += usize::from((m < 0.0) == (one.depth() == 1));
            // The view of the mirror culls as any other view: no object of the frustum is added.
            // SAFETY: handles are live.
            unsafe {
                let by_frustum = make(vis_pipeline_create);
                ok(vis_pipeline_add_frustum(by_frustum));
                ok(vis_pipeline_cull(by_frustum, scene, mirrored, visible, null_mut()));
                let all = indices(visible, scene);
                assert!(objects.iter().all(|index| all.contains(index)), "frame {frame}: layers and frustum");
                vis_pipeline_destroy(by_frustum);
            }
        }
    }
    let all: usize = depths.iter().sum();
    assert!(depths[1] > 20 && depths[2] > 10 && left_out > 10, "depths {depths:?}, {left_out} left out");
    assert!(fewer > 20 && turned == all, "{fewer} with some objects, {turned} of {all} turned");

    // The set that was read is a result of its own.
    // SAFETY: handles are live.
    unsafe {
        let pose = vis_pose { eye: [1.0, 2.0, 1.5], target: [9.0, 2.0, 1.4], up: [0.0, 0.0, 1.0] };
        ok(vis_cells_set_open(cells, 0, true));
        ok(vis_view_set_perspective(view, &raw const pose, 1.2, 1.5, 0.05, 100.0));
        ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
        ok(vis_reflections_read(of, 0, mirrored, shown));
        let before = indices(shown, scene);
        assert!(before.len() > 5, "objects in the mirror: {before:?}");
        // A camera that stands still asks for an answer with a reach, which there is not with mirrors.
        let all = (indices(visible, scene), reflections(of));
        for frame in 0..4 {
            let mut is_kept = true;
            ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
            ok(vis_pipeline_is_kept(pipeline, &raw mut is_kept));
            assert!(!is_kept, "frame {frame} of a camera that stands still");
            assert_eq!((indices(visible, scene), reflections(of)), all, "frame {frame} of the same view");
        }
        let mut id = 0;
        ok(vis_scene_insert(scene, &vis_object_default(boxes()[0]), &raw mut id));
        ok(vis_scene_remove(scene, ids[before[0] as usize]));
        ok(vis_scene_rebuild(scene));
        assert_eq!(indices(shown, scene), before[1..], "objects read before the scene changed");
        ok(vis_reflections_read(of, 0, mirrored, shown));
        assert_eq!(indices(shown, scene), before[1..], "objects read after the scene changed");
        // Handles are destroyed in any order.
        vis_cells_destroy(cells);
        vis_reflections_destroy(of);
        vis_reflections_destroy(null_mut());
        ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
        vis_pipeline_destroy(pipeline);
        [visible, shown].into_iter().for_each(|visible| vis_visible_destroy(visible));
        [view, mirrored].into_iter().for_each(|view| vis_view_destroy(view));
        vis_scene_destroy(scene);
    }
}

#[test]
fn what_is_wrong_with_mirrors_is_refused_by_name() {
    let Building { scene, cells, .. } = Building::new();
    let (view, pipeline) = (make(vis_view_create), make(vis_pipeline_create));
    let (mut of, mut visible, mut mirror) = (null_mut(), null_mut(), 7);
    let pose = vis_pose { eye: [1.0, 2.0, 1.5], target: [9.0, 2.0, 1.4], up: [0.0, 0.0, 1.0] };
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        ok(vis_visible_create(false, &raw mut visible));
        let glass = mirrors()[0];
        let mut add =
            |cell, count| vis_cells_add_mirror(cells, cell, glass.as_ptr().cast(), count, &raw mut mirror);
        returns(add(3, 4), VIS_ERROR_UNKNOWN_ID);
        assert_eq!(message(), "there is no cell 3", "a cell that does not exist");
        returns(add(0, 2), VIS_ERROR_ARGUMENT);
        returns(add(0, 0), VIS_ERROR_ARGUMENT);
        assert_eq!(mirror, 7, "no mirror was added");
        returns(vis_cells_set_mirror(cells, 2, true), VIS_ERROR_UNKNOWN_ID);
        assert_eq!(message(), "there is no mirror 2", "a mirror that does not exist");
        returns(vis_reflections_create(null(), 8, 2, &raw mut of), VIS_ERROR_NULL);
        ok(vis_reflections_create(cells, 8, 1, &raw mut of));
        returns(vis_pipeline_add_reflections(pipeline, null()), VIS_ERROR_NULL);
        ok(vis_pipeline_add_reflections(pipeline, of));
        let mut matrix = [7.0; 16];
        returns(vis_view_matrix(view, null(), matrix.as_mut_ptr()), VIS_ERROR_STATE);
        ok(vis_view_set_perspective(view, &raw const pose, 1.2, 1.5, 0.05, 100.0));
        returns(vis_view_matrix(view, [f64::NAN; 3].as_ptr(), matrix.as_mut_ptr()), VIS_ERROR_ARGUMENT);
        assert_eq!((message().as_str(), matrix), ("`origin` is not finite", [7.0; 16]), "a wrong origin");
        ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
        let before = matrix_and_planes(view, None);
        assert_eq!(before.1, [], "a camera has no clip plane");
        returns(vis_reflections_read(of, 1, view, visible), VIS_ERROR_UNKNOWN_ID);
        assert_eq!(message(), "the frame has 1 reflections, and no reflection 1", "beyond the last");
        assert_eq!(matrix_and_planes(view, None), before, "refused calls change nothing");
        let first = vis_reflection { mirror: 0, parent: VIS_NO_REFLECTION, depth: 1 };
        assert_eq!(reflections(of), [first], "the mirror that the eye sees, and none in it");
        ok(vis_reflections_read(of, 0, view, visible));
        assert_ne!(matrix_and_planes(view, None), before, "the view of the mirror");
        // Without reflections, mirrors are left out.
        let (none, mut count) = (
            {
                let mut none = null_mut();
                ok(vis_reflections_create(cells, 0, 2, &raw mut none));
                none
            },
            9,
        );
        let other = make(vis_pipeline_create);
        returns(vis_pipeline_add_reflections(other, of), VIS_ERROR_STATE);
        assert_eq!(
            message(),
            "a pipeline has these reflections: create others for each pipeline",
            "two pipelines"
        );
        ok(vis_pipeline_add_reflections(other, none));
        ok(vis_view_set_perspective(view, &raw const pose, 1.2, 1.5, 0.05, 100.0));
        ok(vis_pipeline_cull(other, scene, view, visible, null_mut()));
        ok(vis_reflections_left_out(none, &raw mut count));
        assert_eq!((reflections(none), count), (vec![], 1), "no room for a reflection");
        [pipeline, other].into_iter().for_each(|pipeline| vis_pipeline_destroy(pipeline));
        [of, none].into_iter().for_each(|of| vis_reflections_destroy(of));
        vis_visible_destroy(visible);
        vis_view_destroy(view);
        vis_cells_destroy(cells);
        vis_scene_destroy(scene);
    }
}

/// Contribution culling reaches the objects of mirrors, by distances from the camera: the reflected eye is
/// more than four times as far away.
#[test]
fn mirrors_show_the_levels_that_the_camera_shows() {
    let Building { scene, cells, .. } = Building::new();
    let view = make(vis_view_create);
    let (mut of, mut plain_of, mut visible, mut shown) = (null_mut(), null_mut(), null_mut(), null_mut());
    let (pipeline, plain, mirrored) =
        (make(vis_pipeline_create), make(vis_pipeline_create), make(vis_view_create));
    let pose = vis_pose { eye: [1.0, 2.0, 1.5], target: [9.0, 2.0, 1.4], up: [0.0, 0.0, 1.0] };
    let in_mirror = |pipeline: *mut vis_pipeline, of: *const vis_reflections, visible, shown| {
        // SAFETY: handles are live.
        unsafe {
            ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
            ok(vis_reflections_read(of, 0, mirrored, shown));
        }
        indices(shown, scene)
    };
    // SAFETY: handles are live, and points have 3 numbers.
    unsafe {
        ok(vis_visible_create(false, &raw mut visible));
        ok(vis_visible_create(false, &raw mut shown));
        ok(vis_view_set_perspective(view, &raw const pose, 1.2, 1.5, 0.05, 100.0));
        let cube = |min: [f32; 3]| vis_object_default(vis_box { min, max: min.map(|x| x + 0.3) });
        // All stand beside the line from the camera to the mirror, in view of both.
        let (mut near, mut far, mut child, mut parent) = (0, 0, 0, 0);
        for (id, y) in [(&mut near, 1.0), (&mut far, 1.4), (&mut child, 2.2), (&mut parent, 2.2)] {
            ok(vis_scene_insert(scene, &cube([3.0, y, 1.5]), id));
        }
        let index = |id: u64| id as u32;
        let without = |list: &[u32], ids: &[u64]| -> Vec<u32> {
            list.iter().copied().filter(|&one| ids.iter().all(|&id| index(id) != one)).collect()
        };
        // The camera is 2 m away, the reflected eye 20 m.
        ok(vis_scene_set_draw_range(scene, near, 0.0, 5.0));
        ok(vis_scene_set_draw_range(scene, far, 0.0, 1.0));
        ok(vis_scene_set_draw_range(scene, parent, 10.0, f32::INFINITY));
        ok(vis_scene_set_hlod_parent(scene, child, parent));
        for (pipeline, of) in [(plain, &mut plain_of), (pipeline, &mut of)] {
            ok(vis_reflections_create(cells, 8, 2, of));
            ok(vis_pipeline_add_frustum(pipeline));
            ok(vis_pipeline_add_reflections(pipeline, *of));
        }
        let all = in_mirror(plain, plain_of, visible, shown);
        let four = [near, far, child, parent];
        assert!(four.iter().all(|&id| all.contains(&index(id))), "all four are in the mirror: {all:?}");
        // Contribution culling that is added after the mirrors counts as well.
        assert_eq!(in_mirror(pipeline, of, visible, shown), all, "without contribution culling");
        ok(vis_pipeline_add_contribution(pipeline, 0.0, 0.0));
        let expected = without(&all, &[far, parent]);
        for frame in 0..3 {
            assert_eq!(in_mirror(pipeline, of, visible, shown), expected, "frame {frame}: by distance");
            let by_camera = indices(visible, scene);
            for id in four {
                let [camera, mirror] = [&by_camera, &expected].map(|list| list.contains(&index(id)));
                assert_eq!(camera, mirror, "frame {frame}: object {id} for the camera and in the mirror");
            }
        }
        ok(vis_pipeline_set_contribution(pipeline, 0.0, 0.0, [-500.0, 2.0, 1.5].as_ptr()));
        let expected = without(&all, &[near, far, child]);
        assert_eq!(in_mirror(pipeline, of, visible, shown), expected, "by a point far away");
        ok(vis_pipeline_set_contribution(pipeline, 1080.0, 1e6, null()));
        assert_eq!(in_mirror(pipeline, of, visible, shown), [], "all are too small");
        // Objects that come later do not bring back what was removed.
        ok(vis_pipeline_set_contribution(pipeline, 0.0, 0.0, null()));
        ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
        ok(vis_scene_insert(scene, &cube([3.0, 1.8, 1.0]), &raw mut far));
        ok(vis_scene_rebuild(scene));
        ok(vis_reflections_read(of, 0, mirrored, shown));
        assert_eq!(indices(shown, scene).len(), all.len() - 2, "objects read after the scene changed");
        [pipeline, plain].into_iter().for_each(|pipeline| vis_pipeline_destroy(pipeline));
        [of, plain_of].into_iter().for_each(|of| vis_reflections_destroy(of));
        [visible, shown].into_iter().for_each(|visible| vis_visible_destroy(visible));
        [view, mirrored].into_iter().for_each(|view| vis_view_destroy(view));
        vis_cells_destroy(cells);
        vis_scene_destroy(scene);
    }
}

#[test]
fn a_set_with_changes_has_changes_after_a_reflection_was_read_into_it() {
    let Building { scene, cells, .. } = Building::new();
    let (view, pipeline, mirrored) =
        (make(vis_view_create), make(vis_pipeline_create), make(vis_view_create));
    let pose = vis_pose { eye: [1.0, 2.0, 1.5], target: [9.0, 2.0, 1.4], up: [0.0, 0.0, 1.0] };
    for with_changes in [true, false] {
        let (mut of, mut visible) = (null_mut(), null_mut());
        let (mut newly, mut hidden) = (9, 9);
        // SAFETY: handles are live.
        unsafe {
            ok(vis_visible_create(with_changes, &raw mut visible));
            ok(vis_view_set_perspective(view, &raw const pose, 1.2, 1.5, 0.05, 100.0));
            ok(vis_reflections_create(cells, 8, 2, &raw mut of));
            ok(vis_pipeline_add_reflections(pipeline, of));
            let mut changes = |what: &str, expected: [usize; 2]| {
                ok(vis_visible_newly_visible(visible, null_mut(), 0, &raw mut newly));
                ok(vis_visible_newly_hidden(visible, null_mut(), 0, &raw mut hidden));
                let expected = if with_changes { expected } else { [0, 0] };
                assert_eq!([newly, hidden], expected, "{what}, with changes: {with_changes}");
            };
            ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
            let count = indices(visible, scene).len();
            changes("a frame", [count, 0]);
            ok(vis_reflections_read(of, 0, mirrored, visible));
            changes("a reflection", [0, 0]);
            assert!(!indices(visible, scene).is_empty(), "objects in the mirror");
            ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
            changes("the next frame", [count, 0]);
            ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
            changes("the frame after it", [0, 0]);
            vis_reflections_destroy(of);
            vis_visible_destroy(visible);
        }
    }
    // SAFETY: handles are live, and used no more.
    unsafe {
        vis_pipeline_destroy(pipeline);
        [view, mirrored].into_iter().for_each(|view| vis_view_destroy(view));
        vis_cells_destroy(cells);
        vis_scene_destroy(scene);
    }
}
