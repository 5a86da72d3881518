//! Test that the visible entities equal those of bevy's own systems, with the exceptions in the crate's
//! documentation: entities whose world box reaches into view while their rotated box or their sphere does
//! not, and entities entirely before the near plane or beyond the far plane. Both worlds undergo the same
//! random changes of every kind.

mod common;

use bevy_app::{App, Startup};
use bevy_camera::prelude::*;
use bevy_camera::primitives::{Aabb, Frustum, Sphere};
use bevy_camera::visibility::{NoCpuCulling, NoFrustumCulling, RenderLayers, VisibilityRange};
use bevy_camera::{ShadowLodOrigin, SubCameraView};
use bevy_ecs::entity_disabling::Disabled;
use bevy_ecs::prelude::*;
use bevy_ecs::query::Allow;
use bevy_math::{Affine3A, DVec4, EulerRot, Quat, UVec2, Vec2, Vec3, Vec3A, Vec3Swizzles};
use bevy_mesh::Mesh3d;
use bevy_transform::prelude::*;
use common::*;
use std::collections::BTreeSet;
use std::f32::consts::FRAC_PI_2;
use visibility_testing::Random;

const CAMERAS: [Number; 3] = [Number(1_000_000), Number(1_000_001), Number(1_000_002)];

fn placed(random: &mut Random) -> Transform {
    let [x, y, z] = random.vec3(-3.0, 3.0).to_array();
    let turn = if random.one_in(2) { Quat::from_euler(EulerRot::XYZ, x, y, z) } else { Quat::IDENTITY };
    Transform {
        translation: random.vec3(-60.0, 60.0),
        rotation: turn,
        scale: random.vec3(-1.5, 1.5).abs() + 0.2,
    }
}

fn a_box(random: &mut Random) -> Aabb {
    Aabb { center: random.vec3(-1.0, 1.0).into(), half_extents: random.vec3(0.0, 2.0).into() }
}

fn some_layers(random: &mut Random) -> RenderLayers {
    match random.below(6) {
        0 => RenderLayers::none(),
        1 => RenderLayers::from_layers(&[31, 3]),
        2 => RenderLayers::from_layers(&[100]),
        3 => RenderLayers::from_layers(&[0, 64]),
        _ => RenderLayers::layer(random.below(3)),
    }
}

fn a_range(random: &mut Random) -> VisibilityRange {
    let begin = random.range(0.0, 50.0) as f32;
    VisibilityRange { use_aabb: random.one_in(2), ..VisibilityRange::abrupt(begin, begin + 30.0) }
}

fn spawn_drawn(world: &mut World, number: u32, random: &mut Random) {
    let mut entity = world.spawn(drawn(number, placed(random)));
    match random.below(12) {
        0 => {}
        1 => {
            let center = random.vec3(-60.0, 60.0).into();
            entity.insert(Sphere { center, radius: random.range(0.0, 5.0) as f32 });
        }
        _ => {
            entity.insert(a_box(random));
        }
    }
}

fn spawn_cameras(world: &mut World) {
    let perspective =
        |fov, near| Projection::Perspective(PerspectiveProjection { fov, near, ..Default::default() });
    world.spawn((CAMERAS[0], Camera3d::default(), perspective(0.9, 0.1), ShadowLodOrigin));
    let layers = RenderLayers::from_layers(&[1, 2, 31, 100]);
    world.spawn((CAMERAS[1], Camera3d::default(), perspective(1.8, 4.0), layers));
    let orthographic = OrthographicProjection {
        scale: 0.03,
        ..OrthographicProjection { near: 1.0, far: 50.0, ..OrthographicProjection::default_3d() }
    };
    world.spawn((CAMERAS[2], Camera3d::default(), Projection::Orthographic(orthographic)));
}

/// Component that disables entities, besides bevy's own [`Disabled`].
#[derive(Component)]
struct Asleep;

/// Disabling component stored in sparse sets. Once registered, bevy's queries iterate over archetypes, not
/// tables.
#[derive(Component)]
#[component(storage = "SparseSet")]
struct Resting;

/// Returns the entities with a component, disabled ones included, in the order of their numbers.
fn all_with<T: Component>(world: &mut World) -> Vec<Entity> {
    let mut all = world
        .query_filtered::<(&Number, Entity), (With<T>, Allow<Disabled>, Allow<Asleep>, Allow<Resting>)>();
    let mut all: Vec<_> = all.iter(world).map(|(n, e)| (*n, e)).collect();
    all.sort();
    all.into_iter().map(|(_, entity)| entity).collect()
}

/// Applies one random change, of any kind that can make an entity visible or hidden.
fn change(world: &mut World, frame: u32, random: &mut Random) {
    if random.one_in(10) {
        return spawn_drawn(world, 10_000 * (frame + 1) + random.below(10_000) as u32, random);
    }
    if random.one_in(30) {
        let cameras = all_with::<Camera>(world);
        let mut camera = world.entity_mut(random.pick(&cameras));
        match random.below(6) {
            0 => {
                camera.insert(some_layers(random));
            }
            1 => {
                camera.remove::<RenderLayers>();
            }
            2 => {
                let is_active = !random.one_in(3);
                camera.get_mut::<Camera>().unwrap().is_active = is_active;
            }
            3 if random.one_in(3) => {
                camera.insert(NoCpuCulling);
            }
            4 => {
                camera.remove::<NoCpuCulling>();
            }
            _ => {
                let at = random.vec3(-20.0, 20.0);
                camera.insert(Transform { scale: Vec3::ONE, translation: at, ..placed(random) });
            }
        }
        return;
    }
    let all = all_with::<Mesh3d>(world);
    let (first, second) = (random.pick(&all), random.pick(&all));
    let mut entity = world.entity_mut(first);
    match random.below(28) {
        0 => entity.despawn(),
        1 => {
            entity.insert([Visibility::Hidden, Visibility::Visible, Visibility::Inherited][random.below(3)]);
        }
        2 => {
            entity.insert(NoFrustumCulling);
        }
        3 => {
            entity.remove::<NoFrustumCulling>();
        }
        4 => {
            entity.insert(some_layers(random));
        }
        5 => {
            entity.remove::<RenderLayers>();
        }
        6 => {
            entity.insert(a_range(random));
        }
        7 => {
            entity.remove::<VisibilityRange>();
        }
        8 => {
            entity.insert(a_box(random));
        }
        9 => {
            let center = random.vec3(-1.0, 1.0).into();
            if let Some(mut aabb) = entity.get_mut::<Aabb>() {
                aabb.center = center;
            }
        }
        10 => {
            entity.remove::<Aabb>();
        }
        11 => {
            entity.insert(NoCpuCulling);
        }
        12 => {
            entity.remove::<NoCpuCulling>();
        }
        13 => {
            entity.remove::<Visibility>().remove::<InheritedVisibility>().remove::<ViewVisibility>();
        }
        14 => {
            entity.insert(Visibility::default());
        }
        15 => {
            entity.remove::<Transform>().remove::<GlobalTransform>();
        }
        16 if first != second => {
            entity.remove::<ChildOf>();
            // The entity with the lesser number becomes the parent, so there are no cycles.
            let numbers = [first, second].map(|e| *world.get::<Number>(e).unwrap());
            let (parent, child) = if numbers[0] < numbers[1] { (first, second) } else { (second, first) };
            world.entity_mut(child).insert(ChildOf(parent));
        }
        17 => {
            entity.remove::<Sphere>();
        }
        18 => {
            entity.insert(Disabled);
        }
        19 => {
            entity.insert((Asleep, Resting));
        }
        20 | 21 => {
            entity.remove::<(Disabled, Asleep, Resting)>();
        }
        _ => {
            entity.insert(placed(random));
        }
    }
}

/// Returns the local box that an entity is culled by, with its transform: the `Aabb`, or else the box of a
/// `Sphere`, whose centre is a point in world space.
fn local_box(app: &App, entity: Entity) -> Option<(Aabb, Affine3A)> {
    let world = app.world();
    if let Some(aabb) = world.get::<Aabb>(entity) {
        return Some((*aabb, world.get::<GlobalTransform>(entity)?.affine()));
    }
    world.get::<Sphere>(entity).map(|sphere| (Aabb::from(*sphere), Affine3A::IDENTITY))
}

/// Returns whether all corners of an entity's rotated box are before the near plane, or all beyond the far
/// plane.
fn is_beyond_depth(app: &App, camera: Entity, entity: Entity) -> bool {
    let world = app.world();
    let Some((aabb, affine)) = local_box(app, entity) else { return false };
    let projection = world.get::<Projection>(camera).unwrap();
    let view = world.get::<GlobalTransform>(camera).unwrap().affine().inverse();
    let clip: Vec<DVec4> = (0..8)
        .map(|corner| {
            let sign = |axis: i32| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
            let local = aabb.center + aabb.half_extents * Vec3A::new(sign(0), sign(1), sign(2));
            let viewed = view.transform_point3a(affine.transform_point3a(local));
            (projection.get_clip_from_view() * viewed.extend(1.0)).as_dvec4()
        })
        .collect();
    let slack = 1e-4;
    let is_orthographic = matches!(projection, Projection::Orthographic(_));
    clip.iter().all(|p| p.z > p.w * (1.0 - slack)) || is_orthographic && clip.iter().all(|p| p.z < slack)
}

/// Whether bevy's own test finds the world box around an entity's `Aabb` and `Sphere` in view, a little
/// enlarged.
fn world_box_is_in_view(app: &App, camera: Entity, entity: Entity) -> bool {
    let world = app.world();
    let (aabb, affine) = local_box(app, entity).expect("an entity without bounds is the same in both worlds");
    let center = affine.transform_point3a(aabb.center);
    let half = affine.matrix3.abs() * aabb.half_extents;
    let sphere = world.get::<Sphere>(entity).map_or(Aabb { center, half_extents: half }, |&s| Aabb::from(s));
    let min = (center - half).min(sphere.min()) - 1e-4;
    let max = (center + half).max(sphere.max()) + 1e-4;
    let frustum = world.get::<Frustum>(camera).unwrap();
    frustum.intersects_obb(&Aabb::from_min_max(min.into(), max.into()), &Affine3A::IDENTITY, true, false)
}

/// Whether the world box of an entity is wider than what bevy tests.
fn is_wider(app: &App, entity: Entity) -> bool {
    if app.world().get::<Sphere>(entity).is_some() {
        return true;
    }
    let matrix = app.world().get::<GlobalTransform>(entity).unwrap().affine().matrix3;
    let off = matrix.x_axis.yz().abs() + matrix.y_axis.xz().abs() + matrix.z_axis.xy().abs();
    off.max_element() > 1e-6
}

#[test]
fn the_same_entities_are_visible_through_changes_of_every_kind() {
    run(60, |app| app.world_mut().register_disabling_component::<Asleep>());
    run(60, |app| app.world_mut().register_disabling_component::<Resting>());
    run(60, |app| {
        app.add_systems(Startup, |world: &mut World| world.register_disabling_component::<Resting>());
    });
}

/// Runs two worlds side by side for `frames` frames.
fn run(frames: u32, add_disabling: fn(&mut App)) {
    let mut apps = [false, true].map(|with_plugin| app_with(with_plugin, add_disabling));
    for app in &mut apps {
        let world = app.world_mut();
        spawn_cameras(world);
        let mut random = Random(3);
        (0..600).for_each(|number| spawn_drawn(world, number, &mut random));
    }
    let (mut seen, mut hidden, mut wider, mut nearer) = (0, 0, 0, 0);
    for frame in 0..frames {
        for app in &mut apps {
            let mut random = Random(100 + u64::from(frame));
            (0..if frame == 0 { 0 } else { 20 }).for_each(|_| change(app.world_mut(), frame, &mut random));
            app.update();
        }
        let [bevy, ours] = &mut apps;
        for camera in CAMERAS {
            let (theirs, own) = (seen_by(bevy, camera), seen_by(ours, camera));
            let at = entity(ours, camera).unwrap();
            if !ours.world().get::<Camera>(at).unwrap().is_active {
                // An inactive camera keeps the lists of an earlier frame, in both worlds.
                continue;
            }
            for &number in theirs.difference(&own) {
                let entity = entity(ours, number).unwrap();
                assert!(
                    is_beyond_depth(ours, at, entity),
                    "{number:?} vanished for {camera:?} in frame {frame}"
                );
                nearer += 1;
            }
            for &number in own.difference(&theirs) {
                let entity = entity(ours, number).expect("a listed entity is not disabled");
                let has_only_sphere = ours.world().get::<Sphere>(entity).is_some()
                    && ours.world().get::<Aabb>(entity).is_none();
                assert!(
                    has_only_sphere || is_wider(ours, entity) && world_box_is_in_view(ours, at, entity),
                    "{number:?} is no more than bevy's for {camera:?} in frame {frame}"
                );
                wider += usize::from(!has_only_sphere);
            }
            seen += own.len();
            hidden += 600 - own.len().min(600);
        }
        assert_results_follow_lists(bevy, frame);
        assert_results_follow_lists(ours, frame);
    }
    assert!(seen > 10_000 && hidden > 10_000, "{seen} seen, {hidden} hidden");
    assert!(wider > 50 && wider < seen / 20 && nearer > 5, "{wider} wider, {nearer} before the near plane");
}

/// Asserts that an entity culled on the CPU is marked as visible if and only if an active camera lists it.
fn assert_results_follow_lists(app: &mut App, frame: u32) {
    let mut listed = BTreeSet::new();
    for camera in CAMERAS {
        let entity = entity(app, camera).unwrap();
        if app.world().get::<Camera>(entity).unwrap().is_active {
            listed.extend(seen_by(app, camera));
        }
    }
    let mut all =
        app.world_mut().query_filtered::<(&Number, &ViewVisibility), (With<Mesh3d>, Without<NoCpuCulling>)>();
    let marked: BTreeSet<Number> =
        all.iter(app.world()).filter(|(_, result)| result.get()).map(|(number, _)| *number).collect();
    let with_place: BTreeSet<Number> = marked;
    assert_eq!(with_place, listed, "frame {frame}");
}

/// Ten cameras show ten parts of one picture, in two rows of five. Each must show the box in its own part
/// only. bevy culls all of them by the frustum of a whole picture with the aspect ratio of a part.
#[test]
fn a_part_of_a_picture_shows_what_is_in_it() {
    let perspective = PerspectiveProjection { fov: FRAC_PI_2, ..Default::default() };
    // Height and width of a part in metres, at 10 m from the camera.
    for (projection, side) in [
        (Projection::Perspective(perspective), 10.0),
        (Projection::Orthographic(OrthographicProjection::default_3d()), 1.0),
    ] {
        let mut app = app(true);
        let parts = (0..10).map(|number| (number, [number % 5, number / 5].map(|part| part as f32)));
        for (number, [column, row]) in parts {
            let at = Vec3::new(side * (column - 2.0), side * (0.5 - row), -10.0);
            let aabb = Aabb { center: Vec3A::ZERO, half_extents: Vec3A::splat(0.1 * side) };
            app.world_mut().spawn((drawn(number, Transform::from_translation(at)), aabb));
            let part = SubCameraView {
                full_size: UVec2::new(5, 2),
                size: UVec2::ONE,
                offset: Vec2::new(column, row),
            };
            let camera = Camera { sub_camera_view: Some(part), ..Default::default() };
            app.world_mut().spawn((Number(100 + number), Camera3d::default(), camera, projection.clone()));
        }
        app.update();
        for number in 0..10 {
            let seen = seen_by(&mut app, Number(100 + number));
            assert_eq!(seen, BTreeSet::from([Number(number)]), "part {number} of {projection:?}");
        }
    }
}
