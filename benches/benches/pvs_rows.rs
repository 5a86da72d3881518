//! Benchmarks of a potentially visible set. Finding and decoding a row, in a town of 10,000 objects and 1,024
//! viewcells, where each viewcell sees near objects, and fewer objects the farther away they are. Culling by
//! a set whose rows have 36 of 136,900 objects, after the frustum and without its time, compared with looking
//! up each object that the frustum leaves.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};
use visibility_core::glam::{DVec2, DVec3, Vec3};
use visibility_core::pvs::{Pvs, PvsCuller, PvsTargets, ScenePvs, Viewcell, ViewcellId, Viewcells};
use visibility_core::{Aabb, CullStats, Culler, FrustumCuller, ObjectId, Pose, Scene, View, VisibleSet};

/// Number of viewcells along each axis.
const CELLS: u32 = 32;
/// Number of objects along each axis, for decoding rows and for culling frames.
const OBJECTS: [u32; 2] = [100, 370];
/// Length of a side of the town in metres.
const TOWN: f64 = 3700.0;
/// Height of the viewcells in metres.
const HEIGHT: f64 = 10.0;

/// Returns the position of a viewcell or object by its number, with `side` of them along each axis. The town
/// has side 1.
fn place(number: u32, side: u32) -> DVec2 {
    DVec2::new(f64::from(number % side) + 0.5, f64::from(number / side) + 0.5) / f64::from(side)
}

/// Returns the relative height of an object, from 0 to 1, always the same for one object.
fn tallness(object: u32) -> f64 {
    f64::from(object.wrapping_mul(2_654_435_761) >> 24) / 256.0
}

/// Makes a set of the objects that each viewcell sees. Returns the set, the viewcells, and the rows.
fn set(objects: u32, sees: impl Fn(u32, u32) -> bool) -> (Pvs, Viewcells, Vec<Vec<u32>>) {
    let row = |cell| (0..objects * objects).filter(|&object| sees(cell, object)).collect();
    let rows: Vec<Vec<u32>> = (0..CELLS * CELLS).map(row).collect();
    let viewcells = Viewcells::new((0..CELLS * CELLS).map(|cell| {
        let half = DVec2::splat(0.5 / f64::from(CELLS));
        let [min, max] = [place(cell, CELLS) - half, place(cell, CELLS) + half].map(|at| at * TOWN);
        Viewcell::from_box(min.extend(0.0), max.extend(HEIGHT))
    }));
    let before = |ViewcellId(cell): ViewcellId| {
        [1, CELLS].into_iter().filter_map(move |back| cell.checked_sub(back).map(ViewcellId))
    };
    let pvs =
        Pvs::new(PvsTargets::Objects, (objects * objects) as usize, &rows, before).expect("rows ascend");
    (pvs, viewcells, rows)
}

fn rows(c: &mut Criterion) {
    let objects = OBJECTS[0];
    // Objects are of different heights, so whether a far object is seen depends on viewcell and object, and
    // neighbouring rows are similar.
    let (pvs, viewcells, _) = set(objects, |cell, object| {
        place(cell, CELLS).distance(place(object, objects)) < 0.03 + 0.3 * tallness(object).powi(6)
    });
    let (mut number, mut bits) = (0, Vec::new());
    c.bench_function("find and decode a row of 10,000 targets", |b| {
        b.iter(|| {
            number = (number + 389) % (CELLS * CELLS);
            let eye = (place(number, CELLS) * TOWN).extend(HEIGHT / 2.0);
            let cell = viewcells.locate(black_box(eye)).expect("a viewcell");
            pvs.write_bits(cell, &mut bits);
            black_box(bits.first().copied())
        });
    });
}

/// Culler by a set without masks: looks up each candidate object.
struct ObjectByObject {
    sets: Arc<ScenePvs>,
    entered: Option<ViewcellId>,
    seen: Vec<u64>,
    /// Object of each index. The target of an object is its index.
    listed: Vec<Option<ObjectId>>,
    hidden: Vec<bool>,
    changed: Vec<bool>,
}

impl ObjectByObject {
    fn new(scene: &Scene, sets: Arc<ScenePvs>) -> Self {
        let (seen, hidden) = (Vec::new(), Vec::new());
        let changed = vec![false; scene.index_limit()];
        Self { sets, entered: None, seen, listed: scene.ids().map(Some).collect(), hidden, changed }
    }
}

impl Culler for ObjectByObject {
    fn name(&self) -> &str {
        "object by object"
    }

    fn accuracy(&self) -> visibility_core::Accuracy {
        visibility_core::Accuracy::Conservative
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let cell = self.sets.viewcells().locate(view.origin());
        if cell != self.entered {
            self.entered = cell;
            self.sets.pvs().write_bits(cell.expect("a viewcell"), &mut self.seen);
            self.hidden.clear();
            let is_hidden = |target: usize| self.seen[target / 64] >> (target % 64) & 1 == 0;
            self.hidden.extend((0..self.listed.len()).map(is_hidden));
        }
        visible.retain(scene, |id, _| {
            let index = id.index();
            let listed = self.listed.get(index) == Some(&Some(id));
            let [changed, hidden] = [&self.changed, &self.hidden].map(|of| of.get(index) == Some(&true));
            !listed || changed || !hidden
        })
    }
}

/// Returns a view from the middle of a viewcell over the town.
fn view(cell: u32) -> View {
    let eye = (place(cell, CELLS) * TOWN).extend(HEIGHT / 2.0);
    let pose = Pose::look_at(eye, eye + DVec3::new(1.0, 1.0, 0.0), DVec3::Z);
    View::perspective(pose, 1.4, 2.0, 0.1, f64::INFINITY).expect("a view")
}

fn frames(c: &mut Criterion) {
    let objects = OBJECTS[1];
    let (pvs, viewcells, rows) = set(objects, |cell, object| {
        tallness(object) > 0.9 && place(cell, CELLS).distance(place(object, objects)) < 0.03
    });
    let seen: usize = rows.iter().map(Vec::len).sum::<usize>() / rows.len();
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..objects * objects).map(|object| {
        let min = (place(object, objects) * TOWN).extend(0.0).as_vec3();
        Aabb::new(min, min + Vec3::splat(5.0))
    }));
    let sets = Arc::new(ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..)));

    let prepare = || {
        let pairs = ids.iter().copied().zip(0..);
        ScenePvs::new(&scene, sets.pvs().clone(), sets.viewcells().clone(), pairs)
    };
    let mut group = c.benchmark_group(format!("{} objects, {seen} in a row", ids.len()));
    let views = [view(0), view(1)];
    let (mut frustum, mut visible) = (FrustumCuller::new(), VisibleSet::new());
    visible.fill(&scene, &views[0]);
    println!("the frustum leaves {} objects", frustum.cull(&scene, &views[0], &mut visible).visible);
    group.bench_function("ScenePvs::new", |b| b.iter(prepare));
    group.bench_function("frustum alone", |b| {
        b.iter(|| {
            visible.fill(&scene, &views[0]);
            black_box(frustum.cull(&scene, &views[0], &mut visible))
        });
    });
    let by_object = || -> Box<dyn Culler> { Box::new(ObjectByObject::new(&scene, sets.clone())) };
    let by_masks = || -> Box<dyn Culler> { Box::new(PvsCuller::new(sets.clone())) };
    for (name, make) in [("object by object", &by_object as &dyn Fn() -> _), ("PvsCuller", &by_masks)] {
        for (frames, step) in [("same viewcell", 0), ("another viewcell each frame", 1)] {
            let (mut culler, mut frame, mut left) = (make(), 0, 0);
            group.bench_function(BenchmarkId::new(name, frames), |b| {
                b.iter_custom(|frames| {
                    let mut time = Duration::ZERO;
                    for _ in 0..frames {
                        frame += step;
                        let view = &views[frame % 2];
                        visible.fill(&scene, view);
                        frustum.cull(&scene, view, &mut visible);
                        let start = Instant::now();
                        left = black_box(culler.cull(&scene, view, &mut visible)).visible;
                        time += start.elapsed();
                    }
                    time
                });
            });
            println!("{left} objects left");
        }
    }
    // One object leaves its block in each frame, so that the layout of the scene changes.
    let moved = |frame: usize| {
        let min = Vec3::new(if frame.is_multiple_of(2) { 0.0 } else { 3000.0 }, 0.0, 0.0);
        Aabb::new(min, min + 5.0)
    };
    // Culls a fresh copy of the scene, so that the culler follows its change log from the start.
    let mut scene = scene.clone();
    let (pvs, viewcells) = (sets.pvs().clone(), sets.viewcells().clone());
    let of_copy = ScenePvs::new(&scene, pvs, viewcells, ids.iter().copied().zip(0..));
    let (mut culler, mut frame, mut left) = (PvsCuller::new(of_copy), 0, 0);
    group.bench_function("PvsCuller/another layout each frame", |b| {
        b.iter_custom(|frames| {
            let mut time = Duration::ZERO;
            for _ in 0..frames {
                frame += 1;
                scene.set_bounds(ids[70_000], moved(frame)).expect("an object");
                visible.fill(&scene, &views[0]);
                frustum.cull(&scene, &views[0], &mut visible);
                let start = Instant::now();
                left = black_box(culler.cull(&scene, &views[0], &mut visible)).visible;
                time += start.elapsed();
            }
            time
        });
    });
    println!("{left} objects left");
    group.finish();
}

criterion_group!(benches, rows, frames);
criterion_main!(benches);
