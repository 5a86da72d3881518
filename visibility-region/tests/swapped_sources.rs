//! Contract 4 for cullers from viewcells: scenes are swapped, mixed, cloned, changed, reverted and dropped
//! under a live culler, whose answers are those of a culler that has seen no other scene.

use crate::common::PointShadows;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::view::Eye;
use visibility_core::{Accuracy, CullStats, Culler, RegionCuller, Scene, View, VisibleSet};
use visibility_region::{
    ConvexBlockersCuller, ExtendedProjectionCuller, SamplingCuller, ShrunkCuller, VolumetricCuller,
};
use visibility_testing::Random;
use visibility_testing::swapped::{Swapped, hold_against_fresh};

/// A culler from viewcells, asked for the cube of 20 cm around the eye of a view.
struct AroundEye<R>(R);

impl<R: RegionCuller> Culler for AroundEye<R> {
    fn name(&self) -> &str {
        "from a viewcell"
    }

    fn accuracy(&self) -> Accuracy {
        self.0.accuracy()
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let Eye::Point(eye) = view.eye(DVec3::ZERO) else { panic!("the views of this test have an eye") };
        self.0.cull(scene, &Viewcell::from_box(eye - 0.1, eye + 0.1), visible)
    }
}

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

/// Swaps scenes at random under live cullers for two seeds, and asserts that enough objects were hidden for
/// the test to mean anything.
fn hold<R: RegionCuller>(make: fn() -> R, frames: usize) {
    let hidden: usize = (0..2).map(|seed| hold_against_fresh(&Cullers(make), seed, frames)).sum();
    assert!(hidden > frames, "{hidden} objects are no test");
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
fn volumetric() {
    // Half a second for each octree.
    hold(VolumetricCuller::new, 2);
}

#[test]
fn shrunk() {
    hold(|| ShrunkCuller::new(PointShadows, 1), 100);
}

#[test]
fn sampling() {
    hold(|| SamplingCuller::new().with_rays(2000), 100);
}
