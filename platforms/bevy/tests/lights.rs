//! Test that the casters of each shadow view equal those of bevy's own systems, except for entities whose
//! world box reaches into the shadow view while their rotated box does not.

mod common;

use bevy_camera::prelude::*;
use bevy_camera::primitives::{Aabb, CascadesFrusta, CubemapFrusta, Frustum, Sphere};
use bevy_camera::visibility::{
    CascadesVisibleEntities, CubemapVisibleEntities, NoFrustumCulling, RenderLayers, VisibilityRange,
    VisibleMeshEntities,
};
use bevy_ecs::prelude::*;
use bevy_light::{
    CascadeShadowConfigBuilder, DirectionalLight, NotShadowCaster, PointLight, RectLight, SpotLight,
};
use bevy_math::{Affine3A, Quat, Vec3, Vec3A};
use bevy_mesh::Mesh3d;
use bevy_transform::prelude::*;
use common::*;
use std::collections::BTreeSet;
use visibility_bevy::Occluder;
use visibility_testing::Random;

const SUN: Number = Number(1_000_001);
const LAMP: Number = Number(1_000_002);
const SPOT: Number = Number(1_000_003);

fn spawn_world(world: &mut World) {
    let mut random = Random(5);
    world.spawn((Number(1_000_000), Camera3d::default(), Transform::from_xyz(0.0, 3.0, 12.0)));
    let sun = DirectionalLight { shadow_maps_enabled: true, ..Default::default() };
    let cascades = CascadeShadowConfigBuilder { maximum_distance: 60.0, ..Default::default() }.build();
    let down = Transform::from_rotation(Quat::from_rotation_x(-0.9));
    world.spawn((SUN, sun, cascades, down));
    let lamp = PointLight { shadow_maps_enabled: true, range: 14.0, ..Default::default() };
    world.spawn((LAMP, lamp, Transform::from_xyz(1.0, 2.0, -5.0), RenderLayers::from_layers(&[0, 2, 40])));
    let spot = SpotLight { shadow_maps_enabled: true, range: 25.0, outer_angle: 0.7, ..Default::default() };
    world.spawn((SPOT, spot, Transform::from_xyz(0.0, 8.0, 4.0).looking_at(Vec3::NEG_Z * 4.0, Vec3::Y)));
    for number in 0..1500 {
        let turn = if random.one_in(2) {
            Quat::from_rotation_y(random.range(0.0, 3.0) as f32)
        } else {
            Quat::IDENTITY
        };
        let transform = Transform::from_translation(random.vec3(-40.0, 40.0)).with_rotation(turn);
        let mut entity = world.spawn(drawn(number, transform));
        entity.insert(Aabb { center: Vec3A::ZERO, half_extents: random.vec3(0.1, 2.0).into() });
        match random.below(16) {
            0 => drop(entity.insert(NotShadowCaster)),
            1 => drop(entity.insert(NoFrustumCulling)),
            2 => drop(entity.insert(RenderLayers::layer(2))),
            3 => drop(entity.insert(RenderLayers::layer(40))),
            4 => drop(entity.insert(VisibilityRange::abrupt(0.0, 30.0))),
            5 => drop(entity.insert(Visibility::Hidden)),
            6 => drop(entity.remove::<Aabb>()),
            7 => {
                let center = transform.translation.into();
                entity.remove::<Aabb>().insert(Sphere { center, radius: 0.1 });
            }
            _ => {}
        }
    }
}

/// Returns the shadow views of a world in a fixed order: their frusta, their casters, and the sphere of the
/// light's range.
fn shadow_views(app: &mut bevy_app::App) -> Vec<(Frustum, BTreeSet<Number>, Option<Sphere>)> {
    let [sun, lamp, spot] = [SUN, LAMP, SPOT].map(|number| entity(app, number).unwrap());
    let world = app.world();
    let mut views = Vec::new();
    let frusta = &world.get::<CascadesFrusta>(sun).unwrap().frusta;
    let lists = &world.get::<CascadesVisibleEntities>(sun).unwrap().entities;
    for (view, lists) in lists {
        views.extend(frusta[view].iter().zip(lists).map(|(frustum, list)| (*frustum, list, None)));
    }
    let sphere = |light: Entity, radius| {
        Some(Sphere { center: world.get::<GlobalTransform>(light).unwrap().translation_vec3a(), radius })
    };
    let frusta = world.get::<CubemapFrusta>(lamp).unwrap().iter();
    let lists = world.get::<CubemapVisibleEntities>(lamp).unwrap().iter();
    views.extend(frusta.zip(lists).map(|(frustum, list)| (*frustum, list, sphere(lamp, 14.0))));
    let list = world.get::<VisibleMeshEntities>(spot).unwrap();
    views.push((*world.get::<Frustum>(spot).unwrap(), list, sphere(spot, 25.0)));
    let sorted = |list: &VisibleMeshEntities| {
        assert!(list.entities.is_sorted_by(|a, b| a < b), "{:?} are sorted", list.entities);
        numbers(app, &list.entities)
    };
    views.into_iter().map(|(frustum, list, sphere)| (frustum, sorted(list), sphere)).collect()
}

#[test]
fn the_same_entities_cast_shadows() {
    let mut apps = [false, true].map(app);
    apps.iter_mut().for_each(|app| spawn_world(app.world_mut()));
    let (mut casters, mut wider) = (0, 0);
    for frame in 0..12 {
        for app in &mut apps {
            let mut random = Random(frame);
            let mut moved = app.world_mut().query_filtered::<(&Number, &mut Transform), With<Mesh3d>>();
            let mut all: Vec<_> = moved.iter_mut(app.world_mut()).collect();
            all.sort_by_key(|(number, _)| **number);
            for (_, transform) in all.iter_mut().step_by(3) {
                transform.translation += random.vec3(-1.0, 1.0);
            }
            let sun = entity(app, SUN).unwrap();
            app.world_mut().get_mut::<Transform>(sun).unwrap().rotate_y(0.2);
            app.update();
        }
        let [bevy, ours] = &mut apps;
        let (theirs, own) = (shadow_views(bevy), shadow_views(ours));
        assert_eq!(own.len(), 4 + 6 + 1, "shadow views: cascades, sides of the lamp, and the spot");
        assert_eq!(own.len(), theirs.len(), "shadow views of ours and of bevy's");
        for (view, ((frustum, own, sphere), (_, theirs, _))) in own.iter().zip(&theirs).enumerate() {
            for &number in theirs.difference(own) {
                // bevy also counts a box whose bounding corner, but not the box itself, is within the light's
                // range.
                let sphere = sphere.expect("no caster of the sun vanishes");
                assert!(
                    !is_near(ours, number, &sphere),
                    "{number:?} vanished in view {view} of frame {frame}"
                );
            }
            for &number in own.difference(theirs) {
                assert!(is_in(ours, number, frustum, sphere.is_some()), "{number:?} in view {view}");
                wider += 1;
            }
            casters += own.len();
        }
        let seen = seen_by_any(ours);
        assert!(own.iter().all(|(_, own, _)| own.is_subset(&seen)), "casters are drawn");
        assert!(own.iter().all(|(_, own, _)| !own.is_empty()), "every view has casters");
    }
    assert!(
        casters > 5_000 && wider > 0 && wider < casters / 10,
        "{casters} casters, {wider} more than bevy's"
    );
}

/// A lamp whose mesh a wall hides is lit as long as its light may reach what is seen.
#[test]
fn lamps_that_are_meshes_shine_from_behind_walls() {
    let weak = PointLight { range: 1.0, ..Default::default() };
    lamp_shines("point light", PointLight::default(), true);
    lamp_shines("spot light", SpotLight::default(), true);
    lamp_shines("area light", RectLight::default(), true);
    lamp_shines("sun", DirectionalLight::default(), true);
    lamp_shines("weak light", weak, false);
}

fn lamp_shines<L: Component>(name: &str, light: L, is_seen: bool) {
    let mut app = app(true);
    let cube = || Aabb { center: Vec3A::ZERO, half_extents: Vec3A::splat(0.5) };
    let wall = Transform::from_xyz(0.0, 0.0, -5.0).with_scale(Vec3::new(8.0, 8.0, 0.2));
    app.world_mut().spawn((drawn(0, wall), cube(), Occluder::Box));
    let lamp = (drawn(1, Transform::from_xyz(0.0, 0.0, -10.0)), cube(), Occluder::Box);
    let lamp = app.world_mut().spawn(lamp).id();
    app.world_mut().spawn(Camera3d::default());
    let is_lit = |app: &mut bevy_app::App| {
        app.update();
        app.world().get::<ViewVisibility>(lamp).unwrap().get()
    };
    assert!(!is_lit(&mut app), "the wall hides the lamp without {name}");
    app.world_mut().entity_mut(lamp).insert(light);
    assert_eq!(is_lit(&mut app), is_seen, "whether the {name} is seen");
    app.world_mut().get_mut::<Transform>(lamp).unwrap().translation.x += 0.1;
    assert_eq!(is_lit(&mut app), is_seen, "whether the {name} is seen once it has moved");
    app.world_mut().entity_mut(lamp).remove::<L>();
    if app.world().get::<Sphere>(lamp).is_some() {
        app.world_mut().entity_mut(lamp).remove::<Sphere>();
    }
    assert!(!is_lit(&mut app), "the wall hides the lamp again without the {name}");
}

fn world_box(app: &mut bevy_app::App, number: Number) -> Aabb {
    let entity = entity(app, number).unwrap();
    let aabb = *app.world().get::<Aabb>(entity).unwrap();
    let affine = app.world().get::<GlobalTransform>(entity).unwrap().affine();
    Aabb {
        center: affine.transform_point3a(aabb.center),
        half_extents: affine.matrix3.abs() * aabb.half_extents + Vec3A::splat(1e-4),
    }
}

/// Returns whether the world box of an entity is nearer to the centre of a sphere than the radius.
fn is_near(app: &mut bevy_app::App, number: Number, sphere: &Sphere) -> bool {
    let bounds = world_box(app, number);
    let beyond = (sphere.center - bounds.center).abs() - bounds.half_extents;
    beyond.max(Vec3A::ZERO).length() < sphere.radius
}

fn is_in(app: &mut bevy_app::App, number: Number, frustum: &Frustum, with_near: bool) -> bool {
    frustum.intersects_obb(&world_box(app, number), &Affine3A::IDENTITY, with_near, true)
}
