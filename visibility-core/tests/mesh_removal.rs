//! Tests that occluder meshes can be removed: a world that streams for long does not take more and more
//! memory, and no id names a mesh other than its own.

use std::collections::HashMap;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::occlusion::Preparation;
use visibility_core::scene::{MeshId, SceneError};
use visibility_core::{
    Aabb, FrustumCuller, Object, ObjectId, OccluderMesh, Pipeline, Pose, Scene, View, VisibleSet,
};
use visibility_testing::Random;
use visibility_testing::allocations::LIVE;

/// A part of a level that comes and goes as a whole.
struct Sector {
    objects: Vec<ObjectId>,
    meshes: Vec<MeshId>,
}

/// Loads a sector of eight walls: some share a mesh, some have a mesh of their own, one is prepared from its
/// triangles and one gets two meshes one after the other.
fn load(scene: &mut Scene, number: u32) -> Sector {
    let wall = |i: u32| {
        let min = Vec3::new((number % 97) as f32 * 10.0, i as f32 * 5.0, 0.0);
        Aabb::new(min, min + Vec3::new(8.0, 0.5, 3.0 + (number % 7) as f32))
    };
    let objects: Vec<_> = (0..8).map(|i| Object { occluder: true, ..Object::new(wall(i)) }).collect();
    let objects = scene.insert_batch(objects);
    let mut add = |bounds: Aabb| scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
    let shared = add(Aabb::new(Vec3::ZERO, wall(0).max - wall(0).min));
    let mut meshes = vec![shared];
    meshes.extend((4..7).map(|i| add(wall(i))));
    for (&id, i) in objects[..4].iter().zip(0..) {
        scene.set_mesh(id, shared, Affine3A::from_translation(wall(i).min)).unwrap();
    }
    for (&id, &own) in objects[4..7].iter().zip(&meshes[1..]) {
        scene.set_mesh(id, own, Affine3A::IDENTITY).unwrap();
    }
    scene.set_mesh(objects[4], shared, Affine3A::from_translation(wall(4).min)).unwrap();
    let corners = wall(7).corners();
    let triangles: Vec<_> =
        OccluderMesh::CUBOID.iter().map(|of| of.map(|corner| corners[corner as usize])).collect();
    scene.set_triangles(objects[7], triangles).unwrap();
    scene.prepare_occluders(&Preparation::default());
    assert!(objects.iter().all(|&id| scene.occluder(id).is_some()), "a wall of sector {number} has no mesh");
    Sector { objects, meshes }
}

/// Unloads a sector, in one of three orders.
fn unload(scene: &mut Scene, sector: &Sector, order: u32) {
    let drop_meshes =
        |scene: &mut Scene| sector.meshes.iter().for_each(|&mesh| scene.remove_mesh(mesh).unwrap());
    match order % 3 {
        0 => {
            drop_meshes(scene);
            scene.remove_batch(&sector.objects).unwrap();
        }
        1 => {
            scene.remove_batch(&sector.objects).unwrap();
            drop_meshes(scene);
        }
        _ => {
            // A change of the bounds takes the mesh from an object.
            for &id in &sector.objects[2..] {
                scene.set_bounds(id, Aabb::from_arrays([0.0; 3], [1.0; 3])).unwrap();
            }
            drop_meshes(scene);
            sector.objects.iter().for_each(|&id| scene.remove(id).unwrap());
        }
    }
    for &mesh in &sector.meshes {
        assert_eq!(scene.remove_mesh(mesh), Err(SceneError::UnknownMesh(mesh)), "a mesh removed twice");
    }
}

/// Streams sectors, eight at a time, with a camera that culls, for `steps` steps. Asserts that neither the
/// number of meshes and of their indices nor the bytes of scene, pipeline and result grow after the start.
fn stream(steps: u32) {
    let mut scene = Scene::new();
    let (mut pipeline, mut visible) = (Pipeline::new().with(FrustumCuller::new()), VisibleSet::new());
    let mut sectors: Vec<Sector> = Vec::new();
    let before = LIVE.get();
    let (mut greatest, mut seen) = (0, 0);
    for step in 0..steps {
        if step >= 8 {
            unload(&mut scene, &sectors.remove(step as usize * 5 % 8), step);
        }
        sectors.push(load(&mut scene, step));
        scene.maintain(16);
        let eye = DVec3::new((step % 97) as f64 * 10.0 - 40.0, 20.0, 2.0);
        let view = View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.5, 1.5, 0.1, 500.0);
        seen += pipeline.cull(&scene, &view.unwrap(), &mut visible).visible;
        let live = LIVE.get() - before;
        if step < 1000 {
            greatest = live.max(greatest);
        } else {
            assert!(live <= greatest + greatest / 8, "{live} bytes in step {step}, {greatest} at first");
        }
        if step >= 8 {
            // Each of the eight sectors has four meshes that were added and one that was prepared.
            assert_eq!(scene.mesh_count(), 8 * 5, "step {step}");
        }
        let of_sector = &sectors[sectors.len() - 1].meshes;
        assert!(of_sector.iter().all(|mesh| (mesh.to_bits() as u32) < 9 * 5), "step {step}");
        assert!(
            scene.index_limit() <= 9 * 8,
            "step {step}: index limit {}, at most 9 sectors of 8 objects",
            scene.index_limit()
        );
    }
    assert!(seen > u64::from(steps), "{seen}");
}

#[test]
fn a_world_that_streams_for_ten_thousand_steps_does_not_grow() {
    stream(10_000);
}

#[test]
#[ignore = "an hour of streaming: takes a minute"]
fn a_world_that_streams_for_a_million_steps_does_not_grow() {
    stream(1_000_000);
}

/// Tests under random calls that mesh ids, user counts and the mesh of each object agree with a simple model.
#[test]
fn an_id_names_its_own_mesh_or_none() {
    let mut random = Random(3);
    let bounds = Aabb::from_arrays([0.0; 3], [9.0; 3]);
    let (mut reused, mut kept) = (0, 0);
    for _ in 0..40 {
        let mut scene = Scene::new();
        let mut objects: Vec<(ObjectId, Option<MeshId>)> = Vec::new();
        // Every mesh that ever was, with its size, and whether its id still names it.
        let mut meshes: HashMap<MeshId, (f32, bool)> = HashMap::new();
        let mut ids: Vec<MeshId> = Vec::new();
        for step in 0..300 {
            let at = random.below(objects.len() + 1);
            match random.below(8) {
                0 => {
                    let object = Object { occluder: true, ..Object::new(bounds) };
                    objects.push((scene.insert(object), None));
                }
                1 | 2 => {
                    let size = 1.0 + step as f32 / 64.0;
                    let cube = Aabb::from_arrays([1.0; 3], [1.0 + size; 3]);
                    let id = scene.add_mesh(OccluderMesh::cuboid(&cube).unwrap());
                    assert_eq!(MeshId::from_bits(id.to_bits()), id, "an id from its bits");
                    reused += usize::from(ids.iter().any(|old| old.to_bits() as u32 == id.to_bits() as u32));
                    assert!(meshes.insert(id, (size, true)).is_none(), "an id of another mesh");
                    ids.push(id);
                }
                3 | 4 if at < objects.len() && !ids.is_empty() => {
                    let mesh = random.pick(&ids);
                    let set = scene.set_mesh(objects[at].0, mesh, Affine3A::IDENTITY);
                    if meshes[&mesh].1 {
                        assert_eq!(set, Ok(()), "{mesh:?} is in the scene");
                        objects[at].1 = Some(mesh);
                    } else {
                        assert_eq!(set, Err(SceneError::UnknownMesh(mesh)), "{mesh:?} was removed");
                    }
                }
                5 if !ids.is_empty() => {
                    let mesh = random.pick(&ids);
                    let is_known = &mut meshes.get_mut(&mesh).unwrap().1;
                    assert_eq!(scene.remove_mesh(mesh).is_ok(), *is_known, "{mesh:?} can be removed once");
                    *is_known = false;
                }
                6 if at < objects.len() => {
                    if random.one_in(2) {
                        scene.remove(objects.swap_remove(at).0).unwrap();
                    } else {
                        // New bounds take the mesh away from the object.
                        let (id, mesh) = &mut objects[at];
                        scene.set_bounds(*id, Aabb::from_arrays([0.0; 3], [8.0; 3])).unwrap();
                        scene.set_bounds(*id, bounds).unwrap();
                        *mesh = None;
                    }
                }
                7 if random.one_in(8) => {
                    // A clone of the scene has meshes under the same ids. No other scene knows the ids of the
                    // original.
                    let (copy, mut other) = (scene.clone(), Scene::new());
                    assert!(
                        ids.iter().all(|&id| other.remove_mesh(id).is_err()),
                        "a mesh is removed by an id of another scene"
                    );
                    scene = copy;
                }
                _ => {}
            }
            for &(id, mesh) in &objects {
                let size = scene.occluder(id).map(|(mesh, _)| mesh.bounds().max.x - 1.0);
                assert_eq!(
                    size,
                    mesh.map(|mesh| meshes[&mesh].0),
                    "step {step}: the size of the mesh of {id}"
                );
            }
            let users = |id: MeshId| objects.iter().filter(|(_, mesh)| *mesh == Some(id)).count();
            let mut count = 0;
            for (&id, &(_, is_known)) in &meshes {
                let expected = if is_known { Ok(users(id)) } else { Err(SceneError::UnknownMesh(id)) };
                assert_eq!(scene.mesh_users(id), expected, "step {step}: objects with {id:?}");
                count += usize::from(is_known || users(id) > 0);
                kept += usize::from(!is_known && users(id) > 0);
            }
            assert_eq!(scene.mesh_count(), count, "step {step}: meshes that are known or in use");
        }
    }
    assert!(reused > 100 && kept > 100, "too easy: {reused}, {kept}");
}
