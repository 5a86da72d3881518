//! Program `pvs`: bakes which cells of a map see one another through portals. Takes a map with cells and
//! portals, or makes them from the walls of a scene.

use clap::{Parser, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;
use visibility_examples::output_file::write;
use visibility_examples::pvs::built::{Origin, cells};
use visibility_examples::pvs::{Line, Map, QUICK_DEPTH, bake, read, summary};
use visibility_examples::source::{SourceCells, clearance};
use visibility_examples::walkthrough::cell_sets::{CELL_STEPS, OBJECT_STEPS, objects, settings};
use visibility_examples::walkthrough::{World, world::objects_in_cells};
use visibility_examples::{Reading, eprintln, exit_code, open_as, ordinary_file, print, println};
use visibility_portals::{BakerSettings, CellMatrix, ChainTest, prt};

/// Compute the potentially visible set of each cell of a map of cells and portals, or of a scene.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Map: a `.prt` file, as map compilers write it. Or a scene, from which cells and portals are made: a
    /// recipe such as `office:2,16`, or a file.
    map: String,

    /// How a scene file is read.
    #[command(flatten)]
    reading: Reading,

    /// Source of a scene's cells: the scene itself, its boxes, or its polygons.
    #[arg(long, value_enum, default_value = "polygons")]
    from: From,

    /// File to write the cells and portals to, in the portal file format (.prt). By default none.
    #[arg(long, value_name = "FILE")]
    prt: Option<PathBuf>,

    /// Also test the chains of portals that separating planes do not exclude, in Pluecker space. Fewer pairs
    /// of cells count as visible, and each excluded pair has a certificate.
    #[arg(long)]
    exact: bool,

    /// Number of threads; 0 for one per core of the machine. The output is the same for any number.
    #[arg(long, default_value_t = 0)]
    threads: usize,

    /// Print a line of JSON instead of text.
    #[arg(long)]
    json: bool,

    /// File to write the visible sets to, compressed and with a checksum, in the format of
    /// `visibility_core::pvs::Pvs`. By default none.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// File to write the cell-to-cell matrix to, one bit for each pair of cells, row by row. By default none.
    #[arg(long, value_name = "FILE")]
    matrix: Option<PathBuf>,

    /// Matrix file (`.vismat`) of another program, whose visible pairs of cells are compared. By default
    /// none.
    #[arg(long, value_name = "FILE")]
    compare: Option<PathBuf>,

    /// Number of cells to list, starting with the cell that needed the most chains of portals.
    #[arg(long, value_name = "N", default_value_t = 0)]
    slowest: usize,

    /// Maximum number of chains of portals to test for one cell. If a cell reaches the maximum, everything
    /// not yet proven hidden from it counts as visible. By default 20,000 for the cells of a scene and 3,000
    /// for its objects.
    #[arg(long, value_name = "STEPS")]
    limit: Option<u64>,

    /// Preview: chains of portals end at the second portal, and everything that lines through it might still
    /// reach counts as visible. Takes less time and shows more cells. Never hides what a line of sight
    /// reaches; on all maps tried, shows all that the whole bake shows.
    #[arg(long, conflicts_with = "exact")]
    quick: bool,

    /// Distance that a line must keep from all portal edges to count as a line of sight, in the map's units.
    /// By default 1e-6, or more where the map's coordinates are large.
    #[arg(long)]
    clearance: Option<f64>,
}

#[derive(Clone, Copy, ValueEnum)]
enum From {
    /// Cells that the scene itself has; an error if it has none.
    Given,
    /// Cells between the axis-aligned boxes among the scene's opaque objects, found by a kd-tree.
    Walls,
    /// Cells between the scene's opaque triangles, found by a BSP tree.
    Polygons,
}

fn main() -> ExitCode {
    exit_code(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), String> {
    let made = if arguments.map.ends_with(".prt") { None } else { Some(make(arguments)?) };
    let map = match &made {
        Some((world, cells)) => Map { name: world.source.name.clone(), graph: cells.graph.clone() },
        None => read(arguments.map.as_ref())?,
    };
    if let Some(path) = &arguments.prt {
        write(path, prt::write(&map.graph).as_ref())?;
    }
    let steps = if made.is_some() { CELL_STEPS } else { u64::MAX };
    let cell_settings = BakerSettings::default()
        .with_clearance(arguments.clearance.or(made.as_ref().map(|(_, cells)| clearance(&cells.viewcells))))
        .with_steps_per_cell(arguments.limit.unwrap_or(steps))
        .with_depth(if arguments.quick { QUICK_DEPTH } else { u32::MAX })
        .with_chain_test(if arguments.exact { ChainTest::Pluecker } else { ChainTest::Separators });
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
    let baked = bake(&map.graph, cell_settings, threads, |progress| {
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
        let mode = match (arguments.exact, arguments.quick) {
            (true, _) => "exact",
            (false, true) => "quick",
            (false, false) => "separators",
        };
        let line = Line::new(&map, &baked, mode, threads);
        println!("{}", serde_json::to_string(&line).map_err(|error| error.to_string())?);
    } else {
        print!("{}", summary(&map, &baked, arguments.slowest));
    }
    if let Some((world, cells)) = &made {
        let start = Instant::now();
        let limit = settings(&cells.viewcells, arguments.limit.unwrap_or(OBJECT_STEPS));
        let objects = objects(&world.scene, &map.graph, &baked.outcome, limit)?;
        eprintln!(
            "{:.1} of {} objects seen in the mean, in {:.2} s, by {} chains; {} cells reached the limit",
            objects.mean_visible(),
            world.scene.len(),
            start.elapsed().as_secs_f64(),
            objects.steps.iter().sum::<u64>(),
            objects.fallbacks.len()
        );
    }
    if let Some(path) = &arguments.compare {
        let bytes =
            ordinary_file::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
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

/// Makes the cells and portals of a scene, assigns its objects to the cells, and prints their numbers.
fn make(arguments: &Arguments) -> Result<(World, SourceCells), String> {
    let origin = match arguments.from {
        From::Given => Origin::Given,
        From::Walls => Origin::Walls,
        From::Polygons => Origin::Polygons,
    };
    let source = open_as(&arguments.map, &arguments.reading).map_err(|error| error.to_string())?.with_walks();
    source.print_notes();
    let world = World::new(source, (64, 36), Some(1)).map_err(|error| error.to_string())?;
    let start = Instant::now();
    let mut cells = cells(&world.source, origin)?;
    let leaks = cells.names.iter().filter(|name| name.ends_with("outside")).count();
    eprintln!("cells made in {:.2} s, {leaks} of them outside", start.elapsed().as_secs_f64());
    let ids: Vec<_> = world.scene.ids().collect();
    let pairs = objects_in_cells(&world.scene, &ids, &cells.viewcells);
    cells.graph.set_objects(pairs).map_err(|error| error.to_string())?;
    if let Err(error) = cells.graph.validate(1e-6) {
        eprintln!("not as it should be: {error}");
    }
    Ok((world, cells))
}
