//! Program `scale`: simulates a bake on many machines, some slow and some failing, from the measured times of
//! viewcells. It bakes nothing itself, so simulating a million viewcells takes seconds.
//!
//! Shards are handed out as Jeffrey Dean and Sanjay Ghemawat hand out tasks in "MapReduce: Simplified Data
//! Processing on Large Clusters", 2004: a shard whose worker is lost goes back to the queue, and near the end
//! idle workers take copies of the shards that are still running. The first copy that is finished counts.

use clap::Parser;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};
use std::path::PathBuf;
use std::process::ExitCode;
use visibility_core::random::Random;
use visibility_examples::arguments::count;
use visibility_examples::{exit_code, ordinary_file, println};

/// Simulate a bake on many workers: time, cost and bytes, by the number of viewcells in a shard.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Report of `bake --json` from which times and bytes of viewcells are drawn.
    report: PathBuf,

    /// Number of viewcells.
    #[arg(long, default_value_t = 1_000_000, value_parser = count())]
    cells: usize,

    /// Number of workers, one thread each.
    #[arg(long, default_value_t = 1000, value_parser = count())]
    workers: usize,

    /// Numbers of viewcells in a shard, separated by commas.
    #[arg(long, value_delimiter = ',', default_value = "1,10,100,300,1000")]
    shards: Vec<usize>,

    /// Seconds to start a shard: load the scene and prepare it.
    #[arg(long, default_value_t = 0.5)]
    start: f64,

    /// Share of the workers that are slow.
    #[arg(long, default_value_t = 0.05)]
    slow: f64,

    /// Factor by which a slow worker takes longer.
    #[arg(long, default_value_t = 4.0)]
    slowness: f64,

    /// Mean time in hours until a worker fails.
    #[arg(long, default_value_t = 24.0)]
    fails: f64,

    /// Seconds until a failure is noticed, and again until the worker is replaced.
    #[arg(long, default_value_t = 120.0)]
    repair: f64,

    /// Price of a worker for an hour.
    #[arg(long, default_value_t = 0.04)]
    price: f64,

    /// Size of a viewcell's result in a shard, in bytes.
    #[arg(long, default_value_t = 1000.0)]
    bytes: f64,

    /// Do not run second copies of the last shards.
    #[arg(long)]
    no_copies: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    exit_code(simulate_all(&arguments))
}

fn simulate_all(arguments: &Arguments) -> Result<(), String> {
    let report = &arguments.report;
    let text = ordinary_file::open(report).and_then(std::io::read_to_string);
    let text = text.map_err(|error| format!("{}: {error}", report.display()))?;
    let times = measured(&text).map_err(|error| format!("{}: {error}", report.display()))?;
    let positive = [arguments.slowness, arguments.fails, arguments.start, arguments.repair];
    if arguments.workers == 0 || arguments.cells == 0 || arguments.shards.contains(&0) {
        return Err("viewcells, workers and shards must be at least 1".to_owned());
    }
    if positive.iter().any(|number| number.is_nan() || *number < 0.0) || arguments.fails == 0.0 {
        return Err("times must not be negative, nor workers fail at once".to_owned());
    }
    let mean = times.iter().sum::<f64>() / times.len() as f64;
    let ideal = mean * arguments.cells as f64 / arguments.workers as f64;
    println!(
        "{} measured viewcells, {mean:.3} s each; without any loss {:.2} hours",
        times.len(),
        ideal / HOUR
    );
    println!(
        "| viewcells in a shard | shards | hours | efficiency | worker lost | copies | cost | GB of shards |"
    );
    println!("|---:|---:|---:|---:|---:|---:|---:|---:|");
    for &size in &arguments.shards {
        let found = simulate(arguments, &times, size);
        println!(
            "| {size} | {} | {:.2} | {:.0} % | {} | {} | {:.2} | {:.2} |",
            arguments.cells.div_ceil(size),
            found.seconds / HOUR,
            100.0 * ideal / found.seconds,
            found.lost,
            found.copies,
            found.seconds / HOUR * arguments.workers as f64 * arguments.price,
            arguments.cells as f64 * arguments.bytes / 1e9,
        );
    }
    Ok(())
}

const HOUR: f64 = 3600.0;

/// Returns the seconds that each viewcell of a report took, summed over all methods.
fn measured(text: &str) -> Result<Vec<f64>, String> {
    let report: serde_json::Value = serde_json::from_str(text).map_err(|error| error.to_string())?;
    let cells = report["viewcells"].as_array().map_or(&[][..], Vec::as_slice);
    let of_cell = |cell: &serde_json::Value| -> Option<f64> {
        ["sweep", "rays", "proofs"].iter().map(|method| cell["seconds"][method].as_f64()).sum()
    };
    let seconds: Vec<f64> = cells.iter().filter_map(of_cell).collect();
    if seconds.iter().sum::<f64>() > 0.0 {
        Ok(seconds)
    } else {
        Err("the report has no times of viewcells".to_owned())
    }
}

/// Result of a simulated bake.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Found {
    /// Seconds from the start until the last shard was done.
    seconds: f64,
    /// Number of attempts that ended with a failure of the worker.
    lost: usize,
    /// Number of copies of running shards.
    copies: usize,
}

/// Event at a point of simulated time. The first number is the worker's index, or the shard's for `Noticed`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    /// A worker has finished an attempt: index of the worker, number of the attempt.
    Finished(usize, u64),
    /// A worker has failed during an attempt: index of the worker, number of the attempt.
    Failed(usize, u64),
    /// The failed worker with this index was replaced.
    Replaced(usize),
    /// The failure of a worker at the shard with this index is noticed.
    Noticed(usize),
}

struct Worker {
    slowness: f64,
    /// Index of the shard that the worker runs, and the time at which it will finish.
    job: Option<(usize, u64)>,
    attempt: u64,
}

struct Simulation<'a> {
    arguments: &'a Arguments,
    random: Random,
    /// Seconds of work in each shard, on a worker of normal speed.
    work: Vec<f64>,
    done: Vec<bool>,
    /// Number of workers believed to run each shard. A failed worker counts until its failure is noticed. A
    /// shard that is not done is in the queue exactly if its number is 0.
    running: Vec<u32>,
    queue: VecDeque<usize>,
    workers: Vec<Worker>,
    idle: Vec<usize>,
    /// Future events, each with its time in microseconds. Whole numbers make the order the same on every
    /// machine.
    events: BinaryHeap<Reverse<(u64, Event)>>,
    found: Found,
}

fn simulate(arguments: &Arguments, times: &[f64], size: usize) -> Found {
    let mut simulation = Simulation::new(arguments, times, size);
    simulation.run();
    simulation.found
}

/// Returns the time `seconds` after `now`, both times in microseconds. At most `u64::MAX`, a time that is
/// never reached.
fn after(now: u64, seconds: f64) -> u64 {
    now.saturating_add((seconds * 1e6) as u64)
}

impl<'a> Simulation<'a> {
    /// Fills each shard with `size` viewcells whose times are drawn from `times`, which must not be empty.
    /// Gives each worker its first shard.
    fn new(arguments: &'a Arguments, times: &[f64], size: usize) -> Self {
        let mut random = Random(1);
        let mut left = arguments.cells;
        let mut work = Vec::new();
        while left > 0 {
            let count = size.min(left);
            work.push((0..count).map(|_| times[random.below(times.len())]).sum());
            left -= count;
        }
        let workers = (0..arguments.workers).map(|_| {
            let slowness = if random.unit() < arguments.slow { arguments.slowness } else { 1.0 };
            Worker { slowness, job: None, attempt: 0 }
        });
        let workers = workers.collect();
        let mut simulation = Self {
            arguments,
            queue: (0..work.len()).collect(),
            done: vec![false; work.len()],
            running: vec![0; work.len()],
            work,
            workers,
            random,
            idle: Vec::new(),
            events: BinaryHeap::new(),
            found: Found { seconds: 0.0, lost: 0, copies: 0 },
        };
        for worker in 0..arguments.workers {
            simulation.assign(worker, 0);
        }
        simulation
    }

    fn run(&mut self) {
        let mut open = self.work.len();
        let repair = self.arguments.repair;
        while open > 0
            && let Some(Reverse((now, event))) = self.events.pop()
        {
            match event {
                Event::Finished(worker, attempt) if self.workers[worker].attempt == attempt => {
                    let Some((shard, _)) = self.workers[worker].job.take() else { continue };
                    (self.done[shard], self.running[shard]) = (true, 0);
                    open -= 1;
                    self.found.seconds = now as f64 * 1e-6;
                    // A worker that runs another copy of the finished shard is told to stop.
                    for other in 0..self.workers.len() {
                        if self.workers[other].job.is_some_and(|(job, _)| job == shard) {
                            self.assign(other, now);
                        }
                    }
                    self.assign(worker, now);
                }
                Event::Failed(worker, attempt) if self.workers[worker].attempt == attempt => {
                    if let Some((shard, _)) = self.workers[worker].job.take() {
                        self.found.lost += 1;
                        self.events.push(Reverse((after(now, repair), Event::Noticed(shard))));
                    }
                    self.workers[worker].attempt += 1;
                    self.events.push(Reverse((after(now, 2.0 * repair), Event::Replaced(worker))));
                }
                // Ends of attempts that were stopped before are ignored.
                Event::Finished(..) | Event::Failed(..) => {}
                Event::Replaced(worker) => self.assign(worker, now),
                Event::Noticed(shard) => {
                    if self.done[shard] {
                        continue;
                    }
                    self.running[shard] -= 1;
                    if self.running[shard] == 0 {
                        self.queue.push_front(shard);
                        if let Some(worker) = self.idle.pop() {
                            self.assign(worker, now);
                        }
                    }
                }
            }
        }
    }

    /// Gives a worker the next shard of the queue. If the queue is empty, gives it a copy of the shard that
    /// would finish last, if copies are allowed and one is running.
    fn assign(&mut self, worker: usize, now: u64) {
        self.workers[worker].attempt += 1;
        self.workers[worker].job = None;
        let shard = self.queue.pop_front().or_else(|| {
            let last = self.workers.iter().filter_map(|worker| worker.job);
            let copy = last.filter(|&(shard, _)| self.running[shard] == 1).max_by_key(|&(_, end)| end);
            let copy = copy.filter(|_| !self.arguments.no_copies)?.0;
            self.found.copies += 1;
            Some(copy)
        });
        let Some(shard) = shard else { return self.idle.push(worker) };
        self.running[shard] += 1;
        let Worker { slowness, attempt, .. } = self.workers[worker];
        let end = after(now, (self.arguments.start + self.work[shard]) * slowness);
        // Failures have no memory: the time to the next is exponential.
        let failure = after(now, -(1.0 - self.random.unit()).ln() * self.arguments.fails * HOUR);
        self.workers[worker].job = Some((shard, end));
        let (time, event) = if failure < end {
            (failure, Event::Failed(worker, attempt))
        } else {
            (end, Event::Finished(worker, attempt))
        };
        self.events.push(Reverse((time, event)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMES: [f64; 3] = [0.0, 1.0, 3.0];

    /// Returns the arguments of a bake of 2,000 viewcells by 20 workers, some of them slow.
    fn arguments(fails: f64) -> Arguments {
        Arguments {
            report: PathBuf::new(),
            cells: 2000,
            workers: 20,
            shards: Vec::new(),
            start: 0.5,
            slow: 0.2,
            slowness: 4.0,
            fails,
            repair: 20.0,
            price: 0.04,
            bytes: 1000.0,
            no_copies: false,
        }
    }

    #[test]
    fn one_worker_does_shard_after_shard() {
        let arguments = Arguments { workers: 1, slow: 1.0, ..arguments(1e9) };
        // 667 shards of two or three viewcells. Starting a shard takes 0.5 s, and all times are four times as
        // long on slow workers.
        let found = simulate(&arguments, &[0.25], 3);
        assert_eq!(
            found,
            Found { seconds: 4.0 * (667.0 * 0.5 + 2000.0 * 0.25), lost: 0, copies: 0 },
            "one worker does shard after shard"
        );
    }

    #[test]
    fn the_same_input_gives_the_same_output() {
        let found = simulate(&arguments(0.05), &TIMES, 5);
        assert!(found.lost > 0 && found.copies > 0, "{found:?}");
        assert_eq!(found, simulate(&arguments(0.05), &TIMES, 5), "the simulation runs alike again");
    }

    #[test]
    fn more_failures_never_make_it_quicker() {
        // Failures become five times as frequent at least. With only a few more failures the time may be
        // shorter by luck, when work moves away from slow workers.
        for size in [1, 5, 20, 100] {
            let found = [1e9, 0.5, 0.1, 0.02].map(|hours| simulate(&arguments(hours), &TIMES, size));
            assert_eq!(found[0].lost, 0, "size {size}: shards lost without failures");
            let worse = |pair: &[Found]| pair[0].lost < pair[1].lost && pair[0].seconds <= pair[1].seconds;
            assert!(found.windows(2).all(worse), "{size}: {found:?}");
        }
    }

    #[test]
    fn every_shard_is_done_at_the_end() {
        // Workers fail after a few shards, and often two copies of a shard are lost at once.
        for cells in 1..500 {
            let arguments = Arguments { cells, workers: 4, slow: 0.5, ..arguments(0.003) };
            let mut simulation = Simulation::new(&arguments, &TIMES, 1);
            simulation.run();
            assert!(simulation.done.iter().all(|done| *done), "{cells} shards");
        }
    }
}
