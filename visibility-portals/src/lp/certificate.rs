//! Multipliers that show that constraints contradict each other (Farkas' lemma), checked so that no rounding
//! can be mistaken for a proof.
//!
//! Let `h_i . x >= s_i` for all `i`, and `|x_k| <= B_k`. For any `l_i >= 0` and `r = sum l_i h_i`,
//!
//! ```text
//! sum l_i s_i  <=  r . x  <=  sum |r_k| B_k
//! ```
//!
//! so that no `x` exists if the left side is surely greater than the right one. It does not matter where the
//! multipliers come from: here they are found by elimination in `f64` and corrected in numbers of twice the
//! length, which leaves an `r` of about 2^-100; then the bound is evaluated, with every rounding counted
//! against it.

use visibility_core::geometry::DoubleDouble;

/// The most constraints of a certificate: by Helly's theorem seven for six variables; one more for a
/// constraint of the caller's.
pub(crate) const MOST: usize = 8;

/// The constraint `normal . x >= least`, where each coordinate of the normal is known up to `error`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row<const K: usize> {
    pub(crate) normal: [DoubleDouble; K],
    pub(crate) error: f64,
    pub(crate) least: f64,
}

/// Underflow takes at most 2^-1074 from any of the few hundred operations below: less than this in all.
const UNDERFLOW: f64 = 1e-300;

/// Rounds up quotients and sums of the bound below, which are wrong by far less.
const UP: f64 = 1.0 + 1e-12;

/// The left and the right side of the bound, each rounded against a proof.
fn sides<const K: usize>(rows: &[Row<K>], bounds: &[f64; K], multipliers: &[DoubleDouble]) -> (f64, f64) {
    // The left: each term is a product of numbers that are exact, the smaller part of the multiplier below
    // 2^-53 of the greater, and the sum of at most eight is wrong by less than 2^-49 of the sum of their
    // sizes.
    let (mut left, mut size) = (DoubleDouble::ZERO, 0.0);
    for (row, &l) in rows.iter().zip(multipliers) {
        let term = l.times(DoubleDouble::from(row.least));
        left = left.plus(term);
        size += term.hi.abs();
    }
    let left =
        (left.hi + left.lo) - size * (16.0 * DoubleDouble::ERROR) * UP - left.hi.abs() * 4.0 * f64::EPSILON;
    let mut right = 0.0;
    for (k, bound) in bounds.iter().enumerate() {
        // Eight products and eight sums, each wrong by at most ERROR of what has been added up so far.
        let (mut sum, mut size, mut unknown) = (DoubleDouble::ZERO, 0.0, 0.0);
        for (row, &l) in rows.iter().zip(multipliers) {
            let term = l.times(row.normal[k]);
            sum = sum.plus(term);
            size += term.hi.abs();
            unknown += l.hi * row.error;
        }
        let most = sum.hi.abs() * UP + (size * (32.0 * DoubleDouble::ERROR) + unknown) * UP;
        right += most * bound * UP;
    }
    (left - UNDERFLOW, right * UP + UNDERFLOW)
}

/// Whether multipliers prove that no `x` satisfies all rows.
pub(crate) fn proves<const K: usize>(
    rows: &[Row<K>],
    bounds: &[f64; K],
    multipliers: &[DoubleDouble],
) -> bool {
    // Not the other way round: what is not a number proves nothing.
    if !multipliers.iter().all(|l| l.hi >= l.lo.abs()) || rows.len() > MOST {
        return false;
    }
    let (left, right) = sides(rows, bounds, multipliers);
    left > right && right < f64::INFINITY
}

/// Multipliers that prove that no `x` satisfies all of at most [`MOST`] rows; zero for rows that are not
/// needed. `None` if none are found, which proves nothing.
pub(crate) fn find<const K: usize>(rows: &[Row<K>], bounds: &[f64; K]) -> Option<[DoubleDouble; MOST]> {
    if rows.len() > MOST {
        return None;
    }
    // What counts as zero depends on how the rows lie; whatever is tried is checked.
    [1e-12, 1e-9, 1e-6].into_iter().find_map(|zero| {
        let mut used = [false; MOST];
        used[..rows.len()].fill(true);
        // Each time round at least one row is dropped.
        for _ in 0..rows.len() {
            let elimination = Elimination::new(rows, &used)?;
            let (l, dropped) = elimination.nonnegative(zero)?;
            if !dropped {
                let multipliers = elimination.refined(rows, l);
                let proven = proves(rows, bounds, &multipliers[..rows.len()]);
                return proven.then_some(multipliers);
            }
            for (used, l) in used.iter_mut().zip(l) {
                *used = l != 0.0;
            }
        }
        None
    })
}

/// Gaussian elimination with full pivoting. The columns of the matrix are the normals of rows.
struct Elimination<const K: usize> {
    /// Multipliers below the pivots, the upper triangle from the pivots on; rows and columns in pivoting
    /// order.
    m: [[f64; MOST]; K],
    /// Which coordinate, and which of the rows, each has been.
    coordinate: [usize; K],
    row: [usize; MOST],
    /// By column: the factor that its normal was scaled by.
    scale: [f64; MOST],
    count: usize,
    rank: usize,
}

impl<const K: usize> Elimination<K> {
    fn new(rows: &[Row<K>], used: &[bool; MOST]) -> Option<Self> {
        let (mut row, mut scale, mut count) = ([0; MOST], [0.0; MOST], 0);
        let mut m = [[0.0; MOST]; K];
        for (i, r) in rows.iter().enumerate().filter(|(i, _)| used[*i]) {
            let size = r.normal.iter().fold(0.0, |size, h| if h.hi.abs() > size { h.hi.abs() } else { size });
            row[count] = i;
            scale[count] = if size > 0.0 { 1.0 / size } else { 1.0 };
            for (m, h) in m.iter_mut().zip(&r.normal) {
                m[count] = h.hi * scale[count];
            }
            count += 1;
        }
        if count == 0 {
            return None;
        }
        let mut coordinate = [0; K];
        coordinate.iter_mut().enumerate().for_each(|(k, c)| *c = k);
        let mut rank = 0;
        while rank < K.min(count) {
            let (mut best, mut at) = (1e-11, None);
            for (k, m) in m.iter().enumerate().skip(rank) {
                for (j, v) in m.iter().enumerate().take(count).skip(rank) {
                    if v.abs() > best {
                        (best, at) = (v.abs(), Some((k, j)));
                    }
                }
            }
            let Some((k, j)) = at else { break };
            m.swap(rank, k);
            coordinate.swap(rank, k);
            m.iter_mut().for_each(|m| m.swap(rank, j));
            row.swap(rank, j);
            scale.swap(rank, j);
            let pivot = m[rank];
            for m in &mut m[rank + 1..] {
                let factor = m[rank] / pivot[rank];
                m[rank] = factor;
                for j in rank + 1..count {
                    m[j] -= factor * pivot[j];
                }
            }
            rank += 1;
        }
        Some(Self { m, coordinate, row, scale, count, rank })
    }

    /// Solves for the pivot columns, given the right side of the eliminated equations.
    fn back(&self, mut right: [f64; K]) -> [f64; K] {
        for k in (0..self.rank).rev() {
            for j in k + 1..self.rank {
                right[k] -= self.m[k][j] * right[j];
            }
            right[k] /= self.m[k][k];
        }
        right
    }

    /// Multipliers by index of the row, none negative, that make the sum of normals zero; and whether some
    /// were as good as zero and were set to zero.
    fn nonnegative(&self, zero: f64) -> Option<([f64; MOST], bool)> {
        (self.rank..self.count).find_map(|free| {
            let mut right = [0.0; K];
            for (right, m) in right.iter_mut().zip(&self.m).take(self.rank) {
                *right = -m[free];
            }
            let solved = self.back(right);
            let most = solved[..self.rank].iter().fold(1.0, |most: f64, l| most.max(l.abs()));
            if solved[..self.rank].iter().any(|&l| l.is_nan() || l < -zero * most) {
                return None;
            }
            let (mut multipliers, mut dropped) = ([0.0; MOST], self.count > self.rank + 1);
            multipliers[self.row[free]] = self.scale[free];
            for (j, &l) in solved[..self.rank].iter().enumerate() {
                if l > zero * most {
                    multipliers[self.row[j]] = l * self.scale[j];
                } else {
                    dropped = true;
                }
            }
            Some((multipliers, dropped))
        })
    }

    /// Multipliers, corrected until the sum of normals is zero up to about 2^-100.
    fn refined(&self, rows: &[Row<K>], multipliers: [f64; MOST]) -> [DoubleDouble; MOST] {
        let mut multipliers = multipliers.map(DoubleDouble::from);
        for _ in 0..3 {
            let mut right = [0.0; K];
            for (right, &k) in right.iter_mut().zip(&self.coordinate) {
                let terms = rows.iter().zip(&multipliers).map(|(row, l)| l.times(row.normal[k]));
                *right = -terms.fold(DoubleDouble::ZERO, DoubleDouble::plus).hi;
            }
            for k in 0..self.rank {
                for j in k + 1..K {
                    right[j] -= self.m[j][k] * right[k];
                }
            }
            let correction = self.back(right);
            for (j, &c) in correction[..self.rank].iter().enumerate() {
                let l = &mut multipliers[self.row[j]];
                *l = l.plus(DoubleDouble::from(c * self.scale[j]));
            }
        }
        multipliers
    }
}

#[cfg(test)]
mod tests;
