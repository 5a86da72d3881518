//! Benchmark of the hierarchical z-buffer: drawing boxes and triangles by size, updating the pyramid, testing
//! boxes by size and outcome, and whole frames of a synthetic town and of built-in scenes.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::Duration;
use visibility_benches::workload::{Random, town};
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::{
    Aabb, FrustumCuller, OccluderMesh, OcclusionMap, Pipeline, Pose, View, VisibleSet, simd::Simd,
};
use visibility_examples::built_in;
use visibility_examples::walkthrough::World;
use visibility_hzb::{Hzb, HzbCuller};

/// Returns a view along x with a horizontal field of view of 90 degrees: at a distance of 960 m, one metre is
/// one pixel of a picture 1920 pixels wide.
fn view() -> View {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let fov_y = 2.0 * (9.0f64 / 16.0).atan();
    View::perspective(pose, fov_y, 16.0 / 9.0, 0.1, f64::INFINITY).expect("a camera by the book")
}

/// Makes a cube that is `pixels` pixels wide, at a random position in view.
fn cube(random: &mut Random, pixels: f32) -> Aabb {
    let middle = Vec3::new(960.0, random.within(-700.0, 700.0), random.within(-350.0, 350.0));
    Aabb::new(middle - 0.5 * pixels, middle + 0.5 * pixels)
}

/// Measures drawing 64 cubes, none of which the others hide entirely, into an empty buffer, with each
/// instruction set.
fn raster(c: &mut Criterion) {
    let mut group = c.benchmark_group("hzb/raster 64 boxes");
    group.throughput(Throughput::Elements(64)).measurement_time(Duration::from_secs(2));
    for simd in Simd::available() {
        for pixels in [4.0, 32.0, 128.0] {
            let mut random = Random(1);
            let meshes: Vec<_> =
                (0..64).filter_map(|_| OccluderMesh::cuboid(&cube(&mut random, pixels)).ok()).collect();
            let mut hzb = Hzb::new(1920, 1080).expect("a size in range").with_simd(simd);
            group.bench_function(BenchmarkId::new(format!("{simd:?}"), pixels), |b| {
                b.iter(|| {
                    hzb.begin(&view(), DVec3::ZERO);
                    for mesh in &meshes {
                        hzb.add(mesh, &Affine3A::IDENTITY);
                    }
                    hzb.flush();
                });
            });
        }
    }
    group.finish();
}

/// Measures drawing a wavy sheet of 2,048 triangles, each of a given width in pixels, into an empty buffer.
fn triangles(c: &mut Criterion) {
    let mut group = c.benchmark_group("hzb/raster 2048 triangles");
    group.throughput(Throughput::Elements(2048)).measurement_time(Duration::from_secs(2));
    for pixels in [2.0, 8.0, 24.0] {
        let (columns, rows) = (32u32, 32u32);
        let at = |i: u32, j: u32| {
            let (y, z) = (i as f32 - 0.5 * columns as f32, j as f32 - 0.5 * rows as f32);
            Vec3::new(960.0 + 2.0 * pixels * (i as f32 * 0.7).sin(), y * pixels, z * pixels)
        };
        let positions: Vec<_> = (0..=rows).flat_map(|j| (0..=columns).map(move |i| at(i, j))).collect();
        let corner = |i: u32, j: u32| j * (columns + 1) + i;
        let quads = (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j)));
        let indices: Vec<_> = quads
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        let sheet = OccluderMesh::from_indexed(&positions, &indices).expect("a sheet").with_two_sided(true);
        let mut hzb = Hzb::new(1920, 1080).expect("a size in range");
        group.bench_function(BenchmarkId::from_parameter(pixels), |b| {
            b.iter(|| {
                hzb.begin(&view(), DVec3::ZERO);
                hzb.add(&sheet, &Affine3A::IDENTITY);
                hzb.flush();
            });
        });
    }
    group.finish();
}

/// Measures frames of the walks through the built-in city and office, one frame after another.
fn walks(c: &mut Criterion) {
    let mut group = c.benchmark_group("hzb/frame of a walk");
    for name in ["plpcity", "office"] {
        let world =
            World::new(built_in(name).expect("it is built in"), (1920, 1080), Some(16)).expect("views");
        let map = Hzb::new(512, 288).expect("a size in range");
        let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(HzbCuller::new(map));
        let mut visible = VisibleSet::new();
        let mut views = world.views.iter().cycle();
        group.bench_function(name, |b| {
            b.iter(|| views.next().map(|view| pipeline.cull(&world.scene, view, &mut visible)));
        });
    }
    group.finish();
}

/// Measures `begin` of a frame and, with an empty z-buffer, `flush`, which updates the pyramid, at two
/// resolutions.
fn pyramid(c: &mut Criterion) {
    let mut group = c.benchmark_group("hzb/pyramid");
    for size in [[512, 288], [1920, 1080]] {
        let mut hzb = Hzb::new(size[0], size[1]).expect("a size in range");
        hzb.begin(&view(), DVec3::ZERO);
        group.bench_function(BenchmarkId::new("flush", size[0]), |b| b.iter(|| hzb.flush()));
        group.bench_function(BenchmarkId::new("begin", size[0]), |b| {
            b.iter(|| hzb.begin(&view(), DVec3::ZERO))
        });
    }
    group.finish();
}

/// Measures the test of boxes in front of and behind a wall with a gap, by size in pixels.
fn queries(c: &mut Criterion) {
    let mut hzb = Hzb::new(1920, 1080).expect("a size in range");
    hzb.begin(&view(), DVec3::ZERO);
    for y in [-600.0f32, 600.0] {
        let wall = Aabb::from_arrays([500.0, y - 580.0, -400.0], [501.0, y + 580.0, 400.0]);
        hzb.add(&OccluderMesh::cuboid(&wall).expect("a box"), &Affine3A::IDENTITY);
    }
    hzb.flush();
    let mut group = c.benchmark_group("hzb/test a box");
    for pixels in [2.0, 16.0, 128.0] {
        let mut random = Random(2);
        let behind: Vec<_> = (0..256).map(|_| cube(&mut random, pixels)).collect();
        let before: Vec<_> = behind.iter().map(|b| Aabb::new(b.min * 0.4, b.max * 0.4)).collect();
        for (name, boxes) in [("behind", &behind), ("before", &before)] {
            group.throughput(Throughput::Elements(256));
            group.bench_function(BenchmarkId::new(name, pixels), |b| {
                b.iter(|| {
                    boxes
                        .iter()
                        .filter(|bounds| {
                            hzb.test(black_box(bounds)) != visibility_core::occlusion::Occlusion::Hidden
                        })
                        .count()
                });
            });
        }
    }
    group.finish();
}

/// Measures a frame through the whole pipeline: a town of 2,500 houses with 20,000 small objects among them,
/// seen from a street.
fn frame(c: &mut Criterion) {
    let (scene, view) = town();
    let mut group = c.benchmark_group("hzb/frame of a town");
    for size in [[512, 288], [1920, 1080]] {
        let map = Hzb::new(size[0], size[1]).expect("a size in range");
        let culler = HzbCuller::new(map);
        let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(culler);
        let mut visible = VisibleSet::new();
        group.bench_function(BenchmarkId::from_parameter(size[0]), |b| {
            b.iter(|| pipeline.cull(&scene, &view, &mut visible));
        });
    }
    group.finish();
}

criterion_group!(benches, raster, triangles, pyramid, queries, frame, walks);
criterion_main!(benches);
