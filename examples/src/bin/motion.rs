//! Program `motion`: walks through a scene in which many objects move, updates only the movers that motion
//! volumes say are due, and prints how many updates are saved. Every frame is compared with the exact
//! positions of all movers. Some frames are compared with an item buffer, which finds visible movers that
//! were not reported.

use clap::Parser;
use comfy_table::{Table, presets};
use glam::{DVec3, Vec3};
use std::process::ExitCode;
use std::time::{Duration, Instant};
use visibility_core::{Aabb, ObjectId, Scene, VisibleSet};
use visibility_examples::arguments::count;
use visibility_examples::built_in;
use visibility_examples::pvs::stabs::Random;
use visibility_examples::walkthrough::{World, cullers};
use visibility_examples::{exit_code, println};
use visibility_frame::motion::{Motion, MotionVolumes};
use visibility_measure::{DrawnObject, ItemBuffer};

/// Walk through built-in scenes with many movers, and count the updates that motion volumes save.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Built-in scenes, with or without sizes.
    #[arg(default_values_t = ["plpcity".to_owned(), "london".to_owned()])]
    scenes: Vec<String>,

    /// Cullers that decide on visibility, separated by commas, in the syntax of `walkthrough --cullers`.
    #[arg(long, default_value = "frustum,hzb")]
    cullers: String,

    /// Number of movers.
    #[arg(long, default_value_t = 100_000, value_parser = count())]
    movers: usize,

    /// Number of frames, at 60 per second.
    #[arg(long, default_value_t = 600, value_parser = count())]
    frames: usize,

    /// Number of frames from one item buffer to the next.
    #[arg(long, default_value_t = 20, value_parser = count())]
    judged: usize,
}

/// Mover that goes back and forth on a segment at constant speed.
struct Pacer {
    home: DVec3,
    /// Vector from `home`, the middle of the segment, to one of its ends, in metres.
    reach: DVec3,
    /// Speed in metres per second.
    speed: f64,
    phase: f64,
    half: DVec3,
}

impl Pacer {
    fn at(&self, time: f64) -> Aabb {
        // Position on the segment: a triangle wave between -1 and 1, which moves `speed` metres per second.
        let wave = (self.phase + time * self.speed / self.reach.length()).rem_euclid(4.0);
        let center = self.home + self.reach * ((wave - 2.0).abs() - 1.0);
        Aabb::new((center - self.half).as_vec3(), (center + self.half).as_vec3())
    }

    fn motion(&self) -> Motion {
        Motion::new((self.speed as f32).next_up())
    }
}

/// Makes movers on the ground of a scene. Four of five are people at 1 to 2 m/s, and one is a car at 5 to 15
/// m/s.
fn pacers(bounds: &Aabb, count: usize) -> Vec<Pacer> {
    let mut random = Random(1);
    let (min, size) = (bounds.min.as_dvec3(), (bounds.max - bounds.min).as_dvec3());
    (0..count)
        .map(|number| {
            let is_car = number % 5 == 0;
            let half = if is_car { DVec3::new(1.5, 1.5, 0.8) } else { DVec3::new(0.3, 0.3, 0.9) };
            let home = min + size * DVec3::new(random.unit(), random.unit(), 0.0) + DVec3::Z * half.z;
            let length = if is_car { 20.0 + 60.0 * random.unit() } else { 3.0 + 17.0 * random.unit() };
            let reach = if random.unit() < 0.5 { DVec3::X } else { DVec3::Y } * length;
            let speed = if is_car { 5.0 + 10.0 * random.unit() } else { 1.0 + random.unit() };
            Pacer { home, reach, speed, phase: 4.0 * random.unit(), half }
        })
        .collect()
}

fn main() -> ExitCode {
    exit_code(measure(&Arguments::parse()))
}

fn measure(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let mut table = Table::new();
    table.load_style(presets::UTF8_HORIZONTAL_ONLY);
    table.set_header([
        "scene",
        "culler",
        "movers",
        "visible",
        "reported",
        "updates",
        "saved",
        "by volume",
        "outside",
        "too late",
        "bookkeeping",
        "all updates",
    ]);
    for scene in &arguments.scenes {
        let world = World::new(built_in(scene)?, (640, 360), Some(arguments.frames))?;
        let pacers = pacers(&world.scene.culled_bounds().ok_or("an empty scene")?, arguments.movers);
        for number in 0..cullers::parse(&arguments.cullers, &world)?.len() {
            let counts = walk(arguments, &world, &pacers, number)?;
            let frames = world.views.len() as f64;
            let per_frame = |count: usize| format!("{:.0}", count as f64 / frames);
            let time = |time: Duration| format!("{:.2} ms", time.as_secs_f64() * 1e3 / frames);
            let all = pacers.len() as f64 * frames;
            table.add_row([
                scene.clone(),
                counts.culler,
                pacers.len().to_string(),
                format!("{:.0}", counts.visible as f64 / counts.judged.max(1) as f64),
                per_frame(counts.reported),
                per_frame(counts.updates + counts.seen),
                format!("{:.1} %", 100.0 - (counts.updates + counts.seen) as f64 / all * 100.0),
                per_frame(counts.seen),
                counts.outside.to_string(),
                format!("{} of {}", counts.late, counts.visible),
                time(counts.kept),
                time(counts.set_all),
            ]);
        }
    }
    println!("{table}");
    Ok(())
}

/// Sums over all frames of one walk.
#[derive(Default)]
struct Counts {
    culler: String,
    /// Number of frames judged by an item buffer.
    judged: usize,
    /// Number of movers visible in the judged frames, at their exact positions.
    visible: usize,
    /// Number of movers that the culler reported, over all frames.
    reported: usize,
    /// Number of updates of a mover's bounds because it was due.
    updates: usize,
    /// Number of movers, summed over all frames, whose motion volume was seen, so that their exact place was
    /// needed.
    seen: usize,
    /// Number of movers, summed over all frames, whose exact bounds were not inside their bounds in the
    /// scene.
    outside: usize,
    /// Number of movers visible in the judged frames that the culler did not report.
    late: usize,
    /// Time for the motion volumes and for setting the bounds of due movers.
    kept: Duration,
    /// Time for setting the bounds of all movers in each frame, for comparison with `kept`.
    set_all: Duration,
}

fn walk(
    arguments: &Arguments,
    world: &World,
    pacers: &[Pacer],
    number: usize,
) -> Result<Counts, Box<dyn std::error::Error>> {
    let mut scene = world.scene.clone();
    let ids = scene.insert_batch(pacers.iter().map(|pacer| pacer.at(0.0)));
    scene.rebuild();
    let mut all = scene.clone();
    let first = ids.first().map_or(0, |id| id.index());
    let mut volumes = MotionVolumes::new();
    ids.iter().zip(pacers).for_each(|(&id, pacer)| volumes.insert(id, pacer.motion()));
    let (name, mut pipeline) = cullers::parse(&arguments.cullers, world)?.remove(number);
    let (mut visible, mut buffer) = (VisibleSet::new(), ItemBuffer::new(640, 360)?);
    let (mut due, mut seen, mut boxes) = (Vec::new(), Vec::new(), Vec::new());
    let mut counts = Counts { culler: name, ..Counts::default() };
    for (frame, view) in world.views.iter().enumerate() {
        let time = frame as f64 / 60.0;
        let place = |id: ObjectId| (id, pacers[id.index() - first].at(time));

        let start = Instant::now();
        volumes.begin_frame(&mut scene, time, &mut due);
        let moved: Vec<_> = due.iter().map(|&id| place(id)).collect();
        volumes.set_bounds_batch(&mut scene, &moved)?;
        counts.kept += start.elapsed();
        scene.maintain(64);
        pipeline.cull(&scene, view, &mut visible);
        let start = Instant::now();
        volumes.end_frame(&scene, &visible, &mut seen);
        counts.kept += start.elapsed();
        counts.updates += due.len();
        counts.seen += seen.len();
        counts.reported += visible.iter(&scene).filter(|id| id.index() >= first).count();

        let start = Instant::now();
        let moved: Vec<_> = ids.iter().map(|&id| place(id)).collect();
        all.set_bounds_batch(&moved)?;
        counts.set_all += start.elapsed();
        counts.outside += moved.iter().filter(|(id, exact)| !contains(&scene, *id, exact)).count();
        if frame % arguments.judged.max(1) == 0 {
            boxes.clear();
            boxes.extend(moved.iter().map(|(_, exact)| triangles(exact)));
            let movers =
                ids.iter().zip(&boxes).map(|(id, sides)| DrawnObject::from((id.index() as u32, &sides[..])));
            let truth = buffer.draw(view, world.origin(), world.items().chain(movers))?;
            let shown = truth.objects().iter().filter(|object| object.visible_triangles > 0);
            for object in shown.filter(|object| object.key as usize >= first) {
                counts.visible += 1;
                counts.late += usize::from(!visible.contains(&scene, ids[object.key as usize - first]));
            }
            counts.judged += 1;
        }
    }
    Ok(counts)
}

/// Returns whether a mover's bounds in the scene contain its exact bounds.
fn contains(scene: &Scene, id: ObjectId, exact: &Aabb) -> bool {
    scene.bounds(id).is_ok_and(|held| held.min.cmple(exact.min).all() && exact.max.cmple(held.max).all())
}

/// Returns the twelve triangles of a box.
fn triangles(bounds: &Aabb) -> [[Vec3; 3]; 12] {
    let corners = bounds.corners();
    // Corners of each side, in order around the side. Bit `a` of a corner's index is 1 at the maximum of axis
    // `a`.
    let sides = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    std::array::from_fn(|i| {
        let [a, b, c, d] = sides[i / 2].map(|corner: usize| corners[corner]);
        if i % 2 == 0 { [a, b, c] } else { [a, c, d] }
    })
}
