//! The screen shape of a convex mesh, or of a mesh that looks convex from the eye: one outline, and one depth
//! plane for each drawn triangle.
//!
//! The shape is sound for any mesh (see [`screen_shape`](super::screen_shape)), but covers only the pixels on
//! the inner side of every contour edge's line. That is too little for meshes that are not convex, so
//! `mesh_raster.rs` draws those. Unlike boxes, meshes may cross the near plane: triangles are cut there, and
//! the cuts bound the shape.

use super::depth_plane::plane;
use super::near_clip::{NEAR, cut_edge};
use super::occluder_triangles::OccluderTriangles;
use super::screen_bounds::{extent_of, pixels};
use super::screen_projection::{ObjectProjection, ScreenProjection};
use super::screen_shape::{ScreenShape, ShapeResult};
use crate::coverage::Coverage;
use crate::vector::{Point, cross, dot, less, point};
use alloc::vec::Vec;

/// Scratch for one mesh, kept from mesh to mesh so that a frame does not allocate.
#[derive(Clone, Debug, Default)]
pub(crate) struct ConvexScratch {
    /// Homogeneous screen coordinates of each vertex: `x` and `y` (pixel coordinates times `w`), `w`, `n`
    /// (depth key times `w`), and the distance beyond the near plane (positive beyond, in the unit of clip
    /// space).
    corners: Vec<[f64; 5]>,
    /// Column and row in pixels of the buffer, and depth key, of each vertex, computed without error bounds.
    screen: Vec<[f64; 3]>,
    /// For each triangle, true if the triangle is drawn: it certainly faces the eye and is not wholly nearer
    /// than the near limit. False for all other triangles.
    drawn: Vec<bool>,
}

/// Replaces `shape` by the screen shape of a mesh. `object` projects the mesh's own coordinates. `facing` is
/// the sign (1 or -1) of the determinant of the corners of triangles that face the eye. `convex` tells that
/// the mesh is known to be convex. Returns [`ShapeResult::DrawAsMesh`] if the mesh has too many edges or
/// planes for a shape, or is neither known to be convex nor looks convex. Returns [`ShapeResult::Nothing`] if
/// the mesh is outside the buffer, or is convex and shows no triangle.
#[inline(always)]
#[expect(clippy::too_many_arguments)]
pub(crate) fn convex_shape(
    mesh: &OccluderTriangles,
    object: &ObjectProjection,
    projection: &ScreenProjection,
    facing: f64,
    coverage: Coverage,
    convex: bool,
    scratch: &mut ConvexScratch,
    shape: &mut ScreenShape,
) -> ShapeResult {
    let ConvexScratch { corners, screen, drawn } = scratch;
    corners.clear();
    let near_limit = object.near_limit();
    let mut nearest = f64::INFINITY;
    for p in mesh.positions {
        let corner = object.at([f64::from(p.x), f64::from(p.y), f64::from(p.z)]);
        nearest = if corner[4] < nearest { corner[4] } else { nearest };
        corners.push(corner);
    }
    let uncut = nearest > near_limit;

    // Screen bounds of the mesh, unless it comes too close to the plane of the eye.
    let around = if uncut { extent_of(corners, screen, object) } else { None };
    let (columns, lines) = match &around {
        Some(around) => match pixels(around, projection) {
            Some(limits) => limits,
            None => return ShapeResult::Nothing,
        },
        None if !convex => return ShapeResult::DrawAsMesh,
        None => ([0.0, projection.size[0]], [0.0, projection.size[1]]),
    };
    let floor = match (&around, projection.perspective) {
        (Some(around), _) => around[4],
        // The depth key is 1 / w, and no point has a greater w than the farthest corner.
        (None, true) => {
            let farthest = corners.iter().fold(0.0, |most: f64, c| most.max(c[2]));
            (1.0 - 4.0 * f64::EPSILON) / (farthest + object.error[2])
        }
        (None, false) => f64::NEG_INFINITY,
    };
    shape.begin(columns, lines, floor, around.map_or(f64::INFINITY, |around| around[5]));

    // Fronts are tried first. If no triangle faces the eye, the backs of a two-sided mesh are drawn. If the
    // mesh is closed, it then surrounds the eye. The directions to its faces are no convex cone: the line of
    // an edge behind the eye would cut away whole faces, and the plane of a face behind the eye would bound
    // the depth of all others. So its triangles are drawn one by one.
    let closed = || mesh.edges.iter().all(|edge| edge.right.is_some());
    for facing in [facing, -facing] {
        if choose(mesh, corners, drawn, facing, near_limit, object.determinant_error())
            && (convex || looks_convex(mesh, screen, drawn, facing))
        {
            return outline(mesh, corners, drawn, object, projection, facing, coverage, near_limit, shape);
        }
        if !mesh.two_sided {
            break;
        }
        if closed() {
            return ShapeResult::DrawAsMesh;
        }
    }
    if convex { ShapeResult::Nothing } else { ShapeResult::DrawAsMesh }
}

/// Returns whether, as seen from the eye, the drawn triangles fill their outline and bulge towards the eye,
/// so that outline and depth planes describe them without loss. `screen` holds the column, row and depth key
/// of each vertex, `drawn` whether each triangle is drawn. `facing` is the sign (1 or -1) of the determinant
/// of triangles that are drawn. False if a vertex lies outside the outline or before a triangle's plane. The
/// answer only chooses the cheaper way to draw, so rounding does no harm.
#[inline(always)]
fn looks_convex(mesh: &OccluderTriangles, screen: &[[f64; 3]], drawn: &[bool], facing: f64) -> bool {
    // Tolerances by which vertices may lie outside an edge's line or in front of a triangle's plane.
    /// Tolerance across the outline, in pixels: how far a vertex may lie outside the line of a contour edge
    /// for the mesh still to count as looking convex.
    const PIXELS: f64 = 0.1;
    /// Tolerance in depth, as a fraction of the depth key: how far a vertex may lie in front of a triangle's
    /// plane for the mesh still to count as looking convex.
    const DEPTH: f64 = 1e-3;
    // No vertex may be outside the line of a contour edge, which has a drawn triangle on one side only.
    for edge in mesh.edges {
        let left = drawn[edge.left as usize];
        let right = edge.right.is_some_and(|t| drawn[t as usize]);
        if left == right {
            continue;
        }
        let [a, b] = edge.vertices.map(|i| &screen[i as usize]);
        let sign = if left { facing } else { -facing };
        let (dx, dy) = ((b[0] - a[0]) * sign, (b[1] - a[1]) * sign);
        let limit = -PIXELS * (dx.abs() + dy.abs());
        let mut inside = true;
        for p in screen {
            inside &= dx * (p[1] - a[1]) - dy * (p[0] - a[0]) >= limit;
        }
        if !inside {
            return false;
        }
    }
    // No vertex may be in front of the plane of a drawn triangle: a dent would be drawn as if it were filled.
    for (i, t) in mesh.triangles.iter().enumerate() {
        if !drawn[i] {
            continue;
        }
        let [a, b, c] = t.map(|i| screen[i as usize]);
        let (u, v) = ([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]);
        let normal = cross(u, v);
        let limit = DEPTH * normal[2].abs() * a[2].abs();
        let mut behind = true;
        for p in screen {
            behind &= dot(normal, [p[0] - a[0], p[1] - a[1], p[2] - a[2]]) * facing <= limit;
        }
        if !behind {
            return false;
        }
    }
    true
}

/// Decides for each triangle whether it is drawn, and replaces `drawn` by the results. A triangle is drawn if
/// it certainly faces the eye and has a corner farther beyond the near plane than `near_limit`. `facing` is
/// the sign (1 or -1) of the determinant of the corners of triangles that face the eye. `certain` bounds the
/// absolute error of such a determinant. Returns whether any triangle is drawn.
#[inline(always)]
fn choose(
    mesh: &OccluderTriangles,
    corners: &[[f64; 5]],
    drawn: &mut Vec<bool>,
    facing: f64,
    near_limit: f64,
    certain: f64,
) -> bool {
    drawn.clear();
    let mut any = false;
    for t in mesh.triangles {
        let [a, b, c] = t.map(|i| &corners[i as usize]);
        let height = dot(cross(point(&less(b, a)), point(&less(c, a))), point(a));
        let front =
            height * facing > certain && (a[4] > near_limit || b[4] > near_limit || c[4] > near_limit);
        drawn.push(front);
        any |= front;
    }
    any
}

/// Adds to `shape` the contour edges, the near-plane cuts and the depth planes of the drawn triangles.
/// Returns [`ShapeResult::Ready`], or [`ShapeResult::DrawAsMesh`] if the shape has no capacity for all of
/// them.
#[inline(always)]
#[expect(clippy::too_many_arguments)]
fn outline(
    mesh: &OccluderTriangles,
    corners: &[[f64; 5]],
    drawn: &[bool],
    object: &ObjectProjection,
    projection: &ScreenProjection,
    facing: f64,
    coverage: Coverage,
    near_limit: f64,
    shape: &mut ScreenShape,
) -> ShapeResult {
    let products = object.cross_error(projection.size);
    let certain = object.determinant_error();
    let keep = |shape: &mut ScreenShape, a: Point, b: Point| {
        let line = cross(a, b);
        shape.add_edge(
            [line[0] * facing, line[1] * facing, line[2] * facing - products],
            projection.size,
            coverage,
        )
    };
    for edge in mesh.edges {
        let left = drawn[edge.left as usize];
        let right = edge.right.is_some_and(|t| drawn[t as usize]);
        let [a, b] = edge.vertices.map(|i| point(&corners[i as usize]));
        // An edge wholly nearer than the near plane bounds no drawn part of a triangle, but keeping it loses
        // little.
        let room = match (left, right) {
            (true, false) => keep(shape, a, b),
            (false, true) => keep(shape, b, a),
            _ => true,
        };
        if !room {
            return ShapeResult::DrawAsMesh;
        }
    }
    for (t, _) in mesh.triangles.iter().zip(drawn).filter(|(_, drawn)| **drawn) {
        let t = t.map(|i| &corners[i as usize]);
        if !shape.add_depth_plane(plane(t, object, projection, &[certain, products]), projection.size) {
            return ShapeResult::DrawAsMesh;
        }
        // The cut at the near plane is an edge of the remaining part of the triangle.
        let first = (0..3).find(|&i| t[i][4] > near_limit && t[(i + 1) % 3][4] <= near_limit);
        let second = (0..3).find(|&i| t[i][4] <= near_limit && t[(i + 1) % 3][4] > near_limit);
        if let (Some(i), Some(j)) = (first, second) {
            let a = point(&cut_edge(t[i], t[(i + 1) % 3], NEAR, near_limit));
            let b = point(&cut_edge(t[j], t[(j + 1) % 3], NEAR, near_limit));
            if !keep(shape, a, b) {
                return ShapeResult::DrawAsMesh;
            }
        }
    }
    ShapeResult::Ready
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::{Affine3A, DVec3, Vec3};
    use visibility_core::{Pose, View, occlusion::Edge};

    /// A flat mesh looks convex from its front, shows nothing of itself from behind, and a bent one that
    /// opens towards the eye does not look convex.
    #[test]
    fn flat_meshes_look_convex_and_dents_do_not() {
        let view = View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 900.0);
        let projection = ScreenProjection::new(&view.unwrap(), DVec3::ZERO, [64, 64], [64, 64]);
        let object = projection.project_object(&Affine3A::IDENTITY, [10.0; 3]);
        let side = |vertices: [u32; 2], left: u32| Edge { vertices, left, right: None };
        let edges = [
            side([0, 1], 0),
            side([1, 2], 0),
            Edge { vertices: [2, 0], left: 0, right: Some(1) },
            side([2, 3], 1),
            side([3, 0], 1),
        ];
        let result = |turned: bool, depth: f32, convex: bool| {
            let order = if turned { [1.0, -1.0] } else { [-1.0, 1.0] };
            let corners = [[order[0], -1.0], [order[1], -1.0], [order[1], 1.0], [order[0], 1.0]];
            let mut positions = corners.map(|[y, z]| Vec3::new(8.0, y, z));
            positions[1].x += depth;
            let triangles = [[0, 1, 2], [0, 2, 3]];
            let mesh = OccluderTriangles {
                positions: &positions,
                triangles: &triangles,
                edges: &edges,
                two_sided: false,
            };
            let (mut scratch, mut shape) = (ConvexScratch::default(), ScreenShape::default());
            let (scratch, facing) = (&mut scratch, projection.facing);
            let rule = Coverage::Conservative;
            convex_shape(&mesh, &object, &projection, facing, rule, convex, scratch, &mut shape)
        };
        let front = [false, true].map(|turned| result(turned, 0.0, false) == ShapeResult::Ready);
        assert!(front[0] != front[1], "a flat mesh is ready from one side: {front:?}");
        let turned = front[1];
        assert_eq!(result(!turned, 0.0, true), ShapeResult::Nothing, "the back of a convex mesh");
        assert_eq!(result(!turned, 0.0, false), ShapeResult::DrawAsMesh, "the back of a flat mesh");
        // The vertex that moves is one end of the diagonal's other side: away from the eye, the mesh bulges.
        let bent = [-1.0, 1.0].map(|depth| result(turned, depth, false));
        assert!(bent.contains(&ShapeResult::DrawAsMesh), "a dent: {bent:?}");
        assert!(bent.contains(&ShapeResult::Ready), "a bulge: {bent:?}");
    }
}
