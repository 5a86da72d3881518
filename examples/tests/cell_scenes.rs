//! Tests that potentially visible sets of cells never miss an object that an item buffer sees from random
//! eyes in the cells.
//!
//! `cargo test --release cell_scenes -- --ignored --nocapture` repeats the test with 1,000 eyes in the
//! largest office.

use crate::shared_scenes::{assert_none_hidden, scene};
use visibility_core::glam::DVec3;
use visibility_core::{Pose, View, cells::CellId, pvs::Viewcells};
use visibility_examples::pvs::built::Origin;
use visibility_examples::pvs::solids::boxes;
use visibility_examples::pvs::stabs::Random;
use visibility_examples::walkthrough::cell_sets::{
    CELL_STEPS, Detail, cell_rows, objects, sets_of, settings,
};
use visibility_examples::walkthrough::{World, cullers, judge, run};
use visibility_examples::{SceneSource, built_in};

/// Makes `count` views from random positions in random cells in random directions. Positions inside `solids`
/// (minimum and maximum corner) are avoided, and cells thinner than a centimetre: between a wall and a slab
/// that nearly touch, an eye sees along gaps narrower than the tolerance with which cells are made.
fn random_views(viewcells: &Viewcells, solids: &[[DVec3; 2]], count: usize, seed: u64) -> Vec<View> {
    let solid = |p: DVec3| solids.iter().any(|[min, max]| min.cmple(p).all() && p.cmple(*max).all());
    let mut random = Random(seed);
    let mut views = Vec::new();
    while views.len() < count {
        let cell = &viewcells.cells()[random.below(viewcells.cells().len())];
        let mut at = |i: usize| random.between(cell.min[i], cell.max[i]);
        let eye = DVec3::new(at(0), at(1), at(2));
        if (cell.max - cell.min).min_element() < 0.01 || !cell.contains(eye) || solid(eye) {
            continue;
        }
        let direction = random.direction();
        let up = if direction.z.abs() < 0.9 { DVec3::Z } else { DVec3::X };
        let pose = Pose::look_at(eye, eye + direction, up);
        // A near plane at 1 cm would cut openings into walls close to the eye.
        views.push(View::perspective(pose, 1.6, 16.0 / 9.0, 1e-5, f64::INFINITY).unwrap());
    }
    views
}

/// Runs the cullers in `list` from `eyes` random eyes, and fails if the item buffer sees an object that a
/// culler hid. Returns the mean number of objects that each culler reports.
fn check(mut world: World, viewcells: &Viewcells, list: &str, eyes: usize) -> Vec<f64> {
    world.views = random_views(viewcells, &boxes(&world.source), eyes, 11);
    let trials: Vec<_> = cullers::parse(list, &world)
        .unwrap()
        .into_iter()
        .map(|(name, pipeline)| run(name, pipeline, &world))
        .collect();
    let judgement = judge(&world, &trials, || ()).unwrap();
    println!("{}: {eyes} eyes, exact {:.1}", world.source.name, judgement.mean_exact());
    for (trial, verdict) in trials.iter().zip(&judgement.verdicts) {
        println!(
            "{}: {:.1} objects, {} false hidden",
            trial.name,
            trial.mean_visible(),
            verdict.false_hidden
        );
        for (view, hidden) in world.views.iter().zip(&verdict.hidden).filter(|(_, hidden)| !hidden.is_empty())
        {
            let names: Vec<_> = hidden.iter().map(|&i| &world.source.objects[i as usize].name).collect();
            println!("  from {:?}: {names:?}", view.eye(DVec3::ZERO));
        }
        assert_eq!(verdict.false_hidden, 0, "{}", trial.name);
    }
    trials.iter().map(visibility_examples::walkthrough::Trial::mean_visible).collect()
}

/// Culls an office of the given sizes from `eyes` random eyes with sets of whole cells, of objects, and of
/// cells made from geometry. Fails if a visible object is hidden, or if finer sets do not cull more.
fn check_office(sizes: &str, eyes: usize) {
    let world = World::new(built_in(&format!("office:{sizes}")).unwrap(), (1280, 720), Some(1)).unwrap();
    let viewcells = world.source.cells.as_ref().unwrap().viewcells.clone();
    let means = check(world, &viewcells, "frustum,pvs:cells,pvs,pvs:walls,pvs:bsp", eyes);
    let [frustum, cells, objects, walls, polygons] = means[..] else { panic!("{means:?}") };
    assert!(objects < cells && cells < 0.8 * frustum, "{means:?}");
    // Cells made from geometry are smaller, and bounded by furniture and windows as well.
    assert!(walls < 1.2 * objects && polygons < 1.2 * objects, "{means:?}");
}

#[test]
fn no_object_of_an_office_is_missed() {
    check_office("2,8", 60);
}

#[test]
#[ignore = "minutes"]
fn no_object_of_the_largest_office_is_missed() {
    check_office("7,24", 1000);
}

/// Culls a scene of a file from `eyes` random eyes in cells made from its triangles, by portals and by sets
/// of objects. Fails if a visible object is hidden, or if either culler leaves more than `share` of the
/// objects that the frustum leaves.
fn check_file(name: &str, eyes: usize, share: f64) {
    let mut world = World::new(scene(name), (1280, 720), Some(1)).unwrap();
    world.makes_cells = true;
    let viewcells = world.cells().unwrap().viewcells.clone();
    let means = check(world, &viewcells, "frustum,portals,pvs", eyes);
    assert!(means[1].max(means[2]) < share * means[0], "{means:?}");
}

#[test]
#[ignore = "a minute"]
fn no_object_of_an_arena_is_missed() {
    check_file("oa_dm2", 1000, 0.7);
}

#[test]
#[ignore = "two minutes"]
fn no_object_of_a_clinic_is_missed() {
    check_file("clinic", 400, 0.9);
}

#[test]
fn objects_are_those_of_seen_cells_and_fewer() {
    let world = World::new(built_in("office:2,8").unwrap(), (64, 36), Some(1)).unwrap();
    let cells = world.cells().unwrap();
    let (graph, settings) = (&cells.graph, settings(&cells.viewcells, CELL_STEPS));
    let baked = cell_rows(graph, settings).unwrap();
    let outcome = objects(&world.scene, graph, &baked, settings).unwrap();
    assert!(outcome.complete && outcome.fallbacks.is_empty(), "all objects are decided");
    let mut by_cells = 0;
    for cell in (0..graph.cell_count() as u32).map(CellId) {
        let row = &outcome.rows[cell.index()];
        let mut all: Vec<u32> = baked
            .matrix
            .seen_from(cell)
            .flat_map(|seen| graph.objects_in(seen))
            .map(|id| id.index() as u32)
            .collect();
        all.sort_unstable();
        all.dedup();
        assert!(
            row.iter().all(|object| all.binary_search(object).is_ok()),
            "{cell:?}: an object outside of the cells seen"
        );
        // Objects in the cell itself are visible from it.
        assert!(
            graph.objects_in(cell).iter().all(|id| row.binary_search(&(id.index() as u32)).is_ok()),
            "{cell:?}: an object in the cell itself is not seen"
        );
        by_cells += all.len();
    }
    let mean = by_cells as f64 / graph.cell_count() as f64;
    assert!(outcome.mean_visible() < 0.95 * mean, "{} of {mean}", outcome.mean_visible());
    println!("{:.1} objects of {mean:.1} in the cells seen", outcome.mean_visible());
}

#[test]
fn sets_are_baked_once_and_compose() {
    let world = World::new(built_in("office:1,4").unwrap(), (64, 36), Some(3)).unwrap();
    let [a, b] = [0, 1].map(|_| sets_of(&world, Origin::Given, Detail::Objects).unwrap());
    assert!(std::sync::Arc::ptr_eq(&a, &b), "sets are baked once");
    let pipelines = cullers::parse("pvs,pvs+hzb,pvs:cells", &world).unwrap();
    let reports: Vec<_> =
        pipelines.into_iter().map(|(name, p)| run(name, p, &world).mean_visible()).collect();
    assert!(reports[1] <= reports[0] && reports[0] <= reports[2], "{reports:?}");
    let outdoors = World::new(built_in("town:1").unwrap(), (64, 36), Some(1)).unwrap();
    assert!(
        cullers::parse("pvs", &outdoors).is_err() && cullers::parse("pvs:soon", &world).is_err(),
        "sets of a scene without cells, and an unknown setting"
    );
}

/// Checks portal culling on the walks of an office: no false hidden object, and at most 1.3 times as many
/// objects reported as visible. `frames` is the number of frames, `None` for every key.
fn check_walks(sizes: &str, frames: Option<usize>) {
    let world = World::new(built_in(&format!("office:{sizes}")).unwrap(), (640, 360), frames).unwrap();
    let pipelines = cullers::parse("portals,portals:rectangle,pvs+portals", &world).unwrap();
    let trials: Vec<_> = pipelines.into_iter().map(|(name, pipeline)| run(name, pipeline, &world)).collect();
    let judgement = judge(&world, &trials, || ()).unwrap();
    for (trial, verdict) in trials.iter().zip(&judgement.verdicts) {
        let ratio = trial.mean_visible() / judgement.mean_exact();
        println!("{}: {ratio:.3} times the exact set", trial.name);
        assert_eq!(verdict.false_hidden, 0, "{}: {:?}", trial.name, verdict.hidden);
        assert!(ratio < 1.3, "{}: {ratio}", trial.name);
    }
}

#[test]
fn walks_through_portals_report_little_more_than_shows() {
    check_walks("2,16", Some(32));
}

/// Makes a world without cells of its own, as for a program that makes cells.
fn without_cells(mut source: SceneSource, size: (u32, u32), frames: usize) -> World {
    source.cells = None;
    let mut world = World::new(source, size, Some(frames)).unwrap();
    world.makes_cells = true;
    world
}

/// Walks a scene with cells made from its triangles. Fails if a culler in `list` hides a visible object, or
/// if the second culler reports more than `share` of the objects that the first reports.
fn check_made(source: SceneSource, frames: usize, list: &str, share: f64) {
    let world = without_cells(source, (640, 360), frames);
    let pipelines = cullers::parse(list, &world).unwrap();
    let trials: Vec<_> = pipelines.into_iter().map(|(name, pipeline)| run(name, pipeline, &world)).collect();
    assert_none_hidden(&world, &trials);
    let [all, left] = [0, 1].map(|i| trials[i].mean_visible());
    assert!(left <= share * all, "{}: {left} of {all} objects", world.source.name);
}

#[test]
fn cells_are_made_where_a_culler_asks_and_the_scene_brings_none() {
    check_made(built_in("office:2,8").unwrap(), 24, "frustum,portals,pvs:cells,pvs", 0.6);
    check_made(built_in("town:1").unwrap(), 8, "frustum,portals,pvs", 1.0);
    // By default, a world makes no cells.
    let mut world = without_cells(built_in("office:1,2").unwrap(), (64, 36), 1);
    world.makes_cells = false;
    assert!(cullers::parse("portals", &world).is_err(), "portals of a scene without cells");
}

#[test]
#[ignore = "a minute"]
fn made_cells_of_buildings_from_files_hide_nothing_visible() {
    check_made(scene("clinic"), 112, "frustum,portals,portals:rectangle", 0.5);
    check_made(scene("oa_dm2"), 96, "frustum,portals,portals:rectangle", 0.5);
}

#[test]
#[ignore = "half a minute"]
fn walks_through_the_largest_office_report_little_more_than_shows() {
    check_walks("7,24", None);
}
