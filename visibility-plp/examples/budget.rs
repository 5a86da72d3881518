//! Prints the order in which the approximate culler keeps a street's objects, and how many visible objects it
//! finds at several budgets.
//!
//! `cargo run -p visibility-plp --example budget`

use std::error::Error;
use std::sync::Arc;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, Culler, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
use visibility_plp::{Budget, Fineness, OctreeTessellation, PlpCuller, Tessellation};

fn main() -> Result<(), Box<dyn Error>> {
    // Scene of twelve parallel streets with houses on both sides, and a lamp in front of each house.
    let mut scene = Scene::new();
    let (mut houses, mut lamps) = (Vec::new(), Vec::new());
    for street in 0..12 {
        for house in 0..30 {
            let corner = Vec3::new(house as f32 * 12.0, street as f32 * 20.0, 0.0);
            houses.push(scene.insert(Aabb::new(corner, corner + Vec3::new(11.0, 10.0, 8.0))));
            let foot = corner + Vec3::new(5.0, 11.0, 0.0);
            lamps.push(scene.insert(Aabb::new(foot, foot + Vec3::new(0.2, 0.2, 4.0))));
        }
    }
    // A leaf holds fewer vertices than by default, since each box has only eight.
    let fineness = Fineness { vertices: 32, ..Fineness::default() };
    let cells = Arc::new(OctreeTessellation::from_scene(&scene, fineness));
    println!("{} objects in {} cells", scene.len(), cells.content().cell_count());

    // View along the street after the sixth row of houses.
    let eye = DVec3::new(-5.0, 5.0 * 20.0 + 15.0, 1.7);
    let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)?;
    let mut visible = VisibleSet::new();
    for budget in [10, 50, 200, usize::MAX] {
        let mut plp = PlpCuller::new(cells.clone(), Budget::Objects(budget));
        visible.fill(&scene, &view);
        FrustumCuller::new().cull(&scene, &view, &mut visible);
        let stats = plp.cull(&scene, &view, &mut visible);
        let on_street = |ids: &[_], row: usize| ids[row * 30..row * 30 + 30].to_vec();
        let street = [on_street(&houses, 5), on_street(&houses, 6), on_street(&lamps, 5)].concat();
        let found = visible.iter(&scene).filter(|id| street.contains(id)).count();
        println!(
            "{} objects from {} cells, {found} of them of this street",
            visible.count(&scene),
            stats.nodes
        );
    }

    // Pipeline as in an engine: the frustum, then the budget.
    let plp = PlpCuller::new(cells, Budget::Objects(50));
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(plp);
    pipeline.cull(&scene, &view, &mut visible);
    for id in visible.iter(&scene).take(5) {
        println!("draw object {}", id.index());
    }
    Ok(())
}
