//! Tests of every culler at the extremes of its input: coordinates from 1e-30 to 1e30, eyes on vertices,
//! edges and planes, degenerate polygons, cameras with tiny and huge fields of view. No culler may panic or
//! hang, and a conservative culler must hide nothing that an exact ray sees.
//!
//! The cullers come from the table of `walkthrough`, and the methods for viewcells from the table of
//! `region`, so a new one is tested as soon as it is in its table. `EXTREMES_CASES` sets the number of random
//! worlds, 60 by default; `EXTREMES_CULLERS=naylor,bsp` selects the cullers whose names begin with one of
//! these words.

mod exact;
mod maze;
mod metamorphic;
mod oracle;
mod paths;
mod regions;
mod strategies;

use strategies::World;
use visibility_core::{Accuracy, FrustumCuller, Pipeline, View, VisibleSet};
use visibility_examples::walkthrough::cullers::{self, parse};
use visibility_testing::Random;

/// Returns all cullers at each of their settings, without pipelines of several stages. The environment
/// variable `EXTREMES_CULLERS` filters them by prefix.
fn entries() -> Vec<String> {
    let all = cullers::entries().into_iter().filter(|entry| !entry.contains('+'));
    match std::env::var("EXTREMES_CULLERS") {
        Ok(list) => all.filter(|entry| list.split(',').any(|name| entry.starts_with(name))).collect(),
        Err(_) => all.collect(),
    }
}

/// Tests whether a culler, given as its entry in the table, needs cells and portals.
fn is_of_rooms(entry: &str) -> bool {
    entry.starts_with("portals") || entry.starts_with("pvs")
}

/// Returns the number of random worlds to try: the value of `EXTREMES_CASES`, or `unless_set` without it.
fn cases(unless_set: u64) -> u64 {
    std::env::var("EXTREMES_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(unless_set)
}

/// Culls a view, and returns for each object, by index, whether it is reported visible. `visible` is
/// overwritten.
fn shown(world: &World, pipeline: &mut Pipeline, view: &View, visible: &mut VisibleSet) -> Vec<bool> {
    pipeline.cull(&world.scene, view, visible);
    let mut shown = vec![false; world.source.objects.len()];
    visible.iter(&world.scene).for_each(|id| shown[id.index()] = true);
    shown
}

/// Counts of a culler's answers over several worlds. `hidden` counts hidden objects over all views, and
/// `rays` the rays shot at them.
#[derive(Default, Debug)]
struct Tally {
    worlds: usize,
    hidden: usize,
    rays: usize,
    /// Number of objects that an exact culler had to hide, all of which it hid.
    surely: usize,
}

/// Culls every view of a world with a culler, shoots rays at the hidden objects, and fails if a ray reaches
/// one or if an exact culler shows an object that is surely hidden. Counts are added to `tally`. A culler
/// that does not suit the world is skipped.
fn check(entry: &str, case: &strategies::Case, rng: &mut Random, tally: &mut Tally) {
    let world: &World = &case.world;
    // Skips a culler that does not suit the world.
    let Ok(mut made) = parse(entry, world) else { return };
    let mut pipeline = made.remove(0).1;
    tally.worlds += 1;
    let accuracy = pipeline.accuracy();
    let mut frustum = Pipeline::new().with(FrustumCuller::new());
    let rooms = world.source.cells.as_ref().filter(|_| is_of_rooms(entry));
    let rooms = rooms.map(|cells| oracle::Rooms::new(cells, entry.contains("pvs"))).unwrap_or_default();
    let mut visible = VisibleSet::new();
    for (number, view) in world.views.iter().enumerate() {
        let seen = shown(world, &mut pipeline, view, &mut visible);
        let hidden: Vec<usize> = (0..seen.len()).filter(|&index| !seen[index]).collect();
        tally.hidden += hidden.len();
        if !accuracy.never_hides() {
            continue;
        }
        // If rounding blurs the picture, an exact culler does not hide objects outside the frustum. Such
        // views are not checked.
        if accuracy == Accuracy::Exact && shown(world, &mut frustum, view, &mut visible) != seen {
            for index in (0..seen.len()).filter(|&index| exact::surely_hidden(world, view, index)) {
                tally.surely += 1;
                assert!(
                    !seen[index],
                    "{entry} shows object {index} of {} ({}), view {number}, which others hide",
                    world.source.name, case.what
                );
            }
        }
        for &index in &hidden {
            if let Some(point) =
                oracle::seen_point(world, view, index, accuracy, &rooms, rng, &mut tally.rays)
            {
                panic!(
                    "{entry} hides object {index} of {} ({}), view {number}, though the point {point} of it is seen",
                    world.source.name, case.what
                );
            }
        }
    }
}

/// Checks cullers on the random worlds of the seeds below `count`. Each culler that suits a world must hide
/// something in some world.
fn try_worlds(entries: &[String], make: fn(&mut Random) -> strategies::Case, count: u64) {
    let mut tallies: Vec<Tally> = entries.iter().map(|_| Tally::default()).collect();
    for seed in 0..count {
        let case = make(&mut Random(seed));
        for (entry, tally) in entries.iter().zip(&mut tallies) {
            check(entry, &case, &mut Random(seed), tally);
        }
    }
    for (entry, tally) in entries.iter().zip(&tallies) {
        println!(
            "{entry}: {} worlds, {} objects hidden, {} surely, {} rays",
            tally.worlds, tally.hidden, tally.surely, tally.rays
        );
        let easy = tally.worlds > 0 && tally.hidden == 0;
        assert!(!easy, "{entry} hid nothing in {} worlds: too easy", tally.worlds);
        assert!(entry != "naylor" || tally.surely > 0, "{entry}: nothing that it must hide: too easy");
    }
}

#[test]
fn random_worlds_at_the_extremes() {
    try_worlds(&entries(), strategies::random, cases(60));
}

#[test]
fn rooms_at_the_extremes() {
    let mut entries = entries();
    // Adds sets for cells made from the walls, besides the cells that the world has.
    entries.extend(["pvs:walls", "pvs:bsp"].map(String::from));
    try_worlds(&entries, strategies::rooms, cases(150));
}

#[test]
fn scenes_of_nothing_of_one_object_and_of_many_in_one_point() {
    for case in strategies::degenerate_counts() {
        for entry in entries() {
            check(&entry, &case, &mut Random(1), &mut Tally::default());
        }
    }
}

/// Test of a million coinciding objects, which no hierarchy can separate.
#[test]
#[ignore = "minutes, in the release profile"]
fn a_million_objects_in_one_point() {
    let case = strategies::crowd(1_000_000);
    for entry in entries() {
        let start = std::time::Instant::now();
        check(&entry, &case, &mut Random(1), &mut Tally::default());
        println!("{entry}: {:.1} s", start.elapsed().as_secs_f64());
    }
}
