//! Tests that occluders hide only what is behind them: all lines of sight to a hidden entity in view are
//! blocked, by an oracle in `f64` that shares no code with the culler. Entities reappear when an occluder no
//! longer hides them, for whatever reason.

mod common;

use bevy_asset::{Assets, Handle};
use bevy_camera::prelude::*;
use bevy_camera::primitives::{Aabb, Frustum};
use bevy_camera::visibility::{NoFrustumCulling, RenderLayers, VisibilityRange};
use bevy_ecs::entity_disabling::Disabled;
use bevy_ecs::prelude::*;
use bevy_math::{Affine3A, DAffine3, DVec3, Quat, Vec3};
use bevy_mesh::skinning::SkinnedMesh;
use bevy_mesh::{Mesh, Mesh3d, MeshBuilder, Meshable};
use bevy_shape::Cuboid;
use bevy_transform::prelude::*;
use common::*;
use std::collections::BTreeSet;
use std::sync::Arc;
use visibility_bevy::{CullingPipeline, Occluder, VisibilityScene};
use visibility_core::OccluderMesh;
use visibility_testing::Random;

const CAMERA: Number = Number(1_000_000);

/// Returns whether the segment from `eye` to `point` passes through a box with a transform, by the slab test
/// in the box's own coordinates. The box is shrunk by a millionth, so that grazing lines do not count.
fn blocks(wall: &(DAffine3, DVec3), eye: DVec3, point: DVec3) -> bool {
    let (transform, half) = wall;
    let inverse = transform.inverse();
    let (from, to) = (inverse.transform_point3(eye), inverse.transform_point3(point));
    let half = *half * (1.0 - 1e-6);
    let (mut first, mut last) = (0.0f64, 1.0f64);
    for axis in 0..3 {
        let (start, along) = (from[axis], to[axis] - from[axis]);
        if along == 0.0 {
            if start.abs() > half[axis] {
                return false;
            }
            continue;
        }
        let (a, b) = ((-half[axis] - start) / along, (half[axis] - start) / along);
        first = first.max(a.min(b));
        last = last.min(a.max(b));
    }
    first < last
}

fn spawn_walls(world: &mut World, random: &mut Random, mesh: &Handle<Mesh>) {
    for number in 0..12 {
        let transform = Transform {
            translation: Vec3::new(0.0, 0.0, -12.0) + random.vec3(-8.0, 8.0) * Vec3::new(2.0, 0.5, 1.0),
            rotation: Quat::from_rotation_y(random.range(-1.0, 1.0) as f32),
            scale: Vec3::new(6.0, 6.0, 0.5),
        };
        let occluder = match number % 3 {
            0 => Occluder::Mesh,
            1 => Occluder::Box,
            _ => {
                let unit = visibility_core::Aabb::from_arrays([-0.5; 3], [0.5; 3]);
                Occluder::Custom(Arc::new(OccluderMesh::cuboid(&unit).unwrap()))
            }
        };
        world.spawn((Number(number), Mesh3d(mesh.clone()), transform, occluder));
    }
}

fn spawn_things(world: &mut World, random: &mut Random, mesh: &Handle<Mesh>) {
    for number in 100..2100 {
        let turn = Quat::from_rotation_x(random.range(0.0, 3.0) as f32);
        let transform = Transform::from_translation(random.vec3(-40.0, 40.0)).with_rotation(turn);
        world.spawn((Number(number), Mesh3d(mesh.clone()), transform));
    }
}

#[test]
fn boxes_hold_what_bevy_rounded_and_box_occluders_are_within() {
    let mut random = Random(5);
    // bevy keeps the first as centre and half extent, from which its least x is 22.30126953125.
    let mut sides = vec![(Vec3::new(22.301_208, -1.0, 0.1), Vec3::new(1_121.265_1, 1.0, 0.1))];
    for _ in 0..2000 {
        let [a, b] = [0, 1].map(|_| random.vec3(-1e3, 1e3) * random.range(0.0, 1.0) as f32);
        sides.push((a.min(b), a.max(b)));
    }
    assert!(
        Aabb::from_min_max(sides[0].0, sides[0].1).min().x > sides[0].0.x,
        "bevy rounds the first side inwards"
    );
    let mut app = app(true);
    for (number, &(min, max)) in sides.iter().enumerate() {
        let aabb = Aabb::from_min_max(min, max);
        app.world_mut().spawn((drawn(number as u32, Transform::IDENTITY), aabb, Occluder::Box));
    }
    app.update();
    let (mut wide, mut narrow) = (0.0f32, 0.0f32);
    for (number, &(min, max)) in sides.iter().enumerate() {
        let entity = entity(&mut app, Number(number as u32)).unwrap();
        let mirror = app.world().resource::<VisibilityScene>();
        let id = mirror.object(entity).unwrap();
        let bounds = mirror.scene().bounds(id).unwrap();
        let [low, high] = [bounds.min, bounds.max].map(|corner| Vec3::from_array(corner.to_array()));
        assert!(
            low.cmple(min).all() && high.cmpge(max).all(),
            "box {number}: {low} to {high} of {min} to {max}"
        );
        wide = wide.max((min - low).max_element()).max((high - max).max_element());
        let (mesh, _) = mirror.scene().occluder(id).unwrap();
        for corner in mesh.positions().iter().map(|corner| Vec3::from_array(corner.to_array())) {
            let inside = (corner - min).min(max - corner);
            assert!(inside.min_element() >= 0.0, "box {number}: {corner} of {min} to {max}");
            let [from_min, from_max] = [corner - min, max - corner];
            narrow = narrow.max(from_min.min(from_max).max_element());
        }
    }
    assert!(wide < 1e-3 && narrow < 1e-3, "the sides move by {wide} and {narrow}");
}

#[test]
fn only_what_no_line_of_sight_reaches_is_hidden() {
    let mut app = app(true);
    let mut random = Random(11);
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::from_length(1.0).mesh().build());
    spawn_walls(app.world_mut(), &mut random, &mesh);
    spawn_things(app.world_mut(), &mut random, &mesh);
    app.world_mut().spawn((CAMERA, Camera3d::default(), Transform::default()));
    let (mut hidden, mut visible) = (0, 0);
    for _ in 0..24 {
        // Camera, walls and things all move.
        let camera = entity(&mut app, CAMERA).unwrap();
        let eye = random.vec3(-3.0, 3.0);
        app.world_mut().entity_mut(camera).insert(
            Transform::from_translation(eye).looking_at(random.vec3(-6.0, 6.0) - 20.0 * Vec3::Z, Vec3::Y),
        );
        let mut moved = app.world_mut().query_filtered::<&mut Transform, With<Mesh3d>>();
        for mut transform in moved.iter_mut(app.world_mut()) {
            transform.translation += random.vec3(-0.5, 0.5);
        }
        app.update();
        let (seen, world) = (seen_by(&mut app, CAMERA), app.world_mut());
        let placed = |transform: &GlobalTransform| {
            let affine = transform.affine();
            DAffine3::from_cols_array(&affine.to_cols_array().map(f64::from))
        };
        let mut walls = world.query_filtered::<&GlobalTransform, With<Occluder>>();
        let walls: Vec<_> =
            walls.iter(world).map(|transform| (placed(transform), DVec3::splat(0.5))).collect();
        let frustum = *world.get::<Frustum>(camera).unwrap();
        let mut all = world.query::<(&Number, &GlobalTransform, &Aabb)>();
        let all: Vec<_> = all.iter(world).map(|(number, at, aabb)| (*number, *at, *aabb)).collect();
        for (number, transform, aabb) in all {
            visible += usize::from(seen.contains(&number));
            if seen.contains(&number) || !frustum.intersects_obb(&aabb, &transform.affine(), true, false) {
                continue;
            }
            hidden += 1;
            for _ in 0..40 {
                let local = random.vector(0.5);
                let point = placed(&transform).transform_point3(local);
                let is_blocked = walls.iter().any(|wall| blocks(wall, eye.as_dvec3(), point));
                // Points outside of the picture are hidden by the frustum, so they need no blocker.
                let point = Aabb { center: point.as_vec3a(), half_extents: Default::default() };
                let is_in_picture = frustum.intersects_obb(&point, &Affine3A::IDENTITY, true, false);
                assert!(is_blocked || !is_in_picture, "{number:?} at {point:?} is visible from {eye}");
            }
        }
    }
    assert!(hidden > 1000 && visible > 500, "{hidden} hidden, {visible} visible");
}

/// Creates an app with a wall (number 0) in front of a thing (number 1).
fn wall_before_thing(occluder: Occluder) -> bevy_app::App {
    let mut app = app(true);
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::from_length(1.0).mesh().build());
    let wall = Transform::from_xyz(0.0, 0.0, -5.0).with_scale(Vec3::new(8.0, 8.0, 0.2));
    app.world_mut().spawn((Number(0), Mesh3d(mesh.clone()), wall, occluder));
    app.world_mut().spawn((Number(1), Mesh3d(mesh), Transform::from_xyz(0.0, 0.0, -10.0)));
    app.world_mut().spawn((CAMERA, Camera3d::default(), Transform::default()));
    app.update();
    app
}

fn is_seen(app: &mut bevy_app::App, number: u32) -> bool {
    app.update();
    let seen = seen_by(app, CAMERA);
    assert_eq!(
        seen,
        {
            let camera: BTreeSet<Number> = [CAMERA].into();
            seen_by_any(app).difference(&camera).copied().collect()
        },
        "entities seen by the camera and by any"
    );
    seen.contains(&Number(number))
}

/// Change that stops a wall from occluding: its description, the change, and its reversal.
type Change = (&'static str, fn(&mut EntityWorldMut), fn(&mut EntityWorldMut));

#[test]
fn hidden_entities_come_back_when_the_wall_no_longer_hides_them() {
    let changes: [Change; 10] = [
        ("moves away", |wall| move_by(wall, 20.0), |wall| move_by(wall, -20.0)),
        ("no occluder", drop_component::<Occluder>, |wall| add(wall, Occluder::Box)),
        ("hidden", |wall| add(wall, Visibility::Hidden), |wall| add(wall, Visibility::Inherited)),
        ("layer", |wall| add(wall, RenderLayers::layer(2)), drop_component::<RenderLayers>),
        ("high layer", |wall| add(wall, RenderLayers::layer(40)), drop_component::<RenderLayers>),
        ("range", |wall| add(wall, VisibilityRange::abrupt(50.0, 90.0)), drop_component::<VisibilityRange>),
        ("skinned", |wall| add(wall, SkinnedMesh::default()), drop_component::<SkinnedMesh>),
        ("mirrored", |wall| scale(wall, -8.0), |wall| scale(wall, 8.0)),
        ("unculled", |wall| add(wall, NoFrustumCulling), drop_component::<NoFrustumCulling>),
        ("disabled", |wall| add(wall, Disabled), drop_component::<Disabled>),
    ];
    for occluder in [Occluder::Mesh, Occluder::Box] {
        let mut app = wall_before_thing(occluder);
        for (name, there, back) in changes {
            assert!(!is_seen(&mut app, 1), "before {name}");
            let wall = entity(&mut app, Number(0)).unwrap();
            there(&mut app.world_mut().entity_mut(wall));
            assert!(is_seen(&mut app, 1), "{name}");
            assert!(is_seen(&mut app, 1), "{name}, a frame later");
            back(&mut app.world_mut().entity_mut(wall));
        }
        assert!(!is_seen(&mut app, 1), "the wall hides again after all changes");
        let wall = entity(&mut app, Number(0)).unwrap();
        app.world_mut().despawn(wall);
        assert!(is_seen(&mut app, 1), "despawned");
    }
}

fn add(wall: &mut EntityWorldMut, component: impl Component) {
    wall.insert(component);
}

fn drop_component<C: Component>(wall: &mut EntityWorldMut) {
    wall.remove::<C>();
}

fn move_by(wall: &mut EntityWorldMut, x: f32) {
    wall.get_mut::<Transform>().unwrap().translation.x += x;
}

fn scale(wall: &mut EntityWorldMut, x: f32) {
    wall.get_mut::<Transform>().unwrap().scale.x = x;
}

#[test]
fn a_mesh_that_is_loaded_late_or_changed_is_followed() {
    let unit = visibility_core::Aabb::from_arrays([-0.5; 3], [0.5; 3]);
    let custom = Occluder::Custom(Arc::new(OccluderMesh::cuboid(&unit).unwrap()));
    let whole = || Cuboid::from_length(1.0).mesh().build();
    let mut app = wall_before_thing(Occluder::Mesh);
    let wall = entity(&mut app, Number(0)).unwrap();
    let mut late = Handle::default();
    for occluder in [custom, Occluder::Box, Occluder::Mesh] {
        app.world_mut().entity_mut(wall).insert(occluder.clone());
        assert!(!is_seen(&mut app, 1), "the wall hides the thing: {occluder:?}");
        late = app.world().resource::<Assets<Mesh>>().reserve_handle();
        app.world_mut().entity_mut(wall).insert(Mesh3d(late.clone()));
        assert!(is_seen(&mut app, 1), "no mesh yet: {occluder:?}");
        app.world_mut().resource_mut::<Assets<Mesh>>().insert(&late, whole()).unwrap();
        assert!(!is_seen(&mut app, 1), "loaded: {occluder:?}");
        app.world_mut().entity_mut(wall).remove::<Occluder>();
        app.world_mut().resource_mut::<Assets<Mesh>>().remove(&late);
        assert!(is_seen(&mut app, 1), "no occluder and no mesh: {occluder:?}");
        app.world_mut().entity_mut(wall).insert(occluder.clone());
        assert!(is_seen(&mut app, 1), "an occluder whose mesh went before it came: {occluder:?}");
        app.world_mut().resource_mut::<Assets<Mesh>>().insert(&late, whole()).unwrap();
    }
    assert!(!is_seen(&mut app, 1), "loaded again");
    let narrow = Cuboid::new(0.01, 1.0, 1.0).mesh().build();
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(&late, narrow).unwrap();
    assert!(is_seen(&mut app, 1), "changed");
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(&late, whole()).unwrap();
    assert!(!is_seen(&mut app, 1), "changed back");
    for occluder in [Occluder::Mesh, Occluder::Box] {
        app.world_mut().entity_mut(wall).insert(occluder);
        app.world_mut().resource_mut::<Assets<Mesh>>().insert(&late, whole()).unwrap();
        assert!(!is_seen(&mut app, 1), "here again");
        app.world_mut().resource_mut::<Assets<Mesh>>().remove(&late);
        assert!(is_seen(&mut app, 1), "removed while an entity has it, which is not drawn then");
    }
}

/// In every frame the wall is another box, another asset, another custom mesh or another entity.
#[test]
fn occluders_that_change_every_frame_do_not_fill_the_scene() {
    let changes: [fn(&mut bevy_app::App, Vec3); 4] = [
        |app, half| {
            let wall = entity(app, Number(0)).unwrap();
            app.world_mut().entity_mut(wall).insert((Occluder::Box, Aabb::from_min_max(-half, half)));
        },
        |app, half| {
            let wall = entity(app, Number(0)).unwrap();
            app.world_mut().entity_mut(wall).insert(Occluder::Mesh);
            let mesh = app.world().get::<Mesh3d>(wall).unwrap().0.clone();
            let shape = Cuboid::from_size(half * 2.0).mesh().build();
            app.world_mut().resource_mut::<Assets<Mesh>>().insert(&mesh, shape).unwrap();
        },
        |app, half| {
            let bounds = visibility_core::Aabb::from_arrays((-half).to_array(), half.to_array());
            let mesh = Arc::new(OccluderMesh::cuboid(&bounds).unwrap());
            let wall = entity(app, Number(0)).unwrap();
            let aabb = Aabb::from_min_max(-half, half);
            app.world_mut().entity_mut(wall).insert((Occluder::Custom(mesh), aabb));
        },
        |app, half| {
            let wall = entity(app, Number(0)).unwrap();
            let transform = *app.world().get::<Transform>(wall).unwrap();
            app.world_mut().despawn(wall);
            let shape = Cuboid::from_size(half * 2.0).mesh().build();
            let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(shape);
            app.world_mut().spawn((Number(0), Mesh3d(mesh), transform, Occluder::Mesh));
        },
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let mut app = wall_before_thing(Occluder::Box);
        for frame in 0..200 {
            change(&mut app, Vec3::splat(0.5 + frame as f32 * 1e-3));
            assert!(!is_seen(&mut app, 1), "change {number}, frame {frame}");
            let meshes = app.world().resource::<VisibilityScene>().scene().mesh_count();
            assert!(meshes <= 65, "change {number}, frame {frame}: {meshes} meshes");
        }
    }
}

#[test]
fn cameras_choose_their_cullers() {
    let mut app = wall_before_thing(Occluder::Mesh);
    let camera = entity(&mut app, CAMERA).unwrap();
    assert!(!is_seen(&mut app, 1), "the default pipeline hides the thing");
    app.world_mut().entity_mut(camera).insert(CullingPipeline::frustum());
    assert!(is_seen(&mut app, 1), "the frustum alone shows the thing");
    app.world_mut().entity_mut(camera).insert(CullingPipeline::occlusion(usize::MAX, 0));
    assert!(!is_seen(&mut app, 1), "occlusion without budget and price hides the thing");
    let thing = entity(&mut app, Number(1)).unwrap();
    let id = app.world().resource::<VisibilityScene>().object(thing).unwrap();
    assert_eq!(app.world().resource::<VisibilityScene>().entity(id), Some(thing), "the entity of the object");
    let mut culling = app.world_mut().get_mut::<CullingPipeline>(camera).unwrap();
    culling.pipeline_mut().set_explaining(true);
    assert!(!is_seen(&mut app, 1), "explaining changes what is seen");
    let culling = app.world().get::<CullingPipeline>(camera).unwrap();
    assert_eq!(culling.pipeline().explain(id).to_string(), "removed by hzb", "what removed the thing");
    let scene = app.world().resource::<VisibilityScene>();
    assert_eq!(culling.culled(scene).collect::<Vec<_>>(), [(thing, "hzb")], "what is culled, and by what");
    app.world_mut().entity_mut(camera).remove::<CullingPipeline>();
    assert!(is_seen(&mut app, 1), "by the frustum alone");
}
