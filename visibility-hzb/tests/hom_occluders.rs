//! Tests of the occluders that the database accepts.

use visibility_core::glam::{Affine3A, Vec3};
use visibility_core::{Aabb, Object, ObjectId, OccluderMesh, Scene, scene::Triangle};
use visibility_hzb::{OccluderCriteria, OccluderDatabase};

/// Inserts an occluder with the given mesh in scene coordinates. Returns its id.
fn add(scene: &mut Scene, mesh: OccluderMesh) -> ObjectId {
    let id = scene.insert(Object { occluder: true, ..Object::new(*mesh.bounds()) });
    let mesh = scene.add_mesh(mesh);
    scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
    id
}

/// Inserts a box occluder from corner `low` to corner `high`, in metres. Returns its id.
fn add_box(scene: &mut Scene, low: [f32; 3], high: [f32; 3]) -> ObjectId {
    add(scene, OccluderMesh::cuboid(&Aabb::from_arrays(low, high)).unwrap())
}

#[test]
fn what_is_small_complex_or_backed_by_a_wall_is_left_out() {
    let mut scene = Scene::new();
    let wall = add_box(&mut scene, [0.0, 0.0, 0.0], [8.0, 0.2, 3.0]);
    let clock = add_box(&mut scene, [4.0, 0.2, 2.0], [4.4, 0.24, 2.4]);
    // As flat as the clock, but with no wall near.
    let sign = add_box(&mut scene, [4.0, 2.0, 2.0], [4.4, 2.04, 2.4]);
    let crate_on_the_floor = add_box(&mut scene, [2.0, 3.0, 0.0], [3.0, 4.0, 1.0]);
    let pole = add_box(&mut scene, [6.0, 5.0, 0.0], [6.01, 5.01, 3.0]);
    let cup = add_box(&mut scene, [2.1, 3.1, 1.0], [2.2, 3.2, 1.1]);
    // A square of 2 x 40 x 40 triangles.
    let at = |i: u32, j: u32| Vec3::new(i as f32 * 0.1, 9.0, j as f32 * 0.1);
    let fine: Vec<Triangle> = (0..1600)
        .map(|i| (i % 40, i / 40))
        .flat_map(|(i, j)| {
            [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
        })
        .collect();
    let curtain = add(&mut scene, OccluderMesh::from_triangles(&fine).unwrap());
    let not_flagged = add_box(&mut scene, [20.0; 3], [30.0; 3]);
    scene.set_occluder(not_flagged, false).unwrap();

    let database = OccluderDatabase::new(&scene, &OccluderCriteria::default());
    assert_eq!(database.occluders(), [wall, sign, crate_on_the_floor], "occluders chosen, by id");
    assert_eq!(
        (database.small(), database.complex(), database.redundant()),
        (2, 1, 1),
        "occluders that are small, complex, and backed by a wall"
    );
    database.apply(&mut scene).unwrap();
    let flagged = |id: ObjectId| scene.object(id).unwrap().occluder;
    assert!(
        [clock, pole, cup, curtain, not_flagged].into_iter().all(|id| !flagged(id)),
        "an object that was left out is still an occluder"
    );
    assert!(
        [wall, sign, crate_on_the_floor].into_iter().all(flagged),
        "an object that was chosen is no occluder"
    );

    let all = OccluderCriteria { min_size: 0.0, max_triangles: usize::MAX, redundancy: 1.1 };
    scene.set_occluder(clock, true).unwrap();
    assert_eq!(
        OccluderDatabase::new(&scene, &all).occluders().len(),
        4,
        "a size of 0 and any count of triangles: the flagged objects"
    );
    scene.remove(clock).unwrap();
    assert!(
        OccluderDatabase::new(&Scene::new(), &all).occluders().is_empty(),
        "an empty scene has no occluders"
    );
}

#[test]
fn of_many_in_one_place_the_largest_stays() {
    let mut scene = Scene::new();
    for i in 0..3000 {
        let half = 5.0 + (i % 977) as f32 * 1e-3;
        add_box(&mut scene, [-half; 3], [half; 3]);
    }
    let database = OccluderDatabase::new(&scene, &OccluderCriteria::default());
    assert_eq!(
        (database.occluders().len(), database.redundant()),
        (1, 2999),
        "occluders chosen, and redundant ones, of 3000 in one place"
    );
    let size = |id: &ObjectId| scene.bounds(*id).unwrap().max.x;
    assert_eq!(size(&database.occluders()[0]), 5.976, "half the side of the chosen one in metres");
}
