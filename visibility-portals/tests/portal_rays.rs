//! No ray that passes open portals reaches a hidden object, in random mazes: axis-aligned and rotated, with
//! doors that open and close, eyes anywhere, and cameras of all depth conventions.

use crate::maze::{Camera, Maze, Style};
use visibility_core::glam::DVec3;
use visibility_core::{Culler, FrustumCuller, VisibleSet};
use visibility_portals::{Narrowing, NotCulled, PortalEye};
use visibility_testing::{Random, judged, told_enough};

#[derive(Default, Debug)]
struct Tally {
    rays: u64,
    reached: u64,
    in_frustum: u64,
    shown: u64,
    frames: u64,
    outside: u64,
    crossed: u64,
    many_starts: u64,
}

/// Returns a random eye in world space: in a room, in a doorway, near the doorway's plane, on one of its
/// edges or at one of its corners.
fn place(random: &mut Random, maze: &Maze) -> DVec3 {
    let room = random.below(maze.rooms());
    let portals = maze.cells.graph().portals();
    let inside = maze.to_world(maze.point_in(random, room));
    if portals.is_empty() || random.below(2) == 0 {
        return inside;
    }
    let portal = &portals[random.below(portals.len())];
    let vertices = portal.polygon().vertices();
    let (a, b) = (vertices[0], vertices[1]);
    let c = vertices[vertices.len() / 2 + 1 - usize::from(vertices.len() == 3)];
    match random.below(4) {
        0 => a,
        1 => a + (b - a) * random.fine_unit(),
        2 => (a + b + c) / 3.0,
        _ => (a + b + c) / 3.0 + portal.plane().normal * (random.fine_range(-1.0, 1.0) * 1e-9),
    }
}

fn check(seed: u64, sizes: [usize; 3], style: Style, mazes: u32, views: u32, rays: u32) -> Tally {
    let mut random = Random(seed);
    let mut tally = Tally::default();
    for _ in 0..mazes {
        let mut maze = Maze::new(&mut random, sizes, style);
        let mut eye = PortalEye::new();
        let mut boxed = PortalEye::new().with_narrowing(Narrowing::Rectangle);
        let [mut frustum, mut exact, mut rectangle] = [(); 3].map(|_| VisibleSet::new());
        for view in 0..views {
            if view % 4 == 0 {
                maze.shuffle_doors(&mut random);
            }
            let at = place(&mut random, &maze);
            let camera = Camera::new(&mut random, at, view % 5 == 4);
            frustum.fill(&maze.scene, &camera.view);
            FrustumCuller::new().cull(&maze.scene, &camera.view, &mut frustum);
            exact.clone_from(&frustum);
            rectangle.clone_from(&frustum);
            eye.cull(&maze.cells, &maze.scene, &camera.view, &mut exact);
            boxed.cull(&maze.cells, &maze.scene, &camera.view, &mut rectangle);
            tally.frames += 1;
            match eye.stats().fallback {
                Some(why) => {
                    assert_eq!(why, NotCulled::OutsideCells, "seed {seed}, view {view}");
                    tally.outside += 1;
                    continue;
                }
                None => {
                    tally.in_frustum += frustum.count(&maze.scene) as u64;
                    tally.shown += exact.count(&maze.scene) as u64;
                    tally.crossed += eye.stats().crossed;
                    tally.many_starts += u64::from(eye.stats().starts > 1);
                }
            }
            // The rectangle's window contains the polygon's, so each cell that the polygon reaches is reached
            // with the rectangle. Objects may differ: a box is tested against planes one by one, so near a
            // sharp corner of the polygon only the rectangle may exclude it. With a great tolerance the
            // margins of the two differ as well, as they do where doors are slivers: an edge too short for
            // its error gives the polygon no plane, and the rectangle is bounded there all the same.
            for cell in eye.seen_cells() {
                assert!(
                    style.slivers || style.tolerance > 1e-6 || boxed.sees(cell),
                    "seed {seed}, view {view}: the rectangle does not show {cell:?}"
                );
            }
            for _ in 0..rays {
                let aimed = random.below(3) > 0;
                let target = aimed.then(|| Maze::near(&mut random, at, &maze.targets)).flatten();
                let (x, y) = target
                    .and_then(|target| camera.project(target))
                    .unwrap_or_else(|| (random.fine_range(-1.0, 1.0), random.fine_range(-1.0, 1.0)));
                let (from, along) = camera.ray(x, y);
                tally.rays += 1;
                maze.follow(from, along, |object, mirrors| {
                    let (id, min, max) = maze.objects[object];
                    // The ray may meet an object that crosses the far plane beyond that plane, so only
                    // objects entirely in front of it count.
                    let nearest = (0..8).map(|i| {
                        DVec3::new(
                            if i & 1 == 0 { min.x } else { max.x },
                            if i & 2 == 0 { min.y } else { max.y },
                            if i & 4 == 0 { min.z } else { max.z },
                        )
                    });
                    if !mirrors.is_empty() || !nearest.into_iter().all(|p| camera.is_before_far(p)) {
                        return;
                    }
                    tally.reached += 1;
                    for (what, set) in [("polygon", &exact), ("rectangle", &rectangle)] {
                        assert!(
                            set.contains(&maze.scene, id),
                            "seed {seed}, view {view}, {what}: the ray to ({x}, {y}) reaches object {id}, which is hidden; {:?}",
                            eye.stats()
                        );
                    }
                });
            }
        }
    }
    // Asserts that the test is not vacuous.
    told_enough(tally.reached * 16 > tally.rays, format_args!("{tally:?}"));
    told_enough(tally.shown * 2 < tally.in_frustum, format_args!("{tally:?}"));
    told_enough(
        tally.outside * 4 < tally.frames && tally.many_starts > 0 && tally.crossed * 2 > tally.frames,
        format_args!("{tally:?}"),
    );
    judged(tally.rays);
    tally
}

const PLAIN: Style = Style { turned: false, slivers: false, mirrors: false, shift: 0.0, tolerance: 1e-9 };

#[test]
fn no_ray_reaches_what_is_hidden_in_straight_mazes() {
    let tally = check(1, [5, 5, 2], PLAIN, 16, 60, 300);
    told_enough(tally.rays > 250_000, format_args!("{tally:?}"));
}

#[test]
fn no_ray_reaches_what_is_hidden_in_turned_mazes() {
    let tally = check(2, [4, 4, 3], Style { turned: true, shift: 50.0, ..PLAIN }, 16, 60, 300);
    told_enough(tally.rays > 250_000, format_args!("{tally:?}"));
}

#[test]
fn no_ray_reaches_what_is_hidden_behind_slivers() {
    let style = Style { slivers: true, ..PLAIN };
    let tally = check(3, [5, 5, 2], style, 10, 60, 200);
    let turned = check(4, [4, 4, 3], Style { turned: true, shift: 1e4, ..style }, 10, 60, 200);
    told_enough(tally.rays + turned.rays > 200_000, format_args!("{tally:?} {turned:?}"));
}

/// Cells and portals are displaced by nearly the tolerance, so that a missing margin fails the test.
#[test]
fn no_ray_reaches_what_is_hidden_where_cells_are_off_by_the_tolerance() {
    for (seed, tolerance) in [(5, 0.003), (15, 0.012)] {
        let style = Style { tolerance, ..PLAIN };
        let tally = check(seed, [5, 5, 2], style, 12, 60, 300);
        let turned = check(seed + 1, [4, 4, 3], Style { turned: true, shift: 50.0, ..style }, 12, 60, 300);
        told_enough(tally.rays + turned.rays > 200_000, format_args!("{tally:?} {turned:?}"));
    }
}
