//! Triangles and edges of an occluder in the form that set-up and raster take: those of a mesh, or of a box.

use visibility_core::glam::Vec3;
use visibility_core::{OccluderMesh, occlusion::Edge};

/// Vertices, triangles and edges of an occluder, in its own coordinates.
#[derive(Clone, Copy)]
pub(crate) struct OccluderTriangles<'a> {
    /// Positions of the vertices, in the occluder's own coordinates.
    pub(crate) positions: &'a [Vec3],
    /// Indices into `positions` of the three vertices of each triangle, counter-clockwise from the front.
    pub(crate) triangles: &'a [[u32; 3]],
    /// Edges, each with its two vertices as indices into `positions` and the triangles on its two sides as
    /// indices into `triangles`.
    pub(crate) edges: &'a [Edge],
    /// True if the backs of the triangles hide objects too, false if only the fronts do.
    pub(crate) two_sided: bool,
}

impl<'a> OccluderTriangles<'a> {
    /// Borrows the vertices, triangles and edges of a mesh.
    pub(crate) fn of(mesh: &'a OccluderMesh) -> Self {
        Self {
            positions: mesh.positions(),
            triangles: mesh.triangles(),
            edges: mesh.edges(),
            two_sided: mesh.is_two_sided(),
        }
    }

    /// Returns the triangles and edges of a box with the given corners. Bits 0, 1 and 2 of a corner's index
    /// select the greatest x, y and z. `two_sided` tells whether the inner sides of its faces hide too.
    pub(crate) fn of_box(corners: &'a [Vec3; 8], two_sided: bool) -> Self {
        Self { positions: corners, triangles: &BOX_TRIANGLES, edges: &BOX_EDGES, two_sided }
    }
}

/// Corner indices of two triangles for each face of a box, counter-clockwise from outside.
const BOX_TRIANGLES: [[u32; 3]; 12] = OccluderMesh::CUBOID;

/// Edges of the triangles of a box: its twelve edges and a diagonal of each face.
static BOX_EDGES: [Edge; 18] = box_edges();

/// Builds [`BOX_EDGES`].
const fn box_edges() -> [Edge; 18] {
    let mut edges = [Edge { vertices: [0, 0], left: 0, right: None }; 18];
    let (mut count, mut pair) = (0, 0);
    // All pairs of directed sides: side `3 * t + i` runs from corner `i` of triangle `t` to the next.
    while pair < 36 * 36 {
        let (first, second) = (pair / 36, pair % 36);
        let ([a, b], [c, d]) = (side(first), side(second));
        // Each edge is stored once, by the first of its two triangles.
        if first < second && a == d && b == c {
            let right = Some(second as u32 / 3);
            edges[count] = Edge { vertices: [a, b], left: first as u32 / 3, right };
            count += 1;
        }
        pair += 1;
    }
    edges
}

/// Returns the corner indices of the start and end of side `index % 3` of triangle `index / 3` of a box.
const fn side(index: usize) -> [u32; 2] {
    let triangle = BOX_TRIANGLES[index / 3];
    [triangle[index % 3], triangle[(index + 1) % 3]]
}
