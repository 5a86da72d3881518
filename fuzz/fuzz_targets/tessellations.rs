//! Fuzz target: a stored tessellation with arbitrary changes and a repaired checksum is refused with a
//! reason, or projected to the end.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::sync::{Arc, LazyLock};
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, FrustumCuller, Object, Pipeline, Pose, Scene, View, VisibleSet};
use visibility_fuzz::mend;
use visibility_plp::{Budget, DelaunayTessellation, Fineness, OctreeTessellation, PlpCuller, Tessellation};

/// Small scene, and the stored bytes of its octree and of its tetrahedra.
static STORED: LazyLock<(Scene, [Vec<u8>; 2])> = LazyLock::new(|| {
    let mut scene = Scene::new();
    for i in 0..60u32 {
        let min = Vec3::new((i % 5) as f32, (i / 5 % 4) as f32, (i / 20) as f32) * 2.0;
        let max = min + Vec3::splat(0.5 + (i % 3) as f32 * 0.4);
        let id = scene.insert(Object::new(Aabb { min, max }));
        let corner = Vec3::new(max.x, min.y, min.z);
        scene.set_triangles(id, [[min, max, corner]]).expect("the object was just inserted");
    }
    let fineness = Fineness { vertices: 8, ..Fineness::default() };
    let octree = OctreeTessellation::from_scene(&scene, fineness).to_bytes(&scene);
    let tetrahedra = DelaunayTessellation::from_scene(&scene, fineness).to_bytes(&scene);
    (scene, [octree, tetrahedra])
});

fuzz_target!(|bytes: &[u8]| {
    let (scene, stored) = &*STORED;
    let Some((&which, mut edits)) = bytes.split_first() else { return };
    let which = usize::from(which & 1);
    let mut stored = stored[which].clone();
    // Each edit is an offset of two bytes and a new byte.
    while let [low, high, value, rest @ ..] = edits {
        let place = usize::from(u16::from_le_bytes([*low, *high])) % stored.len();
        stored[place] = *value;
        edits = rest;
    }
    if edits.len() == 1 {
        stored.truncate(stored.len() - usize::from(edits[0]).min(stored.len() - 40));
    }
    mend(&mut stored);
    if which == 0 {
        OctreeTessellation::from_bytes(&stored, scene).map(|cells| project(scene, cells)).ok();
    } else {
        DelaunayTessellation::from_bytes(&stored, scene).map(|cells| project(scene, cells)).ok();
    }
});

/// Culls two views of the scene by prioritized-layered projection over a tessellation, which must not panic.
fn project(scene: &Scene, cells: impl Tessellation + Send + Sync + 'static) {
    let mut pipeline = Pipeline::new()
        .with(FrustumCuller::new())
        .with(PlpCuller::new(Arc::new(cells), Budget::Objects(1_000)));
    let mut visible = VisibleSet::new();
    for eye in [DVec3::new(-20.0, 3.0, 2.0), DVec3::new(4.0, 4.0, 1.0)] {
        let pose = Pose::look_at(eye, DVec3::new(5.0, 3.0, 2.0), DVec3::Z);
        let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).expect("an ordinary camera");
        pipeline.cull(scene, &view, &mut visible);
        assert!(visible.iter(scene).count() <= scene.len(), "from {eye}: more objects than there are");
    }
}
