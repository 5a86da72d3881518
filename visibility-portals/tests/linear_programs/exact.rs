//! Linear programs in exact arithmetic: the criss-cross method (Tamas Terlaky, "A Convergent Criss-Cross
//! Method", 1985) on a dictionary of integers with one common denominator (Jack Edmonds's integral pivoting).
//! Shares no code with the solver under test.

/// Exact result of a linear program.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Exact {
    Infeasible,
    /// The greatest value of the objective, as numerator and positive denominator of a fraction.
    Greatest(i128, i128),
}

impl Exact {
    pub(crate) fn is_feasible(self) -> bool {
        self != Self::Infeasible
    }
}

/// The simplex dictionary: each basic variable, and in the last row the objective, is a constant plus a
/// linear combination of the nonbasic variables. All coefficients are integers over one common denominator.
struct Dictionary {
    rows: Vec<Vec<i128>>,
    denominator: i128,
    /// By row: the index of its basic variable. The next field, `others`, holds the index of the nonbasic
    /// variable of each column, not counting the column of constants.
    basic: Vec<usize>,
    others: Vec<usize>,
}

/// Returns the greatest value of `objective . x` subject to `a . x + b >= 0` for all rows `(a, b)` and `|x_k|
/// <= bound`. `None` if the integers overflow.
pub(crate) fn solve(rows: &[(Vec<i128>, i128)], objective: &[i128], bound: i128) -> Option<Exact> {
    let d = objective.len();
    // In terms of y = x + bound, which is nonnegative.
    let shifted = |a: &[i128], b: i128| -> Vec<i128> {
        std::iter::once(b - bound * a.iter().sum::<i128>()).chain(a.iter().copied()).collect()
    };
    let mut all: Vec<Vec<i128>> = rows.iter().map(|(a, b)| shifted(a, *b)).collect();
    for k in 0..d {
        let mut row = vec![0; d + 1];
        (row[0], row[k + 1]) = (2 * bound, -1);
        all.push(row);
    }
    let m = all.len();
    all.push(shifted(objective, 0));
    let mut it =
        Dictionary { rows: all, denominator: 1, basic: (d..d + m).collect(), others: (0..d).collect() };
    loop {
        // The least index of a negative basic variable, or of a nonbasic variable that improves the
        // objective.
        let row = (0..m).filter(|&i| it.rows[i][0] < 0).min_by_key(|&i| it.basic[i]);
        let column = (0..d).filter(|&j| it.rows[m][j + 1] > 0).min_by_key(|&j| it.others[j]);
        let by_row = match (row, column) {
            (None, None) => return Some(Exact::Greatest(it.rows[m][0], it.denominator)),
            (Some(i), Some(j)) => it.basic[i] < it.others[j],
            (row, _) => row.is_some(),
        };
        let (i, j) = if by_row {
            let i = row?;
            let Some(j) = (0..d).filter(|&j| it.rows[i][j + 1] > 0).min_by_key(|&j| it.others[j]) else {
                return Some(Exact::Infeasible);
            };
            (i, j)
        } else {
            let j = column?;
            // Such a row always exists, since the box bounds every variable.
            (0..m).filter(|&i| it.rows[i][j + 1] < 0).min_by_key(|&i| it.basic[i]).map(|i| (i, j))?
        };
        it.exchange(i, j)?;
    }
}

impl Dictionary {
    fn exchange(&mut self, r: usize, j: usize) -> Option<()> {
        let s = j + 1;
        let pivot = self.rows[r].clone();
        let sign = pivot[s].signum();
        for (i, row) in self.rows.iter_mut().enumerate() {
            if i == r {
                row.iter_mut().for_each(|v| *v *= -sign);
                row[s] = self.denominator * sign;
                continue;
            }
            let factor = row[s];
            for (k, v) in row.iter_mut().enumerate() {
                *v = if k == s {
                    *v * sign
                } else {
                    let numerator = v.checked_mul(pivot[s])?.checked_sub(factor.checked_mul(pivot[k])?)?;
                    numerator / self.denominator * sign
                };
            }
        }
        self.denominator = pivot[s].abs();
        std::mem::swap(&mut self.basic[r], &mut self.others[j]);
        Some(())
    }
}
