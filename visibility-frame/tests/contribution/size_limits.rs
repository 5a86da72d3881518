//! Tests of the contribution culler at its size limit: objects exactly as large as the limit, far off the
//! axis and far away.

use super::cull;
use visibility_core::glam::{DMat4, DVec3, DVec4, Vec3};
use visibility_core::scene::DrawRange;
use visibility_core::view::{Depth, Window};
use visibility_core::{Aabb, Pose, Scene, View};
use visibility_frame::lod::ContributionCuller;
use visibility_testing::Random;

/// Tests the limit where it is exact: boxes and cameras in whole numbers, compared in integers. An object
/// exactly as large as the limit stays; an object smaller by a millionth is removed.
#[test]
fn an_object_exactly_as_large_as_the_limit_stays() {
    let mut rng = Random(5);
    let mut ties = 0;
    for _ in 0..4000 {
        // With a window of 2 by 2 and pictures of 2 k rows, a metre at a distance of one metre has k pixels.
        let (k, least) = (1 + rng.below(2000) as i128, 1 + rng.below(40) as i128);
        let pose = Pose { eye: DVec3::ZERO, right: DVec3::X, up: DVec3::Y, forward: DVec3::NEG_Z };
        let view =
            View::perspective_off_center(pose, Window::centered(1.0, 1.0), 0.1, f64::INFINITY).unwrap();
        // The box is a segment along x of length a that begins straight ahead at distance b, with a k == b
        // least.
        let (a, b) = if rng.one_in(2) {
            let part = 1 + rng.below(30) as i128;
            (least * part, k * part)
        } else {
            (1 + rng.below(2000) as i128, 1 + rng.below(20_000) as i128)
        };
        let scale = 2.0f32.powi(rng.between(-40, 40));
        let mut scene = Scene::new();
        let bounds =
            Aabb::new(Vec3::new(0.0, 0.0, -b as f32) * scale, Vec3::new(a as f32, 0.0, -b as f32) * scale);
        let id = scene.insert(bounds);
        let mut culler = ContributionCuller::new(2.0 * k as f64, least as f64);
        let seen = cull(&mut culler, &scene, &view).0.contains(&id);
        assert_eq!(seen, a * k >= b * least, "{a} m at {b} m with {k}: at least {least} pixels");
        ties += usize::from(a * k == b * least);
        // In a parallel view of k pixels per metre, the same box has exactly a k pixels, times the scale.
        let flat = View::orthographic(pose, Window::centered(1.0, 1.0), 0.0, 9.0).unwrap();
        let pixels = (a * k) as f64 * f64::from(scale);
        let mut in_flat = ContributionCuller::new(2.0 * k as f64, pixels);
        assert!(
            cull(&mut in_flat, &scene, &flat).0.contains(&id),
            "an object of exactly {pixels} pixels in a parallel view"
        );
        in_flat.set_min_pixels(pixels * (1.0 + 1e-6));
        assert!(
            !cull(&mut in_flat, &scene, &flat).0.contains(&id),
            "an object just below the limit of {pixels} pixels"
        );
        culler.set_min_pixels(least as f64 * (1.0 + 1e-6));
        let seen = cull(&mut culler, &scene, &view).0.contains(&id);
        assert_eq!(seen, a * k > b * least, "{a} m at {b} m with {k}: more than {least} pixels");
    }
    assert!(ties > 1000, "objects exactly at the limit: {ties}");
}

/// Tests the limit for a picture far off the viewing axis, whose matrix rounding nearly makes singular. The
/// rows are whole numbers, from which the scale follows exactly; the directions of the rows of y and w differ
/// by one part in 2^20, so that their cross product loses 20 binary digits.
#[test]
fn a_picture_far_off_the_axis_does_not_lose_an_object() {
    let mut rng = Random(7);
    for _ in 0..500 {
        let m = ((1 << 26) + 2 * rng.below(1 << 20) + 1) as f64;
        let c = ((1 << 20) + 2 * rng.below(1 << 10) + 1) as f64;
        let (u, v, w) = (DVec3::new(2.0, 1.0, -2.0), DVec3::new(2.0, -2.0, 1.0), DVec3::new(1.0, 2.0, 2.0));
        let rows = [v, u + w * c, DVec3::ZERO, w].map(|row| (row * m).extend(0.0));
        let rows = [rows[0], rows[1], DVec4::W * 0.1, rows[3]];
        let matrix = DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
        let view = View::from_clip_from_world(matrix, Depth::ReversedInfinite).unwrap();
        // |y x w| / |w|^2 is 1: with pictures of 2 k rows, k pixels per metre at one metre.
        let (least, k, part) = (1 + rng.below(40), 1 + rng.below(100), 1 + rng.below(30));
        let mut scene = Scene::new();
        let (length, away) = ((least * part) as f32, -((k * part) as f32));
        let id = scene.insert(Aabb::from_arrays([0.0, 0.0, away], [length, 0.0, away]));
        let mut culler = ContributionCuller::new(2.0 * k as f64, least as f64);
        assert!(cull(&mut culler, &scene, &view).0.contains(&id), "{k} {least} {part}");
        culler.set_min_pixels(least as f64 * (1.0 + 1e-5));
        assert!(!cull(&mut culler, &scene, &view).0.contains(&id), "{k} {least} {part}");
    }
}

/// Tests the margin for rounding of an eye far from the scene's origin, in coordinates whose difference `f64`
/// cannot represent: an object exactly as large as the limit, exactly at the begin or at the end of its
/// range, stays.
#[test]
fn a_far_eye_does_not_lose_an_object() {
    let mut rng = Random(6);
    let (mut kept, mut dropped) = ([0; 3], [0; 3]);
    for _ in 0..4000 {
        // The eye is less than a centimetre before the box; both are far from the origin.
        let (origin, near) = (rng.fine_range(-1e6, 1e6), rng.range(-1e6, 1e6) as f32);
        let eye = origin + f64::from(near) - 10.0f64.powf(rng.range(-6.0, -2.0));
        let pose = Pose { eye: DVec3::new(0.0, 0.0, eye), right: DVec3::X, up: DVec3::Y, forward: DVec3::Z };
        let view =
            View::perspective_off_center(pose, Window::centered(1.0, 1.0), 0.1, f64::INFINITY).unwrap();
        let distance = (f64::from(near) - (eye - origin)) as f32;
        let length = rng.pick(&[1.0, 1.0, 0.99, 1.01])
            * rng.pick(&[distance, distance.next_down(), distance.next_up()]);
        let terms = [f64::from(length), -f64::from(near), eye, -origin];
        let sign = visibility_testing::sign_of_sum(terms.map(|term| (term, 1.0)));
        for (number, range) in [
            // One pixel per metre at a distance of one metre, and a limit of one pixel: a segment stays up to
            // a distance of its own length.
            DrawRange::ALWAYS,
            DrawRange { begin: length, ..DrawRange::ALWAYS },
            DrawRange { end: length, ..DrawRange::ALWAYS },
        ]
        .into_iter()
        .enumerate()
        {
            let mut scene = Scene::new();
            scene.set_origin(DVec3::new(0.0, 0.0, origin)).unwrap();
            let id = scene.insert(Aabb::from_arrays([0.0, 0.0, near], [length, 0.0, near]));
            scene.set_draw_range(id, range).unwrap();
            let least = f64::from(u8::from(number == 0));
            let seen = cull(&mut ContributionCuller::new(2.0, least), &scene, &view).0.contains(&id);
            let is_in_range = if number == 1 { sign <= 0 } else { sign >= 0 };
            assert!(seen || !is_in_range, "{range:?}: {length} m at {near} m from {origin}, eye at {eye}");
            *if seen { &mut kept[number] } else { &mut dropped[number] } += 1;
        }
    }
    assert!(kept.iter().chain(&dropped).all(|&count| count > 500), "{kept:?} {dropped:?}");
}
