//! Welded faces: the triangles of a level, whose corners at equal positions are one vertex.

use alloc::vec::Vec;
use visibility_core::geometry::Plane;
use visibility_core::glam::{DVec3, Vec3};

/// A triangle of a level that hides what lies behind it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LevelTriangle {
    /// Corners in metres relative to `Scene::origin`, counter-clockwise seen from the front.
    pub corners: [Vec3; 3],
    /// True if the triangle is drawn, and so occludes, from both sides; false if it is drawn from its front
    /// only.
    pub two_sided: bool,
}

/// A flat face: a triangle, with additional corners where neighbours' corners lie on its sides.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Face {
    /// Range of the face's corners in [`Faces::corners`], half-open.
    pub(crate) corners: [u32; 2],
    /// Vertices of the triangle, in boundary order: of the face's corners, those that are not in the middle
    /// of a straight side.
    pub(crate) triangle: [u32; 3],
    /// Unit normal of the front, the side from which the corners run counter-clockwise.
    pub(crate) normal: DVec3,
    /// Area in square metres.
    pub(crate) area: f64,
    /// True if the face occludes from both of its sides, false if only from its front.
    pub(crate) two_sided: bool,
}

/// Faces that refer to shared vertices.
#[derive(Clone, Debug, Default)]
pub(crate) struct Faces {
    /// Positions of the vertices in metres. No two are equal.
    pub(crate) vertices: Vec<Vec3>,
    /// All faces, in the order of their triangles.
    pub(crate) faces: Vec<Face>,
    /// Vertices of the corners of all faces, in boundary order.
    pub(crate) corners: Vec<u32>,
}

/// A side of a face: an edge in one of its two directions.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) struct Side {
    /// Vertices of the edge, the lesser index first.
    pub(crate) edge: [u32; 2],
    /// Index of the face.
    pub(crate) face: u32,
    /// Index in [`Faces::corners`] of the corner that the side starts at.
    pub(crate) corner: u32,
    /// True if the side runs from the lesser vertex to the greater.
    pub(crate) forward: bool,
}

/// Returns the sides at open edges (edges of only one face). `sides` are all sides, sorted by edge.
pub(crate) fn open_sides(sides: &[Side]) -> impl Iterator<Item = Side> {
    sides.chunk_by(|a, b| a.edge == b.edge).filter(|same| same.len() == 1).map(|same| same[0])
}

impl Faces {
    /// Welds triangles. Triangles that have no area or are not finite are left out. Of triangles with the
    /// same three vertices only one is kept: a two-sided triangle if any of them is two-sided, or if they
    /// have both orientations.
    pub(crate) fn weld(triangles: &[LevelTriangle]) -> Self {
        let is_finite = |t: &&LevelTriangle| t.corners.iter().all(|p| p.is_finite());
        let triangles: Vec<&LevelTriangle> = triangles.iter().filter(is_finite).collect();
        // Adding 0 turns -0 into 0, so that equal positions have equal bits.
        let position = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
        let mut places: Vec<([u32; 3], u32)> = (0..)
            .zip(triangles.iter().flat_map(|t| &t.corners))
            .map(|(corner, p)| (position(*p), corner))
            .collect();
        places.sort_unstable();
        let mut welded = Self { corners: alloc::vec![0; places.len()], ..Self::default() };
        for same in places.chunk_by(|a, b| a.0 == b.0) {
            for &(_, corner) in same {
                welded.corners[corner as usize] = welded.vertices.len() as u32;
            }
            welded.vertices.push(Vec3::from_array(same[0].0.map(f32::from_bits)));
        }
        // After sorting, triangles with the same vertices are adjacent; the first of them stays.
        let mut order: Vec<([u32; 3], bool, u32)> = Vec::with_capacity(triangles.len());
        for (number, t) in (0..).zip(welded.corners.as_chunks::<3>().0) {
            let mut sorted = *t;
            sorted.sort_unstable();
            let [a, b, c] = *t;
            // An even permutation of the sorted vertices has the same orientation.
            let even = [[a, b, c], [b, c, a], [c, a, b]].contains(&sorted);
            order.push((sorted, even, number));
        }
        order.sort_unstable();
        let mut kept: Vec<(u32, bool)> = Vec::with_capacity(order.len());
        for same in order.chunk_by(|a, b| a.0 == b.0) {
            let both_ways = same[0].1 != same[same.len() - 1].1;
            let two_sided =
                both_ways || same.iter().any(|&(_, _, number)| triangles[number as usize].two_sided);
            kept.extend(same.iter().map(|&(_, _, number)| number).min().map(|number| (number, two_sided)));
        }
        kept.sort_unstable();
        let all = core::mem::take(&mut welded.corners);
        for (number, two_sided) in kept {
            let triangle = [0, 1, 2].map(|k| all[3 * number as usize + k]);
            let points = triangles[number as usize].corners.map(Vec3::as_dvec3);
            let Some(plane) = Plane::from_polygon(&points) else { continue };
            let [a, b, c] = points;
            let first = welded.corners.len() as u32;
            welded.corners.extend_from_slice(&triangle);
            welded.faces.push(Face {
                corners: [first, first + 3],
                triangle,
                normal: plane.normal,
                area: (b - a).cross(c - a).length() * 0.5,
                two_sided,
            });
        }
        welded
    }

    /// Returns the vertices of a face, in boundary order.
    pub(crate) fn corners_of(&self, face: &Face) -> &[u32] {
        &self.corners[face.corners[0] as usize..face.corners[1] as usize]
    }

    /// Returns the position of a vertex in `f64`.
    pub(crate) fn at(&self, vertex: u32) -> DVec3 {
        self.vertices[vertex as usize].as_dvec3()
    }

    /// Returns the sides of all faces, sorted by edge. Sides of one edge lie next to each other.
    pub(crate) fn sides(&self) -> Vec<Side> {
        let mut sides = Vec::with_capacity(self.corners.len());
        for (number, face) in (0..).zip(&self.faces) {
            let [first, end] = face.corners;
            for corner in first..end {
                let next = if corner + 1 < end { corner + 1 } else { first };
                let [a, b] = [corner, next].map(|corner| self.corners[corner as usize]);
                sides.push(Side { edge: [a.min(b), a.max(b)], face: number, corner, forward: a < b });
            }
        }
        sides.sort_unstable();
        sides
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first of several triangles with the same vertices stays. It has two sides if one of the triangles
    /// has, or if the triangles face both ways.
    #[test]
    fn of_copies_the_first_stays() {
        let [a, b, c] = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let other = LevelTriangle { corners: [a, c, Vec3::Z], two_sided: false };
        for (copy, of_copy, two_sided) in [
            ([a, b, c], false, false),
            ([a, b, c], true, true),
            ([b, c, a], true, true),
            ([c, a, b], false, false),
            ([b, a, c], false, true),
            ([c, b, a], true, true),
        ] {
            let first = LevelTriangle { corners: [b, c, a], two_sided: false };
            let copy = LevelTriangle { corners: copy, two_sided: of_copy };
            let faces = Faces::weld(&[first, other, copy]);
            let corners = |face: &Face| [0, 1, 2].map(|k| faces.vertices[face.triangle[k] as usize]);
            let found: Vec<_> = faces.faces.iter().map(|face| (corners(face), face.two_sided)).collect();
            assert_eq!(found, [([b, c, a], two_sided), (other.corners, false)], "with {copy:?}");
        }
    }
}
