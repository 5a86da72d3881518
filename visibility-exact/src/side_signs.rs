//! The sides on which the lines between two polygons pass an edge, and where a side is exactly 0.

use crate::line_side::{Edge, SideFrom, sign};
use crate::sight::Sight;
use visibility_core::glam::DVec3;

/// Bit of a side that is certainly positive, in a set of the sides at pairs of corners.
pub(crate) const POSITIVE: u8 = 1;
/// Bit of a side that is certainly negative: see [`POSITIVE`].
pub(crate) const NEGATIVE: u8 = 2;
/// Bit of a side whose sign rounding leaves undecided: see [`POSITIVE`].
pub(crate) const UNSURE: u8 = 4;

/// Cases in which the side of an edge is exactly 0. One is a line to a corner of Q that is a mixture of ends
/// of the edge. The other is a line between two points of a plane that also holds the edge: P's plane, by
/// which Q or an occluder may have been cut, or Q's plane, by which P or an occluder may have been cut.
pub(crate) struct Zeros {
    /// For each end of the edge, the corner of the target triangle that it is (0, 1 or 2), or 3 for none.
    tags: [u8; 2],
    /// Whether both ends of the edge lie in P's plane.
    in_p: bool,
    /// Whether both ends of the edge lie in Q's plane.
    in_q: bool,
}

impl Zeros {
    #[inline]
    pub(crate) fn new(sight: &Sight, edge: &Edge) -> Self {
        let [a, b] = edge.ends;
        let in_p = sight.before_p.holds(a) && sight.before_p.holds(b);
        Self { tags: edge.tags, in_p, in_q: sight.is_in_plane_of_q(a) && sight.is_in_plane_of_q(b) }
    }

    /// Returns whether the side is exactly 0 for the line from a corner of P to a corner of Q. `zero` has a
    /// bit for each barycentric coordinate of q that is exactly 0.
    #[inline]
    pub(crate) fn hold(&self, sight: &Sight, p: DVec3, q: DVec3, zero: u8) -> bool {
        let [a, b] = self.tags;
        let at = |tag: u8| tag < 3 && zero == 0b111 ^ (1 << tag);
        (zero != 0 && (at(a) || at(b) || (a < 3 && b < 3 && a != b && zero & (1 << (3 - a - b)) != 0)))
            || (self.in_p && sight.before_p.holds(p) && sight.before_p.holds(q))
            || (self.in_q && sight.is_in_plane_of_q(p) && sight.is_in_plane_of_q(q))
    }
}

/// Returns the set of signs that the side of an edge has over the pairs of corners of P and Q. Exact zeros
/// are left out: they lie on the boundary of P or Q, and with one sign at the other corners the side has that
/// sign for all points inside. Stops once no single sign is possible.
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
