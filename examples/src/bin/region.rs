//! Program `region`: computes by several methods the objects visible from viewcells, judges the results by
//! samples, and draws them.

use clap::Parser;
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Instant;
use visibility_bake::BakedSet;
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_examples::arguments::count;
use visibility_examples::output_file::{write, write_with};
use visibility_examples::region::cells::TurnedBox;
use visibility_examples::region::judge::{Effort, Judge};
use visibility_examples::region::output::{self, Judged};
use visibility_examples::region::{cells, methods, picture, planes, plot, trial};
use visibility_examples::{Cameras, Reading, exit_code, open_as, region};
use visibility_examples::{eprintln, print::go_on_without_reader, println};

/// Compute what can be seen from anywhere in a viewcell, and print how fast and how tight each method is.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Scene: a built-in scene (plpcity, london, town, forest, office, each with sizes as in london:40,40),
    /// or a file (.vscn, .glb, .gltf).
    #[arg(value_name = "SCENE", default_value = "london")]
    scene: String,

    /// How a scene file is read.
    #[command(flatten)]
    reading: Reading,

    /// Viewcell: a box in metres. `@` and an angle turn the box about the vertical axis through its middle,
    /// counter-clockwise seen from above. May be given several times.
    #[arg(long = "cell", value_name = "MINX,MINY,MINZ,MAXX,MAXY,MAXZ[@DEGREES]", value_parser = cells::parse,
        allow_hyphen_values = true)]
    cell: Vec<TurnedBox>,

    /// Number of viewcells to spread along the scene's walks. By default 4, or none if there is a --cell.
    #[arg(long, value_name = "N", value_parser = count())]
    cells: Option<usize>,

    /// Greatest size in metres of the viewcells along walks: two sizes on the ground, and the height. Opaque
    /// objects in the way make a viewcell smaller.
    #[arg(long, value_name = "WIDTH,DEPTH,HEIGHT", value_parser = cells::parse_size, default_value = "4,4,2")]
    size: [f64; 3],

    /// Methods, separated by commas.
    #[arg(long, value_name = "LIST", default_value = "rays", help = methods_help())]
    method: String,

    /// Source of the cameras.
    #[command(flatten)]
    cameras: Cameras,

    /// File to write a line of JSON to for each viewcell and method. By default none.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// Folder for pictures of each viewcell and method: the scene from above, with the space that is hidden
    /// at the height of the viewcell, and the occlusion maps of methods that have some. By default none.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,

    /// File to write the visible sets of the first method to, for `walkthrough --cullers region-pvs:FILE`. By
    /// default none.
    #[arg(long, value_name = "FILE")]
    pvs: Option<PathBuf>,

    /// CSV file to write the means of each method to. By default none.
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,

    /// SVG file for a plot of time against tightness. By default none.
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,

    /// Time limit in seconds for each viewcell and method. What is undecided by then counts as visible. For
    /// `exact` and `share`, which take up to a second for each object that no ray finds; the other methods
    /// end soon. By default there is no limit.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    time: Option<f64>,

    /// Number of viewpoints of each viewcell from which the judge draws item buffers.
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = count())]
    eyes: usize,

    /// Side of the judge's item buffers in pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 256)]
    side: u32,

    /// Number of rays of the judge for each viewcell.
    #[arg(long, value_name = "N", default_value_t = 400_000)]
    rays: usize,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = methods::number(text)?;
    let is_usable = seconds > 0.0 && seconds.is_finite();
    is_usable.then_some(seconds).ok_or_else(|| "a time is a number of seconds above 0".into())
}

/// Returns a function for [`Method::set_stop`](methods::Method::set_stop) that prints every ten seconds how
/// long a method has run, and returns true once it has run for `most` seconds.
fn stop_after(most: Option<f64>, what: String) -> Box<dyn Fn() -> bool + Send + Sync> {
    let (start, said) = (Instant::now(), AtomicU64::new(0));
    Box::new(move || {
        let seconds = start.elapsed().as_secs_f64();
        let tens = seconds as u64 / 10;
        if said.swap(tens, Relaxed) < tens {
            eprintln!(
                "{what}: {tens}0 s; each object that no ray finds may take a second: --time ends it with what \
                 is decided by then"
            );
        }
        most.is_some_and(|most| seconds > most)
    })
}

fn methods_help() -> String {
    format!("Methods, separated by commas, of {}", methods::known().collect::<Vec<_>>().join(", "))
}

fn main() -> ExitCode {
    exit_code(compare(&Arguments::parse()))
}

fn compare(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let files = [&arguments.pvs, &arguments.csv, &arguments.plot, &arguments.json, &arguments.pictures];
    if files.into_iter().any(Option::is_some) {
        go_on_without_reader();
    }
    let mut source = open_as(&arguments.scene, &arguments.reading)?;
    arguments.cameras.give_whole(&mut source, &arguments.reading)?;
    source.print_notes();
    let world = region::world(source);
    println!(
        "{}: {} objects, {} triangles",
        arguments.scene,
        world.scene.len(),
        world.source.triangle_count()
    );
    let turned = arguments.cell.iter().map(|cell| cells::viewcell(cell, world.source.up));
    let mut viewcells: Vec<Viewcell> = turned.collect();
    let count = arguments.cells.unwrap_or(if viewcells.is_empty() { 4 } else { 0 });
    viewcells.extend(cells::along_walks(&world, count, arguments.size));
    if viewcells.is_empty() {
        return Err("there is no viewcell: no walk, or all its eyes touch something opaque".into());
    }

    let mut methods = methods::parse(&arguments.method, &world)?;
    for (name, method) in &mut methods {
        let seconds = trial::prepare(method.as_mut(), &world.scene);
        println!("{name}: made ready for the scene in {seconds:.3} s");
    }
    let effort = Effort { eyes: arguments.eyes, side: arguments.side, rays: arguments.rays };
    let mut judge = Judge::new(&world, effort)?;
    let (mut results, mut cubes) = (Vec::new(), 0.0);
    for (number, cell) in viewcells.into_iter().enumerate() {
        eprintln!("viewcell {number}: {} to {}", cell.min, cell.max);
        let (sampled, seconds) = judge.sample(&cell)?;
        cubes += seconds;
        let mut judged = Judged { cell, sampled, trials: Vec::new() };
        let (mut lines, mut sights) = (Vec::new(), Vec::new());
        for (name, method) in &mut methods {
            method.set_stop(stop_after(arguments.time, format!("viewcell {number}, {name}")));
            judged.trials.push(trial::run(name, method.as_mut(), &world.scene, &judged.cell));
            // Objects with a line of sight found by any method count as sampled: a method that misses one has
            // lost a visible object.
            let found = method.sights();
            found.iter().for_each(|&(index, _)| judged.sampled[index as usize] = true);
            sights.extend(found);
            lines.push(method.lines());
        }
        for ((_, method), place) in methods.iter().zip(0..) {
            let left_out = judged.sampled_and_left_out(&judged.trials[place]);
            if !left_out.is_empty() {
                let found = judge.decide(&judged.cell, &left_out, method.clearance(), &sights)?;
                judged.trials[place].left_out = found;
            }
        }
        if let Some(folder) = &arguments.pictures {
            for (at, (name, method)) in methods.iter_mut().enumerate() {
                let (mut lines, up) = (std::mem::take(&mut lines[at]), world.source.up.as_dvec3());
                let maps = method.planes(&world.scene, &judged.cell);
                let segments = planes::shown(&maps).flatten().flat_map(|plane| plane.covered_segments(up));
                lines.extend(segments);
                let sheet = planes::draw(&maps, up);
                let trial = &judged.trials[at];
                let canvas = picture::draw(&world, &judged, trial, &lines, method.as_mut())?;
                std::fs::create_dir_all(folder)?;
                // Names of scenes and settings may contain any characters, even path separators, so they are
                // replaced.
                let plain = |letter: char| if letter.is_alphanumeric() { letter } else { '-' };
                let stem: String =
                    format!("{}-{number}-{name}", world.source.name).chars().map(plain).collect();
                canvas.save(&folder.join(format!("{stem}.png")))?;
                if let Some(sheet) = sheet {
                    sheet.save(&folder.join(format!("{stem}-planes.png")))?;
                }
            }
        }
        results.push(judged);
    }
    println!("{}\n{}", output::table(&results), output::LEGEND);
    if let Some(path) = &arguments.pvs {
        let cells = Viewcells::new(results.iter().map(|judged| judged.cell.clone()));
        let first =
            |judged: &Judged| judged.trials.first().map_or_else(Vec::new, |trial| trial.reported.clone());
        let rows: Vec<Vec<u32>> = results.iter().map(first).collect();
        write(path, &BakedSet::from_rows(&world.scene, cells, &rows)?.to_bytes())?;
    }
    let (eyes, side) = (arguments.eyes, arguments.side);
    let mean = cubes / results.len() as f64;
    println!("for comparison: {eyes} item-buffer cubes of {side}x{side} took {mean:.3} s for a viewcell");
    let points = plot::points(&world.source.name, &results);
    if let Some(path) = &arguments.csv {
        write_with(path, |out| plot::csv(out, &points))?;
    }
    if let Some(path) = &arguments.plot {
        plot::plot(path, &world.source.name, &points)?;
    }
    if let Some(path) = &arguments.json {
        write_with(path, |out| output::json(out, &world, &results))?;
    }
    Ok(())
}
