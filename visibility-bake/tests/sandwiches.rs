//! Tests of the bake: answers are compared with independent rays; bytes are the same in shards, on threads
//! and after stops; gaps are met; damaged files are refused.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;
use visibility_bake::{
    AssembleError, BakeCache, BakedSet, BakedSetError, CellSandwich, Grid, MethodTimes, SandwichBaker,
    SandwichOutcome, SandwichSettings, Shard, assemble,
};
use visibility_core::bake::Bake;
use visibility_core::glam::{DAffine3, DVec3, Vec3};
use visibility_core::pvs::{PvsCuller, Viewcell, Viewcells};
use visibility_core::scene::{SharedTriangles, Triangle};
use visibility_core::{Aabb, Culler, Object, Pose, Scene, View, VisibleSet};
use visibility_testing::{NOT_ALWAYS_DRAWN, Random, is_clear};

/// Makes a street with houses on both sides, and small boxes between and behind them.
pub(crate) fn street() -> (Scene, Viewcells) {
    let mut random = Random(5);
    let mut scene = Scene::new();
    let mut number = |low: f64, high: f64| (low + (high - low) * random.unit()) as f32;
    for i in 0..8 {
        for side in [-1.0, 1.0] {
            let (x, y) = (i as f32 * 10.0, side * 12.0);
            insert(&mut scene, [x, y - 4.0, 0.0], [x + number(7.0, 10.0), y + 4.0, number(5.0, 9.0)], true);
        }
    }
    for _ in 0..60 {
        let corner = [number(-10.0, 90.0), number(-40.0, 40.0), 0.0];
        insert(&mut scene, corner, [corner[0] + 1.0, corner[1] + 1.0, number(0.5, 2.0)], false);
    }
    scene.prepare_occluders(&Default::default());
    let grid = Grid::new(DVec3::new(0.0, -2.0, 1.0), DVec3::new(8.0, 4.0, 1.0)).unwrap();
    let cells = grid.over(DVec3::new(0.0, -2.0, 1.0), DVec3::new(80.0, 2.0, 2.0)).unwrap();
    assert_eq!(cells.len(), 10, "viewcells along the street");
    (scene, Viewcells::new(cells))
}

fn insert(scene: &mut Scene, min: [f32; 3], max: [f32; 3], occluder: bool) {
    let bounds = Aabb::from_arrays(min, max);
    let corner = bounds.corners();
    // Each side has two triangles, between the box corners in the plane of that side.
    let mut triangles: Vec<Triangle> = Vec::new();
    for axis in 0..3 {
        for plane in [bounds.min[axis], bounds.max[axis]] {
            let side: Vec<Vec3> = corner.iter().copied().filter(|corner| corner[axis] == plane).collect();
            triangles.push([side[0], side[1], side[2]]);
            triangles.push([side[1], side[2], side[3]]);
        }
    }
    let id = scene.insert(Object { occluder, cost: 12, ..Object::new(bounds) });
    scene.set_triangles(id, triangles).unwrap();
}

fn baked(scene: &Scene, cells: &Viewcells, settings: SandwichSettings) -> Vec<CellSandwich> {
    Bake::new(SandwichBaker::new(scene, cells, settings)).run().cells
}

#[test]
fn no_object_that_a_ray_reaches_is_left_out_and_few_are_reported() {
    let (scene, cells) = street();
    let found = baked(&scene, &cells, SandwichSettings::default().with_gap(0.0));
    let mut random = Random(9);
    let mut hidden = 0;
    for (cell, sandwich) in cells.cells().iter().zip(&found) {
        let reported = sandwich.reported();
        let total = reported.len() + (sandwich.swept + sandwich.proven) as usize;
        assert_eq!(total, scene.len(), "every object is seen, open, swept away or proven hidden");
        hidden += scene.len() - reported.len();
        for id in scene.ids().filter(|id| reported.binary_search(&(id.index() as u32)).is_err()) {
            let bounds = scene.bounds(id).unwrap();
            let mut between =
                |a: DVec3, b: DVec3| a + (b - a) * DVec3::from_array([(); 3].map(|()| random.unit()));
            for _ in 0..400 {
                let from = between(cell.min, cell.max);
                let to = between(bounds.min.as_dvec3(), bounds.max.as_dvec3());
                assert!(!is_clear(&scene, from, to, id.index()), "{id} is seen from {from} at {to}");
            }
        }
    }
    assert!(hidden > 10 * 30, "{hidden} of {}", 10 * scene.len());
    let open: usize = found.iter().map(|cell| cell.open.len()).sum();
    assert!(open <= 5, "{open} open");
}

#[test]
fn a_gap_saves_work_and_is_met() {
    let (scene, cells) = street();
    let all = baked(&scene, &cells, SandwichSettings::default().with_gap(0.0).with_rays(2));
    let some = baked(&scene, &cells, SandwichSettings::default().with_gap(0.3).with_rays(2));
    let none = baked(&scene, &cells, SandwichSettings::default().with_gap(1.0).with_rays(2));
    let steps = |cells: &[CellSandwich]| cells.iter().map(|cell| cell.steps).sum::<u64>();
    assert!(steps(&none) < steps(&some) && steps(&some) < steps(&all), "a greater gap takes fewer steps");
    for ((some, none), all) in some.iter().zip(&none).zip(&all) {
        // All objects except those on the ground have a cost of 12.
        let gap = some.open.len() as f64 / (some.seen.len() + some.open.len()) as f64;
        assert!(gap <= 0.3 || some.open.iter().all(|index| all.open.contains(index)), "{gap}");
        assert_eq!(none.proven, 0, "a gap of 1 needs no proofs");
        let is_within = |inner: &CellSandwich, outer: &CellSandwich| {
            inner.reported().iter().all(|index| outer.reported().contains(index))
        };
        assert!(
            is_within(all, some) && is_within(some, none),
            "a greater gap reports what a smaller one does"
        );
    }
}

#[test]
fn times_of_methods_outlast_a_stop_and_change_no_byte() {
    // A clock that advances by one second more at each call.
    static ASKED: AtomicU64 = AtomicU64::new(0);
    fn clock() -> Duration {
        let asked = ASKED.fetch_add(1, Ordering::Relaxed);
        Duration::from_secs(asked * (asked + 1) / 2)
    }
    let (scene, cells) = street();
    let baker = || SandwichBaker::new(&scene, &cells, SandwichSettings::default());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let outcome = pool.install(|| {
        let mut bake = Bake::new(baker().with_clock(clock));
        let begun = AtomicUsize::new(0);
        bake.advance_unless(|| begun.fetch_add(1, Ordering::Relaxed) == 4, || false);
        let bake = Bake::resume(baker().with_clock(clock), &bake.save()).unwrap();
        assert_eq!(bake.progress().done, 4, "viewcells swept before the stop");
        bake.run()
    });
    // For each viewcell the clock is called twice for the sweep of its group, twice for its own sweep, three
    // times for rays and twice for proofs of boxes. The gap is then met.
    let seconds = |of: fn(&MethodTimes) -> Duration| {
        let mut seconds: Vec<u64> = outcome.times.iter().map(|times| of(times).as_secs()).collect();
        seconds.sort_unstable();
        seconds
    };
    let expected = |first: u64, step: u64| (0..10).map(|i| first + step * i).collect::<Vec<_>>();
    assert_eq!(seconds(|times| times.sweep), expected(22, 4), "seconds of sweeps");
    assert_eq!(seconds(|times| times.rays), expected(41, 3), "seconds of rays");
    assert_eq!(seconds(|times| times.proofs), expected(113, 5), "seconds of proofs");
    let sum: MethodTimes = outcome.times.iter().sum();
    assert_eq!((sum.sweep.as_secs(), sum.total().as_secs()), (400, 2300), "seconds of sweeps, and in all");
    let shard = Shard::new(baker().whole_fingerprint(), outcome);
    assert_eq!(
        shard.to_bytes(),
        Shard::bake(baker()).to_bytes(),
        "the shard has the bytes of one without a clock"
    );
}

#[test]
fn shards_threads_and_stops_give_the_same_bytes() {
    let (scene, cells) = street();
    let settings = SandwichSettings::default().with_gap(0.0);
    let baker = || SandwichBaker::new(&scene, &cells, settings);
    let whole = Shard::bake(baker()).to_bytes();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| Shard::bake(baker())).to_bytes(), whole, "{threads} threads");
    }
    // The bake is stopped after one to three viewcells of each round, and resumed.
    let mut state = Bake::new(baker()).save();
    for stop in 0.. {
        let mut bake = Bake::resume(baker(), &state).unwrap();
        let (asked, before) = (AtomicUsize::new(0), bake.progress().done);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let pause = || asked.fetch_add(1, Ordering::Relaxed) > stop % 3;
        let now = pool.install(|| bake.advance_unless(pause, || false));
        assert!(
            now.is_none_or(|now| now.done <= before + 1 + stop % 3),
            "stop {stop}: at most {} viewcells are done",
            before + 1 + stop % 3
        );
        if now.is_none() {
            let shard = Shard::new(bake.baker().whole_fingerprint(), bake.finish());
            assert_eq!(shard.to_bytes(), whole, "stop {stop}: the resumed bake has the same bytes");
            break;
        }
        state = bake.save();
    }
    // Shards are in arbitrary order, and one is given twice.
    let part = |range| Shard::from_bytes(&Shard::bake(baker().with_range(range)).to_bytes()).unwrap();
    let shards = [part(7..99), part(0..4), part(3..8), part(0..4)];
    let assembled = assemble(&baker(), shards.clone()).unwrap();
    assert_eq!(assembled, Shard::from_bytes(&whole).unwrap().cells, "rows put together from four shards");

    let [last, first, ..] = shards.clone();
    assert_eq!(
        assemble(&baker(), [first.clone(), last.clone()]),
        Err(AssembleError::Missing(4, 7)),
        "viewcells 4 to 6 are missing"
    );
    // The range of the baker does not count.
    let part = assemble(&baker().with_range(3..5), [first.clone()]);
    assert_eq!(part, Err(AssembleError::Missing(4, 10)), "viewcells of no shard");
    assert_eq!(assemble(&baker(), []), Err(AssembleError::Missing(0, 10)), "no shards");
    let none = Viewcells::new([]);
    let nothing = SandwichBaker::new(&scene, &none, SandwichSettings::default());
    assert_eq!(assemble(&nothing, []), Ok(vec![]), "no viewcells");
    for forged in [8, usize::MAX] {
        let beyond = Shard { first: forged, ..last.clone() };
        assert_eq!(assemble(&baker(), [beyond]), Err(AssembleError::Range(0)), "viewcells from {forged} on");
    }
    let other = Shard::bake(SandwichBaker::new(&scene, &cells, SandwichSettings::default()).with_range(0..1));
    assert_eq!(
        assemble(&baker(), [first.clone(), other]),
        Err(AssembleError::OtherBake(1)),
        "a shard of another bake"
    );
    let mut wrong = first.clone();
    wrong.cells[2].seen.pop();
    assert_eq!(
        assemble(&baker(), [first, wrong]),
        Err(AssembleError::Contradiction(1)),
        "a shard that contradicts another"
    );
}

#[test]
fn a_viewcell_that_is_given_up_is_open_and_worked_on_again() {
    let (scene, cells) = street();
    let settings = SandwichSettings::default().with_gap(0.0).with_rays(20);
    let baker = || SandwichBaker::new(&scene, &cells, settings);
    let whole = Shard::bake(baker()).to_bytes();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let asked = AtomicUsize::new(0);
    let count = |_: ()| asked.fetch_add(1, Ordering::Relaxed);
    // After these two rounds, all groups and all viewcells are swept.
    let mut first = Bake::new(baker());
    for done in [10, 20] {
        pool.install(|| first.advance_unless(|| false, || count(()) == usize::MAX));
        assert_eq!(
            (first.progress().done, first.progress().steps),
            (done, 0),
            "viewcells done, and steps of searches"
        );
    }
    let mut all = Bake::resume(baker(), &first.save()).unwrap();
    asked.store(0, Ordering::Relaxed);
    pool.install(|| all.advance_unless(|| false, || count(()) == usize::MAX));
    let (all, steps) = (asked.swap(0, Ordering::Relaxed), all.progress().steps);
    assert!(all as u64 * 40 > steps, "{all} times asked in {steps} steps");
    // The bake is stopped at the given call of the stop function, in the middle of a viewcell.
    for most in [1, 2, 3, all / 7, all / 3, all / 2, all / 10 * 9] {
        let mut bake = Bake::resume(baker(), &first.save()).unwrap();
        asked.store(0, Ordering::Relaxed);
        let now = pool.install(|| bake.advance_unless(|| false, || count(()) >= most)).unwrap();
        let after = asked.load(Ordering::Relaxed) - most;
        assert!(after <= 3, "goes on to ask {after} times");
        assert!(now.done < 30 && (most < all / 2 || now.done > 22), "{} done", now.done);
        let state = bake.save();
        let outcome = bake.finish();
        assert!(!outcome.complete, "most {most}: the bake is not complete");
        let searched = outcome.cells.iter().filter(|cell| cell.steps > 0);
        assert_eq!(searched.count(), now.done - 20, "most {most}: viewcells searched");
        let resumed = Bake::resume(baker(), &state).unwrap().run();
        assert_eq!(
            Shard::new(baker().whole_fingerprint(), resumed).to_bytes(),
            whole,
            "most {most}: the resumed bake has the same bytes"
        );
    }
}

#[test]
fn an_unfinished_bake_reports_all_that_is_not_hidden_yet() {
    let (scene, cells) = street();
    let baker = || SandwichBaker::new(&scene, &cells, SandwichSettings::default());
    let none = Bake::new(baker()).finish();
    assert!(!none.complete, "a bake that was not begun is not complete");
    assert!(
        none.cells.iter().all(|cell| cell.reported().len() == scene.len()),
        "a bake that was not begun hides an object"
    );
    let shared = &none.cells[0].open;
    assert!(none.cells.iter().all(|cell| std::sync::Arc::ptr_eq(&cell.open, shared)), "one list for all");
    let rows: Vec<_> = none.cells.iter().map(|cell| cell.reported()).collect();
    assert!(rows.iter().all(|row| row.as_ptr() == shared.as_ptr()), "no copies of the list");
    // All groups are swept before the first viewcell, and all viewcells before the first search.
    let mut bake = Bake::new(baker());
    bake.advance();
    let of_groups = Bake::resume(baker(), &bake.save()).unwrap().finish();
    bake.advance();
    let swept = Bake::resume(baker(), &bake.save()).unwrap().finish();
    assert!(
        !swept.complete && swept.cache == BakeCache::default(),
        "a swept bake is not complete, and has no cache"
    );
    let whole = bake.run();
    for (group, swept) in of_groups.cells.iter().zip(&swept.cells) {
        assert!(
            group.swept <= swept.swept && swept.open.iter().all(|index| group.open.contains(index)),
            "the sweep of a viewcell hides what that of its group hides"
        );
    }
    assert_eq!(
        (of_groups.stages, swept.stages),
        ([10, 0, 0, 0, 0], [10, 10, 0, 0, 0]),
        "viewcells by stage, after groups and after sweeps"
    );
    for (swept, whole) in swept.cells.iter().zip(&whole.cells) {
        assert!(swept.swept > 0 && swept.swept == whole.swept, "objects hidden by the sweep");
        assert!(
            swept.seen.is_empty() && swept.open.len() as u32 + swept.swept == scene.len() as u32,
            "what is not hidden by the sweep is open"
        );
        assert!(
            whole.reported().iter().all(|index| swept.open.contains(index)),
            "the searched viewcell reports what the sweep has hidden"
        );
    }
}

#[test]
fn little_time_is_divided_among_the_stages() {
    // A clock that advances by a millisecond at each call: once for each plane of a sweep.
    static ASKED: AtomicU64 = AtomicU64::new(0);
    fn clock() -> Duration {
        Duration::from_millis(ASKED.fetch_add(1, Ordering::Relaxed))
    }
    let (scene, cells) = street();
    let baker = || SandwichBaker::new(&scene, &cells, SandwichSettings::default());
    let whole = Bake::new(baker()).run();
    assert_eq!((whole.stages, whole.cut), ([10; 5], 0), "viewcells by stage of a whole bake, and those cut");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let timed = |time: u64, until: u64| {
        ASKED.store(0, Ordering::Relaxed);
        let mut bake = Bake::new(baker().with_clock(clock).with_time(Duration::from_millis(time)));
        let is_over = || ASKED.load(Ordering::Relaxed) >= until;
        pool.install(|| while !is_over() && bake.advance_unless(is_over, || false).is_some() {});
        bake.finish()
    };
    // Groups come first, then viewcells, and then searches in the remaining time.
    let [groups, swept, ..] = timed(100, 95).stages;
    assert!(0 < groups && groups < 10 && swept < 10, "{groups} groups, {swept} swept");
    let [groups, swept, seen, ..] = timed(3000, 2990).stages;
    assert!(
        (groups, swept) == (10, 10) && 0 < seen && seen < 10,
        "{groups} groups, {swept} swept, {seen} seen"
    );
    // Time that is left at the end is used for items that were put off, but not for sweeps that ended early.
    let late = timed(50, u64::MAX);
    assert!(late.complete && late.stages[2..] == [10; 3], "{:?}", late.stages);
    let found = late.cells.iter().zip(&whole.cells).filter(|(late, whole)| late.swept == whole.swept).count();
    assert!(late.stages[0] < 10 && late.stages[1] < 10 && found < 10, "{:?}, {found} swept", late.stages);
    for (late, whole) in late.cells.iter().zip(&whole.cells) {
        assert!(whole.seen.iter().all(|index| late.reported().contains(index)), "a seen object is hidden");
    }
    // Results without sweeps must not be used by a bake that sweeps.
    let bytes = |outcome| Shard::new(0, outcome).to_bytes();
    assert!(
        bytes(Bake::new(baker().with_cache(late.cache)).run()) == bytes(whole),
        "a bake with the cache of a bake with little time"
    );
    // A group whose sweep ended early keeps that result if the bake is resumed before all its viewcells are
    // done.
    ASKED.store(0, Ordering::Relaxed);
    let mut bake = Bake::new(baker().with_clock(clock).with_time(Duration::from_millis(20)));
    bake.advance_unless(|| ASKED.load(Ordering::Relaxed) > 10, || false);
    let resumed = Bake::resume(baker(), &bake.save()).unwrap().run();
    assert!(resumed.complete && resumed.stages[0] < 10, "{:?}", resumed.stages);
    assert!(
        resumed.stages[1..] == [10; 4] && resumed.cache == BakeCache::default(),
        "all stages but that of groups are complete, and nothing is cached"
    );
}

/// The time for sweeps of groups ends between two viewcells of a group, which are then in different stages.
#[test]
fn no_stage_takes_what_another_has_made_for_a_group() {
    // A clock that advances by a millisecond at each call.
    static ASKED: AtomicU64 = AtomicU64::new(0);
    fn clock() -> Duration {
        Duration::from_millis(ASKED.fetch_add(1, Ordering::Relaxed))
    }
    let (scene, cells) = street();
    let settings = SandwichSettings::default().with_gap(1.0).with_rays(1);
    let baker = || SandwichBaker::new(&scene, &cells, settings);
    let limited = |limit: u64| {
        ASKED.store(0, Ordering::Relaxed);
        baker().with_clock(clock).with_time(Duration::from_millis(limit))
    };
    // Returns a stop function that lets a round begin at most `count` items.
    let at_most = |count: usize| {
        let begun = AtomicUsize::new(0);
        move || begun.fetch_add(1, Ordering::Relaxed) >= count
    };
    let is_looked_from = |outcome: &SandwichOutcome| {
        outcome.complete && outcome.times.iter().all(|times| !times.rays.is_zero())
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| {
        for limit in (89..125).step_by(5) {
            let outcome = Bake::new(limited(limit)).run();
            // In so little time no sweep of a viewcell is complete.
            assert!(is_looked_from(&outcome) && outcome.stages[1] == 0, "{limit} ms: {:?}", outcome.stages);
            // Therefore other bakes must not use what this bake finds when it continues without a limit.
            let mut bake = Bake::new(limited(limit));
            bake.advance();
            bake.advance_unless(at_most(1), || false);
            let resumed = Bake::resume(baker(), &bake.save()).unwrap().run();
            assert!(resumed.complete && resumed.cache == BakeCache::default(), "{limit} ms");
        }
        // When the bake is stopped, some viewcells have used the result of their group's sweep. The bake
        // continues when the time for groups is over.
        let mut bake = Bake::new(baker());
        bake.advance_unless(at_most(5), || false);
        let bake = Bake::resume(limited(1000), &bake.save()).unwrap();
        ASKED.store(750, Ordering::Relaxed);
        let outcome = bake.run();
        assert!(is_looked_from(&outcome), "{:?}", outcome.stages);
    });
}

#[test]
fn the_longest_time_leaves_nothing_out() {
    let (scene, cells) = street();
    let settings = SandwichSettings::default().with_gap(1.0).with_rays(1);
    let baker = || SandwichBaker::new(&scene, &cells, settings).with_range(0..2);
    let outcome = Bake::new(baker().with_time(Duration::MAX)).run();
    assert_eq!(
        (outcome.stages, outcome.complete),
        ([2; 5], true),
        "viewcells by stage, with the longest time"
    );
    assert_eq!(
        outcome.cells,
        Bake::new(baker()).run().cells,
        "rows with the longest time and without a limit"
    );
}

/// A field with so many triangles that no search could begin in its share of the time, behind a street in
/// which parts of each viewcell hide more objects than the whole; and open country, where groups hide
/// nothing.
#[test]
fn what_a_search_has_not_the_time_for_is_swept_in_parts() {
    let (mut scene, cells) = street();
    let field = (0..320).flat_map(|x| (0..320).map(move |y| Vec3::new(x as f32, y as f32, 0.0)));
    let field: Vec<Triangle> = field.map(|at| [at, at + Vec3::X * 0.5, at + Vec3::Y * 0.5]).collect();
    let field: Vec<Triangle> = field.iter().map(|t| t.map(|p| p * 0.1 - Vec3::Z)).collect();
    let id = scene.insert(Aabb::from_points(field.as_flattened().iter().copied()));
    scene.set_triangles(id, field).unwrap();
    let baker = || SandwichBaker::new(&scene, &cells, SandwichSettings::default()).with_range(0..2);
    let mut swept = Bake::new(baker());
    swept.advance();
    swept.advance();
    let swept = swept.finish();
    let limited = Bake::new(baker().with_time(Duration::from_millis(1))).run();
    assert!(limited.complete && limited.cache == BakeCache::default(), "the bake ends without a cache");
    assert_eq!((limited.cut, swept.cut), (2, 0), "viewcells in which the time cut a search short");
    let mut more = 0;
    for (limited, swept) in limited.cells.iter().zip(&swept.cells) {
        assert_eq!((limited.seen.len(), limited.proven, limited.steps), (0, 0, 0), "searched");
        assert!(limited.swept >= swept.swept, "sweeps of parts hide what a whole sweep hides");
        more += limited.swept - swept.swept;
    }
    assert!(more > 0, "sweeps of parts hide more");
    let seen = Bake::new(baker()).run();
    for (limited, seen) in limited.cells.iter().zip(&seen.cells) {
        assert!(seen.seen.iter().all(|index| limited.reported().contains(index)), "what is seen is reported");
    }
}

#[test]
fn groups_from_which_nothing_is_hidden_are_left_out() {
    let mut scene = Scene::new();
    for i in 0..40 {
        let x = i as f32 * 20.0;
        insert(&mut scene, [x, 50.0, 0.0], [x + 1.0, 51.0, 1.0], true);
    }
    scene.prepare_occluders(&Default::default());
    let grid = Grid::new(DVec3::ZERO, DVec3::new(8.0, 4.0, 1.0)).unwrap();
    let cells = Viewcells::new(grid.over(DVec3::ZERO, DVec3::new(799.0, 3.0, 1.0)).unwrap());
    let settings = SandwichSettings::default().with_gap(1.0).with_rays(1);
    let baker = || SandwichBaker::new(&scene, &cells, settings);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let outcome = pool.install(|| Bake::new(baker().with_time(Duration::from_secs(1))).run());
    // Four groups of 16 viewcells are swept before the others are skipped.
    assert_eq!(outcome.stages, [64, 100, 100, 100, 100], "viewcells by stage, after four groups were tried");
    let whole = Bake::new(baker()).run();
    assert_eq!(
        (whole.stages[0], whole.cells),
        (100, outcome.cells),
        "groups that were left out change no row"
    );
}

/// Copies of a mesh of 2^12 triangles. 2^9 copies have as many triangles as a search may copy.
#[test]
fn a_viewcell_that_sees_too_many_triangles_is_left_open() {
    let strip = |i: usize| {
        let corner = |x: usize, z: f32| Vec3::new(x as f32 * 1e-4, 0.0, z);
        [corner(i, 0.0), corner(i + 1, 0.0), corner(i, 1.0)]
    };
    let mesh = SharedTriangles::from((0..1 << 12).map(strip).collect::<Vec<Triangle>>());
    let bake = |copies: u32| {
        let mut scene = Scene::new();
        for i in 0..copies {
            let at = DVec3::new(f64::from(i % 32), 3.0 + f64::from(i / 32), 0.0);
            let placed = mesh.placed(DAffine3::from_translation(at));
            let id = scene.insert(placed.bounds());
            scene.set_triangles(id, placed).unwrap();
        }
        let cells = Viewcells::new(vec![Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
        Bake::new(SandwichBaker::new(&scene, &cells, SandwichSettings::default().with_rays(1))).run()
    };
    let outcome = bake((1 << 9) + 1);
    assert_eq!(
        (outcome.too_large, outcome.complete, outcome.cells[0].open.len()),
        (1, false, 513),
        "too many triangles: viewcells left open, and their objects"
    );
    let outcome = bake(1 << 9);
    assert_eq!((outcome.too_large, outcome.complete), (0, true), "just few enough triangles");
}

#[test]
fn what_is_never_culled_is_reported_from_everywhere() {
    let mut scene = Scene::new();
    // A wall, two boxes behind it, one of which moves, and an object with unknown bounds.
    insert(&mut scene, [5.0, -50.0, -50.0], [6.0, 50.0, 50.0], true);
    for y in [0.0, 3.0] {
        insert(&mut scene, [20.0, y, 0.0], [21.0, y + 1.0, 1.0], false);
    }
    scene.insert(Aabb::from_arrays([f32::NAN; 3], [1.0; 3]));
    scene.set_never_cull(scene.id_at(1).unwrap(), true).unwrap();
    // On the other side a lift, an occluder with infinite bounds at the same place, and a box behind them.
    insert(&mut scene, [-6.0, -50.0, -50.0], [-5.0, 50.0, 50.0], true);
    let lift = scene.id_at(4).unwrap();
    scene.set_never_cull(lift, true).unwrap();
    let anywhere = Aabb::new(Vec3::NEG_INFINITY, Vec3::INFINITY);
    let anywhere = scene.insert(Object { occluder: true, ..Object::new(anywhere) });
    let triangles: Vec<Triangle> = scene.triangles(lift).unwrap().iter().collect();
    scene.set_triangles(anywhere, triangles).unwrap();
    insert(&mut scene, [-21.0, 0.0, 0.0], [-20.0, 1.0, 1.0], false);
    scene.prepare_occluders(&Default::default());
    let grid = Grid::new(DVec3::ZERO, DVec3::splat(2.0)).unwrap();
    let cells = Viewcells::new(grid.over(DVec3::ZERO, DVec3::splat(4.0)).unwrap());
    for gap in [0.0, 1.0] {
        for cell in baked(&scene, &cells, SandwichSettings::default().with_gap(gap)) {
            assert_eq!(
                (cell.seen, &*cell.open),
                (vec![0, 1, 3, 4, 5, 6], &[][..]),
                "gap {gap}: the wall, what is never culled, and what it would hide"
            );
        }
    }
}

#[test]
fn files_are_read_for_their_scene_alone_and_damage_is_found() {
    let (mut scene, cells) = street();
    let found = baked(&scene, &cells, SandwichSettings::default());
    let rows: Vec<_> = found.iter().map(CellSandwich::reported).collect();
    let set = BakedSet::from_rows(&scene, cells, &rows).unwrap();
    let bytes = set.to_bytes();
    assert_eq!(BakedSet::from_bytes(&bytes), Ok(set.clone()), "the set from its bytes");
    for (number, row) in (0..).zip(&rows) {
        assert_eq!(
            set.row(visibility_core::pvs::ViewcellId(number))[..],
            row[..],
            "the row of viewcell {number}"
        );
    }
    assert!(set.clone().for_scene(&scene).is_ok(), "the set is for its scene");
    for at in 0..bytes.len() {
        assert!(BakedSet::from_bytes(&bytes[..at]).is_err(), "{at} bytes");
        let mut damaged = bytes.clone();
        damaged[at] ^= 4;
        assert!(BakedSet::from_bytes(&damaged).is_err(), "byte {at}");
    }
    let mut larger = scene.clone();
    larger.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
    assert!(
        matches!(set.clone().for_scene(&larger), Err(BakedSetError::OtherScene)),
        "a scene with an object more"
    );
    let first = scene.ids().next().unwrap();
    scene.set_bounds(first, Aabb::from_arrays([0.0; 3], [1.0; 3])).unwrap();
    assert!(matches!(set.for_scene(&scene), Err(BakedSetError::OtherScene)), "a scene with another box");
}

/// A set is used for a scene that has the objects in another order, several times and among other objects.
#[test]
fn sets_are_taken_for_objects_of_other_indices() {
    let (scene, cells) = street();
    let rows: Vec<Vec<u32>> =
        (0..cells.cells().len() as u32).map(|cell| (cell % 3..40).step_by(3).collect()).collect();
    let count = scene.len() as u32;
    let set = BakedSet::from_rows(&scene, cells.clone(), &rows).unwrap();
    assert_eq!(set.index_limit(), count as usize, "objects of the bake");
    let mut other = Scene::new();
    // The objects are in reverse order, each twice, and one that the bake does not know is among them.
    let objects: Vec<_> = (0..count)
        .rev()
        .map(|index| {
            let bounds = scene.bounds(scene.id_at(index as usize).unwrap()).unwrap();
            [Some(index), None, Some(index)].map(|index| (other.insert(bounds), index))
        })
        .collect();
    let objects: Vec<_> = objects.concat();
    let foreign = other.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
    let known = objects.iter().filter_map(|&(id, index)| Some((id, index?)));
    let sets = set.for_objects(&other, known.chain([(foreign, count)]));
    let mut culler = PvsCuller::new(&sets);
    for (cell, row) in cells.cells().iter().zip(&rows) {
        let eye = (cell.min + cell.max) * 0.5;
        let view =
            View::perspective(Pose::look_at(eye, eye + DVec3::X, DVec3::Z), 1.0, 1.0, 1e-3, 1e3).unwrap();
        let mut visible = VisibleSet::new();
        visible.fill(&other, &view);
        culler.cull(&other, &view, &mut visible);
        for &(id, index) in &objects {
            let is_seen = index.is_none_or(|index| row.contains(&index));
            assert_eq!(visible.contains(&other, id), is_seen, "{index:?}");
        }
        assert!(visible.contains(&other, foreign), "an index of no object");
    }

    let bounds = |scene: &Scene| -> Vec<(u32, Aabb)> {
        scene.ids().map(|id| (id.index() as u32, scene.bounds(id).unwrap())).collect()
    };
    let mut boxes = bounds(&scene);
    let compared = |origin, boxes: Vec<(u32, Aabb)>| set.clone().compared(None, origin, boxes).err();
    assert_eq!(compared(DVec3::ZERO, boxes.clone()), None, "boxes of the scene");
    assert_eq!(
        compared(DVec3::X, boxes.clone()),
        Some(BakedSetError::OtherScene),
        "boxes with another origin"
    );
    assert_eq!(
        compared(DVec3::ZERO, bounds(&other)),
        Some(BakedSetError::OtherScene),
        "boxes of another scene"
    );
    boxes[3].1.max.x += 1e-3;
    assert_eq!(compared(DVec3::ZERO, boxes), Some(BakedSetError::OtherScene), "a box 1 mm longer");
}

/// A house inside a block that is not drawn in every frame, and such a block inside a house.
#[test]
fn what_is_not_always_drawn_is_proven_to_hide_nothing() {
    let mut scene = Scene::new();
    insert(&mut scene, [10.0, -5.0, -5.0], [20.0, 5.0, 5.0], true);
    insert(&mut scene, [14.0, -1.0, -1.0], [16.0, 1.0, 1.0], true);
    scene.prepare_occluders(&Default::default());
    let cells = Viewcells::new([Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5))]);
    let reported = |scene: &Scene| baked(scene, &cells, SandwichSettings::default())[0].reported().to_vec();
    assert_eq!(reported(&scene), [0], "the block hides the house");
    for (way, set) in NOT_ALWAYS_DRAWN.into_iter().enumerate() {
        let mut scene = scene.clone();
        let block = scene.id_at(0).unwrap();
        set(&mut scene, block);
        assert!(reported(&scene).contains(&1), "way {way}: the block may be absent");
    }
}
