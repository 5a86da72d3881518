//! Tests that an occluder mesh outside the bounds of its object hides nothing, and that a mesh within them is
//! used, however both were computed.

use visibility_core::glam::{Affine3A, DAffine3, DQuat, DVec3, EulerRot, Quat, Vec3};
use visibility_core::{
    Aabb, FrustumCuller, Object, ObjectId, OccluderMesh, OcclusionCuller, Pipeline, Pose, Scene, View,
    VisibleSet,
    occlusion::Preparation,
    scene::{SceneError, SharedTriangles},
};
use visibility_testing::{PlainMap, Random};

/// Box of the house's mesh, in mesh coordinates.
const LOCAL: Aabb = Aabb::from_arrays([0.0; 3], [8.0, 8.0, 10.0]);
const HOUSE: Aabb = Aabb::from_arrays([40.0, 0.0, 0.0], [48.0, 8.0, 10.0]);
const CAR: Aabb = Aabb::from_arrays([20.0, 3.0, 0.0], [24.0, 5.0, 1.5]);

/// Returns a scene with a house that has no mesh yet, and a car before it.
fn street() -> (Scene, [ObjectId; 2]) {
    let mut scene = Scene::new();
    let house = scene.insert(Object { occluder: true, ..Object::new(HOUSE) });
    let car = scene.insert(CAR);
    (scene, [house, car])
}

/// Returns which of the given objects a pipeline shows, and the lacks that the pipeline reports.
fn shown(scene: &Scene, ids: [ObjectId; 2]) -> ([bool; 2], Vec<String>) {
    let pose = Pose::look_at(DVec3::new(-10.0, 4.0, 1.7), DVec3::new(40.0, 4.0, 1.7), DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.6, 0.1, f64::INFINITY).unwrap();
    let mut pipeline =
        Pipeline::new().with(FrustumCuller::new()).with(OcclusionCuller::new(PlainMap::new(96, 60)));
    let mut visible = VisibleSet::new();
    pipeline.cull(scene, &view, &mut visible);
    let mut lacks = Vec::new();
    pipeline.for_each_lack(scene, |_, lack| lacks.push(lack.to_string()));
    (ids.map(|id| visible.contains(scene, id)), lacks)
}

#[test]
fn a_mesh_whose_transform_was_forgotten_hides_nothing() {
    let (mut scene, ids) = street();
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&LOCAL).unwrap());
    scene.set_mesh(ids[0], mesh, Affine3A::IDENTITY).unwrap();
    let lack = "occluders with a mesh outside their bounds: 1".to_string();
    assert_eq!(
        shown(&scene, ids),
        ([true; 2], vec![lack]),
        "both objects are visible, and the mesh is reported"
    );
    assert_eq!(scene.clone().occluders_outside_bounds(), 1, "occluders outside their bounds in a clone");
    assert!(
        scene.has_mesh(ids[0]) && scene.occluder(ids[0]).is_none(),
        "the mesh is kept but does not count"
    );
    scene.set_occluder(ids[0], false).unwrap();
    assert_eq!(
        scene.occluders_outside_bounds(),
        0,
        "an object without the flag of an occluder is not counted"
    );
    scene.set_occluder(ids[0], true).unwrap();
    assert_eq!(
        (scene.occluders_outside_bounds(), scene.occluders_without_mesh()),
        (1, 0),
        "meshes outside, and missing, with the flag again"
    );
    scene.set_mesh(ids[0], mesh, Affine3A::from_translation(HOUSE.min)).unwrap();
    assert_eq!(shown(&scene, ids), ([true; 2], vec![]), "a mesh in its place is not reported");
    // 200 objects behind the house, since hiding a single one would not be worth drawing the occluder.
    let behind = scene.insert_batch([Aabb::from_arrays([60.0, 3.0, 4.0], [61.0, 5.0, 6.0]); 200]);
    assert_eq!(shown(&scene, [ids[0], behind[0]]).0, [true, false], "the house hides what is behind it");
    scene.set_mesh(ids[0], mesh, Affine3A::IDENTITY).unwrap();
    scene.set_bounds(ids[0], CAR).unwrap();
    assert_eq!(
        (scene.occluders_outside_bounds(), scene.occluders_without_mesh()),
        (0, 1),
        "other bounds take the mesh away"
    );
    scene.set_mesh(ids[0], mesh, Affine3A::IDENTITY).unwrap();
    scene.remove(ids[0]).unwrap();
    assert_eq!(
        (scene.occluders_outside_bounds(), scene.occluders_without_mesh()),
        (0, 0),
        "counts after the object is removed"
    );
}

/// With local bounds, mesh and bounds are compared in local coordinates, since a transform moves both. They
/// may be set in either order.
#[test]
fn a_mesh_outside_local_bounds_hides_nothing_until_they_hold_it() {
    let far = Affine3A::from_rotation_translation(Quat::from_rotation_z(0.5), Vec3::new(40.0, 0.0, 0.0));
    let (mut scene, [house, _]) = street();
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&LOCAL).unwrap());
    scene.set_mesh(house, mesh, far).unwrap();
    assert_eq!(scene.occluders_outside_bounds(), 1, "the turned mesh reaches out of the bounds");
    scene.set_local_bounds(house, LOCAL).unwrap();
    assert!(scene.occluder(house).is_some(), "the bounds follow from the mesh's own box");
    scene.set_transforms_batch(&[(house, Affine3A::IDENTITY)]).unwrap();
    assert!(scene.occluder(house).is_some(), "a transform of mesh and bounds keeps the occluder");
    // New local bounds take the mesh away. A mesh that reaches out of the local bounds hides nothing.
    scene.set_local_bounds(house, Aabb::new(LOCAL.min, LOCAL.max - 1.0)).unwrap();
    assert_eq!(
        (scene.occluders_outside_bounds(), scene.occluders_without_mesh()),
        (0, 1),
        "other local bounds take the mesh away"
    );
    scene.set_mesh(house, mesh, far).unwrap();
    assert_eq!(
        (scene.occluders_outside_bounds(), scene.occluders_without_mesh()),
        (1, 0),
        "a mesh larger than the local bounds"
    );
    scene.set_local_bounds(house, Aabb::new(Vec3::NAN, Vec3::NAN)).unwrap();
    scene.set_mesh(house, mesh, far).unwrap();
    assert!(scene.occluder(house).is_none(), "a box that bounds nothing holds no mesh");
    let outside = scene.occluders_outside_bounds();
    let everywhere = Aabb::new(Vec3::NEG_INFINITY, Vec3::INFINITY);
    let sky = scene.insert(Object { occluder: true, ..Object::new(everywhere) });
    scene.set_mesh(sky, mesh, far).unwrap();
    assert_eq!(scene.occluders_outside_bounds(), outside, "infinite bounds hold any mesh");
    assert!(scene.occluder(sky).is_none(), "an object with infinite bounds may be anywhere");
    scene.set_bounds(house, HOUSE).unwrap();
    scene.set_mesh(house, mesh, Affine3A::from_translation(HOUSE.min)).unwrap();
    for never_cull in [false, true, false] {
        scene.set_never_cull(house, never_cull).unwrap();
        assert_eq!(
            scene.occluder(house).is_none(),
            never_cull,
            "an object that is never culled hides nothing"
        );
    }
}

/// Triangles given without their transform, outside the object's bounds, are refused before a mesh is made
/// from them.
#[test]
fn triangles_outside_the_bounds_are_refused() {
    let (mut scene, ids) = street();
    let corners = LOCAL.corners();
    let triangles = |by: Vec3| OccluderMesh::CUBOID.map(|t| t.map(|i| corners[i as usize] + by));
    scene.set_triangles(ids[0], triangles(HOUSE.min)).unwrap();
    assert_eq!(scene.prepare_occluders(&Preparation::default()), 1, "occluders prepared");
    assert!(
        scene.occluder(ids[0]).is_some() && scene.occluders_outside_bounds() == 0,
        "the prepared mesh is within the bounds"
    );
    let error = scene.set_triangles(ids[0], triangles(Vec3::ZERO)).unwrap_err();
    assert_eq!(error, SceneError::Triangles(ids[0]), "triangles outside the bounds");
    let infinite = [[HOUSE.min, HOUSE.max, Vec3::new(f32::INFINITY, 1.0, 1.0)]];
    assert_eq!(
        scene.set_triangles(ids[0], infinite),
        Err(SceneError::Triangles(ids[0])),
        "a triangle that has no end, within bounds that have one"
    );
    assert!(scene.occluder(ids[0]).is_some(), "a failed call changes nothing");
    assert_eq!(
        scene.triangles(ids[0]).unwrap(),
        triangles(HOUSE.min)[..].into(),
        "the triangles that were set before"
    );
    // Rounding of the box and of the corners is tolerated; a distance of 16 times as much is refused.
    for axis in Vec3::AXES {
        for (sign, side) in [(-1.0f32, HOUSE.min), (1.0, HOUSE.max)] {
            if side.dot(axis) == 0.0 {
                continue;
            }
            let at = |by: f32| side + axis * sign * (side.dot(axis) * f32::EPSILON * by);
            let mut set = |by: f32| scene.set_triangles(ids[0], [[side, at(by), side]]);
            assert_eq!(set(2.0), Ok(()), "{axis} {sign}");
            assert_eq!(set(128.0), Err(SceneError::Triangles(ids[0])), "{axis} {sign}");
        }
    }
    scene.set_triangles(ids[0], [[Vec3::NAN; 3]]).unwrap();
    let unknown = scene.insert(Aabb::new(Vec3::NAN, Vec3::NAN));
    scene.set_triangles(unknown, triangles(Vec3::ZERO)).unwrap();
    assert_eq!(
        scene.prepare_occluders(&Preparation::default()),
        0,
        "occluders prepared of an object without the flag"
    );
    scene.set_occluder(unknown, true).unwrap();
    assert_eq!(
        scene.prepare_occluders(&Preparation::default()),
        1,
        "occluders prepared of an object with bounds of NaN"
    );
    assert!(scene.occluder(unknown).is_none(), "a box that bounds nothing holds no mesh");
}

/// Bounds computed in `f64` and rounded to nearest, or as middle plus half extent, contain their mesh. The
/// same bounds, moved or shrunk by some times the rounding error, do not.
#[test]
fn bounds_computed_to_the_nearest_hold_their_mesh_and_others_do_not() {
    let mut random = Random(38);
    let (mut rounded, mut decided) = (0, 0);
    for _ in 0..4000 {
        let scale = 10f64.powf(random.range(-3.0, 5.0));
        let offset = scale * 10f64.powf(random.range(-1.0, 2.0));
        let at = |by: f64, random: &mut Random| random.fine_vector(by).as_vec3();
        let (center, local) = (at(offset, &mut random), at(offset, &mut random));
        let points: Vec<Vec3> = (0..8).map(|_| local + at(scale, &mut random)).collect();
        let all: Vec<[u32; 3]> = (0..6).map(|i| [i, i + 1, i + 2]).collect();
        let Ok(mesh) = OccluderMesh::from_indexed(&points, &all) else { continue };
        let [a, b, c] = [0; 3].map(|_| random.fine_range(-3.0, 3.0));
        let turn = DQuat::from_euler(EulerRot::XYZ, a, b, c);
        let transform = Affine3A::from_rotation_translation(turn.as_quat(), center);
        let exact = DAffine3::from_cols_array(&transform.to_cols_array().map(f64::from));
        let images = mesh.positions().iter().map(|p| exact.transform_point3(p.as_dvec3()));
        let (min, max) =
            images.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), p| (min.min(p), max.max(p)));
        let nearest = Aabb::new(min.as_vec3(), max.as_vec3());
        let (middle, half) = ((nearest.min + nearest.max) * 0.5, (nearest.max - nearest.min) * 0.5);
        let halved = Aabb::new(middle - half, middle + half);
        let mut scene = Scene::new();
        let mesh_id = scene.add_mesh(mesh.clone());
        let mut is_used = |bounds: Aabb| {
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            scene.set_mesh(id, mesh_id, transform).unwrap();
            let is_used = scene.occluder(id).is_some();
            let tested = scene.bounds(id).unwrap();
            let holds = tested.min.as_dvec3().cmple(min).all() && max.cmple(tested.max.as_dvec3()).all();
            assert!(!is_used || holds, "{tested:?} does not hold {min} to {max}");
            // Whatever is tested, the object is the one that was given, and is not moved by its own bounds.
            assert_eq!(scene.object(id).unwrap().bounds, bounds, "the bounds that were given");
            scene.set_bounds(id, bounds).unwrap();
            scene.set_bounds_batch(&[(id, bounds)]).unwrap();
            assert!(scene.has_mesh(id) && scene.bounds(id) == Ok(tested), "the same bounds keep the mesh");
            is_used
        };
        assert!(is_used(nearest) && is_used(halved), "{nearest:?}: {transform:?}");
        let f32_image = Aabb::from_points(mesh.positions().iter().map(|&p| transform.transform_point3(p)));
        rounded += usize::from(f32_image != nearest && nearest.union(&f32_image) != nearest);
        // Distance of 16 error bounds, each of 16 roundings of the summed magnitudes.
        let reach = mesh.bounds().min.abs().max(mesh.bounds().max.abs()).as_dvec3().element_sum();
        let clear = (reach + max.abs().max(min.abs()).max_element() + center.as_dvec3().abs().max_element())
            * (16.0 * 16.0 * f64::from(f32::EPSILON) * 0.5);
        let axis = Vec3::AXES[random.below(3)];
        let by = axis * clear as f32;
        assert!(!is_used(Aabb::new(nearest.min + by, nearest.max)), "{nearest:?}: {transform:?}");
        assert!(!is_used(Aabb::new(nearest.min, nearest.max - by)), "{nearest:?}: {transform:?}");
        decided += 1;
    }
    assert!(rounded > 1000 && decided > 3900, "{rounded} {decided}");
}

/// Returns a mesh of two random triangles, and its box computed as middle plus half extent, out of which the
/// mesh reaches by roundings now and then.
fn mesh_and_rounded_box(random: &mut Random, size: f64) -> Option<(OccluderMesh, Aabb)> {
    let points: Vec<Vec3> = (0..6).map(|_| random.fine_vector(size).as_vec3()).collect();
    let mesh = OccluderMesh::from_indexed(&points, &[[0, 1, 2], [3, 4, 5]]).ok()?;
    let Aabb { min, max } = *mesh.bounds();
    let (middle, half) = ((min + max) * 0.5, (max - min) * 0.5);
    Some((mesh, Aabb::new(middle - half, middle + half)))
}

/// A mesh that reaches out of a local box by roundings: the local box is enlarged, and given again it changes
/// nothing. A mesh that moves by small steps does not enlarge bounds ever further.
#[test]
fn a_local_box_is_enlarged_to_hold_its_mesh_and_stays_the_one_that_was_given() {
    let mut random = Random(39);
    let mut enlarged = 0;
    for _ in 0..400 {
        let Some((mesh, local)) = mesh_and_rounded_box(&mut random, 9.0) else { continue };
        let held = *mesh.bounds();
        let mut scene = Scene::new();
        let mesh = scene.add_mesh(mesh);
        let id = scene.insert(Object { occluder: true, ..Object::new(local) });
        let at = Affine3A::from_translation(random.fine_vector(99.0).as_vec3());
        scene.set_local_bounds(id, local).unwrap();
        scene.set_mesh(id, mesh, at).unwrap();
        let [bounds, given] = [scene.bounds(id).unwrap(), local.transformed(&at)];
        assert_eq!(bounds, local.union(&held).transformed(&at), "the bounds that cullers test");
        assert_eq!(scene.object(id).unwrap().bounds, given, "the bounds that follow from the given box");
        enlarged += usize::from(local.union(&held) != local);
        // The same again, in each way in which an engine may say so in every frame.
        scene.set_local_bounds(id, local).unwrap();
        scene.set_transform(id, at).unwrap();
        scene.set_transforms_batch(&[(id, at)]).unwrap();
        assert!(scene.occluder(id).is_some() && scene.bounds(id) == Ok(bounds), "nothing has changed");
        let other = Affine3A::from_translation(Vec3::X);
        scene.set_transform(id, other).unwrap();
        assert_eq!(scene.bounds(id), Ok(local.union(&held).transformed(&other)), "the bounds move along");
        scene.set_bounds(id, given).unwrap();
        assert!(!scene.has_mesh(id) && scene.bounds(id) == Ok(given), "bounds elsewhere take the mesh away");
        scene.set_local_bounds(id, local).unwrap();
        assert_eq!(scene.bounds(id), Ok(local), "a local box without the former mesh");
    }
    assert!(enlarged > 50, "{enlarged} boxes enlarged: too few");

    let (mut scene, [house, _]) = street();
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&HOUSE).unwrap());
    let (mut steps, step) = (0, 100.0 * f32::EPSILON);
    while steps < 100
        && scene.set_mesh(house, mesh, Affine3A::from_translation(Vec3::X * step * steps as f32)) == Ok(())
        && scene.occluder(house).is_some()
    {
        steps += 1;
    }
    assert!((2..20).contains(&steps), "{steps} steps of two roundings each leave the bounds");
}

/// Triangles that reach out of the bounds of their object by roundings, and the mesh that is prepared from
/// them, with a local box beside them and without.
#[test]
fn bounds_hold_triangles_and_the_mesh_prepared_from_them() {
    let mut random = Random(40);
    let mut enlarged = 0;
    for trial in 0..600 {
        let corner = |random: &mut Random| random.fine_vector(20.0).as_vec3();
        let mesh: Vec<[Vec3; 3]> = (0..4).map(|_| [(); 3].map(|()| corner(&mut random))).collect();
        let at = random.fine_vector(8000.0);
        let turn = DQuat::from_rotation_z(random.fine_range(-3.0, 3.0));
        let mut triangles = SharedTriangles::from(&mesh[..]);
        if trial % 2 == 0 {
            triangles = triangles.placed(DAffine3::from_rotation_translation(turn, at));
        }
        let bounds = triangles.bounds();
        let (middle, half) = ((bounds.min + bounds.max) * 0.5, (bounds.max - bounds.min) * 0.5);
        let given = if trial % 3 == 0 { bounds } else { Aabb::new(middle - half, middle + half) };
        let mut scene = Scene::new();
        let id = scene.insert(Object { occluder: true, ..Object::new(given) });
        if trial % 4 == 1 {
            scene.set_local_bounds(id, given).unwrap();
        }
        scene.set_triangles(id, triangles.clone()).unwrap();
        scene.prepare_occluders(&Preparation::default().with_sliver(0.0));
        let tested = scene.bounds(id).unwrap();
        assert!(tested.union(&bounds) == tested, "trial {trial}: {tested:?} does not hold {bounds:?}");
        if let Some((mesh, transform)) = scene.occluder(id) {
            let exact = DAffine3::from_cols_array(&transform.to_cols_array().map(f64::from));
            for p in mesh.positions() {
                let p = exact.transform_point3(p.as_dvec3());
                let holds = tested.min.as_dvec3().cmple(p).all() && p.cmple(tested.max.as_dvec3()).all();
                assert!(holds, "trial {trial}: {tested:?} does not hold {p}");
            }
        }
        enlarged += usize::from(tested != given);
        assert_eq!(scene.object(id).unwrap().bounds, given, "trial {trial}: the bounds that were given");
        let is_used = scene.occluder(id).is_some();
        if trial % 4 == 1 {
            scene.set_local_bounds(id, given).unwrap();
            scene.set_transform(id, Affine3A::IDENTITY).unwrap();
            scene.set_transforms_batch(&[(id, Affine3A::IDENTITY)]).unwrap();
        } else {
            scene.set_bounds(id, given).unwrap();
        }
        assert_eq!(scene.triangles(id).unwrap(), triangles.view(), "trial {trial}: triangles stay");
        assert_eq!(
            (scene.occluder(id).is_some(), scene.bounds(id)),
            (is_used, Ok(tested)),
            "trial {trial}: the mesh and the tested box stay"
        );
        assert!(is_used, "trial {trial}: the mesh is within the bounds");
    }
    assert!(enlarged > 200, "{enlarged} boxes enlarged: too few");
}

/// A child that was exactly as large as its HLOD parent, and is enlarged by roundings to hold its mesh, is
/// still replaced by the parent: else both would be drawn at some distances, and neither at others.
#[test]
fn a_child_that_is_enlarged_keeps_its_hlod_parent() {
    let mut random = Random(42);
    let mut enlarged = 0;
    for _ in 0..400 {
        let Some((mesh, given)) = mesh_and_rounded_box(&mut random, 99.0) else { continue };
        let mut scene = Scene::new();
        let [parent, child] = [0; 2].map(|_| scene.insert(Object { occluder: true, ..Object::new(given) }));
        scene.set_hlod_parent(child, Some(parent)).unwrap();
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(child, mesh, Affine3A::IDENTITY).unwrap();
        enlarged += usize::from(scene.bounds(child) != Ok(given));
        assert_eq!(scene.stand_in(child), Some((parent, given)), "the child in {:?}", scene.bounds(child));
    }
    assert!(enlarged > 50, "{enlarged} children enlarged: too few");
}

/// A triangle with a NaN corner, beside triangles that reach out of the bounds by roundings.
#[test]
fn bounds_hold_the_finite_triangles_beside_others() {
    let x = 99_999.85;
    let [a, b, c] = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]].map(|[y, z]| Vec3::new(x, y, z));
    let triangles = SharedTriangles::from([[a, b, c], [Vec3::NAN; 3]]);
    let moved = triangles.placed(DAffine3::from_translation(DVec3::Y));
    for triangles in [triangles, moved] {
        let mut scene = Scene::new();
        let id = scene.insert(Aabb::from_arrays([1e5, 0.0, 0.0], [100_001.0, 5.0, 4.0]));
        scene.set_triangles(id, triangles.clone()).unwrap();
        assert_eq!(scene.bounds(id).unwrap().min.x, x, "{triangles:?}");
    }
}
