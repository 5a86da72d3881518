//! Tests of cell-to-cell visibility with lines: no line through portals connects two cells that count as
//! hidden from each other. The lines are random, or planted through chains of portals with minimal clearance.
//!
//! `cargo test --release pvs_lines -- --ignored` repeats the tests on the maps in `../shared/portals`
//! (or in the directory in the environment variable `VISIBILITY_MAPS`), with the number of lines in
//! `VISIBILITY_LINES`, and takes minutes.

use std::path::PathBuf;
use visibility_core::glam::{DQuat, DVec3};
use visibility_core::{
    cells::{CellGraph, CellId},
    pvs::ViewcellId,
};
use visibility_examples::pvs::maps::{planted, rooms, rounded, turned};
use visibility_examples::pvs::stabs::{Random, Verdict, directed_lines, goes_through, random_lines};
use visibility_examples::pvs::{QUICK_DEPTH, bake, read};
use visibility_portals::{BakerSettings, CellMatrix, ChainTest};

/// Settings with the test in Pluecker space and without a limit of steps.
fn exact() -> BakerSettings {
    BakerSettings::default()
        .with_clearance(1e-6)
        .with_steps_per_cell(u64::MAX)
        .with_chain_test(ChainTest::Pluecker)
}

/// Returns the cell-to-cell visibility of a map, baked with default settings on one thread.
fn visible(graph: &CellGraph) -> CellMatrix {
    visible_by(graph, BakerSettings::default())
}

/// Returns the cell-to-cell visibility of a map, baked with the given settings on one thread. Fails unless
/// the result is complete and symmetric.
fn visible_by(graph: &CellGraph, settings: BakerSettings) -> CellMatrix {
    let outcome = bake(graph, settings, 1, |_| {}).unwrap().outcome;
    assert!(
        outcome.complete && outcome.fallbacks.is_empty() && outcome.matrix.is_symmetric(),
        "the bake is complete and symmetric"
    );
    outcome.matrix
}

#[test]
fn no_random_line_passes_between_hidden_cells() {
    let mut sum = Verdict::default();
    for seed in 0..6 {
        let graph = rooms(6, 2, seed);
        graph.validate(1e-9).unwrap();
        // The test in Pluecker space shows only pairs that are shown without it.
        let (matrix, loose) = (visible_by(&graph, exact()), visible(&graph));
        for a in (0..72).map(CellId) {
            assert!(
                matrix.seen_from(a).all(|b| loose.sees(a, b)),
                "seed {seed}, {a:?}: a pair that the loose bake hides"
            );
        }
        // Many pairs are hidden, so errors have a chance to show.
        assert!(matrix.mean_visible() < 50.0, "{}", matrix.mean_visible());
        let verdict = random_lines(&graph, &matrix, 50_000, 1e-6, seed);
        sum.pairs += verdict.pairs;
        sum.false_hidden += verdict.false_hidden;
        // Directed lines aim from each cell at every cell hidden from it.
        let all = CellMatrix::from_bytes(72, &[0xff; 72 * 9]).unwrap();
        let verdict = directed_lines(&graph, &matrix, &all, 20, 1e-6, seed);
        sum.false_hidden += verdict.false_hidden;
    }
    assert!(sum.pairs > 300_000, "{sum:?}");
    assert_eq!(sum.false_hidden, 0, "{sum:?}");
}

/// Settings of a preview, whose chains of portals end at a given depth.
fn to_depth(depth: u32) -> BakerSettings {
    BakerSettings::default().with_depth(depth)
}

#[test]
fn previews_show_all_that_longer_chains_show_and_lines_reach() {
    for seed in 20..26 {
        let graph = rooms(6, 2, seed);
        let mut matrices: Vec<CellMatrix> = (0..4).map(|depth| visible_by(&graph, to_depth(depth))).collect();
        matrices.push(visible(&graph));
        for a in (0..72).map(CellId) {
            for (depth, pair) in matrices.windows(2).enumerate() {
                assert!(
                    pair[1].seen_from(a).all(|b| pair[0].sees(a, b)),
                    "seed {seed}, {a:?}: a pair that depth {depth} hides and a greater depth shows"
                );
            }
        }
        let counts: Vec<u64> = matrices.iter().map(CellMatrix::count).collect();
        assert!(counts[1] < counts[0] && counts[4] < counts[1], "seed {seed}: pairs by depth {counts:?}");
        assert!(counts[1] < 72 * 72, "seed {seed}: the preview hides something");
        let by_chance = random_lines(&graph, &matrices[1], 20_000, 1e-6, seed);
        let all = CellMatrix::from_bytes(72, &[0xff; 72 * 9]).unwrap();
        let aimed = directed_lines(&graph, &matrices[1], &all, 20, 1e-6, seed);
        assert!(by_chance.pairs > 20_000, "seed {seed}: {by_chance:?}");
        assert_eq!(by_chance.false_hidden + aimed.false_hidden, 0, "seed {seed}: {by_chance:?}, {aimed:?}");
    }
}

/// Plants `chains` chains of portals and returns how many of them have a cell that is wrongly called hidden
/// from another, then how many chains could be planted.
fn broken(chains: u64, seed: u64) -> (u64, u64) {
    let mut random = Random(seed);
    let (mut broken, mut good) = (0, 0);
    for _ in 0..chains {
        let clearance = 2e-6 * (random.unit() * 500f64.ln()).exp();
        let count = 2 + random.below(14);
        let chain = planted(count, clearance, &mut random);
        let through = chain.graph.portals().iter().enumerate().all(|(i, portal)| {
            let id = visibility_core::cells::PortalId(i as u32);
            goes_through(&chain.graph, id, portal.cells()[0].index() == i, chain.line, 1e-6)
        });
        if !through || chain.graph.portals().len() != count {
            continue;
        }
        good += 1;
        let cells = 0..=count as u32;
        let is_hidden = |matrix: CellMatrix| {
            cells.clone().any(|a| cells.clone().any(|b| !matrix.sees(CellId(a), CellId(b))))
        };
        // The test in Pluecker space shows the fewest pairs, so it contains every error of the settings
        // without it. A preview has a path of its own where its chains end.
        broken += u64::from(is_hidden(visible_by(&chain.graph, exact())));
        broken += u64::from(is_hidden(visible_by(&chain.graph, to_depth(QUICK_DEPTH))));
    }
    (broken, good)
}

#[test]
fn no_planted_line_is_lost() {
    let (broken, good) = broken(6000, 1);
    assert!(good > 5000, "only {good} chains are as planted");
    assert_eq!(broken, 0, "of {good}");
}

#[test]
fn turning_and_rounding_a_map_changes_next_to_nothing() {
    let (mut plain, mut other) = (0, 0);
    for seed in 10..14 {
        let graph = rooms(6, 2, seed);
        plain += 2 * visible(&graph).count();
        let rotation = DQuat::from_axis_angle(Random(seed).direction(), 1.0 + seed as f64);
        let moved = turned(&graph, rotation, DVec3::new(1234.5, -777.7, 0.3));
        other += visible(&moved).count() + visible(&rounded(&moved, 6)).count();
    }
    let ratio = other as f64 / plain as f64;
    assert!((0.9995..1.005).contains(&ratio), "{ratio}");
}

#[test]
#[ignore = "minutes, and maps that are not part of the project"]
fn real_maps() {
    let directory = std::env::var("VISIBILITY_MAPS").unwrap_or("../../shared/portals".into());
    let lines = std::env::var("VISIBILITY_LINES").ok().and_then(|n| n.parse().ok()).unwrap_or(1_000_000);
    let mut maps: Vec<PathBuf> = std::fs::read_dir(&directory).unwrap().map(|e| e.unwrap().path()).collect();
    maps.retain(|path| path.extension().is_some_and(|e| e == "prt"));
    maps.sort_by_key(|path| std::fs::metadata(path).unwrap().len());
    for path in maps {
        let graph = read(&path).unwrap().graph;
        let matrix = visible(&graph);
        // The test in Pluecker space shows the fewest pairs, so it contains every error of the other
        // settings. The number of threads must not matter.
        let [exact, by_two] = [1, 2].map(|threads| bake(&graph, exact(), threads, |_| {}).unwrap().outcome);
        assert_eq!(exact, by_two, "{}", path.display());
        let cells = (0..graph.cell_count() as u32).map(CellId);
        assert!(
            cells.clone().all(|a| exact.matrix.seen_from(a).all(|b| matrix.sees(a, b))),
            "{}: the exact bake shows a pair that the loose one hides",
            path.display()
        );
        let quick = visible_by(&graph, to_depth(QUICK_DEPTH));
        assert!(
            cells.clone().all(|a| matrix.seen_from(a).all(|b| quick.sees(a, b))),
            "{}: the preview hides a pair that the whole bake shows",
            path.display()
        );
        println!("{}: mean of the preview {}", path.display(), quick.mean_visible());
        assert!(
            exact.complete && exact.matrix.is_symmetric(),
            "{}: the bake is complete and symmetric",
            path.display()
        );
        let bytes = std::fs::read(path.with_extension("vismat")).unwrap();
        let theirs = CellMatrix::from_bytes(graph.cell_count(), &bytes).unwrap();
        assert!(matrix.count() <= theirs.count(), "{}: {}", path.display(), matrix.mean_visible());
        assert!(matrix.count() as f64 <= 1.001 * theirs.both_ways().count() as f64, "{}", path.display());
        let means = [&matrix, &exact.matrix].map(CellMatrix::mean_visible);
        println!(
            "{}: mean {means:?}, theirs both ways {}",
            path.display(),
            theirs.both_ways().mean_visible()
        );
        let by_chance = random_lines(&graph, &exact.matrix, lines, 1e-6, 7);
        let aimed = directed_lines(&graph, &exact.matrix, &theirs, lines / 1000, 1e-6, 8);
        println!("{}: random {by_chance:?}, directed {aimed:?}", path.display());
        assert_eq!(by_chance.false_hidden + aimed.false_hidden, 0, "{}", path.display());
        let rotation = DQuat::from_axis_angle(DVec3::new(0.3, -0.7, 0.4).normalize(), 0.77);
        let moved = turned(&graph, rotation, DVec3::ZERO);
        for (what, graph) in
            [("turned", &moved), ("6 decimals", &rounded(&graph, 6)), ("both", &rounded(&moved, 6))]
        {
            let ratio = visible(graph).count() as f64 / matrix.count() as f64;
            println!("{}: {what}: {ratio:.5} of the pairs", path.display());
            assert!((0.9995..1.005).contains(&ratio), "{}: {what}: {ratio}", path.display());
        }
    }
    let (broken, good) = broken(lines / 20, 99);
    println!("{good} planted chains, {broken} broken");
    assert_eq!(broken, 0, "planted chains of doors that are not seen through");
}

#[test]
fn stored_sets_say_what_the_matrix_says() {
    let graph = rooms(12, 2, 3);
    let matrix = visible(&graph);
    let stored = matrix.to_pvs(&graph).unwrap();
    // The matrix has a bit for each pair; the stored set is smaller because neighbouring rooms have similar
    // rows.
    assert!(stored.as_bytes().len() < matrix.to_bytes().len(), "{}", stored.as_bytes().len());
    let loaded = visibility_core::pvs::Pvs::from_bytes(stored.as_bytes()).unwrap();
    for (a, b) in (0..289).flat_map(|a| (0..289).map(move |b| (a, b))) {
        assert_eq!(loaded.sees(ViewcellId(a), b), matrix.sees(CellId(a), CellId(b)), "{a} {b}");
    }
}

/// The numbers of visible pairs are pinned, so that a change of the answers is noticed.
#[test]
fn the_answers_are_what_they_were() {
    let counts = [0, 1, 2, 3].map(|seed| visible(&rooms(8, 2, seed)).count());
    let quick = [0, 1, 2, 3].map(|seed| visible_by(&rooms(8, 2, seed), to_depth(QUICK_DEPTH)).count());
    assert_eq!(quick, [6028, 4278, 5586, 5280], "pairs of the preview by seed");
    assert_eq!(counts, [4542, 3520, 4382, 4104], "pairs by seed");
    let exact = [0, 1, 2, 3].map(|seed| {
        let outcome = bake(&rooms(8, 2, seed), exact(), 1, |_| {}).unwrap().outcome;
        (outcome.matrix.count(), outcome.rejected)
    });
    assert_eq!(exact, [(4524, 26), (3514, 9), (4380, 8), (4100, 9)], "pairs and rejections by seed, exactly");
}

#[test]
fn any_number_of_threads_gives_the_same_answer() {
    let graph = rooms(7, 2, 5);
    for settings in [BakerSettings::default(), exact(), to_depth(QUICK_DEPTH)] {
        let [one, three] = [1, 3].map(|threads| bake(&graph, settings, threads, |_| {}).unwrap().outcome);
        assert_eq!(one, three, "{settings:?}: by one thread and by three");
    }
}

#[test]
fn a_limit_and_a_stop_show_more_never_less_and_say_so() {
    let graph = rooms(6, 2, 4);
    let matrix = visible(&graph);
    let settings = BakerSettings::default().with_steps_per_cell(30);
    let limited = bake(&graph, settings, 1, |_| {}).unwrap().outcome;
    assert!(
        limited.complete && !limited.fallbacks.is_empty(),
        "the limited bake is complete, and falls back"
    );
    let baker = visibility_portals::CellBaker::new(&graph, BakerSettings::default()).unwrap();
    let mut stopped = visibility_core::bake::Bake::new(baker);
    let nothing = stopped.clone().finish();
    assert!(!nothing.complete, "a bake that was not begun is not complete");
    for _ in 0..5 {
        stopped.advance();
    }
    let resumed = stopped.clone();
    let stopped = stopped.finish();
    for cell in (0..72).map(CellId) {
        for seen in matrix.seen_from(cell) {
            assert!(
                limited.matrix.sees(cell, seen)
                    && stopped.matrix.sees(cell, seen)
                    && nothing.matrix.sees(cell, seen),
                "{cell:?} sees {seen:?} less with a limit or a stop"
            );
        }
    }
    assert!(
        limited.matrix.count() > matrix.count() && limited.matrix.is_symmetric(),
        "the limit shows more, both ways"
    );
    assert!(
        !stopped.complete && stopped.matrix.count() > matrix.count(),
        "the stop shows more, and is not complete"
    );
    let mut resumed = resumed;
    while resumed.advance().is_some() {}
    assert_eq!(resumed.finish().matrix, matrix, "the resumed bake has the whole result");
}
