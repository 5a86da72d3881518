//! Program `pvs`: bakes the cell-to-cell visibility of a map through its portals.

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;
use std::process::ExitCode;
use visibility_examples::output_file::write;
use visibility_examples::pvs::{Line, bake, read, summary};
use visibility_examples::{eprintln, print, println};
use visibility_portals::{BakerSettings, CellMatrix, ChainTest};

/// Compute the potentially visible set of each cell of a map of cells and portals.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Map: a `.prt` file, as map compilers write it.
    map: PathBuf,

    /// Also test in Pluecker space the chains of portals that separating planes do not exclude. Fewer pairs
    /// of cells count as visible; each pair excluded has a certificate.
    #[arg(long)]
    exact: bool,

    /// Number of threads; 0 for as many as the machine has. The answer is the same for any number.
    #[arg(long, default_value_t = 0)]
    threads: usize,

    /// Print a line of JSON instead of text.
    #[arg(long)]
    json: bool,

    /// File to write the visible sets to, compressed and with a checksum, in the format of
    /// `visibility_core::pvs::Pvs`. By default none.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// File to write the cell-to-cell matrix to: a bit for each pair of cells, row by row. By default none.
    #[arg(long, value_name = "FILE")]
    matrix: Option<PathBuf>,

    /// Matrix file (`.vismat`) of another program, to compare the visible pairs of cells with. By default
    /// none.
    #[arg(long, value_name = "FILE")]
    compare: Option<PathBuf>,

    /// Number of cells to list, those that took the most chains of portals first.
    #[arg(long, value_name = "N", default_value_t = 0)]
    slowest: usize,

    /// Maximum number of chains of portals to test for one cell. A cell that reaches the maximum counts as
    /// seeing every cell not yet proven hidden.
    #[arg(long, value_name = "STEPS")]
    limit: Option<u64>,

    /// Distance that a line must keep from all portal edges to count, in the map's units. 1e-6 if not set, or
    /// more where the map's coordinates are large.
    #[arg(long)]
    clearance: Option<f64>,
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
    let settings = BakerSettings {
        clearance: arguments.clearance,
        steps_per_cell: arguments.limit.unwrap_or(BakerSettings::default().steps_per_cell),
        chain_test: if arguments.exact { ChainTest::Pluecker } else { ChainTest::Separators },
    };
    let threads = match arguments.threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        threads => threads,
    };
    // The bar is drawn on standard error, and only if that is a terminal.
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
