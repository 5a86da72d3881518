//! Tests that all instruction sets and job systems draw a level alike, and that warm frames allocate nothing.

use super::{level, triangles, view_within};
use crate::common::scene;
use visibility_core::glam::DVec3;
use visibility_core::simd::Simd;
use visibility_core::{Aabb, FrustumCuller, OcclusionMap, Pipeline, View, VisibleSet};
use visibility_hzb::{Hzb, HzbCuller};
use visibility_occluders::LevelSettings;
use visibility_testing::Random;
use visibility_testing::allocations::ALLOCATIONS;
use visibility_testing::job_systems::{Reversed, for_each_job_system};

/// Returns the bits of the depth keys of a buffer of `width` by `height` pixels.
fn pixels(map: &Hzb, width: usize, height: usize) -> Vec<u32> {
    let at = (0..height).flat_map(|row| (0..width).map(move |column| (column, row)));
    at.map(|(column, row)| map.depth_key(column, row).to_bits()).collect()
}

/// A level that is drawn in bands gives the same pixels, and a pipeline the same objects, with any job
/// system. The pixels are nearly those of a level drawn as a whole. Occluders of the scene are drawn over the
/// level. A warm frame allocates nothing.
#[test]
fn job_systems_agree_and_bands_lose_next_to_nothing() {
    let mut random = Random(35);
    let is_covered = |&&key: &&u32| f32::from_bits(key) > f32::NEG_INFINITY;
    let (mut whole, mut banded, mut hidden) = (0, 0, 0);
    for round in 0..30 {
        let triangles = triangles(&mut random);
        let level = level(&triangles, LevelSettings::default());
        let mut scene = scene(&mut random, 20);
        for _ in 0..6000 {
            let middle = random.vec3(-20.0, 20.0);
            scene.insert(Aabb::new(middle - 0.1, middle + 0.1));
        }
        let size = [[200, 120], [64, 16], [90, 333]][round % 3];
        let mut map =
            Hzb::new(size[0], size[1]).unwrap().with_min_polygon_area(16.0).with_level(level, DVec3::ZERO);
        let pixels = |map: &Hzb| pixels(map, size[0], size[1]);
        let make = |map: &Hzb| {
            let culler = HzbCuller::new(map.clone()).with_price(if round % 2 == 0 { 0 } else { 24 });
            (Pipeline::new().with(FrustumCuller::new()).with(culler), VisibleSet::new())
        };
        for _ in 0..3 {
            let view = view_within(&mut random, &triangles);
            map.begin(&view, DVec3::ZERO);
            whole += pixels(&map).iter().filter(is_covered).count();
            map.begin_within(&view, DVec3::ZERO, f32::INFINITY, Some(&Reversed));
            let before = ALLOCATIONS.get();
            map.begin_within(&view, DVec3::ZERO, f32::INFINITY, Some(&Reversed));
            assert_eq!(ALLOCATIONS.get(), before, "round {round}");
            let first = pixels(&map);
            banded += first.iter().filter(is_covered).count();
            let mut answer = None;
            for_each_job_system(|name, jobs| {
                map.begin_within(&view, DVec3::ZERO, f32::INFINITY, Some(jobs));
                assert!(pixels(&map) == first, "round {round}: other pixels with {name}");
                let (mut pipeline, mut visible) = make(&map);
                let stats = pipeline.cull_on(jobs, &scene, &view, &mut visible);
                let own = (stats, visible.ids(&scene).to_vec());
                hidden += pipeline.stages().next().unwrap().1.visible - stats.visible;
                assert!(
                    *answer.get_or_insert(own.clone()) == own,
                    "round {round}: other objects with {name}"
                );
            });
        }
    }
    assert!(banded * 1000 >= whole * 995, "{banded} pixels in bands, {whole} as a whole");
    assert!(whole > 100_000 && hidden > 10_000, "{whole} pixels are covered, {hidden} objects hidden");
}

/// All instruction sets give the same pixels, and a warm frame allocates nothing.
#[test]
fn instruction_sets_agree_and_warm_frames_allocate_nothing() {
    let mut random = Random(34);
    let mut covered = 0;
    let pixels = |map: &Hzb| pixels(map, 200, 120);
    for round in 0..40 {
        let triangles = triangles(&mut random);
        let level = level(&triangles, LevelSettings::default().with_max_cluster_edges([16, 96][round % 2]));
        let new = Hzb::new(200, 120).unwrap().with_min_polygon_area(16.0).with_level(level, DVec3::ZERO);
        let mut maps: Vec<Hzb> = Simd::available().map(|simd| new.clone().with_simd(simd)).collect();
        let views: [View; 3] = std::array::from_fn(|_| view_within(&mut random, &triangles));
        for pass in 0..2 {
            for view in &views {
                for map in &mut maps {
                    let before = ALLOCATIONS.get();
                    map.begin(view, DVec3::ZERO);
                    map.flush();
                    assert!(pass == 0 || ALLOCATIONS.get() == before, "round {round}");
                }
                let first = pixels(&maps[0]);
                covered += first.iter().filter(|&&key| f32::from_bits(key) > f32::NEG_INFINITY).count();
                assert!(maps.iter().all(|map| pixels(map) == first), "round {round}");
            }
        }
    }
    assert!(covered > 100_000, "{covered} pixels are covered");
}
