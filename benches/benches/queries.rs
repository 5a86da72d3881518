//! Benchmark of scene queries among 100,000 and a million boxes: objects in a sphere, in a box and on a ray,
//! the first hit and the eight nearest. Each is compared with a loop over an array of the boxes, as users
//! write without a hierarchy.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use glam::Vec3;
use std::{hint::black_box, time::Duration};
use visibility_benches::workload::{Order, REACH, Random, boxes};
use visibility_core::geometry::Sphere;
use visibility_core::{Aabb, ObjectId, Scene};
use visibility_frame::queries::{Neighbor, Ray, RayHit, SceneQuery};

/// Number of different queries, which are asked in turn.
const QUERIES: usize = 64;
const RADIUS: f32 = 10.0;
const NEAREST: usize = 8;

fn distance_squared(bounds: &Aabb, point: Vec3) -> f32 {
    point.clamp(bounds.min, bounds.max).distance_squared(point)
}

/// Returns the distance to the box in lengths of the ray's direction. `inverse` has the reciprocals of the
/// direction. `None` if the ray misses the box.
fn enter(bounds: &Aabb, origin: Vec3, inverse: Vec3) -> Option<f32> {
    let (a, b) = ((bounds.min - origin) * inverse, (bounds.max - origin) * inverse);
    let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
    (enter <= leave).then_some(enter)
}

fn queries(c: &mut Criterion) {
    for count in [100_000, 1_000_000] {
        let boxes = boxes(count, Order::Random);
        let mut scene = Scene::new();
        let ids = scene.insert_batch(boxes.iter().copied());
        let all = || ids.iter().copied().zip(&boxes);
        let mut random = Random(3);
        let points: Vec<Vec3> = (0..QUERIES).map(|_| random.point(-REACH, REACH)).collect();
        let rays: Vec<(Vec3, Vec3)> =
            points.iter().map(|&p| (p, random.point(-1.0, 1.0).normalize())).collect();
        let query = SceneQuery::new(&scene);
        let (mut found, mut hits): (Vec<ObjectId>, Vec<RayHit>) = Default::default();
        let (mut nearest, mut distances): (Vec<Neighbor>, Vec<(f32, ObjectId)>) = Default::default();
        let mut group = c.benchmark_group(format!("queries/{count}"));
        let mut bench = |name: &str, by: &str, ask: &mut dyn FnMut(usize) -> usize| {
            let mut turn = 0;
            group.bench_function(BenchmarkId::new(name, by), |b| {
                b.iter(|| {
                    turn = (turn + 1) % QUERIES;
                    black_box(ask(turn))
                });
            });
        };

        bench("sphere", "visibility", &mut |i| {
            query.in_sphere(&Sphere::new(points[i], RADIUS), &mut found);
            found.len()
        });
        bench("sphere", "loop", &mut |i| {
            let is_near = |bounds: &Aabb| distance_squared(bounds, points[i]) <= RADIUS * RADIUS;
            found.clear();
            found.extend(all().filter(|(_, bounds)| is_near(bounds)).map(|(id, _)| id));
            found.len()
        });
        bench("box", "visibility", &mut |i| {
            query.in_box(&Aabb::new(points[i] - RADIUS, points[i] + RADIUS), &mut found);
            found.len()
        });
        bench("box", "loop", &mut |i| {
            let (min, max) = (points[i] - RADIUS, points[i] + RADIUS);
            let meets = |bounds: &Aabb| bounds.min.cmple(max).all() && min.cmple(bounds.max).all();
            found.clear();
            found.extend(all().filter(|(_, bounds)| meets(bounds)).map(|(id, _)| id));
            found.len()
        });
        let ray = |i: usize| Ray::new(rays[i].0, rays[i].1, f32::INFINITY).expect("a ray");
        bench("first hit", "visibility", &mut |i| usize::from(query.first_hit(&ray(i)).is_some()));
        bench("first hit", "loop", &mut |i| {
            let (origin, inverse) = (rays[i].0, rays[i].1.recip());
            let hits = all().filter_map(|(id, bounds)| Some((enter(bounds, origin, inverse)?, id)));
            usize::from(hits.min_by(|a, b| a.0.total_cmp(&b.0)).is_some())
        });
        bench("all hits", "visibility", &mut |i| {
            query.all_hits(&ray(i), &mut hits);
            hits.len()
        });
        bench("all hits", "loop", &mut |i| {
            let (origin, inverse) = (rays[i].0, rays[i].1.recip());
            distances.clear();
            distances.extend(all().filter_map(|(id, bounds)| Some((enter(bounds, origin, inverse)?, id))));
            distances.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            distances.len()
        });
        bench("nearest 8", "visibility", &mut |i| {
            query.nearest(points[i], NEAREST, &mut nearest);
            nearest.len()
        });
        bench("nearest 8", "loop", &mut |i| {
            distances.clear();
            distances.extend(all().map(|(id, bounds)| (distance_squared(bounds, points[i]), id)));
            distances.select_nth_unstable_by(NEAREST, |a, b| a.0.total_cmp(&b.0));
            NEAREST
        });
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_secs(1));
    targets = queries
}
criterion_main!(benches);
