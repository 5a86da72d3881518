//! Benchmark of building a scene from boxes and of rebuilding it, compared with sorting as many keys and with
//! the BVH builders of other crates.

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use parry3d::partitioning::BvhBuildStrategy;
use std::{hint::black_box, time::Duration};
use visibility_benches::contenders::{Shape, parry_aabb};
use visibility_benches::workload::{Order, Random, boxes};
use visibility_core::Scene;

fn construction(c: &mut Criterion) {
    for count in [100_000, 1_000_000] {
        let mut group = c.benchmark_group(format!("construction/{count}"));
        group.throughput(Throughput::Elements(count as u64));
        group.sample_size(10).measurement_time(Duration::from_secs(3));
        group.warm_up_time(Duration::from_millis(500));

        let mut random = Random(3);
        let keys: Vec<u64> = (0..count).map(|_| random.bits()).collect();
        group.bench_function("sort_unstable of u64", |b| {
            b.iter_batched_ref(|| keys.clone(), |keys| keys.sort_unstable(), BatchSize::PerIteration);
        });

        for order in Order::ALL {
            let boxes = boxes(count, order);
            group.bench_function(BenchmarkId::new("visibility, insert_batch", order.name()), |b| {
                // The scene is returned, so that dropping it is not measured.
                let build = |mut scene: Scene| {
                    black_box(scene.insert_batch(boxes.iter().copied()));
                    scene
                };
                b.iter_batched(Scene::new, build, BatchSize::PerIteration);
            });
            group.bench_function(BenchmarkId::new("visibility, rebuild", order.name()), |b| {
                let mut scene = Scene::new();
                scene.insert_batch(boxes.iter().copied());
                b.iter(|| scene.rebuild());
            });
        }

        let boxes = boxes(count, Order::Random);
        let leaves: Vec<_> = boxes.iter().map(parry_aabb).collect();
        for strategy in [BvhBuildStrategy::Binned, BvhBuildStrategy::Ploc] {
            group.bench_function(format!("parry3d 0.31 Bvh, {strategy:?}"), |b| {
                b.iter_with_large_drop(|| parry3d::partitioning::Bvh::from_leaves(strategy, &leaves));
            });
        }
        let mut shapes: Vec<_> = (0..).zip(&boxes).map(|(index, b)| Shape::new(b, index)).collect();
        group.bench_function("bvh 0.13", |b| {
            b.iter_with_large_drop(|| bvh::bvh::Bvh::build(&mut shapes));
        });
    }
}

criterion_group!(benches, construction);
criterion_main!(benches);
