//! Contract 5: no allocation per frame once warm. A global allocator counts the allocations.

use crate::common::{occluder, scene, view};
use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, Culler, FrustumCuller, OcclusionCuller, OcclusionMap, VisibleSet, occlusion::Occlusion,
};
use visibility_hzb::{Hom, Hzb};
use visibility_testing::Random;
use visibility_testing::allocations::ALLOCATIONS;

#[test]
fn a_warm_frame_allocates_nothing_and_gives_the_same_answer() {
    let mut random = Random(5);
    let occluders: Vec<_> = (0..200).map(|_| occluder(&mut random)).collect();
    let views: Vec<_> = (0..8).map(|_| view(&mut random)).collect();
    let boxes: Vec<_> = (0..500)
        .map(|_| {
            let middle = random.vec3(-9.0, 9.0);
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
    assert_eq!(ALLOCATIONS.get(), before, "allocations in 8 warm frames");
    assert_eq!(first, second, "boxes hidden in cold and warm frames");
    assert!(first.iter().sum::<usize>() > 100, "something is hidden: {first:?}");
}

/// Returns the number of allocations of a culler over `map` in 40 new views, after 8 others that warm it up.
fn allocations_at_new_views(map: impl OcclusionMap + Clone) -> usize {
    let mut random = Random(6);
    let scene = scene(&mut random, 300);
    let (mut frustum, mut culler) = (FrustumCuller::new(), OcclusionCuller::new(map));
    let mut set = VisibleSet::new();
    let mut hidden = 0;
    let mut before = 0;
    for number in 0..48 {
        if number == 8 {
            before = ALLOCATIONS.get();
        }
        let view = view(&mut random);
        set.fill(&scene, &view);
        frustum.cull(&scene, &view, &mut set);
        let candidates = set.count(&scene);
        culler.cull(&scene, &view, &mut set);
        hidden += candidates - set.count(&scene);
    }
    assert!(hidden > 1000, "something is hidden: {hidden}");
    ALLOCATIONS.get() - before
}

#[test]
fn views_that_are_new_allocate_nothing() {
    assert_eq!(allocations_at_new_views(Hzb::new(320, 180).unwrap()), 0, "hzb");
    assert_eq!(allocations_at_new_views(Hom::new(320, 180).unwrap()), 0, "hom");
}
