//! Sweeps the opacity threshold of hierarchical occlusion maps over scenes: what it saves, and what it costs.

use clap::Parser;
use std::error::Error;
use std::process::ExitCode;
use visibility_core::{FrustumCuller, OcclusionCuller, OcclusionMap, Pipeline};
use visibility_examples::picture_size::parse_size;
use visibility_examples::walkthrough::{World, judge, run};
use visibility_examples::{built_in, load};
use visibility_hzb::{DepthEstimate, Hom, Hzb};

/// Sweep the opacity threshold of hierarchical occlusion maps, and print a table in Markdown.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Scenes: built-in ones, with sizes as in plpcity:3,3, or files.
    #[arg(value_name = "SCENE", default_values = ["plpcity", "london", "town", "forest", "office"])]
    scenes: Vec<String>,

    /// Opacity thresholds, from the most accurate on.
    #[arg(long, value_delimiter = ',', default_values_t = [1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7], value_name = "LIST")]
    thresholds: Vec<f32>,

    /// Frames of each scene, spread evenly over its walks.
    #[arg(long, default_value_t = 60, value_name = "N")]
    frames: usize,

    /// Size of the finest map.
    #[arg(long, default_value = "512x288", value_name = "WxH", value_parser = parse_size::<usize>)]
    map: [usize; 2],

    /// Size of the picture by which errors are counted.
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
    println!("| scene | map | us a frame | reported | visible | false hidden | wrong pixels |");
    println!("|---|---|---:|---:|---:|---:|---:|");
    for scene in &arguments.scenes {
        let source = if scene.contains('.') { load(scene.as_ref())? } else { built_in(scene)? };
        let world = World::new(source, arguments.size.into(), Some(arguments.frames))?;
        let hom = Hom::new(width, height)?;
        let mut trials = vec![
            run("hzb".into(), pipeline(Hzb::new(width, height)?), &world),
            run(
                "hom:1, plane".into(),
                pipeline(hom.clone().with_depth_estimate(DepthEstimate::Plane)),
                &world,
            ),
            run(
                "hom:1, buffer".into(),
                pipeline(hom.clone().with_depth_estimate(DepthEstimate::Buffer)),
                &world,
            ),
        ];
        for threshold in &arguments.thresholds {
            let map = hom.clone().with_threshold(*threshold);
            trials.push(run(format!("hom:{threshold}"), pipeline(map), &world));
        }
        let judgement = judge(&world, &trials, || ())?;
        for (trial, verdict) in trials.iter().zip(&judgement.verdicts) {
            let frames = trial.reported.len() as f64;
            println!(
                "| {} | {} | {:.0} | {:.1} | {:.1} | {:.2} | {:.1} |",
                world.source.name,
                trial.name,
                trial.quantile(0.5),
                trial.mean_visible(),
                judgement.mean_exact(),
                verdict.false_hidden as f64 / frames,
                verdict.wrong_pixels as f64 / frames,
            );
        }
    }
    println!(
        "\nObjects and pixels a frame, on average; the median time to cull one, one thread; maps of {width}x{height}, errors as an \
         item buffer of {}x{} sees them.",
        arguments.size[0], arguments.size[1]
    );
    Ok(())
}

fn pipeline(map: impl OcclusionMap + Send + 'static) -> Pipeline {
    Pipeline::new().with(FrustumCuller::new()).with(OcclusionCuller::new(map))
}
