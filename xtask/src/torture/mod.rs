//! Trials without end: the tests that say how many answers they judge run again and again, each time with
//! other random numbers, until a number of trials or of hours is reached.
//!
//! A test is a trial if it calls `visibility_testing::judged`. Its programs are compiled with optimization,
//! and with the checks for overflow and the assertions of debug builds.

mod oracles;
mod planted;
mod state;
mod trial;

use crate::test_programs::{test_names, test_programs};
use state::{Record, State};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Mutex;
use std::time::{Duration, Instant};
use trial::{Trial, run};

/// Seeds with which a test may fail before it is left alone.
const MOST_FAILURES: usize = 3;

/// Options of the task.
#[derive(Debug)]
struct Options {
    /// Trials in all, with those of earlier runs of the same commit.
    trials: u64,
    limit: Duration,
    /// Text that must be in a test's name, with its crate's.
    only: String,
    planted: bool,
}

/// Reads options: `--trials N`, `--hours H`, `--only TEXT`, `--planted`.
fn options(arguments: &[String]) -> Result<Options, String> {
    let usage = "usage: cargo run -p xtask -- torture [--trials N] [--hours H] [--only TEXT] [--planted]";
    let mut options = Options { trials: u64::MAX, limit: Duration::MAX, only: String::new(), planted: false };
    let mut arguments = arguments.iter();
    while let Some(name) = arguments.next() {
        if name == "--planted" {
            options.planted = true;
            continue;
        }
        let value = arguments.next().ok_or(usage)?;
        let number = || value.parse::<f64>().ok().filter(|number| *number >= 0.0);
        match name.as_str() {
            "--trials" => options.trials = number().ok_or(usage)? as u64,
            "--hours" => {
                let seconds = 3600.0 * number().ok_or(usage)?;
                options.limit = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
            }
            "--only" => options.only.clone_from(value),
            _ => return Err(usage.to_owned()),
        }
    }
    Ok(options)
}

/// Runs trials as the arguments say, prints their numbers by crate, and returns the number of tests that
/// failed with a seed; or for `--planted` that of planted faults that no trial noticed.
///
/// # Errors
///
/// Returns a wrong argument, a file that cannot be read or written, and programs that do not compile.
pub(crate) fn check(root: &Path, arguments: &[String]) -> Result<usize, String> {
    let options = options(arguments)?;
    if options.planted {
        return planted::check(root, &options.only);
    }
    let trials = trials(root, &options.only)?;
    let begun = Instant::now();
    let state = Mutex::new(State::load(root)?);
    let running = Mutex::new(BTreeSet::new());
    let saved = Mutex::new(Instant::now());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, |count| count.get()) {
            scope.spawn(|| {
                while begun.elapsed() < options.limit {
                    let Some((trial, seed)) = next(&trials, &state, &running, options.trials) else { break };
                    let (name, start) = (trial.name(), Instant::now());
                    let found = run(trial, seed, &[]);
                    lock(&running).remove(&name);
                    if found.is_none() {
                        println!(
                            "failed: TRIAL_SEED={seed} cargo test -p {} {}",
                            trial.program.package, trial.test
                        );
                    }
                    let mut state = lock(&state);
                    state.record(&name, seed, found, start.elapsed());
                    let mut saved = lock(&saved);
                    if saved.elapsed() > Duration::from_secs(10) {
                        *saved = Instant::now();
                        if let Err(error) = state.save() {
                            eprintln!("{error}");
                        }
                    }
                }
            });
        }
    });
    let state = lock(&state);
    state.save()?;
    state.print();
    Ok(state.failures())
}

/// Locks a mutex whose content stays right if a thread has panicked.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(|error| error.into_inner())
}

/// Compiles the programs of all crates with trials. Returns the tests that judge answers, as far as `only` is
/// part of their names.
fn trials(root: &Path, only: &str) -> Result<Vec<Trial>, String> {
    let oracles: Vec<String> =
        oracles::oracles(root)?.into_iter().filter(|name| name.contains(only)).collect();
    let package = |name: &String| name.split(' ').next().unwrap_or_default().to_owned();
    let mut packages: Vec<String> = oracles.iter().map(package).collect();
    packages.dedup();
    if packages.is_empty() {
        return Ok(Vec::new());
    }
    let mut trials = Vec::new();
    for program in test_programs(root, &packages, &root.join("target/torture"))? {
        for test in test_names(&program.path)? {
            let trial = Trial { program: program.clone(), test };
            if oracles.contains(&trial.name()) {
                trials.push(trial);
            }
        }
    }
    Ok(trials)
}

/// Chooses the test that runs next, and its seed: one that has not run yet, or that with the least time among
/// those that have judged something. `None` once the trials are enough.
fn next<'a>(
    trials: &'a [Trial],
    state: &Mutex<State>,
    running: &Mutex<BTreeSet<String>>,
    enough: u64,
) -> Option<(&'a Trial, u64)> {
    let (state, mut running) = (lock(state), lock(running));
    let is_enough = state.trials() >= enough;
    let wanted = |trial: &&Trial| {
        let record = state.get(&trial.name());
        let is_used =
            |record: &Record| !is_enough && record.trials > 0 && record.failed.len() < MOST_FAILURES;
        !running.contains(&trial.name()) && record.is_none_or(is_used)
    };
    let time = |trial: &&Trial| state.get(&trial.name()).map_or(0.0, |record| record.seconds);
    let trial = trials.iter().filter(wanted).min_by(|a, b| time(a).total_cmp(&time(b)))?;
    running.insert(trial.name());
    Some((trial, state.get(&trial.name()).map_or(0, |record| record.seeds)))
}
