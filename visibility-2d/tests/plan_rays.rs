//! Rays against visibility polygons: each ray ends on the polygon's edge at the nearest wall, and that wall
//! is seen. The nearest wall is found wall by wall, which shares nothing with a triangulation.

use visibility_2d::cdt::{Plan, PlanView, Visibility, Wall};
use visibility_testing::Random;

type Point = [f64; 2];

fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

/// Returns where a ray from the origin along `to` meets a segment, in parts of `to`, and how far within the
/// segment, in parts of its length from the nearer end.
fn meet(to: Point, [a, b]: [Point; 2]) -> Option<[f64; 2]> {
    let along = minus(b, a);
    let turn = cross(to, along);
    let (part, at) = (cross(a, along) / turn, cross(a, to) / turn);
    (part > 0.0 && (-0.1..=1.1).contains(&at)).then_some([part, at.min(1.0 - at)])
}

/// Makes walls of several kinds: scattered, in rooms with doors, in piles on a grid.
fn walls(random: &mut Random) -> Vec<[Point; 2]> {
    let count = 20 + random.below(200);
    let kind = random.below(3);
    (0..count)
        .map(|_| match kind {
            0 => {
                let at = [random.range(-50.0, 50.0), random.range(-50.0, 50.0)];
                let length = [0.5, 5.0, 30.0][random.below(3)];
                [at, [at[0] + random.range(-length, length), at[1] + random.range(-length, length)]]
            }
            1 => {
                let at = [random.between(-8, 8), random.between(-8, 8)].map(|i| 6.0 * f64::from(i));
                let (from, to) = (random.range(0.0, 2.0), random.range(3.0, 6.0));
                let ends = [[at[0] + from, at[1]], [at[0] + to, at[1]]];
                if random.below(2) == 0 { ends } else { ends.map(|[x, y]| [y, x]) }
            }
            _ => {
                let mut point = || [random.between(-12, 12), random.between(-12, 12)].map(f64::from);
                [point(), point()]
            }
        })
        .collect()
}

/// Returns the number of rays that were compared, and of those too close to an end of a wall to tell.
fn run(plans: u64, eyes: usize, rays: usize) -> [u64; 2] {
    let [mut compared, mut unsure] = [0; 2];
    let mut answer = Visibility::new();
    for seed in 0..plans {
        let mut random = Random(seed);
        let ends = walls(&mut random);
        let plan = Plan::new(&ends.iter().map(|&[a, b]| Wall::new(a, b)).collect::<Vec<_>>()).unwrap();
        let reach = ends.iter().flatten().flatten().fold(0.0f64, |reach, x| reach.max(x.abs()));
        for _ in 0..eyes {
            // Inside of the walls' bounds, so that the polygon is all around the eye.
            let eye = [0, 1].map(|axis| {
                let of = || ends.iter().flatten().map(|end| end[axis]);
                random.range(of().fold(reach, f64::min), of().fold(-reach, f64::max))
            });
            plan.look(&PlanView::new(eye), &mut answer).unwrap();
            let polygon: Vec<Point> = answer.polygon().iter().map(|&p| minus(p, eye)).collect();
            let near: Vec<[Point; 2]> = ends.iter().map(|wall| wall.map(|end| minus(end, eye))).collect();
            for _ in 0..rays {
                let (sin, cos) = (random.unit() * std::f64::consts::TAU).sin_cos();
                let to = [cos, sin];
                // Where the polygon ends: at the side that passes from the right of the ray to its left.
                let sides = (0..polygon.len()).map(|i| [polygon[i], polygon[(i + 1) % polygon.len()]]);
                let crossed = sides.filter(|[a, b]| cross(to, *a) <= 0.0 && cross(to, *b) > 0.0);
                let edge = crossed.filter_map(|side| meet(to, side)).map(|[part, _]| part);
                let edge = edge.fold(f64::INFINITY, f64::min);
                // Walls up to a little behind the edge, and none that the ray passes at an end.
                let met: Vec<(usize, [f64; 2])> = near
                    .iter()
                    .enumerate()
                    .filter_map(|(wall, ends)| Some((wall, meet(to, *ends)?)))
                    .filter(|(_, [part, _])| *part < edge * (1.0 + 1e-6) + 1e-6)
                    .collect();
                if met.iter().any(|(_, [_, within])| within.abs() < 1e-9) {
                    unsure += 1;
                    continue;
                }
                compared += 1;
                let nearest = met
                    .iter()
                    .filter(|(_, [_, within])| *within > 0.0)
                    .min_by(|a, b| a.1[0].total_cmp(&b.1[0]));
                let place = || format!("seed {seed}, eye {eye:?}, ray {to:?}, edge at {edge}");
                if let Some(&(wall, [part, _])) = nearest {
                    assert!(
                        (part - edge).abs() <= 1e-7 * (1.0 + edge),
                        "{} but wall {wall} at {part}",
                        place()
                    );
                    // Walls at the same place on the ray may be named instead.
                    let is_seen = |&(wall, [at, within]): &(usize, [f64; 2])| {
                        within > 0.0
                            && at - part < 1e-7 * (1.0 + part)
                            && answer.walls().contains(&(wall as u32))
                    };
                    assert!(met.iter().any(is_seen), "{}: wall {wall} is not seen", place());
                } else {
                    // The rectangle around the plan: no wall ends the ray there.
                    let at = [eye[0] + edge * to[0], eye[1] + edge * to[1]];
                    let is_outside = [0, 1].iter().any(|&axis| {
                        let of = || ends.iter().flatten().map(|end| end[axis]);
                        at[axis] < of().fold(reach, f64::min) || at[axis] > of().fold(-reach, f64::max)
                    });
                    assert!(edge.is_finite() && is_outside, "{} ends at no wall", place());
                }
            }
        }
    }
    [compared, unsure]
}

#[test]
fn rays_end_where_the_polygon_does() {
    let [compared, unsure] = run(60, 20, 40);
    assert!(compared > 40_000 && unsure < compared / 100, "{compared} rays, {unsure} unsure");
}

/// `cargo test --release -p visibility-2d plan_rays -- --ignored --nocapture`
#[test]
#[ignore = "long: ten million rays"]
fn ten_million_rays_end_where_the_polygon_does() {
    let [compared, unsure] = run(2_000, 50, 102);
    println!("{compared} rays, {unsure} unsure");
    assert!(compared > 10_000_000 && unsure < compared / 100, "{compared} rays, {unsure} unsure");
}
