//! Tests that the horizon culler carries nothing over from other scenes, and allocates nothing in a warm
//! frame. Scenes are swapped, mixed, cloned, reverted and dropped under a live culler, whose answers must
//! equal those of a culler that has seen no other scene.

use std::sync::Arc;
use visibility_2d::horizon::{Horizon, HorizonCuller, HorizonOccluders, UpAxis};
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::{Aabb, Culler, Object, OccluderMesh, OcclusionCuller, Pose, Scene, View, VisibleSet};
use visibility_testing::allocations::ALLOCATIONS;
use visibility_testing::swapped::{Swapped, hold_against_fresh, scene};
use visibility_testing::{Random, judged, told_enough};

/// Culler with occluders prepared once.
struct Prepared;

impl Swapped for Prepared {
    type Culler = HorizonCuller;
    type Source = Arc<HorizonOccluders>;

    fn derive(&self, scene: &Scene, rng: &mut Random) -> Self::Source {
        let up = if rng.one_in(8) { UpAxis::Y } else { UpAxis::Z };
        HorizonOccluders::new(scene, up).into()
    }

    fn make(&self, source: &Self::Source) -> Self::Culler {
        HorizonCuller::new(source.clone())
    }

    fn give(&self, culler: &mut Self::Culler, source: &Self::Source, _: &Scene) {
        culler.set_occluders(source.clone());
    }
}

/// Culler whose occluders are synchronized before each frame.
struct Synchronised;

impl Swapped for Synchronised {
    type Culler = HorizonCuller;
    type Source = HorizonOccluders;

    fn derive(&self, scene: &Scene, _: &mut Random) -> Self::Source {
        HorizonOccluders::new(scene, UpAxis::Z)
    }

    fn make(&self, source: &Self::Source) -> Self::Culler {
        HorizonCuller::new(Arc::new(source.clone()))
    }

    fn give(&self, culler: &mut Self::Culler, source: &Self::Source, scene: &Scene) {
        let mut source = source.clone();
        source.sync(scene);
        culler.set_occluders(source.into());
    }

    /// Columns keep three steps. A solid more may replace a step, so that a fresh culler, which knows all
    /// solids, hides less than a culler that does not know what has changed since its occluders were made.
    fn is_judged_by_segments(&self) -> bool {
        true
    }
}

/// The horizon as an occlusion map in core's driver.
struct Map;

impl Swapped for Map {
    type Culler = OcclusionCuller<Horizon>;
    type Source = ();

    fn derive(&self, _: &Scene, _: &mut Random) {}

    fn make(&self, (): &()) -> Self::Culler {
        OcclusionCuller::new(Horizon::new(UpAxis::Z))
    }

    fn give(&self, _: &mut Self::Culler, (): &(), _: &Scene) {}
}

fn hold<S: Swapped>(kind: &S) {
    let hidden: usize = (0..4).map(|seed| hold_against_fresh(kind, seed, 250)).sum();
    judged(hidden as u64);
    told_enough(hidden > 250, format_args!("{hidden} objects are no test"));
}

#[test]
fn occluders_made_in_advance() {
    hold(&Prepared);
}

#[test]
fn occluders_synchronised() {
    hold(&Synchronised);
}

#[test]
fn map_of_the_driver() {
    hold(&Map);
}

#[test]
fn a_warm_frame_allocates_nothing() {
    let mut random = Random(5);
    let scene = scene(&mut random);
    let mut culler = HorizonCuller::new(HorizonOccluders::new(&scene, UpAxis::Z).into());
    let mut map = OcclusionCuller::new(Horizon::new(UpAxis::Z));
    let mut visible = VisibleSet::new();
    let (mut before, mut hidden) = (0, 0);
    for number in 0..40 {
        if number == 10 {
            before = ALLOCATIONS.get();
        }
        let eye = random.vector(12.0);
        let pose = Pose::look_at(eye, random.vector(3.0), DVec3::Z);
        let view = View::perspective(pose, 1.2, 1.5, 0.1, 1e3).unwrap();
        for culler in [&mut culler as &mut dyn Culler, &mut map] {
            visible.fill(&scene, &view);
            culler.cull(&scene, &view, &mut visible);
            hidden += scene.len() - visible.count(&scene);
        }
    }
    assert!(hidden > 200, "{hidden} hidden");
    assert_eq!(ALLOCATIONS.get(), before, "allocations in 30 warm frames");
}

#[test]
fn parallel_views_and_blind_frames_hide_nothing() {
    let scene = scene(&mut Random(6));
    let pose = Pose::look_at(DVec3::splat(20.0), DVec3::ZERO, DVec3::Z);
    let window = visibility_core::view::Window::centered(30.0, 20.0);
    let view = View::orthographic(pose, window, 0.1, 100.0).unwrap();
    let mut visible = VisibleSet::new();
    let mut culler = HorizonCuller::new(HorizonOccluders::new(&scene, UpAxis::Z).into());
    visible.fill(&scene, &view);
    let stats = culler.cull(&scene, &view, &mut visible);
    assert_eq!(stats.visible, scene.len() as u64, "objects counted in a parallel view");
    assert_eq!(visible.count(&scene), scene.len(), "objects visible in a parallel view");
}

/// A wall that has moved since its solids were made hides nothing, neither at its old nor at its new place.
/// It hides at the new place once its solids are made again.
#[test]
fn a_wall_that_moved_hides_nothing_until_it_is_taken_in() {
    use visibility_core::glam::Affine3A;
    use visibility_core::{Aabb, Object, OccluderMesh};
    let mut scene = Scene::new();
    let at = |y: f32| Aabb::from_arrays([5.0, y - 3.0, -3.0], [5.5, y + 3.0, 3.0]);
    let wall = scene.insert(Object { occluder: true, ..Object::new(at(0.0)) });
    let place = |scene: &mut Scene, y: f32| {
        scene.set_bounds(wall, at(y)).unwrap();
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&at(y)).unwrap());
        scene.set_mesh(wall, mesh, Affine3A::IDENTITY).unwrap();
    };
    place(&mut scene, 0.0);
    let behind = |y: f32| Aabb::from_arrays([9.0, y - 0.1, -0.1], [9.2, y + 0.1, 0.1]);
    let (middle, side) = (scene.insert(behind(0.0)), scene.insert(behind(12.0)));
    let mut occluders = HorizonOccluders::new(&scene, UpAxis::Z);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    let view = View::perspective(pose, 2.0, 1.5, 0.1, 1e3).unwrap();
    let hidden = |scene: &Scene, occluders: &HorizonOccluders| {
        let mut visible = VisibleSet::new();
        visible.fill(scene, &view);
        HorizonCuller::new(Arc::new(occluders.clone())).cull(scene, &view, &mut visible);
        [middle, side].map(|id| !visible.contains(scene, id))
    };
    assert_eq!(hidden(&scene, &occluders), [true, false], "the wall is before the middle");
    place(&mut scene, 6.5);
    assert_eq!(
        hidden(&scene, &occluders),
        [false, false],
        "the wall has moved, and the occluders do not know"
    );
    occluders.sync(&scene);
    assert_eq!(hidden(&scene, &occluders), [false, true], "the wall is before the side");
    scene.set_occluder(wall, false).unwrap();
    assert_eq!(
        hidden(&scene, &occluders),
        [false, false],
        "the wall is no occluder, and the occluders do not know"
    );
    occluders.sync(&scene);
    assert_eq!(
        (hidden(&scene, &occluders), occluders.solid_count()),
        ([false, false], 0),
        "the wall is no occluder"
    );
}

/// Makes a wall in the plane x = 5, and boxes behind it. Returns the scene and a view from the origin along
/// x.
fn boxes_behind_a_wall(count: usize) -> (Scene, View) {
    use visibility_core::glam::Affine3A;
    use visibility_core::{Aabb, Object, OccluderMesh};
    let mut scene = Scene::new();
    let bounds = Aabb::from_arrays([5.0, -3.0, -3.0], [5.5, 3.0, 3.0]);
    let wall = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
    scene.set_mesh(wall, mesh, Affine3A::IDENTITY).unwrap();
    for i in 0..count {
        let y = i as f32 * 0.02 - 0.5;
        scene.insert(Aabb::from_arrays([9.0, y, -0.1], [9.2, y + 0.01, 0.1]));
    }
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    (scene, View::perspective(pose, 2.0, 1.5, 0.1, 1e3).unwrap())
}

/// Siblings found hidden one after another stay hidden, even if no earlier stage has made masks.
#[test]
fn siblings_hidden_one_by_one_stay_hidden_without_a_stage_before() {
    let (scene, view) = boxes_behind_a_wall(50);
    let mut culler = HorizonCuller::new(HorizonOccluders::new(&scene, UpAxis::Z).into());
    let mut visible = VisibleSet::new();
    visible.fill(&scene, &view);
    let stats = culler.cull(&scene, &view, &mut visible);
    assert_eq!((visible.count(&scene), stats.visible), (1, 1), "the wall alone is visible");
}

#[test]
fn occluders_of_another_up_axis_hide_nothing_until_the_next_frame() {
    use visibility_core::{Aabb, OcclusionMap, occlusion::Occlusion};
    let (scene, view) = boxes_behind_a_wall(1);
    let mut culler = HorizonCuller::new(HorizonOccluders::new(&scene, UpAxis::Z).into());
    let mut visible = VisibleSet::new();
    visible.fill(&scene, &view);
    culler.cull(&scene, &view, &mut visible);
    let behind = Aabb::from_arrays([9.0, -0.1, -0.1], [9.2, 0.1, 0.1]);
    assert_eq!(culler.horizon().test(&behind), Occlusion::Hidden, "a box behind the wall");
    culler.set_occluders(HorizonOccluders::new(&scene, UpAxis::Y).into());
    assert_ne!(
        culler.horizon().test(&behind),
        Occlusion::Hidden,
        "occluders of another up axis, before the next frame"
    );
}

/// Small solids are left out where there are large ones: furniture hides next to nothing compared with walls,
/// and costs as much.
#[test]
fn small_solids_beside_large_ones_are_left_out() {
    let mut scene = Scene::new();
    let mut insert = |size: f32| {
        let bounds = Aabb::from_arrays([0.0; 3], [size; 3]);
        let id = scene.insert(Object { occluder: true, ..Object::new(bounds) });
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&bounds).unwrap());
        scene.set_mesh(id, mesh, Affine3A::IDENTITY).unwrap();
        id
    };
    // Boxes with upright faces of 16 and of 1 m2.
    let walls = [(); 20].map(|()| insert(4.0));
    let chairs = [(); 60].map(|()| insert(1.0));
    let mut occluders = HorizonOccluders::new(&scene, UpAxis::Z);
    assert_eq!(occluders.solid_count(), walls.len(), "solids taken: the walls");
    // A chair that moves remains too small to be an occluder; a chair that grows becomes one.
    scene.set_bounds(chairs[0], Aabb::from_arrays([5.0; 3], [6.0; 3])).unwrap();
    let grown = Aabb::from_arrays([0.0; 3], [1.5; 3]);
    let wardrobe = scene.add_mesh(OccluderMesh::cuboid(&grown).unwrap());
    scene.set_bounds(chairs[1], grown).unwrap();
    scene.set_mesh(chairs[1], wardrobe, Affine3A::IDENTITY).unwrap();
    scene.set_occluder(walls[0], false).unwrap();
    occluders.sync(&scene);
    assert_eq!(occluders.solid_count(), walls.len(), "solids taken: one wall less, and the chair that grew");
}
