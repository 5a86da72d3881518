//! Contract 5 for hierarchical occlusion maps: no allocation per frame once warm, in the driver with each
//! selection of occluders.

use crate::common::{scene, view};
use visibility_core::{Culler, VisibleSet};
use visibility_hzb::{DepthEstimate, Hom, HomCuller};
use visibility_testing::Random;
use visibility_testing::allocations::ALLOCATIONS;

#[test]
fn a_warm_frame_allocates_nothing_and_gives_the_same_answer() {
    let mut random = Random(5);
    let scene = scene(&mut random, 200);
    let views: Vec<_> = (0..8).map(|_| view(&mut random)).collect();
    for estimate in [DepthEstimate::Plane, DepthEstimate::Buffer, DepthEstimate::NoBackground] {
        let map = Hom::new(320, 180).unwrap().with_depth_estimate(estimate).with_threshold(0.9);
        let mut culler = HomCuller::new(map);
        let mut set = VisibleSet::new();
        let mut frame = |number: usize| {
            if number == 0 {
                culler.reset();
            }
            set.fill(&scene, &views[number]);
            culler.cull(&scene, &views[number], &mut set);
            set.count(&scene)
        };
        let first: [usize; 8] = std::array::from_fn(&mut frame);
        let before = ALLOCATIONS.get();
        let second: [usize; 8] = std::array::from_fn(&mut frame);
        assert_eq!(ALLOCATIONS.get(), before, "{estimate:?}");
        assert_eq!(first, second, "{estimate:?}");
        assert!(first.iter().any(|&left| left < 2000), "something is hidden: {first:?}");
    }
}
