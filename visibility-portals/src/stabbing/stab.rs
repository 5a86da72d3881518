//! The answer to whether a line passes a sequence of openings.

use crate::lp::Certificate;

/// Answer to whether a line passes a sequence of openings. `L` is the type of a line: a point and a
/// direction.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Stab<L> {
    /// A line that certainly passes all openings, and stays at least the stabber's clearance away from all
    /// edges of polygons (all ends of segments).
    Line(L),
    /// Certainly no line passes all openings with the clearance. The certificate names a few ends of
    /// segments, or a few edges of polygons, which alone already exclude every line. Its indices count the
    /// ends or edges through the whole sequence of openings, from 0.
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
