//! Occluder meshes: welded vertices, triangles, and the edges that join triangles.
//!
//! The region that an occluder hides is bounded by its contour, and the contour consists of edges that do not
//! join two drawn triangles. Edge adjacency is therefore computed once, when the mesh is made.

use crate::binary_format::Fingerprint;
use crate::geometry::orientation;
use crate::{Aabb, geometry::Side};
use alloc::vec::Vec;
use core::fmt;
use glam::{Affine3A, DAffine3, Vec3};

/// An edge of an [`OccluderMesh`], with the triangles on both sides.
///
/// ```
/// use visibility_core::{Aabb, OccluderMesh};
/// let cube = OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3]))?;
/// assert_eq!(cube.edges().len(), 18); // 12 of the cube, 6 across its faces
/// assert!(cube.edges().iter().all(|edge| edge.right.is_some()));
/// # Ok::<(), visibility_core::occlusion::MeshError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Edge {
    /// Vertex indices of the two ends, in the order in which the triangle `left` traverses them.
    pub vertices: [u32; 2],
    /// Index of the triangle that traverses the edge from the first to the second vertex.
    pub left: u32,
    /// Index of the triangle that traverses the edge in the opposite direction. `None` unless exactly two
    /// triangles share the edge, in opposite directions.
    pub right: Option<u32>,
}

/// The reason why triangles cannot make an occluder.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum MeshError {
    /// A vertex index is not below the number of vertices.
    Index {
        /// Index of the first triangle with a vertex index out of range.
        triangle: usize,
        /// The vertex index out of range: not below the number of vertices.
        index: u32,
    },
    /// A coordinate is NaN or infinite.
    Vertex {
        /// Index of the first vertex with a NaN or infinite coordinate.
        vertex: usize,
    },
    /// There is no triangle with an area.
    NoTriangle,
    /// There are more vertices or triangles than 32 bits can count.
    TooMany,
}

impl fmt::Display for MeshError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Index { triangle, index } => write!(f, "triangle {triangle} has no vertex {index}"),
            Self::Vertex { vertex } => write!(f, "vertex {vertex} of the occluder is not finite"),
            Self::NoTriangle => write!(f, "the occluder has no triangle with an area"),
            Self::TooMany => write!(f, "the occluder has more vertices or triangles than 32 bits count"),
        }
    }
}

impl core::error::Error for MeshError {}

/// A triangle mesh, in mesh coordinates, that occludes what lies behind its triangles.
///
/// The front of a triangle is the side from which its corners run counter-clockwise. Only front faces
/// occlude, as with backface culling, unless the mesh is [two-sided](Self::with_two_sided).
///
/// ```
/// use visibility_core::{Aabb, OccluderMesh};
/// let wall = OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [4.0, 0.2, 3.0]))?;
/// assert!(wall.is_closed() && wall.is_convex() && !wall.is_two_sided());
/// # Ok::<(), visibility_core::occlusion::MeshError>(())
/// ```
#[derive(Clone, PartialEq, Debug)]
pub struct OccluderMesh {
    pub(super) positions: Vec<Vec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    edges: Vec<Edge>,
    /// Edge indices of each triangle: from its first vertex to its second, second to third, third to first.
    triangle_edges: Vec<[u32; 3]>,
    bounds: Aabb,
    /// True if every edge joins two triangles.
    closed: bool,
    pub(super) convex: bool,
    /// True if the mesh is exactly its own bounding box.
    cuboid: bool,
    /// True if back faces occlude too, false if only front faces do.
    two_sided: bool,
    /// Separate convex solids of the mesh and, last, the remaining triangles. Empty if the mesh is not split.
    pub(super) parts: Vec<OccluderMesh>,
    /// Number of triangles that belong to convex solids. Stored, since it is read for each occluder in each
    /// frame.
    pub(super) solid_triangles: usize,
    /// Projected area of the triangles that face +x, +y, +z, -x, -y, -z, along that axis, in square metres.
    facing: [f32; 6],
    /// Hash of positions and triangles, without `two_sided`.
    fingerprint: Fingerprint,
}

impl OccluderMesh {
    /// Triangles of a box as indices of its [corners](Aabb::corners): two for each face, counter-clockwise
    /// from outside.
    pub const CUBOID: [[u32; 3]; 12] = [
        [0, 2, 3],
        [0, 3, 1],
        [4, 5, 7],
        [4, 7, 6],
        [0, 1, 5],
        [0, 5, 4],
        [2, 6, 7],
        [2, 7, 3],
        [0, 4, 6],
        [0, 6, 2],
        [1, 3, 7],
        [1, 7, 5],
    ];

    /// Reads all that the choice of occluders needs of the mesh, to bring it into the cache. The result is a
    /// meaningless mixture of the values read; using it keeps the compiler from removing the reads.
    pub(crate) fn fetched(&self) -> u32 {
        let sizes = self.triangles.len() ^ self.solid_triangles;
        sizes as u32 ^ self.bounds.min.x.to_bits() ^ self.facing[0].to_bits() ^ self.facing[5].to_bits()
    }

    /// Makes a mesh of triangles that index welded `positions` and have areas, and does not split the mesh
    /// into its convex [`parts`](Self::parts). Unused positions are dropped. A mesh that is an axis-aligned
    /// box gets the vertex and triangle order of [`CUBOID`](Self::CUBOID). `None` without triangles.
    pub(super) fn whole(positions: &[Vec3], triangles: Vec<[u32; 3]>) -> Option<Self> {
        if triangles.is_empty() {
            return None;
        }
        let (positions, triangles) = compact(positions, triangles);
        let (edges, triangle_edges) = join(&triangles);
        let closed = edges.iter().all(|edge| edge.right.is_some());
        let corner = |t: &[u32; 3]| t.map(|i| positions[i as usize]);
        let bounds = Aabb::from_points(triangles.iter().flat_map(corner));
        let convex = closed && is_convex(&positions, &triangles, &bounds);
        let corners = bounds.corners();
        // A convex mesh of twelve triangles with the eight corners of its bounds is that box. It is stored in
        // one fixed order, so that all such meshes are drawn by the box's own code.
        let cuboid = convex
            && triangles.len() == Self::CUBOID.len()
            && positions.len() == corners.len()
            && positions.iter().all(|p| corners.contains(p));
        if cuboid && (positions != corners || triangles != Self::CUBOID) {
            return Self::whole(&corners, Self::CUBOID.to_vec());
        }
        // Area towards each of the six directions along the axes: an estimate of the area that the mesh shows
        // to an eye on that side.
        let mut facing = [0.0; 6];
        for t in &triangles {
            let [a, b, c] = corner(t).map(|p| p.as_dvec3());
            let area = ((b - a).cross(c - a) * 0.5).to_array();
            for axis in 0..3 {
                facing[axis] += area[axis].max(0.0) as f32;
                facing[axis + 3] += (-area[axis]).max(0.0) as f32;
            }
        }
        // Equal meshes have equal fingerprints, on every machine: bits of the coordinates, then indices.
        let numbers = positions.iter().flat_map(|p| p.to_array().map(f32::to_bits));
        let fingerprint = numbers
            .chain(triangles.as_flattened().iter().copied())
            .fold(Fingerprint::new(), Fingerprint::with);
        let solid_triangles = if convex { triangles.len() } else { 0 };
        Some(Self {
            positions,
            triangles,
            edges,
            triangle_edges,
            bounds,
            closed,
            convex,
            cuboid,
            two_sided: false,
            parts: Vec::new(),
            solid_triangles,
            facing,
            fingerprint,
        })
    }

    /// Returns the mesh with back faces that occlude too (`true`) or do not (`false`, the default).
    #[must_use]
    pub fn with_two_sided(self, two_sided: bool) -> Self {
        let mut mesh = self;
        mesh.two_sided = two_sided;
        mesh.parts.iter_mut().for_each(|part| part.two_sided = two_sided);
        mesh
    }

    /// Returns the separate convex solids of the mesh and, last, the mesh of the remaining triangles, if any.
    /// Empty if the mesh has no convex solids or is itself one. The parts together have all triangles of the
    /// mesh. Drawing the parts is often cheaper: a table is five boxes.
    ///
    /// ```
    /// use visibility_core::{scene::Triangle, Aabb, OccluderMesh};
    /// let box_at = |x: f32| OccluderMesh::cuboid(&Aabb::from_arrays([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]));
    /// let loose = |mesh: &OccluderMesh| -> Vec<Triangle> {
    ///     mesh.triangles().iter().map(|t| t.map(|i| mesh.positions()[i as usize])).collect()
    /// };
    /// let two = OccluderMesh::from_triangles(&[loose(&box_at(0.0)?), loose(&box_at(5.0)?)].concat())?;
    /// assert!(two.parts().len() == 2 && two.parts().iter().all(OccluderMesh::is_cuboid));
    /// # Ok::<(), visibility_core::occlusion::MeshError>(())
    /// ```
    pub fn parts(&self) -> &[OccluderMesh] {
        &self.parts
    }

    /// Returns the number of triangles that belong to convex solids: all triangles of a convex mesh,
    /// otherwise the triangles of its convex [`parts`](Self::parts). 0 if the mesh has no convex solid.
    ///
    /// ```
    /// use visibility_core::{Aabb, OccluderMesh};
    /// let cube = OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3]))?;
    /// assert_eq!(cube.solid_triangles(), 12);
    /// # Ok::<(), visibility_core::occlusion::MeshError>(())
    /// ```
    pub fn solid_triangles(&self) -> usize {
        self.solid_triangles
    }

    /// Returns the distinct vertex positions, in mesh coordinates.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// Returns the triangles as indices into [`positions`](Self::positions), counter-clockwise from the
    /// front.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Returns all edges. An edge of a single triangle is listed once. An edge that two triangles traverse in
    /// opposite directions is also listed once. An edge that more than two triangles share, or that two
    /// triangles traverse in the same direction, is listed once for each of these triangles, with `right`
    /// equal to `None`.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Returns, for each triangle, its three indices into [`edges`](Self::edges): from the first vertex to
    /// the second, second to third, third to first.
    pub fn triangle_edges(&self) -> &[[u32; 3]] {
        &self.triangle_edges
    }

    /// Returns the bounding box in mesh coordinates.
    pub fn bounds(&self) -> &Aabb {
        &self.bounds
    }

    /// Returns the smallest box around the vertices where `transform` places them, rounded outwards to `f32`;
    /// the box holds them up to the rounding of `f64`. Takes time linear in the number of vertices, unlike
    /// [`bounds`](Self::bounds) [transformed](Aabb::transformed), which is larger for a turned mesh.
    pub fn placed_bounds(&self, transform: &Affine3A) -> Aabb {
        let exact = DAffine3::from_cols_array(&transform.to_cols_array().map(f64::from));
        Aabb::around_placed(&self.positions, &exact)
    }

    /// Tests whether every edge joins two triangles. No back face of a closed mesh can be seen from outside.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// Tests whether the mesh is a closed convex solid facing outwards, up to the rounding of its vertices to
    /// `f32`. Always false for more than 256 triangles.
    pub fn is_convex(&self) -> bool {
        self.convex
    }

    /// Tests whether the mesh is exactly its own bounding box. Its vertices are then in the order of
    /// [`Aabb::corners`] and its triangles those of [`CUBOID`](Self::CUBOID).
    pub fn is_cuboid(&self) -> bool {
        self.cuboid
    }

    /// Tests whether back faces occlude as well as front faces.
    pub fn is_two_sided(&self) -> bool {
        self.two_sided
    }

    /// Returns a hash of positions, triangles and two-sidedness, to detect a changed occluder.
    pub(crate) fn fingerprint(&self) -> Fingerprint {
        self.fingerprint.with(self.two_sided.into())
    }

    /// Returns the approximate projected area of the occluding faces, in square metres, for a distant eye.
    /// `direction` is a unit vector from the mesh towards the eye, in mesh coordinates. The area is exact for
    /// axis-aligned boxes and up to 1.7 times too large for other convex meshes. Faces that cover each other
    /// are counted repeatedly.
    pub(super) fn area_towards(&self, direction: Vec3) -> f32 {
        let d = direction.to_array();
        let part = |axis: usize| {
            let (front, back) = (self.facing[axis], self.facing[axis + 3]);
            let shown = if d[axis] > 0.0 { front } else { back };
            d[axis].abs() * if self.two_sided { front.max(back) } else { shown }
        };
        part(0) + part(1) + part(2)
    }
}

/// Drops unused positions. Returns the used positions in their order, and the triangles reindexed
/// accordingly. Time is O(n log n) in the number of triangles, independent of the number of positions: a mesh
/// of many boxes calls the function for each box.
fn compact(positions: &[Vec3], mut triangles: Vec<[u32; 3]>) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut used = triangles.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    let place = |i: u32| used.partition_point(|&other| other < i) as u32;
    triangles.as_flattened_mut().iter_mut().for_each(|i| *i = place(*i));
    (used.iter().map(|&i| positions[i as usize]).collect(), triangles)
}

/// Computes edge adjacency. Returns the edges, and for each triangle its three edge indices in the order of
/// its sides.
pub(super) fn join(triangles: &[[u32; 3]]) -> (Vec<Edge>, Vec<[u32; 3]>) {
    /// One directed side of one triangle.
    struct Side {
        low: u32,
        high: u32,
        backwards: bool,
        triangle: u32,
        corner: usize,
    }
    let mut sides = Vec::with_capacity(triangles.len() * 3);
    for (triangle, t) in (0..).zip(triangles) {
        for corner in 0..3 {
            let (from, to) = (t[corner], t[(corner + 1) % 3]);
            sides.push(Side {
                low: from.min(to),
                high: from.max(to),
                backwards: from > to,
                triangle,
                corner,
            });
        }
    }
    // The sort brings the sides of one edge together, in whichever direction each triangle runs along it.
    sides.sort_unstable_by_key(|s| (s.low, s.high, s.triangle));
    let mut edges = Vec::with_capacity(sides.len() / 2);
    let mut triangle_edges = alloc::vec![[0; 3]; triangles.len()];
    for group in sides.chunk_by(|a, b| (a.low, a.high) == (b.low, b.high)) {
        // Two triangles that traverse the edge in opposite directions share it. In any other group (one
        // triangle, three or more, or two in the same direction), each triangle gets an open edge of its own.
        let joined = group.len() == 2 && group[0].backwards != group[1].backwards;
        for (position, side) in group.iter().enumerate() {
            if position == 0 || !joined {
                let vertices = if side.backwards { [side.high, side.low] } else { [side.low, side.high] };
                let right = joined.then(|| group[1].triangle);
                edges.push(Edge { vertices, left: side.triangle, right });
            }
            triangle_edges[side.triangle as usize][side.corner] = edges.len() as u32 - 1;
        }
    }
    (edges, triangle_edges)
}

/// Tests whether a closed mesh is a convex solid that faces outwards. The test takes quadratic time, so
/// meshes of more than 256 triangles count as not convex.
///
/// Rounding may have moved vertices in front of a face by a few steps of `f32`. Such a dent is tolerated only
/// if it is small beside the mesh: some vertex must be behind the face by more than four times the tolerated
/// distance. If none is, no vertex may be in front of the face, as far as `f64` can tell, and at least one
/// must be behind it.
fn is_convex(positions: &[Vec3], triangles: &[[u32; 3]], bounds: &Aabb) -> bool {
    if triangles.len() > 256 {
        return false;
    }
    let reach = bounds.min.abs().max(bounds.max.abs()).max_element();
    let allowed = f64::from(reach) * 2.0 * f64::from(f32::EPSILON);
    triangles.iter().all(|t| {
        let [a, b, c] = t.map(|i| positions[i as usize].as_dvec3());
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let heights = || positions.iter().map(|p| normal.dot(p.as_dvec3() - a));
        let sides = || positions.iter().map(|p| orientation(a, b, c, p.as_dvec3()));
        let is_clear = heights().any(|height| height < -4.0 * allowed);
        heights().all(|height| height <= allowed)
            && (is_clear || sides().all(|side| side != Side::Front) && sides().any(|side| side == Side::Back))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> OccluderMesh {
        OccluderMesh::cuboid(&Aabb::from_arrays([-1.0, 0.0, 2.0], [1.0, 3.0, 4.0])).unwrap()
    }

    #[test]
    fn a_box_is_closed_convex_and_faces_outwards() {
        let cube = cube();
        assert!(cube.is_closed() && cube.is_convex(), "a cuboid is closed and convex");
        assert_eq!(
            (cube.positions().len(), cube.triangles().len()),
            (8, 12),
            "vertices and triangles of a cuboid"
        );
        let center = cube.bounds().center();
        for t in cube.triangles() {
            let [a, b, c] = t.map(|i| cube.positions()[i as usize]);
            assert!((b - a).cross(c - a).dot(a - center) > 0.0, "the triangle {a} {b} {c} faces inwards");
        }
        assert_eq!(cube.area_towards(Vec3::X), 6.0, "the projected area in square metres");
        assert_eq!(cube.area_towards(Vec3::NEG_Z), 6.0, "the projected area in square metres");
    }

    #[test]
    fn loose_triangles_are_welded_and_joined() {
        let cube = cube();
        let loose: Vec<crate::scene::Triangle> =
            cube.triangles().iter().map(|t| t.map(|i| cube.positions()[i as usize])).collect();
        let again = OccluderMesh::from_triangles(&loose).unwrap();
        assert_eq!(
            (again.positions().len(), again.edges().len()),
            (8, 18),
            "vertices and edges of the welded cuboid"
        );
        assert!(again.is_closed() && again.is_convex(), "the welded cuboid is closed and convex");
        let open = OccluderMesh::from_triangles(&loose[1..]).unwrap();
        assert!(!open.is_closed() && !open.is_convex(), "a cuboid without one triangle is open");
        assert_eq!(open.edges().iter().filter(|edge| edge.right.is_none()).count(), 3, "edges of the hole");
    }

    #[test]
    fn edges_and_triangles_point_at_each_other() {
        let cube = cube();
        for (triangle, edges) in cube.triangle_edges().iter().enumerate() {
            for (corner, &edge) in edges.iter().enumerate() {
                let Edge { vertices, left, right } = cube.edges()[edge as usize];
                let t = cube.triangles()[triangle];
                let side = [t[corner], t[(corner + 1) % 3]];
                if left as usize == triangle {
                    assert_eq!(vertices, side, "an edge runs the way of its left triangle, {triangle}");
                } else {
                    assert_eq!(
                        (right, [vertices[1], vertices[0]]),
                        (Some(triangle as u32), side),
                        "an edge runs against its right triangle"
                    );
                }
            }
        }
    }

    #[test]
    fn an_edge_of_three_triangles_joins_none() {
        let p = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_Y];
        let fan = OccluderMesh::from_indexed(&p, &[[0, 1, 2], [1, 0, 3], [0, 1, 4]]).unwrap();
        assert!(
            fan.edges().iter().all(|edge| edge.right.is_none()),
            "three triangles at an edge: each keeps an edge of its own"
        );
        assert_eq!(fan.edges().len(), 9, "edges of three triangles that share none");
        let same_way = OccluderMesh::from_indexed(&p, &[[0, 1, 2], [0, 1, 3]]).unwrap();
        assert!(
            same_way.edges().iter().all(|edge| edge.right.is_none()),
            "two triangles that run the same way along an edge share none"
        );
    }

    #[test]
    fn bad_meshes_are_refused_with_the_reason() {
        let p = [Vec3::ZERO, Vec3::X, Vec3::Y];
        assert_eq!(
            OccluderMesh::from_indexed(&p, &[[0, 1, 2], [0, 1, 7]]),
            Err(MeshError::Index { triangle: 1, index: 7 }),
            "the triangle and the index of the vertex that does not exist"
        );
        assert_eq!(
            OccluderMesh::from_indexed(&p, &[[0, 1, 3]]),
            Err(MeshError::Index { triangle: 0, index: 3 }),
            "the index just beyond the vertices"
        );
        assert_eq!(
            OccluderMesh::from_indexed(&p, &[[0, 1, 1]]),
            Err(MeshError::NoTriangle),
            "a triangle with the same vertex twice is left out, and none remains"
        );
        assert_eq!(OccluderMesh::from_triangles(&[]), Err(MeshError::NoTriangle), "no triangles");
        assert_eq!(
            OccluderMesh::from_triangles(&[[Vec3::ZERO, Vec3::NAN, Vec3::X]]),
            Err(MeshError::Vertex { vertex: 1 }),
            "the index of the vertex that is NaN"
        );
        assert_eq!(
            OccluderMesh::cuboid(&Aabb::EMPTY),
            Err(MeshError::NoTriangle),
            "the cuboid of the empty box"
        );
    }

    #[test]
    fn vertices_without_a_triangle_do_not_count() {
        let mut p = cube().positions().to_vec();
        p.insert(0, Vec3::splat(100.0));
        let triangles: Vec<_> = cube().triangles().iter().map(|t| t.map(|i| i + 1)).collect();
        let mesh = OccluderMesh::from_indexed(&p, &triangles).unwrap();
        assert!(mesh.is_convex() && mesh.positions().len() == 8, "the vertex far away is dropped");
        assert_eq!(mesh.fingerprint(), cube().fingerprint(), "the same triangles have the same fingerprint");
        assert_ne!(
            mesh.fingerprint(),
            cube().with_two_sided(true).fingerprint(),
            "two-sided meshes have another fingerprint"
        );
    }

    #[test]
    fn dents_are_not_convex() {
        let mut p = cube().positions().to_vec();
        p[0] += Vec3::splat(0.5);
        let dented = OccluderMesh::from_indexed(&p, cube().triangles()).unwrap();
        assert!(dented.is_closed(), "moving a vertex opens no edge");
        let mut p = cube().positions().to_vec();
        p.push(Vec3::new(0.0, 1.5, 3.5));
        // The top face of the cube is replaced by four triangles around a point pushed inwards.
        let mut triangles: Vec<_> =
            cube().triangles().iter().filter(|t| !t.iter().all(|i| *i >= 4)).copied().collect();
        triangles.extend([[4, 5, 8], [5, 7, 8], [7, 6, 8], [6, 4, 8]]);
        let dented = OccluderMesh::from_indexed(&p, &triangles).unwrap();
        assert!(dented.is_closed() && !dented.is_convex(), "a dent in the top face");
    }

    /// Far from the origin, rounding tolerance must not make a box turned inside out a convex solid: at
    /// 10,000 km one step of `f32` is a metre, as large as the box's extent.
    #[test]
    fn a_room_two_ulps_wide_that_is_turned_inside_out_is_no_solid() {
        for reach in [2.0, 1e3, 1e7, 1e30] {
            let at = Vec3::splat(reach);
            let ulp = f32::from_bits(reach.to_bits() + 1) - reach;
            let bounds = Aabb::new(at, at + 2.0 * ulp);
            let box_ = OccluderMesh::cuboid(&bounds).unwrap();
            assert!(box_.is_convex() && box_.is_cuboid(), "{reach}: a solid that is exactly convex");
            let inwards = OccluderMesh::CUBOID.map(|[a, b, c]| [a, c, b]);
            let room = OccluderMesh::from_indexed(&bounds.corners(), &inwards).unwrap();
            assert!(room.is_closed() && !room.is_convex() && !room.is_cuboid(), "{reach}");
            assert_eq!(
                room.solid_triangles(),
                0,
                "reach {reach}: a room that faces inwards has no solid triangles"
            );
            let turned: Vec<_> =
                room.triangles().iter().map(|t| t.map(|i| room.positions()[i as usize])).collect();
            let given = inwards.map(|t| t.map(|i| bounds.corners()[i as usize]));
            assert_eq!(turned, given, "{reach}: no triangle is turned");
            // The inverted room is also no solid as a part of a larger mesh.
            let far = Aabb::new(at + 8.0 * ulp, at + 12.0 * ulp);
            let loose = OccluderMesh::CUBOID.map(|t| t.map(|i| far.corners()[i as usize]));
            let two = OccluderMesh::from_triangles(&[&given[..], &loose[..]].concat()).unwrap();
            assert_eq!(two.solid_triangles(), 12, "{reach}");
        }
    }

    #[test]
    fn dents_that_are_large_beside_the_mesh_are_not_convex() {
        let at = Vec3::splat(1e7);
        let mut p = Aabb::new(at, at + 4.0).corners().to_vec();
        p.push(at + Vec3::new(2.0, 2.0, 3.0));
        let mut triangles: Vec<_> =
            OccluderMesh::CUBOID.into_iter().filter(|t| !t.iter().all(|i| *i >= 4)).collect();
        triangles.extend([[4, 5, 8], [5, 7, 8], [7, 6, 8], [6, 4, 8]]);
        let dented = OccluderMesh::from_indexed(&p, &triangles).unwrap();
        assert!(
            dented.is_closed() && !dented.is_convex(),
            "a dent of 1 m in a mesh 10,000 km from the origin"
        );
    }

    /// A closed sheet of two opposite triangles has no vertex in front of a face, but it has no volume
    /// either.
    #[test]
    fn a_sheet_with_two_faces_is_no_solid() {
        let p = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let sheet = OccluderMesh::from_indexed(&p, &[[0, 1, 2], [0, 2, 1]]).unwrap();
        assert!(sheet.is_closed() && !sheet.is_convex(), "two triangles back to back enclose no volume");
    }

    /// Returns a cube from 0 to `side` whose top face is four triangles around a middle, `steps` steps of
    /// `f32` below the other corners.
    fn dented_cube(side: f32, steps: u32) -> OccluderMesh {
        let mut p = Aabb::from_arrays([0.0; 3], [side; 3]).corners().to_vec();
        p.push(Vec3::new(0.5 * side, 0.5 * side, f32::from_bits(side.to_bits() - steps)));
        let mut triangles: Vec<_> =
            OccluderMesh::CUBOID.into_iter().filter(|t| !t.iter().all(|i| *i >= 4)).collect();
        triangles.extend([[4, 5, 8], [5, 7, 8], [7, 6, 8], [6, 4, 8]]);
        OccluderMesh::from_indexed(&p, &triangles).unwrap()
    }

    /// In a cube of 1.5 m a step is 2^-23 m, and 3 steps are tolerated. Beside the slopes of a dent, the
    /// corners on the other side stand out by twice its depth.
    #[test]
    fn dents_are_tolerated_up_to_two_roundings_of_the_greatest_coordinate() {
        for (steps, is_convex) in [(0, true), (1, true), (2, false), (3, false), (100, false)] {
            assert_eq!(dented_cube(1.5, steps).is_convex(), is_convex, "a dent of {steps} steps");
        }
    }

    /// The tolerance is nothing for a mesh that is not more than four times as thick: a box of few steps.
    #[test]
    fn thin_meshes_are_convex_without_tolerance() {
        let step = f32::EPSILON;
        for (height, is_dented) in [(2, true), (2, false), (6, true), (6, false), (40, true), (40, false)] {
            let mut p =
                Aabb::from_arrays([0.0, 0.0, 1.0], [1.0, 1.0, 1.0 + height as f32 * step]).corners().to_vec();
            let top = 1.0 + (height - i32::from(is_dented)) as f32 * step;
            p.push(Vec3::new(0.5, 0.5, top));
            let mut triangles: Vec<_> =
                OccluderMesh::CUBOID.into_iter().filter(|t| !t.iter().all(|i| *i >= 4)).collect();
            triangles.extend([[4, 5, 8], [5, 7, 8], [7, 6, 8], [6, 4, 8]]);
            let mesh = OccluderMesh::from_indexed(&p, &triangles).unwrap();
            let expected = !is_dented || height > 10;
            assert_eq!(mesh.is_convex(), expected, "{height} steps thick, dented: {is_dented}");
        }
    }

    #[test]
    fn turned_boxes_are_convex_up_to_their_rounding() {
        let (mut rng, mut convex) = (visibility_testing::Random(3), 0);
        for case in 0..300 {
            let turn = glam::DQuat::from_axis_angle(rng.direction(), rng.range(0.0, 6.0));
            let (size, at) = (rng.direction().abs() + 0.05, rng.fine_vector(3.0));
            let corners = Aabb::from_arrays([-1.0; 3], [1.0; 3]).corners();
            let p = corners.map(|corner| (turn * (corner.as_dvec3() * size) + at).as_vec3());
            let mesh = OccluderMesh::from_indexed(&p, &OccluderMesh::CUBOID).unwrap();
            convex += usize::from(mesh.is_convex());
            assert!(!mesh.is_cuboid(), "case {case}: a turned box is not its own bounding box");
            let inwards = OccluderMesh::CUBOID.map(|[a, b, c]| [a, c, b]);
            let mesh = OccluderMesh::from_indexed(&p, &inwards).unwrap();
            assert!(mesh.is_closed() && !mesh.is_convex(), "case {case}: a turned room");
        }
        assert!(convex > 280, "{convex} of 300 turned boxes are convex");
    }

    /// A box keeps its corners and triangles in one order, by which cullers read them.
    #[test]
    fn boxes_are_kept_in_one_order() {
        let bounds = Aabb::from_arrays([-1.0, 0.0, 2.0], [1.0, 3.0, 4.0]);
        let corners = bounds.corners();
        // Half a turn around z: each corner takes the place of the one across.
        let turned: [Vec3; 8] = core::array::from_fn(|i| corners[i ^ 3]);
        let begun_elsewhere = OccluderMesh::CUBOID.map(|[a, b, c]| [b, c, a]);
        for (p, triangles) in
            [(turned, OccluderMesh::CUBOID), (corners, begun_elsewhere), (turned, begun_elsewhere)]
        {
            let mesh = OccluderMesh::from_indexed(&p, &triangles).unwrap();
            assert!(mesh.is_cuboid(), "{p:?} are the corners of a box");
            assert_eq!(mesh.positions(), corners, "corners in their order");
            assert_eq!(mesh.triangles(), OccluderMesh::CUBOID, "triangles in their order");
        }
    }

    /// A fan of triangles around two poles: convex, of `2 * sides` triangles.
    #[test]
    fn solids_of_up_to_256_triangles_are_tested() {
        for (sides, is_convex) in [(127u32, true), (128, true), (129, false)] {
            let angle = |i: u32| f64::from(i) / f64::from(sides) * core::f64::consts::TAU;
            let mut p: Vec<Vec3> =
                (0..sides).map(|i| Vec3::new(angle(i).cos() as f32, angle(i).sin() as f32, 0.0)).collect();
            p.extend([Vec3::Z, Vec3::NEG_Z]);
            let side = |i: u32| [[i, (i + 1) % sides, sides], [(i + 1) % sides, i, sides + 1]];
            let triangles: Vec<_> = (0..sides).flat_map(side).collect();
            let mesh = OccluderMesh::from_indexed(&p, &triangles).unwrap();
            assert!(mesh.is_closed(), "{sides} sides are closed");
            assert_eq!(mesh.is_convex(), is_convex, "{} triangles", 2 * sides);
        }
    }

    #[test]
    fn areas_are_those_of_the_faces_that_are_seen() {
        let p = [Vec3::ZERO, Vec3::X, Vec3::Y * 2.0];
        let one = OccluderMesh::from_indexed(&p, &[[0, 1, 2]]).unwrap();
        assert_eq!([Vec3::Z, Vec3::NEG_Z].map(|d| one.area_towards(d)), [1.0, 0.0], "front and back");
        let two = one.with_two_sided(true);
        assert_eq!([Vec3::Z, Vec3::NEG_Z].map(|d| two.area_towards(d)), [1.0, 1.0], "both sides");
        assert_eq!(two.area_towards(Vec3::X), 0.0, "seen edge on");
    }
}
