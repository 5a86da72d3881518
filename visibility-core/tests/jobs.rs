//! One view on several threads: the same answer, bit for bit, with any job system.

use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::jobs::{OneThread, for_each_part};
use visibility_core::occlusion::Occlusion;
use visibility_core::{
    Aabb, Accuracy, CullStats, FrustumCuller, Object, ObjectId, OccluderMesh, OcclusionCuller, OcclusionMap,
    Pipeline, Pose, Scene, View, VisibleSet,
};
use visibility_testing::Random;
use visibility_testing::allocations::ALLOCATIONS;
use visibility_testing::job_systems::for_each_job_system;

/// Returns a scene of `count` small boxes on one of two layers each. Some are never culled. A tenth has moved
/// since the hierarchy was built, and some were removed, so that nodes have free lanes.
fn scene(random: &mut Random, count: usize) -> Scene {
    let mut scene = Scene::new();
    let ids: Vec<_> = (0..count)
        .map(|_| {
            let object = Object { never_cull: random.one_in(500), ..Object::new(random.small_box(200.0)) };
            scene.insert(Object { layers: 1 + random.below(3) as u32, ..object })
        })
        .collect();
    scene.rebuild();
    for &id in &ids {
        if random.one_in(10) {
            scene.set_bounds(id, random.small_box(200.0)).unwrap();
        } else if random.one_in(10) {
            scene.remove(id).unwrap();
        }
    }
    scene
}

fn view(random: &mut Random) -> View {
    let eye = random.vector(150.0);
    let pose = Pose::look_at(eye, eye + random.vector(1.0), DVec3::Z);
    let far = if random.one_in(2) { f64::INFINITY } else { 150.0 };
    View::perspective(pose, 1.2, 1.6, 0.1, far).unwrap().with_layers(1 + random.below(3) as u32)
}

/// A map that hides boxes beyond x = 20 and finds boxes before x = 0 wholly visible.
struct Slab;

impl OcclusionMap for Slab {
    fn name(&self) -> &str {
        "slab"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Approximate
    }

    fn begin(&mut self, _: &View, _: DVec3) {}

    fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}

    fn flush(&mut self) {}

    fn test(&self, bounds: &Aabb) -> Occlusion {
        if bounds.min.x > 20.0 {
            Occlusion::Hidden
        } else if bounds.max.x < 0.0 {
            Occlusion::Visible
        } else {
            Occlusion::Partial
        }
    }

    fn shared(&self) -> Option<&(dyn OcclusionMap + Sync)> {
        Some(self)
    }
}

/// Returns the counters of each stage, and the objects that are left.
fn answer(
    scene: &Scene,
    pipeline: &Pipeline,
    visible: &VisibleSet,
    sum: CullStats,
) -> (Vec<CullStats>, Vec<ObjectId>) {
    let stages = pipeline.stages().map(|(_, stats)| stats).chain([sum]);
    (stages.collect(), visible.iter(scene).collect())
}

#[test]
fn the_answer_does_not_depend_on_the_job_system() {
    let mut random = Random(41);
    let (mut left, mut hidden) = (0, 0);
    // Scenes without a tree, with one leaf, with leaves below the root, with few parents of leaves, with one
    // level more, and with many parents of leaves.
    for count in [0, 30, 3000, 40_000, 300_000, 90_000] {
        let scene = scene(&mut random, count);
        let make = || {
            let slab = |price| OcclusionCuller::new(Slab).with_price(price);
            Pipeline::new().with(FrustumCuller::new()).with(slab(0)).with(slab(24))
        };
        for _ in 0..if count > 50_000 { 3 } else { 20 } {
            let view = view(&mut random);
            let (mut pipeline, mut visible) = (make(), VisibleSet::new());
            let sum = pipeline.cull(&scene, &view, &mut visible);
            let expected = answer(&scene, &pipeline, &visible, sum);
            left += expected.1.len();
            hidden += expected.0[0].visible - expected.0[1].visible;
            let (mut pipeline, mut visible) = (make(), VisibleSet::new());
            for_each_job_system(|name, jobs| {
                let sum = pipeline.cull_on(jobs, &scene, &view, &mut visible);
                let found = answer(&scene, &pipeline, &visible, sum);
                assert!(found == expected, "{count} objects with {name}: {:?}, {:?}", found.0, expected.0);
            });
        }
    }
    assert!(left > 50_000 && hidden > 30_000, "{left} objects left, {hidden} hidden");
}

#[test]
fn every_part_is_done_once() {
    for_each_job_system(|name, jobs| {
        let mut done = [0; 37];
        for_each_part(jobs, done.each_mut(), |count| *count += 1);
        assert_eq!(done, [1; 37], "{name}");
    });
}

#[test]
fn warm_frames_allocate_nothing() {
    let mut random = Random(42);
    let scene = scene(&mut random, 20_000);
    let views: Vec<_> = (0..8).map(|_| view(&mut random)).collect();
    let slab = OcclusionCuller::new(Slab).with_price(0);
    let (mut pipeline, mut visible) =
        (Pipeline::new().with(FrustumCuller::new()).with(slab), VisibleSet::new());
    let mut frame = |view| pipeline.cull_on(&OneThread, &scene, view, &mut visible).visible;
    let first: Vec<_> = views.iter().map(&mut frame).collect();
    let before = ALLOCATIONS.get();
    let again = views.iter().zip(&first).filter(|&(view, &visible)| frame(view) == visible).count();
    assert_eq!(ALLOCATIONS.get(), before, "allocations in warm frames");
    assert_eq!(again, views.len(), "warm frames that show as many objects as the first");
}
