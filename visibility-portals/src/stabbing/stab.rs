//! The answer to whether a line passes a sequence of openings.

use crate::lp::Certificate;

/// Answer to whether a line passes a sequence of openings. `L` is the type of a line: a point and a
/// direction.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Stab<L> {
    /// A line that certainly passes all openings, at least the clearance away from all their edges.
    Line(L),
    /// Certainly no line passes all openings with the clearance. The certificate names a few ends of
    /// segments, or edges of polygons, by an index counted through the whole sequence: no line passes even
    /// these.
    No(Certificate),
    /// Undecided: neither a line nor a certificate was found.
    Undecided,
}

impl<L> Stab<L> {
    /// Returns whether the answer is [`Stab::No`]: certainly no line passes all openings. False for a line
    /// and if undecided.
    pub fn is_no(&self) -> bool {
        matches!(self, Self::No(_))
    }
}
