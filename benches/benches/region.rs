//! Benchmark of visibility from viewcells: the sweep, compared with 40 item-buffer cubes of 256 by 256 pixels
//! from the same viewcell, and the sweep in a city with ten times as many objects.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use visibility_core::{RegionCuller, VisibleSet};
use visibility_examples::region::judge::{Effort, Judge};
use visibility_examples::region::{cells, world};
use visibility_region::ExtendedProjectionCuller;

fn viewcells(c: &mut Criterion) {
    let mut group = c.benchmark_group("viewcell");
    group.sample_size(10);
    for name in ["london", "london:38,38"] {
        let world = world(visibility_examples::open(name).expect("a built-in scene"));
        let cell = cells::along_walks(&world, 1, [20.0, 20.0, 3.0]).pop().expect("a viewcell on a walk");
        let mut culler = ExtendedProjectionCuller::new();
        culler.sync(&world.scene);
        let mut visible = VisibleSet::new();
        group.bench_function(BenchmarkId::new("sweep", name), |b| {
            b.iter(|| {
                visible = VisibleSet::new();
                black_box(culler.cull(&world.scene, &cell, &mut visible));
            });
        });
        if name != "london" {
            continue;
        }
        let effort = Effort { eyes: 40, side: 256, rays: 0 };
        let mut judge = Judge::new(&world, effort).expect("a side that item buffers have");
        let mut seen = vec![false; world.source.objects.len()];
        group.bench_function(BenchmarkId::new("40 cubes of 256x256", name), |b| {
            b.iter(|| judge.cubes(&cell, &mut seen).expect("few triangles"));
        });
    }
    group.finish();
}

criterion_group!(benches, viewcells);
criterion_main!(benches);
