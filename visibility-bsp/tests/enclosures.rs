//! Occluders that surround the eye hide what is behind them: corners, courtyards, rooms and boxes.

use std::sync::Arc;
use visibility_bsp::{
    LargeOccludersCuller, Occluders, OcclusionTree, OcclusionTreeCuller, ShadowFrusta, ShadowFrustaCuller,
};
use visibility_core::{Culler, OcclusionCuller, Scene};
use visibility_testing::enclosures::enclosures;

/// Asserts, for each enclosure, that of the objects whose sampled points are all blocked no more than the
/// share `most` is kept, and no more than `most_far` if only those beyond 1 m from the enclosure count.
fn check(make: &dyn Fn(&Scene) -> Box<dyn Culler + Send + Sync>, count: usize, [most, most_far]: [f64; 2]) {
    for (enclosure, seed) in enclosures().iter().zip(0..).take(count) {
        let counts = enclosure.count(seed, 90, make);
        println!("{}, two-sided {}: {counts:?}", enclosure.name, enclosure.two_sided);
        assert!(counts.blocked > 500, "{}: {counts:?}", enclosure.name);
        let of_blocked = |share: f64| share * counts.blocked as f64;
        assert!(counts.kept as f64 <= of_blocked(most), "{}: {counts:?}", enclosure.name);
        assert!(counts.kept_far as f64 <= of_blocked(most_far), "{}: {counts:?}", enclosure.name);
    }
}

#[test]
fn the_tree_of_large_polygons_has_what_surrounds_the_eye() {
    check(&|scene| Box::new(OcclusionTreeCuller::new(Arc::new(Occluders::new(scene)))), 9, [0.03, 0.01]);
}

#[test]
fn the_tree_of_meshes_has_what_surrounds_the_eye() {
    check(&|_| Box::new(OcclusionCuller::new(OcclusionTree::new())), 9, [0.04, 0.01]);
}

#[test]
fn large_occluders_are_found_around_the_eye() {
    check(&|scene| Box::new(LargeOccludersCuller::new(Arc::new(Occluders::new(scene)))), 9, [0.06, 0.02]);
}

/// Regions of eyes are as large as the enclosures, and their polygons are chosen from five eyes each.
#[test]
fn shadow_frusta_are_cast_by_what_surrounds_the_eye() {
    let bake = |scene: &Scene| Arc::new(ShadowFrusta::new(scene, Occluders::new(scene), 64, 16));
    check(&|scene| Box::new(ShadowFrustaCuller::new(bake(scene))), 7, [0.3, 0.15]);
}
