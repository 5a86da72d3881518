//! Multipliers that prove that constraints contradict each other (Farkas' lemma), checked so that rounding
//! can never pass for a proof.
//!
//! Let the constraints be `h_i . x >= s_i` for all `i`, and the bounds of the box `|x_k| <= B_k`. For any
//! multipliers `l_i >= 0` and `r = sum l_i h_i`,
//!
//! ```text
//! sum l_i s_i  <=  r . x  <=  sum |r_k| B_k
//! ```
//!
//! so that no `x` exists if the left side is certainly greater than the right side. Any multipliers will do,
//! wherever they come from. Here they are found by elimination in `f64` and corrected in double-double
//! numbers, which leaves an `r` of about 2^-100. Then both sides are evaluated, with every rounding counted
//! against the proof.

use visibility_core::geometry::DoubleDouble;

/// Maximum number of constraints of a certificate. By Helly's theorem, six constraints suffice for a
/// contradiction in the five variables of the linear program. The seventh states that a line is not parallel
/// to the plane of an opening.
pub(crate) const MAX_ROWS: usize = 7;

/// The constraint `normal . x >= least` on the unknowns `x` of a linear program with `K` variables. Each
/// coordinate of the stored normal is within `error` of its exact value; `least` is exact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row<const K: usize> {
    pub(super) normal: [DoubleDouble; K],
    pub(super) error: f64,
    pub(super) least: f64,
}

/// Bound on the total loss by underflow in [`proof_sides`]. Each of its few hundred operations loses at most
/// 2^-1074.
const UNDERFLOW: f64 = 1e-300;

/// Factor that rounds a computed bound up. The quotients and sums in [`proof_sides`] have far smaller
/// relative errors.
const UP: f64 = 1.0 + 1e-12;

/// Thresholds below which an entry of an elimination counts as 0, tried in turn until a proof is found. Which
/// of them succeeds depends on the rows. A wrong one does no harm, since every result is checked by
/// [`proves`].
const ZEROS: [f64; 3] = [1e-12, 1e-9, 1e-6];

/// Least entry that an elimination divides by; the greatest entry of each row is about 1. A smaller entry may
/// consist of rounding errors alone. A badly chosen limit only makes the search miss proofs.
const MIN_PIVOT: f64 = 1e-11;

/// Returns a lower bound of `sum l_i s_i` and an upper bound of `sum |r_k| B_k`. If the first is greater than
/// the second, the rows are proved infeasible. Here `l_i` is the multiplier of row i, `s_i` the row's least
/// value, `r` the sum of the rows' normals weighted by the multipliers, and `B_k` is `bounds[k]`.
fn proof_sides<const K: usize>(
    rows: &[Row<K>],
    bounds: &[f64; K],
    multipliers: &[DoubleDouble],
) -> (f64, f64) {
    // The left side: each term is a product of exact numbers, with the smaller part of the multiplier below
    // 2^-53 of the greater. The sum of at most eight terms is off by less than 2^-49 of the sum of their
    // absolute values.
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
        // Eight products and eight sums, each off by at most ERROR of the sum of the absolute values so far.
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

/// Tests whether the multipliers (one per row) prove that no `x` with `|x_k| <= bounds[k]` satisfies all
/// rows. `false` for more than [`MAX_ROWS`] rows, for a negative multiplier, and for NaN or
/// infinity.
fn proves<const K: usize>(rows: &[Row<K>], bounds: &[f64; K], multipliers: &[DoubleDouble]) -> bool {
    // Written so that a NaN is rejected.
    if !multipliers.iter().all(|l| l.hi >= l.lo.abs()) || rows.len() > MAX_ROWS {
        return false;
    }
    let (left, right) = proof_sides(rows, bounds, multipliers);
    left > right
}

/// Searches multipliers, one for each row, that prove that no `x` with `|x_k| <= bounds[k]` satisfies all
/// `rows`. The multiplier of a row that the proof does not need is 0. `None` if none are found, which proves
/// nothing, and for more than [`MAX_ROWS`] rows.
pub(super) fn find<const K: usize>(rows: &[Row<K>], bounds: &[f64; K]) -> Option<[DoubleDouble; MAX_ROWS]> {
    if rows.len() > MAX_ROWS {
        return None;
    }
    ZEROS.into_iter().find_map(|zero| {
        let mut used = [false; MAX_ROWS];
        used[..rows.len()].fill(true);
        // Each iteration drops at least one row.
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

/// Gaussian elimination with full pivoting (LU decomposition) of the matrix with one column for each used
/// constraint, the constraint's normal, and one row for each coordinate of the normals.
struct Elimination<const K: usize> {
    /// LU factors in place: the lower factor's entries below the diagonal, the upper factor from the
    /// diagonal on. Matrix rows and columns are in pivoting order.
    m: [[f64; MAX_ROWS]; K],
    /// By row of the matrix `m`: the index of the coordinate of the constraint normals that the row holds,
    /// after pivoting. The field `row` is the index of the constraint in each matrix column.
    coordinate: [usize; K],
    row: [usize; MAX_ROWS],
    /// By column of the matrix `m`: the factor by which the constraint's normal was multiplied, so that its
    /// greatest coefficient is 1.
    scale: [f64; MAX_ROWS],
    count: usize,
    rank: usize,
}

impl<const K: usize> Elimination<K> {
    fn new(rows: &[Row<K>], used: &[bool; MAX_ROWS]) -> Option<Self> {
        let (mut row, mut scale, mut count) = ([0; MAX_ROWS], [0.0; MAX_ROWS], 0);
        let mut m = [[0.0; MAX_ROWS]; K];
        for (i, r) in rows.iter().enumerate().filter(|(i, _)| used[*i]) {
            // Columns of the matrix are the rows in use, each scaled to a greatest coefficient of 1.
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
        // LU decomposition with full pivoting, in place. It stops at a pivot so small that the rest is
        // rounding: `rank` is the number of pivots.
        let mut coordinate = [0; K];
        coordinate.iter_mut().enumerate().for_each(|(k, c)| *c = k);
        let mut rank = 0;
        while rank < K.min(count) {
            let (mut best, mut at) = (MIN_PIVOT, None);
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

    /// Solves the upper triangular system of the first `rank` (pivot) columns by back substitution. `right`
    /// is the right side after forward elimination.
    fn back(&self, mut right: [f64; K]) -> [f64; K] {
        for k in (0..self.rank).rev() {
            for j in k + 1..self.rank {
                right[k] -= self.m[k][j] * right[j];
            }
            right[k] /= self.m[k][k];
        }
        right
    }

    /// Returns multipliers for which the weighted sum of the normals is zero, by constraint index, and
    /// whether constraints were dropped. No multiplier is negative. A constraint is dropped if its multiplier
    /// was at most `zero` times the greatest and was set to 0, or if its column has no pivot and was left
    /// out. `None` if no column without pivot gives such multipliers.
    fn nonnegative(&self, zero: f64) -> Option<([f64; MAX_ROWS], bool)> {
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
            let (mut multipliers, mut dropped) = ([0.0; MAX_ROWS], self.count > self.rank + 1);
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

    /// Returns the `multipliers` of the constraints (one per row) corrected by three steps of iterative
    /// refinement, after which the weighted sum of normals is zero up to about 2^-100.
    fn refined(&self, rows: &[Row<K>], multipliers: [f64; MAX_ROWS]) -> [DoubleDouble; MAX_ROWS] {
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
