//! Benchmarks of sets made online: all boxes that some metres of a walk need, once those of its first place
//! are made, and a frame that a viewcell answers.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use visibility_core::glam::DVec3;
use visibility_core::{Culler, Pose, View, VisibleSet};
use visibility_examples::region::{cells, world};
use visibility_region::OnlinePvs;

/// Length of the walk in metres, and distance from one place to the next.
const LENGTH: f64 = 3.0;
const STEP: f64 = 0.1;

/// Makes all boxes that are missing around `places`.
fn make(online: &mut OnlinePvs, scene: &visibility_core::Scene, places: &[DVec3]) {
    while online.step(scene, places, u32::MAX).is_some() {}
}

fn online(c: &mut Criterion) {
    let mut group = c.benchmark_group("online");
    group.sample_size(10);
    for name in ["london", "office"] {
        let world = world(visibility_examples::open(name).expect("a built-in scene"));
        let (scene, keys) = (&world.scene, &world.source.walks[0].keys);
        let (eye, ahead) = (keys[0].eye, (keys[1].eye - keys[0].eye).normalize());
        let places: Vec<DVec3> =
            (0..).map(|i| STEP * f64::from(i)).take_while(|&x| x < LENGTH).map(|x| eye + ahead * x).collect();
        let size = |width: f64, height: f64| cells::on_axes([width, width, height], world.source.up);
        let mut first = OnlinePvs::new(size(0.6, 0.6), size(4.0, 1.2)).unwrap();
        make(&mut first, scene, &places[..1]);
        group.bench_function(BenchmarkId::new("boxes of a walk of 3 m", name), |b| {
            b.iter(|| {
                let mut online = first.clone();
                places.windows(5).for_each(|places| make(&mut online, scene, places));
                black_box(online);
            });
        });
        let pose = Pose::look_at(eye, eye + ahead, world.source.up.as_dvec3());
        let view = View::perspective(pose, 1.2, 1.5, 0.02, f64::INFINITY).expect("a view of finite numbers");
        group.bench_function(BenchmarkId::new("a frame", name), |b| {
            b.iter(|| {
                let mut visible = VisibleSet::new();
                black_box(first.cull(scene, &view, &mut visible));
            });
        });
    }
    group.finish();
}

criterion_group!(benches, online);
criterion_main!(benches);
