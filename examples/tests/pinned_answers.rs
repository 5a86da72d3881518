//! Test that the answers of every culler at each setting on every built-in scene equal a stored table, with
//! each instruction set of the processor and on 1, 3 and 8 threads: neither these nor refactoring may change
//! an answer. `PINNED_ANSWERS=write cargo test -p visibility-examples pinned_answers` rewrites the table.

use std::fmt::Write;
use std::path::Path;
use visibility_core::glam::DVec3;
use visibility_core::{Pipeline, VisibleSet, jobs::Jobs, simd::Simd};
use visibility_examples::built_in;
use visibility_examples::walkthrough::World;
use visibility_examples::walkthrough::cullers::{CullerError, entries, parse};
use visibility_frame::{
    backface::BackfaceCuller,
    casters::{CasterCuller, Light},
};
use visibility_testing::job_systems::Threads;

const SCENES: [&str; 5] = ["plpcity:1,1", "london:5,5", "town:1", "forest:60,40", "office:1,8"];
/// Number of frames of each scene, spread over its walks.
const FRAMES: usize = 6;

/// State of a 64-bit FNV-1a hash over a sequence of u32.
struct Hash(u64);

impl Hash {
    const EMPTY: Self = Self(0xcbf2_9ce4_8422_2325);

    /// Appends the four little-endian bytes of a number to the hashed sequence.
    fn add(&mut self, number: u32) {
        for byte in number.to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    }
}

/// Culls all frames of a world, on the threads of a job system if one is given, and returns a line of the
/// table: the scene, the culler, the number of reported objects over all frames, the hash of the sorted
/// visible sets, and the hash of the sets in the order of iteration.
fn line(scene: &str, culler: &str, mut pipeline: Pipeline, world: &World, jobs: Option<&dyn Jobs>) -> String {
    let mut visible = VisibleSet::new();
    let (mut count, mut sets, mut orders) = (0, Hash::EMPTY, Hash::EMPTY);
    for view in &world.views {
        match jobs {
            Some(jobs) => pipeline.cull_on(jobs, &world.scene, view, &mut visible),
            None => pipeline.cull(&world.scene, view, &mut visible),
        };
        let mut ids: Vec<u32> = visible.iter(&world.scene).map(|id| id.index() as u32).collect();
        count += ids.len();
        ids.iter().for_each(|&id| orders.add(id));
        ids.sort_unstable();
        ids.iter().for_each(|&id| sets.add(id));
        sets.add(u32::MAX);
    }
    format!("{scene} {culler} {count} {:016x} {:016x}", sets.0, orders.0)
}

/// Returns the lines of a scene: a line for each culler with `world.simd`, or that the culler does not suit
/// the scene, and the lines of cullers that programs do not know by name. These cull `one_sided`, the same
/// scene with one-sided objects.
fn lines(scene: &str, world: &World, one_sided: &World, jobs: Option<&dyn Jobs>) -> String {
    let mut lines = String::new();
    for entry in entries() {
        let line = match parse(&entry, world) {
            Ok(mut made) => line(scene, &entry, made.remove(0).1, world, jobs),
            Err(CullerError::Unsuited { .. }) => format!("{scene} {entry} unsuited"),
            Err(error) => panic!("{error}"),
        };
        writeln!(lines, "{line}").expect("a string");
    }
    let mut backface = BackfaceCuller::new().with_simd(world.simd);
    backface.sync(&one_sided.scene);
    let light = Light::Directional { toward_light: DVec3::new(0.3, 0.2, 1.0) };
    let casters = CasterCuller::new(light).expect("a direction").with_simd(world.simd);
    for (name, pipeline) in
        [("backface", Pipeline::new().with(backface)), ("casters", Pipeline::new().with(casters))]
    {
        writeln!(lines, "{}", line(scene, name, pipeline, one_sided, jobs)).expect("a string");
    }
    lines
}

#[test]
fn every_culler_answers_as_in_the_table() {
    let alone = Simd::available().map(|simd| (simd, None));
    let ways: Vec<_> = alone.chain([1, 3, 8].map(|threads| (Simd::best(), Some(Threads(threads))))).collect();
    let mut tables = vec![String::new(); ways.len()];
    for name in SCENES {
        let world = || {
            let source = built_in(name).expect("a built-in scene");
            World::new(source, (256, 144), Some(FRAMES)).expect("walks")
        };
        let (mut world, mut one_sided) = (world(), world());
        let ids: Vec<_> = one_sided.scene.ids().collect();
        for id in ids {
            one_sided.scene.set_one_sided(id, true).expect("an object of the scene");
        }
        for ((simd, threads), table) in ways.iter().zip(&mut tables) {
            world.simd = *simd;
            *table += &lines(name, &world, &one_sided, threads.as_ref().map(|jobs| jobs as &dyn Jobs));
        }
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pinned_answers.txt");
    if std::env::var("PINNED_ANSWERS").is_ok_and(|what| what == "write") {
        std::fs::write(&path, &tables[0]).expect("the table can be written");
    }
    let stored = std::fs::read_to_string(&path).expect("the table is in the repository");
    for ((simd, threads), table) in ways.iter().zip(&tables) {
        let differing: Vec<_> = table.lines().zip(stored.lines()).filter(|(now, then)| now != then).collect();
        assert!(
            differing.is_empty() && table.lines().count() == stored.lines().count(),
            "{} answers have changed with {simd:?}, on {:?} threads of a job system, as (now, in the table): \
             {differing:#?}",
            differing.len(),
            threads.as_ref().map(|threads| threads.0)
        );
    }
}
