//! Contract 4 for the z-buffer and occlusion maps: scenes swapped, mixed, cloned, reverted and dropped under
//! a live culler, against one that has seen no other.

use visibility_core::{OcclusionCuller, OcclusionMap, Scene};
use visibility_hzb::{Hom, Hzb};
use visibility_testing::Random;
use visibility_testing::swapped::{Swapped, hold_against_fresh};

/// The driver over a map that `0` makes.
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

fn hold<M: OcclusionMap>(make: fn() -> M) {
    let hidden: usize = (0..4).map(|seed| hold_against_fresh(&Maps(make), seed, 250)).sum();
    assert!(hidden > 250, "{hidden} objects are no test");
}

#[test]
fn z_buffer() {
    hold(|| Hzb::new(64, 48).expect("a size that is allowed"));
}

#[test]
fn occlusion_maps() {
    hold(Hom::default);
}
