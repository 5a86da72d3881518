//! Houses and towers that a person in the street sees, found by a horizon culler.
//!
//! `cargo run -p visibility-2d --example horizon`

use std::error::Error;
use visibility_2d::horizon::{HorizonCuller, HorizonOccluders, UpAxis};
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{Aabb, FrustumCuller, Object, OccluderMesh, Pipeline, Pose, Scene, View, VisibleSet};

fn main() -> Result<(), Box<dyn Error>> {
    // Forty rows of houses, a lamp before each, and every ninetieth house a tower.
    let mut scene = Scene::new();
    let mut towers = Vec::new();
    for number in 0..1600 {
        let corner = Vec3::new((number % 40) as f32 * 12.0, (number / 40) as f32 * 20.0, 0.0);
        let height = if number % 90 == 0 { 60.0 } else { 7.0 + (number % 5) as f32 };
        let house = Aabb::new(corner, corner + Vec3::new(11.0, 10.0, height));
        let id = scene.insert(Object { occluder: true, ..Object::new(house) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&house)?);
        scene.set_mesh(id, mesh, Affine3A::IDENTITY)?;
        towers.extend((height > 20.0).then_some(id));
        let lamp = corner + Vec3::new(5.0, 11.0, 0.0);
        scene.insert(Aabb::new(lamp, lamp + Vec3::new(0.2, 0.2, 4.0)));
    }

    // Made once. Call `sync` when occluders change.
    let occluders = HorizonOccluders::new(&scene, UpAxis::Z);
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(HorizonCuller::new(occluders.into()));

    // One view along the street, and one across.
    let eye = DVec3::new(200.0, 295.0, 1.7);
    let mut visible = VisibleSet::new();
    for target in [DVec3::X, DVec3::new(1.0, 1.0, 0.2), DVec3::new(0.2, 1.0, 0.3)] {
        let pose = Pose::look_at(eye, eye + target, DVec3::Z);
        let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?;
        pipeline.cull(&scene, &view, &mut visible);
        let above = towers.iter().filter(|&&id| visible.contains(&scene, id)).count();
        println!("{} of {} objects, {above} of {} towers", visible.count(&scene), scene.len(), towers.len());
    }
    Ok(())
}
