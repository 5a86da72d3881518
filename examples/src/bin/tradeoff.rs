//! Program `tradeoff`: measures every culler at several settings on every scene, and writes times, triangles
//! left to draw, and errors.

use clap::Parser;
use peak_alloc::PeakAlloc;
use std::error::Error;
use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;
use visibility_examples::output_file::{plain_name, write_with};
use visibility_examples::tradeoff::{Effort, output, plot, sweep};
use visibility_examples::walkthrough::auto::advise;
use visibility_examples::walkthrough::cullers::quick_entries;
use visibility_examples::walkthrough::{Prepared, World};
use visibility_examples::{Reading, exit_code, open_as, println};

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Measure every culler at several settings, to compare speed and accuracy.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Scenes: built-in ones (plpcity, london, town, forest, office, each with sizes as in plpcity:3,3),
    /// files (.vscn, .glb, .gltf), or `cars5:car.vscn` for five copies of a car, placed by the description
    /// beside the file. By default the built-in scenes.
    #[arg(value_name = "SCENE", conflicts_with = "scenes")]
    files: Vec<String>,

    /// How scene files are read.
    #[command(flatten)]
    reading: Reading,

    /// Scenes separated by commas, with sizes as in plpcity:3x3.
    #[arg(long, value_delimiter = ',', default_value = "plpcity,london,town,forest,office")]
    scenes: Vec<String>,

    /// Cullers to measure, separated by commas, in the syntax of `walkthrough --cullers`. By default all
    /// cullers, at several settings each.
    #[arg(long, value_delimiter = ',')]
    cullers: Vec<String>,

    /// Measure only a few frames, for a first look.
    #[arg(long)]
    quick: bool,

    /// Folder for the results: points.csv, and two plots per scene. If two scenes have the same name, the
    /// later one gets a number.
    #[arg(long, default_value = "out/tradeoff", value_name = "DIR")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit_code(measure(&Arguments::parse()))
}

fn measure(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all(&arguments.out)
        .map_err(|error| format!("cannot make {}: {error}", arguments.out.display()))?;
    let effort = if arguments.quick { Effort::QUICK } else { Effort::FULL };
    let (start, mut all) = (Instant::now(), Vec::new());
    let table = arguments.out.join("points.csv");
    let scenes = if arguments.files.is_empty() { &arguments.scenes } else { &arguments.files };
    let mut names: Vec<String> = Vec::new();
    let mut advised_costs = Vec::new();
    for scene in scenes {
        let source = open_as(scene, &arguments.reading)?.with_walks();
        source.print_notes();
        let world = World::new(source, (640, 360), Some(effort.frames));
        let mut world = world.map_err(|error| format!("{scene}: {error}"))?;
        world.source.name = unlike(&names, &world.source.name);
        world.prepared = Prepared::measuring(|| MEMORY.current_usage());
        world.makes_cells = true;
        let given = &arguments.cullers;
        let wanted = if given.is_empty() { quick_entries(&world) } else { given.clone() };
        let name = world.source.name.clone();
        names.push(name.clone());
        let total = wanted.len();
        let mut count = 0;
        let swept = sweep(&world, &wanted, effort, |what| {
            count += 1;
            eprint!("\r\x1b[2K{name}: {count} of {total}: {what}");
        })?;
        eprint!("\r\x1b[2K");
        println!("{name}: {} objects, {} triangles", world.scene.len(), world.source.triangle_count());
        println!("{}", swept.truth);
        println!("{}", output::table(&swept.points));
        let affordable = wanted.iter().filter(|entry| !swept.too_slow.contains(entry));
        let advice = advise(&world, &affordable.cloned().collect::<Vec<_>>(), true)?;
        println!("{advice}");
        if let Some(bake) = advice.bake.as_ref().ok().filter(|bake| bake.is_worth_it()) {
            println!(
                "  {}",
                bake.command(scene, &arguments.reading, None, &[], &format!("{}.pvs", plain_name(&name)))
            );
        }
        if let Some(best) = output::best_sound(&swept.points, true) {
            println!(
                "least in all of those that promise it: {}, {:.0} us, {:.1} times the ideal",
                best.culler,
                best.total_us(),
                best.over_ideal
            );
            if let Some(advised) = swept.points.iter().find(|point| point.culler == advice.entry) {
                let (total, ratio) = (advised.total_us(), advised.total_us() / best.total_us());
                println!(
                    "what was advised takes {total:.0} us in all here, {ratio:.2} times as much, {:.1} times the ideal",
                    advised.over_ideal
                );
                advised_costs.push(advised.over_ideal.ln());
            }
        }
        if let Some(best) = output::best_sound(&swept.points, false) {
            println!(
                "least in all that hid nothing in these frames: {}, {:.0} us",
                best.culler,
                best.total_us()
            );
        }
        for (entry, why) in &swept.left_out {
            println!("left out: {entry}: {why}");
        }
        if !swept.too_slow.is_empty() {
            let seconds = effort.patience.as_secs_f64();
            println!("given up after {seconds} s: {}", swept.too_slow.join(", "));
        }
        println!();
        plot::plots(&arguments.out, &plain_name(&name), &swept.points)?;
        all.extend(swept.points);
        // The table is written again after each scene, so that a failure in a later scene loses no results.
        write_with(&table, |out| output::csv(out, &all))?;
    }
    println!("{}", output::LEGEND);
    if advised_costs.len() > 1 {
        let mean = (advised_costs.iter().sum::<f64>() / advised_costs.len() as f64).exp();
        println!(
            "what was advised, over the ideal: {mean:.1}, geometric mean over {} scenes",
            advised_costs.len()
        );
    }
    println!("{} points in {:.0} s; {}", all.len(), start.elapsed().as_secs_f64(), table.display());
    Ok(())
}

/// Returns the name of a scene, with a number appended if it is already in `names`.
fn unlike(names: &[String], name: &str) -> String {
    let numbered = (2..).map(|number| format!("{name}-{number}"));
    let mut candidates = std::iter::once(name.to_owned()).chain(numbered);
    candidates.find(|candidate| !names.contains(candidate)).unwrap_or_default()
}
