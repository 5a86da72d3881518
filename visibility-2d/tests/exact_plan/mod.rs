//! Tests of plans against exact arithmetic with integers and fractions of `i128`, which shares no code with
//! the plan.

mod oracle;
mod path_oracle;
mod paths;
mod region_oracle;

use oracle::Oracle;
use visibility_2d::cdt::{Plan, PlanView, RegionVisibility, Visibility, Wall};
use visibility_testing::{Random, judged, told_enough};

/// Number of integer units of the oracle per world unit.
pub(crate) const UNIT: f64 = 4.0;

/// Makes walls between points of a grid. Walls are parallel to an axis or a diagonal, so that all crossings
/// have coordinates that `f64` represents. Many walls touch, overlap, repeat or have zero length.
fn grid_walls(random: &mut Random, count: usize, size: i32) -> Vec<[[i32; 2]; 2]> {
    let mut walls: Vec<[[i32; 2]; 2]> = Vec::new();
    for _ in 0..count {
        let (x, y) = (random.between(0, size), random.between(0, size));
        let (dx, dy) = random.pick(&[(1, 0), (0, 1), (1, 1), (1, -1)]);
        let length = random.between(-3, 3);
        let wall = match random.below(12) {
            0 if !walls.is_empty() => random.pick(&walls),
            1 if !walls.is_empty() => {
                let [a, b] = random.pick(&walls);
                [b, a]
            }
            _ => [[x, y], [x + length * dx, y + length * dy]],
        };
        walls.push(wall);
    }
    walls
}

fn plan_of(walls: &[[[i32; 2]; 2]]) -> Plan {
    let walls: Vec<_> = walls.iter().map(|ends| ends.map(|end| end.map(f64::from))).collect();
    let walls: Vec<_> = walls.iter().map(|&[a, b]| Wall::new(a, b)).collect();
    Plan::from_walls(&walls, 2.0).unwrap()
}

/// Compares what a plan sees from an eye, in quarters of the grid's unit, with the oracle.
fn compare(plan: &Plan, oracle: &Oracle, eye: [i32; 2], answer: &mut Visibility) {
    let point = eye.map(|x| f64::from(x) / UNIT);
    plan.look(&PlanView::new(point), answer).unwrap();
    let mut seen = answer.walls().to_vec();
    seen.sort_unstable();
    let (expected, area) = oracle.look(eye);
    assert_eq!(seen, expected, "walls seen from {point:?}");
    assert!((answer.area() - area).abs() <= 1e-9 * area, "{} against {area} from {point:?}", answer.area());
    let corners = answer.polygon();
    let shoelace: f64 = (0..corners.len())
        .map(|i| {
            let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
            0.5 * (a[0] * b[1] - a[1] * b[0])
        })
        .sum();
    assert!((shoelace - area).abs() <= 1e-9 * area, "polygon {shoelace} against {area} from {point:?}");
}

/// Returns a plan of fewer than `most` walls on a grid of up to `size` steps, its oracle, and the corners of
/// the plan's rectangle in units of the oracle.
fn random_plan(random: &mut Random, size: i32, most: usize) -> (Plan, Oracle, [[i32; 2]; 2]) {
    let size = random.between(2, size);
    let count = random.below(most);
    let walls = grid_walls(random, count, size);
    let plan = plan_of(&walls);
    let corners = plan.bounds().map(|corner| corner.map(|x| (x * UNIT) as i32));
    let oracle = Oracle::new(&walls, corners);
    (plan, oracle, corners)
}

fn compare_grids(seeds: std::ops::Range<u64>, eyes: usize) {
    let mut answer = Visibility::new();
    for seed in seeds {
        let mut random = Random(seed);
        let (plan, oracle, [low, high]) = random_plan(&mut random, 9, 24);
        for _ in 0..eyes {
            // Eyes on vertices, on walls, on other edges of the triangulation, and anywhere.
            let step = random.pick(&[1, 2, 4]);
            let eye = [0, 1].map(|axis| {
                let x = random.between(low[axis] + 4, high[axis] - 4);
                x / step * step
            });
            compare(&plan, &oracle, eye, &mut answer);
        }
    }
}

#[test]
fn eyes_anywhere_see_what_exact_arithmetic_says() {
    compare_grids(0..400, 12);
}

/// Compares lines of sight between points of the grid, which include vertices and points on walls.
fn compare_sight(seeds: std::ops::Range<u64>, pairs: usize) {
    let (mut seen, mut hidden) = (0, 0);
    for seed in seeds {
        let mut random = Random(seed);
        let (plan, oracle, [low, high]) = random_plan(&mut random, 9, 16);
        for _ in 0..pairs {
            // Points may also be outside the rectangle.
            let step = random.pick(&[1, 2, 4, 4]);
            let [a, b] =
                [0, 1].map(|_| [0, 1].map(|k| random.between(low[k] - 6, high[k] + 6) / step * step));
            let [p, q] = [a, b].map(|point| point.map(|x| f64::from(x) / UNIT));
            let expected = oracle.sees(a, b);
            *(if expected { &mut seen } else { &mut hidden }) += 1;
            assert_eq!(plan.sees(p, q).unwrap(), expected, "seed {seed}: from {p:?} to {q:?}");
            assert_eq!(plan.sees(q, p).unwrap(), expected, "seed {seed}: back from {q:?} to {p:?}");
            // The ray through a visible point goes at least as far as this point, and through a hidden point
            // ends before it.
            if let Some(hit) = plan.ray(p, q).unwrap() {
                let length = |to: [f64; 2]| (to[0] - p[0]).hypot(to[1] - p[1]);
                let (far, near) = (length(hit.point), length(q));
                let inside = [a, b].iter().all(|p| (0..2).all(|k| low[k] < p[k] && p[k] < high[k]));
                let right = if expected { !inside || far >= near - 1e-9 } else { far <= near + 1e-9 };
                assert!(right, "seed {seed}: from {p:?} through {q:?}: {hit:?}");
                assert!(
                    expected || hit.wall.is_some(),
                    "seed {seed}: a ray that does not reach {q:?} hits a wall"
                );
            }
        }
    }
    judged((seen + hidden) as u64);
    told_enough(seen > 1000 && hidden > 1000, format_args!("{seen} seen, {hidden} hidden"));
}

#[test]
fn two_points_see_each_other_as_exact_arithmetic_says() {
    compare_sight(0..600, 30);
}

/// Compares the result for each triangle with lines through all pairs of vertices.
fn compare_triangles(seeds: std::ops::Range<u64>) {
    let (mut answer, mut inner) = (RegionVisibility::new(), Visibility::new());
    let mut total = 0;
    for seed in seeds {
        let mut random = Random(seed);
        let (plan, oracle, _) = random_plan(&mut random, 7, 14);
        let walls = &oracle.walls[..oracle.count];
        let integer = |p: [f64; 2]| p.map(|x| (x * UNIT) as i128);
        let mut vertices: Vec<_> = plan.pieces().flat_map(|(ends, _)| ends.map(integer)).collect();
        vertices.sort_unstable();
        vertices.dedup();
        for _ in 0..4 {
            let corners = plan.triangle(random.below(plan.triangle_count()) as u32).unwrap();
            let triangle = corners.map(integer);
            let all: Vec<_> = vertices.iter().copied().chain(triangle).collect();
            let expected = region_oracle::seen_from(triangle, walls, &all);
            plan.look_from_region(&corners, &mut answer).unwrap();
            let mut seen = answer.walls().to_vec();
            seen.sort_unstable();
            assert_eq!(seen, expected, "seed {seed}: from {corners:?} {walls:?}");
            total += seen.len();

            // A part of the triangle sees no more than the triangle, and no less than each of its own points.
            let point = |random: &mut Random| {
                let shares = [0, 1, 2].map(|_| random.unit() + 1e-3);
                let sum: f64 = shares.iter().sum();
                [0, 1].map(|axis| (0..3).map(|k| shares[k] / sum * corners[k][axis]).sum::<f64>())
            };
            let points: Vec<_> = (0..random.between(1, 4)).map(|_| point(&mut random)).collect();
            plan.look_from_region(&points, &mut answer).unwrap();
            assert!(answer.walls().iter().all(|wall| expected.contains(wall)), "seed {seed}: {points:?}");
            for &eye in &points {
                plan.look(&PlanView::new(eye), &mut inner).unwrap();
                assert!(inner.walls().iter().all(|wall| answer.walls().contains(wall)), "seed {seed}");
                if points.len() == 1 {
                    assert_eq!(inner.walls().len(), answer.walls().len(), "seed {seed}: {eye:?}");
                }
            }
        }
    }
    judged(total as u64);
    told_enough(total > 300, format_args!("{total}"));
}

#[test]
fn triangles_see_what_lines_through_all_vertices_say() {
    compare_triangles(0..120);
}

#[test]
fn regions_across_triangles_miss_nothing() {
    let (mut answer, mut inner) = (RegionVisibility::new(), Visibility::new());
    for seed in 0..150 {
        let mut random = Random(seed);
        let count = random.below(20);
        let walls = grid_walls(&mut random, count, 9);
        let plan = plan_of(&walls);
        let [low, high] = plan.bounds();
        // Corners are often on the grid, so that sides run along walls and through vertices.
        let step = random.pick(&[1.0, 0.01]);
        let corners: Vec<_> = (0..random.between(1, 5))
            .map(|_| {
                [0, 1].map(|k| {
                    let x = random.range(low[k], high[k]);
                    ((x / step).round() * step).clamp(low[k], high[k])
                })
            })
            .collect();
        plan.look_from_region(&corners, &mut answer).unwrap();
        for _ in 0..40 {
            let shares: Vec<_> = corners.iter().map(|_| random.unit().powi(3) + 1e-9).collect();
            let sum: f64 = shares.iter().sum();
            let eye = [0, 1].map(|k| corners.iter().zip(&shares).map(|(c, s)| s / sum * c[k]).sum::<f64>());
            plan.look(&PlanView::new(eye), &mut inner).unwrap();
            for wall in inner.walls() {
                assert!(answer.walls().contains(wall), "seed {seed}: {corners:?} wall {wall} from {eye:?}");
            }
        }
    }
    let plan = plan_of(&[]);
    assert!(plan.look_from_region(&[], &mut answer).is_err(), "a region without corners");
    assert!(
        plan.look_from_region(&[[0.0, 0.0], [1e3, 0.0]], &mut answer).is_err(),
        "a region that leaves the plan"
    );
    assert!(plan.look_from_region(&[[f64::NAN, 0.0]], &mut answer).is_err(), "a region at NaN");
}
