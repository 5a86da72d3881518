//! Occluders that surround the eye hide what is behind them: corners, courtyards, rooms and boxes.

use std::sync::Arc;
use visibility_bsp::{
    LargeOccludersCuller, Occluders, OcclusionTree, OcclusionTreeCuller, ShadowFrusta, ShadowFrustaCuller,
};
use visibility_core::{OcclusionCuller, Scene};
use visibility_testing::enclosures::assert_most_hidden;

#[test]
fn the_tree_of_large_polygons_has_what_surrounds_the_eye() {
    assert_most_hidden(
        &|scene| Box::new(OcclusionTreeCuller::new(Arc::new(Occluders::new(scene)))),
        9,
        [0.03, 0.01],
    );
}

#[test]
fn the_tree_of_meshes_has_what_surrounds_the_eye() {
    assert_most_hidden(&|_| Box::new(OcclusionCuller::new(OcclusionTree::new())), 9, [0.04, 0.01]);
}

#[test]
fn large_occluders_are_found_around_the_eye() {
    assert_most_hidden(
        &|scene| Box::new(LargeOccludersCuller::new(Arc::new(Occluders::new(scene)))),
        9,
        [0.06, 0.02],
    );
}

/// Regions of eyes are as large as the enclosures. For each region, polygons are chosen from five sample
/// eyes.
#[test]
fn shadow_frusta_are_cast_by_what_surrounds_the_eye() {
    let bake = |scene: &Scene| Arc::new(ShadowFrusta::new(scene, Occluders::new(scene), 64, 16));
    assert_most_hidden(&|scene| Box::new(ShadowFrustaCuller::new(bake(scene))), 7, [0.3, 0.15]);
}
