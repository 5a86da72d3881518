//! Portals that are wound the wrong way hide nothing: they are turned by the volumes of the cells, or
//! refused.

use crate::maze::{Maze, Style};
use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, Culler, Pose, Scene, View, VisibleSet,
    cells::{CellGraph, CellGraphError, CellId, PortalId},
    geometry::ConvexPolygon,
    pvs::{Pvs, PvsTargets, Viewcell, Viewcells},
};
use visibility_portals::{PortalCuller, SceneCells, SceneCellsError};
use visibility_testing::Random;

fn reversed(polygon: &ConvexPolygon) -> ConvexPolygon {
    ConvexPolygon::new(polygon.vertices().iter().rev().copied()).unwrap()
}

/// A hole in the floor between two rooms, with the eye 2 m above it. An object below is seen whichever way
/// the hole is wound.
#[test]
fn a_hole_wound_the_wrong_way_is_seen_through() {
    let hole = [[-6.0, -1.0, 0.0], [-4.0, -1.0, 0.0], [-4.0, 1.0, 0.0], [-6.0, 1.0, 0.0]];
    let hole = ConvexPolygon::new(hole.map(DVec3::from)).unwrap();
    let room = |z: f64| Viewcell::from_box(DVec3::new(-10.0, -5.0, z), DVec3::new(0.0, 5.0, z + 3.0));
    let pose = Pose::look_at(DVec3::new(-5.0, 0.0, 2.0), DVec3::new(-5.0, 0.01, -2.0), DVec3::Y);
    let view = View::perspective(pose, 1.2, 1.0, 0.05, 50.0).unwrap();
    for (hole, turned) in [(reversed(&hole), vec![]), (hole, vec![PortalId(0)])] {
        let graph = CellGraph::new(2, [(hole, [CellId(0), CellId(1)])]).unwrap();
        let viewcells = Viewcells::new([room(0.0), room(-3.0)]);
        let mut portals = PortalCuller::new(SceneCells::new(graph, viewcells, 1e-6).unwrap());
        assert_eq!(portals.cells().turned_portals(), turned, "portals that the cells' bodies turn");
        let mut scene = Scene::new();
        let below = scene.insert(Aabb::from_arrays([-5.3, -0.3, -2.3], [-4.7, 0.3, -1.7]));
        let aside = scene.insert(Aabb::from_arrays([-1.3, -0.3, -2.3], [-0.7, 0.3, -1.7]));
        portals.cells_mut().sync(&scene);
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        portals.cull(&scene, &view, &mut visible);
        assert!(portals.eye().stats().fallback.is_none(), "the view begins in a cell");
        assert!(
            visible.contains(&scene, below) && !visible.contains(&scene, aside),
            "the object below the hole, and none aside"
        );
    }
}

/// Mazes that are rotated, far from the origin, with slivers, and displaced within their tolerance. Each
/// portal that was reversed is turned back, and no other.
#[test]
fn reversed_portals_of_mazes_are_turned_back() {
    let mut random = Random(2);
    let (mut reversals, mut portals) = (0, 0);
    for round in 0..60 {
        let style = Style {
            turned: round % 2 == 1,
            slivers: round % 3 == 1,
            mirrors: false,
            shift: [0.0, 1e3, 1e5][round % 3],
            tolerance: [0.0, 1e-6, 1e-3][round / 3 % 3],
        };
        let maze = Maze::new(&mut random, [3, 3, 2], style);
        let (right, viewcells) = (maze.cells.graph(), maze.cells.viewcells());
        assert!(maze.cells.turned_portals().is_empty(), "{round}");
        let mut wrong = Vec::new();
        let given = right.portals().iter().zip((0..).map(PortalId)).map(|(portal, id)| {
            if random.below(2) == 0 {
                return (portal.polygon().clone(), portal.cells());
            }
            wrong.push(id);
            (reversed(portal.polygon()), portal.cells())
        });
        let graph = CellGraph::new(right.cell_count(), given.collect::<Vec<_>>()).unwrap();
        let cells = SceneCells::new(graph, viewcells.clone(), style.tolerance).unwrap();
        assert_eq!(cells.turned_portals(), wrong, "{round}");
        assert!(cells.graph() == right, "{round}");
        reversals += wrong.len();
        portals += right.portals().len();
    }
    assert!(reversals > 300 && portals - reversals > 300, "{reversals} of {portals}");
}

#[test]
fn portals_that_are_not_between_their_cells_are_refused() {
    let corners = [[4.0, 1.0, 0.0], [4.0, 2.0, 0.0], [4.0, 2.0, 2.0], [4.0, 1.0, 2.0]];
    let door = ConvexPolygon::new(corners.map(DVec3::from)).unwrap();
    let graph = CellGraph::new(2, [(door, [CellId(0), CellId(1)])]).unwrap();
    let body = |from: f64, to: f64| Viewcell::from_box(DVec3::new(from, 0.0, 0.0), DVec3::new(to, 4.0, 3.0));
    let error = SceneCellsError::Graph(CellGraphError::NotBetween {
        portal: PortalId(0),
        cells: [CellId(0), CellId(1)],
    });
    for (first, second) in [([0.0, 4.0], [-4.0, 0.0]), ([0.0, 5.0], [3.0, 8.0]), ([4.0, 8.0], [4.0, 6.0])] {
        let viewcells = Viewcells::new([first, second].map(|[from, to]| body(from, to)));
        assert_eq!(
            SceneCells::new(graph.clone(), viewcells, 1e-6).unwrap_err(),
            error,
            "bodies of {first:?} and {second:?}, with a portal at 4"
        );
    }
    // A graph whose portals had to be turned accepts no PVS, since the PVS may have been baked from the
    // original graph.
    let pvs = || Pvs::new(PvsTargets::Cells, 2, &[[0u32, 1]; 2], |_| []).unwrap();
    let right = Viewcells::new([body(0.0, 4.0), body(4.0, 8.0)]);
    let wrong = Viewcells::new([body(4.0, 8.0), body(0.0, 4.0)]);
    assert!(
        SceneCells::new(graph.clone(), right, 1e-6).unwrap().with_pvs(pvs()).is_ok(),
        "a graph that was right from the start takes a PVS"
    );
    let turned = SceneCells::new(graph, wrong.clone(), 1e-6).unwrap();
    let again = turned.graph().clone();
    let error = turned.with_pvs(pvs()).unwrap_err();
    assert_eq!(
        error,
        SceneCellsError::Winding { first: PortalId(0), count: 1 },
        "a turned graph takes no PVS, which may be of before"
    );
    assert!(
        SceneCells::new(again, wrong, 1e-6).unwrap().with_pvs(pvs()).is_ok(),
        "a graph of the turned portals takes one"
    );
}
