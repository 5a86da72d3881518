//! Forged proofs with surfaces: triangles that do not block, boundaries that move too far, and sample lines
//! that do not cross.

use super::*;

#[test]
fn triangles_that_do_not_occlude_are_refused() {
    let mut world = World::new(TARGET, &[]);
    world.triangles = scene_of(&[(TARGET, true), (WALL, false)]);
    assert_eq!(
        world.error(LINE, vec![surface(&[1], LINE)]),
        SURFACE,
        "a surface of a triangle that is no occluder"
    );
}

/// Sample lines that are no segments of the node: they start behind or beside the viewcell polygon, or end
/// behind or beside the target polygon, and cross a triangle there.
#[test]
fn lines_of_other_nodes_are_refused() {
    let behind = [[-4.0, -30.0, -30.0], [-4.0, 30.0, -30.0], [-4.0, 4.0, 90.0]];
    let beyond = [[90.0, -30.0, -30.0], [90.0, 30.0, -30.0], [90.0, 4.0, 90.0]];
    let beside = |x: f32, y: f32| [[x, y - 20.0, -30.0], [x, y + 20.0, -30.0], [x, y, 90.0]];
    let tries = [
        (behind, [[-16.0, 4.0, 4.0], LINE[1]]),
        (beyond, [LINE[0], [96.0, 4.0, 3.0]]),
        (beside(16.0, 88.0), [[8.0, 100.0, 4.0], LINE[1]]),
        (beside(16.0, -78.0), [[8.0, -100.0, 4.0], LINE[1]]),
        (beside(72.0, 88.0), [LINE[0], [80.0, 100.0, 3.0]]),
        (beside(72.0, -78.0), [LINE[0], [80.0, -100.0, 3.0]]),
    ];
    for (occluder, line) in tries {
        let world = World::new(TARGET, &[occluder]);
        world.refuses_surface(1, line, LINE, format_args!("{line:?}"));
    }
}

/// A surface through the viewcell polygon or the target polygon that reaches beyond all segments on every
/// side. It blocks only the segments that start, or end, on one side of it.
#[test]
fn surfaces_that_cut_an_end_of_segments_are_refused() {
    // These triangles lie in the planes y - x = -4 and y - x = -76.
    let through_p = [[-92.0, -96.0, -400.0], [-92.0, -96.0, 400.0], [204.0, 200.0, 0.0]];
    let through_q = [[16.0, -60.0, -400.0], [16.0, -60.0, 400.0], [476.0, 400.0, 0.0]];
    let world = World::new(TARGET, &[through_p]);
    let [hidden, seen] = [6.0, 2.0].map(|y| [[8.0, y, 4.0], [80.0, 4.0, 3.0]]);
    assert_eq!(
        world.error(seen, vec![surface(&[1], hidden)]),
        SURFACE,
        "a surface through the start of segments"
    );
    let world = World::new(TARGET, &[through_q]);
    let [hidden, seen] = [3.0, 5.0].map(|y| [[8.0, 4.0, 4.0], [80.0, y, 2.5]]);
    assert_eq!(
        world.error(seen, vec![surface(&[1], hidden)]),
        SURFACE,
        "a surface through the end of segments"
    );
}

/// A wall with a corner in the middle of the segments, moved by more than three clearances. The moved vertex
/// has the lowest number, then the highest.
#[test]
fn boundaries_that_move_too_far_are_refused() {
    for x in [39.0, 41.0] {
        let wall = [[40.0, -100.0, -100.0], [40.0, 100.0, -100.0], [x, 4.0, 5.0]];
        let mut world = World::new(TARGET, &[wall]);
        world.clearance = 1.0 / 128.0;
        let number = world.triangles.vertices(1)[2];
        for z in [500.0, f64::NAN] {
            let moved = vec![(number, DVec3::new(x.into(), 4.0, z))];
            let line = [[8.0, 4.25, 4.0], [80.0 - world.clearance, 4.0, 3.0]];
            assert_eq!(
                world.error(OVER, vec![moved_surface(&[1], moved, line)]),
                SURFACE,
                "from {x}: a boundary that moves to z of {z}"
            );
        }
    }
}

#[test]
fn boundaries_that_segments_meet_are_refused() {
    let world = World::new(TARGET, &[HALF_WALL]);
    let line = [[8.0, 4.0, 2.0], [80.0, 4.0, 2.5]];
    assert_eq!(
        world.error(OVER, vec![surface(&[1], line)]),
        SURFACE,
        "a surface whose boundary segments meet"
    );
}

/// An occluder that has a corner of the target and leans over a part of the target.
#[test]
fn edges_from_a_corner_of_the_target_before_it_are_refused() {
    let mut random = Random(2);
    let mut tried = 0;
    for _ in 0..20_000 {
        let mut int = |r: i32| -> [f32; 3] { core::array::from_fn(|_| random.between(-r, r) as f32) };
        let (u, v, w) = (int(60), int(400), int(400));
        let wall = [TARGET[0], [79.0 - u[0].abs(), v[1], v[2]], [79.0 - u[1].abs(), w[1], w[2]]];
        let line = [[8.0, 4.0, 4.0], [80.0, 4.0, 3.0]];
        let shape = wall.map(|x| Vec3::from_array(x).as_dvec3());
        let seen = [[8.0, 4.0, 4.0], [80.0, 4.0, 5.0]];
        if crosses(line.map(DVec3::from_array), &shape) != Some(true) {
            continue;
        }
        let world = World::new(TARGET, &[wall]);
        if world.sees(seen.map(DVec3::from_array)) {
            tried += 1;
            assert_eq!(world.error(seen, vec![surface(&[1], line)]), SURFACE, "the surface {wall:?}");
        }
    }
    assert!(tried > 10, "{tried}");
}

/// A wall half a clearance before the target polygon. Its edge, which crosses the polygon's middle, moves
/// behind the polygon.
#[test]
fn strips_that_cut_an_end_of_segments_are_refused() {
    let wall = [[79.75, 4.0, -100.0], [79.75, 4.0, 100.0], [79.75, 200.0, 0.0]];
    let mut world = World::new(TARGET, &[wall]);
    world.clearance = 0.125;
    let [a, b, _] = world.triangles.vertices(1);
    let moved = [(a, -100.0), (b, 100.0)].map(|(v, z)| (v, DVec3::new(79.9375, 4.0, z)));
    let line = [[8.0, 5.0, 4.0], [79.875, 4.5, 3.0]];
    let seen = [[8.0, 2.0, 4.0], [80.0, 3.0, 2.25]];
    assert_eq!(
        world.error(seen, vec![moved_surface(&[1], moved.into(), line)]),
        SURFACE,
        "a strip through the end of segments"
    );
}

/// A surface that is a closed tetrahedron among the segments, and a sample line through one edge and one face
/// of it.
#[test]
fn lines_through_an_edge_of_a_surface_are_refused() {
    let [a, b, c, d] = [[40.0, 3.0, 3.0], [40.0, 5.0, 3.0], [44.0, 4.0, 6.0], [44.0, 8.0, 0.0]];
    let world = World::new(TARGET, &[[a, b, c], [a, b, d], [a, c, d], [b, c, d]]);
    let line = [[8.0, 4.0, 3.0], [80.0, 4.0, 3.0]];
    let found = [1, 2, 3, 4].map(|t| crosses(line.map(DVec3::from_array), &world.triangles.corners(t)));
    assert_eq!(found, [None, None, Some(true), Some(false)], "which of the triangles the line crosses");
    let seen = [[8.0, 0.0, 7.0], [80.0, 4.0, 5.0]];
    assert_eq!(
        world.error(seen, vec![surface(&[1, 2, 3, 4], line)]),
        SURFACE,
        "a line through an edge of the surface"
    );
    // Lines through a corner of the tetrahedron, with coordinates of more bits than a product can hold.
    let mut random = Random(3);
    for round in 0..3000 {
        let mut near = |[y, z]: [f32; 2]| {
            let at = random.vec3(-0.5, 0.5);
            [48.0 + at.x, y + at.y, z + at.z]
        };
        let [a, b, c, d] = [[40.0, 4.0, 3.0], near([2.0, 1.0]), near([6.0, 1.0]), near([4.0, 6.0])];
        let world = World::new(TARGET, &[[a, b, c], [a, c, d], [a, d, b], [b, c, d]]);
        let mut slope = || (random.fine_range(-0.01, 0.01) * 2f64.powi(48)).round() / 2f64.powi(48);
        let (u, v) = (slope(), slope());
        let at = |x: f64| [40.0 + x, 4.0 + x * u, 3.0 + x * v];
        let step = surface(&[1, 2, 3, 4], [at(-32.0), at(40.0)]);
        assert_eq!(world.error(seen, vec![step]), SURFACE, "{round}");
    }
}

/// A small triangle among the segments. Its boundary moves below the segments, out of their way. The sample
/// line passes the triangle, and leaves through the diagonal of a strip.
#[test]
fn lines_through_an_edge_of_a_strip_are_refused() {
    let target = [[80.0, 0.5, 0.5], [80.0, 7.5, 0.5], [80.0, 0.5, 7.5]];
    let small = [[40.0, 3.0, 0.5], [40.0, 5.0, 0.5], [40.0, 4.0, 0.8125]];
    let mut world = World::new(target, &[small]);
    world.clearance = 0.25;
    let numbers = world.triangles.vertices(1);
    let mut moved: Vec<(u32, DVec3)> =
        (0..3).map(|k| (numbers[k], DVec3::new(40.25, world.shapes[1][k].y, 0.125))).collect();
    moved.sort_by_key(|entry| entry.0);
    let at = |x: f64| [40.0625 + x, 4.25, 0.640625 + x / 128.0];
    let line = [at(-32.0625), at(39.6875)];
    let strip = [small[2], [40.25, 5.0, 0.125], [40.25, 4.0, 0.125]];
    let strip = strip.map(|x| Vec3::from_array(x).as_dvec3());
    let line_ = line.map(DVec3::from_array);
    assert_eq!(
        [&world.shapes[1], &strip].map(|t| crosses(line_, t)),
        [Some(true), None],
        "the line crosses the triangle, and an edge of the strip"
    );
    let seen = [[8.0, 4.0, 6.0], [80.0, 2.0, 4.0]];
    assert_eq!(
        world.error(seen, vec![moved_surface(&[1], moved.clone(), line)]),
        SURFACE,
        "a line through an edge of the strip"
    );
}

#[test]
fn surfaces_that_are_crossed_an_even_number_of_times_are_refused() {
    let world = World::new(TARGET, &[HALF_WALL]);
    let line = [[8.0, 4.0, 2.0], [80.0, 4.0, 2.5]];
    for triangles in [&[][..], &[1, 1]] {
        assert_eq!(
            world.error(OVER, vec![surface(triangles, line)]),
            SURFACE,
            "a surface of {triangles:?}, crossed an even number of times"
        );
    }
}

/// Triangles that a line does not cross: beside the line, though it crosses their planes, and beyond its
/// ends.
#[test]
fn surfaces_that_a_line_does_not_cross_are_refused() {
    let beside = [[40.0, 60.0, -30.0], [40.0, 90.0, -30.0], [40.0, 75.0, 90.0]];
    let behind = [[-4.0, -30.0, -30.0], [-4.0, 30.0, -30.0], [-4.0, 4.0, 90.0]];
    let beyond = [[90.0, -30.0, -30.0], [90.0, 30.0, -30.0], [90.0, 4.0, 90.0]];
    for occluder in [beside, behind, beyond] {
        let world = World::new(TARGET, &[occluder]);
        assert_eq!(
            world.error(LINE, vec![surface(&[1], LINE)]),
            SURFACE,
            "a surface of {occluder:?}, which the line does not cross"
        );
    }
}

/// The target itself as the surface. The sample line ends behind the target by less than the error of
/// positions.
#[test]
fn the_target_itself_is_refused() {
    let world = World::new(TARGET, &[]);
    let delta = position_error(&world.triangles, &world.cell, Target::Triangle(0), 0.0).unwrap();
    let line = [LINE[0], [80.0 + 0.5 * delta, 4.0, 3.0]];
    world.refuses_surface(0, line, LINE, "the target as its own occluder");
}

/// A triangle that has a corner of the target and cuts the target in two: one part of the target is behind
/// it.
#[test]
fn surfaces_at_a_corner_of_the_target_that_cut_it_are_refused() {
    let cut = [[80.0, 2.0, 2.0], [79.875, 52.0, -48.0], [80.125, 32.0, 92.0]];
    let world = World::new(TARGET, &[cut]);
    let [hidden, seen] = [[5.0, 2.25], [3.0, 3.5]].map(|[y, z]| [[8.0, 4.0, 4.0], [80.0, y, z]]);
    world.refuses_surface(1, hidden, seen, "a surface through the target's corner");
}

/// A triangle from a corner of the target through the viewcell polygon. It blocks only the segments from
/// above.
#[test]
fn surfaces_at_the_target_that_cut_the_start_of_segments_are_refused() {
    let world = World::new(TARGET, &[[TARGET[2], [-64.0, -300.0, 2.0], [-64.0, 300.0, 2.0]]]);
    let [hidden, seen] = [6.0, 2.0].map(|z| [[8.0, 4.25, z], [80.0, 4.0, 3.0]]);
    world.refuses_surface(1, hidden, seen, "a surface from the target through the start of segments");
}

/// A target with a sharp corner. A point far beyond the corner is near the lines of both sides. A line to it
/// passes below an edge over which all segments pass.
#[test]
fn lines_that_end_beyond_a_sharp_corner_are_refused() {
    let least = 2f32.powi(-20);
    let target = [[80.0, 0.0, 0.0], [80.0, 4.0, least], [80.0, 4.0, -least]];
    let mut world = World::new(target, &[[[40.0, -least, -10.0], [40.0, -least, 10.0], [40.0, -100.0, 0.0]]]);
    world.cell = CellBox { min: DVec3::new(-8.0, 0.0, -4.0), max: DVec3::new(0.0, 8.0, 4.0) };
    let line = [[0.0; 3], [80.0, -4.0 * f64::from(least), 0.0]];
    world.refuses_surface(1, line, [[0.0; 3], [80.0, 0.0, 0.0]], "a corner of 2^-20");
}

/// With a clearance, the sample line ends where its proof says. Moved before the target's plane, it would
/// cross a triangle that all segments miss, and the proof that a wall hides the target would be lost.
#[test]
fn lines_of_proofs_with_a_clearance_are_not_moved() {
    let target = [[78.0, 3.0, -3.0], [82.0, 7.0, 0.0], [78.0, 3.0, 3.0]];
    let wall = [[40.0, -300.0, -100.0], [40.0, 300.0, -100.0], [40.0, 0.0, 400.0]];
    let beside = [[72.0, 7.5, -50.0], [72.0, 7.5, 50.0], [72.0, 100.0, 0.0]];
    let high = 11.145816901406112;
    let line = [[0.0, high, 0.0], [81.98342718481594, 6.99447572827198, 0.0]];
    for (occluders, surfaces, expected) in
        [(vec![beside], vec![1], SURFACE), (vec![wall, beside], vec![1, 2], None)]
    {
        let mut world = World::new(target, &occluders);
        world.cell = CellBox { min: DVec3::new(-8.0, 0.0, -4.0), max: DVec3::new(0.0, high, 4.0) };
        world.clearance = 1.0 / 128.0;
        let found = world.proof(vec![surface(&surfaces, line)]).check(&world.triangles).err();
        assert_eq!(found, expected, "a line just below a triangle: {surfaces:?}");
    }
}

/// With a clearance, a sample line may begin and end a little beside the polygons. Here it crosses a triangle
/// just below the edge over which all segments pass.
#[test]
fn lines_that_cross_a_triangle_over_which_all_segments_pass_are_refused() {
    let mut world = World::new(TARGET, &[[[44.0, 1.0, -60.0], [44.0, 1.0, 60.0], [44.0, -60.0, 0.0]]]);
    world.clearance = 1.0 / 128.0;
    world.cell.min.y = -0.011_525_871_376_765_666;
    let line =
        [[8.0, -0.011_525_871_377_788_847, 4.0], [79.992_187_5, 2.011_306_356_213_82, 2.006_987_712_429_687]];
    assert_eq!(world.error(LINE, vec![surface(&[1], line)]), SURFACE, "a line beside both polygons");
}

/// A triangle that has a corner of the target and is beside it, so that all segments miss it. A line that
/// ends just beside the target, near that corner, crosses it.
#[test]
fn lines_that_end_beside_a_corner_of_the_target_are_refused() {
    let target = [[80.0, 0.0, 0.0], [80.0, 8.0, 0.125], [80.0, 8.0, 4.0]];
    let mut world = World::new(target, &[[target[0], [40.0, 100.0, 0.0], [40.0, 100.0, -50.0]]]);
    world.cell = CellBox { min: DVec3::new(-8.0, 0.0, 0.0), max: DVec3::new(0.0, 8.0, 8.0) };
    let line = [[0.0; 3], [80.0, 4.263_256_414_560_601e-11, -6.128_431_095_930_864e-13]];
    world.refuses_surface(1, line, [[0.0, 4.0, 4.0], [80.0, 6.0, 1.0]], "an end beside the target");
}

/// A target with a tip so sharp that rounding lets a point far beyond it count as on the inner side of all
/// sides: two corners are along one direction from the third, which is off their line by 2^-80.
#[test]
fn lines_that_end_beyond_a_tip_by_rounding_are_refused() {
    let along = |part: f32| [80.0, 2700.0 * part, 2563.0 * part];
    let part = 2f32.powi(-21);
    let target = [[80.0, 0.0, -2f32.powi(-80)], along(part), along(594.0 * part)];
    let mut world = World::new(target, &[[[40.0, -0.5, -10.0], [40.0, -0.5, 10.0], [40.0, -100.0, 0.0]]]);
    world.cell = CellBox { min: DVec3::new(-8.0, 0.0, -4.0), max: DVec3::new(0.0, 8.0, 4.0) };
    let line = [[0.0; 3], [80.0, -1.692_963_001_599_812, -1.607_060_804_851_97]];
    world.refuses_surface(1, line, [[0.0; 3], along(part).map(f64::from)], "an end beyond a tip");
}
