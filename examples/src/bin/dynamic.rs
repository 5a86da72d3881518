//! Program `dynamic`: takes random occluders of a scene away and puts them back, brings the verdicts from
//! viewcells up to date, and compares time and verdicts with queries from the start.

use clap::Parser;
use comfy_table::{Table, presets};
use std::error::Error;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;
use visibility_core::pvs::Viewcell;
use visibility_core::scene::Triangle;
use visibility_core::{Object, ObjectId, Scene};
use visibility_exact::{
    DynamicCell, Effort, ExactCuller, ExactSettings, SceneTriangles, UpdateStats, Verdict,
};
use visibility_examples::arguments::count;
use visibility_examples::region::{self, cells};
use visibility_examples::{
    Cameras, Reading, eprintln, exit_code, open_as, print::go_on_without_reader, println,
};
use visibility_testing::{Random, distance};

/// Take random occluders of a scene away and put them back, and bring what viewcells see up to date.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// Scene: a built-in scene (plpcity, london, town, forest, office, each with sizes as in london:40,40),
    /// or a file (.vscn, .glb, .gltf).
    #[arg(value_name = "SCENE", default_value = "london:12,12")]
    scene: String,

    /// How a scene file is read.
    #[command(flatten)]
    reading: Reading,

    /// Source of the cameras.
    #[command(flatten)]
    cameras: Cameras,

    /// Number of viewcells to spread along the scene's walks.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = count())]
    cells: usize,

    /// Greatest size in metres of the viewcells: two sizes on the ground, and the height.
    #[arg(long, value_name = "WIDTH,DEPTH,HEIGHT", value_parser = cells::parse_size, default_value = "3,3,1")]
    size: [f64; 3],

    /// Number of occluders, chosen at random, that are taken away and put back one after the other.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = count())]
    edits: usize,

    /// Seed of the choice of occluders.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// Clearance in metres.
    #[arg(long, value_name = "METRES", default_value_t = 1e-4)]
    clearance: f64,

    /// Number of the edits, spread over all, after which the verdicts are compared with a query from the
    /// start.
    #[arg(long, value_name = "N", default_value_t = 0)]
    compared: usize,
}

fn main() -> ExitCode {
    go_on_without_reader();
    exit_code(run(&Arguments::parse()))
}

/// Names of the two halves of an edit.
const WAYS: [&str; 2] = ["taken away", "put back"];

/// Updates of one kind: times in milliseconds and what they have done.
#[derive(Default)]
struct Updates {
    milliseconds: Vec<f64>,
    /// Times of the updates that had to search.
    searching: Vec<f64>,
    stats: Vec<UpdateStats>,
}

impl Updates {
    fn add(&mut self, milliseconds: f64, stats: UpdateStats) {
        self.milliseconds.push(milliseconds);
        if stats.unproven + stats.blocked > 0 {
            self.searching.push(milliseconds);
        }
        self.stats.push(stats);
    }

    fn row(mut self, name: &str) -> Vec<String> {
        self.milliseconds.sort_by(f64::total_cmp);
        self.searching.sort_by(f64::total_cmp);
        let count = self.milliseconds.len();
        let at = |times: &[f64], part: f64| {
            times.get(((times.len() as f64 - 1.0) * part).round() as usize).map_or(0.0, |time| *time)
        };
        let mean = |of: fn(&UpdateStats) -> usize| {
            self.stats.iter().map(of).sum::<usize>() as f64 / count.max(1) as f64
        };
        let times = &self.milliseconds;
        let average = |times: &[f64]| times.iter().sum::<f64>() / times.len().max(1) as f64;
        let under = times.iter().filter(|time| **time < 5.0).count();
        vec![
            name.into(),
            count.to_string(),
            format!("{:.3}", average(times)),
            format!("{:.3}, {:.2}, {:.1}", at(times, 0.5), at(times, 0.95), at(times, 1.0)),
            format!("{:.1} %", 100.0 * under as f64 / count.max(1) as f64),
            self.searching.len().to_string(),
            format!("{:.2}", average(&self.searching)),
            format!("{:.2}", mean(|stats| stats.unproven)),
            format!("{:.2}", mean(|stats| stats.mended)),
            format!("{:.2}", mean(|stats| stats.blocked)),
            format!("{:.2}", mean(|stats| stats.searched)),
        ]
    }
}

/// Comparison of kept verdicts with those of queries from the start.
#[derive(Default)]
struct Comparison {
    /// Numbers of objects by kept verdict (seen, hidden, open) and by fresh verdict.
    pairs: [[usize; 3]; 3],
    /// Objects that one side sees and the other hides, though their line of sight keeps six clearances.
    contradictions: usize,
    seconds: Vec<f64>,
}

fn number(verdict: Verdict) -> usize {
    match verdict {
        Verdict::Seen(_) => 0,
        Verdict::Hidden | Verdict::Hardly(_) => 1,
        Verdict::Open => 2,
    }
}

impl Comparison {
    fn compare(&mut self, kept: &DynamicCell, scene: &Scene, settings: ExactSettings) {
        let triangles = Arc::new(SceneTriangles::new(scene));
        let mut culler = ExactCuller::new(triangles.clone(), settings);
        let start = Instant::now();
        let fresh = culler.verdicts(kept.viewcell());
        self.seconds.push(start.elapsed().as_secs_f64());
        let mut by_index = vec![None; scene.index_limit()];
        kept.iter().for_each(|(id, verdict)| by_index[id.index()] = Some((id, verdict)));
        for (id, fresh) in fresh.iter(&triangles) {
            let Some((_, kept)) = by_index[id.index()].filter(|(known, _)| *known == id) else {
                self.contradictions += 1;
                continue;
            };
            self.pairs[number(kept)][number(fresh)] += 1;
            let witness = match (kept, fresh) {
                (Verdict::Seen(witness), Verdict::Hidden) | (Verdict::Hidden, Verdict::Seen(witness)) => {
                    witness
                }
                _ => continue,
            };
            let others = scene.ids().filter(|&other| other != id);
            let occluders = others.filter(|&other| scene.object(other).is_ok_and(|object| object.occluder));
            let near = occluders
                .flat_map(|other| scene.triangles(other).unwrap_or_default().to_vec())
                .map(|t| distance(witness.from, witness.to, &t))
                .fold(f64::INFINITY, f64::min);
            self.contradictions += usize::from(near > 6.0 * settings.clearance());
        }
    }
}

/// An object that was taken out of a scene.
struct Taken {
    object: Object,
    triangles: Vec<Triangle>,
}

fn take(scene: &mut Scene, id: ObjectId) -> Result<Taken, Box<dyn Error>> {
    let (object, triangles) = (scene.object(id)?, scene.triangles(id)?.to_vec());
    scene.remove(id)?;
    Ok(Taken { object, triangles })
}

fn put_back(scene: &mut Scene, taken: Taken) -> Result<(), Box<dyn Error>> {
    let id = scene.insert(taken.object);
    scene.set_triangles(id, taken.triangles)?;
    Ok(())
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let mut source = open_as(&arguments.scene, &arguments.reading)?;
    arguments.cameras.give_whole(&mut source, &arguments.reading)?;
    source.print_notes();
    let world = region::world(source);
    let mut scene = world.scene.clone();
    let start = Instant::now();
    let mut triangles = SceneTriangles::new(&scene);
    println!(
        "{}: {} objects, {} triangles, made ready in {:.1} ms",
        arguments.scene,
        scene.len(),
        triangles.len(),
        start.elapsed().as_secs_f64() * 1e3
    );
    let settings = ExactSettings::new(Effort::Exact(arguments.clearance));
    let viewcells: Vec<Viewcell> = cells::along_walks(&world, arguments.cells, arguments.size);
    let mut kept: Vec<DynamicCell> =
        viewcells.into_iter().map(|cell| DynamicCell::new(cell, settings)).collect();
    for (cell, place) in kept.iter_mut().zip(0..) {
        let start = Instant::now();
        cell.update(&triangles, &|| false);
        println!(
            "viewcell {place}: seen, hidden, open {:?} in {:.0} ms; {} kB with {} proofs",
            cell.counts(),
            start.elapsed().as_secs_f64() * 1e3,
            cell.memory() / 1000,
            cell.proofs().count()
        );
    }
    let mut random = Random(arguments.seed);
    let mut syncs = Vec::new();
    let mut updates: [Updates; 2] = Default::default();
    let mut comparisons: [Comparison; 2] = Default::default();
    let occluders: Vec<usize> = scene
        .ids()
        .filter(|&id| scene.object(id).is_ok_and(|object| object.occluder))
        .map(ObjectId::index)
        .collect();
    for edit in 0..arguments.edits {
        let Some(id) = scene.id_at(random.pick(&occluders)) else { continue };
        let mut taken = Some(take(&mut scene, id)?);
        for way in 0..2 {
            if way == 1
                && let Some(taken) = taken.take()
            {
                put_back(&mut scene, taken)?;
            }
            let start = Instant::now();
            triangles.sync(&scene);
            syncs.push(start.elapsed().as_secs_f64() * 1e3);
            for cell in &mut kept {
                let start = Instant::now();
                let stats = cell.update(&triangles, &|| false);
                let milliseconds = start.elapsed().as_secs_f64() * 1e3;
                if milliseconds > 1000.0 {
                    eprintln!("edit {edit}, {}: {milliseconds:.0} ms for {stats:?}", WAYS[way]);
                }
                updates[way].add(milliseconds, stats);
            }
            let before = edit * arguments.compared / arguments.edits;
            if (edit + 1) * arguments.compared / arguments.edits > before {
                kept.iter().for_each(|cell| comparisons[way].compare(cell, &scene, settings));
            }
        }
    }
    syncs.sort_by(f64::total_cmp);
    if let (Some(median), Some(greatest)) = (syncs.get(syncs.len() / 2), syncs.last()) {
        println!("sync: median {median:.3} ms, greatest {greatest:.2} ms");
    }
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header([
        "update after",
        "updates",
        "mean ms",
        "median, 95 %, greatest ms",
        "under 5 ms",
        "searching",
        "mean ms",
        "unproven",
        "mended",
        "blocked",
        "searched",
    ]);
    for (name, updates) in WAYS.into_iter().zip(updates) {
        table.add_row(updates.row(name));
    }
    println!("{table}");
    for (name, comparison) in WAYS.into_iter().zip(comparisons) {
        if comparison.seconds.is_empty() {
            continue;
        }
        let mean = comparison.seconds.iter().sum::<f64>() / comparison.seconds.len() as f64;
        println!(
            "{name}: {} queries from the start, {:.0} ms on average; kept seen, hidden, open by fresh seen, \
             hidden, open: {:?}; contradictions: {}",
            comparison.seconds.len(),
            mean * 1e3,
            comparison.pairs,
            comparison.contradictions
        );
    }
    Ok(())
}
