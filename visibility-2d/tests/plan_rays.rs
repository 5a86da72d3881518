//! Tests of visibility polygons by rays: each ray leaves the polygon at the nearest wall, and this wall is
//! seen. The nearest wall is found by testing all walls, without a triangulation.

use visibility_2d::cdt::{Plan, PlanView, Visibility, Wall};
use visibility_testing::{Random, judged, told_enough};

type Point = [f64; 2];

fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

/// Returns two numbers for a ray from the origin along `to` and a segment that meet: the distance in lengths
/// of `to`, and the distance from the nearer end of the segment in lengths of the segment.
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

/// Returns the number of compared rays, and of rays too close to a wall end to tell.
fn run(plans: u64, eyes: usize, rays: usize) -> [u64; 2] {
    let [mut compared, mut unsure] = [0; 2];
    let mut answer = Visibility::new();
    for seed in 0..plans {
        let mut random = Random(seed);
        let ends = walls(&mut random);
        let plan = Plan::new(&ends.iter().map(|&[a, b]| Wall::new(a, b)).collect::<Vec<_>>()).unwrap();
        let reach = ends.iter().flatten().flatten().fold(0.0f64, |reach, x| reach.max(x.abs()));
        for _ in 0..eyes {
            // The eye is inside the walls' bounds, so the polygon surrounds it.
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
                // The ray leaves the polygon through the side that runs from its right to its left.
                let sides = (0..polygon.len()).map(|i| [polygon[i], polygon[(i + 1) % polygon.len()]]);
                let crossed = sides.filter(|[a, b]| cross(to, *a) <= 0.0 && cross(to, *b) > 0.0);
                let edge = crossed.filter_map(|side| meet(to, side)).map(|[part, _]| part);
                let edge = edge.fold(f64::INFINITY, f64::min);
                // Walls up to slightly behind the polygon's edge. Rays that pass a wall end are skipped.
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
                    // If several walls meet the ray at the same point, any of them may be listed as seen.
                    let is_seen = |&(wall, [at, within]): &(usize, [f64; 2])| {
                        within > 0.0
                            && at - part < 1e-7 * (1.0 + part)
                            && answer.walls().contains(&(wall as u32))
                    };
                    assert!(met.iter().any(is_seen), "{}: wall {wall} is not seen", place());
                } else {
                    // The ray ends at the rectangle around the plan, so no wall stops it.
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
    judged(compared);
    told_enough(
        compared > 40_000 && unsure < compared / 100,
        format_args!("{compared} rays, {unsure} unsure"),
    );
}
