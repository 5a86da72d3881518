//! Contract 5: no allocation per frame once warm. Counted by an allocator of our own.
#![allow(unsafe_code)]

mod common;

use common::{Random, occluder, view};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, Occlusion, OcclusionMap};
use visibility_hzb::Hzb;

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
