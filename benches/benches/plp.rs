//! Benchmark of prioritized-layered projection: tessellation of a scene, and frames by budget.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::sync::Arc;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, Culler, Object, Pose, Scene, View, VisibleSet};
use visibility_plp::{Budget, DelaunayTessellation, OctreeTessellation, PlpCuller, Solidity, Tessellation};

/// Makes `side` by `side` hollow boxes on streets. Each box has 600 triangles, and each triangle is an
/// object.
fn town(side: usize) -> Scene {
    let mut scene = Scene::new();
    for house in 0..side * side {
        let corner = Vec3::new((house % side) as f32, (house / side) as f32, 0.0) * 14.0;
        for tile in 0..600usize {
            let (face, place) = (tile / 100 % 6, tile % 100);
            let (u, v) = ((place % 10) as f32, (place / 10) as f32);
            let at = |u: f32, v: f32| {
                let depth = if face < 3 { 0.0 } else { 10.0 };
                let mut p = [0.0; 3];
                (p[face % 3], p[(face + 1) % 3], p[(face + 2) % 3]) = (depth, u, v);
                corner + Vec3::from_array(p)
            };
            let triangle = [at(u, v), at(u + 1.0, v), at(u, v + 1.0)];
            let id = scene.insert(Object::new(Aabb::from_points(triangle)));
            scene.set_triangles(id, [triangle]).expect("the object was just inserted");
        }
    }
    scene
}

fn views() -> Vec<View> {
    let pose = |i: usize| {
        let eye = DVec3::new(12.0 + i as f64 * 7.0, 12.0, 1.7);
        Pose::look_at(eye, eye + DVec3::new(1.0, 0.3, 0.0), DVec3::Z)
    };
    (0..8).filter_map(|i| View::perspective(pose(i), 1.0, 1.6, 0.1, f64::INFINITY).ok()).collect()
}

fn tessellation(criterion: &mut Criterion) {
    let scene = town(10);
    let mut group = criterion.benchmark_group("plp_tessellation");
    group.sample_size(10).throughput(Throughput::Elements(scene.len() as u64));
    group.bench_function("octree", |bencher| bencher.iter(|| OctreeTessellation::new(&scene)));
    group.bench_function("delaunay", |bencher| bencher.iter(|| DelaunayTessellation::new(&scene)));
    group.finish();
}

fn frame(criterion: &mut Criterion) {
    let scene = town(16);
    let octree = Arc::new(OctreeTessellation::new(&scene));
    let views = views();
    let mut group = criterion.benchmark_group("plp_frame");
    group.sample_size(20);
    for (name, solidity) in [("coverage", Solidity::Coverage), ("count", Solidity::Count)] {
        for percent in [1, 2, 5, 10] {
            let budget = Budget::Objects(scene.len() * percent / 100);
            let mut culler = PlpCuller::new(octree.clone(), budget).with_solidity(solidity).with_one_sided();
            let mut visible = VisibleSet::new();
            let mut next = 0;
            group.bench_function(BenchmarkId::new(name, percent), |bencher| {
                bencher.iter(|| {
                    next = (next + 1) % views.len();
                    visible.fill(&scene, &views[next]);
                    culler.cull(&scene, &views[next], &mut visible)
                });
            });
        }
    }
    let cells = octree.content().cell_count() as u32;
    assert!(cells > 500, "{cells} cells are no town");
    group.finish();
}

criterion_group!(benches, tessellation, frame);
criterion_main!(benches);
