//! Sets of indices, one bit for each.

use alloc::vec::Vec;
use visibility_core::{Scene, VisibleSet};

/// A set of indices below a limit.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bits(Vec<u64>);

impl Bits {
    pub(crate) const EMPTY: Self = Self(Vec::new());

    pub(crate) fn new(limit: usize) -> Self {
        Self(alloc::vec![0; limit.div_ceil(64)])
    }

    /// Returns the indices of the objects that may occlude: the candidates flagged as occluders, as
    /// [`VisibleSet::for_each_occluder`] lists them.
    pub(crate) fn occluding(scene: &Scene, visible: &VisibleSet) -> Self {
        let mut bits = Self::new(scene.index_limit());
        visible.for_each_occluder(scene, |id| {
            bits.insert(id.index());
        });
        bits
    }

    /// Removes all indices, and sets the limit.
    pub(crate) fn reset(&mut self, limit: usize) {
        self.0.clear();
        self.0.resize(limit.div_ceil(64), 0);
    }

    /// Returns whether an index is in the set. False beyond the limit.
    #[inline]
    pub(crate) fn contains(&self, index: usize) -> bool {
        self.0.get(index / 64).is_some_and(|word| word >> (index % 64) & 1 != 0)
    }

    /// Returns whether `other` has all indices of this set.
    pub(crate) fn is_subset(&self, other: &Self) -> bool {
        let words = other.0.iter().copied().chain(core::iter::repeat(0));
        self.0.iter().zip(words).all(|(own, other)| own & !other == 0)
    }

    /// Adds an index, unless the index is beyond the limit. Returns whether the index is new.
    pub(crate) fn insert(&mut self, index: usize) -> bool {
        let Some(word) = self.0.get_mut(index / 64) else { return false };
        let new = *word >> (index % 64) & 1 == 0;
        *word |= 1 << (index % 64);
        new
    }
}
