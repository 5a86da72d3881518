//! Benchmark of processing a visible set: iteration in hierarchy order and by index while writing to
//! entities, bits for a GPU, and groups by mesh compared with a hand-written `HashMap`.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::{collections::HashMap, hint::black_box, time::Duration};
use visibility_core::glam::DVec3;
use visibility_core::{Aabb, FrustumCuller, Pipeline, Pose, Scene, View, VisibleSet};
use visibility_frame::DrawList;

/// Component of an entity with the size of a cache line, written for each visible object as in an engine.
#[derive(Clone)]
#[repr(align(64))]
struct Component([f32; 16]);

fn results(c: &mut Criterion) {
    let count = 100_000;
    let mut state = 1_u64;
    // Returns a pseudo-random number below 2^31.
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as u32
    };
    let mut scene = Scene::new();
    scene.insert_batch((0..count).map(|_| {
        let min = [(); 3].map(|_| random() as f32 * (200.0 / 2_147_483_648.0) - 100.0);
        Aabb::from_arrays(min, min.map(|x| x + 0.5))
    }));
    let pose = Pose::look_at(DVec3::new(-60.0, 0.0, 0.0), DVec3::ZERO, DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.0, 0.1, f64::INFINITY).expect("a view");
    let (mut pipeline, mut visible) = (Pipeline::new().with(FrustumCuller::new()), VisibleSet::new());
    pipeline.cull(&scene, &view, &mut visible);
    let seen = visible.ids(&scene).len();
    let mut sorted = visible.clone();
    sorted.sort_by_index(&scene);
    let mut entities = vec![Component([0.0; 16]); count];
    let mut bits = vec![0; count.div_ceil(32)];
    let meshes: Vec<u32> = (0..count).map(|_| random() % 200).collect();

    let mut group = c.benchmark_group(format!("results/{seen} of {count}"));
    group.throughput(Throughput::Elements(seen as u64));
    group.sample_size(20).measurement_time(Duration::from_secs(2));
    for (name, set) in [("write entities, hierarchy order", &visible), ("write entities, by index", &sorted)]
    {
        group.bench_function(name, |b| {
            b.iter(|| set.iter(&scene).for_each(|id| entities[id.index()].0[3] += 1.0));
        });
    }
    let mut again = VisibleSet::new();
    group.bench_function("cull", |b| b.iter(|| pipeline.cull(&scene, &view, &mut again).visible));
    group.bench_function("cull, list", |b| {
        b.iter(|| {
            pipeline.cull(&scene, &view, &mut again);
            again.ids(&scene).len()
        });
    });
    group.bench_function("cull, write bits", |b| {
        b.iter(|| {
            pipeline.cull(&scene, &view, &mut again);
            again.write_bits(&scene, black_box(&mut bits))
        });
    });
    group.bench_function("cull, sort by index", |b| {
        b.iter(|| {
            pipeline.cull(&scene, &view, &mut again);
            again.sort_by_index(&scene);
        });
    });
    group.bench_function("cull, sort by hand", |b| {
        let mut ids = Vec::new();
        b.iter(|| {
            pipeline.cull(&scene, &view, &mut again);
            ids.clear();
            ids.extend(again.iter(&scene));
            ids.sort_unstable();
        });
    });
    // Measures a set with a list of objects, and a set with only masks.
    for (name, set) in [("listed", &visible), ("masks", &again)] {
        group.bench_function(format!("write bits, {name}"), |b| {
            b.iter(|| set.write_bits(&scene, black_box(&mut bits)));
        });
        let mut list = DrawList::new();
        group.bench_function(format!("group, {name}"), |b| {
            b.iter(|| list.group(set.iter(&scene), |id| meshes[id.index()]));
        });
    }
    let mut by_hand: HashMap<u32, Vec<u32>> = HashMap::new();
    group.bench_function("group by HashMap", |b| {
        b.iter(|| {
            by_hand.values_mut().for_each(Vec::clear);
            for id in visible.iter(&scene) {
                by_hand.entry(meshes[id.index()]).or_default().push(id.index() as u32);
            }
        });
    });
    group.finish();
}

criterion_group!(benches, results);
criterion_main!(benches);
