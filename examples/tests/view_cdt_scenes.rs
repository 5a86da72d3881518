//! Tests of the triangulated image on every scene: no object that an item buffer of 2560 x 1440 sees is
//! hidden, with any setting.
#![allow(missing_docs)]

mod shared_scenes;

use shared_scenes::scene;
use visibility_examples::walkthrough::{World, cullers, judge, run};
use visibility_examples::{SceneSource, built_in};

/// Width and height in pixels of the item buffer that judges the cullers.
const JUDGE: (u32, u32) = (2560, 1440);

/// Culls a scene in `frames` frames, and fails if a visible object is hidden.
fn check(source: SceneSource, frames: usize) {
    let world = World::new(source, JUDGE, Some(frames)).unwrap();
    let entries =
        "frustum,view-cdt,view-cdt:192,view-cdt-whole,view-cdt-cells,view-cdt-incident,hzb,occlusion-tree";
    let trials: Vec<_> = cullers::parse(entries, &world)
        .unwrap()
        .into_iter()
        .map(|(name, pipeline)| run(name, pipeline, &world))
        .collect();
    let judgement = judge(&world, &trials, || ()).unwrap();
    print!("{}: exact {:.1}", world.source.name, judgement.mean_exact());
    for (trial, verdict) in trials.iter().zip(&judgement.verdicts) {
        print!(", {} {:.1}", trial.name, trial.mean_visible());
        assert_eq!(verdict.false_hidden, 0, "{}, {}: {:?}", world.source.name, trial.name, verdict.hidden);
    }
    println!();
}

#[test]
fn nothing_visible_is_hidden_in_built_in_scenes() {
    for name in ["plpcity", "london", "town", "forest", "office"] {
        check(built_in(name).unwrap(), 9);
    }
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are not beside the checkout")]
fn nothing_visible_is_hidden_in_reference_scenes() {
    for name in ["denhaag", "alpine1", "oa_dm2"] {
        check(scene(name), 9);
    }
    for name in ["clinic and its pipes", "cars5"] {
        check(scene(name), 6);
    }
}
