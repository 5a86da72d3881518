//! Draws meshes of any form, one after the other.
//!
//! # The rule
//! Triangles that certainly face the eye are drawn. Of two-sided meshes, triangles that certainly face away
//! are drawn too, as a second mesh. An edge is inner if exactly two drawn triangles share it, in opposite
//! directions. Every other edge of a drawn triangle is a contour, and so is the cut where the near plane
//! crosses a drawn triangle. A pixel is covered if the contour winds round its centre and does not come
//! within rounding of the closed pixel. Its depth key is the least that any drawn triangle of the mesh has in
//! the pixel's quarter of the tile. Then the mesh merges with other meshes: the greatest key wins.
//!
//! Drawn triangles that no inner edges connect are *sheets*, such as the outer side of a wall and the far
//! side of the room behind it. In a deep mesh of few sheets, each sheet is drawn as a mesh of its own, so
//! that farther sheets do not lower the depth keys of nearer ones.
//!
//! # Why it is sound
//! Let no contour meet a pixel, and let one point of the pixel be in a drawn triangle. Walk from that point
//! to any other point of the pixel. Where the walk leaves a drawn triangle it crosses an edge of the
//! triangle, or the cut of the near plane. The crossed edge is no contour, so another drawn triangle begins
//! there. So the whole pixel is covered by triangles that meet the pixel, and the depths of all of these are
//! taken into account. The contour winds round a centre away from it as often as drawn triangles cover the
//! centre ([`ContourRaster`]). Rounding leaves the centre within a fraction of a pixel of a drawn triangle,
//! and then a point of that triangle is in the pixel.
//!
//! Let `x`, `y` and `w` of a corner beyond the near limit (the distance at which geometry is cut) be off by
//! at most `e_x`, `e_y` and `e_w`, and `w` exceed `8 e_w`. Then a pixel coordinate `q = x / w` is off by `8 /
//! 7 (e_x + |q| e_w) / w`, two roundings aside. The *slack* is the greatest such bound over the mesh, with
//! the factor 5 / 4 for the roundings. 16 units of round-off of the greatest coordinate are added for what is
//! computed of the corners. A point of a segment is off by no more than the ends of the segment, so contours
//! are widened by the slack, and by `2^-20` of a pixel. Meshes whose slack exceeds a quarter of a pixel are
//! not drawn.
//!
//! Twice the area of a triangle on the screen is a difference of two products of differences of coordinates,
//! each of these off by twice the slack at most. So the doubled area is off by twice the slack times the sum
//! of the magnitudes of these differences and four slacks, roundings included. Beyond that bound, its sign is
//! that of the determinant of the corners, since each `w` is positive.

use super::contour_raster::{ContourRaster, ContourTiles, ScreenVertex};
use super::parallax::Parallax;
use crate::buffer::tiles::Tiles;
use crate::coverage::Coverage;
use crate::lanes::{greatest, least};
use crate::rounding::{lower, up};
use crate::setup::depth_plane::plane;
use crate::setup::near_clip::{NEAR, clip_triangle, cut_edge};
use crate::setup::occluder_triangles::OccluderTriangles;
use crate::setup::screen_projection::{ObjectProjection, ScreenProjection};
use crate::vector::{cross, dot, less, point};
use alloc::vec::Vec;
use visibility_core::glam::Vec3;

/// Scratch for one mesh, kept from mesh to mesh so that a frame does not allocate.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeshScratch {
    /// Homogeneous screen coordinates of each vertex: `x` and `y` (pixel coordinates times `w`), `w`, `n`
    /// (depth key times `w`), and the distance beyond the near plane (positive beyond, in the unit of clip
    /// space).
    corners: Vec<[f64; 5]>,
    /// Screen position of each vertex in pixels, with its depth key. Meaningless for a vertex nearer than
    /// [`ObjectProjection::near_limit`], the distance at which geometry is cut.
    screen: Vec<ScreenVertex>,
    /// Side of each triangle that is drawn: positive for the front, negative for the back, 0 if the triangle
    /// is not drawn. The magnitude is the number of the triangle's sheet (group of triangles connected by
    /// inner edges), from 1 on.
    facing: Vec<i8>,
    /// Scratch of [`number_sheets`]: for each triangle, an earlier triangle of its sheet (group of triangles
    /// connected by inner edges), or itself if there is none.
    earlier: Vec<u32>,
}

/// Constant part of the slack, in pixels: the distance by which contours (edges of the drawn area) are
/// widened on both sides, so that rounding covers no pixel too many.
const MIN_SLACK_PX: f64 = 1.0 / 1048576.0;

/// Greatest slack, in pixels, of meshes that are drawn.
const MAX_SLACK_PX: f64 = 0.25;

/// Minimum size of drawn triangles in meshes with many open edges: the summed widths and heights, in pixels,
/// of the screen bounds of two of the triangle's sides. Smaller triangles of such meshes are not drawn, since
/// they hide next to nothing.
const MIN_OPEN_TRIANGLE_SIZE_PX: f64 = 64.0;
/// Minimum number of open edges (edges of only one triangle) of a mesh for [`MIN_OPEN_TRIANGLE_SIZE_PX`] to
/// apply.
const MIN_OPEN_EDGES: usize = 32;

/// Least ratio of the depth keys of the nearest and the farthest vertex of a mesh whose sheets (groups of
/// connected triangles) are drawn one by one. In a mesh that is shallower from the eye, farther sheets hardly
/// lower the depth keys of nearer ones.
const MIN_SHEET_DEPTH_RATIO: f32 = 1.5;

/// Greatest number of triangles of a mesh whose sheets (groups of connected triangles) are drawn one by one:
/// finding the sheets takes time for each edge.
const MAX_SHEET_TRIANGLES: usize = 256;

/// Greatest number of sheets (groups of connected triangles) that are drawn one by one. A mesh with more
/// sheets is drawn as one mesh: most of its sheets are small, and each would take time for all triangles and
/// edges.
pub(super) const MAX_SHEETS: i8 = 8;

/// Number of vertices that are processed together.
const LANES: usize = 8;

/// Bounds on three numbers of the vertices of one mesh and of the points where its edges are cut at the near
/// plane: the error of their screen coordinates, in pixels; their depth keys; and their distance beyond the
/// near plane.
pub(super) struct VertexBounds {
    /// Upper bound on the error, in pixels, of the screen coordinates of vertices and near-plane cuts that
    /// are drawn.
    pub(super) error: f64,
    /// Upper bound on the depth keys (greater is nearer) of vertices and near-plane cuts that are drawn.
    greatest: f64,
    /// Least distance beyond the near plane over all vertices, in the unit of the near row of the
    /// projection. Negative if a vertex is nearer than the near plane.
    nearest: f64,
}

impl VertexBounds {
    /// Start value: no error, no depth key and no near-plane distance yet. Each vertex of the mesh extends
    /// these bounds.
    pub(super) const NONE: Self = Self { error: 0.0, greatest: f64::NEG_INFINITY, nearest: f64::INFINITY };
}

/// Draws a mesh of any form into `tiles`: the pixels that its contour winds round and does not come near, at
/// the least depth key of its triangles there. `object` projects the mesh's own coordinates. `facing` is the
/// sign (1 or -1) of the determinant of the corners of triangles that face the eye. With a `parallax`, the
/// pixels are left out at which the contour appears from some eye of the ball. `scratch` and
/// `contour_tiles` are scratch memory. Returns an upper bound on the mesh's depth keys, or negative infinity
/// if the mesh is not drawn because no triangle certainly shows a side or the errors are too large.
#[inline(always)]
#[expect(clippy::too_many_arguments)]
pub(crate) fn draw_mesh(
    mesh: &OccluderTriangles,
    object: &ObjectProjection,
    projection: &ScreenProjection,
    facing: f64,
    coverage: Coverage,
    parallax: Option<&Parallax>,
    scratch: &mut MeshScratch,
    contour_tiles: &mut ContourTiles,
    tiles: &mut Tiles,
) -> f32 {
    let near_limit = object.near_limit();
    let mut vertex_bounds = VertexBounds::NONE;
    project(mesh.positions, object, near_limit, scratch, &mut vertex_bounds);
    let MeshScratch { corners, screen, facing: drawn, earlier } = scratch;
    // Where the near plane cuts a mesh, the cut points are further corners, whose errors and depth keys count
    // as well.
    let uncut = vertex_bounds.nearest > near_limit;
    if !uncut {
        bound_cuts(mesh, corners, object, near_limit, &mut vertex_bounds);
    }
    // More slack would widen contours so far that most meshes cover little.
    let slack = vertex_bounds.error + MIN_SLACK_PX;
    if !(slack <= MAX_SLACK_PX) {
        return f32::NEG_INFINITY;
    }
    let sides = choose(mesh, corners, screen, uncut.then_some(slack), object, facing, near_limit, drawn);
    if sides == 0 {
        return f32::NEG_INFINITY;
    }
    let errors = [object.determinant_error(), object.cross_error(projection.size)];
    let marked = coverage == Coverage::Conservative;
    // In a parallel view the ratio of depth keys says little. With or without sheets, the result is
    // conservative.
    let farthest = || screen[..mesh.positions.len()].iter().fold(f32::INFINITY, |far, v| least(v.far, far));
    // If near and far parts of a mesh differ much in depth, its sheets (groups of connected triangles) are
    // drawn one by one, so that a far sheet does not lower the depth keys of a near one.
    let has_sheets = mesh.triangles.len() <= MAX_SHEET_TRIANGLES
        && uncut
        && vertex_bounds.greatest >= f64::from(MIN_SHEET_DEPTH_RATIO * farthest());
    let sheets = if has_sheets { number_sheets(mesh, drawn, earlier) } else { 1 };
    // Fronts and backs are drawn as two meshes, so that no edge between a front and a back is inner and the
    // depths of the one do not lower those of the other.
    for turn in 0..2 * sheets {
        let side = if turn < sheets { 1 } else { -1 };
        let sheet = side * (turn % sheets + 1);
        if sides & side_bit(side) == 0 {
            continue;
        }
        let mut contours = ContourRaster::new(contour_tiles, tiles.columns, projection.size, slack);
        // First the depth keys: each tile that a triangle meets is lowered to the least key of the triangle
        // in the tile.
        for (t, &facing) in mesh.triangles.iter().zip(drawn.iter()) {
            if facing != sheet {
                continue;
            }
            let plane = || plane(t.map(|i| &corners[i as usize]), object, projection, &errors);
            if uncut {
                contours.lower_depth_keys(&t.map(|i| screen[i as usize]), plane);
                continue;
            }
            let part = clip_triangle(t.map(|i| &corners[i as usize]), near_limit);
            let mut points = [ScreenVertex::default(); 4];
            for (out, corner) in points.iter_mut().zip(&part.corners[..part.count]) {
                *out = on_screen(corner, object, &mut vertex_bounds);
            }
            contours.lower_depth_keys(&points[..part.count], plane);
            if let Some([a, b]) = part.edge {
                if let Some(parallax) = parallax {
                    contours.erode(&parallax.zone(object, &a, &b));
                }
                let [a, b] = [a, b].map(|corner| on_screen(&corner, object, &mut vertex_bounds));
                contours.contour(&a, &b, side, marked);
            }
        }
        // Then the contour: the edges between a drawn and an undrawn triangle, directed so that the drawn
        // side is always on the same hand.
        for edge in mesh.edges {
            let left = i8::from(drawn[edge.left as usize] == sheet);
            let right = edge.right.map_or(0, |t| i8::from(drawn[t as usize] == sheet));
            // Equal counts: the edge is inner (both triangles are drawn and traverse it in opposite
            // directions), or neither triangle is drawn.
            if left == right {
                continue;
            }
            let [i, j] = edge.vertices.map(|i| i as usize);
            let (mut a, mut b) = (screen[i], screen[j]);
            let (mut p, mut q) = (corners[i], corners[j]);
            if !uncut {
                let cut = || cut_edge(&p, &q, NEAR, near_limit);
                match (p[4] > near_limit, q[4] > near_limit) {
                    (true, true) => {}
                    (true, false) => {
                        q = cut();
                        b = on_screen(&q, object, &mut vertex_bounds);
                    }
                    (false, true) => {
                        p = cut();
                        a = on_screen(&p, object, &mut vertex_bounds);
                    }
                    (false, false) => continue,
                }
            }
            if let Some(parallax) = parallax {
                contours.erode(&parallax.zone(object, &p, &q));
            }
            contours.contour(&a, &b, (left - right) * side, marked);
        }
        contours.merge(tiles);
    }
    up(vertex_bounds.greatest)
}

/// Multiplies the facings of drawn triangles, 1 or -1, by the numbers of their sheets (groups of connected
/// triangles), from 1 on in the order of their first triangles. Returns the number of sheets. If there are
/// more than [`MAX_SHEETS`], leaves the facings as they are and returns 1.
pub(super) fn number_sheets(mesh: &OccluderTriangles, facing: &mut [i8], earlier: &mut Vec<u32>) -> i8 {
    earlier.clear();
    earlier.extend(0..facing.len() as u32);
    let first = |earlier: &mut [u32], mut t: u32| {
        while earlier[t as usize] != t {
            earlier[t as usize] = earlier[earlier[t as usize] as usize];
            t = earlier[t as usize];
        }
        t
    };
    for edge in mesh.edges {
        if let Some(right) = edge.right
            && facing[edge.left as usize] == facing[right as usize]
        {
            let [a, b] = [edge.left, right].map(|t| first(earlier, t));
            earlier[a.max(b) as usize] = a.min(b);
        }
    }
    let is_first = |t: usize| earlier[t] == t as u32 && facing[t] != 0;
    if (0..facing.len()).filter(|&t| is_first(t)).take(MAX_SHEETS as usize + 1).count() > MAX_SHEETS as usize
    {
        return 1;
    }
    let mut sheets = 0;
    for t in 0..facing.len() {
        if facing[t] != 0 {
            // An earlier triangle of the sheet already has the sheet's number.
            let number = if earlier[t] == t as u32 { sheets + 1 } else { facing[earlier[t] as usize].abs() };
            sheets = sheets.max(number);
            facing[t] *= number;
        }
    }
    sheets
}

/// Returns the bit of a side in a mask of sides: bit 0 for fronts (`side` 1), bit 1 for backs (-1).
#[inline(always)]
fn side_bit(side: i8) -> u8 {
    if side > 0 { 1 } else { 2 }
}

/// Computes the homogeneous coordinates and the screen positions of all vertices into `scratch`, and extends
/// `vertex_bounds` by the vertices farther beyond the near plane than `near_limit`. Values of earlier meshes
/// are overwritten.
#[inline(always)]
fn project(
    positions: &[Vec3],
    object: &ObjectProjection,
    near_limit: f64,
    scratch: &mut MeshScratch,
    vertex_bounds: &mut VertexBounds,
) {
    let MeshScratch { corners, screen, .. } = scratch;
    // The vectors only grow; values of earlier meshes are overwritten.
    if corners.len() < positions.len() {
        corners.resize(positions.len(), [0.0; 5]);
        screen.resize(positions.len(), ScreenVertex::default());
    }
    let (mut corners, mut screen) = (&mut corners[..positions.len()], &mut screen[..positions.len()]);
    let mut rest = positions;
    while !rest.is_empty() {
        let count = rest.len().min(LANES);
        let mut p = [[0.0; LANES]; 3];
        for i in 0..LANES {
            // Remaining lanes repeat the last vertex.
            let position = &rest[if i < count { i } else { count - 1 }];
            (p[0][i], p[1][i], p[2][i]) =
                (f64::from(position.x), f64::from(position.y), f64::from(position.z));
        }
        rest = &rest[count..];
        // Rows of the projection (x, y, w, depth, distance from the near plane) times the vertices of all
        // lanes.
        let mut values = [[0.0; LANES]; 5];
        for row in 0..5 {
            let [a, b, c] = [object.linear[0][row], object.linear[1][row], object.linear[2][row]];
            for i in 0..LANES {
                values[row][i] = p[0][i] * a + p[1][i] * b + p[2][i] * c + object.constant[row];
            }
        }
        let [x, y, w, n, near] = &values;
        let (mut sx, mut sy, mut far) = ([0.0; LANES], [0.0; LANES], [0.0f32; LANES]);
        // Vertices nearer than the near plane have no screen position. They count for `nearest` only, which
        // makes the caller cut the mesh.
        let (mut error, mut most, mut nearest) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let known = near[i] > near_limit;
            let (corner, off, high) = project_corner([x[i], y[i], w[i], n[i]], object);
            (sx[i], sy[i], far[i]) = (corner.x, corner.y, corner.far);
            error[i] = if known { off } else { 0.0 };
            most[i] = if known { high } else { f64::NEG_INFINITY };
            nearest[i] = near[i];
        }
        for i in 0..LANES {
            vertex_bounds.error = greatest(error[i], vertex_bounds.error);
            vertex_bounds.greatest = greatest(most[i], vertex_bounds.greatest);
            vertex_bounds.nearest = least(nearest[i], vertex_bounds.nearest);
        }
        let (these, others) = corners.split_at_mut(count);
        for (i, corner) in these.iter_mut().enumerate() {
            *corner = [x[i], y[i], w[i], n[i], near[i]];
        }
        corners = others;
        let (these, others) = screen.split_at_mut(count);
        for (i, corner) in these.iter_mut().enumerate() {
            *corner = ScreenVertex { x: sx[i], y: sy[i], far: far[i] };
        }
        screen = others;
    }
}

/// Projects a corner, given by `x` and `y` (pixel coordinates times `w`), `w` and `n` (depth key times `w`).
/// Returns its screen position, an upper bound on the error of its pixel coordinates in pixels, and an upper
/// bound on its depth key. The error is infinite for a corner at or behind the eye.
#[inline(always)]
pub(crate) fn project_corner([x, y, w, n]: [f64; 4], object: &ObjectProjection) -> (ScreenVertex, f64, f64) {
    let [ex, ey, ew, en, _] = object.error;
    // The reciprocal is infinite for corners at or behind the eye, which makes their error infinite.
    let over = 1.0 / if w > 8.0 * ew { w } else { 0.0 };
    let size = greatest(x.abs(), y.abs()) * over;
    let error = 1.25 * (greatest(ex, ey) + size * ew) * over + 8.0 * f64::EPSILON * size;
    // The error is NaN for a corner in the eye itself.
    let error = if error < f64::INFINITY { error } else { f64::INFINITY };
    let depth_key = n * over;
    let margin = 1.25 * (en + depth_key.abs() * ew) * over;
    (ScreenVertex { x: x * over, y: y * over, far: lower(depth_key - margin) }, error, depth_key + margin)
}

/// Returns the screen position of a corner, given by `x`, `y`, `w`, `n` and the distance beyond the near
/// plane, and extends `vertex_bounds` (bounds on error and depth key) by the corner.
#[inline(always)]
pub(super) fn on_screen(
    &[x, y, w, n, _]: &[f64; 5],
    object: &ObjectProjection,
    vertex_bounds: &mut VertexBounds,
) -> ScreenVertex {
    let (corner, error, most) = project_corner([x, y, w, n], object);
    vertex_bounds.error = greatest(error, vertex_bounds.error);
    vertex_bounds.greatest = greatest(most, vertex_bounds.greatest);
    corner
}

/// Decides for each triangle whether it is drawn, and replaces `drawn` by the results: 1 for a triangle that
/// certainly faces the eye, -1 for one that certainly faces away if the mesh is two-sided, else 0. A triangle
/// is not drawn if none of its corners is farther beyond the near plane than `near_limit`. `slack` is `Some`
/// if all vertices of the mesh are farther than `near_limit`; it bounds the error of their screen coordinates
/// in pixels. Returns the mask of the sides to draw: bit 0 for fronts, bit 1 for backs.
#[inline(always)]
#[expect(clippy::too_many_arguments)]
pub(super) fn choose(
    mesh: &OccluderTriangles,
    corners: &[[f64; 5]],
    screen: &[ScreenVertex],
    slack: Option<f64>,
    object: &ObjectProjection,
    facing: f64,
    near_limit: f64,
    drawn: &mut Vec<i8>,
) -> u8 {
    drawn.clear();
    let (mut fronts, mut backs) = (false, false);
    let back = if mesh.two_sided { -1 } else { 0 };
    if let Some(slack) = slack {
        // In a mesh of mostly open edges, such as foliage, triangles stand alone, and small ones hide next to
        // nothing. The threshold counts an edge that joins two triangles as a side of both.
        let open = (2 * mesh.edges.len()).saturating_sub(3 * mesh.triangles.len());
        let smallest =
            if open >= mesh.triangles.len().max(MIN_OPEN_EDGES) { MIN_OPEN_TRIANGLE_SIZE_PX } else { 0.0 };
        for t in mesh.triangles {
            let [a, b, c] = t.map(|i| &screen[i as usize]);
            let (bx, by, cx, cy) = (b.x - a.x, b.y - a.y, c.x - a.x, c.y - a.y);
            let area = (bx * cy - by * cx) * facing;
            let size = bx.abs() + by.abs() + cx.abs() + cy.abs();
            let certain = if size < smallest { f64::INFINITY } else { 2.0 * slack * (size + 4.0 * slack) };
            let turn = if area < -certain { back } else { 0 };
            let turn = if area > certain { 1 } else { turn };
            (fronts, backs) = (fronts | (turn > 0), backs | (turn < 0));
            drawn.push(turn);
        }
        // The eye is outside a closed mesh all of whose corners are beyond the near plane. From outside, all
        // backs are behind fronts, so they need not be drawn.
        return u8::from(fronts) | if backs && open > 0 { 2 } else { 0 };
    }
    let certain = object.determinant_error();
    for t in mesh.triangles {
        let [a, b, c] = t.map(|i| &corners[i as usize]);
        let height = dot(cross(point(&less(b, a)), point(&less(c, a))), point(a)) * facing;
        let seen = a[4] > near_limit || b[4] > near_limit || c[4] > near_limit;
        let turn = if height < -certain { back } else { 0 };
        let turn = if !seen { 0 } else { if height > certain { 1 } else { turn } };
        (fronts, backs) = (fronts | (turn > 0), backs | (turn < 0));
        drawn.push(turn);
    }
    u8::from(fronts) | if backs { 2 } else { 0 }
}

/// Extends `vertex_bounds` by the points where edges of the mesh cross the distance `near_limit` beyond the
/// near plane.
#[inline(always)]
fn bound_cuts(
    mesh: &OccluderTriangles,
    corners: &[[f64; 5]],
    object: &ObjectProjection,
    near_limit: f64,
    vertex_bounds: &mut VertexBounds,
) {
    for edge in mesh.edges {
        let [a, b] = edge.vertices.map(|i| &corners[i as usize]);
        if (a[4] > near_limit) != (b[4] > near_limit) {
            on_screen(&cut_edge(a, b, NEAR, near_limit), object, vertex_bounds);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact_screen::exact_values;
    use crate::random::random;
    use crate::rounding::FloorCeil;
    use visibility_core::glam::{Affine3A, DVec3};
    use visibility_core::{Pose, View, occlusion::Edge};

    /// Screen positions and depth keys are within their error bounds for points close to the eye's plane,
    /// where most digits of `w` cancel.
    #[test]
    fn vertices_are_within_their_errors() {
        let mut random = random(3);
        let mut close = 0;
        for trial in 0..100_000 {
            let slope = random(0.0005, 0.002);
            let pose = Pose::look_at(DVec3::ZERO, DVec3::new(1.0, slope, 0.0), DVec3::Z);
            let view = View::perspective(pose, 1.0, 1.7, 1e-6, f64::INFINITY).unwrap();
            let projection = ScreenProjection::new(&view, DVec3::ZERO, [640, 360], [640, 360]);
            let y = random(900.0, 1000.0) as f32;
            let p = Vec3::new((-slope * f64::from(y)) as f32, y, random(-1.0, 1.0) as f32);
            let object =
                projection.project_object(&Affine3A::IDENTITY, p.to_array().map(|v| f64::from(v.abs())));
            let [x, y, w, n, _] = object.at(p.to_array().map(f64::from));
            let (vertex, error, most) = project_corner([x, y, w, n], &object);
            if !(error < f64::INFINITY) {
                continue;
            }
            close += u32::from(w < 1e-9);
            let [x, y, w, n, _] = exact_values(&projection, &Affine3A::IDENTITY, p.to_array());
            let over = |key: f64| w.times(key.into()).plus(n.negated()).hi;
            assert!(over(vertex.far.into()) <= 0.0 && over(most) >= 0.0, "trial {trial}: depth keys");
            for (value, exact) in [(vertex.x, x), (vertex.y, y)] {
                let off = exact.plus(w.times((-value).into())).hi.abs();
                assert!(off <= error * w.hi, "trial {trial}: {off} of {}", error * w.hi);
            }
        }
        assert!(close > 100, "{close} points are close");
    }

    /// Bounds hold whichever way `x`, `y`, `w` and `n` of a corner are off by their errors. These errors are
    /// made large here, so that half of one would not do.
    #[test]
    fn corners_are_within_their_errors_if_their_coordinates_are() {
        let mut random = random(13);
        let mut known = 0;
        for trial in 0..20_000 {
            let mut object = ObjectProjection::default();
            for error in &mut object.error {
                // No error is less than a few units of round-off.
                *error = 1e-14 + if random(-1.0, 1.0) > 0.0 { random(0.0, 0.2) } else { 0.0 };
            }
            let [x, y] = [0; 2].map(|_| random(-2.0, 2.0));
            let (w, n) = (random(0.5, 2.0), random(-2.0, 2.0));
            let (corner, error, most) = project_corner([x, y, w, n], &object);
            if !(error < f64::INFINITY) {
                assert!(w <= 8.0 * object.error[2], "trial {trial}: {w} is far above its error");
                continue;
            }
            known += 1;
            for signs in 0..16 {
                let off =
                    [0, 1, 2, 3].map(|i| if signs >> i & 1 == 0 { 1.0 } else { -1.0 } * object.error[i]);
                let (x, y, w, n) = (x + off[0], y + off[1], w + off[2], n + off[3]);
                let wrong = (x / w - corner.x).abs().max((y / w - corner.y).abs());
                assert!(wrong <= error, "trial {trial}, signs {signs:b}: off by {wrong}, not {error}");
                assert!(f64::from(corner.far) <= n / w && n / w <= most, "trial {trial}: depth key");
            }
        }
        assert!(known > 10_000, "{known} corners are known");
    }

    /// The three edges of a triangle with the vertices 0, 1 and 2, without neighbouring triangles.
    const TRIANGLE_EDGES: [Edge; 3] = [
        Edge { vertices: [0, 1], left: 0, right: None },
        Edge { vertices: [1, 2], left: 0, right: None },
        Edge { vertices: [2, 0], left: 0, right: None },
    ];

    /// Tests that coordinates which are off by their whole error bound cover no pixel that the true triangle
    /// leaves partly uncovered.
    #[test]
    fn coordinates_off_by_their_error_cover_no_bare_pixel() {
        let (mut random, mut pixels) = (random(11), 0);
        let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 900.0);
        let projection = ScreenProjection::new(&view.unwrap(), DVec3::ZERO, [64, 64], [64, 64]);
        for trial in 0..2_000 {
            let positions = [0; 3].map(|_| DVec3::new(10.0, random(-6.0, 6.0), random(-6.0, 6.0)).as_vec3());
            let mesh = OccluderTriangles {
                positions: &positions,
                triangles: &[[0, 1, 2]],
                edges: &TRIANGLE_EDGES,
                two_sided: true,
            };
            let object = projection.project_object(&Affine3A::IDENTITY, [10.0; 3]);
            let mut off = object;
            // 0.5 is 0.05 pixels at a distance of 10 m, and 0.01 of `w` is up to 0.06 pixels.
            for (axis, most) in [(0, 0.5), (1, 0.5), (2, if trial % 2 == 0 { 0.01 } else { 0.0 })] {
                off.error[axis] += most;
                off.constant[axis] += [-most, most, random(-most, most)][random(0.0, 3.0) as usize];
            }
            let mut tiles = Tiles::new(64, 64);
            let (mut scratch, mut contour_tiles) = (MeshScratch::default(), ContourTiles::new(&tiles));
            let coverage = Coverage::Conservative;
            draw_mesh(
                &mesh,
                &off,
                &projection,
                1.0,
                coverage,
                None,
                &mut scratch,
                &mut contour_tiles,
                &mut tiles,
            );
            let [a, b, c] = positions.map(|p| {
                let [x, y, w, ..] = object.at(p.to_array().map(f64::from));
                [x / w, y / w]
            });
            let side = |a: [f64; 2], b: [f64; 2], p: [f64; 2]| {
                (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
            };
            let sign = side(a, b, c).signum();
            for (x, y) in (0..64).flat_map(|y| (0..64).map(move |x| (x, y))) {
                if tiles.pixel(x, y) == f32::NEG_INFINITY {
                    continue;
                }
                pixels += 1;
                for corner in [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]] {
                    let p = corner.map(|side| side as f64);
                    let inside = [(a, b), (b, c), (c, a)].iter().all(|&(a, b)| side(a, b, p) * sign >= 0.0);
                    assert!(inside, "trial {trial}: corner {p:?} of a covered pixel is bare");
                }
            }
        }
        assert!(pixels > 100_000, "{pixels} pixels are covered");
    }

    /// Tests that a triangle which faces away is never drawn as a front, nor a front as a back, if screen
    /// coordinates are off by up to the slack.
    #[test]
    fn triangles_off_by_the_slack_keep_their_facing() {
        let mut random = random(12);
        let object = ObjectProjection::default();
        let mesh = OccluderTriangles {
            positions: &[],
            triangles: &[[0, 1, 2]],
            edges: &TRIANGLE_EDGES,
            two_sided: true,
        };
        let (mut drawn, mut certain) = (Vec::new(), 0);
        for trial in 0..100_000 {
            let slack = random(0.0, 0.25);
            let vertex = |x: f64, y: f64| {
                // Coordinates have sixteen fractional bits, so that the doubled area is exact in `f64`.
                [x, y].map(|v| (v * 65536.0).floor_() / 65536.0)
            };
            let (length, height) = (random(0.0, 20.0), random(-1.0, 1.0));
            let true_vertices = [
                vertex(random(0.0, 1.0), random(0.0, 1.0)),
                vertex(length, random(0.0, 1.0)),
                vertex(random(0.0, 1.0) * length, height),
            ];
            let [a, b, c] = true_vertices;
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            let screen = true_vertices.map(|[x, y]| ScreenVertex {
                x: x + slack * [-1.0, 1.0, random(-1.0, 1.0)][random(0.0, 3.0) as usize],
                y: y + slack * [-1.0, 1.0, random(-1.0, 1.0)][random(0.0, 3.0) as usize],
                far: 0.0,
            });
            choose(&mesh, &[], &screen, Some(slack), &object, 1.0, 0.0, &mut drawn);
            let facing = f64::from(drawn[0]);
            assert!(facing == 0.0 || facing * area > 0.0, "trial {trial}: {facing} for {area}");
            certain += u32::from(facing != 0.0);
        }
        assert!(certain > 10_000, "{certain} are certain");
    }
}
