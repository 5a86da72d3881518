//! The recursion of Seidel's algorithm: a program in d variables is solved by programs in d - 1.
//!
//! This work is based on: Raimund Seidel, "Small-Dimensional Linear Programming and Convex Hulls Made Easy",
//! 1991. Constraints are inspected one by one, in random order. As long as the best point so far satisfies
//! the next constraint, the point is kept. Otherwise the new best point lies in the plane of that constraint,
//! and a program of one dimension less, made of the constraints before it, finds the point. In random order
//! the i-th constraint requires this with probability d / i, which gives O(d! n) steps in all.
//!
//! At full dimension, the next constraint inspected is the one that the best point so far violates most (as
//! in Bernd Gaertner, "Fast and Robust Smallest Enclosing Balls", 1999). In lower dimensions it is the next
//! one in random order. Few constraints then need a program in their planes, and those programs are short.
//!
//! All computation here is ordinary `f64` with a tolerance and proves nothing. It proposes a point, or the
//! few constraints that seem to contradict each other. One macro makes a function for each dimension, so that
//! each row is an array of fixed length.

use alloc::vec::Vec;
use visibility_core::random::Random;

/// Maximum number of variables of a program.
pub(crate) const DIMENSIONS: usize = 6;

/// First tag of the bounds of the box. A tag names a constraint or a bound: the upper bound of variable k has
/// the tag `BOX + 2 k`, the lower bound `BOX + 2 k + 1`, and smaller tags are indices of constraints.
pub(crate) const BOX: u32 = u32::MAX - 2 * DIMENSIONS as u32;

/// Tolerance of constraints: a point counts as satisfying a constraint if the constraint is violated by less
/// than this, relative to the point's greatest coordinate and to the constraint's greatest coefficient. No
/// proof depends on this value.
const TOLERANCE: f64 = 1e-12;

/// Threshold below which a coefficient counts as zero, in rows scaled so that the greatest coefficient is 1.
const ZERO_COEFFICIENT: f64 = 1e-13;

/// Maximum number of inspections of rows (constraints) in the programs of all dimensions together, for each
/// row of the full program. In random order the limit is practically never reached.
const STEPS_PER_ROW: u64 = 200_000;

/// Why the solver returned no point.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Stop {
    /// The constraints in [`SeidelSolver::conflict`] contradict each other, up to rounding.
    Conflict,
    /// The limit of steps was reached, or the dimension is not supported.
    GaveUp,
}

/// Rows (constraints) of the program of one dimension: the coefficients, then the constant, and the tag of
/// the constraint (an index, or see [`BOX`]). The greatest coefficient is 1 in absolute value, or all are
/// zero.
type Rows<const N: usize> = Vec<([f64; N], u32)>;

/// Scratch memory of Seidel's algorithm: the rows (constraints) of the programs of all dimensions, and the
/// constraints that the last infeasible program found to contradict each other (the conflict).
#[derive(Clone, Debug, Default)]
pub(crate) struct SeidelSolver {
    rows1: Rows<2>,
    rows2: Rows<3>,
    rows3: Rows<4>,
    rows4: Rows<5>,
    rows5: Rows<6>,
    rows6: Rows<7>,
    /// By dimension d: the tag of the constraint on whose boundary plane the program of dimension d - 1 is
    /// solved.
    tight: [u32; DIMENSIONS + 1],
    /// The conflict: tags (see [`BOX`]) of the constraints that contradict each other, after
    /// [`Stop::Conflict`]. The first `conflicting` entries are in use.
    conflict: [u32; DIMENSIONS + 1],
    conflicting: usize,
    steps: u64,
    /// The box in which the program is solved: for each variable, by index, the bound on the variable's
    /// absolute value.
    bounds: [f64; DIMENSIONS],
    /// Seed of the random order in which the rows (constraints) are inserted.
    pub(crate) seed: u64,
}

impl SeidelSolver {
    /// Returns the tags of the constraints that contradict each other. Empty if the last program had no
    /// contradiction. A tag is the index of a constraint, or [`BOX`] and above for a bound of a variable.
    pub(crate) fn conflict(&self) -> &[u32] {
        &self.conflict[..self.conflicting]
    }

    /// Returns the indices of the given constraints that, with bounds of the box of allowed points, were
    /// found to contradict each other in the last program; in the order of [`conflict`](Self::conflict).
    /// Empty if there was no contradiction.
    pub(crate) fn conflicting_rows(&self) -> impl Iterator<Item = usize> + '_ {
        self.conflict().iter().filter(|tag| **tag < BOX).map(|&tag| tag as usize)
    }

    /// Records a conflict (a set of constraints that contradict each other) and returns [`Stop::Conflict`].
    /// The conflict consists of `rows`, the tags of contradicting rows of the program of dimension
    /// `dimension`, and of the constraints in whose planes this program lies, one for each higher dimension
    /// up to `top`.
    fn conflict_of(&mut self, rows: &[u32], dimension: usize, top: usize) -> Stop {
        let above = top - dimension;
        self.conflict[..above].copy_from_slice(&self.tight[dimension + 1..=top]);
        self.conflict[above..above + rows.len()].copy_from_slice(rows);
        self.conflicting = above + rows.len();
        Stop::Conflict
    }

    /// Solves the program in one variable. `variable` is its index in the full program, `top` the dimension
    /// of the full program.
    fn solve1(&mut self, objective: [f64; 1], [variable]: [usize; 1], top: usize) -> Result<[f64; 1], Stop> {
        let bound = self.bounds[variable];
        let ((mut low, mut high), [mut by_high, mut by_low]) = ((-bound, bound), bound_tags(variable));
        for i in 0..self.rows1.len() {
            let ([a, b], tag) = self.rows1[i];
            if a == 0.0 && b < -TOLERANCE {
                return Err(self.conflict_of(&[tag], 1, top));
            }
            let at = -b / a;
            if a > 0.0 && at > low {
                (low, by_low) = (at, tag);
            } else if a < 0.0 && at < high {
                (high, by_high) = (at, tag);
            }
        }
        self.take_steps(self.rows1.len())?;
        if low > high + TOLERANCE * (1.0 + high.abs()) {
            return Err(self.conflict_of(&[by_low, by_high], 1, top));
        }
        // Without an objective any point will do. The feasible point nearest to zero keeps the numbers small.
        let x = match objective[0] {
            o if o > 0.0 => high,
            o if o < 0.0 => low,
            _ if low > 0.0 => low,
            _ if high < 0.0 => high,
            _ => 0.0,
        };
        Ok([x])
    }

    fn take_steps(&mut self, count: usize) -> Result<(), Stop> {
        self.steps = self.steps.checked_sub(count as u64).ok_or(Stop::GaveUp)?;
        Ok(())
    }
}

/// Returns the tags of the upper and of the lower bound of the variable with index `variable`: [`BOX`] plus
/// `2 * variable`, and one more.
fn bound_tags(variable: usize) -> [u32; 2] {
    [BOX + 2 * variable as u32, BOX + 2 * variable as u32 + 1]
}

/// Scales a row so that its greatest coefficient is 1 in absolute value. If all coefficients are negligible,
/// they become zero and the constant is kept.
fn normalised<const N: usize>(mut row: [f64; N]) -> [f64; N] {
    let mut most = 0.0;
    for a in &row[..N - 1] {
        most = if a.abs() > most { a.abs() } else { most };
    }
    if most <= ZERO_COEFFICIENT {
        row[..N - 1].fill(0.0);
        return row;
    }
    let inverse = 1.0 / most;
    for a in &mut row {
        *a *= inverse;
    }
    row
}

/// Returns `array` without the element at index `k`; `M` must be `N - 1`.
fn without<T: Copy + Default, const N: usize, const M: usize>(array: &[T; N], k: usize) -> [T; M] {
    let mut out = [T::default(); M];
    out[..k].copy_from_slice(&array[..k]);
    out[k..].copy_from_slice(&array[k + 1..]);
    out
}

macro_rules! level {
    ($solve:ident, $rows:ident, $d:literal, $n:literal, $lower:ident, $lower_rows:ident, $less:literal) => {
        impl SeidelSolver {
            fn $solve(
                &mut self,
                objective: [f64; $d],
                variables: [usize; $d],
                top: usize,
            ) -> Result<[f64; $d], Stop> {
                // Starts at the best corner of the box. Coordinates without an objective start at 0, where
                // numbers are small.
                let (mut x, mut allowed) = ([0.0; $d], TOLERANCE);
                for k in 0..$d {
                    if objective[k] != 0.0 {
                        x[k] = self.bounds[variables[k]] * objective[k].signum();
                        allowed = greater(allowed, x[k].abs() * TOLERANCE);
                    }
                }
                // Invariant: `x` is the best point of the rows before `i`.
                let mut i = 0;
                while i < self.$rows.len() {
                    let (mut least, mut worst) = (-allowed, None);
                    for (place, (row, _)) in self.$rows[i..].iter().enumerate() {
                        let mut value = row[$d];
                        for k in 0..$d {
                            value += row[k] * x[k];
                        }
                        if value >= least {
                            continue;
                        }
                        (least, worst) = (value, Some(i + place));
                        if $d < top {
                            break;
                        }
                    }
                    let Some(worst) = worst else { break };
                    if $d < top {
                        i = worst;
                    } else {
                        self.$rows.swap(i, worst);
                    }
                    let (row, tag) = self.$rows[i];
                    let mut k = 0;
                    for j in 1..$d {
                        k = if row[j].abs() > row[k].abs() { j } else { k };
                    }
                    if row[k] == 0.0 {
                        return Err(self.conflict_of(&[tag], $d, top));
                    }
                    // In the plane of this row, x_k is a linear function of the other variables.
                    self.tight[$d] = tag;
                    let inverse = 1.0 / row[k];
                    let mut sum: [f64; $d] = without(&row, k);
                    for s in &mut sum {
                        *s *= -inverse;
                    }
                    self.$lower_rows.clear();
                    for (earlier, tag) in &self.$rows[..i] {
                        let mut row: [f64; $d] = without(earlier, k);
                        for (r, s) in row.iter_mut().zip(&sum) {
                            *r += earlier[k] * s;
                        }
                        self.$lower_rows.push((normalised(row), *tag));
                    }
                    // The bounds of x_k come last, since they seldom matter.
                    let bound = self.bounds[variables[k]];
                    for (side, tag) in [-1.0, 1.0].into_iter().zip(bound_tags(variables[k])) {
                        let mut row = sum;
                        for s in &mut row {
                            *s *= side;
                        }
                        row[$less] += bound;
                        self.$lower_rows.push((normalised(row), tag));
                    }
                    self.take_steps(self.$rows.len() + 3)?;
                    let mut lower_objective: [f64; $less] = without(&objective, k);
                    for (o, s) in lower_objective.iter_mut().zip(&sum) {
                        *o += objective[k] * s;
                    }
                    let y = self.$lower(lower_objective, without(&variables, k), top)?;
                    x[..k].copy_from_slice(&y[..k]);
                    x[k + 1..].copy_from_slice(&y[k..]);
                    x[k] = sum[$less];
                    allowed = TOLERANCE;
                    for (s, y) in sum.iter().zip(&y) {
                        x[k] += s * y;
                    }
                    for x in &x {
                        allowed = greater(allowed, x.abs() * TOLERANCE);
                    }
                    // Move to front: a row that was violated once is likely to be violated again, so programs
                    // of one dimension less inspect it first (Emo Welzl, "Smallest Enclosing Disks (Balls and
                    // Ellipsoids)", 1991).
                    self.$rows[..=i].rotate_right(1);
                    i += 1;
                }
                Ok(x)
            }
        }
    };
}

level!(solve2, rows2, 2, 3, solve1, rows1, 1);
level!(solve3, rows3, 3, 4, solve2, rows2, 2);
level!(solve4, rows4, 4, 5, solve3, rows3, 3);
level!(solve5, rows5, 5, 6, solve4, rows4, 4);
level!(solve6, rows6, 6, 7, solve5, rows5, 5);

fn greater(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

impl SeidelSolver {
    /// Returns a point that satisfies `count` constraints and maximizes the objective within the box `|x_k|
    /// <= bounds[k]`, up to rounding. `constraint` returns coefficients and constant by index. The dimension
    /// is the length of the objective.
    ///
    /// # Errors
    /// [`Stop::Conflict`] if the constraints seem to contradict each other, [`Stop::GaveUp`] at the limit of
    /// steps or if the dimension is not from 1 to [`DIMENSIONS`].
    pub(crate) fn solve<const D: usize>(
        &mut self,
        count: usize,
        mut constraint: impl FnMut(usize) -> ([f64; D], f64),
        objective: [f64; D],
        bounds: [f64; D],
    ) -> Result<[f64; D], Stop> {
        self.steps = STEPS_PER_ROW * (count as u64 + 1);
        self.conflicting = 0;
        self.bounds[..D].copy_from_slice(&bounds);
        // One instance for each dimension, whose arrays have a fixed size. A random order of the constraints
        // makes the expected time linear.
        macro_rules! run {
            ($solve:ident, $rows:ident, $d:literal, $n:literal) => {{
                self.$rows.clear();
                for i in 0..count {
                    let (normal, offset) = constraint(i);
                    let mut row = [0.0; $n];
                    row[..$d].copy_from_slice(&normal);
                    row[$d] = offset;
                    self.$rows.push((normalised(row), i as u32));
                }
                shuffle(&mut self.$rows, self.seed);
                let mut fixed = [0.0; $d];
                fixed.copy_from_slice(&objective);
                let mut variables = [0; $d];
                variables.iter_mut().enumerate().for_each(|(k, variable)| *variable = k);
                let found = self.$solve(fixed, variables, $d)?;
                let mut x = [0.0; D];
                x.copy_from_slice(&found);
                Ok(x)
            }};
        }
        match D {
            1 => run!(solve1, rows1, 1, 2),
            2 => run!(solve2, rows2, 2, 3),
            3 => run!(solve3, rows3, 3, 4),
            4 => run!(solve4, rows4, 4, 5),
            5 => run!(solve5, rows5, 5, 6),
            6 => run!(solve6, rows6, 6, 7),
            _ => Err(Stop::GaveUp),
        }
    }
}

/// Shuffles the rows into a random order that depends only on their number and on the seed (Fisher and
/// Yates).
fn shuffle<T>(rows: &mut [T], seed: u64) {
    let mut random = Random(seed);
    for i in (1..rows.len()).rev() {
        // The upper 32 bits times the count, divided by 2^32: below the count.
        let j = ((random.bits() >> 32) * (i as u64 + 1)) >> 32;
        rows.swap(i, j as usize);
    }
}
