//! Benchmark of hierarchical occlusion maps: updating the pyramid, the overlap test by outcome and size, and
//! a frame of a synthetic town, compared with the z-buffer.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::Duration;
use visibility_benches::workload::{Random, town};
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{
    Aabb, Culler, FrustumCuller, OccluderMesh, OcclusionMap, Pipeline, Pose, View, VisibleSet,
    occlusion::Occlusion,
};
use visibility_hzb::{DepthEstimate, Hom, HomCuller, Hzb, HzbCuller};

const ESTIMATES: [DepthEstimate; 3] =
    [DepthEstimate::Plane, DepthEstimate::Buffer, DepthEstimate::NoBackground];

/// Returns a view along x with a horizontal field of view of 90 degrees: at a distance of 960 m, one metre is
/// one pixel of a picture 1920 pixels wide.
fn view() -> View {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let fov_y = 2.0 * (9.0f64 / 16.0).atan();
    View::perspective(pose, fov_y, 16.0 / 9.0, 0.1, f64::INFINITY).expect("a camera by the book")
}

/// Makes the occluder mesh of the box between two corners in world space, in metres.
fn wall(low: [f32; 3], high: [f32; 3]) -> OccluderMesh {
    OccluderMesh::cuboid(&Aabb::from_arrays(low, high)).expect("a box")
}

/// Measures a frame with one occluder, small or as large as the picture. The time is that of drawing the
/// occluder and updating the pyramid.
fn pyramid(c: &mut Criterion) {
    let mut group = c.benchmark_group("hom/pyramid");
    let small = wall([500.0, -10.0, -10.0], [501.0, 10.0, 10.0]);
    let large = wall([500.0, -900.0, -900.0], [501.0, 900.0, 900.0]);
    for size in [[512, 288], [1920, 1080]] {
        for (name, mesh) in [("small", &small), ("large", &large)] {
            let mut hom = Hom::new(size[0], size[1]).expect("a size in range");
            let mut hzb = Hzb::new(size[0], size[1]).expect("a size in range");
            let frame = |map: &mut dyn OcclusionMap| {
                map.begin(&view(), DVec3::ZERO);
                map.add(mesh, &Affine3A::IDENTITY);
                map.flush();
            };
            group.bench_function(BenchmarkId::new(format!("hom, {name}"), size[0]), |b| {
                b.iter(|| frame(&mut hom));
            });
            group.bench_function(BenchmarkId::new(format!("hzb, {name}"), size[0]), |b| {
                b.iter(|| frame(&mut hzb));
            });
        }
    }
    group.finish();
}

/// Measures the test of cubes of a given size in pixels: in front of a wall, behind it, and behind a wall
/// with narrow gaps.
fn overlap(c: &mut Criterion) {
    let mut group = c.benchmark_group("hom/test a box");
    group.throughput(Throughput::Elements(256)).measurement_time(Duration::from_secs(2));
    let whole = [wall([500.0, -900.0, -900.0], [501.0, 900.0, 900.0])];
    let riddled: Vec<_> = (-60..60)
        .map(|i| i as f32 * 10.0)
        .map(|y| wall([500.0, y, -900.0], [501.0, y + 9.0, 900.0]))
        .collect();
    for (name, walls, near) in
        [("before", &whole[..], 0.4), ("hidden", &whole[..], 1.0), ("behind holes", &riddled[..], 1.0)]
    {
        for estimate in ESTIMATES {
            let mut hom = Hom::new(1920, 1080).expect("a size in range").with_depth_estimate(estimate);
            hom.begin(&view(), DVec3::ZERO);
            for mesh in walls {
                hom.add(mesh, &Affine3A::IDENTITY);
            }
            hom.flush();
            for pixels in [2.0, 16.0, 128.0] {
                let mut random = Random(2);
                let boxes: Vec<_> = (0..256)
                    .map(|_| {
                        let middle =
                            Vec3::new(960.0, random.within(-700.0, 700.0), random.within(-350.0, 350.0));
                        Aabb::new((middle - 0.5 * pixels) * near, (middle + 0.5 * pixels) * near)
                    })
                    .collect();
                group.bench_function(BenchmarkId::new(format!("{name}, {estimate:?}"), pixels), |b| {
                    b.iter(|| {
                        boxes.iter().filter(|bounds| hom.test(black_box(bounds)) != Occlusion::Hidden).count()
                    });
                });
            }
        }
    }
    group.finish();
}

/// Measures a frame through the whole pipeline: a town of 2,500 houses with 20,000 small objects among them,
/// seen from a street.
fn frame(c: &mut Criterion) {
    let (scene, view) = town();
    let mut group = c.benchmark_group("hom/frame of a town");
    for size in [[512, 288], [1920, 1080]] {
        let hom = Hom::new(size[0], size[1]).expect("a size in range");
        let hzb = Hzb::new(size[0], size[1]).expect("a size in range");
        let mut bench = |name: &str, culler: Box<dyn Culler + Send + Sync>| {
            let mut pipeline = Pipeline::new().with(FrustumCuller::new());
            pipeline.push(culler);
            let mut visible = VisibleSet::new();
            group.bench_function(BenchmarkId::new(name, size[0]), |b| {
                b.iter(|| pipeline.cull(&scene, &view, &mut visible));
            });
        };
        bench("hzb", Box::new(HzbCuller::new(hzb)));
        let dialled = hom.clone().with_threshold(0.9);
        bench("hom, threshold 0.9", Box::new(HomCuller::new(dialled)));
        for estimate in ESTIMATES {
            let map = hom.clone().with_depth_estimate(estimate);
            bench(&format!("hom, {estimate:?}"), Box::new(HomCuller::new(map)));
        }
    }
    group.finish();
}

criterion_group!(benches, pyramid, overlap, frame);
criterion_main!(benches);
