//! Tests of frames that end when the caller says so: by a clock of the caller, by levels of detail, and of
//! the budget that a frame took.

use crate::common::{looking_along_x, rooms, run, triangles, views};
use visibility_core::{Aabb, Object, ObjectId, Scene, View, VisibleSet};
use visibility_plp::{Budget, Fineness, OctreeTessellation, Pace, PlpCuller};

/// Small leaves, so that small test scenes have many cells.
const FINE: Fineness = Fineness { vertices: 24, halvings: 7 };

/// Runs a frame over all objects of a scene and returns the objects kept, in the set's order.
fn run_while(
    culler: &mut PlpCuller<&OctreeTessellation>,
    scene: &Scene,
    view: &View,
    keep: impl FnMut(ObjectId, f32) -> bool,
) -> Vec<ObjectId> {
    let mut visible = VisibleSet::new();
    visible.fill(scene, view);
    culler.cull_while(scene, view, &mut visible, keep);
    visible.iter(scene).collect()
}

/// Each object takes between 1 and 7 us of a fake clock. A frame ends at the first object that is asked for
/// after the time is over, and keeps the same objects as a longer frame does first.
#[test]
fn a_frame_ends_when_the_clock_of_the_caller_says_so() {
    let scene = triangles(31, 1500);
    let cells = OctreeTessellation::from_scene(&scene, FINE);
    let mut culler = PlpCuller::new(&cells, Budget::Objects(usize::MAX));
    let mut ended = 0;
    for view in views() {
        let all = run(&mut culler, &scene, &view);
        for limit in [0, 1, 40, 700] {
            let (mut clock, mut granted, mut asked) = (0u64, 0, Vec::new());
            let kept = run_while(&mut culler, &scene, &view, |id, priority| {
                assert!((0.0..=1.0).contains(&priority), "priority {priority} of {id}");
                asked.push(id);
                let is_time_left = clock < limit;
                if is_time_left {
                    clock += 1 + id.index() as u64 % 7;
                    granted += 1;
                }
                is_time_left
            });
            assert_eq!(kept, all[..kept.len()], "the first objects of the frame without a limit");
            assert_eq!(asked[..kept.len()], kept, "objects asked for before they are kept");
            assert_eq!(kept.len(), granted, "objects kept and objects granted in {limit} us");
            if kept.len() < all.len() {
                ended += 1;
                assert_eq!(asked.len(), kept.len() + 1, "one object is refused in {limit} us");
                assert!(clock >= limit && clock < limit + 7, "{clock} us of {limit}");
            }
            assert_eq!(culler.spent(), kept.len() as u64, "objects that the frame took");
        }
    }
    assert!(ended > 60, "{ended} frames were ended by the clock");
}

/// With levels of detail, the budget holds for the triangles of the levels that are drawn: distant objects
/// are drawn with a fifth of their triangles, so more of them fit.
#[test]
fn the_cost_of_levels_of_detail_is_what_the_caller_charges() {
    let (scene, ..) = rooms(12);
    let cells = OctreeTessellation::from_scene(&scene, FINE);
    let view = looking_along_x(1.0);
    let budget = 300;
    let finest = run(&mut PlpCuller::new(&cells, Budget::Cost(budget)), &scene, &view);
    let mut culler = PlpCuller::new(&cells, Budget::Objects(usize::MAX));
    let mut left = budget;
    let kept = run_while(&mut culler, &scene, &view, |id, _| {
        let object = scene.object(id).unwrap();
        let is_near = scene.bounds(id).unwrap().min.x < 5.0;
        let cost = u64::from(object.cost) / if is_near { 1 } else { 5 };
        let fits = cost <= left;
        left -= if fits { cost } else { 0 };
        fits
    });
    assert_eq!(finest.len(), 25, "objects of 12 triangles each in 300");
    assert_eq!(kept[..25], finest, "the same objects first");
    assert!(kept.len() > 80 && left < 12, "{} objects, {left} of the budget left", kept.len());
}

#[test]
fn objects_in_no_cell_are_told_first_and_kept_whatever_the_answer() {
    let mut scene = triangles(33, 300);
    let cells = OctreeTessellation::from_scene(&scene, FINE);
    let new = scene.insert(Object { cost: 9, ..Object::new(Aabb::from_arrays([1.0; 3], [2.0; 3])) });
    let mut culler = PlpCuller::new(&cells, Budget::Cost(1000));
    let mut asked = Vec::new();
    let kept = run_while(&mut culler, &scene, &looking_along_x(-60.0), |id, priority| {
        asked.push((id, priority));
        false
    });
    assert_eq!(kept, [new], "objects kept of a frame that wants none");
    assert_eq!((asked[0], asked.len()), ((new, 1.0), 2), "the new object, and the first of the cells");
    assert_eq!(culler.spent(), 9, "the cost of the new object");
    let other = rooms(2).0;
    run_while(&mut culler, &other, &looking_along_x(0.0), |_, _| {
        panic!("cells of another scene ask nothing")
    });
    assert_eq!(culler.spent(), 0, "the cost of a frame of another scene");
}

/// A machine that draws 3 units of cost a microsecond, after 100 us for each frame: frames come to take the
/// wanted time, measured by a fake clock.
#[test]
fn a_pace_finds_the_budget_of_a_machine() {
    let scene = triangles(34, 2000);
    let cells = OctreeTessellation::from_scene(&scene, FINE);
    let mut pace = Pace::new(0.1);
    let mut culler = PlpCuller::new(&cells, pace.budget(200.0));
    let view = looking_along_x(-100.0);
    let mut took = 0.0;
    for _ in 0..60 {
        culler.set_budget(pace.budget(200.0));
        run(&mut culler, &scene, &view);
        took = 100.0 + culler.spent() as f64 / 3.0;
        pace.record(culler.spent(), took);
    }
    assert!((198.0..=200.5).contains(&took), "{took} us of 200");
    assert!((295..=301).contains(&culler.spent()), "{} objects", culler.spent());
}

/// Objects of 12 units of cost, on a machine that draws one unit a microsecond after 100 us for each frame.
/// A pace whose budget is below the cost of any object does not stick at an empty picture, whether the first
/// estimate of the speed was too low or the machine has stalled for many frames.
#[test]
fn a_pace_below_the_cost_of_any_object_recovers() {
    let (scene, ..) = rooms(12);
    let cells = OctreeTessellation::from_scene(&scene, FINE);
    let mut stalled = Pace::new(1.0);
    (0..90).for_each(|_| stalled.record(900, 1e9));
    for mut pace in [Pace::new(0.001), Pace::new(1e-9), stalled] {
        assert_eq!(pace.budget(1000.0), Budget::Cost(1), "a budget below the cost of any object");
        let mut culler = PlpCuller::new(&cells, pace.budget(1000.0));
        let mut took = 0.0;
        for _ in 0..90 {
            culler.set_budget(pace.budget(1000.0));
            run(&mut culler, &scene, &looking_along_x(1.0));
            assert!(culler.spent() > 0, "an empty picture at {pace:?}");
            took = 100.0 + culler.spent() as f64;
            pace.record(culler.spent(), took);
        }
        assert!((980.0..=1001.0).contains(&took), "{took} us of 1000");
    }
}

#[test]
fn a_budget_of_cost_admits_one_object_and_no_budget_none() {
    let (mut scene, ..) = rooms(12);
    let cells = OctreeTessellation::from_scene(&scene, FINE);
    let kept = |scene: &Scene, cost| {
        let mut culler = PlpCuller::new(&cells, Budget::Cost(cost));
        (run(&mut culler, scene, &looking_along_x(1.0)).len(), culler.spent())
    };
    let counts = [0, 1, 11, 12, 23, 24].map(|cost| kept(&scene, cost));
    assert_eq!(counts, [(0, 0), (1, 12), (1, 12), (1, 12), (1, 12), (2, 24)], "objects and their cost");
    // An object in no cell takes from the budget first, and is then the one that is admitted.
    scene.insert(Object { cost: 9, ..Object::new(Aabb::from_arrays([1.0; 3], [2.0; 3])) });
    assert_eq!([10, 21].map(|cost| kept(&scene, cost)), [(1, 9), (2, 21)], "with an object in no cell");
}
