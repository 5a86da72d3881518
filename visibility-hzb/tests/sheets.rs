//! Meshes whose near side occludes although their far side, which also faces the eye, lies behind the hidden
//! objects.

use crate::common::{Occluder, draw};
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::scene::Triangle;
use visibility_core::{Aabb, OccluderMesh, OcclusionMap, Pose, View, occlusion::Occlusion};
use visibility_hzb::Hzb;

/// Returns a garage of thick walls as one closed mesh. It is open towards +x, and extends from -5 to 5 along
/// all axes.
fn garage() -> OccluderMesh {
    let [outer, inner] = [
        Aabb::from_arrays([-5.0; 3], [5.0; 3]).corners(),
        Aabb::from_arrays([-4.7; 3], [5.0, 4.7, 4.7]).corners(),
    ];
    // The last two triangles of a box are its +x side, which is left open.
    let walls = &OccluderMesh::CUBOID[..10];
    let mut triangles: Vec<Triangle> = walls.iter().map(|t| t.map(|i| outer[i as usize])).collect();
    triangles.extend(walls.iter().map(|&[a, b, c]| [a, c, b].map(|i| inner[i as usize])));
    // The rim around the opening, counter-clockwise as seen from outside.
    for [i, j] in [[1, 3], [3, 7], [7, 5], [5, 1]] {
        triangles.push([outer[i], outer[j], inner[j]]);
        triangles.push([outer[i], inner[j], inner[i]]);
    }
    OccluderMesh::from_triangles(&triangles).unwrap()
}

#[test]
fn a_house_of_one_mesh_hides_what_is_in_it() {
    let mesh = garage();
    assert!(
        mesh.is_closed() && mesh.parts().is_empty() && mesh.triangles().len() == 28,
        "the garage is one closed mesh of 28 triangles"
    );
    let occluders = [Occluder { mesh, transform: Affine3A::IDENTITY }];
    for (from, is_hidden) in [
        (DVec3::new(-20.0, 3.0, 1.0), true),
        (DVec3::new(-3.0, 20.0, 2.0), true),
        (DVec3::new(2.0, -18.0, 9.0), true),
        (DVec3::new(20.0, 1.0, 2.0), false),
    ] {
        let view =
            View::perspective(Pose::look_at(from, DVec3::ZERO, DVec3::Z), 1.0, 1.6, 0.1, 100.0).unwrap();
        let hzb = draw(Hzb::new(320, 200).unwrap(), &occluders, &view);
        for i in 0..27 {
            let least = Vec3::from_array([i % 3, i / 3 % 3, i / 9].map(|i| 2.5 * i as f32 - 2.7));
            let answer = hzb.test(&Aabb::new(least, least + 0.4));
            assert_eq!(answer == Occlusion::Hidden, is_hidden, "a thing at {least} seen from {from}");
        }
    }
}
