//! What a virtual occluder hides is not reached by any ray from the viewcell, wherever it moves.

use crate::common::{World, random_world};
use std::collections::BTreeSet;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::occlusion::Occlusion;
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, OccluderMesh, OcclusionMap, Pose, Scene, View};
use visibility_region::{ExtendedProjectionCuller, VirtualOccluders};
use visibility_testing::Random;

fn view(eye: DVec3, direction: DVec3, near: f64) -> View {
    let up = if direction.x.abs() > 0.5 { DVec3::Z } else { DVec3::X };
    View::perspective(Pose::look_at(eye, eye + direction, up), 1.2, 1.0, near, f64::INFINITY).unwrap()
}

#[test]
fn no_ray_reaches_a_box_that_virtual_occluders_hide() {
    let mut rng = Random(3);
    let mut hidden_boxes = 0;
    for number in 0..15 {
        let scale = rng.pick(&[1.0, 1e3]);
        let (mut world, cell) = random_world(&mut rng, scale);
        let mut map = ExtendedProjectionCuller::new().virtual_occluders(&world.scene, &cell);
        assert!(
            map.occluders().len() <= VirtualOccluders::MAX,
            "world {number}: {} virtual occluders",
            map.occluders().len()
        );
        if cell.max.cmple(cell.min).any() {
            continue; // no near plane fits into a flat cell
        }
        // Boxes that were not there: the rays look for those that all of some views hide.
        let size = cell.max - cell.min;
        let eyes: Vec<DVec3> =
            (0..4).map(|_| cell.min + size * (rng.vector(0.4) + DVec3::splat(0.5))).collect();
        let boxes: Vec<Aabb> = (0..300)
            .map(|_| {
                let at = (rng.direction() * (scale * rng.range(3.0, 60.0))).as_vec3();
                let half = rng.vec3(0.0, scale * 0.5).abs();
                Aabb::new(at - half, at + half)
            })
            .collect();
        for eye in eyes {
            assert!(map.sync(&world.scene), "objects that hide nothing were added");
            map.begin(&view(eye, rng.direction(), 1e-6 * scale), DVec3::ZERO);
            let hidden: Vec<Aabb> =
                boxes.iter().copied().filter(|b| map.test(b) == Occlusion::Hidden).collect();
            hidden_boxes += hidden.len();
            world.bounds.clear();
            let ids: BTreeSet<_> = hidden.iter().map(|&b| world.add_target(b)).collect();
            let here = Viewcell::from_box(eye, eye);
            let found = world.search(&mut rng, &here, &ids, 300);
            assert!(found.is_ok(), "world {number}: {found:?}");
        }
    }
    assert!(hidden_boxes > 100, "{hidden_boxes}");
}

/// A wall with posts behind it.
fn wall() -> (World, Viewcell) {
    let mut world = World::new();
    world.add_box([5.0, -9.0, -9.0], [5.2, 9.0, 9.0]);
    for y in -4..4 {
        world.add_target(Aabb::from_arrays([20.0, y as f32, 0.0], [20.5, y as f32 + 0.5, 1.0]));
    }
    (world, Viewcell::from_box(DVec3::ZERO, DVec3::ONE))
}

#[test]
fn nothing_is_hidden_from_an_eye_outside_of_the_cell() {
    let (world, cell) = wall();
    let mut map = ExtendedProjectionCuller::new().virtual_occluders(&world.scene, &cell);
    let post = world.bounds[3].1;
    let mut answer = |eye: DVec3, near: f64| {
        map.sync(&world.scene);
        map.begin(&view(eye, DVec3::X, near), DVec3::ZERO);
        map.test(&post)
    };
    assert_eq!(answer(DVec3::splat(0.5), 0.1), Occlusion::Hidden, "from within the cell");
    assert_eq!(answer(DVec3::new(-0.5, 0.5, 0.5), 0.1), Occlusion::Partial, "before the cell");
    assert_eq!(answer(DVec3::new(8.0, 0.5, 0.5), 0.1), Occlusion::Partial, "behind the wall");
    assert_eq!(answer(DVec3::splat(0.5), 7.0), Occlusion::Partial, "sight begins behind the wall");
    map.sync(&world.scene);
    map.begin(&view(DVec3::splat(0.5), DVec3::X, 0.1), DVec3::ZERO);
    assert_eq!(map.test(&Aabb::EMPTY), Occlusion::Visible, "the empty box");
    assert_eq!(map.test(&Aabb::new(Vec3::NAN, Vec3::ONE)), Occlusion::Visible, "a box with NaN");
}

#[test]
fn the_scene_may_lie_anywhere_in_the_world() {
    let (mut world, cell) = wall();
    let origin = DVec3::new(4e6, -3e6, 1e3);
    world.scene.set_origin(origin).unwrap();
    let cell = Viewcell::from_box(cell.min + origin, cell.max + origin);
    let mut map = ExtendedProjectionCuller::new().virtual_occluders(&world.scene, &cell);
    map.sync(&world.scene);
    map.begin(&view(origin + 0.5, DVec3::X, 0.1), origin);
    assert_eq!(map.test(&world.bounds[3].1), Occlusion::Hidden, "far from the origin");
    let corner = map.occluders()[0].corners()[0] - origin;
    assert!(corner.x > 4.99 && corner.x < 20.0, "{corner}");
    // Between the sync and the frame the walls move with the origin.
    map.sync(&world.scene);
    world.scene.set_origin(origin + DVec3::X * 30.0).unwrap();
    map.begin(&view(origin + 0.5, DVec3::X, 0.1), world.scene.origin());
    assert_eq!(map.test(&world.bounds[3].1), Occlusion::Partial, "the origin moved after the sync");
}

#[test]
fn empty_scenes_and_cells_have_no_virtual_occluders() {
    let none = |scene: &Scene, cell: &Viewcell| {
        ExtendedProjectionCuller::new().virtual_occluders(scene, cell).occluders().is_empty()
    };
    let (world, cell) = wall();
    assert!(none(&Scene::new(), &cell), "an empty scene");
    for p in [DVec3::NAN, DVec3::INFINITY] {
        assert!(none(&world.scene, &Viewcell::from_box(p, p)), "a cell at {p}");
    }
    assert!(none(&world.scene, &Viewcell::from_box(DVec3::ONE, DVec3::ZERO)), "an inverted cell");
    assert!(!none(&world.scene, &cell), "a proper cell has virtual occluders");
}

/// Tests that virtual occluders hide only what the walls of the present scene hide, while scenes are changed,
/// reverted, cloned, swapped and dropped, and that they go on while only other objects change.
#[test]
fn other_scenes_and_changed_walls_make_virtual_occluders_inert() {
    let mut rng = Random(7);
    let post = Aabb::from_arrays([20.0, 0.0, 0.0], [20.5, 0.5, 1.0]);
    let thick = Aabb::from_arrays([5.0, -9.0, -9.0], [5.2, 9.0, 9.0]);
    let scene_of = |wall: Aabb| {
        let mut world = World::new();
        world.add_box(wall.min.to_array(), wall.max.to_array());
        world.add_target(post);
        world.scene
    };
    let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
    let mut culler = ExtendedProjectionCuller::new();
    let scene = scene_of(thick);
    let mut scenes = [scene.clone(), scene, scene_of(Aabb::new(thick.min, thick.max - Vec3::Y * 8.0))];
    let mut live = culler.virtual_occluders(&scenes[0], &cell);
    // Index of the scene that `live` was made from, and whether its wall, if it occluded then, has changed
    // since.
    let (mut made_from, mut is_stale, mut had_wall) = (Some(0), false, true);
    let mut counts = [0, 0];
    for _ in 0..1500 {
        let at = made_from.filter(|_| rng.one_in(2)).unwrap_or(rng.below(scenes.len()));
        let [wall, mover] = [0, 1].map(|index| scenes[at].id_at(index).unwrap());
        match rng.below(20) {
            0 => {
                let was = scenes[at].object(wall).unwrap().occluder;
                scenes[at].set_occluder(wall, !was).unwrap();
                is_stale |= made_from == Some(at) && had_wall;
            }
            1 => {
                // Moved and moved back: the log tells of a change.
                let bounds = scenes[at].bounds(wall).unwrap();
                scenes[at].set_bounds(wall, Aabb::new(bounds.min + 30.0, bounds.max + 30.0)).unwrap();
                scenes[at].set_bounds(wall, bounds).unwrap();
                let mesh = scenes[at].add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
                scenes[at].set_mesh(wall, mesh, Affine3A::IDENTITY).unwrap();
                is_stale |= made_from == Some(at) && had_wall;
            }
            2 => scenes[at].set_bounds(mover, Aabb::new(post.min, post.max + rng.unit() as f32)).unwrap(),
            3 => {
                let to = rng.below(scenes.len());
                scenes[to] = scenes[at].clone();
                made_from = made_from.filter(|&from| from != to);
            }
            4 => {
                let to = rng.below(scenes.len());
                scenes.swap(at, to);
                made_from = made_from.map(|from| {
                    if from == at {
                        to
                    } else if from == to {
                        at
                    } else {
                        from
                    }
                });
            }
            5..8 => {
                live = culler.virtual_occluders(&scenes[at], &cell);
                (made_from, is_stale) = (Some(at), false);
                had_wall = scenes[at].object(wall).unwrap().occluder;
            }
            _ => {}
        }
        let synced = !rng.one_in(4);
        let held = synced && live.sync(&scenes[at]);
        live.begin(&view(DVec3::splat(0.5), DVec3::X, 0.1), DVec3::ZERO);
        let hides = live.test(&post) == Occlusion::Hidden;
        let is_same = made_from == Some(at) && !is_stale;
        assert_eq!(held, synced && is_same, "confirmed for the scene as it was, and for no other");
        assert!(!hides || held && had_wall, "what hides was confirmed, and made of an occluding wall");
        counts[usize::from(hides)] += 1;
    }
    assert!(counts.iter().all(|&count| count > 60), "{counts:?}");
}
