//! Bakes which cells of a map see which, through its portals.

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;
use std::process::ExitCode;
use visibility_examples::pvs::{Line, bake, read, summary};
use visibility_portals::{CellMatrix, Settings};

/// Compute the potentially visible set of each cell of a map of cells and portals.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// The map: a `.prt` file, as map compilers write them.
    map: PathBuf,

    /// Test in Pluecker space, too, what separating planes call visible: fewer pairs, every one less with a
    /// certificate.
    #[arg(long)]
    exact: bool,

    /// Threads; 0 for as many as there are. The answer is the same for any number.
    #[arg(long, default_value_t = 0)]
    threads: usize,

    /// Print a JSON line instead of words.
    #[arg(long)]
    json: bool,

    /// Write the sets compressed and with a checksum, to be loaded by `visibility_core::pvs::Pvs`.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Write which cells see which: a bit for each pair, row by row.
    #[arg(long, value_name = "FILE")]
    matrix: Option<PathBuf>,

    /// Compare with the `.vismat` file of another program.
    #[arg(long, value_name = "FILE")]
    compare: Option<PathBuf>,

    /// Name the cells that cost most.
    #[arg(long, value_name = "N", default_value_t = 0)]
    slowest: usize,

    /// The most chains of portals to look at for one cell; then it sees all that is still possible.
    #[arg(long, value_name = "STEPS")]
    limit: Option<u64>,

    /// How far from all portal edges a line must stay to count, in the map's units.
    #[arg(long, default_value_t = 1e-6)]
    clearance: f64,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), String> {
    let map = read(&arguments.map)?;
    let settings = Settings {
        clearance: arguments.clearance,
        steps_per_cell: arguments.limit.unwrap_or(Settings::default().steps_per_cell),
        exact: arguments.exact,
    };
    let threads = match arguments.threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        threads => threads,
    };
    // Drawn on the terminal's error stream, and not at all where that is none.
    let bar = ProgressBar::new(0);
    if let Ok(style) =
        ProgressStyle::with_template("{bar:40} {pos}/{len} portals, {elapsed}, {eta} to go {msg}")
    {
        bar.set_style(style);
    }
    let baked = bake(&map.graph, settings, threads, |progress| {
        bar.set_length(progress.total as u64);
        bar.set_position(progress.done as u64);
    })?;
    bar.finish_and_clear();
    let write = |path: &PathBuf, bytes: &[u8]| {
        std::fs::write(path, bytes).map_err(|error| format!("cannot write {}: {error}", path.display()))
    };
    if let Some(path) = &arguments.matrix {
        write(path, &baked.outcome.matrix.to_bytes())?;
    }
    if let Some(path) = &arguments.out {
        let pvs = baked.outcome.matrix.to_pvs(&map.graph).map_err(|error| error.to_string())?;
        write(path, pvs.as_bytes())?;
    }
    if arguments.json {
        let mode = if arguments.exact { "exact" } else { "separators" };
        let line = Line::new(&map, &baked, mode, threads);
        println!("{}", serde_json::to_string(&line).map_err(|error| error.to_string())?);
    } else {
        print!("{}", summary(&map, &baked, arguments.slowest));
    }
    if let Some(path) = &arguments.compare {
        let bytes =
            std::fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
        let other = CellMatrix::from_bytes(map.graph.cell_count(), &bytes)
            .ok_or_else(|| format!("{} is not of a map with as many cells", path.display()))?;
        let both = other.both_ways();
        eprintln!(
            "theirs: {:.2} cells in the mean, {:.2} both ways; our pairs are {:.5} of theirs both ways",
            other.mean_visible(),
            both.mean_visible(),
            baked.outcome.matrix.count() as f64 / both.count().max(1) as f64,
        );
    }
    Ok(())
}
