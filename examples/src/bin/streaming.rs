//! Program `streaming`: walks through a scene while a streaming cache holds the visible and recently visible
//! objects in memory, and prints the cache's memory and traffic. Then walks again with a limit of the memory
//! and of the bytes loaded in a frame, by baked sets or sets made online.

use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;
use visibility_core::bits::Bits;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{HiddenSets, Prefetch, PvsCuller, Residency};
use visibility_core::{ObjectId, VisibleSet};
use visibility_examples::open;
use visibility_examples::region::cells::on_axes;
use visibility_examples::region::read_sets;
use visibility_examples::streaming_cache::Cache;
use visibility_examples::walkthrough::{World, cullers};
use visibility_examples::{exit_code, println};
use visibility_region::OnlinePvs;

/// Walk through a scene while objects are loaded as they become visible and unloaded after they
/// became hidden.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Built-in scene, with or without sizes, such as `plpcity` or `office:2,16`, or a file with walks.
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

    /// Walk again and load in order of importance within a limit, by sets made online or, with `--prefetch`,
    /// by these: megabytes in memory. A triangle takes 36 bytes.
    #[arg(long, value_name = "MB")]
    memory: Option<f64>,

    /// With `--memory`: kilobytes loaded in a frame.
    #[arg(long, value_name = "KB", default_value_t = 100.0)]
    rate: f64,

    /// With `--memory` and sets made online: microseconds of work on these in a frame.
    #[arg(long, value_name = "US", default_value_t = 2000)]
    work: u32,
}

/// Frames per second.
const RATE: f64 = 60.0;
/// Bytes of a triangle in memory.
const TRIANGLE: u64 = 36;

fn main() -> ExitCode {
    exit_code(stream(&Arguments::parse()))
}

fn stream(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    // With ten frames between two keys of a walk, the camera moves at about walking pace.
    let source = open(&arguments.scene)?;
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
    let (mut prefetch, reach) = (Prefetch::new(), reach(&world));
    println!("frame   visible  appeared  vanished  in memory  loads  unloads");
    for (frame, view) in world.views.iter().enumerate() {
        pipeline.cull(&world.scene, view, &mut visible);
        cache.update(&world.scene, &visible);
        if let Some(sets) = &sets {
            let (eye, velocity) = motion(&world, frame);
            for arrival in prefetch.search(sets, eye, velocity, reach, arguments.ahead) {
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
    if let Some(memory) = arguments.memory {
        let mut residency = Residency::new((memory * 1e6) as u64);
        match sets {
            Some(sets) => within(arguments, &world, &mut PvsCuller::new(sets), &mut residency, |_, _| ()),
            None => {
                // Viewcells hold the box from which lines of sight begin, and some of the way.
                let side = (4.0 * reach).max(0.6);
                let size = on_axes([side, side, side], world.source.up);
                let wide = on_axes([6.0 * side, 6.0 * side, 2.0 * side], world.source.up);
                let mut online = OnlinePvs::new(size, wide)?.with_margin(reach);
                within(arguments, &world, &mut online, &mut residency, |online, places| {
                    online.step(&world.scene, places, arguments.work);
                });
            }
        }
    }
    Ok(())
}

/// Returns the eye of a frame in metres, and its velocity in metres a second. The first frame of a walk has
/// no velocity.
fn motion(world: &World, frame: usize) -> (DVec3, DVec3) {
    let (pose, walk) = &world.poses[frame];
    let before = frame.checked_sub(1).map(|before| &world.poses[before]);
    let step = before.filter(|(_, other)| other == walk).map(|(before, _)| pose.eye - before.eye);
    (pose.eye, step.unwrap_or(DVec3::ZERO) * RATE)
}

/// Returns a distance in metres from the eye within which lines of sight begin: that of the corners of the
/// near plane in the walk with the widest view, and at least twice the distance of the near plane. Twice is
/// enough for views of up to 80 degrees.
fn reach(world: &World) -> f64 {
    let widest = world.source.walks.iter().map(|walk| f64::from(walk.fov_y_degrees)).fold(0.0, f64::max);
    let aspect = f64::from(world.size.0) / f64::from(world.size.1);
    let up = (widest.to_radians() * 0.5).tan();
    let corner = DVec3::new(1.0, up, up * aspect).length();
    f64::from(world.source.near) * corner.max(2.0)
}

/// Walks while a [`Residency`] loads and drops by `sets`, on which `work` works in each frame for the places
/// where the eye is and will be. Prints a line.
fn within<S: HiddenSets>(
    arguments: &Arguments,
    world: &World,
    sets: &mut S,
    residency: &mut Residency,
    mut work: impl FnMut(&mut S, &[DVec3]),
) {
    let size = |id: ObjectId| world.scene.object(id).map_or(0, |object| u64::from(object.cost) * TRIANGLE);
    let reach = reach(world);
    let around = |place: &DVec3| [*place - reach, *place + reach];
    let [mut loaded, mut dropped, mut peak] = [0; 3];
    let [mut complete, mut late] = [0; 2];
    let mut hidden = Bits::EMPTY;
    // The cameras of the walk show all layers.
    let layers = [u32::MAX];
    for frame in 0..world.views.len() {
        let (eye, velocity) = motion(world, frame);
        let places: Vec<DVec3> =
            (0..=10).map(|i| eye + velocity * (arguments.ahead * f64::from(i) / 10.0)).collect();
        work(sets, &places);
        let boxes: Vec<[DVec3; 2]> = places.iter().map(around).collect();
        residency.update(&world.scene, sets, &layers, &boxes, size, (arguments.rate * 1e3) as u64);
        loaded += residency.loads().iter().map(|load| load.bytes).sum::<u64>();
        dropped += residency.drops().iter().map(|drop| drop.bytes).sum::<u64>();
        peak = peak.max(residency.bytes());
        complete += usize::from(residency.is_complete());
        late += usize::from(!sets.write_hidden(&world.scene, &layers, boxes[0][0], boxes[0][1], &mut hidden));
    }
    let mb = |bytes: u64| bytes as f64 / 1e6;
    println!(
        "within {} KB a frame: {:.1} MB loaded, {:.1} dropped, at most {:.1} of {:.1} MB in memory; all that \
         may be visible was there in {complete} of {} frames; the set was late in {late}",
        arguments.rate,
        mb(loaded),
        mb(dropped),
        mb(peak),
        mb(world.source.triangle_count() as u64 * TRIANGLE),
        world.views.len(),
    );
}
