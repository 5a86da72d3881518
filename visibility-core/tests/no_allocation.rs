//! Tests that frames allocate nothing once warm, and how many bytes an object takes. Allocations are counted
//! by a global allocator of this file.

use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::{
    Aabb, Accuracy, FrustumCuller, ObjectId, OccluderMesh, OcclusionCuller, OcclusionMap, Pipeline, Scene,
    View, VisibleSet,
    geometry::Plane,
    occlusion::Occlusion,
    pvs::{Prefetch, Pvs, PvsCuller, PvsTargets, ScenePvs, Viewcell, ViewcellId, Viewcells},
};
use visibility_testing::allocations::{ALLOCATIONS, LIVE};
use visibility_testing::cameras::circling;
use visibility_testing::{Octree, Random};

/// A world in which a sequence of moves is repeated: objects step back and forth, some of them across the
/// world.
struct World {
    scene: Scene,
    /// New bounds of the moved objects, for each frame of the sequence.
    walk: Vec<Vec<(ObjectId, Aabb)>>,
    frames: usize,
    drawn: usize,
    appeared: usize,
}

impl World {
    fn new(count: usize, moves_per_frame: usize, teleports: bool) -> Self {
        let mut rng = Random(1);
        let mut scene = Scene::new();
        let homes: Vec<Aabb> = (0..count).map(|_| rng.small_box(200.0)).collect();
        let ids = scene.insert_batch(homes.iter().copied());
        let mut walk = Vec::new();
        for frame in 0..16 {
            let mut moves = Vec::new();
            for _ in 0..moves_per_frame {
                let number = rng.below(count);
                let step = rng.vector(3.0).as_vec3();
                let home = homes[number];
                moves.push((ids[number], Aabb::new(home.min + step, home.max + step)));
            }
            // A tenth of the objects teleports together every fourth frame.
            for &id in ids[..count / 10].iter().filter(|_| teleports && frame % 4 == 0) {
                let place = frame as f32 * 10.0 + id.index() as f32 * 1e-3;
                moves.push((id, Aabb::from_arrays([place, -place, 0.0], [place + 1.0, 1.0 - place, 1.0])));
            }
            walk.push(moves);
        }
        Self { scene, walk, frames: 0, drawn: 0, appeared: 0 }
    }

    fn frame(&mut self, pipeline: &mut Pipeline, visible: &mut VisibleSet, sort: bool) {
        self.scene.set_bounds_batch(&self.walk[self.frames % self.walk.len()]).unwrap();
        self.scene.maintain(16);
        pipeline.cull(&self.scene, &circling(self.frames), visible);
        if sort {
            visible.sort_by_key(&self.scene, |id| id.index() % 100);
        }
        self.drawn += visible.iter(&self.scene).count() + visible.count(&self.scene);
        self.appeared += visible.newly_visible().count() + visible.newly_hidden().count();
        self.frames += 1;
    }
}

fn check_frames(teleports: bool, changes: bool, sort: bool, warm: usize) {
    for size in [40, 1000, 20_000] {
        let mut world = World::new(size, size / 50, teleports);
        let mut visible = if changes { VisibleSet::new().with_changes() } else { VisibleSet::new() };
        let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(FrustumCuller::new());
        for _ in 0..warm {
            world.frame(&mut pipeline, &mut visible, sort);
        }
        let before = ALLOCATIONS.get();
        for _ in 0..400 {
            world.frame(&mut pipeline, &mut visible, sort);
        }
        assert_eq!(ALLOCATIONS.get() - before, 0, "{size} objects, after {} frames", world.frames);
        assert!(
            world.drawn > 0 && (!changes || world.appeared > 0),
            "{size} objects: {} drawn, {} appeared",
            world.drawn,
            world.appeared
        );
    }
}

#[test]
fn frames_allocate_nothing_once_warm() {
    check_frames(false, false, false, 40);
}

#[test]
fn frames_that_tell_of_changes_and_sort_allocate_nothing_once_warm() {
    check_frames(false, true, true, 100);
}

/// Tests frames in which most objects move, by bounds or by transforms.
#[test]
fn frames_that_move_everything_allocate_nothing_once_warm() {
    let mut world = World::new(5000, 5000, false);
    let ids: Vec<ObjectId> = world.scene.ids().collect();
    let mut placed = world.scene.clone();
    let mesh = placed.add_mesh(OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3])).unwrap());
    for &id in &ids {
        placed.set_local_bounds(id, placed.bounds(id).unwrap()).unwrap();
        placed.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
    }
    let turned = |angle: f32| Affine3A::from_rotation_z(angle).to_cols_array();
    let moves: Vec<Vec<_>> =
        (0..8).map(|frame| ids.iter().map(|&id| (id, turned(frame as f32 * 0.01))).collect()).collect();
    let (mut pipeline, mut visible) = (Pipeline::new().with(FrustumCuller::new()), VisibleSet::new());
    let mut before = 0;
    for frame in 0..200 {
        if frame == 100 {
            before = ALLOCATIONS.get();
        }
        world.frame(&mut pipeline, &mut visible, false);
        placed.set_transforms_batch(&moves[frame % moves.len()]).unwrap();
        placed.maintain(16);
    }
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations in 100 warm frames");
}

/// Tests that buffers which grow slowly are allocated once: a scene with few moves per frame allocates
/// nothing after the first frames.
#[test]
fn frames_with_few_moves_allocate_nothing_after_a_second() {
    let mut world = World::new(20_000, 5, false);
    let mut visible = VisibleSet::new();
    let mut pipeline = Pipeline::new().with(FrustumCuller::new());
    for _ in 0..60 {
        world.frame(&mut pipeline, &mut visible, false);
    }
    let before = ALLOCATIONS.get();
    for _ in 0..3000 {
        world.frame(&mut pipeline, &mut visible, false);
        assert_eq!(ALLOCATIONS.get(), before, "in frame {}", world.frames);
    }
}

/// Tests teleports, which split and free nodes: once the greatest number of nodes has been reached, no more
/// are allocated.
#[test]
fn frames_with_teleports_allocate_nothing_once_warm() {
    check_frames(true, true, false, 1000);
}

/// Tests two eyes and the union of their sets, in a moving scene.
#[test]
fn many_views_allocate_nothing_once_warm() {
    let mut world = World::new(20_000, 100, false);
    let clip = Plane::new(DVec3::new(1.0, 1.0, 0.0), 60.0);
    let mut eyes = [(); 2].map(|_| (Pipeline::new().with(FrustumCuller::new()), VisibleSet::new()));
    let (mut both, mut moved) = (VisibleSet::new().with_changes(), VisibleSet::new());
    let mut before = 0;
    for frame in 0..300 {
        if frame == 100 {
            before = ALLOCATIONS.get();
        }
        world.frame(&mut eyes[0].0, &mut moved, false);
        both.clear(&world.scene);
        for (number, (pipeline, set)) in eyes.iter_mut().enumerate() {
            let eye = circling(frame + number).with_clip_planes(&[clip]).unwrap();
            pipeline.cull(&world.scene, &eye, set);
            both.union(&world.scene, set);
        }
        both.finish(&world.scene);
        world.appeared += both.newly_visible().count();
    }
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations in 200 warm frames");
    assert!(world.drawn > 0 && world.appeared > 0, "{} drawn, {} appeared", world.drawn, world.appeared);
}

/// An occlusion map that hides boxes far behind the nearest occluder, and allocates nothing itself.
struct Curtain {
    nearest: f32,
}

impl OcclusionMap for Curtain {
    fn name(&self) -> &str {
        "curtain"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Approximate
    }

    fn begin(&mut self, _: &View, _: DVec3) {
        self.nearest = f32::INFINITY;
    }

    fn add(&mut self, occluder: &OccluderMesh, transform: &Affine3A) {
        self.nearest = self.nearest.min(transform.transform_point3(occluder.bounds().min).x);
    }

    fn flush(&mut self) {}

    fn test(&self, bounds: &Aabb) -> Occlusion {
        if bounds.min.x > self.nearest + 30.0 { Occlusion::Hidden } else { Occlusion::Partial }
    }
}

/// Tests the occlusion driver over the scene's own hierarchy and another.
#[test]
fn occlusion_allocates_nothing_once_warm() {
    let mut world = World::new(5_000, 50, false);
    let mesh = OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [1.0; 3])).unwrap();
    let mesh = world.scene.add_mesh(mesh);
    for id in world.scene.ids().step_by(3).collect::<Vec<_>>() {
        let place = world.scene.bounds(id).unwrap().min;
        world.scene.set_mesh(id, mesh, Affine3A::from_translation(place)).unwrap();
        world.scene.set_occluder(id, true).unwrap();
    }
    let own = OcclusionCuller::new(Curtain { nearest: 0.0 });
    let octree = Octree::new(&world.scene, 5);
    let foreign = OcclusionCuller::over(Curtain { nearest: 0.0 }, octree);
    let mut pipelines = [
        Pipeline::new().with(FrustumCuller::new()).with(own),
        Pipeline::new().with(FrustumCuller::new()).with(foreign),
    ];
    let mut visible = VisibleSet::new();
    let mut before = 0;
    for frame in 0..300 {
        if frame == 150 {
            before = ALLOCATIONS.get();
        }
        for pipeline in &mut pipelines {
            world.frame(pipeline, &mut visible, false);
        }
    }
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations in 150 warm frames");
}

/// Tests a PVS culler whose eye enters other viewcells, and leaves all of them, while objects move.
#[test]
fn a_pvs_allocates_nothing_once_warm() {
    let mut world = World::new(20_000, 100, false);
    let rows: Vec<Vec<u32>> = (1..5).map(|row| (0..20_000).step_by(row * 7).collect()).collect();
    let pvs = Pvs::new(PvsTargets::Objects, 20_000, &rows, |_| []).unwrap();
    // The eye goes round a circle of 30 m: through four viewcells, and a gap.
    let viewcells = Viewcells::new([-40.0, -15.0, 0.0, 15.0].map(|x| {
        let min = DVec3::new(x, -50.0, -50.0);
        Viewcell::from_box(min, DVec3::new(x + if x == 15.0 { 10.0 } else { 15.0 }, 50.0, 50.0))
    }));
    let shared = ScenePvs::new(&world.scene, pvs, viewcells, world.scene.ids().zip(0..));
    let mut pipeline =
        Pipeline::new().with(FrustumCuller::new()).with(PvsCuller::new(std::sync::Arc::new(shared)));
    let (mut visible, mut before) = (VisibleSet::new(), 0);
    for frame in 0..600 {
        if frame == 300 {
            before = ALLOCATIONS.get();
        }
        world.frame(&mut pipeline, &mut visible, false);
    }
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations in 300 warm frames");
    assert!(world.drawn > 0, "no object was drawn");
}

#[test]
fn an_object_takes_at_most_64_bytes() {
    let mut rng = Random(2);
    let boxes: Vec<Aabb> = (0..100_000).map(|_| rng.small_box(200.0)).collect();
    let before = LIVE.get();
    let mut scene = Scene::new();
    drop(scene.insert_batch(boxes.iter().copied()));
    for state in ["built", "rebuilt"] {
        let live = (LIVE.get() - before) as usize;
        assert!(scene.memory() <= 64 * boxes.len(), "{state}: {} bytes", scene.memory());
        assert!(live <= 64 * boxes.len(), "{state}: {live} bytes held");
        // The reported memory is the allocated memory, except for some spare capacity.
        assert!((live * 99 / 100..=live).contains(&scene.memory()), "{state}: {} of {live}", scene.memory());
        scene.rebuild();
    }
    drop(scene);
    assert_eq!(LIVE.get(), before, "all is given back");
}

#[test]
fn warm_prefetches_allocate_nothing() {
    let mut rng = Random(12);
    let mut scene = Scene::new();
    let ids = scene.insert_batch((0..500).map(|_| rng.small_box(200.0)));
    let room = |i: u32| {
        let x = f64::from(i) * 2.0;
        Viewcell::from_box(DVec3::new(x, -5.0, -5.0), DVec3::new(x + 2.0, 5.0, 5.0))
    };
    let rows: Vec<Vec<u32>> = (0..50).map(|_| (0..500).filter(|_| rng.below(20) == 0).collect()).collect();
    let before_it = |id: ViewcellId| id.0.checked_sub(1).map(ViewcellId);
    let pvs = Pvs::new(PvsTargets::Objects, 500, &rows, before_it).unwrap();
    let pairs = ids.into_iter().map(|id| (id, id.index() as u32));
    let sets = ScenePvs::new(&scene, pvs, Viewcells::new((0..50).map(room)), pairs);
    let (mut prefetch, mut found, mut before) = (Prefetch::new(), 0, 0);
    for frame in 0..100 {
        if frame == 50 {
            before = ALLOCATIONS.get();
        }
        let eye = DVec3::X * f64::from(frame % 50);
        found += prefetch.search(&sets, eye, DVec3::X * 4.0, 0.2, 5.0).len();
    }
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations in 50 warm searches");
    assert!(found > 1000, "{found}");
}
