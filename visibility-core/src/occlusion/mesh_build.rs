//! Constructors of occluder meshes from indexed meshes, loose triangles, boxes and polygons.

use super::mesh::{MeshError, OccluderMesh};
use super::parts::split;
use crate::{Aabb, geometry::ConvexPolygon, scene::Triangle};
use alloc::vec::Vec;
use glam::{DVec3, Vec3};

impl OccluderMesh {
    /// Makes an occluder from an indexed mesh, in mesh coordinates. Vertices at bit-identical positions
    /// (zeros of either sign are equal) are welded. Triangles without area, or with a repeated vertex, are
    /// dropped. The vertices and triangles of an axis-aligned box are reordered to the order of
    /// [`cuboid`](Self::cuboid). Time is O(n log n) in the size of the mesh, plus a quadratic convexity test
    /// for solids of up to 256 triangles.
    ///
    /// # Errors
    /// [`MeshError::TooMany`], [`MeshError::Vertex`], [`MeshError::Index`], or [`MeshError::NoTriangle`] if
    /// no triangle remains.
    pub fn from_indexed(positions: &[Vec3], indices: &[[u32; 3]]) -> Result<Self, MeshError> {
        if positions.len() >= u32::MAX as usize || indices.len() >= (u32::MAX / 3) as usize {
            return Err(MeshError::TooMany);
        }
        if let Some(vertex) = positions.iter().position(|p| !p.is_finite()) {
            return Err(MeshError::Vertex { vertex });
        }
        for (triangle, corners) in indices.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&i| i as usize >= positions.len()) {
                return Err(MeshError::Index { triangle, index });
            }
        }
        let (positions, place) = weld(positions);
        let triangles: Vec<[u32; 3]> = indices
            .iter()
            .map(|t| t.map(|i| place[i as usize]))
            .filter(|t| has_area(&positions, t))
            .collect();
        let mut mesh = Self::whole(&positions, triangles).ok_or(MeshError::NoTriangle)?;
        if !mesh.convex {
            mesh.parts = split(&mesh.positions, &mesh.triangles);
            mesh.solid_triangles = mesh.parts.iter().map(Self::solid_triangles).sum();
        }
        Ok(mesh)
    }

    /// Makes an occluder from loose triangles, like [`from_indexed`](Self::from_indexed).
    ///
    /// # Errors
    /// [`MeshError::TooMany`], [`MeshError::Vertex`] (vertex `3 * triangle + corner`), or
    /// [`MeshError::NoTriangle`] if no triangle has an area.
    pub fn from_triangles(triangles: &[Triangle]) -> Result<Self, MeshError> {
        // Indices may wrap around here. `from_indexed` refuses that many vertices before using an index.
        let indices: Vec<[u32; 3]> = (0..triangles.len() as u32)
            .map(|i| 3u32.wrapping_mul(i))
            .map(|first| [first, first.wrapping_add(1), first.wrapping_add(2)])
            .collect();
        Self::from_indexed(triangles.as_flattened(), &indices)
    }

    /// Makes an occluder from an axis-aligned box. A box with extent on all axes gives a closed convex mesh.
    ///
    /// # Errors
    /// [`MeshError::Vertex`] for infinite coordinates, and [`MeshError::NoTriangle`] for an improper box or a
    /// box that is flat on more than one axis.
    pub fn cuboid(bounds: &Aabb) -> Result<Self, MeshError> {
        if !bounds.is_proper() {
            return Err(MeshError::NoTriangle);
        }
        Self::from_indexed(&bounds.corners(), &Self::CUBOID)
    }

    /// Makes an occluder from a convex polygon, rounded to `f32`. Its front is the side from which its
    /// vertices run counter-clockwise. The mesh is open and one-sided.
    ///
    /// # Errors
    /// [`MeshError::Vertex`] if `f32` cannot hold a vertex, and [`MeshError::NoTriangle`] for a polygon that
    /// is empty or has no area.
    pub fn polygon(polygon: &ConvexPolygon) -> Result<Self, MeshError> {
        let positions: Vec<Vec3> = polygon.vertices().iter().map(|v| v.as_vec3()).collect();
        let fan: Vec<[u32; 3]> = (2..positions.len() as u32).map(|i| [0, i - 1, i]).collect();
        Self::from_indexed(&positions, &fan)
    }
}

/// Welds vertices at equal positions (bit-identical, or zeros of either sign). Returns the distinct positions
/// in order of first use, and for each given vertex the index of its position.
fn weld(positions: &[Vec3]) -> (Vec<Vec3>, Vec<u32>) {
    // Adding zero turns -0 into 0, so that equal numbers have equal bits.
    let key = |i: &u32| (positions[*i as usize] + 0.0).to_array().map(f32::to_bits);
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.sort_unstable_by_key(|i| (key(i), *i));
    // The first vertex of each group represents the group.
    let mut first: Vec<u32> = (0..positions.len() as u32).collect();
    for group in order.chunk_by(|a, b| key(a) == key(b)) {
        group.iter().for_each(|&i| first[i as usize] = group[0]);
    }
    let mut welded = Vec::new();
    let mut place = alloc::vec![0; positions.len()];
    for i in 0..positions.len() {
        if first[i] == i as u32 {
            place[i] = welded.len() as u32;
            welded.push(positions[i]);
        } else {
            place[i] = place[first[i] as usize];
        }
    }
    (welded, place)
}

fn has_area(positions: &[Vec3], triangle: &[u32; 3]) -> bool {
    let [a, b, c] = triangle.map(|i| positions[i as usize].as_dvec3());
    // Differences of `f32` numbers are exact in `f64` unless one number is 2^29 times the other.
    (b - a).cross(c - a) != DVec3::ZERO
}
