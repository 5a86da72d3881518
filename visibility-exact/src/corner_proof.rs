//! Proofs of degree two that no line passes three edges around a corner on given sides.
//!
//! With d = q - p, a line from p to q passes an edge of direction t_k through a_k on the side h_k = t_k . (d
//! x (a_k - p)). Where d = sum_k l_k s_k t_k for three edges with signs s_k, the sum of l_k s_k h_k does not
//! depend on p, since d . (d x p) = 0: it is a quadratic form of d alone. If for all directions of the node
//! all l_k > 0 and the form is negative, no line has all s_k h_k > 0. Likewise if all l_k < 0 and the form is
//! positive. Linear programs over the corners cannot prove this, since they do not know that d . (d x p) = 0.

use crate::line_side::{Row, U};
use crate::sight::Sight;
use visibility_core::glam::DVec3;

/// Greatest number of rows (dividing edges, each with a required side) of a node whose triples are tried.
/// With more rows, no triple is tried.
const MAX_ROWS: usize = 14;

/// Searches three rows, edges with a side, that no line of a node satisfies together, and returns their
/// indices. `None` if no triple is proven.
pub(crate) fn find(sight: &Sight, rows: &[Row], delta: f64) -> Option<[u32; 3]> {
    if rows.len() > MAX_ROWS {
        return None;
    }
    for a in 0..rows.len() {
        for b in a + 1..rows.len() {
            for c in b + 1..rows.len() {
                if excludes(sight, [&rows[a], &rows[b], &rows[c]], delta) {
                    return Some([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    None
}

/// Returns whether three rows, edges with a side, exclude all lines of a node.
///
/// As at the head of this file, t_k is the unit direction of edge k, s_k its required sign, d = q - p the
/// direction of a line from p to q, and v an end of the first edge. With g_k the computed rows of the inverse
/// of the matrix with columns s_k t_k, and l_k = g_k . d, the sum of l_k s_k t_k is R d with R close to the
/// identity. R - I is recomputed, and each entry is wrong by at most 8 U K, with U the unit round-off of
/// `f64` and K the sum of |s_k t_k| |g_k|. The term d . (d x (v - p)) then does not vanish, but is at most e
/// |d|^2 |v - p|, where e = 3 max |R - I| + 24 U K. The form itself is a sum of products of at most 9
/// roundings each. All this is covered by (e + 64 U K) |d_i| |d_j| D, with D the greatest distance involved.
/// Corners are known up to delta, and directions up to 4 delta in length, which changes the doubled polar
/// form by at most 16 delta K D (|d_i| + |d_j|). Ends of edges are known up to delta too: unit vectors of
/// edges of length L turn by 4 delta / L, which changes the g_k by 4 delta K |g_k| / L and the products e_m x
/// t_m by 4 delta (1 + D / L). With D no less than |d|, a factor of 1 + K D / L covers both.
fn excludes(sight: &Sight, rows: [&Row; 3], delta: f64) -> bool {
    let t = rows.map(|row| (row.edge.ends[1] - row.edge.ends[0]).normalize_or_zero() * row.side);
    let cross = [t[1].cross(t[2]), t[2].cross(t[0]), t[0].cross(t[1])];
    let determinant = t[0].dot(cross[0]);
    // The inverse of three nearly coplanar directions is too inexact to be used.
    if determinant.abs() < 1e-6 {
        return false;
    }
    let middle = sight.q.center() - sight.p.center();
    let flip = if cross[0].dot(middle) / determinant < 0.0 { -1.0 } else { 1.0 };
    let g = cross.map(|cross| cross * (flip / determinant));
    let k: f64 = g.iter().map(|g| g.length()).sum();
    let shortest =
        rows.map(|row| row.edge.ends[0].distance(row.edge.ends[1])).into_iter().fold(f64::MAX, f64::min);
    let positive = |d: DVec3| {
        let turned = 8.0 * delta * k / shortest;
        g.iter().all(|g| g.dot(d) > ((16.0 * U + turned) * d.length() + 4.0 * delta) * k)
    };
    if !positive(middle) {
        return false;
    }
    // The form is bilinear in the points of the viewcell and target polygons, so pairs of corners decide its
    // sign.
    let mut directions = [DVec3::ZERO; 64];
    let mut count = 0;
    for &p in sight.p.corners() {
        for &q in sight.q.corners() {
            directions[count] = q - p;
            count += 1;
        }
    }
    let directions = &directions[..count];
    if !directions.iter().all(|&d| positive(d)) {
        return false;
    }
    let v = rows[0].edge.ends[0];
    let e = [0, 1, 2].map(|m| {
        let x = rows[m].edge.ends[0] - v;
        x - t[m] * x.dot(t[m])
    });
    let residual = DVec3::AXES.into_iter().fold(0.0f64, |most, axis| {
        let column: DVec3 = (0..3).map(|m| t[m] * (g[m].dot(axis) * flip)).sum();
        most.max((column - axis).abs().max_element())
    });
    let corners = sight.p.corners().iter().map(|p| v.distance(*p));
    let lengths = e.iter().chain(directions).map(|x| x.length());
    let far = corners.chain(lengths).fold(0.0, f64::max);
    let bound = (3.0 * residual + 128.0 * U * k) * far;
    let moved = 16.0 * delta * k * far * (1.0 + k * far / shortest);
    // Twice the polar form (the symmetric bilinear form) at two directions.
    let form = |x: DVec3, y: DVec3| -> f64 {
        (0..3)
            .map(|m| {
                let w = e[m].cross(t[m]);
                g[m].dot(x) * w.dot(y) + g[m].dot(y) * w.dot(x)
            })
            .sum()
    };
    (0..count).all(|i| {
        (i..count).all(|j| {
            let (x, y) = (directions[i], directions[j]);
            form(x, y) < -2.0 * bound * x.length() * y.length() - moved * (x.length() + y.length())
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::half::Half;
    use crate::line_side::Edge;
    use crate::polygon::Polygon;
    use visibility_testing::Random;

    /// Three edges through one point, and lines through this point, which are on no side of any edge.
    /// Positions are moved by their error, or rounded only.
    #[test]
    fn lines_through_a_corner_are_not_excluded() {
        let mut random = Random(7);
        let mut tried = 0;
        for round in 0i32..20_000 {
            let mut int =
                |r: i32| DVec3::from_array(core::array::from_fn(|_| f64::from(random.between(-r, r))));
            let v = int(50);
            let t = [int(9), int(9), int(9)];
            if t[0].dot(t[1].cross(t[2])) == 0.0 {
                continue;
            }
            let flip = if round % 4 < 2 { 1.0 } else { -1.0 };
            let d = (t[0] + t[1] + t[2]) * flip;
            let delta = if round % 2 == 0 { 1e-9 } else { 0.0 };
            let quad = |at: DVec3| {
                let [a, b] = [d.any_orthogonal_vector(), d.cross(d.any_orthogonal_vector())]
                    .map(|x| x.normalize() * 1e-3);
                Polygon::new(&[at - a - b, at + a - b, at + a + b, at - a + b])
            };
            // The corner is halfway between the two polygons, or close to the viewcell's.
            let (p, q) = (quad(v - d / [1.0, 256.0][(round / 2 % 2) as usize]), quad(v + d));
            let half = Half { normal: DVec3::X, offset: 0.0 };
            let sight = Sight { p, q, before_p: half, before_q: half, near: None };
            let mut row = |k: usize| {
                let mut end = |m: i32| {
                    let error = random.fine_vector(delta);
                    v + t[k] * (f64::from(m) * [1.0, 1.0 / 1024.0][(round / 4 % 2) as usize]) + error
                };
                let (m, n) = (round % 5 - 7, round % 7 + 3);
                Row { edge: Edge::new(end(m), end(n)), side: 1.0 }
            };
            let rows = [row(0), row(1), row(2)];
            tried += 1;
            assert!(!excludes(&sight, [&rows[0], &rows[1], &rows[2]], delta), "{round}: {v} {t:?}");
        }
        assert!(tried > 10_000, "cases tried: {tried}");
    }
}
