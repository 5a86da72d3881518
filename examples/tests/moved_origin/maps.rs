//! Tests of occlusion maps without the driver: a frame must contain nothing of earlier frames, whatever was
//! added, flushed or tested in those, and wherever the origin was.

use super::live::{LateDevice, Queries};
use super::world::{Camera, move_origin, scene};
use visibility_2d::horizon::{Horizon, UpAxis};
use visibility_2d::view_cdt::ViewCdt;
use visibility_bsp::OcclusionTree;
use visibility_core::occlusion::{HardwareQueries, LateAnswers, Occlusion};
use visibility_core::{Aabb, OcclusionMap, Scene};
use visibility_hzb::{Hom, Hzb};
use visibility_testing::Random;

/// Draws some occluders of a scene into a map, and flushes it if `flushes`.
fn draw(map: &mut dyn OcclusionMap, scene: &Scene, rng: &mut Random, flushes: bool) {
    for id in scene.ids() {
        let (mesh, ref transform) = scene.occluder(id).unwrap();
        if rng.one_in(4) {
            map.add(mesh, transform);
        }
    }
    if flushes {
        map.flush();
    }
}

/// Runs a map for many frames, and compares each frame with a map newly made for it.
fn hold<M: OcclusionMap>(make: fn() -> M) {
    let mut rng = Random(3);
    let (mut scene, mut live) = (scene(&mut rng), make());
    let boxes: Vec<Aabb> = scene.ids().map(|id| scene.bounds(id).unwrap()).collect();
    let mut hidden = 0;
    for frame in 0..120 {
        let camera = Camera::random(&scene, 12.0, &mut rng);
        // An extra frame, ended before or after its occluders take effect.
        live.begin(&camera.view, scene.origin());
        draw(&mut live, &scene, &mut rng, frame % 2 == 0);
        for bounds in &boxes {
            let _ = live.test_mut(bounds);
        }
        if !rng.one_in(4) {
            move_origin(&mut scene, &mut rng);
        }
        let camera = if rng.one_in(2) { camera } else { Camera::random(&scene, 12.0, &mut rng) };
        let mut fresh = make();
        let seed = rng.bits();
        for map in [&mut live as &mut dyn OcclusionMap, &mut fresh] {
            map.begin(&camera.view, scene.origin());
            draw(map, &scene, &mut Random(seed), true);
        }
        for bounds in &boxes {
            let answer = live.test_mut(bounds);
            let is_less = answer == Occlusion::Hidden && fresh.test_mut(bounds) != Occlusion::Hidden;
            assert!(!is_less, "{} hides {bounds:?} in frame {frame} for an earlier frame", live.name());
            hidden += usize::from(answer == Occlusion::Hidden);
        }
    }
    assert!(hidden > 100, "{}: {hidden} boxes hidden", live.name());
}

#[test]
fn a_frame_of_a_map_has_nothing_of_the_frames_before() {
    hold(|| Hzb::new(128, 80).unwrap());
    hold(|| Hom::new(128, 80).unwrap());
    hold(ViewCdt::new);
    hold(|| Horizon::new(UpAxis::Z));
    hold(OcclusionTree::new);
}

/// Late answers belong to an earlier frame, and only count with that frame's origin.
#[test]
fn late_answers_are_of_their_origin() {
    for late in [LateAnswers::Visible, LateAnswers::Trusted { frames: 8 }] {
        let mut rng = Random(4);
        let mut scene = scene(&mut rng);
        let mut map = Queries(HardwareQueries::new(LateDevice::new(), late));
        let mut counts = [0; 2];
        for _ in 0..200 {
            let camera = Camera::random(&scene, 12.0, &mut rng);
            let boxes: Vec<Aabb> = scene.ids().map(|id| scene.bounds(id).unwrap()).collect();
            for frame in 0..3 {
                if frame == 2 {
                    scene.set_origin(scene.origin() + rng.vector(8.0)).unwrap();
                }
                map.begin(&camera.view, scene.origin());
                for id in scene.ids() {
                    let (mesh, ref transform) = scene.occluder(id).unwrap();
                    map.add(mesh, transform);
                }
                map.flush();
                let hidden = boxes.iter().filter(|bounds| map.test_mut(bounds) == Occlusion::Hidden).count();
                if frame > 0 {
                    counts[frame - 1] += hidden;
                }
            }
        }
        assert!(counts[0] > 100, "{late:?}: {counts:?} is no test");
        assert_eq!(
            counts[1], 0,
            "{late:?}: boxes of equal numbers are other boxes once the origin has moved"
        );
    }
}
