//! One bit for each object index.

use alloc::vec::Vec;

/// A set of object indices, one bit each. Holds words only up to the greatest index that was ever in it.
#[derive(Clone, Debug, Default)]
pub(super) struct IndexBits(Vec<u64>);

impl IndexBits {
    /// Returns whether the set holds an index. False beyond all indices that were ever in it.
    pub(super) fn contains(&self, index: usize) -> bool {
        self.0.get(index / 64).is_some_and(|word| word >> (index % 64) & 1 != 0)
    }

    /// Adds or removes an index.
    pub(super) fn set(&mut self, index: usize, value: bool) {
        if self.0.len() <= index / 64 {
            if !value {
                return;
            }
            self.0.resize(index / 64 + 1, 0);
        }
        let word = &mut self.0[index / 64];
        *word = *word & !(1 << (index % 64)) | u64::from(value) << (index % 64);
    }

    /// Returns the number of bytes in use.
    pub(super) fn memory(&self) -> usize {
        size_of_val(&self.0[..])
    }
}
