//! Program `plp`: measures prioritized-layered projection as its papers do, by the share of the visible
//! triangles found with a budget of triangles.

use clap::Parser;
use comfy_table::{CellAlignment, Table, presets};
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;
use visibility_core::VisibleSet;
use visibility_core::{Culler, FrustumCuller};
use visibility_examples::arguments::{count, parse_size};
use visibility_examples::plp::conservative::{Effort, conservative, front_to_back, frustum};
use visibility_examples::plp::{BUDGETS, Coverage, Method, TriangleWorld, coverage, plot, right_and_wrong};
use visibility_examples::walkthrough::World;
use visibility_examples::{Reading, exit_code, open_as, println};
use visibility_hzb::Hzb;
use visibility_measure::ItemBuffer;
use visibility_plp::{
    Budget, DelaunayTessellation, Fineness, OctreeTessellation, PlpCuller, Solidity, Tessellation,
};

/// Measure the share of the visible triangles that prioritized-layered projection finds, by budget.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Scene: a built-in scene, a file, or `cars5:car.vscn` for five copies of a car.
    #[arg(default_value = "plpcity:3,3")]
    scene: String,
    /// How a scene file is read.
    #[command(flatten)]
    reading: Reading,
    /// Number of frames, spread evenly over the walks. By default every key of the walks is a frame.
    #[arg(long, value_name = "N", value_parser = count())]
    frames: Option<usize>,
    /// Text that the name of a walk must contain, such as `streets`. Other walks are left out.
    #[arg(long, value_name = "NAME")]
    walk: Option<String>,
    /// Width and height in pixels of the picture by which visibility is measured.
    #[arg(long, default_value = "1024x1024", value_name = "WxH", value_parser = parse_size::<u32>)]
    size: [u32; 2],
    /// Maximum number of triangle corners in a leaf of the octree; a leaf with more is split into eight.
    #[arg(long, default_value_t = Fineness::default().vertices)]
    vertices: usize,
    /// Maximum number of times that the scene's side is halved on the way to a leaf.
    #[arg(long, default_value_t = Fineness::default().halvings)]
    halvings: u32,
    /// Instead, compare the number of occlusion tests of the conservative form with testing every cell front
    /// to back.
    #[arg(long)]
    conservative: bool,
    /// Instead, time frames at budgets of 1 % to 10 % of all triangles, and fit a line.
    #[arg(long)]
    speed: bool,
    /// Folder for the plot and the pictures of the worst frame.
    #[arg(long, default_value = "out", value_name = "DIR")]
    pictures: PathBuf,
}

fn main() -> ExitCode {
    exit_code(show(&Arguments::parse()))
}

fn show(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let mut source = open_as(&arguments.scene, &arguments.reading)?.with_walks();
    source.print_notes();
    if let Some(wanted) = &arguments.walk {
        source.walks.retain(|walk| walk.name.contains(wanted));
    }
    if arguments.conservative {
        let world = World::new(source, (16 * 160, 9 * 160), arguments.frames)?;
        return show_conservative(&world);
    }
    let world = World::new(source, arguments.size.into(), arguments.frames)?;
    world.check_copies()?;
    let world = TriangleWorld::new(&world);
    let fineness = Fineness { vertices: arguments.vertices, halvings: arguments.halvings };
    let start = Instant::now();
    let octree = Arc::new(OctreeTessellation::from_scene(&world.scene, fineness));
    let took = start.elapsed().as_secs_f64();
    describe("octree", &world, &*octree, octree.memory(), took);
    if arguments.speed {
        show_speed(&world, &octree);
        return Ok(());
    }
    let start = Instant::now();
    let delaunay = Arc::new(DelaunayTessellation::new(&world.scene));
    let took = start.elapsed().as_secs_f64();
    describe("Delaunay", &world, &*delaunay, delaunay.memory(), took);
    /// Index into `methods` of the method that is plotted: the octree with solidity by coverage.
    const BEST: usize = 1;
    let mut methods = [
        Method::centroid(&world),
        Method::plp("octree, by coverage", &world, octree.clone(), Solidity::Coverage),
        Method::plp("Delaunay, by coverage", &world, delaunay.clone(), Solidity::Coverage),
        Method::plp("octree, by count", &world, octree.clone(), Solidity::Count),
        Method::plp("Delaunay, by count", &world, delaunay, Solidity::Count),
        Method::perfect(),
    ];
    let coverage = coverage(&world, &mut methods, arguments.size, || ())?;
    let mean = f64::from(coverage.exact.iter().sum::<u32>()) / coverage.exact.len() as f64;
    println!("{} frames, {mean:.0} visible triangles a frame", coverage.exact.len());
    println!("{}", table(&coverage));

    std::fs::create_dir_all(&arguments.pictures)?;
    let file = |what: &str| arguments.pictures.join(format!("plp-{}-{what}", world.name));
    let title = format!("{}: visible triangles found by budget", world.name);
    plot(&file("walk.svg"), &title, &coverage, BEST)?;
    // The frame in which sorting by distance has the most wrong pixels at the smallest budget shows the
    // differences best.
    let wrong = &coverage.found[0][0].wrong;
    let worst = (0..wrong.len()).max_by(|&a, &b| wrong[a].total_cmp(&wrong[b])).unwrap_or(0);
    let mut buffer = ItemBuffer::new(arguments.size[0], arguments.size[1])?;
    let seen = world.see(&world.views[worst], &mut buffer)?;
    for (method, name) in [(0, "centroid"), (BEST, "octree"), (2, "delaunay")] {
        let mut drawn = methods[method].order(&world.views[worst], &seen);
        drawn.truncate((world.triangles.len() as f64 * BUDGETS[0]) as usize);
        drawn.sort_unstable();
        let canvas = right_and_wrong(&world, &world.views[worst], &drawn, arguments.size)?;
        canvas.save(&file(&format!("{name}.png")))?;
    }
    println!("pictures: {}, of frame {worst} at 1 %", arguments.pictures.display());
    Ok(())
}

/// Prints table 1 of the conservative paper for four finenesses of the octree, first that of `walkthrough
/// --cullers cplp`. Returns an error when the z-buffer cannot be created.
fn show_conservative(world: &World) -> Result<(), Box<dyn Error>> {
    let total = world.source.triangle_count() as u64;
    println!("{}: {} triangles, {} frames", world.source.name, total, world.views.len());
    for vertices in [Fineness::default().vertices, 128, 1000, 5000] {
        let fineness = Fineness { vertices, ..Fineness::default() };
        let cells = Arc::new(OctreeTessellation::from_scene(&world.scene, fineness));
        println!("at most {vertices} corners of triangles a cell: {} cells", cells.content().cell_count());
        let map = || Hzb::new(512, 288);
        let mut rows = vec![frustum(world), front_to_back(world, &cells, &mut map()?)];
        for share in [200, 100, 50, 20] {
            rows.push(conservative(world, &cells, total / share, map()?));
        }
        println!("{}", efforts(&rows));
    }
    Ok(())
}

/// Formats efforts as a table, with ratios to the second row, which must be the front-to-back order.
fn efforts(rows: &[Effort]) -> Table {
    let mut table = Table::new();
    let header = ["method", "triangles", "of front to back", "tests", "fewer by", "visible cells"];
    table.load_style(presets::UTF8_HORIZONTAL_ONLY).set_header(header);
    let base = &rows[1];
    for row in rows {
        table.add_row([
            row.name.clone(),
            format!("{:.0}", row.triangles),
            format!("{:.2}", row.triangles / base.triangles),
            format!("{:.0}", row.tests),
            format!("{:.1}", base.tests / row.tests),
            format!("{:.0}", row.visible),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Prints the frame times at budgets of 1 % to 10 % of all triangles, and the line through the medians. The
/// first of three passes over the frames is not timed.
fn show_speed(world: &TriangleWorld, octree: &Arc<OctreeTessellation>) {
    let mut points = Vec::new();
    for percent in 1..=10 {
        let budget = Budget::Objects(world.triangles.len() * percent / 100);
        let mut culler = PlpCuller::new(octree.clone(), budget).with_one_sided();
        let mut visible = VisibleSet::new();
        let mut times = Vec::new();
        for pass in 0..3 {
            for view in &world.views {
                visible.fill(&world.scene, view);
                FrustumCuller::new().cull(&world.scene, view, &mut visible);
                let start = Instant::now();
                culler.cull(&world.scene, view, &mut visible);
                if pass > 0 {
                    times.push(start.elapsed().as_secs_f64() * 1e3);
                }
            }
        }
        times.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
        println!("{percent:3} %: median {:.3} ms, p90 {:.3} ms, most {:.3} ms", at(0.5), at(0.9), at(1.0));
        points.push((percent as f64, at(0.5)));
    }
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let (xy, xx, yy) = points.iter().fold((0.0, 0.0, 0.0), |(a, b, c), p| {
        let (dx, dy) = (p.0 - x, p.1 - y);
        (a + dx * dy, b + dx * dx, c + dy * dy)
    });
    let slope = xy / xx;
    println!("fit: {:.3} ms + {slope:.3} ms for each percent, r2 {:.3}", y - slope * x, xy * xy / (xx * yy));
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
