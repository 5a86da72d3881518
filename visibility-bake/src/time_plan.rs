//! How a bake divides its time among stages and viewcells, if that is limited.
//!
//! Hidden objects are found first by the sweeps of groups, each for many viewcells, then by the sweeps of
//! viewcells, and in the end by searches. An earlier stage takes less time for an object that it finds. So
//! each stage has all the time that later stages can do without, and a viewcell that is not swept at all is
//! worse than ten that are not searched.

use std::sync::atomic::{AtomicU8, AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::time::Duration;

/// Number of stages of a bake. All groups of viewcells are swept; then all viewcells; then all are looked
/// from along rays; then, where the gap is not met, boxes are proven hidden, and in the end triangles.
pub(crate) const STAGES: usize = 5;
/// The stage of the sweeps of groups, whose results all viewcells of a group take.
pub(crate) const GROUP: u32 = 0;
/// The stage of the sweeps of viewcells.
pub(crate) const SWEEP: u32 = 1;
/// The stage of rays aimed at the objects that sweeps have left.
pub(crate) const LOOK: u32 = 2;
/// The stage of proofs of boxes.
pub(crate) const BOXES: u32 = 3;

/// Share of a [limited time](crate::SandwichBaker::with_time) after which no viewcell is swept by itself any
/// more. The rest is for rays and proofs.
pub const SWEEP_TIME: f64 = 0.85;

/// Share of the time after which each stage of sweeps gives way to the next stage.
const ENDS: [(u32, f64); 2] = [(GROUP, 0.7), (SWEEP, SWEEP_TIME)];

/// Least share of the time left for its stage that a sweep may take. A sweep finds most at its end, so that
/// equal shares for all would often find less than whole sweeps for a few.
const MIN_PART: f64 = 0.25;

/// Number of groups that are swept before the others may be left out.
const TRIED: u64 = 4;

/// Least share of the objects that the first sweeps of groups must find hidden, or else the other groups are
/// left out. In open country next to nothing is hidden from a group, and more from each of its viewcells.
const MIN_HIDDEN: f64 = 0.125;

/// Least time of a search: with less, nothing would be left after the rays.
const MIN_SEARCH: Duration = Duration::from_millis(500);

/// Longest limit of time: numbers of seconds far above it are beyond what a [`Duration`] holds once rounded.
const LONGEST: Duration = Duration::from_secs(1 << 32);

/// Phase of a stage whose time has not ended.
const IN_TIME: u8 = 0;
/// Phase of a stage in the round in which its time has ended: no item is begun any more.
const ENDED: u8 = 1;
/// Phase of a stage in the rounds after its time has ended: its items wait until all other viewcells are
/// done.
const PUT_OFF: u8 = 2;

/// Time of a bake and its division among stages.
pub(crate) struct TimePlan {
    /// Clock: returns the time passed since a fixed moment.
    clock: fn() -> Duration,
    /// Time on the clock at which each stage gives way to later ones. For all stages after the sweeps this is
    /// the end of the bake. [`Duration::MAX`] without a limit.
    ends: [Duration; STAGES],
    /// Phase of each stage: [`IN_TIME`], [`ENDED`] or [`PUT_OFF`].
    phases: [AtomicU8; STAGES],
    /// Number of items (each a viewcell and a stage) that threads work on now.
    working: AtomicUsize,
    /// Number of searches begun in this round.
    begun: AtomicUsize,
    /// Number of groups swept, number of objects that these sweeps tested, and number of those found hidden.
    groups: [AtomicU64; 3],
}

impl TimePlan {
    /// Returns a plan without a limit, and a clock that stands still.
    pub(crate) fn new() -> Self {
        Self {
            clock: || Duration::ZERO,
            ends: [Duration::MAX; STAGES],
            phases: Default::default(),
            working: AtomicUsize::new(0),
            begun: AtomicUsize::new(0),
            groups: Default::default(),
        }
    }

    pub(crate) fn set_clock(&mut self, clock: fn() -> Duration) {
        self.clock = clock;
    }

    /// Limits the time from now on, to [`LONGEST`] at most.
    pub(crate) fn limit(&mut self, time: Duration) {
        let (now, time) = (self.now(), time.min(LONGEST));
        self.ends = [now.saturating_add(time); STAGES];
        for (stage, part) in ENDS {
            self.ends[stage as usize] = now.saturating_add(time.mul_f64(part));
        }
    }

    pub(crate) fn is_limited(&self) -> bool {
        self.ends[GROUP as usize] != Duration::MAX
    }

    pub(crate) fn now(&self) -> Duration {
        (self.clock)()
    }

    /// Returns whether the clock has reached the time `end`. False for `None`, which stands for no limit.
    pub(crate) fn is_over(&self, end: Option<Duration>) -> bool {
        end.is_some_and(|end| self.now() >= end)
    }

    /// Begins work on an item. The work ends when the result is dropped.
    pub(crate) fn begin(&self) -> Working<'_> {
        self.working.fetch_add(1, Relaxed);
        Working(self)
    }

    /// Returns whether the time of a stage is over when the clock shows `now`.
    pub(crate) fn is_past(&self, stage: u32, now: Duration) -> bool {
        now >= self.ends[stage as usize]
    }

    /// Ends a stage whose time is over. Returns false if the stage was [put off](Self::is_put_off) already:
    /// nothing else is left to do, and its items are worked on all the same.
    pub(crate) fn end(&self, stage: u32) -> bool {
        let phase = &self.phases[stage as usize];
        let is_new = phase.load(Relaxed) != PUT_OFF;
        if is_new {
            phase.store(ENDED, Relaxed);
        }
        is_new
    }

    /// Returns whether the items of a stage wait until all others are done, since the time of the stage has
    /// ended. Called while no item is worked on.
    pub(crate) fn is_put_off(&self, stage: usize) -> bool {
        let Some(phase) = self.phases.get(stage).filter(|phase| phase.load(Relaxed) != IN_TIME) else {
            return false;
        };
        phase.store(PUT_OFF, Relaxed);
        true
    }

    /// Notes the result of a group's sweep that was not cut short: of the `asked` objects that it tested, it
    /// found `hidden` hidden.
    pub(crate) fn note_group(&self, asked: usize, hidden: usize) {
        for (sum, number) in self.groups.iter().zip([1, asked as u64, hidden as u64]) {
            sum.fetch_add(number, Relaxed);
        }
    }

    /// Returns whether sweeps of groups are left out: the time is limited, and the first sweeps have found
    /// less than [`MIN_HIDDEN`] of the objects hidden.
    pub(crate) fn leaves_groups_out(&self) -> bool {
        let [swept, asked, hidden] = self.groups.each_ref().map(|sum| sum.load(Relaxed));
        self.is_limited() && swept >= TRIED && (hidden as f64) < MIN_HIDDEN * asked as f64
    }

    /// Returns the time on the clock at which a sweep for `viewcells` viewcells must end if it begins now:
    /// after [`MIN_PART`] of the time left for its stage, or after their share of it, whichever is later.
    /// `waiting` counts the viewcells that are not swept. `None` without a limit.
    pub(crate) fn end_of_sweep(&self, stage: u32, viewcells: usize, waiting: usize) -> Option<Duration> {
        self.is_limited().then(|| {
            let (now, end) = (self.now(), self.ends[stage as usize]);
            let share = viewcells as f64 / waiting.max(viewcells).max(1) as f64;
            now + end.saturating_sub(now).mul_f64(share.max(MIN_PART))
        })
    }

    /// Returns how long a search may take that begins now: its share of the time left, and at least
    /// [`MIN_SEARCH`]. `waiting` counts the viewcells that are not searched before this round. `None`
    /// without a limit.
    pub(crate) fn share_of_search(&self, waiting: usize) -> Option<Duration> {
        self.is_limited().then(|| {
            let waiting = waiting.saturating_sub(self.begun.fetch_add(1, Relaxed));
            let left = self.ends[LOOK as usize].saturating_sub(self.now());
            let share = self.working.load(Relaxed) as f64 / waiting.max(1) as f64;
            left.mul_f64(share.min(1.0)).max(MIN_SEARCH)
        })
    }

    /// Begins the next round, after the results of a round were taken in.
    pub(crate) fn end_round(&mut self) {
        *self.begun.get_mut() = 0;
    }
}

/// Work on an item, until it is dropped.
pub(crate) struct Working<'a>(&'a TimePlan);

impl Drop for Working<'_> {
    fn drop(&mut self) {
        self.0.working.fetch_sub(1, Relaxed);
    }
}
