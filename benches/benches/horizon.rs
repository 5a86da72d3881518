//! Benchmark of horizons beside the z-buffer on built-in cities, and of zones among discs.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use visibility_2d::discs::{Disc, DiscView, DiscZone, Discs};
use visibility_benches::workload::Random;
use visibility_core::{Pipeline, VisibleSet};
use visibility_examples::built_in;
use visibility_examples::walkthrough::{World, cullers};

/// Measures frames of the walks through built-in cities, one frame after another.
fn walks(c: &mut Criterion) {
    let mut group = c.benchmark_group("horizon/frame of a walk");
    for scene in ["london", "town"] {
        let world =
            World::new(built_in(scene).expect("it is built in"), (640, 360), Some(32)).expect("views");
        let made: Vec<(String, Pipeline)> =
            cullers::parse("frustum,horizon,horizon-map,hzb", &world).expect("they suit the scene");
        for (name, mut pipeline) in made {
            let mut visible = VisibleSet::new();
            let mut views = world.views.iter().cycle();
            group.bench_function(BenchmarkId::new(scene, name), |b| {
                b.iter(|| views.next().map(|view| pipeline.cull(&world.scene, view, &mut visible)));
            });
        }
    }
    group.finish();
}

/// Measures a full turn among discs 4.5 m apart on average, by radius in metres, and making the set.
fn zones(c: &mut Criterion) {
    let mut random = Random(1);
    let count = 100_000;
    let side = 4.5 * f64::from(count as f32).sqrt();
    let mut place = || f64::from(random.within(0.0, 1.0)) * side;
    let centers: Vec<[f64; 2]> = (0..count).map(|_| [place(), place()]).collect();
    let mut group = c.benchmark_group("discs");
    for radius in [1.0, 0.3] {
        let discs: Vec<Disc> = centers.iter().map(|&center| Disc { center, radius }).collect();
        let made = Discs::new(&discs).expect("finite discs");
        let (mut zone, mut seen) = (DiscZone::new(), Vec::new());
        let eye = [0.5 * side, 0.5 * side];
        group.bench_function(BenchmarkId::new("full turn", radius), |b| {
            b.iter(|| zone.look(&made, &DiscView::new(eye), &mut seen));
        });
        group.bench_function(BenchmarkId::new("make 100,000", radius), |b| b.iter(|| Discs::new(&discs)));
    }
    group.finish();
}

criterion_group!(benches, walks, zones);
criterion_main!(benches);
