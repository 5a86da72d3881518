//! Random scenes of occluders, and rays that search for objects hidden by mistake.
//!
//! The rays share no projection, clipping or raster code with the cullers that they judge: each is
//! intersected with all triangles. A ray counts as unobstructed only if it misses every triangle by more than
//! rounding.
#![allow(dead_code, unreachable_pub)]

mod point_shadows;

#[allow(unused_imports)]
pub use point_shadows::PointShadows;
use std::collections::BTreeSet;
use visibility_core::glam::{Affine3A, DVec3, Quat, Vec3};
use visibility_core::scene::Triangle;
use visibility_core::{Aabb, Object, ObjectId, OccluderMesh, RegionCuller, Scene, VisibleSet, pvs::Viewcell};
use visibility_testing::Random;

/// A scene with its occluding triangles. Each has a flag that says whether its back occludes too.
pub struct World {
    pub scene: Scene,
    pub triangles: Vec<([DVec3; 3], bool)>,
    /// The object of each triangle.
    pub owners: Vec<ObjectId>,
    pub bounds: Vec<(ObjectId, Aabb)>,
}

impl World {
    pub fn new() -> Self {
        Self { scene: Scene::new(), triangles: Vec::new(), owners: Vec::new(), bounds: Vec::new() }
    }

    /// Adds an object that hides nothing.
    pub fn add_target(&mut self, bounds: Aabb) -> ObjectId {
        let id = self.scene.insert(bounds);
        self.bounds.push((id, bounds));
        id
    }

    /// Adds an occluder.
    pub fn add(&mut self, triangles: &[Triangle], two_sided: bool, transform: Affine3A) -> Option<ObjectId> {
        let mesh = OccluderMesh::from_triangles(triangles).ok()?.with_two_sided(two_sided);
        let bounds = mesh.bounds().transformed(&transform);
        let id = self.scene.insert(Object { occluder: true, ..Object::new(bounds) });
        self.bounds.push((id, bounds));
        let place = |p: Vec3| {
            let p = p.as_dvec3();
            let column = |c: visibility_core::glam::Vec3A| DVec3::new(c.x.into(), c.y.into(), c.z.into());
            let m = transform.matrix3;
            column(m.x_axis) * p.x
                + column(m.y_axis) * p.y
                + column(m.z_axis) * p.z
                + column(transform.translation)
        };
        let mirrored = transform.matrix3.determinant() < 0.0;
        for t in mesh.triangles() {
            let [a, b, c] = t.map(|i| place(mesh.positions()[i as usize]));
            self.triangles.push((if mirrored { [a, c, b] } else { [a, b, c] }, two_sided));
            self.owners.push(id);
        }
        let mesh = self.scene.add_mesh(mesh);
        self.scene.set_mesh(id, mesh, transform).unwrap();
        Some(id)
    }

    pub fn add_box(&mut self, min: [f32; 3], max: [f32; 3]) -> ObjectId {
        self.add(&cuboid(min, max), false, Affine3A::IDENTITY).unwrap()
    }

    /// Returns the world as a view with some layers draws it: without triangles and bounds of other objects.
    pub fn on_layers(&self, layers: u32) -> Self {
        let is_drawn = |id: ObjectId| self.scene.object(id).is_ok_and(|o| o.layers & layers != 0);
        let triangles = self.owners.iter().zip(&self.triangles).filter(|(id, _)| is_drawn(**id));
        let (owners, triangles) = triangles.unzip();
        let bounds = self.bounds.iter().copied().filter(|(id, _)| is_drawn(*id)).collect();
        Self { scene: self.scene.clone(), triangles, owners, bounds }
    }

    /// Returns whether a segment misses all occluding triangles by more than rounding.
    pub fn is_free(&self, from: DVec3, to: DVec3) -> bool {
        let met = |(t, two_sided): &([DVec3; 3], bool)| hit(from, to - from, t, *two_sided);
        !self.triangles.iter().filter_map(met).any(|at| at <= 1.0 + 1e-9)
    }

    /// Returns the objects that a culler hides from a viewcell.
    pub fn hidden(&self, culler: &mut dyn RegionCuller, cell: &Viewcell) -> BTreeSet<ObjectId> {
        let mut visible = VisibleSet::new();
        culler.cull(&self.scene, cell, &mut visible);
        visible.finish(&self.scene);
        let seen: BTreeSet<ObjectId> = visible.iter(&self.scene).collect();
        self.scene.ids().filter(|id| !seen.contains(id)).collect()
    }

    /// Searches with `count` rays from the viewcell for an object of `hidden` that a ray sees. Some rays are
    /// random, most pass close to an edge of an occluder. `Err` with the object, the viewpoint and the
    /// direction if one is found.
    pub fn search(
        &self,
        rng: &mut Random,
        cell: &Viewcell,
        hidden: &BTreeSet<ObjectId>,
        count: usize,
    ) -> Result<(), (ObjectId, DVec3, DVec3)> {
        let size = cell.max - cell.min;
        self.search_from(rng, &|part| cell.min + size * part, hidden, count)
    }

    /// Searches as [`search`](Self::search) does, from viewpoints that `eye` computes from three fractions
    /// from 0 to 1.
    pub fn search_from(
        &self,
        rng: &mut Random,
        eye: &dyn Fn(DVec3) -> DVec3,
        hidden: &BTreeSet<ObjectId>,
        count: usize,
    ) -> Result<(), (ObjectId, DVec3, DVec3)> {
        let boxes: Vec<_> = self.bounds.iter().filter(|(id, _)| hidden.contains(id)).collect();
        if boxes.is_empty() {
            return Ok(());
        }
        for _ in 0..count {
            // Viewpoints at corners, on edges and on faces find most hidden objects.
            let at = DVec3::from_array([0, 1, 2].map(|_| match rng.below(3) {
                0 => 0.0,
                1 => 1.0,
                _ => rng.unit(),
            }));
            let eye = eye(at);
            let target = if rng.one_in(4) || self.triangles.is_empty() {
                let b = &rng.pick(&boxes).1;
                let at = DVec3::from_array([0, 1, 2].map(|_| match rng.below(4) {
                    0 => 0.0,
                    1 => 1.0,
                    _ => rng.unit(),
                }));
                b.min.as_dvec3() + (b.max - b.min).as_dvec3() * at
            } else {
                let (t, _) = rng.pick(&self.triangles);
                let corner = rng.below(3);
                let p = t[corner] + (t[(corner + 1) % 3] - t[corner]) * rng.unit();
                let near = (p - eye).length() * 10f64.powi(-rng.between(1, 6));
                p + rng.vector(near)
            };
            let direction = target - eye;
            if direction.length_squared() == 0.0 {
                continue;
            }
            let mut reach = f64::INFINITY;
            for (t, two_sided) in &self.triangles {
                if let Some(at) = hit(eye, direction, t, *two_sided) {
                    reach = reach.min(at);
                }
            }
            for (id, b) in &boxes {
                if let Some(at) = entry(eye, direction, b)
                    && at < reach * (1.0 - 1e-9)
                {
                    return Err((*id, eye, direction));
                }
            }
        }
        Ok(())
    }
}

/// Returns the ray parameter where a ray meets a triangle, or passes it within rounding.
fn hit(eye: DVec3, direction: DVec3, &[a, b, c]: &[DVec3; 3], two_sided: bool) -> Option<f64> {
    let (e, f) = (b - a, c - a);
    let p = direction.cross(f);
    let determinant = e.dot(p);
    if determinant < 0.0 && !two_sided {
        return None;
    }
    let s = eye - a;
    let u = s.dot(p) / determinant;
    let q = s.cross(e);
    let v = direction.dot(q) / determinant;
    let t = f.dot(q) / determinant;
    let near = 1e-9;
    if !(u.is_finite() && v.is_finite()) {
        return None;
    }
    (u >= -near && v >= -near && u + v <= 1.0 + near && t >= 0.0).then_some(t)
}

/// Returns the ray parameter where a ray enters a box.
fn entry(eye: DVec3, direction: DVec3, bounds: &Aabb) -> Option<f64> {
    let (mut first, mut last) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        let (low, high) = (f64::from(bounds.min[axis]), f64::from(bounds.max[axis]));
        if direction[axis] == 0.0 {
            if eye[axis] < low || eye[axis] > high {
                return None;
            }
            continue;
        }
        let (a, b) = ((low - eye[axis]) / direction[axis], (high - eye[axis]) / direction[axis]);
        (first, last) = (first.max(a.min(b)), last.min(a.max(b)));
    }
    (first <= last).then_some(first)
}

pub fn cuboid(min: [f32; 3], max: [f32; 3]) -> Vec<Triangle> {
    let corners = Aabb::from_arrays(min, max).corners();
    OccluderMesh::CUBOID.map(|t| t.map(|i| corners[i as usize])).to_vec()
}

/// Makes a prism over a polygon in the xy plane, which `fan` cuts into triangles. `capped`: with top and
/// bottom.
pub fn prism(outline: &[[f32; 2]], fan: &[[usize; 3]], height: [f32; 2], capped: bool) -> Vec<Triangle> {
    let at = |i: usize, z: f32| Vec3::new(outline[i][0], outline[i][1], z);
    let mut all = Vec::new();
    for i in 0..outline.len() {
        let j = (i + 1) % outline.len();
        let [a, b, c, d] = [at(i, height[0]), at(j, height[0]), at(j, height[1]), at(i, height[1])];
        all.extend([[a, b, c], [a, c, d]]);
    }
    if capped {
        for &[i, j, k] in fan {
            all.push([at(i, height[1]), at(j, height[1]), at(k, height[1])]);
            all.push([at(i, height[0]), at(k, height[0]), at(j, height[0])]);
        }
    }
    all
}

/// Makes a random world around a viewcell at the origin, `scale` metres large: occluders of many shapes near
/// the viewcell, and objects that do not occlude.
pub fn random_world(rng: &mut Random, scale: f64) -> (World, Viewcell) {
    let mut world = World::new();
    let size = DVec3::from_array([0, 1, 2].map(|_| scale * rng.pick(&[0.0, 0.1, 0.5, 1.0, 3.0])));
    let cell = Viewcell::from_box(-size * 0.5, size * 0.5);
    for _ in 0..rng.between(5, 40) {
        let s = |rng: &mut Random, least: f64, most: f64| (scale * rng.range(least, most)) as f32;
        let turn = match rng.below(4) {
            0 => Quat::IDENTITY,
            1 => Quat::from_rotation_z(rng.range(0.0, 6.0) as f32),
            2 => Quat::from_rotation_x(std::f32::consts::FRAC_PI_2),
            _ => Quat::from_axis_angle(rng.direction().as_vec3().normalize(), rng.range(0.0, 3.0) as f32),
        };
        let away = rng.direction() * (scale * rng.range(2.0, 12.0));
        let mut transform = Affine3A::from_rotation_translation(turn, away.as_vec3());
        if rng.one_in(4) {
            transform.matrix3.x_axis = -transform.matrix3.x_axis;
        }
        let (w, h) = (s(rng, 1.0, 8.0), s(rng, 1.0, 8.0));
        let triangles = match rng.below(6) {
            0 => cuboid([-w, -w, -h], [w, w, h]),
            // A plate: open and thin.
            1 => {
                let p = [[-w, -h], [w, -h], [w, h], [-w, h]].map(|[y, z]| Vec3::new(0.0, y, z));
                vec![[p[0], p[1], p[2]], [p[0], p[2], p[3]]]
            }
            // An L-shaped prism: concave, closed or without top and bottom.
            2 => {
                let t = w * 0.3;
                let outline = [[-w, -w], [w, -w], [w, -w + t], [-w + t, -w + t], [-w + t, w], [-w, w]];
                let fan = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
                prism(&outline, &fan, [-h, h], rng.one_in(2))
            }
            // Houses in a row, with walls between them and different heights.
            3 => (0..4)
                .flat_map(|i| {
                    let x = i as f32 * w * 0.5 - w;
                    cuboid([x, -w * 0.5, -h], [x + w * 0.5, w * 0.5, h * rng.range(0.2, 1.0) as f32])
                })
                .collect(),
            // A wall with a hole, as one mesh.
            4 => {
                let (a, b) = (w * rng.range(0.001, 0.3) as f32, h * rng.range(0.001, 0.3) as f32);
                let outer = [[-w, -h], [w, -h], [w, h], [-w, h]].map(|[y, z]| Vec3::new(0.0, y, z));
                let inner = [[-a, -b], [a, -b], [a, b], [-a, b]].map(|[y, z]| Vec3::new(0.0, y, z));
                (0..4)
                    .flat_map(|i| {
                        let j = (i + 1) % 4;
                        [[outer[i], outer[j], inner[j]], [outer[i], inner[j], inner[i]]]
                    })
                    .collect()
            }
            // A hedge of leaves.
            _ => (0..200)
                .map(|_| {
                    let at = Vec3::new(
                        0.1 * w * rng.unit() as f32,
                        w * rng.range(-1.0, 1.0) as f32,
                        h * rng.range(-1.0, 1.0) as f32,
                    );
                    let leaf = 0.4 * w;
                    [at, at + Vec3::new(0.0, leaf, 0.0), at + Vec3::new(0.1 * leaf, 0.0, leaf)]
                })
                .collect(),
        };
        // One occluder in four has reversed winding.
        let triangles: Vec<Triangle> =
            if rng.one_in(4) { triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect() } else { triangles };
        if rng.one_in(2) {
            // Given in scene coordinates, these surfaces are joined with one another.
            let triangles: Vec<Triangle> =
                triangles.iter().map(|t| t.map(|p| transform.transform_point3(p))).collect();
            let cut = rng.below(triangles.len());
            let two_sided = rng.one_in(2);
            world.add(&triangles[..cut], two_sided, Affine3A::IDENTITY);
            world.add(&triangles[cut..], two_sided, Affine3A::IDENTITY);
        } else {
            world.add(&triangles, rng.one_in(2), transform);
        }
    }
    for _ in 0..80 {
        let at = (rng.direction() * (scale * rng.range(3.0, 60.0))).as_vec3();
        let half = rng.vec3(0.0, scale * 0.6).abs();
        world.add_target(Aabb::new(at - half, at + half));
    }
    if rng.one_in(2) {
        world.scene.rebuild();
    }
    (world, cell)
}
