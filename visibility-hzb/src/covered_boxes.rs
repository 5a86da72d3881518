//! Tests that boxes cover no pixel that they leave partly bare, nor one nearer than they are, if their screen
//! coordinates are off by as much as the error bounds allow, and that cuts at the near plane bound triangles.
//! The oracle meets the true box with the lines of sight through the corners of pixels. Errors are made
//! large, beside which its own rounding is nothing.

use crate::buffer::tiles::Tiles;
use crate::coverage::Coverage;
use crate::random::random;
use crate::raster::contour_raster::ContourTiles;
use crate::raster::mesh_raster::{MeshScratch, draw_mesh};
use crate::raster::shape_fill::fill_shape;
use crate::setup::box_shape::box_shape;
use crate::setup::convex_shape::{ConvexScratch, convex_shape};
use crate::setup::occluder_triangles::OccluderTriangles;
use crate::setup::screen_projection::{ScreenProjection, project_object};
use crate::setup::screen_shape::{ScreenShape, ShapeResult};
use visibility_core::glam::{Affine3A, DMat3, DVec3, Vec3};
use visibility_core::view::Window;
use visibility_core::{Aabb, Pose, View, occlusion::Edge};

/// Width and height of the buffer in pixels.
const SIZE: usize = 32;

/// Returns the line of sight through a place on the screen: the point `start` on the near plane and `step`,
/// such that `start + t * step` is `t` beyond that plane.
fn line_of_sight(projection: &ScreenProjection, [column, row]: [f64; 2]) -> (DVec3, DVec3) {
    let ([x, y, w, _], near) = (projection.rows, projection.near);
    let [rx, ry, rw, rd] = [x, y, w, near].map(|row| DVec3::from(row.linear));
    let inverse = DMat3::from_cols(rx - rw * column, ry - rw * row, rd).transpose().inverse();
    let at = |t: f64| {
        let [x, y] = [w.constant * column - x.constant, w.constant * row - y.constant];
        inverse * DVec3::new(x, y, t - near.constant)
    };
    (at(0.0), at(1.0) - at(0.0))
}

/// Returns the depth key of a box where the line of sight through a place on the screen first meets its
/// surface beyond the near plane. If the line begins inside, it meets the inner side, which counts if the box
/// is two-sided. `None` if it meets nothing that counts.
fn first_hit(
    projection: &ScreenProjection,
    [min, max]: [DVec3; 2],
    two_sided: bool,
    [column, row]: [f64; 2],
) -> Option<f64> {
    let (start, step) = line_of_sight(projection, [column, row]);
    let [_, _, w, n] = projection.rows;
    let [rw, rn] = [w, n].map(|row| DVec3::from(row.linear));
    let [a, b] = [(min - start) / step, (max - start) / step];
    let (enter, exit) = (a.min(b).max_element(), a.max(b).min_element());
    let t = if enter >= 0.0 { enter } else { exit };
    if exit < enter || t < 0.0 || (enter < 0.0 && !two_sided) {
        return None;
    }
    let p = start + step * t;
    Some((rn.dot(p) + n.constant) / (rw.dot(p) + w.constant))
}

#[test]
fn boxes_off_by_their_errors_cover_no_bare_pixel() {
    let (mut random, mut covered) = (random(61), [[0; 2]; 3]);
    for trial in 0..2_400 {
        let drawer = trial % 3;
        let target = DVec3::new(1.0, random(-0.5, 0.5), random(-0.5, 0.5));
        let pose = Pose::look_at(DVec3::ZERO, target, DVec3::Z);
        let is_parallel = trial % 2 == 0;
        let view = if is_parallel {
            View::orthographic(pose, Window::centered(5.0, 5.0), 2.0, 20.0)
        } else {
            View::perspective(pose, 1.0, 1.0, 2.0, 20.0)
        };
        let projection = ScreenProjection::new(&view.unwrap(), DVec3::ZERO, [SIZE; 2], [SIZE; 2]);
        let middle = target.normalize() * random(1.0, 9.0)
            + DVec3::new(random(-2.0, 2.0), random(-2.0, 2.0), random(-2.0, 2.0));
        let half = DVec3::new(random(0.2, 3.0), random(0.2, 3.0), random(0.2, 3.0));
        // The transform moves the box by a metre.
        let bounds = Aabb::new((middle - half - DVec3::X).as_vec3(), (middle + half - DVec3::X).as_vec3());
        let transform = Affine3A::from_translation(Vec3::X);
        let exact = [bounds.min, bounds.max].map(|corner| corner.as_dvec3() + DVec3::X);
        let two_sided = drawer > 0 && trial % 4 < 2;
        let mut off = projection.clone();
        let size = if is_parallel { 1.0 } else { 8.0 };
        let most = [0.02, 0.02, 0.001, if is_parallel { 0.01 } else { 0.0 }];
        for (row, most) in off.rows.iter_mut().zip(most) {
            let error = size * most * [0.0, 0.1, 1.0][random(0.0, 3.0) as usize];
            row.error += error;
            row.constant += error * [-1.0, 1.0, random(-1.0, 1.0)][random(0.0, 3.0) as usize];
        }
        let Some((object, facing)) = project_object(&off, &bounds, &transform) else { continue };
        let corners = core::array::from_fn(|i| {
            let [min, max] = [bounds.min, bounds.max];
            Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { min[axis] } else { max[axis] }))
        });
        let mesh = OccluderTriangles::of_box(&corners, two_sided);
        let (mut tiles, mut shape) = (Tiles::new(SIZE, SIZE), ScreenShape::default());
        let rule = Coverage::Conservative;
        let result = match drawer {
            0 => box_shape(&bounds, &transform, &off, None, rule, &mut shape),
            1 => {
                let scratch = &mut ConvexScratch::default();
                convex_shape(&mesh, &object, &off, facing, rule, true, scratch, &mut shape)
            }
            _ => {
                let (mut scratch, mut cells) = (MeshScratch::default(), ContourTiles::new(&tiles));
                let (scratch, cells) = (&mut scratch, &mut cells);
                draw_mesh(&mesh, &object, &off, facing, rule, None, scratch, cells, &mut tiles);
                ShapeResult::Nothing
            }
        };
        if result == ShapeResult::Ready {
            fill_shape(&shape, &mut tiles);
        }
        let near = projection.near;
        let is_cut = corners
            .iter()
            .any(|corner| DVec3::from(near.linear).dot(corner.as_dvec3() + DVec3::X) + near.constant < 0.0);
        for (x, y) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y))) {
            let key = f64::from(tiles.pixel_closely(x, y));
            if key == f64::NEG_INFINITY {
                continue;
            }
            covered[drawer][usize::from(is_cut)] += 1;
            for corner in [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]] {
                let hit = first_hit(&projection, exact, two_sided, corner.map(|side| side as f64));
                let is_hidden = hit.is_some_and(|hit| key <= hit + 1e-9);
                assert!(is_hidden, "trial {trial}, pixel {x}, {y}: {key} where the box has {hit:?}");
            }
        }
    }
    let least = [[20_000, 0], [20_000, 1_000], [20_000, 1_000]];
    for (counts, least) in covered.iter().zip(least) {
        assert!(counts[0] > least[0] && counts[1] >= least[1], "{covered:?} pixels are covered");
    }
}

/// A triangle that the near plane may cut covers the pixels that its part beyond that plane covers entirely:
/// no other pixel, and all that stay covered if they are larger by a tenth of a pixel.
#[test]
fn triangles_cut_at_the_near_plane_cover_their_rest() {
    let (mut random, mut covered) = (random(62), [[0; 2]; 2]);
    let edges = [[0, 1], [1, 2], [2, 0]].map(|vertices| Edge { vertices, left: 0, right: None });
    for trial in 0..4_000 {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
        let view = if trial % 4 < 2 {
            View::orthographic(pose, Window::centered(4.0, 4.0), 2.0, 20.0)
        } else {
            View::perspective(pose, 1.5, 1.0, 2.0, 20.0)
        };
        let projection = ScreenProjection::new(&view.unwrap(), DVec3::ZERO, [SIZE; 2], [SIZE; 2]);
        let corners =
            [0; 3].map(|_| DVec3::new(random(1.0, 4.0), random(-4.0, 4.0), random(-4.0, 4.0)).as_vec3());
        let object = projection.project_object(&Affine3A::IDENTITY, [4.0; 3]);
        let mesh = OccluderTriangles {
            positions: &corners,
            triangles: &[[0, 1, 2]],
            edges: &edges,
            two_sided: true,
        };
        let (mut tiles, mut shape) = (Tiles::new(SIZE, SIZE), ScreenShape::default());
        let (facing, rule) = (projection.facing, Coverage::Conservative);
        if trial % 2 == 0 {
            let scratch = &mut ConvexScratch::default();
            let result = convex_shape(&mesh, &object, &projection, facing, rule, true, scratch, &mut shape);
            if result == ShapeResult::Ready {
                fill_shape(&shape, &mut tiles);
            }
        } else {
            let (mut scratch, mut cells) = (MeshScratch::default(), ContourTiles::new(&tiles));
            let (scratch, cells) = (&mut scratch, &mut cells);
            draw_mesh(&mesh, &object, &projection, facing, rule, None, scratch, cells, &mut tiles);
        }
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let normal = (b - a).cross(c - a);
        // How far a place is within the triangle and beyond the near plane. Negative outside.
        let depth_within = |place: [f64; 2]| {
            let (start, step) = line_of_sight(&projection, place);
            let t = normal.dot(a - start) / normal.dot(step);
            let p = start + step * t;
            let inside = |a: DVec3, b: DVec3| normal.cross(b - a).dot(p - a) / normal.length_squared();
            t.min(inside(a, b)).min(inside(b, c)).min(inside(c, a))
        };
        let is_cut = corners.iter().any(|corner| corner.x < 2.0);
        for (x, y) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y))) {
            let least = |by: f64| {
                let [low, high] = [[x, y].map(|v| v as f64 - by), [x, y].map(|v| v as f64 + 1.0 + by)];
                let corners = [low, [high[0], low[1]], [low[0], high[1]], high];
                corners.map(depth_within).into_iter().fold(f64::INFINITY, f64::min)
            };
            if tiles.pixel(x, y) > f32::NEG_INFINITY {
                covered[trial % 2][usize::from(is_cut)] += 1;
                assert!(least(0.0) >= -1e-9, "trial {trial}, pixel {x}, {y} of {corners:?} is covered");
            } else {
                assert!(least(0.1) < 1e-6, "trial {trial}, pixel {x}, {y} of {corners:?} is bare");
            }
        }
    }
    assert!(covered.iter().flatten().all(|&count| count > 2_000), "{covered:?} pixels are covered");
}
