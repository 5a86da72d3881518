//! Runs of a crate's tests: first each one alone, to learn which mutants it reaches and how long it takes;
//! then, for a mutant, those that reach it.

use super::schemata::Program;
use crate::test_programs::test_names;
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Test of a crate.
#[derive(Debug)]
pub(crate) struct Test {
    program: Program,
    name: String,
    /// Time that it took without a mutant.
    time: Duration,
    /// Mutants that it reaches.
    reached: BTreeSet<usize>,
}

/// What became of a mutant.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Fate {
    /// A test failed, or took ten times as long as without the mutant.
    Killed,
    /// All tests that reach it passed.
    Survived,
    /// No test reaches it.
    Unreached,
}

/// Runs `work` for the numbers below `count` on one thread per core, and returns the results in order.
fn in_parallel<T: Send>(count: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let (next, results) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, |count| count.get()) {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= count {
                        return;
                    }
                    let result = work(number);
                    results.lock().unwrap_or_else(|error| error.into_inner()).push((number, result));
                }
            });
        }
    });
    let mut results = results.into_inner().unwrap_or_else(|error| error.into_inner());
    results.sort_by_key(|&(number, _)| number);
    results.into_iter().map(|(_, result)| result).collect()
}

/// Runs each test of the programs alone, in the folder of its package. Returns those that pass.
///
/// # Errors
///
/// Returns the first program that cannot be run.
pub(crate) fn tests(programs: &[Program], folder: &Path) -> Result<Vec<Test>, String> {
    let mut names = Vec::new();
    for program in programs {
        let own = test_names(program)?.into_iter();
        names.extend(own.map(|name| (program.clone(), name)));
    }
    let ran = in_parallel(names.len(), |number| {
        let (program, name) = names[number].clone();
        let record = folder.join(format!("reached-{number}.txt"));
        let begun = Instant::now();
        let passed = Command::new(&program)
            .args(["--exact", &name, "--test-threads=1"])
            .env("MUTANT", "record")
            .env("MUTANT_RECORD", &record)
            .current_dir(folder)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status()
            .is_ok_and(|status| status.success());
        let reached = std::fs::read_to_string(&record).unwrap_or_default();
        let _ = std::fs::remove_file(&record);
        let reached = reached.lines().filter_map(|line| line.parse().ok()).collect();
        passed.then(|| Test { program, name, time: begun.elapsed(), reached })
    });
    Ok(ran.into_iter().flatten().collect())
}

/// Returns the fate of each mutant, given by its index. `None` for those whose turn comes after `end`.
pub(crate) fn fates(mutants: &[usize], tests: &[Test], folder: &Path, end: Instant) -> Vec<Option<Fate>> {
    in_parallel(mutants.len(), |number| (Instant::now() < end).then(|| fate(mutants[number], tests, folder)))
}

/// Runs the tests that reach a mutant, quick ones first, until one of them fails.
fn fate(mutant: usize, tests: &[Test], folder: &Path) -> Fate {
    let mut own: Vec<&Test> = tests.iter().filter(|test| test.reached.contains(&mutant)).collect();
    own.sort_by_key(|test| test.time);
    if own.is_empty() {
        return Fate::Unreached;
    }
    let quick = own.partition_point(|test| test.time < Duration::from_millis(500));
    for group in [&own[..quick], &own[quick..]] {
        let programs: BTreeSet<&Program> = group.iter().map(|test| &test.program).collect();
        for program in programs {
            let own = group.iter().filter(|test| test.program == *program);
            if !passes(program, own.copied(), mutant, folder) {
                return Fate::Killed;
            }
        }
    }
    Fate::Survived
}

/// Returns whether tests of one program all pass with a mutant, in time. Ends them at the first that fails.
fn passes<'a>(program: &Path, tests: impl Iterator<Item = &'a Test>, mutant: usize, folder: &Path) -> bool {
    let (mut time, mut command) = (Duration::from_secs(10), Command::new(program));
    command.args(["--exact", "--test-threads=1"]).env("MUTANT", mutant.to_string()).current_dir(folder);
    for test in tests {
        command.arg(&test.name);
        time += 10 * test.time;
    }
    let Ok(mut child) = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn() else { return true };
    let Some(output) = child.stdout.take() else { return true };
    let failed = Mutex::new(false);
    let limit = Instant::now() + time;
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut lines = BufReader::new(output).lines().map_while(Result::ok);
            let is_failure = lines.any(|line| line.ends_with("... FAILED"));
            *failed.lock().unwrap_or_else(|error| error.into_inner()) |= is_failure;
        });
        loop {
            match child.try_wait() {
                Ok(Some(status)) => return status.success(),
                _ if Instant::now() > limit || *failed.lock().unwrap_or_else(|error| error.into_inner()) => {
                    let _ = child.kill();
                    let _ = child.wait();
                    return false;
                }
                _ => std::thread::sleep(Duration::from_millis(5)),
            }
        }
    })
}
