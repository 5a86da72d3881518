//! Objects that a segment sees through slots between screens are not hidden.

use visibility_core::{Accuracy, RegionCuller};
#[cfg(feature = "papers")]
use visibility_region::VolumetricCuller;
use visibility_region::{ConvexBlockersCuller, ExtendedProjectionCuller};
use visibility_testing::{SlotScene, SlotSearch, judged, told_enough};

/// Makes trials, and fails if the culler hides a target that a segment sees.
fn search(culler: &mut dyn RegionCuller, trials: usize) -> SlotSearch {
    assert_eq!(culler.accuracy(), Accuracy::Conservative, "the culler is conservative");
    let search = SlotScene::search(culler, 1, trials);
    assert!(search.wrong.is_empty(), "targets of scenes {:?} are seen and hidden", search.wrong);
    judged(search.seen as u64);
    search
}

#[test]
fn sweeps_hide_nothing_that_is_seen_through_a_slot() {
    let found = search(&mut ExtendedProjectionCuller::new(), 2000);
    told_enough(found.seen > 1000 && found.hidden > 20, format_args!("{found:?}"));
}

#[test]
fn solids_hide_nothing_that_is_seen_through_a_slot() {
    let found = search(&mut ConvexBlockersCuller::new(), 300);
    told_enough(found.seen > 200 && found.hidden > 0, format_args!("{found:?}"));
}

#[test]
#[cfg(feature = "papers")]
fn octrees_hide_nothing_that_is_seen_through_a_slot() {
    let found = search(&mut VolumetricCuller::new(), 30);
    told_enough(found.seen > 20, format_args!("{found:?}"));
}
