//! Program that culls two small scenes on bare Linux, without the standard library or libc, and exits with 0
//! if the answers are right.
#![no_std]
#![no_main]

mod runtime;

extern crate alloc;

use alloc::vec::Vec;
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::{
    Aabb, FrustumCuller, Object, ObjectId, OccluderMesh, Pipeline, Pose, Scene, View, VisibleSet,
};
use visibility_hzb::{Hzb, HzbCuller};
// Linked, so that these crates are also proven to need no standard library.
use {
    visibility_2d as _, visibility_bsp as _, visibility_exact as _, visibility_frame as _,
    visibility_measure as _,
};
use {visibility_plp as _, visibility_portals as _, visibility_region as _};

/// Returns true if frustum culling and the z-buffer give the expected answers.
fn the_answer_is_right() -> bool {
    frustum() && z_buffer().unwrap_or(false)
}

/// Culls a scene of a wall and a box behind the wall with the z-buffer. Returns whether only the wall is
/// visible; `None` if a step failed.
fn z_buffer() -> Option<bool> {
    let mut scene = Scene::new();
    let bounds = Aabb::from_arrays([5.0, -4.0, -4.0], [5.5, 4.0, 4.0]);
    let wall = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).ok()?);
    scene.set_mesh(wall, mesh, Affine3A::IDENTITY).ok()?;
    scene.insert(Aabb::from_arrays([8.0, -1.0, -1.0], [9.0, 1.0, 1.0]));
    let map = Hzb::new(64, 64).ok()?;
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(HzbCuller::new(map));
    let mut visible = VisibleSet::new();
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.25, f64::INFINITY).ok()?;
    pipeline.cull(&scene, &view, &mut visible);
    Some(visible.iter(&scene).eq([wall]))
}

/// Culls a row of a thousand boxes along x. The camera is at box 500 and looks along the row up to a far
/// plane at box 600. Returns whether exactly the boxes 500 to 600 are visible.
fn frustum() -> bool {
    let mut scene = Scene::new();
    let boxes = (0..1000).map(|i| Aabb::from_arrays([i as f32, -0.25, -0.25], [i as f32 + 0.5, 0.25, 0.25]));
    scene.insert_batch(boxes);
    let pose = Pose::look_at(DVec3::new(499.75, 0.0, 0.0), DVec3::new(600.0, 0.0, 0.0), DVec3::Z);
    let Ok(view) = View::perspective(pose, 1.0, 1.5, 0.25, 100.5) else { return false };
    let mut pipeline = Pipeline::new().with(FrustumCuller::new());
    let mut visible = VisibleSet::new();
    pipeline.cull(&scene, &view, &mut visible);
    let mut seen: Vec<usize> = visible.iter(&scene).map(ObjectId::index).collect();
    seen.sort_unstable();
    seen.into_iter().eq(500..=600)
}
