//! Program `hom_sweep`: culls scenes by hierarchical occlusion maps at several opacity thresholds, and prints
//! times, objects left and errors as a table.

use clap::Parser;
use std::error::Error;
use std::process::ExitCode;
use visibility_core::{Culler, FrustumCuller, OcclusionCuller, OcclusionMap, Pipeline, VisibleSet};
use visibility_examples::arguments::{count, parse_size};
use visibility_examples::walkthrough::{Trial, World, judge, run};
use visibility_examples::{built_in, load};
use visibility_examples::{eprintln, println};
use visibility_hzb::{DepthEstimate, Hom, Hzb, OccluderCriteria, OccluderDatabase};

/// Sweep the opacity threshold of hierarchical occlusion maps, and print a table in Markdown.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Scenes: built-in scenes, with sizes as in plpcity:3,3, or files.
    #[arg(value_name = "SCENE", default_values = ["plpcity", "london", "town", "forest", "office"])]
    scenes: Vec<String>,

    /// Opacity thresholds, fractions from 0 to 1, most accurate first.
    #[arg(long, value_delimiter = ',', default_values_t = [1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7], value_name = "LIST")]
    thresholds: Vec<f32>,

    /// Number of frames of each scene, spread evenly over its walks.
    #[arg(long, default_value_t = 60, value_name = "N", value_parser = count())]
    frames: usize,

    /// Size of the finest occlusion map, in pixels.
    #[arg(long, default_value = "512x288", value_name = "WxH", value_parser = parse_size::<usize>)]
    map: [usize; 2],

    /// Size in pixels of the item buffer by which errors are counted.
    #[arg(long, default_value = "1280x720", value_name = "WxH", value_parser = parse_size::<u32>)]
    size: [u32; 2],
}

fn main() -> ExitCode {
    match sweep(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn sweep(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let [width, height] = arguments.map;
    println!("| scene | map | us a frame | tests | reported | triangles | false hidden | wrong pixels |");
    println!("|---|---|---:|---:|---:|---:|---:|---:|");
    for scene in &arguments.scenes {
        let source = if scene.contains('.') { load(scene.as_ref())?.with_walks() } else { built_in(scene)? };
        let mut world = World::new(source, arguments.size.into(), Some(arguments.frames))?;
        let hom = Hom::new(width, height)?;
        let plane = || hom.clone().with_depth_estimate(DepthEstimate::Plane);
        let buffer = || hom.clone().with_depth_estimate(DepthEstimate::Buffer);
        let mut cullers: Vec<(String, Box<dyn Culler + Send + Sync>)> = vec![
            ("hzb".into(), Box::new(culler(Hzb::new(width, height)?))),
            ("hom:1, plane".into(), Box::new(culler(plane()))),
            ("hom:1, buffer".into(), Box::new(culler(buffer()))),
        ];
        for threshold in &arguments.thresholds {
            let map = hom.clone().with_threshold(*threshold);
            cullers.push((format!("hom:{threshold}"), Box::new(culler(map))));
        }
        let mut rows: Vec<_> = cullers.into_iter().map(|(name, culler)| row(name, culler, &world)).collect();
        let database = OccluderDatabase::new(&world.scene, &OccluderCriteria::default());
        database.apply(&mut world.scene)?;
        let name = format!("hom:1, database of {}", database.occluders().len());
        rows.push(row(name, Box::new(culler(hom.clone())), &world));

        let (trials, counts): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        let judgement = judge(&world, &trials, || ())?;
        let frames = world.views.len() as f64;
        for ((trial, [tests, triangles]), verdict) in trials.iter().zip(counts).zip(&judgement.verdicts) {
            println!(
                "| {} | {} | {:.0} | {:.0} | {:.1} | {:.0} | {:.2} | {:.1} |",
                world.source.name,
                trial.name,
                trial.quantile(0.5),
                tests as f64 / frames,
                trial.mean_visible(),
                triangles as f64 / frames,
                verdict.false_hidden as f64 / frames,
                verdict.wrong_pixels as f64 / frames,
            );
        }
        println!("| {} | (visible) | | | {:.1} | | | |", world.source.name, judgement.mean_exact());
    }
    println!(
        "\nFor one frame: the median time to cull it on one thread, and on average boxes tested, objects and triangles reported, visible \
         objects hidden, pixels that are wrong then. Maps of {width}x{height}; errors as an item buffer of {}x{} sees them.",
        arguments.size[0], arguments.size[1]
    );
    Ok(())
}

fn culler<M: OcclusionMap>(map: M) -> OcclusionCuller<M> {
    OcclusionCuller::new(map)
}

/// Runs one culler on all frames of a world. Returns its trial, then the number of boxes tested and the
/// number of triangles of reported objects, each summed over all frames.
fn row(name: String, culler: Box<dyn Culler + Send + Sync>, world: &World) -> (Trial, [u64; 2]) {
    let mut pipeline = Pipeline::new().with(FrustumCuller::new());
    pipeline.push(culler);
    let (mut visible, mut tests, mut triangles) = (VisibleSet::new(), 0, 0);
    for view in &world.views {
        pipeline.cull(&world.scene, view, &mut visible);
        tests += pipeline.stages().last().map_or(0, |(_, stats)| stats.tests);
        let cost = |id| world.scene.object(id).map_or(0, |object| u64::from(object.cost));
        triangles += visible.iter(&world.scene).map(cost).sum::<u64>();
    }
    (run(name, pipeline, world), [tests, triangles])
}
