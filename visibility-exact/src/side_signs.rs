//! Signs of the sides on which the lines between two polygons pass an edge, and cases where a side is exactly
//! 0.

use crate::line_side::{Edge, SideFrom, sign};
use crate::sight::Sight;
use visibility_core::glam::DVec3;

/// Bit in the set of signs of an edge: some line from a corner of the viewcell polygon to a corner of the
/// target polygon certainly passes the edge on its positive side.
pub(crate) const POSITIVE: u8 = 1;
/// Bit in the set of signs of an edge: some line between corners of the two polygons certainly passes the
/// edge on its negative side.
pub(crate) const NEGATIVE: u8 = 2;
/// Bit in the set of signs of an edge: rounding leaves undecided on which side some line between corners of
/// the two polygons passes the edge.
pub(crate) const UNSURE: u8 = 4;

/// Cases in which the side of an edge is exactly 0. In the first, the line ends at a corner of the target
/// polygon Q that is an end of the edge or a mean of its two ends, by their tags as corners of the target
/// triangle. In the second, the line and the edge lie in one plane: the plane of the viewcell polygon P or
/// that of Q. Both are frequent, since polygons and occluders are cut by these planes.
pub(crate) struct Zeros {
    /// For each end of the edge, the number of the target triangle's corner that it is (0, 1 or 2), or 3 for
    /// none.
    tags: [u8; 2],
    /// Whether both ends of the edge lie in the viewcell polygon's plane.
    in_p: bool,
    /// Whether both ends of the edge lie in the target polygon's plane.
    in_q: bool,
}

impl Zeros {
    #[inline]
    pub(crate) fn new(sight: &Sight, edge: &Edge) -> Self {
        let [a, b] = edge.ends;
        let in_p = sight.before_p.holds(a) && sight.before_p.holds(b);
        Self { tags: edge.tags, in_p, in_q: sight.is_in_plane_of_q(a) && sight.is_in_plane_of_q(b) }
    }

    /// Returns whether the side is exactly 0 for the line from corner `p` of the viewcell polygon to corner
    /// `q` of the target polygon. Bit i of `zero` is set if barycentric coordinate i of q in the target
    /// triangle is exactly 0.
    #[inline]
    pub(crate) fn hold(&self, sight: &Sight, p: DVec3, q: DVec3, zero: u8) -> bool {
        let [a, b] = self.tags;
        let at = |tag: u8| tag < 3 && zero == 0b111 ^ (1 << tag);
        (zero != 0 && (at(a) || at(b) || (a < 3 && b < 3 && a != b && zero & (1 << (3 - a - b)) != 0)))
            || (self.in_p && sight.before_p.holds(p) && sight.before_p.holds(q))
            || (self.in_q && sight.is_in_plane_of_q(p) && sight.is_in_plane_of_q(q))
    }
}

/// Returns the set of signs of an edge's side over all pairs of a corner of the viewcell polygon and a corner
/// of the target polygon. Exact zeros are left out, since they lie on the boundary of a polygon: if all other
/// pairs have one sign, the side has this sign for all points inside. Stops once both signs, or an undecided
/// one, are found.
#[inline]
pub(crate) fn signs(sight: &Sight, edge: &Edge, delta: f64) -> u8 {
    let mut found = 0;
    let zeros = Zeros::new(sight, edge);
    for &from in sight.p.corners() {
        let side = SideFrom::new(from, edge.ends[0], edge.ends[1], delta);
        for (&to, &zero) in sight.q.corners().iter().zip(&sight.q.zero) {
            if zeros.hold(sight, from, to, zero) {
                continue;
            }
            found |= match sign(side.to(to)) {
                1 => POSITIVE,
                -1 => NEGATIVE,
                _ => UNSURE,
            };
            if found >= UNSURE || found == POSITIVE | NEGATIVE {
                return found;
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::half::Half;
    use crate::polygon::Polygon;

    fn sight(near: Option<f64>) -> Sight {
        let [p, q] = [0.0, 9.0]
            .map(|x| Polygon::new(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]].map(|[y, z]| DVec3::new(x, y, z))));
        let before_p = Half { normal: DVec3::X, offset: 0.0 };
        Sight { p, q, before_p, before_q: Half { normal: DVec3::NEG_X, offset: 9.0 }, near }
    }

    /// Of an edge between corners of the target, lines to its ends and to what is between them are exactly on
    /// side 0. Of an edge with one such corner, lines to this corner.
    #[test]
    fn lines_to_means_of_an_edges_ends_pass_it_on_side_0() {
        for [a, b] in (0..16u8).map(|k| [k / 4, k % 4]).filter(|[a, b]| a != b || *a == 3) {
            let ends = [a, b].into_iter().filter(|tag| *tag < 3).fold(0, |ends, tag| ends | 1 << tag);
            for zero in 0..0b111u8 {
                let zeros = Zeros { tags: [a, b], in_p: false, in_q: false };
                let is_mean = 0b111 & !zero & !ends == 0;
                let found = zeros.hold(&sight(None), DVec3::ZERO, DVec3::X, zero);
                assert_eq!(found, is_mean, "tags {a} and {b}, zeros {zero:03b}");
            }
        }
    }

    /// Lines and edges in the plane of a polygon are on side 0. One point of the four outside of it suffices
    /// for another side.
    #[test]
    fn lines_and_edges_in_one_plane_are_on_side_0() {
        for (near, x, beside) in
            [(None, 0.0, 1e-9), (None, 9.0, 1e-9), (Some(0.25), 9.0, 0.3), (Some(0.25), 9.0, -0.3)]
        {
            let sight = sight(near);
            for outside in 0..5 {
                let x = |k: usize| if k == outside { x + beside } else { x };
                let [a, b, p, q] =
                    [[5.0, 6.0], [7.0, 9.0], [0.0, 0.0], [1.0, 1.0]].map(|[y, z]| DVec3::new(0.0, y, z));
                let [a, b, p, q] = [(0, a), (1, b), (2, p), (3, q)].map(|(k, v)| v + DVec3::X * x(k));
                let found = Zeros::new(&sight, &Edge::new(a, b)).hold(&sight, p, q, 0);
                assert_eq!(found, outside == 4, "near {near:?}: point {outside} of 4 is beside the plane");
            }
        }
        let (sight, at) = (sight(Some(0.25)), |x: f64| DVec3::new(x, 5.0, 5.0));
        let zeros = Zeros::new(&sight, &Edge::new(at(8.8), at(9.2)));
        assert!(zeros.hold(&sight, at(8.9), at(9.1), 0), "four points near the plane count as in it");
    }
}
