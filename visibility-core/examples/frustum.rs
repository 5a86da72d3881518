//! Frustum culling of a million boxes with the time per frame: `cargo run --release -p visibility-core
//! --example frustum`.

use std::time::Instant;
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet, view::ViewError};

fn main() -> Result<(), ViewError> {
    // A grid of a hundred boxes along each axis, 10 m apart.
    let boxes = (0..1_000_000).map(|i| {
        let at = [i % 100, i / 100 % 100, i / 10_000].map(|cell| cell as f32 * 10.0 - 500.0);
        Aabb::from_arrays(at, at.map(|least| least + 2.0))
    });
    let mut scene = Scene::new();
    scene.insert_batch(boxes);
    let mut pipeline = Pipeline::new().with(FrustumCuller::new());
    let mut visible = VisibleSet::new();
    for degrees in (0..360).step_by(45) {
        let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
        let pose = Pose::look_at(DVec3::ZERO, DVec3::new(cos, sin, 0.2), DVec3::Z);
        let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, 400.0)?;
        let start = Instant::now();
        let stats = pipeline.cull(&scene, &view, &mut visible);
        let micros = start.elapsed().as_secs_f64() * 1e6;
        println!(
            "looking towards {degrees:3} degrees: {:6} objects of {}, {:5} nodes tested, {micros:5.0} us",
            stats.visible,
            scene.len(),
            stats.nodes
        );
    }
    Ok(())
}
