//! The linear-programming solver agrees with exact arithmetic and with `microlp`, on random and on degenerate
//! programs.
//!
//! `cargo test --release -p visibility-portals linear_programs -- --ignored --nocapture` tests a
//! million programs.

mod exact;

use exact::Exact;
use microlp::{ComparisonOp, OptimizationDirection, Problem, SolveOutcome};
use visibility_portals::lp::{Feasible, Greatest, HalfSpace, Solver};
use visibility_testing::Random;

/// Returns a random integer from `-most` to `most`, both included.
fn around(random: &mut Random, most: i128) -> i128 {
    random.below(2 * most as usize + 1) as i128 - most
}

const BOUND: i128 = 64;

/// Returns the rows `(a, b)` of a random integer program `a . x + b >= 0` in `d` variables, of one of five
/// kinds: arbitrary; with small coefficients, so that many rows meet in a point or coincide; mostly through
/// one point; with opposite pairs that touch or miss by one; nearly parallel. Some rows have all coefficients
/// zero.
fn program(d: usize, random: &mut Random) -> Vec<(Vec<i128>, i128)> {
    let (kind, count) = (random.below(5), 1 + random.below(24));
    let most = if kind == 0 || kind == 4 { 100 } else { 2 };
    let point: Vec<i128> = (0..d).map(|_| around(random, 9)).collect();
    let mut rows: Vec<(Vec<i128>, i128)> = Vec::new();
    while rows.len() < count {
        let a: Vec<i128> = (0..d).map(|_| around(random, most)).collect();
        let through: i128 = -a.iter().zip(&point).map(|(a, p)| a * p).sum::<i128>();
        let b = match kind {
            0 => around(random, 100 * d as i128) + 60,
            1 => around(random, 4) + 1,
            2 => through + i128::from(random.below(6) == 0),
            3 => through + around(random, 1) + 1,
            _ => through + around(random, 2) + 1,
        };
        let mut other: (Vec<i128>, i128) = (a.iter().map(|a| -a).collect(), -b + around(random, 1));
        if kind == 4 {
            let k = random.below(d);
            other.0[k] += around(random, 1);
        }
        if kind >= 3 && random.below(4) == 0 {
            rows.push(other);
        }
        if random.below(40) == 0 {
            rows.push((vec![0; d], around(random, 5) + 4));
        }
        if random.below(8) == 0 {
            rows.push((a.clone(), b));
        }
        rows.push((a, b));
    }
    rows
}

#[derive(Default, Debug)]
struct Tally {
    programs: u64,
    too_long: u64,
    feasible: u64,
    infeasible: u64,
    /// Number of undecided answers. Each is asserted to be on a program that a relative change of a
    /// millionth decides the other way.
    maybe: u64,
    unknown: u64,
    microlp_differs: u64,
}

fn size(row: &(Vec<i128>, i128)) -> i128 {
    row.0.iter().map(|a| a.abs()).max().unwrap_or(0).max(row.1.abs())
}

/// Tests whether moving all half-spaces in or out by a relative 2^-20 changes whether the program is
/// feasible. `None` if the exact solver overflows.
fn is_thin(rows: &[(Vec<i128>, i128)]) -> Option<bool> {
    let feasible = |by: i128| {
        let moved: Vec<_> = rows.iter().map(|row| (row.0.clone(), (row.1 << 20) + by * size(row))).collect();
        exact::solve(&moved, &vec![0; rows[0].0.len()], BOUND << 20).map(Exact::is_feasible)
    };
    Some(feasible(-1)? != feasible(1)?)
}

fn by_microlp<const D: usize>(rows: &[HalfSpace<D>], objective: [f64; D]) -> Option<f64> {
    let mut problem = Problem::new(OptimizationDirection::Maximize);
    let bounds = (-(BOUND as f64), BOUND as f64);
    let variables = objective.map(|o| problem.add_var(o, bounds));
    for row in rows {
        let terms: Vec<_> = variables.iter().copied().zip(row.normal).collect();
        problem.add_constraint(&terms, ComparisonOp::Ge, -row.offset);
    }
    match problem.solve() {
        Ok(SolveOutcome::Solution(solution)) => Some(solution.objective()),
        _ => None,
    }
}

fn compare<const D: usize>(solver: &mut Solver<D>, random: &mut Random, tally: &mut Tally) {
    let rows = program(D, random);
    let objective: [i128; D] = std::array::from_fn(|_| around(random, 10));
    let (Some(truth), Some(thin)) = (exact::solve(&rows, &objective, BOUND), is_thin(&rows)) else {
        tally.too_long += 1;
        return;
    };
    tally.programs += 1;
    let half = |(a, b): &(Vec<i128>, i128)| HalfSpace {
        normal: std::array::from_fn(|k| a[k] as f64),
        offset: *b as f64,
    };
    let halves: Vec<_> = rows.iter().map(half).collect();
    match solver.feasible(&halves, BOUND as f64) {
        Feasible::Yes(x) => {
            assert!(truth.is_feasible(), "{rows:?}");
            for row in &halves {
                let value: f64 = row.normal.iter().zip(x).map(|(a, x)| a * x).sum::<f64>() + row.offset;
                assert!(value > -1e-9, "{value} {rows:?}");
            }
            tally.feasible += 1;
        }
        Feasible::No(certificate) => {
            assert!(!truth.is_feasible(), "{rows:?}");
            let (mut sum, mut constant) = ([0.0; D], 0.0);
            assert!(
                certificate.multipliers().count() <= D + 1,
                "{rows:?}: at most one multiplier more than variables"
            );
            for (i, [l, rest]) in certificate.multipliers() {
                assert!(
                    l > 0.0 && rest.abs() <= l,
                    "{rows:?}: row {i} has the multiplier {l} with the rest {rest}"
                );
                constant += l * halves[i].offset;
                sum.iter_mut().zip(halves[i].normal).for_each(|(sum, a)| *sum += l * a);
            }
            let left: f64 = sum.iter().map(|s| s.abs() * BOUND as f64).sum::<f64>() + constant;
            assert!(left < 1e-9, "{left} {rows:?}");
            tally.infeasible += 1;
        }
        Feasible::Undecided => {
            assert!(thin, "undecided although it is clear: {rows:?}");
            tally.maybe += 1;
        }
    }
    let objective = objective.map(|o| o as f64);
    let other = by_microlp(&halves, objective);
    match (solver.greatest(&halves, objective, BOUND as f64), truth) {
        (Greatest::At(x), Exact::Greatest(numerator, denominator)) => {
            let value: f64 = objective.iter().zip(x).map(|(o, x)| o * x).sum();
            let right = numerator as f64 / denominator as f64;
            // Where the feasible set is very thin, rounding moves the best point far.
            let allowed = if thin { 1e-5 } else { 1e-7 };
            assert!((value - right).abs() <= allowed * (1.0 + right.abs()), "{value} {right} {rows:?}");
            let agrees = other.is_some_and(|o| (o - value).abs() <= allowed * (1.0 + right.abs()));
            assert!(agrees || thin, "{value} and microlp {other:?} {rows:?}");
            tally.microlp_differs += u64::from(!agrees);
        }
        (Greatest::Infeasible(_), truth) => {
            assert!(!truth.is_feasible(), "{rows:?}");
            assert!(other.is_none() || thin, "microlp {other:?} {rows:?}");
            tally.microlp_differs += u64::from(other.is_some());
        }
        (answer, _) => {
            assert!(thin, "{answer:?} although it is clear: {rows:?}");
            tally.unknown += 1;
        }
    }
}

fn run(programs: u64, seed: u64) -> Tally {
    let (mut random, mut tally) = (Random(seed), Tally::default());
    let (mut s1, mut s2, mut s3) = (Solver::new(), Solver::new(), Solver::new());
    let (mut s4, mut s5, mut s6) = (Solver::new(), Solver::new(), Solver::new());
    while tally.programs < programs {
        compare::<1>(&mut s1, &mut random, &mut tally);
        compare::<2>(&mut s2, &mut random, &mut tally);
        compare::<3>(&mut s3, &mut random, &mut tally);
        compare::<4>(&mut s4, &mut random, &mut tally);
        compare::<5>(&mut s5, &mut random, &mut tally);
        compare::<6>(&mut s6, &mut random, &mut tally);
    }
    tally
}

#[test]
fn agrees_with_exact_arithmetic_and_with_microlp() {
    let tally = run(12_000, 1);
    println!("{tally:?}");
    assert!(tally.feasible > 3000 && tally.infeasible > 3000, "{tally:?}");
    assert!(tally.too_long * 100 < tally.programs, "{tally:?}");
}

#[test]
#[ignore = "minutes"]
fn agrees_a_million_times() {
    std::thread::scope(|scope| {
        for seed in 2..10 {
            scope.spawn(move || println!("{:?}", run(125_000, seed)));
        }
    });
}

/// A program that the random test found: many nearly parallel opposite rows, so that each elimination loses
/// digits.
#[test]
fn nearly_parallel_opposites_are_decided() {
    let rows: [([i32; 6], i32); 24] = [
        ([53, 63, -77, -92, 98, 37], 73),
        ([-26, -92, -5, -63, -95, -62], 1079),
        ([0, 0, 0, 0, 0, 0], 1),
        ([26, 92, 5, 63, 96, 62], -1078),
        ([-41, 49, 91, 26, 82, -100], -1127),
        ([35, -83, 45, -20, 89, -78], -77),
        ([-35, 82, -45, 20, -89, 78], 76),
        ([-62, 65, 27, 83, 35, 85], -171),
        ([62, -65, -27, -84, -35, -85], 171),
        ([-38, 86, 55, -24, 40, -75], -798),
        ([38, -86, -55, 23, -40, 75], 799),
        ([-29, 91, 93, -35, -88, -57], -484),
        ([-71, 78, -82, -67, -89, -71], -84),
        ([71, -78, 82, 67, 90, 71], 85),
        ([73, -25, -64, 70, 95, -11], -1188),
        ([-76, -30, 71, 65, -89, -31], 99),
        ([-76, 36, 70, -83, -43, 14], 1217),
        ([-25, 68, 85, -16, -79, 82], 597),
        ([-66, 100, -66, -91, 29, 28], 611),
        ([13, -52, 23, 25, 0, -53], -300),
        ([-13, 52, -23, -25, 0, 53], 301),
        ([-20, 18, 19, 24, 71, -23], -453),
        ([37, -80, -84, 61, -30, 56], 236),
        ([-37, 80, 84, -60, 30, -56], -236),
    ];
    let halves = rows.map(|(a, b)| HalfSpace { normal: a.map(f64::from), offset: f64::from(b) });
    let answer = Solver::new().feasible(&halves, BOUND as f64);
    assert!(!matches!(answer, Feasible::Undecided), "nearly parallel opposites are decided");
}
