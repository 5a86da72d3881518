//! Walks a camera through a scene, culls every frame with each culler asked for, and says how fast and how right the answers were.

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};
use visibility_examples::description::Description;
use visibility_examples::walkthrough::judge::Judgement;
use visibility_examples::walkthrough::{Trial, World, cullers, eye_picture, judge, map_picture, output, run};
use visibility_examples::{SceneSource, SourceError, built_in, load, load_walks};

/// Walk a camera through a scene, cull every frame, and say how fast and how right the answers were.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// The same as --scene.
    #[arg(value_name = "SCENE", conflicts_with = "scene")]
    file: Option<String>,

    /// A built-in scene (plpcity, london, town, forest, office, each with sizes as in plpcity:3,3), or a file: .vscn, .glb, .gltf.
    #[arg(long, value_name = "NAME[:SIZES]|FILE")]
    scene: Option<String>,

    /// Camera walks from the JSON description of a scene, instead of the scene's own.
    #[arg(long, value_name = "FILE.json")]
    cameras: Option<PathBuf>,

    /// Cullers to compare, separated by commas; a+b runs b after a. All but `frustum` itself run after the frustum.
    #[arg(long, default_value = "frustum", value_name = "LIST")]
    cullers: String,

    /// Number of frames, spread evenly over the walks. At first, every key of the walks is a frame.
    #[arg(long, value_name = "N")]
    frames: Option<usize>,

    /// Size of the picture: its shape is that of the view, its pixels are those that the exact answer is measured by.
    #[arg(long, default_value = "640x360", value_name = "WxH", value_parser = parse_size)]
    size: (u32, u32),

    /// Write a line of JSON for each culler.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// Write what each culler reports in each frame: frame, culler, and the objects in the scene's order.
    #[arg(long, value_name = "FILE")]
    dump: Option<PathBuf>,

    /// Where pictures are written.
    #[arg(long, default_value = "out", value_name = "DIR")]
    pictures: PathBuf,
}

fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let (width, height) = text.split_once('x').ok_or("a size looks like 640x360")?;
    let side = |text: &str| text.parse().map_err(|error| format!("{text}: {error}"));
    Ok((side(width)?, side(height)?))
}

fn main() -> ExitCode {
    match walk(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn walk(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let pipelines = cullers::parse(&arguments.cullers)?;
    let name = arguments.scene.as_deref().or(arguments.file.as_deref()).unwrap_or("plpcity");
    let start = Instant::now();
    let source = scene(name, arguments.cameras.as_deref())?;
    let (objects, triangles) = (source.objects.len(), source.triangle_count());
    let loaded = start.elapsed();
    let start = Instant::now();
    let world = World::new(source, arguments.size, arguments.frames)?;
    println!(
        "{}: {objects} objects, {triangles} triangles, {} walks, {} frames; made in {:.0} ms, hierarchy in {:.0} ms",
        world.source.name,
        world.source.walks.len(),
        world.views.len(),
        loaded.as_secs_f64() * 1e3,
        start.elapsed().as_secs_f64() * 1e3,
    );

    let bar = progress("culling", pipelines.len());
    let mut trials = Vec::new();
    for (name, pipeline) in pipelines {
        trials.push(run(name, pipeline, &world));
        bar.inc(1);
    }
    bar.finish_and_clear();
    let (width, height) = world.size;
    let bar = progress(&format!("the exact answer at {width}x{height}"), world.views.len());
    let judgement = judge(&world, &trials, || bar.inc(1))?;
    bar.finish_and_clear();

    println!("{}\n{}", output::table(&world, &trials, &judgement), output::LEGEND);
    if let Some(path) = &arguments.json {
        write_file(path, |out| output::json(out, &world, &trials, &judgement))?;
    }
    if let Some(path) = &arguments.dump {
        write_file(path, |out| output::dump(out, &trials))?;
    }
    pictures(&arguments.pictures, &world, &trials, &judgement)
}

fn scene(name: &str, cameras: Option<&Path>) -> Result<SceneSource, SourceError> {
    let path = Path::new(name);
    let mut source =
        if path.extension().is_some() && !name.contains(':') { load(path)? } else { built_in(name)? };
    if let Some(cameras) = cameras {
        source.walks = load_walks(cameras)?;
        let description = Description::load(cameras)?;
        source.near = description.near.unwrap_or(source.near);
        source.up = description.up.unwrap_or(source.up);
    }
    Ok(source)
}

/// A bar where someone watches; elsewhere a line that says what has begun.
fn progress(what: &str, steps: usize) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        eprintln!("{what}: {steps} steps ...");
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(steps as u64).with_message(what.to_owned());
    let style = ProgressStyle::with_template("{msg} {bar:40} {pos}/{len} {eta}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}

fn write_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<(), Box<dyn Error>> {
    let told = |error: std::io::Error| format!("cannot write {}: {error}", path.display());
    let mut out = BufWriter::new(File::create(path).map_err(told)?);
    write(&mut out).and_then(|()| out.flush()).map_err(told)?;
    Ok(())
}

/// The middle of each walk from the eye, and from above for each culler; for a culler that lost something, also the frame
/// in which it lost most.
fn pictures(
    folder: &Path,
    world: &World,
    trials: &[Trial],
    judgement: &Judgement,
) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder).map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
    let save = |canvas: visibility_examples::walkthrough::canvas::Canvas, name: String| {
        let path = folder.join(name);
        canvas.save(&path).map_err(|error| format!("cannot write {}: {error}", path.display()))
    };
    let mut middles = Vec::new();
    for walk in 0..world.source.walks.len() {
        let of: Vec<_> = (0..world.poses.len()).filter(|&frame| world.poses[frame].1 == walk).collect();
        middles.extend(of.get(of.len() / 2));
    }
    for &frame in &middles {
        save(eye_picture::draw(world, frame)?, format!("{}-{frame:04}-eye.png", world.source.name))?;
    }
    for (index, trial) in trials.iter().enumerate() {
        let hidden = &judgement.verdicts[index].hidden;
        let worst = (0..hidden.len()).max_by_key(|&frame| hidden[frame].len());
        let worst = worst.filter(|&frame| !hidden[frame].is_empty() && !middles.contains(&frame));
        for frame in middles.iter().copied().chain(worst) {
            let canvas = map_picture::draw(world, trial, judgement, index, frame)?;
            save(canvas, format!("{}-{frame:04}-above-{}.png", world.source.name, trial.name))?;
        }
    }
    println!("pictures: {}", folder.display());
    Ok(())
}
