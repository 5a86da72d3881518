//! Tests that a horizon does not fill notches of meshes that count as convex.

use crate::common::scene_of;
use std::sync::Arc;
use visibility_2d::horizon::{Horizon, HorizonCuller, HorizonOccluders, UpAxis};
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{Aabb, Culler, OccluderMesh, OcclusionCuller, Pose, View, VisibleSet};
use visibility_testing::notched_blade;

/// Returns whether a box is hidden behind a mesh, as seen from `eye` towards `ahead`: by the culler with
/// prepared occluders, and by the map.
fn hidden(mesh: &OccluderMesh, transform: Affine3A, eye: DVec3, ahead: DVec3, bounds: Aabb) -> [bool; 2] {
    let (scene, target) = scene_of(mesh, transform, bounds);
    let pose = Pose::look_at(eye, eye + ahead, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).unwrap();
    let mut prepared = HorizonCuller::new(Arc::new(HorizonOccluders::new(&scene, UpAxis::Z)));
    let mut map = OcclusionCuller::new(Horizon::new(UpAxis::Z));
    [&mut prepared as &mut dyn Culler, &mut map].map(|culler| {
        let mut visible = VisibleSet::new();
        visible.fill(&scene, &view);
        culler.cull(&scene, &view, &mut visible);
        !visible.contains(&scene, target)
    })
}

/// A blade 2 cm wide and 10 m high, 2 km from the origin, has a notch of 20 cm in its edge. No vertex is in
/// front of a face by more than two steps of `f32`.
#[test]
fn a_box_seen_through_the_notch_of_a_blade_is_visible() {
    let mesh = notched_blade(2000.0, 0.01, 10.0, 0.2);
    assert!(mesh.is_convex(), "the blade counts as convex");
    let eye = DVec3::new(1980.0, 5.0, 9.9);
    let boxed = |low: f32| Aabb::from_arrays([2010.0, 4.9, low], [2010.1, 5.1, low + 0.03]);
    let identity = Affine3A::IDENTITY;
    assert_eq!(hidden(&mesh, identity, eye, DVec3::X, boxed(9.85)), [false; 2], "seen through the notch");
    assert_eq!(hidden(&mesh, identity, eye, DVec3::X, boxed(9.0)), [true; 2], "below the notch");
}

/// An eye before the end of a blade, or in it, whose near plane is inside: the way to the box begins in the
/// blade and leaves it through the back of a face. The posts, moved inside by more than the notch is deep,
/// are beyond the near plane.
#[test]
fn a_box_seen_from_inside_a_blade_is_visible() {
    let boxed = Aabb::from_arrays([1999.8, 50.0, 1.2], [2000.2, 50.4, 1.8]);
    for (notch, y, expected) in
        [(0.2, 0.2, false), (0.2, -0.05, false), (0.0, -0.05, false), (0.0, -0.15, true)]
    {
        let mesh = notched_blade(2000.0, 0.01, 10.0, notch);
        let eye = DVec3::new(2000.0, y, 1.5);
        let found = hidden(&mesh, Affine3A::IDENTITY, eye, DVec3::Y, boxed);
        assert_eq!(found, [expected; 2], "a notch of {notch}, seen from {y}");
    }
}

/// A box 1 km long and 10 cm high, whose top is lowered halfway by a step of `f32` of its length, is squeezed
/// to a length of 20 m and stretched to a height of 10 m.
#[test]
fn a_box_seen_through_the_notch_of_a_squeezed_mesh_is_visible() {
    let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let side = |y: f32| {
        [at(0.0, y, 0.0), at(1000.0, y, 0.0), at(1000.0, y, 0.1), at(500.0, y, 0.1 - 1.1e-4), at(0.0, y, 0.1)]
    };
    let (near, far) = (side(0.0), side(1.0));
    let mut triangles = Vec::new();
    for i in 0..5 {
        let k = (i + 1) % 5;
        triangles.extend([[near[i], far[i], far[k]], [near[i], far[k], near[k]]]);
    }
    triangles.extend([[near[3], near[0], near[1]], [near[3], near[1], near[2]], [near[3], near[4], near[0]]]);
    triangles.extend([[far[3], far[1], far[0]], [far[3], far[2], far[1]], [far[3], far[0], far[4]]]);
    let mesh = OccluderMesh::from_triangles(&triangles).unwrap();
    assert!(mesh.is_convex(), "the box counts as convex");
    let squeezed = Affine3A::from_scale(Vec3::new(0.02, 10.0, 100.0));
    let eye = DVec3::new(10.0, -20.0, 9.995);
    let boxed = |low: f32| Aabb::from_arrays([9.99, 40.0, low], [10.01, 40.1, low + 0.001]);
    assert_eq!(hidden(&mesh, squeezed, eye, DVec3::Y, boxed(9.9925)), [false; 2], "seen through the notch");
    assert_eq!(hidden(&mesh, squeezed, eye, DVec3::Y, boxed(9.9)), [true; 2], "below the notch");
}
