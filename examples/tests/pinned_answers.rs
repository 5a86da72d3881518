//! Test that the answers of every culler at each setting on every built-in scene equal a stored table:
//! refactoring must not change an answer. `PINNED_ANSWERS=write cargo test -p visibility-examples
//! pinned_answers` rewrites the table.

use std::fmt::Write;
use std::path::Path;
use visibility_core::glam::DVec3;
use visibility_core::{Pipeline, VisibleSet};
use visibility_examples::built_in;
use visibility_examples::walkthrough::World;
use visibility_examples::walkthrough::cullers::{CullerError, entries, parse};
use visibility_frame::{
    backface::BackfaceCuller,
    casters::{CasterCuller, Light},
};

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

/// Culls all frames of a world and returns a line of the table: the scene, the culler, the number of reported
/// objects over all frames, the hash of the sorted visible sets, and the hash of the sets in the order of
/// iteration.
fn line(scene: &str, culler: &str, mut pipeline: Pipeline, world: &World) -> String {
    let mut visible = VisibleSet::new();
    let (mut count, mut sets, mut orders) = (0, Hash::EMPTY, Hash::EMPTY);
    for view in &world.views {
        pipeline.cull(&world.scene, view, &mut visible);
        let mut ids: Vec<u32> = visible.iter(&world.scene).map(|id| id.index() as u32).collect();
        count += ids.len();
        ids.iter().for_each(|&id| orders.add(id));
        ids.sort_unstable();
        ids.iter().for_each(|&id| sets.add(id));
        sets.add(u32::MAX);
    }
    format!("{scene} {culler} {count} {:016x} {:016x}", sets.0, orders.0)
}

#[test]
fn every_culler_answers_as_in_the_table() {
    let mut lines = String::new();
    for name in SCENES {
        let source = built_in(name).expect("a built-in scene");
        let mut world = World::new(source, (256, 144), Some(FRAMES)).expect("walks");
        for entry in entries() {
            match parse(&entry, &world) {
                Ok(mut made) => {
                    writeln!(lines, "{}", line(name, &entry, made.remove(0).1, &world)).expect("a string");
                }
                Err(CullerError::Unsuited { .. }) => {
                    writeln!(lines, "{name} {entry} unsuited").expect("a string");
                }
                Err(error) => panic!("{error}"),
            }
        }
        let ids: Vec<_> = world.scene.ids().collect();
        for id in ids {
            world.scene.set_one_sided(id, true).expect("an object of the scene");
        }
        let mut backface = BackfaceCuller::new();
        backface.sync(&world.scene);
        let backface = Pipeline::new().with(backface);
        writeln!(lines, "{}", line(name, "backface", backface, &world)).expect("a string");
        let light = Light::Directional { toward_light: DVec3::new(0.3, 0.2, 1.0) };
        let casters = Pipeline::new().with(CasterCuller::new(light).expect("a direction"));
        writeln!(lines, "{}", line(name, "casters", casters, &world)).expect("a string");
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pinned_answers.txt");
    if std::env::var("PINNED_ANSWERS").is_ok_and(|what| what == "write") {
        std::fs::write(&path, &lines).expect("the table can be written");
        return;
    }
    let table = std::fs::read_to_string(&path).expect("the table is in the repository");
    let differing: Vec<_> = lines.lines().zip(table.lines()).filter(|(now, then)| now != then).collect();
    assert!(
        differing.is_empty() && lines.lines().count() == table.lines().count(),
        "{} answers have changed, as (now, in the table): {differing:#?}",
        differing.len()
    );
}
