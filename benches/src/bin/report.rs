//! Program `report`: measures every contender in one run, in turns, and prints the first part of
//! `RESULTS.md`, up to the targets: `cargo run --release -p visibility-benches --bin report`.
//!
//! Numbers are ratios of medians. Each round measures every contender once, in a new random order. So
//! disturbances from other processes affect all contenders alike, and no contender always follows the one
//! that leaves the caches in the worst state.

use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};
use std::hint::black_box;
use std::time::{Duration, Instant};
use visibility_benches::check::{check, verify};
use visibility_benches::contenders::{self, Shape, parry_aabb};
use visibility_benches::moving::{BUDGET, DRIFT, LONG, Movers};
use visibility_benches::workload::{FRAMES, Order, Random, Share, boxes, views};
use visibility_core::{Aabb, FrustumCuller, Pipeline, Scene, VisibleSet};

/// Numbers of boxes to measure with, each with its name in tables.
const SIZES: [(usize, &str); 2] = [(100_000, "100 thousand"), (1_000_000, "1 million")];
/// Number of times that each contender is measured; the median time counts.
const ROUNDS: usize = 9;
/// Time for which frames run before they are measured, so that caches and branch predictors settle.
const WARM_UP: Duration = Duration::from_millis(20);

fn main() {
    println!("# Results\n");
    println!("{}, one thread. Ratios of medians within one run; `src/bin/report.rs` says how.\n", cpu());
    let mut targets = Vec::new();
    for (count, size) in SIZES {
        frustum(count, size, &mut targets);
    }
    let sort = construction(&mut targets);
    moving(sort, &mut targets);
    moving_for_long(&mut targets);
    println!("## Targets\n\n| | wanted | measured | |\n|---|---|---|---|");
    for Target { what, wanted, measured, at_least } in targets {
        let (word, met) =
            if at_least { ("at least", measured >= wanted) } else { ("at most", measured <= wanted) };
        let met = if met { "met" } else { "**missed**" };
        println!("| {what} | {word} {wanted} | {} | {met} |", short(measured));
    }
}

/// Ratio that the library should reach: at least `wanted` if `at_least`, otherwise at most `wanted`.
struct Target {
    what: String,
    wanted: f64,
    measured: f64,
    at_least: bool,
}

/// Prints a table of the time of every contender, for every share in view and order of boxes, as a multiple
/// of this library's time. Appends the targets that depend on these times to `targets`. `size` is the name of
/// `count` in tables.
fn frustum(count: usize, size: &str, targets: &mut Vec<Target>) {
    let mut names = Vec::new();
    let mut columns = Vec::new();
    let mut header = String::new();
    for share in Share::ALL {
        for order in Order::ALL {
            let (boxes, views) = (boxes(count, order), views(share));
            let mut all = contenders::all(&boxes, &views);
            let mut visible: Vec<_> = all.iter_mut().map(|c| verify(c.as_mut(), &boxes, &views)).collect();
            visible.sort();
            visible.dedup();
            names = all.iter().map(|c| c.name()).collect();
            let seconds = in_turns(&mut all, ROUNDS, |contender| {
                // Unmeasured frames let caches and branch predictors settle first.
                let start = Instant::now();
                for frame in 0..FRAMES {
                    contender.cull(frame);
                    if start.elapsed() > WARM_UP {
                        break;
                    }
                }
                let start = Instant::now();
                (0..FRAMES).for_each(|frame| _ = black_box(contender.cull(frame)));
                start.elapsed() / FRAMES as u32
            });
            header += &format!(" {}, {} |", share.name(), order.name());
            eprintln!("{size}, {share:?}, {order:?}: visible {visible:?}, {seconds:?}");
            columns.push((share, order, seconds, visible));
        }
    }
    // The unit is the time of the second to last contender: this library with the widest instructions,
    // without a list of ids.
    let unit = names.len() - 2;
    println!("## Frustum culling of {size} boxes\n");
    println!(
        "Time as a multiple of ours on the widest instructions. Boxes are within a cube, the camera in its middle.\n"
    );
    println!("| {size} boxes |{header}\n|---|{}", "---|".repeat(columns.len()));
    for (row, name) in names.iter().enumerate() {
        let cells: String =
            columns.iter().map(|(_, _, s, _)| format!(" {} |", short(s[row] / s[unit]))).collect();
        println!("| {} |{cells}", name.replace("visibility", "**visibility**"));
    }
    let cells: String =
        columns.iter().map(|(_, _, s, _)| format!(" {} |", short(s[unit] * 1e9 / count as f64))).collect();
    println!("| ours, in ns a box |{cells}");
    let counts = |list: &[Option<usize>]| {
        let counts: Vec<String> = list.iter().flatten().map(usize::to_string).collect();
        counts.join(" or ")
    };
    let cells: String = columns.iter().map(|(_, _, _, v)| format!(" {} |", counts(v))).collect();
    println!("| boxes reported, every contender |{cells}\n");

    let row = |prefix: &str| names.iter().position(|name| name.starts_with(prefix)).expect("a contender");
    let (plain, tree) = (row("glam"), row("treeculler"));
    for (share, order, s, _) in &columns {
        let mut target = |what: &str, row: usize, wanted: f64| {
            let what = format!("{size}, {}, {}: {what} / ours", share.name(), order.name());
            targets.push(Target { what, wanted, measured: s[row] / s[unit], at_least: true });
        };
        match (count, share, order) {
            (1_000_000, Share::Eleven, order) => {
                target("plain loop", plain, 60.0);
                if *order == Order::Sorted {
                    target("plain loop that leaves early", plain + 1, 60.0);
                    target("treeculler", tree, 40.0);
                    target("treeculler, coherent", tree + 1, 40.0);
                }
                target("reading all", row("reading"), 1.0);
            }
            (100_000, Share::One, _) => {
                target("plain loop", plain, 40.0);
            }
            _ => {}
        }
    }
}

/// Prints a table of construction times as multiples of the time of one sort, and appends the targets that
/// depend on these times to `targets`. Returns the time in seconds to sort a million keys.
fn construction(targets: &mut Vec<Target>) -> f64 {
    let mut columns = Vec::new();
    let names = [
        "`sort_unstable` of as many `u64`",
        "**visibility**, `insert_batch`, random",
        "**visibility**, `insert_batch`, sorted",
        "**visibility**, `rebuild`",
        "parry3d 0.31 Bvh, binned",
        "bvh 0.13",
    ];
    for (count, _) in SIZES {
        let [scattered, sorted] = Order::ALL.map(|order| boxes(count, order));
        let keys = keys(count);
        let mut there = Scene::new();
        there.insert_batch(scattered.iter().copied());
        let leaves: Vec<_> = scattered.iter().map(parry_aabb).collect();
        let mut shapes: Vec<_> = (0..).zip(&scattered).map(|(index, b)| Shape::new(b, index)).collect();
        let mut rows: [Box<dyn FnMut() -> Duration>; 6] = [
            Box::new(|| sort(&keys)),
            Box::new(|| build(&scattered)),
            Box::new(|| build(&sorted)),
            Box::new(|| timed(|| there.rebuild())),
            Box::new(|| timed(|| Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves))),
            Box::new(|| timed(|| bvh::bvh::Bvh::build(&mut shapes))),
        ];
        columns.push(in_turns(&mut rows, ROUNDS, |row| row()));
    }
    println!("## Construction\n\nTime as a multiple of one sort of as many keys.\n");
    println!("| | {} | {} |\n|---|---|---|", SIZES[0].1, SIZES[1].1);
    for (row, name) in names.iter().enumerate() {
        let [small, large] = [0, 1].map(|column: usize| short(columns[column][row] / columns[column][0]));
        println!("| {name} | {small} | {large} |");
    }
    let [small, large] = [0, 1].map(|column: usize| short(columns[column][0] * 1e3));
    println!("| the sort, in ms | {small} | {large} |\n");
    let large = &columns[1];
    for (row, what) in [(1, "random"), (2, "sorted")] {
        let what = format!("building 1 million, {what} / sorting 1 million keys");
        targets.push(Target { what, wanted: 6.0, measured: large[row] / large[0], at_least: false });
    }
    large[0]
}

/// Prints a table of the times to move objects, as multiples of the time of one sort, and of the effect on
/// culling. Appends the targets that depend on these times to `targets`. `sort_before` is the time in seconds
/// to sort a million keys, for comparison.
fn moving(sort_before: f64, targets: &mut Vec<Target>) {
    println!("## Moving\n");
    println!(
        "Per frame, as a multiple of one sort of as many keys as there are objects: `set_bounds_batch` of those that move, then"
    );
    println!(
        "`maintain` with a budget of {BUDGET} blocks or without limit. parry3d: the faster of `insert` for each, and"
    );
    println!(
        "`insert_or_update_partially` for each with one `refit`. At last the time to cull (11 %) after {DRIFT} such frames, as a"
    );
    println!("multiple of that after a rebuild.\n");
    println!(
        "| objects, moving | set_bounds_batch | maintain({BUDGET}) | maintain(all) | parry3d | culling, never maintained | culling, maintain({BUDGET}) | culling, maintain(all) |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (count, size) in SIZES {
        for percent in [1, 10, 100] {
            let row = drift(count, percent);
            let sort = row.sort;
            let [moving, some, all, parry] =
                [row.set_bounds, row.some, row.all, row.parry].map(|s| short(s / sort));
            let [a, b, c] = row.culling.map(short);
            println!("| {size}, {percent} % | {moving} | {some} | {all} | {parry} | {a} | {b} | {c} |");
            eprintln!(
                "{size}, {percent} %: sort {sort} s (before: {sort_before} s), set_bounds {} s, maintain {} s, {} s",
                row.set_bounds, row.some, row.all
            );
            if (count, percent) == (1_000_000, 1) {
                let what = "moving 10 thousand of 1 million / sorting 1 million keys".into();
                targets.push(Target { what, wanted: 0.1, measured: row.set_bounds / sort, at_least: false });
                let what = format!("the same with maintain({BUDGET})");
                let measured = (row.set_bounds + row.some) / sort;
                targets.push(Target { what, wanted: 0.1, measured, at_least: false });
            }
        }
    }
    println!();
}

/// Times of moving objects, in seconds per frame, by operation. `culling` is the time to cull a scene never
/// maintained, maintained with a budget, and maintained without limit, each relative to a rebuilt scene.
struct Drift {
    sort: f64,
    set_bounds: f64,
    some: f64,
    all: f64,
    parry: f64,
    culling: [f64; 3],
}

/// Measures [`DRIFT`] frames in which `percent` percent of `count` boxes move, and culling afterwards. Panics
/// if an answer after moving is wrong.
fn drift(count: usize, percent: usize) -> Drift {
    let boxes = boxes(count, Order::Random);
    let mut scene = Scene::new();
    let ids = scene.insert_batch(boxes.iter().copied());
    // Clones, since ids of one scene are unknown in another.
    let mut scenes = [scene.clone(), scene.clone(), scene];
    let leaves: Vec<_> = boxes.iter().map(parry_aabb).collect();
    let mut trees = [(); 2].map(|()| Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves));
    let mut workspace = BvhWorkspace::default();
    let mut movers = Movers::new(boxes, &ids, count * percent / 100);
    let keys = keys(count);

    let mut times: [Vec<f64>; 6] = Default::default();
    for frame in 0..DRIFT {
        let moved = movers.step();
        let mut note = |what: usize, time: Duration| times[what].push(time.as_secs_f64());
        let [never, some, all] = &mut scenes;
        let set_bounds =
            |scene: &mut Scene| timed(|| scene.set_bounds_batch(moved).expect("every mover is in the scene"));
        note(1, set_bounds(never));
        set_bounds(some);
        note(2, timed(|| some.maintain(BUDGET)));
        set_bounds(all);
        note(3, timed(|| all.maintain(usize::MAX)));
        // These operations take the longest and vary the least, so one frame in twelve suffices.
        if frame % 12 == 0 {
            note(0, sort(&keys));
            let [one, other] = &mut trees;
            note(4, timed(|| moved.iter().for_each(|(id, b)| one.insert(parry_aabb(b), id.index() as u32))));
            let partially = || {
                for (id, b) in moved {
                    other.insert_or_update_partially(parry_aabb(b), id.index() as u32, 0.0);
                }
                other.refit(&mut workspace);
            };
            note(5, timed(partially));
        }
    }
    let [sort, set_bounds, some, all, insert, refit] = times.map(median);

    let views = views(Share::Eleven);
    let mut rebuilt = scenes[0].clone();
    rebuilt.rebuild();
    let [never, some_scene, all_scene] = scenes;
    let cull = |scene: Scene| (scene, Pipeline::new().with(FrustumCuller::new()), VisibleSet::new());
    let mut eyes = [rebuilt, never, some_scene, all_scene].map(cull);
    let seconds = in_turns(&mut eyes, ROUNDS, |(scene, pipeline, set)| {
        views.iter().for_each(|view| _ = black_box(pipeline.cull(scene, view, set)));
        timed(|| views.iter().for_each(|view| _ = black_box(pipeline.cull(scene, view, set))))
    });
    for (scene, _, set) in &eyes {
        let seen: Vec<u32> = set.iter(scene).map(|id| id.index() as u32).collect();
        let verdict = check(movers.boxes(), &views[FRAMES - 1], &seen, false);
        assert_eq!((verdict.lost, verdict.extra), (0, 0), "after moving: {verdict:?}");
    }
    let culling = [1, 2, 3].map(|i: usize| seconds[i] / seconds[0]);
    Drift { sort, set_bounds, some, all, parry: insert.min(refit), culling }
}

/// Prints a table of the times of `maintain` and of culling while all objects move for [`LONG`] frames, as
/// multiples of the times of a rebuild and of culling after a rebuild. Appends the targets that depend on
/// these times to `targets`.
fn moving_for_long(targets: &mut Vec<Target>) {
    println!("## Moving for long\n");
    println!(
        "All of 100 thousand objects move every frame, each its own way until it meets a wall, so that in the end everything has"
    );
    println!(
        "mixed. Times of a frame as a multiple of one `rebuild`, and of culling (11 %) as a multiple of that after a rebuild.\n"
    );
    println!(
        "| after frames | set_bounds_batch | maintain({BUDGET}) | culling | bytes an object |\n|---|---|---|---|---|"
    );
    let count = SIZES[0].0;
    let boxes = boxes(count, Order::Random);
    let mut scene = Scene::new();
    let ids = scene.insert_batch(boxes.iter().copied());
    let mut movers = Movers::new(boxes, &ids, count);
    let views = views(Share::Eleven);
    let mut worst = [0.0f64; 2];
    for until in LONG.windows(2) {
        let mut times: [Vec<f64>; 3] = Default::default();
        for frame in until[0]..until[1] {
            let moved = movers.step();
            let set_bounds = timed(|| scene.set_bounds_batch(moved).expect("every mover is in the scene"));
            times[0].push(set_bounds.as_secs_f64());
            times[1].push(timed(|| scene.maintain(BUDGET)).as_secs_f64());
            if frame % 10 == 0 {
                let mut rebuilt = scene.clone();
                rebuilt.rebuild();
                // A second rebuild is measured because its memory is already in the cache.
                times[2].push(timed(|| rebuilt.rebuild()).as_secs_f64());
            }
        }
        let [set_bounds, maintain, rebuild] = times.map(median);
        let mut rebuilt = scene.clone();
        rebuilt.rebuild();
        let cull = |scene| (scene, Pipeline::new().with(FrustumCuller::new()), VisibleSet::new());
        let mut eyes = [&rebuilt, &scene].map(cull);
        let seconds = in_turns(&mut eyes, ROUNDS, |(scene, pipeline, set)| {
            views.iter().for_each(|view| _ = black_box(pipeline.cull(scene, view, set)));
            timed(|| views.iter().for_each(|view| _ = black_box(pipeline.cull(scene, view, set))))
        });
        let culling = seconds[1] / seconds[0];
        worst = [worst[0].max(culling), worst[1].max(maintain / rebuild)];
        let cells = [set_bounds / rebuild, maintain / rebuild, culling].map(short);
        let bytes = scene.memory() as f64 / count as f64;
        println!("| {} | {} | {} | {} | {} |", until[1], cells[0], cells[1], cells[2], short(bytes));
        eprintln!("after {} frames: rebuild {rebuild} s, maintain {maintain} s", until[1]);
    }
    println!();
    let what =
        format!("all of 100 thousand move for {} frames: culling / after a rebuild", LONG[LONG.len() - 1]);
    targets.push(Target { what, wanted: 1.3, measured: worst[0], at_least: false });
    let what = format!("the same: maintain({BUDGET}) / rebuild");
    targets.push(Target { what, wanted: 0.1, measured: worst[1], at_least: false });
}

/// Returns `count` random 64-bit keys to sort, equal in every run.
fn keys(count: usize) -> Vec<u64> {
    let mut random = Random(3);
    (0..count).map(|_| random.bits()).collect()
}

/// Returns the wall-clock time to sort a copy of the keys, without the time to copy.
fn sort(keys: &[u64]) -> Duration {
    let mut keys = keys.to_vec();
    let time = timed(|| keys.sort_unstable());
    black_box(keys);
    time
}

/// Returns the wall-clock time to insert all boxes into an empty scene, without the time to drop the scene.
fn build(boxes: &[Aabb]) -> Duration {
    let mut scene = Scene::new();
    let time = timed(|| scene.insert_batch(boxes.iter().copied()));
    black_box(scene);
    time
}

/// Returns the wall-clock time of a function. Dropping its result is not measured.
fn timed<T>(what: impl FnOnce() -> T) -> Duration {
    let start = Instant::now();
    let result = black_box(what());
    let time = start.elapsed();
    drop(result);
    time
}

/// Measures each contender once per round, in a random order, and returns the median time of each contender
/// in seconds.
fn in_turns<T>(them: &mut [T], rounds: usize, mut measure: impl FnMut(&mut T) -> Duration) -> Vec<f64> {
    let count = them.len();
    let mut times = vec![Vec::with_capacity(rounds); count];
    let mut random = Random(4);
    for _ in 0..rounds {
        for which in random.choose(count, count) {
            let which = which as usize;
            times[which].push(measure(&mut them[which]).as_secs_f64());
        }
    }
    times.into_iter().map(median).collect()
}

/// Returns the median, the upper of the two middle times if their number is even. Panics without times.
fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Formats a ratio with two or three digits, which is the precision of such a measurement.
fn short(x: f64) -> String {
    match x {
        x if x >= 10.0 => format!("{x:.0}"),
        x if x >= 1.0 => format!("{x:.1}"),
        x => format!("{x:.3}"),
    }
}

/// Returns the name of the processor if the system tells it, otherwise the name of its architecture.
fn cpu() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let field = |name: &str| {
        let line = info.lines().find(|line| line.starts_with(name))?;
        Some(line.split_once(':')?.1.trim().to_string())
    };
    match (field("model name"), field("cpu family"), field("model\t")) {
        (Some(name), Some(family), Some(model)) => format!("{name} (family {family}, model {model})"),
        (Some(name), ..) => name,
        _ => format!("A processor of the {} family", std::env::consts::ARCH),
    }
}
