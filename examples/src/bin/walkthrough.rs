//! Program `walkthrough`: walks a camera through a scene, culls every frame with each of several cullers, and
//! prints times and errors.

use clap::Parser;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;
use visibility_examples::arguments::{count, parse_size, quoted, scene_arguments};
use visibility_examples::output_file::{plain_name, write_with};
use visibility_examples::progress::Steps;
use visibility_examples::source::{check_hints, parse_hint};
use visibility_examples::walkthrough::bake_advice::BakeEstimate;
use visibility_examples::walkthrough::canvas::{Canvas, save_animation};
use visibility_examples::walkthrough::judge::Judgement;
use visibility_examples::walkthrough::{
    Trial, World, aimed_rays, auto, cells_picture, cullers, explain, eye_picture, freeze, judge_with_limits,
    map_picture, output, run,
};
use visibility_examples::{Cameras, Hint, Reading, exit_code, load::is_made, load_as, open_as};
use visibility_examples::{print, print::go_on_without_reader, println};

/// Walk a camera through a scene, cull every frame, and print times and errors of each culler.
#[derive(Parser)]
#[command(version, after_help = format!("Cullers:{}", cullers::listing()))]
struct Arguments {
    /// Scene, as for --scene.
    #[arg(value_name = "SCENE", conflicts_with = "scene")]
    file: Option<String>,

    /// Scene: a built-in scene (plpcity, london, town, forest, office, each with sizes as in plpcity:3,3), a
    /// file (.vscn, .glb, .gltf), or `cars5:car.vscn` for five copies of a car, placed by the description
    /// beside the file.
    #[arg(long, value_name = "NAME[:SIZES]|FILE")]
    scene: Option<String>,

    /// How to read scene files.
    #[command(flatten)]
    reading: Reading,

    /// File whose objects are appended to the scene; may be given several times.
    #[arg(long, value_name = "FILE")]
    with: Vec<PathBuf>,

    /// Hint for all objects whose names contain TEXT, as in the program `bake`. A set that was baked with
    /// hints needs the same hints here. May be given several times.
    #[arg(long = "hint", value_name = "HINT=TEXT", value_parser = parse_hint)]
    hints: Vec<(Hint, String)>,

    /// Source of the cameras.
    #[command(flatten)]
    cameras: Cameras,

    /// Cullers to compare, separated by commas. a+b runs b after a. `auto` chooses the best culler for the
    /// scene. Every culler except `frustum` runs after frustum culling. `portals` and `pvs` need cells and
    /// portals; if the scene has none, they are made from its opaque triangles. `pvs` bakes them, which takes
    /// a minute for thousands of cells.
    #[arg(long, default_value = "frustum,hzb", value_name = "LIST")]
    cullers: String,

    /// Let `auto` try all cullers on twelve views, which takes minutes for large scenes. By default it ends
    /// after about ten seconds, with fewer views and without the cullers that need long preparation.
    #[arg(long)]
    thorough: bool,

    /// Number of frames, spread evenly over the walks. By default every key of the walks is a frame.
    #[arg(long, value_name = "N", value_parser = count())]
    frames: Option<usize>,

    /// Size of the picture in pixels. Sets the view's aspect ratio and the resolution of the item buffer.
    #[arg(long, default_value = "640x360", value_name = "WxH", value_parser = parse_size::<u32>)]
    size: [u32; 2],

    /// Number of rays to aim beside edges and corners, as a second check for hidden objects that are visible.
    /// By default none. A million rays take some seconds.
    #[arg(long, default_value_t = 0, value_name = "N")]
    rays: u64,

    /// File to write a line of JSON to for each culler. By default none.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// File to write the reported objects of each frame to: frame, culler, and indices of objects. By default
    /// none.
    #[arg(long, value_name = "FILE")]
    dump: Option<PathBuf>,

    /// Index or name of an object to explain: which stage of each culler removed it in every frame. The
    /// object is marked in the pictures.
    #[arg(long, value_name = "OBJECT")]
    explain: Option<String>,

    /// Number of a frame to freeze: also draws the objects that are visible in this frame, from above and
    /// from later cameras.
    #[arg(long, value_name = "FRAME")]
    freeze: Option<usize>,

    /// File to write an animated PNG to: each frame from the eye, beside its map by the last culler. By
    /// default none.
    #[arg(long, value_name = "FILE")]
    animation: Option<PathBuf>,

    /// Folder for pictures.
    #[arg(long, default_value = "out", value_name = "DIR")]
    pictures: PathBuf,
}

/// Time for which a frame of the animation is shown, in milliseconds.
const FRAME_MS: u16 = 120;

fn main() -> ExitCode {
    exit_code(walk(&Arguments::parse()))
}

fn walk(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    if arguments.json.is_some() || arguments.dump.is_some() {
        go_on_without_reader();
    }
    let name = arguments.scene.as_deref().or(arguments.file.as_deref()).unwrap_or("plpcity");
    let start = Instant::now();
    let mut source = open_as(name, &arguments.reading)?;
    for file in &arguments.with {
        let mut with = load_as(file, &arguments.reading)?;
        with.drop_walks();
        with.print_notes();
        source.append(with);
    }
    let mut is_named = vec![false; arguments.hints.len()];
    source.objects.iter_mut().for_each(|object| object.take_all(&arguments.hints, &mut is_named));
    check_hints(&arguments.hints, &is_named)?;
    arguments.cameras.give_whole(&mut source, &arguments.reading)?;
    source.print_notes();
    let loaded = start.elapsed();
    let start = Instant::now();
    let mut world = World::new(source, arguments.size.into(), arguments.frames)?;
    world.makes_cells = true;
    if arguments.rays > 0 {
        world.check_copies().map_err(|why| format!("--rays: {why}"))?;
    }
    let reading = if is_made(name) { Reading::default() } else { arguments.reading };
    println!("{}", output::header(&world, &reading));
    println!(
        "{} walks, {} frames; made in {:.0} ms, hierarchy in {:.0} ms",
        world.source.walks.len(),
        world.views.len(),
        loaded.as_secs_f64() * 1e3,
        start.elapsed().as_secs_f64() * 1e3,
    );

    let find = |wanted: &String| {
        explain::find(&world, wanted).ok_or_else(|| format!("there is no object `{wanted}`"))
    };
    let marked = arguments.explain.as_ref().map(find).transpose()?;
    if let Some(frame) = arguments.freeze.filter(|&frame| frame >= world.views.len()) {
        return Err(format!("there is no frame {frame} to freeze, only {}", world.views.len()).into());
    }

    let (list, advice) = auto::resolve(&arguments.cullers, &world, arguments.thorough)?;
    if let Some(advice) = advice {
        println!("{advice}");
        println!("to see it again: {}", again(arguments, name, &advice.entry));
        if let Some(bake) = advice.bake.ok().filter(BakeEstimate::is_worth_it) {
            if arguments.with.is_empty() {
                let file = format!("{}.pvs", plain_name(&world.source.name));
                let cameras = arguments.cameras.cameras.as_deref();
                println!("  {}", bake.command(name, &arguments.reading, cameras, &arguments.hints, &file));
                println!("  then --cullers frustum,baked:{file}");
            } else {
                println!("  the program `bake` takes one scene, without --with");
            }
        }
    }
    let pipelines = cullers::parse(&list, &world)?;
    let bar = Steps::new("culling", pipelines.len(), true);
    let mut trials = Vec::new();
    for (name, pipeline) in pipelines {
        trials.push(run(name, pipeline, &world));
        bar.step();
    }
    drop(bar);
    let (width, height) = world.size;
    let bar = Steps::new(&format!("the exact answer at {width}x{height}"), world.views.len(), true);
    let judgement = judge_with_limits(&world, &trials, || bar.step())?;
    drop(bar);

    println!("{}", output::truth(&judgement));
    println!("{}\n{}", output::table(&world, &trials, &judgement), output::LEGEND);
    if arguments.rays > 0 {
        print!("{}", output::aimed_rays(&trials, &aimed_rays::cast(&world, &trials, arguments.rays)));
    }
    if let Some(path) = &arguments.json {
        write_with(path, |out| output::json(out, &world, &trials, &judgement))?;
    }
    if let Some(path) = &arguments.dump {
        write_with(path, |out| output::dump(out, &trials))?;
    }
    if let Some(object) = marked {
        println!("object {object}, {}:", world.source.objects[object as usize].name);
        for (name, mut pipeline) in cullers::parse(&list, &world)? {
            print!(" {name}\n{}", explain::explain(&world, &mut pipeline, object));
        }
    }
    let album = Album { folder: &arguments.pictures, world: &world, marked };
    album.walks(&trials, &judgement)?;
    if let Some(frame) = arguments.freeze {
        for (name, mut pipeline) in cullers::parse(&list, &world)? {
            for (what, canvas) in freeze::draw(&world, &mut pipeline, frame)? {
                album.save(&canvas, &format!("{frame:04}-frozen-{name}-{what}"))?;
            }
        }
    }
    if let Some(path) = &arguments.animation {
        album.animation(path, &trials, &judgement)?;
    }
    println!("pictures: {}", arguments.pictures.display());
    Ok(())
}

/// Returns the command line that walks through the same scene with another culler.
fn again(arguments: &Arguments, scene: &str, culler: &str) -> String {
    let cameras = arguments.cameras.cameras.as_deref();
    let scene = scene_arguments(scene, &arguments.reading, cameras, &arguments.hints);
    let mut command = format!("cargo run --release -- {scene}");
    for with in &arguments.with {
        command += &format!(" --with {}", quoted(&with.display().to_string()));
    }
    let others = if culler == "frustum" { String::new() } else { format!(",{culler}") };
    format!("{command} --cullers frustum{others}")
}

/// Writer of pictures of a world into a folder. `marked` is the index of the object that is marked in the
/// pictures.
struct Album<'a> {
    folder: &'a Path,
    world: &'a World,
    marked: Option<u32>,
}

impl Album<'_> {
    /// Writes a picture as `SCENE-NAME.png` into the folder, as a [`plain_name`]. Creates
    /// the folder if needed. Returns a message with the path as the error.
    fn save(&self, canvas: &Canvas, name: &str) -> Result<(), String> {
        std::fs::create_dir_all(self.folder)
            .map_err(|error| format!("cannot make {}: {error}", self.folder.display()))?;
        let stem = plain_name(&format!("{}-{name}", self.world.source.name));
        let path = self.folder.join(format!("{stem}.png"));
        canvas.save(&path)
    }

    /// Writes an animation of all frames, each from the eye beside its map by the last trial.
    fn animation(&self, path: &Path, trials: &[Trial], judgement: &Judgement) -> Result<(), Box<dyn Error>> {
        let Self { world, marked, .. } = *self;
        let bar = Steps::new("animation", world.views.len(), true);
        let mut pictures = Vec::new();
        for frame in 0..world.views.len() {
            let eye =
                eye_picture::draw(world, &world.views[frame], eye_picture::Shown { only: None, marked })?;
            let shown = map_picture::Shown { frame, trial: trials.len().saturating_sub(1), marked };
            pictures.push(map_picture::draw_beside(&eye, world, trials, judgement, shown)?);
            bar.step();
        }
        Ok(save_animation(path, &pictures, FRAME_MS)?)
    }

    /// Writes pictures of the middle frame of each walk: one from the eye, and one from above for each
    /// culler. For a culler that hid visible objects, also draws from above the frame in which it hid the
    /// most. Returns the first error of drawing or writing.
    fn walks(&self, trials: &[Trial], judgement: &Judgement) -> Result<(), Box<dyn Error>> {
        let Self { world, marked, .. } = *self;
        let mut middles = Vec::new();
        for walk in 0..world.source.walks.len() {
            let of: Vec<_> = (0..world.poses.len()).filter(|&frame| world.poses[frame].1 == walk).collect();
            middles.extend(of.get(of.len() / 2));
        }
        for &frame in &middles {
            let shown = eye_picture::Shown { only: None, marked };
            self.save(&eye_picture::draw(world, &world.views[frame], shown)?, &format!("{frame:04}-eye"))?;
        }
        for (index, trial) in trials.iter().enumerate() {
            let hidden = &judgement.verdicts[index].hidden;
            let worst = (0..hidden.len()).max_by_key(|&frame| hidden[frame].len());
            let worst = worst.filter(|&frame| !hidden[frame].is_empty() && !middles.contains(&frame));
            for frame in middles.iter().copied().chain(worst) {
                let shown = map_picture::Shown { frame, trial: index, marked };
                let canvas = map_picture::draw(world, trials, judgement, shown)?;
                self.save(&canvas, &format!("{frame:04}-above-{}", trial.name))?;
                if trial.name.contains("portals")
                    && let Ok(canvas) = cells_picture::draw(world, trial, &judgement.exact[frame], frame)?
                {
                    self.save(&canvas, &format!("{frame:04}-cells-{}", trial.name))?;
                }
            }
        }
        Ok(())
    }
}
