//! Program `bake`: finds what can be seen from each viewcell of a scene, and writes the file that a game
//! loads.

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use std::ffi::OsStr;
use std::fs::DirBuilder;
use std::hash::{BuildHasher, RandomState};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use visibility_bake::{CellSandwich, Shard, assemble};
use visibility_core::bake::Progress;
use visibility_examples::arguments::{quoted, scene_arguments};
use visibility_examples::bake::pictures;
use visibility_examples::bake::report::Report;
use visibility_examples::bake::{
    Budget, Degrees, Failure, Fitted, Job, Level, Plan, Run, fit, forget, forget_depths, run,
};
use visibility_examples::output_file::{Lock, beside, is_special, target, write};
use visibility_examples::{eprintln, ordinary_file, print, println};

/// Bake what can be seen from each viewcell of a scene. An interrupted bake resumes where it was. The last
/// lines tell how many viewcells exceed the wanted gap, and the version of the level. A game whose scene has
/// only boxes passes this version to the loader of the file.
///
/// `bake assemble` puts the shards of a bake (--shard) together. `bake fingerprint` prints the hash that all
/// shards of a bake share, and the number of viewcells.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(flatten)]
    job: Job,

    #[command(flatten)]
    budget: Budget,

    /// File to write, for `walkthrough --cullers baked:FILE`. With --shard, the file of the shard.
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,

    #[command(flatten)]
    degrees: Degrees,

    /// Time limit in seconds. What is undecided by then counts as visible. By default there is no limit. If
    /// not all viewcells are made within the limit, or within a second if that is longer, the bake fails.
    #[arg(long, value_name = "SECONDS")]
    time: Option<f64>,

    /// Least seconds between two writes of the finished work to FILE.state. The pause grows to a tenth of the
    /// time so far, so an interruption loses at most about that much work.
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0)]
    save: f64,

    /// Cache file, read if it exists and written at the end. After an edit of the scene, only viewcells that
    /// the edit can have changed are baked again; the output is the same as without a cache. By default none.
    #[arg(long, value_name = "FILE", conflicts_with = "budget")]
    cache: Option<PathBuf>,

    /// Number of threads; 0 for one per core of the machine. The output is the same for any number.
    #[arg(long, default_value_t = 0)]
    threads: usize,

    /// Bake only part I of N parts, counted from 0, for `bake assemble`.
    #[arg(long, value_name = "I/N", value_parser = part,
        conflicts_with_all = ["time", "json", "pictures", "budget", "degrees"])]
    shard: Option<[usize; 2]>,

    /// File to write the report to, as JSON. By default none.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// Folder for pictures: a heat map of the gaps of all viewcells (PNG and SVG), and the viewcells with
    /// the greatest gaps. By default none.
    #[arg(long, value_name = "DIR", conflicts_with = "memory")]
    pictures: Option<PathBuf>,
}

/// Put the shards of a bake together. The scene and all settings must be those of the shards.
#[derive(Parser)]
#[command(name = "bake assemble", version)]
struct Assembly {
    #[command(flatten)]
    job: Job,

    /// File to write, for `walkthrough --cullers baked:FILE`.
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,

    #[command(flatten)]
    degrees: Degrees,

    /// Files of the shards, in any order.
    #[arg(long, value_name = "FILE", num_args = 1.., required = true)]
    shards: Vec<PathBuf>,

    /// File to write the report to, as JSON. By default none.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// Folder for the same pictures as a whole bake writes. By default none.
    #[arg(long, value_name = "DIR", conflicts_with = "memory")]
    pictures: Option<PathBuf>,
}

/// Print the hash that all shards of a bake share, and the number of viewcells.
#[derive(Parser)]
#[command(name = "bake fingerprint", version)]
struct Identity {
    #[command(flatten)]
    job: Job,
}

/// Least time allowed for making the viewcells, whatever the time limit.
const LEAST_TIME: Duration = Duration::from_secs(1);

/// Time by which the viewcells must be made. Unset without a time limit.
static VIEWCELLS_END: OnceLock<Instant> = OnceLock::new();

fn is_too_late_for_viewcells() -> bool {
    VIEWCELLS_END.get().is_some_and(|&end| Instant::now() >= end)
}

/// Exit code if the memory is too small.
const MEMORY_EXIT_CODE: u8 = 3;

/// Reads the index of a shard and the number of shards, as in 0/4.
fn part(text: &str) -> Result<[usize; 2], String> {
    let numbers = text.split_once('/').and_then(|(i, n)| Some([i.parse().ok()?, n.parse().ok()?]));
    numbers.filter(|[i, n]| i < n).ok_or_else(|| "a part is I/N with I from 0 to N - 1".to_owned())
}

/// Settings of the allocator of glibc for a bake with a memory limit. By default glibc keeps much of the
/// freed memory, separately for each thread.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const ALLOCATOR: [(&str, &str); 3] =
    [("MALLOC_ARENA_MAX", "1"), ("MALLOC_MMAP_THRESHOLD_", "65536"), ("MALLOC_TRIM_THRESHOLD_", "65536")];

/// Restarts the program with [`ALLOCATOR`], since glibc reads these settings only at the start. Returns if
/// the user has set any of them, or if the restart fails; the bake may then take more memory than the limit.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn begin_with_allocator() {
    use std::os::unix::process::CommandExt;
    if ALLOCATOR.iter().all(|(name, _)| std::env::var_os(name).is_none())
        && let Ok(program) = std::env::current_exe()
    {
        let _ = std::process::Command::new(program).args(std::env::args_os().skip(1)).envs(ALLOCATOR).exec();
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn begin_with_allocator() {}

fn main() -> ExitCode {
    let from_first = std::env::args_os().skip(1);
    let first = std::env::args_os().nth(1);
    let done = match first.as_deref().and_then(OsStr::to_str) {
        Some("assemble") => put_together(&Assembly::parse_from(from_first)),
        Some("fingerprint") => identify(&Identity::parse_from(from_first)),
        _ => bake(&Arguments::parse()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            match error {
                Failure::Memory(_) => ExitCode::from(MEMORY_EXIT_CODE),
                Failure::Other(_) => ExitCode::FAILURE,
            }
        }
    }
}

/// Bakes a scene, or one shard of its bake. Writes the output file, and the cache, report and pictures that
/// the arguments ask for.
fn bake(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.job.memory.is_some() {
        begin_with_allocator();
    }
    let duration = |seconds| Duration::try_from_secs_f64(seconds).map_err(|error| error.to_string());
    let limit = arguments.time.map(duration).transpose()?;
    let save_every = duration(arguments.save)?;
    let (base, _folder) = base(&arguments.out)?;
    let _lock = Lock::new(&base)?;
    let begun = Instant::now();
    if let Some(end) = limit.and_then(|limit| begun.checked_add(limit.max(LEAST_TIME))) {
        let _ = VIEWCELLS_END.set(end);
    }
    let mut level = Level::open(&arguments.job, &beside(&base, ".tiles"), is_too_late_for_viewcells)?;
    if let Some(cache) = &arguments.cache {
        level.take_cache(cache)?;
    }
    let count = level.viewcells.cells().len();
    let range = arguments.shard.map_or(0..count, |[i, n]| {
        // The product of two counts of viewcells or shards fits in 128 bits.
        let at = |i: usize| (count as u128 * i as u128 / n as u128) as usize;
        at(i)..at(i + 1)
    });
    let left = || limit.map(|limit| limit.saturating_sub(begun.elapsed()));
    if let Some(limit) = left().filter(|_| !beside(&base, ".state").exists()) {
        let threads = match arguments.threads {
            0 => std::thread::available_parallelism().map_or(1, |threads| threads.get()),
            threads => threads,
        };
        eprintln!("{}", Plan::measure(&level, limit, threads).text());
    }
    let limit = left();
    let settings = Run { threads: arguments.threads, limit, save_every, state: beside(&base, ".state") };
    // The bar is drawn on standard error, and only if that is a terminal.
    let bar = ProgressBar::new(range.len() as u64);
    let template = "{msg} {bar:40} {pos}/{len} viewcells, {elapsed}, {eta} to go in this step";
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    let start = Instant::now();
    let show = |count: usize, now: Progress| {
        let (step, done) = (now.done / count.max(1), now.done % count.max(1));
        if let Some(step) = ["sweeps of groups", "sweeps", "rays", "boxes", "triangles"].get(step)
            && bar.message() != *step
        {
            bar.set_message(*step);
            bar.reset_eta();
        }
        bar.set_position(done as u64);
    };
    if let Some(budget) = arguments.budget.of(arguments.job.places.size, level.up) {
        let fitted = fit(&mut level, budget, &settings, &base, |count, now| {
            bar.set_length(count as u64);
            show(count, now);
        })?;
        bar.finish_and_clear();
        return write_fitted(arguments, &level, fitted, start.elapsed().as_secs_f64(), &base);
    }
    let baker = || level.baker().with_range(range.clone());
    let outcome = run(baker, &settings, |now| show(range.len(), now))?;
    bar.finish_and_clear();
    let cache = arguments.cache.as_ref().map(|path| (path, outcome.cache.to_bytes()));
    let (reused, complete) = (outcome.reused, outcome.complete || arguments.shard.is_some());
    let said = if arguments.shard.is_some() {
        let shard = Shard::new(level.fingerprint(), outcome);
        write(&arguments.out, &shard.to_bytes())?;
        format!("viewcells {} to {} of {count}: {}\n", range.start, range.end, arguments.out.display())
    } else {
        let seconds = start.elapsed().as_secs_f64();
        let set = level.set(outcome.source, &outcome.cells, &arguments.degrees)?;
        write(&arguments.out, &set.to_bytes())?;
        let mut report = Report::new(&level, &outcome.cells, &outcome.times, &set, seconds, outcome.complete);
        (report.stages, report.too_large, report.cut) = (outcome.stages, outcome.too_large, outcome.cut);
        write_report(&level, &outcome.cells, &report, &arguments.json, &arguments.pictures)?;
        report.text() + &next_command(&arguments.job, &arguments.out)
    };
    if complete {
        forget(&settings.state);
    }
    // The result does not depend on the cache, which another bake may be writing at this moment.
    if let Some((path, bytes)) = cache {
        write(path, &bytes)?;
    }
    // All files are written before anything is printed, since printing to a closed pipe ends the program.
    if let Some(path) = &arguments.cache {
        println!("{reused} of {} viewcells from {}", range.len(), path.display());
    }
    print!("{said}");
    Ok(())
}

/// Writes the file, report and pictures of a bake with a budget, which has taken `seconds`.
fn write_fitted(
    arguments: &Arguments,
    level: &Level,
    fitted: Fitted,
    seconds: f64,
    base: &Path,
) -> Result<(), Failure> {
    let Fitted { cells, source, times, complete, too_large, cut } = fitted;
    let set = level.set(source, &cells, &arguments.degrees)?;
    write(&arguments.out, &set.to_bytes())?;
    let mut report = Report::new(level, &cells, &[], &set, seconds, complete);
    (report.methods, report.too_large, report.cut) = ((&times).into(), too_large, cut);
    write_report(level, &cells, &report, &arguments.json, &arguments.pictures)?;
    if complete {
        forget_depths(base);
    }
    print!("{}{}", report.text(), next_command(&arguments.job, &arguments.out));
    Ok(())
}

/// Returns the path to which the names of the program's own files are appended: the file to write, or the
/// target if that is a link. If the output is a device or pipe, a path in a temporary folder, which is
/// returned as well.
fn base(out: &Path) -> Result<(PathBuf, Option<TemporaryFolder>), String> {
    if !is_special(out) {
        return Ok((target(out), None));
    }
    let folder = TemporaryFolder::new()?;
    Ok((folder.0.join("bake"), Some(folder)))
}

/// New folder for files of this process alone, which is removed with its files when this value is dropped.
struct TemporaryFolder(PathBuf);

impl TemporaryFolder {
    /// Makes the folder in the system's folder for temporary files, which other users may share. So its name
    /// cannot be guessed, and on Unix only this user may enter it.
    fn new() -> Result<Self, String> {
        let path = std::env::temp_dir().join(format!("bake-{:016x}", RandomState::new().hash_one(0)));
        let mut folder = DirBuilder::new();
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut folder, 0o700);
        // A file or link of that name is an error.
        folder.create(&path).map_err(|error| format!("cannot make {}: {error}", path.display()))?;
        Ok(Self(path))
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        // A folder that cannot be removed stays.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Prints the fingerprint of a bake and the number of its viewcells.
fn identify(arguments: &Identity) -> Result<(), Failure> {
    let folder = TemporaryFolder::new()?;
    let level = Level::open(&arguments.job, &folder.0.join("tiles"), || false)?;
    let said = format!("{:016x} {}", level.fingerprint(), level.viewcells.cells().len());
    // Files are removed before anything is printed, since printing to a closed pipe ends the program.
    drop((level, folder));
    println!("{said}");
    Ok(())
}

/// Assembles shards, and writes the file and the report.
fn put_together(arguments: &Assembly) -> Result<(), Failure> {
    let (base, _folder) = base(&arguments.out)?;
    let _lock = Lock::new(&base)?;
    let level = Level::open(&arguments.job, &beside(&base, ".tiles"), || false)?;
    let fingerprint = level.fingerprint();
    let mut shards = Vec::new();
    for file in &arguments.shards {
        let named = |error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
        let bytes = ordinary_file::read(file).map_err(|error| named(&error))?;
        let shard = Shard::from_bytes(&bytes).map_err(|error| named(&error))?;
        if shard.fingerprint != fingerprint {
            return Err(named(&"it is of another scene, other viewcells or other settings").into());
        }
        shards.push(shard);
    }
    let baker = level.baker();
    let cells = assemble(&baker, shards).map_err(|error| error.to_string())?;
    let set = level.set(baker.source(), &cells, &arguments.degrees)?;
    write(&arguments.out, &set.to_bytes())?;
    let report = Report::new(&level, &cells, &[], &set, 0.0, true);
    write_report(&level, &cells, &report, &arguments.json, &arguments.pictures)?;
    print!("{}{}", report.text(), next_command(&arguments.job, &arguments.out));
    Ok(())
}

/// Returns the command line that culls by the file of a bake, to print for the user.
fn next_command(job: &Job, file: &Path) -> String {
    if file.to_string_lossy().contains([',', '+']) {
        return "to cull by it, give it a name without , and +: they separate cullers\n".to_owned();
    }
    let scene = scene_arguments(&job.scene, &job.reading, job.cameras.cameras.as_deref(), &job.hints);
    let culler = quoted(&format!("baked:{}", file.display()));
    format!("to cull by it: cargo run --release -- {scene} --cullers frustum,{culler}\n")
}

/// Writes the report and the pictures of a bake that the arguments ask for.
fn write_report(
    level: &Level,
    cells: &[CellSandwich],
    report: &Report,
    json: &Option<PathBuf>,
    folder: &Option<PathBuf>,
) -> Result<(), Failure> {
    if let Some(path) = json {
        write(path, &serde_json::to_vec(report).map_err(|error| error.to_string())?)?;
    }
    let drawn = folder.as_deref().map_or(Ok(()), |folder| pictures::draw(level, cells, report, folder));
    drawn.map_err(Failure::from)
}
