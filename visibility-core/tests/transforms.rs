//! Tests that objects occlude from their present place, however they were moved: bounds, meshes, triangles
//! and ids.

use visibility_core::glam::{Affine3A, DVec3, EulerRot, Mat3A, Quat, Vec3};
use visibility_core::{
    Aabb, FrustumCuller, Object, ObjectId, OccluderMesh, OcclusionCuller, Pipeline, Pose, Scene, View,
    VisibleSet,
    occlusion::Preparation,
    scene::{SceneError, ToAffine, Triangle},
};
use visibility_testing::{PlainMap, Random, sign_of_sum};

/// Bounds of the wall, across a view along x.
const WALL: Aabb = Aabb::from_arrays([10.0, -4.0, -4.0], [10.5, 4.0, 4.0]);
/// Bounds of an object that the wall hides.
const BEHIND: Aabb = Aabb::from_arrays([20.0, -0.2, -0.2], [20.4, 0.2, 0.2]);
/// Bounds beside the view.
const ASIDE: Aabb = Aabb::from_arrays([10.0, 40.0, -4.0], [10.5, 48.0, 4.0]);

fn is_visible(scene: &Scene, id: ObjectId) -> bool {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.6, 0.1, f64::INFINITY).unwrap();
    let culler = OcclusionCuller::new(PlainMap::new(96, 60));
    let mut visible = VisibleSet::new();
    Pipeline::new().with(FrustumCuller::new()).with(culler).cull(scene, &view, &mut visible);
    visible.contains(scene, id)
}

/// Returns a scene with a wall that has neither mesh nor triangles, the wall, and an object behind.
fn street() -> (Scene, ObjectId, ObjectId) {
    let mut scene = Scene::new();
    let wall = scene.insert(Object { occluder: true, ..Object::new(WALL) });
    let behind = scene.insert(BEHIND);
    (scene, wall, behind)
}

fn with_mesh() -> (Scene, ObjectId, ObjectId) {
    let (mut scene, wall, behind) = street();
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&WALL).unwrap());
    scene.set_mesh(wall, mesh, Affine3A::IDENTITY).unwrap();
    (scene, wall, behind)
}

/// Returns the side of the wall that faces the view, as triangles.
fn front() -> [Triangle; 2] {
    let p = |y, z| Vec3::new(10.0, y, z);
    [[p(-4.0, -4.0), p(-4.0, 4.0), p(4.0, -4.0)], [p(4.0, 4.0), p(4.0, -4.0), p(-4.0, 4.0)]]
}

fn with_prepared_mesh() -> (Scene, ObjectId, ObjectId) {
    let (mut scene, wall, behind) = street();
    scene.set_triangles(wall, front()).unwrap();
    assert_eq!(scene.prepare_occluders(&Preparation::default()), 1, "occluders prepared");
    (scene, wall, behind)
}

#[test]
fn new_bounds_take_away_what_hides_at_the_old_ones() {
    for (mut scene, wall, behind) in [with_mesh(), with_prepared_mesh()] {
        scene.set_bounds(wall, WALL).unwrap();
        assert!(!is_visible(&scene, behind), "nothing has moved");
        let mut batch = scene.clone();
        scene.set_bounds(wall, ASIDE).unwrap();
        batch.set_bounds_batch(&[(behind, BEHIND), (wall, ASIDE)]).unwrap();
        for scene in [&mut scene, &mut batch] {
            assert!(is_visible(scene, behind), "nothing is before it any more");
            assert!(
                !scene.has_mesh(wall) && scene.triangles(wall).unwrap().is_empty(),
                "mesh and triangles go with the bounds"
            );
            assert_eq!(scene.prepare_occluders(&Preparation::default()), 0, "the triangles were elsewhere");
            scene.set_bounds(wall, WALL).unwrap();
            assert!(is_visible(scene, behind), "whether the wall is as it was is unknown");
        }
    }
}

#[test]
fn bounds_that_become_nan_take_away_what_hides() {
    for (mut scene, wall, behind) in [with_mesh(), with_prepared_mesh()] {
        scene.set_bounds(wall, Aabb::new(Vec3::NAN, Vec3::NAN)).unwrap();
        assert!(
            is_visible(&scene, behind) && is_visible(&scene, wall),
            "a wall at NaN is visible and hides nothing"
        );
    }
}

#[test]
fn flags_leave_what_hides_where_it_is() {
    for (mut scene, wall, behind) in [with_mesh(), with_prepared_mesh()] {
        scene.set_never_cull(wall, true).unwrap();
        scene.set_layers(wall, 3).unwrap();
        scene.set_cost(wall, 3).unwrap();
        scene.set_never_cull(wall, false).unwrap();
        assert!(!is_visible(&scene, behind), "flags do not stop the wall from hiding");
    }
}

/// Applies one transform to an object, alone, in a batch of glam's transforms or in a batch of rows.
fn move_by(scene: &mut Scene, id: ObjectId, transform: Affine3A, how: usize) {
    let columns = transform.to_cols_array_2d();
    match how {
        0 => scene.set_transform(id, transform).unwrap(),
        1 => scene.set_transforms_batch(&[(id, transform)]).unwrap(),
        2 => scene.set_transforms_batch(&[(id, transform.to_cols_array())]).unwrap(),
        3 => scene.set_transforms_batch(&[(id, columns)]).unwrap(),
        _ => {
            let rows = [0, 1, 2].map(|row| [0, 1, 2, 3].map(|column| columns[column][row]));
            scene.set_transforms_batch(&[(id, rows)]).unwrap();
        }
    }
}

#[test]
fn transforms_move_bounds_and_mesh_together() {
    let away = Affine3A::from_translation(Vec3::Y * 40.0);
    for how in 0..5 {
        let (mut scene, wall, behind) = with_mesh();
        scene.set_local_bounds(wall, WALL).unwrap();
        assert!(!is_visible(&scene, behind), "way {how}: the wall hides the thing behind");
        move_by(&mut scene, wall, away, how);
        assert!(
            is_visible(&scene, behind) && !is_visible(&scene, wall),
            "way {how}: the wall is out of view"
        );
        assert_eq!(scene.bounds(wall).unwrap(), WALL.transformed(&away), "way {how}: the bounds have moved");
        assert_eq!(
            (scene.transform(wall), scene.local_bounds(wall)),
            (Some(away), Some(WALL)),
            "way {how}: transform and local bounds"
        );
        assert_eq!(scene.occluder(wall).unwrap().1, away, "way {how}: the mesh has moved");
        move_by(&mut scene, wall, Affine3A::IDENTITY, how);
        assert!(!is_visible(&scene, behind) && is_visible(&scene, wall), "it hides where it is again");
        // Setting a mesh again, with another transform, moves the bounds as well.
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&WALL).unwrap());
        scene.set_mesh(wall, mesh, away).unwrap();
        assert!(is_visible(&scene, behind), "way {how}: the new mesh is out of the way");
        assert_eq!(
            scene.bounds(wall).unwrap(),
            WALL.transformed(&away),
            "way {how}: the bounds follow the new mesh"
        );
    }
}

#[test]
fn what_is_made_of_triangles_stays_behind_a_transform() {
    for how in 0..5 {
        let (mut scene, wall, behind) = with_prepared_mesh();
        scene.set_local_bounds(wall, WALL).unwrap();
        move_by(&mut scene, wall, Affine3A::IDENTITY, how);
        assert!(!is_visible(&scene, behind), "it has not moved");
        // A quarter turn about the wall's middle, and a shift that leaves the bounds as they are.
        move_by(&mut scene, wall, Affine3A::from_translation(Vec3::Y * 40.0), how);
        assert!(is_visible(&scene, behind) && !scene.has_mesh(wall), "way {how}: the prepared mesh is gone");
        assert!(scene.triangles(wall).unwrap().is_empty(), "way {how}: the triangles are gone");
        move_by(&mut scene, wall, Affine3A::IDENTITY, how);
        scene.set_triangles(wall, front()).unwrap();
        assert_eq!(
            scene.prepare_occluders(&Preparation::default()),
            1,
            "way {how}: occluders prepared of new triangles"
        );
        assert!(!is_visible(&scene, behind), "way {how}: the wall hides again");
    }
}

/// Tests that a turn which leaves the bounds as they are still removes the triangles.
#[test]
fn triangles_that_turn_within_their_bounds_are_removed() {
    let mut scene = Scene::new();
    let cube = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
    let id = scene.insert(cube);
    scene.set_local_bounds(id, cube).unwrap();
    scene.set_transform(id, Affine3A::from_scale(-Vec3::ONE)).unwrap();
    let bounds = scene.bounds(id).unwrap();
    scene.set_triangles(id, [[Vec3::ONE, Vec3::NEG_ONE, Vec3::X]]).unwrap();
    scene.set_transform(id, Affine3A::from_scale(Vec3::new(1.0, -1.0, 1.0))).unwrap();
    assert_eq!(scene.bounds(id), Ok(bounds), "the bounds are those of before the turn");
    assert!(scene.triangles(id).unwrap().is_empty(), "the triangles are gone though the bounds are equal");
}

#[test]
fn a_local_box_that_changes_takes_the_mesh_away() {
    let (mut scene, wall, behind) = with_mesh();
    scene.set_local_bounds(wall, WALL).unwrap();
    scene.set_local_bounds(wall, WALL).unwrap();
    assert!(!is_visible(&scene, behind), "the same box");
    scene.set_local_bounds(wall, ASIDE).unwrap();
    assert!(is_visible(&scene, behind) && !scene.has_mesh(wall), "another local box takes the mesh away");
    // A first local box that is elsewhere takes the prepared mesh away, since the triangles do not move.
    let (mut scene, wall, behind) = with_prepared_mesh();
    scene.set_local_bounds(wall, ASIDE).unwrap();
    assert!(
        is_visible(&scene, behind) && !scene.has_mesh(wall),
        "the first local box is elsewhere, and takes the mesh away"
    );
}

#[test]
fn transforms_that_cannot_be_are_errors_and_change_nothing() {
    let (mut scene, wall, behind) = with_mesh();
    let shift = Affine3A::from_translation(Vec3::Y * 40.0);
    assert_eq!(
        scene.set_transform(wall, shift),
        Err(SceneError::NoLocalBounds(wall)),
        "a transform without local bounds"
    );
    scene.set_local_bounds(wall, WALL).unwrap();
    let revision = scene.revision();
    let nan = Affine3A::from_translation(Vec3::NAN);
    let refused = Err(SceneError::Transform(wall));
    assert_eq!(scene.set_transform(wall, nan), refused, "a transform of NaN");
    assert_eq!(
        scene.set_transforms_batch(&[(wall, shift), (wall, nan)]),
        refused,
        "a batch with a transform of NaN"
    );
    let bare = Err(SceneError::NoLocalBounds(behind));
    assert_eq!(
        scene.set_transforms_batch(&[(wall, shift), (behind, shift)]),
        bare,
        "a batch with an object without local bounds"
    );
    assert!(!is_visible(&scene, behind) && scene.revision() == revision, "refused calls change nothing");
    // Setting bounds in scene coordinates removes the local bounds.
    scene.set_bounds(wall, ASIDE).unwrap();
    assert_eq!(scene.local_bounds(wall), None, "bounds in scene coordinates end the local ones");
    assert_eq!(
        scene.set_transform(wall, shift),
        Err(SceneError::NoLocalBounds(wall)),
        "a transform after the local bounds ended"
    );
    // Improper and infinite local boxes: the object is never culled.
    for local in [Aabb::EMPTY, Aabb::new(Vec3::NAN, Vec3::ONE), Aabb::new(Vec3::ZERO, Vec3::INFINITY)] {
        scene.set_local_bounds(wall, local).unwrap();
        scene.set_transform(wall, shift).unwrap();
        assert!(is_visible(&scene, wall), "{local:?}");
    }
}

/// Tests random moves by every function, in batches of every size and with removed objects, against single
/// transforms: bounds are those of the local box, and the mesh is at the object's transform.
#[test]
fn random_transforms_place_bounds_and_meshes() {
    let mut rng = Random(11);
    let mut scene = Scene::new();
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&Aabb::from_arrays([-1.0; 3], [1.0; 3])).unwrap());
    let mut model: Vec<(ObjectId, Aabb, Affine3A)> = Vec::new();
    for round in 0..200 {
        for _ in 0..rng.below(20) {
            let id = scene.insert(Object { occluder: rng.one_in(2), ..Object::new(Aabb::EMPTY) });
            let local = Aabb::new(-rng.vec3(0.0, 2.0), rng.vec3(0.0, 2.0));
            scene.set_local_bounds(id, local).unwrap();
            if rng.one_in(2) {
                scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
            }
            model.push((id, local, Affine3A::IDENTITY));
        }
        for _ in 0..rng.below(10).min(model.len()) {
            let (id, ..) = model.swap_remove(rng.below(model.len()));
            scene.remove(id).unwrap();
            assert_eq!(
                (scene.transform(id), scene.local_bounds(id), scene.has_mesh(id)),
                (None, None, false),
                "{id} was removed"
            );
        }
        let mut moved = Vec::new();
        for _ in 0..if model.is_empty() { 0 } else { rng.below(400) } {
            let (id, _, transform) = &mut {
                let n = rng.below(model.len());
                &mut model[n]
            };
            let turn =
                Quat::from_euler(EulerRot::XYZ, rng.unit() as f32, rng.unit() as f32, rng.unit() as f32);
            *transform = Affine3A::from_rotation_translation(turn, rng.vector(50.0).as_vec3());
            moved.push((*id, *transform));
        }
        if round % 3 == 0 {
            moved.iter().for_each(|&(id, transform)| scene.set_transform(id, transform).unwrap());
        } else {
            let arrays: Vec<_> =
                moved.iter().map(|(id, transform)| (*id, transform.to_cols_array())).collect();
            scene.set_transforms_batch(&arrays).unwrap();
        }
        for (id, local, transform) in &model {
            assert_eq!(
                scene.bounds(*id).unwrap(),
                local.transformed(transform),
                "{id}: its bounds are the transformed local ones"
            );
            assert_eq!(scene.transform(*id), Some(*transform), "{id}: its transform");
            if let Some((_, ref placed)) = scene.occluder(*id) {
                assert_eq!(placed, transform, "{id}: its mesh has its transform");
            }
        }
        let bare = |id: ObjectId| scene.object(id).unwrap().occluder && !scene.has_mesh(id);
        assert_eq!(
            scene.occluders_without_mesh(),
            model.iter().filter(|(id, ..)| bare(*id)).count(),
            "round {round}: occluders without a mesh"
        );
    }
}

#[test]
fn occluders_without_a_mesh_are_counted() {
    let (mut scene, wall, behind) = street();
    let count = |scene: &Scene| scene.occluders_without_mesh();
    assert_eq!(count(&scene), 1, "the wall has no mesh yet");
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&WALL).unwrap());
    scene.set_mesh(wall, mesh, Affine3A::IDENTITY).unwrap();
    scene.set_mesh(wall, mesh, Affine3A::IDENTITY).unwrap();
    scene.set_mesh(behind, mesh, Affine3A::IDENTITY).unwrap();
    assert_eq!(count(&scene), 0, "the wall has a mesh; the thing behind is no occluder");
    scene.set_occluder(wall, false).unwrap();
    scene.set_bounds(wall, ASIDE).unwrap();
    assert_eq!(count(&scene), 0, "not an occluder");
    scene.set_occluder(wall, true).unwrap();
    scene.set_occluder(wall, true).unwrap();
    assert_eq!(count(&scene), 1, "its mesh was removed");
    scene.set_triangles(wall, front().map(|t| t.map(|p| p + Vec3::Y * 44.0))).unwrap();
    scene.prepare_occluders(&Preparation::default());
    assert_eq!((count(&scene), count(&scene.clone())), (0, 0), "a mesh was prepared; a clone counts alike");
    scene.set_triangles(wall, []).unwrap();
    scene.insert_batch([Object { occluder: true, ..Object::new(ASIDE) }; 3]);
    assert_eq!(count(&scene), 4, "the wall lost its mesh, and three without one are new");
    scene.remove(wall).unwrap();
    scene.remove(behind).unwrap();
    assert_eq!(count(&scene), 3, "the wall is gone");
}

#[test]
fn ids_of_another_scene_are_unknown() {
    let mut scenes: Vec<_> = (0..100).map(|_| with_mesh()).collect();
    let local = Aabb::from_arrays([0.0; 3], [1.0; 3]);
    for number in 0..100 {
        let (_, id, _) = scenes[(number + 1 + number % 9) % 100];
        let scene = &mut scenes[number].0;
        let unknown = SceneError::UnknownObject(id);
        assert!(
            !scene.contains(id) && scene.occluder(id).is_none() && scene.transform(id).is_none(),
            "{id} is of another scene"
        );
        assert_eq!(scene.bounds(id), Err(unknown), "{id} is of another scene");
        assert_eq!(scene.set_bounds(id, local), Err(unknown), "{id} is of another scene");
        assert_eq!(scene.set_bounds_batch(&[(id, local)]), Err(unknown), "{id} is of another scene");
        assert_eq!(scene.set_local_bounds(id, local), Err(unknown), "{id} is of another scene");
        assert_eq!(scene.set_transform(id, Affine3A::IDENTITY), Err(unknown), "{id} is of another scene");
        assert_eq!(scene.remove(id), Err(unknown), "{id} is of another scene");
        // A clone of a scene knows the ids made before it was cloned; ids made later belong to one of the two
        // scenes.
        let (mut copy, old) = (scene.clone(), scene.ids().next().unwrap());
        let (new, other) = (copy.insert(local), scene.insert(local));
        assert!(
            copy.contains(old) && !scene.contains(new) && !copy.contains(other),
            "ids from before the clone are valid in both, new ones in one scene each"
        );
        let [mesh, foreign] =
            [scene, &mut copy].map(|scene| scene.add_mesh(OccluderMesh::cuboid(&local).unwrap()));
        let scene = &mut scenes[number].0;
        assert_eq!(scene.set_mesh(other, mesh, Affine3A::IDENTITY), Ok(()), "{mesh:?} is of the scene");
        let refused = Err(SceneError::UnknownMesh(foreign));
        assert_eq!(
            scene.set_mesh(other, foreign, Affine3A::IDENTITY),
            refused,
            "{foreign:?} is of the clone"
        );
    }
}

/// Tests whether the exact image of a corner is within the bounds on one axis.
fn contains_image(bounds: &Aabb, transform: &Affine3A, corner: Vec3, axis: usize) -> bool {
    let columns = transform.to_cols_array_2d().map(|column| f64::from(column[axis]));
    let terms = |side: f32| {
        let products = (0..3).map(|i| (columns[i], f64::from(corner[i])));
        let all: Vec<_> = products.chain([(columns[3], 1.0), (-f64::from(side), 1.0)]).collect();
        sign_of_sum(all)
    };
    terms(bounds.min[axis]) >= 0 && terms(bounds.max[axis]) <= 0
}

/// Tests random boxes and transforms, and transforms whose terms cancel up to their last bits, against exact
/// arithmetic.
#[test]
fn transformed_boxes_contain_the_exact_image() {
    let mut rng = Random(5);
    for round in 0..20_000 {
        let exponent = rng.between(-30, 30);
        let scale = |rng: &mut Random| (rng.fine_range(1.0, 2.0) * 2f64.powi(exponent)) as f32;
        let mut columns = [(); 3].map(|()| Vec3::from_array([(); 3].map(|()| scale(&mut rng))));
        let mut min = Vec3::from_array([(); 3].map(|()| scale(&mut rng)));
        let mut size = rng.vec3(0.0, 1.0) * rng.pick(&[0.0, 1.0, 100.0]);
        let mut translation = rng.vec3(-1.0, 1.0) * rng.pick(&[0.0, 1.0, 1e4]);
        if round % 2 == 0 {
            // The first and last product cancel, up to a step; the product between is smaller by far.
            size = Vec3::ZERO;
            translation = Vec3::ZERO;
            columns[2] = -columns[0];
            min.z = if rng.one_in(2) { min.x } else { min.x.next_up() };
            columns[1] *= 2f32.powi(-rng.between(20, 40));
        }
        let order = [[0, 1, 2], [1, 0, 2], [0, 2, 1]][rng.below(3)];
        let transform = Affine3A {
            matrix3: Mat3A::from_cols(
                columns[order[0]].into(),
                columns[order[1]].into(),
                columns[order[2]].into(),
            ),
            translation: translation.into(),
        };
        let (min, size) = (order.map(|i| min[i]).into(), Vec3::from(order.map(|i| size[i])));
        let local = Aabb::new(min, min + size);
        let bounds = local.transformed(&transform);
        assert!(bounds.is_proper(), "round {round}: {bounds:?} is a box");
        for corner in local.corners() {
            for axis in 0..3 {
                assert!(
                    contains_image(&bounds, &transform, corner, axis),
                    "{round}: {local:?} {transform:?}"
                );
            }
        }
    }
}

#[test]
fn transformed_boxes_are_tight() {
    let cube = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
    assert_eq!(cube.transformed(&Affine3A::IDENTITY), cube, "the identity rounds nothing");
    let cases = [
        (cube, Affine3A::from_translation(Vec3::splat(5.0)), [4.0, 6.0]),
        (Aabb::from_arrays([1.0; 3], [2.0; 3]), Affine3A::from_scale(-Vec3::ONE), [-2.0, -1.0]),
    ];
    for (local, transform, [min, max]) in cases {
        let bounds = local.transformed(&transform);
        let off = [bounds.min - min, bounds.max - max].map(|v| v.abs().max_element());
        assert!(off.iter().all(|&x| x < 7e-6), "{bounds:?}");
        assert!(
            bounds.contains_point(Vec3::splat(min)) && bounds.contains_point(Vec3::splat(max)),
            "{bounds:?} contains the exact image from {min} to {max}"
        );
    }
}

#[test]
fn boxes_that_bound_nothing_stay_so() {
    let turn = Affine3A::from_rotation_z(0.3);
    let inverted = Aabb::from_arrays([1.0, 0.0, 0.0], [-1.0, 1.0, 1.0]);
    let nan = Aabb::new(Vec3::ZERO, Vec3::new(1.0, f32::NAN, 1.0));
    for improper in [inverted, nan, Aabb::EMPTY] {
        assert!(!improper.transformed(&turn).is_proper(), "{improper:?}");
    }
    let cube = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
    for element in 0..12 {
        for (value, is_proper) in [(f32::NAN, false), (f32::MAX, true)] {
            let mut columns = turn.to_cols_array();
            columns[element] = value;
            let bounds = cube.transformed(&columns.to_affine());
            assert_eq!(bounds.is_proper(), is_proper, "{columns:?}: {bounds:?}");
        }
    }
    let endless = Aabb::new(-Vec3::INFINITY, Vec3::INFINITY);
    assert!(
        !endless.transformed(&turn).is_finite() && !endless.transformed(&Affine3A::ZERO).is_finite(),
        "an endless box stays endless"
    );
    let large = Aabb::new(Vec3::ZERO, Vec3::MAX).transformed(&Affine3A::from_scale(Vec3::splat(4.0)));
    assert_eq!(large.max, Vec3::INFINITY, "a box that overflows ends at infinity");
}
