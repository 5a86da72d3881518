//! A table from the indices of objects to places in a list.

use alloc::boxed::Box;
use alloc::vec::Vec;

/// Number of indices in a block of the table.
const BLOCK: usize = 4096;

/// No place.
const NONE: u32 = u32::MAX;

/// Places by the index of an object, in blocks that are made when an index in them first gets a place. So one
/// index as great as indices can be takes 8 MB, not the 16 GB of a plain list.
#[derive(Clone, Debug)]
pub(super) struct Places(Vec<Option<Box<[u32; BLOCK]>>>);

impl Places {
    pub(super) const fn new() -> Self {
        Self(Vec::new())
    }

    /// Returns the place of an index. `None` if it has none.
    #[inline]
    pub(super) fn get(&self, index: usize) -> Option<u32> {
        let place = self.0.get(index / BLOCK)?.as_ref()?[index % BLOCK];
        (place != NONE).then_some(place)
    }

    /// Sets the place of an index, or takes the place away.
    pub(super) fn set(&mut self, index: usize, place: Option<u32>) {
        if self.0.len() <= index / BLOCK {
            self.0.resize(index / BLOCK + 1, None);
        }
        let block = self.0[index / BLOCK].get_or_insert_with(|| Box::new([NONE; BLOCK]));
        block[index % BLOCK] = place.unwrap_or(NONE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_kept_by_index() {
        let mut places = Places::new();
        for index in [0, BLOCK - 1, BLOCK, 5 * BLOCK + 3] {
            assert_eq!(places.get(index), None, "index {index} at first");
            places.set(index, Some(index as u32 + 7));
            assert_eq!(places.get(index), Some(index as u32 + 7), "index {index}");
            places.set(index, None);
            assert_eq!(places.get(index), None, "index {index} at last");
        }
    }
}
