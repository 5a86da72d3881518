//! Program `occluders`: makes the occluders of a level from a scene, and prints what became of its triangles.

use clap::Parser;
use std::process::ExitCode;
use std::time::Instant;
use visibility_examples::{Reading, eprintln, open_as, println};
use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};

/// Make the occluders of a level: its opaque triangles welded, joined into planar polygons, in clusters.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Scene: a recipe such as `office:2,16`, or a file (.vscn, .glb, .gltf).
    scene: String,

    /// How a scene file is read.
    #[command(flatten)]
    reading: Reading,

    /// Share of the area of all polygons to keep, from 0 to 1. The smallest polygons are left out. By default
    /// as much as the z-buffer draws.
    #[arg(long, value_name = "SHARE")]
    keep: Option<f64>,

    /// How far a polygon may be off its plane, as a fraction of the greatest coordinate. By default some
    /// roundings.
    #[arg(long, value_name = "FRACTION")]
    flatness: Option<f64>,
}

fn main() -> ExitCode {
    match make(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn make(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let source = open_as(&arguments.scene, &arguments.reading)?;
    source.print_notes();
    let opaque = source.objects.iter().filter(|object| object.opaque && !object.door);
    let triangles: Vec<LevelTriangle> = opaque
        .flat_map(|object| {
            let two_sided = !object.one_sided;
            object.triangles.iter().map(move |&corners| LevelTriangle { corners, two_sided })
        })
        .collect();
    let mut settings = LevelSettings::default();
    if let Some(share) = arguments.keep {
        settings = settings.with_kept_area(share);
    }
    if let Some(flatness) = arguments.flatness {
        settings = settings.with_flatness(flatness);
    }
    let start = Instant::now();
    let level = LevelOccluders::new(&triangles, settings)?;
    let seconds = start.elapsed().as_secs_f64();
    let report = level.report();
    println!("{}: {} opaque triangles of {}", source.name, report.triangles, source.triangle_count());
    println!("{} faces, {} open edges", report.faces, report.open_edges);
    println!("{} T-junctions, {} open edges left", report.t_junctions, report.open_edges_left);
    println!(
        "{} planar polygons, {} vertices on straight lines removed",
        report.polygons, report.straightened
    );
    println!(
        "{} polygons kept with {} edges in {} clusters, {:.1} m2 left out; {seconds:.2} s",
        level.polygons().len(),
        level.edges().len(),
        level.clusters().len(),
        report.area_left_out,
    );
    Ok(())
}
