//! The recursion of Seidel's algorithm: a program in d variables is solved by programs in d - 1.
//!
//! This work is based on: Raimund Seidel, "Small-Dimensional Linear Programming and Convex Hulls Made Easy",
//! 1991. Constraints are inspected one by one, in random order. As long as the point found so far satisfies
//! the next constraint, the point is kept. Otherwise the new point lies in the plane of that constraint, and
//! a program of one dimension less, made of the constraints before it, finds the point. In random order the
//! i-th constraint requires this with probability d / i, which gives O(d! n) steps in all.
//!
//! In five dimensions, the next constraint inspected is the one that the point found so far violates most (as
//! in Bernd Gaertner, "Fast and Robust Smallest Enclosing Balls", 1999). In lower dimensions it is the next
//! one in random order. Few constraints then need a program in their planes, and those programs are short.
//!
//! All computation here is ordinary `f64` with a tolerance and proves nothing. It proposes the few
//! constraints that seem to contradict each other. One macro makes a function for each dimension, so that
//! each row is an array of fixed length.

use alloc::vec::Vec;
use visibility_core::random::Random;

/// Number of variables of a program.
pub(super) const DIMENSIONS: usize = 5;

/// Tag of the bounds of all variables. A smaller tag is the index of a constraint.
const BOX: u32 = u32::MAX;

/// Bound on the absolute value of each variable, so that every program has a bounded solution. If all
/// solutions exceed the bound, the constraints seem to contradict each other; but then no certificate is
/// found, since certificates do not use the bound.
const BOUND: f64 = 1e6;

/// Tolerance of constraints: a point counts as satisfying a constraint if the constraint is violated by less
/// than this, relative to the point's greatest coordinate and to the constraint's greatest coefficient. No
/// proof depends on this value.
const TOLERANCE: f64 = 1e-12;

/// Threshold below which a coefficient counts as zero, in rows scaled so that the greatest coefficient is 1.
const ZERO_COEFFICIENT: f64 = 1e-13;

/// Maximum number of inspections of rows (constraints) in the programs of all dimensions together, for each
/// row of the full program. In random order the limit is practically never reached.
const STEPS_PER_ROW: u64 = 200_000;

/// Why the solver found no point.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Stop {
    /// The constraints in [`SeidelSolver::conflict`] contradict each other, up to rounding.
    Conflict,
    /// The limit of steps was reached.
    GaveUp,
}

/// Rows (constraints) of a linear program in `N - 1` variables: the coefficients, then the constant, and the
/// tag of the constraint (an index, or [`BOX`]). The greatest coefficient is 1 in absolute value, or all are
/// zero.
type Rows<const N: usize> = Vec<([f64; N], u32)>;

/// Scratch memory of Seidel's algorithm: the rows (constraints) of the programs of all dimensions, and the
/// constraints that the last infeasible program found to contradict each other (the conflict).
#[derive(Clone, Debug, Default)]
pub(super) struct SeidelSolver {
    rows1: Rows<2>,
    rows2: Rows<3>,
    rows3: Rows<4>,
    rows4: Rows<5>,
    rows5: Rows<6>,
    /// By dimension d: the tag of the constraint on whose boundary plane the program of dimension d - 1 is
    /// solved.
    tight: [u32; DIMENSIONS + 1],
    /// The conflict: tags of the constraints that contradict each other, after [`Stop::Conflict`]. The first
    /// `conflicting` entries are in use.
    conflict: [u32; DIMENSIONS + 1],
    conflicting: usize,
    steps: u64,
}

impl SeidelSolver {
    /// Returns the indices of the constraints that, with bounds of the variables, were found to contradict
    /// each other in the last program. Empty if there was no contradiction.
    pub(super) fn conflict(&self) -> impl Iterator<Item = usize> + '_ {
        self.conflict[..self.conflicting].iter().filter(|tag| **tag != BOX).map(|&tag| tag as usize)
    }

    /// Records a conflict (a set of constraints that contradict each other) and returns [`Stop::Conflict`].
    /// The conflict consists of `rows`, the tags of contradicting rows of the program of dimension
    /// `dimension`, and of the constraints in whose planes this program lies, one for each higher dimension.
    fn conflict_of(&mut self, rows: &[u32], dimension: usize) -> Stop {
        let above = DIMENSIONS - dimension;
        self.conflict[..above].copy_from_slice(&self.tight[dimension + 1..]);
        self.conflict[above..above + rows.len()].copy_from_slice(rows);
        self.conflicting = above + rows.len();
        Stop::Conflict
    }

    /// Solves the program in one variable: the feasible point nearest to zero, which keeps the numbers small.
    fn solve1(&mut self) -> Result<[f64; 1], Stop> {
        let ((mut low, mut high), (mut by_low, mut by_high)) = ((-BOUND, BOUND), (BOX, BOX));
        for i in 0..self.rows1.len() {
            let ([a, b], tag) = self.rows1[i];
            if a == 0.0 && b < -TOLERANCE {
                return Err(self.conflict_of(&[tag], 1));
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
            return Err(self.conflict_of(&[by_low, by_high], 1));
        }
        Ok([if low > 0.0 {
            low
        } else if high < 0.0 {
            high
        } else {
            0.0
        }])
    }

    fn take_steps(&mut self, count: usize) -> Result<(), Stop> {
        self.steps = self.steps.checked_sub(count as u64).ok_or(Stop::GaveUp)?;
        Ok(())
    }
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

/// Returns `row` without the element at index `k`; `M` must be `N - 1`.
fn without<const N: usize, const M: usize>(row: &[f64; N], k: usize) -> [f64; M] {
    let mut out = [0.0; M];
    out[..k].copy_from_slice(&row[..k]);
    out[k..].copy_from_slice(&row[k + 1..]);
    out
}

macro_rules! level {
    ($solve:ident, $rows:ident, $d:literal, $lower:ident, $lower_rows:ident, $less:literal) => {
        impl SeidelSolver {
            fn $solve(&mut self) -> Result<[f64; $d], Stop> {
                // Starts at zero, where numbers are small.
                let (mut x, mut allowed) = ([0.0; $d], TOLERANCE);
                // Invariant: `x` satisfies the rows before `i`.
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
                        if $d < DIMENSIONS {
                            break;
                        }
                    }
                    let Some(worst) = worst else { break };
                    if $d < DIMENSIONS {
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
                        return Err(self.conflict_of(&[tag], $d));
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
                    for side in [-1.0, 1.0] {
                        let mut row = sum.map(|s| s * side);
                        row[$less] += BOUND;
                        self.$lower_rows.push((normalised(row), BOX));
                    }
                    self.take_steps(self.$rows.len() + 3)?;
                    let y = self.$lower()?;
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

level!(solve2, rows2, 2, solve1, rows1, 1);
level!(solve3, rows3, 3, solve2, rows2, 2);
level!(solve4, rows4, 4, solve3, rows3, 3);
level!(solve5, rows5, 5, solve4, rows4, 4);

fn greater(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

impl SeidelSolver {
    /// Searches a point that satisfies `constraints` and whose coordinates are at most [`BOUND`] in absolute
    /// value, up to rounding. A constraint is its five coefficients and its constant.
    ///
    /// # Errors
    /// [`Stop::Conflict`] if the constraints seem to contradict each other, [`Stop::GaveUp`] at the limit of
    /// steps.
    pub(super) fn solve(&mut self, constraints: &[([f64; DIMENSIONS], f64)]) -> Result<(), Stop> {
        self.steps = STEPS_PER_ROW * (constraints.len() as u64 + 1);
        self.conflicting = 0;
        self.rows5.clear();
        self.rows5.extend(
            (0..)
                .zip(constraints)
                .map(|(i, &([a, b, c, d, e], constant))| (normalised([a, b, c, d, e, constant]), i)),
        );
        // A random order of the constraints makes the expected time linear.
        shuffle(&mut self.rows5);
        self.solve5().map(|_| ())
    }
}

/// Shuffles the rows into a random order that depends only on their number (Fisher and Yates).
fn shuffle<T>(rows: &mut [T]) {
    let mut random = Random(0);
    for i in (1..rows.len()).rev() {
        // The upper 32 bits times the count, divided by 2^32: below the count.
        let j = ((random.bits() >> 32) * (i as u64 + 1)) >> 32;
        rows.swap(i, j as usize);
    }
}
