//! Portal culling in two rooms with a door between them: prints the objects that are visible with the door
//! open, and then with the door closed.
//!
//! `cargo run -p visibility-portals --example two_rooms`

use std::error::Error;
use visibility_core::bake::Bake;
use visibility_core::glam::{DVec2, DVec3};
use visibility_core::{Aabb, Culler, FrustumCuller, Pose, Scene, View, VisibleSet, cells::PortalId};
use visibility_portals::from_geometry::{WallSettings, floor_plan, from_walls};
use visibility_portals::{BakerSettings, CellBaker, PortalCuller, SceneCells};

fn main() -> Result<(), Box<dyn Error>> {
    // A house of 8 by 4 m, 3 m high, with a wall across the middle at x = 4 and a door in that wall from y =
    // 1 to 2.
    let wall = |a: [f64; 2], b: [f64; 2]| [DVec2::from(a), DVec2::from(b)];
    let plan = [
        wall([0.0, 0.0], [8.0, 0.0]),
        wall([0.0, 4.0], [8.0, 4.0]),
        wall([0.0, 0.0], [0.0, 4.0]),
        wall([8.0, 0.0], [8.0, 4.0]),
        wall([4.0, 0.0], [4.0, 1.0]),
        wall([4.0, 2.0], [4.0, 4.0]),
    ];
    let rooms = from_walls(&floor_plan(&plan, 0.0, 3.0)?, &WallSettings::default())?;
    println!("{} cells, {} portals", rooms.graph.cell_count(), rooms.graph.portals().len());

    // Before the first frame: bakes which cells can be seen from anywhere in each cell.
    let mut bake = Bake::new(CellBaker::new(&rooms.graph, BakerSettings::default())?);
    while let Some(progress) = bake.advance() {
        println!("baked {} of {} portals", progress.done, progress.total);
    }
    let matrix = bake.finish().matrix;
    println!("a cell sees {:.1} cells in the mean", matrix.mean_visible());

    let mut scene = Scene::new();
    let objects = [
        ("chair", scene.insert(Aabb::from_arrays([2.0, 3.0, 0.0], [2.5, 3.5, 1.0]))),
        ("table behind the door", scene.insert(Aabb::from_arrays([6.0, 1.2, 0.0], [6.8, 1.8, 1.0]))),
        ("shelf beside the door", scene.insert(Aabb::from_arrays([4.5, 3.0, 0.0], [5.0, 3.8, 2.0]))),
    ];

    let pvs = matrix.to_pvs(&rooms.graph)?;
    let cells = SceneCells::new(rooms.graph, rooms.viewcells, 1e-6)?.with_pvs(pvs)?;
    let mut frustum = FrustumCuller::new();
    let mut portals = PortalCuller::new(cells);
    let mut visible = VisibleSet::new();
    let pose = Pose::look_at(DVec3::new(0.5, 1.5, 1.6), DVec3::new(7.0, 2.0, 1.0), DVec3::Z);
    let view = View::perspective(pose, 1.2, 1.5, 0.1, 100.0)?;
    for open in [true, false] {
        for door in 0..portals.cells().graph().portals().len() as u32 {
            portals.cells_mut().set_open(PortalId(door), open)?;
        }
        visible.fill(&scene, &view);
        frustum.cull(&scene, &view, &mut visible);
        portals.cull(&scene, &view, &mut visible);
        println!("door {}:", if open { "open" } else { "closed" });
        for (name, id) in objects {
            println!("  {name}: {}", if visible.contains(&scene, id) { "visible" } else { "hidden" });
        }
    }
    Ok(())
}
