//! Portals walked from a ball of eyes: no ray of any view of the region reaches a hidden object, in random
//! mazes. Answers that a pipeline keeps are dropped when a door moves.

use crate::maze::{Camera, Maze, Style};
use std::sync::{Arc, RwLock};
use visibility_core::cells::PortalId;
use visibility_core::glam::{DQuat, DVec3};
use visibility_core::view::{Reach, ViewRegion};
use visibility_core::{Culler, FrustumCuller, Pipeline, VisibleSet};
use visibility_portals::{PortalEye, SharedPortalCuller};
use visibility_testing::{Random, judged, told_enough};

#[derive(Default, Debug)]
struct Tally {
    reached: u64,
    hidden: u64,
    in_frustum: u64,
    shown: u64,
    shown_from_eye: u64,
    regions: u64,
    answered: u64,
}

const STYLE: Style = Style { turned: false, slivers: false, mirrors: false, shift: 0.0, tolerance: 1e-9 };

/// Casts rays from views within the reach that `drawn` is made of, and counts those that reach objects which
/// are hidden from the region of the reach `drawn`.
fn cast(seed: u64, style: Style, drawn: impl Fn(Reach) -> Reach) -> Tally {
    let (mut random, mut tally) = (Random(seed), Tally::default());
    for _ in 0..24 {
        let mut maze = Maze::new(&mut random, [4, 4, 2], style);
        let (mut eye, mut one) = (PortalEye::new(), PortalEye::new());
        let [mut set, mut of_eye] = [(); 2].map(|()| VisibleSet::new());
        for view in 0..40 {
            if view % 4 == 0 {
                maze.shuffle_doors(&mut random);
            }
            let room = random.below(maze.rooms());
            let at = maze.to_world(maze.point_in(&mut random, room));
            let camera = Camera::new(&mut random, at, false);
            let reach = Reach::new([0.01, 0.03, 0.1][random.below(3)], [0.0, 0.1][random.below(2)]);
            let Some(region) = ViewRegion::around(&camera.view, drawn(reach)) else { continue };
            set.fill(&maze.scene, &camera.view);
            FrustumCuller::new().cull_region(None, &maze.scene, &region, &mut set);
            of_eye.clone_from(&set);
            let in_frustum = set.count(&maze.scene) as u64;
            one.cull(&maze.cells, &maze.scene, &camera.view, &mut of_eye);
            tally.regions += 1;
            if eye.cull_region(&maze.cells, &maze.scene, &region, &mut set).is_none() {
                continue;
            }
            tally.answered += 1;
            tally.in_frustum += in_frustum;
            tally.shown += set.count(&maze.scene) as u64;
            tally.shown_from_eye += of_eye.count(&maze.scene) as u64;
            for _ in 0..8 {
                let turn = DQuat::from_axis_angle(random.direction(), reach.radians() * (1.0 - 1e-6));
                let moved = camera.moved(random.direction() * (reach.metres() * (1.0 - 1e-6)), turn);
                for _ in 0..30 {
                    let target =
                        Maze::near(&mut random, at, &maze.targets).and_then(|target| moved.project(target));
                    let edge = random.pick(&[-1.0, 1.0]);
                    let (x, y) = match random.below(4) {
                        0 => (edge, random.fine_range(-1.0, 1.0)),
                        1 => (random.fine_range(-1.0, 1.0), edge),
                        _ => target.unwrap_or((random.fine_range(-1.0, 1.0), random.fine_range(-1.0, 1.0))),
                    };
                    let (from, along) = moved.ray(x, y);
                    maze.follow(from, along, |object, _| {
                        let (id, min, max) = maze.objects[object];
                        let corner = |i: u32| {
                            DVec3::new(
                                if i & 1 == 0 { min.x } else { max.x },
                                if i & 2 == 0 { min.y } else { max.y },
                                if i & 4 == 0 { min.z } else { max.z },
                            )
                        };
                        if (0..8).all(|i| moved.is_before_far(corner(i))) {
                            tally.reached += 1;
                            tally.hidden += u64::from(!set.contains(&maze.scene, id));
                        }
                    });
                }
            }
        }
    }
    tally
}

#[test]
fn no_ray_from_the_ball_reaches_what_is_hidden() {
    for (seed, style) in [(1, STYLE), (2, Style { turned: true, slivers: true, shift: 50.0, ..STYLE })] {
        let tally = cast(seed, style, |reach| reach);
        assert_eq!(tally.hidden, 0, "seed {seed}: {tally:?}");
        judged(tally.reached);
        told_enough(tally.reached > 20_000, format_args!("seed {seed}: too little was tested: {tally:?}"));
        told_enough(tally.shown * 2 < tally.in_frustum, format_args!("seed {seed}: portals hide: {tally:?}"));
    }
}

/// The oracle finds regions that are drawn too small.
#[test]
fn too_small_a_ball_or_cone_is_found() {
    let halved = cast(1, STYLE, |reach| Reach::new(0.3 * reach.metres(), reach.radians()));
    assert!(halved.hidden > 0, "a third of the ball: {halved:?}");
    let unturned = cast(1, STYLE, |reach| Reach::new(reach.metres(), 0.0));
    assert!(unturned.hidden > 0, "no turn: {unturned:?}");
}

#[test]
fn a_kept_answer_is_dropped_when_a_door_moves() {
    let mut random = Random(7);
    let maze = Maze::new(&mut random, [3, 3, 1], STYLE);
    let at = maze.to_world(maze.point_in(&mut random, 4));
    let camera = Camera::new(&mut random, at, false);
    let cells = Arc::new(RwLock::new(maze.cells.clone()));
    let portals = SharedPortalCuller::new(cells.clone());
    let mut pipeline =
        Pipeline::new().with(FrustumCuller::new()).with(portals).with_reach(Some(Reach::new(0.1, 0.1)));
    let mut visible = VisibleSet::new();
    let mut kept = Vec::new();
    for frame in 0..8 {
        if frame == 4 {
            cells.write().unwrap().set_open(PortalId(0), frame % 2 == 1).unwrap();
        }
        pipeline.cull(&maze.scene, &camera.view, &mut visible);
        kept.push(pipeline.is_kept());
    }
    let expected = [false, false, true, true, false, true, true, true];
    assert_eq!(kept, expected, "frames that kept the answer, and a door that moved before the fifth");
}
