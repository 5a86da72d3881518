//! Sets of indices, one bit for each.

use alloc::vec::Vec;

/// A set of indices below a limit, one bit for each. The limit is always a multiple of 64.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bits(Vec<u64>);

impl Bits {
    /// The empty set with limit 0, which no index can be added to.
    pub const EMPTY: Self = Self(Vec::new());

    /// Returns an empty set for the indices below `limit`, which is rounded up to a multiple of 64.
    pub fn new(limit: usize) -> Self {
        Self(alloc::vec![0; limit.div_ceil(64)])
    }

    /// Removes all indices, and sets the limit to `limit`, rounded up to a multiple of 64.
    pub fn reset(&mut self, limit: usize) {
        self.0.clear();
        self.0.resize(limit.div_ceil(64), 0);
    }

    /// Removes all indices. The limit stays.
    pub fn clear(&mut self) {
        self.0.fill(0);
    }

    /// Raises the limit to `limit`, rounded up to a multiple of 64. Does nothing if the limit is that high
    /// already.
    pub fn grow(&mut self, limit: usize) {
        if self.0.len() < limit.div_ceil(64) {
            self.0.resize(limit.div_ceil(64), 0);
        }
    }

    /// Returns whether an index is in the set. False for an index at or beyond the limit.
    #[inline]
    pub fn contains(&self, index: usize) -> bool {
        self.0.get(index / 64).is_some_and(|word| word >> (index % 64) & 1 != 0)
    }

    /// Adds an index, unless the index is at or beyond the limit. Returns true if the index was added, false
    /// if the set had it already or cannot hold it.
    #[inline]
    pub fn insert(&mut self, index: usize) -> bool {
        let Some(word) = self.0.get_mut(index / 64) else { return false };
        let new = *word >> (index % 64) & 1 == 0;
        *word |= 1 << (index % 64);
        new
    }

    /// Removes an index. Returns whether the index was in the set.
    #[inline]
    pub fn remove(&mut self, index: usize) -> bool {
        let Some(word) = self.0.get_mut(index / 64) else { return false };
        let known = *word >> (index % 64) & 1 != 0;
        *word &= !(1 << (index % 64));
        known
    }

    /// Adds an index if `value` is true, or else removes it. Does nothing for an index at or beyond the
    /// limit.
    #[inline]
    pub fn set(&mut self, index: usize, value: bool) {
        if let Some(word) = self.0.get_mut(index / 64) {
            *word = *word & !(1 << (index % 64)) | u64::from(value) << (index % 64);
        }
    }

    /// Adds all indices of `other`. Indices at or beyond the limit of this set are left out.
    pub fn unite(&mut self, other: &Self) {
        self.unite_words(other.0.iter().copied());
    }

    /// Adds the indices whose bits are set in `words`, in the layout of [`words`](Self::words). Indices at or
    /// beyond the limit of this set are left out.
    #[inline]
    pub fn unite_words(&mut self, words: impl Iterator<Item = u64>) {
        self.0.iter_mut().zip(words).for_each(|(own, other)| *own |= other);
    }

    /// Removes the indices that `other` lacks.
    pub fn intersect(&mut self, other: &Self) {
        let words = other.0.iter().copied().chain(core::iter::repeat(0));
        self.0.iter_mut().zip(words).for_each(|(own, other)| *own &= other);
    }

    /// Returns the number of indices.
    pub fn count(&self) -> u32 {
        self.0.iter().map(|word| word.count_ones()).sum()
    }

    /// Returns the number of indices of this set that `other` lacks.
    pub fn count_without(&self, other: &Self) -> u32 {
        let words = other.0.iter().copied().chain(core::iter::repeat(0));
        self.0.iter().zip(words).map(|(own, other)| (own & !other).count_ones()).sum()
    }

    /// Returns the least index in the set that is not below `first`. `None` if there is none.
    pub fn next(&self, first: usize) -> Option<usize> {
        let head = self.0.get(first / 64)? & u64::MAX << (first % 64);
        let rest = self.0[first / 64 + 1..].iter().copied();
        let mut words = core::iter::once(head).chain(rest).zip(first / 64..);
        words.find(|(word, _)| *word != 0).map(|(word, at)| at * 64 + word.trailing_zeros() as usize)
    }

    /// Iterates over the indices, ascending.
    pub fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        core::iter::successors(self.next(0), |&index| self.next(index + 1))
    }

    /// Returns the words: index `i` is bit `i % 64` of word `i / 64`.
    pub fn words(&self) -> &[u64] {
        &self.0
    }

    /// Returns the number of bytes in use on the heap, without spare capacity.
    pub fn memory(&self) -> usize {
        size_of_val(&self.0[..])
    }
}

impl From<Vec<u64>> for Bits {
    /// Makes a set from its [`words`](Self::words).
    fn from(words: Vec<u64>) -> Self {
        Self(words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use visibility_testing::Random;

    #[test]
    fn answers_as_a_set_of_the_standard_library() {
        let mut random = Random(0x9e37_79b9);
        let (mut bits, mut other) = (Bits::new(200), Bits::new(130));
        let (mut set, mut other_set) = (BTreeSet::new(), BTreeSet::new());
        for round in 0..2000 {
            let index = random.below(260);
            match round % 5 {
                0 => assert_eq!(bits.insert(index), index < 256 && set.insert(index), "insert {index}"),
                1 => assert_eq!(bits.remove(index), set.remove(&index), "remove {index}"),
                2 => {
                    bits.set(index, round % 2 == 0);
                    set.remove(&index);
                    set.extend((round % 2 == 0 && index < 256).then_some(index));
                }
                3 => assert_eq!(other.insert(index), index < 192 && other_set.insert(index), "other {index}"),
                _ => assert_eq!(bits.contains(index), set.contains(&index), "contains {index}"),
            }
            assert_eq!(bits.next(index), set.range(index..).next().copied(), "next from {index}");
            let without = set.difference(&other_set).count() as u32;
            assert_eq!(bits.count_without(&other), without, "indices that the other set lacks");
        }
        assert!(bits.iter().eq(set.iter().copied()), "{:?} listed of {set:?}", bits);
        other.unite(&bits);
        other_set.extend(set.range(..192));
        assert!(other.iter().eq(other_set.iter().copied()), "{:?} of the union {other_set:?}", other);
        let mut both = bits.clone();
        both.intersect(&other);
        let common: BTreeSet<usize> = set.intersection(&other_set).copied().collect();
        assert!(both.iter().eq(common.iter().copied()), "{both:?} of the intersection {common:?}");
        assert_eq!(both.count() as usize, common.len(), "number of indices of {both:?}");
        other.grow(1000);
        assert!(other.insert(999) && other.remove(999), "no index beyond the limit that was raised");
        other.grow(1);
        assert!(other.iter().eq(other_set), "indices changed as the limit rose");
        other.reset(64);
        assert_eq!(other, Bits::new(1), "a set with the limit 64 after it was emptied");
    }
}
