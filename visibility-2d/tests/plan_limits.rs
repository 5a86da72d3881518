//! Tests of range, sector, opacities and walls to see through, against sample points and a simple count of
//! walls.

use visibility_2d::cdt::{Opacity, Plan, PlanView, RegionVisibility, Visibility, Wall};
use visibility_testing::Random;
use visibility_testing::allocations::ALLOCATIONS;

type Point = [f64; 2];

fn side(a: Point, b: Point, p: Point) -> f64 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

fn random_plan(random: &mut Random, count: usize) -> Plan {
    let walls: Vec<_> = (0..count)
        .map(|_| {
            let [x, y] = [0, 1].map(|_| random.range(0.0, 20.0));
            let wall = Wall::new([x, y], [x + random.range(-4.0, 4.0), y + random.range(-4.0, 4.0)]);
            wall.with_opacity(random.pick(&[
                Opacity::Opaque,
                Opacity::Opaque,
                Opacity::Clear,
                Opacity::OneWay,
            ]))
        })
        .collect();
    Plan::from_walls(&walls, 1.0).unwrap()
}

/// Returns how many walls stop a line of sight, and the numbers of all walls that it crosses.
fn crossed(plan: &Plan, eye: Point, to: Point) -> (u32, Vec<u32>) {
    let mut all: Vec<_> = (0u32..)
        .zip(plan.walls())
        .filter(|(_, wall)| {
            let [a, b] = wall.ends;
            side(eye, to, a) * side(eye, to, b) < 0.0 && side(a, b, eye) * side(a, b, to) < 0.0
        })
        .collect();
    all.sort_by_key(|&(number, _)| number);
    let stops = all.iter().filter(|(_, wall)| {
        let [a, b] = wall.ends;
        match wall.opacity {
            Opacity::Opaque => true,
            Opacity::Clear => false,
            Opacity::OneWay => side(a, b, eye) < 0.0,
        }
    });
    (stops.count() as u32, all.iter().map(|&(number, _)| number).collect())
}

/// Returns whether a polygon contains a point, and whether the point is clearly off the boundary.
fn holds(polygon: &[Point], p: Point) -> (bool, bool) {
    let (mut inside, mut clear) = (false, true);
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        if (a[1] > p[1]) != (b[1] > p[1]) && (side(a, b, p) > 0.0) == (b[1] > a[1]) {
            inside = !inside;
        }
        let length = (b[0] - a[0]).hypot(b[1] - a[1]);
        clear &= side(a, b, p).abs() > 1e-6 * length;
    }
    (inside, clear)
}

#[test]
fn polygons_hold_what_is_seen() {
    let mut answer = Visibility::new();
    let (mut seen_count, mut hidden_count) = (0, 0);
    for seed in 0..600 {
        let mut random = Random(seed);
        let count = random.below(30);
        let plan = random_plan(&mut random, count);
        let [low, high] = plan.bounds();
        let mut view = PlanView::new([0, 1].map(|k| random.fine_range(low[k], high[k])));
        let near = |random: &mut Random, eye: Point| eye.map(|x| x + random.fine_range(-1.0, 1.0));
        if random.one_in(2) {
            view = view.with_range(random.range(0.0, 15.0));
        }
        if random.one_in(2) {
            view = view.with_sector(near(&mut random, view.eye), near(&mut random, view.eye));
        }
        if random.one_in(2) {
            view = view.with_through(random.below(4) as u32);
        }
        plan.look(&view, &mut answer).unwrap();
        let area = answer.area();
        let (mut met, mut samples) = (0, 0);
        for _ in 0..60 {
            let p = [0, 1].map(|k| random.fine_range(low[k], high[k]));
            let distance = (p[0] - view.eye[0]).hypot(p[1] - view.eye[1]);
            // Chords of a 64th of a turn deviate from the circle by at most 0.13 %, so points near the range
            // are skipped.
            if distance <= view.range && distance > view.range * 0.998 {
                continue;
            }
            let in_sector = view.sector.is_none_or(|[right, left]| {
                let (of_right, of_left) = (side(view.eye, right, p) > 0.0, side(view.eye, left, p) < 0.0);
                if side(view.eye, right, left) > 0.0 { of_right && of_left } else { of_right || of_left }
            });
            let (stops, walls) = crossed(&plan, view.eye, p);
            let seen = distance <= view.range && in_sector && stops <= view.through;
            let (inside, clear) = holds(answer.polygon(), p);
            samples += 1;
            met += u32::from(inside);
            if !clear {
                continue;
            }
            assert_eq!(inside, seen, "seed {seed}: {view:?} {p:?}");
            if seen {
                // All walls that the line of sight crosses must be seen.
                assert!(walls.iter().all(|wall| answer.walls().contains(wall)), "seed {seed}: {view:?}");
                seen_count += 1;
            } else {
                hidden_count += 1;
            }
        }
        let whole = (high[0] - low[0]) * (high[1] - low[1]);
        let share = f64::from(met) / f64::from(samples);
        assert!(
            (area / whole - share).abs() < 0.4,
            "seed {seed}: area {area} of {whole}, {share} of the samples"
        );
    }
    assert!(seen_count > 3000 && hidden_count > 3000, "{seen_count} seen, {hidden_count} hidden");
}

#[test]
fn one_way_walls_and_doors_are_the_same_for_points_and_regions() {
    let (mut answer, mut region) = (Visibility::new(), RegionVisibility::new());
    let mut asymmetric = 0;
    for seed in 0..300 {
        let mut random = Random(seed);
        let count = random.below(20);
        let mut plan = random_plan(&mut random, count);
        // Doors open and close after the plan was made.
        for wall in 0..count as u32 {
            let before = plan.stamp();
            let opacity = random.pick(&[Opacity::Opaque, Opacity::Clear, Opacity::OneWay]);
            let same = plan.walls()[wall as usize].opacity == opacity;
            plan.set_opacity(wall, opacity).unwrap();
            assert_eq!(
                plan.stamp() == before,
                same,
                "seed {seed}: the stamp changes with the opacity of wall {wall}"
            );
        }
        let fresh = Plan::from_walls(plan.walls(), 1.0).unwrap();
        assert!(
            plan.set_opacity(count as u32, Opacity::Clear).is_err(),
            "seed {seed}: a wall that does not exist"
        );
        let [low, high] = plan.bounds();
        for _ in 0..20 {
            let [p, q] = [0, 1].map(|_| [0, 1].map(|k| random.fine_range(low[k], high[k])));
            let (there, back) = (plan.sees(p, q).unwrap(), plan.sees(q, p).unwrap());
            assert_eq!(there, crossed(&plan, p, q).0 == 0, "seed {seed}");
            assert_eq!(back, crossed(&plan, q, p).0 == 0, "seed {seed}");
            asymmetric += u32::from(there != back);
            let mut seen = |plan: &Plan| {
                plan.look(&PlanView::new(p), &mut answer).unwrap();
                let mut walls = answer.walls().to_vec();
                walls.sort_unstable();
                walls
            };
            let walls = seen(&plan);
            assert_eq!(walls, seen(&fresh), "seed {seed}");
            plan.look_from_region(&[p], &mut region).unwrap();
            let mut by_region = region.walls().to_vec();
            by_region.sort_unstable();
            assert_eq!(walls, by_region, "seed {seed}");
        }
    }
    assert!(asymmetric > 100, "{asymmetric}");
}

#[test]
fn sectors_share_the_turn() {
    let (mut answer, mut parts) = (Visibility::new(), Visibility::new());
    for seed in 0..300 {
        let mut random = Random(seed);
        let plan = random_plan(&mut random, 20);
        let [low, high] = plan.bounds();
        let eye = [0, 1].map(|k| random.range(low[k], high[k]).round());
        plan.look(&PlanView::new(eye), &mut answer).unwrap();
        // Points on the grid, so that some sector directions are opposite or equal.
        let points = [0, 1].map(|_| eye.map(|x| x + f64::from(random.between(-2, 2))));
        let [a, b] = points;
        if a == eye
            || b == eye
            || side(eye, a, b) == 0.0 && (0..2).any(|k| (a[k] - eye[k]) * (b[k] - eye[k]) > 0.0)
        {
            continue;
        }
        let mut area = 0.0;
        for (right, left) in [(a, b), (b, a)] {
            plan.look(&PlanView::new(eye).with_sector(right, left), &mut parts).unwrap();
            area += parts.area();
            assert!(
                parts.walls().iter().all(|wall| answer.walls().contains(wall)),
                "seed {seed}: a wall seen in the sector from {right:?} to {left:?} alone"
            );
        }
        assert!((area - answer.area()).abs() < 1e-9 * area, "seed {seed}: {area} {}", answer.area());
        plan.look(&PlanView::new(eye).with_sector(a, a), &mut parts).unwrap();
        assert_eq!(parts.area(), 0.0, "seed {seed}: the area of an empty sector");
    }
}

#[test]
fn range_decides_by_distance_alone_at_any_magnitude() {
    // A wall at distance 5 from the eye. Its nearest point is an end, or between the ends.
    for scale in [1e-15, 1.0, 1e15] {
        for (a, b) in [([3.0, 4.0], [3.0, 9.0]), ([-2.0, 5.0], [7.0, 5.0])] {
            let wall = Wall::new(a.map(|x| x * scale), b.map(|x| x * scale));
            let plan = Plan::from_walls(&[wall], 100.0 * scale).unwrap();
            let mut answer = Visibility::new();
            for (range, seen) in [(5.0, true), (5.0 * (1.0 + 1e-15), true), (5.0 * (1.0 - 1e-14), false)] {
                plan.look(&PlanView::new([0.0, 0.0]).with_range(range * scale), &mut answer).unwrap();
                assert_eq!(!answer.walls().is_empty(), seen, "{a:?} {range} {scale}");
            }
        }
    }
}

#[test]
fn warm_queries_allocate_nothing() {
    let mut random = Random(5);
    let plan = random_plan(&mut random, 60);
    let (mut answer, mut region) = (Visibility::new(), RegionVisibility::new());
    let mut queries = |seed: u64| {
        let mut random = Random(seed);
        for _ in 0..50 {
            let eye = [0, 1].map(|_| random.range(-1.0, 21.0));
            let view = PlanView::new(eye).with_sector([9.0, 9.0], [9.0, 10.0]);
            plan.look(&PlanView::new(eye), &mut answer).unwrap();
            plan.look(&view.with_range(5.0).with_through(1), &mut answer).unwrap();
            let _ = plan.look_from_region(&[eye, [3.0, 4.0]], &mut region);
            let _ = plan.ray(eye, [0.0, 0.0]);
        }
    };
    queries(1);
    let before = ALLOCATIONS.get();
    queries(1);
    assert_eq!(ALLOCATIONS.get(), before, "allocations in warm queries");
}

/// Gaps and overlaps between two walls that `f64` products cannot distinguish: directions are neighbouring
/// Fibonacci numbers, whose cross product is 1 or -1 while its terms are near 2^104.
#[test]
fn gaps_of_the_last_bit_are_told_from_overlaps() {
    let mut fibonacci = vec![1.0f64, 1.0];
    for i in 2..76 {
        fibonacci.push(fibonacci[i - 1] + fibonacci[i - 2]);
    }
    let mut answer = Visibility::new();
    let mut seen = 0;
    for i in 40..74 {
        // The second direction is to the left or to the right of the first, by a cross product of 1.
        let [a, b] = [i, i + 1].map(|k| [fibonacci[k - 1], fibonacci[k]]);
        let is_gap = (a[0] as i128 * b[1] as i128) > (a[1] as i128 * b[0] as i128);
        let size = fibonacci[i + 1];
        let walls = [
            // One wall to the right of the first direction, one to the left of the second.
            Wall::new(a, [a[0] + size, -size]),
            Wall::new(b, [-size, b[1]]),
            // The wall that is visible through the gap.
            Wall::new([0.0, 4.0 * size], [4.0 * size, 4.0 * size]),
            // Walls around the eye on the other sides.
            Wall::new([-size, size], [-size, -2.0 * size]),
            Wall::new([-size, -size], [3.0 * size, -size]),
            Wall::new([2.0 * size, -size], [a[0] + size, -size]),
        ];
        let plan = Plan::new(&walls).unwrap();
        plan.look(&PlanView::new([0.0, 0.0]), &mut answer).unwrap();
        assert_eq!(answer.walls().contains(&2), is_gap, "{a:?} {b:?}");
        let beyond = [a[0] + b[0], a[1] + b[1]];
        assert_eq!(plan.sees([0.0, 0.0], beyond).unwrap(), is_gap, "{a:?} {b:?}");
        seen += u32::from(is_gap);
    }
    assert_eq!(seen, 17, "gaps of the last bit, of 34 cases");
}

#[test]
fn a_wall_that_touches_the_range_is_in_it() {
    let mut random = Random(7);
    let mut answer = Visibility::new();
    for _ in 0..3000 {
        // The line through (3, 4) k in the direction (-4, 3) is at distance 5 k from the eye.
        let (k, m, n) = (random.between(1, 1 << 28), random.between(1, 1 << 25), random.between(1, 1 << 25));
        let [k, m, n] = [k, m, n].map(f64::from);
        let end = |m: f64| [3.0 * k - 4.0 * m, 4.0 * k + 3.0 * m];
        let plan = Plan::new(&[Wall::new(end(m), end(-n))]).unwrap();
        let mut sees = |range: f64| {
            plan.look(&PlanView::new([0.0, 0.0]).with_range(range), &mut answer).unwrap();
            !answer.walls().is_empty()
        };
        assert!(sees(5.0 * k), "{k} {m} {n}");
        // A wall at a small angle to the lines of sight to its ends has a larger rounding error.
        let unsure = 1e-13 * (1.0 + k.hypot(m) * k.hypot(n) / (k * (m + n)));
        assert!(!sees(5.0 * k * (1.0 - unsure)), "{k} {m} {n}");
    }
}

#[test]
fn rays_name_a_wall_that_stops_them() {
    let wall_of = |walls: &[Wall], through: Point| {
        Plan::new(walls).unwrap().ray([0.0, 0.0], through).unwrap().unwrap().wall
    };
    // Transparent walls behind the point where two walls touch.
    let corner = [
        Wall::new([2.0, 0.0], [3.0, 0.0]).with_opacity(Opacity::Clear),
        Wall::new([2.0, 0.0], [2.0, 1.0]),
        Wall::new([2.0, 0.0], [2.0, -1.0]),
    ];
    assert_eq!(wall_of(&corner, [1.0, 0.0]), Some(1), "the opaque wall at the contact, not the glass behind");
    // On one segment: a transparent wall, a one-way wall that lets the ray pass, and one that stops it.
    let ends = [[2.0, -1.0], [2.0, 1.0]];
    let one_way = |[a, b]: [Point; 2]| Wall::new(a, b).with_opacity(Opacity::OneWay);
    let stacked = [
        Wall::new(ends[0], ends[1]).with_opacity(Opacity::Clear),
        one_way(ends),
        one_way([ends[1], ends[0]]),
        Wall::new(ends[0], ends[1]),
    ];
    assert_eq!(
        wall_of(&stacked, [1.0, 0.25]),
        Some(2),
        "of walls on one segment, the first that stops the ray"
    );
    assert_eq!(wall_of(&stacked[..2], [1.0, 0.25]), None, "glass, and a one-way wall that lets the ray pass");
    // The ray runs along a wall on its left, up to another wall on the left. Transparent walls and a wall on
    // the right do not stop it.
    let along = [
        Wall::new([3.0, 0.0], [3.0, -1.0]),
        Wall::new([1.0, 0.0], [3.0, 0.0]),
        Wall::new([1.0, 0.0], [1.0, -1.0]),
        Wall::new([3.0, 0.0], [3.0, 1.0]),
    ];
    assert_eq!(wall_of(&along, [1.0, 0.0]), Some(3), "the wall on the left that ends the ray");
}
