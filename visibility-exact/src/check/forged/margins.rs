//! Forged proofs that are wrong by less than a margin: of sides, polygons of occluders, weights and corners.

use super::*;

/// Lines pass these edges within the error of positions: the proof is refused for either sign of the side.
#[test]
fn edges_within_the_error_of_positions_are_not_passed() {
    let target = [[72.0, 2.0, 0.5], [72.0, 6.0, 0.5], [72.0, 4.0, 2.0]];
    // The upper edge of the occluder touches the segments from the viewcell face's upper side to the target's
    // upper corner.
    let mut world = World::new(target, &[HALF_WALL.map(|[x, y, z]| [x, y, z + 1.0])]);
    let delta = position_error(&world.triangles, &world.cell, Target::Triangle(0), 0.0).unwrap();
    let line = [[8.0, 4.0, 4.0], [72.0, 4.0, 1.0]];
    let Step::Loop { piece, ring, side, edges } = ring(world.piece(1), &world.shapes[1], line, &INSIDE)
    else {
        unreachable!()
    };
    let with = |side| vec![Step::Loop { piece, ring: ring.clone(), side, edges: edges.clone() }];
    for (lower, error) in [(0.0, LOOP), (0.2, LOOP), (400.0, None)] {
        world.cell.max.z = 8.0 - lower * delta;
        assert_eq!(world.proof(with(side)).check(&world.triangles).err(), error, "{lower}");
        for scale in [1e30, f64::INFINITY, f64::NAN, -1.0, 0.0] {
            assert!(world.proof(with(side * scale)).check(&world.triangles).is_err(), "{lower} {scale}");
        }
    }
}

/// The target is halved, and the step of one half is correct. The step of the other half is forged: its
/// occluder has a corner of the target, but leaves a region at the middle of the target's side visible. The
/// corner of the halved polygon there is a mean of two corners of the target, of which the occluder has only
/// one, so it must not count as a point of the occluder's edge.
#[test]
fn mixtures_of_other_corners_are_not_on_an_edge() {
    let at_corner = [TARGET[2], [79.0, 4.0, -200.0], [79.0, -200.0, 6.5]];
    // Occluders below and above the line from (2, 2) through (5, 4), in y and z.
    let below = [[79.0, -298.0, -197.7], [79.0, 302.0, 202.3], [79.0, 300.0, -400.0]];
    let world = World::new(TARGET, &[at_corner, below]);
    let Step::Loop { piece, ring: corners, side, edges } =
        ring(world.piece(1), &world.shapes[1], [LINE[0], [80.0, 3.5, 3.5]], &INSIDE)
    else {
        unreachable!()
    };
    let corners = corners.iter().zip([2, 3, 3]).map(|(&(x, _), tag)| (x, tag)).collect();
    let forged = Step::Loop { piece, ring: corners, side, edges };
    let hidden = ring(world.piece(2), &world.shapes[2], [LINE[0], [80.0, 4.0, 2.5]], &INSIDE);
    let halves = Step::Halves { of_p: false, across: false };
    let seen = [[8.0, 4.0, 4.0], [80.0, 4.5, 4.25]];
    assert_eq!(
        world.error(seen, vec![halves.clone(), hidden.clone(), forged.clone()]),
        LOOP,
        "a ring whose corners mix other corners"
    );
    // The step of the first half is accepted.
    assert_eq!(
        world.proof(vec![halves, hidden]).check(&world.triangles).err(),
        MALFORMED,
        "the second half has no step"
    );
}

/// Loops on polygons that do not occlude, or are not convex, or not flat, so that lines pass between their
/// triangles.
#[test]
fn pieces_that_are_no_convex_polygon_of_occluders_are_refused() {
    let of = |shapes: &[(Triangle, bool)]| {
        let mut world = World::new(TARGET, &[]);
        world.triangles = scene_of(shapes);
        world.shapes = shapes
            .iter()
            .filter(|(_, occluder)| *occluder)
            .map(|(t, _)| t.map(|x| Vec3::from_array(x).as_dvec3()))
            .collect();
        world
    };
    let refused = |world: World, piece: u32, corners: &[DVec3]| {
        let edges = vec![LoopEdge::Inside; corners.len()];
        assert_eq!(
            world.error(LINE, vec![ring(piece, corners, LINE, &edges)]),
            LOOP,
            "piece {piece} with the corners {corners:?}"
        );
    };
    let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z).as_dvec3();
    let mut world = of(&[(TARGET, true), (WALL, false)]);
    let piece = world.triangles.push_piece(&[1]);
    refused(world, piece, &WALL.map(|[x, y, z]| at(x, y, z)));
    // Two triangles in one plane that do not touch.
    let left = [[40.0, -300.0, -100.0], [40.0, -30.0, 4.0], [40.0, -300.0, 400.0]];
    let right = left.map(|[x, y, z]| [x, -y, z]);
    let mut world = of(&[(TARGET, true), (left, true), (right, true)]);
    let piece = world.triangles.push_piece(&[1, 2]);
    let corners = [left[0], right[0], right[2], left[2]].map(|[x, y, z]| at(x, y, z));
    refused(world, piece, &corners);
    // Two triangles with a side in common, behind the viewcell.
    let (low, high) = ([-50.0, 4.0, -400.0], [-50.0, 4.0, 800.0]);
    let (left, right) = ([40.0, -300.0, 4.0], [40.0, 300.0, 4.0]);
    let mut world = of(&[(TARGET, true), ([left, low, high], true), ([right, high, low], true)]);
    let piece = world.triangles.push_piece(&[1, 2]);
    let between = |[x, y, z]: [f32; 3], b: [f32; 3]| at(x, y, z).lerp(Vec3::from_array(b).as_dvec3(), 0.3);
    let corners = [between(left, low), between(right, low), between(right, high), between(left, high)];
    refused(world, piece, &corners);
}

/// Returns a node of all segments from polygon `p` to polygon `q`, independent of any scene.
fn node(p: &[DVec3], q: &[DVec3], near: Option<f64>) -> Sight {
    let half = Half { normal: DVec3::X, offset: 1e9 };
    Sight { p: Polygon::new(p), q: Polygon::new(q), before_p: half, before_q: half, near }
}

/// Three edges that a line from the viewcell's face to the target passes on the given sides, by exact
/// integers.
#[test]
fn corners_with_lines_are_refused() {
    let world = World::new(TARGET, &[]);
    let (steps, target_vertices) = ([].iter(), vec![]);
    let check = Check {
        triangles: &world.triangles,
        clearance: 0.0,
        delta: 1e-13,
        target_vertices,
        steps,
        splits: 0,
    };
    let mut random = Random(5);
    let (mut tried, mut excluded) = (0, 0);
    for round in 0..90_000 {
        let mut int = |r: i32| DVec3::from_array(core::array::from_fn(|_| f64::from(random.between(-r, r))));
        let r = [1, 4, 16, 30][round / 6 % 4];
        let (p, q) = (int(20) * 2.0, int(20) * 2.0);
        let s = if round % 2 == 0 { r } else { 0 };
        let (p, q) = ([p, p + int(s) * 2.0, p + int(s) * 2.0], [q, q + int(r) * 2.0, q + int(r) * 2.0]);
        let edges = [int(12), int(12), int(12)].map(|a| [a, a + int(9)]);
        let sight = node(&p, &q, None);
        let sides = |p: DVec3, q: DVec3| edges.map(|[a, b]| sign((q - p).dot((a - p).cross(b - p))));
        // The line ends at a corner of the target or at the middle of its side.
        let seen = sides(p[round % 2], (q[0] + q[round / 3 % 2]) * 0.5);
        let rows: [Divider; 3] =
            core::array::from_fn(|k| ([(edges[k][0], None), (edges[k][1], None)], seen[k]));
        if seen.iter().all(|x| *x != 0.0) {
            tried += 1;
            assert!(!check.corner_excludes(&sight, [&rows[0], &rows[1], &rows[2]]), "{round}");
        }
        // No line between corners of an excluded node passes the three edges on these sides.
        let rows = rows.map(|(edge, sign)| (edge, -sign));
        if seen.iter().all(|x| *x != 0.0) && check.corner_excludes(&sight, [&rows[0], &rows[1], &rows[2]]) {
            excluded += 1;
            let is_inside = |p: DVec3, q: DVec3| sides(p, q).iter().zip(&seen).all(|(x, y)| *x == -*y);
            assert!(!p.iter().any(|p| q.iter().any(|q| is_inside(*p, *q))), "{round}");
        }
    }
    assert!(tried > 60_000 && excluded > 100, "{tried} {excluded}");
}

/// Three edges that a line along z passes on the given sides. They must not exclude the line where positions
/// may be wrong by `DELTA`: in each case such an error changes a sign that [`Check::corner_excludes`] relies
/// on. In the first case, moving the ends of the line changes the sign of c . d for one edge. In the second,
/// moving the ends of another edge does. In the third, moving the ends of the line changes the sign of the
/// form. In the first two cases the line is far from the edges.
#[test]
fn corners_within_the_errors_of_positions_are_refused() {
    const DELTA: f64 = 1.0 / 256.0;
    let (long, size) = (64.0, 256.0);
    let at = DVec3::new;
    let ends = [DVec3::ZERO, DVec3::Z];
    let corner = |far: f64| at(far, -2.0 * long, 0.0);
    let first = corner(-2.0 * long / DELTA);
    let second = corner(-4.0 * long * long / DELTA);
    let beside = |x: DVec3, t: DVec3| [x, x + t];
    let [up, down] = [DVec3::Y * long, DVec3::Y * -long];
    let cases = [
        (
            [at(0.0, DELTA, 0.0), at(0.0, -DELTA, 1.0)],
            [
                beside(first, down),
                beside(first + up, at(long, 0.0, long)),
                beside(first, at(-long, -2.0 * DELTA * long, long)),
            ],
            DVec3::ZERO,
        ),
        (
            ends,
            [
                beside(second, down),
                beside(second + up, DVec3::X * long),
                beside(second, at(-long, -DELTA, 0.0)),
            ],
            DVec3::Y * DELTA,
        ),
        (
            [at(-DELTA, -DELTA, 0.0), at(DELTA, DELTA, 1.0)],
            [
                beside(at(0.0, -DELTA, 0.0), DVec3::X * size),
                beside(at(DELTA, DELTA, size), at(-size, size, 0.0)),
                beside(at(-DELTA, 0.0, 0.0), DVec3::Y * -size),
            ],
            DVec3::ZERO,
        ),
    ];
    let world = World::new(TARGET, &[]);
    for (number, (moved, edges, error)) in cases.into_iter().enumerate() {
        // These products are exact, since all numbers have few digits.
        for [a, b] in edges {
            let side = (ends[1] - ends[0]).dot((a - ends[0]).cross(b - ends[0]));
            assert!(side > 0.0, "{number}: the line is on another side of an edge: {side}");
        }
        let (steps, target_vertices) = ([].iter(), vec![]);
        let (triangles, clearance) = (&world.triangles, 0.0);
        let check = Check { triangles, clearance, delta: DELTA, target_vertices, steps, splits: 0 };
        let sight = node(&[moved[0]; 3], &[moved[1]; 3], None);
        let rows: [Divider; 3] = core::array::from_fn(|k| {
            let error = if k == 1 { error } else { DVec3::ZERO };
            ([(edges[k][0] - error, None), (edges[k][1] + error, None)], 1.0)
        });
        let holds = check.corner_excludes(&sight, [&rows[0], &rows[1], &rows[2]]);
        assert!(!holds, "{number}: three edges exclude a line that passes them on their sides");
    }
}

/// Three edges around a line, all next to one point of it. The line passes inside of each, and outside of
/// each once all ends have moved by their error: then the products of ends and directions are wrong, and
/// nothing else.
#[test]
fn corners_at_a_point_within_the_errors_of_positions_are_refused() {
    const DELTA: f64 = 1.0 / 256.0;
    let size = 256.0;
    let at = DVec3::new;
    let around =
        [(at(0.0, -1.0, 0.0), DVec3::X), (at(1.0, 0.0, 0.0), at(-1.0, 1.0, 0.0)), (-DVec3::X, -DVec3::Y)];
    let world = World::new(TARGET, &[]);
    let (steps, target_vertices) = ([].iter(), vec![]);
    let (triangles, clearance) = (&world.triangles, 0.0);
    let check = Check { triangles, clearance, delta: DELTA, target_vertices, steps, splits: 0 };
    let sight = node(&[DVec3::ZERO; 3], &[DVec3::Z; 3], None);
    for (away, expected) in [(0.5, false), (-0.5, false), (-40.0, true)] {
        let rows: [Divider; 3] = around.map(|(off, along)| {
            let start = off * (away * DELTA);
            ([(start, None), (start + along * size, None)], 1.0)
        });
        let found = check.corner_excludes(&sight, [&rows[0], &rows[1], &rows[2]]);
        assert_eq!(found, expected, "a line that passes {away} errors inside of three edges");
    }
}

fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

/// One line meets three edges, so the form is 0 up to rounding. Products of the coordinates have more than
/// 106 bits, and positions count as exact.
#[test]
fn corners_on_a_line_are_refused() {
    let world = World::new(TARGET, &[]);
    let (steps, target_vertices) = ([].iter(), vec![]);
    let check =
        Check { triangles: &world.triangles, clearance: 1e-4, delta: 0.0, target_vertices, steps, splits: 0 };
    let mut random = Random(6);
    for round in 0..5000 {
        let bits = [30, 46][round % 2];
        let mut int =
            || DVec3::from_array(core::array::from_fn(|_| ((random.bits() as i64) >> (64 - bits)) as f64));
        let (d, t, u) = (int(), int(), int());
        let t = [t, u, d - t - u];
        let (p, q) = (-d * 8.0, d * 8.0);
        let sight = node(&[p; 3], &[q; 3], Some(0.0));
        for sign in [1.0, -1.0] {
            let rows: [Divider; 3] = core::array::from_fn(|k| {
                let x = d * [0.0, 2.0, -1.0][k];
                ([(x - t[k] * 2.0, None), (x + t[k] * 4.0, None)], sign)
            });
            assert!(!check.corner_excludes(&sight, [&rows[0], &rows[1], &rows[2]]), "{round}");
        }
    }
}

/// Three edges in one plane meet a line in one point and are almost parallel. Their coordinates have more
/// than 53 bits, so products of two cancel almost completely, and the form is 0 up to this rounding.
#[test]
fn corners_of_edges_along_each_other_are_refused() {
    let world = World::new(TARGET, &[]);
    let (steps, target_vertices) = ([].iter(), vec![]);
    let check =
        Check { triangles: &world.triangles, clearance: 1e-4, delta: 0.0, target_vertices, steps, splits: 0 };
    let mut random = Random(8);
    for round in 0..5000 {
        let mut unit = || random.fine_range(1.0, 2.0);
        let (y, z) = (unit(), unit());
        // Seen along the line, each end is less than half a turn from the next.
        let small = [unit(), unit()].map(|part| part * 2f64.powi(-40 - round % 8));
        let ends = [[y, z], [-y - small[0], -z + small[1]], [-y + small[1], -z - small[0]]];
        let d = DVec3::X * unit();
        let sight = node(&[-d; 3], &[d; 3], Some(0.0));
        for sign in [1.0, -1.0] {
            let rows: [Divider; 3] = core::array::from_fn(|k| {
                let end = DVec3::new(0.0, ends[k][0], ends[k][1]);
                ([(end, None), (-end * 2f64.powi(-9 - k as i32), None)], sign)
            });
            assert!(
                !check.corner_excludes(&sight, [&rows[0], &rows[1], &rows[2]]),
                "{round}: three edges that a line meets exclude it"
            );
        }
    }
}

/// Lines on both sides of one edge that is given as three rows with different ends. With the chosen weights
/// the sum of sides is 0 up to rounding, and excludes nothing.
#[test]
fn weights_that_cancel_are_refused() {
    let world = World::new(TARGET, &[]);
    let (steps, target_vertices) = ([].iter(), vec![]);
    let check =
        Check { triangles: &world.triangles, clearance: 1e-4, delta: 0.0, target_vertices, steps, splits: 0 };
    let mut random = Random(7);
    for round in 0..3000 {
        let mut int = || DVec3::from_array(core::array::from_fn(|_| f64::from(random.between(-900, 900))));
        let (p, a, b, c) = (int(), int(), int(), int());
        // Lines end at two points on either side of the edge.
        let q = [1.0, -0.371].map(|side| a + (b - a) * 0.5 - p + a + c * side);
        let sight = node(&[p; 3], &[q[0], q[1], q[1]], Some(0.0));
        let (s, t) = (f64::from(1 + (round % 7)), f64::from(3 + (round % 11)));
        let part = f64::from(round) / 3000.0;
        let edge = |from: f64, to: f64| [(a + (b - a) * from, None), (a + (b - a) * to, None)];
        let rows: [Divider; 3] =
            [(edge(0.0, 1.0), 1.0), (edge(-1.0, s - 1.0), -1.0), (edge(2.0, 2.0 + t), 1.0)];
        let weights = [1.0, (1.0 + part * t) / s, part];
        assert!(!check.excludes(&sight, &rows, &weights), "{round}");
    }
}

/// A loop with one corner beside the target and behind the target's plane by less than the error of heights.
/// Its other corners are in front of the plane.
#[test]
fn corners_next_to_the_plane_of_the_target_are_not_before_it() {
    let mut random = Random(8);
    for round in 0..500 {
        let target = plane_through_the_origin(&mut random);
        let normal = unit_normal(&target.map(|x| Vec3::from_array(x).as_dvec3())).unwrap();
        let at = |x: DVec3| x.as_vec3().to_array();
        let far = Vec3::from_array(target[0]).as_dvec3();
        let lateral = normal.cross(far) * 4.0;
        let wall = [at(normal * -1e-20), at(far * 2.0 + lateral + normal), at(far * 2.0 - lateral + normal)];
        let mut world = World::new(target, &[wall]);
        let min = (far * 0.5 + normal * 4000.0).round();
        world.cell = CellBox { min, max: min + DVec3::ONE };
        let (check, sight) = world.node_from(normal);
        let corners = world.shapes[1].map(|x| (x, None));
        assert!(!check.is_on_piece(&sight, world.piece(1), &corners), "{round}");
        // Up to rounding, the corner is on the target's plane.
        assert!(
            sight.before_q.height(corners[0].0).abs() < check.delta,
            "{round}: the corner is on the target's plane, up to rounding"
        );
    }
}

/// Surfaces of two triangles that share an edge, the ridge. It runs from a corner of the target over the
/// target. In one case the other end of the ridge is behind the target's plane by less than rounding, and the
/// triangles rise from the ridge. In the other case it is in front of that plane by less than the margin for
/// errors, and the triangles slope down behind the plane like a tent.
#[test]
fn ridges_next_to_the_plane_of_the_target_are_refused() {
    let mut random = Random(9);
    let mut tried = [0; 2];
    for round in 0..4000 {
        let target = plane_through_the_origin(&mut random);
        let far = Vec3::from_array(target[0]).as_dvec3();
        let normal = unit_normal(&target.map(|x| Vec3::from_array(x).as_dvec3())).unwrap();
        let at = |x: DVec3| x.as_vec3().to_array();
        let lateral = normal.cross(far) * random.fine_range(2.0, 6.0);
        let is_tent = round % 2 == 1;
        let depth = normal * random.fine_range(50.0, 800.0) * if is_tent { -1.0 } else { 1.0 };
        let middle = far * random.fine_range(0.3, 1.2) + depth;
        // The viewcell has the greatest coordinate of all.
        let min = (far * 0.5 + normal * 60_000.0).round();
        let max = min + DVec3::ONE;
        let delta = 128.0 * 2f64.powi(-53) * min.abs().max(max.abs()).max_element();
        let ridge = at(normal * if is_tent { 2.7 * delta } else { -1e-20 });
        let [left, right] = [at(middle + lateral), at(middle - lateral)];
        let mut world = World::new(target, &[[target[0], ridge, left], [target[0], right, ridge]]);
        world.cell = CellBox { min, max };
        let (check, sight) = world.node_from(normal);
        let corners =
            |t: usize, k: usize| (world.shapes[t][k], check.tag(world.triangles.vertices(t as u32)[k]));
        let [far, ridge, left, right] = [corners(1, 0), corners(1, 1), corners(1, 2), corners(2, 1)];
        let parts = if is_tent { [0.3, 0.0, 0.0] } else { [0.5, 0.3, 0.2] };
        let t = &world.shapes[0];
        let line = [sight.p.center(), t[0] * parts[0] + t[1] * parts[1] + t[2] * parts[2]];
        if [[far, left], [left, ridge], [far, right], [right, ridge]]
            .iter()
            .all(|edge| check.is_missed(&sight, edge, true, line))
        {
            tried[usize::from(is_tent)] += 1;
            assert!(!check.surface_blocks(&sight, &[1, 2], &[], line), "{round}");
        }
    }
    assert!(tried.iter().all(|tried| *tried > 50), "{tried:?}");
}
