//! The triangles of an occluder's mesh in scene coordinates.

use super::outline::OccluderTriangle;
use crate::clip_projection::U;
use alloc::vec::Vec;
use visibility_core::OccluderMesh;
use visibility_core::geometry::keeps_orientation;
use visibility_core::glam::{Affine3A, DVec3};

/// Appends the triangles of a mesh, transformed to metres relative to `Scene::origin`, with `source` as their
/// object. `closed` tells whether the mesh encloses a volume. The triangles of a two-sided mesh also hide for
/// eyes behind them if the mesh is not closed; if closed, they are turned outwards. Appends nothing if a
/// position is not finite, or if the transform flattens the mesh. Returns a bound on the error of each
/// coordinate of the corners, in metres.
pub(crate) fn triangles_of(
    mesh: &OccluderMesh,
    transform: &Affine3A,
    source: u32,
    closed: bool,
    triangles: &mut Vec<OccluderTriangle>,
) -> f64 {
    let transformed = point_transform(transform);
    let at = |i: u32| transformed(mesh.positions()[i as usize].as_dvec3()).0;
    let mut placing_error = 0.0f64;
    for position in mesh.positions() {
        let (placed, error) = transformed(position.as_dvec3());
        if !placed.is_finite() {
            return 0.0;
        }
        placing_error = placing_error.max(error);
    }
    let Some(keeps_orientation) = keeps_orientation(transform) else { return 0.0 };
    let first = triangles.len();
    let two_sided = mesh.is_two_sided() && !closed;
    for t in mesh.triangles() {
        let [a, b, c] = t.map(at);
        let corners = if keeps_orientation { [a, b, c] } else { [a, c, b] };
        triangles.push(OccluderTriangle { corners, source, two_sided });
    }
    if mesh.is_two_sided() && closed {
        // If a closed two-sided mesh is stored inside out, its triangles are turned so that their fronts face
        // outwards.
        let origin = at(0);
        let volume: f64 = triangles[first..]
            .iter()
            .map(|t| {
                let [a, b, c] = t.corners.map(|p| p - origin);
                a.dot(b.cross(c))
            })
            .sum();
        for triangle in &mut triangles[first..] {
            if volume < 0.0 {
                triangle.corners.swap(1, 2);
            }
        }
    }
    placing_error
}

/// Returns a function that takes mesh-space points to metres relative to `Scene::origin` by an affine
/// transform, computed in `f64`, with a bound on the error of each coordinate in metres. The identity returns
/// points unchanged, without an error.
fn point_transform(transform: &Affine3A) -> impl Fn(DVec3) -> (DVec3, f64) {
    let identity = *transform == Affine3A::IDENTITY;
    let [x, y, z] = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis]
        .map(|axis| DVec3::from_array(axis.to_array().map(f64::from)));
    let shift = DVec3::from_array(transform.translation.to_array().map(f64::from));
    move |p| {
        if identity {
            return (p, 0.0);
        }
        // `f64` holds products of two `f32` exactly, so three sums are rounded.
        let terms = x.abs() * p.x.abs() + y.abs() * p.y.abs() + z.abs() * p.z.abs() + shift.abs();
        (x * p.x + y * p.y + z * p.z + shift, 4.0 * U * terms.max_element())
    }
}

/// Tests whether every edge of an indexed mesh is used equally often in both directions. Such a mesh encloses
/// a volume, even if parts of it touch. True without triangles.
pub(super) fn is_closed(triangles: &[[u32; 3]]) -> bool {
    let mut sides: Vec<(u32, u32, bool)> = Vec::with_capacity(triangles.len() * 3);
    for t in triangles {
        for i in 0..3 {
            let (a, b) = (t[i], t[(i + 1) % 3]);
            sides.push((a.min(b), a.max(b), a < b));
        }
    }
    sides.sort_unstable();
    sides
        .chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
        .all(|same| same.iter().filter(|s| s.2).count() * 2 == same.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Vec3;

    /// A triangle that faces up does so after it is mirrored sideways, also where scales are so small that
    /// the determinant is zero in `f32`.
    #[test]
    fn the_front_of_a_mirrored_triangle_stays_its_front() {
        for scale in [1.0, 1e-16, 1e12] {
            for sideways in [scale, -scale] {
                let corners = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p / scale);
                let mesh = OccluderMesh::from_triangles(&[corners]).unwrap();
                let transform = Affine3A::from_scale(Vec3::new(sideways, scale, scale));
                let mut placed = Vec::new();
                triangles_of(&mesh, &transform, 0, false, &mut placed);
                let [a, b, c] = placed[0].corners;
                assert!((b - a).cross(c - a).z > 0.9, "scales {sideways} and {scale}: {a} {b} {c}");
            }
        }
        let (mesh, mut placed) =
            (OccluderMesh::from_triangles(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]).unwrap(), Vec::new());
        triangles_of(&mesh, &Affine3A::from_scale(Vec3::new(1.0, 1.0, 0.0)), 0, false, &mut placed);
        assert!(placed.is_empty(), "a flattened mesh has no front");
    }

    /// Positions and transforms of whole numbers, whose products and sums exceed the precision of a double.
    #[test]
    fn corners_are_placed_within_the_error_that_is_told() {
        let mut random = visibility_testing::Random(16);
        let mut rounded = 0;
        for _ in 0..2_000 {
            let mut whole = || [(); 3].map(|()| random.between(-(1 << 24), 1 << 24) as f32);
            let axes = [whole(), whole(), whole()];
            // The first axis is much longer than the others.
            let axes = [axes[0].map(|x| x * 1048576.0), axes[1], axes[2]];
            let shift = whole();
            let corners = [whole(), whole(), whole()].map(Vec3::from_array);
            let [x, y, z] = axes.map(Vec3::from_array);
            let transform = Affine3A::from_mat3_translation(
                visibility_core::glam::Mat3::from_cols(x, y, z),
                shift.into(),
            );
            let Ok(mesh) = OccluderMesh::from_triangles(&[corners]) else { continue };
            let mut placed = Vec::new();
            let error = triangles_of(&mesh, &transform, 0, false, &mut placed);
            for corner in placed.iter().flat_map(|triangle| triangle.corners) {
                let exact = |p: Vec3| {
                    [0, 1, 2].map(|i| {
                        let terms = (0..3).map(|k| axes[k][i] as i128 * p[k] as i128);
                        terms.sum::<i128>() + shift[i] as i128
                    })
                };
                // The corners may come in either order.
                let off = |p: &Vec3| {
                    let exact = exact(*p);
                    (0..3).map(|i| (corner[i] as i128 - exact[i]).abs()).max().unwrap_or(0)
                };
                let off = corners.iter().map(off).min().unwrap_or(0);
                assert!(off as f64 <= error, "{corner} is off by {off}, told {error}");
                rounded += usize::from(off > 0);
            }
            assert!(placed.is_empty() || error < 1e7, "{error}");
        }
        assert!(rounded > 1_000, "corners that are rounded: {rounded}");
    }

    #[test]
    fn closed_meshes_hide_from_outside_alone_and_two_sided_ones_are_turned_outwards() {
        let cube = OccluderMesh::CUBOID.map(|[a, b, c]| [a, c, b]);
        let corners = visibility_core::Aabb::from_arrays([0.0; 3], [1.0; 3]).corners();
        for (two_sided, closed) in [(false, false), (false, true), (true, false), (true, true)] {
            let triangles: Vec<_> = cube.iter().map(|t| t.map(|i| corners[i as usize])).collect();
            let mesh = OccluderMesh::from_triangles(&triangles).unwrap();
            let mesh = mesh.with_two_sided(two_sided);
            let mut placed = Vec::new();
            triangles_of(&mesh, &Affine3A::IDENTITY, 0, closed, &mut placed);
            for triangle in placed {
                assert_eq!(
                    triangle.two_sided,
                    two_sided && !closed,
                    "two-sided: {two_sided}, closed: {closed}"
                );
                let [a, b, c] = triangle.corners;
                let is_outwards = (b - a).cross(c - a).dot(a - DVec3::splat(0.5)) > 0.0;
                assert_eq!(is_outwards, two_sided && closed, "two-sided: {two_sided}, closed: {closed}");
            }
        }
    }

    #[test]
    fn a_mesh_is_closed_if_edges_run_both_ways_alike() {
        assert!(is_closed(&OccluderMesh::CUBOID), "a box");
        assert!(!is_closed(&OccluderMesh::CUBOID[1..]), "a box without a triangle");
        // At each corner, as many edges go up as go down.
        assert!(!is_closed(&[[0, 1, 2], [1, 0, 3]]), "two triangles");
    }
}
