//! Memory of a set for walks on several threads.

use crate::CullStats;
use alloc::vec::Vec;

/// Memory of walks on several threads, kept from frame to frame.
#[derive(Clone, Debug)]
pub(crate) struct SplitScratch {
    /// Subtrees in the order of the walk: the node number of each one's root, and the number `known` that the
    /// tests above have passed down to it.
    pub(crate) subtrees: Vec<(u32, u32)>,
    /// Empty before the first walk, then a fixed number of elements, among which the subtrees are dealt out.
    pub(crate) parts: Vec<Part>,
}

impl SplitScratch {
    pub(crate) const EMPTY: Self = Self { subtrees: Vec::new(), parts: Vec::new() };
}

/// Result of a part of a walk on several threads.
#[derive(Clone, Debug, Default)]
pub(crate) struct Part {
    pub(crate) masks: NewMasks,
    /// For each subtree of the part, whether any object of the subtree is left in the set.
    pub(crate) is_any_left: Vec<bool>,
    pub(crate) stats: CullStats,
}

/// New masks of nodes. Siblings are mostly numbered one after the other, so that runs of masks can be copied.
#[derive(Clone, Debug, Default)]
pub(crate) struct NewMasks {
    masks: Vec<u64>,
    /// First node of each run of consecutive nodes, and the length of the run.
    runs: Vec<(u32, u32)>,
}

impl NewMasks {
    pub(crate) fn clear(&mut self) {
        self.masks.clear();
        self.runs.clear();
    }

    /// Appends the mask of a node.
    #[inline(always)]
    pub(crate) fn push(&mut self, node: usize, mask: u64) {
        match self.runs.last_mut() {
            Some((first, length)) if *first + *length == node as u32 => *length += 1,
            _ => self.runs.push((node as u32, 1)),
        }
        self.masks.push(mask);
    }

    /// Iterates over the runs of masks, each with its first node.
    pub(crate) fn runs(&self) -> impl Iterator<Item = (usize, &[u64])> {
        let mut rest = &self.masks[..];
        self.runs.iter().map(move |&(first, length)| {
            let (run, others) = rest.split_at(length as usize);
            rest = others;
            (first as usize, run)
        })
    }
}
