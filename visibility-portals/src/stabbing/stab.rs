//! The answer to whether a line passes a sequence of openings.

use crate::lp::Certificate;

/// Whether a line passes a sequence of openings. `L` is the line, by a point and a direction.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Stab<L> {
    /// A line that certainly passes all openings, at least the clearance away from all their edges.
    Line(L),
    /// No line passes all openings that far from their edges. The certificate names a few of the ends of
    /// segments, or edges of polygons, counted through the sequence: no line passes even these.
    No(Certificate),
    /// Neither was shown.
    Maybe,
}

impl<L> Stab<L> {
    /// Whether it is certain that no line passes.
    pub fn is_no(&self) -> bool {
        matches!(self, Self::No(_))
    }
}
