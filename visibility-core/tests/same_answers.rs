//! Tests that the same clip matrix gives the same result with all SIMD instruction sets and on all platforms,
//! and that results depend only on relative positions, not on the origin of the world.

use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, FrustumCuller, ObjectId, Pipeline, Pose, Scene, View, VisibleSet, simd::Simd, view::Depth,
};
use visibility_testing::cameras::{Camera, box_behind, clip_planes, power_of_two, random_camera};
use visibility_testing::{FNV_START, Random, fnv};

/// Clip matrices as an engine would pass them, column-major, with their depth conventions. Literal, since
/// trigonometric functions differ between platforms.
const MATRICES: [([f32; 16], Depth); 3] = [
    // Perspective from (3, -4, 2), rotated about all axes, with reversed infinite depth.
    (
        [
            0.8137977,
            -0.4698463,
            0.0,
            0.34202015,
            0.4698463,
            0.54404026,
            0.0,
            0.8137977,
            -0.2961981,
            1.3612,
            0.0,
            -0.46984634,
            0.03,
            0.86,
            0.1,
            3.1688,
        ],
        Depth::ReversedInfinite,
    ),
    // Orthographic, with the depth of OpenGL.
    (
        [
            0.011, 0.002, -0.0013, 0.0, -0.0021, 0.0107, 0.0007, 0.0, 0.0009, -0.0011, 0.0024, 0.0, 0.125,
            -0.25, 0.0625, 1.0,
        ],
        Depth::NegativeOneToOne,
    ),
    // Perspective, off-centre, with the depth of Direct3D.
    (
        [1.3, 0.05, 0.12, 0.12, -0.4, 0.9, 0.97, 0.97, -0.03, 1.7, -0.25, -0.25, 12.0, -7.5, 38.5, 39.0],
        Depth::ZeroToOne,
    ),
];

fn cull_with(simd: Simd, scene: &Scene, view: &View) -> VisibleSet {
    let mut visible = VisibleSet::new();
    let stats = Pipeline::new().with(FrustumCuller::new().with_simd(simd)).cull(scene, view, &mut visible);
    assert_eq!(stats.visible, visible.count(scene) as u64, "{simd:?}: objects counted and in the set");
    visible
}

/// Returns a random box. `kind` selects: evenly spread, of all scales, of arbitrary bits, flat or degenerate.
fn random_box(rng: &mut Random, kind: usize) -> Aabb {
    match kind {
        0 => {
            let min: [f32; 3] = core::array::from_fn(|_| (rng.unit() as f32 - 0.5) * 512.0);
            Aabb::from_arrays(min, min.map(|x| x + rng.unit() as f32 * 4.0))
        }
        1 => {
            let size = power_of_two(rng.between(-60, 60)) as f32;
            let min: [f32; 3] = core::array::from_fn(|_| (rng.unit() as f32 - 0.5) * size);
            Aabb::from_arrays(min, min.map(|x| x + rng.unit() as f32 * size))
        }
        2 => {
            let (a, b): ([f32; 3], [f32; 3]) =
                (core::array::from_fn(|_| rng.bits32()), core::array::from_fn(|_| rng.bits32()));
            if rng.one_in(8) {
                return Aabb::from_arrays(a, b);
            }
            // Mostly with min <= max, because the kernel never tests inverted boxes.
            Aabb::from_arrays(
                core::array::from_fn(|i| a[i].min(b[i])),
                core::array::from_fn(|i| a[i].max(b[i])),
            )
        }
        _ => {
            let min: [f32; 3] = core::array::from_fn(|_| (rng.unit() as f32 - 0.5) * 64.0);
            let flat = rng.below(4);
            Aabb::from_arrays(
                min,
                core::array::from_fn(|i| {
                    min[i] + if i == flat || flat == 3 { 0.0 } else { rng.unit() as f32 }
                }),
            )
        }
    }
}

fn all_ids(visible: &VisibleSet, scene: &Scene) -> Vec<ObjectId> {
    visible.iter(scene).collect()
}

#[test]
fn all_instruction_sets_give_the_same_set_on_a_million_boxes() {
    let mut rng = Random(1);
    let paths: Vec<Simd> = Simd::available().collect();
    println!("paths: {paths:?}");
    let mut decided = 0;
    for kind in 0..4 {
        let mut scene = Scene::new();
        scene.insert_batch((0..250_000).map(|number| {
            let (matrix, depth) = MATRICES[number / 4 % 3];
            let camera = Camera::new(matrix.map(f64::from), depth);
            if number % 4 == 0 { box_at_the_limit(&mut rng, &camera) } else { random_box(&mut rng, kind) }
        }));
        let mut views: Vec<View> = MATRICES
            .iter()
            .map(|&(matrix, depth)| View::from_clip_from_world(matrix, depth).unwrap())
            .collect();
        while views.len() < 8 {
            let exponents = [rng.between(-2, 8); 3];
            let (camera, _) = random_camera(&mut rng, exponents);
            views.extend(View::from_clip_from_world(camera.matrix, camera.depth));
        }
        for view in &views {
            let expected = all_ids(&cull_with(Simd::PORTABLE, &scene, view), &scene);
            decided += usize::from(!expected.is_empty() && expected.len() < scene.len());
            for &simd in &paths {
                let found = all_ids(&cull_with(simd, &scene, view), &scene);
                assert!(found == expected, "{simd:?} differs, boxes of kind {kind}, {view:?}");
            }
        }
    }
    assert!(decided >= 24, "too easy: {decided}");
}

/// Returns a box whose deciding corner is outside of a plane of the camera by about the rounding error of
/// `f32`, so that the last bit of the kernel's arithmetic decides whether the box is hidden.
fn box_at_the_limit(rng: &mut Random, camera: &Camera) -> Aabb {
    let plane = rng.pick(&[0, 1, 2, 3, 4]);
    let (n, d) = camera.coefficients(&clip_planes(camera.depth)[plane]);
    let mut p = rng.vector(64.0).as_vec3();
    let q = p.as_dvec3();
    let axis = (0..3).max_by(|&a, &b| n[a].abs().total_cmp(&n[b].abs())).unwrap();
    let others: f64 = (0..3).filter(|&i| i != axis).map(|i| n[i] * q[i]).sum();
    let size: f64 = (0..3).filter(|&i| i != axis).map(|i| (n[i] * q[i]).abs()).sum();
    let out = rng.unit() * power_of_two(-19) * (size + d.abs());
    p[axis] = (-(others + d + out) / n[axis]) as f32;
    box_behind(rng, p.to_array(), n, [1; 3])
}

#[test]
fn the_answers_are_those_of_every_other_platform() {
    // Boxes are made from integers, by operations that IEEE 754 fixes to the last bit.
    let mut rng = Random(2024);
    let mut hash = FNV_START;
    for (matrix, depth) in MATRICES {
        let camera = Camera::new(matrix.map(f64::from), depth);
        let boxes = (0..20_000).map(|number| match number % 8 {
            kind @ 0..4 => random_box(&mut rng, kind),
            _ => box_at_the_limit(&mut rng, &camera),
        });
        let mut scene = Scene::new();
        let ids = scene.insert_batch(boxes);
        let view = View::from_clip_from_world(matrix, depth).unwrap();
        let mut visible = VisibleSet::new();
        Pipeline::new().with(FrustumCuller::new()).cull(&scene, &view, &mut visible);
        // Membership by id, which does not depend on the order of the hierarchy, is hashed first.
        let answers: Vec<u8> = ids.iter().map(|&id| visible.contains(&scene, id).into()).collect();
        hash = fnv(hash, &answers);
        // The ids in drawing order, which does depend on the hierarchy, are hashed next.
        for id in visible.iter(&scene) {
            hash = fnv(hash, &(id.index() as u32).to_le_bytes());
        }
    }
    assert_eq!(
        hash, 0xe939_10dd_3e5b_eb90,
        "results changed on this platform: the answers are not those that were pinned on others, so that what a player sees \
         depends on the machine. If the order of the hierarchy or the margin was changed on purpose, pin the new hash."
    );
}

/// Spacing of test coordinates in metres, 2^-20: coordinates up to 10^7 m on this grid have exact differences
/// in `f64`.
const GRID: f64 = 1.0 / 1048576.0;

#[test]
fn moving_the_world_changes_no_answer() {
    let mut rng = Random(4);
    let mut scene = Scene::new();
    scene.insert_batch((0..20_000).map(|_| random_box(&mut rng, 0)));
    let on_grid = |v: DVec3| (v / GRID).round() * GRID;
    for _ in 0..60 {
        let (scene_origin, eye) = (on_grid(rng.vector(100.0)), on_grid(rng.vector(200.0)));
        let pose = Pose::look_at(DVec3::ZERO, rng.vector(1.0), DVec3::Z);
        let view = View::perspective(pose, 1.1, 1.6, 0.1, f64::INFINITY).unwrap();
        let answer = |scene: &mut Scene, shift: DVec3| {
            scene.set_origin(scene_origin + shift).unwrap();
            let view = view.relative_to(eye + shift).unwrap();
            let mut visible = VisibleSet::new();
            let stats = Pipeline::new().with(FrustumCuller::new()).cull(scene, &view, &mut visible);
            (all_ids(&visible, scene), stats)
        };
        let expected = answer(&mut scene, DVec3::ZERO);
        for magnitude in [1.0, 1e3, 1e5, 1e6, 1e7] {
            let shift = on_grid(rng.vector(magnitude));
            assert!(answer(&mut scene, shift) == expected, "moved by {shift}, as seen from {eye}");
        }
    }
}

#[test]
fn objects_a_few_metres_from_a_far_eye_are_visible() {
    let mut rng = Random(6);
    for distance in [0.0, 1e4, 1e6, 1e7, 1e9, 1e12] {
        for _ in 0..200 {
            let eye = rng.vector(1.0).normalize() * distance;
            let forward = rng.vector(1.0).normalize();
            let pose = Pose::look_at(eye, eye + forward * (distance + 1.0), DVec3::Z);
            // The scene's origin is within a few kilometres of the eye, as `f32` bounds require.
            let mut scene = Scene::new();
            scene.set_origin(eye + rng.vector(3000.0)).unwrap();
            let target = eye + pose.forward * rng.range(2.0, 9.0);
            let at = |p: DVec3| Aabb::from_world(p - 0.125, p + 0.125, scene.origin());
            let (ahead, behind) = (at(target), at(eye - (target - eye)));
            let [ahead, behind] = [ahead, behind].map(|bounds| scene.insert(bounds));
            let view = View::perspective(pose, 0.8, 1.5, 0.5, f64::INFINITY).unwrap();
            let visible = cull_with(Simd::best(), &scene, &view);
            assert!(visible.contains(&scene, ahead), "{target} is ahead of {eye}");
            // At 10^12 m an `f64` coordinate is still precise to a tenth of a millimetre.
            assert!(!visible.contains(&scene, behind), "{target} mirrored is behind {eye}");
        }
    }
}
