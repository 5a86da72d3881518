//! Result of a bake for one viewcell: the objects that are certainly seen, and those that are not proven
//! hidden.

use std::borrow::Cow;
use std::sync::Arc;
use visibility_core::binary_format::{FormatError, Reader, Writer};

/// Bounds on the set of objects visible from one viewcell: it contains all seen objects, and is contained in
/// the seen and the open objects together. Objects are given by their
/// [indices](visibility_core::ObjectId::index).
#[derive(Clone, PartialEq, Eq, Debug, Default)]
#[non_exhaustive]
pub struct CellSandwich {
    /// Objects that a line of sight reaches, ascending.
    pub seen: Vec<u32>,
    /// Objects that are neither seen nor proven hidden, ascending. They count as visible. Viewcells that were
    /// not worked on share one list of all objects.
    pub open: Arc<[u32]>,
    /// Number of objects that the sweep of extended projections found hidden.
    pub swept: u32,
    /// Number of objects that were proven hidden one by one or in groups.
    pub proven: u32,
    /// Work done after the sweep: the number of rays plus the number of nodes of the search for proofs.
    pub steps: u64,
}

impl CellSandwich {
    /// Returns the objects that count as visible, ascending.
    pub fn reported(&self) -> Cow<'_, [u32]> {
        if self.seen.is_empty() {
            return Cow::Borrowed(&self.open);
        }
        let mut row = [self.seen.as_slice(), &self.open].concat();
        row.sort_unstable();
        Cow::Owned(row)
    }

    pub(crate) fn save(&self, to: &mut Writer) {
        to.u32(self.swept);
        to.u32(self.proven);
        to.u64(self.steps);
        for list in [&self.seen[..], &self.open] {
            to.u32(list.len() as u32);
            to.u32s(list.iter().copied());
        }
    }

    /// Reads a result that [`save`](Self::save) has written. Indices of objects must be below `limit`.
    pub(crate) fn load(from: &mut Reader<'_>, limit: usize) -> Result<Self, FormatError> {
        let (swept, proven, steps) = (from.u32()?, from.u32()?, from.u64()?);
        let mut lists = [Vec::new(), Vec::new()];
        for list in &mut lists {
            let count = from.u32()? as usize;
            *list = from.u32s(count)?;
            let ascends = list.windows(2).all(|pair| pair[0] < pair[1]);
            if !ascends || list.last().is_some_and(|&last| last as usize >= limit) {
                return Err(from.content_error("objects of a viewcell are unknown or out of order"));
            }
        }
        let [seen, open] = lists;
        if open.iter().any(|index| seen.binary_search(index).is_ok()) {
            return Err(from.content_error("an object of a viewcell is both seen and open"));
        }
        Ok(Self { seen, open: open.into(), swept, proven, steps })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::binary_format::Format;

    const EXAMPLE: Format = Format { magic: *b"EXAMPLE.", version: 1 };

    #[test]
    fn results_are_read_as_written_and_forged_ones_are_refused() {
        let found = |seen: &[u32], open: &[u32]| CellSandwich {
            seen: seen.to_vec(),
            open: open.into(),
            swept: 1,
            proven: 2,
            steps: 3,
        };
        let read = |found: &CellSandwich, limit: usize| {
            let mut to = Writer::new(EXAMPLE, 0, 0);
            found.save(&mut to);
            let bytes = to.finish();
            CellSandwich::load(&mut Reader::new(&bytes, EXAMPLE).unwrap(), limit).ok()
        };
        let all = found(&[1, 4], &[0, 2, 7]);
        assert_eq!(read(&all, 8).as_ref(), Some(&all), "the result as written");
        assert_eq!(read(&all, 7), None, "an index that is not below the limit");
        for (seen, open, what) in [
            (&[4, 1][..], &[][..], "out of order"),
            (&[1, 1][..], &[][..], "seen twice"),
            (&[][..], &[3, 3][..], "open twice"),
            (&[1, 3][..], &[0, 3][..], "seen and open"),
        ] {
            assert_eq!(read(&found(seen, open), 8), None, "{what}");
        }
        assert_eq!(all.reported().as_ref(), [0, 1, 2, 4, 7], "seen and open objects");
    }
}
