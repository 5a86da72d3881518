//! Benchmark of portal culling: frames by the number of portals that the view crosses, with both kinds of
//! narrowing, and the opening and closing of a thousand doors.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::Duration;
use visibility_core::glam::DVec3;
use visibility_core::{
    Aabb, Pose, Scene, View, VisibleSet,
    cells::{CellGraph, CellId, PortalId},
    geometry::ConvexPolygon,
    pvs::{Viewcell, Viewcells},
};
use visibility_portals::{Narrowing, PortalEye, SceneCells};

/// Makes rooms 4 m long in a row along x, with a door 1 m wide and 2 m high in the middle of each wall and
/// ten boxes in each room.
fn row(rooms: u32) -> (SceneCells, Scene) {
    let room = |i: u32| DVec3::new(f64::from(i) * 4.0, 0.0, 0.0);
    let door = |x: f64| {
        let corners = [[1.5, 0.0], [2.5, 0.0], [2.5, 2.0], [1.5, 2.0]];
        ConvexPolygon::new(corners.map(|[y, z]| DVec3::new(x, y, z))).expect("a door")
    };
    let portals = (1..rooms).map(|i| (door(room(i).x), [CellId(i - 1), CellId(i)]));
    let graph = CellGraph::new(rooms as usize, portals).expect("rooms in a row");
    let viewcells = (0..rooms).map(|i| Viewcell::from_box(room(i), room(i) + DVec3::new(4.0, 4.0, 3.0)));
    let mut cells = SceneCells::new(graph, Viewcells::new(viewcells), 1e-6).expect("a viewcell a room");
    let mut scene = Scene::new();
    scene.insert_batch((0..rooms * 10).map(|i| {
        let at = (room(i / 10)
            + DVec3::new(0.5 + f64::from(i % 10) * 0.3, f64::from(i % 10) * 0.35 + 0.3, 1.0))
        .as_vec3();
        Aabb::new(at - 0.15, at + 0.15)
    }));
    cells.sync(&scene);
    (cells, scene)
}

fn frame(c: &mut Criterion) {
    let mut group = c.benchmark_group("portals/frame by portals crossed");
    group.measurement_time(Duration::from_secs(2));
    let pose = Pose::look_at(DVec3::new(0.5, 2.0, 1.0), DVec3::new(9.0, 2.0, 1.0), DVec3::Z);
    let view = View::perspective(pose, 1.0, 1.5, 0.1, f64::INFINITY).expect("a camera by the book");
    for crossed in [0u32, 1, 4, 16, 64] {
        let (cells, scene) = row(crossed + 1);
        group.throughput(Throughput::Elements(u64::from(crossed.max(1))));
        for narrowing in [Narrowing::Polygon, Narrowing::Rectangle] {
            let mut eye = PortalEye::new().with_narrowing(narrowing);
            let mut visible = VisibleSet::new();
            group.bench_function(BenchmarkId::new(format!("{narrowing:?}"), crossed), |b| {
                b.iter(|| {
                    visible.fill(&scene, &view);
                    eye.cull(&cells, &scene, black_box(&view), &mut visible)
                });
            });
            assert_eq!(eye.stats().crossed, u64::from(crossed), "all doors are seen through");
        }
    }
}

fn doors(c: &mut Criterion) {
    let (mut cells, _) = row(1001);
    let mut group = c.benchmark_group("portals/doors");
    group.throughput(Throughput::Elements(1000)).measurement_time(Duration::from_secs(2));
    let mut open = false;
    group.bench_function("1000 opened or closed", |b| {
        b.iter(|| {
            open = !open;
            for i in 0..1000 {
                cells.set_open(PortalId(i), black_box(open)).expect("a portal of the row");
            }
        });
    });
}

criterion_group!(benches, frame, doors);
criterion_main!(benches);
