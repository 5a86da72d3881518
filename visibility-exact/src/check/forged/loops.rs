//! Forged proofs with loops: rings of occluder corners, and the lines outside of their edges.

use super::*;

/// A loop that is larger than the occluder on which it is said to lie.
#[test]
fn loops_away_from_their_occluder_are_refused() {
    let small = [[40.0, 3.0, 3.0], [40.0, 5.0, 3.0], [40.0, 4.0, 5.0]];
    let corners = WALL.map(|x| Vec3::from_array(x).as_dvec3());
    for clearance in [0.0, 1.0 / 128.0] {
        let world = World { clearance, ..World::new(TARGET, &[small]) };
        let seen = [[8.0, 0.0, 7.0], [80.0, 4.0, 5.0]];
        assert_eq!(
            world.error(seen, vec![ring(world.piece(1), &corners, LINE, &INSIDE)]),
            LOOP,
            "clearance {clearance}: a loop away from its occluder"
        );
    }
}

/// Loops on occluders behind the viewcell and behind the target.
#[test]
fn loops_beyond_the_ends_of_segments_are_refused() {
    for x in [-4.0, 81.0] {
        let wall = WALL.map(|[_, y, z]| [x, y, z]);
        for clearance in [0.0, 1.0 / 128.0] {
            let world = World { clearance, ..World::new(TARGET, &[wall]) };
            let step = ring(world.piece(1), &world.shapes[1], LINE, &INSIDE);
            assert_eq!(world.error(LINE, vec![step]), LOOP, "{x} {clearance}");
        }
    }
}

/// A loop on an occluder in the plane of the viewcell's face holds. A loop inside the viewcell, by two errors
/// of positions, is refused: segments that start at the face do not cross it.
#[test]
fn loops_just_inside_the_viewcell_are_refused() {
    let wall = WALL.map(|[_, y, z]| [8.0, y, z]);
    let mut world = World::new(TARGET, &[wall]);
    let delta = position_error(&world.triangles, &world.cell, Target::Triangle(0), 0.0).unwrap();
    let loop_ = ring(world.piece(1), &world.shapes[1], [[0.0, 4.0, 4.0], LINE[1]], &INSIDE);
    assert_eq!(
        world.proof(vec![loop_.clone()]).check(&world.triangles),
        Ok(()),
        "a loop at the viewcell's face"
    );
    world.cell.max.x += 2.0 * delta;
    assert_eq!(
        world.proof(vec![loop_]).check(&world.triangles).err(),
        LOOP,
        "a loop within the viewcell by two errors"
    );
}

/// A one-sided occluder in the plane of the viewcell's face, with its back to the viewcell. Segments from the
/// face do not cross this occluder.
#[test]
fn loops_that_show_their_back_are_refused() {
    let wall = WALL.map(|[_, y, z]| [8.0, y, z]);
    let mut world = World { clearance: 1.0 / 128.0, ..World::new(TARGET, &[wall]) };
    let step = ring(world.piece(1), &world.shapes[1], [[0.0, 4.0, 4.0], LINE[1]], &INSIDE);
    assert_eq!(world.proof(vec![step.clone()]).check(&world.triangles), Ok(()), "an occluder of two sides");
    for [a, b, c] in [wall, [wall[0], wall[2], wall[1]]] {
        let mut scene = Scene::new();
        for (shape, one_sided) in [(TARGET, false), ([a, b, c], true)] {
            let triangle = shape.map(Vec3::from_array);
            let object = Object::new(Aabb::from_points(triangle));
            let id = scene.insert(Object { occluder: true, one_sided, ..object });
            scene.set_triangles(id, [triangle]).unwrap();
        }
        world.triangles = SceneTriangles::new(&scene);
        assert_eq!(
            world.proof(vec![step.clone()]).check(&world.triangles).err(),
            LOOP,
            "an occluder {a:?} {b:?} {c:?} of one side"
        );
    }
}

/// A loop on a plate that lies in the target's plane and is larger than the target.
#[test]
fn loops_in_the_plane_of_the_target_are_refused() {
    let world = World::new(TARGET, &[WALL.map(|[_, y, z]| [80.0, y, z])]);
    let step = ring(world.piece(1), &world.shapes[1], LINE, &INSIDE);
    assert_eq!(world.error(LINE, vec![step]), LOOP, "a loop in the target's plane");
    // No ring at all.
    let step = Step::Loop { piece: world.piece(1), ring: [].into(), side: 1.0, edges: [].into() };
    assert!(matches!(world.error(LINE, vec![step]), LOOP | MALFORMED), "a loop without corners");
}

/// Loops with a corner behind the target that is falsely tagged as a corner of the target, where such corners
/// are allowed. In the last case, another corner of the loop is rightly tagged.
#[test]
fn corners_that_are_not_the_targets_are_refused() {
    let tilted = [[70.0, 52.0, -48.0], [90.0, 32.0, 92.0], [90.0, -200.0, -90.0]];
    let world = World::new(TARGET, &[tilted]);
    let seen = [[8.0, 4.0, 4.0], [80.0, 3.0, 3.0]];
    for tags in [[3, 3, 3], [3, 0, 1], [3, 1, 2], [3, 0, 0]] {
        let Step::Loop { piece, ring, side, edges } = ring(world.piece(1), &world.shapes[1], LINE, &INSIDE)
        else {
            unreachable!()
        };
        let ring = ring.iter().zip(tags).map(|(&(x, _), tag)| (x, tag)).collect();
        assert_eq!(
            world.error(seen, vec![Step::Loop { piece, ring, side, edges }]),
            LOOP,
            "corners tagged {tags:?} as the target's"
        );
    }
    let cut = [[80.0, 2.0, 2.0], [79.875, 52.0, -48.0], [80.125, 32.0, 92.0]];
    let world = World::new(TARGET, &[cut]);
    let step = ring(world.piece(1), &world.shapes[1], [LINE[0], [80.0, 5.0, 2.25]], &INSIDE);
    let Step::Loop { piece, ring, side, edges } = step else { unreachable!() };
    let ring = ring.iter().zip([0, 3, 0]).map(|(&(x, _), tag)| (x, tag)).collect();
    assert_eq!(
        world.error([[8.0, 4.0, 4.0], [80.0, 3.0, 3.5]], vec![Step::Loop { piece, ring, side, edges }]),
        LOOP,
        "a corner tagged as the target's fourth"
    );
}

#[test]
fn loops_that_lines_pass_outside_are_refused() {
    let world = World::new(TARGET, &[HALF_WALL]);
    let line = [[8.0, 4.0, 2.0], [80.0, 4.0, 2.5]];
    assert_eq!(
        world.error(OVER, vec![ring(world.piece(1), &world.shapes[1], line, &INSIDE)]),
        LOOP,
        "a loop below the line of sight"
    );
    // All lines pass outside of the first or the second edge, and inside of the others.
    let above = HALF_WALL.map(|[x, y, z]| [x, y, z - 40.0]);
    let world = World::new(TARGET, &[above]);
    let line = [[8.0, 4.0, -40.0], [80.0, 4.0, -38.0]];
    assert_eq!(
        world.error(LINE, vec![ring(world.piece(1), &world.shapes[1], line, &INSIDE)]),
        LOOP,
        "a loop that all lines pass outside of"
    );
}

/// Loops with fewer or more edges than corners.
#[test]
fn malformed_loops_are_refused() {
    let world = World::new(TARGET, &[HALF_WALL]);
    let line = [[8.0, 4.0, 2.0], [80.0, 4.0, 2.5]];
    let step = ring(world.piece(1), &world.shapes[1], line, &INSIDE[..2]);
    assert_eq!(world.error(OVER, vec![step]), MALFORMED, "fewer edges than corners");
    let step = ring(world.piece(1), &world.shapes[1], line, &[INSIDE, INSIDE].concat());
    assert_eq!(world.error(OVER, vec![step]), MALFORMED, "more edges than corners");
    for factor in [0.0, 0.5, -2.0, f64::NAN] {
        let mut step = ring(world.piece(1), &world.shapes[1], line, &INSIDE);
        let Step::Loop { side, .. } = &mut step else { unreachable!() };
        *side *= factor;
        assert_eq!(world.error(OVER, vec![step]), MALFORMED, "a side that is {factor} of a sign");
    }
}

/// Loops with edges across the segments, of which the proof falsely says that no line passes outside.
#[test]
fn edges_that_lines_pass_outside_are_refused() {
    let world = World::new(TARGET, &[HALF_WALL]);
    let line = [[8.0, 4.0, 2.0], [80.0, 4.0, 2.5]];
    let edges = [LoopEdge::Inside, LoopEdge::Inside, never(&[1.0])];
    let step = ring(world.piece(1), &world.shapes[1], line, &edges);
    assert_eq!(world.error(OVER, vec![step]), WEIGHTS, "an edge that lines pass on both sides of");
    // A row lasts only while its own edge is checked: the row of the first edge is gone, so the second weight
    // has no row.
    let edges = [never(&[1.0]), LoopEdge::Inside, never(&[1.0, 0.0])];
    let step = ring(world.piece(1), &world.shapes[1], line, &edges);
    assert_eq!(world.error(OVER, vec![step]), WEIGHTS, "an edge excluded by a row that is gone");
    // All lines pass above the occluder.
    let below = HALF_WALL.map(|[x, y, z]| [x, y, z - 40.0]);
    let world = World::new(TARGET, &[below]);
    let line = [[8.0, 4.0, -40.0], [80.0, 4.0, -38.0]];
    for weight in [1.0, -1.0] {
        let edges = [LoopEdge::Inside, LoopEdge::Inside, never(&[weight])];
        let step = ring(world.piece(1), &world.shapes[1], line, &edges);
        assert_eq!(world.error(LINE, vec![step]), WEIGHTS, "{weight}");
    }
}

/// Parts of a divided node that hold lines, and that the proof falsely calls empty.
#[test]
fn nodes_with_lines_are_not_empty() {
    let world = World::new(TARGET, &[HALF_WALL]);
    let line = [[8.0, 4.0, 2.0], [80.0, 4.0, 2.5]];
    let edges = [LoopEdge::Divides, LoopEdge::Inside, LoopEdge::Divides];
    let step = ring(world.piece(1), &world.shapes[1], line, &edges);
    // The weights of the first part are right. Those of the second would need the lines to be outside of the
    // first edge.
    for weights in [&[1.0, 0.0][..], &[1.0, 0.0, 0.0], &[0.0, 1.0], &[1.0], &[]] {
        let steps = vec![step.clone(), empty(&[1.0]), empty(weights)];
        assert_eq!(world.error(OVER, steps), WEIGHTS, "{weights:?}");
    }
    let steps = vec![step.clone(), empty(&[1.0])];
    assert_eq!(world.error(OVER, steps), MALFORMED, "two parts of the node have no step");
    let steps = vec![step.clone(), empty(&[1.0]), Step::Corner { edges: [0, 1, 1] }];
    assert_eq!(world.error(OVER, steps), Some(ProofError::Corner), "a corner of edges that do not exclude");
    let below = HALF_WALL.map(|[x, y, z]| [x, y, z - 40.0]);
    let world = World::new(TARGET, &[below]);
    let line = [[8.0, 4.0, -40.0], [80.0, 4.0, -38.0]];
    let edges = [LoopEdge::Inside, LoopEdge::Inside, LoopEdge::Divides];
    let step = ring(world.piece(1), &world.shapes[1], line, &edges);
    for weight in [1.0, -1.0] {
        assert_eq!(
            world.error(LINE, vec![step.clone(), empty(&[weight])]),
            WEIGHTS,
            "weight {weight}: a node that has lines"
        );
    }
}

/// The viewcell polygon is halved, and a loop adds a row in each half. A row of the first half must not count
/// in the second half, where the loop is missing.
#[test]
fn rows_end_with_their_loop() {
    let world = World::new(TARGET, &[WALL]);
    let edges = [LoopEdge::Divides, LoopEdge::Inside, LoopEdge::Inside];
    let good = ring(world.piece(1), &world.shapes[1], LINE, &edges);
    let halves = Step::Halves { of_p: true, across: false };
    let steps = vec![halves.clone(), good.clone(), empty(&[1.0]), good.clone(), empty(&[1.0])];
    assert_eq!(world.proof(steps).check(&world.triangles), Ok(()), "the rows of each half hold");
    // The second half has no loop, and so no row.
    let steps = vec![halves, good, empty(&[1.0]), empty(&[1.0])];
    assert_eq!(
        world.proof(steps).check(&world.triangles).err(),
        WEIGHTS,
        "a row of the first half in the second"
    );
}

/// A viewcell so small that products of its coordinates are below the least number: sides of lines from it
/// are not known, though no rounding is seen.
#[test]
fn sides_that_underflow_are_unsure() {
    for e in [1e-315, 1e-200, 5e-324] {
        let mut world = World::new(TARGET, &[[[40.0, 0.0, 0.0], [41.0, 0.0, 0.0], [40.5, -1.0, -1.0]]]);
        world.cell = CellBox { min: DVec3::splat(-e), max: DVec3::new(0.0, e, e) };
        world.clearance = 1.0 / 128.0;
        let ring = [40.0, 41.0, 40.5].map(|x| (DVec3::new(x, e, e), 3));
        let step = || Step::Loop {
            piece: world.piece(1),
            ring: ring.to_vec().into(),
            side: 1.0,
            edges: INSIDE.to_vec().into(),
        };
        // All lines to the target rise, and the occluder hangs down.
        let proof = world.proof(vec![step(), step(), step()]);
        assert_eq!(proof.check(&world.triangles).err(), LOOP, "coordinates of {e}");
    }
}

/// A sliver of 2e-5 m between two small boxes, and a loop 2e-7 m off its plane: in `f64`, the cross product
/// of two of its sides is as far off. All segments pass inside the loop and miss the sliver.
#[test]
fn loops_off_the_plane_of_a_sliver_are_refused() {
    let sliver = [
        [-0.000_351_331_66, -7.345_137e-7, -4.398_289_4e-7],
        [57.239_56, -60.817_387, -54.998_53],
        [28.619_604, -30.408_693, -27.499_266],
    ];
    let loop_ = [
        [28.619_031_444_069_112, -30.408_085_160_570_455, -27.498_715_940_896_24],
        [28.620_176_242_267_14, -30.409_301_508_271_753, -27.499_815_911_511_9],
        [28.620_176_372_133_2, -30.409_301_418_704_97, -27.499_815_875_396_312],
        [28.619_031_573_935_175, -30.408_085_071_003_676, -27.498_715_904_780_65],
    ];
    let around = |x: f64, y: f64, z: f64| [-1e-9, 1e-9].map(|by| DVec3::new(x, y, z) + DVec3::splat(by));
    let [min, max] = around(26.979_731_902_673_37, -31.270_857_803_371_765, -28.252_586_663_436_944);
    let [from, to] = around(30.259_475_912_528_95, -29.546_528_775_903_656, -26.745_945_152_855_604);
    let world = World::new(sliver, &[]);
    let line = [(min + max) / 2.0, (from + to) / 2.0].map(|x| x.to_array());
    let step = ring(world.piece(0), &loop_.map(DVec3::from_array), line, &[const { LoopEdge::Inside }; 4]);
    let target = Target::Box { min: from, max: to };
    let proof = Proof { cell: CellBox { min, max }, target, clearance: 0.0, steps: vec![step; 9] };
    assert_eq!(proof.check(&world.triangles), Err(ProofError::Loop), "a loop off its occluder");
}

/// A sliver so sharp that rounding lets points 1 m beyond its tip count as on the inner side of all sides:
/// the tip is off the line through the other corners by less than 2^-53. A loop beyond it is around no
/// occluder.
#[test]
fn loops_beyond_the_tip_of_a_sliver_are_refused() {
    let along = |part: f32| [40.0, 3659.0 * part, 3813.0 * part];
    let part = 2f32.powi(-12);
    let sliver = [[40.0, 0.0, 0.75 * 2f32.powi(-53)], along(part), along(49.0 * part)];
    let world = World { clearance: 1e-4, ..World::new(sliver, &[]) };
    let beyond = [
        [-2.133_088_926_160_634, -2.222_866_377_548_646],
        [-1.045_192_326_530_675_7, -1.089_182_383_454_896_4],
    ];
    let at = |x: f64, [y, z]: [f64; 2]| DVec3::new(40.0 + x, y, z);
    let [a, b] = beyond;
    let corners = [at(-2.9e-4, a), at(-2.9e-4, b), at(2.9e-4, b), at(2.9e-4, a)];
    let around = |middle: DVec3| [-1e-9, 1e-9].map(|by| middle + DVec3::splat(by));
    // From one side of the sliver's line to the other.
    let middle = (at(0.0, a) + at(0.0, b)) / 2.0;
    let across = DVec3::new(0.0, 3813.0, -3659.0).normalize() * 3.0;
    let [min, max] = around(middle + across);
    let [from, to] = around(middle - across);
    let line = [(min + max) / 2.0, (from + to) / 2.0].map(|x| x.to_array());
    let step = ring(world.piece(0), &corners, line, &[const { LoopEdge::Inside }; 4]);
    let target = Target::Box { min: from, max: to };
    let cell = CellBox { min, max };
    let proof = Proof { cell, target, clearance: world.clearance, steps: vec![step; 4] };
    assert_eq!(proof.check(&world.triangles), Err(ProofError::Loop), "a loop off its occluder");
}
