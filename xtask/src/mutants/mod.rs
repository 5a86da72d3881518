//! Mutation tests of what decides visibility: each comparison, rounding and margin of a crate is changed, one
//! at a time, and a test of the crate must fail.
//!
//! `cargo-mutants` replaces functions and operators, and compiles the crate for each mutant. What it lacks is
//! here: margins become nothing or half of themselves, `<` becomes `<=`, rounding up becomes rounding down;
//! and hundreds of mutants are compiled at once.

mod run;
pub(crate) mod schemata;
mod sites;

use run::Fate;
use schemata::{ALL_TESTS, Mutant, Tree, UNIT_TESTS, batches, flat};
use std::path::Path;
use std::time::{Duration, Instant, SystemTime};

/// Mutants that survive the tests of their crates for a reason, one on a line: file, function, expression,
/// what stands in its place, reason, divided by ` | `.
const SURVIVORS: &str = "xtask/survivors.txt";

/// Options of the task.
#[derive(Debug)]
struct Options {
    /// Folder of the crate.
    package: String,
    /// Files of the crate whose mutants are wanted. All, if there are none.
    files: Vec<String>,
    /// Number of mutants to draw. All, if that is more.
    sample: usize,
    seed: u64,
    /// Time for tests of mutants, beside what compiling takes. No mutant's tests are begun after it.
    limit: Duration,
    /// Whether the unit tests of the crate run alone, without those in its folder `tests`.
    unit_tests: bool,
}

/// Reads options: a crate or files of one; `--sample N`, `--seed N`, `--minutes N`, `--lib`.
fn options(arguments: &[String]) -> Result<Options, String> {
    let usage = "usage: cargo run -p xtask -- mutants (CRATE | FILE...) [--sample N] [--seed N] [--minutes N] [--lib]";
    let (flags, arguments): (Vec<String>, Vec<String>) =
        arguments.iter().cloned().partition(|argument| argument == "--lib");
    let places = arguments.iter().take_while(|place| !place.starts_with("--")).count();
    let (places, pairs) = arguments.split_at(places);
    let package = |place: &str| place.split('/').next().unwrap_or_default().to_owned();
    let first = package(places.first().ok_or(usage)?);
    if places.iter().any(|place| package(place) != first) {
        return Err(format!("{places:?} are of several crates"));
    }
    let files = places.iter().filter(|place| place.ends_with(".rs")).cloned().collect();
    let day = SystemTime::UNIX_EPOCH.elapsed().map_or(0, |time| time.as_secs() / 86_400);
    let (limit, unit_tests) = (Duration::from_secs(86_400), !flags.is_empty());
    let mut options = Options { package: first, files, sample: usize::MAX, seed: day, limit, unit_tests };
    for pair in pairs.chunks(2) {
        let [name, value] = pair else { return Err(usage.to_owned()) };
        let value: u64 = value.parse().map_err(|_| format!("{name} {value} is no number"))?;
        match name.as_str() {
            "--sample" => options.sample = value as usize,
            "--seed" => options.seed = value,
            "--minutes" => options.limit = Duration::from_secs(60 * value),
            _ => return Err(usage.to_owned()),
        }
    }
    Ok(options)
}

/// Mutates a crate as the arguments say, prints each survivor for which [`SURVIVORS`] has no reason, and
/// returns their number.
///
/// # Errors
///
/// Returns a wrong argument, a file that cannot be read or written, and a crate that does not compile.
pub(crate) fn check(root: &Path, arguments: &[String]) -> Result<usize, String> {
    let options = options(arguments)?;
    let (mut mutants, mut tests) = (Vec::new(), Vec::new());
    let mut texts = Vec::new();
    for file in sites::source_files(root, &options.package)? {
        let text = std::fs::read_to_string(root.join(&file)).map_err(|error| format!("{file}: {error}"))?;
        tests.extend(sites::test_modules(&file, &text));
        texts.push((file, text));
    }
    let is_test = |file: &str| {
        let module = |test: &String| file.strip_prefix(test.as_str());
        tests.iter().filter_map(module).any(|rest| rest == ".rs" || rest.starts_with('/'))
    };
    for (file, text) in texts {
        if !is_test(&file) && (options.files.is_empty() || options.files.contains(&file)) {
            let sites = sites::sites(&text).map_err(|error| format!("{file}: {error}"))?;
            mutants.extend(schemata::mutants(&file, &text, &sites));
        }
    }
    let reasons = std::fs::read_to_string(root.join(SURVIVORS)).unwrap_or_default();
    let stale = stale(&reasons, &options, &mutants);
    stale.iter().for_each(|line| println!("{SURVIVORS}: no mutant of the line: {line}"));
    let chosen = drawn(mutants.len(), options.sample, options.seed);
    let folder = root.join("target/mutants");
    let programs = if options.unit_tests { UNIT_TESTS } else { ALL_TESTS };
    let tree = Tree::new(root, folder.join("tree"), &options.package, programs)?;
    let tests_folder = folder.join("tree").join(&options.package);
    let (mut counts, mut left_out, mut found) = ([0; 4], 0, stale.len());
    let mut left = options.limit;
    for mut batch in batches(&chosen) {
        let all = batch.len();
        if left.is_zero() {
            left_out += all;
            continue;
        }
        let programs = tree.build(&mutants, &mut batch)?;
        let tests = run::tests(&programs, &tests_folder)?;
        let begun = Instant::now();
        let fates = run::fates(&batch, &tests, &tests_folder, begun + left);
        left = left.saturating_sub(begun.elapsed());
        counts[3] += all - batch.len();
        for (&index, fate) in batch.iter().zip(fates) {
            let Some(fate) = fate else {
                left_out += 1;
                continue;
            };
            counts[fate as usize] += 1;
            let mutant = &mutants[index];
            if fate != Fate::Killed && !has_reason(&reasons, mutant) {
                let Mutant { file, function, line, old, new, .. } = mutant;
                println!("{file}:{line} {fate:?} | {file} | {function} | {old} | {} |", flat(new));
                found += 1;
            }
        }
    }
    let [killed, survived, unreached, invalid] = counts;
    println!(
        "{}: {} mutants drawn of {}: {killed} killed, {survived} survived, {unreached} not reached by a test, \
         {invalid} do not compile, {left_out} left out for want of time",
        options.package,
        chosen.len(),
        mutants.len()
    );
    Ok(found)
}

/// Returns how the line of a mutant in [`SURVIVORS`] begins. The reason follows.
fn line_start(mutant: &Mutant) -> String {
    let Mutant { file, function, old, new, .. } = mutant;
    format!("{file} | {function} | {old} | {} | ", flat(new))
}

/// Returns whether the list of survivors has a reason for a mutant.
fn has_reason(reasons: &str, mutant: &Mutant) -> bool {
    let start = line_start(mutant);
    reasons.lines().any(|line| line.strip_prefix(&start).is_some_and(|reason| !reason.trim().is_empty()))
}

/// Returns the lines of the list of survivors that are about the files or the crate of the options, and about
/// none of its mutants.
fn stale<'a>(reasons: &'a str, options: &Options, mutants: &[Mutant]) -> Vec<&'a str> {
    let crate_alone = [format!("{}/", options.package)];
    let places = if options.files.is_empty() { &crate_alone[..] } else { &options.files };
    let starts: Vec<String> = mutants.iter().map(line_start).collect();
    let is_about = |line: &&str| places.iter().any(|place| line.starts_with(place));
    let lines = reasons.lines().filter(is_about);
    lines.filter(|line| !starts.iter().any(|start| line.starts_with(start))).collect()
}

/// Draws `sample` of the numbers below `count` without replacement, sorted; all, if there are no more.
fn drawn(count: usize, sample: usize, seed: u64) -> Vec<usize> {
    let mut numbers: Vec<usize> = (0..count).collect();
    // SplitMix64: each key depends on the seed and the number alone.
    let key = |number: &usize| {
        let mut x = seed.wrapping_add((*number as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    };
    numbers.sort_by_key(key);
    numbers.truncate(sample);
    numbers.sort_unstable();
    numbers
}

#[cfg(test)]
mod tests {
    use super::{Options, drawn, has_reason, schemata, sites, stale};
    use std::time::Duration;

    #[test]
    fn reasons_are_those_of_mutants() -> Result<(), String> {
        let text = "fn f(a: f32) -> bool { a < 1.0 }";
        let mutants = schemata::mutants("c/src/f.rs", text, &sites::sites(text)?);
        let reasons = "c/src/f.rs | f | a < 1.0 | a <= 1.0 | equal is as good\n\
                       c/src/f.rs | f | a < 2.0 | a <= 2.0 | of a line that is gone\nd/src/f.rs | f |";
        assert!(has_reason(reasons, &mutants[0]), "a line with a reason");
        assert!(!has_reason("c/src/f.rs | f | a < 1.0 | a <= 1.0 |  ", &mutants[0]), "a line without one");
        let (package, limit) = ("c".to_owned(), Duration::ZERO);
        let mut options =
            Options { package, files: Vec::new(), sample: 1, seed: 1, limit, unit_tests: false };
        for files in [Vec::new(), vec!["c/src/f.rs".to_owned()]] {
            options.files = files;
            let lines = stale(reasons, &options, &mutants);
            assert!(matches!(lines[..], [line] if line.ends_with("gone")), "stale lines: {lines:?}");
        }
        Ok(())
    }

    #[test]
    fn samples_depend_on_the_seed() {
        assert_eq!(drawn(3, 5, 1), [0, 1, 2], "all numbers if there are no more");
        let [a, b] = [1, 2].map(|seed| drawn(1000, 10, seed));
        assert_eq!(a.len(), 10, "numbers drawn: {a:?}");
        assert_ne!(a, b, "numbers of two seeds");
        assert!(a.is_sorted_by(|a, b| a < b), "in order, without replacement: {a:?}");
    }
}
