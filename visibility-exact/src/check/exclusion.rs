//! Dividing edges that leave a node without segments.

use super::context::{Check, Divider};
use super::exact_side::{D, cross, difference, dot, norm, side};
use crate::sight::Sight;
use alloc::vec::Vec;

impl Check<'_> {
    /// Returns whether weights of rows make the sum of their sides negative at all pairs of corners.
    pub(super) fn excludes(&self, sight: &Sight, rows: &[Divider], weights: &[f64]) -> bool {
        if weights.len() != rows.len() || weights.iter().any(|w| w.is_nan() || *w < 0.0) {
            return false;
        }
        let pairs = sight.p.corners().len() * sight.q.corners().len();
        let mut sums = alloc::vec![(0.0, 0.0); pairs];
        for ((edge, sign), weight) in rows.iter().zip(weights) {
            for (sum, (value, error)) in sums.iter_mut().zip(self.sides(sight, edge, side)) {
                let term = value * sign * weight;
                sum.0 += term;
                sum.1 += error * weight + term.abs() * 1e-15;
            }
        }
        sums.iter().all(|(value, error)| *value < -*error)
    }

    /// Returns whether three edges exclude all lines, by the form of degree two. With directions t_k times
    /// signs, and without division: det d = sum of L_k t_k for L_k = (t_i x t_j) . d. The sum of
    /// L_k (side on edge k) is then, up to the common factor, the form at d, whatever p is.
    pub(super) fn corner_excludes(&self, sight: &Sight, rows: [&Divider; 3]) -> bool {
        let sign = |x: f64| D::from(x);
        let t = rows.map(|([a, b], s)| difference(b.0, a.0).map(|x| x.times(sign(*s))));
        let c = [cross(t[1], t[2]), cross(t[2], t[0]), cross(t[0], t[1])];
        let determinant = dot(t[0], c[0]).hi;
        let orientation = if determinant > 0.0 { 1.0 } else { -1.0 };
        let v = rows[0].0[0].0;
        let e = rows.map(|([a, _], _)| difference(a.0, v));
        let w: [[D; 3]; 3] = core::array::from_fn(|k| cross(e[k], t[k]));
        let directions: Vec<[D; 3]> = sight
            .p
            .corners()
            .iter()
            .flat_map(|&p| sight.q.corners().iter().map(move |&q| difference(q, p)))
            .collect();
        let (Some(first), true) = (directions.first(), determinant.abs() > 0.0) else { return false };
        // Changes of directions by 2 delta on each axis.
        let change = 2.0 * self.moved(sight);
        let level = dot(c[0], *first).hi * orientation;
        let sense = if level > 0.0 { 1.0 } else { -1.0 };
        // Changes of the ends of edges by delta change each t_k and e_k by 2 delta on each axis, and a
        // product of two vectors by at most twice the product of the sums of their magnitudes.
        let moved = |u: [D; 3], w: [D; 3]| 4.0 * change * (norm(u) + norm(w) + change);
        let c_moved: [f64; 3] = core::array::from_fn(|k| moved(t[(k + 1) % 3], t[(k + 2) % 3]));
        let w_moved: [f64; 3] = core::array::from_fn(|k| moved(e[k], t[k]));
        let positive = directions.iter().all(|d| {
            (0..3).all(|k| {
                let least = norm(c[k]) * change + c_moved[k] * (norm(*d) + change);
                dot(c[k], *d).hi * orientation * sense > least
            })
        });
        let rounding: f64 = (0..3).map(|k| norm(c[k]) * norm(w[k])).sum::<f64>() * 1e-24;
        positive
            && directions.iter().enumerate().all(|(i, x)| {
                directions[i..].iter().all(|y| {
                    let (mut form, mut error) = (0.0, rounding * norm(*x) * norm(*y));
                    for k in 0..3 {
                        let both =
                            dot(c[k], *x).times(dot(w[k], *y)).plus(dot(c[k], *y).times(dot(w[k], *x)));
                        form += both.hi * orientation * sense;
                        error += both.hi.abs() * 1e-15
                            + 2.0 * change * norm(c[k]) * norm(w[k]) * (norm(*x) + norm(*y) + change);
                        let changed = c_moved[k] * (norm(w[k]) + w_moved[k]) + norm(c[k]) * w_moved[k];
                        error += 2.0 * changed * (norm(*x) + change) * (norm(*y) + change);
                    }
                    form < -error
                })
            })
    }
}
