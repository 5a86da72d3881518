//! Intermediate results of a viewcell while a bake runs, and their form in a saved bake.

use crate::bake_cache::{CellRecord, GroupRecord};
use crate::cell_sandwich::CellSandwich;
use crate::method_times::MethodTimes;
use crate::time_plan::{GROUP, STAGES, SWEEP};
use std::sync::Arc;
use visibility_core::binary_format::{FormatError, Reader, Writer};

/// Results of one viewcell so far.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FoundCell {
    pub(crate) sandwich: CellSandwich,
    pub(crate) times: MethodTimes,
    pub(crate) group: Arc<GroupRecord>,
    pub(crate) record: CellRecord,
    /// Sum of the costs, in triangles, of the objects that are open in the viewcell.
    pub(crate) cost: u64,
    pub(crate) is_reused: bool,
    /// Whether the sweep of the viewcell was skipped or ended early.
    pub(crate) is_skipped: bool,
    /// Whether the time was too short for a search of the viewcell: the search ended early, or sweeps from
    /// parts of the viewcell were done instead.
    pub(crate) is_cut: bool,
    /// Next stage of the viewcell, or the number of stages if the viewcell is done.
    pub(crate) next: u32,
}

impl FoundCell {
    /// Returns whether all stages of the viewcell are done.
    pub(crate) fn is_done(&self) -> bool {
        self.next as usize == STAGES
    }

    /// Returns whether a stage of the viewcell is done or was not needed. False for a sweep that was skipped
    /// or ended early because its time was over.
    pub(crate) fn has_passed(&self, stage: u32) -> bool {
        let is_left_out = match stage {
            GROUP => self.group.is_cut,
            SWEEP => self.is_skipped,
            _ => false,
        };
        self.next > stage && !is_left_out
    }

    /// Returns whether no sweep or search was skipped or ended early. The result then equals that of a bake
    /// without a limit of time.
    pub(crate) fn is_whole(&self) -> bool {
        !(self.group.is_cut || self.is_skipped || self.is_cut)
    }

    /// Writes all fields except the group.
    pub(crate) fn save(&self, to: &mut Writer) {
        self.sandwich.save(to);
        self.times.save(to);
        self.record.save(to);
        to.u64(self.cost);
        to.u32s([self.is_reused, self.is_skipped, self.is_cut].map(u32::from));
        to.u32(self.next);
    }

    /// Reads the fields that [`save`](Self::save) has written for a viewcell of a group. `limit` is the
    /// greatest index of an object plus 1, and `left` the number of objects that the sweep of the group has
    /// left.
    pub(crate) fn load(
        from: &mut Reader<'_>,
        group: Arc<GroupRecord>,
        limit: usize,
        left: usize,
    ) -> Result<Self, FormatError> {
        let (sandwich, times) = (CellSandwich::load(from, limit)?, MethodTimes::load(from)?);
        let (record, cost) = (CellRecord::load(from)?, from.u64()?);
        let mut flag = || from.u32().map(|flag| flag != 0);
        let (is_reused, is_skipped, is_cut) = (flag()?, flag()?, flag()?);
        let next = from.u32()?;
        if next as usize > STAGES || record.left.last().is_some_and(|&last| last as usize >= left) {
            return Err(from.content_error("the results of a viewcell are not of its group"));
        }
        Ok(Self { sandwich, times, group, record, cost, is_reused, is_skipped, is_cut, next })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::binary_format::Format;

    const EXAMPLE: Format = Format { magic: *b"EXAMPLE.", version: 1 };

    fn found(next: u32, left: &[u32]) -> FoundCell {
        FoundCell {
            sandwich: CellSandwich::default(),
            times: MethodTimes::default(),
            group: Arc::default(),
            record: CellRecord { left: left.to_vec(), answers: vec![0; left.len()], ..CellRecord::default() },
            cost: 5,
            is_reused: false,
            is_skipped: false,
            is_cut: false,
            next,
        }
    }

    #[test]
    fn a_stage_is_passed_unless_it_was_left_out() {
        let swept = found(SWEEP + 1, &[]);
        assert_eq!([0, 1, 2].map(|stage| swept.has_passed(stage)), [true, true, false], "two stages done");
        assert!(!swept.is_done() && found(STAGES as u32, &[]).is_done(), "all stages done");
        assert!(swept.is_whole(), "nothing was left out");
        let skipped = FoundCell { is_skipped: true, ..swept.clone() };
        assert!(skipped.has_passed(GROUP) && !skipped.has_passed(SWEEP), "the sweep was left out");
        let group = Arc::new(GroupRecord { is_cut: true, ..GroupRecord::default() });
        let cut = FoundCell { group, ..swept.clone() };
        assert!(!cut.has_passed(GROUP) && cut.has_passed(SWEEP), "the sweep of the group was left out");
        let searched = FoundCell { is_cut: true, ..swept };
        for (number, found) in [skipped, cut, searched].iter().enumerate() {
            assert!(!found.is_whole(), "something was left out of result {number}");
        }
    }

    #[test]
    fn results_are_read_as_written_and_forged_ones_are_refused() {
        let read = |found: &FoundCell, left: usize| {
            let mut to = Writer::new(EXAMPLE, 0, 0);
            found.save(&mut to);
            let bytes = to.finish();
            FoundCell::load(&mut Reader::new(&bytes, EXAMPLE).unwrap(), Arc::default(), 9, left).ok()
        };
        let done = found(STAGES as u32, &[1, 4]);
        assert_eq!(read(&done, 5).as_ref(), Some(&done), "the result as written");
        assert_eq!(read(&done, 4), None, "an object that the group has not left");
        assert_eq!(read(&found(STAGES as u32 + 1, &[]), 5), None, "an unknown stage");
    }
}
