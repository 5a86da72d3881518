//! Tests of walls as modular kits and editors make them: rows of panels, copies, and separate sheets for both
//! sides.

use visibility_core::glam::Vec3;
use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};
use visibility_testing::allocations::{LIVE, PEAK};

/// Returns the two triangles of a rectangle across the x axis.
fn panel(x: f32, y: [f32; 2], z: [f32; 2], two_sided: bool) -> [LevelTriangle; 2] {
    let at = |i: usize, j: usize| Vec3::new(x, y[i], z[j]);
    [[at(0, 0), at(1, 0), at(1, 1)], [at(0, 0), at(1, 1), at(0, 1)]]
        .map(|corners| LevelTriangle { corners, two_sided })
}

fn made(triangles: &[LevelTriangle]) -> LevelOccluders {
    LevelOccluders::new(triangles, LevelSettings::default().with_kept_area(1.0)).unwrap()
}

#[test]
fn rows_of_panels_that_are_half_a_panel_apart_are_one_rectangle() {
    let mut wall = Vec::new();
    for row in 0..6 {
        let shift = (row % 2) as f32;
        let z = [row as f32, row as f32 + 1.0];
        wall.extend(panel(5.0, [-1.0, 1.0 - shift], z, true));
        for i in 0..7 {
            let y = 1.0 - shift + 2.0 * i as f32;
            wall.extend(panel(5.0, [y, (y + 2.0).min(14.0)], z, true));
        }
    }
    let level = made(&wall);
    let report = level.report();
    assert_eq!(report.open_edges_left, 2 * 6 + 8 + 8, "sides of the rectangle, in the lengths of its panels");
    assert!(report.t_junctions > 60, "only {} T-junctions were found", report.t_junctions);
    assert_eq!(report.edges_not_split, 0, "edges that are not split");
    assert_eq!((level.polygons().len(), level.edges().len()), (1, 4), "panels of all rows are one rectangle");
    assert_eq!(level.polygons()[0].area, 15.0 * 6.0, "the rectangle's area in square metres");
}

#[test]
fn a_hole_stays_open() {
    let wall = [
        panel(5.0, [0.0, 4.0], [0.0, 1.0], true),
        panel(5.0, [0.0, 1.0], [1.0, 3.0], true),
        panel(5.0, [2.0, 4.0], [1.0, 3.0], true),
        panel(5.0, [0.0, 4.0], [3.0, 4.0], true),
    ];
    let level = made(&wall.concat());
    assert_eq!((level.polygons().len(), level.edges().len()), (1, 8), "a square with a square hole");
}

#[test]
fn copies_and_signs_of_zero_make_no_difference() {
    let wall = panel(0.0, [0.0, 2.0], [0.0, 2.0], false);
    let mut copies = wall.to_vec();
    for mut t in panel(-0.0, [-0.0, 2.0], [-0.0, 2.0], false) {
        t.corners.rotate_left(1);
        copies.push(t);
    }
    assert_eq!(made(&copies).edges(), made(&wall).edges(), "edges with and without copies");
    assert!(!made(&copies).polygons()[0].two_sided, "copies of a one-sided wall are one-sided");
    // A copy that faces the other way closes the wall's back.
    for t in wall {
        let [a, b, c] = t.corners;
        copies.push(LevelTriangle { corners: [a, c, b], ..t });
    }
    let both = made(&copies);
    assert_eq!(
        (both.polygons().len(), both.edges().len()),
        (1, 4),
        "a wall with a copy of its back is one rectangle"
    );
    assert!(both.polygons()[0].two_sided, "a wall with a copy of its back has two sides");
}

#[test]
fn triangles_without_area_or_number_are_left_out() {
    let mut triangles = panel(1.0, [0.0, 1.0], [0.0, 1.0], true).to_vec();
    for corner in [Vec3::NAN, Vec3::INFINITY, triangles[0].corners[0]] {
        let mut broken = triangles[0];
        broken.corners[1] = corner;
        triangles.push(broken);
    }
    let level = made(&triangles);
    assert_eq!(
        (level.report().triangles, level.report().faces),
        (5, 2),
        "triangles given, and those with an area"
    );
    assert_eq!(
        (level.polygons().len(), level.edges().len()),
        (1, 4),
        "the two triangles left are one rectangle"
    );
    assert!(made(&[]).clusters().is_empty(), "a level without triangles has no clusters");
}

#[test]
fn vertices_on_very_many_sides_take_no_square_of_memory() {
    // Each triangle has a side from the origin along x, on which the corners of all shorter ones lie.
    let count = 3_000;
    let triangles: Vec<LevelTriangle> = (1..=count)
        .map(|i| {
            let corners = [Vec3::ZERO, Vec3::new(i as f32, 0.0, 0.0), Vec3::new(0.0, 1.0, i as f32)];
            LevelTriangle { corners, two_sided: true }
        })
        .collect();
    PEAK.set(LIVE.get());
    let before = LIVE.get();
    let level = made(&triangles);
    let report = level.report();
    let bytes = (PEAK.get() - before) / count as isize;
    assert!(bytes < 10_000, "{bytes} bytes for a triangle");
    assert!(report.t_junctions > 0, "some corners are inserted");
    assert!(report.edges_not_split > 0, "the report tells that some edges are not split");
    assert_eq!(report.triangles, count, "triangles given");
}
