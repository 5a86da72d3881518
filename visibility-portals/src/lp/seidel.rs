//! The recursion: a program in d variables by programs in d - 1.
//!
//! This work is based on: Raimund Seidel, "Small-Dimensional Linear Programming and Convex Hulls Made Easy",
//! 1991. Constraints are looked at one by one, in random order. As long as the best point so far satisfies
//! the next one, nothing happens; if it does not, the new best point lies in the plane of that constraint,
//! and a program of one dimension less, of the constraints before it, finds it. In random order the i-th does
//! so with probability d / i, which makes O(d! n) steps in all.
//!
//! In the program itself, not in those of fewer dimensions, the next constraint is the one that the best
//! point so far is farthest from satisfying (as Bernd Gaertner, "Fast and Robust Smallest Enclosing Balls",
//! 1999, does): few are ever looked at in their planes, and those programs of fewer dimensions are short.
//!
//! Everything here is ordinary `f64` with a tolerance and proves nothing: it proposes a point, or the few
//! constraints that seem to contradict each other. One function for each dimension, made by one macro, so
//! that each row is an array of known length.

use alloc::vec::Vec;

/// The most variables.
pub(crate) const DIMENSIONS: usize = 6;

/// From here on, tags name the bounds of the box: the upper bound of variable k is `BOX + 2 k`, the lower one
/// `BOX + 2 k + 1`.
pub(crate) const BOX: u32 = u32::MAX - 2 * DIMENSIONS as u32;

/// A point that is outside of a constraint by less satisfies it; relative to the size of the point and to the
/// greatest coefficient. No proof depends on it.
const TOLERANCE: f64 = 1e-12;

/// Coefficients of size one that cancel to less are zero.
const NOTHING: f64 = 1e-13;

/// Rows looked at, by all levels together and for each row of the program, before it is given up. In random
/// order that is as good as impossible.
const STEPS_PER_ROW: u64 = 200_000;

/// Why there is no point.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Stop {
    /// The constraints in [`Levels::conflict`] contradict each other, up to rounding.
    Conflict,
    /// The limit of steps was reached.
    GaveUp,
}

/// Rows of one dimension: coefficients, then the constant, and a tag. The greatest coefficient is 1 or -1, or
/// all are zero.
type Rows<const N: usize> = Vec<([f64; N], u32)>;

/// Scratch memory of the programs of all dimensions.
#[derive(Clone, Debug, Default)]
pub(crate) struct Levels {
    rows1: Rows<2>,
    rows2: Rows<3>,
    rows3: Rows<4>,
    rows4: Rows<5>,
    rows5: Rows<6>,
    rows6: Rows<7>,
    /// By dimension: the constraint in whose plane the program of one dimension less lies.
    tight: [u32; DIMENSIONS + 1],
    /// The constraints that contradict each other, after [`Stop::Conflict`].
    conflict: [u32; DIMENSIONS + 1],
    conflicting: usize,
    steps: u64,
    /// By variable: the bound on its size.
    bounds: [f64; DIMENSIONS],
    /// Chooses the random order of the rows.
    pub(crate) seed: u64,
}

impl Levels {
    /// The tags of the constraints that contradict each other.
    pub(crate) fn conflict(&self) -> &[u32] {
        &self.conflict[..self.conflicting]
    }

    /// Notes down a conflict of rows of dimension `dimension` in the planes of those above, in a program of
    /// dimension `top`.
    fn conflict_of(&mut self, rows: &[u32], dimension: usize, top: usize) -> Stop {
        let above = top - dimension;
        self.conflict[..above].copy_from_slice(&self.tight[dimension + 1..=top]);
        self.conflict[above..above + rows.len()].copy_from_slice(rows);
        self.conflicting = above + rows.len();
        Stop::Conflict
    }

    /// Solves a program in one variable.
    fn solve1(&mut self, objective: [f64; 1], [variable]: [usize; 1], top: usize) -> Result<[f64; 1], Stop> {
        let bound = self.bounds[variable];
        let ((mut low, mut high), [mut by_high, mut by_low]) = ((-bound, bound), sides(variable));
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
        // Without an objective, any point will do: the middle of what there is, if that is little, is
        // farthest from going wrong.
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

/// The tags of the upper and the lower bound of a variable.
fn sides(variable: usize) -> [u32; 2] {
    [BOX + 2 * variable as u32, BOX + 2 * variable as u32 + 1]
}

/// A row scaled so that its greatest coefficient is 1 or -1. A row without coefficients keeps its constant.
fn normalised<const N: usize>(mut row: [f64; N]) -> [f64; N] {
    let mut most = 0.0;
    for a in &row[..N - 1] {
        most = if a.abs() > most { a.abs() } else { most };
    }
    if most <= NOTHING {
        row[..N - 1].fill(0.0);
        return row;
    }
    let inverse = 1.0 / most;
    for a in &mut row {
        *a *= inverse;
    }
    row
}

/// An array without one of its elements.
fn without<T: Copy + Default, const N: usize, const M: usize>(array: &[T; N], k: usize) -> [T; M] {
    let mut out = [T::default(); M];
    out[..k].copy_from_slice(&array[..k]);
    out[k..].copy_from_slice(&array[k + 1..]);
    out
}

macro_rules! level {
    ($solve:ident, $rows:ident, $d:literal, $n:literal, $lower:ident, $lower_rows:ident, $less:literal) => {
        impl Levels {
            fn $solve(
                &mut self,
                objective: [f64; $d],
                variables: [usize; $d],
                top: usize,
            ) -> Result<[f64; $d], Stop> {
                // The best corner of the box; without an objective its middle, where nothing is large.
                let (mut x, mut allowed) = ([0.0; $d], TOLERANCE);
                for k in 0..$d {
                    if objective[k] != 0.0 {
                        x[k] = self.bounds[variables[k]] * objective[k].signum();
                        allowed = greater(allowed, x[k].abs() * TOLERANCE);
                    }
                }
                // The rows before `i` are satisfied by the best point of them, `x`.
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
                    // In the plane of this row, x_k is a sum of the other variables.
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
                    // The bounds of x_k last: they seldom matter.
                    let bound = self.bounds[variables[k]];
                    for (side, tag) in [-1.0, 1.0].into_iter().zip(sides(variables[k])) {
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
                    // What mattered once matters again: programs of one dimension less look at it first (Emo
                    // Welzl, "Smallest Enclosing Disks (Balls and Ellipsoids)", 1991).
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

impl Levels {
    /// A point that satisfies `count` constraints, given by number as coefficients and constant, and makes
    /// the objective greatest among them within a box. The dimension, from 1 to [`DIMENSIONS`], is the length
    /// of the objective.
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

/// Puts the rows into a random order, always the same for as many and a seed (Fisher and Yates; the numbers
/// are splitmix64's, Steele, Lea and Flood, "Fast Splittable Pseudorandom Number Generators", 2014).
fn shuffle<T>(rows: &mut [T], seed: u64) {
    let mut state = seed;
    for i in (1..rows.len()).rev() {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (state ^ state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        // The upper half times the count, over 2^32: below the count.
        let j = ((z >> 32) * (i as u64 + 1)) >> 32;
        rows.swap(i, j as usize);
    }
}
