//! Only candidates that are always drawn occlude. An object hides nothing if an earlier stage has removed it,
//! or if no camera or only some cameras draw it.

use crate::common;

use common::{PointShadows, World};
use visibility_core::glam::{Affine3A, DVec3, Vec3};
use visibility_core::pvs::Viewcell;
use visibility_core::{Aabb, Culler, ObjectId, Pose, RegionCuller, Scene, View, VisibleSet};
use visibility_region::{
    ConvexBlockersCuller, ExtendedProjectionCuller, OnlinePvs, SamplingCuller, ShrunkCuller, VolumetricCuller,
};
use visibility_testing::NOT_ALWAYS_DRAWN;

/// Makes a wall, in scene coordinates or placed by a transform, and an object that the wall hides.
fn world(transform: Affine3A) -> (World, ObjectId, ObjectId) {
    let mut world = World::new();
    let wall = common::cuboid([5.0, -20.0, -20.0], [9.0, 20.0, 20.0]);
    let wall = world.add(&wall, false, transform).unwrap();
    let behind = world.add_target(Aabb::from_arrays([10.0, -0.3, -0.3], [10.5, 0.3, 0.3]));
    (world, wall, behind)
}

fn cell() -> Viewcell {
    Viewcell::from_box(DVec3::splat(-0.5), DVec3::splat(0.5))
}

fn view(layers: u32) -> View {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X, DVec3::Z);
    View::perspective(pose, 1.0, 1.0, 0.1, 100.0).unwrap().with_layers(layers)
}

fn cullers() -> [Box<dyn RegionCuller>; 4] {
    [
        Box::new(ExtendedProjectionCuller::new()),
        Box::new(ConvexBlockersCuller::new()),
        Box::new(VolumetricCuller::new()),
        Box::new(ShrunkCuller::new(PointShadows, 2)),
    ]
}

/// Transforms of the wall: the identity, for a mesh in scene coordinates, and another.
fn transforms() -> [Affine3A; 2] {
    [Affine3A::IDENTITY, Affine3A::from_scale(Vec3::new(1.0, 1.0, 1.125))]
}

#[test]
fn what_an_earlier_stage_dropped_hides_nothing() {
    for (transform, mut culler) in transforms().into_iter().flat_map(|t| cullers().map(|c| (t, c))) {
        let (world, wall, behind) = world(transform);
        let mut sees = |dropped: Option<ObjectId>| {
            let mut visible = VisibleSet::new();
            visible.retain(&world.scene, |id, _| Some(id) != dropped);
            culler.cull(&world.scene, &cell(), &mut visible);
            visible.contains(&world.scene, behind)
        };
        assert!(
            !sees(None) && sees(Some(wall)) && !sees(None),
            "{transform:?}: a wall that was dropped hides nothing, and hides again as a candidate"
        );
    }
}

#[test]
fn what_is_on_no_layer_of_the_candidates_hides_nothing() {
    for (transform, mut culler) in transforms().into_iter().flat_map(|t| cullers().map(|c| (t, c))) {
        let (mut world, wall, behind) = world(transform);
        let mut sees = |scene: &Scene, mut visible: VisibleSet| {
            culler.cull(scene, &cell(), &mut visible);
            visible.contains(scene, behind)
        };
        let of_layers = |scene: &Scene, layers: u32| {
            let mut visible = VisibleSet::new();
            visible.fill(scene, &view(layers));
            visible
        };
        world.scene.set_layers(wall, 2).unwrap();
        assert!(
            !sees(&world.scene, VisibleSet::new()),
            "{transform:?}: a new set, on whose layers the wall is"
        );
        assert!(!sees(&world.scene, of_layers(&world.scene, 3)), "{transform:?}: a set on the wall's layer");
        assert!(sees(&world.scene, of_layers(&world.scene, 1)), "drawn by other cameras");
        world.scene.set_layers(wall, 0).unwrap();
        assert!(sees(&world.scene, VisibleSet::new()), "drawn by no camera");
    }
}

#[test]
fn what_is_not_always_drawn_hides_nothing() {
    let ways = 0..NOT_ALWAYS_DRAWN.len();
    for (transform, way) in transforms().into_iter().flat_map(|t| ways.clone().map(move |way| (t, way))) {
        let (mut world, wall, behind) = world(transform);
        let mut cullers: Vec<Box<dyn RegionCuller>> = cullers().into_iter().collect();
        cullers.push(Box::new(SamplingCuller::new().with_rays(2000)));
        let mut answers = |scene: &Scene| {
            let mut sees: Vec<bool> = cullers
                .iter_mut()
                .map(|culler| {
                    let mut visible = VisibleSet::new();
                    culler.cull(scene, &cell(), &mut visible);
                    visible.contains(scene, behind)
                })
                .collect();
            let mut online = OnlinePvs::new(DVec3::ONE, DVec3::splat(4.0)).unwrap();
            while online.step(scene, &[DVec3::ZERO], u32::MAX).is_some() {}
            let mut visible = VisibleSet::new();
            online.cull(scene, &view(u32::MAX), &mut visible);
            sees.push(!online.is_ready() || visible.contains(scene, behind));
            sees
        };
        assert_eq!(answers(&world.scene), [false; 6], "{transform:?}: the wall hides");
        NOT_ALWAYS_DRAWN[way](&mut world.scene, wall);
        assert_eq!(answers(&world.scene), [true; 6], "{transform:?}, way {way}: the wall may be absent");
    }
}

/// In a union of the sets of two views, an occluder that one of the views does not draw hides nothing.
#[test]
fn an_occluder_that_one_view_of_a_union_does_not_draw_hides_nothing() {
    for (transform, mut culler) in transforms().into_iter().flat_map(|t| cullers().map(|c| (t, c))) {
        let (mut world, wall, behind) = world(transform);
        for (of_wall, sees) in [(0b01, true), (0b10, true), (0b100, false)] {
            world.scene.set_layers(wall, of_wall).unwrap();
            let mut both = VisibleSet::new();
            both.clear(&world.scene);
            for layers in [0b101, 0b110] {
                let mut set = VisibleSet::new();
                set.fill(&world.scene, &view(layers));
                both.union(&world.scene, &set);
            }
            culler.cull(&world.scene, &cell(), &mut both);
            assert_eq!(both.contains(&world.scene, behind), sees, "{transform:?}: a wall on {of_wall:#b}");
        }
    }
}
