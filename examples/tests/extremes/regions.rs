//! Tests of every method for viewcells at the extremes: on the same random worlds as the cullers, from
//! viewcells that are points, slabs, huge, inverted, cut by planes, infinite or NaN.

use super::strategies::{self, Case};
use super::{cases, oracle};
use visibility_core::geometry::Plane;
use visibility_core::glam::{DQuat, DVec3};
use visibility_core::{pvs::Viewcell, view::Eye};
use visibility_examples::region::methods::{self, METHODS};
use visibility_examples::region::trial;
use visibility_testing::Random;

/// Returns all methods with fast settings. The environment variable `EXTREMES_CULLERS` filters them by
/// prefix.
fn entries() -> Vec<String> {
    let all = METHODS.iter().map(|entry| match entry.name {
        "rays" => "rays:2000".to_owned(),
        "shrink" => "shrink:1".to_owned(),
        name => name.to_owned(),
    });
    match std::env::var("EXTREMES_CULLERS") {
        Ok(list) => all.filter(|entry| list.split(',').any(|name| entry.starts_with(name))).collect(),
        Err(_) => all.collect(),
    }
}

/// Makes viewcells around the eyes of a world's views: boxes with sides from 0 to a thousand times the
/// distance from the eye to an object, and one with invalid numbers.
fn viewcells(case: &Case, rng: &mut Random) -> Vec<Viewcell> {
    let world = &case.world;
    let eyes = world.views.iter().filter_map(|view| match view.eye(world.origin()) {
        Eye::Point(eye) => Some(eye),
        Eye::Direction(_) => None,
    });
    let mut cells: Vec<Viewcell> = eyes
        .take(2)
        .map(|eye| {
            let object = &world.source.objects[rng.below(world.source.objects.len())];
            let away = object.bounds().map_or(1.0, |(min, _)| min.as_dvec3().distance(eye));
            let size = away * 10f64.powi(rng.between(-5, 2));
            let half = DVec3::from_array([0, 1, 2].map(|_| size * rng.pick(&[0.0, 0.1, 1.0, 1000.0])));
            let middle = eye + world.origin();
            let mut cell = Viewcell::from_box(middle - half, middle + half);
            if rng.one_in(3) {
                turn(&mut cell, middle, half * 0.5, rng);
            }
            cell
        })
        .collect();
    if let Some(cell) = cells.first().cloned() {
        cells.push(spoiled(cell, rng));
    }
    cells
}

/// Adds planes to a viewcell that cut it to a randomly rotated box.
fn turn(cell: &mut Viewcell, middle: DVec3, half: DVec3, rng: &mut Random) {
    let turn = DQuat::from_axis_angle(rng.direction(), rng.range(0.0, 3.0));
    cell.planes = (0..3)
        .flat_map(|i| {
            let axis = turn * DVec3::AXES[i];
            let length = rng.range(0.1, 9.0);
            [axis, -axis].map(|normal| Plane::through(middle - normal * half[i], normal * length))
        })
        .collect();
}

/// Puts NaN, infinities, huge or reversed numbers into a viewcell.
fn spoiled(mut cell: Viewcell, rng: &mut Random) -> Viewcell {
    const BAD: [f64; 7] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, -f64::MAX, 1e30, 5e-324];
    match rng.below(6) {
        0 => cell.min[rng.below(3)] = rng.pick(&BAD),
        1 => cell.max[rng.below(3)] = rng.pick(&BAD),
        2 => (cell.min, cell.max) = (cell.max + DVec3::splat(1.0), cell.min),
        3 => (cell.min, cell.max) = (DVec3::splat(-rng.pick(&BAD)), DVec3::splat(rng.pick(&BAD))),
        4 => cell.planes.push(Plane::new(rng.vector(1.0) * rng.pick(&BAD), rng.pick(&BAD))),
        // Two opposite planes with no point between them.
        _ => {
            let normal = rng.direction();
            cell.planes.push(Plane::through(cell.max, normal));
            cell.planes.push(Plane::through(cell.min - normal, -normal));
        }
    }
    cell
}

/// Runs a method on viewcells of a world. If the method promises to hide nothing visible, fails if a ray
/// reaches a hidden object. Returns the numbers of objects hidden and of rays tried.
fn check(name: &str, case: &Case, cells: &[Viewcell], rng: &mut Random) -> [usize; 2] {
    let world = &case.world;
    let mut method = methods::parse(name, world).expect("a method of the table").remove(0).1;
    let [mut hidden, mut rays] = [0; 2];
    for cell in cells {
        let trial = trial::run(name, method.as_mut(), &world.scene, cell);
        let objects = 0..world.source.objects.len();
        let lacks = |&index: &usize| trial.reported.binary_search(&(index as u32)).is_err();
        for index in objects.filter(lacks) {
            hidden += 1;
            let sight = oracle::sight_from_cell(world, cell, index, rng, &mut rays);
            let is_wrong = trial.accuracy.never_hides() && sight.is_some();
            assert!(!is_wrong, "{name} hides object {index} of {} from {cell:?}: {sight:?}", case.what);
        }
    }
    [hidden, rays]
}

#[test]
fn methods_for_viewcells_at_the_extremes() {
    let entries = entries();
    let mut sums = vec![[0; 2]; entries.len()];
    for seed in 0..cases(60) {
        let mut rng = Random(seed);
        let case = strategies::random(&mut rng);
        let cells = viewcells(&case, &mut rng);
        for (entry, sum) in entries.iter().zip(&mut sums) {
            // Slow methods take up to a second per viewcell, so they are tested on every tenth world.
            let is_slow = ["exact", "share", "volume"].contains(&entry.as_str());
            if !is_slow || seed % 10 == 0 {
                let counts = check(entry, &case, &cells, &mut rng);
                (0..2).for_each(|i| sum[i] += counts[i]);
            }
        }
    }
    for (entry, [hidden, rays]) in entries.iter().zip(sums) {
        println!("{entry}: {hidden} hidden, {rays} rays");
        assert!(entry != "sweep" || hidden > 100 && rays > 500, "{entry}: too easy");
    }
}

#[test]
fn methods_for_viewcells_in_scenes_of_nothing_of_one_object_and_of_many_in_one_point() {
    for case in strategies::degenerate_counts() {
        let cells = [
            Viewcell::from_box(DVec3::splat(-1.0), DVec3::splat(1.0)),
            Viewcell::from_box(DVec3::ZERO, DVec3::ZERO),
            Viewcell::from_box(DVec3::splat(f64::NAN), DVec3::ZERO),
        ];
        for entry in entries() {
            check(&entry, &case, &cells, &mut Random(1));
        }
    }
}
