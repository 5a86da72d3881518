//! Portal culling frame by frame: doors, one-way portals, objects that move, limits, queries of the last
//! frame, and hostile input.

use crate::maze::{Camera, Maze, Style};
use crate::room_row::{along, boxes, row_of_rooms, seen};
use std::sync::{Arc, RwLock};
use visibility_core::bake::Bake;
use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, Accuracy, Culler, ObjectId, Pipeline, Pose, Scene, View, VisibleSet,
    cells::{CellGraph, CellId, PortalId},
    geometry::{ConvexPolygon, Plane},
    pvs::{Pvs, PvsTargets, Viewcell, Viewcells},
    view::{Depth, Reach, ViewRegion, Window},
};
use visibility_portals::{
    BakerSettings, CellBaker, CellMatrix, NotCulled, Passage, PortalCuller, PortalEye, SceneCells,
    SceneCellsError, SharedPortalCuller,
};
use visibility_testing::{Random, cameras::DEPTHS};

/// Returns a [row of rooms](row_of_rooms), and a scene with one box in each room.
fn row(rooms: u32) -> (SceneCells, Scene, Vec<ObjectId>) {
    let mut cells = row_of_rooms(rooms);
    let (scene, ids) = boxes(rooms);
    cells.sync(&scene);
    (cells, scene, ids)
}

#[test]
fn closing_a_door_hides_what_is_behind_and_one_way_portals_only_from_one_side() {
    let (mut cells, scene, _) = row(4);
    let mut eye = PortalEye::new();
    assert_eq!(seen(&mut eye, &cells, &scene, &along()), [0, 1, 2, 3], "all doors are open");
    cells.set_open(PortalId(1), false).unwrap();
    assert_eq!(seen(&mut eye, &cells, &scene, &along()), [0, 1], "the second door is shut");
    cells.set_passage(PortalId(1), Passage::Forward).unwrap();
    assert_eq!(seen(&mut eye, &cells, &scene, &along()), [0, 1], "a shut door stays shut");
    cells.set_open(PortalId(1), true).unwrap();
    assert_eq!(
        seen(&mut eye, &cells, &scene, &along()),
        [0, 1, 2, 3],
        "the second door is open, and passed forwards"
    );
    cells.set_passage(PortalId(1), Passage::Backward).unwrap();
    assert_eq!(seen(&mut eye, &cells, &scene, &along()), [0, 1], "the second door is passed backwards alone");
    // From the other end of the row, one sees through the door if its passage is `Backward`, not `Forward`.
    let pose = Pose::look_at(DVec3::new(15.5, 2.0, 1.0), DVec3::new(0.0, 2.0, 1.0), DVec3::Z);
    let back = View::perspective(pose, 1.0, 1.5, 0.1, 100.0).unwrap();
    assert_eq!(
        seen(&mut eye, &cells, &scene, &back),
        [0, 1, 2, 3],
        "from the other end, backwards is the way"
    );
    cells.set_passage(PortalId(1), Passage::Forward).unwrap();
    assert_eq!(
        seen(&mut eye, &cells, &scene, &back),
        [2, 3],
        "from the other end, forwards is against the way"
    );
}

#[test]
fn objects_that_move_are_seen_at_once_and_hidden_when_taken_in() {
    let (mut cells, mut scene, ids) = row(3);
    cells.set_open(PortalId(0), false).unwrap();
    let mut eye = PortalEye::new();
    assert_eq!(seen(&mut eye, &cells, &scene, &along()), [0], "the first door is shut");
    // Before the sync a changed object is visible wherever it is.
    let moved = Aabb::from_arrays([9.0, 0.5, 0.5], [9.5, 1.0, 1.0]);
    scene.set_bounds(ids[1], moved).unwrap();
    let added = scene.insert(moved);
    assert_eq!(
        seen(&mut eye, &cells, &scene, &along()),
        [0, 1, 3],
        "the moved object and the new one, before the sync"
    );
    cells.sync(&scene);
    assert_eq!(cells.cells_of(ids[1]), [CellId(2)], "the moved object is in the third room");
    assert_eq!(seen(&mut eye, &cells, &scene, &along()), [0], "both are in the third room, after the sync");
    // Moves the object so that it spans the eye's room and the next.
    scene.set_bounds(added, Aabb::from_arrays([3.0, 1.0, 0.5], [5.0, 2.0, 1.0])).unwrap();
    cells.sync(&scene);
    assert_eq!(cells.cells_of(added), [CellId(0), CellId(1)], "the object spans two rooms");
    assert_eq!(
        seen(&mut eye, &cells, &scene, &along()),
        [0, 3],
        "the object that reaches into the eye's room"
    );
    // Moves the object out of all cells, where it is always visible. The index of a removed object is reused
    // by another object.
    scene.set_bounds(added, Aabb::from_arrays([0.0, 50.0, 0.0], [1.0, 51.0, 1.0])).unwrap();
    scene.remove(ids[2]).unwrap();
    let again = scene.insert(moved);
    assert_eq!(again.index(), ids[2].index(), "the new object takes the index of the old");
    cells.sync(&scene);
    assert_eq!(
        (cells.cells_of(ids[2]).len(), cells.cells_of(again).len()),
        (0, 1),
        "cells of the removed object and of the new one"
    );
    assert_eq!(seen(&mut eye, &cells, &scene, &along()), [0, 3], "the object outside all cells");
    // A clone is another scene, with which the cells were never synced.
    let (other, ..) = (scene.clone(), ());
    assert_eq!(seen(&mut eye, &cells, &other, &along()).len(), 4, "objects of a clone");
    assert_eq!(eye.stats().fallback, Some(NotCulled::NotSynced), "why nothing is culled");
}

#[test]
fn eyes_outside_and_views_that_begin_outside_fall_back_and_say_so() {
    let (cells, scene, _) = row(3);
    let mut eye = PortalEye::new();
    let look = |from: DVec3, near: f64| {
        let pose = Pose::look_at(from, DVec3::new(20.0, 2.0, 1.0), DVec3::Z);
        View::perspective(pose, 1.0, 1.5, near, 100.0).unwrap()
    };
    for (from, near) in [
        (DVec3::new(-1.0, 2.0, 1.0), 0.1),
        (DVec3::new(1.0, 2.0, 3.5), 0.1),
        (DVec3::new(1.0, 3.999, 1.0), 0.1),
        (DVec3::new(1e30, 2.0, 1.0), 0.1),
    ] {
        assert_eq!(seen(&mut eye, &cells, &scene, &look(from, near)), [0, 1, 2], "{from}");
        assert_eq!(eye.stats().fallback, Some(NotCulled::OutsideCells), "{from}");
        assert!(
            eye.sees(CellId(2)) && eye.seen_cells().count() == 0,
            "{from}: all cells are seen, none is listed"
        );
    }
    // The eye is behind the room, but the near plane lies inside: lines of sight begin at the near plane.
    assert_eq!(
        seen(&mut eye, &cells, &scene, &look(DVec3::new(-0.5, 2.0, 1.0), 0.6)),
        [0, 1, 2],
        "the near plane is in the first room"
    );
    assert_eq!(eye.stats().fallback, None, "the eye before the clip plane did not count");
    // A clip plane with the eye behind it: lines of sight begin on the part of the plane that is in the view,
    // which lies in a cell.
    let view = along().with_clip_planes(&[Plane::new(DVec3::X, -0.3)]).unwrap();
    assert_eq!(seen(&mut eye, &cells, &scene, &view), [0, 1, 2], "the clip plane is in the first room");
    assert_eq!(
        (eye.stats().fallback, eye.stats().starts),
        (None, 1),
        "one cell in which lines of sight begin"
    );
    // At this distance the part of the clip plane in the view reaches outside the cell.
    let view = along().with_clip_planes(&[Plane::new(DVec3::X, -7.0)]).unwrap();
    assert_eq!(seen(&mut eye, &cells, &scene, &view).len(), 3, "the clip plane reaches out of the rooms");
    assert_eq!(eye.stats().fallback, Some(NotCulled::OutsideCells), "why nothing is culled");
    // Parallel lines of sight.
    let pose = Pose::look_at(DVec3::new(0.5, 2.0, 1.0), DVec3::new(9.0, 2.0, 1.0), DVec3::Z);
    let narrow = View::orthographic(pose, Window::centered(1.2, 0.9), 0.0, 50.0).unwrap();
    assert_eq!(seen(&mut eye, &cells, &scene, &narrow), [0, 1, 2], "a narrow parallel view");
    assert_eq!(eye.stats().fallback, None, "a parallel view begins in the first room");
    // Objects beyond the far plane are not seen.
    let short = View::orthographic(pose, Window::centered(1.2, 0.9), 0.0, 3.0).unwrap();
    assert_eq!(seen(&mut eye, &cells, &scene, &short), [0], "a parallel view that ends after 3 m");
}

/// A ball of eyes that reaches out of the cells has no answer. One that reaches through a portal into the
/// next cell, or along a wall that it does not touch, has one.
#[test]
fn balls_that_reach_out_of_the_cells_have_no_answer() {
    let (mut cells, scene, _) = row(3);
    cells.set_open(PortalId(0), false).unwrap();
    let mut eye = PortalEye::new();
    let mut answer = |from: DVec3| {
        let pose = Pose::look_at(from, DVec3::new(20.0, 2.0, 1.0), DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.5, 0.1, 100.0).unwrap();
        let region = ViewRegion::around(&view, Reach::new(0.1, 0.1)).unwrap();
        let mut set = VisibleSet::new();
        set.fill(&scene, &view);
        eye.cull_region(&cells, &scene, &region, &mut set).map(|stats| stats.visible)
    };
    for (from, expected) in [
        (DVec3::new(1.0, 2.0, 1.0), Some(1)),
        (DVec3::new(1.0, 3.7, 1.0), Some(1)),
        (DVec3::new(1.0, 3.9, 1.0), None),
        (DVec3::new(1.0, 3.999, 1.0), None),
        (DVec3::new(1.0, 4.15, 1.0), None),
        (DVec3::new(3.95, 2.0, 1.0), Some(3)),
        (DVec3::new(3.95, 3.9, 1.0), None),
    ] {
        assert_eq!(answer(from), expected, "{from}: objects seen");
    }
}

#[test]
fn too_many_steps_fall_back_and_many_ways_are_put_together() {
    // One open hall divided into 12 x 12 cells by walls that are portals entirely: every path through the
    // hall is open.
    let n = 12u32;
    let cell = |x: u32, y: u32| CellId(y * n + x);
    let mut portals = Vec::new();
    for (x, y) in (0..n).flat_map(|x| (0..n).map(move |y| (x, y))) {
        let (a, b) = (f64::from(x), f64::from(y));
        let wall = |points: [[f64; 2]; 2]| {
            let [[x0, y0], [x1, y1]] = points;
            let corners = [[x0, y0, 0.0], [x1, y1, 0.0], [x1, y1, 1.0], [x0, y0, 1.0]];
            ConvexPolygon::new(corners.map(DVec3::from)).unwrap()
        };
        if x + 1 < n {
            portals.push((wall([[a + 1.0, b], [a + 1.0, b + 1.0]]), [cell(x, y), cell(x + 1, y)]));
        }
        if y + 1 < n {
            portals.push((wall([[a + 1.0, b + 1.0], [a, b + 1.0]]), [cell(x, y), cell(x, y + 1)]));
        }
    }
    let graph = CellGraph::new((n * n) as usize, portals).unwrap();
    graph.validate(1e-9).unwrap();
    let viewcells = (0..n * n).map(|i| {
        let at = DVec3::new(f64::from(i % n), f64::from(i / n), 0.0);
        Viewcell::from_box(at, at + 1.0)
    });
    let mut cells = SceneCells::new(graph, Viewcells::new(viewcells), 1e-6).unwrap();
    let mut scene = Scene::new();
    for i in 0..n * n {
        let (x, y) = ((i % n) as f32 + 0.4, (i / n) as f32 + 0.4);
        scene.insert(Aabb::from_arrays([x, y, 0.4], [x + 0.2, y + 0.2, 0.6]));
    }
    cells.sync(&scene);
    // From the corner of four cells, along the walls and the diagonal, where slivers of portals lead around
    // every corner in both directions.
    let mut worst = 0;
    for (at, to) in [
        ([6.0, 6.0], [12.0, 6.0]),
        ([6.0, 6.0], [12.0, 12.0]),
        ([0.5, 0.5], [12.0, 12.0]),
        ([6.5, 0.5], [6.5, 9.0]),
    ] {
        let point = |[x, y]: [f64; 2]| DVec3::new(x, y, 0.5);
        let pose = Pose::look_at(point(at), point(to), DVec3::Z);
        let view = View::perspective(pose, 1.5, 1.5, 0.01, f64::INFINITY).unwrap();
        let mut eye = PortalEye::new();
        let mut frustum = VisibleSet::new();
        frustum.fill(&scene, &view);
        visibility_core::FrustumCuller::new().cull(&scene, &view, &mut frustum);
        let mut visible = frustum.clone();
        eye.cull(&cells, &scene, &view, &mut visible);
        assert_eq!(eye.stats().fallback, None, "{at:?} to {to:?}: the walk ends within its steps");
        worst = worst.max(eye.stats().portals);
        // Nothing occludes: all objects in the frustum are visible.
        for id in frustum.iter(&scene) {
            assert!(visible.contains(&scene, id), "{at:?} to {to:?}: object {id}");
        }
        let mut limited = PortalEye::new().with_step_limit(40);
        let mut visible = frustum.clone();
        limited.cull(&cells, &scene, &view, &mut visible);
        assert_eq!(
            limited.stats().fallback,
            Some(NotCulled::Steps),
            "{at:?} to {to:?}: 40 steps are too few"
        );
        assert_eq!(
            visible.count(&scene),
            frustum.count(&scene),
            "{at:?} to {to:?}: objects left after too few steps"
        );
        // The next frame with the full limit is not affected by the aborted one.
        limited = limited.with_step_limit(20_000);
        let mut visible = frustum.clone();
        limited.cull(&cells, &scene, &view, &mut visible);
        assert_eq!(
            (limited.stats().portals, limited.stats().crossed),
            (eye.stats().portals, eye.stats().crossed),
            "{at:?} to {to:?}: portals looked at and crossed, after a frame that gave up"
        );
    }
    assert!(worst < 8_000, "{worst} portals looked at");
}

#[test]
fn questions_of_a_game_are_answered() {
    let (mut cells, scene, _) = row(5);
    let mut eye = PortalEye::new();
    seen(&mut eye, &cells, &scene, &along());
    assert_eq!(eye.seen_cells().collect::<Vec<_>>(), [0, 1, 2, 3, 4].map(CellId), "cells seen, in order");
    assert_eq!(
        eye.path_to(CellId(3)).collect::<Vec<_>>(),
        [2, 1, 0].map(PortalId),
        "portals on the way back from cell 3"
    );
    assert_eq!(eye.path_to(CellId(0)).count(), 0, "portals on the way back from the eye's cell");
    assert_eq!(eye.windows().count(), 4, "windows that are seen");
    let (portal, cell, corners) = eye.windows().next().unwrap();
    assert_eq!((portal, cell), (PortalId(0), CellId(1)), "the first window, and the cell behind it");
    assert!(
        corners.into_iter().all(|corner| (corner.x - 4.0).abs() < 1e-6),
        "the first window's corners are in its wall"
    );
    assert!(
        cells.can_see(CellId(0), CellId(4)) && cells.can_see_now(CellId(4), CellId(0)),
        "ends of the row see each other, doors open"
    );
    cells.set_open(PortalId(2), false).unwrap();
    assert!(
        cells.can_see(CellId(0), CellId(4)) && !cells.can_see_now(CellId(0), CellId(4)),
        "a shut door ends the sight of now"
    );
    assert!(
        cells.can_see_now(CellId(0), CellId(2)) && cells.can_see_now(CellId(3), CellId(4)),
        "both sides of the shut door"
    );
    cells.set_passage(PortalId(3), Passage::Forward).unwrap();
    assert!(
        cells.can_see_now(CellId(3), CellId(4)) && !cells.can_see_now(CellId(4), CellId(3)),
        "a one-way portal"
    );
    assert!(
        !cells.can_see(CellId(0), CellId(9)) && !cells.can_see_now(CellId(9), CellId(0)),
        "cells that do not exist"
    );
}

#[test]
fn objects_are_where_the_graph_lists_them_until_they_move() {
    let (cells, mut scene, ids) = row(3);
    let mut graph = cells.graph().clone();
    graph.set_objects([(CellId(2), ids[1]), (CellId(0), ids[2]), (CellId(2), ids[2])]).unwrap();
    let mut cells = SceneCells::new(graph, cells.viewcells().clone(), 1e-6).unwrap();
    cells.sync(&scene);
    assert_eq!(cells.cells_of(ids[0]), [CellId(0)], "not listed: by its box");
    assert_eq!(
        (cells.cells_of(ids[1]), cells.cells_of(ids[2])),
        (&[CellId(2)][..], &[CellId(0), CellId(2)][..]),
        "cells of objects that the graph lists"
    );
    scene.set_bounds(ids[1], scene.bounds(ids[1]).unwrap()).unwrap();
    cells.sync(&scene);
    assert_eq!(cells.cells_of(ids[1]), [CellId(1)], "the object has moved, and is where its box is");
}

#[test]
fn sets_limit_the_walk() {
    let (cells, scene, _) = row(5);
    // PVS rows that end at the second neighbour. They are wrong for this row of rooms, so that their effect
    // is visible.
    let rows: Vec<Vec<u32>> = (0..5u32).map(|a| (0..5).filter(|&b| a.abs_diff(b) <= 2).collect()).collect();
    let pvs = Pvs::new(PvsTargets::Cells, 5, &rows, |_| []).unwrap();
    let cells = cells.with_pvs(pvs).unwrap();
    let mut eye = PortalEye::new();
    assert_eq!(seen(&mut eye, &cells, &scene, &along()), [0, 1, 2], "the set ends the walk after two rooms");
    assert!(
        cells.can_see(CellId(0), CellId(2)) && !cells.can_see(CellId(0), CellId(3)),
        "the set of the first cell"
    );
    let pose = Pose::look_at(DVec3::new(6.0, 2.0, 1.0), DVec3::new(19.0, 2.0, 1.0), DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.5, 0.1, 100.0).unwrap();
    assert_eq!(seen(&mut eye, &cells, &scene, &view), [1, 2, 3], "the set of the second cell");
    let few = Pvs::new(PvsTargets::Cells, 4, &rows[..1], |_| []).unwrap();
    assert!(
        matches!(cells.with_pvs(few), Err(SceneCellsError::Pvs { cells: 5, viewcells: 1, targets: 4 })),
        "a set of fewer cells"
    );
}

/// Tests that pipelines of two eyes share cells whose doors the game opens, and that each says why its last
/// frame culled nothing.
#[test]
fn shared_cells_open_for_all_eyes_and_each_eye_says_why_it_culls_nothing() {
    let (cells, mut scene, ids) = row(4);
    assert!(
        PortalCuller::new(cells.clone()).hides_behind_undrawn(),
        "walls of cells are not asked for in the set"
    );
    let cells = Arc::new(RwLock::new(cells));
    assert!(SharedPortalCuller::new(cells.clone()).hides_behind_undrawn(), "nor are those of shared cells");
    let eye = || Pipeline::new().with(SharedPortalCuller::new(cells.clone()));
    let (mut pipelines, mut visible) = ([eye(), eye()], VisibleSet::new());
    let mut counts = |scene: &Scene, view: &View| {
        pipelines.each_mut().map(|pipeline| {
            pipeline.cull(scene, view, &mut visible);
            let mut lacks = Vec::new();
            pipeline.for_each_lack(scene, |stage, lack| lacks.push(format!("{stage}: {lack}")));
            (visible.count(scene), lacks)
        })
    };
    assert_eq!(
        counts(&scene, &along()),
        [(4, vec![]), (4, vec![])],
        "objects that two eyes see, and why not fewer"
    );
    cells.write().unwrap().set_open(PortalId(1), false).unwrap();
    assert_eq!(counts(&scene, &along()), [(2, vec![]), (2, vec![])], "a door was shut for both eyes");
    // The first of the two eyes syncs the moved object; the second uses the result.
    scene.set_bounds(ids[0], scene.bounds(ids[3]).unwrap()).unwrap();
    assert_eq!(
        counts(&scene, &along()),
        [(1, vec![]), (1, vec![])],
        "the moved object is taken in for both eyes"
    );
    let outside = vec!["portals: objects not culled, the eye being outside all cells: 4".to_owned()];
    let pose = Pose::look_at(DVec3::new(-50.0, 2.0, 1.0), DVec3::new(0.0, 2.0, 1.0), DVec3::Z);
    let far = View::perspective(pose, 1.0, 1.5, 0.1, 100.0).unwrap();
    assert_eq!(
        counts(&scene, &far),
        [(4, outside.clone()), (4, outside)],
        "both eyes are outside of the cells"
    );
    // If a panic poisoned the lock of the cells, nothing is hidden.
    let poisoned = std::panic::catch_unwind(|| {
        let _guard = cells.write().unwrap();
        panic!("a game that fails while it holds the cells");
    });
    assert!(poisoned.is_err() && cells.is_poisoned(), "the cells are poisoned");
    let lack = vec!["portals: objects not culled, a panic having left the cells: 4".to_owned()];
    assert_eq!(
        counts(&scene, &along()),
        [(4, lack.clone()), (4, lack)],
        "both eyes say that a panic left the cells"
    );
}

/// If a door moves within its wall, the numbers of cells, portals and volumes stay the same.
#[test]
fn sets_of_another_graph_are_refused_and_unknown_ones_promise_nothing() {
    let (cells, scene, _) = row(3);
    let bake =
        |graph: &CellGraph| Bake::new(CellBaker::new(graph, BakerSettings::default()).unwrap()).run().matrix;
    let moved = |by: f64| {
        let portals = cells.graph().portals().iter().map(|portal| {
            let vertices = portal.polygon().vertices().iter().map(|&v| v + DVec3::Y * by);
            (ConvexPolygon::new(vertices).unwrap(), portal.cells())
        });
        CellGraph::new(3, portals).unwrap()
    };
    let edited = moved(0.125);
    assert_eq!(moved(0.0).version(), cells.graph().version(), "the same portals have the same version");
    assert!(edited.version() != cells.graph().version(), "portals moved by 1/8 m have another");
    assert!(
        CellGraph::new(2, []).unwrap().version() != CellGraph::new(3, []).unwrap().version(),
        "another count of cells has another"
    );
    let pvs = |graph: &CellGraph| Pvs::from_bytes(bake(graph).to_pvs(graph).unwrap().as_bytes()).unwrap();
    let accuracy = |cells: SceneCells| {
        let (culler, mut lacks) = (PortalCuller::new(cells), Vec::new());
        culler.for_each_lack(&scene, &mut |lack| lacks.push(lack.to_string()));
        (culler.accuracy(), lacks)
    };
    let with = |pvs: Pvs| cells.clone().with_pvs(pvs);
    assert_eq!(
        accuracy(with(pvs(cells.graph())).unwrap()),
        (Accuracy::Conservative, Vec::new()),
        "a set of this graph"
    );
    let refused = with(pvs(&edited)).err();
    assert_eq!(refused, Some(SceneCellsError::OtherGraph), "a set of another graph");
    assert!(refused.unwrap().to_string().ends_with("bake again"), "the error says what to do");
    // It is unknown from which graph these matrices were baked: one was read from bytes, the other is
    // converted with another graph.
    let matrix = CellMatrix::from_bytes(3, &bake(&edited).to_bytes()).unwrap();
    assert_eq!(matrix, bake(&edited), "a matrix from bytes is equal");
    for unknown in [matrix.to_pvs(cells.graph()), bake(&edited).to_pvs(cells.graph())] {
        let unknown = unknown.unwrap();
        assert_eq!(unknown.source(), None, "a set without a known graph");
        let lack = "cells with a PVS that may be of another graph: 3".to_owned();
        assert_eq!(
            accuracy(with(unknown.clone()).unwrap()),
            (Accuracy::Approximate, vec![lack]),
            "what an unknown set promises, and lacks"
        );
        let promised = unknown.with_source(cells.graph().version());
        assert_eq!(
            accuracy(with(promised).unwrap()).0,
            Accuracy::Conservative,
            "a set that the caller vouches for"
        );
    }
}

#[test]
fn errors_name_what_is_wrong() {
    let (cells, ..) = row(3);
    let graph = cells.graph().clone();
    let said = |error: SceneCellsError| error.to_string();
    let none = SceneCells::new(graph.clone(), Viewcells::default(), 0.0).unwrap_err();
    assert_eq!(said(none), "0 viewcells for 3 cells: each cell needs one", "no viewcells");
    for tolerance in [-1.0, f64::NAN, f64::INFINITY] {
        let error = SceneCells::new(graph.clone(), cells.viewcells().clone(), tolerance).unwrap_err();
        assert!(
            said(error).starts_with("the tolerance cannot be"),
            "the error names the tolerance {tolerance}"
        );
    }
    let mut cells = cells;
    assert_eq!(
        said(cells.set_open(PortalId(2), true).unwrap_err()),
        "there is no portal 2",
        "a portal that does not exist"
    );
    assert!(!cells.is_open(PortalId(2)), "a portal that does not exist is not open");
    let door = graph.portals()[0].polygon();
    assert_eq!(
        cells.add_mirror(CellId(3), door),
        Err(SceneCellsError::UnknownCell(CellId(3))),
        "a mirror in a cell that does not exist"
    );
    assert_eq!(
        cells.add_mirror(CellId(0), &ConvexPolygon::default()),
        Err(SceneCellsError::NoPlane),
        "a mirror without vertices"
    );
}

/// The objects of a reflection are the result of a frame: an object that comes later is not among them, and
/// the others stay.
#[test]
fn what_a_mirror_shows_survives_changes_of_the_scene() {
    let (mut cells, mut scene, ids) = row(2);
    let corners = [[1.0, 0.5], [1.0, 2.0], [3.0, 2.0], [3.0, 0.5]];
    let glass = ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(8.0, y, z))).unwrap();
    cells.add_mirror(CellId(1), &glass).unwrap();
    let mut eye = PortalEye::new();
    seen(&mut eye, &cells, &scene, &along());
    let [reflection] = eye.reflections() else { panic!("one mirror is seen") };
    assert!(reflection.visible().is_finished(), "the set of a reflection");
    let shown = |scene: &Scene| reflection.visible().iter(scene).collect::<Vec<_>>();
    assert_eq!(shown(&scene), ids, "objects in the mirror");
    for step in 0..70 {
        scene.insert(Aabb::from_arrays([1.0 + 0.01 * step as f32, 1.0, 0.0], [3.0, 3.0, 1.0]));
    }
    scene.rebuild();
    assert_eq!(shown(&scene), ids, "objects in the mirror, once others have come");
    scene.remove(ids[0]).unwrap();
    assert_eq!(shown(&scene), ids[1..], "objects in the mirror, once one of them has gone");
}

/// A matrix in `f32` whose far plane is more than 2^24 times as far as its near plane has no far plane left:
/// its row of depth rounds to that of `w`, but for the offset. Doors and mirrors do without it.
#[test]
fn a_far_plane_that_single_precision_rounds_away_is_no_reason_to_cull_nothing() {
    let (mut cells, scene, _) = row(4);
    let corners = [[1.0, 0.5], [1.0, 2.0], [3.0, 2.0], [3.0, 0.5]];
    let glass = ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(8.0, y, z))).unwrap();
    cells.add_mirror(CellId(1), &glass).unwrap();
    let (near, far) = (0.01f32, 1e6);
    let slope: f32 = far / (far - near);
    assert_eq!(slope, 1.0, "depth per metre, rounded");
    // Along x, from (0.5, 2, 1).
    let matrix =
        [[0.0, 0.0, slope, 1.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [2.0, -1.0, -0.5 - near, -0.5]];
    let view = View::from_clip_from_world(matrix, Depth::ZeroToOne).unwrap();
    let mut eye = PortalEye::new();
    cells.set_open(PortalId(1), false).unwrap();
    assert_eq!(seen(&mut eye, &cells, &scene, &view), [0, 1], "objects before the shut door");
    assert_eq!(eye.stats().fallback, None, "reason to cull nothing");
    assert_eq!(eye.reflections().len(), 1, "mirrors that are seen");
}

/// Overlapping cells, NaN viewcells, huge and tiny scales: every frame ends without a panic.
#[test]
fn no_input_panics_or_hangs() {
    let (mut random, mut accepted) = (Random(5), 0);
    for scale in [1e-150, 1e-30, 1.0, 1e9, 1e30, 1e150] {
        for _ in 0..6 {
            let wild = |random: &mut Random| match random.below(9) {
                0 => f64::NAN,
                1 => f64::INFINITY,
                2 => 0.0,
                _ => random.fine_range(-1.0, 1.0) * scale,
            };
            let point = |random: &mut Random| random.fine_vector(1.0) * scale;
            let portals: Vec<_> = (0..60)
                .filter_map(|_| {
                    let (a, b, c) = (point(&mut random), point(&mut random), point(&mut random));
                    let (from, to) = (random.below(12) as u32, random.below(12) as u32);
                    (from != to)
                        .then(|| ConvexPolygon::new([a, b, c]).ok())
                        .flatten()
                        .map(|p| (p, [CellId(from), CellId(to)]))
                })
                .collect();
            let Ok(graph) = CellGraph::new(12, portals) else { continue };
            let viewcells: Vec<_> = (0..12)
                .map(|_| {
                    let (a, b) = (point(&mut random), point(&mut random));
                    let plane = Plane::new(random.fine_vector(1.0), wild(&mut random));
                    Viewcell { min: a.min(b), max: a.max(b), planes: vec![plane] }
                })
                .collect();
            // With a tolerance as large as everything, each portal may count as between its cells.
            let tolerance = random.fine_unit() * random.pick(&[1e-9, 10.0, 10.0]) * scale;
            let Ok(mut cells) = SceneCells::new(graph, Viewcells::new(viewcells), tolerance) else {
                continue;
            };
            accepted += 1;
            for cell in 0..12 {
                let p = [(); 3].map(|()| point(&mut random));
                if let Ok(mirror) = ConvexPolygon::new(p) {
                    cells.add_mirror(CellId(cell), &mirror).unwrap();
                }
            }
            let mut scene = Scene::new();
            for _ in 0..50 {
                let p = [(); 6].map(|()| wild(&mut random) as f32);
                scene.insert(Aabb::from_arrays([p[0], p[1], p[2]], [p[3], p[4], p[5]]));
            }
            let mut culler = PortalCuller::new(cells);
            let mut visible = VisibleSet::new();
            for i in 0..20 {
                let view = if i % 3 == 0 {
                    let matrix: [f64; 16] = std::array::from_fn(|_| random.fine_range(-1.0, 1.0) * scale);
                    View::from_clip_from_world(matrix, DEPTHS[i % 6])
                } else {
                    let eye = point(&mut random);
                    let pose = Pose::look_at(eye, eye + random.fine_vector(1.0), random.fine_vector(1.0));
                    View::perspective(pose, 1.0, 1.0, 1e-3 * scale, scale)
                };
                let Ok(view) = view else { continue };
                visible.fill(&scene, &view);
                culler.cull(&scene, &view, &mut visible);
                assert!(
                    culler.eye().stats().portals <= 20_000 * 9,
                    "scale {scale}: portals looked at: {}",
                    culler.eye().stats().portals
                );
            }
        }
    }
    assert!(accepted > 12, "{accepted}");
}

/// An aborted frame, or a frame of other cells, does not affect later frames.
#[test]
fn frames_do_not_depend_on_the_frames_before() {
    let mut random = Random(8);
    let style = Style { turned: false, slivers: false, mirrors: true, shift: 0.0, tolerance: 1e-9 };
    let mazes = [Maze::new(&mut random, [4, 4, 2], style), Maze::new(&mut random, [3, 5, 2], style)];
    let mut used = PortalEye::new();
    for number in 0..200 {
        let maze = &mazes[random.below(2)];
        let room = random.below(maze.rooms());
        let at = maze.to_world(maze.point_in(&mut random, room));
        let camera = Camera::new(&mut random, at, number % 5 == 0);
        used = used.with_step_limit(if random.below(3) == 0 { 5 } else { 20_000 });
        let fresh = PortalEye::new();
        let mut fresh = if number % 7 == 0 { fresh.with_step_limit(0) } else { fresh };
        seen(&mut used, &maze.cells, &maze.scene, &camera.view);
        used = used.with_step_limit(if number % 7 == 0 { 0 } else { 20_000 });
        let sets = [&mut used, &mut fresh].map(|eye| {
            let set = seen(eye, &maze.cells, &maze.scene, &camera.view);
            let reflected: Vec<_> =
                eye.reflections().iter().map(|one| one.visible().count(&maze.scene)).collect();
            (set, reflected, eye.stats())
        });
        assert_eq!(sets[0], sets[1], "frame {number}");
    }
}
