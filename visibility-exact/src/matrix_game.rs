//! Linear programs over the corners of P, where lines of sight begin, and of Q, where they end. They decide
//! whether a line passes given edges on given sides.
//!
//! Each edge gives a row, each pair of corners a column, and each entry is the side on which the line between
//! the corners passes the edge. The entries are affine in either corner, so a line from P to Q has in each
//! row a weighted mean of that row's entries, with the same weights in all rows. If some weights of the rows
//! make the sum of rows negative in all columns, no line is positive in all rows (the lemma of Farkas). The
//! simplex method searches these weights, in a condensed tableau, as for a matrix game. The weights are then
//! evaluated anew with error bounds, so no answer relies on the method.

use alloc::vec::Vec;

/// Sign of the value of a [`MatrixGame`]: the greatest number that all rows can reach together, each as the
/// sum of its entries weighted by column weights with sum 1.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Value {
    /// Certainly no weights of the columns make all rows positive. `row_weights` prove this.
    Negative,
    /// The weights `column_weights` make all rows positive, up to rounding.
    Positive,
    /// The sign is not known: it is within rounding errors, or the method did not end.
    Open,
}

/// Greatest number of steps of the simplex method for one matrix. After half of these steps, the first
/// improving column is taken instead of the steepest, which prevents cycles.
const STEPS: usize = 120;

/// A matrix whose rows are pushed and popped like a stack. Each row belongs to an edge, each column to a pair
/// of a corner of the viewcell polygon and a corner of the target polygon.
#[derive(Default)]
pub(crate) struct Matrix {
    /// Number of entries of each row.
    columns: usize,
    /// Entries, row after row, each divided by the scale of its row.
    entries: Vec<f64>,
    /// For each row, its scale and a bound on the errors of its scaled entries.
    rows: Vec<(f64, f64)>,
}

impl Matrix {
    pub(crate) fn start(&mut self, columns: usize) {
        self.columns = columns;
        self.truncate(0);
    }

    /// Keeps the first `rows` rows.
    pub(crate) fn truncate(&mut self, rows: usize) {
        self.entries.truncate(rows * self.columns);
        self.rows.truncate(rows);
    }

    /// Adds a row with the entries that `fill` appends to its argument. `fill` returns a bound on the errors
    /// of the entries.
    pub(crate) fn push(&mut self, fill: impl FnOnce(&mut Vec<f64>) -> f64) {
        let start = self.entries.len();
        let error = fill(&mut self.entries);
        let row = &mut self.entries[start..];
        let scale = row.iter().fold(0.0f64, |most, x| most.max(x.abs())).max(1e-200);
        row.iter_mut().for_each(|x| *x /= scale);
        self.rows.push((scale, error / scale + 1e-15));
    }
}

/// Solution of the game of a matrix, and scratch memory.
#[derive(Default)]
pub(crate) struct MatrixGame {
    tableau: Vec<f64>,
    labels: Vec<usize>,
    /// If the value is [`Value::Negative`]: weights of the rows before scaling, whose weighted sum is
    /// negative in all columns.
    pub(crate) row_weights: Vec<f64>,
    /// If the value is [`Value::Positive`]: weights of the columns for which the weighted sum of each row is
    /// positive, up to rounding.
    pub(crate) column_weights: Vec<f64>,
}

impl MatrixGame {
    /// Solves the game of a matrix. The answer for a matrix without rows is [`Value::Open`].
    pub(crate) fn solve(&mut self, matrix: &Matrix) -> Value {
        let Matrix { columns, entries, rows } = matrix;
        let (m, n) = (rows.len(), *columns);
        self.row_weights.clear();
        self.row_weights.resize(m, 0.0);
        self.column_weights.clear();
        self.column_weights.resize(n, 0.0);
        if m == 0 || n == 0 || !self.optimize(entries, m, n) {
            return Value::Open;
        }
        let height = n + 1;
        let total = self.tableau[m * height + n];
        if !(total > 0.0 && total.is_finite()) {
            return Value::Open;
        }
        let (beside, below) = self.labels.split_at(m);
        for (k, &label) in beside.iter().enumerate() {
            if label >= m {
                self.column_weights[label - m] = (self.tableau[k * height + n] / total).max(0.0);
            }
        }
        for (j, &label) in below.iter().enumerate() {
            if label < m {
                self.row_weights[label] = (self.tableau[m * height + j] / total).max(0.0);
            }
        }
        // Rounding of a column's weighted sum: m products and sums round by at most 2 m times the unit
        // round-off of the weights' sum, for entries of at most 1.
        let slack: f64 = self.row_weights.iter().zip(rows).map(|(w, (_, error))| w * error).sum();
        let weights: f64 = self.row_weights.iter().sum();
        let slack = slack * 1.001 + weights * m as f64 * 4.0 * f64::EPSILON;
        let column = |j: usize| (0..m).map(|k| self.row_weights[k] * entries[k * n + j]).sum::<f64>();
        let greatest = (0..n).map(column).fold(f64::NEG_INFINITY, f64::max);
        if greatest < -slack {
            for (weight, (scale, _)) in self.row_weights.iter_mut().zip(rows) {
                *weight /= scale;
            }
            return Value::Negative;
        }
        if 1.0 / total - SHIFT > 1e-10 { Value::Positive } else { Value::Open }
    }

    /// Finds weights y_k >= 0 of the `m` rows whose sum is as great as possible, where for each of the `n`
    /// columns j the sum over k of y_k (entry_kj + [`SHIFT`]) is at most 1. Returns whether the optimum, or a
    /// certainly negative value, was reached.
    fn optimize(&mut self, entries: &[f64], m: usize, n: usize) -> bool {
        // The tableau is stored by columns, as the matrix has fewer rows than columns: a column for each
        // weight, then one of sums.
        let height = n + 1;
        self.tableau.clear();
        for entries in entries.chunks_exact(n) {
            self.tableau.extend(entries.iter().map(|entry| entry + SHIFT));
            self.tableau.push(-1.0);
        }
        self.tableau.extend((0..n).map(|_| 1.0));
        self.tableau.push(0.0);
        self.labels.clear();
        self.labels.extend(0..m + n);
        for step in 0..STEPS {
            // The value of the game is at most 1 / total - SHIFT with the present weights of rows, so it is
            // surely negative.
            if self.tableau[m * height + n] > CERTAIN {
                return true;
            }
            let costs = self.tableau.chunks_exact(height).take(m).map(|column| column[n]);
            let improving = costs.enumerate().filter(|(_, cost)| *cost < -1e-12);
            let entering = if step < STEPS / 2 {
                improving.min_by(|a, b| a.1.total_cmp(&b.1))
            } else {
                improving.min_by_key(|(k, _)| self.labels[*k])
            };
            let Some((c, _)) = entering else { return true };
            let mut leaving: Option<(f64, usize)> = None;
            let sums = &self.tableau[m * height..];
            for (j, (&by, &sum)) in self.tableau[c * height..c * height + n].iter().zip(sums).enumerate() {
                if by > 1e-11 {
                    let ratio = sum / by;
                    let label = |j: usize| self.labels[m + j];
                    let is_less = leaving
                        .is_none_or(|(least, at)| ratio < least || (ratio == least && label(j) < label(at)));
                    if is_less {
                        leaving = Some((ratio, j));
                    }
                }
            }
            let Some((_, r)) = leaving else { return false };
            self.pivot(r, c, height);
            self.labels.swap(c, m + r);
        }
        false
    }

    fn pivot(&mut self, r: usize, c: usize, height: usize) {
        let (before, rest) = self.tableau.split_at_mut(c * height);
        let (entering, after) = rest.split_at_mut(height);
        let inverse = 1.0 / entering[r];
        for other in before.chunks_exact_mut(height).chain(after.chunks_exact_mut(height)) {
            let at = other[r] * inverse;
            for (x, y) in other.iter_mut().zip(entering.iter()) {
                *x -= y * at;
            }
            other[r] = at;
        }
        for x in entering.iter_mut() {
            *x *= -inverse;
        }
        entering[r] = inverse;
    }
}

/// Least sum of the rows' weights at which the value of the game is certainly negative, below -1e-6.
const CERTAIN: f64 = 1.0 / (SHIFT - 1e-6);

/// Number added to all entries, which are at least -1, so that the value of the shifted game is positive.
const SHIFT: f64 = 2.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_games_have_their_values() {
        let (mut game, mut matrix) = (MatrixGame::default(), Matrix::default());
        let mut solve = |rows: &[[f64; 3]]| {
            matrix.start(3);
            for row in rows {
                matrix.push(|entries| {
                    entries.extend(row);
                    0.0
                });
            }
            (game.solve(&matrix), game.row_weights.clone(), game.column_weights.clone())
        };
        let (value, _, columns) = solve(&[[4.0, -1.0, -1.0], [-1.0, 2.0, -1.0], [-1.0, -1.0, 5.0]]);
        assert_eq!(value, Value::Positive, "a game that the columns win");
        assert!((columns.iter().sum::<f64>() - 1.0).abs() < 1e-9, "the weights of the columns add up to 1");
        let rows = [[1.0, -3.0, -1.0], [-2.0, 1.0, -1.0]];
        let (value, weights, _) = solve(&rows);
        assert_eq!(value, Value::Negative, "a game that the rows win");
        assert!(
            (0..3).all(|j| weights[0] * rows[0][j] + weights[1] * rows[1][j] < 0.0),
            "the weights {weights:?} make each column negative"
        );
        let (value, ..) = solve(&[[1.0, 0.0, -1.0], [-1.0, 0.0, 1.0]]);
        assert_eq!(value, Value::Open, "a game of value 0");
        assert_eq!(solve(&[[f64::NAN; 3]]).0, Value::Open, "a game of NaN");
        assert_eq!(solve(&[[0.0; 3]]).0, Value::Open, "a game of zeros");
    }

    /// Negative entries whose error bounds allow positive values prove nothing.
    #[test]
    fn errors_of_entries_count() {
        let (mut game, mut matrix) = (MatrixGame::default(), Matrix::default());
        for (error, value) in [(2e-3, Value::Open), (1e-4, Value::Negative)] {
            matrix.start(2);
            for x in [-1.0, -2.0] {
                matrix.push(|entries| {
                    entries.extend([-1e-3, x]);
                    error
                });
            }
            assert_eq!(game.solve(&matrix), value, "{error}");
        }
    }
}
