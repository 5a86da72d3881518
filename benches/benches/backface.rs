//! Benchmark of backface culling compared with frustum culling: 64 cones or 64 boxes per kernel call, in one
//! run. Throughput is in clusters per second.
//!
//! The kernels are not public, so both are measured through their cullers, on a scene in which every block
//! must be tested. Cones are also measured in an array, as [`Cones`] tests them.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use visibility_benches::workload::Random;
use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, Culler, FrustumCuller, Object, Pose, Scene, View, VisibleSet, view::Eye};
use visibility_frame::backface::{BackfaceCuller, Cones, NormalCone};

/// Makes `count` clusters like those of real meshes, as bounds and normal cones: patches about a metre wide
/// with random orientation.
fn clusters(count: usize) -> Vec<(Aabb, NormalCone)> {
    let mut random = Random(1);
    // Fitting a cone is slow, so 256 patches are repeated.
    let patches: Vec<(Aabb, NormalCone)> = (0..256)
        .map(|_| {
            let (place, axis) = (random.point(-90.0, 90.0), random.point(-1.0, 1.0).normalize_or(Vec3::Z));
            let (x, y) = axis.any_orthonormal_pair();
            let triangles: Vec<[Vec3; 3]> = (0..16)
                .map(|_| {
                    let at = place + x * random.within(-0.5, 0.5) + y * random.within(-0.5, 0.5);
                    [at, at + x * 0.1 + axis * random.within(-0.05, 0.05), at + y * 0.1]
                })
                .collect();
            (Aabb::from_points(triangles.iter().flatten().copied()), NormalCone::from_triangles(&triangles))
        })
        .collect();
    (0..count).map(|i| patches[i % patches.len()]).collect()
}

fn backface(c: &mut Criterion) {
    for count in [4096, 65_536] {
        let clusters = clusters(count);
        let mut group = c.benchmark_group(format!("backface/{count}"));
        group.throughput(Throughput::Elements(count as u64));
        let eyes: Vec<Eye> =
            (0..16).map(|i| Eye::Point(DVec3::new(120.0 - 15.0 * f64::from(i), 40.0, 9.0))).collect();
        let mut turn = 0;
        let mut next = move || {
            turn = (turn + 1) % 16;
            turn
        };

        let cones = Cones::new(clusters.iter().map(|(_, cone)| *cone));
        let mut masks = vec![0; count / 64];
        group.bench_function(BenchmarkId::from_parameter("cones in a row"), |b| {
            b.iter(|| {
                cones.back_facing(&eyes[next()], &mut masks);
                black_box(&masks);
            });
        });

        let mut scene = Scene::new();
        // One object for each cluster, with the cluster's bounds and cone.
        let one_sided = |bounds| Object { one_sided: true, ..Object::new(bounds) };
        let ids = scene.insert_batch(clusters.iter().map(|(bounds, _)| one_sided(*bounds)));
        let mut culler = BackfaceCuller::new();
        for (&id, (_, cone)) in ids.iter().zip(&clusters) {
            culler.set(&scene, id, *cone).expect("an object of the scene");
        }
        let views: Vec<View> = eyes
            .iter()
            .map(|eye| {
                let Eye::Point(eye) = *eye else { unreachable!("points only") };
                let pose = Pose::look_at(eye, DVec3::ZERO, DVec3::Z);
                View::perspective(pose, 1.0, 1.5, 0.1, 1000.0).expect("a camera")
            })
            .collect();
        let mut visible = VisibleSet::new();
        group.bench_function(BenchmarkId::from_parameter("backface culler"), |b| {
            b.iter(|| {
                let view = &views[next()];
                visible.fill(&scene, view);
                black_box(culler.cull(&scene, view, &mut visible))
            });
        });

        // The scene has as many boxes as clusters. Every block of boxes crosses planes of every view.
        let mut scene = Scene::new();
        scene.insert_batch((0..count).map(|i| {
            let x = i as f32 / count as f32;
            Aabb::from_arrays([-200.0 - x, -200.0, -200.0], [200.0 + x, 200.0, 200.0])
        }));
        let mut frustum = FrustumCuller::new();
        group.bench_function(BenchmarkId::from_parameter("frustum culler, every box on the planes"), |b| {
            b.iter(|| {
                let view = &views[next()];
                visible.fill(&scene, view);
                black_box(frustum.cull(&scene, view, &mut visible))
            });
        });
        group.finish();
    }
}

criterion_group!(benches, backface);
criterion_main!(benches);
