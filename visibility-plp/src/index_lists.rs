//! Lists of numbers, one after another in a single array (compressed sparse rows, CSR).

use alloc::vec::Vec;

/// Compressed sparse rows: one list of `u32` for each list number from 0 on.
#[derive(Clone, Debug, Default)]
pub(crate) struct IndexLists {
    /// CSR offsets: the index in `items` of each list's first item, then the end of the last list. One entry
    /// more than there are lists.
    pub(crate) starts: Vec<usize>,
    /// Items of all lists, in order of the list number.
    pub(crate) items: Vec<u32>,
}

impl IndexLists {
    /// Makes `count` lists from `pairs` of a list number and an item. Items of one list keep the order of the
    /// pairs. Panics if a list number is `count` or more.
    pub(crate) fn new(count: usize, pairs: impl Iterator<Item = (u32, u32)> + Clone) -> Self {
        let mut starts = alloc::vec![0usize; count + 1];
        for (list, _) in pairs.clone() {
            starts[list as usize + 1] += 1;
        }
        for list in 1..starts.len() {
            starts[list] += starts[list - 1];
        }
        let mut places = starts.clone();
        let mut items = alloc::vec![0u32; starts[count]];
        for (list, item) in pairs {
            let place = &mut places[list as usize];
            items[*place] = item;
            *place += 1;
        }
        Self { starts, items }
    }

    /// Returns the items of one list. Panics if `list` is not a list number.
    #[inline]
    pub(crate) fn get(&self, list: usize) -> &[u32] {
        &self.items[self.starts[list]..self.starts[list + 1]]
    }

    /// Returns the heap memory of the lists in bytes, without spare capacity.
    pub(crate) fn memory(&self) -> usize {
        size_of_val(&self.starts[..]) + size_of_val(&self.items[..])
    }
}
