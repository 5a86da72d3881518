//! Bakes: long computations over many items in rounds, which report progress, can be stopped, saved and
//! resumed, and give the same result on any number of threads.
//!
//! A [`Baker`] is the algorithm: it computes the result of one item and merges results into its state. A
//! [`Bake`] runs a baker. The items of one round are computed independently of one another, so any number of
//! threads can share them (feature `rayon`: all threads of the current pool; otherwise one thread). At the
//! end of each round the results are merged in a fixed order. The outcome therefore depends on the size of a
//! round, never on the number of threads.
//!
//! ```
//! use visibility_core::bake::{Bake, Baker};
//! use visibility_core::binary_format::{FormatError, Reader, Writer};
//! /// Counts the divisors of the numbers from 1 on.
//! struct Divisors(Vec<u32>);
//! impl Baker for Divisors {
//!     type Scratch = ();
//!     type Found = u32;
//!     type Outcome = Vec<u32>;
//!     fn item_count(&self) -> usize { self.0.len() }
//!     fn work(&self, item: u32, _: &mut (), _: &dyn Fn() -> bool) -> Option<u32> {
//!         Some((1..=item + 1).filter(|divisor| (item + 1) % divisor == 0).count() as u32)
//!     }
//!     fn take_in(&mut self, item: u32, found: u32) -> u64 {
//!         self.0[item as usize] = found;
//!         u64::from(item) + 1
//!     }
//!     // This baker counts a waiting number, which was not examined, as divisible by all smaller numbers.
//!     fn finish(mut self, waiting: &[u32]) -> Vec<u32> {
//!         for &item in waiting { self.0[item as usize] = item + 1 }
//!         self.0
//!     }
//!     fn fingerprint(&self) -> u64 { self.0.len() as u64 }
//!     fn save(&self, state: &mut Writer) { state.u32s(self.0.iter().copied()) }
//!     fn load(&mut self, state: &mut Reader<'_>) -> Result<(), FormatError> {
//!         self.0 = state.u32s(self.0.len())?;
//!         Ok(())
//!     }
//! }
//! let mut bake = Bake::new(Divisors(vec![0; 100]));
//! let progress = bake.advance().unwrap();
//! assert!(progress.done < progress.total);
//! // Later, maybe in another process:
//! let mut bake = Bake::resume(Divisors(vec![0; 100]), &bake.save())?;
//! while bake.advance().is_some() {}
//! assert_eq!(bake.finish()[11], 6);
//! # Ok::<(), FormatError>(())
//! ```

use crate::binary_format::{Format, FormatError, Reader, Writer};
use crate::spans::{self, Span};
use alloc::vec::Vec;
use core::cmp::Reverse;

/// Format of saved bakes. Earlier versions are refused: 1 and 2 held cell-to-cell bakes only, and 3 may hold
/// results of a faulty version of `visibility-bake`, which hid visible objects.
const FORMAT: Format = Format { magic: *b"VISIBAKE", version: 4 };

/// Progress of a bake: the number of items done and the cost so far.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[non_exhaustive]
pub struct Progress {
    /// Number of items whose results have been merged.
    pub done: usize,
    /// Number of all items of the bake, done or not.
    pub total: usize,
    /// Sum of the costs of all merged items, in the baker's own unit of work (see [`Baker::take_in`]).
    /// Saturates at `u64::MAX`.
    pub steps: u64,
}

/// An algorithm over numbered items. A [`Bake`] calls it in rounds: the items of a round are worked on
/// independently, then their results are merged.
pub trait Baker: Sync {
    /// Scratch memory of one thread, reused for one item after another. What earlier items have left in it
    /// must not change the result of an item.
    type Scratch: Default;
    /// Result of working on one item, before [`take_in`](Self::take_in) merges it into the baker's state.
    type Found: Send;
    /// Final result of the whole bake.
    type Outcome;

    /// Greatest number of items in one round; 0 counts as 1. Larger rounds keep more threads busy, but the
    /// items of a round cannot use one another's results.
    const ROUND: usize = 48;
    /// Kind stored in the [header](crate::binary_format) of saved bakes, so that a bake saved by one type of
    /// baker is refused by another type.
    const KIND: u32 = 0;

    /// Returns the number of items, which are numbered from 0. Must be less than `u32::MAX` and constant for
    /// the whole bake.
    fn item_count(&self) -> usize;

    /// Returns the priority of an item within its stage; lower ranks are worked on first. A good rank is the
    /// expected cost of the item. Each round takes the waiting items of lowest rank; among equal ranks, those
    /// of lowest number. The rank may change between rounds. The default is the item's number.
    fn rank(&self, item: u32) -> u64 {
        item.into()
    }

    /// Returns the stage of an item: an item is worked on once the results of all items of lower stages have
    /// been merged. The stage may change between rounds, as when the baker puts items off, but an item must
    /// never come before an item whose result it needs. The default is one stage for all.
    fn stage(&self, item: u32) -> u32 {
        let _ = item;
        0
    }

    /// Returns whether the waiting items of the lowest stage keep their ranks, and no other item joins them,
    /// until all of them are done. A [`Bake`] then sorts them once. Otherwise, as by default, it looks at all
    /// waiting items in each round, in time quadratic in the number of items. The order is the same.
    fn is_order_fixed(&self) -> bool {
        false
    }

    /// Computes the result of one item from the baker's state before the round. Called from several threads
    /// at once with feature `rayon`. If an item takes long, `work` calls `stop` several times a second. Once
    /// `stop` has returned true, `work` returns `None`, and the item stays waiting. If an item is short,
    /// `work` need not call `stop`.
    fn work(&self, item: u32, scratch: &mut Self::Scratch, stop: &dyn Fn() -> bool) -> Option<Self::Found>;

    /// Merges the result of one item into the baker's state. Called at the end of a round for each item of
    /// the round, in ascending order of rank. Returns the work that the item has cost, in the baker's own
    /// unit, which [`Progress::steps`] sums up.
    fn take_in(&mut self, item: u32, found: Self::Found) -> u64;

    /// Turns the baker's state into the final result. `waiting` lists the items that were not worked on, in
    /// ascending order. A conservative baker counts as visible everything that these items could have found
    /// to be visible.
    fn finish(self, waiting: &[u32]) -> Self::Outcome;

    /// Returns a hash of everything that determines the outcome: the input and the settings, but not the
    /// progress. See [`Fingerprint`](crate::binary_format::Fingerprint).
    fn fingerprint(&self) -> u64;

    /// Appends the merged results so far to `state`, in the form that [`load`](Self::load) reads.
    fn save(&self, state: &mut Writer);

    /// Replaces the merged results of this baker by those that a baker of the same fingerprint has
    /// [saved](Self::save).
    ///
    /// # Errors
    /// [`FormatError`] if the state is inconsistent. The bytes may be forged, so every number must be
    /// checked before use.
    fn load(&mut self, state: &mut Reader<'_>) -> Result<(), FormatError>;
}

/// A [`Baker`] in progress: [`advance`](Self::advance) works on one round of items, [`finish`](Self::finish)
/// ends the bake at any time.
#[derive(Clone, Debug)]
pub struct Bake<B> {
    baker: B,
    /// Items that have not been worked on yet, in any order but for the last `sorted`, without duplicates.
    waiting: Vec<u32>,
    /// Number of items at the end of `waiting` that are all those of the lowest stage, in descending order of
    /// rank, then number. 0 if they are not sorted.
    sorted: usize,
    steps: u64,
}

impl<B: Baker> Bake<B> {
    /// Starts a bake with all items waiting.
    pub fn new(baker: B) -> Self {
        let waiting = (0..baker.item_count() as u32).collect();
        Self { baker, waiting, sorted: 0, steps: 0 }
    }

    /// Returns the baker with the results merged so far.
    pub fn baker(&self) -> &B {
        &self.baker
    }

    /// Returns the number of items done, the number of all items, and the cost so far.
    pub fn progress(&self) -> Progress {
        let total = self.baker.item_count();
        Progress { done: total.saturating_sub(self.waiting.len()), total, steps: self.steps }
    }

    /// Works on the next round of items and merges their results. Returns the progress after the round, or
    /// `None` if no item was waiting.
    pub fn advance(&mut self) -> Option<Progress> {
        self.advance_unless(|| false, || false)
    }

    /// Works on the next round of items like [`advance`](Self::advance), but ends early once `pause` or
    /// `stop` returns true. Items of the round that no thread has begun by then stay waiting. After `pause`,
    /// the items already begun are finished. After `stop`, an item already begun also stays waiting if its
    /// [`Baker::work`] returns `None`. Stopping early can change the outcome of the whole bake only if items
    /// use one another's results.
    pub fn advance_unless(
        &mut self,
        pause: impl Fn() -> bool + Sync,
        stop: impl Fn() -> bool + Sync,
    ) -> Option<Progress> {
        if self.waiting.is_empty() {
            return None;
        }
        let round = self.next_round();
        let span = spans::round(round.len());
        let found = span.within(|| work_on_all(&self.baker, &round, &span, &pause, &stop));
        for (&item, found) in round.iter().zip(found) {
            match found {
                Some(found) => self.steps = self.steps.saturating_add(self.baker.take_in(item, found)),
                None => {
                    self.waiting.push(item);
                    self.sorted = 0;
                }
            }
        }
        span.record_round(self.progress());
        Some(self.progress())
    }

    /// Removes the items of the lowest stage that have the least rank, at most [`Baker::ROUND`], from the
    /// waiting items and returns them in ascending order of rank, then number. Requires at least one waiting
    /// item.
    fn next_round(&mut self) -> Vec<u32> {
        let baker = &self.baker;
        if baker.is_order_fixed() {
            if self.sorted == 0 {
                let lowest = self.waiting.iter().map(|&item| baker.stage(item)).min();
                self.waiting.sort_by_cached_key(|&item| {
                    let is_lowest = Some(baker.stage(item)) == lowest;
                    is_lowest.then(|| Reverse((baker.rank(item), item)))
                });
                let is_higher = |&item: &u32| Some(baker.stage(item)) != lowest;
                self.sorted = self.waiting.len() - self.waiting.partition_point(is_higher);
            }
            let size = B::ROUND.clamp(1, self.sorted);
            self.sorted -= size;
            let mut round = self.waiting.split_off(self.waiting.len() - size);
            round.reverse();
            return round;
        }
        self.sorted = 0;
        let size = B::ROUND.clamp(1, self.waiting.len());
        let key = |&item: &u32| (baker.stage(item), baker.rank(item), item);
        let mut keys: Vec<(u32, u64, u32)> = self.waiting.iter().map(key).collect();
        if size < keys.len() {
            keys.select_nth_unstable(size - 1);
        }
        keys[..size].sort_unstable();
        let of_stage = keys[..size].partition_point(|&(stage, ..)| stage == keys[0].0);
        self.waiting.clear();
        self.waiting.extend(keys[of_stage..].iter().map(|&(.., item)| item));
        keys[..of_stage].iter().map(|&(.., item)| item).collect()
    }

    /// Works on all waiting items and returns the final result.
    pub fn run(mut self) -> B::Outcome {
        while self.advance().is_some() {}
        self.finish()
    }

    /// Ends the bake and returns the final result. Items that are still waiting are passed to
    /// [`Baker::finish`].
    pub fn finish(mut self) -> B::Outcome {
        self.waiting.sort_unstable();
        self.baker.finish(&self.waiting)
    }

    /// Returns the state of the bake as bytes in the [binary format](crate::binary_format), for
    /// [`resume`](Self::resume). The bake itself is unchanged.
    pub fn save(&self) -> Vec<u8> {
        let mut state = Writer::new(FORMAT, B::KIND, self.baker.fingerprint());
        state.u64(self.steps);
        state.u32(self.waiting.len() as u32);
        let mut waiting = self.waiting.clone();
        waiting.sort_unstable();
        state.u32s(waiting);
        self.baker.save(&mut state);
        state.finish()
    }

    /// Restores a bake from the bytes of [`save`](Self::save). The resumed bake has the same outcome as an
    /// uninterrupted bake. `baker` must be newly made from the input and settings of the saved bake.
    ///
    /// # Errors
    /// [`FormatError`] if the bytes are damaged or inconsistent, or belong to another baker, another input
    /// or other settings.
    pub fn resume(mut baker: B, bytes: &[u8]) -> Result<Self, FormatError> {
        let mut state = Reader::new(bytes, FORMAT)?;
        state.expect(B::KIND, baker.fingerprint())?;
        let steps = state.u64()?;
        let count = state.u32()? as usize;
        let waiting = state.u32s(count)?;
        let ascending = waiting.windows(2).all(|pair| pair[0] < pair[1]);
        if !ascending || waiting.last().is_some_and(|&last| last as usize >= baker.item_count()) {
            return Err(state.content_error("the items that wait are unknown or out of order"));
        }
        baker.load(&mut state)?;
        state.end()?;
        Ok(Self { baker, waiting, sorted: 0, steps })
    }
}

/// Returns the results of the items of a round, in the order of `round`, computed on this thread. `None` for
/// an item that was not begun because `pause` or `stop` had returned true, and for one for which
/// [`Baker::work`] returned `None`.
#[cfg(not(feature = "rayon"))]
fn work_on_all<B: Baker>(
    baker: &B,
    round: &[u32],
    span: &Span,
    pause: &impl Fn() -> bool,
    stop: &impl Fn() -> bool,
) -> Vec<Option<B::Found>> {
    let mut scratch = B::Scratch::default();
    let mut work = |&item| {
        if stop() || pause() {
            return None;
        }
        span.item(item, || baker.work(item, &mut scratch, stop))
    };
    round.iter().map(&mut work).collect()
}

/// Returns the results of the items of a round, in the order of `round`, computed on all threads of the
/// current pool. `None` for an item that was not begun because `pause` or `stop` had returned true, and for
/// one for which [`Baker::work`] returned `None`. Idle threads take items from the end of the round, where
/// rank and thus expected cost is greatest, so that the last items to run are short.
#[cfg(feature = "rayon")]
fn work_on_all<B: Baker>(
    baker: &B,
    round: &[u32],
    span: &Span,
    pause: &(impl Fn() -> bool + Sync),
    stop: &(impl Fn() -> bool + Sync),
) -> Vec<Option<B::Found>> {
    use core::sync::atomic::{AtomicUsize, Ordering};
    use rayon::prelude::*;
    let taken = AtomicUsize::new(0);
    let work = |_| {
        let (mut scratch, mut found) = (B::Scratch::default(), Vec::new());
        while !stop() && !pause() {
            let next = round.len().checked_sub(1 + taken.fetch_add(1, Ordering::Relaxed));
            let Some(place) = next else { break };
            let of_item = span.item(round[place], || baker.work(round[place], &mut scratch, stop));
            found.extend(of_item.map(|found| (place, found)));
        }
        found
    };
    let threads = 0..rayon::current_num_threads();
    let found: Vec<(usize, B::Found)> = threads.into_par_iter().with_max_len(1).flat_map_iter(work).collect();
    let mut by_place: Vec<Option<B::Found>> = round.iter().map(|_| None).collect();
    found.into_iter().for_each(|(place, found)| by_place[place] = Some(found));
    by_place
}

/// Calls `fill(scratch, row_index, row)` for each row of a table, on all threads of the current pool with
/// feature `rayon`, otherwise on this thread. `scratch` is memory that one thread reuses from row to row; its
/// content must not change the rows.
pub fn fill_rows<T: Send, S: Default>(rows: &mut [T], fill: impl Fn(&mut S, usize, &mut T) + Sync) {
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        let rows = rows.par_iter_mut().enumerate().with_max_len(16);
        rows.for_each_init(S::default, |scratch, (number, row)| fill(scratch, number, row));
    }
    #[cfg(not(feature = "rayon"))]
    {
        let mut scratch = S::default();
        rows.iter_mut().enumerate().for_each(|(number, row)| fill(&mut scratch, number, row));
    }
}
