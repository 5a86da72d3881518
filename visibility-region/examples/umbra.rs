//! Prints which objects a viewcell sees in a street behind a row of houses.
//!
//! `cargo run -p visibility-region --example umbra`

use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Object, OccluderMesh, RegionCuller, Scene, VisibleSet};
use visibility_region::ExtendedProjectionCuller;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut scene = Scene::new();
    // Houses side by side, each narrower than the viewcell: they hide objects only together.
    for i in -12..12 {
        let y = 3.0 * i as f32;
        let house = Aabb::from_arrays([10.0, y, 0.0], [18.0, y + 3.0, 8.0 + (i % 3) as f32]);
        let id = scene.insert(Object { occluder: true, ..Object::new(house) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&house)?);
        scene.set_mesh(id, mesh, Affine3A::IDENTITY)?;
    }
    // Cars on the street behind the houses, and one car in front of them.
    let car = |x: f32, y: f32| Aabb::from_arrays([x, y, 0.0], [x + 2.0, y + 4.0, 1.5]);
    let behind = scene.insert_batch((0..8).map(|i| car(24.0, 5.0 * i as f32 - 20.0)));
    let before = scene.insert(car(6.0, 0.0));

    let cell = Viewcell::from_box(DVec3::new(0.0, -4.0, 0.5), DVec3::new(2.0, 4.0, 2.5));
    let mut culler = ExtendedProjectionCuller::new();
    let mut visible = VisibleSet::new();
    culler.cull(&scene, &cell, &mut visible);
    visible.finish(&scene);
    println!("{} of {} objects can be seen from the viewcell", visible.count(&scene), scene.len());
    assert!(visible.contains(&scene, before), "the car before the houses is seen");
    assert!(behind.iter().all(|&id| !visible.contains(&scene, id)), "a car behind the houses is seen");
    Ok(())
}
