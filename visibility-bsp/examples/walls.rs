//! Example: a town of walls and small boxes, seen by one camera, with the number of objects that each culler
//! of the crate leaves visible.
//!
//! `cargo run -p visibility-bsp --example walls`

use std::sync::Arc;
use visibility_bsp::{
    BspOrderCuller, NaylorCuller, Occluders, OcclusionTreeCuller, SceneTree, ShadowFrusta, ShadowFrustaCuller,
};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{
    Aabb, Culler, FrustumCuller, Object, OccluderMesh, Pipeline, Pose, Scene, View, VisibleSet,
    occlusion::Preparation,
};

/// Inserts a box with its twelve triangles. `occluder` flags it as opaque.
fn insert_box(scene: &mut Scene, bounds: Aabb, occluder: bool) -> Result<(), Box<dyn std::error::Error>> {
    let id = scene.insert(Object { occluder, ..Object::new(bounds) });
    let corners = bounds.corners();
    let triangles: Vec<[Vec3; 3]> =
        OccluderMesh::CUBOID.iter().map(|t| t.map(|i| corners[i as usize])).collect();
    scene.set_triangles(id, triangles)?;
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Blocks of houses, 20 m apart, with lamps between them.
    let mut scene = Scene::new();
    for x in 0..12 {
        for y in 0..12 {
            let at = Vec3::new(x as f32 * 20.0, y as f32 * 20.0, 0.0);
            let height = 6.0 + ((x * 7 + y * 3) % 5) as f32 * 2.0;
            insert_box(&mut scene, Aabb::new(at, at + Vec3::new(14.0, 14.0, height)), true)?;
            for lamp in 0..6 {
                let at = at + Vec3::new(16.0, lamp as f32 * 3.0, 0.0);
                insert_box(&mut scene, Aabb::new(at, at + Vec3::new(0.2, 0.2, 4.0)), false)?;
            }
        }
    }
    scene.prepare_occluders(&Preparation::default());
    scene.rebuild();

    // Made once and shared by all views.
    let occluders = Arc::new(Occluders::new(&scene));
    let frusta = Arc::new(ShadowFrusta::new(&scene, (*occluders).clone(), 64, 32));
    let tree = Arc::new(SceneTree::new(&scene)?);
    println!("{} objects, {} occluder polygons", scene.len(), occluders.len());

    let pose = Pose::look_at(DVec3::new(-6.0, 15.0, 1.7), DVec3::new(200.0, 120.0, 5.0), DVec3::Z);
    let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?;
    let cullers: [Box<dyn Culler + Send + Sync>; 5] = [
        Box::new(FrustumCuller::new()),
        Box::new(ShadowFrustaCuller::new(frusta)),
        Box::new(OcclusionTreeCuller::new(occluders)),
        Box::new(NaylorCuller::new(tree.clone())),
        Box::new(BspOrderCuller::new(tree)),
    ];
    let mut visible = VisibleSet::new();
    for culler in cullers {
        let name = culler.name().to_owned();
        let mut pipeline = Pipeline::new().with(FrustumCuller::new());
        pipeline.push(culler);
        pipeline.cull(&scene, &view, &mut visible);
        println!("{name:16} {:4} visible", visible.count(&scene));
    }
    Ok(())
}
