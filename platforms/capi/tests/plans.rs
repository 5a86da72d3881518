//! Tests of plans, regions, proofs, queries, casters and occluders of levels through the C interface. The
//! answers are worked out by hand: a wall, what is before it, behind it and beside it.

mod common;

use common::{make, message, ok, returns};
use std::ptr::null_mut;
use visibility::vis_status::*;
use visibility::*;

fn wall(from: [f64; 2], to: [f64; 2]) -> vis_wall {
    vis_wall { from, to, opacity: vis_opacity::VIS_OPACITY_OPAQUE as u32 }
}

/// Reads a list by calling `write` twice: first for the length, then for the list.
fn list<T: Copy>(empty: T, write: impl Fn(*mut T, usize, *mut usize) -> vis_status) -> Vec<T> {
    let mut length = 0;
    ok(write(null_mut(), 0, &raw mut length));
    let mut items = vec![empty; length];
    ok(write(items.as_mut_ptr(), length, &raw mut length));
    assert_eq!(items.len(), length, "the length of the list, asked for twice");
    items
}

#[test]
fn a_plan_tells_what_an_eye_sees() {
    // A wall across, 2 wide at x = 5, and one behind it, 1 wide at x = 9.
    let walls = [wall([5.0, -1.0], [5.0, 1.0]), wall([9.0, -0.5], [9.0, 0.5])];
    let mut plan = null_mut();
    let (eye, behind, beside) = ([0.0, 0.0], [9.0, 0.0], [9.0, 5.0]);
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        ok(vis_plan_create(walls.as_ptr(), walls.len(), &raw mut plan));
        let sees = |a: [f64; 2], b: [f64; 2]| {
            let mut sees = false;
            ok(vis_plan_sees(plan, a.as_ptr(), b.as_ptr(), &raw mut sees));
            sees
        };
        let seen = || {
            list(0, |to, room, count| {
                vis_plan_visible_walls(plan, eye.as_ptr(), f64::INFINITY, to, room, count)
            })
        };
        let ray = |through: [f64; 2]| {
            let mut hit = vis_wall_hit { point: [0.0; 2], wall: 7 };
            ok(vis_plan_ray(plan, eye.as_ptr(), through.as_ptr(), &raw mut hit));
            hit
        };
        assert_eq!([sees(eye, behind), sees(eye, beside)], [false, true], "behind the wall and beside it");
        assert_eq!(seen(), [0], "walls seen from the eye");
        assert_eq!(ray([1.0, 0.0]), vis_wall_hit { point: [5.0, 0.0], wall: 0 }, "a ray ahead");
        assert_eq!(ray([1.0, 5.0]).wall, VIS_NO_WALL, "a ray past the wall");
        assert!(ray(eye).point[0].is_nan(), "a ray without a direction");
        let polygon = |range| {
            let corners = list(0.0, |to, room, count| {
                vis_plan_visibility_polygon(plan, [7.0, 0.0].as_ptr(), range, to, room, count)
            });
            let corners: Vec<[f64; 2]> = corners.chunks(2).map(|corner| [corner[0], corner[1]]).collect();
            let next = corners.iter().cycle().skip(1);
            let doubled: f64 = corners.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum();
            (corners, doubled / 2.0)
        };
        // Between the walls, 2 m from both.
        let (corners, area) = polygon(1.5);
        let circle = std::f64::consts::PI * 1.5 * 1.5;
        assert!(area > 0.9 * circle && area <= circle, "area {area} of a circle of 1.5 m: {corners:?}");
        assert!(corners.iter().all(|[x, y]| (x - 7.0).hypot(*y) < 1.5001), "{corners:?}");
        // From a region that is wider than the first wall, both are seen; from a point one is.
        let from = |points: &[f64]| {
            list(0, |to, room, count| {
                vis_plan_walls_seen_from_region(plan, points.as_ptr(), points.len() / 2, to, room, count)
            })
        };
        assert_eq!(from(&[4.5, 0.0]), [0], "walls seen from a point");
        assert_eq!(from(&[4.5, -1.5, 4.5, 1.5]), [0, 1], "walls seen from a segment");
        ok(vis_plan_set_opacity(plan, 0, vis_opacity::VIS_OPACITY_CLEAR as u32));
        assert_eq!((sees(eye, behind), seen()), (true, vec![0, 1]), "through a clear wall");
        // Sight passes from the left of a wall to its right: from +x to -x along +y.
        ok(vis_plan_set_opacity(plan, 0, vis_opacity::VIS_OPACITY_ONE_WAY as u32));
        assert_eq!([sees(eye, behind), sees([8.0, 0.0], eye)], [true, false], "through a wall of one way");
        returns(vis_plan_set_opacity(plan, 2, 0), VIS_ERROR_UNKNOWN_ID);
        returns(vis_plan_set_opacity(plan, 0, 3), VIS_ERROR_ARGUMENT);
        vis_plan_destroy(plan);
    }
}

/// Creates a scene of a wall at x = 5, a lamp behind it, and a lamp far beside it. The wall has a mesh and
/// triangles.
fn street() -> (*mut vis_scene, [u64; 3]) {
    let scene = make(vis_scene_create);
    let boxes = [
        ([5.0, -9.0, -9.0], [6.0, 9.0, 9.0]),
        ([9.0, -1.0, -1.0], [10.0, 1.0, 1.0]),
        ([9.0, 40.0, -1.0], [10.0, 41.0, 1.0]),
    ];
    let mut descs = boxes.map(|(min, max)| vis_object_default(vis_box { min, max }));
    descs[0].flags = VIS_OBJECT_OCCLUDER;
    (descs[1].layers, descs[2].layers) = (1, 2);
    let (mut ids, mut mesh) = ([0; 3], 0);
    let side = |y: f32, z: f32| [5.0, y, z];
    let triangles = [
        side(-9.0, -9.0),
        side(9.0, -9.0),
        side(9.0, 9.0),
        side(-9.0, -9.0),
        side(9.0, 9.0),
        side(-9.0, 9.0),
    ];
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        ok(vis_scene_insert_batch(scene, descs.as_ptr(), 3, ids.as_mut_ptr()));
        ok(vis_scene_set_triangles(scene, ids[0], triangles.as_ptr().cast(), 2));
        for i in [1, 2] {
            let vis_box { min: [x, y, z], max: [_, top, high] } = descs[i].bounds;
            let triangle = [[x, y, z], [x, top, z], [x, top, high]];
            ok(vis_scene_set_triangles(scene, ids[i], triangle.as_ptr().cast(), 1));
        }
        ok(vis_scene_add_box_mesh(scene, &raw const descs[0].bounds, &raw mut mesh));
        ok(vis_scene_set_mesh(scene, ids[0], mesh, std::ptr::null()));
    }
    (scene, ids)
}

#[test]
fn a_region_sees_what_is_not_behind_the_wall_for_all_of_it() {
    let (scene, _) = street();
    let seen = |min: [f64; 3], max: [f64; 3]| {
        // SAFETY: handles are live, and arrays as long as said.
        list(0, |to, room, count| unsafe {
            vis_scene_seen_from(scene, min.as_ptr(), max.as_ptr(), to, room, count)
        })
    };
    let proven = |min: [f64; 3], max: [f64; 3], steps| {
        list(0, |to, room, count| {
            // SAFETY: handles are live, and arrays as long as said.
            unsafe { vis_scene_prove_from(scene, min.as_ptr(), max.as_ptr(), 0.0, steps, to, room, count) }
        })
    };
    let (min, max) = ([-1.0; 3], [1.0; 3]);
    assert_eq!(seen(min, max), [0b101], "from before the wall: all but the lamp behind it");
    assert_eq!(proven(min, max, 0), [0b101, 0b010], "seen by rays, and proven hidden");
    assert_eq!(proven(min, max, 1), [0b000, 0b000], "nothing is decided without work");
    // Behind the wall, with triangles: an object that is never culled, and one with a box of NaN.
    let never_culled = vis_object_desc {
        flags: VIS_OBJECT_NEVER_CULL,
        ..vis_object_default(vis_box { min: [9.0, -1.0, -1.0], max: [10.0, 1.0, 1.0] })
    };
    let improper = vis_object_default(vis_box { min: [f32::NAN; 3], max: [f32::NAN; 3] });
    let (mut shown, mut id) = ([0; 2], 0);
    let triangle: [f32; 9] = [9.0, -1.0, -1.0, 9.0, 1.0, -1.0, 9.0, 1.0, 1.0];
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        for desc in [never_culled, improper] {
            ok(vis_scene_insert(scene, &raw const desc, &raw mut id));
            ok(vis_scene_set_triangles(scene, id, triangle.as_ptr(), 1));
            shown = [shown[1], id];
        }
    }
    assert_eq!(seen(min, max), [0b11101], "objects that are never culled are seen");
    assert_eq!(proven(min, max, 0), [0b00101, 0b00010], "objects that are never culled are not hidden");
    for id in shown {
        // SAFETY: the scene is live.
        ok(unsafe { vis_scene_remove(scene, id) });
    }
    let (min, max) = ([-1.0, -1.0, -1.0], [7.0, 1.0, 1.0]);
    assert_eq!(seen(min, max), [0b111], "from both sides of the wall");
    assert_eq!(proven(min, max, 0)[0], 0b111, "seen by rays from both sides of the wall");
    let bad = [f64::NAN; 3];
    let mut count = 0;
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        returns(
            vis_scene_seen_from(scene, bad.as_ptr(), max.as_ptr(), null_mut(), 0, &raw mut count),
            VIS_ERROR_ARGUMENT,
        );
        returns(
            vis_scene_seen_from(scene, max.as_ptr(), min.as_ptr(), null_mut(), 0, &raw mut count),
            VIS_ERROR_ARGUMENT,
        );
        let mut prove = |clearance| {
            let (min, max) = (min.as_ptr(), max.as_ptr());
            vis_scene_prove_from(scene, min, max, clearance, 0, null_mut(), 0, &raw mut count)
        };
        returns(prove(-1.0), VIS_ERROR_ARGUMENT);
        returns(prove(f64::NAN), VIS_ERROR_ARGUMENT);
        vis_scene_destroy(scene);
    }
}

#[test]
fn queries_find_objects_by_ray_and_box() {
    let (scene, ids) = street();
    let (origin, along) = ([0.0_f32; 3], [2.0_f32, 0.0, 0.0]);
    let none = vis_ray_hit { object: 1, distance: 0.0 };
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        let first = |direction: [f32; 3], most, layers| {
            let mut hit = none;
            ok(vis_scene_first_hit(scene, origin.as_ptr(), direction.as_ptr(), most, layers, &raw mut hit));
            hit
        };
        let hit = first(along, f32::INFINITY, VIS_ALL_LAYERS);
        assert!(hit.object == ids[0] && (4.99..=5.0).contains(&hit.distance), "{hit:?}");
        assert_eq!(
            first(along, 4.0, VIS_ALL_LAYERS).object,
            VIS_NO_OBJECT,
            "a ray that ends before the wall"
        );
        assert_eq!(first([0.0, 0.0, 1.0], 99.0, VIS_ALL_LAYERS).object, VIS_NO_OBJECT, "a ray upwards");
        let on_layer = list(none, |to, room, count| {
            vis_scene_ray_hits(scene, origin.as_ptr(), along.as_ptr(), 99.0, 2, to, room, count)
        });
        assert_eq!(on_layer.len(), 1, "the wall is on all layers, the lamp on another: {on_layer:?}");
        let hits = list(none, |to, room, count| {
            vis_scene_ray_hits(scene, origin.as_ptr(), along.as_ptr(), 99.0, VIS_ALL_LAYERS, to, room, count)
        });
        assert_eq!(hits.iter().map(|hit| hit.object).collect::<Vec<_>>(), ids[..2], "all along the ray");
        let mut hit = none;
        returns(
            vis_scene_first_hit(scene, origin.as_ptr(), origin.as_ptr(), 9.0, VIS_ALL_LAYERS, &raw mut hit),
            VIS_ERROR_ARGUMENT,
        );
        let area = vis_box { min: [9.5, 0.0, 0.0], max: [50.0; 3] };
        let within = |layers| {
            list(0, |to, room, count| vis_scene_in_box(scene, &raw const area, layers, to, room, count))
        };
        assert_eq!(within(VIS_ALL_LAYERS), ids[1..], "objects in a box");
        assert_eq!(within(2), ids[2..], "objects of a layer in a box");
        vis_scene_destroy(scene);
    }
}

/// Culls by a pipeline from the origin along x, and returns the bits of the visible objects.
fn cull(pipeline: *mut vis_pipeline, scene: *mut vis_scene) -> u32 {
    let view = make(vis_view_create);
    let pose = vis_pose { eye: [0.0; 3], target: [1.0, 0.0, 0.0], up: [0.0, 0.0, 1.0] };
    let (mut visible, mut bits, mut count) = (null_mut(), 0, 0);
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        ok(vis_view_set_perspective(view, &raw const pose, 1.0, 1.0, 0.1, 20.0));
        ok(vis_visible_create(false, &raw mut visible));
        ok(vis_pipeline_cull(pipeline, scene, view, visible, null_mut()));
        ok(vis_visible_write_bits(visible, scene, &raw mut bits, 1, &raw mut count));
        vis_visible_destroy(visible);
        vis_view_destroy(view);
    }
    bits
}

#[test]
fn casters_are_those_whose_shadow_falls_into_view() {
    let scene = make(vis_scene_create);
    // In view; beyond the view's side towards the sun; on the other side of the view.
    let boxes = [[9.0, 0.0, 0.0], [9.0, 40.0, 0.0], [9.0, -40.0, 0.0]];
    let cube = |[x, y, z]: [f32; 3]| {
        vis_object_default(vis_box { min: [x, y, z], max: [x + 1.0, y + 1.0, z + 1.0] })
    };
    let light = |kind: vis_light_kind, direction, range| {
        let position = [9.0, 41.5, 0.5];
        vis_light { kind: kind as u32, position, direction, range, half_angle: 0.1 }
    };
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        ok(vis_scene_insert_batch(scene, boxes.map(cube).as_ptr(), 3, [0; 3].as_mut_ptr()));
        let casters = |light: vis_light| {
            let pipeline = make(vis_pipeline_create);
            ok(vis_pipeline_add_casters(pipeline, &raw const light));
            let bits = cull(pipeline, scene);
            vis_pipeline_destroy(pipeline);
            bits
        };
        use vis_light_kind::*;
        assert_eq!(casters(light(VIS_LIGHT_DIRECTIONAL, [0.0, 1.0, 0.0], 0.0)), 0b011, "the sun at +y");
        assert_eq!(casters(light(VIS_LIGHT_DIRECTIONAL, [0.0, -1.0, 0.0], 0.0)), 0b101, "the sun at -y");
        assert_eq!(casters(light(VIS_LIGHT_POINT, [0.0; 3], f64::INFINITY)), 0b011, "a lamp at +y");
        assert_eq!(casters(light(VIS_LIGHT_POINT, [0.0; 3], 5.0)), 0b010, "a lamp of 5 m");
        assert_eq!(
            casters(light(VIS_LIGHT_SPOT, [0.0, 1.0, 0.0], 99.0)) & 0b001,
            0,
            "a spot that looks away"
        );
        let pipeline = make(vis_pipeline_create);
        let mut unknown = light(VIS_LIGHT_POINT, [0.0; 3], 1.0);
        unknown.kind = 3;
        returns(vis_pipeline_add_casters(pipeline, &raw const unknown), VIS_ERROR_ARGUMENT);
        returns(
            vis_pipeline_add_casters(pipeline, &light(VIS_LIGHT_DIRECTIONAL, [0.0; 3], 1.0)),
            VIS_ERROR_ARGUMENT,
        );
    }
}

#[test]
fn the_occluders_of_a_level_hide_from_where_they_are() {
    let (scene, ids) = street();
    // A floor of many squares as a wall at x = 7, which no object of the scene is.
    let mut triangles = Vec::new();
    for (i, k) in (-10..10).flat_map(|i| (-10..10).map(move |k| (i as f32, k as f32))) {
        let at = |a: f32, b: f32| [7.0, i + a, k + b];
        triangles.extend([
            at(0.0, 0.0),
            at(1.0, 0.0),
            at(1.0, 1.0),
            at(0.0, 0.0),
            at(1.0, 1.0),
            at(0.0, 1.0),
        ]);
    }
    let count = triangles.len() / 3;
    let (mut level, mut again) = (null_mut(), null_mut());
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        ok(vis_scene_set_flags(scene, ids[0], 0));
        ok(vis_level_create(triangles.as_ptr().cast(), count, true, &raw mut level));
        let bytes = list(0, |to, room, count| vis_level_write(level, to, room, count));
        let improper = [[0.0_f32; 9], [f32::NAN; 9]];
        let mut refused = null_mut();
        let status = vis_level_create(improper.as_ptr().cast(), 2, true, &raw mut refused);
        returns(status, VIS_ERROR_ARGUMENT);
        assert_eq!(message(), "triangle 1 is not finite", "message of a level that is refused");
        ok(vis_level_read(bytes.as_ptr(), bytes.len(), &raw mut again));
        returns(vis_level_read(bytes.as_ptr(), bytes.len() - 1, &raw mut again), VIS_ERROR_FORMAT);
        for level in [level, again] {
            let hidden = |origin: [f64; 3]| {
                let pipeline = make(vis_pipeline_create);
                ok(vis_pipeline_add_frustum(pipeline));
                ok(vis_pipeline_add_z_buffer_of_level(pipeline, 0, 0, level, origin.as_ptr()));
                let bits = cull(pipeline, scene);
                vis_pipeline_destroy(pipeline);
                bits
            };
            assert_eq!(hidden([0.0; 3]), 0b001, "the lamp is behind the level");
            assert_eq!(hidden([9.0, 0.0, 0.0]), 0b011, "the level is behind the lamp");
            vis_level_destroy(level);
        }
        triangles[0][0] = f32::NAN;
        returns(vis_level_create(triangles.as_ptr().cast(), count, true, &raw mut level), VIS_ERROR_ARGUMENT);
        vis_scene_destroy(scene);
    }
}
