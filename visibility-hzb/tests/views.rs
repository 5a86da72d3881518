//! Random views of random occluders: no box that a ray reaches is hidden, nothing panics, and pixels and
//! answers are equal on all instruction sets.

use crate::common::boxes::{Checked, assert_hidden, extreme, random_box};
use crate::common::{draw, faces, occluder, view};
use visibility_core::glam::Vec3;
use visibility_core::{
    Aabb, Culler, OcclusionCuller, OcclusionMap, Scene, VisibleSet, occlusion::Occlusion, simd::Simd,
};
use visibility_hzb::{Coverage, Hzb};
use visibility_testing::{Random, judged, told_enough};

/// Tests random boxes on `views` random views: instruction sets must agree, and view rays to points of a
/// hidden box must meet an occluder in front of the box.
fn run(views: u64, seed: u64) {
    let mut random = Random(seed);
    let (mut hidden, mut rays) = (0u64, 0u64);
    for round in 0..views {
        let size = [[40, 24], [17, 33], [64, 64]][random.below(3)];
        let view = view(&mut random);
        let mut occluders: Vec<_> = (0..random.below(5) + 1).map(|_| occluder(&mut random)).collect();
        let plain = occluders.len();
        if random.below(4) == 0 {
            occluders.extend(extreme(&mut random));
        }
        let coverage = if random.below(8) == 0 { Coverage::Sampled } else { Coverage::Conservative };
        let new = Hzb::new(size[0], size[1]).unwrap().with_coverage(coverage);
        let maps: Vec<_> =
            Simd::available().map(|simd| draw(new.clone().with_simd(simd), &occluders, &view)).collect();
        let first = &maps[0];
        for map in &maps[1..] {
            for row in 0..size[1] {
                for column in 0..size[0] {
                    let (a, b) = (first.depth_key(column, row), map.depth_key(column, row));
                    assert_eq!(a.to_bits(), b.to_bits(), "round {round}, pixel {column},{row}");
                }
            }
        }
        let mut scene = Scene::new();
        let boxes: Vec<_> = (0..40).map(|_| random_box(&mut random)).collect();
        scene.insert_batch(boxes.iter().copied());
        for map in &maps {
            let mut set = VisibleSet::new();
            set.fill(&scene, &view);
            OcclusionCuller::new(Checked(map.clone())).cull(&scene, &view, &mut set);
        }
        let all = faces(&occluders[..plain]);
        for bounds in &boxes {
            let answer = first.test(bounds);
            for map in &maps[1..] {
                assert_eq!(map.test(bounds), answer, "round {round}, {bounds:?}");
            }
            if answer != Occlusion::Hidden || coverage == Coverage::Sampled {
                continue;
            }
            hidden += 1;
            // Rays are cast only if there are no extreme occluders, for which they are too imprecise.
            if occluders.len() == plain {
                let what = format!("round {round}");
                rays += assert_hidden(&mut random, &view, size, bounds, &all, &what);
            }
        }
    }
    judged(rays);
    told_enough(hidden > views, "too little is hidden to prove anything");
}

#[test]
fn nothing_that_a_ray_reaches_is_hidden() {
    run(4_000, 1);
}

#[test]
fn improper_boxes_are_visible() {
    let mut random = Random(3);
    let occluders: Vec<_> = (0..20).map(|_| occluder(&mut random)).collect();
    let view = view(&mut random);
    let hzb = draw(Hzb::new(64, 36).unwrap(), &occluders, &view);
    for bounds in [Aabb::EMPTY, Aabb::new(Vec3::NAN, Vec3::NAN), Aabb::new(Vec3::ONE, Vec3::ZERO)] {
        assert_eq!(hzb.test(&bounds), Occlusion::Visible, "{bounds:?}");
    }
    let endless = Aabb::new(Vec3::NEG_INFINITY, Vec3::INFINITY);
    assert_ne!(hzb.test(&endless), Occlusion::Hidden, "a box without end");
}

#[test]
fn a_map_that_was_never_begun_hides_nothing() {
    let hzb = Hzb::new(64, 36).unwrap();
    assert_ne!(hzb.test(&Aabb::from_arrays([1.0; 3], [2.0; 3])), Occlusion::Hidden, "a box behind nothing");
    assert!(
        Hzb::new(15, 36).is_err() && Hzb::new(64, 4097).is_err(),
        "pictures of 15 columns and of 4097 rows"
    );
}
