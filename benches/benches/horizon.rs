//! Benchmark of horizons on built-in cities, compared with the z-buffer, and of visible discs, computed from
//! scratch and updated.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use visibility_2d::discs::{Disc, DiscView, DiscZone, Discs, KineticZone};
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

/// Makes 835,089 disjoint discs, 4.5 m apart on average, as many as the forest of the paper on visible zones.
fn forest(radius: f64) -> Vec<Disc> {
    const SQUARES: usize = 914;
    const SIDE: f64 = 4.5;
    let mut random = Random(1);
    let mut coordinate = || f64::from(random.within(0.0, 1.0)) * SQUARES as f64 * SIDE;
    let mut squares = vec![Vec::<u32>::new(); SQUARES * SQUARES];
    let mut discs: Vec<Disc> = Vec::new();
    while discs.len() < 835_089 {
        let center = [coordinate(), coordinate()];
        let [x, y] = center.map(|x| ((x / SIDE) as usize).min(SQUARES - 1));
        let near = (x.max(1) - 1..(x + 2).min(SQUARES))
            .flat_map(|x| (y.max(1) - 1..(y + 2).min(SQUARES)).map(move |y| x * SQUARES + y));
        let is_free = near.flat_map(|square| &squares[square]).all(|&other| {
            let other: Disc = discs[other as usize];
            (other.center[0] - center[0]).hypot(other.center[1] - center[1]) > 2.01 * radius
        });
        if is_free {
            squares[x * SQUARES + y].push(discs.len() as u32);
            discs.push(Disc { center, radius });
        }
    }
    discs
}

/// Radius in metres of a circular walk of 1,024 steps of 5 cm.
const CIRCLE: f64 = 0.05 * 1024.0 / std::f64::consts::TAU;

/// Returns the eye at a step of the circular walk.
fn circle(step: u32) -> [f64; 2] {
    let (sin, cos) = (f64::from(step) * std::f64::consts::TAU / 1024.0).sin_cos();
    [2000.0 + CIRCLE * cos, 2000.0 + CIRCLE * sin]
}

/// Prints the mean work of the first 64 moves on the circular walk.
fn count_work(kept: &mut KineticZone, radius: f64, reach: f64) {
    let (mut seen, mut segments, mut steps, mut ended, mut rebuilt) = (0, 0, 0, 0, 0);
    kept.move_to(circle(0));
    for step in 1..=64 {
        seen += kept.move_to(circle(step)).len();
        let work = kept.work();
        (segments, steps, ended) = (segments + work.segments, steps + work.steps, ended + work.ended);
        rebuilt += usize::from(work.rebuilt);
    }
    let mean = |count: usize| count as f64 / 64.0;
    println!(
        "radius {radius}, classes of {reach} m: {:.1} discs, {:.1} segments, {:.2} steps, {:.2} ended a \
         move; {rebuilt} rebuilt",
        mean(seen),
        mean(segments),
        mean(steps),
        mean(ended)
    );
}

/// Measures looking all around from successive eyes of a walk among discs, by radius in metres; the same for
/// a ball of eyes; and making the set of discs.
fn zones(c: &mut Criterion) {
    let mut group = c.benchmark_group("discs");
    group.sample_size(10);
    for radius in [1.5, 0.6, 0.3, 0.05] {
        let discs = forest(radius);
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
/// discs, by the reach of their classes, compared with computing them from scratch. Discs leave the circle
/// free.
fn moves(c: &mut Criterion) {
    let mut group = c.benchmark_group("moves of 5 cm among discs");
    group.sample_size(10);
    for radius in [1.5, 0.6, 0.3, 0.05] {
        let mut discs = forest(radius);
        discs.retain(|disc| {
            let [x, y] = disc.center.map(|x| x - 2000.0);
            (x.hypot(y) - CIRCLE).abs() > radius + 0.1
        });
        let made = Discs::new(&discs).expect("finite discs");
        let (mut zone, mut seen) = (DiscZone::new(), Vec::new());
        let mut eyes = (0..1024).map(circle).cycle();
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
            count_work(&mut kept, radius, reach);
        }
    }
    group.finish();
}

criterion_group!(benches, walks, zones, moves);
criterion_main!(benches);
