//! Benchmark of BSP trees: construction, traversal in depth order, insertion and removal of objects, merging
//! of solids, and whole frames of the object-space cullers.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::Duration;
use visibility_benches::workload::Random;
use visibility_bsp::{BspOrderCuller, BspTree, NaylorCuller, SceneTree, TraversalStack};
use visibility_core::glam::{DQuat, DVec3};
use visibility_core::{
    Aabb, Culler, FrustumCuller, Object, Pipeline, Pose, Scene, View, VisibleSet, scene::Triangle, view::Eye,
};

/// Returns the twelve triangles of a box with half extents `half`, rotated about z by `turn` radians.
fn block(center: DVec3, half: DVec3, turn: f64) -> Vec<[DVec3; 3]> {
    let turn = DQuat::from_rotation_z(turn);
    let corner = |i: usize| {
        let sign = |bit: usize| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
        center + turn * (half * DVec3::new(sign(0), sign(1), sign(2)))
    };
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    faces
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .map(|triangle| triangle.map(corner))
        .collect()
}

/// Makes a town of houses on streets, each rotated by a small angle. Returns the triangles of each house.
fn town(houses: usize) -> Vec<Vec<[DVec3; 3]>> {
    let mut random = Random(5);
    let side = (houses as f64).sqrt().ceil() as usize;
    (0..houses)
        .map(|i| {
            let mut within = |low: f32, high: f32| f64::from(random.within(low, high));
            let height = within(3.0, 20.0);
            let center = DVec3::new((i % side) as f64 * 30.0, (i / side) as f64 * 30.0, height);
            block(center, DVec3::new(within(6.0, 11.0), within(6.0, 11.0), height), within(0.0, 0.6))
        })
        .collect()
}

/// Builds the tree of a town; the owner of a fragment is the index of its house.
fn tree(town: &[Vec<[DVec3; 3]>]) -> BspTree {
    let polygons = (0..).zip(town).flat_map(|(owner, house)| house.iter().map(move |t| (owner, t)));
    BspTree::build(polygons).expect("houses do not cross")
}

fn build(c: &mut Criterion) {
    let mut group = c.benchmark_group("bsp/build");
    group.sample_size(10).measurement_time(Duration::from_secs(4));
    for houses in [100, 1000, 5000] {
        let town = town(houses);
        group.throughput(Throughput::Elements(12 * houses as u64));
        group.bench_function(BenchmarkId::from_parameter(12 * houses), |b| b.iter(|| tree(&town)));
    }
    group.finish();
}

/// Measures the front-to-back traversal of every fragment of a tree, from random eyes within its bounds.
fn order(c: &mut Criterion) {
    let mut group = c.benchmark_group("bsp/order");
    group.measurement_time(Duration::from_secs(3));
    for houses in [100, 1000, 8000] {
        let tree = tree(&town(houses));
        let (mut stack, mut random) = (TraversalStack::new(), Random(6));
        let reach = tree.bounds().max.as_dvec3();
        group.throughput(Throughput::Elements(tree.fragment_count() as u64));
        group.bench_function(BenchmarkId::from_parameter(tree.fragment_count()), |b| {
            b.iter(|| {
                let mut share = || f64::from(random.within(0.0, 1.0));
                let eye = reach * DVec3::new(share(), share(), share());
                let mut sum = 0u64;
                tree.front_to_back(Eye::Point(eye), &mut stack, |fragments| {
                    fragments.for_each(|fragment| sum += u64::from(fragment.owner()));
                });
                black_box(sum)
            });
        });
    }
    group.finish();
}

/// Measures the removal of a box of twelve triangles and its insertion at a random position.
fn insertion(c: &mut Criterion) {
    let mut group = c.benchmark_group("bsp/move a box");
    for houses in [100, 1000, 5000] {
        let mut tree = tree(&town(houses));
        let (mut random, reach, owner) = (Random(7), tree.bounds().max, houses as u32);
        group.bench_function(BenchmarkId::from_parameter(12 * houses), |b| {
            b.iter(|| {
                tree.remove(owner);
                let [x, y] = [reach.x, reach.y].map(|most| f64::from(random.within(0.0, most)));
                let cart = block(DVec3::new(x, y, 1.0), DVec3::new(2.0, 1.0, 1.0), x);
                tree.insert(owner, &cart).expect("a box")
            });
        });
    }
    group.finish();
}

fn frame(c: &mut Criterion) {
    let mut scene = Scene::new();
    for house in town(2500) {
        let triangles: Vec<Triangle> = house.iter().map(|t| t.map(|v| v.as_vec3())).collect();
        let bounds = Aabb::from_points(triangles.iter().flatten().copied());
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        scene.set_triangles(id, triangles).expect("it was just inserted");
    }
    let tree = std::sync::Arc::new(SceneTree::new(&scene).expect("houses do not cross"));
    let eye = DVec3::new(15.0 + 30.0 * 25.0, 10.0, 1.7);
    let pose = Pose::look_at(eye, eye + DVec3::new(20.0, 100.0, 3.0), DVec3::Z);
    let view = View::perspective(pose, 1.0, 16.0 / 9.0, 0.1, f64::INFINITY).expect("a camera by the book");
    let mut group = c.benchmark_group("bsp/frame of a town");
    let cullers: [Box<dyn Culler + Send + Sync>; 2] =
        [Box::new(BspOrderCuller::new(tree.clone())), Box::new(NaylorCuller::new(tree))];
    for culler in cullers {
        let name = culler.name().to_owned();
        let mut pipeline = Pipeline::new().with(FrustumCuller::new());
        pipeline.push(culler);
        let mut visible = VisibleSet::new();
        group.bench_function(name, |b| b.iter(|| pipeline.cull(&scene, &view, &mut visible)));
    }
    group.finish();
}

criterion_group!(benches, build, order, insertion, frame);
criterion_main!(benches);
