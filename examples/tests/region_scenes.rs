//! Tests of the methods for viewcells on whole scenes: a conservative method hides no object that a guided
//! ray or an item buffer sees from the viewcell.
//!
//! `cargo test --release region_scenes -- --ignored` makes 100,000 trials over all scenes, the stored
//! ones too if they are there.

use crate::shared_scenes;

use visibility_core::Accuracy;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_examples::region::judge::{Effort, Judge};
use visibility_examples::region::output::Judged;
use visibility_examples::region::{cells, methods, trial, world};
use visibility_examples::{SceneSource, SourceObject, built_in};

/// Entries of the conservative methods.
const METHODS: &str = "sweep,convex,volume,shrink:2";

/// Sizes of viewcells: a step, a room, and a street corner.
const SIZES: [[f64; 3]; 3] = [[0.5, 0.5, 1.0], [4.0, 4.0, 2.0], [20.0, 20.0, 3.0]];

/// Names of stored scenes.
const STORED: &[&str] = &["denhaag", "oa_dm2", "alpine1", "clinic"];

#[derive(Default, Debug)]
struct Verdict {
    /// Number of sampled objects, summed over viewcells and methods.
    trials: usize,
    /// Number of hidden objects, summed over viewcells and methods.
    hidden: usize,
    /// Number of objects that a sample sees and a method hides.
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
                assert_eq!(method.accuracy(), Accuracy::Conservative, "{name} is conservative");
                let trial = trial::run(name, method.as_mut(), &world.scene, &judged.cell);
                let lost = judged.sampled_and_left_out(&trial);
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

/// The judge's verdict on an object behind a wall with a crack: none if the crack is closed, "narrow" if all
/// lines through it come too near to the wall, "false hidden" if a method with a clearance should have found
/// one.
#[test]
fn what_is_left_out_is_false_hidden_narrow_or_sampled_by_rounding_alone() {
    let quad = |x: f32, [y, z]: [[f32; 2]; 2]| {
        let [a, b, c, d] =
            [[y[0], z[0]], [y[1], z[0]], [y[1], z[1]], [y[0], z[1]]].map(|[y, z]| Vec3::new(x, y, z));
        vec![[a, b, c], [a, c, d]]
    };
    let world_of = |crack: f32, origin: DVec3| {
        let mut source = SceneSource::new("crack".to_owned(), Vec3::Z, 0.1);
        source.origin = origin;
        let walls = [[-20.0, 0.25], [0.25 + crack, 20.0]].map(|y| quad(5.0, [y, [-20.0, 20.0]]));
        let parts = walls.into_iter().chain([quad(8.0, [[-1.0, 1.0]; 2])]);
        source.objects = parts.map(|triangles| SourceObject::new("part".to_owned(), triangles)).collect();
        world(source)
    };
    let found = |crack: f32, method: &str, line: Option<[DVec3; 2]>| {
        let origin = DVec3::new(1e5, -3e5, 50.0);
        let (world, cell) = (world_of(crack, origin), Viewcell::from_box(origin - 1.0, origin + 1.0));
        let mut judge = Judge::new(&world, Effort { eyes: 9, side: 64, rays: 20_000 }).unwrap();
        let (mut sampled, _) = judge.sample(&cell).unwrap();
        let mut exact = methods::parse("exact:0", &world).unwrap();
        trial::run("exact:0", exact[0].1.as_mut(), &world.scene, &cell);
        let given = line.map(|line| (2, line.map(|p| p + origin)));
        let sights: Vec<_> = exact[0].1.sights().into_iter().chain(given).collect();
        sights.iter().for_each(|&(index, _)| sampled[index as usize] = true);
        let (name, mut method) = methods::parse(method, &world).unwrap().remove(0);
        let trial = trial::run(&name, method.as_mut(), &world.scene, &cell);
        let judged = Judged { cell, sampled, trials: Vec::new() };
        let left_out = judged.sampled_and_left_out(&trial);
        let decided = judge.decide(&judged.cell, &left_out, method.clearance(), &sights).unwrap();
        (left_out, decided.false_hidden, decided.narrow)
    };
    let none = Vec::new();
    // A crack of 0.03 mm is narrower than six times a clearance of 0.1 mm. A method with clearance 0 must see
    // through it.
    assert_eq!(
        found(3e-5, "exact", None),
        (vec![2], none.clone(), vec![2]),
        "a crack of .03 mm, with a clearance"
    );
    assert_eq!(
        found(3e-5, "exact:0", None),
        (none.clone(), none.clone(), none.clone()),
        "a crack of .03 mm, without a clearance"
    );
    // The method `exact` finds lines of sight through a crack of 3 mm, and a few rays do not.
    assert_eq!(found(3e-3, "exact", None), (none.clone(), none.clone(), none.clone()), "a crack of 3 mm");
    assert_eq!(
        found(3e-3, "rays:1", None),
        (vec![1, 2], vec![1, 2], none.clone()),
        "a crack of 3 mm, by few rays"
    );
    // A line that a method reports as a line of sight, although a closed wall blocks it.
    let through = [DVec3::ZERO, DVec3::new(8.0, 0.1, 0.1)];
    assert_eq!(
        found(0.0, "exact", Some(through)),
        (vec![2], none.clone(), none.clone()),
        "a line through the closed wall"
    );
    let along_the_seam = [DVec3::new(0.0, 0.25, 0.0), DVec3::new(8.0, 0.25, 0.1)];
    assert_eq!(
        found(0.0, "exact", Some(along_the_seam)),
        (vec![2], none.clone(), none),
        "a line along the closed wall's seam"
    );
}

/// A method with a time limit ends, and reports undecided objects as visible.
#[test]
fn a_method_that_is_stopped_reports_what_is_open() {
    let world = world(built_in("town:2").unwrap());
    let cell = cells::along_walks(&world, 1, [4.0, 4.0, 2.0]).remove(0);
    let mut exact = methods::parse("exact", &world).unwrap().remove(0).1;
    let whole = trial::run("exact", exact.as_mut(), &world.scene, &cell);
    exact.set_stop(Box::new(|| true));
    let stopped = trial::run("exact", exact.as_mut(), &world.scene, &cell);
    let sandwich = stopped.sandwich.unwrap();
    assert!(
        whole.sandwich.unwrap().hidden > 100 && sandwich.hidden == 0 && sandwich.open > 100,
        "a stopped method leaves all open: {sandwich:?}"
    );
    assert_eq!(stopped.reported.len(), world.scene.len(), "a stopped method reports all");
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
