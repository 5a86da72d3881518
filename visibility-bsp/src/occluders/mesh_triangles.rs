//! The triangles of an occluder's mesh, where it is in the scene.

use super::outline::OccluderTriangle;
use alloc::vec::Vec;
use visibility_core::OccluderMesh;
use visibility_core::glam::{Affine3A, DVec3};

/// The triangles of a mesh where it is; whether it has an inside is for the caller to say. Whether they hide
/// from behind as well: only if the mesh says so and has an inside that can be seen.
pub(crate) fn triangles_of(
    mesh: &OccluderMesh,
    transform: &Affine3A,
    source: u32,
    closed: bool,
    pieces: &mut Vec<OccluderTriangle>,
) {
    let place = placer(transform);
    let at = |i: u32| place(mesh.positions()[i as usize].as_dvec3());
    if (0..mesh.positions().len() as u32).any(|i| !at(i).is_finite()) {
        return;
    }
    let mirrored = transform.matrix3.determinant() < 0.0;
    let first = pieces.len();
    let two_sided = mesh.is_two_sided() && !closed;
    for t in mesh.triangles() {
        let [a, b, c] = t.map(at);
        let corners = if mirrored { [a, c, b] } else { [a, b, c] };
        pieces.push(OccluderTriangle { corners, source, two_sided });
    }
    if mesh.is_two_sided() && closed {
        // Where the file turned the mesh inside out, its outside is what a two-sided one shows.
        let origin = at(0);
        let volume: f64 = pieces[first..]
            .iter()
            .map(|t| {
                let [a, b, c] = t.corners.map(|p| p - origin);
                a.dot(b.cross(c))
            })
            .sum();
        for piece in &mut pieces[first..] {
            if volume < 0.0 {
                piece.corners.swap(1, 2);
            }
        }
    }
}

/// Applies a transform in `f64`; the identity changes nothing, not even by rounding.
fn placer(transform: &Affine3A) -> impl Fn(DVec3) -> DVec3 {
    let identity = *transform == Affine3A::IDENTITY;
    let [x, y, z] = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis]
        .map(|axis| DVec3::from_array(axis.to_array().map(f64::from)));
    let shift = DVec3::from_array(transform.translation.to_array().map(f64::from));
    move |p| if identity { p } else { x * p.x + y * p.y + z * p.z + shift }
}

/// Whether every edge is gone through as often one way as the other: the mesh then has an inside, however its
/// solids touch.
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
