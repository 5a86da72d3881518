//! Random scenes, and a ray test to judge which boxes may be hidden.
#![allow(dead_code, missing_docs, unreachable_pub)]

pub mod exact;

use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{
    Aabb, Object, Pose, Scene, View, occlusion::Preparation, scene::Triangle, view::Window,
};
use visibility_testing::Random;

/// Returns the twelve triangles of a box, in the box's own space, counter-clockwise as seen from outside.
pub fn triangles_of(bounds: &Aabb) -> Vec<Triangle> {
    let corners = bounds.corners();
    visibility_core::OccluderMesh::CUBOID.iter().map(|t| t.map(|i| corners[i as usize])).collect()
}

/// A random scene of occluders (solid boxes, walls, slanted and sliver triangles) and of 600 small boxes that
/// are not occluders.
pub struct Soup {
    /// The scene of all occluders and boxes, with `prepare_occluders` already called.
    pub scene: Scene,
    /// Triangles of all occluders, in metres relative to `Scene::origin`.
    pub solid: Vec<Triangle>,
}

impl Soup {
    /// Creates a scene with `occluders` occluder objects; all coordinates are multiplied by `scale`.
    pub fn new(random: &mut Random, scale: f32, occluders: usize) -> Self {
        let mut scene = Scene::new();
        let mut solid = Vec::new();
        let whole = |random: &mut Random, reach: f64| random.fine_vector(reach).round().as_vec3();
        for i in 0..occluders {
            let at = whole(random, 12.0);
            let triangles = match i % 6 {
                // Walls and slabs on whole coordinates, so that many touch.
                0 | 1 => {
                    let mut size = Vec3::new(1.0, 1.0, 1.0) + whole(random, 4.0).abs();
                    size[random.below(3)] = 0.25;
                    triangles_of(&Aabb::new(at * scale, (at + size) * scale))
                }
                // Two abutting slabs of one object.
                2 => {
                    let (mut size, axis) = (Vec3::splat(0.5), random.below(3));
                    size[(axis + 1) % 3] = 3.0;
                    size[(axis + 2) % 3] = 4.0;
                    let mut next = at;
                    next[(axis + 1) % 3] += 3.0;
                    let mut both = triangles_of(&Aabb::new(at * scale, (at + size) * scale));
                    both.extend(triangles_of(&Aabb::new(next * scale, (next + size) * scale)));
                    both
                }
                // A slanted quadrilateral, and (next arm) a single triangle.
                3 => {
                    let (u, v) = (random.fine_vector(6.0).as_vec3(), random.fine_vector(6.0).as_vec3());
                    let [a, b, c, d] = [at, at + u, at + u + v, at + v].map(|p| p * scale);
                    vec![[a, b, c], [a, c, d]]
                }
                4 => vec![[at * scale, (at + whole(random, 6.0)) * scale, (at + whole(random, 6.0)) * scale]],
                // A sliver and a triangle collapsed to a point.
                _ => {
                    let u = random.fine_vector(8.0).as_vec3();
                    let v = u + random.fine_vector(1e-4).as_vec3();
                    vec![[at * scale, (at + u) * scale, (at + v) * scale], [at * scale; 3]]
                }
            };
            let bounds = Aabb::from_points(triangles.iter().flatten().copied());
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            scene.set_triangles(id, triangles.as_slice()).unwrap();
            solid.extend(triangles);
        }
        for _ in 0..600 {
            let min = random.fine_vector(16.0).as_vec3() * scale;
            let size = random.fine_vector(0.6).abs().as_vec3() * scale;
            scene.insert(Aabb::new(min, min + size));
        }
        scene.prepare_occluders(&Preparation::default().with_sliver(0.0).with_two_sided(true));
        scene.rebuild();
        Self { scene, solid }
    }

    /// Returns a random perspective or orthographic view. Its eye is anywhere, in the plane of an occluder
    /// triangle, at a vertex, or next to an edge.
    pub fn view(&self, random: &mut Random, scale: f64) -> View {
        let triangle = self.solid[random.below(self.solid.len())].map(|p| p.as_dvec3());
        let eye = match random.below(8) {
            0 => triangle[0],
            1 => {
                triangle[0]
                    + (triangle[1] - triangle[0]) * random.fine_range(-2.0, 2.0)
                    + (triangle[2] - triangle[0]) * random.fine_range(-2.0, 2.0)
            }
            2 => triangle[0] * 0.5 + triangle[1] * 0.5 + random.fine_vector(1e-9 * scale),
            _ => random.fine_vector(14.0 * scale),
        };
        let target = eye + random.fine_vector(1.0) * scale;
        let pose = Pose::look_at(eye, target, DVec3::new(0.1, 0.2, 1.0));
        let near = [0.01, 0.1, 1.0][random.below(3)] * scale;
        let far = if random.below(2) == 0 { f64::INFINITY } else { 60.0 * scale };
        if random.below(3) == 0 {
            let size = random.fine_range(4.0, 30.0) * scale;
            View::orthographic(pose, Window::centered(size, size), near, 80.0 * scale).unwrap()
        } else {
            View::perspective(pose, random.fine_range(0.4, 2.2), random.fine_range(0.6, 1.8), near, far)
                .unwrap()
        }
    }
}

/// Returns the parameter `t` at which the segment `from + t (to - from)` crosses a triangle's plane inside
/// the triangle; `t` may be outside 0 to 1. `None` if the line misses the triangle or is parallel to it. Both
/// sides count, and the boundary is widened by 1e-9 for the oracle's own rounding. Points and triangle are in
/// metres relative to `Scene::origin`.
pub fn meets(from: DVec3, to: DVec3, triangle: &Triangle) -> Option<f64> {
    let [a, b, c] = triangle.map(|p| p.as_dvec3());
    let (u, v, along) = (b - a, c - a, to - from);
    let normal = u.cross(v);
    let rate = normal.dot(along);
    if rate == 0.0 {
        return None;
    }
    let t = normal.dot(a - from) / rate;
    let p = from + along * t - a;
    let area = normal.length_squared();
    let (s, r) = (p.cross(v).dot(normal) / area, u.cross(p).dot(normal) / area);
    let rim = 1e-9;
    (s >= -rim && r >= -rim && s + r <= 1.0 + rim).then_some(t)
}
