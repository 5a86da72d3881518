//! Decomposition of meshes into separate convex solids, such as furniture and buildings made of boxes.
//!
//! A convex solid is drawn by its silhouette alone, and separate solids occlude independently of one another.
//! Solids are found once, when a mesh is made. First, boxes are found whose 12 triangles are listed
//! consecutively, as most tools write them: touching boxes share edges, so they cannot be separated by their
//! edges. Then the remaining triangles are grouped into pieces joined along edges, and each piece that is a
//! convex solid is taken.

use super::mesh::{OccluderMesh, join};
use crate::union_find::root;
use alloc::vec::Vec;
use glam::Vec3;

/// Number of triangles of a box.
const BOX: usize = 12;

/// Splits a mesh into its convex solids and, last, a mesh of the remaining triangles, if any remain. Empty if
/// there are no convex solids, or if the whole mesh is one.
pub(super) fn split(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<OccluderMesh> {
    let mut parts = Vec::new();
    let mut rest = Vec::new();
    let mut left = triangles;
    while let Some(first) = left.first() {
        let solid =
            left.get(..BOX).filter(|run| has_eight_corners(run)).and_then(|run| solid(positions, run));
        match solid {
            Some(solid) => {
                parts.push(solid);
                left = &left[BOX..];
            }
            None => {
                rest.push(*first);
                left = &left[1..];
            }
        }
    }
    let mut remains = Vec::new();
    for piece in pieces(&rest) {
        match solid(positions, &piece) {
            Some(solid) => parts.push(solid),
            None => remains.extend(piece),
        }
    }
    if parts.is_empty() || (parts.len() == 1 && remains.is_empty()) {
        return Vec::new();
    }
    parts.extend(OccluderMesh::whole(positions, remains));
    parts
}

/// Returns the mesh of `triangles` if it is a closed convex solid of 4 to 256 triangles, otherwise `None`.
/// `triangles` index `positions`.
fn solid(positions: &[Vec3], triangles: &[[u32; 3]]) -> Option<OccluderMesh> {
    // A solid has at least four triangles; the convexity test accepts at most 256.
    (4..=256)
        .contains(&triangles.len())
        .then(|| OccluderMesh::whole(positions, triangles.to_vec()))
        .flatten()
        .filter(OccluderMesh::is_convex)
}

fn has_eight_corners(triangles: &[[u32; 3]]) -> bool {
    let (mut seen, mut count) = ([0; 8], 0);
    for &corner in triangles.as_flattened() {
        if !seen[..count].contains(&corner) {
            if count == seen.len() {
                return false;
            }
            seen[count] = corner;
            count += 1;
        }
    }
    count == seen.len()
}

/// Groups triangles that are connected through edges with two triangles ([`Edge::right`](super::Edge::right)
/// is not `None`). Groups are in the order of their first triangles, and the triangles of a group in their
/// given order.
fn pieces(triangles: &[[u32; 3]]) -> Vec<Vec<[u32; 3]>> {
    let (edges, _) = join(triangles);
    let mut parent: Vec<u32> = (0..triangles.len() as u32).collect();
    for edge in &edges {
        if let Some(right) = edge.right {
            let (a, b) = (root(&mut parent, edge.left), root(&mut parent, right));
            // The first triangle of a group is its representative.
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut place = alloc::vec![u32::MAX; triangles.len()];
    let mut pieces: Vec<Vec<[u32; 3]>> = Vec::new();
    for (i, t) in (0..).zip(triangles) {
        let own = &mut place[root(&mut parent, i) as usize];
        if *own == u32::MAX {
            *own = pieces.len() as u32;
            pieces.push(Vec::new());
        }
        pieces[*own as usize].push(*t);
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Aabb, scene::Triangle};

    fn cuboid(min: [f32; 3], max: [f32; 3]) -> Vec<Triangle> {
        let mesh = OccluderMesh::cuboid(&Aabb::from_arrays(min, max)).unwrap();
        mesh.triangles().iter().map(|t| t.map(|i| mesh.positions()[i as usize])).collect()
    }

    #[test]
    fn boxes_that_touch_are_told_apart() {
        let mut triangles = cuboid([0.0; 3], [1.0; 3]);
        triangles.extend(cuboid([1.0, 0.0, 0.0], [2.0, 1.0, 3.0]));
        triangles.push([Vec3::splat(5.0), Vec3::new(6.0, 5.0, 5.0), Vec3::new(5.0, 6.0, 5.0)]);
        let mesh = OccluderMesh::from_triangles(&triangles).unwrap().with_two_sided(true);
        let parts = mesh.parts();
        assert_eq!(parts.len(), 3, "two boxes and a triangle");
        assert!(
            parts[0].is_cuboid() && parts[1].is_cuboid() && !parts[2].is_closed(),
            "the boxes are cuboids, the triangle is open"
        );
        assert!(parts.iter().all(OccluderMesh::is_two_sided), "parts of a two-sided mesh are two-sided");
        assert_eq!(
            parts.iter().map(|part| part.triangles().len()).sum::<usize>(),
            25,
            "triangles of all parts: 12 and 12 and 1"
        );
        assert_eq!(
            parts[1].bounds(),
            &Aabb::from_arrays([1.0, 0.0, 0.0], [2.0, 1.0, 3.0]),
            "the second part is the second box"
        );
    }

    #[test]
    fn solids_that_are_no_boxes_are_found_in_any_order_of_triangles() {
        let p = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|p| p * 2.0);
        let solid = [[p[0], p[2], p[1]], [p[0], p[1], p[3]], [p[1], p[2], p[3]], [p[2], p[0], p[3]]];
        let far = solid.map(|t| t.map(|p| p + 9.0));
        let mixed: Vec<_> = solid.into_iter().zip(far).flat_map(|(a, b)| [a, b]).collect();
        let mesh = OccluderMesh::from_triangles(&mixed).unwrap();
        assert_eq!(mesh.parts().len(), 2, "two solids whose triangles alternate");
        assert!(mesh.parts().iter().all(OccluderMesh::is_convex), "each of the solids is convex");
    }

    #[test]
    fn what_is_of_one_piece_has_no_parts() {
        let mut one = cuboid([0.0; 3], [1.0; 3]);
        assert!(OccluderMesh::from_triangles(&one).unwrap().parts().is_empty(), "a single box");
        one.pop();
        assert!(OccluderMesh::from_triangles(&one).unwrap().parts().is_empty(), "a single box with a hole");
    }

    #[test]
    fn one_box_beside_loose_triangles_is_a_part() {
        let mut triangles = cuboid([0.0; 3], [1.0; 3]);
        triangles.push([Vec3::splat(5.0), Vec3::new(6.0, 5.0, 5.0), Vec3::new(5.0, 6.0, 5.0)]);
        let mesh = OccluderMesh::from_triangles(&triangles).unwrap();
        let counts: Vec<_> = mesh.parts().iter().map(|part| part.triangles().len()).collect();
        assert_eq!(counts, [12, 1], "a box and a triangle");
        assert_eq!(mesh.solid_triangles(), 12, "triangles of the box");
        let flat = OccluderMesh::from_triangles(&triangles[10..]).unwrap();
        assert!(flat.parts().is_empty() && flat.solid_triangles() == 0, "no solid");
    }
}
