//! Objects that a segment sees through slots between screens are not hidden.
//!
//! `cargo test -p visibility-region slots -- --ignored --nocapture` makes a million trials of the sweep.

use visibility_core::{Accuracy, RegionCuller};
#[cfg(feature = "papers")]
use visibility_region::VolumetricCuller;
use visibility_region::{ConvexBlockersCuller, ExtendedProjectionCuller};
use visibility_testing::{SlotScene, SlotSearch};

/// Makes trials, and fails if the culler hides a target that a segment sees.
fn search(culler: &mut dyn RegionCuller, first: usize, trials: usize) -> SlotSearch {
    assert_eq!(culler.accuracy(), Accuracy::Conservative, "the culler is conservative");
    let search = SlotScene::search(culler, 1, first, trials);
    assert!(search.wrong.is_empty(), "targets of scenes {:?} are seen and hidden", search.wrong);
    search
}

#[test]
fn sweeps_hide_nothing_that_is_seen_through_a_slot() {
    let found = search(&mut ExtendedProjectionCuller::new(), 0, 2000);
    assert!(found.seen > 1000 && found.hidden > 20, "{found:?}");
}

#[test]
fn solids_hide_nothing_that_is_seen_through_a_slot() {
    let found = search(&mut ConvexBlockersCuller::new(), 0, 300);
    assert!(found.seen > 200 && found.hidden > 0, "{found:?}");
}

#[test]
#[cfg(feature = "papers")]
fn octrees_hide_nothing_that_is_seen_through_a_slot() {
    let found = search(&mut VolumetricCuller::new(), 0, 30);
    assert!(found.seen > 20, "{found:?}");
}

/// Makes trials and prints the results. The variables `SLOT_TRIALS` and `SLOT_FIRST` of the environment set
/// their number and the first of them.
fn search_long(culler: &mut dyn RegionCuller, trials: usize) {
    let number = |name: &str, other: usize| {
        std::env::var(name).ok().and_then(|value| value.parse().ok()).unwrap_or(other)
    };
    let (start, trials) = (number("SLOT_FIRST", 0), number("SLOT_TRIALS", trials));
    let mut sum = SlotSearch::default();
    for first in (start..start + trials).step_by(1000) {
        let found = SlotScene::search(culler, 1, first, 1000);
        sum.seen += found.seen;
        sum.closed += found.closed;
        sum.hidden += found.hidden;
        sum.wrong.extend(found.wrong);
        println!("up to scene {}: {sum:?}", first + 1000);
    }
    assert!(sum.wrong.is_empty(), "{sum:?}");
}

#[test]
#[ignore = "an hour"]
fn sweeps_hide_nothing_in_a_million_scenes_of_slots() {
    search_long(&mut ExtendedProjectionCuller::new(), 1_000_000);
}

#[test]
#[ignore = "an hour"]
fn solids_hide_nothing_in_many_scenes_of_slots() {
    search_long(&mut ConvexBlockersCuller::new(), 20_000);
    #[cfg(feature = "papers")]
    search_long(&mut VolumetricCuller::new(), 10_000);
}
