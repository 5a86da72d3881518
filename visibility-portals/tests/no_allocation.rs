//! No heap allocation once warm: frames through portals and mirrors, doors that open and close, objects that
//! move. A counting global allocator checks this.

use crate::maze::{Camera, Maze, Style};
use visibility_core::{Aabb, Culler, FrustumCuller, VisibleSet, cells::PortalId};
use visibility_portals::{Narrowing, PortalEye};
use visibility_testing::Random;
use visibility_testing::allocations::ALLOCATIONS;

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
            // A thousand doors change per frame.
            for i in 0..1000 {
                maze.cells.set_open(PortalId((i % portals) as u32), (i + number) % 7 != 0).unwrap();
            }
            for i in 0..50 {
                let (id, min, max) = maze.objects[(number * 50 + i) % maze.objects.len()];
                let step = (number % 3) as f32 * 0.5;
                maze.scene.set_bounds(id, Aabb::new(min.as_vec3() + step, max.as_vec3() + step)).unwrap();
            }
            // Every fifth frame culls without a sync after the changes.
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
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations in 72 warm frames");
    assert!(crossed > 100 && reflections > 100, "{crossed} {reflections}");
}
