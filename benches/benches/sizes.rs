//! Table of z-buffer frames for scenes of growing size: occluders drawn, boxes tested, time and reported
//! objects, compared with the objects in the frustum and the visible objects. Time should depend on the
//! visible part: a city that is a hundred times larger should take no longer.
//!
//! `cargo bench -p visibility-benches --bench sizes` measures all built-in scenes; names of scenes or paths
//! of files after `--` are measured instead.

use visibility_core::{CullStats, FrustumCuller, Pipeline, VisibleSet};
use visibility_examples::open;
use visibility_examples::walkthrough::{World, judge, run};
use visibility_hzb::{Hzb, HzbCuller};

/// Scenes to measure, each kind from small to large.
const SCENES: &[&str] = &[
    "london:12,12",
    "london:24,24",
    "london:40,40",
    "london:80,80",
    "london:120,120",
    "london:200,200",
    "plpcity:1,1",
    "plpcity",
    "plpcity:3,3",
    "plpcity:8,8",
    "town:2",
    "town:8",
    "town:40",
    "forest:60,40",
    "forest:400,300",
    "office:1,8",
    "office",
    "office:7,24",
];

/// Number of frames of each scene, spread evenly over its walks.
const FRAMES: usize = 16;
/// Width and height in pixels of the item buffer that counts the visible objects.
const JUDGE: (u32, u32) = (320, 180);

/// Measures one scene and prints its row. Fails if the z-buffer hides a visible object.
fn row(name: &str) -> Result<(), Box<dyn std::error::Error>> {
    let world = World::new(open(name)?, JUDGE, Some(FRAMES))?;
    let frustum = || Pipeline::new().with(FrustumCuller::new());
    let hzb = || frustum().with(HzbCuller::new(Hzb::default()));
    let trials = [run("frustum".into(), frustum(), &world), run("hzb".into(), hzb(), &world)];
    let (mut pipeline, mut visible, mut sum) = (hzb(), VisibleSet::new(), CullStats::default());
    for view in &world.views {
        pipeline.cull(&world.scene, view, &mut visible);
        pipeline.stages().skip(1).for_each(|(_, stats)| sum += stats);
    }
    let frames = world.views.len() as f64;
    let judgement = judge(&world, &trials, || ())?;
    let [in_view, hzb] = &trials;
    println!(
        "| {name} | {} | {:.0} | {:.1} | {:.1} | {:.1} | {:.0} | {:.0} |",
        world.scene.len(),
        in_view.mean_visible(),
        judgement.mean_exact(),
        hzb.mean_visible(),
        sum.occluders as f64 / frames,
        sum.tests as f64 / frames,
        hzb.quantile(0.5),
    );
    assert!(judgement.verdicts.iter().all(|verdict| verdict.false_hidden == 0), "{name}");
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Without `--bench`, which `cargo bench` adds, this program runs as a short test.
    let is_bench = std::env::args().any(|word| word == "--bench");
    let named: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    println!("| scene | objects | in view | visible | reported | occluders drawn | boxes tested | us |");
    println!("|---|---:|---:|---:|---:|---:|---:|---:|");
    match (named.is_empty(), is_bench) {
        (false, _) => named.iter().try_for_each(|name| row(name)),
        (true, true) => SCENES.iter().try_for_each(|name| row(name)),
        (true, false) => row("office:1,8"),
    }
}
