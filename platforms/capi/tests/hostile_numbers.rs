//! Test with random calls and extreme numbers: no call may panic, whatever the handles are used for.

mod common;

use common::{make, ok};
use std::ptr::{null, null_mut};
use visibility::vis_status::*;
use visibility::*;
use visibility_testing::Random;

/// Returns an extreme number (NaN, infinite, huge, denormal and so on), or an ordinary one.
fn number(rng: &mut Random) -> f64 {
    const NUMBERS: [f64; 12] = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MAX,
        5e-324,
        -0.0,
        0.0,
        1.0,
        -1.0,
        3.4e38,
        1e-40,
        16777217.0,
    ];
    if rng.below(2) == 0 { NUMBERS[rng.below(NUMBERS.len())] } else { rng.vector(10.0).x }
}

fn numbers<const N: usize>(rng: &mut Random) -> [f64; N] {
    std::array::from_fn(|_| number(rng))
}

fn random_box(rng: &mut Random) -> vis_box {
    let [min, max] = [(); 2].map(|()| numbers::<3>(rng).map(|x| x as f32));
    vis_box { min, max }
}

/// Returns an affine matrix, a matrix with one invalid element, or 16 arbitrary numbers.
fn matrix(rng: &mut Random) -> [f32; 16] {
    let mut matrix: [f32; 16] = std::array::from_fn(|i| if i % 5 == 0 { 1.0 } else { 0.0 });
    match rng.below(3) {
        0 => numbers::<3>(rng).into_iter().zip(12..).for_each(|(x, at)| matrix[at] = x as f32),
        1 => matrix[rng.below(16)] = number(rng) as f32,
        _ => matrix = numbers::<16>(rng).map(|x| x as f32),
    }
    matrix
}

#[test]
fn no_number_makes_a_call_panic() {
    let rng = &mut Random(24);
    let (scene, view, pipeline) = (make(vis_scene_create), make(vis_view_create), make(vis_pipeline_create));
    let (mut visible, mut measure) = (null_mut(), null_mut());
    let (mut graph, mut cells, mut pvs) = (null_mut(), null_mut(), null_mut());
    let (mut online, mut sight) = (null_mut(), null_mut());
    let who_sees = make(vis_who_sees_create);
    let (mut ids, mut meshes) = (vec![VIS_NO_OBJECT], vec![0]);
    let (mut list, mut count, mut outcomes) = ([0_u64; 64], 0, [0; 9]);
    // SAFETY: handles are live, and arrays have the stated lengths.
    unsafe {
        ok(vis_visible_create(true, &mut visible));
        ok(vis_measure_create(32, 32, &mut measure));
        ok(vis_pipeline_add_frustum(pipeline));
        ok(vis_pipeline_add_z_buffer(pipeline, 32, 32));
        ok(vis_pipeline_add_contribution(pipeline, number(rng), number(rng)));
        ok(vis_online_create([1.0; 3].as_ptr(), [4.0; 3].as_ptr(), 0.0, &mut online));
        ok(vis_pipeline_add_online(pipeline, online));
        for round in 0..20_000 {
            let (id, mesh) = (ids[rng.below(ids.len())], meshes[rng.below(meshes.len())]);
            let index = || number(&mut Random(round)) as u32;
            let status = match rng.below(31) {
                0 => {
                    let flags = rng.below(17) as u32;
                    let object = vis_object_desc { flags, ..vis_object_default(random_box(rng)) };
                    let mut new = 0;
                    let status = vis_scene_insert(scene, &object, &mut new);
                    ids.push(new);
                    status
                }
                1 => vis_scene_set_bounds(scene, id, &random_box(rng)),
                2 => vis_scene_set_bounds_batch(scene, &id, &random_box(rng), 1),
                3 => vis_scene_set_local_bounds(scene, id, &random_box(rng)),
                4 => vis_scene_set_transforms_batch(scene, &id, matrix(rng).as_ptr(), 1),
                5 => vis_scene_set_mesh(scene, id, mesh, matrix(rng).as_ptr()),
                6 => {
                    let mut new = 0;
                    let status = vis_scene_add_box_mesh(scene, &random_box(rng), &mut new);
                    meshes.push(new);
                    status
                }
                7 => {
                    let (corners, mut new) = (numbers::<9>(rng).map(|x| x as f32), 0);
                    let indices = [0, rng.below(4) as u32, 2];
                    let status =
                        vis_scene_add_mesh(scene, corners.as_ptr(), 3, indices.as_ptr(), 1, true, &mut new);
                    meshes.push(new);
                    status
                }
                8 => vis_scene_set_triangles(scene, id, numbers::<9>(rng).map(|x| x as f32).as_ptr(), 1),
                9 => vis_scene_set_draw_range(scene, id, number(rng) as f32, number(rng) as f32),
                10 => vis_scene_set_hlod_parent(scene, id, ids[rng.below(ids.len())]),
                11 => vis_scene_set_origin(scene, numbers::<3>(rng).as_ptr()),
                12 => {
                    vis_view_set_matrix(view, matrix(rng).as_ptr(), index() % 7, numbers::<3>(rng).as_ptr())
                }
                13 => vis_view_set_matrix_f64(view, numbers::<16>(rng).as_ptr(), index() % 7, null()),
                14 => {
                    let [eye, target, up] = [numbers(rng), numbers(rng), numbers(rng)];
                    let [a, b, near, far] = numbers(rng);
                    match rng.below(2) {
                        0 => vis_view_set_perspective(view, &vis_pose { eye, target, up }, a, b, near, far),
                        _ => vis_view_set_orthographic(view, &vis_pose { eye, target, up }, a, b, near, far),
                    }
                }
                15 => vis_view_set_clip_planes(view, numbers::<4>(rng).as_ptr(), 1),
                16 => {
                    let mut found = vis_comparison {
                        reported_objects: 0,
                        false_hidden_objects: 0,
                        false_visible_objects: 0,
                        wrong_pixels: 0,
                    };
                    let judged = vis_measure_compare(measure, scene, view, visible, &mut found);
                    assert_ne!(judged, VIS_ERROR_PANIC, "round {round}");
                    vis_visible_ids(visible, scene, list.as_mut_ptr(), list.len(), &mut count)
                }
                17 => vis_scene_remove(scene, id),
                18 => vis_scene_prepare_occluders(scene, &mut count),
                19 => vis_scene_maintain(scene, rng.below(50), null_mut()),
                20 => {
                    // Two cells with a portal polygon that is rarely valid.
                    let portal = vis_portal { first_vertex: 0, vertex_count: 3, cells: [0, 1] };
                    let [min, max] = [numbers(rng), numbers(rng)];
                    let volume = vis_volume { min, max, first_plane: 0, plane_count: 1 };
                    let (vertices, plane) = (rng.vector(9.0).to_array(), numbers::<4>(rng));
                    let corners = [vertices, [1.0, 0.0, 0.0], numbers(rng)];
                    let mut status = vis_graph_create(2, &portal, 1, corners.as_ptr().cast(), 3, &mut graph);
                    if status == VIS_OK {
                        status = vis_graph_bake(graph, number(rng), &mut pvs);
                        if status == VIS_OK {
                            vis_pvs_destroy(pvs);
                        }
                        let volumes = [volume, volume];
                        let tolerance = number(rng);
                        let made = vis_cells_create(
                            graph,
                            volumes.as_ptr(),
                            2,
                            plane.as_ptr(),
                            1,
                            tolerance,
                            &mut cells,
                        );
                        if made == VIS_OK {
                            let own = make(vis_pipeline_create);
                            ok(vis_pipeline_add_portals(own, cells));
                            status = vis_pipeline_cull(own, scene, view, visible, null_mut());
                            vis_pipeline_destroy(own);
                            vis_cells_destroy(cells);
                        }
                        vis_graph_destroy(graph);
                    }
                    status
                }
                21 => {
                    let places = numbers::<6>(rng);
                    vis_online_step(online, scene, places.as_ptr(), 2, index() % 50, null_mut())
                }
                22 => {
                    let (size, corners) = (numbers::<3>(rng).map(f64::abs), numbers::<6>(rng));
                    let wide = size.map(|x| 4.0 * x);
                    let (min, max) = (corners[..3].as_ptr(), corners[3..].as_ptr());
                    let mut own = null_mut();
                    let mut status = vis_online_create(size.as_ptr(), wide.as_ptr(), number(rng), &mut own);
                    if status == VIS_OK {
                        status = vis_online_step(own, scene, min, 1, 50, null_mut());
                        assert_ne!(status, VIS_ERROR_PANIC, "round {round}");
                        status = vis_online_write_hidden(own, scene, min, max, null_mut(), 0, &mut count);
                        vis_online_destroy(own);
                    }
                    status
                }
                23 => {
                    let corners = numbers::<4>(rng);
                    let (from, to) = ([corners[0], corners[1]], [corners[2], corners[3]]);
                    let wall = vis_wall { from, to, opacity: rng.below(4) as u32 };
                    let [min, max] = [numbers(rng), numbers(rng)];
                    let reach = vis_reach { min, max, margin: number(rng) };
                    let bounds = numbers::<6>(rng);
                    let mut status = match rng.below(2) {
                        0 => vis_sight_cells_create_of_plan(&wall, 1, 0, index() % 4, &mut sight),
                        _ => vis_sight_cells_create_of_scene(scene, bounds.as_ptr(), 1, &mut sight),
                    };
                    if status == VIS_OK {
                        status = vis_who_sees_look(who_sees, sight, null(), &reach, 1, &reach, 1);
                        vis_sight_cells_destroy(sight);
                    }
                    status
                }
                24 => {
                    let corners = numbers::<8>(rng);
                    let [from, to, a, b] = [0, 2, 4, 6].map(|at| [corners[at], corners[at + 1]]);
                    let wall = vis_wall { from, to, opacity: rng.below(4) as u32 };
                    let mut plan = null_mut();
                    let mut status = vis_plan_create(&wall, 1, &mut plan);
                    if status == VIS_OK {
                        let (mut sees, mut hit) = (false, vis_wall_hit { point: a, wall: 0 });
                        let (a, b) = (a.as_ptr(), b.as_ptr());
                        for call in [
                            vis_plan_sees(plan, a, b, &mut sees),
                            vis_plan_ray(plan, a, b, &mut hit),
                            vis_plan_visible_walls(plan, a, number(rng), null_mut(), 0, &mut count),
                            vis_plan_walls_seen_from_region(
                                plan,
                                corners.as_ptr(),
                                4,
                                null_mut(),
                                0,
                                &mut count,
                            ),
                        ] {
                            assert_ne!(call, VIS_ERROR_PANIC, "round {round}");
                        }
                        status = vis_plan_visibility_polygon(plan, a, number(rng), null_mut(), 0, &mut count);
                        vis_plan_destroy(plan);
                    }
                    status
                }
                25 => {
                    let (corners, mut words) = (numbers::<6>(rng), [0_u32; 4096]);
                    let (min, max) = (corners[..3].as_ptr(), corners[3..].as_ptr());
                    let (clearance, words) = (number(rng), words.as_mut_ptr());
                    match rng.below(2) {
                        0 => vis_scene_seen_from(scene, min, max, words, 4096, &mut count),
                        _ => vis_scene_prove_from(scene, min, max, clearance, 2000, words, 4096, &mut count),
                    }
                }
                26 => {
                    let [origin, along] = [(); 2].map(|()| numbers::<3>(rng).map(|x| x as f32));
                    let (most, layers) = (number(rng) as f32, index());
                    let mut hit = vis_ray_hit { object: 0, distance: 0.0 };
                    let kind = rng.below(4) as u32;
                    let [position, direction] = [numbers(rng), numbers(rng)];
                    let light =
                        vis_light { kind, position, direction, range: number(rng), half_angle: number(rng) };
                    let own = make(vis_pipeline_create);
                    if vis_pipeline_add_casters(own, &light) == VIS_OK {
                        let culled = vis_pipeline_cull(own, scene, view, visible, null_mut());
                        assert_ne!(culled, VIS_ERROR_PANIC, "round {round}");
                    }
                    vis_pipeline_destroy(own);
                    let area = random_box(rng);
                    let found = vis_scene_in_box(scene, &area, layers, null_mut(), 0, &mut count);
                    assert_ne!(found, VIS_ERROR_PANIC, "round {round}");
                    let (origin, along) = (origin.as_ptr(), along.as_ptr());
                    let all =
                        vis_scene_ray_hits(scene, origin, along, most, layers, null_mut(), 0, &mut count);
                    assert_ne!(all, VIS_ERROR_PANIC, "round {round}");
                    vis_scene_first_hit(scene, origin, along, most, layers, &mut hit)
                }
                27 => {
                    let sizes = numbers::<3>(rng).map(|x| x as f32);
                    let keys = [index(); 1];
                    let lodged = vis_scene_set_lod_sizes(scene, &id, 1, sizes.as_ptr(), rng.below(4));
                    assert_ne!(lodged, VIS_ERROR_PANIC, "round {round}");
                    let keyed = vis_scene_set_draw_keys(scene, &id, keys.as_ptr(), 1);
                    assert_ne!(keyed, VIS_ERROR_PANIC, "round {round}");
                    let [begin, end, margin] = numbers::<3>(rng).map(|x| x as f32);
                    vis_scene_set_draw_range_with_margin(scene, id, begin, end, margin)
                }
                28 => {
                    let (height, eye, mut own) = (number(rng), numbers::<3>(rng), null_mut());
                    let changed = vis_pipeline_set_contribution(pipeline, height, number(rng), eye.as_ptr());
                    assert_ne!(changed, VIS_ERROR_PANIC, "round {round}");
                    let fade = number(rng) as f32;
                    let mut status = vis_lods_create(height, number(rng), fade, &mut own);
                    if status == VIS_OK {
                        let draw = make(vis_draw_list_create);
                        let seconds = number(rng) as f32;
                        for call in [
                            vis_lods_set_distance_eye(own, eye.as_ptr()),
                            vis_lods_select(own, scene, view, visible, seconds),
                            vis_draw_list_group_fading(draw, scene, own),
                            vis_draw_list_group_levels(draw, scene, own),
                        ] {
                            assert_ne!(call, VIS_ERROR_PANIC, "round {round}");
                        }
                        status = vis_draw_list_group(draw, scene, visible);
                        vis_draw_list_destroy(draw);
                        vis_lods_destroy(own);
                    }
                    status
                }
                29 => {
                    let (size, corners) = (numbers::<3>(rng).map(f64::abs), numbers::<9>(rng));
                    let (mut of, mut hall, mut mirror) = (null_mut(), null_mut(), 0);
                    let room = vis_volume { min: [0.0; 3], max: size, first_plane: 0, plane_count: 0 };
                    let mut empty = null_mut();
                    ok(vis_graph_create(1, null(), 0, null(), 0, &mut empty));
                    let mut status = vis_cells_create(empty, &room, 1, null(), 0, number(rng), &mut hall);
                    if status == VIS_OK {
                        status = vis_cells_add_mirror(hall, 0, corners.as_ptr(), 3, &mut mirror);
                        ok(vis_reflections_create(hall, 3, 2, &mut of));
                        let (own, mirrored) = (make(vis_pipeline_create), make(vis_view_create));
                        ok(vis_pipeline_add_reflections(own, of));
                        let (mut matrix, origin) = ([0.0; 16], numbers::<3>(rng));
                        for call in [
                            vis_pipeline_cull(own, scene, view, visible, null_mut()),
                            vis_reflections_read(of, 0, mirrored, visible),
                            vis_view_matrix(mirrored, origin.as_ptr(), matrix.as_mut_ptr()),
                            vis_view_clip_planes(mirrored, origin.as_ptr(), null_mut(), 0, &mut count),
                        ] {
                            assert_ne!(call, VIS_ERROR_PANIC, "round {round}");
                        }
                        vis_view_destroy(mirrored);
                        vis_pipeline_destroy(own);
                        vis_reflections_destroy(of);
                        vis_cells_destroy(hall);
                    }
                    vis_graph_destroy(empty);
                    status
                }
                _ => vis_pipeline_cull(pipeline, scene, view, visible, null_mut()),
            };
            assert_ne!(status, VIS_ERROR_PANIC, "round {round}");
            outcomes[status as usize] += 1;
        }
    }
    // Checks that the numbers were varied: many calls succeeded, and calls were refused for each possible
    // reason.
    assert!(outcomes[VIS_OK as usize] > 5_000, "{outcomes:?}");
    for reason in [VIS_ERROR_ARGUMENT, VIS_ERROR_UNKNOWN_ID, VIS_ERROR_STATE] {
        assert!(outcomes[reason as usize] > 100, "{reason:?}: {outcomes:?}");
    }
}
