//! Contract tests of the frustum culler, at any magnitude of coordinates and in any depth convention: no box
//! that touches the view is hidden, and a box clear of the view by more than the rounding error is hidden.

use proptest::prelude::{ProptestConfig, any};
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};
use visibility_core::glam::{DMat4, DQuat, DVec3};
use visibility_core::{Aabb, FrustumCuller, ObjectId, Pipeline, Scene, View, VisibleSet};
use visibility_testing::cameras::{
    Camera, DEPTHS, aimed_point, box_behind, clip_planes, power_of_two, projection, random_camera,
    random_projection,
};
use visibility_testing::{Random, judged, told_enough};

fn cull(scene: &Scene, view: &View) -> VisibleSet {
    let mut visible = VisibleSet::new();
    Pipeline::new().with(FrustumCuller::new()).cull(scene, view, &mut visible);
    visible
}

/// Returns the view of a test camera, or `None` if its matrix is singular or overflows in `f32`.
fn view_of(camera: &Camera) -> Option<View> {
    View::from_clip_from_world(camera.matrix, camera.depth).ok()?.relative_to(camera.origin).ok()
}

fn scene_of(camera: &Camera, boxes: &[Aabb]) -> (Scene, Vec<ObjectId>) {
    let mut scene = Scene::new();
    scene.set_origin(camera.scene_origin).unwrap();
    let ids = scene.insert_batch(boxes.iter().copied());
    (scene, ids)
}

/// Culls boxes near the boundary of the view and asserts that none that exactly touches the view is hidden.
/// Returns the number of boxes that touch the view and the number of boxes hidden.
fn check_boxes(
    rng: &mut Random,
    camera: &Camera,
    boxes: &[Aabb],
    inner: &[(usize, DVec3)],
) -> (usize, usize) {
    let Some(view) = view_of(camera) else { return (0, 0) };
    let (scene, ids) = scene_of(camera, boxes);
    let visible = cull(&scene, &view);
    let (mut touching, mut hidden) = (0, 0);
    for (bounds, &id) in boxes.iter().zip(&ids) {
        let is_visible = visible.contains(&scene, id);
        hidden += usize::from(!is_visible);
        if camera.sees_a_corner(bounds) {
            touching += 1;
            assert!(is_visible, "{bounds:?} has a corner in view of {camera:?} and is hidden; {}", rng.0);
        }
    }
    for &(number, p) in inner {
        if camera.sees(p) {
            let bounds = &boxes[number];
            assert!(visible.contains(&scene, ids[number]), "{bounds:?} holds {p}, in view of {camera:?}");
        }
    }
    (touching, hidden)
}

/// Checks boxes that touch planes of the view with a corner, and boxes around points near those planes.
/// Returns the number of boxes that touch the view and the number of boxes hidden.
fn check_camera(rng: &mut Random, camera: &Camera, base: &DMat4, exponents: [i32; 3]) -> (usize, usize) {
    let (mut boxes, mut inner) = (Vec::new(), Vec::new());
    for _ in 0..96 {
        let Some((p, n, _)) = aimed_point(rng, camera, base, exponents) else { continue };
        if rng.one_in(8) {
            // The point is in view, but perhaps no corner of the box is.
            let size: [f32; 3] = exponents.map(|e| power_of_two((e + rng.between(-5, 9)).min(126)) as f32);
            let min: [f32; 3] = core::array::from_fn(|i| p[i] - size[i] * rng.unit() as f32);
            let bounds = Aabb::from_arrays(min, core::array::from_fn(|i| p[i] + size[i] * rng.unit() as f32));
            if bounds.is_finite() {
                inner.push((boxes.len(), DVec3::from_array(p.map(f64::from))));
                boxes.push(bounds);
            }
        } else {
            boxes.push(box_behind(rng, p, n, exponents));
        }
    }
    check_boxes(rng, camera, &boxes, &inner)
}

/// Checks `cases` random cameras, the same ones in each run, and asserts that enough boxes touched the view
/// and enough were hidden.
fn check_cameras(
    cases: u32,
    exponents: impl Fn(&mut Random) -> [i32; 3],
    prepare: impl Fn(&mut Random, &mut Camera),
) {
    let sums = std::cell::Cell::new((0, 0));
    let config =
        ProptestConfig { cases, failure_persistence: None, max_shrink_iters: 0, ..Default::default() };
    let always_the_same = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let outcome = TestRunner::new_with_rng(config, always_the_same).run(&any::<u64>(), |seed| {
        let mut rng = Random(seed);
        let exponents = exponents(&mut rng);
        let (mut camera, base) = random_camera(&mut rng, exponents);
        prepare(&mut rng, &mut camera);
        let (touching, hidden) = check_camera(&mut rng, &camera, &base, exponents);
        sums.set((sums.get().0 + touching, sums.get().1 + hidden));
        Ok(())
    });
    outcome.unwrap();
    let (touching, hidden) = sums.get();
    judged((touching + hidden) as u64);
    told_enough(
        touching > 10 * cases as usize && hidden > cases as usize / 4,
        format_args!("too easy: {touching} {hidden}"),
    );
}

#[test]
fn what_touches_the_view_is_visible_at_every_scale() {
    check_cameras(600, |rng| [rng.between(-100, 100); 3], |_, _| {});
}

#[test]
fn what_touches_the_view_is_visible_at_human_scale() {
    check_cameras(600, |rng| [rng.between(-4, 10); 3], |_, _| {});
}

#[test]
fn what_touches_the_view_is_visible_with_another_scale_on_each_axis() {
    check_cameras(600, |rng| core::array::from_fn(|_| rng.between(-100, 100)), |_, _| {});
}

/// Tests coordinates, normals and products below the smallest normal number of `f32`.
#[test]
fn what_touches_the_view_is_visible_where_numbers_are_denormal() {
    check_cameras(600, |rng| core::array::from_fn(|_| rng.between(-148, -100)), |_, _| {});
    check_cameras(600, |rng| [rng.between(-148, -120); 3], |_, _| {});
}

#[test]
fn what_touches_the_view_is_visible_where_numbers_are_huge() {
    check_cameras(300, |rng| core::array::from_fn(|_| rng.between(100, 119)), |_, _| {});
}

/// Tests scenes and cameras with far-away origins, whose difference may round in `f64`.
#[test]
fn what_touches_the_view_is_visible_far_from_the_origin_of_the_world() {
    check_cameras(
        600,
        |rng| [rng.between(-4, 10); 3],
        |rng, camera| {
            let (far, near) = (power_of_two(rng.between(0, 45)), power_of_two(rng.between(-10, 20)));
            camera.scene_origin = rng.vector(far);
            camera.origin = camera.scene_origin + rng.vector(near);
        },
    );
}

/// Returns a camera, and its projection without rotation, whose eye is at the origin of the scene but far
/// from the origin of its matrix: the large terms cancel, and their rounding errors remain. Matrix elements
/// are rounded to multiples of `unit`.
fn cancelling_camera(rng: &mut Random, distance: f64, unit: f64) -> (Camera, DMat4) {
    let depth = rng.pick(&DEPTHS);
    let (turn, eye) = (rng.vector(3.0), rng.vector(distance));
    let base = projection(depth, [-0.7, 0.9, -1.1, 0.8], power_of_two(-8), power_of_two(8), false)
        * DMat4::from_quat(DQuat::from_scaled_axis(turn))
        * DMat4::from_translation(eye);
    let matrix = base.to_cols_array().map(|x| (x / unit).round() * unit);
    (Camera { origin: eye, ..Camera::new(matrix, depth) }, DMat4::from_cols_array(&matrix))
}

fn boxes_near_planes(rng: &mut Random, camera: &Camera, base: &DMat4, exponents: [i32; 3]) -> Vec<Aabb> {
    let mut boxes = Vec::new();
    for _ in 0..64 {
        if let Some((p, n, _)) = aimed_point(rng, camera, base, exponents) {
            boxes.push(box_behind(rng, p, n, exponents));
        }
    }
    boxes
}

#[test]
fn what_touches_the_view_is_visible_where_origins_cancel() {
    let mut rng = Random(5);
    let mut touching = 0;
    for _ in 0..400 {
        let distance = power_of_two(rng.between(10, 32));
        let (camera, base) = cancelling_camera(&mut rng, distance, power_of_two(-60));
        let exponents = [rng.between(-8, 4); 3];
        let boxes = boxes_near_planes(&mut rng, &camera, &base, exponents);
        touching += check_boxes(&mut rng, &camera, &boxes, &[]).0;
    }
    judged(touching as u64);
    told_enough(touching > 1000, format_args!("too easy: {touching}"));
}

/// Tests that scaling a clip matrix by a power of two does not change which boxes are hidden, even if
/// products of elements underflow in `f64`.
#[test]
fn clip_matrices_of_any_magnitude_show_the_same() {
    let mut rng = Random(7);
    let mut touching = 0;
    for _ in 0..300 {
        // Elements have few bits, so that none is lost at the lower end of the range of `f64`.
        let (camera, base) = cancelling_camera(&mut rng, 4.0, power_of_two(-16));
        let exponents = [rng.between(-8, 4); 3];
        let boxes = boxes_near_planes(&mut rng, &camera, &base, exponents);
        let in_view: Vec<bool> = boxes.iter().map(|bounds| camera.sees_a_corner(bounds)).collect();
        let (scene, ids) = scene_of(&camera, &boxes);
        for exponent in [-1050, -1030, -1000, -500, 0, 500, 900] {
            // The power is applied in two steps, since it may itself be outside the range of `f64`.
            let half = power_of_two(exponent / 2);
            let scaled = Camera { matrix: camera.matrix.map(|x| x * half * half), ..camera.clone() };
            let Some(view) = view_of(&scaled) else { continue };
            let visible = cull(&scene, &view);
            for ((bounds, &id), &in_view) in boxes.iter().zip(&ids).zip(&in_view) {
                touching += usize::from(in_view);
                let shown = visible.contains(&scene, id);
                assert!(
                    shown || !in_view,
                    "{bounds:?} has a corner in view of {camera:?} times 2^{exponent}"
                );
            }
        }
    }
    judged(touching as u64);
    told_enough(touching > 10_000, format_args!("too easy: {touching}"));
}

#[test]
fn boxes_that_bound_nothing_are_always_visible() {
    let mut rng = Random(3);
    let (inf, nan) = (f32::INFINITY, f32::NAN);
    let mut boxes = vec![
        Aabb::EMPTY,
        Aabb::from_arrays([nan; 3], [nan; 3]),
        Aabb::from_arrays([-inf; 3], [inf; 3]),
        Aabb::from_arrays([inf; 3], [inf; 3]),
        Aabb::from_arrays([-inf; 3], [-inf; 3]),
    ];
    for axis in 0..3 {
        for bad in [nan, inf, -inf] {
            for side in 0..2 {
                let (mut min, mut max) = ([-7.0, -8.0, -9.0], [-6.0, -7.0, -8.0]);
                if side == 0 {
                    min[axis] = bad
                } else {
                    max[axis] = bad
                }
                boxes.push(Aabb::from_arrays(min, max));
            }
        }
        let mut inverted = Aabb::from_arrays([-7.0; 3], [-6.0; 3]);
        inverted.max[axis] = inverted.min[axis].next_down();
        boxes.push(inverted);
    }
    for _ in 0..200 {
        let exponents = [rng.between(-30, 30); 3];
        let (camera, _) = random_camera(&mut rng, exponents);
        let Some(view) = view_of(&camera) else { continue };
        // With 0 to 200 other objects, which give the hierarchy more levels.
        let others = (0..rng.below(3) * 100).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 0.5; 3]));
        let (scene, ids) = scene_of(&camera, &boxes.iter().copied().chain(others).collect::<Vec<_>>());
        let visible = cull(&scene, &view);
        for (bounds, &id) in boxes.iter().zip(&ids) {
            assert!(visible.contains(&scene, id), "{bounds:?} hidden from {camera:?}");
        }
    }
}

/// Returns a point box moved out of the plane with normal `n` until it is `target` error bounds outside.
/// `None` if rounding to `f32` undoes the move.
fn clear_point(rng: &mut Random, camera: &Camera, p: [f32; 3], n: DVec3, target: f64) -> Option<Aabb> {
    // The axis along which the smallest relative change moves the point out.
    let axis =
        (0..3).max_by(|&a, &b| (n[a] * f64::from(p[a])).abs().total_cmp(&(n[b] * f64::from(p[b])).abs()));
    let axis = axis.unwrap();
    let mut step = f64::from(p[axis]).abs() * power_of_two(-24);
    for _ in 0..40 {
        let mut q = p;
        q[axis] = (f64::from(p[axis]) - step * n[axis].signum()) as f32;
        let exponents = q.map(|x| x.abs().max(f32::MIN_POSITIVE).log2() as i32);
        let bounds = box_behind(rng, q, n, exponents);
        if camera.error_bounds_outside(&bounds) > target {
            return Some(bounds);
        }
        step *= 1.25;
    }
    None
}

/// Tests that culling decides: boxes outside of a plane by at least sixteen error bounds are hidden. Boxes of
/// all scales share blocks of 64.
#[test]
fn boxes_clear_of_a_plane_by_sixteen_error_bounds_are_hidden() {
    let mut rng = Random(11);
    let (mut total, mut close) = (0, 0);
    for case in 0..600 {
        // Scales from 1e-15 to 1e15: either one scale for all boxes of a view, or a scale of its own for each
        // box, with the eye at the origin.
        let wild = case % 2 == 0;
        let exponent = rng.between(-50, 50);
        let depth = rng.pick(&DEPTHS);
        let base = if wild {
            let window =
                [rng.range(-3.0, -0.1), rng.range(0.1, 3.0), rng.range(-3.0, -0.1), rng.range(0.1, 3.0)];
            let turn = DVec3::new(rng.range(-3.0, 3.0), rng.range(-3.0, 3.0), rng.range(-3.0, 3.0));
            projection(depth, window, power_of_two(-52), power_of_two(52), false)
                * DMat4::from_quat(DQuat::from_scaled_axis(turn))
        } else {
            random_projection(&mut rng, depth, 3.0)
        };
        let scale = if wild { 1.0 } else { power_of_two(-exponent) };
        let matrix = (base * DMat4::from_scale(DVec3::splat(scale))).to_cols_array();
        let camera = Camera::new(matrix.map(|x| f64::from(x as f32)), depth);
        let Some(view) = view_of(&camera) else { continue };
        let mut boxes = Vec::new();
        for _ in 0..100 {
            if wild {
                // Side planes pass through the origin, so multiples of a point on a side plane are on it too.
                let plane = &clip_planes(depth)[rng.below(4)];
                let (n, _) = camera.coefficients(plane);
                let n = n.normalize();
                let other = rng.vector(1.0);
                let p = (other - n * n.dot(other)) * power_of_two(rng.between(-50, 50));
                boxes.extend(clear_point(&mut rng, &camera, p.as_vec3().to_array(), n, 16.0));
            } else if let Some((p, n, _)) = aimed_point(&mut rng, &camera, &base, [exponent; 3]) {
                boxes.extend(clear_point(&mut rng, &camera, p, n, 16.0));
            }
        }
        // Boxes of very different scales in the same blocks.
        let count = boxes.len();
        for _ in 0..60 {
            let size = power_of_two(rng.between(-120, 120));
            let min = rng.vector(size).as_vec3();
            boxes.push(Aabb::new(min, min + (rng.vector(size).abs()).as_vec3()));
        }
        let (scene, ids) = scene_of(&camera, &boxes);
        let visible = cull(&scene, &view);
        for (bounds, &id) in boxes[..count].iter().zip(&ids) {
            let clear = camera.error_bounds_outside(bounds);
            total += 1;
            close += usize::from(clear < 24.0);
            assert!(
                !visible.contains(&scene, id),
                "{bounds:?} is clear by {clear}, and visible in {camera:?}"
            );
        }
    }
    judged(total);
    told_enough(total > 20_000 && close > 5_000, format_args!("too easy: {total} {close}"));
}
