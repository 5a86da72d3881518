//! Tests that no line of sight meets a box hidden by the triangulated image: rays are cast to points of
//! hidden boxes, triangle by triangle, with code independent of the image.

use crate::common::{Face, Occluder, is_blocked};
use visibility_2d::view_cdt::ViewCdt;
use visibility_core::glam::{Affine3A, DVec3, Mat3, Quat, Vec3};
use visibility_core::occlusion::Occlusion;
use visibility_core::view::{Depth, Window};
use visibility_core::{Aabb, OccluderMesh, OcclusionMap, Pose, View};
use visibility_testing::{Random, judged, told_enough};

/// Makes a ball whose vertices are moved inwards by up to the fraction `dent` of its radius.
fn ball(random: &mut Random, dent: f64) -> Option<OccluderMesh> {
    let (rings, sectors) = (4u32, 6u32);
    let mut positions = vec![Vec3::Z * 1.5, Vec3::Z * -1.5];
    for k in 0..(rings - 1) * sectors {
        let (a, b) = (
            std::f32::consts::PI * (k / sectors + 1) as f32 / rings as f32,
            std::f32::consts::TAU * (k % sectors) as f32 / sectors as f32,
        );
        let r = 1.5 - random.fine_range(0.0, 1.5 * dent + 1e-9) as f32;
        positions.push(Vec3::new(a.sin() * b.cos(), a.sin() * b.sin(), a.cos()) * r);
    }
    let at = |ring: u32, sector: u32| 2 + ring * sectors + sector % sectors;
    let mut triangles = Vec::new();
    for s in 0..sectors {
        triangles.push([0, at(0, s), at(0, s + 1)]);
        triangles.push([1, at(rings - 2, s + 1), at(rings - 2, s)]);
        for ring in 0..rings - 2 {
            let [a, b, c, d] = [at(ring, s), at(ring + 1, s), at(ring + 1, s + 1), at(ring, s + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    OccluderMesh::from_indexed(&positions, &triangles).ok()
}

/// Makes a sheet of squares. Each corner is moved up or down by up to `height`, and some squares are left
/// out.
fn sheet(random: &mut Random, height: f64) -> Option<OccluderMesh> {
    let cells = 1 + random.below(4) as u32;
    let side = cells + 1;
    let positions: Vec<_> = (0..side * side)
        .map(|k| {
            let [x, y] = [k % side, k / side].map(|k| (k as f32 / cells as f32 - 0.5) * 5.0);
            Vec3::new(x, y, random.fine_range(-height, height + 1e-9) as f32)
        })
        .collect();
    let mut triangles = Vec::new();
    for k in 0..cells * cells {
        let a = k / cells * side + k % cells;
        if !random.one_in(8) {
            triangles.extend([[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]);
        }
    }
    OccluderMesh::from_indexed(&positions, &triangles).ok()
}

fn occluder(random: &mut Random) -> Option<Occluder> {
    let mesh = match random.below(6) {
        0 | 1 => {
            let middle = random.vec3(-6.0, 6.0);
            let half = random.vec3(0.1, 3.0);
            OccluderMesh::cuboid(&Aabb::new(middle - half, middle + half)).ok()?
        }
        2 => ball(random, 0.0)?,
        3 => ball(random, 0.5)?,
        4 => {
            let height = random.pick(&[0.0, 0.01, 1.0]);
            sheet(random, height)?
        }
        _ => {
            let triangles: Vec<_> =
                (0..1 + random.below(4)).map(|_| [0; 3].map(|_| random.vec3(-4.0, 4.0))).collect();
            OccluderMesh::from_triangles(&triangles).ok()?
        }
    };
    let shift = random.vec3(-5.0, 5.0);
    let transform = match random.below(3) {
        0 => Affine3A::IDENTITY,
        1 => Affine3A::from_translation(shift),
        _ => {
            let axis = random.vec3(-1.0, 1.0).normalize_or(Vec3::X);
            let turn = Quat::from_axis_angle(axis, random.fine_range(-3.0, 3.0) as f32);
            let mirror = if random.one_in(2) { -1.0 } else { 1.0 };
            let scale = Mat3::from_diagonal(Vec3::new(mirror, 0.5, 1.5));
            Affine3A::from_mat3_translation(Mat3::from_quat(turn) * scale, shift)
        }
    };
    Some(Occluder { mesh: mesh.with_two_sided(random.one_in(3)), transform })
}

/// Returns a box to test: at a random place, or small and just behind an edge of an occluder as seen along
/// `back`.
fn target(random: &mut Random, back: impl Fn(DVec3) -> DVec3, faces: &[Face]) -> Aabb {
    if random.one_in(2) || faces.is_empty() {
        let middle = random.vec3(-14.0, 14.0);
        let most = random.pick(&[0.02, 0.3, 2.0]);
        let half = random.vec3(0.0, most);
        return Aabb::new(middle - half, middle + half);
    }
    let (t, _) = faces[random.below(faces.len())];
    let edge = t[0] + (t[1] - t[0]) * random.unit();
    let behind = edge + back(edge) * random.fine_range(0.0, 1.5);
    let size = random.pick(&[1e-5f32, 1e-3, 0.1]);
    let middle = behind.as_vec3() + random.vec3(-2.0, 2.0) * size;
    Aabb::new(middle - size, middle + size)
}

fn random_view(random: &mut Random, pose: Pose) -> View {
    let near = random.pick(&[0.01, 0.5, 3.0]);
    let view = match random.below(4) {
        0 => View::orthographic(pose, Window::centered(14.0, 9.0), near, 60.0),
        1 => {
            let window = Window { left: -0.2, right: 0.9, bottom: -0.3, top: 0.4 };
            View::perspective_off_center(pose, window, near, f64::INFINITY)
        }
        _ => View::perspective(pose, random.fine_range(0.3, 2.2), 1.5, near, f64::INFINITY),
    };
    let view = view.unwrap();
    // Variants of the view: depth from 0 to 1 instead of reversed, and mirrored pictures.
    let m = view.clip_from(view.origin());
    let [mut x, y, z, w] = [0, 1, 2, 3].map(|i| m.row(i));
    if random.one_in(3) {
        x = -x;
    }
    let (z, depth) = match view.depth() {
        Depth::Reversed if random.one_in(2) => (w - z, Depth::ZeroToOne),
        Depth::ReversedInfinite if random.one_in(2) => (w - z, Depth::ZeroToOneInfinite),
        depth => (z, depth),
    };
    let rows = visibility_core::glam::DMat4::from_cols(x, y, z, w).transpose();
    View::from_clip_from_world(rows, depth).unwrap().relative_to(view.origin()).unwrap()
}

fn run(rounds: usize, seed: u64) -> [u64; 2] {
    let mut random = Random(seed);
    let [mut hidden, mut rays] = [0; 2];
    for round in 0..rounds {
        let eye = random.vec3(-8.0, 8.0).as_dvec3();
        let ahead = random.vec3(-3.0, 3.0).as_dvec3() - eye;
        let pose = Pose::look_at(eye, eye + ahead, random.vec3(-1.0, 1.0).as_dvec3());
        let view = random_view(&mut random, pose);
        let direction = ahead.normalize();
        let is_parallel = matches!(view.eye(DVec3::ZERO), visibility_core::view::Eye::Direction(_));
        let start = |p: DVec3| if is_parallel { p - direction * 100.0 } else { eye };
        let mut map = ViewCdt::new();
        map.begin(&view, DVec3::ZERO);
        let count = random.below(10) + 1;
        let occluders: Vec<_> = (0..count).filter_map(|_| occluder(&mut random)).collect();
        for o in &occluders {
            map.add(&o.mesh, &o.transform);
            if random.one_in(3) {
                map.flush();
            }
        }
        map.flush();
        let faces: Vec<_> = occluders.iter().flat_map(Occluder::faces).collect();
        let planes = view.planes(DVec3::ZERO);
        let near = planes.as_slice()[4].plane;
        for _ in 0..60 {
            let bounds = target(&mut random, |p| p - start(p), &faces);
            if map.test(&bounds) != Occlusion::Hidden {
                continue;
            }
            hidden += 1;
            for p in random.points_of(&bounds) {
                if !planes.contains(p) {
                    continue;
                }
                rays += 1;
                assert!(
                    is_blocked(start(p), p, (near.normal, near.offset), &faces),
                    "seed {seed}, round {round}: {p} of {bounds:?} is seen"
                );
            }
        }
    }
    [hidden, rays]
}

#[test]
fn what_the_image_hides_no_ray_reaches() {
    let [hidden, rays] = run(6_000, 1);
    judged(rays);
    told_enough(hidden > 8_000 && rays > 40_000, format_args!("{hidden} boxes, {rays} rays are no test"));
}
