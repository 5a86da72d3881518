//! Runs fuzz targets on changed inputs in a plain loop, on a stable compiler and without libFuzzer. Prints
//! for each target how many inputs were run and how many of them its reader accepted: a target that accepts
//! none reaches nothing behind its first checks.
//!
//! `mutate (TARGET | all) [--minutes N] [--seed S]`, or `mutate TARGET FILE...` to run files as they are. The
//! input that is run stands in `artifacts/TARGET.running`, so that one that ends the program is not lost.
//! Inputs that cause a panic are kept in `artifacts` as well, one for each place of a panic.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Seek, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Mutex;
use std::time::{Duration, Instant};
use visibility_fuzz::seeds::{TARGETS, Target};
use visibility_testing::Random;
use visibility_testing::allocations::{CountingAllocator, LIVE, PEAK};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Greatest length of an input in bytes, unless it is a seed.
const LONGEST: usize = 1 << 13;

/// Greatest number of inputs that are kept to be changed further, besides the seeds.
const KEPT: usize = 256;

/// Where the last panic was, and its message.
static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let (mut names, mut files, mut minutes, mut seed) = (Vec::new(), Vec::new(), 1.0, 1);
    while let Some(argument) = arguments.next() {
        let mut value = |name: &str| arguments.next().unwrap_or_else(|| panic!("{name} takes a number"));
        match argument.as_str() {
            "--minutes" => minutes = value("--minutes").parse().expect("a number of minutes"),
            "--seed" => seed = value("--seed").parse().expect("a whole number"),
            _ if names.is_empty() => names.push(argument),
            _ => files.push(argument),
        }
    }
    let is_named = |target: &&Target| names.iter().any(|name| name == target.name || name == "all");
    let targets: Vec<&Target> = TARGETS.iter().filter(is_named).collect();
    if targets.is_empty() {
        let known: Vec<_> = TARGETS.iter().map(|target| target.name).collect();
        eprintln!("mutate (TARGET | all) [--minutes N] [--seed S] [FILE...]; targets: {}", known.join(", "));
        return ExitCode::FAILURE;
    }
    std::panic::set_hook(Box::new(|info| {
        *LAST_PANIC.lock().expect("no panic in the hook") = info.to_string()
    }));
    let mut is_well = true;
    for target in targets {
        if files.is_empty() {
            is_well &= run(target, Duration::from_secs_f64(minutes * 60.0), seed);
        }
        for file in &files {
            let bytes = std::fs::read(file).expect("a file that can be read");
            let begun = Instant::now();
            let outcome = catch_unwind(|| (target.run)(&bytes));
            is_well &= outcome.is_ok();
            let said = match outcome {
                Ok(is_accepted) => format!("accepted: {is_accepted}, {:?}", begun.elapsed()),
                Err(_) => LAST_PANIC.lock().expect("no panic in the hook").clone(),
            };
            println!("{} {file}: {said}", target.name);
        }
    }
    if is_well { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Runs a target for some time. Returns whether no input caused a panic and at least one seed and one changed
/// input were accepted.
fn run(target: &Target, time: Duration, seed: u64) -> bool {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let artifacts = root.join("artifacts");
    std::fs::create_dir_all(&artifacts).expect("a folder for artifacts");
    let running = artifacts.join(format!("{}.running", target.name));
    let mut running = File::create(running).expect("a file for the input");

    let mut seeds = (target.seeds)();
    let mut stored: Vec<_> = std::fs::read_dir(root.join("seeds").join(target.name))
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .collect();
    stored.sort();
    seeds.extend(stored.into_iter().filter_map(|path| std::fs::read(path).ok()));

    let (mut random, mut panics) = (Random(seed), BTreeMap::new());
    let mut pool: Vec<Vec<u8>> = seeds.clone();
    let (mut count, mut accepted, mut accepted_seeds) = (0u64, 0u64, 0);
    let (mut slowest, mut largest) = (Duration::ZERO, 0);
    let begun = Instant::now();
    while begun.elapsed() < time || (count as usize) < seeds.len() {
        let is_seed = (count as usize) < seeds.len();
        let input =
            if is_seed { seeds[count as usize].clone() } else { changed(&pool, seeds.len(), &mut random) };
        let stored =
            running.rewind().and_then(|()| running.set_len(0)).and_then(|()| running.write_all(&input));
        stored.expect("the input is stored");
        let (start, before) = (Instant::now(), LIVE.get());
        PEAK.set(before);
        let outcome = catch_unwind(AssertUnwindSafe(|| (target.run)(&input)));
        count += 1;
        slowest = slowest.max(start.elapsed());
        largest = largest.max(PEAK.get() - before);
        match outcome {
            Ok(true) if is_seed => accepted_seeds += 1,
            Ok(true) => {
                accepted += 1;
                if pool.len() < seeds.len() + KEPT {
                    pool.push(input);
                } else {
                    let at = seeds.len() + random.below(KEPT);
                    pool[at] = input;
                }
            }
            Ok(false) => {}
            Err(_) => {
                let said = LAST_PANIC.lock().expect("no panic in the hook").clone();
                let place = said.lines().next().unwrap_or_default().to_owned();
                let first = !panics.contains_key(&place);
                *panics.entry(place.clone()).or_insert(0u64) += 1;
                if first {
                    let path = artifacts.join(format!("{}-{}", target.name, panics.len()));
                    std::fs::write(&path, &input).expect("the input is stored");
                    println!("{}: {said}\n  input: {}", target.name, path.display());
                }
            }
        }
    }
    println!(
        "{:16} {count:9} inputs, {accepted:9} changed ones accepted, {accepted_seeds} of {} seeds; {} panics; \
         longest {:.2} s, most memory {} KiB",
        target.name,
        seeds.len(),
        panics.values().sum::<u64>(),
        slowest.as_secs_f64(),
        largest / 1024,
    );
    panics.is_empty() && accepted > 0 && accepted_seeds > 0
}

/// Numbers that readers may stumble over, as bytes of files.
const EXTREMES: [&[u8]; 20] = [
    &[0],
    &[1],
    &[0x7f],
    &[0x80],
    &[0xff],
    &[0; 4],
    &[1, 0, 0, 0],
    &[0xff; 4],
    &[0xff, 0xff, 0xff, 0x7f],
    &[0, 0, 0, 0x80],
    // 2^28, f32 infinity, NaN and the greatest f32.
    &[0, 0, 0, 0x10],
    &[0, 0, 0x80, 0x7f],
    &[0, 0, 0xc0, 0x7f],
    &[0xff, 0xff, 0x7f, 0x7f],
    &[0xff; 8],
    // f64 infinity, NaN, the greatest f64 and the least above 0.
    &[0, 0, 0, 0, 0, 0, 0xf0, 0x7f],
    &[0, 0, 0, 0, 0, 0, 0xf8, 0x7f],
    &[0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xef, 0x7f],
    &[1, 0, 0, 0, 0, 0, 0, 0],
    // The greatest number of seven bits a byte.
    &[0xff, 0xff, 0xff, 0xff, 0x0f],
];

/// Numbers that readers of text may stumble over.
const WORDS: [&str; 14] = [
    "0",
    "-0",
    "1",
    "-1",
    "65",
    "255",
    "65536",
    "1048577",
    "4294967295",
    "4294967296",
    "18446744073709551616",
    "1e38",
    "1e-320",
    "1e999",
];

/// Returns an input of the pool, which begins with `seeds` seeds, with some changes.
fn changed(pool: &[Vec<u8>], seeds: usize, random: &mut Random) -> Vec<u8> {
    // Half of all begin with a seed, so that a kind of file that is accepted easily does not replace the
    // others.
    let count = if random.one_in(2) { seeds } else { pool.len() };
    let mut bytes = pool[random.below(count)].clone();
    loop {
        change_once(&mut bytes, pool, random);
        if random.one_in(2) {
            break;
        }
    }
    let longest = pool.iter().map(Vec::len).max().unwrap_or(0).max(LONGEST);
    bytes.truncate(longest);
    bytes
}

fn change_once(bytes: &mut Vec<u8>, pool: &[Vec<u8>], random: &mut Random) {
    let at = random.below(bytes.len() + 1);
    let part = |random: &mut Random, of: &[u8]| {
        let start = random.below(of.len() + 1);
        let most = [4, 16, 64, of.len()][random.below(4)];
        start..(start + random.below(most + 1)).min(of.len())
    };
    match random.below(10) {
        0 => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= 1 << random.below(8)),
        1 => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte = random.bits() as u8),
        2 | 3 => {
            // A number over what stands there, which keeps the places of all that follows.
            let extreme = EXTREMES[random.below(EXTREMES.len())];
            bytes.iter_mut().skip(at).zip(extreme).for_each(|(byte, &new)| *byte = new);
        }
        4 => {
            let extreme = EXTREMES[random.below(EXTREMES.len())];
            bytes.splice(at..at, extreme.iter().copied());
        }
        5 => drop(bytes.drain(part(random, bytes))),
        6 => {
            let copied = bytes[part(random, bytes)].to_vec();
            bytes.splice(at..at, copied);
        }
        7 => {
            let other = &pool[random.below(pool.len())];
            let taken = other[part(random, other)].to_vec();
            let end = if random.one_in(2) { at } else { bytes.len().min(at + taken.len()) };
            bytes.splice(at..end, taken);
        }
        8 => {
            // The number of a text, from its first digit at or after `at` to its last.
            let is_of_number = |byte: &u8| byte.is_ascii_digit() || *byte == b'.';
            let start = at + bytes[at..].iter().take_while(|byte| !is_of_number(byte)).count();
            let end = start + bytes[start..].iter().take_while(|byte| is_of_number(byte)).count();
            if start < end {
                bytes.splice(start..end, WORDS[random.below(WORDS.len())].bytes());
            }
        }
        _ => {
            // Small changes of a byte, such as of a count or a step.
            let step = [1, 255, 2, 254][random.below(4)];
            bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte = byte.wrapping_add(step));
        }
    }
}
