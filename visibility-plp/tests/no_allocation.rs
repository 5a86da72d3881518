//! No allocation per frame once warm, counted by an allocator of our own.
#![allow(unsafe_code, missing_docs)]

mod common;

use common::{Blank, triangles, views};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;
use visibility_core::{Culler, FrustumCuller, VisibleSet};
use visibility_plp::{Budget, ConservativePlpCuller, DelaunayTessellation, OctreeTessellation, PlpCuller};

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: all is left to the system's allocator; counting neither allocates nor touches the memory.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

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
