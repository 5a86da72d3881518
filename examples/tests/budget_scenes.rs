//! Bakes with a budget of triangles: nothing that samples see from a fitted viewcell is left out, and a bake
//! that is killed at random moments finally writes the bytes of one that is not.

use crate::bake_program::{folder, names};
use crate::shared_scenes::stored;
use clap::Parser;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;
use visibility_examples::bake::{Budget, Job, Level, Run, fit};
use visibility_examples::region::judge::{Effort, Judge};
use visibility_testing::Random;

#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    job: Job,
    #[command(flatten)]
    budget: Budget,
}

/// Bakes a scene with a budget and compares up to `judged` of the viewcells with samples. Returns the number
/// of viewcells before and after, and the number of hidden objects in the judged ones.
fn judge(arguments: &[&str], judged: usize) -> [usize; 3] {
    let parsed = Arguments::parse_from([&["bake", "--clearance", "0"], arguments].concat());
    let folder = folder(&format!("budget_{}", arguments[0].replace(['/', ':', ','], "-")));
    let mut level = Level::open(&parsed.job, &folder.join("tiles"), || false).unwrap();
    let before = level.viewcells.cells().len();
    let budget = parsed.budget.of(parsed.job.places.size, level.up).unwrap();
    let save_every = Duration::from_secs(60);
    let settings = Run { threads: 2, limit: None, save_every, state: folder.join("unused") };
    let fitted = fit(&mut level, budget, &settings, &folder.join("set"), |_, _| {}).unwrap();
    assert!(fitted.complete, "{arguments:?}: the bake is complete");
    let world = level.world().unwrap();
    let effort = Effort { eyes: 4, side: 128, rays: 20_000 };
    let mut judge = Judge::new(world, effort).unwrap();
    let cells = level.viewcells.cells();
    let (mut seen, mut hidden) = (0, 0);
    for (cell, found) in cells.iter().zip(&fitted.cells).step_by(cells.len().div_ceil(judged)) {
        let (sampled, _) = judge.sample(cell).unwrap();
        let reported = found.reported();
        hidden += world.scene.len() - reported.len();
        for (index, _) in (0..).zip(&sampled).filter(|(_, sampled)| **sampled) {
            seen += 1;
            assert!(
                reported.binary_search(&index).is_ok(),
                "{arguments:?}: object {index} is sampled from {cell:?} and left out"
            );
        }
    }
    assert!(seen > 20 * judged, "{arguments:?}: {seen} sampled objects");
    [before, cells.len(), hidden]
}

/// Arguments for a bake without proofs, which take minutes.
const QUICK: [&str; 4] = ["--gap", "100%", "--rays", "20"];

#[test]
fn nothing_sampled_is_left_out_of_fitted_viewcells() {
    let office = ["office:1,8", "--cells", "walks", "--budget", "6k-triangles", "--agree", "5%"];
    let [before, after, hidden] = judge(&[&office[..], &QUICK].concat(), 8);
    assert!(after > before && hidden > 0, "{before} viewcells, then {after}; {hidden} objects hidden");
}

#[test]
#[cfg_attr(not(reference_scenes), ignore = "reference scenes are missing")]
fn nothing_sampled_is_left_out_of_fitted_viewcells_of_a_town() {
    let town = stored("denhaag.vscn");
    let town = town.to_str().unwrap();
    let over = "--over=-10,-10,1,10,10,3";
    let sizes = ["--size", "10,10,2", "--least", "5,5,2", "--budget", "5k"];
    let [before, after, hidden] = judge(&[&[town, over], &sizes[..], &QUICK].concat(), 6);
    assert!(after >= before && hidden > 0, "{before} viewcells, then {after}; {hidden} objects hidden");
}

/// Number of times that the bake is killed.
const KILLS: usize = 8;

fn start(out: &Path, threads: &str) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bake"));
    command.args(["london:2,2", "--cells", "walks", "--size", "16,16,4", "--gap", "100%", "--save", "0.02"]);
    command.args(["--budget", "1200", "--threads", threads, "-o"]).arg(out);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().expect("the program starts")
}

#[test]
fn a_bake_with_a_budget_that_is_killed_has_the_bytes_of_one_that_is_not() {
    let folder = folder("budget_kills");
    let [whole, killed] = ["whole.pvs", "killed.pvs"].map(|name| folder.join(name));
    assert!(start(&whole, "1").wait().unwrap().success(), "the bake that is not killed succeeds");
    assert_eq!(names(&folder), ["whole.pvs"], "files beside the output");
    // Work that is saved: states and results of depths, by name and content.
    let saved = || -> Vec<(String, Vec<u8>)> {
        let names =
            names(&folder).into_iter().filter(|name| name.contains(".depth") && !name.ends_with(".part"));
        names.filter_map(|name| fs::read(folder.join(&name)).ok().map(|bytes| (name, bytes))).collect()
    };
    let mut random = Random(41);
    let (mut kills, mut resumed, mut bakes) = (0, 0, 0);
    while kills < KILLS {
        assert!(bakes < 20 * KILLS, "{bakes} bakes, of which all but {kills} end before they are killed");
        bakes += 1;
        let before = saved();
        let mut running = start(&killed, ["1", "2"][kills % 2]);
        // The bake goes on for some writes.
        let (mut writes, mut last) = (1 + random.below(6), before.clone());
        while writes > 0 && running.try_wait().unwrap().is_none() {
            let now = saved();
            writes -= usize::from(now != last);
            last = now;
            sleep(Duration::from_millis(1));
        }
        sleep(Duration::from_micros(random.below(60_000) as u64));
        running.kill().unwrap();
        if running.wait().unwrap().success() {
            // On a busy machine the bake may finish before it is killed. Then the next bake starts anew.
            fs::remove_file(&killed).unwrap();
            continue;
        }
        kills += 1;
        resumed += usize::from(!before.is_empty());
    }
    assert!(resumed >= KILLS / 2, "{resumed} of {kills} kills were of bakes that went on");
    assert!(start(&killed, "2").wait().unwrap().success(), "the bake that was killed succeeds");
    assert!(fs::read(&killed).unwrap() == fs::read(&whole).unwrap(), "other bytes");
    let left: Vec<String> = names(&folder).into_iter().filter(|name| name.contains("depth")).collect();
    assert!(left.is_empty(), "files that are left: {left:?}");
}
