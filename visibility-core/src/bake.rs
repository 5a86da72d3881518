//! Bakes: long computations over many items, in rounds, that report progress, can be stopped, saved and
//! resumed, and give the same answer on any number of threads.
//!
//! A [`Baker`] is the algorithm: it says what one item comes to, and takes in what was found. A [`Bake`] runs
//! it. Within a round the items know nothing of one another, so they can be worked on by any number of
//! threads (feature `rayon`: all threads of the current pool; otherwise one). At the end of the round what
//! was found is taken in, in a fixed order; so the answer depends on the size of a round, never on threads.
//!
//! ```
//! use visibility_core::bake::{Bake, Baker};
//! use visibility_core::envelope::{EnvelopeError, Reader, Writer};
//! /// Counts the divisors of the numbers from 1 on.
//! struct Divisors(Vec<u32>);
//! impl Baker for Divisors {
//!     type Scratch = ();
//!     type Found = u32;
//!     type Outcome = Vec<u32>;
//!     fn item_count(&self) -> usize { self.0.len() }
//!     fn work(&self, item: u32, _: &mut ()) -> u32 {
//!         (1..=item + 1).filter(|divisor| (item + 1) % divisor == 0).count() as u32
//!     }
//!     fn take_in(&mut self, item: u32, found: u32) -> u64 {
//!         self.0[item as usize] = found;
//!         u64::from(item) + 1
//!     }
//!     // A number that was not looked at counts as one with all divisors.
//!     fn finish(mut self, waiting: &[u32]) -> Vec<u32> {
//!         for &item in waiting { self.0[item as usize] = item + 1 }
//!         self.0
//!     }
//!     fn fingerprint(&self) -> u64 { self.0.len() as u64 }
//!     fn save(&self, state: &mut Writer) { state.u32s(self.0.iter().copied()) }
//!     fn load(&mut self, state: &mut Reader<'_>) -> Result<(), EnvelopeError> {
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
//! # Ok::<(), EnvelopeError>(())
//! ```

use crate::envelope::{EnvelopeError, Format, Reader, Writer};
use alloc::vec::Vec;

/// Saved bakes. Versions 1 and 2 were forms of cell-to-cell bakes alone.
const FORMAT: Format = Format { magic: *b"VISIBAKE", version: 3 };

/// How far a bake is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Progress {
    /// Items that are done.
    pub done: usize,
    /// All items.
    pub total: usize,
    /// Sum of what the items have cost so far, in steps of the baker's own; at most `u64::MAX`.
    pub steps: u64,
}

/// An algorithm that a [`Bake`] runs.
pub trait Baker: Sync {
    /// Memory for one thread, which serves one item after another. Must not change what is found.
    type Scratch: Default;
    /// What one item comes to.
    type Found: Send;
    /// The answer.
    type Outcome;

    /// The most items of one round. A round of more items keeps more threads busy; its items know less of one
    /// another.
    const ROUND: usize = 48;
    /// The kind in the [header](crate::envelope) of saved bakes, which tells bakers apart.
    const KIND: u32 = 0;

    /// How many items there are, numbered from 0; less than `u32::MAX`.
    fn item_count(&self) -> usize;

    /// How much an item will cost, or another reason to look at it late. Each round takes the waiting items
    /// of the least rank; of equal ones, those of the least number. Asked anew before each round.
    fn rank(&self, item: u32) -> u64 {
        item.into()
    }

    /// Works on one item, by what was known before the round.
    fn work(&self, item: u32, scratch: &mut Self::Scratch) -> Self::Found;

    /// Takes in what an item has come to. Called at the end of a round, in ascending order of ranks. Returns
    /// what the item has cost, in steps.
    fn take_in(&mut self, item: u32, found: Self::Found) -> u64;

    /// The answer. `waiting` lists the items that were not worked on, ascending: a conservative baker counts
    /// as visible all that they might have found.
    fn finish(self, waiting: &[u32]) -> Self::Outcome;

    /// A hash of all that decides the answer: input and settings. See
    /// [`Fingerprint`](crate::envelope::Fingerprint).
    fn fingerprint(&self) -> u64;

    /// Writes what was taken in so far, for [`load`](Self::load).
    fn save(&self, state: &mut Writer);

    /// Reads what was [saved](Self::save) by a baker with the same fingerprint, in place of what this one has
    /// taken in.
    ///
    /// # Errors
    /// If the state makes no sense. Bytes may be forged: no number in them is to be trusted.
    fn load(&mut self, state: &mut Reader<'_>) -> Result<(), EnvelopeError>;
}

/// A [`Baker`] at work: moved on by [`advance`](Self::advance) as long as one likes, ended by
/// [`finish`](Self::finish).
#[derive(Clone, Debug)]
pub struct Bake<B> {
    baker: B,
    /// Items that are still to be worked on, in any order.
    waiting: Vec<u32>,
    steps: u64,
}

impl<B: Baker> Bake<B> {
    /// A bake of which nothing is done.
    pub fn new(baker: B) -> Self {
        let waiting = (0..baker.item_count() as u32).collect();
        Self { baker, waiting, steps: 0 }
    }

    /// The algorithm, with what it has taken in.
    pub fn baker(&self) -> &B {
        &self.baker
    }

    /// How far the bake is.
    pub fn progress(&self) -> Progress {
        let total = self.baker.item_count();
        Progress { done: total.saturating_sub(self.waiting.len()), total, steps: self.steps }
    }

    /// Works on the items of the next round. `None` when all were done before.
    pub fn advance(&mut self) -> Option<Progress> {
        if self.waiting.is_empty() {
            return None;
        }
        let round = self.next_round();
        let found = work_on_all(&self.baker, &round);
        for (&item, found) in round.iter().zip(found) {
            self.steps = self.steps.saturating_add(self.baker.take_in(item, found));
        }
        Some(self.progress())
    }

    /// Takes the items of least rank out of those that wait, ascending by rank.
    fn next_round(&mut self) -> Vec<u32> {
        let size = B::ROUND.clamp(1, self.waiting.len());
        let key = |&item: &u32| (self.baker.rank(item), item);
        if size < self.waiting.len() {
            self.waiting.select_nth_unstable_by_key(size - 1, key);
        }
        let mut round: Vec<u32> = self.waiting.drain(..size).collect();
        round.sort_unstable_by_key(key);
        round
    }

    /// Works on all items that are left and gives the answer.
    pub fn run(mut self) -> B::Outcome {
        while self.advance().is_some() {}
        self.finish()
    }

    /// Ends the bake, whether or not all items are done.
    pub fn finish(mut self) -> B::Outcome {
        self.waiting.sort_unstable();
        self.baker.finish(&self.waiting)
    }

    /// The state of the bake as bytes in an [envelope](crate::envelope), for [`resume`](Self::resume).
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

    /// Goes on with a bake that was [saved](Self::save): gives the same answer as one that was never
    /// interrupted. `baker` must be as new, from the same input and with the same settings.
    ///
    /// # Errors
    /// [`EnvelopeError`] if the bytes are damaged, or of another baker, of another input or of other
    /// settings.
    pub fn resume(mut baker: B, bytes: &[u8]) -> Result<Self, EnvelopeError> {
        let mut state = Reader::new(bytes, FORMAT)?;
        state.expect(B::KIND, baker.fingerprint())?;
        let steps = state.u64()?;
        let count = state.u32()? as usize;
        let waiting = state.u32s(count)?;
        let ascending = waiting.windows(2).all(|pair| pair[0] < pair[1]);
        if !ascending || waiting.last().is_some_and(|&last| last as usize >= baker.item_count()) {
            return Err(state.wrong("the items that wait are unknown or out of order"));
        }
        baker.load(&mut state)?;
        state.end()?;
        Ok(Self { baker, waiting, steps })
    }
}

/// What each item of a round comes to, in their order.
#[cfg(not(feature = "rayon"))]
fn work_on_all<B: Baker>(baker: &B, round: &[u32]) -> Vec<B::Found> {
    let mut scratch = B::Scratch::default();
    round.iter().map(|&item| baker.work(item, &mut scratch)).collect()
}

/// What each item of a round comes to, in their order. Each thread takes the next item when it is done with
/// one, the last of the round first: those are ranked to cost most, and no thread should be left with a long
/// one at the end.
#[cfg(feature = "rayon")]
fn work_on_all<B: Baker>(baker: &B, round: &[u32]) -> Vec<B::Found> {
    use core::sync::atomic::{AtomicUsize, Ordering};
    use rayon::prelude::*;
    let taken = AtomicUsize::new(0);
    let work = |_| {
        let (mut scratch, mut found) = (B::Scratch::default(), Vec::new());
        while let Some(place) = round.len().checked_sub(1 + taken.fetch_add(1, Ordering::Relaxed)) {
            found.push((place, baker.work(round[place], &mut scratch)));
        }
        found
    };
    let threads = 0..rayon::current_num_threads();
    let mut found: Vec<(usize, B::Found)> =
        threads.into_par_iter().with_max_len(1).flat_map_iter(work).collect();
    found.sort_unstable_by_key(|&(place, _)| place);
    found.into_iter().map(|(_, found)| found).collect()
}

/// Calls `fill` with each row of a table and its number, on all threads: `table` is cut into rows of `width`
/// numbers, at least 1, the last of which may be shorter. `scratch` is memory for one thread, which must not
/// change what is filled in.
pub fn fill_rows<T: Send, S: Default>(
    table: &mut [T],
    width: usize,
    fill: impl Fn(&mut S, usize, &mut [T]) + Sync,
) {
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        let rows = table.par_chunks_mut(width.max(1)).enumerate().with_max_len(16);
        rows.for_each_init(S::default, |scratch, (number, row)| fill(scratch, number, row));
    }
    #[cfg(not(feature = "rayon"))]
    {
        let mut scratch = S::default();
        table.chunks_mut(width.max(1)).enumerate().for_each(|(number, row)| fill(&mut scratch, number, row));
    }
}
