//! Kernel of an occluder mesh that counts as convex: the points behind the planes of all its faces.
//!
//! A mesh counts as [convex](OccluderMesh::is_convex) if no vertex is in front of a face by more than two
//! steps of `f32`. Where two faces meet at a sharp edge, a vertex so little in front of both may be the
//! bottom of a notch a thousand times as deep, and the hull of the vertices fills the notch. The kernel does
//! not: a point strictly behind the planes of all faces of a closed mesh sees each face's back, and so is
//! inside.

use visibility_core::OccluderMesh;
use visibility_core::glam::DVec3;

/// Least part of the way to the middle of the mesh by which a vertex is moved that is in front of a face.
const FIRST_PART: f64 = 1.0 / (1u64 << 32) as f64;

/// Kernel of a mesh, in mesh coordinates. Contains a point that is strictly behind the planes of all faces.
pub(super) struct Kernel<'a> {
    mesh: &'a OccluderMesh,
    /// Mean of the vertices, strictly behind the planes of all faces.
    middle: DVec3,
}

impl<'a> Kernel<'a> {
    /// Makes the kernel of a closed mesh. `None` if the mean of the vertices is not strictly behind the
    /// planes of all faces. Takes time linear in the number of triangles.
    pub(super) fn new(mesh: &'a OccluderMesh) -> Option<Self> {
        let positions = mesh.positions();
        let sum: DVec3 = positions.iter().map(|p| p.as_dvec3()).sum();
        let kernel = Self { mesh, middle: sum / positions.len() as f64 };
        let is_behind = |t: &[u32; 3]| kernel.side(t, kernel.middle) > 0.0;
        (mesh.is_closed() && mesh.triangles().iter().all(is_behind)).then_some(kernel)
    }

    /// Returns a point of the kernel near a vertex: the vertex itself, or if that is in front of a face, a
    /// point between the vertex and the middle, at most twice as far from the vertex as needed. `None` if
    /// that is more than halfway. Takes time linear in the number of triangles; exact arithmetic where the
    /// vertex is close to the plane of a face that it is no corner of.
    pub(super) fn nearest(&self, vertex: u32) -> Option<DVec3> {
        let triangles = self.mesh.triangles();
        let p = self.mesh.positions().get(vertex as usize)?.as_dvec3();
        // All vertices of a cuboid are in its kernel.
        if self.mesh.is_cuboid() || triangles.iter().all(|t| t.contains(&vertex) || self.side(t, p) >= 0.0) {
            return Some(p);
        }
        core::iter::successors(Some(FIRST_PART), |part| Some(2.0 * part))
            .take_while(|&part| part < 1.0)
            .map(|part| p + (self.middle - p) * part)
            .find(|&q| triangles.iter().all(|t| self.side(t, q) >= 0.0))
    }

    /// Returns a number with the exact sign of the distance of `p` behind the plane of a triangle: positive
    /// behind it, 0 on it, negative in front of it. `f64` holds all products of three coordinates of `f32`,
    /// so none overflows, nor underflows.
    fn side(&self, triangle: &[u32; 3], p: DVec3) -> f64 {
        let [a, b, c] =
            triangle.map(|i| self.mesh.positions().get(i as usize).map_or(DVec3::NAN, |p| p.as_dvec3()));
        // Points of a level face, the most frequent ones that are in one plane, take no exact arithmetic.
        if (a.cmpeq(p) & b.cmpeq(p) & c.cmpeq(p)).any() {
            return 0.0;
        }
        let [a, b, c, p] = [a, b, c, p].map(|p| robust::Coord3D { x: p.x, y: p.y, z: p.z });
        robust::orient3d(a, b, c, p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Aabb;
    use visibility_core::glam::Vec3;
    use visibility_testing::notched_blade;

    /// Returns how far each vertex is from the point of the kernel near it.
    fn moves(mesh: &OccluderMesh) -> Option<[f64; 8]> {
        let kernel = Kernel::new(mesh)?;
        let mut moves = [0.0; 8];
        for ((vertex, p), by) in (0..).zip(mesh.positions()).zip(&mut moves) {
            *by = kernel.nearest(vertex)?.distance(p.as_dvec3());
        }
        Some(moves)
    }

    #[test]
    fn vertices_of_convex_solids_stay() {
        let cube = OccluderMesh::cuboid(&Aabb::from_arrays([-1.0, 0.0, 2.0], [1.0, 3.0, 4.0])).unwrap();
        for mesh in [cube, notched_blade(0.0, 1.0, 20.0, 0.0), notched_blade(0.0, 1.0, 20.0, -1.0)] {
            assert_eq!(moves(&mesh), Some([0.0; 8]), "{:?}", mesh.positions());
        }
    }

    /// Returns whether a point is in front of a face by more than rounding.
    fn is_in_front(mesh: &OccluderMesh, p: DVec3) -> bool {
        mesh.triangles().iter().any(|t| {
            let [a, b, c] = t.map(|i| mesh.positions()[i as usize].as_dvec3());
            (b - a).cross(c - a).normalize().dot(p - a) > 1e-12
        })
    }

    /// No vertex of a notched blade is in front of a face once it is moved, and none is moved more than twice
    /// as far as needed.
    #[test]
    fn vertices_move_until_they_are_behind_all_faces_and_no_farther() {
        for notch in [0.0625, 0.5, 1.0] {
            let mesh = notched_blade(0.0, 1.0, 20.0, notch);
            let kernel = Kernel::new(&mesh).unwrap();
            let mut moved = 0;
            for (vertex, p) in (0..).zip(mesh.positions().iter().map(|p| p.as_dvec3())) {
                let q = kernel.nearest(vertex).unwrap();
                assert!(!is_in_front(&mesh, q), "notch {notch}: vertex {vertex} at {q}");
                moved += usize::from(q != p);
                let less = p + (q - p) * 0.499_999;
                assert!(
                    q == p || is_in_front(&mesh, less),
                    "notch {notch}: vertex {vertex} at {q} is too far"
                );
            }
            assert!((2..7).contains(&moved), "notch {notch}: {moved} vertices are moved");
        }
        assert_eq!(
            moves(&notched_blade(0.0, 1.0, 20.0, 9.0)),
            None,
            "the middle is above the bottom of the notch"
        );
    }

    /// A mesh that is turned inside out, or that has no inside, has no kernel.
    #[test]
    fn meshes_without_an_inside_have_no_kernel() {
        let solid = notched_blade(0.0, 1.0, 20.0, 0.0);
        let turned: alloc::vec::Vec<_> = solid.triangles().iter().map(|&[a, b, c]| [a, c, b]).collect();
        let turned = OccluderMesh::from_indexed(solid.positions(), &turned).unwrap();
        let open = OccluderMesh::from_indexed(solid.positions(), &solid.triangles()[1..]).unwrap();
        let flat =
            OccluderMesh::from_indexed(&[Vec3::ZERO, Vec3::X, Vec3::Y], &[[0, 1, 2], [0, 2, 1]]).unwrap();
        for (what, mesh) in [("inside out", turned), ("open", open), ("flat", flat)] {
            assert!(Kernel::new(&mesh).is_none(), "{what}");
        }
    }

    /// The middle of a blade is behind all faces, but half of the way from a vertex to it is not.
    #[test]
    fn vertices_that_would_move_more_than_halfway_have_no_point() {
        let notches = (1..40).map(|step| step as f32 * 0.25);
        let mut far = notches.filter(|&notch| {
            let mesh = notched_blade(0.0, 1.0, 20.0, notch);
            Kernel::new(&mesh).is_some() && moves(&mesh).is_none()
        });
        assert!(far.next().is_some(), "no notch is deep enough");
    }

    /// Coordinates at the ends of `f32` keep the exact sign.
    #[test]
    fn tiny_and_huge_meshes_keep_their_kernel() {
        for scale in [-126, -60, 60, 122].map(|exponent| 2f32.powi(exponent)) {
            for notch in [0.0, 0.25] {
                let mesh = notched_blade(0.0, 1.0, 20.0, notch);
                let p: alloc::vec::Vec<Vec3> = mesh.positions().iter().map(|&p| p * scale).collect();
                let scaled = moves(&OccluderMesh::from_indexed(&p, mesh.triangles()).unwrap());
                let expected = moves(&mesh).map(|by| by.map(|by| by * f64::from(scale)));
                assert_eq!(scaled, expected, "scale {scale}, notch {notch}");
            }
        }
    }
}
