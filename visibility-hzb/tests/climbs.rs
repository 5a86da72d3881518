//! Climbs towards boxes that the buffer hides and a line of sight reaches, with cameras, meshes and lines of
//! sight in exact arithmetic: any exact matrix, any power of two as the unit of coordinates, moved origins.

use std::sync::Arc;
use visibility_core::glam::Affine3A;
use visibility_core::occlusion::Occlusion;
use visibility_core::{OcclusionMap, simd::Simd};
use visibility_hzb::Hzb;
#[cfg(feature = "papers")]
use visibility_hzb::{DepthEstimate, Hom};
use visibility_occluders::{LevelOccluders, LevelSettings, LevelTriangle};
use visibility_testing::{Random, SightWorld, climb, judged, told_enough};

/// Returns whether a map hides the target of a world.
fn hides(map: &mut dyn OcclusionMap, world: &SightWorld) -> bool {
    let (Some(view), Some(mesh)) = (world.view(), world.mesh()) else { return false };
    map.begin(&view, world.origin());
    map.add(&mesh, &Affine3A::IDENTITY);
    map.flush();
    map.test(&world.target()) == Occlusion::Hidden
}

/// Climbs from `count` random worlds with a map of random size and asserts that no hidden target is seen.
fn run(seed: u64, count: usize, make: impl Fn(&mut Random, [usize; 2]) -> Box<dyn OcclusionMap>) {
    let mut random = Random(seed);
    let (mut started, mut all) = (0, 0);
    for number in 0..count {
        let world = SightWorld::seen_by_camera(&mut random);
        let size = random.pick(&[[64, 36], [16, 17], [130, 50], [333, 77]]);
        let mut map = make(&mut random, size);
        let Some(end) = climb(world, &mut random, 60, |world| hides(&mut *map, world)) else { continue };
        assert!(end.least > 0.0, "world {number}, {size:?} pixels: hidden and seen: {:?}", end.input);
        started += 1;
        all += end.judged;
    }
    judged(all);
    told_enough(
        started > count / 8 && all > 8 * started as u64,
        format_args!("{started} worlds of {count}, {all} inputs"),
    );
}

#[test]
fn no_climb_ends_at_a_box_that_the_buffer_hides_and_a_line_reaches() {
    let simd: Vec<Simd> = Simd::available().collect();
    run(1, 1500, |random, [width, height]| {
        Box::new(Hzb::new(width, height).unwrap().with_simd(random.pick(&simd)))
    });
}

#[cfg(feature = "papers")]
#[test]
fn no_climb_ends_at_a_box_that_occlusion_maps_hide_and_a_line_reaches() {
    run(2, 1500, |random, [width, height]| {
        let estimate =
            random.pick(&[DepthEstimate::Plane, DepthEstimate::Buffer, DepthEstimate::NoBackground]);
        Box::new(Hom::new(width, height).unwrap().with_depth_estimate(estimate))
    });
}

#[test]
fn no_climb_ends_at_a_box_that_a_level_hides_and_a_line_reaches() {
    let mut random = Random(3);
    let (mut started, mut all) = (0, 0);
    for number in 0..1000 {
        let world = SightWorld::seen_by_camera(&mut random).with_fixed_triangles();
        let two_sided = world.is_two_sided();
        let triangle = |corners| LevelTriangle { corners, two_sided };
        let triangles: Vec<LevelTriangle> = world.mesh_triangles().into_iter().map(triangle).collect();
        let settings = LevelSettings::default().with_kept_area(1.0);
        let Ok(level) = LevelOccluders::new(&triangles, settings) else { continue };
        let size = random.pick(&[[64, 36], [16, 17], [130, 50], [333, 77]]);
        let mut hzb = Hzb::new(size[0], size[1]).unwrap().with_level(Arc::new(level), world.origin());
        let end = climb(world, &mut random, 60, |world| {
            let Some(view) = world.view() else { return false };
            hzb.begin(&view, world.origin());
            hzb.flush();
            hzb.test(&world.target()) == Occlusion::Hidden
        });
        let Some(end) = end else { continue };
        assert!(end.least > 0.0, "world {number}, {size:?} pixels: hidden and seen: {:?}", end.input);
        started += 1;
        all += end.judged;
    }
    judged(all);
    told_enough(started > 30 && all > 8 * started, format_args!("{started} worlds, {all} inputs"));
}
