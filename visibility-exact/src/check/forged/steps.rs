//! Forged steps that the check refuses: numbers of triangles, polygons and rows that do not exist, proofs
//! nested too deeply, too few or too many steps, and targets over whose plane no viewpoint is higher than the
//! clearance, which no proof covers.

use super::*;
use crate::search::SPLITS;

#[test]
fn numbers_beyond_the_scene_are_refused() {
    let world = World::new(TARGET, &[]);
    for t in [1, u32::MAX] {
        let proof = Proof { target: Target::Triangle(t), ..world.proof(vec![]) };
        assert_eq!(proof.check(&world.triangles).err(), MALFORMED, "a target that is triangle {t} of 1");
    }
    assert_eq!(
        world.error(LINE, vec![surface(&[1], LINE)]),
        SURFACE,
        "a surface of a triangle that does not exist"
    );
    let corners = WALL.map(|x| Vec3::from_array(x).as_dvec3());
    assert_eq!(
        world.error(LINE, vec![ring(1, &corners, LINE, &INSIDE)]),
        LOOP,
        "a loop of a piece that does not exist"
    );
    let world = World::new(TARGET, &[HALF_WALL]);
    let edges = [LoopEdge::Inside, LoopEdge::Inside, LoopEdge::Divides];
    let divides = ring(world.piece(1), &world.shapes[1], LINE, &edges);
    assert_eq!(
        world.error(OVER, vec![divides, Step::Corner { edges: [0, 0, 1] }]),
        MALFORMED,
        "a corner of a row that does not exist"
    );
}

/// A proof nested so deeply that a recursive check of it would overflow the stack.
#[test]
fn deep_proofs_are_refused() {
    let world = World::new(TARGET, &[]);
    let halves = vec![Step::Halves { of_p: true, across: false }; 200_000];
    assert_eq!(world.error(LINE, halves), MALFORMED, "200,000 halvings");
}

#[test]
fn nodes_without_a_step_are_refused() {
    let world = World::new(TARGET, &[HALF_WALL]);
    assert_eq!(world.error(OVER, vec![]), MALFORMED, "a proof without steps");
    // The proof has no step for the segments that pass outside of the dividing edge.
    let [below, above] = [[[8.0, 4.0, 2.0], [80.0, 4.0, 2.5]], OVER];
    let edges = [LoopEdge::Inside, LoopEdge::Inside, LoopEdge::Divides];
    let divides = ring(world.piece(1), &world.shapes[1], below, &edges);
    assert_eq!(world.error(above, vec![divides]), MALFORMED, "a division with one part alone");
    let halves = |across| Step::Halves { of_p: false, across };
    let world = World::new(TARGET, &[[[40.0, -300.0, -9.0], [40.0, 0.0, 9000.0], [40.0, 4.0, -9.0]]]);
    let line = [[8.0, 2.0, 4.0], [80.0, 3.0, 2.5]];
    assert_eq!(
        world.error([[8.0, 7.0, 4.0], [80.0, 5.0, 2.5]], vec![halves(false), surface(&[1], line)]),
        SURFACE,
        "a surface for the wrong half"
    );
}

#[test]
fn steps_too_many_are_refused() {
    let world = World::new(TARGET, &[WALL]);
    let steps = vec![surface(&[1], LINE), surface(&[1], LINE)];
    assert_eq!(
        world.proof(steps).check(&world.triangles).err(),
        MALFORMED,
        "a second step of a node that has one"
    );
}

/// A viewcell that reaches less far in front of the target's plane than the clearance. No proof covers the
/// target from there, so an empty proof must be refused. A viewcell that only reaches up to the plane does
/// not see the target, and an empty proof holds.
#[test]
fn targets_seen_from_less_than_the_clearance_are_refused() {
    let mut world = World::new(TARGET, &[]);
    world.clearance = 0.125;
    for (height, error) in [(1.0 / 16.0, MALFORMED), (1.0 / 64.0, MALFORMED), (0.0, None)] {
        let max = DVec3::new(80.0 - height, 8.0, 8.0);
        world.cell = CellBox { min: max - DVec3::splat(1.0 / 256.0), max };
        let from = [max.x, max.y, max.z];
        let to = [80.0, 4.0, 3.0];
        match error {
            None => assert_eq!(
                world.proof(vec![]).check(&world.triangles),
                Ok(()),
                "the target is nearer than the clearance"
            ),
            _ => assert_eq!(world.error([from, to], vec![]), error, "{height}"),
        }
    }
}

/// A viewcell that ends below the plane of a one-sided target, by less than the margin of cuts, which is four
/// errors of positions: an empty proof does not cover it.
#[test]
fn targets_seen_from_next_to_their_plane_are_refused() {
    let shape: Triangle = [[76.0, 2.0, -0.125], [84.0, 4.0, -0.375], [76.0, 6.0, -0.125]];
    let mut scene = Scene::new();
    let triangle = shape.map(Vec3::from_array);
    let object = Object::new(Aabb::from_points(triangle));
    let id = scene.insert(Object { occluder: true, one_sided: true, ..object });
    scene.set_triangles(id, [triangle]).unwrap();
    let mut world = World { triangles: SceneTriangles::new(&scene), ..World::new(shape, &[]) };
    let delta = position_error(&world.triangles, &world.cell, Target::Triangle(0), 0.0).unwrap();
    for (below, error) in [(5.0, None), (3.5, MALFORMED), (1.0, MALFORMED), (-1.0, MALFORMED)] {
        // The plane is at z = 2 where x = 8.
        let max = DVec3::new(8.0, 8.0, 2.0 - below * delta);
        world.cell = CellBox { min: DVec3::new(0.0, 0.0, -6.0), max };
        let found = world.proof(vec![]).check(&world.triangles).err();
        assert_eq!(found, error, "a viewcell that ends {below} errors below the target's plane");
    }
}

/// A wall of one side that divides the viewcell: the parts before and behind it are proven apart.
#[test]
fn viewcells_are_split_by_planes_of_one_sided_triangles() {
    let divider = [[-40.0, 4.0, -300.0], [40.0, 4.0, -300.0], [0.0, 4.0, 400.0]];
    let mut scene = Scene::new();
    for (shape, one_sided) in [(TARGET, false), (WALL, false), (divider, true)] {
        let triangle = shape.map(Vec3::from_array);
        let object = Object::new(Aabb::from_points(triangle));
        let id = scene.insert(Object { occluder: true, one_sided, ..object });
        scene.set_triangles(id, [triangle]).unwrap();
    }
    for clearance in [0.0, 1.0 / 128.0] {
        let world =
            World { triangles: SceneTriangles::new(&scene), clearance, ..World::new(TARGET, &[WALL]) };
        let before = world.triangles.front(2).unwrap().normal.y.signum();
        let from =
            |side: f64| surface(&[1], [[8.0, 4.0 + 2.0 * side * before, 4.0], [80.0 - clearance, 4.0, 3.0]]);
        let split = |triangle| Step::Split { triangle };
        let check = |steps: Vec<Step>| world.proof(steps).check(&world.triangles).err();
        assert_eq!(check(vec![split(2), from(1.0), from(-1.0)]), None, "both parts, clearance {clearance}");
        assert_eq!(check(vec![split(2), from(-1.0), from(1.0)]), SURFACE, "parts exchanged");
        assert_eq!(check(vec![split(2), from(1.0)]), MALFORMED, "one part alone");
        for number in [0, 1, 3, 4, u32::MAX] {
            assert_eq!(check(vec![split(number), from(1.0), from(-1.0)]), MALFORMED, "triangle {number}");
        }
    }
    // Each cut leaves a strip behind it, so the part before the plane can be cut again and again.
    let mut world = World { triangles: SceneTriangles::new(&scene), ..World::new(TARGET, &[WALL]) };
    let nested = |world: &World, count: u32| {
        let mut steps = vec![Step::Split { triangle: 2 }; count as usize];
        steps.push(empty(&[]));
        world.proof(steps).check(&world.triangles).err()
    };
    let found = [SPLITS, SPLITS + 1].map(|count| nested(&world, count));
    assert_eq!(found, [WEIGHTS, MALFORMED], "{SPLITS} cuts and one more");
    world.clearance = 1.0 / 128.0;
    assert_eq!(nested(&world, 2), MALFORMED, "a cut with a clearance is exact, and leaves no strip");
}

/// A corner of the target is none of the target polygon with a clearance, since the polygon is moved.
#[test]
fn corners_of_the_target_have_no_tag_with_a_clearance() {
    let wall = [TARGET[0], [40.0, 300.0, -100.0], [40.0, 100.0, 400.0]];
    for (clearance, error) in [(0.0, None), (1.0 / 128.0, LOOP)] {
        let world = World { clearance, ..World::new(TARGET, &[wall]) };
        let Step::Loop { piece, ring, side, edges } = ring(world.piece(1), &world.shapes[1], LINE, &INSIDE)
        else {
            unreachable!()
        };
        let ring = ring.iter().zip([0, 3, 3]).map(|(&(x, _), tag)| (x, tag)).collect();
        let found = world.proof(vec![Step::Loop { piece, ring, side, edges }]).check(&world.triangles).err();
        assert_eq!(found, error, "clearance {clearance}");
    }
}

/// A viewcell over the target's plane by less than the error of heights, and by more than a clearance that is
/// even smaller.
#[test]
fn clearances_within_the_error_of_positions_are_refused() {
    let mut random = Random(1);
    for round in 0..3000 {
        let [_, a, b] = plane_through_the_origin(&mut random);
        let target = [a, b, core::array::from_fn(|k| -a[k] - b[k])];
        let mut world = World::new(target, &[]);
        let normal = unit_normal(&world.shapes[0]).unwrap();
        let unit = world.triangles.position_error(0.0) / 128.0;
        world.clearance = 1.5 * unit;
        // The farthest corner of the viewcell is 1.6 units over the target's plane.
        let corner = normal.signum() * f64::from((1.6 * unit / normal.abs().element_sum()) as f32);
        world.cell = CellBox { min: corner.min(DVec3::ZERO), max: corner.max(DVec3::ZERO) };
        let seen = [corner, world.shapes[0][0]].map(|x| x.to_array());
        assert_eq!(world.error(seen, vec![]), MALFORMED, "{round}");
    }
}

/// Weights of a true sum, so small that the sides that count against it underflow, and so great that those
/// that count for it overflow. Between a lower and an upper wall, a slot is open.
#[test]
fn weights_that_underflow_or_overflow_are_refused() {
    let at = 0.984375;
    let lower = [[at, -1.0, 0.015625], [at, 1.0, 0.015625], [at, 0.0, -50.0]];
    let upper = [[at, -2.0, 0.109375], [at, 2.0, 0.109375], [at, 0.0, 50.0]];
    let target = [[1.0, -0.125, -0.25], [1.0, 0.125, -0.25], [1.0, 0.0, 0.25]];
    let mut world = World::new(target, &[lower, upper]);
    world.cell = CellBox { min: DVec3::new(-1.0, -0.25, -0.25), max: DVec3::new(0.0, 0.25, 0.25) };
    let seen = [[0.0; 3], [1.0, 0.0, 0.0625]];
    let edges = [LoopEdge::Divides, LoopEdge::Inside, LoopEdge::Inside];
    let [below, above] = [-0.2, 0.2].map(|z| [[0.0, 0.0, z], [1.0, 0.0, z]]);
    let lower = ring(world.piece(1), &world.shapes[1], below, &edges);
    let upper = ring(world.piece(2), &world.shapes[2], above, &edges);
    for weights in [&[5e-324; 3][..], &[1.797e308, 1.797e308, 1.2e308, 1.2e308, 1.2e308]] {
        let mut steps = vec![lower.clone(); 2];
        steps.resize(weights.len(), upper.clone());
        steps.push(empty(weights));
        assert_eq!(world.error(seen, steps), WEIGHTS, "{weights:?}");
    }
}
