//! Benchmark of exact visibility from a viewcell of a house: with rays only, and with rays and proofs.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::sync::Arc;
use visibility_exact::{Effort, ExactCuller, ExactSettings, SceneTriangles};
use visibility_examples::region::{cells, world};

fn viewcells(c: &mut Criterion) {
    let mut group = c.benchmark_group("exact viewcell");
    group.sample_size(10);
    let world = world(visibility_examples::open("office").expect("a built-in scene"));
    let cell = cells::along_walks(&world, 1, [3.0, 3.0, 1.0]).pop().expect("a viewcell on a walk");
    let triangles = Arc::new(SceneTriangles::new(&world.scene));
    for (name, effort) in
        [("rays", Effort::Rays(200)), ("exact", Effort::Exact(1e-4)), ("conservative", Effort::Exact(0.0))]
    {
        let mut culler = ExactCuller::new(triangles.clone(), ExactSettings::new(effort));
        group.bench_function(BenchmarkId::new(name, "office"), |b| {
            b.iter(|| black_box(culler.verdicts(&cell)));
        });
    }
    group.finish();
}

criterion_group!(benches, viewcells);
criterion_main!(benches);
