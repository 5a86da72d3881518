//! Tests of sets made ahead of an eye, and of who sees whom, through the C interface: the answers are those
//! of the Rust crates on the same scene, which changes between frames.

mod common;

use common::{make, message, ok, returns};
use std::ptr::{null, null_mut};
use visibility::vis_answer::*;
use visibility::vis_opacity::*;
use visibility::vis_status::*;
use visibility::*;
use visibility_2d::cdt::{Opacity, Plan, PlanCells, Wall};
use visibility_core::bake::Bake;
use visibility_core::cells::{CellGraph, CellId};
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_core::who_sees::{Reach, SightCells, ViewcellMatrix, WhoSees};
use visibility_core::{
    Culler, FrustumCuller, Object, ObjectId, OccluderMesh, Pipeline, Pose, Scene, View, VisibleSet,
};
use visibility_portals::{BakerSettings, CellBaker};
use visibility_region::{ExtendedProjectionCuller, OnlineCells, OnlinePvs};
use visibility_testing::Random;

/// Sizes of viewcells and of wide boxes, in metres.
const SIZES: [[f64; 3]; 2] = [[0.6; 3], [4.0, 4.0, 1.0]];

/// A town, as a scene of the C library and as one of Rust, that are changed alike.
struct Town {
    c: *mut vis_scene,
    rust: Scene,
    ids: Vec<(u64, ObjectId)>,
}

impl Town {
    /// Makes 40 walls in two directions, and 200 small objects.
    fn new(rng: &mut Random) -> Self {
        let mut town = Self { c: make(vis_scene_create), rust: Scene::new(), ids: Vec::new() };
        for i in 0..40 {
            let (x, y) = (rng.range(-30.0, 30.0) as f32, rng.range(-30.0, 30.0) as f32);
            let (width, depth) = if i % 2 == 0 { (8.0, 0.3) } else { (0.3, 8.0) };
            town.insert(vis_box { min: [x, y, -1.0], max: [x + width, y + depth, 3.0] }, true);
        }
        for _ in 0..200 {
            town.insert(small(rng), false);
        }
        town
    }

    fn insert(&mut self, bounds: vis_box, occludes: bool) {
        let flags = if occludes { VIS_OBJECT_OCCLUDER } else { 0 };
        let desc = vis_object_desc { flags, ..vis_object_default(bounds) };
        let (mut id, mut mesh) = (0, 0);
        let object = self.rust.insert(Object { occluder: occludes, ..Object::new(bounds.into()) });
        // SAFETY: the scene is live.
        unsafe {
            ok(vis_scene_insert(self.c, &raw const desc, &raw mut id));
            if occludes {
                ok(vis_scene_add_box_mesh(self.c, &raw const bounds, &raw mut mesh));
                ok(vis_scene_set_mesh(self.c, id, mesh, null()));
                let mesh = self.rust.add_mesh(OccluderMesh::cuboid(&bounds.into()).expect("a box"));
                self.rust.set_mesh(object, mesh, Affine3A::IDENTITY).expect("an object");
            }
        }
        self.ids.push((id, object));
    }

    fn remove(&mut self, at: usize) {
        let (id, object) = self.ids.remove(at);
        // SAFETY: the scene is live.
        ok(unsafe { vis_scene_remove(self.c, id) });
        self.rust.remove(object).expect("an object");
    }

    /// Moves, adds or removes an object; of walls, removes one or makes it hide nothing.
    fn change(&mut self, rng: &mut Random) {
        let at = rng.below(self.ids.len());
        let ((id, object), bounds) = (self.ids[at], small(rng));
        let is_wall = self.rust.object(object).expect("an object").occluder;
        // SAFETY: the scene is live.
        unsafe {
            match rng.below(3) {
                0 => self.insert(bounds, false),
                1 => self.remove(at),
                _ if is_wall => {
                    ok(vis_scene_set_flags(self.c, id, 0));
                    self.rust.set_occluder(object, false).expect("an object");
                }
                _ => {
                    ok(vis_scene_set_bounds(self.c, id, &raw const bounds));
                    self.rust.set_bounds(object, bounds.into()).expect("an object");
                }
            }
        }
    }
}

/// Returns the bounds of an object of half a metre.
fn small(rng: &mut Random) -> vis_box {
    let corner = [rng.range(-30.0, 30.0) as f32, rng.range(-30.0, 30.0) as f32, rng.range(-1.0, 1.0) as f32];
    vis_box { min: corner, max: corner.map(|x| x + 0.5) }
}

fn new_online() -> *mut vis_online {
    let mut online = null_mut();
    // SAFETY: `online` is memory for the result.
    ok(unsafe { vis_online_create(SIZES[0].as_ptr(), SIZES[1].as_ptr(), 0.0, &raw mut online) });
    online
}

/// Reads a list by calling `write` twice: first for the length, then for the list.
fn list<T: Copy + Default>(write: impl Fn(*mut T, usize, *mut usize) -> vis_status) -> Vec<T> {
    let mut count = 0;
    ok(write(null_mut(), 0, &raw mut count));
    let mut items = vec![T::default(); count];
    ok(write(items.as_mut_ptr(), count, &raw mut count));
    items
}

/// Returns the indices of objects of the C library.
fn indices(ids: Vec<u64>) -> Vec<usize> {
    ids.into_iter().map(|id| id as u32 as usize).collect()
}

#[test]
fn frames_answer_as_in_rust_while_the_scene_changes() {
    let rng = &mut Random(42);
    let mut town = Town::new(rng);
    let (view, pipeline, online) = (make(vis_view_create), make(vis_pipeline_create), new_online());
    let mut visible = null_mut();
    let mut rust_online = OnlinePvs::new(SIZES[0].into(), SIZES[1].into()).unwrap();
    let (mut frustum, mut rust_visible) = (Pipeline::new().with(FrustumCuller::new()), VisibleSet::new());
    let (mut answers, mut hidden, mut came, mut went) = ([0; 3], 0, 0, 0);
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        ok(vis_visible_create(false, &raw mut visible));
        ok(vis_pipeline_add_frustum(pipeline));
        ok(vis_pipeline_add_online(pipeline, online));
        for frame in 0..60 {
            if frame % 7 == 3 {
                town.change(rng);
            }
            let eye = DVec3::new(0.05 * f64::from(frame) - 2.0, 0.3, 0.5);
            let places = [0.0, 0.1, 0.2, 0.4].map(|seconds| (eye + DVec3::X * 3.0 * seconds).to_array());
            let budget = rng.pick(&[0, 300, u32::MAX]);
            for _ in 0..rng.below(10) {
                let mut work = vis_online_work::default();
                let flat = places.as_ptr().cast();
                ok(vis_online_step(online, town.c, flat, 4, budget, &raw mut work));
                let expected = rust_online.step(&town.rust, &places.map(DVec3::from), budget);
                let expected = expected.map_or_else(vis_online_work::default, |step| vis_online_work {
                    worked: true,
                    wide: step.is_wide,
                    finished: step.is_last,
                    stats: work.stats,
                });
                assert_eq!(work, expected, "work of a step of frame {frame}");
            }
            let turn = 0.3 * f64::from(frame);
            let target = eye + DVec3::new(turn.cos(), turn.sin(), 0.0);
            let pose = vis_pose { eye: eye.into(), target: target.into(), up: [0.0, 0.0, 1.0] };
            ok(vis_view_set_perspective(view, &raw const pose, 1.2, 1.5, 0.02, 100.0));
            ok(vis_pipeline_cull(pipeline, town.c, view, visible, null_mut()));
            let pose = Pose::look_at(eye, target, DVec3::Z);
            let rust_view = View::perspective(pose, 1.2, 1.5, 0.02, 100.0).expect("a camera");
            frustum.cull(&town.rust, &rust_view, &mut rust_visible);
            let in_frustum = rust_visible.count(&town.rust);
            rust_online.cull(&town.rust, &rust_view, &mut rust_visible);
            hidden += in_frustum - rust_visible.count(&town.rust);
            let of_rust = |ids: &[ObjectId]| ids.iter().map(|id| id.index()).collect::<Vec<_>>();
            let ids = list(|ids, size, count| vis_visible_ids(visible, town.c, ids, size, count));
            assert_eq!(indices(ids), of_rust(rust_visible.ids(&town.rust)), "visible objects, frame {frame}");
            let ids = list(|ids, size, count| vis_online_came(online, ids, size, count));
            came += ids.len();
            assert_eq!(indices(ids), of_rust(rust_online.came()), "what came, frame {frame}");
            let ids = list(|ids, size, count| vis_online_went(online, ids, size, count));
            went += ids.len();
            assert_eq!(indices(ids), of_rust(rust_online.went()), "what went, frame {frame}");
            let mut answer = VIS_ANSWER_NONE;
            ok(vis_online_answer(online, &raw mut answer));
            let expected = match rust_online.answer() {
                None => VIS_ANSWER_NONE,
                Some(_) if rust_online.is_ready() => VIS_ANSWER_VIEWCELL,
                Some(_) => VIS_ANSWER_WIDE,
            };
            assert_eq!(answer, expected, "what answered frame {frame}");
            answers[answer as usize] += 1;
            let (min, max) = (eye - 0.05, eye + 0.05);
            let corners = [min.to_array(), max.to_array()];
            let words = list(|words, size, count| {
                let [min, max] = [corners[0].as_ptr(), corners[1].as_ptr()];
                vis_online_write_hidden(online, town.c, min, max, words, size, count)
            });
            let bits = (0..32 * words.len()).filter(|&index| words[index / 32] >> (index % 32) & 1 != 0);
            let expected = rust_online.hidden_from(&town.rust, min, max);
            let expected: Vec<usize> = expected.into_iter().flat_map(|bits| bits.iter()).collect();
            assert_eq!(bits.collect::<Vec<_>>(), expected, "objects hidden from a box, frame {frame}");
            assert_eq!(
                words.len(),
                town.rust.index_limit().div_ceil(32),
                "words of a bit an object, frame {frame}"
            );
        }
        // The pipeline keeps the sets.
        vis_online_destroy(online);
        ok(vis_pipeline_cull(pipeline, town.c, view, visible, null_mut()));
    }
    assert!(
        answers.iter().all(|&count| count > 0),
        "frames with no answer, a wide box's, a viewcell's: {answers:?}"
    );
    assert!(hidden > 100 && came > 0 && went > 0, "{hidden} hidden, {came} came, {went} went");
}

/// Returns movers in a square of the town.
fn movers(rng: &mut Random, count: usize) -> Vec<vis_reach> {
    let mover = |_| {
        let at = [rng.range(-8.0, 8.0), rng.range(-8.0, 8.0), 0.0];
        vis_reach { min: at, max: at.map(|x| x + 0.4), margin: rng.range(0.0, 0.5) }
    };
    (0..count).map(mover).collect()
}

/// Looks by both libraries, and compares all answers. Returns how many pairs see each other.
fn look(
    who_sees: (*mut vis_who_sees, &mut WhoSees),
    cells: (*mut vis_sight_cells, &mut dyn SightCells),
    scene: *const vis_scene,
    movers: &[vis_reach],
) -> usize {
    let (c, rust) = who_sees;
    let (all, some) = (movers.len(), movers.len() / 3);
    let reach = |r: &vis_reach| Reach { min: r.min.into(), max: r.max.into(), margin: r.margin };
    let reaches: Vec<Reach> = movers.iter().map(reach).collect();
    rust.look(cells.1, &reaches[..some], &reaches);
    // SAFETY: handles are live, and arrays as long as said.
    unsafe { ok(vis_who_sees_look(c, cells.0, scene, movers.as_ptr(), some, movers.as_ptr(), all)) };
    (0..some)
        .map(|observer| {
            // SAFETY: the handle is live, and the list is as long as said.
            let seen = list(|to, size, count| unsafe { vis_who_sees_seen_by(c, observer, to, size, count) });
            let expected: Vec<u32> = rust.seen_by(observer).map(|target| target as u32).collect();
            assert_eq!(seen, expected, "targets that observer {observer} sees");
            for target in 0..all {
                let mut sees = false;
                // SAFETY: the handle is live.
                ok(unsafe { vis_who_sees_sees(c, observer, target, &raw mut sees) });
                assert_eq!(sees, expected.contains(&(target as u32)), "pair {observer}, {target}");
            }
            seen.len()
        })
        .sum()
}

/// Boxes of 2 m that cover a square of the town.
fn grid() -> Vec<[f64; 6]> {
    let of = |i: usize| {
        let (x, y) = (2.0 * (i / 10) as f64 - 10.0, 2.0 * (i % 10) as f64 - 10.0);
        [x, y, -1.0, x + 2.0, y + 2.0, 1.0]
    };
    (0..100).map(of).collect()
}

#[test]
fn movers_in_a_changing_scene_see_each_other_as_in_rust() {
    let rng = &mut Random(7);
    let mut town = Town::new(rng);
    // Long walls between lanes of the boxes.
    for y in [-6.0, -2.0, 2.0, 6.0] {
        town.insert(vis_box { min: [-30.0, y, -9.0], max: [30.0, y + 0.1, 9.0] }, true);
    }
    let boxes = grid();
    let of = |corners: &[f64; 6]| {
        Viewcell::from_box(DVec3::from_slice(&corners[..3]), DVec3::from_slice(&corners[3..]))
    };
    let viewcells = Viewcells::new(boxes.iter().map(of));
    let (who_sees, mut rust_who_sees) = (make(vis_who_sees_create), WhoSees::new());
    let (mut online, mut cells, mut still) = (null_mut(), null_mut(), null_mut());
    let sizes = [DVec3::new(2.5, 2.5, 2.0), DVec3::new(6.0, 6.0, 3.0)];
    let mut rust_online = OnlinePvs::new(sizes[0], sizes[1]).unwrap().with_margin(0.75);
    let movers = movers(rng, 24);
    let middles: Vec<[f64; 3]> = movers[..8].iter().map(|m| m.min.map(|x| x + 0.2)).collect();
    let mut seen = Vec::new();
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        let flat = boxes.as_ptr().cast();
        ok(vis_online_create(
            sizes[0].to_array().as_ptr(),
            sizes[1].to_array().as_ptr(),
            0.75,
            &raw mut online,
        ));
        ok(vis_sight_cells_create_of_scene(town.c, flat, 100, &raw mut still));
        let mut rust_still =
            ViewcellMatrix::of_scene::<ExtendedProjectionCuller>(&town.rust, viewcells.clone());
        ok(vis_sight_cells_create_online(town.c, online, flat, 100, &raw mut cells));
        let rust_cells = OnlineCells::new(&mut town.rust, viewcells);
        let objects = list(|ids, size, count| vis_sight_cells_objects(cells, ids, size, count));
        let expected: Vec<usize> = rust_cells.objects().iter().map(|id| id.index()).collect();
        assert_eq!(indices(objects.clone()), expected, "objects of the boxes");
        let count = list::<u64>(|ids, size, count| vis_sight_cells_objects(still, ids, size, count)).len();
        assert_eq!(count, 0, "sight cells of a scene that stands still add no objects");
        seen.push(look((who_sees, &mut rust_who_sees), (still, &mut rust_still), null(), &movers));
        for round in 0..3 {
            for step in 0..200 {
                let mut work = vis_online_work::default();
                let places = middles.as_ptr().cast();
                ok(vis_online_step(online, town.c, places, 8, 5000, &raw mut work));
                let places: Vec<DVec3> = middles.iter().map(|&place| place.into()).collect();
                let expected = rust_online.step(&town.rust, &places, 5000);
                assert_eq!(work.worked, expected.is_some(), "step {step} of round {round}");
            }
            let mut rust_cells = rust_cells.with(&town.rust, &mut rust_online);
            seen.push(look((who_sees, &mut rust_who_sees), (cells, &mut rust_cells), town.c, &movers));
            drop(rust_cells);
            town.remove(town.ids.len() - 1);
            town.change(rng);
        }
        let looked = vis_who_sees_look(who_sees, cells, null(), movers.as_ptr(), 8, movers.as_ptr(), 24);
        refused(looked, VIS_ERROR_NULL, "the pointer `scene` is null");
        // Without its objects no box is known to be hidden.
        ok(vis_scene_remove(town.c, objects[0]));
        ok(vis_who_sees_look(who_sees, cells, town.c, movers.as_ptr(), 8, movers.as_ptr(), 24));
        let all = list::<u32>(|to, size, count| vis_who_sees_seen_by(who_sees, 0, to, size, count)).len();
        assert_eq!(all, 24, "all see all once an object of a box is removed");
    }
    assert!(seen.iter().all(|&seen| (9..8 * 24 - 20).contains(&seen)), "pairs of {}: {seen:?}", 8 * 24);
}

#[test]
fn movers_on_a_plan_see_each_other_as_in_rust_while_doors_move() {
    let rng = &mut Random(3);
    let opacities = [
        (VIS_OPACITY_OPAQUE, Opacity::Opaque),
        (VIS_OPACITY_CLEAR, Opacity::Clear),
        (VIS_OPACITY_ONE_WAY, Opacity::OneWay),
    ];
    let (mut walls, mut rust_walls) = (Vec::new(), Vec::new());
    for _ in 0..40 {
        let from = [rng.range(-9.0, 9.0), rng.range(-9.0, 9.0)];
        let to = [from[0] + rng.range(-6.0, 6.0), from[1] + rng.range(-6.0, 6.0)];
        let (opacity, rust_opacity) = rng.pick(&opacities);
        walls.push(vis_wall { from, to, opacity: opacity as u32 });
        rust_walls.push(Wall::new(from, to).with_opacity(rust_opacity));
    }
    let mut rust_cells = PlanCells::new(Plan::new(&rust_walls).expect("a plan"), [1, 0]).expect("two axes");
    let (who_sees, mut rust_who_sees) = (make(vis_who_sees_create), WhoSees::new());
    let (mut cells, mut seen) = (null_mut(), Vec::new());
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        ok(vis_sight_cells_create_of_plan(walls.as_ptr(), 40, 1, 0, &raw mut cells));
        for _ in 0..8 {
            let movers = movers(rng, 24);
            seen.push(look((who_sees, &mut rust_who_sees), (cells, &mut rust_cells), null(), &movers));
            let (wall, (opacity, rust_opacity)) = (rng.below(40) as u32, rng.pick(&opacities));
            ok(vis_sight_cells_set_opacity(cells, wall, opacity as u32));
            rust_cells.set_opacity(wall, rust_opacity).expect("a wall");
        }
        vis_who_sees_destroy(who_sees);
        vis_sight_cells_destroy(cells);
    }
    assert!(seen.iter().all(|&seen| (9..8 * 24 - 20).contains(&seen)), "pairs of {}: {seen:?}", 8 * 24);
}

#[test]
fn movers_in_rooms_see_each_other_as_in_rust() {
    // The first and the third room open into the second by doors in one plane: no line leads from one of them
    // into the other.
    let doors = [0.0, 6.0].map(|y| [[4.0, y, 0.0], [4.0, y + 1.0, 0.0], [4.0, y + 1.0, 2.0], [4.0, y, 2.0]]);
    let rooms =
        [([0.0; 3], [4.0, 4.0, 3.0]), ([4.0, 0.0, 0.0], [8.0, 8.0, 3.0]), ([0.0, 5.0, 0.0], [4.0, 8.0, 3.0])];
    let made = doors
        .map(|door| door.map(DVec3::from))
        .into_iter()
        .zip([[CellId(0), CellId(1)], [CellId(2), CellId(1)]]);
    let rust_graph = CellGraph::from_vertices(3, made).expect("a graph");
    let baked = Bake::new(CellBaker::new(&rust_graph, BakerSettings::default()).expect("a baker")).run();
    let rust_pvs = baked.matrix.to_pvs(&rust_graph).expect("a set");
    let viewcells = Viewcells::new(rooms.map(|(min, max)| Viewcell::from_box(min.into(), max.into())));
    let mut rust_cells = ViewcellMatrix::of_portals(&rust_graph, viewcells, &rust_pvs, 1e-6).expect("rooms");
    let portals = [0, 1].map(|i| vis_portal { first_vertex: 4 * i, vertex_count: 4, cells: [2 * i, 1] });
    let volumes = rooms.map(|(min, max)| vis_volume { min, max, first_plane: 0, plane_count: 0 });
    let rng = &mut Random(1);
    let mover = |i: usize| {
        let corner = rooms[i % 3].0;
        let at = [corner[0] + rng.range(0.2, 3.2), corner[1] + rng.range(0.2, 2.2), 0.2];
        vis_reach { min: at, max: at.map(|x| x + 0.4), margin: 0.1 }
    };
    let movers: Vec<vis_reach> = (0..24).map(mover).collect();
    let (who_sees, mut rust_who_sees) = (make(vis_who_sees_create), WhoSees::new());
    let (mut graph, mut pvs, mut cells) = (null_mut(), null_mut(), null_mut());
    // SAFETY: handles are live, and arrays as long as said.
    unsafe {
        ok(vis_graph_create(3, portals.as_ptr(), 2, doors.as_ptr().cast(), 8, &raw mut graph));
        ok(vis_graph_bake(graph, 0.0, &raw mut pvs));
        let make = |tolerance, pvs, cells| {
            vis_sight_cells_create_of_portals(graph, volumes.as_ptr(), 3, null(), 0, tolerance, pvs, cells)
        };
        ok(make(1e-6, pvs, &raw mut cells));
        let seen = look((who_sees, &mut rust_who_sees), (cells, &mut rust_cells), null(), &movers);
        assert!(seen > 24 && seen < 8 * 24 - 20, "pairs of {}: {seen}", 8 * 24);
        refused(make(f64::NAN, pvs, &raw mut cells), VIS_ERROR_ARGUMENT, "the tolerance cannot be NaN");
        let (ends, targets, mut other) = ([1_usize, 2, 3], [0_u32, 1, 2], null_mut());
        ok(vis_pvs_create(3, ends.as_ptr(), 3, targets.as_ptr(), 3, &raw mut other));
        let made = make(0.0, other, &raw mut cells);
        refused(made, VIS_ERROR_ARGUMENT, "the set is not of these cells and portals");
    }
}

/// Asserts that a call failed with the expected status and message.
#[track_caller]
fn refused(status: vis_status, expected: vis_status, said: &str) {
    returns(status, expected);
    assert_eq!(message(), said, "message of a call that was refused with {expected:?}");
}

#[test]
fn mistakes_are_refused_by_name() {
    let (scene, online, pipeline) = (make(vis_scene_create), new_online(), make(vis_pipeline_create));
    let (who_sees, mut cells, mut made) = (make(vis_who_sees_create), null_mut(), null_mut());
    let (size, wide, at) = ([0.6; 3], [4.0; 3], [0.0; 3]);
    let reach = vis_reach { min: [0.0; 3], max: [1.0; 3], margin: 0.0 };
    // SAFETY: null is allowed everywhere; all other pointers are live, and arrays as long as said.
    unsafe {
        let create = |size: &[f64; 3], wide: &[f64; 3], margin, to| {
            vis_online_create(size.as_ptr(), wide.as_ptr(), margin, to)
        };
        for (bad, said) in [
            ([0.6, f64::NAN, 0.6], "on axis 1, viewcells of NaN m do not fit into wide boxes of 4 m"),
            ([0.6, 0.6, 0.0], "on axis 2, viewcells of 0 m do not fit into wide boxes of 4 m"),
            ([5.0, 0.6, 0.6], "on axis 0, viewcells of 5 m do not fit into wide boxes of 4 m"),
        ] {
            refused(create(&bad, &wide, 0.0, &raw mut made), VIS_ERROR_ARGUMENT, said);
        }
        returns(create(&size, &[f64::INFINITY; 3], 0.0, &raw mut made), VIS_ERROR_ARGUMENT);
        returns(create(&size, &[f64::NAN; 3], 0.0, &raw mut made), VIS_ERROR_ARGUMENT);
        refused(
            create(&size, &wide, f64::NAN, &raw mut made),
            VIS_ERROR_ARGUMENT,
            "the margin cannot be NaN",
        );
        refused(create(&size, &wide, -1.0, &raw mut made), VIS_ERROR_ARGUMENT, "the margin cannot be -1");
        refused(create(&size, &wide, 0.1, null_mut()), VIS_ERROR_NULL, "the pointer `online` is null");
        refused(
            vis_online_create(null(), null(), 0.0, &raw mut made),
            VIS_ERROR_NULL,
            "the pointer `viewcell` is null",
        );
        assert!(made.is_null(), "no sets are made");
        let step =
            |online, scene, places, count| vis_online_step(online, scene, places, count, 10, null_mut());
        refused(step(null_mut(), scene, at.as_ptr(), 1), VIS_ERROR_NULL, "the pointer `online` is null");
        refused(step(online, null(), at.as_ptr(), 1), VIS_ERROR_NULL, "the pointer `scene` is null");
        refused(step(online, scene, null(), 1), VIS_ERROR_NULL, "the pointer `places` is null");
        let places = [0.0, 0.0, 0.0, 0.0, f64::NAN, 0.0];
        refused(step(online, scene, places.as_ptr(), 2), VIS_ERROR_ARGUMENT, "place 1 is not finite");
        ok(step(online, scene, places.as_ptr(), 1));
        ok(step(online, scene, null(), 0));
        let (mut words, mut count) = ([7_u32; 1], 7);
        let mut hide = |min: &[f64; 3], max: &[f64; 3]| {
            vis_online_write_hidden(
                online,
                scene,
                min.as_ptr(),
                max.as_ptr(),
                words.as_mut_ptr(),
                1,
                &raw mut count,
            )
        };
        refused(hide(&at, &[f64::INFINITY; 3]), VIS_ERROR_ARGUMENT, "`max` is not finite");
        refused(hide(&[f64::NAN; 3], &at), VIS_ERROR_ARGUMENT, "`min` is not finite");
        assert_eq!((count, words), (7, [7]), "a refused call writes nothing");
        returns(vis_online_answer(online, null_mut()), VIS_ERROR_NULL);
        returns(vis_online_answer(null(), &mut VIS_ANSWER_NONE), VIS_ERROR_NULL);
        returns(vis_online_came(online, null_mut(), 0, null_mut()), VIS_ERROR_NULL);
        refused(vis_pipeline_add_online(pipeline, null()), VIS_ERROR_NULL, "the pointer `online` is null");

        let wall = |opacity| vis_wall { from: [0.0; 2], to: [0.0, 1.0], opacity };
        let plan =
            |wall: vis_wall, x, y, cells| vis_sight_cells_create_of_plan(&raw const wall, 1, x, y, cells);
        refused(plan(wall(3), 0, 1, &raw mut cells), VIS_ERROR_ARGUMENT, "3 is no vis_opacity");
        let said = "a plan lies along two of the axes 0 to 2, not 2 and 2";
        refused(plan(wall(0), 2, 2, &raw mut cells), VIS_ERROR_ARGUMENT, said);
        let far = vis_wall { to: [f64::NAN, 1.0], ..wall(0) };
        let said = "point (NaN, 1.0) of number 0 has a coordinate that is no number up to 1e60";
        refused(plan(far, 0, 1, &raw mut cells), VIS_ERROR_ARGUMENT, said);
        for bad in [
            [0.0, 0.0, f64::NAN, 1.0, 1.0, 1.0],
            [2.0, 0.0, 0.0, 1.0, 1.0, 1.0],
            [0.0, 0.0, 0.0, 1.0, f64::INFINITY, 1.0],
        ] {
            let said = "box 0 is inverted or not finite";
            let made = vis_sight_cells_create_of_scene(scene, bad.as_ptr(), 1, &raw mut cells);
            refused(made, VIS_ERROR_ARGUMENT, said);
            let made = vis_sight_cells_create_online(scene, online, bad.as_ptr(), 1, &raw mut cells);
            refused(made, VIS_ERROR_ARGUMENT, said);
        }
        assert!(cells.is_null(), "no sight cells are made");
        ok(vis_scene_count(scene, &raw mut count));
        assert_eq!(count, 0, "refused sight cells add no objects");
        ok(vis_sight_cells_create_of_scene(scene, null(), 0, &raw mut cells));
        let said = "the sight cells are of no plan, and have no walls";
        refused(vis_sight_cells_set_opacity(cells, 0, 0), VIS_ERROR_UNKNOWN_ID, said);
        ok(plan(wall(0), 0, 1, &raw mut cells));
        refused(vis_sight_cells_set_opacity(cells, 0, 9), VIS_ERROR_ARGUMENT, "9 is no vis_opacity");
        let said = "wall 1 is unknown: the plan has 1, numbered from 0";
        refused(vis_sight_cells_set_opacity(cells, 1, 0), VIS_ERROR_UNKNOWN_ID, said);

        let sees = |observer, target| vis_who_sees_sees(who_sees, observer, target, &mut false);
        refused(sees(0, 0), VIS_ERROR_UNKNOWN_ID, "the answer has 0 observers, and no observer 0");
        let look = |cells, one: &[vis_reach], all: &[vis_reach]| {
            vis_who_sees_look(who_sees, cells, null(), one.as_ptr(), one.len(), all.as_ptr(), all.len())
        };
        ok(look(cells, &[reach], &[reach, reach]));
        for bad in [
            vis_reach { min: [f64::NAN, 0.0, 0.0], ..reach },
            vis_reach { max: [f64::INFINITY; 3], ..reach },
            vis_reach { min: [2.0; 3], ..reach },
            vis_reach { margin: f64::NAN, ..reach },
            vis_reach { margin: -1.0, ..reach },
        ] {
            let said =
                "needs a finite box that is not inverted, and a margin that is finite and not negative";
            refused(look(cells, &[bad], &[]), VIS_ERROR_ARGUMENT, &format!("observer 0 {said}"));
            refused(look(cells, &[], &[reach, bad]), VIS_ERROR_ARGUMENT, &format!("target 1 {said}"));
        }
        refused(look(null_mut(), &[], &[]), VIS_ERROR_NULL, "the pointer `cells` is null");
        ok(sees(0, 1));
        refused(sees(1, 0), VIS_ERROR_UNKNOWN_ID, "the answer has 1 observers, and no observer 1");
        refused(sees(0, 2), VIS_ERROR_UNKNOWN_ID, "the answer has 2 targets, and no target 2");
        returns(vis_who_sees_seen_by(who_sees, 1, null_mut(), 0, &raw mut count), VIS_ERROR_UNKNOWN_ID);
        vis_online_destroy(null_mut());
        vis_sight_cells_destroy(null_mut());
        vis_who_sees_destroy(null_mut());
    }
}
