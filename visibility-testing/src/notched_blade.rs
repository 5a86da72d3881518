//! A solid that is convex but for a notch.

use visibility_core::OccluderMesh;
use visibility_core::glam::Vec3;

/// Makes a closed blade with its edge at a height of 10 m above the line of points `(x, y, 0)`, `y` from 0 to
/// `length`. Halfway, the edge is lowered by `notch`. At the bottom, the blade reaches `half` to both sides.
/// All lengths are in metres.
pub fn notched_blade(x: f32, half: f32, length: f32, notch: f32) -> OccluderMesh {
    let corners = [
        Vec3::new(x - half, 0.0, 0.0),
        Vec3::new(x + half, 0.0, 0.0),
        Vec3::new(x + half, length, 0.0),
        Vec3::new(x - half, length, 0.0),
        Vec3::new(x, 0.0, 10.0),
        Vec3::new(x, length, 10.0),
        Vec3::new(x, length / 2.0, 10.0 - notch),
    ];
    let triangles = [
        [0, 3, 2],
        [0, 2, 1],
        [0, 1, 4],
        [2, 3, 5],
        [1, 2, 6],
        [1, 6, 4],
        [2, 5, 6],
        [3, 0, 6],
        [0, 4, 6],
        [3, 6, 5],
    ];
    OccluderMesh::from_indexed(&corners, &triangles).expect("triangles with an area")
}
