//! Occluder meshes from what engines have: indexed meshes, loose triangles, boxes, polygons.

use super::mesh::{MeshError, OccluderMesh};
use super::parts::split;
use crate::{Aabb, geometry::ConvexPolygon, scene::Triangle};
use alloc::vec::Vec;
use glam::{DVec3, Vec3};

impl OccluderMesh {
    /// From an indexed mesh. Vertices at the same place (bit for bit, zeros of either sign) become one;
    /// triangles without area, or with a vertex twice, are left out. A box along the axes gets its
    /// vertices and triangles in the order of [`cuboid`](Self::cuboid).
    ///
    /// # Errors
    /// All of [`MeshError`].
    pub fn from_indexed(positions: &[Vec3], indices: &[[u32; 3]]) -> Result<Self, MeshError> {
        if positions.len() >= u32::MAX as usize || indices.len() >= (u32::MAX / 3) as usize {
            return Err(MeshError::TooMany);
        }
        if let Some(vertex) = positions.iter().position(|p| !p.is_finite()) {
            return Err(MeshError::NonFinite { vertex });
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
        let mut mesh = Self::whole(&positions, triangles).ok_or(MeshError::Empty)?;
        if !mesh.convex {
            mesh.parts = split(&mesh.positions, &mesh.triangles);
            mesh.solid_triangles = mesh.parts.iter().map(Self::solid_triangles).sum();
        }
        Ok(mesh)
    }

    /// From loose triangles.
    ///
    /// # Errors
    /// All of [`MeshError`] but `Index`.
    pub fn from_triangles(triangles: &[Triangle]) -> Result<Self, MeshError> {
        let indices: Vec<[u32; 3]> =
            (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Self::from_indexed(triangles.as_flattened(), &indices)
    }

    /// A box, closed and convex.
    ///
    /// # Errors
    /// [`MeshError::NonFinite`], and [`MeshError::Empty`] for a box that is flat in more than one direction
    /// or inverted.
    pub fn cuboid(bounds: &Aabb) -> Result<Self, MeshError> {
        if !bounds.is_proper() {
            return Err(MeshError::Empty);
        }
        Self::from_indexed(&bounds.corners(), &Self::CUBOID)
    }

    /// A convex polygon, seen from the side on which its vertices run counter-clockwise.
    ///
    /// # Errors
    /// [`MeshError::NonFinite`], also where `f32` cannot hold a vertex, and [`MeshError::Empty`].
    pub fn polygon(polygon: &ConvexPolygon) -> Result<Self, MeshError> {
        let positions: Vec<Vec3> = polygon.vertices().iter().map(|v| v.as_vec3()).collect();
        let fan: Vec<[u32; 3]> = (2..positions.len() as u32).map(|i| [0, i - 1, i]).collect();
        Self::from_indexed(&positions, &fan)
    }
}

/// Each place once, and for each vertex its place.
fn weld(positions: &[Vec3]) -> (Vec<Vec3>, Vec<u32>) {
    // Adding zero turns -0 into 0, so that equal numbers have equal bits.
    let key = |i: &u32| (positions[*i as usize] + 0.0).to_array().map(f32::to_bits);
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.sort_unstable_by_key(|i| (key(i), *i));
    // The first of each group stands for it, and groups keep the order in which they are first used.
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
    // Differences of f32 numbers are exact in f64 unless one is 2^29 times the other.
    (b - a).cross(c - a) != DVec3::ZERO
}
