//! No visible object is hidden when cells, portals and mirrors are displaced within the tolerance, or eyes
//! and boxes within their rounding.

use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, Pose, Scene, View, VisibleSet,
    cells::{CellGraph, CellId},
    geometry::ConvexPolygon,
    pvs::{Viewcell, Viewcells},
};
use visibility_portals::{PortalEye, SceneCells};

fn quad(corners: [[f64; 3]; 4]) -> ConvexPolygon {
    ConvexPolygon::new(corners.map(DVec3::from)).unwrap()
}

fn view(from: DVec3, to: DVec3, tangent: f64) -> View {
    let pose = Pose::look_at(from, to, DVec3::Z);
    View::perspective(pose, 2.0 * tangent.atan(), 1.0, 1e-3, f64::INFINITY).unwrap()
}

/// Culls one frame. Returns the eye after the frame, and the number of visible objects.
fn seen(cells: &SceneCells, scene: &Scene, view: &View) -> (PortalEye, usize) {
    let (mut eye, mut visible) = (PortalEye::new(), VisibleSet::new());
    visible.fill(scene, view);
    eye.cull(cells, scene, view, &mut visible);
    assert_eq!(eye.stats().fallback, None, "the view begins in a cell");
    let count = visible.count(scene);
    (eye, count)
}

/// Returns the cells of [`beside`] that are told `tolerance`, and the same with viewcells that know it.
fn both_beside(tolerance: f64) -> [SceneCells; 2] {
    let cells = beside(tolerance);
    let viewcells = cells.viewcells().cells().iter().cloned();
    let (min, max) = (DVec3::new(0.0, -1.0, -3.0), DVec3::new(8.0, 20.0, 3.0));
    let viewcells = Viewcells::of_divided_box(viewcells, min, max, tolerance);
    let misplaced = SceneCells::new(cells.graph().clone(), viewcells, 1e-9).unwrap();
    [cells, misplaced]
}

/// Returns two cells: a room west of x = 4, a room east of x = 4 that begins farther north, and a door
/// between them from y = 1 to 3.
fn beside(tolerance: f64) -> SceneCells {
    let door = quad([[4.0, 1.0, -1.0], [4.0, 3.0, -1.0], [4.0, 3.0, 1.0], [4.0, 1.0, 1.0]]);
    let graph = CellGraph::new(2, [(door, [CellId(0), CellId(1)])]).unwrap();
    let cell = |low: [f64; 2], high: [f64; 2]| {
        Viewcell::from_box(DVec3::new(low[0], low[1], -3.0), DVec3::new(high[0], high[1], 3.0))
    };
    let viewcells = Viewcells::new([cell([0.0, -1.0], [4.0, 20.0]), cell([4.0, 1.0], [8.0, 20.0])]);
    SceneCells::new(graph, viewcells, tolerance).unwrap()
}

#[test]
fn an_eye_that_may_be_on_either_side_of_a_door_sees_through_it() {
    let mut scene = Scene::new();
    // An object beyond the door, so near the door's plane that a line of sight at half the tolerance from
    // that plane reaches it.
    scene.insert(Aabb::from_arrays([4.02, 10.0, -0.1], [4.04, 11.0, 0.1]));
    for (tolerance, x, sees) in
        [(0.01, 3.995, 1), (0.01, 4.0, 1), (0.01, 4.005, 1), (1e-9, 3.995, 1), (1e-9, 3.9, 0)]
    {
        for mut cells in both_beside(tolerance) {
            cells.sync(&scene);
            let eye = DVec3::new(x, 0.0, 0.0);
            let (_, count) = seen(&cells, &scene, &view(eye, eye + DVec3::Y, 1.0));
            assert_eq!(count, sees, "tolerance {tolerance}, eye at {x}");
        }
    }
}

#[test]
fn a_door_just_outside_the_view_may_be_in_it() {
    let mut scene = Scene::new();
    scene.insert(Aabb::from_arrays([5.0, 0.0, -0.1], [8.0, 3.0, 0.1]));
    // In the plane of the door the view ends at y = 0.995; the door begins at y = 1.
    let view = view(DVec3::new(2.0, 0.0, 0.0), DVec3::new(4.0, 0.0, 0.0), 0.995 / 2.0);
    for (tolerance, sees) in [(0.01, 1), (0.001, 0)] {
        for mut cells in both_beside(tolerance) {
            cells.sync(&scene);
            assert_eq!(seen(&cells, &scene, &view).1, sees, "tolerance {tolerance}");
        }
    }
}

#[test]
fn a_door_may_be_wider_than_it_seems() {
    let mut scene = Scene::new();
    // From (2, 2) past the door's end at (4, 3), lines of sight reach y = 4 at x = 6. They reach 0.02 farther
    // if the door ends at 3.01.
    scene.insert(Aabb::from_arrays([5.99, 4.015, -0.1], [6.0, 5.0, 0.1]));
    let view = view(DVec3::new(2.0, 2.0, 0.0), DVec3::new(4.0, 2.0, 0.0), 1.0);
    for (tolerance, sees) in [(0.01, 1), (0.001, 0)] {
        for mut cells in both_beside(tolerance) {
            cells.sync(&scene);
            assert_eq!(seen(&cells, &scene, &view).1, sees, "tolerance {tolerance}");
        }
    }
}

#[test]
fn a_door_that_is_not_flat_hides_nothing_beside_its_dents() {
    let mut scene = Scene::new();
    // One vertex is behind the plane of the others, so that from the eye the door's outline has a dent: it
    // seems to be at y = 3 - 1e-6. The object is seen through (4, 3 - 5e-7, 0.9), beside the dent, but
    // outside the edge on the dent's other side.
    scene.insert(Aabb::from_arrays([5.99, 3.999999, 1.79], [6.0, 4.2, 1.85]));
    let view = view(DVec3::new(2.0, 2.0, 0.0), DVec3::new(4.0, 2.0, 0.0), 1.0);
    let corners =
        [[4.0, 1.0, -1.0], [4.0, 3.0, -1.0], [4.0 + 2e-6, 3.0, 0.0], [4.0, 3.0, 1.0], [4.0, 1.0, 1.0]];
    let door = ConvexPolygon::new(corners.map(DVec3::from)).unwrap();
    let graph = CellGraph::new(2, [(door, [CellId(0), CellId(1)])]).unwrap();
    let mut cells = SceneCells::new(graph, beside(0.0).viewcells().clone(), 1e-9).unwrap();
    cells.sync(&scene);
    assert_eq!(seen(&cells, &scene, &view).1, 1, "objects seen beside the dent");
}

#[test]
fn a_mirror_is_looked_into_from_its_plane_and_shows_what_is_in_it() {
    let room = |tolerance| {
        let graph = CellGraph::new(1, []).unwrap();
        let viewcells = Viewcells::new([Viewcell::from_box(DVec3::splat(-10.0), DVec3::splat(10.0))]);
        let mut cells = SceneCells::new(graph, viewcells, tolerance).unwrap();
        // A mirror in the middle of the room, facing west.
        let glass = [[4.0, 1.0, -1.0], [4.0, 1.0, 1.0], [4.0, 3.0, 1.0], [4.0, 3.0, -1.0]];
        cells.add_mirror(CellId(0), &quad(glass)).unwrap();
        cells
    };
    let mut scene = Scene::new();
    // Four objects: one in front of the mirror; one behind it by half of the greater tolerance; one well
    // behind it; and one that lines of sight reach after reflection at a grazing angle.
    for (x, y) in [([3.0, 3.5], 1.5), ([4.005, 4.5], 1.5), ([4.1, 5.0], 1.5), ([3.9, 3.98], 9.0)] {
        scene.insert(Aabb::from_arrays([x[0], y, -0.5], [x[1], y + 0.9, 0.5]));
    }
    let look = |cells: &mut SceneCells, from: DVec3, to: DVec3| -> Option<Vec<usize>> {
        cells.sync(&scene);
        let (eye, _) = seen(cells, &scene, &view(from, to, 1.0));
        let shown = |one: &visibility_portals::Reflection| {
            one.visible().iter(&scene).map(|id| id.index()).collect::<Vec<_>>()
        };
        eye.reflections().first().map(|one| {
            let mut ids = shown(one);
            ids.sort_unstable();
            ids
        })
    };
    let middle = DVec3::new(4.0, 2.0, 0.0);
    for (tolerance, shown) in [(0.01, vec![0, 1]), (0.001, vec![0])] {
        assert_eq!(
            look(&mut room(tolerance), DVec3::new(0.0, 2.0, 0.0), middle),
            Some(shown),
            "tolerance {tolerance}: objects in the mirror"
        );
    }
    // Eyes beside the mirror, so near its plane that the mirror may face the eye.
    for x in [3.995, 4.0, 4.005] {
        let from = DVec3::new(x, 0.0, 0.0);
        let shown = look(&mut room(0.01), from, from + DVec3::Y);
        assert!(shown.is_some_and(|ids| ids.contains(&3)), "eye at {x}");
    }
    let from = DVec3::new(4.1, 0.0, 0.0);
    assert_eq!(look(&mut room(0.001), from, from + DVec3::Y), None, "an eye behind the mirror");
}

#[test]
fn boxes_far_from_the_origin_may_be_higher_than_they_seem() {
    // The scene's origin is 2^27 above the box. Relative to the eye the origin is at 2^27 + 1.4e-8, which is
    // rounded to 2^27, so the box seems to be lower by the difference.
    let (origin, eye) = (134_217_728.0, DVec3::new(1.0, 2.0, -1.4e-8));
    let mut scene = Scene::new();
    scene.set_origin(DVec3::new(0.0, 0.0, origin)).unwrap();
    scene.insert(Aabb::from_arrays([5.0, 1.5, -origin as f32 - 16.0], [7.0, 2.5, -origin as f32]));
    for (sill, sees) in [(5e-9, 1), (1.0, 0)] {
        // The top of the box is 1.4e-8 above the eye and twice as far away as the door, so lines of sight
        // over the sill reach twice the sill's height at the box.
        let z = eye.z + sill;
        let door = quad([[4.0, 1.0, z], [4.0, 3.0, z], [4.0, 3.0, 2.0], [4.0, 1.0, 2.0]]);
        let graph = CellGraph::new(2, [(door, [CellId(0), CellId(1)])]).unwrap();
        let room = |x: f64| Viewcell::from_box(DVec3::new(x, 0.0, -20.0), DVec3::new(x + 4.0, 4.0, 20.0));
        let mut cells = SceneCells::new(graph, Viewcells::new([room(0.0), room(4.0)]), 0.0).unwrap();
        cells.sync(&scene);
        assert_eq!(seen(&cells, &scene, &view(eye, eye + DVec3::X, 1.0)).1, sees, "sill {sill}");
    }
}
