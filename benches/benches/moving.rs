//! Benchmark of moving 1 %, 10 % and all of the objects each frame, with and without `maintain`, and of
//! culling afterwards.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::{Duration, Instant};
use visibility_benches::moving::{BUDGET, DRIFT, Movers};
use visibility_benches::workload::{FRAMES, Order, Share, boxes, views};
use visibility_core::{FrustumCuller, Pipeline, Scene, VisibleSet};

/// Budgets, in blocks, with which `maintain` is called each frame; `None` never calls it.
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

criterion_group!(benches, moving);
criterion_main!(benches);
