//! Rooms in a row with doors in line, a box in each room, and a view along the row, for tests.

use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, ObjectId, Pose, Scene, View, VisibleSet,
    cells::{CellGraph, CellId},
    geometry::ConvexPolygon,
    pvs::{Viewcell, Viewcells},
};
use visibility_portals::{PortalEye, SceneCells};

fn room(i: u32) -> DVec3 {
    DVec3::new(f64::from(i) * 4.0, 0.0, 0.0)
}

/// Returns rooms of 4 by 4 by 3 in a row along x, with a door 1 wide and 2 high in the middle of each wall
/// between rooms.
pub(crate) fn row_of_rooms(rooms: u32) -> SceneCells {
    let door = |x: f64| {
        let corners = [[1.5, 0.0], [2.5, 0.0], [2.5, 2.0], [1.5, 2.0]];
        ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(x, y, z))).unwrap()
    };
    let portals = (1..rooms).map(|i| (door(room(i).x), [CellId(i - 1), CellId(i)]));
    let graph = CellGraph::new(rooms as usize, portals).unwrap();
    let viewcells = (0..rooms).map(|i| Viewcell::from_box(room(i), room(i) + DVec3::new(4.0, 4.0, 3.0)));
    SceneCells::new(graph, Viewcells::new(viewcells), 1e-6).unwrap()
}

/// Returns a scene with one box in the middle of each room of a row, and the boxes in the order of the rooms.
pub(crate) fn boxes(rooms: u32) -> (Scene, Vec<ObjectId>) {
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..rooms).map(|i| {
        let at = (room(i) + DVec3::new(2.5, 2.0, 1.0)).as_vec3();
        Aabb::new(at - 0.2, at + 0.2)
    }));
    (scene, ids)
}

/// Returns a view from the first room along the row of rooms, with an infinite far plane.
pub(crate) fn along() -> View {
    let pose = Pose::look_at(DVec3::new(0.5, 2.0, 1.0), DVec3::new(9.0, 2.0, 1.0), DVec3::Z);
    View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).unwrap()
}

/// Returns the indices of the visible objects, ascending.
pub(crate) fn indices(scene: &Scene, visible: &VisibleSet) -> Vec<usize> {
    let mut all: Vec<usize> = visible.iter(scene).map(|id| id.index()).collect();
    all.sort_unstable();
    all
}

/// Returns the indices of the objects that `eye` leaves of all objects in view, ascending.
pub(crate) fn seen(eye: &mut PortalEye, cells: &SceneCells, scene: &Scene, view: &View) -> Vec<usize> {
    let mut visible = VisibleSet::new();
    visible.fill(scene, view);
    eye.cull(cells, scene, view, &mut visible);
    indices(scene, &visible)
}
