//! Program `streaming`: walks through a scene while a streaming cache holds the visible and recently visible
//! objects in memory, and prints the cache's memory and traffic.

use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;
use visibility_core::VisibleSet;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Prefetch;
use visibility_examples::built_in;
use visibility_examples::region::read_sets;
use visibility_examples::streaming_cache::Cache;
use visibility_examples::walkthrough::{World, cullers};
use visibility_examples::{exit_code, println};

/// Walk through a built-in scene while objects are loaded as they become visible and unloaded after they
/// became hidden.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Built-in scene, with or without sizes, such as `plpcity` or `office:2,16`.
    #[arg(default_value = "plpcity")]
    scene: String,

    /// Culler that decides on visibility, in the syntax of `walkthrough --cullers`.
    #[arg(long, default_value = "frustum")]
    culler: String,

    /// Number of frames for which a hidden object stays in memory.
    #[arg(long, default_value_t = 30)]
    patience: u64,

    /// File of the program `bake`, from which the cache loads objects before they become visible. Suits the
    /// culler `baked:FILE`.
    #[arg(long, value_name = "FILE")]
    prefetch: Option<PathBuf>,

    /// Seconds to look ahead, at 60 frames a second.
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0)]
    ahead: f64,
}

fn main() -> ExitCode {
    exit_code(stream(&Arguments::parse()))
}

fn stream(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    // With ten frames between two keys of a walk, the camera moves at about walking pace.
    let source = built_in(&arguments.scene)?;
    let frames = source.walks.iter().map(|walk| walk.keys.len()).sum::<usize>() * 10;
    let all = source.triangle_count() as f64;
    let mut world = World::new(source, (640, 360), Some(frames))?;
    world.makes_cells = true;
    let (_, mut pipeline) = cullers::parse(&arguments.culler, &world)?.remove(0);
    let (mut visible, mut cache) = (VisibleSet::new().with_changes(), Cache::new(arguments.patience));
    let sets = match &arguments.prefetch {
        Some(file) => Some(read_sets(file, &world)?),
        None => None,
    };
    let mut prefetch = Prefetch::new();
    println!("frame   visible  appeared  vanished  in memory  loads  unloads");
    for (frame, view) in world.views.iter().enumerate() {
        pipeline.cull(&world.scene, view, &mut visible);
        cache.update(&world.scene, &visible);
        if let Some(sets) = &sets {
            let (pose, walk) = &world.poses[frame];
            let before = frame.checked_sub(1).map(|before| &world.poses[before]);
            // The first frame of a walk has no velocity.
            let step = before.filter(|(_, other)| other == walk).map(|(before, _)| pose.eye - before.eye);
            let velocity = step.unwrap_or(DVec3::ZERO) * 60.0;
            let reach = f64::from(world.source.near) * 2.0;
            for arrival in prefetch.search(sets, pose.eye, velocity, reach, arguments.ahead) {
                cache.announce(&world.scene, arrival.object);
            }
        }
        if frame % (frames / 20).max(1) == 0 {
            let traffic = cache.traffic();
            println!(
                "{frame:5}  {:8}  {:8}  {:8}  {:7.1} %  {:5}  {:7}",
                visible.count(&world.scene),
                visible.newly_visible().count(),
                visible.newly_hidden().count(),
                traffic.resident as f64 / all * 100.0,
                traffic.loads,
                traffic.unloads,
            );
        }
    }
    let traffic = cache.traffic();
    println!(
        "{frames} frames: at most {:.1} % of all triangles in memory at a time; {} loads, \
         {} of them ahead, {} unloads, {} spared by patience",
        traffic.peak as f64 / all * 100.0,
        traffic.loads,
        traffic.ahead,
        traffic.unloads,
        traffic.spared,
    );
    Ok(())
}
