//! Hierarchical occlusion maps on random views of random occluders. At a threshold of 1, no box that a ray
//! reaches is hidden, by any depth estimate, and a hole of one pixel is enough to keep a box visible. Answers
//! are equal on all instruction sets and pinned by a hash.

use crate::common::boxes::{Checked, assert_hidden, extreme, random_box};
use crate::common::{Occluder, draw, faces, occluder, view};
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{
    Aabb, Accuracy, Culler, OccluderMesh, OcclusionCuller, OcclusionMap, Pose, Scene, View, VisibleSet,
    occlusion::Occlusion, simd::Simd, view::Window,
};
use visibility_hzb::{Coverage, DepthEstimate, Hom, Hzb};
use visibility_testing::{Random, judged, told_enough};

/// All depth estimates of an occlusion map.
const ESTIMATES: [DepthEstimate; 3] =
    [DepthEstimate::Plane, DepthEstimate::Buffer, DepthEstimate::NoBackground];

/// Tests random boxes on `views` random views. A box that is hidden by the no-background estimate must be
/// hidden by the z-buffer too. View rays to points of a hidden box must meet an occluder in front of the box.
fn run(views: u64, seed: u64) {
    let mut random = Random(seed);
    let (mut hidden, mut rays) = ([0u64; 3], 0u64);
    for round in 0..views {
        let size = [[40, 24], [17, 33], [64, 64], [130, 50]][random.below(4)];
        let view = view(&mut random);
        let mut occluders: Vec<_> = (0..random.below(5) + 1).map(|_| occluder(&mut random)).collect();
        let plain = occluders.len();
        if random.below(4) == 0 {
            occluders.extend(extreme(&mut random));
        }
        let coverage = if random.below(8) == 0 { Coverage::Sampled } else { Coverage::Conservative };
        let hzb = draw(Hzb::new(size[0], size[1]).unwrap().with_coverage(coverage), &occluders, &view);
        let boxes: Vec<_> = (0..40).map(|_| random_box(&mut random)).collect();
        let mut scene = Scene::new();
        scene.insert_batch(boxes.iter().copied());
        let all = faces(&occluders[..plain]);
        for (estimate, hidden) in ESTIMATES.into_iter().zip(&mut hidden) {
            let new = Hom::new(size[0], size[1]).unwrap();
            let new = new.with_coverage(coverage).with_depth_estimate(estimate);
            let maps: Vec<_> =
                Simd::available().map(|s| draw(new.clone().with_simd(s), &occluders, &view)).collect();
            for map in &maps {
                let mut set = VisibleSet::new();
                set.fill(&scene, &view);
                OcclusionCuller::new(Checked(map.clone())).cull(&scene, &view, &mut set);
            }
            for bounds in &boxes {
                let answer = maps[0].test(bounds);
                for map in &maps[1..] {
                    assert_eq!(map.test(bounds), answer, "round {round}, {bounds:?}");
                }
                if answer != Occlusion::Hidden {
                    continue;
                }
                if estimate == DepthEstimate::NoBackground {
                    assert_eq!(hzb.test(bounds), Occlusion::Hidden, "round {round}: the z-buffer shows it");
                }
                // Rays are cast only if there are no extreme occluders, for which they are too imprecise.
                if coverage == Coverage::Conservative && occluders.len() == plain {
                    let what = format!("round {round}, {estimate:?}");
                    let own = assert_hidden(&mut random, &view, size, bounds, &all, &what);
                    rays += own;
                    // Count only boxes to which a ray was cast.
                    *hidden += u64::from(own > 0);
                }
            }
        }
    }
    judged(rays);
    told_enough(
        hidden.iter().all(|&hidden| hidden > views / 8),
        format_args!("too little is hidden to prove anything: {hidden:?}"),
    );
}

#[test]
fn nothing_that_a_ray_reaches_is_hidden_by_any_depth_estimate() {
    run(6_000, 11);
}

/// Returns a parallel view along x from the origin in which a pixel is a metre wide.
fn pixels_as_metres(size: [usize; 2]) -> View {
    let half = size.map(|side| side as f64 / 2.0);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let window = Window { left: -half[0], right: half[0], bottom: -half[1], top: half[1] };
    View::orthographic(pose, window, 1.0, 100.0).unwrap()
}

/// Returns a wall at x from 10 to 11 m that covers the given range of columns and lines, in pixels from the
/// upper left, in the view of [`pixels_as_metres`]. `None` if a range is empty.
fn wall(size: [usize; 2], columns: [f32; 2], lines: [f32; 2]) -> Option<OccluderMesh> {
    let half = size.map(|side| side as f32 / 2.0);
    // Columns run to the right, which is -y for an observer who looks along x with z up.
    let (low, high) =
        ([10.0, half[0] - columns[1], half[1] - lines[1]], [11.0, half[0] - columns[0], half[1] - lines[0]]);
    (columns[0] < columns[1] && lines[0] < lines[1])
        .then(|| OccluderMesh::cuboid(&Aabb::from_arrays(low, high)).unwrap())
}

#[test]
fn a_hole_of_one_pixel_in_a_wall_shows_what_is_behind() {
    let mut random = Random(4);
    let mut rounded_away = 0;
    let sizes = [[16, 16], [17, 40], [64, 64], [256, 256], [320, 180], [512, 288], [1000, 700], [4096, 4096]];
    for size in sizes {
        let view = pixels_as_metres(size);
        for estimate in ESTIMATES {
            let mut hom = Hom::new(size[0], size[1]).unwrap().with_depth_estimate(estimate);
            let [width, height] = size.map(|side| side as f32);
            let (hole_x, hole_y) = (random.below(size[0]), random.below(size[1]));
            let (x, y) = (hole_x as f32, hole_y as f32);
            // Walls above, below, to the left and to the right of the hole. They extend beyond the picture,
            // so that its border is covered too, and a little into the hole, so that rounding leaves no other
            // pixel uncovered.
            let parts = [
                ([-9.0, width + 9.0], [-9.0, y + 0.125]),
                ([-9.0, width + 9.0], [y + 0.875, height + 9.0]),
                ([-9.0, x + 0.125], [y - 1.0, y + 2.0]),
                ([x + 0.875, width + 9.0], [y - 1.0, y + 2.0]),
            ];
            hom.begin(&view, DVec3::ZERO);
            for mesh in parts.into_iter().filter_map(|(columns, lines)| wall(size, columns, lines)) {
                hom.add(&mesh, &Affine3A::IDENTITY);
            }
            hom.flush();
            assert_eq!(hom.opacity(0, hole_x, hole_y), Some(0.0), "{size:?}");
            let top = hom.levels() - 1;
            let beside = [hom.opacity(top, 1, 0), hom.opacity(top, 0, 1)];
            assert_eq!(beside, [None; 2], "{size:?}: the top of the pyramid is one texel");
            for level in 0..=top {
                let opacity = hom.opacity(level, hole_x >> level, hole_y >> level).unwrap();
                assert!(opacity < 1.0, "{size:?}, level {level}: {opacity}");
                // An average stored in eight bits would round this opacity to 1.
                rounded_away += u32::from((opacity * 255.0).round() == 255.0);
            }
            // Boxes behind the whole picture, and boxes behind some pixels around the hole.
            let (half_width, half_height) = (width / 2.0, height / 2.0);
            for reach in [1.0, 3.0, 9.0, 40.0, 200.0, 9000.0f32] {
                let (left, right) = ((x - reach).max(0.0), (x + 1.0 + reach).min(width));
                let (upper, lower) = ((y - reach).max(0.0), (y + 1.0 + reach).min(height));
                let behind = Aabb::from_arrays(
                    [20.0, half_width - right, half_height - lower],
                    [30.0, half_width - left, half_height - upper],
                );
                assert_ne!(hom.test(&behind), Occlusion::Hidden, "{size:?}, {estimate:?}, {reach}");
            }
            // With the hole closed, the same boxes must be hidden, or the test would prove nothing.
            hom.add(&wall(size, [x - 1.0, x + 2.0], [y - 1.0, y + 2.0]).unwrap(), &Affine3A::IDENTITY);
            hom.flush();
            let all = Aabb::from_arrays(
                [20.0, 2.0 - half_width, 2.0 - half_height],
                [30.0, half_width - 2.0, half_height - 2.0],
            );
            let small = Aabb::from_arrays([20.0, -1.0, -1.0], [30.0, 1.0, 1.0]);
            assert_eq!(hom.test(&small), Occlusion::Hidden, "{size:?}, {estimate:?}");
            assert_eq!(hom.test(&all), Occlusion::Hidden, "{size:?}, {estimate:?}");
        }
    }
    assert!(rounded_away > 50, "an average that rounds to one would have passed: {rounded_away}");
}

#[test]
fn hidden_is_strictly_behind() {
    let size = [64, 64];
    let view = pixels_as_metres(size);
    for estimate in ESTIMATES {
        let new = Hom::new(64, 64).unwrap().with_depth_estimate(estimate);
        let mesh = wall(size, [-9.0, 73.0], [-9.0, 73.0]).unwrap();
        let hom = draw(new, &[Occluder { mesh, transform: Affine3A::IDENTITY }], &view);
        let at = |x: f32| hom.test(&Aabb::from_arrays([x, -3.0, -3.0], [x + 1.0, 3.0, 3.0]));
        // The wall reaches from 10 to 11 m. The estimates `Plane` and `Buffer` use only its back.
        assert_eq!(at(8.0), Occlusion::Visible, "{estimate:?}: a box before the wall");
        assert_ne!(at(10.0), Occlusion::Hidden, "{estimate:?}: a box that touches the wall's front");
        assert_eq!(at(11.1), Occlusion::Hidden, "{estimate:?}");
        assert_eq!(
            at(10.5) == Occlusion::Hidden,
            estimate == DepthEstimate::NoBackground,
            "{estimate:?}: a box that begins within the wall"
        );
    }
}

#[test]
fn a_wall_from_behind_the_eye_on_hides_what_is_behind_all_of_it() {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 1.5, 16.0 / 9.0, 0.1, f64::INFINITY).unwrap();
    for side in [-1.0, 1.0] {
        let across = |low: f32, high: f32| (low * side).min(high * side)..(low * side).max(high * side);
        let bounds = |x: [f32; 2], y: [f32; 2], z: f32| {
            let y = across(y[0], y[1]);
            Aabb::from_arrays([x[0], y.start, -z], [x[1], y.end, z])
        };
        for estimate in ESTIMATES {
            let wall = OccluderMesh::cuboid(&bounds([-5.0, 50.0], [1.0, 1.2], 40.0)).unwrap();
            let occluder = [Occluder { mesh: wall, transform: Affine3A::IDENTITY }];
            let new = Hom::new(320, 180).unwrap().with_depth_estimate(estimate);
            let hom = draw(new, &occluder, &view);
            let before = bounds([3.0, 3.1], [0.8, 0.85], 0.1);
            assert_ne!(hom.test(&before), Occlusion::Hidden, "{estimate:?}, side {side}");
            let behind = bounds([60.0, 61.0], [20.0, 21.0], 2.0);
            assert_eq!(hom.test(&behind), Occlusion::Hidden, "{estimate:?}, side {side}");
        }
    }
}

#[test]
fn what_is_promised_depends_on_the_thresholds() {
    let accuracy = |map: Hom| map.accuracy();
    assert_eq!(accuracy(Hom::default()), Accuracy::Conservative, "the default");
    assert_eq!(accuracy(Hom::default().with_threshold(1.0)), Accuracy::Conservative, "a threshold of 1");
    assert_eq!(accuracy(Hom::default().with_threshold(0.99)), Accuracy::Approximate, "a threshold of 0.99");
    assert_eq!(
        accuracy(Hom::default().with_level_threshold(5, 0.99)),
        Accuracy::Approximate,
        "a threshold of 0.99 on one level"
    );
    assert_eq!(
        accuracy(Hom::default().with_level_threshold(0, 0.1)),
        Accuracy::Conservative,
        "a threshold on a level that is always opaque"
    );
    assert_eq!(
        accuracy(Hom::default().with_level_threshold(99, 0.1)),
        Accuracy::Conservative,
        "a threshold on a level that does not exist"
    );
    assert_eq!(
        accuracy(Hom::default().with_coverage(Coverage::Sampled)),
        Accuracy::Approximate,
        "pixels covered by their centres"
    );
    assert!(
        Hom::new(15, 36).is_err() && Hom::new(64, 4097).is_err(),
        "pictures of 15 columns and of 4097 rows"
    );
}

#[test]
fn improper_boxes_are_visible_and_an_empty_map_hides_nothing() {
    let mut random = Random(3);
    let occluders: Vec<_> = (0..20).map(|_| occluder(&mut random)).collect();
    let view = view(&mut random);
    for threshold in [1.0, 0.0] {
        let new = Hom::new(64, 36).unwrap().with_threshold(threshold);
        let hom = draw(new.clone(), &occluders, &view);
        for bounds in [Aabb::EMPTY, Aabb::new(Vec3::NAN, Vec3::NAN), Aabb::new(Vec3::ONE, Vec3::ZERO)] {
            assert_eq!(hom.test(&bounds), Occlusion::Visible, "threshold {threshold}: {bounds:?}");
        }
        assert_ne!(
            hom.test(&Aabb::new(Vec3::NEG_INFINITY, Vec3::INFINITY)),
            Occlusion::Hidden,
            "threshold {threshold}: a box without end"
        );
        assert_ne!(
            new.test(&Aabb::from_arrays([1.0; 3], [2.0; 3])),
            Occlusion::Hidden,
            "threshold {threshold}: a map that was never begun"
        );
        let empty = draw(new, &[], &pixels_as_metres([64, 36]));
        let before = Aabb::from_arrays([20.0, -3.0, -3.0], [30.0, 3.0, 3.0]);
        assert_ne!(empty.test(&before), Occlusion::Hidden, "at {threshold}");
    }
}

#[test]
fn another_depth_estimate_counts_from_the_next_frame_on() {
    let size = [64, 64];
    let view = pixels_as_metres(size);
    let mesh = wall(size, [-9.0, 73.0], [-9.0, 73.0]).unwrap();
    let occluder = [Occluder { mesh, transform: Affine3A::IDENTITY }];
    let (between, behind) = ([[2.0; 3], [3.0; 3]], [[20.0; 3], [21.0; 3]]);
    for estimate in ESTIMATES {
        let hom = draw(Hom::new(64, 64).unwrap(), &occluder, &view).with_depth_estimate(estimate);
        assert_ne!(
            hom.test(&Aabb::from_arrays(between[0], between[1])),
            Occlusion::Hidden,
            "{estimate:?}: a box between the eye and the wall"
        );
        let hides = hom.test(&Aabb::from_arrays(behind[0], behind[1])) == Occlusion::Hidden;
        assert!(
            !hides || estimate == DepthEstimate::NoBackground,
            "{estimate:?}: depths that were not estimated hide a box"
        );
        let hom = draw(hom, &occluder, &view);
        assert_eq!(
            hom.test(&Aabb::from_arrays(behind[0], behind[1])),
            Occlusion::Hidden,
            "{estimate:?}: a box behind the wall in the next frame"
        );
    }
}

#[test]
fn the_answers_are_pinned() {
    let mut random = Random(21);
    let mut hash = 0xcbf2_9ce4_8422_2325u64;
    let mut hidden = 0;
    for round in 0..300 {
        let size = [[96, 54], [200, 120], [333, 77]][round % 3];
        // Coordinates are multiples of a quarter pixel, so that the rounding of the rasterizer does not
        // matter.
        let mut part = |side: usize| {
            let (a, b) = (random.below(4 * side) as f32, random.below(4 * side) as f32);
            [a.min(b) * 0.25 + 0.125, a.max(b) * 0.25 + 0.125]
        };
        let meshes: Vec<_> = (0..12).filter_map(|_| wall(size, part(size[0]), part(size[1]))).collect();
        let shift =
            |random: &mut Random| Affine3A::from_translation(Vec3::new(random.below(40) as f32, 0.0, 0.0));
        let occluders: Vec<_> =
            meshes.into_iter().map(|mesh| Occluder { mesh, transform: shift(&mut random) }).collect();
        let new = Hom::new(size[0], size[1])
            .unwrap()
            .with_threshold([1.0, 0.9, 0.6][round / 3 % 3])
            .with_depth_estimate(ESTIMATES[round / 9 % 3]);
        let hom = draw(new, &occluders, &pixels_as_metres(size));
        for _ in 0..40 {
            let middle = random.vec3(-1.0, 1.0) * Vec3::new(1.0, size[0] as f32, size[1] as f32) * 0.5;
            let half = random.vec3(0.0, 30.0) * Vec3::new(0.1, 1.0, 1.0);
            let away = Vec3::X * (12 + random.below(60)) as f32;
            let bounds = Aabb::new(middle - half + away, middle + half + away);
            let answer = hom.test(&bounds) as u64;
            hidden += u64::from(answer == Occlusion::Hidden as u64);
            hash = (hash ^ answer).wrapping_mul(0x0100_0000_01b3);
        }
    }
    // The hash is the same on every processor and instruction set. It changes only if the rule of which boxes
    // are hidden changes.
    assert_eq!((hidden, hash), (1458, 0xc658_72e4_9d07_8f94), "{hash:#x}");
}
