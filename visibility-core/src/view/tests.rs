use super::*;
use alloc::{format, string::ToString};
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
        assert_eq!(
            view.planes(DVec3::ZERO).as_slice().len(),
            if depth.is_infinite() { 5 } else { 6 },
            "{depth:?}: planes of the view"
        );
    }
}

#[test]
fn orthographic_views_look_along_a_direction() {
    let window = Window { left: -2.0, right: 4.0, bottom: -1.0, top: 1.0 };
    let view = View::orthographic(pose(), window, -5.0, 20.0).unwrap();
    let Eye::Direction(d) = view.eye(DVec3::ZERO) else { panic!("parallel") };
    assert!(d.distance(pose().forward) < 1e-12, "the direction {d} is not the camera's");
    let at = |x: f64, y: f64, z: f64| pose().eye + pose().right * x + pose().up * y + pose().forward * z;
    assert!(
        in_view(&view, at(3.9, 0.9, 19.0)) && in_view(&view, at(-1.9, -0.9, -4.0)),
        "points just within the window"
    );
    assert!(
        !in_view(&view, at(-2.1, 0.0, 0.0)) && !in_view(&view, at(0.0, 0.0, 20.1)),
        "points just outside the window"
    );
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
    assert_eq!(
        View::from_clip_from_world(m, Depth::ZeroToOneInfinite).map(|_| ()),
        Err(ViewError::NoCamera),
        "the lines of sight of this matrix do not meet"
    );
    m.y_axis.w = 2.25;
    assert!(View::from_clip_from_world(m, Depth::ZeroToOneInfinite).is_ok(), "they meet in a point");
}

#[test]
fn bad_cameras_are_refused_with_the_reason() {
    let new = |m: Mat4| View::from_clip_from_world(m, Depth::ZeroToOne).map(|_| ());
    assert_eq!(new(Mat4::ZERO), Err(ViewError::NotInvertible), "the zero matrix");
    let mut m = Mat4::IDENTITY;
    m.z_axis.y = f32::NAN;
    assert_eq!(new(m), Err(ViewError::Matrix { row: 1, column: 2 }), "the entry that is NaN");
    m.z_axis.y = 0.0;
    m.y_axis = m.x_axis;
    assert_eq!(new(m), Err(ViewError::NotInvertible), "a matrix with two equal columns");
    // The third row is a combination of the others, but rounding keeps the determinant from being exactly
    // zero.
    let mut rows = [[0.1, 0.7, 0.3, 0.9], [0.2, 0.4, 0.6, 0.3], [0.0; 4], [0.5, 0.1, 0.2, 0.7]];
    rows[2] = core::array::from_fn(|i| rows[0][i] * 0.3 + rows[1][i] * 0.7);
    let combined = View::from_clip_from_world(DMat4::from_cols_array_2d(&rows), Depth::ZeroToOne);
    assert_eq!(
        combined.map(|_| ()),
        Err(ViewError::NotInvertible),
        "a matrix whose third row follows from the others"
    );
    let view = View::perspective(pose(), 1.0, 1.0, 0.1, 1.0).unwrap();
    assert_eq!(view.relative_to(DVec3::NAN).map(|_| ()), Err(ViewError::Origin), "an origin that is NaN");
    let bad = |fov, aspect, near, far| View::perspective(pose(), fov, aspect, near, far).is_err();
    assert!(
        bad(0.0, 1.0, 0.1, 1.0) && bad(4.0, 1.0, 0.1, 1.0) && bad(1.0, -1.0, 0.1, 1.0),
        "angles of 0 and 4 radians and a negative aspect are refused"
    );
    assert!(
        bad(1.0, 1.0, 0.0, 1.0) && bad(1.0, 1.0, 2.0, 1.0) && bad(1.0, f64::NAN, 0.1, 1.0),
        "near of 0, far before near and an aspect of NaN are refused"
    );
}

#[test]
fn extreme_cameras_are_accepted() {
    let fov = |degrees: f64| degrees.to_radians();
    for (angle, near, far) in [(0.001, 1e-4, 1e5), (179.9, 1e-4, 1e5), (60.0, 1e-15, 1e-6), (60.0, 1e9, 1e18)]
    {
        let view = View::perspective(pose(), fov(angle), 1.7, near, far).unwrap();
        assert!(in_view(&view, pose().eye + pose().forward * (near * 2.0)), "{angle} {near} {far}");
        assert!(
            !in_view(&view, pose().eye - pose().forward * far),
            "{angle} {near} {far}: a point behind the eye is in view"
        );
        let (Eye::Point(eye), error) = (view.eye(DVec3::ZERO), 1e-12) else { panic!("perspective") };
        assert!(eye.distance(pose().eye) < error, "{angle} {near} {far}: the eye is {eye}");
    }
}

#[test]
fn only_the_difference_of_origins_counts() {
    // On a grid of 2^-20 m the difference of the origins is exact, so the planes are bit-identical.
    let step = DVec3::splat(1e7) + DVec3::new(3.0, -5.0, 7.0) / 1048576.0;
    let origin = DVec3::new(12.5, -7.25, 1.0 / 1048576.0);
    let view = View::perspective(pose(), 1.0, 1.5, 0.25, f64::INFINITY).unwrap();
    let moved = view.relative_to(view.origin() + step).unwrap();
    assert_eq!(view.planes(origin), moved.planes(origin + step), "both origins moved by the same step");
    assert_eq!(view.clip_from(origin), moved.clip_from(origin + step), "both origins moved by the same step");
    assert_eq!(view.eye(origin), moved.eye(origin + step), "both origins moved by the same step");
}

/// Tests that a view in words names the camera that its matrix was made for, in every depth convention.
#[test]
fn views_say_what_camera_they_are() {
    let (window, layers) = (Window { left: -1.0, right: 3.0, bottom: -1.0, top: 1.0 }, 5);
    let eye = "eye (1, 2, 3), looks along (0.6, 0.8, 0) with (0, 0, 1) up, ";
    let finite = View::perspective(pose(), 1.0, 1.5, 0.25, 64.0).unwrap();
    let words = "field of view 78.67 x 57.3 degrees, near 0.25, far 64, depth Reversed";
    assert_eq!(finite.to_string(), format!("{eye}{words}"), "a perspective view with a far plane");
    let wide = View::perspective_off_center(pose(), window, 0.0001, f64::INFINITY).unwrap();
    let words = "field of view 116.6 x 90 degrees, near 1.0e-4, no far plane, depth ReversedInfinite";
    assert_eq!(
        wide.with_layers(layers).to_string(),
        format!("{eye}{words}, layers 0x5"),
        "an off-centre view without a far plane, on some layers"
    );
    // Mirrored views (x negated) with other ranges of depth.
    let scaled = |depth, z: DVec3| {
        let rows = DMat4::from_cols_array_2d(&[
            [-1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, z.x, z.y],
            [0.0, 0.0, z.z, 0.0],
        ]);
        View::from_clip_from_world(rows, depth).unwrap().to_string()
    };
    let ahead = "eye (0, 0, 0), looks along (0, 0, 1) with (0, 1, 0) up, field of view 90 x 90 degrees, ";
    let right = scaled(Depth::ZeroToOneInfinite, DVec3::new(1.0, 1.0, -2.0));
    assert_eq!(
        right,
        format!("{ahead}near 2, no far plane, depth ZeroToOneInfinite"),
        "a mirrored view without a far plane"
    );
    let right = scaled(Depth::NegativeOneToOne, DVec3::new(1.5, 1.0, -2.5));
    assert_eq!(
        right,
        format!("{ahead}near 1, far 5, depth NegativeOneToOne"),
        "a mirrored view with depth from -1"
    );
    let left = View::from_clip_from_world(DMat4::from_scale(DVec3::new(0.5, 0.25, 0.1)), Depth::ZeroToOne);
    let words = "parallel view at (0, 0, 0), looks along (0, 0, 1) with (0, 1, 0) up, 4 x 8, near 0, far 10, \
                 depth ZeroToOne, left-handed";
    assert_eq!(left.unwrap().to_string(), words, "a parallel, left-handed view");
}

#[test]
fn parameters_out_of_range_are_refused_with_range_and_unit() {
    let error =
        |fov, aspect, near, far| View::perspective(pose(), fov, aspect, near, far).unwrap_err().to_string();
    let degrees = error(60.0, 1.5, 0.1, 10.0);
    assert!(
        degrees.ends_with(
            "fov_y cannot be 60: it is in radians, above 0 and below pi; was it meant in degrees?"
        ),
        "an angle in degrees: {degrees}"
    );
    assert!(error(-1.0, 1.5, 0.1, 10.0).ends_with("in radians, above 0 and below pi"), "a negative angle");
    assert!(
        error(1.0, 0.0, 0.1, 10.0)
            .ends_with("aspect cannot be 0: it is width over height, above 0 and finite"),
        "an aspect of 0"
    );
    assert!(
        error(1.0, 1.5, 0.0, 10.0).ends_with("near cannot be 0: it is a distance in metres, above 0"),
        "near of 0"
    );
    assert!(error(1.0, 1.5, f64::NAN, 10.0).ends_with("in metres, and finite"), "far of NaN");
    assert!(
        error(1.0, 1.5, 0.1, 0.1).contains("far cannot be 0.1: it is a distance in metres, above near"),
        "far equal to near"
    );
    let window = Window { left: 1.0, right: -1.0, bottom: -1.0, top: 1.0 };
    let error = View::orthographic(pose(), window, 0.0, 1.0).unwrap_err().to_string();
    assert!(error.contains("width cannot be -2: the left edge must be less than the right"), "{error}");
}

/// The first parameter that is out of range is named, at each end of its range.
#[test]
fn parameters_at_the_ends_of_their_ranges_are_named() {
    let name = |view: Result<View, ViewError>| match view {
        Err(ViewError::Parameter { name, .. }) => name,
        other => panic!("no parameter is named: {other:?}"),
    };
    let (infinite, pi) = (f64::INFINITY, core::f64::consts::PI);
    let perspective = |fov, aspect, near, far| name(View::perspective(pose(), fov, aspect, near, far));
    assert_eq!([0.0, pi].map(|fov| perspective(fov, 1.0, 0.1, 9.0)), ["fov_y"; 2], "no angle");
    assert_eq!([0.0, infinite].map(|aspect| perspective(1.0, aspect, 0.1, 9.0)), ["aspect"; 2], "no ratio");
    assert_eq!(
        [0.0, infinite].map(|near| perspective(1.0, 1.0, near, infinite)),
        ["near"; 2],
        "no near plane"
    );
    assert_eq!([0.1, f64::NAN].map(|far| perspective(1.0, 1.0, 0.1, far)), ["far"; 2], "no far plane");
    let window = |left, right| Window { left, right, bottom: -1.0, top: 1.0 };
    for window in [window(1.0, 1.0), window(0.0, infinite), window(f64::NAN, 1.0)] {
        assert_eq!(name(View::perspective_off_center(pose(), window, 0.1, 9.0)), "width", "{window:?}");
        assert_eq!(name(View::orthographic(pose(), window, 0.1, 9.0)), "width", "{window:?}");
    }
    let parallel = |near, far| name(View::orthographic(pose(), window(-1.0, 1.0), near, far));
    assert_eq!([1.0, 0.5, infinite].map(|far| parallel(1.0, far)), ["far"; 3], "no far plane");
    assert_eq!(parallel(-f64::MAX, f64::MAX), "far", "a length without end");
}

/// Matrices of whole numbers of which a row or a column is a sum of multiples of the others: the division by
/// the greatest element of each row rounds, and the determinant is not zero.
#[test]
fn singular_matrices_are_refused_whatever_their_rounding() {
    let mut rng = visibility_testing::Random(1);
    for case in 0..20_000 {
        let mut m = [[0i64; 4]; 4];
        for row in &mut m {
            row.iter_mut().for_each(|x| *x = i64::from(rng.between(-1000, 1000)));
        }
        let (last, factors) = (rng.below(4), [(); 3].map(|()| i64::from(rng.between(-3, 3))));
        let others: alloc::vec::Vec<usize> = (0..4).filter(|&i| i != last).collect();
        m[last] = core::array::from_fn(|at| (0..3).map(|i| factors[i] * m[others[i]][at]).sum());
        let matrix = DMat4::from_cols_array_2d(&m.map(|row| row.map(|x| x as f64)));
        let matrix = if rng.one_in(2) { matrix.transpose() } else { matrix };
        let refused = View::from_clip_from_world(matrix, Depth::ZeroToOne).map(|_| ());
        assert_eq!(refused, Err(ViewError::NotInvertible), "case {case}: {matrix}");
    }
}

/// Each element that is not finite is named, and each of a matrix is looked at.
#[test]
fn matrices_that_are_not_finite_are_refused() {
    for (row, column) in (0..16).map(|i| (i / 4, i % 4)) {
        for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut m = DMat4::IDENTITY.to_cols_array_2d();
            m[column][row] = number;
            let refused = View::from_clip_from_world(DMat4::from_cols_array_2d(&m), Depth::ZeroToOne);
            let expected = Err(ViewError::Matrix { row, column });
            assert_eq!(refused.map(|_| ()), expected, "{number} at row {row}, column {column}");
        }
    }
}

/// Matrices of which no product of elements in two rows and two columns is other than zero.
#[test]
fn matrices_of_one_column_are_refused() {
    for column in 0..4 {
        let mut m = [[0.0; 4]; 4];
        m[column] = [1.0; 4];
        let refused = View::from_clip_from_world(DMat4::from_cols_array_2d(&m), Depth::ZeroToOne);
        assert_eq!(refused.map(|_| ()), Err(ViewError::NotInvertible), "column {column} alone");
    }
}

#[test]
fn round_and_tiny_distances_keep_their_zeros() {
    let far = View::perspective(pose(), 1.0, 1.5, 0.25, 1000.0).unwrap().to_string();
    assert!(far.contains("near 0.25, far 1000, depth"), "a far plane at 1 km: {far}");
    let near = View::perspective(pose(), 1.0, 1.5, 1e-10, f64::INFINITY).unwrap().to_string();
    assert!(near.contains("near 1.0e-10, no far plane"), "a near plane at 1e-10 m: {near}");
}
