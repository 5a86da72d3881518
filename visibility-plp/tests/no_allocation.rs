//! No allocation per frame once warm, counted by an allocator of our own.
#![allow(missing_docs)]

#[path = "../../visibility-core/tests/common/allocations.rs"]
mod allocations;
mod common;

use allocations::ALLOCATIONS;
use common::{Blank, triangles, views};
use std::sync::Arc;
use visibility_core::{Culler, FrustumCuller, VisibleSet};
use visibility_plp::{Budget, ConservativePlpCuller, DelaunayTessellation, OctreeTessellation, PlpCuller};

#[test]
fn warm_frames_allocate_nothing() {
    let scene = triangles(20, 3000);
    let octree = Arc::new(OctreeTessellation::new(&scene));
    let delaunay = Arc::new(DelaunayTessellation::new(&scene));
    let cullers: [Box<dyn Culler>; 4] = [
        Box::new(PlpCuller::new(octree.clone(), Budget::Objects(500)).with_one_sided(true)),
        Box::new(PlpCuller::new(octree.clone(), Budget::Cost(500)).with_all_kept(true)),
        Box::new(PlpCuller::new(delaunay, Budget::Objects(500))),
        Box::new(ConservativePlpCuller::new(octree, Budget::Cost(100), Blank)),
    ];
    let views = views();
    for (number, mut culler) in cullers.into_iter().enumerate() {
        let (mut frustum, mut visible) = (FrustumCuller::new(), VisibleSet::new());
        let mut before = 0;
        for pass in 0..3 {
            for view in &views {
                visible.fill(&scene, view);
                frustum.cull(&scene, view, &mut visible);
                culler.cull(&scene, view, &mut visible);
            }
            if pass == 0 {
                before = ALLOCATIONS.get();
            }
        }
        assert_eq!(ALLOCATIONS.get() - before, 0, "culler {number}");
    }
}
