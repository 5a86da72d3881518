use super::*;
use glam::{Mat4, Vec3};

fn pose() -> Pose {
    Pose::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 6.0, 3.0), DVec3::Z)
}

/// Returns whether a point of the world satisfies all planes of a view, up to their error bounds. False if
/// the point is beyond one of the planes.
fn in_view(view: &View, p: DVec3) -> bool {
    view.planes(DVec3::ZERO).as_slice().iter().all(|v| v.plane.signed_distance(p) >= -v.error)
}

#[test]
fn engine_matrices_of_every_convention_give_the_same_view() {
    let eye = Vec3::new(1.0, 2.0, 3.0);
    // A right-handed camera space in which z points towards the viewer, as in OpenGL and most engines.
    let axis = |v: DVec3| v.as_vec3().extend(0.0);
    let look = Mat4::from_cols(axis(pose().right), axis(pose().up), axis(-pose().forward), eye.extend(1.0))
        .inverse();
    let (f, a, n, far) = (1.0f32 / (0.5f32).tan(), 1.5f32, 0.25f32, 64.0f32);
    let project = |zz: f32, zw: f32| {
        Mat4::from_cols_array_2d(&[[f / a, 0., 0., 0.], [0., f, 0., 0.], [0., 0., zz, -1.], [0., 0., zw, 0.]])
            * look
    };
    let finite = [
        (project(-(far + n) / (far - n), -2.0 * far * n / (far - n)), Depth::NegativeOneToOne),
        (project(-far / (far - n), -far * n / (far - n)), Depth::ZeroToOne),
        (project(n / (far - n), far * n / (far - n)), Depth::Reversed),
    ];
    let infinite = [
        (project(-1.0, -2.0 * n), Depth::NegativeOneToOneInfinite),
        (project(-1.0, -n), Depth::ZeroToOneInfinite),
        (project(0.0, n), Depth::ReversedInfinite),
    ];
    let built = View::perspective(pose(), 1.0, 1.5, 0.25, 64.0).unwrap();
    let built_infinite = View::perspective(pose(), 1.0, 1.5, 0.25, f64::INFINITY).unwrap();
    let (forward, up) = (pose().forward, pose().up);
    for (matrix, depth) in finite.into_iter().chain(infinite) {
        let view = View::from_clip_from_world(matrix, depth).unwrap();
        let Eye::Point(e) = view.eye(DVec3::ZERO) else { panic!("{depth:?} is perspective") };
        assert!(e.distance(eye.as_dvec3()) < 1e-4, "{depth:?}: {e}");
        let reference = if depth.is_infinite() { &built_infinite } else { &built };
        for distance in [-1.0, 0.2, 0.3, 10.0, 60.0, 70.0, 1e6] {
            for height in [-0.6, -0.5, 0.0, 0.5, 0.6] {
                let p = e + (forward + up * height) * distance;
                assert_eq!(in_view(&view, p), in_view(reference, p), "{depth:?} at {distance}, {height}");
            }
        }
        assert_eq!(view.planes(DVec3::ZERO).as_slice().len(), if depth.is_infinite() { 5 } else { 6 });
    }
}

#[test]
fn orthographic_views_look_along_a_direction() {
    let window = Window { left: -2.0, right: 4.0, bottom: -1.0, top: 1.0 };
    let view = View::orthographic(pose(), window, -5.0, 20.0).unwrap();
    let Eye::Direction(d) = view.eye(DVec3::ZERO) else { panic!("parallel") };
    assert!(d.distance(pose().forward) < 1e-12);
    let at = |x: f64, y: f64, z: f64| pose().eye + pose().right * x + pose().up * y + pose().forward * z;
    assert!(in_view(&view, at(3.9, 0.9, 19.0)) && in_view(&view, at(-1.9, -0.9, -4.0)));
    assert!(!in_view(&view, at(-2.1, 0.0, 0.0)) && !in_view(&view, at(0.0, 0.0, 20.1)));
    let depth_out = -view.clip_from(DVec3::ZERO).row(2).truncate().dot(d);
    assert!(depth_out > 0.0, "reversed depth falls along the line of sight");
}

/// Regression test, found by fuzzing: all view rays of this matrix run along (0, 1, -1), but `w` differs
/// between them, so neither `w` nor depth tells which surface is nearer. Such a matrix must be rejected.
#[test]
fn parallel_lines_of_sight_of_which_w_differs_are_of_no_camera() {
    let mut m = Mat4::from_cols_array_2d(&[
        [-5.125, 2.125, 2.125, 2.125],
        [2.125, 2.125, 2.125, 2.125],
        [2.125, 2.125, -0.375, 2.125],
        [2.125, 2.125, 2.125, -0.6875],
    ]);
    assert_eq!(View::from_clip_from_world(m, Depth::ZeroToOneInfinite).map(|_| ()), Err(ViewError::NoCamera));
    m.y_axis.w = 2.25;
    assert!(View::from_clip_from_world(m, Depth::ZeroToOneInfinite).is_ok(), "they meet in a point");
}

#[test]
fn bad_cameras_are_refused_with_the_reason() {
    let new = |m: Mat4| View::from_clip_from_world(m, Depth::ZeroToOne).map(|_| ());
    assert_eq!(new(Mat4::ZERO), Err(ViewError::Singular));
    let mut m = Mat4::IDENTITY;
    m.z_axis.y = f32::NAN;
    assert_eq!(new(m), Err(ViewError::NonFinite { row: 1, column: 2 }));
    m.z_axis.y = 0.0;
    m.y_axis = m.x_axis;
    assert_eq!(new(m), Err(ViewError::Singular));
    // The third row is a combination of the others, but rounding keeps the determinant from being exactly
    // zero.
    let mut rows = [[0.1, 0.7, 0.3, 0.9], [0.2, 0.4, 0.6, 0.3], [0.0; 4], [0.5, 0.1, 0.2, 0.7]];
    rows[2] = core::array::from_fn(|i| rows[0][i] * 0.3 + rows[1][i] * 0.7);
    let combined = View::from_clip_from_world(DMat4::from_cols_array_2d(&rows), Depth::ZeroToOne);
    assert_eq!(combined.map(|_| ()), Err(ViewError::Singular));
    let view = View::perspective(pose(), 1.0, 1.0, 0.1, 1.0).unwrap();
    assert_eq!(view.relative_to(DVec3::NAN).map(|_| ()), Err(ViewError::NonFiniteOrigin));
    let bad = |fov, aspect, near, far| View::perspective(pose(), fov, aspect, near, far).is_err();
    assert!(bad(0.0, 1.0, 0.1, 1.0) && bad(4.0, 1.0, 0.1, 1.0) && bad(1.0, -1.0, 0.1, 1.0));
    assert!(bad(1.0, 1.0, 0.0, 1.0) && bad(1.0, 1.0, 2.0, 1.0) && bad(1.0, f64::NAN, 0.1, 1.0));
}

#[test]
fn extreme_cameras_are_accepted() {
    let fov = |degrees: f64| degrees.to_radians();
    for (angle, near, far) in [(0.001, 1e-4, 1e5), (179.9, 1e-4, 1e5), (60.0, 1e-15, 1e-6), (60.0, 1e9, 1e18)]
    {
        let view = View::perspective(pose(), fov(angle), 1.7, near, far).unwrap();
        assert!(in_view(&view, pose().eye + pose().forward * (near * 2.0)), "{angle} {near} {far}");
        assert!(!in_view(&view, pose().eye - pose().forward * far));
        let (Eye::Point(eye), error) = (view.eye(DVec3::ZERO), 1e-12) else { panic!("perspective") };
        assert!(eye.distance(pose().eye) < error);
    }
}

#[test]
fn only_the_difference_of_origins_counts() {
    // On a grid of 2^-20 m the difference of the origins is exact, so the planes are bit-identical.
    let step = DVec3::splat(1e7) + DVec3::new(3.0, -5.0, 7.0) / 1048576.0;
    let origin = DVec3::new(12.5, -7.25, 1.0 / 1048576.0);
    let view = View::perspective(pose(), 1.0, 1.5, 0.25, f64::INFINITY).unwrap();
    let moved = view.relative_to(view.origin() + step).unwrap();
    assert_eq!(view.planes(origin), moved.planes(origin + step));
    assert_eq!(view.clip_from(origin), moved.clip_from(origin + step));
    assert_eq!(view.eye(origin), moved.eye(origin + step));
}
