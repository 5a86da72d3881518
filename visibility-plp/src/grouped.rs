//! Lists by number, one after another in one array.

use alloc::vec::Vec;

/// For each of many numbers, a list of numbers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Grouped {
    /// Where each list begins in `items`, and where the last one ends.
    pub(crate) starts: Vec<u32>,
    pub(crate) items: Vec<u32>,
}

impl Grouped {
    /// From pairs of a list's number, below `count`, and an item; items keep their order.
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

    #[inline]
    pub(crate) fn get(&self, list: usize) -> &[u32] {
        &self.items[self.starts[list] as usize..self.starts[list + 1] as usize]
    }

    pub(crate) fn memory(&self) -> usize {
        size_of_val(&self.starts[..]) + size_of_val(&self.items[..])
    }
}
