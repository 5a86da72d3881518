//! Benchmark of the object-space cullers on built-in scenes, compared with the z-buffer: preparation, whole
//! frames of the walks, and frames with an eye that hardly moves.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use std::sync::Arc;
use visibility_bsp::{
    BspOrderCuller, LargeOccludersCuller, NaylorCuller, Occluders, OcclusionTreeCuller, SceneTree,
    ShadowFrusta, ShadowFrustaCuller,
};
use visibility_core::{Culler, FrustumCuller, Pipeline, Pose, View, VisibleSet};
use visibility_examples::built_in;
use visibility_examples::walkthrough::World;
use visibility_hzb::{Hzb, HzbCuller};

const SCENES: [&str; 3] = ["plpcity", "office", "town"];

/// Makes the world of a built-in scene with a frame per key of its walks.
fn world(name: &str) -> World {
    World::new(built_in(name).expect("a built-in scene"), (1280, 720), None).expect("a walk")
}

fn preparation(c: &mut Criterion) {
    let mut group = c.benchmark_group("occluders/made in advance");
    group.sample_size(10);
    for name in SCENES {
        let world = world(name);
        group.bench_function(BenchmarkId::new("tree of the scene", name), |b| {
            b.iter(|| SceneTree::new(&world.scene))
        });
        group.bench_function(BenchmarkId::new("polygons", name), |b| b.iter(|| Occluders::new(&world.scene)));
        let occluders = Occluders::new(&world.scene);
        group.bench_function(BenchmarkId::new("64 regions", name), |b| {
            b.iter(|| ShadowFrusta::new(&world.scene, occluders.clone(), 64, 32))
        });
    }
    group.finish();
}

/// Measures the frames of the walks, each with a reset pipeline as if it were the first frame.
fn walks(c: &mut Criterion) {
    for name in SCENES {
        let world = world(name);
        let occluders = Arc::new(Occluders::new(&world.scene));
        let frusta = ShadowFrusta::new(&world.scene, Occluders::clone(&occluders), 256, 32);
        let tree = Arc::new(SceneTree::new(&world.scene).expect("a tree"));
        let cullers: [Box<dyn Culler + Send + Sync>; 6] = [
            Box::new(HzbCuller::new(Hzb::new(512, 288).expect("a size in range"))),
            Box::new(OcclusionTreeCuller::new(occluders.clone())),
            Box::new(ShadowFrustaCuller::new(frusta.into())),
            Box::new(LargeOccludersCuller::new(occluders)),
            Box::new(BspOrderCuller::new(tree.clone())),
            Box::new(NaylorCuller::new(tree)),
        ];
        let mut group = c.benchmark_group(format!("occluders/walk of {name}"));
        for culler in cullers {
            let culler_name = culler.name().to_owned();
            let mut pipeline = Pipeline::new().with(FrustumCuller::new());
            pipeline.push(culler);
            let mut visible = VisibleSet::new();
            let mut views = world.views.iter().cycle();
            group.bench_function(culler_name, |b| {
                b.iter(|| {
                    pipeline.reset();
                    views.next().map(|view| pipeline.cull(&world.scene, view, &mut visible))
                });
            });
        }
        group.finish();
    }
}

/// Measures 40 frames at each of about eight positions of the walks. The eye stands still or moves by 2 mm
/// per frame.
fn slow_walks(c: &mut Criterion) {
    for name in SCENES {
        let world = world(name);
        let occluders = Arc::new(Occluders::new(&world.scene));
        let mut group = c.benchmark_group(format!("occluders/slow walk of {name}"));
        for (speed, step) in [("still", 0.0), ("2 mm a frame", 0.002)] {
            let poses = world.poses.iter().step_by(world.poses.len() / 8);
            let views: Vec<View> = poses
                .flat_map(|&(pose, _)| (0..40).map(move |frame| slowly(pose, step * f64::from(frame))))
                .collect();
            for (memory, coherent) in [("with memory", true), ("without", false)] {
                let culler = LargeOccludersCuller::new(occluders.clone());
                let culler = if coherent { culler } else { culler.without_coherence() };
                let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
                let mut visible = VisibleSet::new();
                let mut next = views.iter().cycle();
                group.bench_function(BenchmarkId::new(memory, speed), |b| {
                    b.iter(|| next.next().map(|view| pipeline.cull(&world.scene, view, &mut visible)));
                });
            }
        }
        group.finish();
    }
}

/// Returns the view of a pose moved forwards and sideways by `distance` metres and rotated slightly.
fn slowly(pose: Pose, distance: f64) -> View {
    let eye = pose.eye + (pose.forward + 0.5 * pose.right).normalize() * distance;
    let target = eye + pose.forward + pose.right * distance;
    View::perspective(Pose::look_at(eye, target, pose.up), 1.0, 16.0 / 9.0, 0.1, f64::INFINITY)
        .expect("a camera by the book")
}

criterion_group!(benches, preparation, walks, slow_walks);
criterion_main!(benches);
