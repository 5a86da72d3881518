//! Lists of numbers, stored one after another in one array (compressed sparse rows).

use alloc::vec::Vec;

/// One list of `u32` for each number below a count.
#[derive(Clone, Debug, Default)]
pub(crate) struct IndexLists {
    /// First item of each list, an index into `items`, and the end of the last list. One more than there are
    /// lists.
    pub(crate) starts: Vec<u32>,
    pub(crate) items: Vec<u32>,
}

impl IndexLists {
    /// Makes `count` lists from pairs of a list's number and an item. Items of one list keep their order.
    /// Panics if a pair names a list of `count` or more.
    pub(crate) fn new(count: usize, pairs: &[(u32, u32)]) -> Self {
        let mut starts = alloc::vec![0u32; count + 1];
        for &(list, _) in pairs {
            starts[list as usize + 1] += 1;
        }
        for list in 1..starts.len() {
            starts[list] += starts[list - 1];
        }
        let mut places = starts.clone();
        let mut items = alloc::vec![0u32; pairs.len()];
        for &(list, item) in pairs {
            let place = &mut places[list as usize];
            items[*place as usize] = item;
            *place += 1;
        }
        Self { starts, items }
    }

    /// The items of a list. Panics for a number that is no list's.
    #[inline]
    pub(crate) fn get(&self, list: usize) -> &[u32] {
        &self.items[self.starts[list] as usize..self.starts[list + 1] as usize]
    }

    /// Heap memory in bytes.
    pub(crate) fn memory(&self) -> usize {
        size_of_val(&self.starts[..]) + size_of_val(&self.items[..])
    }
}
