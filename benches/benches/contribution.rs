//! Benchmark of culling by size: a million boxes of which about 1 % are large enough. Compared are the
//! contribution culler, a test of each box in `VisibleSet::retain`, and a plain loop over all boxes, as in
//! simple engines. Candidates are all boxes, or those that the frustum leaves. Draw ranges are measured too.
//!
//! There are three sets of boxes: boxes of 0.5 to 3 m; the same with one box in a hundred enlarged a hundred
//! times, so that nodes contain large and small ones; and clusters of small boxes around large ones.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::{hint::black_box, time::Duration};
use visibility_benches::workload::{FRAMES, Order, Random, Share, boxes, views};
use visibility_core::{Aabb, Culler, FrustumCuller, Scene, View, VisibleSet, scene::DrawRange, view::Eye};
use visibility_frame::lod::ContributionCuller;

const COUNT: usize = 1_000_000;
const PICTURE_HEIGHT: f64 = 1080.0;

/// Names and boxes of the inputs.
fn inputs() -> [(&'static str, Vec<Aabb>); 3] {
    let small = boxes(COUNT, Order::Random);
    let mut random = Random(7);
    let mut some_large = small.clone();
    for bounds in &mut some_large {
        if random.bits().is_multiple_of(100) {
            let half = bounds.half_extent() * 20.0;
            *bounds = Aabb::new(bounds.center() - half, bounds.center() + half);
        }
    }
    let crowds = small
        .iter()
        .enumerate()
        .map(|(number, bounds)| {
            let (center, half) = (bounds.center(), bounds.half_extent());
            let half = if number % 1000 == 0 { half * 10.0 } else { half * 0.1 };
            let near = small[number - number % 1000].center() + center * 0.01;
            Aabb::new(near - half, near + half)
        })
        .collect();
    [("small", small), ("one in a hundred large", some_large), ("crowds", crowds)]
}

/// Returns the greatest squared ratio of distance to diagonal at which an object is large enough, for the
/// workload's field of view of 60 degrees.
fn limit(pixels: f64) -> f32 {
    let per_metre = 0.5 * PICTURE_HEIGHT / 30f64.to_radians().tan() / pixels;
    (per_metre * per_metre) as f32
}

/// Test that a user would write: whether the sphere around a box is large enough at the distance of the box.
fn is_large(bounds: &Aabb, eye: glam::Vec3, limit: f32) -> bool {
    eye.clamp(bounds.min, bounds.max).distance_squared(eye) <= bounds.min.distance_squared(bounds.max) * limit
}

/// Returns the size in pixels that about 1 % of the boxes exceed.
fn one_percent(boxes: &[Aabb], eye: glam::Vec3) -> f64 {
    let (mut least, mut most) = (0.0, 1e6);
    for _ in 0..50 {
        let middle = 0.5 * (least + most);
        let count = boxes.iter().filter(|bounds| is_large(bounds, eye, limit(middle))).count();
        *if count > COUNT / 100 { &mut least } else { &mut most } = middle;
    }
    least
}

fn eye(view: &View) -> glam::Vec3 {
    match view.eye(glam::DVec3::ZERO) {
        Eye::Point(eye) => eye.as_vec3(),
        Eye::Direction(_) => unreachable!("a perspective view"),
    }
}

fn contribution(c: &mut Criterion) {
    let views = views(Share::Eleven);
    for (name, boxes) in inputs() {
        let pixels = one_percent(&boxes, eye(&views[0]));
        let limit = limit(pixels);
        let mut scene = Scene::new();
        let ids = scene.insert_batch(boxes.iter().copied());
        for behind_frustum in [false, true] {
            let place = if behind_frustum { "behind the frustum" } else { "of all" };
            let mut group = c.benchmark_group(format!("contribution/{name}/{place}"));
            group.throughput(Throughput::Elements(COUNT as u64));
            group.sample_size(10).measurement_time(Duration::from_secs(2));
            group.warm_up_time(Duration::from_millis(500));
            let (mut frustum, mut culler) =
                (FrustumCuller::new(), ContributionCuller::new(PICTURE_HEIGHT, pixels));
            let mut visible = VisibleSet::new();
            let mut run = |number: usize, by: &mut dyn FnMut(&Scene, &View, &mut VisibleSet) -> u64| {
                let view = &views[number % FRAMES];
                visible.fill(&scene, view);
                if behind_frustum {
                    frustum.cull(&scene, view, &mut visible);
                }
                by(&scene, view, &mut visible)
            };
            let mut ours = |scene: &Scene, view: &View, visible: &mut VisibleSet| {
                culler.cull(scene, view, visible).visible
            };
            let mut retain = |scene: &Scene, view: &View, visible: &mut VisibleSet| {
                let eye = eye(view);
                visible.retain(scene, |_, bounds| is_large(bounds, eye, limit)).visible
            };
            let counts = [run(0, &mut ours), run(0, &mut retain)];
            assert!(counts[0].abs_diff(counts[1]) <= 2, "{counts:?}");
            println!("{name}, {place}: {} of {COUNT} remain at {pixels:.1} pixels", counts[0]);
            let mut frame = 0;
            let mut next = || {
                frame += 1;
                frame
            };
            group.bench_function(BenchmarkId::from_parameter("the stages before"), |b| {
                b.iter(|| black_box(run(next(), &mut |_, _, _| 0)));
            });
            group.bench_function(BenchmarkId::from_parameter("visibility"), |b| {
                b.iter(|| black_box(run(next(), &mut ours)));
            });
            group.bench_function(BenchmarkId::from_parameter("VisibleSet::retain"), |b| {
                b.iter(|| black_box(run(next(), &mut retain)));
            });
            if !behind_frustum {
                let mut out = Vec::with_capacity(COUNT);
                group.bench_function(BenchmarkId::from_parameter("plain loop"), |b| {
                    b.iter(|| {
                        let eye = eye(&views[next() % FRAMES]);
                        out.clear();
                        out.extend((0..COUNT as u32).filter(|&i| is_large(&boxes[i as usize], eye, limit)));
                        black_box(out.len())
                    });
                });
            }
        }
        // Draw ranges of 100 to 160 m leave the same share of objects.
        let mut random = Random(3);
        for &id in &ids {
            let range = DrawRange { end: random.within(100.0, 160.0), ..DrawRange::ALWAYS };
            scene.set_draw_range(id, range).expect("a range");
        }
        scene.rebuild();
        let mut group = c.benchmark_group(format!("contribution/{name}/by range"));
        group.throughput(Throughput::Elements(COUNT as u64));
        group.sample_size(10).measurement_time(Duration::from_secs(2));
        let mut culler = ContributionCuller::new(PICTURE_HEIGHT, 0.0);
        let mut visible = VisibleSet::new();
        let mut frame = 0;
        group.bench_function(BenchmarkId::from_parameter("visibility"), |b| {
            b.iter(|| {
                frame += 1;
                visible.fill(&scene, &views[frame % FRAMES]);
                black_box(culler.cull(&scene, &views[frame % FRAMES], &mut visible))
            });
        });
        group.bench_function(BenchmarkId::from_parameter("VisibleSet::retain"), |b| {
            b.iter(|| {
                frame += 1;
                let eye = eye(&views[frame % FRAMES]);
                visible.fill(&scene, &views[frame % FRAMES]);
                black_box(visible.retain(&scene, |id, bounds| {
                    let end = scene.draw_range(id).expect("an object").end;
                    eye.clamp(bounds.min, bounds.max).distance_squared(eye) <= end * end
                }))
            });
        });
    }
}

criterion_group!(benches, contribution);
criterion_main!(benches);
