//! Tests of answers that come late, of the horizon, and of cells made from a scene.

mod common;

use common::{make, ok, returns};
use std::ptr::{null, null_mut};
use visibility::vis_status::*;
use visibility::*;

/// Returns a view from a place, turned from the x axis by an angle in radians.
fn look_from(eye: [f64; 3], turn: f64) -> *mut vis_view {
    let view = make(vis_view_create);
    let target = [eye[0] + turn.cos(), eye[1] + turn.sin(), eye[2]];
    let pose = vis_pose { eye, target, up: [0.0, 0.0, 1.0] };
    // SAFETY: the view is live.
    ok(unsafe { vis_view_set_perspective(view, &raw const pose, 1.0, 1.0, 0.1, f64::INFINITY) });
    view
}

/// Makes a wall from 5 to 6 along x, 40 m wide and from the ground at z = -2 up to `height`, and a lamp
/// behind it. Returns the ids of both.
fn street(height: f32) -> (*mut vis_scene, [u64; 2]) {
    let scene = make(vis_scene_create);
    let wall = vis_box { min: [5.0, -20.0, -2.0], max: [6.0, 20.0, height] };
    let lamp = vis_box { min: [9.0, -1.0, -1.0], max: [10.0, 1.0, 1.0] };
    let mut ids = [VIS_NO_OBJECT; 2];
    for (id, bounds, flags) in [(0, wall, VIS_OBJECT_OCCLUDER), (1, lamp, 0)] {
        let desc = vis_object_desc { flags, ..vis_object_default(bounds) };
        // SAFETY: the scene is live.
        ok(unsafe { vis_scene_insert(scene, &raw const desc, &raw mut ids[id]) });
    }
    let mut mesh = 0;
    // SAFETY: the scene is live.
    unsafe {
        ok(vis_scene_add_box_mesh(scene, &raw const wall, &raw mut mesh));
        ok(vis_scene_set_mesh(scene, ids[0], mesh, null()));
    }
    (scene, ids)
}

/// Culls and returns whether an object is visible.
fn sees(pipeline: *mut vis_pipeline, scene: *mut vis_scene, view: *mut vis_view, id: u64) -> bool {
    let (mut visible, mut seen) = (null_mut(), false);
    // SAFETY: handles are live.
    unsafe {
        ok(vis_visible_create(false, &raw mut visible));
        ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
        ok(vis_visible_contains(visible, scene, id, &raw mut seen));
        vis_visible_destroy(visible);
    }
    seen
}

#[test]
fn the_horizon_hides_behind_walls_and_follows_the_scene() {
    for height in [9.0, 0.2] {
        let (scene, [wall, lamp]) = street(height);
        let (view, pipeline) = (look_from([0.0; 3], 0.0), make(vis_pipeline_create));
        // SAFETY: handles are live.
        unsafe {
            ok(vis_pipeline_add_frustum(pipeline));
            ok(vis_pipeline_add_horizon(pipeline, true));
        }
        let is_high = height > 1.0;
        assert_eq!(sees(pipeline, scene, view, lamp), !is_high, "behind a wall of {height} m");
        // SAFETY: the scene is live.
        ok(unsafe { vis_scene_set_flags(scene, wall, 0) });
        assert!(sees(pipeline, scene, view, lamp), "a wall that is no occluder any more, {height} m high");
    }
}

#[test]
fn an_answer_for_a_reach_is_kept_and_told_from_others() {
    let (scene, [_, lamp]) = street(9.0);
    let pipeline = make(vis_pipeline_create);
    let (metres, radians) = (0.5, 0.2);
    // SAFETY: handles are live.
    unsafe {
        ok(vis_pipeline_add_frustum(pipeline));
        ok(vis_pipeline_add_z_buffer(pipeline, 0, 0));
        ok(vis_pipeline_set_reach(pipeline, metres, radians));
    }
    let kept = || {
        let mut kept = false;
        // SAFETY: the pipeline is live.
        ok(unsafe { vis_pipeline_is_kept(pipeline, &raw mut kept) });
        kept
    };
    let (view, mut visible) = (look_from([0.0; 3], 0.0), null_mut());
    // SAFETY: `visible` is memory for the result.
    ok(unsafe { vis_visible_create(false, &raw mut visible) });
    for is_kept in [false, false, true] {
        let mut seen = true;
        // SAFETY: handles are live.
        unsafe {
            ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
            ok(vis_visible_contains(visible, scene, lamp, &raw mut seen));
        }
        assert!(!seen, "the lamp is behind the wall");
        assert_eq!(kept(), is_kept, "frames for the view, for its reach, and one that keeps the answer");
    }
    for (eye, turn, expected) in [
        ([0.0; 3], 0.0, true),
        ([0.4, 0.0, 0.2], 0.15, true),
        ([0.6, 0.0, 0.0], 0.0, false),
        ([0.0; 3], 0.25, false),
    ] {
        let (other, mut within) = (look_from(eye, turn), !expected);
        // SAFETY: handles are live.
        ok(unsafe { vis_view_is_within_reach(other, view, metres, radians, &raw mut within) });
        assert_eq!(within, expected, "a view from {eye:?}, turned by {turn}");
    }
    // SAFETY: the pipeline is live.
    ok(unsafe { vis_pipeline_set_reach(pipeline, 0.0, 0.0) });
    assert!(!kept(), "a pipeline without a reach");
    let (empty, mut within) = (make(vis_view_create), true);
    // SAFETY: handles are live.
    returns(
        unsafe { vis_view_is_within_reach(empty, view, metres, radians, &raw mut within) },
        VIS_ERROR_STATE,
    );
}

#[test]
fn cells_of_a_scene_have_walls_only_where_an_occluder_is_always_drawn() {
    let count_of = |scene| {
        let (mut cells, mut count) = (null_mut(), 0);
        // SAFETY: the scene is live.
        unsafe {
            ok(vis_cells_create_of_scene(scene, 0, &raw mut cells, &raw mut count));
            vis_cells_destroy(cells);
        }
        count
    };
    let (scene, [wall, lamp]) = street(9.0);
    let (walled, open) = (count_of(scene), count_of(make(vis_scene_create)));
    assert!(walled > open, "a wall that is always drawn: {walled} cells, without it {open}");
    // SAFETY: the scene is live.
    unsafe {
        ok(vis_scene_set_draw_range(scene, wall, 0.0, 50.0));
        assert_eq!(count_of(scene), open, "a wall that is drawn up to 50 m");
        ok(vis_scene_set_draw_range(scene, wall, 0.0, f32::INFINITY));
        assert_eq!(count_of(scene), walled, "the wall is always drawn again");
        ok(vis_scene_set_hlod_parent(scene, lamp, wall));
        assert_eq!(count_of(scene), open, "a wall with an HLOD child");
        ok(vis_scene_set_hlod_parent(scene, lamp, VIS_NO_OBJECT));
        ok(vis_scene_set_hlod_parent(scene, wall, lamp));
        assert_eq!(count_of(scene), open, "a wall with an HLOD parent");
        ok(vis_scene_set_hlod_parent(scene, wall, VIS_NO_OBJECT));
        ok(vis_scene_set_layers(scene, wall, 0));
        assert_eq!(count_of(scene), open, "a wall on no layer");
        ok(vis_scene_set_layers(scene, wall, 2));
        assert_eq!(count_of(scene), walled, "a wall on another layer");
    }
}

/// Triangles of a box whose corners have the bits of their numbers as coordinates.
const CUBOID: [u32; 36] = [
    0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7,
    5,
];

#[test]
fn cells_of_a_scene_hide_what_is_behind_its_walls() {
    let (scene, _) = street(9.0);
    let (mut cells, mut count) = (null_mut(), 0);
    // SAFETY: the scene is live.
    ok(unsafe { vis_cells_create_of_scene(scene, 0, &raw mut cells, &raw mut count) });
    assert!(count > 1, "cells around a closed wall: {count}");
    // A room of walls that are drawn from both sides, and a lamp outside.
    let room = make(vis_scene_create);
    let bounds = vis_box { min: [-3.0; 3], max: [3.0; 3] };
    let lamp_box = vis_box { min: [9.0, -1.0, -1.0], max: [10.0, 1.0, 1.0] };
    let [mut walls, mut lamp, mut mesh] = [VIS_NO_OBJECT, VIS_NO_OBJECT, 0];
    let desc = vis_object_desc { flags: VIS_OBJECT_OCCLUDER, ..vis_object_default(bounds) };
    let lamp_desc = vis_object_default(lamp_box);
    let corners: Vec<f32> =
        (0..8).flat_map(|i| [1, 2, 4].map(|axis| if i & axis == 0 { -3.0 } else { 3.0 })).collect();
    let view = look_from([0.0; 3], 0.0);
    for (is_two_sided, is_hidden) in [(true, true), (false, false)] {
        let pipeline = make(vis_pipeline_create);
        // SAFETY: handles are live, and lists are as long as said.
        unsafe {
            ok(vis_scene_insert(room, &raw const desc, &raw mut walls));
            ok(vis_scene_insert(room, &raw const lamp_desc, &raw mut lamp));
            ok(vis_scene_add_mesh(
                room,
                corners.as_ptr(),
                8,
                CUBOID.as_ptr(),
                12,
                is_two_sided,
                &raw mut mesh,
            ));
            ok(vis_scene_set_mesh(room, walls, mesh, null()));
            ok(vis_cells_create_of_scene(room, 0, &raw mut cells, null_mut()));
            ok(vis_pipeline_add_frustum(pipeline));
            ok(vis_pipeline_add_portals(pipeline, cells));
        }
        assert_eq!(!sees(pipeline, room, view, lamp), is_hidden, "walls of two sides: {is_two_sided}");
        // SAFETY: handles are live.
        unsafe {
            ok(vis_scene_remove(room, walls));
            ok(vis_scene_remove(room, lamp));
        }
    }
}

/// Two walls with a slot of a metre between them. The transform of the second subtracts numbers that are
/// equal up to the last bits of an `f32`.
#[test]
fn cells_of_a_scene_leave_slots_open_that_f32_would_close() {
    // Far from the zero point of the world, nothing but the scene's origin is large.
    [0.0, 6.4e6].into_iter().for_each(cells_leave_a_slot_open);
}

fn cells_leave_a_slot_open(away: f64) {
    let scene = make(vis_scene_create);
    // SAFETY: the scene is live, and the point has three numbers.
    ok(unsafe { vis_scene_set_origin(scene, [away, 0.0, 0.0].as_ptr()) });
    let lamp_box = vis_box { min: [9.5, 0.25, -0.25], max: [10.5, 0.75, 0.25] };
    let lamp_desc = vis_object_default(lamp_box);
    let mut lamp = VIS_NO_OBJECT;
    // SAFETY: the scene is live.
    ok(unsafe { vis_scene_insert(scene, &raw const lamp_desc, &raw mut lamp) });
    // The second wall goes from 3 * 16777211 - 50331632 = 1 to 100.
    let thrice: [f32; 16] =
        [1.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -50_331_632.0, 0.0, 1.0];
    for (y, placed, transform) in
        [([-100.0, 0.0], [-100.0, 0.0], None), ([16_777_211.0, 16_777_244.0], [1.0, 100.0], Some(thrice))]
    {
        let bounds = vis_box { min: [5.0, placed[0], -100.0], max: [5.0, placed[1], 100.0] };
        let desc = vis_object_desc { flags: VIS_OBJECT_OCCLUDER, ..vis_object_default(bounds) };
        let corners: [f32; 12] = [5.0, y[0], -100.0, 5.0, y[1], -100.0, 5.0, y[1], 100.0, 5.0, y[0], 100.0];
        let indices = [0, 1, 2, 0, 2, 3];
        let (mut wall, mut mesh) = (VIS_NO_OBJECT, 0);
        let transform = transform.as_ref().map_or(null(), |numbers| numbers.as_ptr());
        // SAFETY: handles are live, and lists are as long as said.
        unsafe {
            ok(vis_scene_insert(scene, &raw const desc, &raw mut wall));
            ok(vis_scene_add_mesh(scene, corners.as_ptr(), 4, indices.as_ptr(), 2, true, &raw mut mesh));
            ok(vis_scene_set_mesh(scene, wall, mesh, transform));
        }
    }
    // A hall around both, so that the eye is in a cell.
    let hall = vis_box { min: [-20.0, -100.0, -100.0], max: [20.0, 100.0, 100.0] };
    let desc = vis_object_desc { flags: VIS_OBJECT_OCCLUDER, ..vis_object_default(hall) };
    let corners: Vec<f32> = (0..8)
        .flat_map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 0 { hall.min[k] } else { hall.max[k] }))
        .collect();
    let (mut walls, mut mesh) = (VIS_NO_OBJECT, 0);
    // SAFETY: handles are live, and lists are as long as said.
    unsafe {
        ok(vis_scene_insert(scene, &raw const desc, &raw mut walls));
        ok(vis_scene_add_mesh(scene, corners.as_ptr(), 8, CUBOID.as_ptr(), 12, true, &raw mut mesh));
        ok(vis_scene_set_mesh(scene, walls, mesh, null()));
    }
    let (mut cells, pipeline) = (null_mut(), make(vis_pipeline_create));
    // SAFETY: handles are live.
    unsafe {
        ok(vis_cells_create_of_scene(scene, 0, &raw mut cells, null_mut()));
        ok(vis_pipeline_add_portals(pipeline, cells));
    }
    let view = look_from([away, 0.5, 0.0], 0.0);
    assert!(sees(pipeline, scene, view, lamp), "a lamp behind a slot of a metre, {away} m away");
    let aside = look_from([away, -50.0, 0.0], 1.37);
    assert!(!sees(pipeline, scene, aside, lamp), "a lamp behind the first wall, {away} m away");
}

/// Two sheets that are drawn from the side of greater x alone, the first placed by a transform that mirrors
/// it. From behind both, a lamp beyond them is seen.
#[test]
fn cells_of_a_scene_know_the_fronts_of_mirrored_sheets() {
    let scene = make(vis_scene_create);
    let lamp_box = vis_box { min: [14.0, -1.0, -1.0], max: [16.0, 1.0, 1.0] };
    let lamp_desc = vis_object_default(lamp_box);
    let mut lamp = VIS_NO_OBJECT;
    // SAFETY: the scene is live.
    ok(unsafe { vis_scene_insert(scene, &raw const lamp_desc, &raw mut lamp) });
    let mirror: [f32; 16] =
        [-1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -5.0, 0.0, 0.0, 1.0];
    let shift: [f32; 16] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 5.0, 0.0, 0.0, 1.0];
    let sheet: [f32; 12] = [0.0, -100.0, -100.0, 0.0, 100.0, -100.0, 0.0, 100.0, 100.0, 0.0, -100.0, 100.0];
    let hall: Vec<f32> = (0..8)
        .flat_map(|i| {
            [(1, 20.0), (2, 100.0), (4, 100.0)].map(|(axis, far)| if i & axis == 0 { -far } else { far })
        })
        .collect();
    for (corners, indices, x, transform, is_two_sided) in [
        (&sheet[..], &[0u32, 2, 1, 0, 3, 2][..], [-5.0, -5.0], &mirror, false),
        (&sheet, &[0, 1, 2, 0, 2, 3], [5.0, 5.0], &shift, false),
        (
            &hall,
            &CUBOID,
            [-20.0, 20.0],
            &[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            true,
        ),
    ] {
        let bounds = vis_box { min: [x[0], -100.0, -100.0], max: [x[1], 100.0, 100.0] };
        let desc = vis_object_desc { flags: VIS_OBJECT_OCCLUDER, ..vis_object_default(bounds) };
        let (mut wall, mut mesh) = (VIS_NO_OBJECT, 0);
        let (vertex_count, triangle_count) = (corners.len() / 3, indices.len() / 3);
        // SAFETY: handles are live, and lists are as long as said.
        unsafe {
            ok(vis_scene_insert(scene, &raw const desc, &raw mut wall));
            ok(vis_scene_add_mesh(
                scene,
                corners.as_ptr(),
                vertex_count,
                indices.as_ptr(),
                triangle_count,
                is_two_sided,
                &raw mut mesh,
            ));
            ok(vis_scene_set_mesh(scene, wall, mesh, transform.as_ptr()));
        }
    }
    let (mut cells, pipeline) = (null_mut(), make(vis_pipeline_create));
    // SAFETY: handles are live.
    unsafe {
        ok(vis_cells_create_of_scene(scene, 0, &raw mut cells, null_mut()));
        ok(vis_pipeline_add_portals(pipeline, cells));
    }
    assert!(
        sees(pipeline, scene, look_from([-15.0, 0.0, 0.0], 0.0), lamp),
        "a lamp behind the backs of two sheets"
    );
}
