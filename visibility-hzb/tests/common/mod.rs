//! Random occluders and cameras, and rays cast against the occluders. Rays use only the view's matrix and
//! plain vector algebra, and share no code with the rasterizer.
#![allow(dead_code, unreachable_pub)] // Each test uses a part.

pub mod boxes;

use visibility_core::glam::{Affine3A, DMat4, DVec3, DVec4, Quat, Vec3, Vec4};
use visibility_core::{
    Aabb, Object, OccluderMesh, OcclusionMap, Pose, Scene, View,
    view::{Depth, Window},
};
use visibility_hzb::Hzb;
use visibility_testing::Random;

/// An occluder mesh and its placement.
pub struct Occluder {
    /// Mesh in its own coordinates.
    pub mesh: OccluderMesh,
    /// Transform from the mesh's coordinates to the scene.
    pub transform: Affine3A,
}

/// Returns an open, concave mesh: a square grid of `cells` x `cells` quads, 4 m wide, whose vertices are
/// moved up and down by at most `height` metres. One in `holes` quads is missing; 0 leaves out none. `None`
/// if [`OccluderMesh`] rejects the triangles.
fn grid(random: &mut Random, cells: u32, height: f64, holes: usize) -> Option<OccluderMesh> {
    let side = cells + 1;
    let mut positions = Vec::new();
    for j in 0..side {
        for i in 0..side {
            let z = random.fine_range(-height, height) as f32;
            positions.push(Vec3::new(i as f32 / cells as f32 - 0.5, j as f32 / cells as f32 - 0.5, z) * 4.0);
        }
    }
    let mut triangles = Vec::new();
    for j in 0..cells {
        for i in 0..cells {
            let (a, b, c, d) = (j * side + i, j * side + i + 1, (j + 1) * side + i + 1, (j + 1) * side + i);
            if holes == 0 || random.below(holes) != 0 {
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    OccluderMesh::from_indexed(&positions, &triangles).ok()
}

/// Returns a closed ball of radius 1.5 m whose vertices are moved inwards by a random fraction of the radius,
/// at most `dent`. `None` if [`OccluderMesh`] rejects the triangles.
fn ball(random: &mut Random, dent: f64) -> Option<OccluderMesh> {
    let (rings, sectors) = (5u32, 8u32);
    let mut positions = vec![Vec3::new(0.0, 0.0, 1.5), Vec3::new(0.0, 0.0, -1.5)];
    for ring in 1..rings {
        for sector in 0..sectors {
            let (a, b) = (
                std::f32::consts::PI * ring as f32 / rings as f32,
                std::f32::consts::TAU * sector as f32 / sectors as f32,
            );
            let r = 1.5 * (1.0 - random.fine_range(0.0, dent.max(1e-9))) as f32;
            positions.push(Vec3::new(a.sin() * b.cos(), a.sin() * b.sin(), a.cos()) * r);
        }
    }
    let at = |ring: u32, sector: u32| 2 + (ring - 1) * sectors + sector % sectors;
    let mut triangles = Vec::new();
    for s in 0..sectors {
        triangles.push([0, at(1, s), at(1, s + 1)]);
        triangles.push([1, at(rings - 1, s + 1), at(rings - 1, s)]);
        for ring in 1..rings - 1 {
            let (a, b, c, d) = (at(ring, s), at(ring + 1, s), at(ring + 1, s + 1), at(ring, s + 1));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    OccluderMesh::from_indexed(&positions, &triangles).ok()
}

/// Returns a random occluder near the scene's origin: box, boxes, grid, ball, loose triangles or wall, some
/// of them two-sided, mirrored or scaled.
pub fn occluder(random: &mut Random) -> Occluder {
    let mesh = loop {
        let mesh = match random.below(11) {
            0 | 1 => {
                let a = random.vec3(-2.0, 2.0);
                let b = random.vec3(-2.0, 2.0);
                OccluderMesh::cuboid(&Aabb::new(a.min(b), a.max(b))).ok()
            }
            2 => grid(random, 3, 0.1, 5),
            3 => grid(random, 4, 0.01, 0),
            4 => ball(random, 0.5),
            5 => ball(random, 0.0),
            6 => {
                // Loose triangles, some of them slivers.
                let triangles: Vec<_> = (0..random.below(6) + 1)
                    .map(|_| {
                        let a = random.vec3(-2.0, 2.0);
                        let thin = if random.below(3) == 0 { 0.01 } else { 2.0 };
                        [a, a + random.vec3(-3.0, 3.0), a + random.vec3(-thin, thin)]
                    })
                    .collect();
                OccluderMesh::from_triangles(&triangles).ok()
            }
            9 | 10 => {
                // Boxes, some of which touch, and sometimes a loose triangle.
                let mut triangles = Vec::new();
                let mut last = Vec3::ZERO;
                for _ in 0..random.below(5) + 2 {
                    let a = if random.below(2) == 0 { last } else { random.vec3(-2.0, 2.0) };
                    let b = a + random.vec3(-2.0, 2.0);
                    last = b;
                    if let Ok(part) = OccluderMesh::cuboid(&Aabb::new(a.min(b), a.max(b))) {
                        triangles
                            .extend(part.triangles().iter().map(|t| t.map(|i| part.positions()[i as usize])));
                    }
                }
                for _ in 0..random.below(2) {
                    triangles.push([random.vec3(-2.0, 2.0), random.vec3(-2.0, 2.0), random.vec3(-2.0, 2.0)]);
                }
                OccluderMesh::from_triangles(&triangles).ok()
            }
            7 => {
                // A flat wall with a window, two triangles for each of its four sides.
                let p = |x: f32, y: f32| Vec3::new(x, y, 0.0);
                let positions = [
                    p(-3., -3.),
                    p(3., -3.),
                    p(3., 3.),
                    p(-3., 3.),
                    p(-1., -1.),
                    p(1., -1.),
                    p(1., 1.),
                    p(-1., 1.),
                ];
                let triangles: Vec<[u32; 3]> = (0..4)
                    .flat_map(|i| [[i, (i + 1) % 4, (i + 1) % 4 + 4], [i, (i + 1) % 4 + 4, i + 4]])
                    .collect();
                OccluderMesh::from_indexed(&positions, &triangles).ok()
            }
            _ => {
                // A wall of two triangles, or a folded one.
                let fold = if random.below(2) == 0 { 0.0 } else { random.fine_range(-2.0, 2.0) as f32 };
                let p = [
                    Vec3::new(-2., -2., 0.),
                    Vec3::new(2., -2., fold),
                    Vec3::new(2., 2., 0.),
                    Vec3::new(-2., 2., 0.),
                ];
                OccluderMesh::from_indexed(&p, &[[0, 1, 2], [0, 2, 3]]).ok()
            }
        };
        if let Some(mesh) = mesh {
            break mesh.with_two_sided(random.below(3) == 0);
        }
    };
    let transform = match random.below(3) {
        0 => Affine3A::IDENTITY,
        1 => Affine3A::from_translation(random.vec3(-6.0, 6.0)),
        _ => {
            let q = random.vec3(-1.0, 1.0);
            let turn = Quat::from_vec4(Vec4::new(q.x, q.y, q.z, 0.3).normalize());
            let scale = random.vec3(0.3, 3.0)
                * if random.below(4) == 0 { Vec3::new(-1.0, 1.0, 1.0) } else { Vec3::ONE };
            Affine3A::from_scale_rotation_translation(scale, turn, random.vec3(-6.0, 6.0))
        }
    };
    Occluder { mesh, transform }
}

/// Returns a scene of `count` random occluders among 2000 small boxes.
pub fn scene(random: &mut Random, count: usize) -> Scene {
    let mut scene = Scene::new();
    for _ in 0..count {
        let Occluder { mesh, transform } = occluder(random);
        let corners = mesh.bounds().corners().map(|p| transform.transform_point3(p));
        let id = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_points(corners)) });
        let mesh = scene.add_mesh(mesh);
        scene.set_mesh(id, mesh, transform).unwrap();
    }
    scene.insert_batch((0..2000).map(|_| {
        let middle = random.vec3(-9.0, 9.0);
        Aabb::new(middle - 0.3, middle + 0.3)
    }));
    scene.rebuild();
    scene
}

/// Draws the occluders into `map`, with an extra flush after the second one.
pub fn draw<M: OcclusionMap>(mut map: M, occluders: &[Occluder], view: &View) -> M {
    map.begin(view, DVec3::ZERO);
    for (i, o) in occluders.iter().enumerate() {
        map.add(&o.mesh, &o.transform);
        if i == 1 {
            map.flush();
        }
    }
    map.flush();
    map
}

/// Returns the column, row and depth key of each covered pixel, row by row from the top.
pub fn covered_pixels(hzb: &Hzb) -> impl Iterator<Item = (usize, usize, f64)> {
    (0..hzb.width() * hzb.height())
        .map(|i| (i % hzb.width(), i / hzb.width()))
        .map(|(column, row)| (column, row, f64::from(hzb.depth_key(column, row))))
        .filter(|&(.., stored)| stored != f64::NEG_INFINITY)
}

/// Returns a random perspective, off-centre or orthographic view towards the scene's origin, in a random
/// depth convention.
pub fn view(random: &mut Random) -> View {
    let eye = random.vec3(-9.0, 9.0).as_dvec3();
    let pose = Pose::look_at(eye, random.vec3(-3.0, 3.0).as_dvec3(), random.vec3(-1.0, 1.0).as_dvec3());
    let near = if random.below(2) == 0 { 0.1 } else { random.fine_range(0.5, 4.0) };
    let far = if random.below(2) == 0 { 60.0 } else { f64::INFINITY };
    let view = match random.below(4) {
        0 => {
            let window = Window {
                left: -random.fine_range(0.2, 9.0),
                right: random.fine_range(0.2, 9.0),
                bottom: -4.0,
                top: random.fine_range(0.1, 5.0),
            };
            View::orthographic(pose, window, near, 60.0)
        }
        1 => {
            let window = Window {
                left: random.fine_range(-1.0, 0.1),
                right: random.fine_range(0.2, 1.0),
                bottom: -0.3,
                top: random.fine_range(0.1, 0.9),
            };
            View::perspective_off_center(pose, window, near, far)
        }
        _ => View::perspective(pose, random.fine_range(0.2, 2.2), random.fine_range(0.7, 2.5), near, far),
    };
    convention(&view.unwrap(), random.below(3))
}

/// Returns the same view in another depth convention: -1 to 1 for `which` 0, 0 to 1 for 1, unchanged
/// (reversed) otherwise.
pub fn convention(view: &View, which: usize) -> View {
    let m = view.clip_from(view.origin());
    let [x, y, z, w] = [m.row(0), m.row(1), m.row(2), m.row(3)];
    let infinite = view.depth().is_infinite();
    let (z, depth) = match which {
        0 => (w - z * 2.0, if infinite { Depth::NegativeOneToOneInfinite } else { Depth::NegativeOneToOne }),
        1 => (w - z, if infinite { Depth::ZeroToOneInfinite } else { Depth::ZeroToOne }),
        _ => return *view,
    };
    let m = DMat4::from_cols(x, y, z, w).transpose();
    View::from_clip_from_world(m, depth).unwrap().relative_to(view.origin()).unwrap()
}

/// A triangle of an occluder in world coordinates.
#[derive(Clone, Copy)]
pub struct Face {
    /// Corners in world coordinates, counter-clockwise as seen from the front.
    pub corners: [DVec3; 3],
    /// True if only the front hides objects, false if the back does too.
    pub one_sided: bool,
}

/// Returns all triangles of some occluders in world coordinates.
pub fn faces(occluders: &[Occluder]) -> Vec<Face> {
    let mut faces = Vec::new();
    for Occluder { mesh, transform } in occluders {
        let m = transform.matrix3.to_cols_array().map(f64::from);
        let (a, b, c) =
            (DVec3::new(m[0], m[1], m[2]), DVec3::new(m[3], m[4], m[5]), DVec3::new(m[6], m[7], m[8]));
        let shift = Vec3::from(transform.translation).as_dvec3();
        let mirrored = a.dot(b.cross(c)) < 0.0;
        for t in mesh.triangles() {
            let mut corners = t.map(|i| {
                let p = mesh.positions()[i as usize].as_dvec3();
                a * p.x + b * p.y + c * p.z + shift
            });
            if mirrored {
                corners.swap(1, 2);
            }
            faces.push(Face { corners, one_sided: !mesh.is_two_sided() });
        }
    }
    faces
}

/// A view ray through a point of the picture, from the near plane on.
pub struct Ray {
    /// Point of the ray on the near plane, in world coordinates.
    pub from: DVec3,
    /// Unit direction of the ray, away from the eye.
    pub along: DVec3,
    /// Clip matrix of the view, for world coordinates.
    matrix: DMat4,
    /// Depth convention of the view.
    depth: Depth,
    /// True if the view is perspective, false if it is parallel.
    perspective: bool,
}

impl Ray {
    /// Returns the view ray through column `x` and row `y` of a picture, in pixels. `size` is the width and
    /// height of the picture in pixels.
    pub fn new(view: &View, size: [usize; 2], x: f64, y: f64) -> Self {
        let matrix = view.clip_from(DVec3::ZERO);
        let (x, y) = (x / size[0] as f64 * 2.0 - 1.0, 1.0 - y / size[1] as f64 * 2.0);
        let inverse = matrix.inverse();
        let at = |z: f64| {
            let p = inverse * DVec4::new(x, y, z, 1.0);
            p.truncate() / p.w
        };
        let (near, far) = match view.depth() {
            Depth::NegativeOneToOne | Depth::NegativeOneToOneInfinite => (-1.0, 0.5),
            Depth::ZeroToOne | Depth::ZeroToOneInfinite => (0.0, 0.5),
            Depth::Reversed | Depth::ReversedInfinite => (1.0, 0.5),
        };
        let (from, to) = (at(near), at(far));
        let perspective = matrix.row(3).truncate() != DVec3::ZERO;
        Self { from, along: (to - from).normalize(), matrix, depth: view.depth(), perspective }
    }

    /// Returns the depth key (greater is nearer) of a point in world coordinates, as the z-buffer defines it.
    pub fn depth_key(&self, p: DVec3) -> f64 {
        let clip = self.matrix * p.extend(1.0);
        match (self.perspective, self.depth.is_reversed()) {
            (true, _) => 1.0 / clip.w,
            (false, true) => clip.z / clip.w,
            (false, false) => -clip.z / clip.w,
        }
    }

    /// Returns whether a point on the ray lies nearer than the near plane.
    pub fn is_before_near(&self, p: DVec3) -> bool {
        (p - self.from).dot(self.along) < 0.0
    }

    /// Returns the greatest depth key of all points beyond the near plane in which the ray meets one of
    /// `faces`. Negative infinity if it meets none. Faces are enlarged by 1e-7 of their size, so that no ray
    /// slips between two faces that share an edge.
    pub fn nearest(&self, faces: &[Face]) -> f64 {
        let mut best = f64::NEG_INFINITY;
        for Face { corners: [a, b, c], one_sided } in faces {
            let (u, v) = (*b - *a, *c - *a);
            let normal = u.cross(v);
            let slope = self.along.dot(normal);
            if slope == 0.0 || (*one_sided && slope > 0.0) {
                continue;
            }
            let t = (*a - self.from).dot(normal) / slope;
            if t < -1e-9 {
                continue;
            }
            let p = self.from + self.along * t;
            let over = 1.0 / normal.length_squared();
            let (s, r) = ((p - *a).cross(v).dot(normal) * over, u.cross(p - *a).dot(normal) * over);
            const SLIP: f64 = -1e-7;
            if s >= SLIP && r >= SLIP && s + r <= 1.0 - SLIP {
                best = best.max(self.depth_key(p));
            }
        }
        best
    }
}
