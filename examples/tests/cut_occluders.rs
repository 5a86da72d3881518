//! Tests of occlusion maps used without the driver: an occluder that a clip plane may cut hides nothing.

use visibility_bsp::OcclusionTree;
use visibility_core::geometry::Plane;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::{Aabb, OccluderMesh, OcclusionMap, Pose, View, occlusion::Occlusion};
use visibility_hzb::{Hom, Hzb};
use visibility_testing::PlainMap;

fn maps() -> Vec<Box<dyn OcclusionMap>> {
    vec![
        Box::new(Hzb::new(160, 160).unwrap()),
        Box::new(Hom::new(160, 160).unwrap()),
        Box::new(OcclusionTree::new()),
        Box::new(PlainMap::new(64, 64)),
    ]
}

#[test]
fn an_occluder_hides_only_where_every_clip_plane_leaves_it_whole() {
    let wall = OccluderMesh::cuboid(&Aabb::from_arrays([10.0, -5.0, -5.0], [11.0, 5.0, 5.0])).unwrap();
    let behind = Aabb::from_arrays([20.0, -0.5, -0.5], [21.0, 0.5, 0.5]);
    let view =
        View::perspective(Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z), 1.0, 1.0, 0.1, 100.0).unwrap();
    for mut map in maps() {
        for (start, expected) in [(9.0, true), (10.0, false), (10.5, false), (12.0, false)] {
            let plane = Plane::through(DVec3::new(start, 0.0, 0.0), DVec3::X);
            map.begin(&view.with_clip_planes(&[plane]).unwrap(), DVec3::ZERO);
            map.add(&wall, &Affine3A::IDENTITY);
            map.flush();
            let hidden = map.test(&behind) == Occlusion::Hidden;
            assert_eq!(hidden, expected, "{}, plane at {start} m", map.name());
        }
    }
}
