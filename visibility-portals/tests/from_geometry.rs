//! Cells made from geometry: an unblocked segment leads through portals from the cell of its start to the
//! cell of its end, and most blocked segments do not.

use visibility_core::cells::{CellId, Portal};
use visibility_core::geometry::ConvexPolygon;
use visibility_core::glam::{DMat3, DQuat, DVec2, DVec3, dvec3};
use visibility_portals::from_geometry::{
    GeometryError, PolygonSettings, SolidRule, Subdivision, WallSettings, floor_plan, from_polygons,
    from_walls,
};
use visibility_testing::Random;

/// Returns axis-aligned boxes of a house: walls of zero or more thickness with gaps for doors and windows, a
/// floor and a ceiling slab, and a few loose blocks. Each box is its minimum and maximum corner, in the
/// boxes' own space.
fn house(random: &mut Random) -> Vec<[DVec3; 2]> {
    let mut boxes = Vec::new();
    let mut add = |min: [f64; 3], max: [f64; 3]| boxes.push([DVec3::from(min), DVec3::from(max)]);
    add([0.0, 0.0, -0.3], [16.0, 12.0, 0.0]);
    add([0.0, 0.0, 3.0], [16.0, 12.0, 3.3]);
    for x in 0..5 {
        for y in 0..3 {
            let (x, y) = (4.0 * f64::from(x), 4.0 * f64::from(y));
            let door = random.fine_range(0.4, 2.6);
            let thick = [0.0, 0.15][(random.fine_unit() * 2.0) as usize];
            add([x, y, 0.0], [x + thick, y + door, 3.0]);
            add([x, y + door + 0.9, 0.0], [x + thick, y + 4.0, 3.0]);
            if random.fine_unit() < 0.7 {
                add([x, y + door, 2.0], [x + thick, y + door + 0.9, 3.0]);
            }
        }
    }
    for y in 0..4 {
        for x in 0..4 {
            let (x, y) = (4.0 * f64::from(x), 4.0 * f64::from(y));
            let window = random.fine_range(0.4, 2.4);
            add([x, y - 0.1, 0.0], [x + window, y, 3.0]);
            add([x + window + 1.2, y - 0.1, 0.0], [x + 4.0, y, 3.0]);
            add([x + window, y - 0.1, 0.0], [x + window + 1.2, y, 0.9]);
        }
    }
    for _ in 0..6 {
        let p = [random.fine_range(1.0, 14.0), random.fine_range(1.0, 10.0), 0.0];
        add(
            p,
            [
                p[0] + random.fine_range(0.2, 2.0),
                p[1] + random.fine_range(0.2, 2.0),
                random.fine_range(0.4, 2.0),
            ],
        );
    }
    boxes
}

/// Returns the faces of boxes as triangles, counter-clockwise as seen from outside, rotated by `turn` into
/// the space of the cells.
pub(crate) fn triangles(boxes: &[[DVec3; 2]], turn: DMat3) -> Vec<ConvexPolygon> {
    let mut out = Vec::new();
    for [min, max] in boxes {
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for side in [min, max] {
                let corner = |a: f64, b: f64| {
                    let mut p = *side;
                    (p[u], p[v]) = (a, b);
                    turn * p
                };
                let quad = [
                    corner(min[u], min[v]),
                    corner(max[u], min[v]),
                    corner(max[u], max[v]),
                    corner(min[u], max[v]),
                ];
                let quad = if side == min { [quad[3], quad[2], quad[1], quad[0]] } else { quad };
                for half in [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]] {
                    out.extend(ConvexPolygon::new(half));
                }
            }
        }
    }
    out
}

/// Tests whether the segment from `a` to `b` meets one of `boxes` enlarged by `widen` on all sides; a
/// negative `widen` shrinks the boxes. All lengths are in the boxes' space and unit. `false` if it meets
/// none.
pub(crate) fn blocked(boxes: &[[DVec3; 2]], a: DVec3, b: DVec3, widen: f64) -> bool {
    boxes.iter().any(|[min, max]| {
        let (mut enter, mut leave) = (0.0f64, 1.0f64);
        for i in 0..3 {
            let d = b[i] - a[i];
            let (near, far) = ((min[i] - widen - a[i]) / d, (max[i] + widen - a[i]) / d);
            enter = enter.max(near.min(far));
            leave = leave.min(near.max(far));
        }
        enter <= leave
    })
}

/// Follows the segment from `a` to `b` (in the space of the cells), which starts in cell `from`, through
/// portals. Returns the cell in which it ends. `None` if the segment comes within 1e-3 of an edge of a
/// portal, where the result is unreliable.
fn walk(cells: &Subdivision, from: CellId, a: DVec3, b: DVec3) -> Option<CellId> {
    let mut hits = Vec::new();
    for portal in cells.graph.portals() {
        let plane = portal.plane();
        let (da, db) = (plane.signed_distance(a), plane.signed_distance(b));
        if da * db > 0.0 || da == db {
            continue;
        }
        let t = da / (da - db);
        let p = a + (b - a) * t;
        let vertices = portal.polygon().vertices();
        let inside = (0..vertices.len()).map(|i| {
            let (v, w) = (vertices[i], vertices[(i + 1) % vertices.len()]);
            plane.normal.cross(w - v).normalize_or_zero().dot(p - v)
        });
        let least = inside.fold(f64::INFINITY, f64::min);
        if least.abs() < 1e-3 {
            return None;
        }
        if least > 0.0 {
            hits.push((t, portal));
        }
    }
    hits.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut cell, mut at) = (from, -1.0);
    for (t, portal) in hits {
        // Merged portals may overlap; only one of two coincident portals is passed.
        if portal.cells().contains(&cell) && t > at + 1e-9 {
            (cell, at) = (portal.other(cell), t);
        }
    }
    Some(cell)
}

/// Asserts that random unblocked segments lead to the cell of their end point. Returns the number of these
/// segments, and the fraction of blocked segments that lead to another cell. `turn` rotates the boxes into
/// the space of the cells.
fn check(
    cells: &Subdivision,
    boxes: &[[DVec3; 2]],
    turn: DMat3,
    tolerance: f64,
    random: &mut Random,
) -> (u32, f64) {
    cells.graph.validate(1e-6).unwrap();
    let bodies = &cells.viewcells;
    let (mut clear, mut stopped, mut all) = (0, 0, 0);
    for _ in 0..8000 {
        let mut point = || {
            DVec3::new(
                random.fine_range(-0.9, 16.9),
                random.fine_range(-0.9, 12.9),
                random.fine_range(-0.6, 3.9),
            )
        };
        let (a, b) = (point(), point());
        let Some([from, to]) =
            bodies.locate(turn * a).zip(bodies.locate(turn * b)).map(|(a, b)| [CellId(a.0), CellId(b.0)])
        else {
            // The point is in a wall, which is no cell.
            continue;
        };
        let Some(end) = walk(cells, from, turn * a, turn * b) else { continue };
        if !blocked(boxes, a, b, tolerance) {
            clear += 1;
            assert_eq!(end, to, "from {a} to {b}");
        } else if blocked(boxes, a, b, -1e-3) {
            all += 1;
            stopped += u32::from(end != to);
        }
    }
    (clear, f64::from(stopped) / f64::from(all))
}

#[test]
fn clear_lines_pass_the_cells_of_walls() {
    let mut random = Random(3);
    for _ in 0..4 {
        let boxes = house(&mut random);
        let cells = from_walls(&boxes, &WallSettings::default()).unwrap();
        assert!(cells.graph.cell_count() > 20, "the house has {} cells", cells.graph.cell_count());
        let (clear, stopped) = check(&cells, &boxes, DMat3::IDENTITY, 1e-4, &mut random);
        println!(
            "{} cells, {} portals: {clear} clear, {stopped} of the others stopped",
            cells.graph.cell_count(),
            cells.graph.portals().len()
        );
        assert!(clear > 500 && stopped > 0.8, "{clear} {stopped}");
    }
}

#[test]
fn clear_lines_pass_the_cells_of_polygons() {
    let mut random = Random(4);
    let turn = DQuat::from_axis_angle(DVec3::new(0.3, -0.7, 0.4).normalize(), 0.77);
    // Walls that are solids are closed: from between them, one-sided faces block as others do.
    let one_sided = vec![true; 1 << 14];
    for (turn, solid) in [
        (DMat3::IDENTITY, SolidRule::Nothing),
        (DMat3::from_quat(turn), SolidRule::Nothing),
        (DMat3::IDENTITY, SolidRule::Backs),
        (DMat3::from_quat(turn), SolidRule::Unreached(&[DVec3::new(-0.5, -0.5, 0.5)])),
    ] {
        let boxes = house(&mut random);
        let one_sided =
            if solid == SolidRule::Nothing && turn == DMat3::IDENTITY { &one_sided[..] } else { &[] };
        let settings = PolygonSettings::default().with_solid(solid).with_one_sided(one_sided);
        let cells = from_polygons(&triangles(&boxes, turn), &settings).unwrap();
        assert!(cells.graph.cell_count() > 20, "{solid:?}: the house has {} cells", cells.graph.cell_count());
        let (clear, stopped) = check(&cells, &boxes, turn, 2e-5, &mut random);
        println!(
            "{} cells, {} portals: {clear} clear, {stopped} of the others stopped",
            cells.graph.cell_count(),
            cells.graph.portals().len()
        );
        assert!(clear > 300 && stopped > 0.7, "{clear} {stopped}");
    }
}

#[test]
fn solid_leaves_are_no_cells() {
    // A block in a room: with `SolidRule::Backs` the inside of the block is no cell, and the room remains.
    let solids = [[DVec3::ZERO, DVec3::splat(4.0)]];
    let soup = triangles(&solids, DMat3::IDENTITY);
    let (around, within) = ([DVec3::splat(-0.5)], [DVec3::splat(2.0)]);
    let count = |solid| {
        let settings = PolygonSettings::default().with_solid(solid);
        let cells = from_polygons(&soup, &settings).unwrap();
        let inside = cells.viewcells.locate(DVec3::splat(2.0));
        assert!(
            cells.outside.len() == cells.graph.cell_count() - usize::from(inside.is_some()),
            "{solid:?}: all cells but the block's lead outside"
        );
        (cells.graph.cell_count(), inside.is_some())
    };
    assert_eq!(count(SolidRule::Nothing), (7, true), "six cells around the block and one within");
    assert_eq!(count(SolidRule::Backs), (6, false), "backs make the block solid");
    assert_eq!(
        count(SolidRule::Unreached(&around)),
        (6, false),
        "what is not reached from around the block is solid"
    );
    assert_eq!(
        count(SolidRule::Unreached(&within)),
        (1, true),
        "what is not reached from within the block is solid"
    );
    // Boxes given to `from_walls` are always solid.
    let cells = from_walls(&solids, &WallSettings::default()).unwrap();
    assert_eq!(cells.graph.cell_count(), 6, "boxes of walls are solid");
}

#[test]
fn regions_that_look_through_backs_are_no_cells() {
    let solids = [[DVec3::ZERO, DVec3::splat(4.0)]];
    let soup = triangles(&solids, DMat3::IDENTITY);
    let turned =
        |polygon: &ConvexPolygon| ConvexPolygon::new(polygon.vertices().iter().rev().copied()).unwrap();
    let inside_out: Vec<ConvexPolygon> = soup.iter().map(turned).collect();
    let count = |soup: &[ConvexPolygon], one_sided: &[bool]| {
        let settings = PolygonSettings::default().with_one_sided(one_sided);
        let cells = from_polygons(soup, &settings).unwrap();
        let inside = cells.viewcells.locate(DVec3::splat(2.0));
        (cells.graph.cell_count(), inside.is_some())
    };
    // From within a block lines pass its faces, and from around a block that is inside out.
    assert_eq!(count(&soup, &[]), (7, true), "two-sided faces: cells around and within");
    assert_eq!(count(&soup, &[true; 12]), (6, false), "one-sided faces: no cell within");
    assert_eq!(count(&inside_out, &[true; 12]), (1, true), "one-sided faces inside out: no cell around");
    // One face with a back is enough. Doubled faces block from both sides.
    let mut one_back = soup.clone();
    one_back[7] = turned(&soup[7]);
    let only = |at: usize| core::array::from_fn::<bool, 12, _>(|i| i == at);
    assert_eq!(count(&one_back, &only(7)), (1, true), "one one-sided face inside out: no cell around");
    assert_eq!(count(&soup, &only(7)), (6, false), "one one-sided face: no cell within");
    assert_eq!(
        count(&[soup, inside_out].concat(), &[true; 24]),
        (7, true),
        "doubled faces: cells around and within"
    );
    // A wall across the world is a wall from its front; a gap in it joins both sides.
    let wall = |[a, b]: [f64; 2]| {
        let corners = [[a, 0.0], [b, 0.0], [b, 3.0], [a, 3.0]];
        ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(0.0, y, z))).unwrap()
    };
    let count = |soup: &[ConvexPolygon]| {
        let settings = PolygonSettings::default().with_margin(0.0).with_one_sided(&[true, true]);
        // Too small to divide space, it only widens its bounds.
        let thin = [DVec3::new(-5.0, 0.0, 0.0), DVec3::new(5.0, 9.0, 3.0), DVec3::new(-5.0, 0.001, 0.0)];
        let thin = ConvexPolygon::new(thin).unwrap();
        from_polygons(&[soup, &[thin]].concat(), &settings).unwrap().graph.cell_count()
    };
    assert_eq!(
        (count(&[wall([0.0, 4.0]), wall([4.0, 9.0])]), count(&[wall([0.0, 4.0]), wall([5.0, 9.0])])),
        (1, 0),
        "cells before a closed wall and before one with a gap"
    );
}

/// The strips of a wall are narrower than half of the tolerance each: together they are a wall that is looked
/// through from behind.
#[test]
fn many_narrow_backs_side_by_side_leak() {
    let strips = (0..225).map(|i| f64::from(i) * 0.04);
    let mut soup: Vec<ConvexPolygon> =
        strips.map(|y| upright(0.0, [y, y + 0.04], [0.0, 3.0], false)).collect();
    // Too small to divide space, it only widens its bounds.
    let thin = [DVec3::new(-5.0, 0.0, 0.0), DVec3::new(5.0, 9.0, 3.0), DVec3::new(-5.0, 0.001, 0.0)];
    soup.push(ConvexPolygon::new(thin).unwrap());
    let settings = PolygonSettings::default().with_margin(0.0).with_tolerance(0.1);
    let count = |one_sided: &[bool]| {
        from_polygons(&soup, &settings.with_one_sided(one_sided)).unwrap().graph.cell_count()
    };
    assert_eq!((count(&[]), count(&[true; 225])), (2, 1), "cells beside the wall, two-sided and one-sided");
}

/// Returns the rectangle of a plane at `x` with the given ranges of y and z, front to greater x, or to lesser
/// x if `turned`.
pub(crate) fn upright(x: f64, y: [f64; 2], z: [f64; 2], turned: bool) -> ConvexPolygon {
    let mut corners =
        [[y[0], z[0]], [y[1], z[0]], [y[1], z[1]], [y[0], z[1]]].map(|[y, z]| DVec3::new(x, y, z));
    if turned {
        corners.reverse();
    }
    ConvexPolygon::new(corners).unwrap()
}

/// A pane whose back is looked through fills a window of a long wall: small beside the wall, but not to who
/// looks through it.
#[test]
fn a_small_leak_in_a_large_wall_is_a_leak() {
    for length in [8.0, 500.0, 4000.0] {
        let polygons = [
            upright(0.0, [0.0, length], [0.0, 3.0], false),
            upright(0.0, [length + 1.0, 2.0 * length + 1.0], [0.0, 3.0], false),
            upright(0.0, [length, length + 1.0], [0.0, 1.0], false),
            upright(0.0, [length, length + 1.0], [1.9, 3.0], false),
            upright(0.0, [length, length + 1.0], [1.0, 1.9], false),
        ];
        let one_sided = [false, false, false, false, true];
        for (one_sided, is_cell) in [(&one_sided[..], false), (&[], true)] {
            let settings = PolygonSettings::default().with_one_sided(one_sided);
            let cells = from_polygons(&polygons, &settings).unwrap();
            let bodies = &cells.viewcells;
            let behind = bodies.locate(DVec3::new(-0.5, length + 0.5, 1.45));
            assert_eq!(behind.is_some(), is_cell, "behind a wall of {length} m, one-sided {one_sided:?}");
        }
    }
}

/// The air between two signs is bounded by backs alone, and is no solid: lines pass over both signs.
#[test]
fn air_between_the_backs_of_two_signs_is_a_cell() {
    let signs = [upright(0.0, [0.0, 4.0], [0.0, 3.0], true), upright(10.0, [0.0, 4.0], [0.0, 3.0], false)];
    let settings = PolygonSettings::default().with_solid(SolidRule::Backs);
    let cells = from_polygons(&signs, &settings).unwrap();
    let bodies = &cells.viewcells;
    let between = bodies.locate(DVec3::new(5.0, 2.0, 1.5));
    assert!(between.is_some(), "the air between the signs is a cell, of {}", cells.viewcells.cells().len());
}

#[test]
fn leaks_are_named_by_their_portals() {
    let plan = |gap: f64| {
        let wall = |a: [f64; 2], b: [f64; 2]| [DVec2::from(a), DVec2::from(b)];
        let segments = [
            wall([0.0, 0.0], [8.0, 0.0]),
            wall([0.0, 4.0], [8.0, 4.0]),
            wall([0.0, 0.0], [0.0, 4.0]),
            wall([8.0, 0.0], [8.0, 4.0 - gap]),
            wall([4.0, 0.0], [4.0, 3.0]),
        ];
        from_walls(&floor_plan(&segments, 0.0, 3.0).unwrap(), &WallSettings::default()).unwrap()
    };
    let closed = plan(0.0);
    assert_eq!(closed.leak(DVec3::ONE), None, "a closed room has no leak");
    assert_eq!(closed.leak(DVec3::splat(100.0)), None, "a point outside has no leak");
    let leak = plan(0.5).leak(DVec3::ONE).unwrap();
    assert_eq!(leak.portals.len(), 2, "portals on the way out, through the door and the gap");
    assert!(leak.to_string().contains("leaks to cell"), "the leak is described: {leak}");
    // The last portal of the leak is the gap itself.
    let portal = plan(0.5).graph.portals()[leak.portals[1].index()].polygon().area();
    assert!((portal - 1.5).abs() < 1e-9, "{portal}");
}

#[test]
fn cells_behind_the_outermost_polygons_reach_out() {
    // A house without a margin, and in it a room under the roof or one on the ground: polygons lie on the
    // boundary of the bounding box.
    for room in [[3.0, 5.0], [-5.0, -3.0]] {
        let boxes = [
            [DVec3::splat(-5.0), DVec3::splat(5.0)],
            [DVec3::new(-1.0, -1.0, room[0]), DVec3::new(1.0, 1.0, room[1])],
        ];
        let settings = PolygonSettings::default().with_margin(0.0);
        let cells = from_polygons(&triangles(&boxes, DMat3::IDENTITY), &settings).unwrap();
        let bodies = &cells.viewcells;
        let cell = bodies
            .locate(DVec3::new(0.1, 0.2, (room[0] + room[1]) / 2.0))
            .map(|viewcell| CellId(viewcell.0))
            .unwrap();
        assert!(cells.outside.contains(&cell), "{room:?}: {:?} of {}", cells.outside, bodies.cells().len());
        assert!(cells.graph.portals_of(cell).is_empty(), "{room:?}: the room has no portals");
    }
}

#[test]
fn gaps_thinner_than_the_tolerance_close_and_wider_ones_stay() {
    for (gap, portals) in [(1e-6, 0), (1e-2, 1)] {
        let wall = |y: [f64; 2]| {
            let quad = [[y[0], -9.0], [y[1], -9.0], [y[1], 9.0], [y[0], 9.0]];
            ConvexPolygon::new(quad.map(|[y, z]| DVec3::new(0.0, y, z))).unwrap()
        };
        // The soup has a duplicate wall, a wall slightly off the plane, and a sliver thinner than the
        // tolerance.
        let needle = [[0.0, 0.0], [0.0, 1e-9], [9.0, 0.0]].map(|[y, z]| DVec3::new(0.0, y, z));
        let mut soup = vec![wall([-9.0, 0.0]), wall([gap, 9.0]), wall([-9.0, -3.0])];
        soup.extend(ConvexPolygon::new(needle));
        let offset = wall([-5.0, -1.0]).vertices().iter().map(|&v| v + DVec3::X * 1e-6).collect::<Vec<_>>();
        soup.extend(ConvexPolygon::new(offset));
        let settings = PolygonSettings::default().with_margin(0.0).with_tolerance(1e-4);
        let mut wide = soup.clone();
        wide.push(
            ConvexPolygon::new([[9.0, 0.0], [9.0, 1.0], [8.0, 0.0]].map(|[x, z]| DVec3::new(x, 9.0, z)))
                .unwrap(),
        );
        wide.push(
            ConvexPolygon::new([[-9.0, 0.0], [-9.0, 1.0], [-8.0, 0.0]].map(|[x, z]| DVec3::new(x, 9.0, z)))
                .unwrap(),
        );
        let cells = from_polygons(&wide, &settings).unwrap();
        assert_eq!((cells.graph.cell_count(), cells.graph.portals().len()), (2, portals), "{gap}");
    }
}

#[test]
fn odd_input_gives_an_error_or_an_answer() {
    let walls = WallSettings::default();
    let polygons = PolygonSettings::default();
    assert_eq!(from_walls(&[], &walls).unwrap(), Subdivision::default(), "no walls");
    assert_eq!(from_polygons(&[], &polygons).unwrap(), Subdivision::default(), "no polygons");
    let unit = [DVec3::ZERO, DVec3::ONE];
    assert_eq!(
        from_walls(&[unit, [DVec3::NAN, DVec3::ONE]], &walls),
        Err(GeometryError::Coordinate { index: 1 }),
        "the index of the wall that is NaN"
    );
    assert_eq!(
        from_walls(&[[DVec3::ONE, DVec3::ZERO]], &walls),
        Err(GeometryError::NotAxial { index: 0 }),
        "the index of the wall that is inverted"
    );
    let slanted = [[DVec2::ZERO, DVec2::ONE]];
    assert_eq!(
        floor_plan(&slanted, 0.0, 3.0),
        Err(GeometryError::NotAxial { index: 0 }),
        "a wall that runs along no axis"
    );
    let bad = walls.with_margin(f64::NAN);
    assert!(matches!(from_walls(&[unit], &bad), Err(GeometryError::Setting { .. })), "a margin of NaN");
    let fine = polygons.with_tolerance(1e-30);
    let soup = triangles(&[unit], DMat3::IDENTITY);
    assert!(
        matches!(from_polygons(&soup, &fine), Err(GeometryError::Setting { .. })),
        "a tolerance below rounding"
    );
    for scale in [1e-100, 1e-30, 1e-9, 1e9, 1e30, 1e75] {
        let scaled = [unit.map(|p| p * scale), [DVec3::splat(scale * 2.0), DVec3::splat(scale * 3.0)]];
        let settings = walls.with_margin(scale).with_tolerance(scale * 1e-6);
        let graph = from_walls(&scaled, &settings).unwrap().graph;
        assert!(graph.cell_count() > 1, "walls of {scale} m");
        assert!(graph.portals().len() >= graph.cell_count() - 1, "portals between walls of {scale} m");
        let settings = polygons.with_margin(scale);
        let graph = from_polygons(&triangles(&scaled, DMat3::IDENTITY), &settings).unwrap().graph;
        // Polygons of the least size have no area.
        let least = if scale < 1e-80 { 0 } else { 2 };
        assert!(graph.cell_count() >= least && graph.portals().len() + 1 >= graph.cell_count(), "{scale}");
    }
    let too_large = from_walls(&[[DVec3::ZERO, DVec3::splat(1e77)]], &walls);
    assert!(matches!(too_large, Err(GeometryError::Setting { value: 1e77, .. })), "{too_large:?}");
    // A slit that is wider than the tolerance stays open, however long it is.
    let slit = 1.0 + 5e-12;
    let walls = [[0.0, 1.0], [slit, 2.0]].map(|[low, high]| [dvec3(1.0, low, 0.0), dvec3(1.0, high, 1000.0)]);
    let settings = WallSettings::default().with_tolerance(0.0).with_min_share(0.0);
    let graph = from_walls(&walls, &settings.with_min_area(0.0)).unwrap().graph;
    let has_slit =
        |portal: &Portal| portal.polygon().vertices().iter().any(|v| v.y > 1.0 && v.y < 1.0 + 1e-9);
    assert!(graph.portals().iter().any(has_slit), "a slit of 5e-12 m");
    // Random polygons that all intersect: the limit on cells holds.
    let mut random = Random(9);
    let mut point = || DVec3::new(random.fine_unit(), random.fine_unit(), random.fine_unit()) * 10.0;
    let soup: Vec<_> =
        (0..150).filter_map(|_| ConvexPolygon::new([point(), point(), point()]).ok()).collect();
    let settings = polygons.with_max_cells(200).with_min_share(0.0).with_min_area(0.0);
    let cells = from_polygons(&soup, &settings).unwrap();
    assert!(
        cells.graph.cell_count() <= 200 && cells.graph.portals().len() > 200,
        "{} cells of at most 200, {} portals",
        cells.graph.cell_count(),
        cells.graph.portals().len()
    );
}

/// A wall with a slot of a metre, given relative to an origin far away: the slot stays open if the origin is
/// told, and may be narrower than the default tolerance otherwise.
#[test]
fn slots_far_from_the_worlds_zero_stay_open_if_the_origin_is_told() {
    for (away, is_open_untold) in [(0.0, true), (6.4e6, false)] {
        let origin = DVec3::new(away, 0.0, -away);
        let wall = |[low, high]: [f64; 2]| {
            let corner = |[y, z]: [f64; 2]| origin + DVec3::new(5.0, y, z);
            ConvexPolygon::new([[low, -9.0], [high, -9.0], [high, 9.0], [low, 9.0]].map(corner)).unwrap()
        };
        let soup = [wall([-9.0, 0.0]), wall([1.0, 9.0])];
        let slot = origin + DVec3::new(5.0, 0.5, 0.0);
        let is_open = |settings: &PolygonSettings<'_>| {
            let made = from_polygons(&soup, settings).unwrap();
            made.graph.portals().iter().any(|portal| {
                let vertices = portal.polygon().vertices();
                let ends = vertices.iter().zip(vertices.iter().cycle().skip(1));
                let sides = ends.map(|(&a, &b)| (b - a).cross(slot - a).x);
                let (least, most) = sides.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
                least > 0.0 || most < 0.0
            })
        };
        let settings = PolygonSettings::default();
        assert!(is_open(&settings.with_origin(origin)), "{away} m away, with the origin");
        assert_eq!(is_open(&settings), is_open_untold, "{away} m away, without the origin");
    }
    let soup = [ConvexPolygon::new([DVec3::ZERO, DVec3::X, DVec3::Y]).unwrap()];
    let made = from_polygons(&soup, &PolygonSettings::default().with_origin(DVec3::NAN));
    let is_refused = matches!(made, Err(GeometryError::Setting { what: "the origin", .. }));
    assert!(is_refused, "an origin that is not a point");
}
