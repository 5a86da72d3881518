//! An object is not hidden behind its own occluder mesh, which may reach out of the object's box by roundings
//! of its position.

use visibility_core::glam::{Affine3A, DAffine3, DVec3, Vec3};
use visibility_core::occlusion::Preparation;
use visibility_core::scene::SharedTriangles;
use visibility_core::{
    Aabb, FrustumCuller, Object, ObjectId, OccluderMesh, OcclusionCuller, Pipeline, Pose, Scene, View,
    VisibleSet,
};
use visibility_hzb::Hzb;
use visibility_testing::Random;

/// A wall of which only the front, at x = `front` before it is placed, is in view.
fn wall(front: f32) -> Aabb {
    Aabb::from_arrays([front - 0.3, -20.0, -20.0], [front, 20.0, 20.0])
}

/// Asserts that the only object in view is visible from `distance` metres before its front.
fn assert_visible(scene: &Scene, id: ObjectId, at: DVec3, distance: f64, case: &str) {
    let pose = Pose::look_at(at + DVec3::X * distance, at, DVec3::Z);
    let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.01, f64::INFINITY).unwrap();
    let mut pipeline = Pipeline::new()
        .with(FrustumCuller::new())
        .with(OcclusionCuller::new(Hzb::new(512, 288).unwrap()).with_price(1_000_000));
    let mut visible = VisibleSet::new();
    for _ in 0..2 {
        pipeline.cull(scene, &view, &mut visible);
        assert!(visible.contains(scene, id), "{case}: {at}, {distance} m before it");
    }
}

#[test]
fn a_wall_far_from_the_origin_is_not_hidden_behind_itself() {
    let mut random = Random(41);
    for trial in 0..600 {
        let front = if trial == 0 { 0.00048 } else { random.range(-0.01, 0.01) as f32 };
        let reach = 10f64.powf(random.range(1.0, 4.0));
        let at = if trial == 0 { DVec3::X * 8192.0 } else { random.fine_vector(reach) };
        let distance = if trial == 0 { 5.0 } else { 10f64.powf(random.range(-1.5, 1.0)) };
        let looked_at = at + DVec3::X * f64::from(front);
        let mut scene = Scene::new();
        // Instances of triangles, placed, with the mesh that is prepared from them.
        let corners = wall(front).corners();
        let triangles = SharedTriangles::from(OccluderMesh::CUBOID.map(|t| t.map(|i| corners[i as usize])));
        let triangles = triangles.placed(DAffine3::from_translation(at));
        let id = scene.insert(Object { occluder: true, ..Object::new(triangles.bounds()) });
        scene.set_triangles(id, triangles).unwrap();
        assert_eq!(scene.prepare_occluders(&Preparation::default()), 1, "the wall's mesh");
        assert_visible(&scene, id, looked_at, distance, "a prepared mesh");
        // A mesh that is set, in a box computed to the nearest.
        let transform = Affine3A::from_translation(at.as_vec3());
        let rounded = |p: Vec3| (p.as_dvec3() + at.as_vec3().as_dvec3()).as_vec3();
        let bounds = Aabb::new(rounded(wall(front).min), rounded(wall(front).max));
        let mut scene = Scene::new();
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&wall(front)).unwrap());
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_mesh(id, mesh, transform).unwrap();
        assert!(scene.occluder(id).is_some(), "the mesh is within the bounds");
        assert_visible(&scene, id, looked_at, distance, "a mesh in its box");
    }
}
