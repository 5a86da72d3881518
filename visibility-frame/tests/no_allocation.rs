//! Tests that frames allocate nothing once warm. Allocations are counted by a global allocator of this
//! program.

use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::occlusion::Occlusion;
use visibility_core::scene::DrawRange;
use visibility_core::{
    Aabb, Accuracy, FrustumCuller, Object, ObjectId, OccluderMesh, OcclusionMap, Pipeline, Scene, View,
    VisibleSet,
};
use visibility_frame::backface::NormalCone;
use visibility_frame::casters::{CasterCuller, Light};
use visibility_frame::clusters::{ClusterInstance, ClusterMesh, ClusterView};
use visibility_frame::draw_list::{DrawIndexedIndirect, DrawList};
use visibility_frame::lod::{ContributionCuller, LodSelector};
use visibility_testing::Random;
use visibility_testing::allocations::ALLOCATIONS;
use visibility_testing::cameras::circling;

/// Runs `frames` frames over 20,000 objects, of which `moves` move back and forth in a sequence of 16 frames.
/// `frame` returns what it has drawn. Asserts that the frames after the first third allocate nothing.
fn check_frames(frames: usize, moves: usize, mut frame: impl FnMut(&mut Scene, usize) -> usize) {
    let mut rng = Random(1);
    let mut scene = Scene::new();
    let homes: Vec<Aabb> = (0..20_000).map(|_| rng.small_box(200.0)).collect();
    let ids = scene.insert_batch(homes.iter().copied());
    let mut moved = || {
        let (number, step) = (rng.below(homes.len()), rng.vector(3.0).as_vec3());
        (ids[number], Aabb::new(homes[number].min + step, homes[number].max + step))
    };
    let walk: Vec<Vec<_>> = (0..16).map(|_| (0..moves).map(|_| moved()).collect()).collect();
    let (mut before, mut drawn) = (0, 0);
    for number in 0..frames {
        if number == frames / 3 {
            before = ALLOCATIONS.get();
        }
        scene.set_bounds_batch(&walk[number % walk.len()]).unwrap();
        scene.maintain(16);
        drawn += frame(&mut scene, number);
    }
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations in warm frames");
    assert!(drawn > 0, "nothing was drawn");
}

/// Tests the uses of a result: order by index, bits, groups and commands.
#[test]
fn results_allocate_nothing_once_warm() {
    let (mut visible, mut list) = (VisibleSet::new(), DrawList::new());
    let mut pipeline = Pipeline::new().with(FrustumCuller::new());
    let (mut bits, mut commands) = (vec![0; 20_000usize.div_ceil(32)], Vec::new());
    check_frames(400, 400, |scene, number| {
        pipeline.cull(scene, &circling(number), &mut visible);
        visible.sort_by_index(scene);
        visible.write_bits(scene, &mut bits).unwrap();
        // Few keys and sparse keys alternate.
        let spread = if number % 2 == 0 { 1 } else { 1 << 20 };
        list.group(visible.iter(scene), |id| id.index() as u32 % 50 * spread);
        commands.clear();
        commands.extend(list.commands(|_| DrawIndexedIndirect::default()));
        commands.len()
    });
}

/// Tests the casters of three lights with receivers.
#[test]
fn casters_allocate_nothing_once_warm() {
    let place = DVec3::new(5.0, -9.0, 20.0);
    let lights = [
        Light::Directional { toward_light: DVec3::new(0.3, 0.2, 0.5) },
        Light::Point { position: place, range: 90.0 },
        Light::Spot { position: place, direction: DVec3::NEG_Z, half_angle: 0.7, range: 150.0 },
    ];
    let receivers = Aabb::from_arrays([-90.0; 3], [90.0; 3]);
    let mut shadows = lights.map(|light| {
        Pipeline::new().with(CasterCuller::new(light).unwrap().with_receivers(receivers, DVec3::ZERO))
    });
    let mut casters = VisibleSet::new();
    check_frames(300, 100, |scene, number| {
        let drawn = shadows.iter_mut().map(|pipeline| {
            pipeline.cull(scene, &circling(number), &mut casters);
            casters.iter(scene).count()
        });
        drawn.sum()
    });
}

/// Tests levels of detail: moving objects with draw ranges and HLOD parents, some of which change.
#[test]
fn levels_of_detail_allocate_nothing_once_warm() {
    let mut pipeline = Pipeline::new().with(FrustumCuller::new()).with(ContributionCuller::new(1080.0, 2.0));
    let (mut visible, mut lods) = (VisibleSet::new(), LodSelector::new(1080.0));
    let (mut ids, mut parent) = (Vec::new(), ObjectId::PLACEHOLDER);
    check_frames(600, 200, |scene, number| {
        if number == 0 {
            ids = scene.ids().collect::<Vec<ObjectId>>();
            for &id in ids.iter().step_by(3) {
                scene.set_draw_range(id, DrawRange { end: 150.0, ..DrawRange::ALWAYS }).unwrap();
            }
            parent = scene.insert(Aabb::from_arrays([-20.0; 3], [20.0; 3]));
        }
        let begin = DrawRange { begin: (number % 50) as f32, ..DrawRange::ALWAYS };
        scene.set_draw_range(parent, begin).unwrap();
        scene.set_hlod_parent(ids[number % 300], (number % 2 == 0).then_some(parent)).unwrap();
        pipeline.cull(scene, &circling(number), &mut visible);
        lods.select(scene, &circling(number), &visible, 0.02, |_| &[100.0, 20.0]);
        lods.selected().len()
    });
}

/// An occlusion map that hides boxes beyond `x = 100`, and allocates nothing itself.
struct Wall;

impl OcclusionMap for Wall {
    fn name(&self) -> &str {
        "wall"
    }

    fn accuracy(&self) -> Accuracy {
        Accuracy::Approximate
    }

    fn begin(&mut self, _: &View, _: DVec3) {}

    fn add(&mut self, _: &OccluderMesh, _: &Affine3A) {}

    fn flush(&mut self) {}

    fn test(&self, bounds: &Aabb) -> Occlusion {
        if bounds.min.x > 100.0 { Occlusion::Hidden } else { Occlusion::Partial }
    }
}

#[test]
fn warm_lists_of_clusters_allocate_nothing() {
    let mut rng = Random(9);
    let floor = NormalCone::from_triangles(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    let mesh = ClusterMesh::new((0..5000).map(|_| (rng.small_box(200.0), floor)));
    let mut scene = Scene::new();
    scene.insert_batch((0..300).map(|_| Object { one_sided: true, ..Object::new(rng.small_box(200.0)) }));
    let (mut visible, mut list) = (VisibleSet::new(), Vec::new());
    let mut run = || {
        let mut listed = 0;
        for frame in 0..40 {
            let view = circling(frame);
            visible.fill(&scene, &view);
            list.clear();
            let instance = |id: ObjectId| {
                let place = Vec3::splat(id.index() as f32 - 150.0);
                Some(ClusterInstance::new(&mesh, Affine3A::from_translation(place)))
            };
            ClusterView::new(&scene, &view).with_map(&Wall).cull(&visible, instance, &mut list);
            listed += list.len();
        }
        listed
    };
    let listed = run();
    let before = ALLOCATIONS.get();
    assert_eq!(run(), listed, "clusters listed in warm frames and in the first");
    assert_eq!(ALLOCATIONS.get() - before, 0, "allocations in 40 warm frames");
    assert!(listed > 100_000, "{listed}");
}
