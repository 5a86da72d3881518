//! Benchmark of moving 1 %, 10 % and all of the objects in each frame, with and without `maintain`, and of
//! culling afterwards, compared with one sort of as many keys. Also of moving occluders, by transforms and by
//! bounds and meshes.

use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::{Duration, Instant};
use visibility_benches::moving::{BUDGET, DRIFT, Movers};
use visibility_benches::workload::{FRAMES, Order, Share, boxes, views};
use visibility_core::glam::Affine3A;
use visibility_core::{Aabb, FrustumCuller, Object, OccluderMesh, Pipeline, Scene, VisibleSet};

/// Budgets, in blocks, for `maintain` in each frame. `None` never calls it.
const BUDGETS: [(&str, Option<usize>); 3] =
    [("alone", None), ("with maintain(256)", Some(BUDGET)), ("with maintain of all", Some(usize::MAX))];

fn moving(c: &mut Criterion) {
    for count in [100_000, 1_000_000] {
        for percent in [1, 10, 100] {
            let boxes = boxes(count, Order::Random);
            let mut fresh = Scene::new();
            let ids = fresh.insert_batch(boxes.iter().copied());
            let start = Movers::new(boxes, &ids, count * percent / 100);

            let mut group = c.benchmark_group(format!("moving/{count}/{percent} %"));
            group.sample_size(10).measurement_time(Duration::from_secs(2));
            group.warm_up_time(Duration::from_millis(500));
            let mut random = 0x9e37_79b9_7f4a_7c15u64;
            let keys: Vec<u64> = std::iter::repeat_with(|| {
                random = random.wrapping_mul(0xd129_0247_1d8b_f3c5).rotate_left(23) ^ 0x5bd1_e995;
                random
            })
            .take(count)
            .collect();
            group.bench_function("sort of as many keys as objects", |b| {
                b.iter_batched_ref(|| keys.clone(), |keys| keys.sort_unstable(), BatchSize::LargeInput);
            });
            for (name, budget) in BUDGETS {
                let (mut scene, mut movers) = (fresh.clone(), start.clone());
                group.bench_function(BenchmarkId::new("set_bounds_batch", name), |b| {
                    b.iter_custom(|frames| (0..frames).map(|_| frame(&mut scene, &mut movers, budget)).sum());
                });
            }

            let views = views(Share::Eleven);
            for (name, budget) in BUDGETS {
                let (mut scene, mut movers) = (fresh.clone(), start.clone());
                (0..DRIFT).for_each(|_| _ = frame(&mut scene, &mut movers, budget));
                let mut bench = |name: &str, scene: &Scene| {
                    let mut pipeline = Pipeline::new().with(FrustumCuller::new());
                    let (mut set, mut at) = (VisibleSet::new(), 0);
                    group.bench_function(BenchmarkId::new("culling afterwards", name), |b| {
                        b.iter(|| {
                            at = (at + 1) % FRAMES;
                            black_box(pipeline.cull(scene, &views[at], &mut set))
                        });
                    });
                };
                bench(name, &scene);
                if budget.is_none() {
                    scene.rebuild();
                    bench("rebuilt", &scene);
                }
            }
        }
    }
}

/// Moves 48,700 occluders in each frame: by one batch of transforms, or by a batch of bounds and `set_mesh`
/// for each.
fn occluders(c: &mut Criterion) {
    const COUNT: usize = 48_700;
    let boxes = boxes(COUNT, Order::Random);
    let mut by_transforms = Scene::new();
    let local = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
    let mesh = by_transforms.add_mesh(OccluderMesh::cuboid(&local).expect("a box is a mesh"));
    let ids = by_transforms.insert_batch(boxes.iter().map(|b| Object { occluder: true, ..Object::new(*b) }));
    let mut by_bounds = by_transforms.clone();
    // The clone has the same mesh ids as the original.
    for &id in &ids {
        by_transforms.set_local_bounds(id, local).expect("just inserted");
        by_transforms.set_mesh(id, mesh, Affine3A::IDENTITY).expect("just inserted");
    }
    // Two sets of transforms, a quarter of a metre apart, between which the frames alternate.
    let states = [0.0, 0.25].map(|shift| {
        let place = |b: &Aabb| Affine3A::from_translation(b.center() + shift);
        let transforms: Vec<_> = ids.iter().zip(&boxes).map(|(&id, b)| (id, place(b))).collect();
        let arrays: Vec<_> = transforms.iter().map(|(id, place)| (*id, place.to_cols_array())).collect();
        let bounds: Vec<_> = transforms.iter().map(|(id, place)| (*id, local.transformed(place))).collect();
        (transforms, arrays, bounds)
    });
    by_transforms.set_transforms_batch(&states[0].1).expect("all have local bounds");
    by_transforms.rebuild();
    by_bounds.set_bounds_batch(&states[0].2).expect("all are in the scene");
    by_bounds.rebuild();
    let mut group = c.benchmark_group("moving/occluders");
    group.sample_size(20).measurement_time(Duration::from_secs(1));
    let mut frame = 0;
    group.bench_function("set_transforms_batch", |b| {
        b.iter(|| {
            frame += 1;
            by_transforms.set_transforms_batch(&states[frame % 2].1).expect("all have local bounds");
        });
    });
    group.bench_function("set_bounds_batch and set_mesh", |b| {
        b.iter(|| {
            frame += 1;
            let (transforms, _, bounds) = &states[frame % 2];
            by_bounds.set_bounds_batch(bounds).expect("all are in the scene");
            for &(id, transform) in transforms {
                by_bounds.set_mesh(id, mesh, transform).expect("all are in the scene");
            }
        });
    });
}

/// Advances all movers by one frame. Returns the time to update the scene, including `maintain` if `budget`
/// (in blocks) is not `None`.
fn frame(scene: &mut Scene, movers: &mut Movers, budget: Option<usize>) -> Duration {
    let moved = movers.step();
    let start = Instant::now();
    scene.set_bounds_batch(moved).expect("every mover is in the scene");
    if let Some(budget) = budget {
        black_box(scene.maintain(budget));
    }
    start.elapsed()
}

criterion_group!(benches, moving, occluders);
criterion_main!(benches);
