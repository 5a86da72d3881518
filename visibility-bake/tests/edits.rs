//! A bake of an edited level with the cached results of the bake before gives the same bytes as a bake
//! without, and works on fewer viewcells.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;
use visibility_bake::{BakeCache, Grid, SandwichBaker, SandwichOutcome, SandwichSettings, Shard};
use visibility_core::bake::Bake;
use visibility_core::binary_format::FormatError;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::occlusion::Preparation;
use visibility_core::pvs::Viewcells;
use visibility_core::scene::Triangle;
use visibility_core::{Aabb, Object, Scene};
use visibility_testing::Random;

/// A box of the level: least corner, greatest corner, whether it occludes, and its cost.
type Brick = ([f32; 3], [f32; 3], bool, u32);

fn sides(bounds: &Aabb) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for plane in [bounds.min[axis], bounds.max[axis]] {
            let side: Vec<Vec3> =
                bounds.corners().into_iter().filter(|corner| corner[axis] == plane).collect();
            triangles.push([side[0], side[1], side[2]]);
            triangles.push([side[1], side[2], side[3]]);
        }
    }
    triangles
}

fn insert(scene: &mut Scene, bricks: &[Brick]) {
    for &(min, max, occluder, cost) in bricks {
        let bounds = Aabb::from_arrays(min, max);
        let id = scene.insert(Object { occluder, cost, ..Object::new(bounds) });
        scene.set_triangles(id, sides(&bounds)).unwrap();
    }
}

fn scene(bricks: &[Brick]) -> Scene {
    let mut scene = Scene::new();
    insert(&mut scene, bricks);
    scene.prepare_occluders(&Default::default());
    scene
}

fn brick(random: &mut Random) -> Brick {
    let mut number = |low: f64, high: f64| (low + (high - low) * random.unit()) as f32;
    let at = [number(1.0, 78.0), number(-18.0, 18.0), 0.0];
    (at, [at[0] + 1.0, at[1] + 1.0, number(0.5, 3.0)], random.one_in(2), 1 + random.below(20) as u32)
}

/// Makes four courts along a street, each 20 m long, with high walls between them and a few houses and bricks
/// in each. The first bricks are the walls.
fn level(random: &mut Random) -> Vec<Brick> {
    let wall = |x: f32| ([x, -200.0, -1.0], [x + 0.3, 200.0, 60.0], true, 12);
    let mut bricks: Vec<Brick> = [-0.5, 19.8, 39.8, 59.8, 80.2].map(wall).into();
    for i in 0..8 {
        for y in [-10.0f32, 10.0] {
            let x = i as f32 * 10.0 + 1.0;
            let end = x + 5.0 + 2.5 * random.unit() as f32;
            bricks.push(([x, y - 4.0, 0.0], [end, y + 4.0, 5.0 + 3.0 * random.unit() as f32], true, 12));
        }
    }
    bricks.extend((0..24).map(|_| brick(random)));
    bricks
}

/// Returns viewcells of 4 m along the street, shifted across it by `by` metres.
fn viewcells(by: f64) -> Viewcells {
    let grid = Grid::new(DVec3::new(0.0, by - 2.0, 1.0), DVec3::new(4.0, 4.0, 1.0)).unwrap();
    Viewcells::new(grid.over(DVec3::new(0.0, by - 2.0, 1.0), DVec3::new(80.0, by + 2.0, 2.0)).unwrap())
}

fn baked(
    scene: &Scene,
    cells: &Viewcells,
    settings: SandwichSettings,
    cache: &Arc<BakeCache>,
) -> SandwichOutcome {
    Bake::new(SandwichBaker::new(scene, cells, settings).with_cache(cache.clone())).run()
}

#[test]
fn an_edited_level_has_the_bytes_of_a_whole_bake() {
    let mut random = Random(31);
    let mut bricks = level(&mut random);
    let mut gap = 0.1;
    let mut settings = SandwichSettings::default().with_gap(gap).with_rays(4);
    let mut cells = viewcells(0.0);
    let none = Arc::new(BakeCache::default());
    let mut cache = none.clone();
    let mut reused = Vec::new();
    for round in 0..24 {
        match round % 8 {
            0 => {}
            1 | 2 => {
                let at = 5 + random.below(bricks.len() - 5);
                bricks[at] = brick(&mut random);
            }
            3 => bricks.insert(5 + random.below(20), brick(&mut random)),
            4 => drop(bricks.remove(5 + random.below(bricks.len() - 5))),
            5 => {
                let at = 5 + random.below(bricks.len() - 8);
                bricks[at].2 = !bricks[at].2;
                bricks[at + 1].3 += 40;
                bricks[at + 2].1[2] += 1.0;
            }
            6 => {
                gap = if gap > 0.15 { 0.1 } else { 0.2 };
                settings = settings.with_gap(gap);
            }
            _ => cells = viewcells(if cells.cells()[0].min.y == -2.0 { 0.01 } else { 0.0 }),
        }
        let mut scene = scene(&bricks);
        if (2..7).contains(&(round % 8)) {
            // A hole in a house, whose bounds stay the same.
            let id = scene.id_at(9).unwrap();
            let rest = scene.triangles(id).unwrap().to_vec().split_off(4);
            scene.set_triangles(id, rest).unwrap();
            scene.prepare_occluders(&Default::default());
        }
        let [whole, partly] = [&none, &cache].map(|cache| baked(&scene, &cells, settings, cache));
        assert_eq!(whole.reused, 0, "round {round}: a bake without a cache reuses nothing");
        let of = |outcome: &SandwichOutcome| Shard::new(0, outcome.clone()).to_bytes();
        assert!(of(&whole) == of(&partly), "round {round}: other bytes");
        assert!(whole.cache == partly.cache, "round {round}: another cache");
        reused.push(partly.reused);
        cache = Arc::new(BakeCache::from_bytes(&partly.cache.to_bytes()).unwrap());
        assert!(*cache == partly.cache, "round {round}: the cache as written");
    }
    // In these rounds the settings of an earlier round return, but objects have moved since.
    for round in [0, 6, 7, 14, 15, 22, 23] {
        assert_eq!(reused[round], 0, "round {round} of {reused:?}");
    }
    assert_eq!([reused[8], reused[16]], [20, 20], "all, as nothing has changed: {reused:?}");
    let edits: usize = (0..24).filter(|round| (1..6).contains(&(round % 8))).map(|round| reused[round]).sum();
    assert!(edits > 50, "{reused:?}");
}

#[test]
fn what_moves_where_it_is_hidden_costs_sweeps_alone() {
    let mut bricks = level(&mut Random(8));
    // The new brick is inside a house.
    bricks.push(([3.0, -11.0, 1.0], [4.0, -10.0, 2.0], true, 12));
    let (cells, settings) = (viewcells(0.0), SandwichSettings::default().with_rays(4));
    let before = Bake::new(SandwichBaker::new(&scene(&bricks), &cells, settings)).run();
    bricks.last_mut().unwrap().1 = [4.5, -9.0, 3.0];
    let after = baked(&scene(&bricks), &cells, settings, &Arc::new(before.cache.clone()));
    // From a few viewcells the sweep does not find the new brick hidden, though rays do not reach it either.
    assert!(after.reused >= 15, "{} of 20", after.reused);
    let seen = |outcome: &SandwichOutcome| -> Vec<Vec<u32>> {
        outcome.cells.iter().map(|cell| cell.seen.clone()).collect()
    };
    assert_eq!(seen(&after), seen(&before), "objects seen by viewcell, after a move out of sight");
    // A new first object, in another house, changes the numbers of all other objects.
    bricks.insert(0, ([3.0, 9.0, 1.0], [4.0, 10.0, 2.0], true, 12));
    let renumbered = baked(&scene(&bricks), &cells, settings, &Arc::new(after.cache.clone()));
    assert!(renumbered.reused >= 15, "{} of 20", renumbered.reused);
    let moved: Vec<Vec<u32>> =
        seen(&after).iter().map(|row| row.iter().map(|index| index + 1).collect()).collect();
    assert_eq!(seen(&renumbered), moved, "objects seen by viewcell, with new numbers");
}

#[test]
fn a_level_of_many_tiles_has_the_bytes_of_a_whole_bake() {
    let mut random = Random(52);
    // A field of bricks behind the last wall, listed first, and then the street.
    let mut bricks: Vec<Brick> = (0..18_000)
        .map(|i| {
            let at = [100.0 + (i / 48) as f32 * 3.5, (i % 48) as f32 * 3.5 - 84.0, 0.0];
            (at, [at[0] + 2.0, at[1] + 2.0, 0.5 + 3.0 * random.unit() as f32], true, 12)
        })
        .collect();
    let street = bricks.len();
    bricks.extend(level(&mut random));
    let (cells, settings) = (viewcells(0.0), SandwichSettings::default().with_rays(4).with_gap(0.3));
    let none = Arc::new(BakeCache::default());
    let mut cache = none.clone();
    let mut reused = Vec::new();
    for round in 0..5 {
        match round {
            0 => {}
            // Behind the wall, a brick moves, or is removed, which changes the numbers of all later objects.
            1 => bricks[9_000].1[2] += 2.0,
            2 => drop(bricks.remove(9_000)),
            // In the street, a brick is replaced, or a wall becomes low.
            3 => bricks[street + 30] = brick(&mut random),
            _ => bricks[street + 3].1[2] = 2.0,
        }
        let mut scene = Scene::new();
        insert(&mut scene, &bricks);
        // Each wall hides objects by itself, whatever the winding of its triangles.
        scene.prepare_occluders(&Preparation::default().with_two_sided(true));
        let [whole, partly] = [&none, &cache].map(|cache| baked(&scene, &cells, settings, cache));
        let of = |outcome: &SandwichOutcome| Shard::new(0, outcome.clone()).to_bytes();
        assert!(of(&whole) == of(&partly), "round {round}: other bytes");
        assert!(whole.cache == partly.cache, "round {round}: another cache");
        reused.push(partly.reused);
        cache = Arc::new(BakeCache::from_bytes(&partly.cache.to_bytes()).unwrap());
    }
    assert_eq!(reused[..3], [0, 20, 20], "viewcells reused in the first rounds: {reused:?}");
    assert!((5..20).contains(&reused[3]) && reused[4] < 20, "{reused:?}");
}

#[test]
fn a_resumed_bake_keeps_to_the_sweep_that_its_group_began_with() {
    let mut scene = scene(&level(&mut Random(53)));
    // The last wall hides an object of 2^18 triangles, so the level is heavy enough for several tiles.
    let heap = [Vec3::ZERO, Vec3::Y, Vec3::Z].map(|corner| corner + Vec3::X * 90.0);
    let id = scene.insert(Aabb::from_points(heap));
    scene.set_triangles(id, vec![heap; 1 << 18]).unwrap();
    let (cells, settings) = (viewcells(0.0), SandwichSettings::default().with_rays(1).with_gap(1.0));
    let baker = || SandwichBaker::new(&scene, &cells, settings);
    // No clock runs, so the limit of time has one effect only: all tiles of a group are swept at once.
    let limited = || baker().with_time(Duration::from_secs(1000));
    let cache = Bake::new(baker()).run().cache;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let outcome = pool.install(|| {
        let (mut begun, asked) = (Bake::new(limited()), AtomicUsize::new(0));
        begun.advance_unless(|| asked.fetch_add(1, Ordering::Relaxed) >= 2, || false);
        assert_eq!(begun.progress().done, 2, "viewcells of the first group that are through with its sweep");
        let mut resumed = Bake::resume(limited().with_cache(cache), &begun.save()).unwrap();
        resumed.advance();
        Bake::resume(limited(), &resumed.save()).unwrap().run()
    });
    assert_eq!(outcome.reused, 10, "viewcells of the second group, whose results are all from the cache");
    let again = Bake::new(limited().with_cache(outcome.cache)).run();
    assert_eq!(again.reused, 20, "viewcells with results from the cache of the resumed bake");
    assert_eq!(again.cells, outcome.cells, "rows from the cache of the resumed bake");
}

#[test]
fn damaged_caches_are_refused_and_forged_ones_do_not_panic() {
    let (scene, cells) = (scene(&level(&mut Random(8))[..20]), viewcells(0.0));
    let settings = SandwichSettings::default().with_rays(4);
    let bytes = Bake::new(SandwichBaker::new(&scene, &cells, settings)).run().cache.to_bytes();
    for at in 0..bytes.len() {
        assert!(BakeCache::from_bytes(&bytes[..at]).is_err(), "{at} bytes");
        let mut damaged = bytes.clone();
        damaged[at] ^= 4;
        assert!(BakeCache::from_bytes(&damaged).is_err(), "byte {at}");
    }
    let mut accepted = 0;
    for at in 44..bytes.len() {
        let mut forged = bytes.clone();
        forged[at] = 0xee;
        let sum = forged[..32].iter().chain(&forged[40..]).fold(0xcbf2_9ce4_8422_2325_u64, |sum, &byte| {
            (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
        forged[32..40].copy_from_slice(&sum.to_le_bytes());
        match BakeCache::from_bytes(&forged) {
            Ok(cache) => {
                accepted += 1;
                if accepted % 4 == 0 {
                    baked(&scene, &cells, settings, &Arc::new(cache));
                }
            }
            Err(error) => assert!(matches!(error, FormatError::Content { .. }), "{error}"),
        }
    }
    assert!(accepted > 30 && accepted * 2 < bytes.len(), "{accepted} of {}", bytes.len());
}
