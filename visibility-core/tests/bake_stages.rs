//! Tests of bakes in stages: an item is worked on when all items of lower stages are done, also where a bake
//! is paused, stopped or resumed.

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use visibility_core::bake::{Bake, Baker};
use visibility_core::binary_format::{FormatError, Reader, Writer};

/// A baker of sums: the result of an item is its own number plus the sum of the results of the stage before.
#[derive(Clone)]
struct Sums {
    done: Vec<Option<u32>>,
    order: Vec<u32>,
}

impl Sums {
    fn new() -> Self {
        Self { done: vec![None; 100], order: Vec::new() }
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

    fn work(&self, item: u32, (): &mut (), _: &dyn Fn() -> bool) -> Option<u32> {
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
    let mut bake = Bake::new(Sums::new());
    while bake.advance().is_some() {}
    let ascending = |pair: &[u32]| {
        let key = |item| (item % 3, 100 - item);
        key(pair[0]) < key(pair[1])
    };
    assert!(
        bake.baker().order.len() == 100 && bake.baker().order.windows(2).all(ascending),
        "items by their rank within each round: {:?}",
        bake.baker().order
    );
    let whole = bake.finish();
    assert_eq!(whole, Bake::new(Sums::new()).run(), "a bake in one run has the same rows");
    let mut bake = Bake::new(Sums::new());
    for number in 0..200 {
        // Stops each round after a few items.
        let begun = AtomicUsize::new(0);
        bake.advance_unless(|| begun.fetch_add(1, Relaxed) > number % 5, || false);
        bake = Bake::resume(Sums::new(), &bake.save()).unwrap();
    }
    assert_eq!(bake.finish(), whole, "a bake that was saved and resumed 200 times has the same rows");
}
