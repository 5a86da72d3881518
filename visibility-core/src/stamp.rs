//! Stamps, by which a culler or a shared structure detects that the data it derived its state from has
//! changed or was replaced by other data.

use crate::serial::{is_same_range, next_serial};

/// Identifies the content of a structure that others derive state from: a cell graph, a PVS, a set of
/// occluders.
///
/// The structure takes a [new](Self::new) stamp when it is made and after every change of its content, so
/// equal stamps mean equal content. A clone keeps the stamp of the original until one of the two changes.
/// State derived from the structure is kept together with the structure's stamp, and is computed again when
/// the two stamps differ. Stamps have no order, and two different stamps may belong to equal contents.
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
    /// The stamp of no content, equal to no stamp from [`new`](Self::new). A cache holds `NONE` until it is
    /// first filled.
    pub const NONE: Self = Self(0);

    /// Returns a stamp different from all stamps of this process.
    #[expect(clippy::new_without_default, reason = "a default would suggest a fixed value")]
    pub fn new() -> Self {
        Self(next_serial())
    }

    /// Makes a stamp of a number counted up from [`next_range`](crate::serial::next_range). Such numbers are
    /// at least 2^40, and [`new`](Self::new) counts up from 1, so the two give equal stamps only after 2^40
    /// calls of `new`.
    pub(crate) const fn from_count(count: u64) -> Self {
        Self(count)
    }

    /// Returns the number that makes the stamp differ from others.
    pub(crate) const fn number(self) -> u64 {
        self.0
    }

    /// Returns whether two stamps made by [`from_count`](Self::from_count) are of the same range, as the
    /// layouts of one scene are.
    pub(crate) fn is_of_same_range(self, other: Self) -> bool {
        is_same_range(self.0, other.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_distinct() {
        let stamps = core::array::from_fn::<Stamp, 8, _>(|_| Stamp::new());
        assert!(
            (0..8).all(|i| stamps[i] != Stamp::NONE && !stamps[..i].contains(&stamps[i])),
            "stamps are distinct and none is `NONE`: {stamps:?}"
        );
    }
}
