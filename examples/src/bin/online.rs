//! Program `online`: walks through a scene with visible sets that are computed ahead of the eye, and compares
//! them with item buffers.

use clap::Parser;
use comfy_table::{Table, presets};
use glam::DVec3;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;
use visibility_core::{Culler, Pose, RegionCuller, View, VisibleSet};
use visibility_examples::arguments::count;
use visibility_examples::region::cells::on_axes;
use visibility_examples::region::judge::{Effort, Judge};
use visibility_examples::region::online_plot::{Frame, plot};
use visibility_examples::{Cameras, Reading, Walk, exit_code, open_as, println, region};
use visibility_region::{ExtendedProjectionCuller, OnlinePvs};

/// Walk through scenes with visible sets that are computed ahead of the eye: time, number of objects, and how
/// often a set is late.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Scenes: built-in ones, with or without sizes, or files (.vscn, .glb, .gltf).
    #[arg(default_values_t = ["london".to_owned(), "office".to_owned()])]
    scenes: Vec<String>,

    /// How to read scene files.
    #[command(flatten)]
    reading: Reading,

    /// Source of the walks.
    #[command(flatten)]
    cameras: Cameras,

    /// Number of frames per scene, at 60 per second, divided among its first four walks.
    #[arg(long, default_value_t = 600, value_parser = count())]
    frames: usize,

    /// Speed of the eye in metres per second.
    #[arg(long, value_name = "SPEED", default_value_t = 1.4)]
    speed: f64,

    /// Milliseconds of each frame for computing sets ahead. The last step of a frame may overrun a little.
    #[arg(long, value_name = "MS", default_value_t = 2.0)]
    budget: f64,

    /// Side of the viewcells in metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.6)]
    size: f64,

    /// Side on the ground, in metres, of the wide boxes that stand in for missing viewcells.
    #[arg(long, value_name = "METRES", default_value_t = 4.0)]
    wide: f64,

    /// Number of frames from one judged by item buffers to the next.
    #[arg(long, default_value_t = 30, value_parser = count())]
    judged: usize,

    /// Folder to plot the walks of each scene to, as `online-SCENE.svg`. By default none.
    #[arg(long, value_name = "FOLDER")]
    plots: Option<PathBuf>,
}

/// Frames per second.
const RATE: f64 = 60.0;
/// Longest prediction of the eye's path in seconds, and the number of predicted positions within that time.
const AHEAD: (f64, u32) = (1.0, 20);

/// Sums over the walks of a scene. Times are in milliseconds.
#[derive(Default)]
struct Sums {
    frames: usize,
    /// Number of frames whose set came from a viewcell, from a wide box, and from neither (everything counts
    /// as visible).
    answers: [usize; 3],
    /// For wide boxes and for viewcells: the number computed, and the time that took.
    boxes: [(usize, f64); 2],
    longest_step: f64,
    culling: f64,
    judged: usize,
    reported: usize,
    sampled: usize,
    missing: usize,
    /// Number of objects that a separate sweep of the box reports, and the time of that sweep.
    direct: (usize, f64),
    /// The frames of all walks.
    plotted: Vec<Frame>,
}

fn main() -> ExitCode {
    exit_code(measure(&Arguments::parse()))
}

fn measure(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let mut table = Table::new();
    table.load_style(presets::UTF8_HORIZONTAL_ONLY);
    table.set_header([
        "scene",
        "viewcells",
        "ms each",
        "wide",
        "ms each",
        "all in",
        "longest step",
        "late",
        "unanswered",
        "cull us",
        "reported",
        "sampled",
        "times",
        "missing",
        "direct",
        "ms",
    ]);
    for scene in &arguments.scenes {
        let sums = walk(arguments, scene)?;
        let name = scene.rsplit('/').next().unwrap_or(scene);
        if let Some(folder) = &arguments.plots {
            let stem = name.split('.').next().unwrap_or(name).replace(':', "-");
            plot(&folder.join(format!("online-{stem}.svg")), name, &sums.plotted, RATE)?;
        }
        let mean = |sum: f64, count: usize| sum / count.max(1) as f64;
        let ms = |time: f64| format!("{time:.2}");
        let [wide, near] = sums.boxes;
        table.add_row([
            name.to_owned(),
            near.0.to_string(),
            ms(mean(near.1, near.0)),
            wide.0.to_string(),
            ms(mean(wide.1, wide.0)),
            ms(mean(near.1 + wide.1, near.0)),
            ms(sums.longest_step),
            sums.answers[1].to_string(),
            sums.answers[2].to_string(),
            format!("{:.1}", mean(sums.culling, sums.frames) * 1e3),
            format!("{:.1}", mean(sums.reported as f64, sums.judged)),
            format!("{:.1}", mean(sums.sampled as f64, sums.judged)),
            format!("{:.2}", mean(sums.reported as f64, sums.sampled)),
            sums.missing.to_string(),
            format!("{:.1}", mean(sums.direct.0 as f64, sums.judged)),
            ms(mean(sums.direct.1, sums.judged)),
        ]);
    }
    println!("{table}");
    println!(
        "viewcells, wide: boxes made, and processor time of one thread for each; all in: time for a viewcell \
         with its share of wide boxes, in ms\nlate: frames answered by a wide box; unanswered: frames in which \
         all objects counted as visible\nreported: objects of the box that answered, in all directions; \
         sampled: objects that item buffers and rays from the box see; missing: sampled objects with a line of \
         sight that were not reported\ndirect: objects that a sweep of the same box reports by itself, and its \
         time"
    );
    Ok(())
}

fn walk(arguments: &Arguments, name: &str) -> Result<Sums, Box<dyn std::error::Error>> {
    let mut source = open_as(name, &arguments.reading)?;
    arguments.cameras.give_whole(&mut source, &arguments.reading)?;
    source.print_notes();
    let world = region::world(source);
    let mut judge = Judge::new(&world, Effort { eyes: 20, side: 256, rays: 100_000 })?;
    let size = |width: f64, height: f64| on_axes([width, width, height], world.source.up);
    let walks: Vec<&Walk> = world.source.walks.iter().filter(|walk| walk.keys.len() > 1).take(4).collect();
    if walks.is_empty() {
        return Err(format!("{name}: no way to walk: its walks stand still; --cameras gives others").into());
    }
    let (mut sums, mut visible) = (Sums::default(), VisibleSet::new());
    let mut sweep = ExtendedProjectionCuller::new();
    sweep.sync(&world.scene);
    let mut online =
        OnlinePvs::new(size(arguments.size, arguments.size), size(arguments.wide, 2.0 * arguments.size))?;
    for (index, walk) in walks.iter().enumerate() {
        let frames = arguments.frames / walks.len() + usize::from(index < arguments.frames % walks.len());
        let path = path(walk, arguments.speed / RATE, frames);
        // The boxes around the first eye position are computed before the first frame, and are not counted.
        let start = path.first().copied().into_iter().collect::<Vec<_>>();
        while online.step(&world.scene, &start, u32::MAX).is_some() {}
        for (number, &eye) in path.iter().enumerate() {
            let velocity = (eye - path[number.saturating_sub(1)]) * RATE;
            let places: Vec<DVec3> = (0..=AHEAD.1)
                .map(|i| eye + velocity * (AHEAD.0 * f64::from(i) / f64::from(AHEAD.1)))
                .collect();
            let (frame, mut work) = (Instant::now(), 0.0);
            let ms = |since: Instant| since.elapsed().as_secs_f64() * 1e3;
            while ms(frame) < arguments.budget {
                let begin = Instant::now();
                let left = (arguments.budget - ms(frame)) * 1e3;
                let Some(step) = online.step(&world.scene, &places, left as u32) else { break };
                let (count, time) = &mut sums.boxes[usize::from(!step.is_wide)];
                *count += usize::from(step.is_last);
                let taken = ms(begin);
                *time += taken;
                work += taken;
                sums.longest_step = sums.longest_step.max(taken);
            }
            let pose = Pose::look_at(eye, eye + DVec3::new(0.6, 0.7, 0.1), world.source.up.as_dvec3());
            let view = View::perspective(pose, 1.2, 1.5, 0.02, f64::INFINITY)?;
            visible.clone_from(&VisibleSet::new());
            let begin = Instant::now();
            online.cull(&world.scene, &view, &mut visible);
            sums.culling += ms(begin);
            sums.frames += 1;
            let answer = if online.is_ready() { 0 } else { 1 + usize::from(online.answer().is_none()) };
            sums.answers[answer] += 1;
            let (reported, mut sampled) = (visible.count(&world.scene), None);
            if number % arguments.judged == 0
                && let Some(cell) = online.answer()
            {
                let (seen, _) = judge.sample(cell)?;
                let is_missing = |&index: &u32| {
                    let id = world.scene.id_at(index as usize);
                    seen[index as usize] && !id.is_some_and(|id| visible.contains(&world.scene, id))
                };
                let left_out: Vec<u32> = (0..seen.len() as u32).filter(is_missing).collect();
                sums.missing += judge.decide(cell, &left_out, 0.0, &[])?.false_hidden.len();
                let count = seen.iter().filter(|&&seen| seen).count();
                sampled = Some(count);
                sums.sampled += count;
                sums.reported += reported;
                sums.judged += 1;
                let mut direct = VisibleSet::new();
                let begin = Instant::now();
                sweep.cull(&world.scene, cell, &mut direct);
                sums.direct.1 += ms(begin);
                sums.direct.0 += direct.count(&world.scene);
            }
            sums.plotted.push(Frame { answer, reported, sampled, work });
        }
    }
    Ok(sums)
}

/// Returns up to `count` eyes of a walk, `step` metres apart along its keys.
fn path(walk: &Walk, step: f64, count: usize) -> Vec<DVec3> {
    let (mut path, mut left) = (Vec::new(), 0.0);
    for pair in walk.keys.windows(2) {
        let (from, to) = (pair[0].eye, pair[1].eye);
        let length = from.distance(to);
        while left < length && path.len() < count {
            path.push(from.lerp(to, left / length));
            left += step;
        }
        left -= length;
    }
    path
}
