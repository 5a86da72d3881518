//! View of a frame, in the form that drawing a level needs.

use super::prepared::PreparedLevel;
use crate::buffer::tile_layout::SIDE;
use crate::coverage::Coverage;
use crate::query::box_projection::ScreenProjection32;
use crate::rounding::up;
use crate::setup::screen_projection::{ObjectProjection, ScreenProjection, ScreenRow, U, project_object};
use visibility_core::glam::{Affine3A, DMat3, DVec3, Vec3};
use visibility_core::view::{Eye, ViewPlanes, ViewProjection};
use visibility_core::{Aabb, View};

/// Maximum error of a vertex in pixels. Vertices with a greater error are projected again in `f64`.
pub(super) const MAX_ERROR_PX: f32 = 1.0 / 64.0;

/// Maximum distance in pixels by which an outline may move on the screen when its vertices move within the
/// polygon's slab (the layer that holds its vertices). Polygons that exceed it are not drawn.
pub(super) const MAX_BEND_PX: f64 = 1.0 / 64.0;

/// Unit round-off of `f32`.
const U32: f64 = f32::EPSILON as f64 / 2.0;

/// Greatest magnitude of columns and rows within the guard band, as a multiple of the buffer's longer side.
/// Outlines are cut where they leave the band, beyond all pixels.
const GUARD_BAND: f64 = 4.0;

/// Least cosine of the angle between the direction of a parallel view and the normal of a polygon that is
/// drawn.
pub(super) const MIN_PARALLEL_COSINE: f64 = 0.01;

/// The view of a frame relative to the origin of a level.
#[derive(Clone, Debug)]
pub(crate) struct LevelFrame {
    /// Projection of the view in `f64`, for points relative to the origin of the level.
    pub(super) projection: ScreenProjection,
    /// The same projection in `f32`.
    pub(super) projection32: ScreenProjection32,
    /// Projection of the level's vertices in `f64`, with its errors.
    pub(super) object: ObjectProjection,
    /// Bounds on the errors of depth planes: first of a determinant of three points, then of cross products.
    pub(super) plane_errors: [f64; 2],
    /// Eye of a perspective view, in metres relative to the origin of the level; the unit direction of a
    /// parallel view.
    pub(super) eye: DVec3,
    /// Bound on the distance of `eye` from the exact one: in metres for a point; for a direction, the length
    /// of the difference of the unit vectors.
    pub(super) eye_error: f64,
    /// True for a perspective view, false for a parallel one.
    pub(super) perspective: bool,
    /// Clip planes of the view.
    pub(super) clip_planes: ViewPlanes,
    /// Distance beyond the near plane, in the unit of clip space, at which outlines are cut. On a ray that
    /// meets a polygon's plane beyond this distance, all of the polygon's slab (the layer that holds its
    /// vertices) is beyond the near plane.
    pub(super) least_near: f64,
    /// Clip coordinate `w` at which outlines are cut: the remaining points have at least this `w`.
    pub(super) least_w: f64,
    /// Greatest thickness in metres, in a parallel view, of the slab (the layer that holds the vertices) of a
    /// polygon whose outline may be cut. Before the cut, the outline's vertices are moved into one plane, by
    /// up to this thickness.
    pub(super) most_flattened: f64,
    /// The eye's *window*: four points, relative to the anchor, on rays just outside the corners of the
    /// buffer, at about twice the distance at which outlines are cut. All points in the picture that are
    /// nearer than that distance lie in the convex hull of the eye and the window. `None` if the four points
    /// are not certainly beyond that distance.
    pub(super) window: Option<[DVec3; 4]>,
    /// Greatest magnitude in pixels of columns and rows of outlines: outlines are cut there.
    pub(super) guard: f64,
    /// Distance in pixels within which an edge counts as near a pixel. It is more than the error of outlines.
    pub(super) slack: f32,
    /// Pixels that one square metre covers in the middle of the view, facing the eye at a distance of one
    /// metre; in a parallel view at any distance.
    pub(super) pixels_per_area: f32,
    /// Least area of a drawn polygon on the screen, in square pixels, as estimated from its middle.
    pub(super) min_polygon_area: f32,
    /// Upper bound on the product of a point's clip coordinate `w` and the distance in pixels by which the
    /// point, if it is in the picture, moves on the screen when it moves by one metre.
    pub(super) pixels_per_metre: f64,
    /// The five planes that bound the view, in the order and with the coefficients of [`sides`], for tests
    /// whether balls are outside of the view.
    pub(super) sides: [[f32; 5]; 5],
    /// Greatest change of the clip coordinate `w` when a point moves by one metre.
    pub(super) w_per_metre: f64,
    /// Rule that decides which pixels an outline covers.
    pub(super) coverage: Coverage,
    /// Columns of tiles that are drawn, half-open: all columns, or those of a band.
    pub(super) columns: [usize; 2],
}

impl LevelFrame {
    /// Prepares a frame of `view`. `picture` is the width and height of the picture in pixels, `size` that of
    /// the buffer of whole tiles. `None` if the view's numbers are too large or too small to draw anything.
    pub(crate) fn new(
        view: &View,
        level: &PreparedLevel,
        picture: [usize; 2],
        size: [usize; 2],
        coverage: Coverage,
        min_polygon_area: f32,
    ) -> Option<Self> {
        let projection = ScreenProjection::new(view, level.origin, picture, size);
        // Error bounds are computed once for the frame, for points in a box that contains every polygon and
        // the balls around polygons.
        let reach = level.reach.to_array().map(up);
        let bounds = Aabb { min: -Vec3::from(reach), max: Vec3::from(reach) };
        let (object, _) = project_object(&projection, &bounds, &Affine3A::IDENTITY)?;
        let [x, y, w, _] = projection.rows.map(|row| DVec3::from(row.linear));
        let near = DVec3::from(projection.near.linear);
        let perspective = projection.perspective;
        let eye_error = ViewProjection::new(view, level.origin).eye_error();
        let (eye, depth) = if perspective {
            (projection.anchor, w.length_squared())
        } else {
            // The cross product of rows `x` and `y` would point backwards in a mirrored picture.
            let Eye::Direction(along) = view.eye(level.origin) else { return None };
            (along, projection.rows[2].constant * projection.rows[2].constant)
        };
        // Upper bound on the distance in pixels that a point moves on the screen when it moves by a metre,
        // times its `w`.
        let side = projection.size[0].max(projection.size[1]);
        let pixels_per_metre = x.length().max(y.length()) + side * w.length();
        // Along the ray through a pixel, the distance beyond the near plane is linear in `w`, and equals the
        // constant of its row at the eye. A polygon whose slab (the layer that holds its vertices) is no
        // thicker than the eye's distance from it is met at no less than half the `w` of its plane.
        let most_flattened = MAX_BEND_PX * projection.rows[2].constant.abs() / pixels_per_metre;
        let least_near = if perspective {
            projection.near.constant.abs()
        } else {
            near.length() * level.thickness.min(most_flattened) * (2.0 / MIN_PARALLEL_COSINE)
        };
        // The limit is 1,024 errors of such a distance, which covers that of the near plane's constant.
        let least_near = least_near * (1.0 + 1e-6) + 2.0 * object.near_limit();
        // A `w` of at least 1,024 times its error, so that quotients by `w` err by at most a thousandth.
        let least_w = 1024.0 * object.error[2];
        // A polygon's area in pixels, estimated from its area in square metres: it decides only whether the
        // polygon is worth drawing.
        let across = |row: DVec3| {
            let along = if perspective && depth > 0.0 { w * (row.dot(w) / depth) } else { DVec3::ZERO };
            (row - along).length()
        };
        let columns = [0, size[0] / SIDE];
        Some(Self {
            sides: sides(&projection, columns).map(|side| side.map(|value| value as f32)),
            columns,
            coverage,
            min_polygon_area,
            projection32: ScreenProjection32::new(&projection),
            object,
            plane_errors: [object.determinant_error(), object.cross_error(projection.size)],
            eye,
            eye_error,
            perspective,
            clip_planes: view.clip_planes_from(level.origin),
            least_near,
            least_w,
            most_flattened,
            window: window(&projection, least_near, least_w),
            guard: GUARD_BAND * side,
            slack: up(2.0 * f64::from(MAX_ERROR_PX) + MAX_BEND_PX + 64.0 * U32 * GUARD_BAND * side),
            pixels_per_area: (across(x) * across(y) / depth) as f32,
            pixels_per_metre,
            w_per_metre: w.length(),
            projection,
        })
    }

    /// Returns the frame for drawing the half-open range `columns` of tile columns alone.
    pub(super) fn of_columns(&self, columns: [usize; 2]) -> Self {
        // One more tile column on each side, so that polygons which meet near the border are drawn on both
        // sides of it.
        let around = [columns[0].saturating_sub(1), (columns[1] + 1).min(self.columns[1])];
        let sides = sides(&self.projection, around).map(|side| side.map(|value| value as f32));
        Self { sides, columns, ..self.clone() }
    }
}

/// Returns the five planes that bound the part of a view that a half-open range of tile columns shows: left,
/// right, top, bottom and near plane. Each has five coefficients `[a, b, c, d, e]`: `a x + b y + c z + d + e
/// r` is negative for a ball of radius `r` about the point `x`, `y`, `z` that is beyond the plane. Lengths
/// are in metres, points relative to the origin of `projection`. Not rounded conservatively.
pub(crate) fn sides(projection: &ScreenProjection, columns: [usize; 2]) -> [[f64; 5]; 5] {
    let row = |row: &ScreenRow| {
        let linear = DVec3::from(row.linear);
        linear.extend(row.constant - linear.dot(projection.anchor))
    };
    let [column, line, depth] = [0, 1, 2].map(|i| row(&projection.rows[i]));
    let [left, right] = columns.map(|column| (column * SIDE) as f64);
    let below = projection.size[1] * depth - line;
    let sides = [column - left * depth, right * depth - column, line, below, row(&projection.near)];
    sides.map(|side| [side.x, side.y, side.z, side.w, side.truncate().length()])
}

/// Returns the eye's window (see [`LevelFrame::window`]): points on the rays through the corners of the
/// buffer, enlarged by a pixel on each side, at twice the distance `least_near` beyond the near plane. `None`
/// if rounding may have moved a point off its ray, or if a point is not certainly beyond the distance
/// `least_near` and the clip coordinate `least_w`.
fn window(projection: &ScreenProjection, least_near: f64, least_w: f64) -> Option<[DVec3; 4]> {
    let [x, y, w, _] = projection.rows;
    let near = projection.near;
    let [rx, ry, rw, rn] = [x, y, w, near].map(|row| DVec3::from(row.linear));
    let ([width, height], distance) = (projection.size, 2.0 * least_near);
    let mut points = [DVec3::ZERO; 4];
    let corners = [[-1.0, -1.0], [width + 1.0, -1.0], [width + 1.0, height + 1.0], [-1.0, height + 1.0]];
    for (point, [column, row]) in points.iter_mut().zip(corners) {
        let columns = DMat3::from_cols(rx - rw * column, ry - rw * row, rn);
        let wanted = DVec3::new(
            w.constant * column - x.constant,
            w.constant * row - y.constant,
            distance - near.constant,
        );
        *point = columns.transpose().inverse() * wanted;
        // Checks that, despite rounding, the point is within half a pixel and a quarter of the distance of
        // its intended place. The comparisons are false for NaN.
        let [x, y, w, near] = [x, y, w, near].map(|row| {
            let linear = DVec3::from(row.linear);
            let error = 8.0 * U * linear.abs().dot(point.abs()) + 2.0 * row.error;
            (linear.dot(*point) + row.constant, error)
        });
        let is_at = |of: (f64, f64), at: f64| (of.0 - at * w.0).abs() + of.1 + at.abs() * w.1 <= 0.5 * w.0;
        let is_beyond = near.0 - near.1 >= 1.5 * least_near && w.0 - w.1 > 2.0 * least_w;
        if !(is_at(x, column) && is_at(y, row) && is_beyond) {
            return None;
        }
    }
    Some(points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::random;
    use alloc::sync::Arc;
    use visibility_core::Pose;
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::view::Window;
    use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};

    /// The points of the window are outside the buffer by half a pixel, beyond 1.5 times the distance and
    /// beyond twice the `w` asked for, whichever way the rows of the projection are off by their errors, and
    /// in double-double arithmetic where views are as narrow as numbers allow.
    #[test]
    fn windows_are_where_they_should_be() {
        let (mut random, mut counts) = (random(81), [[0; 2]; 2]);
        let size = [64.0, 32.0];
        for trial in 0..20_000 {
            let is_narrow = trial % 2 == 0;
            let fov = if is_narrow { 10.0f64.powi(-(random(0.0, 15.0) as i32)) } else { random(0.1, 2.0) };
            let pose = Pose::look_at(DVec3::ZERO, DVec3::new(1.0, random(-1.0, 1.0), 0.3), DVec3::Z);
            let Ok(view) = View::perspective(pose, fov, 2.0, 0.1, 900.0) else { continue };
            let mut projection = ScreenProjection::new(&view, DVec3::ZERO, [64, 32], [64, 32]);
            let least_near = projection.near.constant.abs();
            // `w` of points at twice the distance, as the window has them.
            let w = 2.0 * least_near / DVec3::from(projection.near.linear).length()
                * DVec3::from(projection.rows[2].linear).length();
            let least_w = if is_narrow { 0.0 } else { w * random(0.1, 1.1) };
            if !is_narrow {
                let most = [w * random(0.0, 1.2), w * random(0.0, 1.2), w * random(0.0, 4e-3)];
                projection.rows.iter_mut().zip(most).for_each(|(row, error)| row.error = error);
                projection.near.error = least_near * random(0.0, 0.6);
            }
            let found = window(&projection, least_near, least_w);
            counts[trial % 2][usize::from(found.is_some())] += 1;
            let corners = [[-1.0, -1.0], [65.0, -1.0], [65.0, 33.0], [-1.0, 33.0]];
            assert_eq!(projection.size, size, "size in pixels");
            for (p, [column, line]) in found.into_iter().flatten().zip(corners) {
                let value = |row: &ScreenRow, sign: f64| {
                    let start = DoubleDouble::sum(row.constant, sign * row.error);
                    let terms = row.linear.into_iter().zip(p.to_array());
                    terms.fold(start, |sum, (a, b)| sum.plus(DoubleDouble::product(a, b)))
                };
                for signs in 0..16 {
                    let sign = |i: i32| if signs >> i & 1 == 0 { 1.0 } else { -1.0 };
                    let ([x, y, w, _], near) = (projection.rows, projection.near);
                    let (x, y, w, near) =
                        (value(&x, sign(0)), value(&y, sign(1)), value(&w, sign(2)), value(&near, sign(3)));
                    let off = |of: DoubleDouble, at: f64| of.plus(w.times((-at).into())).hi.abs() / w.hi;
                    let [beside, above] = [off(x, column), off(y, line)];
                    let case = (trial, fov, beside, above);
                    // The bound is half of the computed `w`, of which the exact one has nearly all.
                    assert!(beside.max(above) <= 0.51, "{case:?}: pixels from the corner {column}, {line}");
                    assert!(near.hi >= 1.5 * least_near, "{case:?}: {} beyond the near plane", near.hi);
                    assert!(w.hi >= 2.0 * least_w, "{case:?}: w is {}", w.hi);
                }
            }
        }
        assert!(counts.iter().flatten().all(|&count| count > 100), "{counts:?} without and with a window");
    }

    /// A frame knows its eye as well as core does, relative to the origin of the level, however far that is.
    #[test]
    fn frames_have_the_error_of_their_eye() {
        let corners = [Vec3::ZERO, Vec3::new(9.0, 9.0, 0.0), Vec3::new(9.0, 0.0, 9.0)];
        let triangles = [LevelTriangle { corners, two_sided: true }];
        let level = Arc::new(LevelOccluders::new(&triangles, LevelSettings::default()).unwrap());
        let mut errors = [(); 2].map(|()| [0.0; 2]);
        for (i, origin) in [DVec3::ZERO, DVec3::new(1e7, 0.1, 0.3)].into_iter().enumerate() {
            let level = PreparedLevel::new(level.clone(), origin);
            let pose = Pose::look_at(origin - DVec3::X, origin + DVec3::new(1.0, 0.2, 0.3), DVec3::Z);
            let window = Window::centered(9.0, 9.0);
            let views =
                [View::perspective(pose, 1.0, 1.0, 0.1, 9.0), View::orthographic(pose, window, 0.1, 9.0)];
            for (error, view) in errors[i].iter_mut().zip(views) {
                let view = view.unwrap();
                let new = LevelFrame::new(&view, &level, [64; 2], [64; 2], Coverage::Conservative, 16.0);
                *error = new.unwrap().eye_error;
                assert_eq!(*error, ViewProjection::new(&view, origin).eye_error(), "error from {origin}");
            }
        }
        let [near, far] = errors;
        assert!(near.iter().chain(&far).all(|&error| error > 0.0) && far[0] > near[0], "{near:?} {far:?}");
    }

    /// Points in the picture move by no more pixels than the bound, in pictures beside the middle of the view
    /// as well. The slack holds a vertex's error, the bend and 16 units of round-off.
    #[test]
    fn points_in_the_picture_move_within_the_bound() {
        let corners = [Vec3::ZERO, Vec3::new(9.0, 9.0, 0.0), Vec3::new(9.0, 0.0, 9.0)];
        let triangles = [LevelTriangle { corners, two_sided: true }];
        let level = LevelOccluders::new(&triangles, LevelSettings::default()).unwrap();
        let level = PreparedLevel::new(Arc::new(level), DVec3::ZERO);
        let (mut random, mut most) = (random(82), [0.0f64; 2]);
        for trial in 0..3_000 {
            let size = [[64, 16], [16, 64]][trial % 2];
            let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
            let [left, bottom] = [0; 2].map(|_| random(-3.0, 3.0));
            let (width, height) = (random(0.05, 2.0), random(0.05, 2.0));
            let window = Window { left, right: left + width, bottom, top: bottom + height };
            let Ok(view) = View::perspective_off_center(pose, window, 0.1, 900.0) else { continue };
            let Some(frame) = LevelFrame::new(&view, &level, size, size, Coverage::Conservative, 16.0) else {
                continue;
            };
            let slack = f64::from(MAX_ERROR_PX) + MAX_BEND_PX + 16.0 * U32 * frame.guard;
            assert!(f64::from(frame.slack) >= slack, "trial {trial}: the slack is {}", frame.slack);
            let rows = frame.projection.rows.map(|row| DVec3::from(row.linear));
            let [x, y, w, _] = rows;
            for axis in 0..2 {
                // A point at a side of the picture, and the direction in which it moves fastest.
                let at = if random(0.0, 1.0) < 0.5 { 0.0 } else { frame.projection.size[axis] };
                let row = [x, y][axis] - w * at;
                let moved = row.length();
                assert!(moved <= frame.pixels_per_metre, "trial {trial}, axis {axis}: {moved} pixels");
                most[trial % 2] = most[trial % 2].max(moved / frame.pixels_per_metre);
            }
        }
        assert!(most.iter().all(|&most| most > 0.7), "{most:?} of the bound");
    }
}
