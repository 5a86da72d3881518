//! Every culler at the extremes of its input: coordinates from 1e-30 to 1e30, eyes in the worst places,
//! polygons that are none, cameras that see almost nothing or almost everything. No panic, no hang, and what
//! promises to be conservative hides nothing that an exact ray sees.
//!
//! Cullers are taken from the table that `walkthrough` takes them from, so a new one is tested as soon as it
//! can be asked for. `EXTREMES_CASES` sets how many random worlds are tried, 60 by default;
//! `EXTREMES_CULLERS=naylor,bsp` tries only cullers whose names begin so.

mod exact;
mod maze;
mod metamorphic;
mod oracle;
mod paths;
mod strategies;

use strategies::World;
use visibility_core::{Accuracy, FrustumCuller, Pipeline, View, VisibleSet};
use visibility_examples::walkthrough::cullers::{self, parse};
use visibility_testing::Random;

/// All cullers at each setting of their dials, one at a time.
fn entries() -> Vec<String> {
    let all = cullers::entries().into_iter().filter(|entry| !entry.contains('+'));
    match std::env::var("EXTREMES_CULLERS") {
        Ok(list) => all.filter(|entry| list.split(',').any(|name| entry.starts_with(name))).collect(),
        Err(_) => all.collect(),
    }
}

/// Whether a culler looks through portals.
fn is_of_rooms(entry: &str) -> bool {
    entry.starts_with("portals") || entry.starts_with("pvs")
}

/// How many random worlds to try.
fn cases(unless_set: u64) -> u64 {
    std::env::var("EXTREMES_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(unless_set)
}

/// By object, whether a view shows it.
fn shown(world: &World, pipeline: &mut Pipeline, view: &View, visible: &mut VisibleSet) -> Vec<bool> {
    pipeline.cull(&world.scene, view, visible);
    let mut shown = vec![false; world.source.objects.len()];
    visible.iter(&world.scene).for_each(|id| shown[id.index()] = true);
    shown
}

/// What a culler did over several worlds.
#[derive(Default, Debug)]
struct Tally {
    worlds: usize,
    hidden: usize,
    rays: usize,
    /// Hidden beyond doubt, where the culler is exact.
    surely: usize,
}

/// Culls every view of a world and shoots rays at what was hidden.
fn check(entry: &str, case: &strategies::Case, rng: &mut Random, tally: &mut Tally) {
    let world: &World = &case.world;
    // A culler that does not go with the world says so.
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
        // Where rounding blurs the picture, what is exact says nothing.
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

/// Shows random worlds to cullers, each of which must hide something in them.
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
    // Cells made of the walls instead of those that are given.
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

/// A million, as the scene's bounds make no difference to any of them.
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
