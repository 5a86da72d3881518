//! The bake of sandwiches, which are lower and upper bounds on the visible set of each viewcell. Methods are
//! applied from cheap to exact, each to the objects that the methods before have left undecided.
//!
//! The objects that a sweep has *left* are those that it did not find hidden. An object is *open* in a
//! viewcell if it is left there, and neither seen by a ray nor proven hidden. Its *cost* is
//! [`Object::cost`](visibility_core::Object::cost), in triangles.

mod group;
mod group_content;
mod viewcell_work;

pub use group::BakeScratch;

use crate::bake_cache::{BakeCache, GroupRecord};
use crate::cell_groups::CellGroups;
use crate::cell_sandwich::CellSandwich;
use crate::fingerprints::{BakeSource, level_fingerprint};
use crate::found_cell::FoundCell;
use crate::level_error::LevelError;
use crate::method_times::MethodTimes;
use crate::sandwich_outcome::SandwichOutcome;
use crate::scratch_file::lock;
use crate::settings::SandwichSettings;
use crate::spans;
use crate::tiled_scene::TiledScene;
use crate::time_plan::{BOXES, GROUP, LOOK, STAGES, SWEEP, TimePlan};
use group::Slot;
use std::collections::BTreeSet;
use std::fmt;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use visibility_core::Scene;
use visibility_core::bake::Baker;
use visibility_core::binary_format::{Fingerprint, FormatError, Reader, Writer};
use visibility_core::pvs::Viewcells;

/// Computes the sandwiches (lower and upper bounds on the visible set) of a range of viewcells, as a
/// [`Baker`] for a [`Bake`](visibility_core::bake::Bake): with progress, stopping and resuming, on any number
/// of threads. Without a limit of time, the result does not depend on threads or stops.
///
/// The sweep of extended projections removes objects that many occluders hide together, first for a group of
/// neighbouring viewcells, then, among the objects left, for each single viewcell. After all viewcells are
/// swept, rays find objects that are seen. Then proofs are tried for the boxes of the open objects, the most
/// costly first, until the [gap](SandwichSettings::with_gap) is met. Where boxes do not suffice for that,
/// proofs are tried for the triangles of the objects. Each viewcell therefore has five items of work: sweep
/// of its group, own sweep, rays, proofs for boxes, proofs for triangles. The stages after the sweeps process
/// the viewcells in portions, each about as large as all portions before it. In a portion, the groups with
/// the most costly open objects come first.
///
/// Occluders are the objects that are flagged as such, are [always drawn](Scene::is_always_drawn) and can be
/// culled, on whichever layers they are. The sweeps use their meshes, the proofs their triangles. Objects
/// that are [never culled](visibility_core::Object::never_cull), such as moving ones, count as seen, and hide
/// nothing. Each method uses only the objects that the sweep before it has left, so that a distant edit
/// changes nothing ([`with_cache`](Self::with_cache)).
///
/// ```
/// use visibility_bake::{SandwichBaker, SandwichSettings};
/// use visibility_core::{bake::Bake, glam::{DVec3, Vec3}, pvs::{Viewcell, Viewcells}, Aabb, Object, Scene};
/// // A wall, and a plate behind it.
/// let square = |x: f32, r: f32| {
///     let [a, b, c, d] = [(-r, -r), (r, -r), (r, r), (-r, r)].map(|(y, z)| Vec3::new(x, y, z));
///     [[a, b, c], [a, c, d]]
/// };
/// let mut scene = Scene::new();
/// for triangles in [square(5.0, 10.0), square(9.0, 1.0)] {
///     let bounds = Aabb::from_points(triangles.as_flattened().iter().copied());
///     let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
///     scene.set_triangles(id, triangles)?;
/// }
/// let cells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
/// let outcome = Bake::new(SandwichBaker::new(&scene, &cells, SandwichSettings::default())).run();
/// assert_eq!(outcome.cells[0].seen, [0]);
/// assert!(outcome.cells[0].open.is_empty() && outcome.complete);
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
pub struct SandwichBaker<'a> {
    level: Arc<TiledScene<'a>>,
    viewcells: &'a Viewcells,
    settings: SandwichSettings,
    range: Range<usize>,
    /// Hash of the scene, all viewcells and the settings. It is the same for all shards of a bake.
    fingerprint: u64,
    source: BakeSource,
    groups: CellGroups,
    /// State of each group while some of its viewcells are worked on.
    slots: Vec<Mutex<Slot>>,
    /// Groups that may have content in their slot.
    held: Mutex<BTreeSet<u32>>,
    cache: Arc<BakeCache>,
    time: TimePlan,
    /// Results so far of each viewcell of `range`. `None` for a viewcell without a completed stage.
    done: Vec<Option<FoundCell>>,
    /// For each stage, the number of viewcells of `range` that have not completed it. In a round, the number
    /// at its beginning, since the results of a round are stored at its end.
    waiting: [usize; STAGES],
    /// For each group and stage, the sum of the costs of open objects in those of the group's viewcells that
    /// are at that stage.
    costs: Vec<[u64; STAGES]>,
    /// Result of the sweep of each group, by the group's number. `None` as long as no viewcell of the group
    /// in `range` has a result.
    found_groups: Vec<Option<Arc<GroupRecord>>>,
    /// First reason why a viewcell could not be worked on. `None` if there was no error.
    error: Mutex<Option<LevelError>>,
}

impl fmt::Debug for SandwichBaker<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SandwichBaker").field("settings", &self.settings).finish_non_exhaustive()
    }
}

impl<'a> SandwichBaker<'a> {
    /// Prepares a bake of all objects of a scene, from all viewcells.
    pub fn new(scene: &'a Scene, viewcells: &'a Viewcells, settings: SandwichSettings) -> Self {
        Self::of_level(Arc::new(TiledScene::new(scene)), viewcells, settings)
    }

    /// Prepares a bake of all objects of a level from all viewcells.
    pub fn of_level(
        level: Arc<TiledScene<'a>>,
        viewcells: &'a Viewcells,
        settings: SandwichSettings,
    ) -> Self {
        let groups = CellGroups::new(viewcells);
        let baker = Self {
            viewcells,
            settings,
            range: 0..0,
            fingerprint: level_fingerprint(&level, viewcells, &settings),
            source: BakeSource::new(level.version(), viewcells),
            level,
            slots: groups.cells.iter().map(|_| Mutex::default()).collect(),
            held: Mutex::default(),
            groups,
            cache: Arc::default(),
            time: TimePlan::new(),
            done: Vec::new(),
            waiting: [0; STAGES],
            costs: Vec::new(),
            found_groups: Vec::new(),
            error: Mutex::default(),
        };
        baker.with_range(0..viewcells.cells().len())
    }

    /// Restricts the baker to the viewcells with numbers in `range`. Numbers beyond the last viewcell are
    /// ignored.
    #[must_use]
    pub fn with_range(mut self, range: Range<usize>) -> Self {
        let count = self.viewcells.cells().len();
        let start = range.start.min(count);
        self.range = start..range.end.clamp(start, count);
        self.done = vec![None; self.range.len()];
        self.found_groups = vec![None; self.slots.len()];
        self.count();
        self
    }

    /// Sets the clock with which the baker measures the times of the methods. `clock` returns the time since
    /// a fixed moment.
    #[must_use]
    pub fn with_clock(mut self, clock: fn() -> Duration) -> Self {
        self.time.set_clock(clock);
        self
    }

    /// Prepares for a bake that the caller ends after `time`, as measured by the [clock](Self::with_clock),
    /// which must be set. A limit of more than 2^32 seconds counts as 2^32 seconds. The bake finds hidden
    /// objects first, for as many viewcells as possible:
    ///
    /// - Groups are swept undivided, for at most seven tenths of the time. Groups that are not swept by then
    ///   wait until all other work is done. If the sweeps of the first groups find less than an eighth of the
    ///   objects hidden, the sweeps of the other groups are skipped, and their time is used for sweeps of
    ///   single viewcells.
    /// - Viewcells are swept until 85 hundredths of the time have passed ([`SWEEP_TIME`](crate::SWEEP_TIME)).
    ///   Viewcells that are not swept by then continue with all objects that their group's sweep has left. A
    ///   sweep that takes more than a quarter of the time left for its stage, and more than its equal share,
    ///   ends early and keeps what it has found.
    /// - Each search, by rays and then by proofs, has an equal share of the time left, and at least half a
    ///   second. If it could not even begin in that time, since a sweep has left too many triangles, the
    ///   viewcell is swept in parts instead.
    ///
    /// Sweeps and searches that were skipped or ended early are not repeated when the bake is resumed.
    #[must_use]
    pub fn with_time(mut self, time: Duration) -> Self {
        self.time.limit(time);
        self
    }

    /// Lets the bake reuse results of an earlier bake, of the scene before an edit. Without a limit of time,
    /// the outcome is the same as without the cache, to the last byte, except for times. See [`BakeCache`]
    /// for the cost of an edit.
    #[must_use]
    pub fn with_cache(mut self, cache: impl Into<Arc<BakeCache>>) -> Self {
        self.cache = cache.into();
        self
    }

    /// Returns the sandwiches found so far, in the order of the viewcells in the range. `None` for a viewcell
    /// without a completed stage.
    pub fn cells(&self) -> impl Iterator<Item = Option<&CellSandwich>> {
        self.done.iter().map(|done| done.as_ref().map(|found| &found.sandwich))
    }

    /// Returns a hash of the level, the settings and all viewcells, independent of the range of this baker.
    /// Shards with the same hash belong to the same bake.
    pub fn whole_fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// Returns the level and the viewcells that are baked, for [`BakedSet::new`](crate::BakedSet::new).
    pub fn source(&self) -> BakeSource {
        self.source
    }

    /// Returns the number of viewcells of the whole bake, whatever the range of this baker.
    pub(crate) fn whole_count(&self) -> usize {
        self.viewcells.cells().len()
    }

    /// Returns the first reason why a viewcell of a level in a file could not be worked on, or `None` if
    /// there was no error. Objects that were not proven hidden from the viewcell before the error count as
    /// visible. A resumed bake does not work on a viewcell again after an error.
    pub fn error(&self) -> Option<LevelError> {
        lock(&self.error).clone()
    }

    /// Sets, for each group and stage, the number of viewcells that are not done with the stage, and the
    /// costs of those whose next stage it is; and the numbers of viewcells of all groups.
    fn count(&mut self) {
        self.slots.iter_mut().for_each(|slot| *slot = Mutex::default());
        self.waiting = [0; STAGES];
        self.costs = vec![[0; STAGES]; self.slots.len()];
        for (cell, done) in self.range.clone().zip(&self.done) {
            let of = self.groups.of[cell] as usize;
            let slot = self.slots[of].get_mut().unwrap_or_else(PoisonError::into_inner);
            let next = done.as_ref().map_or(GROUP, |found| found.next) as usize;
            slot.left.iter_mut().skip(next).for_each(|left| *left += 1);
            self.waiting.iter_mut().skip(next).for_each(|waiting| *waiting += 1);
            if let Some(found) = done {
                add_cost(&mut self.costs[of], found);
            }
        }
    }

    /// Returns the position in `range` of an item's viewcell, from 0, and the item's stage.
    fn place_and_stage(&self, item: u32) -> (usize, u32) {
        let (item, count) = (item as usize, self.range.len().max(1));
        (item % count, (item / count) as u32)
    }

    /// Returns the time on the baker's clock by which a sweep that begins now must end. `stage` is [`GROUP`]
    /// or [`SWEEP`], and `viewcells` the number of viewcells that the sweep is for. `None` without a limit of
    /// time: the sweep may run to its end.
    fn end_of_sweep(&self, stage: u32, viewcells: usize) -> Option<Duration> {
        self.time.end_of_sweep(stage, viewcells, self.waiting[stage as usize])
    }
}

/// Adds the cost of a viewcell's open objects to its group's sum for the viewcell's next stage.
fn add_cost(costs: &mut [u64; STAGES], found: &FoundCell) {
    if let Some(cost) = costs.get_mut(found.next as usize) {
        *cost = cost.saturating_add(found.cost);
    }
}

impl Baker for SandwichBaker<'_> {
    type Scratch = BakeScratch;
    /// Result of an item: the viewcell's new state. `None` if the viewcell needs no more work, or if its
    /// objects could not be loaded.
    type Found = Option<FoundCell>;
    type Outcome = SandwichOutcome;

    // Threads wait for one another at the end of a round, so short rounds leave many threads idle.
    const ROUND: usize = 64;
    const KIND: u32 = 33;

    fn item_count(&self) -> usize {
        STAGES * self.range.len()
    }

    fn rank(&self, item: u32) -> u64 {
        let (place, stage) = self.place_and_stage(item);
        let of = self.groups.of[self.range.start + place];
        if stage <= SWEEP {
            // Items are sorted by group, so that the viewcells of a group stay together.
            return u64::from(of);
        }
        let costs = self.costs[of as usize][stage as usize] / self.groups.cells[of as usize].len() as u64;
        u64::from(self.groups.portion(of)) << 56 | (u64::MAX >> 8).saturating_sub(costs)
    }

    fn stage(&self, item: u32) -> u32 {
        let (place, stage) = self.place_and_stage(item);
        let next = self.done[place].as_ref().map_or(GROUP, |found| found.next) as usize;
        // No item is worked on while the next round is chosen, as `is_put_off` requires.
        if self.time.is_put_off(next) {
            stage + STAGES as u32
        } else if self.time.is_limited() && (stage, next) == (BOXES, BOXES as usize) {
            // Rays hide nothing. With a limit of time, boxes are therefore proven for some viewcells before
            // others have rays.
            SWEEP
        } else {
            stage
        }
    }

    // Costs are added to a stage only by the stages before it, and only a limit of time puts items off.
    fn is_order_fixed(&self) -> bool {
        !self.time.is_limited()
    }

    fn work(
        &self,
        item: u32,
        scratch: &mut BakeScratch,
        stop: &dyn Fn() -> bool,
    ) -> Option<Option<FoundCell>> {
        let (place, stage) = self.place_and_stage(item);
        if self.done[place].as_ref().map_or(GROUP, |before| before.next) != stage {
            return Some(None);
        }
        let of = self.groups.of[self.range.start + place];
        let _begun = self.time.begin();
        let mut attempt = |is_alone| {
            // `_working` must be dropped last, after groups are released: a thread that works alone relies on
            // this.
            let _working = self.level.work(is_alone);
            if is_alone {
                *scratch = BakeScratch::default();
                self.release_groups();
            }
            let number = self.range.start + place;
            let found = spans::stage(number, stage, || self.attempt(item, scratch, stop));
            match &found {
                Ok(Some(Some(found))) => self.end_stages(of, stage..found.next),
                Err(LevelError::Memory { .. }) if !is_alone => {}
                Ok(None) => {}
                Ok(Some(None)) | Err(_) => self.end_stages(of, stage..STAGES as u32),
            }
            found
        };
        let mut found = attempt(false);
        if matches!(found, Err(LevelError::Memory { .. })) {
            // Other threads may hold too much of the memory, also for groups whose viewcells are waiting.
            found = attempt(true);
        }
        found.unwrap_or_else(|error| {
            lock(&self.error).get_or_insert(error);
            Some(None)
        })
    }

    fn take_in(&mut self, item: u32, found: Option<FoundCell>) -> u64 {
        self.time.end_round();
        let Some(found) = found else { return 0 };
        let (place, _) = self.place_and_stage(item);
        let of = self.groups.of[self.range.start + place] as usize;
        add_cost(&mut self.costs[of], &found);
        self.found_groups[of].get_or_insert_with(|| found.group.clone());
        let (steps, next) = (found.record.steps, found.next as usize);
        let before = self.done[place].replace(found);
        let first = before.as_ref().map_or(GROUP, |before| before.next) as usize;
        self.waiting.iter_mut().take(next).skip(first).for_each(|waiting| *waiting -= 1);
        steps.saturating_sub(before.map_or(0, |before| before.record.steps))
    }

    fn finish(self, waiting: &[u32]) -> SandwichOutcome {
        let all: Arc<[u32]> = self.level.objects.iter().map(|object| object.index).collect();
        let is_done = |done: &Option<FoundCell>| done.as_ref().is_some_and(FoundCell::is_done);
        let mut cache = BakeCache::default();
        for members in &self.groups.cells {
            let found = members.iter().map(|&cell| {
                let place = (cell as usize).checked_sub(self.range.start)?;
                self.done.get(place).filter(|done| is_done(done))?.as_ref()
            });
            // The results of a group are kept only if all its viewcells are complete, from the same sweep of
            // the group: a bake from the cache must give the results of a bake without.
            if let Some(found) = found.collect::<Option<Vec<&FoundCell>>>()
                && let Some(first) = found.first()
                && found.iter().all(|found| found.is_whole() && found.group.trace == first.group.trace)
            {
                cache.insert(first.group.clone(), found.iter().map(|found| found.record.clone()).collect());
            }
        }
        let stages = [0, 1, 2, 3, 4]
            .map(|stage| self.done.iter().flatten().filter(|found| found.has_passed(stage)).count());
        let too_large = |found: &FoundCell| {
            (LOOK..STAGES as u32).contains(&found.next) && {
                let objects = found.group.trace.replay(&self.level.tree).unwrap_or_default();
                self.is_too_large(&found.record, &objects)
            }
        };
        let too_large = self.done.iter().flatten().filter(|found| too_large(found)).count();
        let cut = self.done.iter().flatten().filter(|found| found.is_done() && !found.is_whole()).count();
        let complete = waiting.is_empty() && self.done.iter().all(is_done);
        let reused = self.done.iter().flatten().filter(|found| found.is_reused).count();
        let unknown = || CellSandwich { open: all.clone(), ..CellSandwich::default() };
        let done = self.done.into_iter().map(|done| {
            done.map_or_else(|| (unknown(), MethodTimes::default()), |found| (found.sandwich, found.times))
        });
        let (cells, times) = done.unzip();
        let first = self.range.start;
        let error = self.error.into_inner().unwrap_or_else(PoisonError::into_inner);
        let source = self.source;
        SandwichOutcome {
            source,
            first,
            cells,
            times,
            complete,
            stages,
            reused,
            cache,
            too_large,
            cut,
            error,
        }
    }

    fn fingerprint(&self) -> u64 {
        let hash = Fingerprint::new().with_u64(self.fingerprint);
        hash.with_u64(self.range.start as u64).with_u64(self.range.end as u64).value()
    }

    fn save(&self, state: &mut Writer) {
        for group in &self.found_groups {
            state.u32(u32::from(group.is_some()));
            if let Some(group) = group {
                group.save(state);
            }
        }
        for done in &self.done {
            state.u32(u32::from(done.is_some()));
            if let Some(found) = done {
                found.save(state);
            }
        }
    }

    fn load(&mut self, state: &mut Reader<'_>) -> Result<(), FormatError> {
        // For each group, the number of objects that its sweep has left.
        let mut left = vec![0; self.found_groups.len()];
        for (group, left) in self.found_groups.iter_mut().zip(&mut left) {
            *group = None;
            if state.u32()? != 0 {
                let found = GroupRecord::load(state)?;
                let objects = found.trace.replay(&self.level.tree);
                let wrong = || state.content_error("the sweep of a group is of another level");
                *left = objects.ok_or_else(wrong)?.len();
                *group = Some(Arc::new(found));
            }
        }
        let limit = self.level.index_limit;
        for (cell, done) in self.range.clone().zip(&mut self.done) {
            let of = self.groups.of[cell] as usize;
            *done = match (state.u32()?, &self.found_groups[of]) {
                (0, _) => None,
                (_, None) => return Err(state.content_error("the group of a viewcell is missing")),
                (_, Some(group)) => Some(FoundCell::load(state, group.clone(), limit, left[of])?),
            };
        }
        self.count();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::bake::Bake;
    use visibility_core::glam::DVec3;
    use visibility_core::{Aabb, Object};

    #[test]
    fn waiting_viewcells_are_counted_as_by_looking_at_each() {
        let mut scene = Scene::new();
        for i in 0..40 {
            let min = [(i * 7 % 40) as f32, 20.0 + (i * 13 % 30) as f32, 0.0];
            let bounds = Aabb::from_arrays(min, [min[0] + 3.0, min[1] + 2.0, 4.0]);
            scene.insert(Object { occluder: i % 2 == 0, ..Object::new(bounds) });
        }
        scene.prepare_occluders(&Default::default());
        let grid = crate::Grid::new(DVec3::ZERO, DVec3::new(2.0, 2.0, 2.0)).unwrap();
        let cells = Viewcells::new(grid.over(DVec3::ZERO, DVec3::new(39.0, 9.0, 1.0)).unwrap());
        let baker = || SandwichBaker::new(&scene, &cells, SandwichSettings::default()).with_range(7..99);
        let check = |baker: &SandwichBaker<'_>| {
            for (stage, &waiting) in (0..).zip(&baker.waiting) {
                let is_waiting = |done: &Option<FoundCell>| done.as_ref().is_none_or(|of| of.next <= stage);
                assert_eq!(waiting, baker.done.iter().filter(|done| is_waiting(done)).count(), "{stage}");
            }
        };
        let mut bake = Bake::new(baker());
        let mut rounds = 0;
        while bake.advance().is_some() {
            check(bake.baker());
            check(Bake::resume(baker(), &bake.save()).unwrap().baker());
            rounds += 1;
        }
        assert!(rounds > 4, "{rounds}");
    }
}
