//! Cullers from viewcells never hide a visible object by memory of an earlier scene (contract 4): scenes are
//! swapped, mixed, cloned, changed, reverted and dropped under a live culler. Its answers equal those of a
//! culler that has seen no other scene.

#[cfg(feature = "papers")]
use crate::common::PointShadows;
use visibility_core::{RegionCuller, Scene};
use visibility_region::{ConvexBlockersCuller, ExtendedProjectionCuller, SamplingCuller};
#[cfg(feature = "papers")]
use visibility_region::{ShrunkCuller, VolumetricCuller};
use visibility_testing::swapped::{AroundEye, Swapped, hold_against_fresh};
use visibility_testing::{Random, judged, told_enough};

struct Cullers<R>(fn() -> R);

impl<R: RegionCuller> Swapped for Cullers<R> {
    type Culler = AroundEye<R>;
    type Source = ();

    fn derive(&self, _: &Scene, _: &mut Random) {}

    fn make(&self, (): &()) -> Self::Culler {
        AroundEye((self.0)())
    }

    fn give(&self, _: &mut Self::Culler, (): &(), _: &Scene) {}
}

/// Swaps scenes at random under live cullers, for two seeds. Asserts that enough objects were hidden for the
/// test to be meaningful.
fn hold<R: RegionCuller>(make: fn() -> R, frames: usize) {
    let hidden: usize = (0..2).map(|seed| hold_against_fresh(&Cullers(make), seed, frames)).sum();
    judged(hidden as u64);
    told_enough(hidden > frames, format_args!("{hidden} objects are no test"));
}

#[test]
fn extended_projections() {
    hold(ExtendedProjectionCuller::new, 100);
}

#[test]
fn convex_blockers() {
    hold(ConvexBlockersCuller::new, 200);
}

#[test]
#[cfg(feature = "papers")]
fn volumetric() {
    // Few frames, since each octree takes half a second.
    hold(VolumetricCuller::new, 2);
}

#[test]
#[cfg(feature = "papers")]
fn shrunk() {
    hold(|| ShrunkCuller::new(PointShadows, 1), 100);
}

#[test]
fn sampling() {
    hold(|| SamplingCuller::new().with_rays(2000), 100);
}
