//! No allocation once warm: frames through portals and mirrors, doors that open and close, objects that move. Counted by an allocator of our
//! own.
#![allow(unsafe_code)]

mod maze;

use maze::{Camera, Maze, Random, Style};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use visibility_core::{Aabb, Culler, FrustumCuller, PortalId, VisibleSet};
use visibility_portals::{Narrowing, PortalEye};

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
fn frames_doors_and_moving_objects_allocate_nothing_once_warm() {
    let mut random = Random(21);
    let style = Style { turned: true, slivers: false, mirrors: true, shift: 10.0, tolerance: 1e-9 };
    let mut maze = Maze::new(&mut random, [10, 10, 5], style);
    let portals = maze.cells.graph().portals().len();
    assert!(portals > 500, "{portals}");
    let cameras: Vec<Camera> = (0..24)
        .map(|number| {
            let room = random.below(maze.rooms());
            let at = maze.to_world(maze.point_in(&mut random, room));
            Camera::new(&mut random, at, number % 6 == 0)
        })
        .collect();
    let mut eyes = [Narrowing::Polygon, Narrowing::Rectangle].map(|how| PortalEye::new().with_narrowing(how));
    let mut visible = VisibleSet::new();
    let (mut before, mut crossed, mut reflections) = (0, 0, 0);
    for pass in 0..6 {
        if pass == 3 {
            before = ALLOCATIONS.get();
        }
        for (number, camera) in cameras.iter().enumerate() {
            // A thousand doors a frame.
            for i in 0..1000 {
                maze.cells.set_open(PortalId((i % portals) as u32), (i + number) % 7 != 0).unwrap();
            }
            for i in 0..50 {
                let (id, min, max) = maze.objects[(number * 50 + i) % maze.objects.len()];
                let step = (number % 3) as f32 * 0.5;
                maze.scene.set_bounds(id, Aabb::new(min.as_vec3() + step, max.as_vec3() + step)).unwrap();
            }
            // Some frames see what was not taken in.
            if number % 5 != 0 {
                maze.cells.sync(&maze.scene);
            }
            for eye in &mut eyes {
                visible.fill(&maze.scene, &camera.view);
                FrustumCuller::new().cull(&maze.scene, &camera.view, &mut visible);
                eye.cull(&maze.cells, &maze.scene, &camera.view, &mut visible);
                crossed += eye.stats().crossed;
                reflections += eye.stats().reflections;
            }
        }
    }
    assert_eq!(ALLOCATIONS.get() - before, 0);
    assert!(crossed > 100 && reflections > 100, "{crossed} {reflections}");
}
