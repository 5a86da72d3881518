//! Benchmarks of visibility on a plan: queries and builds.
//!
//! Maps are floors of rooms with jittered corners, doors and pillars, and a forest of short walls. Each
//! iteration queries from 100 eyes, so the time of a query is a hundredth of the printed time.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use visibility_2d::cdt::{Plan, PlanView, RegionVisibility, Visibility, Wall};

/// Linear congruential generator, so that maps are the same in each run.
struct Random(u64);

impl Random {
    fn range(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Makes the walls of `n` by `n` rooms of 128 units.
fn rooms(n: i32, random: &mut Random) -> Vec<Wall> {
    let count = n + 1;
    let corner = |i: i32, j: i32, random: &mut Random| {
        [i, j].map(|k| f64::from(k * 128) + random.range(-40.0, 40.0).round())
    };
    let corners: Vec<_> = (0..count * count).map(|k| corner(k % count, k / count, random)).collect();
    let at = |i: i32, j: i32| corners[(j * count + i) as usize];
    let mut walls = Vec::new();
    let mut wall = |a: [f64; 2], b: [f64; 2], is_outer: bool, random: &mut Random| {
        let part = |t: f64| [0, 1].map(|axis| (a[axis] + t * (b[axis] - a[axis])).round());
        let kind = random.range(0.0, 1.0);
        if is_outer || (0.35..0.6).contains(&kind) {
            walls.push(Wall::new(a, b));
        } else if kind >= 0.6 {
            walls.push(Wall::new(a, part(random.range(0.2, 0.4))));
            walls.push(Wall::new(part(random.range(0.5, 0.8)), b));
        }
    };
    for i in 0..count {
        for j in 0..n {
            let is_outer = i == 0 || i == n;
            wall(at(i, j), at(i, j + 1), is_outer, random);
            wall(at(j, i), at(j + 1, i), is_outer, random);
        }
    }
    for k in 0..n * n {
        if random.range(0.0, 1.0) < 0.3 {
            let [x, y] = [k % n, k / n].map(|k| f64::from(k * 128 + 64));
            let r = random.range(6.0, 16.0).round();
            let square = [[x - r, y], [x, y - r], [x + r, y], [x, y + r]];
            walls.extend((0..4).map(|i| Wall::new(square[i], square[(i + 1) % 4])));
        }
    }
    walls
}

/// Makes walls 3 units long, one per 100 square units.
fn forest(count: usize, random: &mut Random) -> Vec<Wall> {
    let side = (count as f64).sqrt() * 10.0;
    (0..count)
        .map(|_| {
            let [x, y] = [0, 1].map(|_| random.range(0.0, side));
            let (sin, cos) = random.range(0.0, std::f64::consts::PI).sin_cos();
            Wall::new([x - 1.5 * cos, y - 1.5 * sin], [x + 1.5 * cos, y + 1.5 * sin])
        })
        .collect()
}

fn plans(criterion: &mut Criterion) {
    for n in [7, 14, 24] {
        let random = &mut Random(n as u64);
        let walls = rooms(n, random);
        let plan = Plan::from_walls(&walls, 8.0).unwrap();
        let side = f64::from(n * 128);
        let eyes: Vec<_> = (0..100).map(|_| [0, 1].map(|_| random.range(0.0, side))).collect();
        let mut group = criterion.benchmark_group(format!("rooms_{}", walls.len()));
        group.sample_size(10);
        let mut answer = Visibility::new();
        group.bench_function("plan", |bencher| {
            bencher.iter(|| {
                for &eye in &eyes {
                    plan.look(&PlanView::new(eye), &mut answer).unwrap();
                    black_box(answer.area());
                }
            });
        });
        let mut region = RegionVisibility::new();
        let count = plan.triangle_count() as u32;
        group.bench_function("region", |bencher| {
            bencher.iter(|| {
                for k in 0..100 {
                    let triangle = plan.triangle(k * 7919 % count).unwrap();
                    plan.look_from_region(&triangle, &mut region).unwrap();
                    black_box(region.walls().len());
                }
            });
        });
        group.bench_function("sees", |bencher| {
            bencher.iter(|| {
                for pair in eyes.windows(2) {
                    black_box(plan.sees(pair[0], pair[1]).unwrap());
                }
            });
        });
        group.bench_function("build", |bencher| {
            bencher.iter_batched(|| walls.clone(), |walls| Plan::new(&walls).unwrap(), BatchSize::LargeInput);
        });
        group.finish();
    }
    let random = &mut Random(1);
    let walls = forest(100_000, random);
    let plan = Plan::new(&walls).unwrap();
    let side = (walls.len() as f64).sqrt() * 10.0;
    let eyes: Vec<_> = (0..100).map(|_| [0, 1].map(|_| random.range(0.3 * side, 0.7 * side))).collect();
    let mut group = criterion.benchmark_group("forest_100000");
    group.sample_size(10);
    let mut answer = Visibility::new();
    group.bench_function("plan", |bencher| {
        bencher.iter(|| {
            for &eye in &eyes {
                plan.look(&PlanView::new(eye), &mut answer).unwrap();
                black_box(answer.area());
            }
        });
    });
    group.bench_function("build", |bencher| {
        bencher.iter_batched(|| walls.clone(), |walls| Plan::new(&walls).unwrap(), BatchSize::LargeInput);
    });
    group.finish();
}

criterion_group!(benches, plans);
criterion_main!(benches);
