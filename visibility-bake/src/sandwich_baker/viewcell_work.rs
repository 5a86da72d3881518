//! The work on one viewcell, stage by stage: its sweep, rays and proofs.

use super::SandwichBaker;
use super::group::{BakeScratch, Content};
use crate::bake_cache::{CellRecord, HIDDEN, OPEN, SEEN};
use crate::cell_sandwich::CellSandwich;
use crate::fingerprints::with_viewcell;
use crate::found_cell::FoundCell;
use crate::level_error::LevelError;
use crate::method_times::MethodTimes;
use crate::near_to_far::{ids_of, swept};
use crate::search::{Method, Search};
use crate::tiled_scene::PreparedScene;
use crate::time_plan::{BOXES, LOOK, STAGES, SWEEP};
use std::time::Duration;
use visibility_core::VisibleSet;
use visibility_exact::SceneTriangles;

/// Approximate number of triangles that a search copies and sorts in a second, on a machine of 2026.
const SEARCHED_A_SECOND: f64 = 2e5;

/// Record and times of a viewcell after a stage, and the viewcell's next stage.
type Found = (CellRecord, MethodTimes, u32);

impl SandwichBaker<'_> {
    /// Works on an item, as [`work`](Baker::work) does, with the memory that is free now. The item's stage
    /// must be the next stage of its viewcell. `Err` if there is not enough memory now.
    pub(super) fn attempt(
        &self,
        item: u32,
        scratch: &mut BakeScratch,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<Option<FoundCell>>, LevelError> {
        let begun = self.time.now();
        let mut last = begun;
        let mut lap = || {
            let now = self.time.now();
            now.saturating_sub(std::mem::replace(&mut last, now))
        };
        let (place, stage) = self.place_and_stage(item);
        let before = self.done[place].as_ref();
        // Once the time of this stage is over, an unswept viewcell continues without its sweep. Any other
        // item is left undone, unless no other work remains.
        if self.time.is_past(stage, begun) {
            if let Some(before) = before
                && stage == SWEEP
            {
                return Ok(Some(Some(FoundCell { next: LOOK, is_skipped: true, ..before.clone() })));
            }
            if self.time.end(stage) {
                return Ok(None);
            }
        }
        let number = self.range.start + place;
        let of = self.groups.of[number];
        let group = self.group(of, stage, scratch)?;
        if stop() {
            return Ok(None);
        }
        let objects = &group.objects;
        let done = STAGES as u32;
        let mut is_skipped = before.is_some_and(|before| before.is_skipped);
        let mut is_cut = before.is_some_and(|before| before.is_cut);
        let (record, times, next) = match (&group.content, before) {
            // An earlier bake has results for this group with the same content.
            (Content::Cached(records), _) => {
                let member = self.groups.cells[of as usize].binary_search(&(number as u32));
                (records[member.unwrap_or_default()].clone(), MethodTimes::default(), done)
            }
            // The group's objects fit into one scene, in which the viewcell is swept.
            (Content::Scene(scene), before) => {
                let _memory = self.level.reserve_cell(objects, false)?;
                let (record, is_known, cut) = self.sweep(number, objects, scene, scratch);
                is_skipped |= cut;
                let group = before.map_or(Duration::ZERO, |before| before.times.sweep);
                let times = MethodTimes { sweep: group + lap(), ..MethodTimes::default() };
                (record, times, if is_known { done } else { LOOK })
            }
            // The viewcell has no sweep of its own yet, so all objects that the group's sweep left stay open.
            (Content::Objects, None) => {
                let left: Vec<u32> = (0..objects.len() as u32).collect();
                let hash = self.content_hash(objects.iter().copied());
                let key = with_viewcell(hash, &self.viewcells.cells()[number]).value();
                let record = CellRecord { key, answers: vec![OPEN; left.len()], left, steps: 0 };
                (record, MethodTimes { sweep: lap(), ..MethodTimes::default() }, SWEEP)
            }
            (Content::Objects, Some(before)) if self.is_too_large(&before.record, objects) => {
                return Ok(Some(None));
            }
            // The condition is needed since saved bytes may be forged.
            (Content::Objects, Some(before)) if before.record.is_of(objects) => {
                // A search must first sort its triangles. If its share of the time is too short for that,
                // parts of the viewcell are swept instead.
                let share = self.time.share_of_search(self.waiting[stage as usize]);
                let seconds = self.triangles_left(&before.record, objects) as f64 / SEARCHED_A_SECOND;
                let found = if share.is_some_and(|share| share.as_secs_f64() < seconds) {
                    is_cut = true;
                    self.sweep_in_parts(number, objects, before, &mut lap, stop)?
                } else {
                    self.search(number, objects, before, share, &mut lap, stop)?.map(|(found, cut)| {
                        is_cut |= cut;
                        found
                    })
                };
                match found {
                    Some(found) => found,
                    None => return Ok(None),
                }
            }
            (Content::Objects, _) => return Ok(Some(None)),
        };
        let open = record.left.iter().zip(&record.answers).filter(|&(_, &answer)| answer == OPEN);
        let cost = |(&at, _)| u64::from(self.level.objects[objects[at as usize] as usize].cost);
        Ok(Some(Some(FoundCell {
            sandwich: self.sandwich(&record, objects),
            times,
            group: group.record.clone(),
            cost: open.map(cost).sum(),
            record,
            is_reused: stage <= SWEEP && next == done,
            is_skipped,
            is_cut,
            next,
        })))
    }

    /// Sweeps the scene of a group from a viewcell. Returns the record of the viewcell, and two flags. The
    /// first is true if the answers of the record are from the cache; otherwise the answer for each object
    /// left is [`OPEN`]. The second is true if the time of the sweep was over when it ended, so that more
    /// objects may be left than after a full sweep.
    fn sweep(
        &self,
        viewcell: usize,
        objects: &[u32],
        PreparedScene { scene, sweep: prepared, .. }: &PreparedScene,
        scratch: &mut BakeScratch,
    ) -> (CellRecord, bool, bool) {
        let (cell, number) = (&self.viewcells.cells()[viewcell], self.groups.of[viewcell]);
        if scratch.local.as_ref().is_none_or(|&(of, _)| of != number) {
            scratch.local = Some((number, prepared.clone()));
        }
        let (_, sweep) = scratch.local.get_or_insert_with(|| (number, prepared.clone()));
        let end = self.end_of_sweep(SWEEP, 1);
        let is_over = || self.time.is_over(end);
        // Objects in the scene of a group have the indices of the group's list.
        let left: Vec<u32> = swept(sweep, scene, cell, &is_over).iter().map(|id| id.index() as u32).collect();
        let key = with_viewcell(self.content_hash(left.iter().map(|&at| objects[at as usize])), cell).value();
        match self.cache.cell(key).filter(|known| known.answers.len() == left.len()) {
            Some(known) => (CellRecord { left, ..known.clone() }, true, is_over()),
            None => (CellRecord { key, answers: vec![OPEN; left.len()], left, steps: 0 }, false, is_over()),
        }
    }

    /// Returns whether the objects that the sweep of a viewcell has left have more triangles than a search
    /// may copy. `objects` are those left after the sweep of the group. Positions in the record beyond this
    /// list are ignored.
    pub(super) fn is_too_large(&self, record: &CellRecord, objects: &[u32]) -> bool {
        self.triangles_left(record, objects) > self.level.most_copied
    }

    /// Returns the number of triangles of the objects that the sweep of a viewcell has left.
    fn triangles_left(&self, record: &CellRecord, objects: &[u32]) -> u64 {
        let left = record.left.iter().filter_map(|&at| objects.get(at as usize));
        left.map(|&at| u64::from(self.level.objects[at as usize].triangles)).sum()
    }

    /// Sweeps again from smaller parts of a viewcell, where there is no time for a search. Tests the objects
    /// that the viewcell's own sweep has left. Each stage divides the viewcell into more parts than the stage
    /// before. Returns the objects left and the next stage. `None` once `stop` has returned true.
    fn sweep_in_parts(
        &self,
        viewcell: usize,
        objects: &[u32],
        before: &FoundCell,
        lap: &mut impl FnMut() -> Duration,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<Found>, LevelError> {
        let mut record = before.record.clone();
        let numbers: Vec<u32> = record.left.iter().map(|&at| objects[at as usize]).collect();
        let PreparedScene { scene, mut sweep, .. } = self.level.prepared(&numbers)?;
        let mut visible = VisibleSet::new();
        sweep.cull_in_parts(&scene, &self.viewcells.cells()[viewcell], before.next, &mut visible, stop);
        if stop() {
            return Ok(None);
        }
        // Objects in the scene have their positions in `record.left` as indices.
        let left = ids_of(&visible, &scene).into_iter().map(|id| id.index());
        (record.left, record.answers) =
            left.map(|at| (before.record.left[at], before.record.answers[at])).unzip();
        let mut times = before.times;
        times.sweep += lap();
        Ok(Some((record, times, before.next + 1)))
    }

    /// Searches for answers for the objects left after the sweep of a viewcell, within `share` if the time is
    /// limited. Returns them with the next stage, and a flag that is true if the share was used up before the
    /// search was complete. `None` once `stop` has returned true.
    fn search(
        &self,
        viewcell: usize,
        objects: &[u32],
        before: &FoundCell,
        share: Option<Duration>,
        lap: &mut impl FnMut() -> Duration,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<(Found, bool)>, LevelError> {
        let record = &before.record;
        let end = share.map(|share| self.time.now() + share);
        let is_over = || stop() || self.time.is_over(end);
        let left: Vec<u32> = record.left.iter().map(|&at| objects[at as usize]).collect();
        // Only the triangles of objects that the sweep has left are read, since all relevant occluders are
        // among these.
        let _memory = self.level.reserve_cell(&left, true)?;
        let scene = self.level.scene_with_triangles(&left)?;
        let triangles = SceneTriangles::new(&scene);
        let cell = &self.viewcells.cells()[viewcell];
        let answers = record.answers.clone();
        let mut search = Search::new(&scene, cell, &triangles, &self.settings, answers, &is_over);
        let mut times = before.times;
        match before.next {
            LOOK => {
                search.aim_rays();
                times.rays += lap();
            }
            BOXES => search.prove(Method::Boxes),
            _ => {
                search.prove(Method::QuickTriangles);
                search.prove(Method::Triangles);
            }
        }
        times.proofs += lap();
        // A search that ends because of the time keeps its results. A search that `stop` ends is repeated
        // later.
        let is_cut = search.is_stopped();
        if is_cut && !self.time.is_over(end) {
            return Ok(None);
        }
        let next = if search.is_met() { STAGES as u32 } else { before.next + 1 };
        let steps = record.steps.saturating_add(search.steps());
        let (key, left) = (record.key, record.left.clone());
        Ok(Some(((CellRecord { key, left, answers: search.answers, steps }, times, next), is_cut)))
    }

    /// Returns the result for a viewcell from its `record`: the indices of the seen and of the open objects,
    /// and the numbers of objects swept and proven hidden. `objects` are those left after the sweep of the
    /// group.
    fn sandwich(&self, record: &CellRecord, objects: &[u32]) -> CellSandwich {
        let index = |at: u32| self.level.objects[objects[at as usize] as usize].index;
        let with = |wanted: u8| -> Vec<u32> {
            let chosen = record.left.iter().zip(&record.answers).filter(|&(_, &answer)| answer == wanted);
            let mut chosen: Vec<u32> = chosen.map(|(&at, _)| index(at)).collect();
            chosen.sort_unstable();
            chosen
        };
        CellSandwich {
            seen: with(SEEN),
            open: with(OPEN).into(),
            swept: (self.level.objects.len() - record.left.len()) as u32,
            proven: record.answers.iter().filter(|&&answer| answer == HIDDEN).count() as u32,
            steps: record.steps,
        }
    }
}
