//! What derived state was made from: the one type by which a culler or a shared structure tells its sources
//! apart.

use crate::serial::next_serial;

/// Identifies the content of a structure that others derive state from: a cell graph, a PVS, a set of
/// occluders.
///
/// A structure takes a [new](Self::new) stamp when it is made and after every change of its content, so equal
/// stamps mean equal content. A clone keeps the stamp of the original until either of them changes. Whatever
/// is derived from the structure keeps the stamp beside it, and is made anew when the two differ. Stamps have
/// no order: two that differ say nothing else about their owners.
///
/// ```
/// use visibility_core::stamp::Stamp;
/// let mut cells = Stamp::new();
/// let cached_for = cells;
/// assert_eq!(cached_for, cells);
/// cells = Stamp::new(); // the content has changed
/// assert_ne!(cached_for, cells);
/// assert_ne!(Stamp::NONE, cells);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub struct Stamp(u64);

impl Stamp {
    /// The stamp of no content: what a cache holds before it is filled for the first time.
    pub const NONE: Self = Self(0);

    /// A stamp that no other content has.
    #[expect(clippy::new_without_default, reason = "a default would suggest a fixed value")]
    pub fn new() -> Self {
        Self(next_serial())
    }

    /// The stamp with a number that its owner has counted up from [`next_range`](crate::serial::next_range),
    /// whose numbers are greater than any serial.
    pub(crate) const fn from_count(count: u64) -> Self {
        Self(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_distinct() {
        let stamps = core::array::from_fn::<Stamp, 8, _>(|_| Stamp::new());
        assert!((0..8).all(|i| stamps[i] != Stamp::NONE && !stamps[..i].contains(&stamps[i])));
    }
}
