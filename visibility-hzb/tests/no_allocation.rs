//! Contract 5: no allocation per frame once warm. Counted by an allocator of our own.

#[path = "../../visibility-core/tests/common/allocations.rs"]
mod allocations;
mod common;

use allocations::ALLOCATIONS;
use common::{Random, occluder, view};
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, Occlusion, OcclusionMap};
use visibility_hzb::Hzb;

#[test]
fn a_warm_frame_allocates_nothing_and_gives_the_same_answer() {
    let mut random = Random(5);
    let occluders: Vec<_> = (0..200).map(|_| occluder(&mut random)).collect();
    let views: Vec<_> = (0..8).map(|_| view(&mut random)).collect();
    let boxes: Vec<_> = (0..500)
        .map(|_| {
            let middle = random.vec(-9.0, 9.0);
            Aabb::new(middle - 0.3, middle + 0.3)
        })
        .collect();
    let mut hzb = Hzb::new(320, 180).unwrap();
    let mut frame = |number: usize| {
        hzb.begin(&views[number % views.len()], DVec3::ZERO);
        for (i, o) in occluders.iter().enumerate() {
            hzb.add(&o.mesh, &o.transform);
            if i == 100 {
                hzb.flush();
            }
        }
        hzb.flush();
        boxes.iter().filter(|b| hzb.test(b) == Occlusion::Hidden).count()
    };
    let first: [usize; 8] = std::array::from_fn(&mut frame);
    let before = ALLOCATIONS.get();
    let second: [usize; 8] = std::array::from_fn(&mut frame);
    assert_eq!(ALLOCATIONS.get(), before);
    assert_eq!(first, second);
    assert!(first.iter().sum::<usize>() > 100, "something is hidden: {first:?}");
}
