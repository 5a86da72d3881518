//! Program `engine`: runs a small engine with 50,000 instances, two eyes and four shadow cascades, and prints
//! the time of each step of a frame.

use clap::Parser;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use visibility_examples::arguments::count;
use visibility_examples::engine::{Engine, MOVING};
use visibility_examples::{exit_code, println};

/// Run a small engine and print the least and the median time of each step of a frame.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Number of measured frames, after 30 frames of warm-up.
    #[arg(long, default_value_t = 300, value_parser = count())]
    frames: usize,
}

fn main() -> ExitCode {
    exit_code(run(Arguments::parse().frames.max(1)))
}

/// Runs `frames` frames and prints the table of times.
fn run(frames: usize) -> Result<(), Box<dyn std::error::Error>> {
    let begin = Instant::now();
    let mut engine = Engine::new()?;
    println!("{} instances built in {:.0?}", engine.scene().len(), begin.elapsed());
    let names = [
        "the engine's own transforms".to_string(),
        format!("move {MOVING} boxes and occluders"),
        "maintain".to_string(),
        "cull two eyes: frustum, size, z-buffer".to_string(),
        "levels of detail".to_string(),
        "draw commands".to_string(),
        "cull and group four cascades".to_string(),
        "bits for the GPU".to_string(),
        "streaming".to_string(),
    ];
    let mut times: Vec<Vec<Duration>> = vec![Vec::with_capacity(frames); names.len()];
    for frame in 0..frames + 30 {
        let mut step = 0;
        let mut last = Instant::now();
        let mut lap = || {
            let now = Instant::now();
            if frame >= 30 {
                times[step].push(now - last);
            }
            (step, last) = (step + 1, Instant::now());
        };
        engine.simulate();
        lap();
        engine.move_instances()?;
        lap();
        engine.maintain();
        lap();
        engine.cull_eyes();
        lap();
        engine.select_levels();
        lap();
        engine.list_draws();
        lap();
        engine.cull_cascades();
        lap();
        engine.write_bits()?;
        lap();
        engine.stream();
        lap();
    }
    println!("{:42} {:>9} {:>9}", "step of a frame", "least", "median");
    for (name, times) in names.iter().zip(&mut times) {
        times.sort_unstable();
        let us = |time: Duration| time.as_secs_f64() * 1e6;
        println!("{name:42} {:6.0} us {:6.0} us", us(times[0]), us(times[times.len() / 2]));
    }
    let counts = engine.counts();
    println!(
        "last frame: {} visible in {} draws; {} casters in four cascades; {} loads so far",
        counts.visible, counts.draws, counts.casters, counts.loads
    );
    Ok(())
}
