//! Benchmark of culling the clusters of instances, compared with a hand-written loop as in engines: 1,000
//! instances of a mesh of 1,000 clusters, one view, one thread. The loop transforms the bounding sphere and
//! the normal cone of every cluster of every visible instance and tests both, without bounds on rounding, and
//! is only correct for rotations and uniform scales. Both begin with the same visible set. Throughput is in
//! clusters of the visible instances per second.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::f32::consts::{PI, TAU};
use std::hint::black_box;
use visibility_benches::workload::Random;
use visibility_core::glam::{Affine3A, DVec3, Quat, Vec3, Vec4};
use visibility_core::view::Eye;
use visibility_core::{Aabb, FrustumCuller, Object, ObjectId, Pipeline, Pose, Scene, View, VisibleSet};
use visibility_frame::backface::NormalCone;
use visibility_frame::clusters::{ClusterInstance, ClusterMesh, ClusterView, VisibleCluster};

/// Cluster in the form of meshoptimizer: bounding sphere, and cone with apex, axis and cutoff.
#[derive(Clone, Copy)]
struct Meshlet {
    center: Vec3,
    radius: f32,
    apex: Vec3,
    axis: Vec3,
    cutoff: f32,
}

const RINGS: usize = 25;
const SECTORS: usize = 40;

/// Makes the triangles of 1,000 clusters on a sphere of radius 1, 32 triangles per cluster.
fn sphere() -> Vec<Vec<[Vec3; 3]>> {
    let at = |ring: usize, sector: usize| {
        let (up, around) =
            (PI * ring as f32 / (4 * RINGS) as f32, TAU * sector as f32 / (4 * SECTORS) as f32);
        Vec3::new(up.sin() * around.cos(), up.sin() * around.sin(), up.cos())
    };
    let quad = |i: usize, j: usize| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    let patch = |ring: usize, sector: usize| {
        (0..16).flat_map(|k| quad(4 * ring + k / 4, 4 * sector + k % 4)).collect::<Vec<_>>()
    };
    (0..RINGS * SECTORS).map(|k| patch(k / SECTORS, k % SECTORS)).collect()
}

fn meshlet(triangles: &[[Vec3; 3]]) -> Meshlet {
    let center = Aabb::from_points(triangles.iter().flatten().copied()).center();
    let normals = || triangles.iter().map(|[a, b, c]| (b - a).cross(c - a).normalize_or_zero());
    let axis = normals().sum::<Vec3>().normalize();
    let least = normals().filter(|n| *n != Vec3::ZERO).map(|n| n.dot(axis)).fold(1.0, f32::min);
    // The apex lies behind the planes of all triangles.
    let behind = triangles.iter().zip(normals()).filter(|(_, n)| *n != Vec3::ZERO);
    let back = behind.map(|(t, n)| (center - t[0]).dot(n) / n.dot(axis)).fold(0.0, f32::max);
    Meshlet {
        center,
        radius: triangles.iter().flatten().map(|p| p.distance(center)).fold(0.0, f32::max),
        apex: center - axis * back,
        axis,
        cutoff: (1.0 - least * least).sqrt(),
    }
}

/// Hand-written loop: appends the visible clusters of one instance.
fn by_hand(
    meshlets: &[Meshlet],
    transform: &Affine3A,
    planes: &[Vec4],
    eye: Vec3,
    instance: ObjectId,
    list: &mut Vec<VisibleCluster>,
) {
    let scale = transform.matrix3.x_axis.length();
    for (cluster, meshlet) in (0..).zip(meshlets) {
        let center = transform.transform_point3(meshlet.center);
        let radius = meshlet.radius * scale;
        if planes.iter().any(|plane| plane.dot(center.extend(1.0)) < -radius) {
            continue;
        }
        let apex = transform.transform_point3(meshlet.apex);
        let axis = transform.transform_vector3(meshlet.axis) / scale;
        let toward = apex - eye;
        if toward.dot(axis) >= meshlet.cutoff * toward.length() {
            continue;
        }
        list.push(VisibleCluster { instance, cluster });
    }
}

fn clusters(c: &mut Criterion) {
    let mut random = Random(1);
    let triangles = sphere();
    let mesh = ClusterMesh::new(triangles.iter().map(|triangles| {
        (Aabb::from_points(triangles.iter().flatten().copied()), NormalCone::from_triangles(triangles))
    }));
    let meshlets: Vec<Meshlet> = triangles.iter().map(|triangles| meshlet(triangles)).collect();
    let transforms: Vec<Affine3A> = (0..1000)
        .map(|_| {
            let turn = Quat::from_scaled_axis(random.point(-3.0, 3.0));
            let scale = Vec3::splat(random.within(1.0, 6.0));
            Affine3A::from_scale_rotation_translation(scale, turn, random.point(-100.0, 100.0))
        })
        .collect();
    let mut scene = Scene::new();
    scene.insert_batch(transforms.iter().map(|transform| {
        let reach = transform.matrix3.x_axis.length() * 1.001;
        let center = Vec3::from(transform.translation);
        Object { one_sided: true, ..Object::new(Aabb::new(center - reach, center + reach)) }
    }));
    // One camera among the instances, and one that sees all of them.
    for (name, eye, fov) in
        [("amid", DVec3::new(-20.0, 0.0, 0.0), 1.0), ("all", DVec3::new(-420.0, 0.0, 0.0), 0.8)]
    {
        let pose = Pose::look_at(eye, DVec3::X * 50.0, DVec3::Z);
        let view = View::perspective(pose, fov, 1.6, 0.1, 1000.0).expect("a camera");
        let mut visible = VisibleSet::new();
        Pipeline::new().with(FrustumCuller::new()).cull(&scene, &view, &mut visible);
        let instances = visible.count(&scene);
        let mut list = Vec::with_capacity(1 << 20);

        let mut group = c.benchmark_group(format!("clusters/{name}"));
        group.throughput(Throughput::Elements(1000 * instances as u64));
        group.bench_function(BenchmarkId::from_parameter("cluster view"), |b| {
            b.iter(|| {
                list.clear();
                let instance = |id: ObjectId| Some(ClusterInstance::new(&mesh, transforms[id.index()]));
                black_box(ClusterView::new(&scene, &view).cull(&visible, instance, &mut list))
            });
        });
        let ours = list.len();

        let planes: Vec<Vec4> = (view.planes(scene.origin()).as_slice().iter())
            .map(|plane| plane.plane.normal.as_vec3().extend(plane.plane.offset as f32))
            .collect();
        let Eye::Point(eye) = view.eye(scene.origin()) else { unreachable!("perspective") };
        group.bench_function(BenchmarkId::from_parameter("spheres and cones by hand"), |b| {
            b.iter(|| {
                list.clear();
                for id in visible.iter(&scene) {
                    let transform = &transforms[id.index()];
                    by_hand(&meshlets, transform, &planes, eye.as_vec3(), id, &mut list);
                }
                black_box(list.len())
            });
        });
        eprintln!("{name}: {instances} instances; {ours} clusters listed, {} by hand", list.len());
        group.finish();
    }
}

criterion_group!(benches, clusters);
criterion_main!(benches);
