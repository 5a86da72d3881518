//! Each condition of [`Check::is_on_piece`] alone, just inside and just outside of its margin.

use super::*;

/// A viewcell with x from -80 to -72 before [`TARGET`]. Occluders stand at x = 0, where coordinates are fine
/// enough to be off by less than the error of positions.
fn world(occluders: &[Triangle]) -> (World, f64) {
    let mut world = World::new(TARGET, occluders);
    world.cell = CellBox { min: DVec3::new(-80.0, 0.0, -6.0), max: DVec3::new(-72.0, 8.0, 2.0) };
    let delta = position_error(&world.triangles, &world.cell, Target::Triangle(0), 0.0).unwrap();
    (world, delta)
}

/// Returns whether the check takes a ring for one on polygon `piece`.
fn holds(world: &World, piece: u32, ring: &[(DVec3, Option<usize>)]) -> bool {
    let (check, sight) = world.node_from(-DVec3::X);
    check.is_on_piece(&sight, piece, ring)
}

fn untagged(corners: &[[f32; 3]]) -> Vec<(DVec3, Option<usize>)> {
    corners.iter().map(|&x| (Vec3::from_array(x).as_dvec3(), None)).collect()
}

const UPRIGHT: Triangle = [[0.0, -300.0, -100.0], [0.0, 300.0, -100.0], [0.0, 0.0, 400.0]];

/// Two triangles that are flat, and convex, up to one error of positions.
#[test]
fn polygons_are_flat_and_convex_up_to_one_error() {
    let (_, delta) = world(&[UPRIGHT]);
    let [a, b, c] = UPRIGHT;
    let bent = |by: f64| {
        let d = [(by * delta) as f32, -300.0, 300.0];
        ([[a, b, c], [a, c, d]], [a, b, c, d])
    };
    // The middle of a side is half as far off that side as the end is off the side's other half.
    let dented = |by: f64| {
        let [low, high, away] = [[0.0, 0.0, -100.0], [0.0, 0.0, 100.0], [0.0, -400.0, 0.0]];
        let middle = [0.0, (-0.5 * by * delta) as f32, 0.0];
        ([[low, middle, away], [middle, high, away]], [low, middle, high, away])
    };
    for (by, expected) in [(0.0, true), (0.9, true), (1.1, false), (1e12, false)] {
        for (shape, (triangles, corners)) in [("bent", bent(by)), ("dented", dented(by))] {
            let (mut world, own) = world(&triangles);
            assert_eq!(own, delta, "{shape}: the error of positions");
            let piece = world.triangles.push_piece(&[1, 2]);
            assert_eq!(holds(&world, piece, &untagged(&corners)), expected, "{shape} by {by} errors");
        }
    }
}

/// A corner off its occluder by two errors of positions and three clearances.
#[test]
fn corners_are_near_their_occluder() {
    for clearance in [0.0, 1.0 / 128.0] {
        let (mut world, delta) = world(&[UPRIGHT]);
        world.clearance = clearance;
        let reach = 3.0 * clearance + 2.0 * delta;
        for (part, expected) in [(0.0, true), (0.97, true), (1.03, false)] {
            let mut ring = untagged(&UPRIGHT);
            ring[0].0.x += part * reach;
            // Over the middle of the occluder, far from its sides.
            ring[1].0 = DVec3::new(part * reach, 0.0, 50.0);
            for ring in [[ring[0], ring[2]], [ring[1], ring[2]]] {
                let found = holds(&world, world.piece(1), &ring);
                assert_eq!(found, expected, "clearance {clearance}: {ring:?} off by {part} of {reach}");
            }
        }
    }
}

/// A one-sided occluder whose plane divides the viewcell's face.
#[test]
fn occluders_that_show_their_back_to_some_viewpoints_are_refused() {
    let [a, b, c] = [[-40.0, 4.0, -100.0], [40.0, 4.0, -100.0], [0.0, 4.0, 400.0]];
    for one_sided in [false, true] {
        for shape in [[a, b, c], [a, c, b]] {
            let (mut world, _) = world(&[shape]);
            let mut scene = Scene::new();
            for (shape, one_sided) in [(TARGET, false), (shape, one_sided)] {
                let triangle = shape.map(Vec3::from_array);
                let object = Object::new(Aabb::from_points(triangle));
                let id = scene.insert(Object { occluder: true, one_sided, ..object });
                scene.set_triangles(id, [triangle]).unwrap();
            }
            world.triangles = SceneTriangles::new(&scene);
            let found = holds(&world, world.piece(1), &untagged(&shape));
            assert_eq!(found, !one_sided, "{shape:?}, one-sided: {one_sided}");
        }
    }
}

/// A corner that is one of the target's, by number and position. The target's plane is tilted, so that
/// heights over it are rounded.
#[test]
fn corners_of_the_target_are_at_their_positions() {
    let target = [[80.0, 2.0, 2.0], [80.5, 6.0, 2.0], [80.25, 4.0, 6.0]];
    for k in 0..3 {
        let shape = [target[k], [40.0, -300.0, -100.0], [40.0, 300.0, -100.0]];
        let (mut world, _) = world(&[]);
        world.triangles = scene_of(&[(target, true), (shape, true)]);
        world.shapes = [target, shape].map(|t| t.map(|x| Vec3::from_array(x).as_dvec3())).to_vec();
        let (check, _) = world.node_from(-DVec3::X);
        let tag = check.tag(world.triangles.vertices(1)[0]);
        assert!(tag.is_some(), "corner {k} of the target is one of the occluder");
        let mut ring = untagged(&shape);
        ring[0].1 = tag;
        assert!(holds(&world, world.piece(1), &ring), "corner {k} at its position");
        ring[0].0 = ring[0].0.lerp(ring[1].0, 0.5);
        assert!(!holds(&world, world.piece(1), &ring), "the tag of corner {k} elsewhere on the occluder");
        ring[0] = (world.shapes[1][0], tag.map(|k| (k + 1) % 3));
        assert!(!holds(&world, world.piece(1), &ring), "the tag of another corner than {k}");
    }
}

/// With a clearance, corners behind a tilted target polygon's plane count as in the plane up to 1.5 `near`.
#[test]
fn corners_near_the_plane_of_the_target_polygon_are_in_it() {
    let target = [[80.0, 2.0, 2.0], [80.5, 6.0, 2.0], [80.25, 4.0, 6.0]];
    let (mut world, _) = world(&[UPRIGHT]);
    world.triangles = scene_of(&[(target, true), (UPRIGHT, true)]);
    world.clearance = 1.0;
    let (check, sight) = world.node_from(-DVec3::X);
    for near in [0.0, 0.5] {
        let sight = Sight { near: Some(near), ..sight };
        let on_plane = sight.q.corners()[0];
        for (part, expected) in [(1.4, near > 0.0), (1.6, false), (-1.4, near > 0.0), (-1.6, false)] {
            let x = on_plane + sight.before_q.normal * part * 0.5;
            assert_eq!(check.is_near_plane_of_q(&sight, x), expected, "{near}: {part} half metres before");
        }
        // One corner is behind a plane by a quarter of a metre, and the others are far in front of it.
        let ring = untagged(&UPRIGHT);
        let normal = (ring[1].0 + ring[2].0 - ring[0].0 * 2.0).normalize();
        let before_q = Half { normal, offset: -normal.dot(ring[0].0) - 0.25 };
        let sight = Sight { before_q, ..sight };
        let found = check.is_on_piece(&sight, world.piece(1), &ring);
        assert_eq!(found, near > 0.0, "{near}: a corner behind the plane");
    }
}
