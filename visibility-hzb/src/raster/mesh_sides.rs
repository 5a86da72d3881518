//! Tests of the choice of a mesh's triangles: fronts, backs and sheets, and of the errors of its corners.

use super::contour_raster::{ContourTiles, ScreenVertex};
use super::mesh_raster::{
    MAX_SHEETS, MeshScratch, VertexBounds, choose, draw_mesh, number_sheets, on_screen, project_corner,
};
use crate::buffer::tiles::Tiles;
use crate::coverage::Coverage;
use crate::random::random;
use crate::setup::occluder_triangles::OccluderTriangles;
use crate::setup::screen_projection::{ObjectProjection, ScreenProjection};
use alloc::vec::Vec;
use visibility_core::geometry::DoubleDouble;
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{Pose, View, occlusion::Edge};

/// Returns the edge between two triangles, or of one. Which vertices it joins is of no account here.
fn edge(left: u32, right: Option<u32>) -> Edge {
    Edge { vertices: [0, 1], left, right }
}

/// Returns a mesh of the given triangles and edges without positions.
fn mesh<'a>(triangles: &'a [[u32; 3]], edges: &'a [Edge], two_sided: bool) -> OccluderTriangles<'a> {
    OccluderTriangles { positions: &[], triangles, edges, two_sided }
}

/// Sheets are numbered in the order of their first triangles, over edges between triangles of one facing.
#[test]
fn sheets_are_numbered_in_order() {
    let numbered = |facing: &[i8], edges: &[Edge]| {
        let (mut facing, mut earlier) = (facing.to_vec(), Vec::new());
        let count = number_sheets(&mesh(&[], edges, true), &mut facing, &mut earlier);
        (count, facing)
    };
    let edges = [edge(1, Some(4)), edge(2, Some(0)), edge(1, Some(0)), edge(3, Some(5)), edge(5, None)];
    let expected = (3, [1, 1, -2, 0, 1, 3].to_vec());
    assert_eq!(
        numbered(&[1, 1, -1, 0, 1, 1], &edges),
        expected,
        "a sheet of three, a back, and a single one"
    );
    // Triangles that are not drawn, and triangles of one sheet, count for no sheets.
    let most = usize::from(MAX_SHEETS.unsigned_abs());
    let chain: Vec<Edge> = (0..20).map(|t| edge(t, Some(t + 1))).collect();
    for (singles, count) in [(most - 1, MAX_SHEETS), (most, 1)] {
        let facing: Vec<i8> = (0..60).map(|t| i8::from(t <= 20 || t >= 60 - singles)).collect();
        let (own, numbers) = numbered(&facing, &chain);
        assert_eq!(own, count, "a sheet of 21 triangles and {singles} single ones");
        assert_eq!(numbers[59], own, "the number of the last of {singles} single triangles");
    }
}

/// Returns the projection of corners that are as given, off by at most `error` in each value.
fn off_by(error: f64, size: f64) -> ObjectProjection {
    ObjectProjection { error: [error; 5], size: [size; 5], ..ObjectProjection::default() }
}

/// Backs are drawn of open two-sided meshes alone: a closed mesh before the eye has fronts before all backs.
#[test]
fn backs_of_closed_meshes_are_not_drawn() {
    let triangles = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];
    let edges = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]].map(|[a, b]| edge(a, Some(b)));
    let single = [0, 1, 2].map(|_| edge(0, None));
    let (mut random, object, mut drawn) = (random(31), ObjectProjection::default(), Vec::new());
    let mut both = 0;
    for trial in 0..1_000 {
        let screen = [0; 4].map(|_| ScreenVertex { x: random(0.0, 64.0), y: random(0.0, 64.0), far: 0.0 });
        let mut sides = |mesh: &OccluderTriangles| {
            let sides = choose(mesh, &[], &screen, Some(1e-6), &object, 1.0, 0.0, &mut drawn);
            let count = |side: i8| drawn.iter().filter(|&&own| own == side).count();
            (sides, [count(1), count(-1)])
        };
        let (closed, counts) = sides(&mesh(&triangles, &edges, true));
        assert_eq!((closed, counts[0] + counts[1]), (1, 4), "trial {trial}: a closed mesh");
        // Without the last triangle, three edges are open.
        let edges: Vec<Edge> = [edge(0, Some(1)), edge(0, Some(2)), edge(1, Some(2))]
            .into_iter()
            .chain([0, 1, 2].map(|t| edge(t, None)))
            .collect();
        let (open, counts) = sides(&mesh(&triangles[..3], &edges, true));
        let expected = u8::from(counts[0] > 0) | u8::from(counts[1] > 0) << 1;
        assert_eq!(open, expected, "trial {trial}: an open mesh");
        both += u32::from(open == 3);
        let (front, counts) = sides(&mesh(&triangles[..1], &single, false));
        assert_eq!((front, counts[1]), (u8::from(counts[0] > 0), 0), "trial {trial}: a one-sided triangle");
    }
    assert!(both > 300, "{both} open meshes show both sides");
    let flat = [[1.0, 1.0], [5.0, 5.0], [9.0, 9.0]].map(|[x, y]| ScreenVertex { x, y, far: 0.0 });
    let sides =
        choose(&mesh(&triangles[..1], &single, true), &[], &flat, Some(1e-6), &object, 1.0, 0.0, &mut drawn);
    assert_eq!((sides, &drawn[..]), (0, &[0][..]), "a triangle seen edge on has no side");
}

/// Triangles that the near plane may cut show a side if some corner is beyond it, and the side that they
/// certainly show however their coordinates are off by their errors.
#[test]
fn triangles_at_the_near_plane_show_their_side() {
    let single = [0, 1, 2].map(|_| edge(0, None));
    let (mut random, mut drawn, mut counts) = (random(32), Vec::new(), [0; 3]);
    for trial in 0..20_000 {
        let error = [1e-6, 1e-4, 1e-3][trial % 3];
        let object = off_by(error, 1.0);
        let point = [0; 3].map(|_| [0; 3].map(|_| random(-0.999, 0.999)));
        // Every other triangle is nearly in a plane through the eye.
        let point = if trial % 2 == 0 {
            let share = random(-1.0, 1.0);
            [
                point[0],
                point[1],
                [0, 1, 2].map(|i| point[2][i] * 0.01 + share * (point[0][i] + point[1][i]) * 0.4),
            ]
        } else {
            point
        };
        let near = [0, 1, 2].map(|i| if trial >> (4 + i) & 1 == 0 { -1.0 } else { 1.0 });
        let corners: Vec<[f64; 5]> = (0..3)
            .map(|i| {
                let [x, y, w] = point[i].map(|v| v + error * [-1.0, 1.0][random(0.0, 2.0) as usize]);
                [x, y, w, 1.0, near[i]]
            })
            .collect();
        let triangles = [[0, 1, 2]];
        let sides =
            choose(&mesh(&triangles, &single, true), &corners, &[], None, &object, 1.0, 0.5, &mut drawn);
        let [a, b, c] = point.map(DVec3::from);
        let height = (b - a).cross(c - a).dot(a);
        let seen = near.iter().any(|&near| near > 0.5);
        assert_eq!(sides, [2, 0, 1][(drawn[0] + 1) as usize], "trial {trial}: sides of {}", drawn[0]);
        assert!(seen || drawn[0] == 0, "trial {trial}: a triangle before the near plane is drawn");
        assert!(f64::from(drawn[0]) * height >= 0.0, "trial {trial}: {} for {height}", drawn[0]);
        let is_clear = height.abs() > 2.0 * object.determinant_error();
        assert!(!(seen && is_clear) || drawn[0] != 0, "trial {trial}: {height} is not drawn");
        counts[(drawn[0] + 1) as usize] += 1;
    }
    assert!(counts.iter().all(|&count| count > 2_000), "{counts:?} backs, undrawn and fronts");
}

/// Bounds of a mesh hold the errors of all corners, not of the last alone.
#[test]
fn bounds_hold_the_greatest_error() {
    let object = off_by(1e-3, 10.0);
    let (near, far) = ([1.0, 1.0, 0.1, 1.0, 1.0], [1.0, 1.0, 5.0, 1.0, 1.0]);
    let error = |[x, y, w, n, _]: [f64; 5]| project_corner([x, y, w, n], &object).1;
    assert!(error(near) > 2.0 * error(far), "the near corner has the greater error");
    for order in [[near, far], [far, near]] {
        let mut bounds = VertexBounds::NONE;
        order.iter().for_each(|corner| {
            on_screen(corner, &object, &mut bounds);
        });
        assert_eq!(bounds.error, error(near), "error of {order:?}");
    }
}

/// The position of a corner whose coordinates are exact is off by the rounding of its quotient.
#[test]
fn positions_are_off_by_rounding() {
    let (mut random, object, mut off) = (random(33), ObjectProjection::default(), 0);
    for trial in 0..1_000 {
        let (x, y, w) = (random(-9.0, 9.0), random(-9.0, 9.0), random(0.1, 9.0));
        let (corner, error, _) = project_corner([x, y, w, 1.0], &object);
        for (value, exact) in [(corner.x, x), (corner.y, y)] {
            let wrong = DoubleDouble::product(value, w).plus((-exact).into()).hi.abs();
            assert!(wrong <= error * w, "trial {trial}: {value} is off by {wrong}, not {error}");
            off += u32::from(wrong > 0.0);
        }
    }
    assert!(off > 500, "{off} positions are rounded");
}

/// A two-sided triangle covers the same pixels from behind as from the front, a one-sided one none.
#[test]
fn backs_cover_as_fronts_do() {
    let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 900.0);
    let projection = ScreenProjection::new(&view.unwrap(), DVec3::ZERO, [64, 64], [64, 64]);
    let object = projection.project_object(&Affine3A::IDENTITY, [10.0; 3]);
    let covered = |positions: [Vec3; 3], two_sided: bool| {
        let edges = [[0, 1], [1, 2], [2, 0]].map(|vertices| Edge { vertices, left: 0, right: None });
        let mesh =
            OccluderTriangles { positions: &positions, triangles: &[[0, 1, 2]], edges: &edges, two_sided };
        let mut tiles = Tiles::new(64, 64);
        let (mut scratch, mut cells) = (MeshScratch::default(), ContourTiles::new(&tiles));
        let (scratch, cells) = (&mut scratch, &mut cells);
        let facing = projection.facing;
        let rule = Coverage::Conservative;
        draw_mesh(&mesh, &object, &projection, facing, rule, None, scratch, cells, &mut tiles);
        let pixels = (0..64).flat_map(|y| (0..64).map(move |x| (x, y)));
        pixels.filter(|&(x, y)| tiles.pixel(x, y) > f32::NEG_INFINITY).collect::<Vec<_>>()
    };
    let [a, b, c] = [[10.0, 4.0, -3.0], [9.0, -4.0, -3.0], [8.0, 0.5, 3.5]].map(Vec3::from_array);
    let [one, other] = [[a, b, c], [a, c, b]].map(|order| covered(order, true));
    assert!(one.len() > 500, "{} pixels are covered", one.len());
    assert_eq!(one, other, "pixels from the front and from behind");
    let counts = [[a, b, c], [a, c, b]].map(|order| covered(order, false).len());
    assert!(counts.contains(&0) && counts.contains(&one.len()), "one side covers: {counts:?}");
}
