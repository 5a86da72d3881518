//! Tests of the PVS culler: the viewcell of an eye is found as by testing every viewcell, and an object is
//! hidden if and only if the viewcell does not see it.

use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::scene::DrawRange;
use visibility_core::{
    Aabb, ObjectId, OccluderMesh, Pose, Scene, View, VisibleSet,
    geometry::Plane,
    pvs::{Pvs, PvsCuller, PvsTargets, ScenePvs, Viewcell, ViewcellId, Viewcells},
};

fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*state >> 11) as f64 * 2f64.powi(-53)
}

#[test]
fn viewcells_are_found_as_by_looking_at_each() {
    let mut state = 5;
    for count in [0, 1, 4, 5, 300] {
        let mut cells = Vec::new();
        for i in 0..count {
            let min = DVec3::new(random(&mut state), random(&mut state), random(&mut state)) * 20.0;
            let size = DVec3::new(random(&mut state), random(&mut state), random(&mut state)) * 4.0;
            let mut cell = Viewcell::from_box(min, min + size);
            if i % 3 == 0 {
                cell.planes.push(Plane::through(min + size * 0.5, DVec3::new(1.0, -0.5, 0.2)));
            }
            cells.push(cell);
        }
        cells.push(Viewcell::from_box(DVec3::NAN, DVec3::NAN));
        let tree = Viewcells::new(cells.clone());
        let mut found = 0;
        for _ in 0..4000 {
            let p = DVec3::new(random(&mut state), random(&mut state), random(&mut state)) * 24.0;
            let plain = cells.iter().position(|cell| cell.contains(p)).map(|i| ViewcellId(i as u32));
            assert_eq!(tree.locate(p), plain, "the first of {count} viewcells that contains {p}");
            found += usize::from(plain.is_some());
        }
        assert!(count < 300 || found > 400, "{found}");
        assert_eq!(tree.locate(DVec3::NAN), None, "a point that is NaN is in no viewcell");
    }
}

/// Tests points beside the plane between two viewcells, by exact fractions. The plane has whole-number
/// coefficients, of different length in the two viewcells, and is far from the origin.
#[test]
fn a_point_is_in_the_viewcells_that_it_is_exactly_in() {
    let mut state = 7;
    let mut whole = |most: i64| (random(&mut state) * (2 * most + 1) as f64) as i64 - most;
    let mut close = 0;
    for trial in 0..20_000 {
        let normal = [whole(20), whole(20), whole(20)];
        let anchor = [whole(1 << 40), whole(1 << 40), whole(1 << 40)];
        let on_plane: [i64; 3] = core::array::from_fn(|i| anchor[i] + whole(4));
        let (r, tiny) = ([whole(9), whole(9), whole(9)], [whole(3), whole(3), whole(3)]);
        if normal == [0; 3] {
            continue;
        }
        // Points are moved along the plane by multiples of 1/16, and off the plane by multiples of 2^-20.
        let across: [i64; 3] = core::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            normal[j] * r[k] - normal[k] * r[j]
        });
        let at: [f64; 3] = core::array::from_fn(|i| {
            (on_plane[i] - anchor[i]) as f64 + across[i] as f64 / 16.0 + tiny[i] as f64 / 1048576.0
        });
        let vector = |v: [i64; 3]| DVec3::from_array(v.map(|x| x as f64));
        let offset: i64 = -(0..3).map(|i| normal[i] * on_plane[i]).sum::<i64>();
        let cells = [3, -7].map(|times| Viewcell {
            planes: vec![Plane::new(vector(normal.map(|n| n * times)), (offset * times) as f64)],
            ..Viewcell::from_box(DVec3::splat(-1e13), DVec3::splat(1e13))
        });
        let mut reached = Vec::new();
        let covered = Viewcells::new(cells).reached(&[at.into()], vector(anchor), 0.0, &mut reached);
        assert!(covered, "{trial}: the viewcells leave no gap");
        let side: i64 = (0..3).map(|i| normal[i] * tiny[i]).sum();
        assert!(side < 0 || reached.contains(&ViewcellId(0)), "{trial}: {normal:?} {anchor:?} {tiny:?}");
        assert!(side > 0 || reached.contains(&ViewcellId(1)), "{trial}: {normal:?} {anchor:?} {tiny:?}");
        close += usize::from(reached.len() == 2);
    }
    println!("{close} too close to tell");
}

/// Returns a scene with ten objects in a row in front of two rooms, the objects, and the rooms' PVS and
/// viewcells. The first room sees the objects with even index, the second all but the last.
fn world() -> (Scene, Vec<ObjectId>, Pvs, Viewcells) {
    let mut scene = Scene::new();
    scene.set_origin(DVec3::new(1e6, 0.0, 0.0)).unwrap();
    let ids =
        (0..10).map(|i| scene.insert(Aabb::from_arrays([20.0, i as f32, 0.0], [21.0, i as f32 + 0.5, 1.0])));
    let ids = ids.collect();
    let rows = [vec![0, 2, 4, 6, 8], (0..9).collect()];
    let pvs = Pvs::new(PvsTargets::Objects, 10, &rows, |_| []).unwrap();
    let rooms = [0.0, 5.0]
        .map(|x| Viewcell::from_box(DVec3::new(1e6 + x, -5.0, -5.0), DVec3::new(1e6 + x + 5.0, 15.0, 5.0)));
    (scene, ids, pvs, Viewcells::new(rooms))
}

fn seen(culler: &mut PvsCuller<&ScenePvs>, scene: &Scene, ids: &[ObjectId], x: f64) -> Vec<usize> {
    use visibility_core::Culler;
    let eye = DVec3::new(1e6 + x, 5.0, 0.5);
    let view = View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 2.0, 2.0, 0.1, 1e3).unwrap();
    let mut visible = VisibleSet::new();
    visible.fill(scene, &view);
    culler.cull(scene, &view, &mut visible);
    (0..ids.len()).filter(|&i| visible.contains(scene, ids[i])).collect()
}

#[test]
fn what_a_viewcell_does_not_see_is_hidden_and_only_that() {
    let (mut scene, ids, pvs, viewcells) = world();
    let pairs = ids.iter().copied().zip(0..).filter(|(_, target)| *target != 5);
    let shared = ScenePvs::new(&scene, pvs, viewcells, pairs);
    let mut culler = PvsCuller::new(&shared);
    // Object 5 was given no target, so it cannot be hidden.
    assert_eq!(
        seen(&mut culler, &scene, &ids, 2.0),
        [0, 2, 4, 5, 6, 8],
        "what viewcell 0 sees, and object 5"
    );
    assert_eq!(culler.viewcell(), Some(ViewcellId(0)), "the viewcell of the eye");
    assert_eq!(
        seen(&mut culler, &scene, &ids, 7.0),
        [0, 1, 2, 3, 4, 5, 6, 7, 8],
        "what both viewcells see where they meet"
    );
    // Outside of all viewcells, everything is visible.
    assert_eq!(seen(&mut culler, &scene, &ids, 12.0).len(), 10, "objects visible outside of all viewcells");
    assert_eq!(culler.viewcell(), None, "the eye is in no viewcell");
    assert_eq!(
        seen(&mut culler, &scene, &ids, 2.0),
        [0, 2, 4, 5, 6, 8],
        "what viewcell 0 sees, after the eye was outside"
    );
    // The PVS is no longer valid for an object that has moved, which is visible.
    scene.set_bounds(ids[3], Aabb::from_arrays([22.0, 0.0, 0.0], [23.0, 1.0, 1.0])).unwrap();
    assert_eq!(seen(&mut culler, &scene, &ids, 2.0), [0, 2, 3, 4, 5, 6, 8], "object 3 has moved");
    // A new object is not in the PVS, even if it reuses an index.
    scene.remove(ids[1]).unwrap();
    let new = scene.insert(Aabb::from_arrays([20.0, 1.0, 0.0], [21.0, 1.5, 1.0]));
    assert_eq!(seen(&mut culler, &scene, &[new], 2.0), [0], "the new object");
    // The PVS says nothing of another scene.
    let (other, ids, ..) = world();
    assert_eq!(seen(&mut culler, &other, &ids, 2.0).len(), 10, "objects visible in another scene");
}

#[test]
fn objects_in_several_cells_are_seen_where_any_of_them_is() {
    let (scene, ids, pvs, viewcells) = world();
    // Objects with a target that the PVS does not contain are not hidden.
    let pairs = [(ids[0], 1), (ids[0], 3), (ids[1], 1), (ids[1], 2), (ids[2], 1), (ids[2], 77)];
    let shared = ScenePvs::new(&scene, pvs, viewcells, pairs);
    assert_eq!(
        seen(&mut PvsCuller::new(&shared), &scene, &ids[..3], 2.0),
        [1, 2],
        "objects with a target that is seen, or unknown"
    );
}

/// Tests an eye whose near plane reaches into the next viewcell: objects that the next viewcell sees are
/// visible too. The rooms meet at x = 5, and the near plane is 0.1 m in front of the eye, which looks along
/// x.
#[test]
fn where_the_near_plane_reaches_the_next_viewcell_what_that_sees_is_seen_too() {
    let (scene, ids, pvs, viewcells) = world();
    let shared = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
    let mut culler = PvsCuller::new(&shared);
    assert_eq!(
        seen(&mut culler, &scene, &ids, 4.85),
        [0, 2, 4, 6, 8],
        "the near plane ends 5 cm before the next viewcell"
    );
    assert_eq!(
        seen(&mut culler, &scene, &ids, 4.95),
        [0, 1, 2, 3, 4, 5, 6, 7, 8],
        "the near plane reaches into the next viewcell"
    );
    assert_eq!(culler.viewcell(), Some(ViewcellId(0)), "where the eye is");
    assert_eq!(
        seen(&mut culler, &scene, &ids, 4.85),
        [0, 2, 4, 6, 8],
        "the near plane ends before the next viewcell again"
    );
}

/// A near plane as wide as a map's, over a row of thin viewcells and over a grid of them, on a thread with
/// little memory for its stack.
#[test]
fn a_polygon_over_many_viewcells_is_covered_without_deep_recursion() {
    let cell = |x: f64, y: f64, size: [f64; 2]| {
        Viewcell::from_box(DVec3::new(x, y, 0.0), DVec3::new(x + size[0], y + size[1], 10.0))
    };
    let row = Viewcells::new((0..1800).map(|i| cell(f64::from(i), 0.0, [1.0, 10.0])));
    let grid = Viewcells::new((0..100).map(|i| cell(f64::from(i % 10), f64::from(i / 10), [1.0; 2])));
    let gap = Viewcells::new((0..99).map(|i| cell(f64::from(i % 10), f64::from(i / 10), [1.0; 2])));
    let square =
        |width: f64| [[0.5, 0.5], [width, 0.5], [width, 9.5], [0.5, 9.5]].map(|[x, y]| DVec3::new(x, y, 5.0));
    let reached = move || {
        [(row, 1799.5), (grid, 9.5), (gap, 9.5)].map(|(cells, width)| {
            let mut reached = Vec::new();
            (cells.reached(&square(width), DVec3::ZERO, 0.0, &mut reached), reached.len())
        })
    };
    let small = std::thread::Builder::new().stack_size(1 << 18).spawn(reached).unwrap();
    let expected = [(true, 1800), (true, 100), (false, 99)];
    assert_eq!(small.join().unwrap(), expected, "a row, a grid, and a grid without its last viewcell");
}

/// Tests a near plane that reaches out of all viewcells: everything is visible. The rooms end at y = 15, and
/// the near plane extends 0.16 m to either side, 0.1 m in front of the eye.
#[test]
fn a_near_plane_that_reaches_out_of_all_viewcells_sees_everything() {
    use visibility_core::Culler;
    let (scene, ids, pvs, viewcells) = world();
    let shared = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
    let mut culler = PvsCuller::new(&shared);
    for (y, expected) in [(14.6, 5), (14.9, 10), (14.6, 5)] {
        let eye = DVec3::new(1e6 + 2.0, y, 0.5);
        let view =
            View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 2.0, 1.0, 0.1, 1e3).unwrap();
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        culler.cull(&scene, &view, &mut visible);
        assert_eq!(ids.iter().filter(|&&id| visible.contains(&scene, id)).count(), expected, "{y}");
        assert_eq!(culler.viewcell(), Some(ViewcellId(0)), "{y}: the eye is in the first viewcell");
    }
}

#[test]
fn an_eye_that_a_clip_plane_cuts_away_sees_everything() {
    use visibility_core::Culler;
    let (scene, ids, pvs, viewcells) = world();
    let shared = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
    let mut culler = PvsCuller::new(&shared);
    let eye = DVec3::new(1e6 + 2.0, 5.0, 0.5);
    let view = View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 2.0, 2.0, 0.1, 1e3).unwrap();
    // A clip plane 6 m ahead of the eye, where view rays begin in the next room, or 1 m behind the eye.
    for (start, expected) in [(6.0, 10), (-1.0, 5)] {
        let view = view.with_clip_planes(&[Plane::through(DVec3::X * start, DVec3::X)]).unwrap();
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        culler.cull(&scene, &view, &mut visible);
        assert_eq!(
            ids.iter().filter(|&&id| visible.contains(&scene, id)).count(),
            expected,
            "objects visible with a clip plane {start} m ahead of the eye"
        );
    }
}

/// Tests an oblique near plane, as for a mirror or for water (Lengyel, "Oblique View Frustum Depth Projection
/// and Clipping", 2005). View rays at the left never meet this plane, and those beside them begin far away,
/// in the next room: everything is visible.
#[test]
fn an_oblique_near_plane_that_not_all_lines_of_sight_meet_sees_everything() {
    use visibility_core::glam::{DMat4, DVec4};
    use visibility_core::{Culler, view::Depth};
    let mut scene = Scene::new();
    let at = |x: f32, y: f32| Aabb::from_arrays([x - 0.1, y - 0.1, 1.4], [x + 0.1, y + 0.1, 1.6]);
    let [here, there] = [(3.0, 2.0), (6.0, 4.5)].map(|(x, y)| scene.insert(at(x, y)));
    let pvs = Pvs::new(PvsTargets::Cells, 2, &[vec![0], vec![1]], |_| []).unwrap();
    let rooms =
        [0.0, 4.0].map(|x| Viewcell::from_box(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 4.0, 8.0, 3.0)));
    let shared = ScenePvs::new(&scene, pvs, Viewcells::new(rooms), [(here, 0), (there, 1)]);
    // The camera looks along x with a field of view of 90 degrees; relative to the eye, x = -Y, y = Z, w = X.
    let rows = [
        DVec4::new(0.0, -1.0, 0.0, 0.0),
        DVec4::new(0.0, 0.0, 1.0, 0.0),
        DVec4::new(0.6, -1.0, 0.0, -0.4),
        DVec4::new(1.0, 0.0, 0.0, 0.0),
    ];
    let matrix = DMat4::from_cols_array_2d(&rows.map(|row| row.to_array())).transpose();
    let view = View::from_clip_from_world(matrix, Depth::ZeroToOneInfinite).unwrap();
    let view = view.relative_to(DVec3::new(1.0, 2.0, 1.5)).unwrap();
    let mut visible = VisibleSet::new();
    visible.fill(&scene, &view);
    PvsCuller::new(&shared).cull(&scene, &view, &mut visible);
    assert!(visible.contains(&scene, there), "in view, and in the room in which its lines of sight begin");
}

#[test]
fn sets_given_in_place_of_others_are_taken_in() {
    use visibility_core::Culler;
    let (scene, ids, pvs, viewcells) = world();
    let made = |shift: u32| {
        let pairs = ids.iter().zip(0..).map(|(&id, i)| (id, (i + shift) % 10));
        ScenePvs::new(&scene, pvs.clone(), viewcells.clone(), pairs)
    };
    let (first, second) = (made(0), made(1));
    let eye = DVec3::new(1e6 + 2.0, 5.0, 0.5);
    let view = View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 2.0, 2.0, 0.1, 1e3).unwrap();
    let mut culler = PvsCuller::new(&first);
    for (sets, expected) in [(&first, 0), (&second, 1), (&first, 0)] {
        *culler.shared_mut() = sets;
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        culler.cull(&scene, &view, &mut visible);
        let seen = (0..10).filter(|&i| visible.contains(&scene, ids[i]));
        assert!(seen.eq((0..10).filter(|i| i % 2 == expected)), "from the same viewcell, with other sets");
    }
}

/// A set that names other occluders than the set it was made from is another set to a culler.
#[test]
fn a_set_with_other_occluders_is_another_set() {
    let (mut scene, ids, pvs, viewcells) = world();
    let none = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..)).with_occluders(&scene, []);
    let named = none.clone().with_occluders(&scene, [ids[3]]);
    let mut culler = PvsCuller::new(&none);
    assert_eq!(seen(&mut culler, &scene, &ids, 2.0), [0, 2, 4, 6, 8], "what viewcell 0 sees");
    scene.set_bounds(ids[3], Aabb::from_arrays([22.0, 0.0, 0.0], [23.0, 1.0, 1.0])).unwrap();
    assert_eq!(
        seen(&mut culler, &scene, &ids, 2.0),
        [0, 2, 3, 4, 6, 8],
        "an object that hides nothing moved"
    );
    *culler.shared_mut() = &named;
    assert_eq!(seen(&mut culler, &scene, &ids, 2.0).len(), 10, "an occluder of the second set has moved");
}

#[test]
fn a_culler_that_was_in_another_scene_hides_in_its_own_as_before() {
    let (mut scene, ids, pvs, viewcells) = world();
    let shared = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
    let mut culler = PvsCuller::new(&shared);
    let copy = scene.clone();
    assert_eq!(seen(&mut culler, &scene, &ids, 2.0), [0, 2, 4, 6, 8], "what viewcell 0 sees");
    assert_eq!(seen(&mut culler, &copy, &ids, 2.0).len(), 10, "a clone is another scene");
    scene.set_bounds(ids[3], Aabb::from_arrays([22.0, 0.0, 0.0], [23.0, 1.0, 1.0])).unwrap();
    assert_eq!(seen(&mut culler, &scene, &ids, 2.0), [0, 2, 3, 4, 6, 8], "object 3 has moved");
    assert_eq!(seen(&mut culler, &copy, &ids, 2.0).len(), 10, "objects visible in the clone");
    assert_eq!(
        seen(&mut culler, &scene, &ids, 2.0),
        [0, 2, 3, 4, 6, 8],
        "object 3 has moved, after a frame of the clone"
    );
}

#[test]
fn nothing_is_hidden_once_an_occluder_of_the_pvs_has_changed() {
    use visibility_core::Culler;
    for targets in [PvsTargets::Objects, PvsTargets::Cells] {
        let (mut scene, ids, _, viewcells) = world();
        let rows = [vec![0, 2, 4, 6, 8], (0..9).collect()];
        let pvs = Pvs::new(targets, 10, &rows, |_| []).unwrap();
        scene.set_occluder(ids[0], true).unwrap();
        let pairs = || ids.iter().copied().zip(0..);
        let flagged = ScenePvs::new(&scene, pvs.clone(), viewcells.clone(), pairs());
        let named = flagged.clone().with_occluders(&scene, [ids[2]]);
        let (mut of_flagged, mut of_named) = (PvsCuller::new(&flagged), PvsCuller::new(&named));
        scene.set_bounds(ids[4], Aabb::from_arrays([22.0, 0.0, 0.0], [23.0, 1.0, 1.0])).unwrap();
        for culler in [&mut of_flagged, &mut of_named] {
            assert_eq!(seen(culler, &scene, &ids, 2.0).len(), 5, "{targets:?}: no occluder has changed");
        }
        scene.remove(ids[0]).unwrap();
        let left = if targets == PvsTargets::Objects { 9 } else { 4 };
        for frame in 0..2 {
            let found = seen(&mut of_flagged, &scene, &ids, 2.0).len();
            assert_eq!(found, left, "{targets:?}: {frame} frames after the flagged occluder went");
            let found = seen(&mut of_named, &scene, &ids, 2.0).len();
            assert_eq!(found, 4, "{targets:?}: the flagged object is none of the named occluders");
        }
        scene.set_bounds(ids[2], Aabb::from_arrays([22.0, 2.0, 0.0], [23.0, 2.5, 1.0])).unwrap();
        assert_eq!(seen(&mut of_named, &scene, &ids, 2.0).len(), 9, "{targets:?}: the named one has changed");
        let mut lacks = 0;
        of_named.for_each_lack(&scene, &mut |lack| lacks += lack.count);
        assert_eq!(lacks, 9, "{targets:?}: all objects are named as not culled");
    }
}

#[test]
fn nothing_is_hidden_in_a_view_that_does_not_show_an_occluder_of_the_pvs() {
    use visibility_core::Culler;
    let (mut scene, ids, pvs, viewcells) = world();
    scene.set_occluder(ids[0], true).unwrap();
    scene.set_layers(ids[0], 0b01).unwrap();
    // An object on no layer is drawn in no view, so no bake can have used it as an occluder.
    scene.set_occluder(ids[2], true).unwrap();
    scene.set_layers(ids[2], 0).unwrap();
    let shared = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
    let mut culler = PvsCuller::new(&shared);
    let eye = DVec3::new(1e6 + 2.0, 5.0, 0.5);
    let view = View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 2.0, 2.0, 0.1, 1e3).unwrap();
    for (layers, hides, lacking) in [(0b11, true, 0), (0b10, false, 1), (0b11, true, 0)] {
        let view = view.with_layers(layers);
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        culler.cull(&scene, &view, &mut visible);
        assert_eq!(!visible.contains(&scene, ids[1]), hides, "object 1 in a view of layers {layers:#b}");
        let mut lacks = 0;
        culler.for_each_lack(&scene, &mut |_| lacks += 1);
        assert_eq!(lacks, lacking, "lacks in a view of layers {layers:#b}");
    }
}

/// A viewcell with a NaN plane contains no point, so its PVS says nothing about any eye.
#[test]
fn nothing_is_hidden_from_a_viewcell_with_a_plane_that_is_nan() {
    let (scene, ids, pvs, viewcells) = world();
    for (normal, offset) in [(DVec3::NAN, 1.0), (DVec3::X, f64::NAN), (DVec3::splat(f64::INFINITY), 1.0)] {
        let mut cells = viewcells.cells().to_vec();
        cells[0].planes.push(Plane::new(normal, offset));
        let pairs = ids.iter().copied().zip(0..);
        let shared = ScenePvs::new(&scene, pvs.clone(), Viewcells::new(cells), pairs);
        let mut culler = PvsCuller::new(&shared);
        assert_eq!(seen(&mut culler, &scene, &ids, 2.0).len(), 10, "a plane {normal}, {offset}");
        assert_eq!(seen(&mut culler, &scene, &ids, 8.0).len(), 9, "from the whole viewcell");
    }
}

#[test]
fn an_object_with_a_target_that_the_pvs_lacks_is_never_hidden() {
    let (scene, ids, pvs, viewcells) = world();
    for target in [9, 10, 11, u32::MAX] {
        let shared = ScenePvs::new(&scene, pvs.clone(), viewcells.clone(), [(ids[1], 9), (ids[3], target)]);
        let found = seen(&mut PvsCuller::new(&shared), &scene, &[ids[1], ids[3]], 2.0);
        assert_eq!(
            found,
            if target < 10 { vec![] } else { vec![1] },
            "target {target} of 10, {found:?} seen"
        );
    }
}

#[test]
fn a_named_occluder_that_may_be_absent_or_is_never_culled_hides_nothing() {
    type Change = fn(&mut Scene, ObjectId);
    let changes: [(&str, usize, Change); 3] = [
        ("as it was", 5, |_, _| {}),
        ("with a draw range", 10, |scene, id| {
            scene.set_draw_range(id, DrawRange { end: 9e9, ..DrawRange::ALWAYS }).unwrap();
        }),
        ("never culled", 10, |scene, id| scene.set_never_cull(id, true).unwrap()),
    ];
    for (name, expected, change) in changes {
        let (mut scene, ids, pvs, viewcells) = world();
        change(&mut scene, ids[0]);
        let shared = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
        let shared = shared.with_occluders(&scene, [ids[0]]);
        let found = seen(&mut PvsCuller::new(&shared), &scene, &ids, 2.0);
        assert_eq!(found.len(), expected, "{name}: {found:?} seen");
    }
}

#[test]
fn triangles_that_an_occluder_gets_or_loses_count() {
    for has_triangles in [false, true] {
        let (mut scene, ids, pvs, viewcells) = world();
        scene.set_occluder(ids[0], true).unwrap();
        let corner = scene.bounds(ids[0]).unwrap().min;
        let set = |scene: &mut Scene, has_triangles: bool| {
            let triangle = [corner, corner + Vec3::X, corner + Vec3::Z];
            scene.set_triangles(ids[0], &[triangle][..usize::from(has_triangles)]).unwrap();
        };
        set(&mut scene, has_triangles);
        let shared = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
        let mut culler = PvsCuller::new(&shared);
        assert_eq!(seen(&mut culler, &scene, &ids, 2.0).len(), 5, "triangles {has_triangles}: before");
        set(&mut scene, !has_triangles);
        assert_eq!(seen(&mut culler, &scene, &ids, 2.0).len(), 10, "triangles {has_triangles}: after");
    }
}

/// An eye with an angle of nearly half a turn, so that the corners of its near plane are uncertain by
/// nanometres. The viewcell beside the corners counts up to that error.
#[test]
fn the_viewcell_that_a_corner_of_the_near_plane_may_be_in_is_seen_from() {
    use visibility_core::{Culler, view::Eye};
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 179.8f64.to_radians(), 1.0, 0.001, 1e3).unwrap();
    let Eye::Point(eye) = view.eye(DVec3::ZERO) else { panic!("a perspective view has an eye") };
    let (mut side, mut error) = (f64::NEG_INFINITY, 0.0f64);
    let known = view.for_each_sight_start(eye, |corners, of_corners| {
        corners.iter().for_each(|corner| side = side.max(eye.y + corner.y));
        error = error.max(of_corners);
    });
    assert!(known && error > 1e-12 && side < 1.0, "an error of {error} m of corners up to {side} m");
    for (share, is_seen) in [(0.4, true), (0.9, true), (1.1, false), (2.0, false)] {
        let middle = side + share * error;
        let cells = [[-9.0, middle], [middle, 9.0]]
            .map(|[from, to]| Viewcell::from_box(DVec3::new(-9.0, from, -9.0), DVec3::new(9.0, to, 9.0)));
        let mut scene = Scene::new();
        let id = scene.insert(Aabb::from_arrays([20.0; 3], [21.0; 3]));
        let pvs = Pvs::new(PvsTargets::Objects, 1, &[vec![], vec![0]], |_| []).unwrap();
        let shared = ScenePvs::new(&scene, pvs, Viewcells::new(cells), [(id, 0)]);
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        PvsCuller::new(&shared).cull(&scene, &view, &mut visible);
        assert_eq!(visible.contains(&scene, id), is_seen, "a viewcell {share} errors from the corners");
    }
}

#[test]
fn a_set_that_was_not_compared_is_approximate_and_an_empty_scene_lacks_nothing() {
    use visibility_core::{Accuracy, Culler};
    let (mut scene, ids, pvs, viewcells) = world();
    scene.set_occluder(ids[0], true).unwrap();
    scene.set_layers(ids[0], 0b01).unwrap();
    let pairs: Vec<_> = ids.iter().copied().zip(0..).collect();
    let lacks = |culler: &PvsCuller<&ScenePvs>, scene: &Scene| {
        let mut lacks = Vec::new();
        culler.for_each_lack(scene, &mut |lack| lacks.push(lack.to_string()));
        lacks
    };
    for (x, layers) in [(2.0, 0b11), (2.0, 0b10), (50.0, 0b11)] {
        let shared = ScenePvs::new(&scene, pvs.clone(), viewcells.clone(), pairs.iter().copied());
        let mut culler = PvsCuller::new(&shared);
        assert_eq!(culler.accuracy(), Accuracy::Conservative, "sets that are known to be of the scene");
        let eye = DVec3::new(1e6 + x, 5.0, 0.5);
        let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
        culler.look(&scene, &View::perspective(pose, 2.0, 2.0, 0.1, 1e3).unwrap().with_layers(layers));
        let expected = usize::from((x, layers) != (2.0, 0b11));
        assert_eq!(lacks(&culler, &scene).len(), expected, "lacks at x = {x}, layers {layers:#b}");
        assert!(lacks(&culler, &Scene::new()).is_empty(), "an empty scene, x = {x}, layers {layers:#b}");
    }
    for (pairs, expected) in [(&pairs[..], 1), (&[], 0)] {
        let shared = ScenePvs::new(&scene, pvs.clone(), viewcells.clone(), pairs.iter().copied());
        let shared = shared.unchecked();
        let culler = PvsCuller::new(&shared);
        assert_eq!(culler.accuracy(), Accuracy::Approximate, "sets that may be of another scene");
        assert_eq!(lacks(&culler, &scene).len(), expected, "lacks of {} objects", pairs.len());
    }
}

#[test]
fn changes_of_an_occluder_count_where_they_matter() {
    type Change = fn(&mut Scene, ObjectId);
    let cuboid = |scene: &mut Scene, id: ObjectId, share: f32| {
        let bounds = scene.bounds(id).unwrap();
        let mesh = OccluderMesh::cuboid(&Aabb::new(bounds.min, bounds.min.lerp(bounds.max, share))).unwrap();
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
    };
    let changes: [(&str, bool, Change); 15] = [
        ("cost", false, |scene, id| scene.set_cost(id, 99).unwrap()),
        ("the same layers", false, |scene, id| scene.set_layers(id, u32::MAX).unwrap()),
        ("the same bounds", false, |scene, id| scene.set_bounds(id, scene.bounds(id).unwrap()).unwrap()),
        ("opened and shut", false, |scene, id| {
            scene.set_occluder(id, false).unwrap();
            scene.set_occluder(id, true).unwrap();
        }),
        ("the same triangles", false, |scene, id| {
            let same = scene.shared_triangles(id).unwrap().clone();
            scene.set_triangles(id, same).unwrap();
        }),
        ("layers", true, |scene, id| scene.set_layers(id, 3).unwrap()),
        ("bounds", true, |scene, id| {
            let bounds = scene.bounds(id).unwrap();
            scene.set_bounds(id, Aabb::new(bounds.min, bounds.max + 1.0)).unwrap();
        }),
        ("opened", true, |scene, id| scene.set_occluder(id, false).unwrap()),
        ("glass", true, |scene, id| scene.set_see_through(id, true).unwrap()),
        ("one-sided", true, |scene, id| scene.set_one_sided(id, true).unwrap()),
        ("never culled", true, |scene, id| scene.set_never_cull(id, true).unwrap()),
        ("draw range", true, |scene, id| {
            scene.set_draw_range(id, DrawRange { end: 9.0, ..DrawRange::ALWAYS }).unwrap();
        }),
        ("other triangles", true, |scene, id| {
            let corner = scene.bounds(id).unwrap().min;
            scene.set_triangles(id, [[corner, corner + 0.1, corner + Vec3::X * 0.1]]).unwrap();
        }),
        ("a moved mesh", true, |scene, id| {
            let mesh = scene.add_mesh(OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [0.5; 3])).unwrap());
            let at = Affine3A::from_translation(scene.bounds(id).unwrap().min);
            scene.set_mesh(id, mesh, at).unwrap();
        }),
        ("removed", true, |scene, id| scene.remove(id).unwrap()),
    ];
    for (name, matters, change) in changes {
        let (mut scene, ids, pvs, viewcells) = world();
        scene.set_occluder(ids[0], true).unwrap();
        let corner = scene.bounds(ids[0]).unwrap().min;
        scene.set_triangles(ids[0], [[corner, corner + Vec3::X, corner + Vec3::Z]]).unwrap();
        cuboid(&mut scene, ids[0], 0.5);
        let shared = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
        let mut culler = PvsCuller::new(&shared);
        let before = seen(&mut culler, &scene, &ids, 2.0);
        assert_eq!(before, [0, 2, 4, 6, 8], "{name}: before");
        change(&mut scene, ids[0]);
        let (is_there, after) = (scene.contains(ids[0]), seen(&mut culler, &scene, &ids, 2.0));
        let all: Vec<usize> = (usize::from(!is_there)..10).collect();
        assert_eq!(after, if matters { all } else { before }, "{name}");
        // A culler that is new, or has lost the log, finds the same.
        assert_eq!(seen(&mut PvsCuller::new(&shared), &scene, &ids, 2.0), after, "{name}: a new culler");
    }
}

#[test]
fn another_mesh_or_place_of_an_occluders_mesh_counts() {
    for (name, by, share, matters) in
        [("the same", 0.0, 1.0, false), ("another mesh", 0.0, 0.5, true), ("another place", 0.25, 1.0, true)]
    {
        let (mut scene, ids, pvs, viewcells) = world();
        scene.set_occluder(ids[0], true).unwrap();
        let bounds = scene.bounds(ids[0]).unwrap();
        let part = |share: f32| Aabb::from_arrays([0.0; 3], [0.5, 0.25 * share, 0.5]);
        let mesh = |scene: &mut Scene, by: f32, share: f32| {
            let mesh = scene.add_mesh(OccluderMesh::cuboid(&part(share)).unwrap());
            scene.set_mesh(ids[0], mesh, Affine3A::from_translation(bounds.min + Vec3::X * by)).unwrap();
        };
        mesh(&mut scene, 0.0, 1.0);
        let shared = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
        mesh(&mut scene, by, share);
        let count = seen(&mut PvsCuller::new(&shared), &scene, &ids, 2.0).len();
        assert_eq!(count, if matters { 10 } else { 5 }, "{name}");
    }
}

/// An occluder without flag and triangles that the caller names: another turn of the object within the same
/// bounds counts, and so do another mesh and glass.
#[test]
fn changes_of_a_named_occluder_count() {
    type Change = fn(&mut Scene, ObjectId, Affine3A);
    fn set_mesh(scene: &mut Scene, id: ObjectId, at: Affine3A, high: f32) {
        let part = Aabb::from_arrays([-0.5, -0.25, -0.5], [0.5, high, 0.5]);
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&part).unwrap());
        scene.set_mesh(id, mesh, at).unwrap();
    }
    let changes: [(&str, bool, bool, Change); 6] = [
        ("glass", false, true, |scene, id, _| scene.set_see_through(id, true).unwrap()),
        ("one-sided", false, true, |scene, id, _| scene.set_one_sided(id, true).unwrap()),
        ("the same place", false, false, |scene, id, at| scene.set_transform(id, at).unwrap()),
        ("half a turn", false, true, |scene, id, at| {
            let turn = Affine3A::from_scale(Vec3::new(-1.0, -1.0, 1.0));
            let bounds = scene.bounds(id).unwrap();
            scene.set_transform(id, at * turn).unwrap();
            assert_eq!(scene.bounds(id).unwrap(), bounds, "the turned bounds");
        }),
        ("the same mesh", true, false, |scene, id, at| set_mesh(scene, id, at, 0.25)),
        ("another mesh", true, true, |scene, id, at| set_mesh(scene, id, at, 0.1)),
    ];
    for (name, has_mesh, matters, change) in changes {
        let (mut scene, ids, pvs, viewcells) = world();
        let at = Affine3A::from_translation(scene.bounds(ids[0]).unwrap().center());
        scene.set_local_bounds(ids[0], Aabb::from_arrays([-0.5, -0.25, -0.5], [0.5, 0.25, 0.5])).unwrap();
        scene.set_transform(ids[0], at).unwrap();
        if has_mesh {
            set_mesh(&mut scene, ids[0], at, 0.25);
        }
        let shared = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
        let shared = shared.with_occluders(&scene, [ids[0]]);
        let mut culler = PvsCuller::new(&shared);
        assert_eq!(seen(&mut culler, &scene, &ids, 2.0).len(), 5, "{name}: before");
        change(&mut scene, ids[0], at);
        assert_eq!(seen(&mut culler, &scene, &ids, 2.0).len(), if matters { 10 } else { 5 }, "{name}");
    }
}

#[test]
fn a_named_occluder_that_is_no_longer_always_drawn_hides_nothing() {
    // The occluder is named by the caller, and has neither flag nor mesh in this scene.
    let (mut scene, ids, pvs, viewcells) = world();
    let shared = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
    let shared = shared.with_occluders(&scene, [ids[0]]);
    let mut culler = PvsCuller::new(&shared);
    assert_eq!(seen(&mut culler, &scene, &ids, 2.0).len(), 5, "before");
    scene.set_draw_range(ids[0], DrawRange { end: 9e9, ..DrawRange::ALWAYS }).unwrap();
    assert_eq!(seen(&mut culler, &scene, &ids, 2.0).len(), 10, "with a draw range");
}
