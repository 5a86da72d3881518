//! Trials of the methods for viewcells on whole scenes: no object that a guided ray or an item buffer sees
//! from a viewcell is hidden by a conservative method.
//!
//! `cargo test --release region_scenes -- --ignored` makes 100,000 trials over all scenes, the stored
//! ones too if they are there.

use crate::shared_scenes;

use visibility_core::Accuracy;
use visibility_examples::region::judge::{Effort, Judge};
use visibility_examples::region::output::Judged;
use visibility_examples::region::{cells, methods, trial, world};
use visibility_examples::{SceneSource, built_in};

/// Conservative methods.
const METHODS: &str = "sweep,convex,volume,virtual,shrink:2";

/// Sizes of viewcells: a step, a room, and a street corner.
const SIZES: [[f64; 3]; 3] = [[0.5, 0.5, 1.0], [4.0, 4.0, 2.0], [20.0, 20.0, 3.0]];

/// Stored scenes.
const STORED: &[&str] = &["denhaag", "oa_dm2", "alpine1", "clinic"];

#[derive(Default, Debug)]
struct Verdict {
    /// Sampled objects, summed over viewcells and methods.
    trials: usize,
    /// Objects hidden, summed over viewcells and methods.
    hidden: usize,
    /// Objects hidden although a sample sees them.
    lost: usize,
}

/// Tries all methods on `count` viewcells of each size.
fn run(source: SceneSource, count: usize, effort: Effort, verdict: &mut Verdict) {
    let world = world(source);
    let mut judge = Judge::new(&world, effort).unwrap();
    let mut methods = methods::parse(METHODS, &world).unwrap();
    for size in SIZES {
        for cell in cells::along_walks(&world, count, size) {
            let (sampled, _) = judge.sample(&cell).unwrap();
            let judged = Judged { cell, sampled, trials: Vec::new() };
            for (name, method) in &mut methods {
                assert_eq!(method.accuracy(), Accuracy::Conservative);
                let trial = trial::run(name, method.as_mut(), &world.scene, &judged.cell);
                let lost = judged.false_hidden(&trial);
                if !lost.is_empty() {
                    eprintln!("{}: {:?}: {name} hides {lost:?}", world.source.name, judged.cell);
                }
                verdict.trials += judged.sampled_count();
                verdict.hidden += world.scene.len() - trial.reported.len();
                verdict.lost += lost.len();
            }
        }
    }
}

#[test]
fn nothing_sampled_is_hidden() {
    let effort = Effort { eyes: 3, side: 96, rays: 15_000 };
    let mut verdict = Verdict::default();
    for name in ["london:3,3", "office:1,8", "town:2", "plpcity:1,1", "forest:60,40"] {
        run(built_in(name).unwrap(), 2, effort, &mut verdict);
    }
    println!("{verdict:?}");
    assert_eq!(verdict.lost, 0, "{verdict:?}");
    assert!(verdict.trials > 2000 && verdict.hidden > 2000, "{verdict:?}");
}

#[test]
fn ten_virtual_occluders_hide_most_of_what_the_sweep_hides_in_a_city() {
    let world = world(built_in("london").unwrap());
    let mut methods = methods::parse("sweep,virtual:10", &world).unwrap();
    let mut hidden = [0; 2];
    for cell in cells::along_walks(&world, 3, [20.0, 20.0, 3.0]) {
        for ((name, method), hidden) in methods.iter_mut().zip(&mut hidden) {
            *hidden +=
                world.scene.len() - trial::run(name, method.as_mut(), &world.scene, &cell).reported.len();
        }
    }
    assert!(hidden[0] > 9000 && hidden[1] * 100 >= hidden[0] * 85, "{hidden:?}");
}

#[test]
#[ignore = "takes many minutes"]
fn nothing_sampled_is_hidden_in_many_trials() {
    let effort = Effort { eyes: 15, side: 256, rays: 200_000 };
    let mut verdict = Verdict::default();
    for count in [2, 4, 8, 16, 32, 64] {
        if verdict.trials > 100_000 {
            break;
        }
        for name in ["london", "office", "town", "plpcity", "forest"] {
            run(built_in(name).unwrap(), count, effort, &mut verdict);
        }
        let stored = if cfg!(reference_scenes) { STORED } else { &[] };
        for name in stored {
            run(shared_scenes::scene(name), count, effort, &mut verdict);
        }
    }
    println!("{verdict:?}");
    assert_eq!(verdict.lost, 0, "{verdict:?}");
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "the reference scenes are missing")]
fn nothing_sampled_is_hidden_in_stored_scenes() {
    let effort = Effort { eyes: 2, side: 96, rays: 20_000 };
    let mut verdict = Verdict::default();
    for name in ["denhaag", "oa_dm2", "alpine1"] {
        run(shared_scenes::scene(name), 1, effort, &mut verdict);
    }
    println!("{verdict:?}");
    assert_eq!(verdict.lost, 0, "{verdict:?}");
    assert!(verdict.trials > 500, "{verdict:?}");
}
