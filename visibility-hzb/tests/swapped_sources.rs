//! Contract 4 for the z-buffer and occlusion maps: scenes are swapped, mixed, cloned, reverted and dropped
//! under a live culler, whose answers are compared with those of a culler that has seen no other scene.

use visibility_core::{OcclusionCuller, OcclusionMap, Scene};
use visibility_hzb::{Hom, Hzb};
use visibility_testing::swapped::{Swapped, hold_against_fresh};
use visibility_testing::{Random, judged, told_enough};

/// Test subject: an occlusion culler over a map that the contained function creates.
struct Maps<M>(fn() -> M);

impl<M: OcclusionMap> Swapped for Maps<M> {
    type Culler = OcclusionCuller<M>;
    type Source = ();

    fn derive(&self, _: &Scene, _: &mut Random) {}

    fn make(&self, (): &()) -> Self::Culler {
        OcclusionCuller::new((self.0)())
    }

    fn give(&self, _: &mut Self::Culler, (): &(), _: &Scene) {}
}

/// Swaps scenes at random under live cullers for four seeds of 250 frames, and asserts that enough objects
/// were hidden for the test to mean anything.
fn hold<M: OcclusionMap>(make: fn() -> M) {
    let hidden: usize = (0..4).map(|seed| hold_against_fresh(&Maps(make), seed, 250)).sum();
    judged(hidden as u64);
    told_enough(hidden > 250, format_args!("{hidden} objects are no test"));
}

#[test]
fn z_buffer() {
    hold(|| Hzb::new(64, 48).expect("a size that is allowed"));
}

#[test]
fn occlusion_maps() {
    hold(Hom::default);
}
