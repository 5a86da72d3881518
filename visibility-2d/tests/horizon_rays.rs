//! Tests that no unobstructed line of sight meets a box hidden by a horizon: rays are cast to points of
//! hidden boxes, triangle by triangle, with code independent of the horizon's columns.

use crate::common::{Occluder, is_blocked};
use visibility_2d::horizon::{Horizon, UpAxis};
use visibility_core::glam::{Affine3A, DVec3, Mat3, Quat, Vec3};
use visibility_core::occlusion::Occlusion;
use visibility_core::{Aabb, OccluderMesh, OcclusionMap, Pose, View};
use visibility_testing::{Random, judged, told_enough};

/// Makes a prism over a convex polygon, with or without its floor and its top.
fn prism(random: &mut Random, floor: bool, top: bool) -> Option<OccluderMesh> {
    let sides = 3 + random.below(5);
    let middle = random.vec3(-9.0, 9.0);
    let radius = random.fine_range(0.3, 4.0) as f32;
    let (low, high) = (middle.z.min(0.0), middle.z.max(0.0) + 0.5);
    let mut angle = random.unit() as f32;
    let mut ring = Vec::new();
    for _ in 0..sides {
        ring.push(Vec3::new(middle.x + radius * angle.cos(), middle.y + radius * angle.sin(), 0.0));
        angle += std::f32::consts::TAU / sides as f32 * random.fine_range(0.6, 1.0) as f32;
    }
    let at = |i: usize, z: f32| Vec3::new(ring[i % sides].x, ring[i % sides].y, z);
    let mut triangles = Vec::new();
    for i in 0..sides {
        triangles.push([at(i, low), at(i + 1, low), at(i + 1, high)]);
        triangles.push([at(i, low), at(i + 1, high), at(i, high)]);
    }
    for i in 1..sides - 1 {
        if top {
            triangles.push([at(0, high), at(i, high), at(i + 1, high)]);
        }
        if floor {
            triangles.push([at(0, low), at(i + 1, low), at(i, low)]);
        }
    }
    match random.below(8) {
        0 => drop(triangles.pop()),
        1 => {
            let index = random.below(triangles.len());
            triangles[index].swap(0, 1);
        }
        2 => {
            let index = random.below(triangles.len());
            triangles[index][0] += random.vec3(-0.5, 0.5);
        }
        _ => {}
    }
    let mesh = OccluderMesh::from_triangles(&triangles).ok()?;
    Some(mesh.with_two_sided(random.below(2) == 0))
}

/// Makes walls around a yard or along a crooked line, not convex: of one height or of several, on the ground
/// or raised, and some with a gap, a reversed triangle, or a corner moved so that panels lean.
fn walls(random: &mut Random) -> Option<OccluderMesh> {
    let count = 3 + random.below(6);
    let (is_ring, is_even) = (random.below(3) > 0, random.below(2) == 0);
    let middle = random.vec3(-9.0, 9.0);
    let corners: Vec<Vec3> = (0..count)
        .map(|i| {
            let angle = (i as f32 + 0.8 * random.unit() as f32) / count as f32 * std::f32::consts::TAU;
            let radius = random.fine_range(0.4, 5.0) as f32;
            Vec3::new(middle.x + radius * angle.cos(), middle.y + radius * angle.sin(), 0.0)
        })
        .collect();
    let even = [middle.z.min(0.0), middle.z.max(0.0) + 0.5];
    let mut triangles = Vec::new();
    for i in 0..count - usize::from(!is_ring) {
        let uneven = [random.fine_range(-6.0, -0.5) as f32, random.fine_range(-0.4, 6.0) as f32];
        let [low, high] = if is_even { even } else { uneven };
        let at = |i: usize, z: f32| Vec3::new(corners[i % count].x, corners[i % count].y, z);
        // In a quarter of the panels, the upper edge slopes.
        let end = if random.below(4) == 0 { high + 0.5 } else { high };
        if random.below(2) == 0 {
            triangles.push([at(i, low), at(i + 1, low), at(i + 1, end)]);
            triangles.push([at(i, low), at(i + 1, end), at(i, high)]);
        } else {
            triangles.push([at(i, low), at(i + 1, low), at(i, high)]);
            triangles.push([at(i + 1, low), at(i + 1, end), at(i, high)]);
        }
    }
    let index = random.below(triangles.len());
    match random.below(8) {
        0 => drop(triangles.remove(index)),
        1 => triangles[index].swap(0, 1),
        2 => triangles[index][0] += random.vec3(-0.5, 0.5),
        3 => triangles[index][2].z = triangles[index][0].z - 1.0,
        _ => {}
    }
    let mesh = OccluderMesh::from_triangles(&triangles).ok()?;
    Some(mesh.with_two_sided(random.below(2) == 0))
}

/// Makes a closed solid, a blade or a slab, whose top edges have a notch as deep as a mesh that counts as
/// convex may have, up to a factor of 2. Each axis of the mesh is stretched by a power of two, which the
/// transform undoes: along one axis, a notch is deepest if the mesh is longest along another.
fn notched(random: &mut Random) -> Option<Occluder> {
    let middle = random.vec3(-6.0, 6.0);
    let (length, height) = (random.fine_range(1.0, 8.0) as f32, random.fine_range(0.5, 9.0) as f32);
    let width = random.pick(&[0.01f32, 0.05, 0.3, 1.0]);
    let top = random.pick(&[0.0, 1.0]) * width;
    let stretch = [0; 3].map(|_| random.pick(&[1.0f32, 1.0, 1.0, 1.0 / 64.0, 64.0, 1024.0]));
    let stretch = Vec3::from_array(stretch);
    let along = random.pick(&[[0, 1], [1, 0]]);
    let mesh = |notch: f32| {
        // The outline of each side, counter-clockwise from the front, with the notch between the upper ends.
        let at = |along_it: f32, across: f32, up: f32| {
            let mut p = middle;
            p[along[0]] += along_it * length;
            p[along[1]] += if along[0] == 0 { -across } else { across };
            p.z += up;
            p * stretch
        };
        let side = |bottom: f32, top: f32| {
            [
                at(0.0, bottom, -height),
                at(1.0, bottom, -height),
                at(1.0, top, 0.0),
                at(0.5, top, -notch),
                at(0.0, top, 0.0),
            ]
        };
        let (front, back) = (side(width / 2.0, top / 2.0), side(-width / 2.0, -top / 2.0));
        let mut triangles = Vec::new();
        for i in 0..5 {
            let k = (i + 1) % 5;
            triangles.extend([[front[i], back[i], back[k]], [front[i], back[k], front[k]]]);
        }
        for [a, b, c] in [[3, 0, 1], [3, 1, 2], [3, 4, 0]] {
            triangles.extend([[front[a], front[b], front[c]], [back[a], back[c], back[b]]]);
        }
        OccluderMesh::from_triangles(&triangles).ok()
    };
    let depths = (0..24).map(|halvings| 0.5 * height / (1u32 << halvings) as f32);
    let mesh = depths.filter_map(mesh).find(OccluderMesh::is_convex)?;
    Some(Occluder { mesh, transform: Affine3A::from_scale(1.0 / stretch) })
}

fn occluder(random: &mut Random) -> Option<Occluder> {
    if random.one_in(4) {
        return notched(random);
    }
    let mesh = match random.below(6) {
        4 | 5 => walls(random)?,
        0 => {
            let middle = random.vec3(-9.0, 9.0);
            let half = random.vec3(0.1, 3.0);
            OccluderMesh::cuboid(&Aabb::new(middle - half, middle + half)).ok()?
        }
        1 => prism(random, true, true)?,
        2 => prism(random, false, true)?,
        _ => {
            let top = random.below(4) > 0;
            prism(random, false, top)?
        }
    };
    let transform = match random.below(4) {
        0 => {
            let turn = Quat::from_rotation_z(random.fine_range(-3.0, 3.0) as f32);
            Affine3A::from_rotation_translation(turn, random.vec3(-2.0, 2.0))
        }
        1 => {
            let axis = random.vec3(-1.0, 1.0).normalize_or(Vec3::X);
            let turn = Quat::from_axis_angle(axis, random.fine_range(-3.0, 3.0) as f32);
            Affine3A::from_mat3_translation(
                Mat3::from_quat(turn) * Mat3::from_diagonal(Vec3::new(1.0, 0.5, 1.5)),
                random.vec3(-2.0, 2.0),
            )
        }
        _ => Affine3A::IDENTITY,
    };
    Some(Occluder { mesh, transform })
}

/// Returns a box to test: at a random place, or small and just behind an outline of an occluder.
fn target(random: &mut Random, eye: DVec3, occluders: &[Occluder]) -> Aabb {
    if random.below(2) == 0 || occluders.is_empty() {
        let middle = random.vec3(-14.0, 14.0);
        let most = [0.02, 0.3, 2.0][random.below(3)];
        let half = random.vec3(0.0, most);
        return Aabb::new(middle - half, middle + half);
    }
    let occluder = &occluders[random.below(occluders.len())];
    let count = occluder.mesh.triangles().len();
    let Some((t, _)) = occluder.faces().nth(random.below(count)) else { return Aabb::EMPTY };
    let part = random.unit();
    let edge = t[0] + (t[1] - t[0]) * part;
    let behind = edge + (edge - eye) * random.fine_range(0.0, 1.5);
    let size = [1e-4f32, 1e-2, 0.1][random.below(3)];
    let middle = behind.as_vec3() + random.vec3(-2.0, 2.0) * size;
    Aabb::new(middle - size, middle + size)
}

fn run(rounds: usize, seed: u64) -> [u64; 2] {
    let mut random = Random(seed);
    let [mut hidden, mut rays] = [0; 2];
    for round in 0..rounds {
        let eye = random.vec3(-6.0, 6.0).as_dvec3() * DVec3::new(1.0, 1.0, 0.5);
        // View directions: level, tilted, and steeply down.
        let ahead = DVec3::new(random.unit() - 0.5, random.unit() - 0.5, 0.0);
        let tilt = [0.0, 0.3, -1.0, 1.0][random.below(4)] * random.unit();
        let pose = Pose::look_at(eye, eye + ahead + DVec3::Z * tilt, random.vec3(-1.0, 1.0).as_dvec3());
        let pose = if random.below(2) == 0 { Pose::look_at(eye, eye + ahead, DVec3::Z) } else { pose };
        let near = [0.01, 0.5, 3.0][random.below(3)];
        let fov = random.fine_range(0.3, 2.6);
        let view = View::perspective(pose, fov, 1.5, near, f64::INFINITY).unwrap();
        let up = if random.below(4) == 0 { UpAxis::Y } else { UpAxis::Z };
        let mut horizon = Horizon::new(up).with_columns([1, 7, 64, 360][random.below(4)]);
        horizon.begin(&view, DVec3::ZERO);
        let count = random.below(10) + 1;
        let occluders: Vec<_> = (0..count).filter_map(|_| occluder(&mut random)).collect();
        for o in &occluders {
            horizon.add(&o.mesh, &o.transform);
        }
        horizon.flush();
        let faces: Vec<_> = occluders.iter().flat_map(Occluder::faces).collect();
        let planes = view.planes(DVec3::ZERO);
        let near_plane = planes.as_slice()[4].plane;
        for _ in 0..60 {
            let bounds = target(&mut random, eye, &occluders);
            if horizon.test(&bounds) != Occlusion::Hidden {
                continue;
            }
            hidden += 1;
            for p in random.points_of(&bounds) {
                if !planes.contains(p) {
                    continue;
                }
                rays += 1;
                assert!(
                    is_blocked(eye, p, (near_plane.normal, near_plane.offset), &faces),
                    "seed {seed}, round {round}: {p} of {bounds:?} is seen from {eye} up {up:?}"
                );
            }
        }
    }
    [hidden, rays]
}

#[test]
fn what_a_horizon_hides_no_ray_reaches() {
    let [hidden, rays] = run(6_000, 1);
    judged(rays);
    told_enough(hidden > 8_000 && rays > 60_000, format_args!("{hidden} boxes, {rays} rays are no test"));
}
