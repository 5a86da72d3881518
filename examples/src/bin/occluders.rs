//! Program `occluders`: makes the occluders of a level from a scene, writes the file that a game loads, and
//! shows in numbers and pictures which of the scene's triangles became occluders.

use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;
use visibility_examples::arguments::{count, parse_size};
use visibility_examples::level_occluders::{make, picture};
use visibility_examples::output_file::{plain_name, write};
use visibility_examples::print::go_on_without_reader;
use visibility_examples::source::{check_hints, parse_hint};
use visibility_examples::walkthrough::World;
use visibility_examples::{Cameras, Hint, Reading, exit_code, open_as, println};
use visibility_hzb::Hzb;
use visibility_occluders::{LevelOccluders, LevelSettings};

/// Make the occluders of a level: weld its opaque triangles, join them into nearly flat polygons, and group
/// these in clusters.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Scene: a recipe such as `office:2,16`, or a file (.vscn, .glb, .gltf).
    scene: String,

    /// How to read scene files.
    #[command(flatten)]
    reading: Reading,

    /// Hint for all objects whose names contain TEXT, as in the program `bake`. Doors and movers do not
    /// belong to the level. May be given several times.
    #[arg(long = "hint", value_name = "HINT=TEXT", value_parser = parse_hint)]
    hints: Vec<(Hint, String)>,

    /// Share of the area of all polygons to keep, from 0 to 1. The smallest polygons are left out. By default
    /// the share that the z-buffer draws.
    #[arg(long, value_name = "SHARE")]
    keep: Option<f64>,

    /// Greatest distance of a polygon's points from its plane, as a fraction of the greatest coordinate. By
    /// default a few rounding errors.
    #[arg(long, value_name = "FRACTION")]
    flatness: Option<f64>,

    /// Greatest distance of a polygon's points from its plane, as a share of the square root of its area. The
    /// larger of this and --flatness counts. By default the share for the z-buffer; 0 for flat polygons.
    #[arg(long, value_name = "SHARE")]
    bulge: Option<f64>,

    /// File to write, for `walkthrough --cullers hzb-level:FILE`, which refuses the file for a scene with
    /// other triangles, hints or units.
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Folder for pictures from the cameras of the polygons kept and left out. By default none.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,

    /// Camera walks of the pictures.
    #[command(flatten)]
    cameras: Cameras,

    /// Number of pictures, spread evenly over the walks.
    #[arg(long, value_name = "N", value_parser = count(), default_value = "6", requires = "pictures")]
    frames: usize,

    /// Size of the pictures in pixels.
    #[arg(long, default_value = "1024x576", value_name = "WxH", value_parser = parse_size::<u32>, requires = "pictures")]
    size: [u32; 2],
}

fn main() -> ExitCode {
    exit_code(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    if arguments.out.is_some() || arguments.pictures.is_some() {
        go_on_without_reader();
    }
    let mut source = open_as(&arguments.scene, &arguments.reading)?;
    let mut is_named = vec![false; arguments.hints.len()];
    source.objects.iter_mut().for_each(|object| object.take_all(&arguments.hints, &mut is_named));
    check_hints(&arguments.hints, &is_named)?;
    if arguments.pictures.is_some() {
        arguments.cameras.give_whole(&mut source, &arguments.reading)?;
    }
    source.print_notes();
    let world = if arguments.pictures.is_some() {
        World::new(source, arguments.size.into(), Some(arguments.frames))?
    } else {
        World::with_views(source, Vec::new(), Vec::new(), (1, 1))
    };
    let mut settings = LevelSettings::default();
    if let Some(share) = arguments.keep {
        settings = settings.with_kept_area(share);
    }
    if let Some(flatness) = arguments.flatness {
        settings = settings.with_flatness(flatness);
    }
    if let Some(bulge) = arguments.bulge {
        settings = settings.with_bulge(bulge);
    }
    let start = Instant::now();
    let level = make(&world, settings)?;
    let seconds = start.elapsed().as_secs_f64();
    let report = level.report();
    let all = world.source.triangle_count();
    println!("{}: {} opaque triangles of {all} stand still", world.source.name, report.triangles);
    println!("{} faces, {} open edges", report.faces, report.open_edges);
    println!("{} T-junctions, {} open edges left", report.t_junctions, report.open_edges_left);
    println!("{} polygons, {} vertices on straight lines removed", report.polygons, report.straightened);
    println!(
        "{} polygons kept with {} edges in {} clusters, {:.1} m2 left out; {seconds:.2} s",
        level.polygons().len(),
        level.edges().len(),
        level.clusters().len(),
        report.area_left_out,
    );
    if let Some(path) = &arguments.out {
        let bytes = level.to_bytes();
        write(path, &bytes)?;
        let version = level.version().unwrap_or_default();
        println!("{}: {} bytes, level version {version:016x}", path.display(), bytes.len());
    }
    if let Some(folder) = &arguments.pictures {
        draw(&world, Arc::new(level), folder)?;
    }
    Ok(())
}

/// Draws each view of the world into a folder, and prints what share of the pixels shows which kind of
/// triangle.
fn draw(
    world: &World,
    level: Arc<LevelOccluders>,
    folder: &std::path::Path,
) -> Result<(), Box<dyn std::error::Error>> {
    std::fs::create_dir_all(folder).map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
    let mut hzb = Hzb::default().with_level(level.clone(), world.origin());
    let name = &world.source.name;
    for (frame, view) in world.views.iter().enumerate() {
        let title = format!("{name}, frame {frame}: the level's occluders");
        let (canvas, pixels) = picture::draw(world, view, &level, &mut hzb, &title)?;
        let file = plain_name(&format!("{name}-{frame:04}-occluders"));
        let path = folder.join(format!("{file}.png"));
        canvas.save(&path)?;
        println!("{}: {pixels}", path.display());
    }
    Ok(())
}
