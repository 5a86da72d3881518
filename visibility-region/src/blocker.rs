//! Convex blockers: convex solids and single triangles of occluder meshes, and boxes.

use alloc::vec::Vec;
use visibility_core::OccluderMesh;
use visibility_core::geometry::keeps_orientation;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::scene::Triangle;

/// Bound on the error of a transformed coordinate, as a fraction of the sum of the magnitudes of its terms:
/// twice the greatest error of the products and sums in `f64`, which is 4 epsilon.
const TRANSFORMED: f64 = 8.0 * f64::EPSILON;

/// Bound on the depth of dents in a mesh that counts as convex, as a fraction of the greatest magnitude of
/// its coordinates: twice the depth that [`OccluderMesh::is_convex`] allows.
const DENTS: f64 = 4.0 * f32::EPSILON as f64;

/// Returns a bound on the depth of dents in a solid, as a fraction of the greatest magnitude of its
/// coordinates. 0 for a cuboid, and for a mesh that is not convex, since then only its single triangles
/// block.
pub(crate) fn dents(mesh: &OccluderMesh) -> f64 {
    if mesh.is_convex() && !mesh.is_cuboid() { DENTS } else { 0.0 }
}

/// A convex blocker: a closed convex polyhedron, or one convex polygon.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blocker {
    /// Vertices in metres relative to the scene's origin.
    pub(crate) vertices: Vec<DVec3>,
    /// Faces as ranges of `corners`. Corners run counter-clockwise as seen from the side that occludes.
    pub(crate) faces: Vec<core::ops::Range<usize>>,
    /// Vertex indices of the faces, one face after another.
    pub(crate) corners: Vec<u32>,
    /// Bound on the error of each coordinate of the vertices, in metres.
    pub(crate) slack: f64,
    /// Triangles that close a hole of an open mesh, in metres relative to the scene's origin. They do not
    /// exist in the mesh, so the blocker hides nothing from viewpoints that are not strictly behind all of
    /// them. They are also listed in `faces`.
    pub(crate) caps: Vec<[DVec3; 3]>,
}

impl Blocker {
    /// Makes the blocker of a whole convex mesh. `caps` are triangles of the mesh that were added to close
    /// its hole, if it has one. An added triangle may be missing in `caps` only if it lies in the plane of
    /// one that is there.
    pub(crate) fn solid(mesh: &OccluderMesh, transform: &Affine3A, caps: &[Triangle]) -> Self {
        let mut blocker = Self::placed(mesh, transform, mesh.positions().iter().map(|p| p.as_dvec3()));
        let Some(turned) = turn(transform) else { return blocker };
        blocker.corners = mesh.triangles().iter().flat_map(|&t| turned(t)).collect();
        blocker.faces = (0..mesh.triangles().len()).map(|i| i * 3..i * 3 + 3).collect();
        let placement = Placement::new(mesh, transform);
        let order = turned([0, 1, 2]).map(|i| i as usize);
        let placed = |cap: &Triangle| order.map(|i| placement.place(cap[i].as_dvec3()));
        blocker.caps = caps.iter().map(placed).collect();
        blocker
    }

    /// Makes the blocker of one triangle of a mesh, with two faces if the mesh is two-sided.
    pub(crate) fn triangle(mesh: &OccluderMesh, transform: &Affine3A, triangle: usize) -> Self {
        let corners = mesh.triangles()[triangle].map(|i| mesh.positions()[i as usize].as_dvec3());
        let mut blocker = Self::placed(mesh, transform, corners.into_iter());
        let Some(turned) = turn(transform) else { return blocker };
        blocker.corners.extend(turned([0, 1, 2]));
        if mesh.is_two_sided() {
            blocker.corners.extend(turned([0, 2, 1]));
        }
        blocker.faces = (0..blocker.corners.len() / 3).map(|i| i * 3..i * 3 + 3).collect();
        blocker
    }

    /// Makes a blocker without faces, whose vertices are the given points of a mesh mapped to scene
    /// coordinates.
    fn placed(mesh: &OccluderMesh, transform: &Affine3A, points: impl Iterator<Item = DVec3>) -> Self {
        let placement = Placement::new(mesh, transform);
        Self {
            vertices: points.map(|p| placement.place(p)).collect(),
            slack: placement.doubt + placement.size * dents(mesh),
            ..Self::default()
        }
    }

    /// Makes the blocker of a box, given by its least and greatest corner in scene coordinates.
    #[cfg(any(feature = "papers", test))]
    pub(crate) fn cuboid(min: DVec3, max: DVec3) -> Self {
        let at = |corner: usize, bit: usize, axis: usize| {
            if corner >> bit & 1 != 0 { max[axis] } else { min[axis] }
        };
        let vertices = (0..8).map(|i| DVec3::new(at(i, 0, 0), at(i, 1, 1), at(i, 2, 2))).collect();
        // The six sides, counter-clockwise as seen from outside. Bit k of a vertex's index says whether it
        // has the box's maximum on axis k.
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        Self {
            vertices,
            faces: (0..6).map(|i| i * 4..i * 4 + 4).collect(),
            corners: faces.as_flattened().to_vec(),
            slack: 0.0,
            caps: Vec::new(),
        }
    }
}

/// Returns a function that swaps two corners of a triangle if the transform mirrors, so that the front of the
/// triangle stays its front. `None` if the transform flattens, so that there is no front.
fn turn(transform: &Affine3A) -> Option<impl Fn([u32; 3]) -> [u32; 3]> {
    let keeps = keeps_orientation(transform)?;
    Some(move |[a, b, c]: [u32; 3]| if keeps { [a, b, c] } else { [a, c, b] })
}

/// A map from mesh coordinates to scene coordinates, in `f64`.
pub(crate) struct Placement {
    /// Columns of the linear part of the map. `None` if the whole map is the identity: points then stay as
    /// they are, without rounding.
    columns: Option<[DVec3; 3]>,
    translation: DVec3,
    /// Bound, in metres, on the sum of the magnitudes of the terms that add up to a coordinate of any mapped
    /// vertex.
    size: f64,
    /// Bound on the error of each coordinate of a mapped vertex, in metres. 0 for the identity.
    pub(crate) doubt: f64,
}

impl Placement {
    pub(crate) fn new(mesh: &OccluderMesh, transform: &Affine3A) -> Self {
        let reach = f64::from(mesh.bounds().min.abs().max(mesh.bounds().max.abs()).max_element());
        if *transform == Affine3A::IDENTITY {
            return Self { columns: None, translation: DVec3::ZERO, size: reach, doubt: 0.0 };
        }
        let columns = transform.matrix3.to_cols_array_2d().map(|c| DVec3::from_array(c.map(f64::from)));
        let translation = DVec3::from_array(transform.translation.to_array().map(f64::from));
        let largest = columns.iter().fold(0.0, |most: f64, column| most.max(column.abs().max_element()));
        let size = 3.0 * reach * largest + translation.abs().max_element();
        Self { columns: Some(columns), translation, size, doubt: size * TRANSFORMED }
    }

    /// Maps a point from mesh coordinates to scene coordinates.
    pub(crate) fn place(&self, p: DVec3) -> DVec3 {
        match &self.columns {
            Some(columns) => columns[0] * p.x + columns[1] * p.y + columns[2] * p.z + self.translation,
            None => p,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Aabb;
    use visibility_core::geometry::DoubleDouble;
    use visibility_core::glam::Vec3;
    use visibility_testing::Random;

    /// Placed points are off by no more than is told, though the mesh may reach to one side of its origin
    /// alone and the transform may move it along one axis alone. Points that stay where they are are exact.
    #[test]
    fn points_are_placed_within_their_doubt() {
        let mut random = Random(6);
        let mut off = 0;
        for round in 0..2_000 {
            let side = if round % 2 == 0 { Vec3::ONE } else { Vec3::NEG_ONE };
            let corners = [(); 3].map(|()| random.vec3(0.0, 9.0) * side);
            let Ok(mesh) = OccluderMesh::from_triangles(&[corners]) else { continue };
            let columns = [(); 3].map(|()| random.vec3(-1.0, 1.0));
            let translation = if round % 3 == 0 { random.vec3(-1e3, 1e3) } else { Vec3::ZERO };
            let [x, y, z] = columns;
            let transform = Affine3A::from_cols(x.into(), y.into(), z.into(), translation.into());
            let placement = Placement::new(&mesh, &transform);
            for corner in corners {
                let placed = placement.place(corner.as_dvec3());
                for axis in 0..3 {
                    let terms =
                        (0..3).map(|k| (columns[k][axis], corner[k])).chain([(translation[axis], 1.0)]);
                    let exact = terms.fold(DoubleDouble::ZERO, |sum, (a, b)| {
                        sum.plus(DoubleDouble::product(f64::from(a), f64::from(b)))
                    });
                    let error = exact.plus((-placed[axis]).into()).hi.abs();
                    assert!(error <= placement.doubt, "round {round}: {error} of {}", placement.doubt);
                    off += usize::from(error > 0.0);
                }
            }
            let blocker = Blocker::triangle(&mesh, &transform, 0);
            assert_eq!(blocker.slack, placement.doubt, "round {round}: the slack of a triangle");
            let stays = Placement::new(&mesh, &Affine3A::IDENTITY);
            assert_eq!(stays.doubt, 0.0, "points that stay");
        }
        assert!(off > 1_000, "{off} coordinates are rounded");
    }

    /// Convex meshes may have dents up to their slack, unless they are boxes.
    #[test]
    fn convex_meshes_have_dents_unless_they_are_boxes() {
        let cuboid = OccluderMesh::cuboid(&Aabb::new(Vec3::ZERO, Vec3::ONE)).unwrap();
        let [o, x, y, z] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let sides = [[o, y, x], [o, x, z], [o, z, y], [x, y, z]];
        let solid = OccluderMesh::from_triangles(&sides).unwrap();
        let open = OccluderMesh::from_triangles(&sides[..3]).unwrap();
        assert!(cuboid.is_convex() && solid.is_convex() && !open.is_convex(), "two solids and an open mesh");
        assert_eq!([&cuboid, &solid, &open].map(dents), [0.0, 4.0 * f64::from(f32::EPSILON), 0.0], "dents");
        let scaled = Blocker::solid(&solid, &Affine3A::from_scale(Vec3::splat(2.0)), &[]);
        assert!(scaled.slack > 6.0 * 4.0 * f64::from(f32::EPSILON), "dents grow with the solid");
    }

    /// A triangle that faces up does so after it is mirrored sideways, also where scales are so small that
    /// the determinant is zero in `f32`.
    #[test]
    fn the_front_of_a_mirrored_triangle_stays_its_front() {
        for scale in [1.0, 1e-16, 1e12] {
            for sideways in [scale, -scale] {
                let corners = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p / scale);
                let mesh = OccluderMesh::from_triangles(&[corners]).unwrap();
                let transform = Affine3A::from_scale(Vec3::new(sideways, scale, scale));
                let blocker = Blocker::triangle(&mesh, &transform, 0);
                let [a, b, c] = [0, 1, 2].map(|i| blocker.vertices[blocker.corners[i] as usize]);
                assert!((b - a).cross(c - a).z > 0.9, "scales {sideways} and {scale}: {a} {b} {c}");
            }
        }
        let mesh = OccluderMesh::from_triangles(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]).unwrap();
        let flat = Affine3A::from_scale(Vec3::new(1.0, 1.0, 0.0));
        assert!(Blocker::triangle(&mesh, &flat, 0).faces.is_empty(), "a flattened triangle has no front");
        assert!(Blocker::solid(&mesh, &flat, &[]).faces.is_empty(), "nor has a flattened solid");
    }
}
