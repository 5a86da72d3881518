//! Tests the cullers by blockers against rays: they must not hide an object that a ray sees, in worlds of
//! boxes that touch, overlap, share planes or are rotated.
//!
//! `cargo test --release -p visibility-region blockers -- --ignored` runs 100 times as many worlds.

use crate::common::PointShadows;
use visibility_core::geometry::Containment;
use visibility_core::glam::{Affine3A, DVec3, EulerRot, Quat, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Accuracy, Object, OccluderMesh, RegionCuller, Scene, VisibleSet};
use visibility_region::{ConvexBlockersCuller, SamplingCuller, ShrunkCuller, VolumetricCuller};
use visibility_testing::{Random, judged, told_enough};

/// Makes a world of boxes, with corners on a grid so that many touch or share planes. One in five is rotated,
/// one in five is glass. Adds thin walls and single two-sided triangles.
fn world(random: &mut Random, scale: f32) -> Scene {
    let mut scene = Scene::new();
    for _ in 0..60 {
        let grid = |random: &mut Random, most: i32| random.between(-most, most) as f32 * 0.5;
        let at = Vec3::new(grid(random, 24), grid(random, 24), grid(random, 6));
        let size = if random.one_in(3) {
            Vec3::new(
                grid(random, 3).abs() + 0.25,
                grid(random, 16).abs() + 1.0,
                grid(random, 12).abs() + 1.0,
            )
        } else {
            Vec3::new(1.0, 1.0, 1.0) * (0.5 + grid(random, 8).abs())
        };
        let local = Aabb::new(at * scale, (at + size) * scale);
        let is_occluder = !random.one_in(5);
        let id = scene.insert(Object { occluder: is_occluder, ..Object::new(local) });
        if random.one_in(8) {
            let [a, b, c] = [local.min, Vec3::new(local.max.x, local.min.y, local.max.z), local.max];
            let mesh = OccluderMesh::from_triangles(&[[a, b, c]]);
            let Ok(mesh) = mesh else { continue };
            let mesh = scene.add_mesh(mesh.with_two_sided(random.one_in(2)));
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
            continue;
        }
        // One box in four lacks a side, as houses may lack a bottom.
        let missing = random.below(24);
        let sides = OccluderMesh::CUBOID.iter().enumerate().filter(|(i, _)| i / 2 != missing);
        let corners = local.corners();
        let triangles: Vec<_> = sides.map(|(_, t)| t.map(|i| corners[i as usize])).collect();
        let mesh = scene.add_mesh(OccluderMesh::from_triangles(&triangles).unwrap());
        let mut transform = Affine3A::IDENTITY;
        if random.one_in(5) {
            let turn = Quat::from_euler(EulerRot::XYZ, random.unit() as f32, random.unit() as f32, 3.0);
            let mirror = Vec3::new(if random.one_in(2) { -1.0 } else { 1.0 }, 1.0, 1.5);
            transform = Affine3A::from_scale_rotation_translation(mirror, turn, Vec3::X * scale);
        }
        scene.set_local_bounds(id, local).unwrap();
        scene.set_mesh(id, mesh, transform).unwrap();
    }
    // Small targets, some of them flat against a wall.
    for _ in 0..120 {
        let at = Vec3::from_array(core::array::from_fn(|_| random.between(-28, 28) as f32 * 0.5));
        let size = if random.one_in(2) { Vec3::new(0.25, 0.25, 0.0) } else { Vec3::splat(0.3) };
        scene.insert(Aabb::new(at * scale, (at + size) * scale));
    }
    scene
}

/// Names of the cullers, in the order of `Verdict::hidden`.
const NAMES: [&str; 3] = ["convex blockers", "volumetric", "shrunk"];

#[derive(Default, Debug)]
struct Verdict {
    /// Number of objects seen by a ray.
    seen: usize,
    /// Number of objects hidden, for each culler.
    hidden: [usize; 3],
    /// Number of objects that are hidden although a ray sees them.
    lost: usize,
}

fn trials(worlds: u64, rays: usize, scale: f32) -> Verdict {
    let mut verdict = Verdict::default();
    let mut convex = ConvexBlockersCuller::new();
    let mut volumetric = VolumetricCuller::new();
    let mut shrunk = ShrunkCuller::new(PointShadows, 2);
    for seed in 0..worlds {
        let mut random = Random(seed);
        let scene = world(&mut random, scale);
        let at = random.vector(8.0) * DVec3::new(1.0, 1.0, 0.25);
        let size = DVec3::new(random.range(0.0, 2.0), random.range(0.1, 2.0), random.range(0.1, 1.0));
        let scale = f64::from(scale);
        let cell = Viewcell::from_box(at * scale, (at + size) * scale);
        let mut rays = SamplingCuller::new().with_rays(rays).with_seed(seed);
        rays.cull(&scene, &cell, &mut VisibleSet::new());
        verdict.seen += rays.sight_lines().len();
        let cullers: [&mut dyn RegionCuller; 3] = [&mut convex, &mut volumetric, &mut shrunk];
        for ((name, culler), hidden) in NAMES.into_iter().zip(cullers).zip(&mut verdict.hidden) {
            assert_eq!(culler.accuracy(), Accuracy::Conservative, "{name} is conservative");
            let mut visible = VisibleSet::new();
            let stats = culler.cull(&scene, &cell, &mut visible);
            *hidden += scene.len() - visible.count(&scene);
            assert_eq!(
                stats.visible as usize,
                visible.count(&scene),
                "{name}: objects counted and in the set"
            );
            for line in rays.sight_lines() {
                if !visible.contains(&scene, line.id) {
                    verdict.lost += 1;
                    eprintln!("seed {seed}: object {} is hidden, but seen by {line:?}", line.id);
                }
            }
        }
    }
    verdict
}

#[test]
fn nothing_that_a_ray_sees_is_hidden() {
    let verdict = trials(12, 6000, 1.0);
    judged(12 * 6000);
    assert_eq!(verdict.lost, 0, "{verdict:?}");
    told_enough(verdict.seen > 600, format_args!("{verdict:?}"));
    told_enough(
        verdict.hidden.iter().all(|&hidden| hidden > 120),
        format_args!("each hides something: {verdict:?}"),
    );
}

#[test]
fn scale_does_not_matter() {
    let of_size_1 = trials(3, 1000, 1.0);
    for scale in [1e-15, 1e-3, 1e6, 1e15] {
        let verdict = trials(3, 1000, scale);
        assert_eq!(verdict.lost, 0, "scale {scale}: objects hidden that are seen");
        // Not tested for the shrunk occluders, which have absolute margins.
        assert!(verdict.hidden[0].abs_diff(of_size_1.hidden[0]) < 20, "{scale}: {verdict:?} {of_size_1:?}");
    }
}

/// A house without a bottom hides objects behind it from a viewcell above the ground. It does not from a
/// viewcell below the ground, which looks in through the hole and out through the one-sided walls.
#[test]
fn open_houses_hide_from_above_the_ground() {
    let bounds = Aabb::from_arrays([4.0, -9.0, 0.0], [8.0, 9.0, 9.0]);
    let corners = bounds.corners();
    let open: Vec<_> = OccluderMesh::CUBOID
        .iter()
        .map(|t| t.map(|i| corners[i as usize]))
        .filter(|t| t.iter().any(|p| p.z > 0.0))
        .collect();
    let mut scene = Scene::new();
    let mesh = scene.add_mesh(OccluderMesh::from_triangles(&open).unwrap());
    let house = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    scene.set_mesh(house, mesh, Affine3A::IDENTITY).unwrap();
    let behind = scene.insert(Aabb::from_arrays([9.0, 0.0, 0.5], [9.5, 1.0, 1.0]));
    let above = scene.insert(Aabb::from_arrays([8.5, 0.0, 4.0], [9.0, 1.0, 5.0]));
    let cullers: [&mut dyn RegionCuller; 3] = [
        &mut ConvexBlockersCuller::new(),
        &mut VolumetricCuller::new(),
        &mut ShrunkCuller::new(PointShadows, 4),
    ];
    for (name, culler) in NAMES.into_iter().zip(cullers) {
        let mut visible = VisibleSet::new();
        let cell = Viewcell::from_box(DVec3::new(0.0, 0.0, 0.2), DVec3::new(1.0, 1.0, 1.0));
        culler.cull(&scene, &cell, &mut visible);
        assert!(
            !visible.contains(&scene, behind) && visible.contains(&scene, house),
            "{name}: from the ground, the house hides what is behind"
        );
        let cell = Viewcell::from_box(DVec3::new(5.0, 0.0, -3.0), DVec3::new(6.0, 1.0, -2.0));
        let mut visible = VisibleSet::new();
        culler.cull(&scene, &cell, &mut visible);
        assert!(
            visible.contains(&scene, behind) && visible.contains(&scene, above),
            "{name}: from below, the open house hides nothing"
        );
    }
}

/// A wall, with tiles in front of it, on it, flush with it, and behind it.
#[test]
fn what_shares_the_plane_of_a_blocker_is_seen() {
    let wall = Aabb::from_arrays([4.0, -9.0, -9.0], [8.0, 9.0, 9.0]);
    let mut scene = Scene::new();
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&wall).unwrap());
    let id = scene.insert(Object { occluder: true, ..Object::new(wall) });
    scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
    let tile = |x: [f32; 2]| Aabb::from_arrays([x[0], 0.0, 0.0], [x[1], 1.0, 1.0]);
    let seen = [[3.0, 3.5], [3.5, 4.0], [4.0, 4.0], [4.0, 4.5]].map(|x| scene.insert(tile(x)));
    let hidden = [[8.0, 8.5], [8.25, 9.0]].map(|x| scene.insert(tile(x)));
    let never = scene.insert(Object { never_cull: true, ..Object::new(tile([9.0, 9.5])) });
    let improper = scene.insert(Aabb::from_arrays([9.0, f32::NAN, 0.0], [9.5, 1.0, 1.0]));
    let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
    let cullers: [&mut dyn RegionCuller; 3] = [
        &mut ConvexBlockersCuller::new(),
        &mut VolumetricCuller::new(),
        &mut ShrunkCuller::new(PointShadows, 4),
    ];
    for (name, culler) in NAMES.into_iter().zip(cullers) {
        let mut visible = VisibleSet::new();
        culler.cull(&scene, &cell, &mut visible);
        assert!(
            seen.iter().chain([&id, &never, &improper]).all(|&id| visible.contains(&scene, id)),
            "{name}: what is before the wall, shares its plane, or is never culled"
        );
        assert!(hidden.iter().all(|&id| !visible.contains(&scene, id)), "{name}: what is behind the wall");
        // A viewcell inside the wall, one that partly overlaps it, and three with improper boxes.
        for (min, max) in [(5.0, 6.0), (0.0, 5.0), (1.0, 0.0), (f64::NAN, 1.0), (f64::NEG_INFINITY, 0.0)] {
            let cell = Viewcell::from_box(DVec3::splat(min), DVec3::splat(max));
            let mut visible = VisibleSet::new();
            culler.cull(&scene, &cell, &mut visible);
            assert_eq!(visible.count(&scene), scene.len(), "{min} {max}");
        }
        // Once it is no occluder, the wall hides nothing.
        let mut open = scene.clone();
        open.set_occluder(id, false).unwrap();
        let mut visible = VisibleSet::new();
        culler.cull(&open, &cell, &mut visible);
        assert_eq!(
            visible.count(&open),
            open.len(),
            "{name}: objects visible after the wall stopped occluding"
        );
        culler.cull(&Scene::new(), &cell, &mut VisibleSet::new());
    }
    assert_eq!(wall.classify_aabb(&tile([5.0, 6.0])), Containment::Inside, "the tile is within the wall");
}

/// A viewcell that is a point, and an object at that point, nearer than the views from the point begin.
#[test]
fn what_touches_the_cell_is_seen_however_small() {
    let mut scene = Scene::new();
    let dust = scene.insert(Aabb::new(Vec3::ZERO, Vec3::ZERO));
    let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ZERO);
    let cullers: [&mut dyn RegionCuller; 3] = [
        &mut ConvexBlockersCuller::new(),
        &mut VolumetricCuller::new(),
        &mut ShrunkCuller::new(PointShadows, 2),
    ];
    for (name, culler) in NAMES.into_iter().zip(cullers) {
        let mut visible = VisibleSet::new();
        culler.cull(&scene, &cell, &mut visible);
        assert!(visible.contains(&scene, dust), "{name}: a point in the cell");
    }
}
