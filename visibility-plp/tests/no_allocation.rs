//! Test that a warm frame allocates nothing, as counted by a global allocator.

use crate::common::{Blank, triangles, views};
use std::sync::Arc;
use visibility_core::{Culler, FrustumCuller, VisibleSet};
use visibility_plp::{
    Budget, ConservativePlpCuller, DelaunayTessellation, Fineness, OctreeTessellation, PlpCuller,
};
use visibility_testing::allocations::ALLOCATIONS;

/// One frame warms up a culler for all views, even if this first frame sees almost nothing.
#[test]
fn a_warm_culler_allocates_nothing_at_new_views() {
    const FINE: Fineness = Fineness { vertices: 100, halvings: 6 };
    let scene = triangles(20, 3000);
    let octree = Arc::new(OctreeTessellation::from_scene(&scene, FINE));
    let delaunay = Arc::new(DelaunayTessellation::from_scene(&scene, FINE));
    let all = Budget::Objects(usize::MAX);
    let cullers: [Box<dyn Culler>; 7] = [
        Box::new(PlpCuller::new(octree.clone(), Budget::Objects(500)).with_one_sided()),
        Box::new(PlpCuller::new(octree.clone(), Budget::Cost(500)).with_all_kept()),
        Box::new(PlpCuller::new(octree.clone(), all)),
        Box::new(PlpCuller::new(delaunay.clone(), Budget::Objects(500))),
        Box::new(PlpCuller::new(delaunay.clone(), all)),
        Box::new(ConservativePlpCuller::new(octree, Budget::Cost(100), Blank)),
        Box::new(ConservativePlpCuller::new(delaunay, Budget::Cost(100), Blank)),
    ];
    let views = views();
    let mut grown = Vec::new();
    for (number, mut culler) in cullers.into_iter().enumerate() {
        let (mut frustum, mut visible) = (FrustumCuller::new(), VisibleSet::new());
        let mut before = 0;
        // The eighth view (index 7) sees the fewest objects.
        for (frame, view) in views[7..8].iter().chain(&views).enumerate() {
            visible.fill(&scene, view);
            frustum.cull(&scene, view, &mut visible);
            culler.cull(&scene, view, &mut visible);
            if frame == 0 {
                before = ALLOCATIONS.get();
            }
        }
        grown.push((number, ALLOCATIONS.get() - before));
    }
    assert!(grown.iter().all(|&(_, count)| count == 0), "{grown:?}");
}
