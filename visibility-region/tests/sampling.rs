//! Tests of the sampling culler: rays do not leave a closed room, however its walls are cut into triangles,
//! and find objects that are visible through narrow gaps.

use visibility_core::glam::{Affine3A, DVec3, Quat, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::scene::Triangle;
use visibility_core::{Aabb, Accuracy, Object, ObjectId, OccluderMesh, RegionCuller, Scene, VisibleSet};
use visibility_region::SamplingCuller;
use visibility_testing::Random;

/// Cuts a rectangle, given by a corner and two sides, into random triangles, with vertices on the edges of
/// other triangles.
fn cut(at: Vec3, u: Vec3, v: Vec3, depth: usize, random: &mut Random, out: &mut Vec<Triangle>) {
    if depth == 0 {
        out.extend([[at, at + u, at + u + v], [at, at + u + v, at + v]]);
        return;
    }
    // Eighths are exact in `f32` for the sizes used here, so that all vertices are on the rectangle.
    let part = random.between(1, 7) as f32 / 8.0;
    if random.one_in(2) {
        cut(at, u * part, v, depth - 1, random, out);
        cut(at + u * part, u * (1.0 - part), v, depth - 1, random, out);
    } else {
        cut(at, u, v * part, depth - 1, random, out);
        cut(at + v * part, u, v * (1.0 - part), depth - 1, random, out);
    }
}

fn walls(half: f32, depth: usize, random: &mut Random) -> [Vec<Triangle>; 6] {
    core::array::from_fn(|side| {
        let axis = side % 3;
        let mut at = Vec3::splat(-half);
        at[axis] = if side < 3 { half } else { -half };
        let [u, v] = [1, 2].map(|i| Vec3::AXES[(axis + i) % 3] * (2.0 * half));
        let mut triangles = Vec::new();
        cut(at, u, v, depth, random, &mut triangles);
        triangles
    })
}

fn insert(scene: &mut Scene, triangles: Vec<Triangle>, occluder: bool) -> ObjectId {
    let bounds = Aabb::from_points(triangles.iter().flatten().copied());
    let id = scene.insert(Object { occluder, ..Object::new(bounds) });
    scene.set_triangles(id, triangles).unwrap();
    id
}

#[test]
fn no_ray_leaves_a_closed_room() {
    let mut sent = 0;
    for seed in 0..12 {
        let mut random = Random(seed);
        let mut scene = Scene::new();
        // Each wall is an object, or each triangle is: joints between objects must not leak either.
        for wall in walls(8.0, 5, &mut random) {
            match seed % 2 {
                0 => {
                    insert(&mut scene, wall, true);
                }
                _ => wall.into_iter().for_each(|triangle| {
                    insert(&mut scene, vec![triangle], true);
                }),
            }
        }
        let inside = scene.len();
        let outside: Vec<ObjectId> =
            walls(9.0, 0, &mut random).into_iter().map(|wall| insert(&mut scene, wall, false)).collect();
        let cell = Viewcell::from_box(DVec3::new(-3.0, -1.0, -8.0), DVec3::new(2.0, 3.0, 1.0));
        let mut culler = SamplingCuller::new().with_rays(20_000).with_seed(seed);
        let mut visible = VisibleSet::new();
        sent += culler.cull(&scene, &cell, &mut visible).tests - scene.len() as u64;
        assert!(outside.iter().all(|&id| !visible.contains(&scene, id)), "seed {seed}");
        assert!(
            visible.count(&scene) > inside * 9 / 10,
            "seed {seed}: {} of {inside} objects of the room are seen",
            visible.count(&scene)
        );
    }
    assert_eq!(sent, 240_000, "what is outside stays missing");
}

#[test]
fn narrow_gaps_are_found() {
    // Gaps that are as deep as they are wide.
    for (width, rays) in [(0.1, 2_000), (1e-2, 20_000), (1e-3, 200_000)] {
        let mut scene = Scene::new();
        let wall = |min: [f32; 3], max: [f32; 3]| {
            let bounds = Aabb::from_arrays(min, max);
            (bounds, OccluderMesh::cuboid(&bounds).unwrap())
        };
        for (bounds, mesh) in [
            wall([5.0, -50.0, -50.0], [5.0 + width, 1.0, 50.0]),
            wall([5.0, 1.0 + width, -50.0], [5.0 + width, 50.0, 50.0]),
        ] {
            let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
            let mesh = scene.add_mesh(mesh);
            scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        }
        let behind = scene.insert(Aabb::from_arrays([9.0, 0.5, 0.0], [9.5, 1.5, 0.5]));
        let hidden = scene.insert(Aabb::from_arrays([9.0, 20.5, 0.0], [9.5, 21.5, 0.5]));
        let cell = Viewcell::from_box(DVec3::ZERO, DVec3::new(1.0, 2.0, 1.0));
        let mut visible = VisibleSet::new();
        SamplingCuller::new().with_rays(rays).cull(&scene, &cell, &mut visible);
        assert!(visible.contains(&scene, behind), "a gap of {width} m");
        assert!(!visible.contains(&scene, hidden), "a gap of {width} m shows what is elsewhere");
    }
}

/// Lines of sight are checked without the crate's code, in `f64` with margins far above its rounding: no
/// occluder is met clearly before the seen point, and the point is on the object.
#[test]
fn sight_lines_are_unobstructed() {
    let mut checked = 0;
    for seed in 0..40 {
        let mut random = Random(seed);
        let mut scene = Scene::new();
        let mut boxes = Vec::new();
        for _ in 0..40 {
            let (center, half) = (random.vec3(-9.0, 9.0), random.vec3(0.1, 2.0));
            let local = Aabb::new(-half, half);
            let id = scene.insert(Object { occluder: !random.one_in(4), ..Object::new(local) });
            scene.set_local_bounds(id, local).unwrap();
            let mesh = scene.add_mesh(OccluderMesh::cuboid(&local).unwrap());
            let turn = Quat::from_axis_angle(random.direction().as_vec3().normalize(), 1.0);
            let transform = Affine3A::from_rotation_translation(turn, center);
            scene.set_mesh(id, mesh, transform).unwrap();
            boxes.push((id, half.as_dvec3(), transform));
        }
        let cell = Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5));
        let mut culler = SamplingCuller::new().with_rays(3000).with_seed(seed);
        culler.cull(&scene, &cell, &mut VisibleSet::new());
        for line in culler.sight_lines() {
            checked += 1;
            assert!(cell.contains(line.eye), "{line:?} begins in the cell");
            for (id, half, transform) in &boxes {
                let local = |p: DVec3| {
                    let turn =
                        transform.matrix3.to_cols_array_2d().map(|c| DVec3::from_array(c.map(f64::from)));
                    let p = p - DVec3::from_array(transform.translation.to_array().map(f64::from));
                    DVec3::new(turn[0].dot(p), turn[1].dot(p), turn[2].dot(p))
                };
                let (eye, point) = (local(line.eye), local(line.point));
                if *id == line.id {
                    let off = (point.abs() - *half).max_element();
                    // An object without an occluder's mesh is represented by its bounds, which contain the
                    // rotated box.
                    assert!(off.abs() < 5e-2 || !scene.object(*id).unwrap().occluder, "{off}");
                } else if scene.object(*id).unwrap().occluder {
                    let depth = |i| (eye.lerp(point, f64::from(i) / 2000.0).abs() - *half).max_element();
                    let (inside, outside) =
                        ((0..2000).any(|i| depth(i) < -1e-4), (0..2000).any(|i| depth(i) > 1e-4));
                    assert!(!(inside && outside), "seed {seed}: {line:?} passes {id}");
                }
            }
        }
    }
    assert!(checked > 300, "{checked}");
}

/// A one-sided wall stops rays at the side that its transform makes the front.
#[test]
fn fronts_follow_transforms() {
    // The front faces along +x, away from the viewcell; only a mirroring transform turns it to the viewcell.
    for (scale, blocks, is_seen) in [
        ([1.0, 1.0, 1.0], false, false),
        ([-1.0, 1.0, 1.0], true, true),
        // Flattened along an axis, it has no certain front.
        ([0.0, 1.0, 1.0], false, true),
    ] {
        let mut scene = Scene::new();
        let corners = [[0.0, -9.0, -9.0], [0.0, 9.0, -9.0], [0.0, 0.0, 9.0]].map(Vec3::from_array);
        let bounds = Aabb::from_arrays([5.0, -9.0, -9.0], [5.0, 9.0, 9.0]);
        let wall = scene.insert(Object { occluder: true, one_sided: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(OccluderMesh::from_indexed(&corners, &[[0, 1, 2]]).unwrap());
        let transform =
            Affine3A::from_scale_rotation_translation(Vec3::from_array(scale), Quat::IDENTITY, Vec3::X * 5.0);
        scene.set_mesh(wall, mesh, transform).unwrap();
        let behind = scene.insert(Aabb::from_arrays([8.0, 0.0, 0.0], [8.5, 0.5, 0.5]));
        let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
        let mut visible = VisibleSet::new();
        SamplingCuller::new().with_rays(4000).cull(&scene, &cell, &mut visible);
        assert_eq!(visible.contains(&scene, behind), !blocks, "what is behind a wall of scale {scale:?}");
        assert_eq!(visible.contains(&scene, wall), is_seen, "the wall of scale {scale:?}");
    }
}

#[test]
fn what_is_no_occluder_is_seen_and_seen_through() {
    let mut scene = Scene::new();
    let pane = |x: f32| {
        let p = |y: f32, z: f32| Vec3::new(x, y, z);
        vec![[p(-9.0, -9.0), p(9.0, -9.0), p(0.0, 20.0)]]
    };
    let glass = insert(&mut scene, pane(3.0), false);
    let wall = insert(&mut scene, pane(4.0), true);
    // Objects that consist of bounds only: one in front of the wall, one with infinite bounds, one behind the
    // wall.
    let box_ = scene.insert(Object { occluder: true, ..Object::new(Aabb::from_arrays([3.2; 3], [3.4; 3])) });
    let endless = scene.insert(Aabb::from_arrays([0.0; 3], [f32::INFINITY; 3]));
    let lost = insert(&mut scene, vec![[Vec3::NAN; 3]], true);
    let behind = scene.insert(Aabb::from_arrays([6.0, 0.0, 0.0], [6.5, 0.5, 0.5]));
    let mut culler = SamplingCuller::new();
    assert_eq!(culler.accuracy(), Accuracy::Aggressive, "sampling is aggressive");
    let cell = Viewcell::from_box(DVec3::ZERO, DVec3::ONE);
    let mut visible = VisibleSet::new();
    culler.cull(&scene, &cell, &mut visible);
    for (id, is_seen) in
        [(glass, true), (wall, true), (box_, true), (endless, true), (behind, false), (lost, true)]
    {
        assert_eq!(visible.contains(&scene, id), is_seen, "{id}");
    }
    // Once the wall is no occluder, the tree of triangles is rebuilt.
    scene.set_occluder(wall, false).unwrap();
    let mut visible = VisibleSet::new();
    culler.cull(&scene, &cell, &mut visible);
    assert!(visible.contains(&scene, behind), "the wall stopped occluding");
    // The tree is rebuilt for a clone that was changed, and again for the first scene.
    let mut clone = scene.clone();
    clone.set_occluder(wall, true).unwrap();
    let hides = |culler: &mut SamplingCuller, scene: &Scene| {
        let mut visible = VisibleSet::new();
        culler.cull(scene, &cell, &mut visible);
        !visible.contains(scene, behind)
    };
    assert!(
        hides(&mut culler, &clone) && !hides(&mut culler, &scene) && hides(&mut culler, &clone),
        "the wall occludes in the clone alone"
    );
}

#[test]
fn no_input_panics() {
    let mut random = Random(5);
    let mut culler = SamplingCuller::new().with_rays(200);
    for _ in 0..300 {
        let mut scene = Scene::new();
        let odd = |random: &mut Random| match random.below(4) {
            0 => random.bits32(),
            1 => 0.0,
            2 => f32::MAX,
            _ => random.range(-5.0, 5.0) as f32,
        };
        for _ in 0..random.below(12) {
            let triangle = [(); 3].map(|()| Vec3::new(odd(&mut random), odd(&mut random), odd(&mut random)));
            let occluder = random.one_in(2);
            insert(&mut scene, vec![triangle], occluder);
        }
        let mut corner = || {
            DVec3::from_array(core::array::from_fn(|_| match random.below(5) {
                0 => random.bits64(),
                1 => f64::INFINITY,
                _ => random.range(-3.0, 3.0),
            }))
        };
        let cell = Viewcell::from_box(corner(), corner());
        culler.cull(&scene, &cell, &mut VisibleSet::new());
    }
    culler.with_rays(0).cull(
        &Scene::new(),
        &Viewcell::from_box(DVec3::ZERO, DVec3::ZERO),
        &mut VisibleSet::new(),
    );
}

#[test]
fn rays_pass_backs_of_one_sided_walls() {
    let mut random = Random(3);
    for depth in [0, 4] {
        let square = |x: f32, r: f32, depth: usize, random: &mut Random| {
            let mut triangles = Vec::new();
            let (u, v) = (Vec3::Y * (2.0 * r), Vec3::Z * (2.0 * r));
            cut(Vec3::new(x, -r, -r), u, v, depth, random, &mut triangles);
            triangles
        };
        // The fronts of the triangles look along x, away from the first viewcell and towards the second.
        for (one_sided, x, seen) in [
            (false, 0.0, [true, false]),
            (true, 0.0, [false, true]),
            (false, 9.0, [true, true]),
            (true, 9.0, [true, true]),
        ] {
            let mut scene = Scene::new();
            let wall = insert(&mut scene, square(4.0, 8.0, depth, &mut random), true);
            let behind = insert(&mut scene, square(6.0, 1.0, 0, &mut random), true);
            scene.set_one_sided(wall, one_sided).unwrap();
            let mut visible = VisibleSet::new();
            let cell = Viewcell::from_box(DVec3::new(x, -0.5, -0.5), DVec3::new(x + 1.0, 0.5, 0.5));
            SamplingCuller::new().with_rays(20_000).cull(&scene, &cell, &mut visible);
            let found = [wall, behind].map(|id| visible.contains(&scene, id));
            assert_eq!(found, seen, "one-sided: {one_sided}, from x = {x}, {depth}");
        }
    }
}
