//! Cells made from the plan of the office see one another as the office's own cells do.
#![allow(missing_docs)]

use glam::DVec3;
use visibility_2d::cdt::{Opacity, Plan, Wall};
use visibility_core::bake::Bake;
use visibility_core::cells::{CellGraph, CellId};
use visibility_core::{Pose, Scene, View, VisibleSet, pvs::Viewcells};
use visibility_examples::recipes::{Office, office};
use visibility_portals::{CellBaker, CellMatrix, PortalEye, SceneCells, Settings};

/// Height of doors above the floor, in metres.
const DOOR: f64 = 2.1;

fn matrix(graph: &CellGraph) -> CellMatrix {
    let mut bake = Bake::new(CellBaker::new(graph, Settings::default()).unwrap());
    while bake.advance().is_some() {}
    bake.finish().matrix
}

/// Returns the walls of one floor: the sides of its rooms, with each doorway as a clear wall.
fn floor_walls(office: &Office) -> Vec<Wall> {
    let doorways: Vec<_> = office.portals.iter().map(|portal| [portal.quad[0], portal.quad[1]]).collect();
    let mut walls = Vec::new();
    for cell in &office.cells {
        let (low, high) = (cell.min, cell.max);
        let corners = [low, low.with_x(high.x), high, low.with_y(high.y)];
        for k in 0..4 {
            let [a, b] = [corners[k], corners[(k + 1) % 4]].map(|p| p.truncate());
            // Places along the side where doorways begin and end.
            let along = (b - a).normalize();
            let mut cuts = vec![0.0, a.distance(b)];
            for doorway in &doorways {
                let places = doorway.map(|p| p.truncate() - a);
                if places
                    .iter()
                    .all(|p| p.perp_dot(along).abs() < 1e-9 && (0.0..=cuts[1]).contains(&p.dot(along)))
                {
                    cuts.extend(places.map(|p| p.dot(along)));
                }
            }
            cuts.sort_by(f64::total_cmp);
            // Walls and doorways alternate.
            for (index, pair) in cuts.windows(2).enumerate() {
                if index % 2 == 0 {
                    walls.push(Wall::new(a + along * pair[0], a + along * pair[1]));
                }
            }
        }
    }
    walls.extend(doorways.iter().map(|ends| {
        let [a, b] = ends.map(|p| p.truncate());
        Wall::new(a, b).with_opacity(Opacity::Clear)
    }));
    walls
}

#[test]
fn cells_of_the_office_plan_see_what_its_own_cells_see() {
    for rooms in [4, 9, 16] {
        let office = office(1, rooms).unwrap();
        let own = office.scene.cells.as_ref().unwrap();
        let plan = Plan::new(&floor_walls(&office)).unwrap();
        let made = plan.cells(0.0, DOOR).unwrap();
        // The room of each cell, `None` outside the building.
        let room_of: Vec<_> = (0..made.graph.cell_count())
            .map(|cell| {
                let outline = made.outline(CellId(cell as u32));
                let [x, y] = [0, 1].map(|k| outline.iter().map(|p| p[k]).sum::<f64>() / outline.len() as f64);
                own.viewcells.locate(DVec3::new(x, y, 1.0)).map(|viewcell| viewcell.index())
            })
            .collect();
        let count = own.graph.cell_count();
        assert!((0..count).all(|room| room_of.contains(&Some(room))));

        let (expected, found) = (matrix(&own.graph), matrix(&made.graph));
        let mut sees = vec![vec![false; count]; count];
        for (from, room) in room_of.iter().enumerate() {
            for to in found.seen_from(CellId(from as u32)) {
                let other = room_of[to.index()];
                // No line of sight leaves the building.
                assert_eq!(room.is_some(), other.is_some());
                if let (Some(room), Some(other)) = (*room, other) {
                    sees[room][other] = true;
                }
            }
        }
        let mut pairs = 0;
        for (from, row) in sees.iter().enumerate() {
            for (to, &seen) in row.iter().enumerate() {
                assert_eq!(seen, expected.sees(CellId(from as u32), CellId(to as u32)), "{from} sees {to}");
                pairs += usize::from(seen);
            }
        }
        assert!(pairs > 2 * count && pairs < count * count, "{pairs} of {count} rooms");

        // From eyes, by the portal culler.
        let scene = Scene::new();
        let mut eyes = [PortalEye::new(), PortalEye::new()];
        let mut cells = [(&own.graph, &own.viewcells), (&made.graph, &made.viewcells)].map(
            |(graph, viewcells): (&CellGraph, &Viewcells)| {
                SceneCells::new(graph.clone(), viewcells.clone(), 1e-6).unwrap()
            },
        );
        cells.iter_mut().for_each(|cells| cells.sync(&scene));
        for step in 0..200 {
            let room = &office.cells[step * 7 % count];
            let share =
                DVec3::new(0.1 + 0.8 * (step % 9) as f64 / 9.0, 0.1 + 0.8 * (step % 7) as f64 / 7.0, 0.5);
            let eye = room.min + share * (room.max - room.min).with_z(DOOR);
            let turn = step as f64;
            let pose = Pose::look_at(eye, eye + DVec3::new(turn.cos(), turn.sin(), 0.0), DVec3::Z);
            let view = View::perspective(pose, 1.2, 1.6, 1e-4, f64::INFINITY).unwrap();
            let mut visible = VisibleSet::new();
            for (eye, cells) in eyes.iter_mut().zip(&cells) {
                visible.fill(&scene, &view);
                eye.cull(cells, &scene, &view, &mut visible);
            }
            let expected: Vec<_> = eyes[0].seen_cells().map(|cell| cell.index()).collect();
            let mut found: Vec<_> = eyes[1].seen_cells().filter_map(|cell| room_of[cell.index()]).collect();
            found.sort_unstable();
            found.dedup();
            assert_eq!(found, expected, "from {eye}");
        }
    }
}
