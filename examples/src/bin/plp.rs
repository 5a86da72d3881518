//! Prioritized-layered projection as its papers measure it: how many of the visible triangles a budget buys.

use clap::Parser;
use comfy_table::{CellAlignment, Table, presets};
use std::error::Error;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;
use visibility_examples::plp::{BUDGETS, Coverage, Method, TriangleWorld, coverage};
use visibility_examples::walkthrough::World;
use visibility_examples::{built_in, cars5, load};
use visibility_plp::{Fineness, OctreeTessellation, Solidity, Tessellation};

/// How many of the visible triangles prioritized-layered projection finds, by budget.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// A built-in scene, a file, or cars5:car.vscn.
    #[arg(default_value = "plpcity:3,3")]
    scene: String,
    /// Number of frames, spread evenly over the walks. By default every key of the walks is a frame.
    #[arg(long, value_name = "N")]
    frames: Option<usize>,
    /// Side of the square pictures that visibility is measured in.
    #[arg(long, default_value_t = 1024)]
    size: u32,
    /// A leaf with more corners of triangles than this is cut in eight.
    #[arg(long, default_value_t = Fineness::default().vertices)]
    vertices: usize,
    /// The scene is halved no more often than this.
    #[arg(long, default_value_t = Fineness::default().halvings)]
    halvings: u32,
}

fn main() -> ExitCode {
    match show(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn show(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let name = &arguments.scene;
    let source = if let Some(car) = name.strip_prefix("cars5:") {
        cars5(Path::new(car))?
    } else if Path::new(name).extension().is_some() {
        load(Path::new(name))?
    } else {
        built_in(name)?
    };
    let world = World::new(source, (arguments.size, arguments.size), arguments.frames)?;
    let world = TriangleWorld::new(&world);
    let fineness = Fineness { vertices: arguments.vertices, halvings: arguments.halvings };
    let start = Instant::now();
    let octree = Arc::new(OctreeTessellation::with_fineness(&world.scene, fineness));
    let took = start.elapsed().as_secs_f64();
    describe("octree", &world, &*octree, octree.memory(), took);
    let mut methods = [
        Method::centroid(&world),
        Method::plp("octree, by count", &world, octree.clone(), Solidity::Count),
        Method::plp("octree, by coverage", &world, octree.clone(), Solidity::Coverage),
        Method::perfect(),
    ];
    let coverage = coverage(&world, &mut methods, arguments.size, || ())?;
    let mean = coverage.exact.iter().sum::<u32>() as f64 / coverage.exact.len() as f64;
    println!("{} frames, {mean:.0} visible triangles a frame", coverage.exact.len());
    println!("{}", table(&coverage));
    Ok(())
}

fn describe(name: &str, world: &TriangleWorld, cells: &impl Tessellation, memory: usize, took: f64) {
    let content = cells.content();
    println!(
        "{}, {} triangles; {name}: {} cells, {:.2} cells a triangle, {:.1} MB, {:.1} % of the triangles', made in {took:.2} s",
        world.name,
        world.triangles.len(),
        content.cell_count(),
        content.reference_count() as f64 / world.triangles.len() as f64,
        memory as f64 / 1e6,
        memory as f64 / (world.triangles.len() * 36) as f64 * 100.0,
    );
}

fn table(coverage: &Coverage) -> Table {
    let mut table = Table::new();
    let budgets = BUDGETS.map(|budget| format!("{} %", budget * 100.0));
    let header = ["found at".to_owned()].into_iter().chain(budgets.clone());
    let header = header.chain(["missed, of centroid's".to_owned(), "wrong pixels at worst".to_owned()]);
    table.load_style(presets::UTF8_HORIZONTAL_ONLY).set_header(header);
    for (method, name) in coverage.names.iter().enumerate() {
        let ratios = (0..BUDGETS.len()).map(|b| format!("{:.1} %", coverage.ratio(method, b) * 100.0));
        let of_centroid = |b: usize| coverage.missed(method, b) as f64 / coverage.missed(0, b).max(1) as f64;
        let missed: Vec<String> = (0..BUDGETS.len()).map(|b| format!("{:.2}", of_centroid(b))).collect();
        let wrong: Vec<String> =
            (0..BUDGETS.len()).map(|b| format!("{:.2} %", coverage.worst(method, b) * 100.0)).collect();
        let row = [name.clone()].into_iter().chain(ratios);
        table.add_row(row.chain([missed.join("  "), wrong.join("  ")]));
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
