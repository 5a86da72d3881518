//! Tests of queries where a condition or a margin decides: eyes, targets and walls on one line, at one
//! height, on bounds of sectors and of the plan.

use super::super::predicates::{MAX_MAGNITUDE, MIN_MAGNITUDE, are_heights, checked, orient};
use super::super::triangulation::NONE;
use super::super::unseen::SeenCones;
use super::super::{
    Opacity, Plan, PlanCells, PlanError, PlanObjects, PlanView, RegionVisibility, UnseenRegion, Visibility,
    Wall,
};
use alloc::vec::Vec;
use visibility_core::glam::DVec3;
use visibility_core::who_sees::{Reach, SightCells};
use visibility_testing::Random;

type Point = [f64; 2];

/// Makes walls around a square, counter-clockwise from its lower side.
fn square(low: f64, high: f64) -> Vec<Wall> {
    let corners = [[low, low], [high, low], [high, high], [low, high]];
    (0..4).map(|k| Wall::new(corners[k], corners[(k + 1) % 4])).collect()
}

fn sorted(list: &[u32]) -> Vec<u32> {
    let mut list = list.to_vec();
    list.sort_unstable();
    list
}

/// Returns the area that a polygon surrounds, positive if it is counter-clockwise.
fn surrounded(polygon: &[Point]) -> f64 {
    let after = polygon.iter().cycle().skip(1);
    polygon.iter().zip(after).map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum()
}

/// A line of sight at just the height at which a wall begins or ends passes: between two points, for a view,
/// and along the wall, where it may then change sides.
#[test]
fn lines_of_sight_along_the_top_of_a_wall_pass() {
    let (from, to) = ([-1.0, 0.0], [1.0, 0.0]);
    let mut answer = Visibility::new();
    for ([low, high], at, seen) in [
        ([0.0, 1.0], 1.0, true),
        ([0.0, 1.0], 0.0, true),
        ([0.0, 1.0], 0.5, false),
        ([1.0, 1.0], 1.0, true),
        ([f64::NEG_INFINITY, f64::INFINITY], 1.0, false),
    ] {
        let plan = Plan::new(&[Wall::new([0.0, -1.0], [0.0, 1.0]).with_heights(low, high)]).unwrap();
        let case = alloc::format!("a line at {at} over a wall from {low} to {high}");
        assert_eq!(plan.sees_at((from, at), (to, at)), Ok(seen), "{case}");
        let mut objects = PlanObjects::new(&plan);
        objects.insert(&plan, &[to]).unwrap();
        plan.look_at(&PlanView::new(from).with_heights(at, at), &objects, &mut answer).unwrap();
        assert_eq!(!answer.objects().is_empty(), seen, "{case}: the view");
    }
    // The line passes the first wall on the right, runs along a low one, and passes the last on the left.
    let plan = Plan::new(&[
        Wall::new([0.0, 0.0], [0.0, 1.0]),
        Wall::new([0.0, 0.0], [2.0, 0.0]).with_heights(0.0, 1.0),
        Wall::new([2.0, 0.0], [2.0, -1.0]),
    ])
    .unwrap();
    for (at, seen) in [([0.5, 0.5], false), ([0.0, 1.0], false), ([1.0, 1.0], true), ([1.0, 1.1], true)] {
        let ends = (([-1.0, 0.0], at[0]), ([3.0, 0.0], at[1]));
        assert_eq!(plan.sees_at(ends.0, ends.1), Ok(seen), "along a wall at heights {at:?}");
    }
    // A one-way wall along the line counts, whichever side it stops; glass does not.
    for (ends, opacity, seen) in [
        ([[0.0, 0.0], [2.0, 0.0]], Opacity::OneWay, false),
        ([[2.0, 0.0], [0.0, 0.0]], Opacity::OneWay, false),
        ([[0.0, 0.0], [2.0, 0.0]], Opacity::Clear, true),
    ] {
        let [a, b] = ends;
        let plan = Plan::new(&[
            Wall::new([0.0, 0.0], [0.0, 1.0]),
            Wall::new(a, b).with_opacity(opacity),
            Wall::new([2.0, 0.0], [2.0, -1.0]),
        ])
        .unwrap();
        assert_eq!(plan.sees([-1.0, 0.0], [3.0, 0.0]), Ok(seen), "along {opacity:?} from {a:?} to {b:?}");
    }
    // High glass in front of a low wall stops nothing above the wall.
    let ends = [[0.0, -1.0], [0.0, 1.0]];
    let wall = |low: f64, high: f64| Wall::new(ends[0], ends[1]).with_heights(low, high);
    let plan = Plan::new(&[wall(0.0, 3.0).with_opacity(Opacity::Clear), wall(0.0, 1.0)]).unwrap();
    let mut objects = PlanObjects::new(&plan);
    objects.insert(&plan, &[to]).unwrap();
    plan.look_at(&PlanView::new(from).with_heights(1.5, 2.0), &objects, &mut answer).unwrap();
    assert_eq!(answer.objects(), [0], "above the wall, through the glass");
}

/// Walls that begin or end at just the height of a line of sight, by whole numbers, let it pass; walls that
/// reach over it by a millionth stop it. The line crosses a wall, or passes the common end of two.
#[test]
fn walls_that_end_at_the_height_of_a_line_let_it_pass() {
    let mut random = Random(31);
    for round in 0..1500 {
        let n = 2 + random.magnitude(16).unsigned_abs() as i64;
        let k = 1 + random.below(n as usize - 1) as i64;
        let d = [1 + random.below(1000) as i64, random.below(1000) as i64];
        let e = [-d[1] - random.below(9) as i64, d[0]];
        let at = |k: i64, m: i64| [0, 1].map(|axis| (k * d[axis] + m * e[axis]) as f64);
        let (of_a, rise) = (random.magnitude(20), random.magnitude(20));
        let [of_a, of_b, height] = [of_a, of_a + n * rise, of_a + k * rise].map(|x| x as f64);
        let size = 1.0 + of_a.abs() + of_b.abs();
        for is_end in [false, true] {
            for (low, high, seen) in [
                (height - size, height, true),
                (height, height + size, true),
                (height - size, height + 1e-6 * size, false),
                (height - 1e-6 * size, height + size, false),
            ] {
                let wall = |m: i64, l: i64| Wall::new(at(k, m), at(k, l)).with_heights(low, high);
                let walls = [wall(1, 0), wall(0, -1)];
                let plan = if is_end { Plan::new(&walls) } else { Plan::new(&[wall(1, -1)]) }.unwrap();
                let ends = ((at(0, 0), of_a), (at(n, 0), of_b));
                let case = alloc::format!("round {round}: {k} of {n} times {d:?}, {low} to {high}, {is_end}");
                assert_eq!(plan.sees_at(ends.0, ends.1), Ok(seen), "{case}");
                assert_eq!(plan.sees_at(ends.1, ends.0), Ok(seen), "{case}: back");
            }
        }
    }
}

/// Each point sees itself, on a vertex, on a wall and beside walls at its height.
#[test]
fn points_see_themselves() {
    let walls = [[0, 0, 1, 0], [1, 0, 2, 0], [2, 0, 2, 1], [0, 2, 3, 2], [3, 0, 3, 2], [1, 0, 1, -1]];
    let walls = walls.map(|ends| ends.map(f64::from));
    let plan = Plan::new(&walls.map(|[a, b, c, d]| Wall::new([a, b], [c, d]))).unwrap();
    for x in -12..24 {
        for y in -12..20 {
            let at = [x, y].map(|x| 0.25 * f64::from(x));
            assert!(plan.sees(at, at).unwrap() && plan.is_straight_path(at, at), "{at:?}");
            assert!(plan.sees_at((at, 1.0), (at, 2.0)).unwrap(), "{at:?} at two heights");
        }
    }
}

/// Rays and lines of sight along a diagonal of the rectangle, which it enters at a corner.
#[test]
fn lines_through_corners_of_the_rectangle() {
    let plan = Plan::from_walls(&[Wall::new([-1.0, 1.0], [1.0, -1.0])], 2.0).unwrap();
    for [x, y] in [[1.0, 1.0], [-1.0, -1.0]] {
        let at = |k: f64| [k * x, k * y];
        assert_eq!(plan.ray(at(5.0), at(6.0)), Ok(None), "a ray away from the corner at {x}, {y}");
        assert_eq!(plan.ray(at(5.0), at(4.0)).unwrap().unwrap().wall, Some(0), "a ray to it");
        assert_eq!(plan.sees(at(6.0), at(5.0)), Ok(true), "a line that ends before it");
        assert_eq!(plan.sees(at(6.0), at(-1.0)), Ok(false), "a line that ends behind the wall");
        assert_eq!(plan.sees(at(6.0), at(0.5)), Ok(true), "a line that ends before the wall");
    }
}

/// Polygons are counter-clockwise, and have the eye as a corner unless it sees all around.
#[test]
fn polygons_have_the_eye_of_limited_views() {
    let plan = Plan::from_walls(&[Wall::new([-1.0, -1.0], [1.0, 0.5])], 2.0).unwrap();
    let [low, high] = plan.bounds();
    let mut answer = Visibility::new();
    for x in [-9.0, low[0], -0.5, high[0], 9.0] {
        for y in [-9.0, low[1], 1.0, high[1], 9.0] {
            let is_inside = low[0] < x && x < high[0] && low[1] < y && y < high[1];
            for range in [f64::INFINITY, 100.0] {
                plan.look(&PlanView::new([x, y]).with_range(range), &mut answer).unwrap();
                let (area, polygon) = (answer.area(), answer.polygon());
                let case = alloc::format!("eye {x}, {y}, range {range}: {polygon:?}");
                assert!(area > 1.0 && (surrounded(polygon) - area).abs() < 1e-9 * area, "{case}");
                assert_eq!(polygon.contains(&[x, y]), !is_inside, "{case}: the eye");
            }
        }
    }
    for range in [f64::INFINITY, 100.0] {
        let away = PlanView::new([9.0, 0.0]).with_sector([10.0, -1.0], [10.0, 1.0]).with_range(range);
        plan.look(&away, &mut answer).unwrap();
        assert!(answer.polygon().is_empty(), "a view away from the plan, range {range}");
    }
    plan.look(&PlanView::new([0.0, 1.0]).with_range(0.0), &mut answer).unwrap();
    assert_eq!(answer.polygon(), [[0.0, 1.0]], "a range of 0");
}

/// Corners at ends of walls are these ends, to the last bit.
#[test]
fn corners_of_polygons_are_ends_of_walls() {
    let mut random = Random(33);
    let mut answer = Visibility::new();
    for round in 0..200 {
        let at = |random: &mut Random, turn: f64| {
            let distance = random.fine_range(1.0, 9.0);
            [distance * turn.cos(), distance * turn.sin()]
        };
        let ends: Vec<Point> = (0..9).map(|k| at(&mut random, 0.7 * f64::from(k))).collect();
        let walls: Vec<_> = (0..9).map(|k| Wall::new(ends[k], ends[(k + 1) % 9])).collect();
        let eye = [0; 2].map(|_| random.fine_range(-0.3, 0.3));
        Plan::new(&walls).unwrap().look(&PlanView::new(eye), &mut answer).unwrap();
        for (end, corner) in ends.iter().flat_map(|end| answer.polygon().iter().map(move |p| (end, p))) {
            let apart = (corner[0] - end[0]).abs() + (corner[1] - end[1]).abs();
            assert!(apart == 0.0 || apart > 1e-9, "round {round}: {corner:?} misses {end:?} by {apart}");
        }
    }
}

/// Sectors between any two of eight directions, along which are vertices, share the room. A sector with the
/// eye as one of its points is none.
#[test]
fn sectors_along_vertices_share_the_room() {
    let mut walls = square(-1.0, 1.0);
    walls.extend([[0, 1], [1, 0], [0, -1], [-1, 0]].map(|end: [i32; 2]| {
        let [x, y] = end.map(f64::from);
        Wall::new([0.5 * x, 0.5 * y], [x, y]).with_opacity(Opacity::Clear)
    }));
    let plan = Plan::new(&walls).unwrap();
    let directions = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]];
    let directions = directions.map(|d| d.map(f64::from));
    let mut answer = Visibility::new();
    for eye in [[0.0; 2], [0.25, 0.0], [-0.25, 0.25], [0.0, -0.75]] {
        for (i, right) in directions.iter().enumerate() {
            for (j, left) in directions.iter().enumerate() {
                for scale in [0.125, 1.0, 3.0] {
                    let to = |d: &Point| [0, 1].map(|k| eye[k] + scale * (d[k] - eye[k]));
                    plan.look(&PlanView::new(eye).with_sector(to(right), to(left)), &mut answer).unwrap();
                    // Triangles of the eye with the eighths of the room's outline.
                    let part = |k: usize| {
                        let [a, b] = [k, k + 1].map(|k| directions[k % 8]);
                        0.5 * ((a[0] - eye[0]) * (b[1] - eye[1]) - (a[1] - eye[1]) * (b[0] - eye[0]))
                    };
                    let expected: f64 = (i..if j < i { j + 8 } else { j }).map(part).sum();
                    let area = answer.area();
                    assert!((area - expected).abs() < 1e-12, "{area} of {expected}: {eye:?}, {i} to {j}");
                }
            }
            for sector in [[*right, eye], [eye, *right]] {
                plan.look(&PlanView::new(eye).with_sector(sector[0], sector[1]), &mut answer).unwrap();
                assert!((answer.area() - 4.0).abs() < 1e-12, "no sector: {sector:?} from {eye:?}");
            }
        }
    }
}

/// Objects at just the bound of what is seen are seen: points on the line past the end of a wall, and boxes
/// around the eye that reach beyond the range on all sides.
#[test]
fn objects_at_bounds_are_seen() {
    let mut answer = Visibility::new();
    let mut seen = |plan: &Plan, view: &PlanView, outlines: &[&[Point]]| {
        let mut objects = PlanObjects::new(plan);
        outlines.iter().for_each(|outline| _ = objects.insert(plan, outline).unwrap());
        plan.look_at(view, &objects, &mut answer).unwrap();
        sorted(answer.objects())
    };
    for [x, y] in [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]] {
        let at = |a: f64, b: f64| [x * a, y * b];
        let plan = Plan::from_walls(&[Wall::new(at(1.0, 1.0), at(1.0, 3.0))], 9.0).unwrap();
        let points = [[at(2.0, 2.0)], [at(3.0, 9.0)], [at(2.0, 2.5)]];
        let list = points.each_ref().map(|point| &point[..]);
        assert_eq!(
            seen(&plan, &PlanView::new([0.0; 2]), &list),
            [0, 1],
            "past the ends of a wall to {x}, {y}"
        );
        let sector = PlanView::new([0.0; 2]).with_sector(at(1.0, 0.0), at(0.0, 1.0));
        let points = [[at(5.0, 0.0)], [at(0.0, 5.0)], [at(-1.0, -5.0)]];
        let list = points.each_ref().map(|point| &point[..]);
        let expected = if x * y > 0.0 { &[0, 1][..] } else { &[0, 1, 2] };
        assert_eq!(seen(&plan, &sector, &list), expected, "on the bounds of a sector to {x}, {y}");
    }
    let plan = Plan::from_walls(&[], 100.0).unwrap();
    let around =
        |x: f64, size: f64| [[x - size, -size], [x + size, -size], [x + size, size], [x - size, size]];
    let view = PlanView::new([0.5, 0.0]).with_range(2.0);
    let boxes =
        [around(0.0, 20.0), around(30.0, 20.0), around(0.5, 0.0), around(3.25, 0.5), around(2.75, 0.5)];
    let list = boxes.each_ref().map(|corners| &corners[..]);
    assert_eq!(seen(&plan, &view, &list), [0, 2, 4], "boxes around and beside the eye");
    let segments = [[[5.0, 0.0], [9.0, 0.0]], [[-9.0, 0.0], [9.0, 0.0]], [[2.5, -3.0], [2.5, 9.0]]];
    let list = segments.each_ref().map(|ends| &ends[..]);
    assert_eq!(seen(&plan, &view, &list), [1, 2], "segments on the line of the eye, and at just the range");
    let mut objects = PlanObjects::new(&plan);
    objects.insert(&plan, &[[0.0; 2]]).unwrap();
    assert_eq!(
        objects.set(&plan, 1, &[[1.0; 2]]),
        Err(PlanError::Objects),
        "an object that was never inserted"
    );
}

/// A point as a region sees the walls and the triangles that an eye there sees: on vertices, on walls and on
/// lines through vertices.
#[test]
fn points_as_regions_see_as_eyes_do() {
    let (mut answer, mut region) = (Visibility::new(), RegionVisibility::new());
    for seed in 0..60 {
        let mut random = Random(seed);
        let walls: Vec<_> = (0..random.between(1, 12))
            .map(|_| {
                let mut end = || [0; 2].map(|_| f64::from(random.between(0, 6)));
                Wall::new(end(), end())
            })
            .collect();
        let plan = Plan::from_walls(&walls, 2.0).unwrap();
        for _ in 0..30 {
            let [low, high] = plan.bounds();
            let eye = [0, 1]
                .map(|k| (0.5 * f64::from(random.between(-3, 15))).clamp(low[k] + 0.25, high[k] - 0.25));
            plan.look(&PlanView::new(eye), &mut answer).unwrap();
            plan.look_from_region(&[eye], &mut region).unwrap();
            assert_eq!(sorted(region.walls()), sorted(answer.walls()), "seed {seed}: from {eye:?}");
            let mut seen = SeenCones::default();
            seen.look(&plan, eye, plan.locate_near(eye, NONE), false);
            let mut triangles: Vec<_> = seen.parts().map(|(t, _)| t).collect();
            triangles.sort_unstable();
            triangles.dedup();
            assert_eq!(sorted(region.triangles()), triangles, "seed {seed}: triangles from {eye:?}");
        }
    }
}

/// A small region within a triangle sees less than the triangle, and regions end at the rectangle.
#[test]
fn small_regions_see_what_their_points_see() {
    let post = Wall::new([-0.1, 9.0], [0.1, 9.0]);
    let plan = Plan::new(&[Wall::new([-1.0, 1.0], [1.0, 1.0]), post]).unwrap();
    let mut region = RegionVisibility::new();
    for points in [&[[0.0, 0.0], [0.01, 0.0], [0.0, 0.01]][..], &[[0.0, 0.0], [0.01, 0.0]], &[[0.0, 0.0]]] {
        plan.look_from_region(points, &mut region).unwrap();
        assert_eq!(region.walls(), [0], "the post behind the screen, from {points:?}");
    }
    let [low, high] = plan.bounds();
    for axis in 0..2 {
        for (bound, beyond) in [(low[axis], low[axis] - 1.0), (high[axis], high[axis] + 1.0)] {
            let mut points = [[0.0, 0.0], [0.0, 0.0]];
            points[1][axis] = beyond;
            let found = plan.look_from_region(&points, &mut region);
            assert_eq!(found, Err(PlanError::Region), "beyond {bound} on axis {axis}");
            points[1][axis] = bound;
            assert_eq!(plan.look_from_region(&points, &mut region), Ok(()), "up to {bound} on axis {axis}");
        }
    }
}

/// A mover is in the triangles that its reach overlaps, and in no others.
#[test]
fn movers_are_where_they_reach() {
    let lines = (0..9).flat_map(|k| {
        let x = f64::from(k);
        [Wall::new([x, 0.0], [x, 8.0]), Wall::new([0.0, x], [8.0, x])]
    });
    let walls: Vec<_> = lines.map(|wall| wall.with_opacity(Opacity::Clear)).collect();
    let mut level = PlanCells::new(Plan::new(&walls).unwrap(), [2, 0]).unwrap();
    let mut cells = Vec::new();
    let reach = |x: f64, size: f64| {
        Reach::new(DVec3::new(x, 0.0, x), DVec3::new(x + size, 1.0, x + size)).within(0.5, 1.0)
    };
    for (reach, side) in [(reach(3.25, 0.5).within(0.0, 0.0), 1), (reach(3.25, 0.5).within(0.125, 1.0), 1)] {
        cells.clear();
        assert!(level.cells_of(&reach, &mut cells), "{reach:?} is inside");
        assert_eq!(cells.len(), 2 * side, "triangles of {reach:?}: {cells:?}");
    }
    cells.clear();
    assert!(level.cells_of(&reach(3.25, 0.5).within(1.0, 1.0), &mut cells), "a reach of a metre is inside");
    assert!((10..=18).contains(&cells.len()), "triangles of nine squares: {}", cells.len());
    let inverted = Reach { min: DVec3::new(4.0, 0.0, 3.0), max: DVec3::new(3.0, 1.0, 4.0), margin: 0.0 };
    assert!(!level.cells_of(&inverted, &mut cells), "a box that is inverted is anywhere");
}

/// What is behind a one-way wall, on the side that it stops, is not seen; rooms on both sides of a wall are
/// hiding places of their own, the lesser of which has a point of the wall.
#[test]
fn walls_part_what_is_unseen() {
    let mut walls = square(0.0, 4.0);
    walls.push(Wall::new([2.0, 0.0], [2.0, 4.0]).with_opacity(Opacity::OneWay));
    let plan = Plan::new(&walls).unwrap();
    let starts = [[1.0, 1.5], [3.0, 1.5]];
    for (eye, left) in [(starts[0], 0.0), (starts[1], 8.0)] {
        let mut unseen = UnseenRegion::reachable(&plan, &starts).unwrap();
        assert_eq!(unseen.hiding_places(&plan).unwrap().len(), 2, "a room on each side");
        let places = unseen.hiding_places(&plan).unwrap();
        assert_eq!(places.at(&plan, &unseen, [2.0, 1.0]), Ok(Some(0)), "the lesser place at the wall");
        unseen.look(&plan, eye).unwrap();
        assert_eq!(unseen.area(), left, "area that {eye:?} does not see");
    }
}

#[test]
fn numbers_up_to_the_limits_are_taken() {
    let (most, least) = (MAX_MAGNITUDE, MIN_MAGNITUDE);
    assert_eq!(checked([most, -most], 0), Ok([most, -most]), "the greatest coordinates");
    assert!(checked([most.next_up(), 0.0], 0).is_err() && checked([0.0, f64::NAN], 0).is_err(), "beyond");
    assert_eq!(checked([least, -least], 0), Ok([least, -least]), "the least coordinates");
    assert_eq!(checked([least.next_down(), -least.next_down()], 0), Ok([0.0; 2]), "smaller ones are 0");
    assert!(are_heights([most, -most]) && !are_heights([0.0, most.next_up()]), "heights");
}

/// Returns the sign of the orientation of whole numbers.
fn turn([a, b, c]: [[i64; 2]; 3]) -> i128 {
    let [p, q] = [a, b].map(|p| [0, 1].map(|k| i128::from(p[k]) - i128::from(c[k])));
    (p[0] * q[1] - p[1] * q[0]).signum()
}

/// Orientations of three points nearly on a line, and of rays through them, by whole numbers.
#[test]
fn orientations_are_exact() {
    let mut random = Random(35);
    let mut counts = [0; 3];
    for round in 0..60_000 {
        let bits = 4 + random.below(23);
        let [d, eye] = [bits, 52].map(|bits| [0; 2].map(|_| random.magnitude(bits)));
        let mut along = || {
            let (by, off) = (random.magnitude(25), [0; 2].map(|_| i64::from(random.between(-1, 1))));
            [0, 1].map(|k| eye[k] + by * d[k] + off[k])
        };
        let points = [along(), along(), eye];
        if points.iter().flatten().any(|x| x.abs() > 1 << 53) {
            continue;
        }
        let expected = turn(points);
        let [a, b, c] = points.map(|p| p.map(|x| x as f64));
        let sign = |x: f64| if x > 0.0 { 1 } else { -i128::from(x < 0.0) };
        for [p, q, r, factor] in [[0, 1, 2, 1], [1, 2, 0, 1], [2, 0, 1, 1], [1, 0, 2, -1]] {
            let all = [a, b, c];
            let [p, q, r] = [p, q, r].map(|k| all[k as usize]);
            let factor = i128::from(factor);
            assert_eq!(sign(orient(p, q, r)), factor * expected, "round {round}: {p:?} {q:?} {r:?}");
        }
        counts[(expected + 1) as usize] += 1;
        if round % 8 == 0 && a != b && a != c && b != c {
            let plan = Plan::from_walls(&[Wall::new(a, b)], 1.0).unwrap();
            assert_eq!(
                super::super::expand::is_left_of(&plan, c, [a, b]),
                Some(expected > 0),
                "round {round}"
            );
        }
    }
    assert!(counts.iter().all(|&count| count > 500), "{counts:?}");
}

/// Points for which the difference of the rounded products has the wrong sign, and is above half of the bound
/// on its error. Signs by fractions.
#[test]
fn orientations_within_the_bound_on_errors_are_exact() {
    for (a, b, c, expected) in [
        (
            [5.379136162094687, 8.315950028339898],
            [35.29163971685809, 60.265036130586054],
            [0.7422078432929635, 0.2629902337052985],
            -1.0,
        ),
        (
            [2.5494799235778167, 2.70484348688857],
            [65.39569467256018, 65.55107119773253],
            [-0.016419422372990544, 0.13894361172797143],
            -1.0,
        ),
        (
            [3.436209347547117, 4.555545814824457],
            [10.415414712229301, 11.534749743228646],
            [-0.21636541502067286, 0.9029718039343273],
            1.0,
        ),
        (
            [9.85631235935697, 8.575292981655513],
            [287.05003436095086, 285.76905468210316],
            [0.6485177837177618, -0.6325029126964261],
            -1.0,
        ),
    ] {
        assert!(orient(a, b, c) * expected > 0.0, "orientation of {a:?}, {b:?} and {c:?}");
        let plan = Plan::new(&[Wall::new(a, b)]).unwrap();
        let is_left = super::super::expand::is_left_of(&plan, c, [a, b]);
        assert_eq!(is_left, Some(expected > 0.0), "rays from {c:?} through {a:?} and {b:?}");
    }
}
