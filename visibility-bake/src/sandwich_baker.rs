//! The bake of sandwiches: for each viewcell methods from cheap to exact, each for what the one before left
//! open.
//!
//! The objects that a sweep has *left* are those that it did not find hidden. An object is *open* in a
//! viewcell if it is left there, and neither seen by a ray nor proven hidden. Its *cost* is
//! [`Object::cost`](visibility_core::Object::cost), in triangles.

use crate::bake_cache::{BakeCache, CellRecord, GroupRecord, HIDDEN, OPEN, SEEN};
use crate::cell_groups::CellGroups;
use crate::cell_sandwich::CellSandwich;
use crate::fingerprints::{METHODS, level_fingerprint, with_settings, with_viewcell};
use crate::found_cell::FoundCell;
use crate::level_error::LevelError;
use crate::method_times::MethodTimes;
use crate::near_to_far::{Trace, ids_of, sweep_near_to_far, swept};
use crate::scratch_file::lock;
use crate::search::{Method, Search};
use crate::settings::SandwichSettings;
use crate::tiled_scene::{PreparedScene, TiledScene};
use crate::time_plan::{BOXES, GROUP, LOOK, STAGES, SWEEP, TimePlan};
use std::fmt;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use visibility_core::bake::Baker;
use visibility_core::binary_format::{Fingerprint, FormatError, Reader, Writer};
use visibility_core::pvs::Viewcells;
use visibility_core::{Scene, VisibleSet};
use visibility_exact::SceneTriangles;
use visibility_region::ExtendedProjectionCuller;

/// Approximate number of triangles that a search copies and sorts in a second, on a machine of 2026.
const SEARCHED_A_SECOND: f64 = 2e5;

/// Finds the sandwiches of a range of viewcells, as a [`Baker`] for a [`Bake`](visibility_core::bake::Bake):
/// with progress, stopping and resuming, on any number of threads; without a limit of time with the same
/// result.
///
/// The sweep of extended projections removes what is hidden behind many occluders together, first for a group
/// of neighbouring viewcells, then, in what is left, for each of them. When all viewcells are swept, rays
/// find what is seen from them, and proofs are tried for the boxes of the open objects, the most costly
/// first, until the [gap](SandwichSettings::with_gap) is met; then, where it is not met, for their triangles.
/// So the bake has five items for each viewcell. In the later stages, of about as many viewcells as came
/// before, the groups with the most costly open objects come first.
///
/// Occluders are the objects that are flagged so: the sweeps use their meshes, the proofs their triangles.
/// Objects that are [never culled](visibility_core::Object::never_cull), such as moving ones, count as seen.
/// Each method works on what the sweep before it has left, so that an edit elsewhere changes nothing
/// ([`with_cache`](Self::with_cache)).
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
    /// Hash of the scene, all viewcells and the settings: the same for all shards of a bake.
    fingerprint: u64,
    groups: CellGroups,
    /// State of each group while some of its viewcells are worked on.
    slots: Vec<Mutex<Slot>>,
    cache: Arc<BakeCache>,
    time: TimePlan,
    done: Vec<Option<FoundCell>>,
    /// Sum of the costs of open objects, by group and stage: those of the group's viewcells that have come to
    /// the stage.
    costs: Vec<[u64; STAGES]>,
    /// Result of the sweep of each group, for groups with a viewcell that is done.
    found_groups: Vec<Option<Arc<GroupRecord>>>,
    /// First reason why a viewcell could not be worked on.
    error: Mutex<Option<LevelError>>,
}

/// The result of a bake.
#[derive(Clone, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub struct SandwichOutcome {
    /// Number of the first viewcell.
    pub first: usize,
    /// Result for each viewcell, in order. In a viewcell that was not worked on, all objects are open.
    pub cells: Vec<CellSandwich>,
    /// Time that each method took, by viewcell. 0 without a [clock](SandwichBaker::with_clock), and in a
    /// viewcell that was not worked on. Without a limit of time, all other parts of the outcome are the same
    /// whatever the times.
    pub times: Vec<MethodTimes>,
    /// Whether all viewcells were worked on to the end: never if some are [too large](Self::too_large).
    pub complete: bool,
    /// Number of viewcells that were through with each stage: swept in groups, swept by themselves, looked
    /// from along rays, searched by proofs of boxes, and by proofs of triangles. A viewcell that does not
    /// need a stage any more counts, too.
    pub stages: [usize; 5],
    /// Number of viewcells whose results, apart from the sweeps, were taken from the
    /// [cache](SandwichBaker::with_cache).
    pub reused: usize,
    /// Results of this bake for the next one. Groups that are not complete are left out.
    pub cache: BakeCache,
    /// Number of viewcells that were swept and not searched, since the objects that the sweeps have left have
    /// more triangles than a search may copy: 2^21, or as many as the level has with each shared mesh counted
    /// once.
    pub too_large: usize,
    /// Why viewcells could not be worked on, for a level in a file.
    pub error: Option<LevelError>,
}

/// Scratch memory of one thread of a bake.
#[derive(Default, Debug)]
pub struct BakeScratch {
    /// Culler prepared for the whole level, if that is small.
    whole: Option<ExtendedProjectionCuller>,
    /// Culler for the tiles around a group.
    sweep: ExtendedProjectionCuller,
    /// Culler prepared for the scene of a group, after the number of the group.
    local: Option<(u32, ExtendedProjectionCuller)>,
}

#[derive(Default)]
struct Slot {
    /// Number of the group's viewcells that are not worked on yet, by stage.
    left: [usize; STAGES],
    /// Content of the group that was made last. The flag is true if it is for the sweeps of viewcells, false
    /// if it is for another stage. With a limit of time, or in a resumed bake, viewcells of the group may be
    /// in different stages.
    group: Option<(bool, Arc<Group>)>,
    /// Result of the group's sweep. It is kept when the content is released.
    record: Option<Arc<GroupRecord>>,
}

/// Data that the viewcells of a group share.
struct Group {
    record: Arc<GroupRecord>,
    /// Numbers of the objects left after the sweep of the group, tile by tile.
    objects: Vec<u32>,
    content: Content,
}

/// Record and times of a viewcell after a stage, and its next stage.
type Found = (CellRecord, MethodTimes, u32);

enum Content {
    /// Records of the group's viewcells from the cache.
    Cached(Vec<CellRecord>),
    /// Scene for the sweeps of the viewcells: the objects that the group's sweep has left, with occluder
    /// meshes, and a prepared sweep.
    Scene(Arc<PreparedScene>),
    /// No scene, for later stages: each viewcell loads the objects that its own sweep has left.
    Objects,
}

impl fmt::Debug for SandwichBaker<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SandwichBaker").field("settings", &self.settings).finish_non_exhaustive()
    }
}

impl<'a> SandwichBaker<'a> {
    /// Prepares a bake of all objects of a scene from all viewcells.
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
            level,
            slots: groups.cells.iter().map(|_| Mutex::default()).collect(),
            groups,
            cache: Arc::default(),
            time: TimePlan::new(),
            done: Vec::new(),
            costs: Vec::new(),
            found_groups: Vec::new(),
            error: Mutex::default(),
        };
        baker.with_range(0..viewcells.cells().len())
    }

    /// Returns the baker for a part of the viewcells: those with numbers in `range`. Numbers beyond the last
    /// viewcell are ignored.
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

    /// Returns the baker with a clock, by which it measures the times of the methods. `clock` returns the
    /// time passed since a fixed moment.
    #[must_use]
    pub fn with_clock(mut self, clock: fn() -> Duration) -> Self {
        self.time.set_clock(clock);
        self
    }

    /// Returns the baker for a bake that ends when `time` has passed, by its [clock](Self::with_clock), which
    /// must run. More than 2^32 seconds count as these. The caller ends the bake. What is hidden comes first,
    /// for as many viewcells as can be:
    ///
    /// - Groups are swept undivided, for seven tenths of the time at most; those that are not by then wait
    ///   until all others are done. Where the first groups find less than an eighth of the objects hidden,
    ///   the others are left out, and all the time is for viewcells.
    /// - Viewcells are swept by themselves until 85 hundredths of the time have passed
    ///   ([`SWEEP_TIME`](crate::SWEEP_TIME)); what is left of the others goes on as it is. A sweep that takes
    ///   more than a quarter of the time that is left for its stage, and more than its share, ends early:
    ///   what it has found by then counts.
    /// - Each search, by rays and then by proofs, has its share of the time that is left, and half a second
    ///   at least. Where it could not even begin in that, since a sweep has left too many triangles, the
    ///   viewcell is swept in parts instead.
    ///
    /// Sweeps and searches that were left out or ended early stay so when the bake is resumed.
    #[must_use]
    pub fn with_time(mut self, time: Duration) -> Self {
        self.time.limit(time);
        self
    }

    /// Returns the baker with the results of a bake of the scene before an edit. Without a limit of time, the
    /// outcome is the same as without these results, to the last byte, except for times. See [`BakeCache`]
    /// for what an edit costs.
    #[must_use]
    pub fn with_cache(mut self, cache: impl Into<Arc<BakeCache>>) -> Self {
        self.cache = cache.into();
        self
    }

    /// Returns the sandwiches found so far, in the order of the viewcells.
    pub fn cells(&self) -> impl Iterator<Item = Option<&CellSandwich>> {
        self.done.iter().map(|done| done.as_ref().map(|found| &found.sandwich))
    }

    /// Returns the [`bake_fingerprint`](crate::bake_fingerprint) of all viewcells, whatever the range of this
    /// baker.
    pub fn whole_fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// Returns why viewcells could not be worked on, for a level in a file. Objects not proven hidden before
    /// the error count as visible. A resumed bake does not work on these viewcells again.
    pub fn error(&self) -> Option<LevelError> {
        lock(&self.error).clone()
    }

    /// Counts the viewcells of each group that are done with each stage, and those left.
    fn count(&mut self) {
        self.slots.iter_mut().for_each(|slot| *slot = Mutex::default());
        self.costs = vec![[0; STAGES]; self.slots.len()];
        for (cell, done) in self.range.clone().zip(&self.done) {
            let of = self.groups.of[cell] as usize;
            let slot = self.slots[of].get_mut().unwrap_or_else(PoisonError::into_inner);
            let next = done.as_ref().map_or(GROUP, |found| found.next) as usize;
            slot.left.iter_mut().skip(next).for_each(|left| *left += 1);
            if let Some(found) = done {
                add_cost(&mut self.costs[of], found);
            }
        }
    }

    /// Notes that a viewcell of a group is done with `stages`. After the last viewcell of a stage, releases
    /// the content that the stage has shared.
    fn end_stages(&self, group: u32, stages: Range<u32>) {
        let mut slot = lock(&self.slots[group as usize]);
        for stage in stages.clone() {
            slot.left[stage as usize] = slot.left[stage as usize].saturating_sub(1);
        }
        if slot.left[stages.start as usize] == 0 {
            (slot.group, slot.record) = (None, None);
        }
    }

    /// Releases the content of all groups that no thread works on, if there is a limit of memory. A thread
    /// that comes back to such a group loads its content again.
    fn release_groups(&self) {
        for slot in self.slots.iter().filter(|_| self.level.is_in_file()) {
            let Ok(mut slot) = slot.try_lock() else { continue };
            slot.group.take_if(|(_, group)| Arc::strong_count(group) == 1);
        }
    }

    /// Returns the position of an item's viewcell in `range`, from 0, and the item's stage.
    fn place_and_stage(&self, item: u32) -> (usize, u32) {
        let (item, count) = (item as usize, self.range.len().max(1));
        (item % count, (item / count) as u32)
    }

    /// Returns a hash of the settings, the origin, and some objects in their order, by their numbers.
    fn content_hash(&self, objects: impl IntoIterator<Item = u32>) -> Fingerprint {
        let hash = with_settings(Fingerprint::new().with(METHODS), &self.settings);
        let origin = self.level.origin.to_array();
        let hash = origin.iter().fold(hash, |hash, x| hash.with_u64(x.to_bits()));
        objects.into_iter().fold(hash, |hash, at| hash.with_u64(self.level.objects[at as usize].hash))
    }

    /// Returns the data that the viewcells of a group share, from the group's slot. If it is not there, makes
    /// it, while other threads that need it wait.
    fn group(&self, number: u32, stage: u32, scratch: &mut BakeScratch) -> Result<Arc<Group>, LevelError> {
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
        Ok(group)
    }

    /// Makes the data that the viewcells of a group share. `known` is the result of the group's sweep. If it
    /// is `None`, the group is swept, and the result is stored there.
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
            // In a bake that was resumed, some of the viewcells may be done.
            known.clone_from(&self.found_groups[number as usize]);
        }
        let whole = with_members(self.content_hash([]));
        // With a limit of time groups are not divided, and so may have other results.
        let question =
            if self.time.is_limited() { with_members(self.content_hash([]).with(1)) } else { whole };
        let answer = self.cache.answer(whole).or_else(|| self.cache.answer(question));
        // Results name objects by their places among those that a trace leaves, which must be that of the
        // viewcells that are done.
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
                    // The surfaces of the last sweep are needed no more.
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
        // What was opened in this bake is what it was.
        let objects = record.trace.replay(&self.level.tree).unwrap_or_default();
        let content = match self.cache.group(record.key).filter(|records| is_usable(records, &objects)) {
            Some(records) => Content::Cached(records.to_vec()),
            None => Content::Objects,
        };
        Ok(Group { record, objects, content })
    }

    /// Returns the time on the clock at which a sweep for `viewcells` viewcells must end if it begins now.
    /// `None` without a limit of time.
    fn end_of_sweep(&self, stage: u32, viewcells: usize) -> Option<Duration> {
        self.time.end_of_sweep(stage, viewcells, self.waiting(stage))
    }

    /// Returns the number of viewcells that were not done with a stage before this round.
    fn waiting(&self, stage: u32) -> usize {
        self.done.iter().filter(|done| done.as_ref().is_none_or(|found| found.next <= stage)).count()
    }

    /// Works on an item, as [`work`](Baker::work) does, with the memory that is free now. The item's stage
    /// must be the next of its viewcell. `Err` if the memory does not suffice now.
    fn attempt(
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
        // With the time of this stage over, a viewcell that was not swept goes on unswept. Any other item is
        // left, unless nothing else is left to do.
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
            // An earlier bake found this group, with the same content.
            (Content::Cached(records), _) => {
                let member = self.groups.cells[of as usize].binary_search(&(number as u32));
                (records[member.unwrap_or_default()].clone(), MethodTimes::default(), done)
            }
            // The group is small enough to be a scene: the viewcell is swept in it.
            (Content::Scene(scene), before) => {
                let _memory = self.level.reserve_cell(objects, false)?;
                let (record, is_known, cut) = self.sweep(number, objects, scene, scratch);
                is_skipped |= cut;
                let group = before.map_or(Duration::ZERO, |before| before.times.sweep);
                let times = MethodTimes { sweep: group + lap(), ..MethodTimes::default() };
                (record, times, if is_known { done } else { LOOK })
            }
            // The scene of the group does not fit into memory: all objects stay open for the search.
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
            // Saved bytes may be forged.
            (Content::Objects, Some(before)) if before.record.is_of(objects) => {
                // A search needs its triangles sorted first. If the share of the time is too short for that,
                // parts of the viewcell are swept.
                let share = self.time.share_of_search(self.waiting(stage));
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
    /// first is true if the answers of the record are from the cache. If it is false, the answer for each
    /// object left after the sweep is [`OPEN`]. The second is true if the time of the sweep was over at its
    /// end, so that more objects may be left than a full sweep leaves.
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
        // The scene of a group has the indices of the group's list.
        let left: Vec<u32> = swept(sweep, scene, cell, &is_over).iter().map(|id| id.index() as u32).collect();
        let key = with_viewcell(self.content_hash(left.iter().map(|&at| objects[at as usize])), cell).value();
        match self.cache.cell(key).filter(|known| known.answers.len() == left.len()) {
            Some(known) => (CellRecord { left, ..known.clone() }, true, is_over()),
            None => (CellRecord { key, answers: vec![OPEN; left.len()], left, steps: 0 }, false, is_over()),
        }
    }

    /// Returns whether the objects that the sweep of a viewcell has left have more triangles than a search
    /// may copy. Positions beyond the list of the group count as none.
    fn is_too_large(&self, record: &CellRecord, objects: &[u32]) -> bool {
        self.triangles_left(record, objects) > self.level.most_copied
    }

    /// Returns the number of triangles of the objects that the sweep of a viewcell has left.
    fn triangles_left(&self, record: &CellRecord, objects: &[u32]) -> u64 {
        let left = record.left.iter().filter_map(|&at| objects.get(at as usize));
        left.map(|&at| u64::from(self.level.objects[at as usize].triangles)).sum()
    }

    /// Sweeps from parts of a viewcell the objects that its own sweep has left, in place of a search that has
    /// not the time to begin. The parts are smaller in each stage. Returns the objects left and the next
    /// stage. `None` once `stop` has returned true.
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
        // The scene has the indices of the list of what is left.
        let left = ids_of(&visible, &scene).into_iter().map(|id| id.index());
        (record.left, record.answers) =
            left.map(|at| (before.record.left[at], before.record.answers[at])).unzip();
        let mut times = before.times;
        times.sweep += lap();
        Ok(Some((record, times, before.next + 1)))
    }

    /// Finds answers for the objects left after the sweep of a viewcell, within `share` if the time is
    /// limited. Returns them with the next stage, and a flag: true if the share was used up before the search
    /// was through. `None` once `stop` has returned true.
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
        // Only triangles of objects that the sweep has left, and their occluders, are read.
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
        // A search that the time ends keeps what it has found. One that `stop` ends is done again later.
        let is_cut = search.is_stopped();
        if is_cut && !self.time.is_over(end) {
            return Ok(None);
        }
        let next = if search.is_met() { STAGES as u32 } else { before.next + 1 };
        let steps = record.steps.saturating_add(search.steps());
        let (key, left) = (record.key, record.left.clone());
        Ok(Some(((CellRecord { key, left, answers: search.answers, steps }, times, next), is_cut)))
    }

    /// Returns the sandwich of a record, given the objects of its group.
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

/// Adds the cost of a viewcell's open objects to the costs of its group, at the viewcell's next stage.
fn add_cost(costs: &mut [u64; STAGES], found: &FoundCell) {
    if let Some(cost) = costs.get_mut(found.next as usize) {
        *cost = cost.saturating_add(found.cost);
    }
}

impl Baker for SandwichBaker<'_> {
    type Scratch = BakeScratch;
    /// `None` for a viewcell with nothing left to do, or whose objects could not be had.
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
            // The viewcells of a group follow one another.
            return u64::from(of);
        }
        let costs = self.costs[of as usize][stage as usize] / self.groups.cells[of as usize].len() as u64;
        u64::from(self.groups.portion(of)) << 56 | (u64::MAX >> 8).saturating_sub(costs)
    }

    fn stage(&self, item: u32) -> u32 {
        let (place, stage) = self.place_and_stage(item);
        let next = self.done[place].as_ref().map_or(GROUP, |found| found.next) as usize;
        // No item is worked on while the next round is chosen.
        if self.time.is_put_off(next) {
            stage + STAGES as u32
        } else if self.time.is_limited() && (stage, next) == (BOXES, BOXES as usize) {
            // Rays hide nothing: where the time is limited, boxes are proven before other viewcells have
            // rays.
            SWEEP
        } else {
            stage
        }
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
            // Content of groups is released before the work ends: a thread that works alone counts on it.
            let _working = self.level.work(is_alone);
            if is_alone {
                *scratch = BakeScratch::default();
                self.release_groups();
            }
            let found = self.attempt(item, scratch, stop);
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
            // Other threads may have too much of the memory, and groups whose viewcells wait.
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
        let steps = found.record.steps;
        let before = self.done[place].replace(found);
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
            // A bake that sweeps all of a group would find other results.
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
        let complete = waiting.is_empty() && self.done.iter().all(is_done);
        let reused = self.done.iter().flatten().filter(|found| found.is_reused).count();
        let unknown = || CellSandwich { open: all.clone(), ..CellSandwich::default() };
        let done = self.done.into_iter().map(|done| {
            done.map_or_else(|| (unknown(), MethodTimes::default()), |found| (found.sandwich, found.times))
        });
        let (cells, times) = done.unzip();
        let first = self.range.start;
        let error = self.error.into_inner().unwrap_or_else(PoisonError::into_inner);
        SandwichOutcome { first, cells, times, complete, stages, reused, cache, too_large, error }
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
        // By group, the number of objects that its sweep has left.
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
