//! Conditions of [`Check::surface_blocks`], just inside and just outside of their margins.

use super::*;

/// A viewcell with x from -80 to -72, [`TARGET`], and a wall at x = 0 that hides the target, with the error
/// of positions.
fn world() -> (World, f64) {
    let wall = WALL.map(|[_, y, z]| [0.0, y, z]);
    let mut world = World::new(TARGET, &[wall]);
    world.cell = CellBox { min: DVec3::new(-80.0, 0.0, -6.0), max: DVec3::new(-72.0, 8.0, 2.0) };
    let delta = position_error(&world.triangles, &world.cell, Target::Triangle(0), 0.0).unwrap();
    (world, delta)
}

/// Returns a scene of [`TARGET`] and of a one-sided triangle, which occlude.
fn with_one_sided(shape: Triangle) -> SceneTriangles {
    let mut scene = Scene::new();
    for (shape, one_sided) in [(TARGET, false), (shape, true)] {
        let triangle = shape.map(Vec3::from_array);
        let object = Object::new(Aabb::from_points(triangle));
        let id = scene.insert(Object { occluder: true, one_sided, ..object });
        scene.set_triangles(id, [triangle]).unwrap();
    }
    SceneTriangles::new(&scene)
}

/// Sample lines whose ends are off the viewcell polygon or the target polygon by an error of positions.
#[test]
fn sample_lines_begin_and_end_within_an_error_of_the_polygons() {
    let (world, delta) = world();
    let (check, sight) = world.node_from(-DVec3::X);
    let line = [DVec3::new(-72.0, 8.0, 0.0), DVec3::new(80.0, 4.0, 2.0)];
    assert!(check.surface_blocks(&sight, &[1], &[], line), "a line from and to the polygons' sides");
    for (end, out) in [(0, DVec3::X), (0, -DVec3::X), (0, DVec3::Y), (1, DVec3::X), (1, -DVec3::Z)] {
        for (part, expected) in [(0.95, true), (1.0, true), (1.05, false)] {
            let mut line = line;
            line[end] += out * (part * delta);
            let found = check.surface_blocks(&sight, &[1], &[], line);
            assert_eq!(found, expected, "end {end} off by {part} errors along {out}");
        }
    }
}

/// Sample lines from a viewcell that is a point begin within an error of positions of the point, not anywhere
/// in the planes of its faces.
#[test]
fn sample_lines_of_a_viewcell_that_is_a_point_begin_there() {
    let (mut world, delta) = world();
    let eye = DVec3::new(-72.0, 4.0, 0.0);
    world.cell = CellBox { min: eye, max: eye };
    let beside = WALL.map(|[_, y, z]| [0.0, y + 400.0, z]);
    for (wall, parts) in [(WALL.map(|[_, y, z]| [0.0, y, z]), true), (beside, false)] {
        world.triangles = scene_of(&[(TARGET, true), (wall, true)]);
        let (check, sight) = world.node_from(-DVec3::X);
        let holds =
            |start: DVec3| check.surface_blocks(&sight, &[1], &[], [start, DVec3::new(80.0, 4.0, 3.0)]);
        for out in [DVec3::Y, -DVec3::Y, DVec3::Z] {
            let found = [0.0, 0.95, 1.0, 1.05, 1e3].map(|part| holds(eye + out * (part * delta)));
            assert_eq!(found, [parts, parts, parts, false, false], "{wall:?}: beside the point along {out}");
        }
        // The target is seen past the wall beside, which this line crosses.
        let far = eye + DVec3::Y * 800.0;
        assert_ne!(crosses([far, DVec3::new(80.0, 4.0, 3.0)], &world.triangles.corners(1)), None, "{wall:?}");
        assert!(!holds(far), "{wall:?}: a line from far beside the point");
    }
}

/// A one-sided triangle faces viewpoints that are more than two errors of positions before its front.
#[test]
fn fronts_are_faced_from_two_errors_away() {
    let (mut world, delta) = world();
    let [a, b, c] = WALL.map(|[_, y, z]| [0.0, y, z]);
    let mut faced = 0;
    for shape in [[a, b, c], [a, c, b]] {
        world.triangles = with_one_sided(shape);
        let found = [1.0, 1.95, 2.05, 1e9].map(|part| {
            world.cell.max.x = -part * delta;
            let (check, sight) = world.node_from(-DVec3::X);
            check.faces(&sight, 1)
        });
        assert!(found == [false; 4] || found == [false, false, true, true], "{shape:?}: {found:?}");
        faced += u32::from(found[3]);
    }
    assert_eq!(faced, 1, "the front of one of the triangles is before the viewcell");
}

/// A triangle with a corner of the target is on one side of the target's plane by more than three errors of
/// positions, and its own plane more than six from the end of the sample line.
#[test]
fn triangles_at_the_target_are_off_its_plane_and_off_the_line() {
    let (world, delta) = world();
    let (check, sight) = world.node_from(-DVec3::X);
    let end = DVec3::new(80.0, 4.0, 3.0);
    // Returns whether a triangle in a plane along x holds, with two corners before the target's plane, and
    // this plane beside the end of the line.
    let holds = |heights: [f64; 2], beside: f64| {
        let y = end.y + beside;
        let corner = |height: f64, z: f64| DVec3::new(80.0 - height, y, z);
        let corners = [corner(heights[0], 20.0), corner(heights[1], 30.0), corner(30.0, 25.0)];
        check.touches_beside(&sight, &corners, [None, None, Some(0)], end)
    };
    for (part, expected) in [(2.9, false), (3.1, true)] {
        for at in [0, 1] {
            for sign in [1.0, -1.0] {
                let mut heights = [sign; 2];
                heights[at] *= part * delta;
                assert_eq!(holds(heights, 1.0), expected, "corner {at} off by {part} errors times {sign}");
            }
        }
        assert_eq!(holds([1.0, 1.0], 2.0 * part * delta), expected, "the line off by {part} twice");
    }
    assert!(!holds([1.0, -1.0], 1.0) && !holds([-1.0, 1.0], 1.0), "corners on both sides of the plane");
    assert!(holds([-1.0, -1.0], 0.0), "a triangle behind the target, in a plane through the line's end");
}

/// A triangle all of whose corners are the target's: no height says on which side of the target it is.
#[test]
fn a_triangle_of_corners_of_the_target_is_on_no_side_of_it() {
    let (world, _) = world();
    let (check, sight) = world.node_from(-DVec3::X);
    let corners = &world.shapes[0];
    let tags = [0, 1, 2].map(Some);
    for end in [[80.0, 4.0, 3.0], [70.0, 4.0, 3.0]] {
        let found = check.touches_beside(&sight, corners, tags, DVec3::from_array(end));
        assert!(!found, "the target, with a line that ends at {end:?}");
    }
}

/// With a clearance, viewpoints on the plane of a one-sided triangle are before it if the plane is
/// perpendicular to an axis, and only then.
#[test]
fn fronts_in_the_plane_of_viewpoints_are_faced_with_a_clearance() {
    let [a, b, c] = WALL.map(|[_, y, z]| [-72.0, y, z]);
    // All corners but one have the coordinate x of the viewpoints, which are behind or on both sides.
    let leaning = [a, b, [-70.0, c[1], c[2]]];
    let turns = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    let leaning = turns.map(|turn| (turn.map(|k| leaning[k]), false));
    let cases = [([a, b, c], true), ([a, c, b], true)].into_iter().chain(leaning);
    let mut faced = [0; 2];
    for (shape, is_upright) in cases {
        for clearance in [0.0, 1.0 / 128.0] {
            let (mut world, _) = world();
            world.clearance = clearance;
            world.triangles = with_one_sided(shape);
            let (check, sight) = world.node_from(-DVec3::X);
            let found = check.faces(&sight, 1);
            if is_upright {
                assert_eq!(found, clearance > 0.0, "{shape:?}, clearance {clearance}");
            }
            faced[usize::from(is_upright)] += u32::from(found);
        }
    }
    assert_eq!(faced, [6, 2], "the leaning triangle is faced from one side, whatever the clearance");
}

/// A one-sided wall is a surface for viewpoints before its front, and for no others.
#[test]
fn surfaces_that_show_their_back_are_refused() {
    let [a, b, c] = WALL.map(|[_, y, z]| [0.0, y, z]);
    let line = [DVec3::new(-72.0, 4.0, 0.0), DVec3::new(80.0, 4.0, 3.0)];
    let found = [[a, b, c], [a, c, b]].map(|shape| {
        let (mut world, _) = world();
        world.triangles = with_one_sided(shape);
        let (check, sight) = world.node_from(-DVec3::X);
        let corners = world.triangles.corners(1).map(|x| (x, None));
        let on_piece = check.is_on_piece(&sight, world.piece(1), &corners);
        assert_eq!(on_piece, check.surface_blocks(&sight, &[1], &[], line), "{shape:?}: loop and surface");
        on_piece
    });
    assert_ne!(found[0], found[1], "one winding of a one-sided wall faces the viewcell");
}

/// A line that ends in the plane of a triangle, and one that passes beside it.
#[test]
fn lines_that_end_in_the_plane_of_a_triangle_are_unsure() {
    let t = WALL.map(|[_, y, z]| DVec3::new(0.0, f64::from(y), f64::from(z)));
    let at = |x: f64| DVec3::new(x, 4.0, 3.0);
    for (x, expected) in [(8.0, Some(true)), (0.0, None), (-8.0, Some(false))] {
        for line in [[at(-72.0), at(x)], [at(x), at(-72.0)]] {
            assert_eq!(crosses(line, &t), expected, "{line:?}");
        }
    }
}

/// Surfaces that reach through the planes of both polygons, and are apart from the polygons.
#[test]
fn surfaces_through_the_planes_of_both_polygons_hold() {
    let (mut world, _) = world();
    let wall = [[-120.0, -900.0, -300.0], [-120.0, 900.0, -300.0], [200.0, 0.0, 900.0]];
    world.triangles = scene_of(&[(TARGET, true), (wall, true)]);
    let (check, sight) = world.node_from(-DVec3::X);
    let line = [DVec3::new(-72.0, 4.0, 0.0), DVec3::new(80.0, 4.0, 3.0)];
    assert!(check.surface_blocks(&sight, &[1], &[], line), "a wall that leans over the target");
    // Beside the viewcell polygon and in its plane, where only planes around all segments separate.
    let beside = [[-72.0, -20.0, 61.0], [-72.0, 40.0, -59.0], [-72.0, 60.0, 60.0]];
    world.triangles = scene_of(&[(TARGET, true), (wall, true), (beside, true)]);
    let (check, sight) = world.node_from(-DVec3::X);
    assert!(!check.is_apart(&sight, &world.triangles.corners(2)), "no plane of one polygon separates it");
    assert!(check.surface_blocks(&sight, &[1, 2], &[], line), "a wall, and a triangle beside the viewcell");
}

/// Edges that lines pass on both sides, and no segment meets: behind the viewcell, behind the target, and
/// from a corner of the target to behind it.
#[test]
fn edges_beyond_the_ends_of_segments_are_missed() {
    let (world, _) = world();
    let (check, sight) = world.node_from(-DVec3::X);
    let line = LINE.map(DVec3::from_array);
    for (x, expected) in [(-200.0, true), (200.0, true), (0.0, false)] {
        let edge = [-9.0, 9.0].map(|z| (DVec3::new(x, 4.0, z), None));
        assert_eq!(check.is_missed(&sight, &edge, false, line), expected, "an edge at {x}");
    }
    // Behind a tilted polygon, but not behind the farthest of its points.
    let tilted = [[80.0, 2.0, 2.0], [86.0, 6.0, 2.0], [83.0, 4.0, 6.0]].map(DVec3::from_array);
    let behind = tilted[2] - DVec3::Z * 3.0 + DVec3::new(2.0, -3.0, 0.0) * 0.25;
    let edge = [-9.0, 9.0].map(|z| (behind + DVec3::Z * z, None));
    for (p, q) in [(sight.p, Polygon::new(&tilted)), (Polygon::new(&tilted), sight.p)] {
        assert!(
            check.is_missed(&Sight { p, q, ..sight }, &edge, false, line),
            "an edge behind {p:?} or {q:?}"
        );
    }
    let edge = [(world.shapes[0][0], Some(0)), (DVec3::new(90.0, 5.0, 5.0), None)];
    let found = [false, true].map(|from_before| check.is_missed(&sight, &edge, from_before, line));
    assert_eq!(found, [false, true], "an edge from a corner of the target to behind it");
}

/// A viewcell that is a point, and an edge to a corner of the target, in one plane across an axis. A sample
/// line to that corner meets the edge, with a side of exactly 0. One to the inside of the target does not.
#[test]
fn sample_lines_to_an_end_of_an_edge_meet_it() {
    let (mut world, _) = world();
    let eye = DVec3::new(-72.0, 2.0, 0.0);
    world.cell = CellBox { min: eye, max: eye };
    let (check, sight) = world.node_from(-DVec3::X);
    let corner = world.shapes[0][0];
    let edge = [(corner, Some(0)), (DVec3::new(70.0, 2.0, 3.0), None)];
    for (end, expected) in [(corner, false), (DVec3::new(80.0, 4.0, 3.0), true)] {
        assert_eq!(check.is_missed(&sight, &edge, false, [eye, end]), expected, "a sample line to {end}");
    }
}

/// Triangles that only one kind of plane separates from the viewcell polygon.
#[test]
fn each_kind_of_plane_separates() {
    let (world, delta) = world();
    let (check, sight) = world.node_from(-DVec3::X);
    let at = DVec3::new;
    let corner = at(-72.0, 8.0, 2.0);
    let off = corner + DVec3::splat(1.0 / 3.0);
    let skew = [at(1.0, -1.0, 3.0), at(1.0, 1.0, 0.0)];
    let middle = at(-71.5, 8.5, -2.0);
    let cases = [
        ("the polygon's", [at(-71.0, 4.0, -2.0), at(-60.0, 4.5, -1.5), at(-59.0, 3.6, -2.2)]),
        (
            "the triangle's",
            [off + at(100.0, -100.0, 0.0), off + at(0.0, 100.0, -100.0), off + at(-100.0, 0.0, 100.0)],
        ),
        ("one across the polygon", [at(-72.0, 9.0, -2.0), at(-72.0, 12.0, -3.0), at(-72.0, 12.0, 0.0)]),
        ("one along two sides", [middle + skew[0] * 40.0, middle - skew[0] * 40.0, middle + skew[1] * 60.0]),
    ];
    for (kind, triangle) in cases {
        assert!(check.is_apart(&sight, &triangle), "{kind}: {triangle:?}");
        let turned = [triangle[1], triangle[2], triangle[0]];
        assert!(check.is_apart(&sight, &turned), "{kind}: {turned:?}");
    }
    for (gap, expected) in [(2.7, false), (3.3, true)] {
        let x = -72.0 + gap * delta;
        let triangle = [at(x, -90.0, -90.0), at(x, 90.0, -90.0), at(x, 4.0, 90.0)];
        assert_eq!(check.is_apart(&sight, &triangle), expected, "{gap} errors before the polygon");
    }
}
