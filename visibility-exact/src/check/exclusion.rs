//! Proofs that no segment lies in a node: the sides on which its segments must pass edges contradict each
//! other.

use super::context::{Check, Divider};
use super::exact_side::{D, cross, difference, dot, norm, side};
use crate::line_side::U;
use crate::sight::Sight;
use alloc::vec::Vec;

/// Bound on the errors by underflow of a product of sums, or a sum of products, of a few double-double
/// numbers, each of which is wrong by some times the least number, 2^-1074.
const UNDERFLOW: f64 = 1e-300;

impl Check<'_> {
    /// Returns whether, for each pair of a corner of the viewcell polygon and a corner of the target polygon,
    /// a weighted sum is certainly negative: the sum over all rows of the row's weight, times its sign, times
    /// the side on which the line between the two corners passes the row's edge. No line then passes every
    /// row's edge on the side that the row's sign gives. Rows without a weight are left out. False if a
    /// weight is negative.
    ///
    /// Rounding, with U the unit round-off of `f64`: a term is a side, rounded to `f64`, times a weight, and
    /// wrong by 2 U of its magnitude. Each of the sums of n terms is wrong by U of the sum of their
    /// magnitudes. Weights may be so small that terms and their errors underflow, each by half of the least
    /// number, or so great that a sum overflows, which no later term undoes.
    pub(super) fn excludes(&self, sight: &Sight, rows: &[Divider], weights: &[f64]) -> bool {
        if weights.iter().any(|w| *w < 0.0) {
            return false;
        }
        let pairs = sight.p.corners().len() * sight.q.corners().len();
        let rounding = (rows.len() as f64 + 4.0) * U;
        let mut sums = alloc::vec![(0.0, 0.0); pairs];
        for ((edge, sign), weight) in rows.iter().zip(weights) {
            for (sum, (value, error)) in sums.iter_mut().zip(self.sides(sight, edge, side)) {
                let term = value * sign * weight;
                sum.0 += term;
                sum.1 += error * weight + term.abs() * rounding + UNDERFLOW;
            }
        }
        sums.iter().all(|(value, error)| value.is_finite() && *value < -*error)
    }

    /// Returns whether no line passes all three edges on the given sides, by the quadratic form of the file
    /// `corner_proof.rs`. With t_k the direction of edge k times the row's sign, d the direction of a line
    /// and p its start, let L_k = (t_i x t_j) . d for the two other edges i and j, and det the determinant of
    /// t_0, t_1 and t_2. Then det d = sum of L_k t_k, without a division. The sum of L_k times the side on
    /// edge k is a quadratic form of d, whatever p is, also where det is 0. If all L_k have one sign for all
    /// d, and the form has the other sign, no line has positive sides on all edges.
    ///
    /// Rounding, with E the relative error of a double-double operation and |v| the sum of the magnitudes of
    /// v: the components of a product c = t x u of two edges' directions are together wrong by 2 E |t| |u|,
    /// and a scalar product c . d by 3 E |c| |d|. A term of the form at two directions x and y, (c . x) (w .
    /// y) + (c . y) (w . x) with w = e x s for a point e and the direction s of an edge, is wrong by 16 E |c|
    /// |w| |x| |y|, and the sum of three terms by 4 E more. All products are taken to be wrong by 8 E |t|
    /// |u|. This covers the rest too, since |c| is at most |t| |u|: of the 8 E, a scalar product needs 2 + 3.
    /// In the form, where c is t x u and w is e x s, the 8 E count as 16 E (|t| |u| |w| + |c| |e| |s|) |x|
    /// |y|. Needed are 4 E of the same sum for the two products, and 20 E |c| |w| |x| |y|, which is at most
    /// 10 E of it. The bounds are themselves wrong by some U, since they are computed in `f64`. The remaining
    /// 2 E and the room for errors of positions are more than that. Each product, scalar product and sum of
    /// terms may be wrong by [`UNDERFLOW`] besides.
    pub(super) fn corner_excludes(&self, sight: &Sight, rows: [&Divider; 3]) -> bool {
        let t = rows.map(|([a, b], s)| difference(b.0, a.0).map(|x| x.times(D::from(*s))));
        let c = [cross(t[1], t[2]), cross(t[2], t[0]), cross(t[0], t[1])];
        let v = rows[0].0[0].0;
        let e = rows.map(|([a, _], _)| difference(a.0, v));
        let w: [[D; 3]; 3] = core::array::from_fn(|k| cross(e[k], t[k]));
        let (p, q) = (sight.p.corners(), sight.q.corners());
        let directions: Vec<[D; 3]> =
            p.iter().flat_map(|&p| q.iter().map(move |&q| difference(q, p))).collect();
        let sign = if directions.iter().any(|d| dot(c[0], *d).hi > 0.0) { 1.0 } else { -1.0 };
        // A direction changes by up to 2 delta on each axis, delta being the error of positions.
        let change = 2.0 * self.moved(sight);
        // If the ends of edges change by delta, the error of positions, each t_k and e_k changes by 2 delta
        // on each axis, and a product of two vectors by at most twice the product of the sums of their
        // magnitudes.
        let wrong = |u: [D; 3], w: [D; 3]| {
            4.0 * change * (norm(u) + norm(w) + change) + 8.0 * D::ERROR * norm(u) * norm(w) + UNDERFLOW
        };
        let c_wrong: [f64; 3] = core::array::from_fn(|k| wrong(t[(k + 1) % 3], t[(k + 2) % 3]));
        let w_wrong: [f64; 3] = core::array::from_fn(|k| wrong(e[k], t[k]));
        let is_positive = directions.iter().all(|d| {
            (0..3).all(|k| {
                let least = norm(c[k]) * change + c_wrong[k] * (norm(*d) + change) + UNDERFLOW;
                dot(c[k], *d).hi * sign > least
            })
        });
        is_positive
            && directions.iter().enumerate().all(|(i, x)| {
                directions[i..].iter().all(|y| {
                    let (mut form, mut error) = (D::ZERO, 0.0);
                    for k in 0..3 {
                        let both =
                            dot(c[k], *x).times(dot(w[k], *y)).plus(dot(c[k], *y).times(dot(w[k], *x)));
                        form = form.plus(both);
                        let moved = 2.0 * change * (norm(*x) + norm(*y) + change);
                        error += norm(c[k]) * norm(w[k]) * moved;
                        error += UNDERFLOW * (1.0 + (norm(c[k]) + norm(w[k])) * (norm(*x) + norm(*y)));
                        let changed = c_wrong[k] * (norm(w[k]) + w_wrong[k]) + norm(c[k]) * w_wrong[k];
                        error += 2.0 * changed * (norm(*x) + change) * (norm(*y) + change);
                    }
                    form.hi * sign < -error
                })
            })
    }
}
