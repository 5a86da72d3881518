//! The answer to whether a line passes.

use crate::lp::Certificate;

/// Whether a line passes through a sequence; `L` is the line, by a point and a direction.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Stab<L> {
    /// This one does, surely, and stays clear of all edges by the clearance.
    Line(L),
    /// None does that stays clear of all edges by the clearance. The certificate names a few ends of segments
    /// or edges of polygons, counted through the sequence: no line passes even these.
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
