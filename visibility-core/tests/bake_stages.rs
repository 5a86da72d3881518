//! Tests of bakes in stages: an item is worked on when all items of lower stages are done, also where a bake
//! is paused, stopped or resumed.

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use visibility_core::bake::{Bake, Baker};
use visibility_core::binary_format::{Format, FormatError, Reader, Writer};

/// A baker of sums: the result of an item is its own number plus the sum of the results of the stage before.
#[derive(Clone)]
struct Sums {
    done: Vec<Option<u32>>,
    order: Vec<u32>,
    is_order_fixed: bool,
    /// Whether some items are left undone until 20 items are done.
    is_late: bool,
}

impl Sums {
    fn new(is_order_fixed: bool) -> Self {
        Self { done: vec![None; 100], order: Vec::new(), is_order_fixed, is_late: false }
    }

    fn of_stage(&self, stage: u32) -> impl Iterator<Item = Option<u32>> {
        (0..100).filter(move |&item| self.stage(item) == stage).map(|item| self.done[item as usize])
    }
}

impl Baker for Sums {
    type Scratch = ();
    type Found = u32;
    type Outcome = Vec<u32>;
    const ROUND: usize = 16;

    fn item_count(&self) -> usize {
        100
    }

    fn rank(&self, item: u32) -> u64 {
        100 - u64::from(item)
    }

    fn stage(&self, item: u32) -> u32 {
        item % 3
    }

    fn is_order_fixed(&self) -> bool {
        self.is_order_fixed
    }

    fn work(&self, item: u32, (): &mut (), _: &dyn Fn() -> bool) -> Option<u32> {
        if self.is_late && item % 7 == 2 && self.order.len() < 20 {
            return None;
        }
        let before = self.stage(item).checked_sub(1);
        let sum = before.map_or(0, |stage| {
            let all: Option<Vec<u32>> = self.of_stage(stage).collect();
            all.expect("the stage before is done").iter().fold(0, |sum: u32, &x| sum.wrapping_add(x))
        });
        Some(sum.wrapping_add(item))
    }

    fn take_in(&mut self, item: u32, found: u32) -> u64 {
        self.done[item as usize] = Some(found);
        self.order.push(item);
        1
    }

    fn finish(self, waiting: &[u32]) -> Vec<u32> {
        assert_eq!(waiting, [], "items that wait after the last stage");
        self.done.into_iter().map(Option::unwrap).collect()
    }

    fn fingerprint(&self) -> u64 {
        7
    }

    fn save(&self, state: &mut Writer) {
        state.u32s(self.done.iter().map(|done| done.unwrap_or(u32::MAX)));
    }

    fn load(&mut self, state: &mut Reader<'_>) -> Result<(), FormatError> {
        self.done = state.u32s(100)?.into_iter().map(|x| (x < u32::MAX).then_some(x)).collect();
        Ok(())
    }
}

#[test]
fn stages_follow_one_another_each_in_the_order_of_ranks() {
    let whole = Bake::new(Sums::new(false)).run();
    for is_order_fixed in [false, true] {
        let mut bake = Bake::new(Sums::new(is_order_fixed));
        let mut rounds = 0;
        while bake.advance().is_some() {
            rounds += 1;
        }
        let key = |&item: &u32| (item % 3, 100 - item);
        let order = &bake.baker().order;
        assert!(order.len() == 100 && order.is_sorted_by_key(key), "{is_order_fixed}: {order:?}");
        assert_eq!(rounds, 9, "{is_order_fixed}: rounds of 16 items of stages of 34, 33 and 33");
        assert_eq!(bake.finish(), whole, "{is_order_fixed}: a bake has the same rows either way");
        for is_resumed in [false, true] {
            let mut bake = Bake::new(Sums::new(is_order_fixed));
            for number in 0..200 {
                // Stops each round after a few items.
                let begun = AtomicUsize::new(0);
                bake.advance_unless(|| begun.fetch_add(1, Relaxed) > number % 5, || false);
                if is_resumed {
                    bake = Bake::resume(Sums::new(is_order_fixed), &bake.save()).unwrap();
                }
            }
            let name = format!("fixed {is_order_fixed}, resumed {is_resumed}");
            assert_eq!(bake.finish(), whole, "{name}: a bake that was stopped 200 times has the same rows");
        }
    }
}

#[test]
fn items_that_were_left_undone_come_first_whether_or_not_the_order_is_fixed() {
    let orders = [false, true].map(|is_order_fixed| {
        let mut bake = Bake::new(Sums { is_late: true, ..Sums::new(is_order_fixed) });
        while bake.advance().is_some() {}
        bake.baker().order.clone()
    });
    assert_eq!(orders[0].len(), 100, "all items are done in the end");
    assert!(!orders[0].is_sorted_by_key(|item| (item % 3, 100 - item)), "some items are done late");
    assert_eq!(orders[0], orders[1], "the order with and without a fixed one");
}

#[test]
fn no_item_is_begun_after_a_pause_or_a_stop() {
    for is_order_fixed in [false, true] {
        let mut bake = Bake::new(Sums::new(is_order_fixed));
        for (pauses, stops) in [(true, false), (false, true), (true, true)] {
            bake.advance_unless(|| pauses, || stops);
            assert_eq!(bake.progress().done, 0, "items done, pause {pauses}, stop {stops}");
        }
        bake.advance_unless(|| false, || false);
        assert_eq!(bake.progress().done, 16, "items done in a round without a pause or a stop");
    }
}

#[test]
fn a_state_whose_waiting_items_make_no_sense_is_refused() {
    const FORMAT: Format = Format { magic: *b"VISIBAKE", version: 4 };
    let resumed = |waiting: &[u32]| {
        let mut state = Writer::new(FORMAT, 0, 7);
        state.u64(0);
        state.u32(waiting.len() as u32);
        state.u32s(waiting.iter().copied());
        Sums::new(false).save(&mut state);
        Bake::resume(Sums::new(false), &state.finish()).map(|bake| bake.progress().done)
    };
    for (waiting, done) in [(&[][..], 100), (&[0], 99), (&[3, 4, 99], 97)] {
        assert_eq!(resumed(waiting), Ok(done), "items done where {waiting:?} wait");
    }
    for waiting in [&[100][..], &[3, 100], &[3, 3], &[4, 3], &[u32::MAX]] {
        let problem = "the items that wait are unknown or out of order";
        let is_refused =
            |error| matches!(error, FormatError::Content { problem: said, .. } if said == problem);
        assert!(resumed(waiting).is_err_and(is_refused), "{waiting:?} wait");
    }
}
