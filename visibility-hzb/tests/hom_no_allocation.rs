//! Contract 5 for hierarchical occlusion maps: no allocation per frame once warm, in the driver with each way of choosing occluders.
#![allow(unsafe_code)]

mod common;

use common::{Random, occluder, view};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use visibility_core::{Aabb, Culler, Object, Scene, Selection, VisibleSet};
use visibility_hzb::{DepthEstimate, Hom, HomCuller};

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

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        unsafe { System.realloc(memory, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_warm_frame_allocates_nothing_and_gives_the_same_answer() {
    let mut random = Random(5);
    let mut scene = Scene::new();
    for _ in 0..200 {
        let o = occluder(&mut random);
        let corners = o.mesh.bounds().corners().map(|p| o.transform.transform_point3(p));
        let bounds = Aabb::from_points(corners);
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(o.mesh);
        scene.set_mesh(id, mesh, o.transform).unwrap();
    }
    scene.insert_batch((0..2000).map(|_| {
        let middle = random.vec(-9.0, 9.0);
        Aabb::new(middle - 0.3, middle + 0.3)
    }));
    scene.rebuild();
    let views: Vec<_> = (0..8).map(|_| view(&mut random)).collect();
    for estimate in [DepthEstimate::Plane, DepthEstimate::Buffer, DepthEstimate::NoBackground] {
        for selection in
            [Selection::SolidAngle, Selection::LastVisible, Selection::Nearest, Selection::Interleaved]
        {
            let map = Hom::new(320, 180).unwrap().with_depth_estimate(estimate).with_threshold(0.9);
            let mut culler = HomCuller::new(map).with_selection(selection);
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
            assert_eq!(ALLOCATIONS.get(), before, "{estimate:?}, {selection:?}");
            assert_eq!(first, second, "{estimate:?}, {selection:?}");
            assert!(first.iter().any(|&left| left < 2000), "something is hidden: {first:?}");
        }
    }
}
