//! Program `cells`: makes cells and portals from a scene, bakes the potentially visible sets of the cells,
//! and prints counts and times.

use clap::{Parser, ValueEnum};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;
use visibility_examples::output_file::write;
use visibility_examples::pvs::built::{Origin, cells};
use visibility_examples::walkthrough::cell_sets::{CELL_STEPS, OBJECT_STEPS, cell_rows, objects, settings};
use visibility_examples::walkthrough::{World, world::objects_in_cells};
use visibility_examples::{Reading, eprintln, open_as, println};
use visibility_portals::prt;

/// Make cells and portals from a scene, and compute the potentially visible set of each cell.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Scene: a recipe such as `office:2,16`, or a file.
    scene: String,

    /// How a scene file is read.
    #[command(flatten)]
    reading: Reading,

    /// Origin of the cells: given by the scene, or made from its boxes or polygons.
    #[arg(long, value_enum, default_value = "polygons")]
    from: From,

    /// File to write the cells and portals to, in the portal file format (.prt). By default none.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Maximum number of chains of portals to test for one cell. A cell that reaches the maximum counts as
    /// seeing every cell and every object not yet proven hidden. By default 20,000 for cells and 3,000 for
    /// objects.
    #[arg(long, value_name = "STEPS")]
    limit: Option<u64>,
}

#[derive(Clone, Copy, ValueEnum)]
enum From {
    /// Cells that the scene itself brings; an error if there are none.
    Given,
    /// Cells between the axis-aligned boxes among the scene's opaque objects, found by a kd-tree.
    Walls,
    /// Cells between the scene's opaque triangles, found by a BSP tree.
    Polygons,
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
    let origin = match arguments.from {
        From::Given => Origin::Given,
        From::Walls => Origin::Walls,
        From::Polygons => Origin::Polygons,
    };
    let source =
        open_as(&arguments.scene, &arguments.reading).map_err(|error| error.to_string())?.with_walks();
    source.print_notes();
    let world = World::new(source, (64, 36), Some(1)).map_err(|error| error.to_string())?;
    let start = Instant::now();
    let mut cells = cells(&world.source, origin)?;
    let made = start.elapsed().as_secs_f64();
    let ids: Vec<_> = world.scene.ids().collect();
    let pairs = objects_in_cells(&world.scene, &ids, &cells.viewcells);
    cells.graph.set_objects(pairs).map_err(|error| error.to_string())?;
    println!(
        "{}: {} cells, {} portals, made in {made:.2} s",
        world.source.name,
        cells.graph.cell_count(),
        cells.graph.portals().len()
    );
    let leaks = cells.names.iter().filter(|name| name.ends_with("outside")).count();
    println!("{leaks} of the cells are outside");
    if let Err(error) = cells.graph.validate(1e-6) {
        println!("not as it should be: {error}");
    }
    if let Some(path) = &arguments.out {
        write(path, prt::write(&cells.graph).as_ref())?;
    }
    let start = Instant::now();
    let limit = |steps| settings(&cells.viewcells, arguments.limit.unwrap_or(steps));
    let baked = cell_rows(&cells.graph, limit(CELL_STEPS))?;
    println!(
        "{:.2} cells seen in the mean, in {:.2} s, by {} chains; {} cells reached the limit",
        baked.matrix.mean_visible(),
        start.elapsed().as_secs_f64(),
        baked.steps.iter().sum::<u64>(),
        baked.fallbacks.len()
    );
    let start = Instant::now();
    let objects = objects(&world.scene, &cells.graph, &baked, limit(OBJECT_STEPS))?;
    println!(
        "{:.1} of {} objects seen in the mean, in {:.2} s, by {} chains; {} cells reached the limit",
        objects.mean_visible(),
        ids.len(),
        start.elapsed().as_secs_f64(),
        objects.steps.iter().sum::<u64>(),
        objects.fallbacks.len()
    );
    Ok(())
}
