//! Tests of prioritized-layered projection on every scene: the conservative form hides no object that an item
//! buffer of 2560 x 1440 sees, and the approximate form reproduces the result of its paper on a small scale.

use crate::shared_scenes::scene;
use glam::DVec3;
use std::sync::Arc;
use visibility_examples::plp::{Method, TriangleWorld, coverage};
use visibility_examples::walkthrough::{World, cullers, judge, run};
use visibility_examples::{SceneSource, built_in};
use visibility_measure::ItemBuffer;
use visibility_plp::{OctreeTessellation, Solidity};

/// Width and height in pixels of the item buffer that judges the cullers.
const JUDGE: (u32, u32) = (2560, 1440);

/// Culls a scene in `frames` frames spread evenly over its walks, or at every key if `frames` is `None`, and
/// fails if a conservative culler hides a visible object.
fn check(source: SceneSource, frames: Option<usize>) {
    let world = World::new(source, JUDGE, frames).unwrap();
    let list = "frustum,cplp,cplp:10%,cplp:0%";
    let trials: Vec<_> = cullers::parse(list, &world)
        .unwrap()
        .into_iter()
        .map(|(name, pipeline)| run(name, pipeline, &world))
        .collect();
    let judgement = judge(&world, &trials, || ()).unwrap();
    print!("{}: {} frames, exact {:.1}", world.source.name, world.views.len(), judgement.mean_exact());
    for (trial, verdict) in trials.iter().zip(&judgement.verdicts) {
        print!(", {} {:.1}", trial.name, trial.mean_visible());
        assert!(trial.accuracy.never_hides(), "{} is conservative", trial.name);
        assert_eq!(verdict.false_hidden, 0, "{}, {}: {:?}", world.source.name, trial.name, verdict.hidden);
    }
    println!();
}

/// Runs [`check`] on reference scenes, given by name.
fn check_stored(names: &[&str], frames: Option<usize>) {
    names.iter().for_each(|name| check(scene(name), frames));
}

#[test]
fn nothing_visible_is_hidden_in_built_in_scenes() {
    for name in ["plpcity:1,1", "london", "town", "office"] {
        check(built_in(name).unwrap(), Some(2));
    }
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn nothing_visible_is_hidden_in_reference_scenes() {
    check_stored(&["clinic", "denhaag", "oa_dm2"], Some(2));
}

/// Test of complete walks through all scenes, which takes minutes in release.
#[test]
#[ignore = "minutes"]
fn nothing_visible_is_hidden_on_whole_walks() {
    for name in ["plpcity:3,3", "london", "town", "forest", "office:7,24"] {
        check(built_in(name).unwrap(), None);
    }
    check_stored(&["clinic", "clinic_mep", "denhaag", "alpine1", "oa_dm2", "cars5"], None);
}

#[test]
fn projection_misses_less_than_half_of_what_sorting_by_distance_misses() {
    let world = World::new(built_in("plpcity:2,2").unwrap(), (320, 320), Some(9)).unwrap();
    let world = TriangleWorld::new(&world);
    let cells = Arc::new(OctreeTessellation::new(&world.scene));
    let mut methods = [
        Method::centroid(&world),
        Method::plp("coverage", &world, cells.clone(), Solidity::Coverage),
        Method::plp("count", &world, cells, Solidity::Count),
    ];
    let coverage = coverage(&world, &mut methods, [320, 320], || ()).unwrap();
    for budget in 0..4 {
        let missed = [0, 1, 2].map(|method| coverage.missed(method, budget));
        println!("{missed:?}, {:.3}", coverage.ratio(1, budget));
        assert!(missed[1] * 2 <= missed[0] && missed[1] < missed[2], "budget {budget}: {missed:?}");
    }
    assert!(
        coverage.ratio(1, 3) > 0.97 && coverage.worst(1, 3) < 0.01,
        "{} of the pixels are right, {} wrong in the worst frame",
        coverage.ratio(1, 3),
        coverage.worst(1, 3)
    );
}

/// Asserts that projection finds, at each budget, at most 1 % less of the visible triangles than sorting by
/// distance.
fn check_against_distance(source: SceneSource, size: [u32; 2], frames: usize) {
    let world = World::new(source, size.into(), Some(frames)).unwrap();
    let world = TriangleWorld::new(&world);
    let cells = Arc::new(OctreeTessellation::new(&world.scene));
    let mut methods = [Method::centroid(&world), Method::plp("coverage", &world, cells, Solidity::Coverage)];
    let coverage = coverage(&world, &mut methods, size, || ()).unwrap();
    for budget in 0..4 {
        let [nearest, projected] = [0, 1].map(|method| coverage.ratio(method, budget));
        println!("{}: {nearest:.3} {projected:.3}", world.name);
        assert!(projected >= nearest - 0.01, "{}, budget {budget}: {projected} of {nearest}", world.name);
    }
}

#[test]
fn projection_never_loses_to_sorting_by_distance() {
    check_against_distance(built_in("london").unwrap(), [320, 180], 12);
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn projection_never_loses_to_sorting_by_distance_on_real_scenes() {
    for name in ["oa_dm2", "denhaag", "alpine1"] {
        check_against_distance(scene(name), [640, 360], 12);
    }
}

#[test]
fn triangles_are_seen_where_the_origin_of_their_world_is() {
    let near = built_in("plpcity:1,1").unwrap();
    let mut far = near.clone();
    let origin = DVec3::new(1e6, 0.0, 2e6);
    far.origin = origin;
    far.walks.iter_mut().for_each(|walk| walk.map(|point| point + origin));
    let seen = [near, far].map(|source| {
        let world = TriangleWorld::new(&World::new(source, (64, 64), Some(1)).unwrap());
        let seen = world.see(&world.views[0], &mut ItemBuffer::new(64, 64).unwrap()).unwrap();
        (world.by_distance(&world.views[0], &seen.candidates), seen.visible)
    });
    assert!(!seen[0].1.is_empty(), "triangles are visible");
    assert!(seen[0] == seen[1], "{} candidates by distance, or visible triangles, differ", seen[0].0.len());
}
