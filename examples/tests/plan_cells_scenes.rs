//! Cells that `Plan::cells` makes from the floor plan of an office, against the office's own cells: a portal
//! culler has the same answer by both.

use visibility_2d::cdt::{Opacity, Plan, Wall};
use visibility_core::cells::{CellGraph, CellId};
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_core::{Pose, View};
use visibility_examples::recipes::{Office, office};
use visibility_examples::source::SourceCells;
use visibility_examples::walkthrough::{World, cullers, run};

/// Returns the floor and the ceiling of a storey.
fn heights(office: &Office) -> [f64; 2] {
    [office.cells[0].min.z, office.cells[0].max.z]
}

/// Returns the two ends of each portal on the plan.
fn doors(office: &Office) -> Vec<[[f64; 2]; 2]> {
    office.portals.iter().map(|portal| [0, 1].map(|k| [portal.quad[k].x, portal.quad[k].y])).collect()
}

/// Makes a world with cells, whose portals reach from floor to ceiling: a plan knows no heads of doors.
fn world(office: &Office, graph: CellGraph, viewcells: Viewcells) -> World {
    let mut source = office.scene.clone();
    let names = (0..viewcells.cells().len()).map(|cell| cell.to_string()).collect();
    let depth = source.cells.as_ref().unwrap().depth;
    source.cells = Some(SourceCells { graph, viewcells, names, depth, with_doorways: None });
    let mut world = World::new(source, (320, 180), Some(1)).unwrap();
    world.views.clear();
    for cell in &office.cells {
        for step in 0..24 {
            // Off the middle, and off the diagonals of rooms.
            let part = DVec3::new(0.21 + 0.023 * f64::from(step), 0.83 - 0.027 * f64::from(step), 0.5);
            let eye = cell.min + (cell.max - cell.min) * part;
            let (sin, cos) = (0.1 + f64::from(step)).sin_cos();
            let pose = Pose::look_at(eye, eye + DVec3::new(cos, sin, 0.05), DVec3::Z);
            let view = View::perspective(pose, 1.6, 16.0 / 9.0, 1e-5, f64::INFINITY).unwrap();
            world.views.push(view);
        }
    }
    world
}

/// Makes the world with the office's own cells.
fn own(office: &Office) -> World {
    let [low, high] = heights(office);
    let center = |cell: usize| (office.cells[cell].min + office.cells[cell].max) * 0.5;
    let portals = office.portals.iter().zip(doors(office)).map(|(portal, [a, b])| {
        let corner = |[x, y]: [f64; 2], z: f64| DVec3::new(x, y, z);
        let mut quad = [corner(a, low), corner(b, low), corner(b, high), corner(a, high)];
        let normal = (quad[1] - quad[0]).cross(quad[2] - quad[0]);
        if normal.dot(center(portal.cells[1]) - quad[0]) < 0.0 {
            quad.reverse();
        }
        (quad, portal.cells.map(|cell| CellId(cell as u32)))
    });
    let graph = CellGraph::from_vertices(office.cells.len(), portals).unwrap();
    let bodies: Vec<_> = office.cells.iter().map(|cell| Viewcell::from_box(cell.min, cell.max)).collect();
    world(office, graph, Viewcells::new(bodies))
}

/// Makes the world with the cells of the plan: sides of the office's cells are walls, but for their doors.
fn of_plan(office: &Office) -> World {
    let mut walls = Vec::new();
    for cell in &office.cells {
        let (min, max) = (cell.min, cell.max);
        for (axis, at, from, to) in [
            (1, min.y, min.x, max.x),
            (1, max.y, min.x, max.x),
            (0, min.x, min.y, max.y),
            (0, max.x, min.y, max.y),
        ] {
            // Ends of what stands, in order along the side.
            let mut ends = vec![from, to];
            for door in doors(office) {
                let along = door.map(|end| end[1 - axis]);
                let [first, last] = [along[0].min(along[1]), along[0].max(along[1])];
                if door.iter().all(|end| end[axis] == at) && from <= first && last <= to {
                    ends.extend([first, last]);
                }
            }
            ends.sort_by(f64::total_cmp);
            for pair in ends.chunks_exact(2).filter(|pair| pair[0] < pair[1]) {
                let point = |along: f64| if axis == 1 { [along, at] } else { [at, along] };
                walls.push(Wall::new(point(pair[0]), point(pair[1])));
            }
        }
    }
    walls.extend(doors(office).iter().map(|&[a, b]| Wall::new(a, b).with_opacity(Opacity::Clear)));
    let [low, high] = heights(office);
    let cells = Plan::new(&walls).unwrap().cells(low, high).unwrap();
    world(office, cells.graph, cells.viewcells)
}

#[test]
fn cells_of_the_plan_show_what_the_own_cells_show() {
    let office = office(1, 6).unwrap();
    let [own, of_plan] = [own(&office), of_plan(&office)].map(|world| {
        let (name, pipeline) = cullers::parse("portals", &world).unwrap().remove(0);
        run(name, pipeline, &world)
    });
    let count = office.scene.objects.len();
    let mut hidden: usize = 0;
    for (frame, (own, of_plan)) in own.reported.iter().zip(&of_plan.reported).enumerate() {
        assert_eq!(own, of_plan, "frame {frame}");
        hidden += count - own.len();
    }
    println!("{} frames, {count} objects, {hidden} hidden", own.reported.len());
    assert!(
        own.reported.len() > 300 && hidden > own.reported.len() * count / 2,
        "{hidden} objects hidden in {} frames",
        own.reported.len()
    );
}
