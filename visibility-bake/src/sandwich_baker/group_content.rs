//! The content of groups. It is made by a sweep of the group or taken from the cache, shared while a stage
//! needs it, and then released.

use super::SandwichBaker;
use super::group::{BakeScratch, Content, Group};
use crate::bake_cache::{CellRecord, GroupRecord};
use crate::fingerprints::{METHODS, with_settings, with_viewcell};
use crate::level_error::LevelError;
use crate::near_to_far::{Trace, sweep_near_to_far};
use crate::scratch_file::lock;
use crate::time_plan::{GROUP, SWEEP};
use std::ops::Range;
use std::sync::Arc;
use visibility_core::binary_format::Fingerprint;
use visibility_region::ExtendedProjectionCuller;

impl SandwichBaker<'_> {
    /// Records that a viewcell of a group is done with `stages`. After the last viewcell of a stage, releases
    /// the content that the stage has used.
    pub(super) fn end_stages(&self, group: u32, stages: Range<u32>) {
        let mut slot = self.level.lock(&self.slots[group as usize]);
        for stage in stages.clone() {
            slot.left[stage as usize] = slot.left[stage as usize].saturating_sub(1);
        }
        if slot.left[stages.start as usize] == 0 {
            (slot.group, slot.record) = (None, None);
        }
    }

    /// Releases the content of all groups that no thread is using, if there is a limit of memory. A thread
    /// that returns to such a group loads its content again.
    pub(super) fn release_groups(&self) {
        if !self.level.is_in_file() {
            return;
        }
        lock(&self.held).retain(|&number| {
            let Ok(mut slot) = self.slots[number as usize].try_lock() else { return true };
            slot.group.take_if(|(_, group)| Arc::strong_count(group) == 1);
            slot.group.is_some()
        });
    }

    /// Returns a hash of the settings, the origin, and the objects with the given numbers, in their order.
    pub(super) fn content_hash(&self, objects: impl IntoIterator<Item = u32>) -> Fingerprint {
        let hash = with_settings(Fingerprint::new().with(METHODS), &self.settings);
        let origin = self.level.origin.to_array();
        let hash = origin.iter().fold(hash, |hash, x| hash.with_u64(x.to_bits()));
        objects.into_iter().fold(hash, |hash, at| hash.with_u64(self.level.objects[at as usize].hash))
    }

    /// Returns the data that the viewcells of a group share, from the group's slot. If the slot is empty,
    /// computes the data, while other threads that need it wait.
    pub(super) fn group(
        &self,
        number: u32,
        stage: u32,
        scratch: &mut BakeScratch,
    ) -> Result<Arc<Group>, LevelError> {
        let mut slot = self.level.lock(&self.slots[number as usize]);
        let for_sweeps = stage == SWEEP;
        if let Some((_, group)) = slot.group.as_ref().filter(|made| made.0 == for_sweeps) {
            return Ok(group.clone());
        }
        slot.group = None;
        self.release_groups();
        scratch.local = None;
        let group = Arc::new(self.new_group(number, stage, &mut slot.record, scratch)?);
        slot.group = Some((for_sweeps, group.clone()));
        if self.level.is_in_file() {
            lock(&self.held).insert(number);
        }
        Ok(group)
    }

    /// Computes the data that the viewcells of a group share. `known` is the result of the group's sweep. If
    /// it is `None`, the group is swept, and the result is stored there.
    fn new_group(
        &self,
        number: u32,
        stage: u32,
        known: &mut Option<Arc<GroupRecord>>,
        scratch: &mut BakeScratch,
    ) -> Result<Group, LevelError> {
        if let Some(record) = &self.found_groups[number as usize]
            && stage != GROUP
        {
            let objects = record.trace.replay(&self.level.tree).unwrap_or_default();
            let content = match stage {
                SWEEP if self.level.may_be_copied() && objects == self.level.tree.order => {
                    Content::Scene(self.level.whole()?)
                }
                SWEEP => Content::Scene(Arc::new(self.level.prepared(&objects)?)),
                _ => Content::Objects,
            };
            return Ok(Group { record: record.clone(), objects, content });
        }
        let members = &self.groups.cells[number as usize];
        let all = self.viewcells.cells();
        let with_members =
            |hash| members.iter().fold(hash, |hash, &cell| with_viewcell(hash, &all[cell as usize])).value();
        let is_usable = |records: &[CellRecord], objects: &[u32]| {
            records.len() == members.len() && records.iter().all(|record| record.is_of(objects))
        };
        if known.is_none() {
            // In a resumed bake, some of the viewcells may be done already.
            known.clone_from(&self.found_groups[number as usize]);
        }
        let whole = with_members(self.content_hash([]));
        // With a limit of time groups are not divided, so their results may differ and need a key of their
        // own.
        let question =
            if self.time.is_limited() { with_members(self.content_hash([]).with(1)) } else { whole };
        let answer = self.cache.answer(whole).or_else(|| self.cache.answer(question));
        // Cached results refer to objects by position in the list that a trace leaves. This must be the trace
        // of the viewcells that are done already.
        if let Some((record, cells)) = answer
            && known.as_ref().is_none_or(|known| known.trace == record.trace)
            && let Some(objects) = record.trace.replay(&self.level.tree)
            && is_usable(cells, &objects)
        {
            let content = Content::Cached(cells.to_vec());
            return Ok(Group { record: record.clone(), objects, content });
        }
        let record = match known {
            Some(record) => record.clone(),
            None => {
                let (trace, is_cut) = if self.time.leaves_groups_out() && self.level.may_be_copied() {
                    (Trace::of_all(&self.level.tree), true)
                } else {
                    let (sweep, whole) = (&mut scratch.sweep, &mut scratch.whole);
                    let end = self.end_of_sweep(GROUP, members.len());
                    let is_over = || self.time.is_over(end);
                    let stop = end.is_some().then_some(&is_over as &dyn Fn() -> bool);
                    let trace = sweep_near_to_far(&self.level, all, members, sweep, whole, stop)?;
                    // The surfaces of the last sweep are not needed any more.
                    scratch.sweep = ExtendedProjectionCuller::new();
                    (trace, is_over())
                };
                let objects = trace.replay(&self.level.tree).unwrap_or_default();
                if !is_cut {
                    let asked = self.level.objects.len();
                    self.time.note_group(asked, asked - objects.len());
                }
                let key = with_members(self.content_hash(objects));
                known.insert(Arc::new(GroupRecord { question, key, trace, is_cut })).clone()
            }
        };
        // The trace was recorded in this bake, with the same tree, so it can be replayed.
        let objects = record.trace.replay(&self.level.tree).unwrap_or_default();
        let content = match self.cache.group(record.key).filter(|records| is_usable(records, &objects)) {
            Some(records) => Content::Cached(records.to_vec()),
            None => Content::Objects,
        };
        Ok(Group { record, objects, content })
    }
}
