//! Tests of the triangulation itself: its structure, and walls that cross, repeat or come from hostile bits.

mod queries;

use super::constrain::MAX_VERTICES;
use super::hilbert::Curve;
use super::plan::{BLOCKS, WALL};
use super::predicates::{in_circle, orient};
use super::triangulation::{NONE, Triangulation, next, previous};
use super::{Plan, PlanError, PlanView, Visibility, Wall};
use alloc::vec::Vec;
use visibility_testing::Random;

/// Asserts that triangles are counter-clockwise, that twins agree, and that every wall is a chain of pieces.
fn check(plan: &Plan) {
    let mut area = 0.0;
    for t in 0..plan.triangle_count() as u32 {
        let [a, b, c] = plan.triangle(t).unwrap();
        assert!(orient(a, b, c) > 0.0, "triangle {a:?} {b:?} {c:?}");
        area += orient(a, b, c);
        for h in 3 * t..3 * t + 3 {
            let edge = plan.edges[h as usize];
            assert_eq!(
                edge.twin & WALL != 0,
                plan.piece[h as usize] != NONE,
                "half-edge {h} is of a wall if and only if it has a piece"
            );
            match edge.twin() {
                None => assert!(edge.twin & BLOCKS != 0, "half-edge {h} at the border blocks"),
                Some(twin) => {
                    assert_eq!(plan.edges[twin as usize].twin(), Some(h), "half-edge {h}: its twin's twin");
                    assert_eq!(
                        plan.edges[twin as usize].origin,
                        plan.edges[next(h) as usize].origin,
                        "half-edge {h}: its twin begins where it ends"
                    );
                    assert_eq!(
                        plan.piece[twin as usize], plan.piece[h as usize],
                        "half-edge {h}: its twin has the same piece"
                    );
                }
            }
        }
    }
    for (vertex, &h) in plan.out.iter().enumerate() {
        assert_eq!(
            plan.edges[h as usize].origin as usize, vertex,
            "vertex {vertex}: its half-edge begins there"
        );
    }
    let [low, high] = plan.bounds();
    let whole = 2.0 * (high[0] - low[0]) * (high[1] - low[1]);
    assert!((area - whole).abs() <= 1e-9 * whole, "area {area} of {whole}");
    // Each end of a wall is an end of one piece in its chain; every other point of the chain is an end of two
    // pieces.
    let mut ends: Vec<Vec<[u64; 2]>> = alloc::vec![Vec::new(); plan.walls().len()];
    for (piece, walls) in plan.pieces() {
        assert!(
            !walls.is_empty() && walls.windows(2).all(|pair| pair[0] < pair[1]),
            "{piece:?}: walls of the piece, ascending: {walls:?}"
        );
        for &wall in walls {
            ends[wall as usize].extend(piece.map(|end| end.map(f64::to_bits)));
        }
    }
    for (mut ends, wall) in ends.into_iter().zip(plan.walls()) {
        ends.sort_unstable();
        let mut single: Vec<_> =
            ends.chunk_by(|a, b| a == b).filter(|group| group.len() % 2 == 1).map(|group| group[0]).collect();
        let flushed = |x: f64| if x.abs() < 1e-40 { 0.0f64 } else { x }.to_bits();
        let mut expected = wall.ends.map(|end| end.map(flushed)).to_vec();
        expected.sort_unstable();
        if expected[0] == expected[1] {
            expected.clear();
        }
        single.dedup();
        assert_eq!(single, expected, "pieces of {wall:?}");
    }
}

/// Counts the edges whose flip would make the triangulation more Delaunay.
fn flippable(plan: &Plan) -> usize {
    (0..plan.edges.len() as u32)
        .filter(|&h| {
            let edge = plan.edges[h as usize];
            edge.twin & (WALL | BLOCKS) == 0
                && edge.twin().is_some_and(|twin| {
                    let [a, b] = plan.ends(h);
                    in_circle(a, b, plan.start(previous(h)), plan.start(previous(twin)))
                })
        })
        .count()
}

fn random_walls(random: &mut Random, count: usize, point: impl Fn(&mut Random) -> [f64; 2]) -> Vec<Wall> {
    (0..count).map(|_| Wall::new(point(random), point(random))).collect()
}

#[test]
fn walls_that_cross_become_chains() {
    for seed in 0..150 {
        let mut random = Random(seed);
        let count = random.below(50);
        // On grids many walls are collinear or concurrent. Scaling by a third makes every crossing inexact.
        let scale = random.pick(&[1.0, 1.0 / 3.0, 1e-9]);
        let size = random.between(1, 12);
        let offset = random.pick(&[0.0, 1e6]);
        let walls = random_walls(&mut random, count, |random| {
            [0, 1].map(|_| offset + f64::from(random.between(0, size)) * scale)
        });
        check(&Plan::new(&walls).unwrap());
    }
}

/// Makes walls and copies on top of them: equal walls, parts of walls, and walls whose ends differ in the
/// last bits, at several scales, in any direction, many at small angles.
fn piled_walls(random: &mut Random) -> Vec<Wall> {
    let scale = [random.pick(&[1.0, 1e6, 1e-6]), random.pick(&[1.0, 1e-3, 1e3])];
    let offset = [random.pick(&[0.0, 0.0, 1e6, -3e3]), random.pick(&[0.0, 0.0, 1e6, 12.5])];
    let thin = random.pick(&[1.0, 1.0, 1e-2, 1e-6, 1e-12]);
    let mut walls: Vec<_> = (0..2 + random.below(10))
        .map(|_| {
            let [a, b] = [0, 1].map(|_| {
                let x = random.unit();
                let point = [x, x * 0.37 + thin * random.range(-1.0, 1.0)];
                [0, 1].map(|axis| offset[axis] + scale[axis] * point[axis])
            });
            Wall::new(a, b)
        })
        .collect();
    for _ in 0..random.below(20) {
        let [a, b] = random.pick(&walls).ends;
        let moved = |random: &mut Random, p: [f64; 2]| {
            p.map(|x| f64::from_bits(x.to_bits() + random.pick(&[0, 0, 1, 2])))
        };
        let share = |share: f64| [0, 1].map(|axis| a[axis] + share * (b[axis] - a[axis]));
        walls.push(match random.below(4) {
            0 => Wall::new(share(random.unit()), share(random.unit())),
            1 => Wall::new(b, a),
            _ => Wall::new(moved(random, a), moved(random, b)),
        });
    }
    walls
}

fn check_piles(seeds: core::ops::Range<u64>) {
    let (count, mut refused) = (seeds.end - seeds.start, 0);
    for seed in seeds {
        let walls = piled_walls(&mut Random(seed));
        let Ok(plan) = Plan::new(&walls) else {
            // A pile is refused if bending its walls does not end, which is very rare.
            refused += 1;
            continue;
        };
        check(&plan);
        let (pieces, count) = (plan.pieces().len(), walls.len());
        assert!(pieces < 2 * count * count, "seed {seed}: {pieces} pieces of {count} walls");
    }
    assert!(refused <= count / 2000, "{refused} of {count} piles refused");
}

/// Piled walls cross at every vertex of each other, by rounding alone. Unless crossings are moved to nearby
/// vertices, some thousand of these piles would split into millions of pieces without end.
#[test]
fn walls_on_top_of_each_other_are_few_pieces() {
    check_piles(0..1500);
}

#[test]
#[ignore = "long form: 40 times as many"]
fn walls_on_top_of_each_other_are_few_pieces_at_length() {
    check_piles(1500..60_000);
}

#[test]
fn without_crossings_the_triangulation_is_delaunay() {
    for seed in 0..20 {
        let mut random = Random(seed);
        let walls: Vec<_> = (0..300)
            .map(|_| {
                let [x, y] = [0, 1].map(|_| random.range(0.0, 100.0));
                Wall::new([x, y], [x + random.range(-0.5, 0.5), y + random.range(-0.5, 0.5)])
            })
            .collect();
        let plan = Plan::new(&walls).unwrap();
        check(&plan);
        if plan.pieces().len() == 300 {
            assert_eq!(flippable(&plan), 0, "seed {seed}");
        }
    }
}

#[test]
fn a_wall_past_many_others_takes_no_quadratic_time() {
    // 20,000 short walls in two jagged rows, and one wall between the rows that crosses edges of all of them.
    let mut walls = Vec::new();
    let mut random = Random(3);
    for i in 0..10_000 {
        let x = f64::from(i);
        for side in [-1.0, 1.0] {
            let y = side * random.range(0.1, 3.0);
            walls.push(Wall::new([x, y], [x + 0.2, 1.01 * y]));
        }
    }
    walls.push(Wall::new([-1.0, 0.0], [10_001.0, 0.01]));
    let plan = Plan::new(&walls).unwrap();
    assert_eq!(plan.pieces().len(), walls.len(), "no wall is split");
    check(&plan);
}

#[test]
fn hostile_bits_are_errors_or_plans() {
    let (mut plans, mut errors) = (0, 0);
    let mut answer = Visibility::new();
    for seed in 0..2000 {
        let mut random = Random(seed);
        let count = random.below(12);
        let kind = random.below(4);
        let walls = random_walls(&mut random, count, |random| {
            [0, 1].map(|_| match kind {
                0 => random.bits64(),
                1 => f64::from(random.bits32()),
                // Neighbouring floating-point numbers, so that most crossings are not representable.
                2 => f64::from_bits(1.0f64.to_bits() + random.below(5) as u64),
                _ => random.pick(&[0.0, -0.0, 1e-300, 1e-40, 1e-39, 1.0, 1e17, -1e59, 1e60, 3e-5]),
            })
        });
        let plan = match Plan::from_walls(&walls, random.bits64()) {
            Ok(plan) => plan,
            Err(error) => {
                assert!(matches!(error, PlanError::Coordinate { .. }), "{error}");
                errors += 1;
                continue;
            }
        };
        check_structure(&plan);
        plans += 1;
        for _ in 0..8 {
            let eye = match random.below(3) {
                0 if count > 0 => random.pick(&walls).ends[0],
                1 => [random.bits64(), random.bits64()],
                _ => [0, 1].map(|axis| {
                    let [low, high] = plan.bounds();
                    low[axis] + random.unit() * (high[axis] - low[axis])
                }),
            };
            let mut view = PlanView::new(eye);
            if random.one_in(2) {
                view = view.with_range(random.bits64());
            }
            if random.one_in(2) {
                view = view.with_sector([random.bits64(), 1.0], [random.unit(), random.bits64()]);
            }
            let view = view.with_through(random.pick(&[0, 1, u32::MAX]));
            let valid = eye.iter().all(|x| x.abs() <= 1e60);
            if plan.look(&view, &mut answer).is_ok() {
                assert!(valid, "an eye at {eye:?} is accepted");
                assert!(answer.polygon().iter().flatten().all(|x| !x.is_nan()), "{view:?}");
            }
        }
    }
    assert!(plans > 500 && errors > 300, "{plans} plans, {errors} errors");
}

/// Asserts the properties in [`check`] that hold exactly at any magnitude.
fn check_structure(plan: &Plan) {
    for t in 0..plan.triangle_count() as u32 {
        let [a, b, c] = plan.triangle(t).unwrap();
        assert!(orient(a, b, c) > 0.0, "triangle {a:?} {b:?} {c:?}");
    }
}

/// Overlapping walls are listed pair by pair. Without a limit, the lists of 100,000 such walls would fill any
/// memory.
#[test]
fn too_many_overlaps_are_an_error() {
    // Wall i lies on i pieces, so the lists grow while walls are inserted.
    let nested: Vec<_> = (1..6500).map(|i| Wall::new([0.0, 0.0], [f64::from(i), 0.0])).collect();
    assert!(
        matches!(Plan::new(&nested), Err(PlanError::TooMany { .. })),
        "6499 nested walls have too many overlaps"
    );
    let few = Plan::new(&nested[..1000]).unwrap();
    assert_eq!(
        few.pieces().map(|(_, walls)| walls.len()).sum::<usize>(),
        1000 * 1001 / 2,
        "overlaps of 999 nested walls"
    );
}

#[test]
fn too_many_overlaps_of_crossed_walls_are_an_error() {
    // Equal walls share one list. Crossings copy the list to many pieces.
    let mut crossed = alloc::vec![Wall::new([0.0, 0.0], [9000.0, 0.0]); 9000];
    crossed.extend((1..9000).map(f64::from).map(|x| Wall::new([x, -1.0], [x, 1.0])));
    assert!(matches!(Plan::new(&crossed), Err(PlanError::TooMany { .. })), "9000 equal walls, each crossed");
}

#[test]
fn as_many_walls_as_the_limit_have_vertices() {
    // Each wall has two ends; the rectangle has four corners.
    assert!(
        2 * core::hint::black_box(Plan::LIMIT) + 4 <= MAX_VERTICES,
        "the limit of walls leaves room for their ends"
    );
}

#[test]
fn a_wide_margin_keeps_the_order_along_the_curve() {
    let mut random = Random(5);
    let point = |random: &mut Random| [0, 1].map(|_| random.range(0.0, 1000.0));
    let walls: Vec<_> = (0..1000)
        .map(|_| {
            let end = point(&mut random);
            Wall::new(end, end.map(|x| x + 0.1))
        })
        .collect();
    let plan = Plan::from_walls(&walls, 1e15).unwrap();
    for _ in 0..100 {
        let [x, y] = point(&mut random);
        let [u, v] = plan.start(plan.near([x, y]));
        // The mean distance to the nearest wall is 16, so the walk ends near its goal.
        assert!((u - x).abs() + (v - y).abs() < 400.0, "{x} {y}: {u} {v}");
    }
    check_structure(&plan);
}

#[test]
fn points_at_one_place_of_the_curve_are_inserted_in_order() {
    let mut random = Random(6);
    let mut points: Vec<_> = (0..4096).map(|i| [f64::from(i), 0.0]).collect();
    for i in (1..points.len()).rev() {
        points.swap(i, random.below(i + 1));
    }
    let (low, high) = ([-1e15; 2], [1e15; 2]);
    let mut triangulation = Triangulation::new(low, high);
    triangulation.insert_all(&points, &Curve::new(low, high));
    // Vertices are numbered in the order of insertion; the first four are the rectangle.
    let steps = triangulation.points[4..].windows(2).map(|pair| (pair[0][0] - pair[1][0]).abs());
    let length: f64 = steps.sum();
    assert!(length < 16.0 * 4096.0, "{length}");
}

#[test]
fn nearly_parallel_walls_are_split_where_they_cross() {
    let walls = [
        Wall::new(
            [1.414_452_842_312_045_3, 2.078_951_414_446_432_3],
            [5.431_334_633_635_018, 8.491_184_539_348_32],
        ),
        Wall::new(
            [0.559_327_261_150_22, 0.713_896_413_494_834_6],
            [6.116_033_472_845_556, 9.584_183_737_594_998],
        ),
    ];
    let plan = Plan::new(&walls).unwrap();
    // The crossing, computed with exact fractions.
    let crossing = [2.583_835_515_027_79, 3.945_661_638_748_201_7];
    let is_near = |end: [f64; 2]| (0..2).all(|k| (end[k] - crossing[k]).abs() < 1e-12);
    assert!(
        plan.pieces().any(|(ends, _)| ends.into_iter().any(is_near)),
        "{:?}",
        plan.pieces().collect::<Vec<_>>()
    );
}

#[test]
fn crossings_obey_the_least_coordinate() {
    let walls =
        [Wall::new([-3e-40, -1e-40], [3.1e-40, 1e-40]), Wall::new([-1e-40, 3e-40], [1e-40, -3.1e-40])];
    let plan = Plan::new(&walls).unwrap();
    assert_eq!(plan.pieces().len(), 4, "pieces of two walls that cross");
    for (ends, _) in plan.pieces() {
        assert!(ends.iter().flatten().all(|&x| x == 0.0 || x.abs() >= 1e-40), "{ends:?}");
    }
}

/// Plans keep walls inside of their rectangle by a quarter of the larger extent, or the least that a number
/// far from 0 allows.
#[test]
fn walls_are_strictly_inside_the_rectangle() {
    let plan = Plan::new(&[Wall::new([1.0, 1.0], [9.0, 2.0])]).unwrap();
    assert_eq!(plan.bounds(), [[-1.0, -1.0], [11.0, 4.0]], "a quarter of the larger extent");
    for x in [1.0, 1e15, -1e15, 1e59, 3e-40] {
        for margin in [0.0, -1.0, f64::NAN, 1e-300] {
            let plan = Plan::from_walls(&[Wall::new([x, x], [x, 0.5 * x])], margin).unwrap();
            let [low, high] = plan.bounds();
            let ends = [x, 0.5 * x];
            let is_inside = |axis: usize| ends.iter().all(|&y| low[axis] < y && y < high[axis]) || axis == 0;
            assert!(is_inside(1) && low[0] < x && x < high[0], "{low:?} to {high:?} around {x}, {margin}");
        }
    }
    assert_eq!(plan.triangle(plan.triangle_count() as u32), None, "a triangle behind the last");
}

/// Triangles that lose different labels report them, with bounds around all of them.
#[test]
fn labels_that_differ_are_erased() {
    let mut of = Triangulation::new([-1.0, -2.0], [3.0, 4.0]);
    of.labels.copy_from_slice(&[7, 7]);
    of.unify(&[0, 1]);
    assert!(of.erased.is_empty(), "equal labels stay");
    of.labels[1] = 8;
    of.unify(&[0, 1]);
    assert_eq!((&of.erased[..], &of.labels[..]), (&[7, 8][..], &[NONE; 2][..]), "labels of both");
    assert_eq!(of.erased_bounds, [[-1.0, -2.0], [3.0, 4.0]], "bounds of both");
}

/// A wall parallel to an axis is not bent through a vertex beside it, though the wall that crosses it there
/// is.
#[test]
fn walls_along_an_axis_stay_straight() {
    for (up, by) in [(true, 1.0), (true, -1.0), (false, 1.0), (false, -1.0)] {
        let turned = |[x, y]: [f64; 2]| if up { [x, y] } else { [y, x] };
        let wall = |a: [f64; 2], b: [f64; 2]| Wall::new(turned(a), turned(b));
        let beside = [2.0, 1.0 + by * f64::EPSILON];
        let plan = Plan::new(&[
            wall(beside, [2.5, 1.0 + by]),
            wall([0.0, 1.0], [4.0, 1.0]),
            wall([2.0 - 0.125, 0.0], [2.0 + 0.125, 2.0]),
        ])
        .unwrap();
        check(&plan);
        let axis = usize::from(up);
        for (ends, walls) in plan.pieces().filter(|(_, walls)| walls.contains(&1)) {
            assert!(ends.iter().all(|end| end[axis] == 1.0), "{ends:?} of {walls:?}, {up} {by}");
        }
    }
}
