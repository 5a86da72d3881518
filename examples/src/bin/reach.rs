//! Program `reach`: walks through scenes at 60 frames a second with answers that are good for a while, and
//! prints how many frames are skipped, how many objects are reported, and what culling takes, beside culling
//! in every frame. Some frames are compared with an item buffer.

use clap::Parser;
use comfy_table::{Table, presets};
use glam::DVec3;
use std::process::ExitCode;
use std::time::Instant;
use visibility_core::view::Reach;
use visibility_core::{Pipeline, Pose, Scene, View, VisibleSet};
use visibility_examples::arguments::count;
use visibility_examples::walkthrough::{World, cullers};
use visibility_examples::{Cameras, Reading, Walk, exit_code, open_as, println};
use visibility_measure::{Comparison, ItemBuffer};

/// Walk through scenes with answers that are good for a while: frames skipped, objects reported, time.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Scenes: built-in ones, with or without sizes, or files (.vscn, .glb, .gltf).
    #[arg(default_values_t = ["office".to_owned(), "london".to_owned()])]
    scenes: Vec<String>,

    /// How to read scene files.
    #[command(flatten)]
    reading: Reading,

    /// Source of the walks.
    #[command(flatten)]
    cameras: Cameras,

    /// Cullers, separated by commas, in the syntax of `walkthrough --cullers`.
    #[arg(long, default_value = "frustum,hzb,hzb-level")]
    cullers: String,

    /// Radius of the ball of eyes in metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.12)]
    metres: f64,

    /// Greatest angle of a turn in degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = 7.5)]
    degrees: f64,

    /// Speed of the eye in metres per second.
    #[arg(long, value_name = "SPEED", default_value_t = 1.4)]
    speed: f64,

    /// Greatest speed in degrees per second at which the camera turns: to where the walk looks, and from side
    /// to side of that by 30 degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = 90.0)]
    turn: f64,

    /// Number of frames per scene, at 60 per second, divided among its first four walks.
    #[arg(long, default_value_t = 1200, value_parser = count())]
    frames: usize,

    /// Number of frames from one judged by an item buffer to the next.
    #[arg(long, default_value_t = 7, value_parser = count())]
    judged: usize,
}

/// Frames per second.
const RATE: f64 = 60.0;
/// Greatest angle in radians by which the camera looks beside the direction of the walk.
const SWAY: f64 = std::f64::consts::PI / 6.0;
/// Width and height of the picture in pixels.
const SIZE: (u32, u32) = (640, 360);

fn main() -> ExitCode {
    exit_code(measure(&Arguments::parse()))
}

/// Sums over the frames of one scene and one way to cull.
#[derive(Default)]
struct Sums {
    skipped: usize,
    reported: usize,
    triangles: u64,
    ms: f64,
    /// Time of the slowest frame in milliseconds.
    longest: f64,
    missing: u64,
}

fn measure(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let mut table = Table::new();
    table.load_style(presets::UTF8_HORIZONTAL_ONLY);
    table.set_header([
        "scene",
        "culler",
        "frames",
        "skipped",
        "reported",
        "each frame",
        "times",
        "triangles",
        "each frame",
        "times",
        "ms",
        "each frame",
        "times",
        "longest",
        "missing",
        "of frames",
    ]);
    let reach = Reach::new(arguments.metres, arguments.degrees.to_radians());
    for name in &arguments.scenes {
        let mut source = open_as(name, &arguments.reading)?;
        arguments.cameras.give_whole(&mut source, &arguments.reading)?;
        source.print_notes();
        let walks: Vec<&Walk> = source.walks.iter().filter(|walk| walk.keys.len() > 1).take(4).collect();
        let mut views = Vec::new();
        for (index, walk) in walks.iter().enumerate() {
            let frames = arguments.frames / walks.len() + usize::from(index < arguments.frames % walks.len());
            let near = f64::from(source.near);
            views.extend(path(walk, arguments, near, frames)?);
        }
        if views.is_empty() {
            return Err(
                format!("{name}: no way to walk: its walks stand still; --cameras gives others").into()
            );
        }
        let world = World::with_views(source, views, Vec::new(), SIZE);
        let mut buffer = ItemBuffer::new(SIZE.0, SIZE.1)?;
        let (kept, plain) =
            (cullers::parse(&arguments.cullers, &world)?, cullers::parse(&arguments.cullers, &world)?);
        for ((entry, kept), (_, mut plain)) in kept.into_iter().zip(plain) {
            let mut kept = kept.with_reach(Some(reach));
            let (mut with, mut without) = (Sums::default(), Sums::default());
            let (mut visible, mut each) = (VisibleSet::new(), VisibleSet::new());
            let mut judged = 0;
            for (number, view) in world.views.iter().enumerate() {
                with.frame(&mut kept, &world.scene, view, &mut visible);
                without.frame(&mut plain, &world.scene, view, &mut each);
                if number % arguments.judged == 0 {
                    judged += 1;
                    buffer.draw(view, world.origin(), world.items())?;
                    for (sums, set) in [(&mut with, &visible), (&mut without, &each)] {
                        let mut comparison = Comparison::default();
                        let is_reported = |_, key: u32| {
                            let id = world.scene.id_at(key as usize);
                            id.is_some_and(|id| set.contains(&world.scene, id))
                        };
                        buffer.visible().compare(is_reported, &mut comparison);
                        sums.missing += comparison.false_hidden_objects as u64;
                    }
                }
            }
            let frames = world.views.len() as f64;
            let [a, b] = [&with, &without];
            table.add_row([
                name.rsplit('/').next().unwrap_or(name).to_owned(),
                entry,
                world.views.len().to_string(),
                format!("{:.1} %", 100.0 * a.skipped as f64 / frames),
                format!("{:.1}", a.reported as f64 / frames),
                format!("{:.1}", b.reported as f64 / frames),
                format!("{:.2}", a.reported as f64 / b.reported as f64),
                format!("{:.0}", a.triangles as f64 / frames),
                format!("{:.0}", b.triangles as f64 / frames),
                format!("{:.2}", a.triangles as f64 / b.triangles as f64),
                format!("{:.4}", a.ms / frames),
                format!("{:.4}", b.ms / frames),
                format!("{:.2}", a.ms / b.ms),
                format!("{:.2}", a.longest),
                format!("{} {}", a.missing, b.missing),
                judged.to_string(),
            ]);
        }
    }
    println!("{table}");
    Ok(())
}

impl Sums {
    /// Culls a frame and adds it.
    fn frame(&mut self, pipeline: &mut Pipeline, scene: &Scene, view: &View, visible: &mut VisibleSet) {
        let begin = Instant::now();
        pipeline.cull(scene, view, visible);
        let ms = begin.elapsed().as_secs_f64() * 1e3;
        self.ms += ms;
        self.longest = self.longest.max(ms);
        self.skipped += usize::from(pipeline.is_kept());
        self.reported += visible.count(scene);
        let costs =
            visible.iter(scene).filter_map(|id| scene.object(id).ok()).map(|object| u64::from(object.cost));
        self.triangles += costs.sum::<u64>();
    }
}

/// Returns the views along a walk at the given speed, as many as `count`. The camera turns to where the walk
/// looks and from side to side, at no more than the greatest speed of a turn.
fn path(
    walk: &Walk,
    arguments: &Arguments,
    near: f64,
    count: usize,
) -> Result<Vec<View>, Box<dyn std::error::Error>> {
    let step = arguments.speed / RATE;
    let most = arguments.turn.to_radians() / RATE;
    let up = walk.up.as_dvec3();
    let (mut views, mut left) = (Vec::new(), 0.0);
    let mut ahead: Option<DVec3> = None;
    for pair in walk.keys.windows(2) {
        let length = pair[0].eye.distance(pair[1].eye);
        while left < length && views.len() < count {
            let part = left / length;
            let eye = pair[0].eye.lerp(pair[1].eye, part);
            let towards = (pair[0].target.lerp(pair[1].target, part) - eye).normalize_or(DVec3::X);
            let phase = arguments.turn.to_radians() / SWAY * views.len() as f64 / RATE;
            let wanted = glam::DQuat::from_axis_angle(up, SWAY * phase.sin()) * towards;
            let before = ahead.unwrap_or(wanted);
            let angle = before.angle_between(wanted);
            let turned = if angle > most {
                let axis = before.cross(wanted).normalize_or(up);
                glam::DQuat::from_axis_angle(axis, most) * before
            } else {
                wanted
            };
            ahead = Some(turned);
            let pose = Pose::look_at(eye, eye + turned, up);
            let fov_y = f64::from(walk.fov_y_degrees).to_radians();
            let aspect = f64::from(SIZE.0) / f64::from(SIZE.1);
            views.push(View::perspective(pose, fov_y, aspect, near, f64::INFINITY)?);
            left += step;
        }
        left -= length;
    }
    Ok(views)
}
