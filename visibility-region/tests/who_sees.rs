//! Movers in a scene see each other wherever a free segment connects them, both by a matrix of the scene and
//! by sets made online, while walls come and go.

use crate::common::World;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{Viewcell, Viewcells};
use visibility_core::who_sees::{Reach, ViewcellMatrix, WhoSees};
use visibility_core::{Aabb, ObjectId};
use visibility_region::{ExtendedProjectionCuller, OnlineCells, OnlinePvs};
use visibility_testing::{Random, judged, told_enough};

/// Number of viewcells along x and y, and their width in metres. Movers walk on them.
const CELLS: (i32, f64) = (6, 2.0);
const MOVERS: usize = 16;

/// Makes a world of walls that stand on the ground, relative to an origin.
fn walls(rng: &mut Random, origin: DVec3) -> (World, Vec<ObjectId>) {
    let mut world = World::new();
    world.scene.set_origin(origin).unwrap();
    let walls = (0..rng.between(8, 20)).map(|_| {
        let (along, at, from) = (rng.below(2), rng.range(0.0, 12.0), rng.range(-2.0, 6.0));
        let (mut min, mut max) = ([from as f32; 3], [from as f32 + rng.range(4.0, 10.0) as f32; 3]);
        (min[along], max[along]) = (at as f32, at as f32 + 0.1);
        (min[2], max[2]) = (-1.0, rng.pick(&[4.0, 9.0]));
        world.add_box(min, max)
    });
    let walls = walls.collect();
    (world, walls)
}

fn viewcells(origin: DVec3) -> Viewcells {
    let cells = (0..CELLS.0 * CELLS.0).map(|i| {
        let min = DVec3::new(f64::from(i % CELLS.0), f64::from(i / CELLS.0), 0.0) * CELLS.1;
        Viewcell::from_box(origin + min, origin + min + CELLS.1)
    });
    Viewcells::new(cells)
}

fn movers(rng: &mut Random, origin: DVec3) -> Vec<Reach> {
    let mover = |_| {
        let low = DVec3::new(rng.range(-0.2, 11.7), rng.range(-0.2, 11.7), 0.4);
        Reach::new(origin + low, origin + low + DVec3::new(0.4, 0.4, 1.2)).within(0.1, rng.range(0.0, 3.0))
    };
    (0..MOVERS).map(mover).collect()
}

/// Fails if a free segment connects an observer with a target that it does not see. Returns the number of
/// hidden pairs, and the number of free segments found.
fn judge(world: &World, origin: DVec3, movers: &[Reach], who: &WhoSees, rng: &mut Random) -> [usize; 2] {
    let (mut hidden, mut free) = (0, 0);
    for (a, b) in (0..MOVERS * MOVERS).map(|pair| (pair / MOVERS, pair % MOVERS)) {
        hidden += usize::from(!who.sees(a, b));
        for _ in 0..5 {
            let mut point = |mover: &Reach| {
                let unit = DVec3::from_array([0, 1, 2].map(|_| rng.unit()));
                let body = mover.min + (mover.max - mover.min) * unit.round();
                body - origin + rng.direction() * mover.margin * 0.999
            };
            let (from, to) = (point(&movers[a]), point(&movers[b]));
            if world.is_free(from, to) {
                free += 1;
                let at = |i: usize| (movers[i].min - origin, movers[i].margin);
                assert!(
                    who.sees(a, b),
                    "{to} of {:?} is seen from {from} of {:?}, but not told",
                    at(b),
                    at(a)
                );
            }
        }
    }
    [hidden, free]
}

fn search(seed: u64, worlds: usize) -> [usize; 4] {
    let mut rng = Random(seed);
    let mut sums = [0; 4];
    for _ in 0..worlds {
        let origin = rng.pick(&[DVec3::ZERO, DVec3::new(3e6, -5e6, 1e5)]);
        let (world, _) = walls(&mut rng, origin);
        let mut matrix =
            ViewcellMatrix::of_scene::<ExtendedProjectionCuller>(&world.scene, viewcells(origin));
        let mut who = WhoSees::new();
        for _ in 0..3 {
            let movers = movers(&mut rng, origin);
            who.look(&mut matrix, &movers, &movers);
            let found = judge(&world, origin, &movers, &who, &mut rng);
            (sums[0], sums[1]) = (sums[0] + found[0], sums[1] + found[1]);
        }

        let (mut world, mut left) = walls(&mut rng, origin);
        let cells = OnlineCells::new(&mut world.scene, viewcells(origin));
        let mut online = OnlinePvs::new(DVec3::splat(2.0), DVec3::new(4.0, 4.0, 2.0)).unwrap();
        let movers = movers(&mut rng, origin);
        let places: Vec<DVec3> = movers.iter().map(|mover| (mover.min + mover.max) * 0.5).collect();
        for tick in 0..4 {
            for _ in 0..rng.pick(&[50, 400]) {
                online.step(&world.scene, &places, u32::MAX);
            }
            // A wall vanishes between the steps and the test of visibility.
            if tick > 0 {
                let number = rng.below(left.len());
                world.scene.remove(left.remove(number)).unwrap();
                world.triangles.drain(12 * number..12 * (number + 1));
            }
            let seen = &mut cells.with(&world.scene, &mut online);
            who.look(seen, &movers, &movers);
            let found = judge(&world, origin, &movers, &who, &mut rng);
            (sums[2], sums[3]) = (sums[2] + found[0], sums[3] + found[1]);
        }
    }
    sums
}

#[test]
fn pairs_with_a_free_segment_are_reported() {
    let [hidden, free, online_hidden, online_free] = search(8, 5);
    judged((free + online_free) as u64);
    told_enough(
        hidden > 300 && free > 2000,
        format_args!("by matrix: {hidden} hidden, {free} free: too few to tell"),
    );
    told_enough(
        online_hidden > 40 && online_free > 2000,
        format_args!("online: {online_hidden} hidden, {online_free} free"),
    );
}

#[test]
fn viewcells_whose_objects_are_gone_or_moved_hide_nobody() {
    let mut world = World::new();
    world.add_box([5.9, -9.0, -9.0], [6.1, 30.0, 9.0]);
    let cells = OnlineCells::new(&mut world.scene, viewcells(DVec3::ZERO));
    let mut online = OnlinePvs::new(DVec3::splat(2.0), DVec3::new(4.0, 4.0, 2.0)).unwrap();
    let at = |x: f64| Reach::new(DVec3::new(x, 5.0, 0.2), DVec3::new(x + 0.4, 5.4, 1.8));
    let movers = [at(2.0), at(10.0)];
    let places = [DVec3::new(2.2, 5.2, 1.0), DVec3::new(10.2, 5.2, 1.0)];
    let mut who = WhoSees::new();
    let mut sees = |scene: &_, online: &mut OnlinePvs| {
        while online.step(scene, &places, u32::MAX).is_some() {}
        who.look(&mut cells.with(scene, online), &movers, &movers);
        who.sees(0, 1)
    };
    assert!(!sees(&world.scene, &mut online), "movers on the sides of a wall");
    let clone = world.scene.clone();
    assert!(!sees(&clone, &mut online), "the same in a clone");
    let object = cells.objects()[3];
    let bounds = world.scene.bounds(object).unwrap();
    world.scene.set_bounds(object, Aabb::new(bounds.min, bounds.max * 2.0)).unwrap();
    assert!(sees(&world.scene, &mut online), "a viewcell's object has other bounds");
    world.scene.set_bounds(object, bounds).unwrap();
    assert!(!sees(&world.scene, &mut online), "and its own again");
    world.scene.set_origin(DVec3::X).unwrap();
    assert!(sees(&world.scene, &mut online), "the origin has moved, the objects have not");
    world.scene.set_origin(DVec3::ZERO).unwrap();
    world.scene.remove(object).unwrap();
    world.scene.insert(bounds);
    assert!(sees(&world.scene, &mut online), "another object in place of a viewcell's");
}

#[test]
fn a_wall_that_some_observers_do_not_see_hides_nobody_from_a_matrix() {
    let mut world = World::new();
    let wall = world.add_box([5.9, -9.0, -9.0], [6.1, 30.0, 9.0]);
    let at = |x: f64| Reach::new(DVec3::new(x, 5.0, 0.2), DVec3::new(x + 0.4, 5.4, 1.8));
    let (movers, mut who) = ([at(2.0), at(10.0)], WhoSees::new());
    for layers in [u32::MAX, 2, u32::MAX, u32::MAX - 1] {
        world.scene.set_layers(wall, layers).unwrap();
        let mut matrix =
            ViewcellMatrix::of_scene::<ExtendedProjectionCuller>(&world.scene, viewcells(DVec3::ZERO));
        who.look(&mut matrix, &movers, &movers);
        assert_eq!(who.sees(0, 1), layers != u32::MAX, "behind a wall on layers {layers:#x}");
    }
    assert!(world.scene.can_occlude(wall), "the scene keeps its occluder");
}
