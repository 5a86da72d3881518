//! Scenes, views and occlusion maps for the tests of this crate.
#![allow(dead_code)]

use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{
    Aabb, Accuracy, Culler, Object, ObjectId, OccluderMesh, OcclusionMap, Pose, Scene, View, VisibleSet,
    occlusion::Occlusion, view::Window,
};
pub(crate) use visibility_testing::Random;

/// Returns a scene of `count` objects of one triangle each: mostly small triangles clustered around eight
/// points, and every fiftieth as large as the scene.
pub(crate) fn triangles(seed: u64, count: usize) -> Scene {
    let mut random = Random(seed);
    let mut scene = Scene::new();
    let middles: Vec<DVec3> = (0..8).map(|_| random.fine_vector(40.0)).collect();
    for i in 0..count {
        let (middle, size) =
            if i % 50 == 0 { (DVec3::ZERO, 60.0) } else { (middles[i % 8] + random.fine_vector(8.0), 1.0) };
        let triangle = [(); 3].map(|_| (middle + random.fine_vector(size)).as_vec3());
        let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points(triangle)) });
        scene.set_triangles(id, [triangle]).unwrap();
    }
    scene
}

/// Returns a scene of `count` rooms in a row along x, with a wall between consecutive rooms and 20 small
/// boxes in each room, then the walls, then the boxes. All objects are boxes without triangles. The walls
/// have occluder meshes.
pub(crate) fn rooms(count: usize) -> (Scene, Vec<ObjectId>, Vec<ObjectId>) {
    let mut scene = Scene::new();
    let (mut walls, mut things) = (Vec::new(), Vec::new());
    for room in 0..count {
        let x = room as f32 * 10.0;
        let wall = Aabb::from_arrays([x + 9.7, -20.0, -20.0], [x + 10.0, 20.0, 20.0]);
        let id = scene.insert(Object { occluder: true, cost: 12, ..Object::new(wall) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&wall).unwrap());
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        walls.push(id);
        for i in 0..20 {
            let min = Vec3::new(x + 3.0 + (i % 5) as f32, (i / 5) as f32 - 2.0, (i % 3) as f32 - 1.0);
            things.push(
                scene.insert(Object { cost: 12, ..Object::new(Aabb::new(min, min + Vec3::splat(0.4))) }),
            );
        }
    }
    (scene, walls, things)
}

/// Returns perspective and orthographic views from inside and outside of the test scenes.
pub(crate) fn views() -> Vec<View> {
    let mut views = Vec::new();
    let mut random = Random(99);
    for size in [5.0, 30.0, 200.0] {
        for _ in 0..4 {
            let pose = Pose::look_at(random.fine_vector(size), random.fine_vector(10.0), DVec3::Z);
            views.push(View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).unwrap());
            views.push(View::perspective(pose, 2.5, 0.7, 20.0, 150.0).unwrap());
            views.push(View::orthographic(pose, Window::centered(30.0, 20.0), -10.0, 300.0).unwrap());
        }
    }
    views
}

/// Returns a perspective view in the direction of the x axis from the eye (x, 0.05, 0.05), in metres.
pub(crate) fn looking_along_x(x: f64) -> View {
    let eye = DVec3::new(x, 0.05, 0.05);
    let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
    View::perspective(pose, 1.2, 1.5, 0.05, f64::INFINITY).unwrap()
}

/// Returns the objects that a culler keeps of all objects of a scene, in the set's order.
pub(crate) fn run(culler: &mut dyn Culler, scene: &Scene, view: &View) -> Vec<ObjectId> {
    let mut visible = VisibleSet::new();
    visible.fill(scene, view);
    culler.cull(scene, view, &mut visible);
    visible.iter(scene).collect()
}

/// Occlusion map that never finds a box hidden.
pub(crate) struct Blank;

impl OcclusionMap for Blank {
    fn name(&self) -> &str {
        "blank"
    }
    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }
    fn begin(&mut self, _: &View, _: DVec3) {}
    fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}
    fn flush(&mut self) {}
    fn test(&self, _: &Aabb) -> Occlusion {
        Occlusion::Partial
    }
}

/// Occlusion map of walls perpendicular to x, in scene-relative metres: boxes beyond the nearest flushed wall
/// are hidden. Exact for views along x in the scenes of [`rooms`].
#[derive(Default)]
pub(crate) struct Walls {
    /// x coordinate of the eye, in scene-relative metres.
    eye: f64,
    /// Greatest x, in scene-relative metres, of the nearest wall added in this frame; infinite without
    /// walls.
    added: f64,
    /// Greatest x, in scene-relative metres, of the nearest wall flushed: boxes beyond it are hidden.
    /// Infinite without walls.
    nearest: f64,
}

impl OcclusionMap for Walls {
    fn name(&self) -> &str {
        "walls"
    }
    fn accuracy(&self) -> Accuracy {
        Accuracy::Conservative
    }
    fn begin(&mut self, view: &View, origin: DVec3) {
        let visibility_core::view::Eye::Point(eye) = view.eye(origin) else { panic!("a perspective view") };
        *self = Self { eye: eye.x, added: f64::INFINITY, nearest: f64::INFINITY };
    }
    fn add(&mut self, occluder: &OccluderMesh, _: &Affine3A) {
        let bounds = occluder.bounds();
        if f64::from(bounds.min.x) > self.eye && bounds.max.y > 15.0 {
            self.added = self.added.min(bounds.max.x.into());
        }
    }
    fn flush(&mut self) {
        self.nearest = self.added;
    }
    fn test(&self, bounds: &Aabb) -> Occlusion {
        if f64::from(bounds.min.x) > self.nearest { Occlusion::Hidden } else { Occlusion::Partial }
    }
}
