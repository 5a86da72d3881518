//! No heap allocation once warm: frames through portals and mirrors, doors that open and close, objects that
//! move, linear programs and stabbing lines. A counting global allocator checks this.

use crate::maze::{Camera, Maze, Style};
use visibility_core::glam::{DVec2, DVec3};
use visibility_core::{Aabb, Culler, FrustumCuller, VisibleSet, cells::PortalId};
use visibility_portals::lp::{Feasible, Greatest, HalfSpace, Solver};
use visibility_portals::stabbing::{Rectangle, Stab, Stabber};
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

/// Solves 300 random programs in `D` variables twice with one solver. Returns how many answers were feasible,
/// infeasible and undecided, and the number of allocations of the second pass.
fn programs<const D: usize>(random: &mut Random) -> ([u32; 3], usize) {
    let mut between = |least: f64, most: f64| random.fine_range(least, most);
    let all: Vec<Vec<HalfSpace<D>>> = (0..300)
        .map(|i| {
            let half = |_| HalfSpace {
                normal: std::array::from_fn(|_| between(-1.0, 1.0)),
                offset: between(-0.05 * D as f64, 1.0),
            };
            (0..3 + i % 40).map(half).collect()
        })
        .collect();
    let mut solver = Solver::<D>::new();
    let (mut counts, mut before) = ([0; 3], 0);
    for pass in 0..2 {
        if pass == 1 {
            before = ALLOCATIONS.get();
        }
        for rows in &all {
            counts[match solver.feasible(rows, 100.0) {
                Feasible::Yes(_) => 0,
                Feasible::No(_) => 1,
                Feasible::Undecided => 2,
            }] += 1;
            let best = solver.greatest(rows, [1.0; D], 100.0);
            counts[2] += u32::from(best == Greatest::Undecided);
        }
    }
    (counts, ALLOCATIONS.get() - before)
}

#[test]
fn programs_and_lines_allocate_nothing_once_warm() {
    let mut random = Random(22);
    let all = [
        programs::<1>(&mut random),
        programs::<2>(&mut random),
        programs::<3>(&mut random),
        programs::<4>(&mut random),
        programs::<5>(&mut random),
        programs::<6>(&mut random),
    ];
    assert!(all.iter().all(|&([yes, no, _], allocated)| yes > 50 && no > 50 && allocated == 0), "{all:?}");
    let mut between = |least: f64, most: f64| random.fine_range(least, most);
    let ways: Vec<(Vec<[DVec2; 2]>, Vec<Rectangle>)> = (0..300)
        .map(|i| {
            let doors = (0..2 + i % 9).map(|i| {
                let (x, y, z) = (4.0 * i as f64, between(-1.5, 1.5), between(-1.5, 1.5));
                let (min, max) = (DVec3::new(x, y - 1.0, z - 1.0), DVec3::new(x, y + 1.0, z + 1.0));
                let ends = [DVec2::new(x, y + 1.0), DVec2::new(x, y - 1.0)];
                (ends, Rectangle { min, max, axis: 0, forward: true })
            });
            doors.unzip()
        })
        .collect();
    let mut stabber = Stabber::new(1e-6);
    let (mut lines, mut none, mut before) = (0, 0, 0);
    for pass in 0..2 {
        if pass == 1 {
            before = ALLOCATIONS.get();
        }
        for (plan, space) in &ways {
            lines += u32::from(matches!(stabber.segments(plan), Stab::Line(_)));
            none += u32::from(stabber.rectangles(space).is_no());
        }
    }
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations for warm lines");
    assert!(lines > 100 && none > 100, "{lines} {none}");
}
