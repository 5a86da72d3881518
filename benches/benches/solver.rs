//! Benchmark of linear programs by dimension and size, beside `microlp`, and of stabbing lines by the number
//! of portals.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use microlp::{ComparisonOp, OptimizationDirection, Problem};
use std::hint::black_box;
use std::time::Duration;
use visibility_benches::workload::Random;
use visibility_core::glam::{DVec2, DVec3};
use visibility_portals::lp::{HalfSpace, Solver};
use visibility_portals::stabbing::Stabber;

/// Bound on the absolute value of every variable: each program is solved within a cube of twice this side
/// around the origin.
const BOUND: f64 = 100.0;

/// Number of different programs that are solved in turn, so that branch prediction cannot learn one program.
const PROGRAMS: usize = 64;

/// Makes linear programs of `count` random half-spaces in D dimensions. Boundaries are within 10 of the
/// origin; most half-spaces contain the origin, a few do not, so about half of the programs have no solution.
fn programs<const D: usize>(count: usize, random: &mut Random) -> Vec<Vec<HalfSpace<D>>> {
    let away = 0.7 / count as f32;
    let mut half = || HalfSpace {
        normal: std::array::from_fn(|_| f64::from(random.within(-1.0, 1.0))),
        offset: f64::from(random.within(0.0, 10.0)) * if random.within(0.0, 1.0) < away { -4.0 } else { 1.0 },
    };
    (0..PROGRAMS).map(|_| (0..count).map(|_| half()).collect()).collect()
}

/// Solves a program with `microlp` and returns the maximum of the objective, or NaN without a solution.
fn by_microlp<const D: usize>(rows: &[HalfSpace<D>], objective: [f64; D]) -> f64 {
    let mut problem = Problem::new(OptimizationDirection::Maximize);
    let variables = objective.map(|o| problem.add_var(o, (-BOUND, BOUND)));
    for row in rows {
        let terms: [_; D] = std::array::from_fn(|k| (variables[k], row.normal[k]));
        problem.add_constraint(terms, ComparisonOp::Ge, -row.offset);
    }
    match problem.solve() {
        Ok(microlp::SolveOutcome::Solution(solution)) => solution.objective(),
        _ => f64::NAN,
    }
}

fn dimension<const D: usize>(c: &mut Criterion) {
    let mut group = c.benchmark_group(format!("lp/{D} variables"));
    group.measurement_time(Duration::from_secs(2)).warm_up_time(Duration::from_secs(1));
    for count in [5, 20, 80] {
        let all = programs::<D>(count, &mut Random(D as u64));
        let objective: [f64; D] = std::array::from_fn(|k| 1.0 - 0.3 * k as f64);
        let (mut solver, mut next) = (Solver::new(), 0);
        let mut turn = || {
            next = (next + 1) % PROGRAMS;
            next
        };
        group.bench_function(BenchmarkId::new("feasible", count), |b| {
            b.iter(|| solver.feasible(black_box(&all[turn()]), BOUND))
        });
        group.bench_function(BenchmarkId::new("greatest", count), |b| {
            b.iter(|| solver.greatest(black_box(&all[turn()]), objective, BOUND))
        });
        group.bench_function(BenchmarkId::new("microlp", count), |b| {
            b.iter(|| by_microlp(black_box(&all[turn()]), objective))
        });
    }
    group.finish();
}

/// Measures stabbing lines through doors along a winding path, in the plane and in space.
fn stabbing(c: &mut Criterion) {
    let mut group = c.benchmark_group("stabbing");
    group.measurement_time(Duration::from_secs(2)).warm_up_time(Duration::from_secs(1));
    for length in [3, 6, 12, 24] {
        let mut random = Random(length as u64);
        let (mut plans, mut spaces) = (Vec::new(), Vec::new());
        for _ in 0..PROGRAMS {
            let (mut plan, mut space) = (Vec::new(), Vec::new());
            for i in 0..length {
                let mut at = |size: f32| f64::from(random.within(-size, size));
                let (x, y, z) = (4.0 * i as f64, at(1.0), at(1.0));
                plan.push([DVec2::new(x + at(1.0), y + 1.2), DVec2::new(x, y - 1.2)]);
                let corners = [[-1.2, -1.2], [1.2, -1.2], [1.2, 1.2], [-1.2, 1.2]];
                let (lean, tilt) = (at(0.4), at(0.4));
                space.push(corners.map(|[a, b]| DVec3::new(x + lean * a + tilt * b, y + a, z + b)));
            }
            plans.push(plan);
            spaces.push(space);
        }
        let (mut stabber, mut next) = (Stabber::new(1e-6), 0);
        let mut turn = || {
            next = (next + 1) % PROGRAMS;
            next
        };
        group.bench_function(BenchmarkId::new("segments", length), |b| {
            b.iter(|| stabber.segments(black_box(&plans[turn()])))
        });
        group.bench_function(BenchmarkId::new("polygons", length), |b| {
            b.iter(|| stabber.polygons(black_box(&spaces[turn()])))
        });
    }
    group.finish();
}

criterion_group!(
    benches,
    dimension::<2>,
    dimension::<3>,
    dimension::<4>,
    dimension::<5>,
    dimension::<6>,
    stabbing
);
criterion_main!(benches);
