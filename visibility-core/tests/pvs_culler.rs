//! Viewcells are found as by looking at each; the culler hides what a viewcell does not see, and only that.

use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, ObjectId, Plane, Pose, Pvs, PvsCuller, PvsTargets, Scene, ScenePvs, View, Viewcell, ViewcellId,
    Viewcells, VisibleSet,
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
            assert_eq!(tree.locate(p), plain);
            found += usize::from(plain.is_some());
        }
        assert!(count < 300 || found > 400, "{found}");
        assert_eq!(tree.locate(DVec3::NAN), None);
    }
}

/// Ten objects in a row in front of two rooms; the first room sees the even ones, the second all but the last.
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
    // Object 5 was given no target, so nobody can say that it is hidden.
    assert_eq!(seen(&mut culler, &scene, &ids, 2.0), [0, 2, 4, 5, 6, 8]);
    assert_eq!(culler.viewcell(), Some(ViewcellId(0)));
    assert_eq!(seen(&mut culler, &scene, &ids, 7.0), [0, 1, 2, 3, 4, 5, 6, 7, 8]);
    // Outside of all viewcells, everything is seen.
    assert_eq!(seen(&mut culler, &scene, &ids, 12.0).len(), 10);
    assert_eq!(culler.viewcell(), None);
    assert_eq!(seen(&mut culler, &scene, &ids, 2.0), [0, 2, 4, 5, 6, 8]);
    // What has moved is no longer where the sets think.
    scene.set_bounds(ids[3], Aabb::from_arrays([22.0, 0.0, 0.0], [23.0, 1.0, 1.0])).unwrap();
    assert_eq!(seen(&mut culler, &scene, &ids, 2.0), [0, 2, 3, 4, 5, 6, 8]);
    // What is new has no set, also under a number that was used before.
    scene.remove(ids[1]).unwrap();
    let new = scene.insert(Aabb::from_arrays([20.0, 1.0, 0.0], [21.0, 1.5, 1.0]));
    assert_eq!(seen(&mut culler, &scene, &[new], 2.0), [0]);
    // Another scene: nothing is known of it.
    let (other, ids, ..) = world();
    assert_eq!(seen(&mut culler, &other, &ids, 2.0).len(), 10);
}

#[test]
fn objects_in_several_cells_are_seen_where_any_of_them_is() {
    let (scene, ids, pvs, viewcells) = world();
    // Targets that the sets do not know hide nothing either.
    let pairs = [(ids[0], 1), (ids[0], 3), (ids[1], 1), (ids[1], 2), (ids[2], 1), (ids[2], 77)];
    let shared = ScenePvs::new(&scene, pvs, viewcells, pairs);
    assert_eq!(seen(&mut PvsCuller::new(&shared), &scene, &ids[..3], 2.0), [1, 2]);
}

/// The rooms meet at x = 5; the near plane is 0.1 m before the eye, which looks along x.
#[test]
fn where_the_near_plane_reaches_the_next_viewcell_what_that_sees_is_seen_too() {
    let (scene, ids, pvs, viewcells) = world();
    let shared = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
    let mut culler = PvsCuller::new(&shared);
    assert_eq!(seen(&mut culler, &scene, &ids, 4.85), [0, 2, 4, 6, 8]);
    assert_eq!(seen(&mut culler, &scene, &ids, 4.95), [0, 1, 2, 3, 4, 5, 6, 7, 8]);
    assert_eq!(culler.viewcell(), Some(ViewcellId(0)), "where the eye is");
    assert_eq!(seen(&mut culler, &scene, &ids, 4.85), [0, 2, 4, 6, 8]);
}

/// The rooms end at y = 15. The near plane is 0.16 m to either side of the middle, 0.1 m before the eye.
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
        assert_eq!(culler.viewcell(), Some(ViewcellId(0)));
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
    // Relative to the eye: from 6 m on, or from behind it.
    for (start, expected) in [(6.0, 10), (-1.0, 5)] {
        let view = view.with_clip_planes(&[Plane::through(DVec3::X * start, DVec3::X)]).unwrap();
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        culler.cull(&scene, &view, &mut visible);
        assert_eq!(ids.iter().filter(|&&id| visible.contains(&scene, id)).count(), expected);
    }
}
