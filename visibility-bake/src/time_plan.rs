//! Division of a bake's time among stages and viewcells, if the time is limited.
//!
//! Sweeps of groups find hidden objects first, each for many viewcells. Then come sweeps of viewcells, and
//! last searches. An earlier stage takes less time for each object that it finds hidden. So each stage gets
//! all the time that later stages do not need, and one viewcell without a sweep is worse than ten without a
//! search.

use std::sync::atomic::{AtomicU8, AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::time::Duration;

/// Number of stages of a bake: all groups of viewcells are swept, then all viewcells, then rays are cast from
/// all viewcells. For viewcells that do not meet the gap of the settings, boxes are then proven hidden, and
/// last triangles.
pub(crate) const STAGES: usize = 5;
/// Number of the stage that sweeps groups of viewcells. All viewcells of a group use the result.
pub(crate) const GROUP: u32 = 0;
/// Number of the stage that sweeps the single viewcells.
pub(crate) const SWEEP: u32 = 1;
/// Number of the stage that casts rays from viewcells at the objects that sweeps have not found hidden.
pub(crate) const LOOK: u32 = 2;
/// Number of the stage that proves boxes of objects hidden from viewcells.
pub(crate) const BOXES: u32 = 3;

/// Fraction of a [limited time](crate::SandwichBaker::with_time) after which no viewcell is swept any more.
/// The rest is for rays and proofs.
pub const SWEEP_TIME: f64 = 0.85;

/// For each stage of sweeps, the fraction of the limited time at which it ends.
const ENDS: [(u32, f64); 2] = [(GROUP, 0.7), (SWEEP, SWEEP_TIME)];

/// Least fraction of its stage's remaining time that a sweep may take. A sweep finds most hidden objects near
/// its end, so equal shares for all sweeps would often find less than complete sweeps for a few viewcells.
const MIN_PART: f64 = 0.25;

/// Number of groups of viewcells that are swept before [`MIN_HIDDEN`] decides whether to skip the others.
const TRIED: u64 = 4;

/// Least fraction of the tested objects that the sweeps of groups of viewcells must find hidden, once
/// [`TRIED`] groups are swept. If they find less, the other groups are not swept: in open country, hardly any
/// object is hidden from all viewcells of a group. Sweeps of the single viewcells find more.
const MIN_HIDDEN: f64 = 0.125;

/// Least time of a search. In less, a search would not get beyond its rays.
const MIN_SEARCH: Duration = Duration::from_millis(500);

/// Greatest limit of time that is used; longer limits are shortened to it. A fraction of a far longer limit
/// could round to more than the greatest [`Duration`].
const LONGEST: Duration = Duration::from_secs(1 << 32);

/// Value of [`TimePlan::phases`] for a stage whose time has not ended. Its items are worked on.
const IN_TIME: u8 = 0;
/// Value of [`TimePlan::phases`] for a stage whose time ended during the present round (a batch of items that
/// the threads work on). No further item of the stage is begun in this round.
const ENDED: u8 = 1;
/// Value of [`TimePlan::phases`] for a stage whose time ended in an earlier round. Its items are worked on
/// after all items of other stages.
const PUT_OFF: u8 = 2;

/// Time of a bake and its division among stages.
pub(crate) struct TimePlan {
    /// Returns the time since a fixed moment.
    clock: fn() -> Duration,
    /// For each stage, the time on the clock at which it ends. For the stages after the sweeps this is the
    /// end of the bake. [`Duration::MAX`] without a limit.
    ends: [Duration; STAGES],
    /// For each stage, whether its time has ended: [`IN_TIME`], [`ENDED`] or [`PUT_OFF`].
    phases: [AtomicU8; STAGES],
    /// Number of items (each a stage of one viewcell) that threads are working on.
    working: AtomicUsize,
    /// Number of searches (rays or proofs for one viewcell) begun in the present round: a batch of items that
    /// the threads work on.
    begun: AtomicUsize,
    /// Sums over all groups of viewcells swept so far: the number of groups, of objects that their sweeps
    /// tested, and of objects that they found hidden.
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

    /// Limits the time, counted from now. The limit is at most [`LONGEST`].
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

    /// Returns whether the clock has reached the time `end`. False for `None`, which means no limit.
    pub(crate) fn is_over(&self, end: Option<Duration>) -> bool {
        end.is_some_and(|end| self.now() >= end)
    }

    /// Marks that work on an item begins. The work ends when the returned value is dropped.
    pub(crate) fn begin(&self) -> Working<'_> {
        self.working.fetch_add(1, Relaxed);
        Working(self)
    }

    /// Returns whether the time of a stage is over when the clock shows `now`.
    pub(crate) fn is_past(&self, stage: u32, now: Duration) -> bool {
        now >= self.ends[stage as usize]
    }

    /// Stops the work on a stage whose time is over. Returns whether the caller must leave its item undone.
    /// False if the stage was already [put off](Self::is_put_off): its items are begun again only when no
    /// other work is left, and are then worked on although the time of the stage is over.
    pub(crate) fn end(&self, stage: u32) -> bool {
        let phase = &self.phases[stage as usize];
        let is_new = phase.load(Relaxed) != PUT_OFF;
        if is_new {
            phase.store(ENDED, Relaxed);
        }
        is_new
    }

    /// Returns whether the items of a stage must wait until no item of another stage is left, because the
    /// time of the stage has ended. Must be called only while no item is worked on.
    pub(crate) fn is_put_off(&self, stage: usize) -> bool {
        let Some(phase) = self.phases.get(stage).filter(|phase| phase.load(Relaxed) != IN_TIME) else {
            return false;
        };
        phase.store(PUT_OFF, Relaxed);
        true
    }

    /// Records the result of a group's complete sweep, which found `hidden` of the `asked` tested objects
    /// hidden.
    pub(crate) fn note_group(&self, asked: usize, hidden: usize) {
        for (sum, number) in self.groups.iter().zip([1, asked as u64, hidden as u64]) {
            sum.fetch_add(number, Relaxed);
        }
    }

    /// Returns whether the remaining sweeps of groups are skipped: if the time is limited, and the first
    /// sweeps found less than [`MIN_HIDDEN`] of the objects hidden.
    pub(crate) fn leaves_groups_out(&self) -> bool {
        let [swept, asked, hidden] = self.groups.each_ref().map(|sum| sum.load(Relaxed));
        self.is_limited() && swept >= TRIED && (hidden as f64) < MIN_HIDDEN * asked as f64
    }

    /// Returns the time on the clock at which a sweep for `viewcells` viewcells must end if it begins now. It
    /// may take [`MIN_PART`] of the time left for its stage, or the viewcells' equal share of that time if
    /// this is more. `waiting` is the number of viewcells that are not swept yet. `None` without a limit.
    pub(crate) fn end_of_sweep(&self, stage: u32, viewcells: usize, waiting: usize) -> Option<Duration> {
        self.is_limited().then(|| {
            let (now, end) = (self.now(), self.ends[stage as usize]);
            let share = viewcells as f64 / waiting.max(viewcells).max(1) as f64;
            now + end.saturating_sub(now).mul_f64(share.max(MIN_PART))
        })
    }

    /// Returns how long a search that begins now may take: its equal share of the time left, and at least
    /// [`MIN_SEARCH`]. `waiting` is the number of viewcells that wait for the search at the beginning of the
    /// present round. `None` without a limit.
    pub(crate) fn share_of_search(&self, waiting: usize) -> Option<Duration> {
        self.is_limited().then(|| {
            let waiting = waiting.saturating_sub(self.begun.fetch_add(1, Relaxed));
            let left = self.ends[LOOK as usize].saturating_sub(self.now());
            let share = self.working.load(Relaxed) as f64 / waiting.max(1) as f64;
            left.mul_f64(share.min(1.0)).max(MIN_SEARCH)
        })
    }

    /// Begins the next round (batch of items that the threads work on), after the results of the last one
    /// were stored.
    pub(crate) fn end_round(&mut self) {
        *self.begun.get_mut() = 0;
    }
}

/// Marks that an item is worked on, until it is dropped.
pub(crate) struct Working<'a>(&'a TimePlan);

impl Drop for Working<'_> {
    fn drop(&mut self) {
        self.0.working.fetch_sub(1, Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock() -> Duration {
        Duration::from_secs(1000)
    }

    fn assert_near(found: Option<Duration>, seconds: f64, what: &str) {
        let found = found.map_or(f64::INFINITY, |found| found.as_secs_f64());
        assert!((found - seconds).abs() < 1e-6, "{what}: {found} s instead of {seconds}");
    }

    /// A bake of 100 seconds from second 1000 on.
    #[test]
    fn time_is_divided_among_stages_and_viewcells() {
        let mut plan = TimePlan::new();
        plan.set_clock(clock);
        assert!(!plan.is_limited() && !plan.is_past(GROUP, clock()) && !plan.is_over(None), "no limit");
        assert_eq!(
            [plan.end_of_sweep(SWEEP, 1, 2), plan.share_of_search(2)],
            [None; 2],
            "shares of no limit"
        );
        plan.limit(Duration::from_secs(100));
        assert!(plan.is_limited(), "a limit");
        for (stage, end) in [(GROUP, 1070), (SWEEP, 1085), (LOOK, 1100), (BOXES, 1100)] {
            let is_past = [end - 1, end].map(|now| plan.is_past(stage, Duration::from_secs(now)));
            assert_eq!(is_past, [false, true], "a second before the end of stage {stage}, and at it");
        }
        let is_over = [1000, 1001].map(|end| plan.is_over(Some(Duration::from_secs(end))));
        assert_eq!(is_over, [true, false], "an end now and in a second");
        for (viewcells, waiting, share) in
            [(1, 2, 0.5), (1, 100, 0.25), (3, 4, 0.75), (3, 0, 1.0), (0, 0, 0.25)]
        {
            let end = plan.end_of_sweep(SWEEP, viewcells, waiting);
            assert_near(end, 1000.0 + 85.0 * share, &format!("a sweep for {viewcells} of {waiting}"));
        }
        assert_near(plan.share_of_search(4), 0.5, "a search that no thread works on");
        plan.end_round();
        let working = plan.begin();
        for (number, share) in [0.25, 1.0 / 3.0, 0.5, 1.0, 1.0].into_iter().enumerate() {
            assert_near(plan.share_of_search(4), 100.0 * share, &format!("search {number} of four"));
        }
        drop(working);
        plan.end_round();
        let _working = [plan.begin(), plan.begin(), plan.begin()];
        assert_near(plan.share_of_search(2), 100.0, "three threads at two searches");
    }

    #[test]
    fn the_longest_limit_is_that_of_every_longer_one() {
        let mut plan = TimePlan::new();
        plan.limit(Duration::MAX);
        let is_past = [LONGEST - Duration::from_secs(1), LONGEST].map(|now| plan.is_past(LOOK, now));
        assert_eq!(is_past, [false, true], "a second before the end, and at it");
    }

    #[test]
    fn groups_that_hide_little_are_left_out_of_a_limited_bake() {
        for (hidden, is_limited, expected) in [(49, true, true), (50, true, false), (49, false, false)] {
            let mut plan = TimePlan::new();
            if is_limited {
                plan.limit(Duration::from_secs(9));
            }
            (0..3).for_each(|_| plan.note_group(100, 0));
            assert!(!plan.leaves_groups_out(), "after three groups");
            plan.note_group(100, hidden);
            assert_eq!(plan.leaves_groups_out(), expected, "{hidden} of 400 objects, limited: {is_limited}");
        }
    }

    #[test]
    fn a_stage_whose_time_is_over_is_put_off_once() {
        let plan = TimePlan::new();
        assert!(!plan.is_put_off(GROUP as usize) && !plan.is_put_off(STAGES), "in time, and no stage");
        assert!(plan.end(GROUP) && plan.end(GROUP), "items of the present round are left undone");
        assert!(plan.is_put_off(GROUP as usize), "the stage in the next round");
        assert!(!plan.end(GROUP), "items that were put off are worked on");
        assert!(!plan.is_put_off(SWEEP as usize), "another stage");
    }
}
