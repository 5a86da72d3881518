//! Measures every culler and each setting of its dial on every scene: what it costs, what it leaves to draw, what it gets wrong.

use clap::Parser;
use peak_alloc::PeakAlloc;
use std::error::Error;
use std::fs::{self, File};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;
use visibility_examples::open;
use visibility_examples::tradeoff::{Effort, output, plot, sweep};
use visibility_examples::walkthrough::World;
use visibility_examples::walkthrough::auto::advise;
use visibility_examples::walkthrough::cullers::entries;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Measure the trade of speed for accuracy of every culler.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Scenes, separated by commas: built-in ones with sizes as in plpcity:3x3, files, or cars5:FILE.
    #[arg(long, value_delimiter = ',', default_value = "plpcity,london,town,forest,office")]
    scenes: Vec<String>,

    /// Only these cullers, separated by commas, as `walkthrough --cullers` takes them. By default all, with every dial.
    #[arg(long, value_delimiter = ',')]
    cullers: Vec<String>,

    /// Few frames, measured briefly: for a look.
    #[arg(long)]
    quick: bool,

    /// Where the results are written: points.csv, and two plots a scene.
    #[arg(long, default_value = "out/tradeoff", value_name = "DIR")]
    out: PathBuf,
}

fn main() -> ExitCode {
    match measure(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn measure(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all(&arguments.out)
        .map_err(|error| format!("cannot make {}: {error}", arguments.out.display()))?;
    let effort = if arguments.quick { Effort::QUICK } else { Effort::FULL };
    let mut wanted = if arguments.cullers.is_empty() { entries() } else { arguments.cullers.clone() };
    let (start, mut all) = (Instant::now(), Vec::new());
    for scene in &arguments.scenes {
        let world = World::new(open(scene)?, (640, 360), Some(effort.frames))?;
        let name = world.source.name.clone();
        let total = wanted.len();
        let mut count = 0;
        let swept = sweep(
            &world,
            &wanted,
            effort,
            || MEMORY.current_usage(),
            |what| {
                count += 1;
                eprint!("\r\x1b[2K{name}: {count} of {total}: {what}");
            },
        )?;
        eprint!("\r\x1b[2K");
        println!("{name}: {} objects, {} triangles", world.scene.len(), world.source.triangle_count());
        println!("{}", output::table(&swept.points));
        println!("{}", advise(&world)?);
        if let Some(best) = output::best_sound(&swept.points) {
            println!("least in all here: {}, {:.0} us", best.culler, best.total_us());
        }
        for (entry, why) in &swept.left_out {
            println!("left out: {entry}: {why}");
        }
        if !swept.too_slow.is_empty() {
            println!("too slow, not measured on later scenes: {}", swept.too_slow.join(", "));
            wanted.retain(|entry| !swept.too_slow.contains(entry));
        }
        println!();
        plot::plots(&arguments.out, &name, &swept.points)?;
        all.extend(swept.points);
    }
    let table = arguments.out.join("points.csv");
    output::csv(File::create(&table)?, &all)?;
    println!("{}", output::LEGEND);
    println!("{} points in {:.0} s; {}", all.len(), start.elapsed().as_secs_f64(), table.display());
    Ok(())
}
