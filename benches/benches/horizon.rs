//! Benchmark of horizons on built-in cities, compared with the z-buffer, and of visible discs, computed from
//! scratch and updated.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use visibility_2d::discs::{DiscView, DiscZone, Discs, KineticZone};
use visibility_core::{Pipeline, VisibleSet};
use visibility_examples::built_in;
use visibility_examples::floor_plans::forest_walk::{STEPS, eye, plant, side};
use visibility_examples::walkthrough::{World, cullers};

/// Measures frames of the walks through built-in cities, one frame after another.
fn walks(c: &mut Criterion) {
    let mut group = c.benchmark_group("horizon/frame of a walk");
    for scene in ["london", "town"] {
        let world =
            World::new(built_in(scene).expect("it is built in"), (640, 360), Some(32)).expect("views");
        let made: Vec<(String, Pipeline)> =
            cullers::parse("frustum,horizon,hzb", &world).expect("they suit the scene");
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

/// Number of trees of the forest of the paper on visible zones.
const TREES: usize = 835_089;

/// Measures looking all around from successive eyes of a walk among discs, by radius in metres; the same for
/// a ball of eyes; and making the set of discs.
fn zones(c: &mut Criterion) {
    let mut group = c.benchmark_group("discs");
    group.sample_size(10);
    for radius in [1.5, 0.6, 0.3, 0.05] {
        let discs = plant(TREES, radius);
        let made = Discs::new(&discs).expect("finite discs");
        let (mut zone, mut seen) = (DiscZone::new(), Vec::new());
        for ball in [0.0, 0.05] {
            let mut step = 0u32;
            let name = if ball > 0.0 { "full turn, ball of 5 cm" } else { "full turn" };
            group.bench_function(BenchmarkId::new(name, radius), |b| {
                b.iter(|| {
                    step = (step + 1) % 1024;
                    let along = 0.05 * f64::from(step);
                    let view = DiscView::new([2000.0 + along, 2000.0 + 0.3 * along]).with_ball(ball);
                    zone.look(&made, &view, &mut seen);
                    seen.len()
                });
            });
        }
        group.bench_function(BenchmarkId::new("make 835,089", radius), |b| b.iter(|| Discs::new(&discs)));
    }
    group.finish();
}

/// Measures moves of an eye on the circular walk among discs, by radius in metres: updating the visible
/// discs, by the reach of their classes, compared with computing them from scratch.
fn moves(c: &mut Criterion) {
    let mut group = c.benchmark_group("moves of 5 cm among discs");
    group.sample_size(10);
    for radius in [1.5, 0.6, 0.3, 0.05] {
        let (discs, side) = (plant(TREES, radius), side(TREES, radius));
        let made = Discs::new(&discs).expect("finite discs");
        let (mut zone, mut seen) = (DiscZone::new(), Vec::new());
        let mut eyes = (0..STEPS).map(|step| eye(step, side)).cycle();
        group.bench_function(BenchmarkId::new("from scratch", radius), |b| {
            b.iter(|| {
                let eye = eyes.next().expect("a cycle");
                zone.look(&made, &DiscView::new(eye), &mut seen);
                seen.len()
            });
        });
        for reach in [0.2, 1.0, 4.0] {
            let mut kept = KineticZone::new(&made, reach);
            let name = format!("kept, classes of {reach} m");
            group.bench_function(BenchmarkId::new(name, radius), |b| {
                b.iter(|| kept.move_to(eyes.next().expect("a cycle")).len());
            });
        }
    }
    group.finish();
}

criterion_group!(benches, walks, zones, moves);
criterion_main!(benches);
