//! Queue entries of a lazy greedy choice. The gain of a candidate only shrinks as others are chosen, so a
//! gain is computed again only when its candidate comes to the top of the queue.

use core::cmp::Ordering;

/// A candidate of a greedy choice (an occluder to use next), as an entry of a binary heap. The greatest entry
/// is chosen next: greatest gain, then greatest `tie_break`, then lowest `number`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Candidate {
    /// Gain of choosing the candidate, in the caller's unit. Further choices can only lower it, so a gain
    /// computed before the last choice is an upper bound.
    pub(crate) gain: f64,
    /// Rank among candidates of equal gain; the greater comes first.
    pub(crate) tie_break: f64,
    /// Index of the candidate in the list from which the caller chooses.
    pub(crate) number: u32,
    /// Number of candidates that had been chosen when `gain` was computed; `u32::MAX` for an initial
    /// estimate.
    pub(crate) evaluated_at: u32,
}

impl Eq for Candidate {}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_gain = self.gain.total_cmp(&other.gain).then(self.tie_break.total_cmp(&other.tie_break));
        by_gain.then(other.number.cmp(&self.number))
    }
}
