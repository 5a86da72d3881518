//! Cameras that do not draw what others draw: those for 2D, those that draw the backs of meshes, and those
//! with a near plane askew.

mod common;

use bevy_app::App;
use bevy_asset::Assets;
use bevy_camera::prelude::*;
use bevy_camera::primitives::Aabb;
use bevy_camera::visibility::VisibleEntities;
use bevy_math::{Quat, Vec3, Vec3A, Vec4};
use bevy_mesh::{Mesh, Mesh2d, Mesh3d, MeshBuilder, Meshable};
use bevy_shape::{Cuboid, Rectangle};
use bevy_transform::prelude::*;
use common::*;
use std::any::TypeId;
use std::f32::consts::PI;
use visibility_bevy::Occluder;

const CAMERA: Number = Number(1_000_000);

/// A world with a square of 8 x 8 m, number 0, 5 m before a camera and its front turned to it, and a box,
/// number 1, 10 m before the camera.
fn square_before_box() -> App {
    let mut app = app(true);
    let mut meshes = app.world_mut().resource_mut::<Assets<Mesh>>();
    let square = meshes.add(Rectangle::new(8.0, 8.0).mesh().build());
    let cuboid = meshes.add(Cuboid::from_length(1.0).mesh().build());
    let world = app.world_mut();
    world.spawn((Number(0), Mesh3d(square), Transform::from_xyz(0.0, 0.0, -5.0), Occluder::Mesh));
    world.spawn((Number(1), Mesh3d(cuboid), Transform::from_xyz(0.0, 0.0, -10.0)));
    world.spawn((CAMERA, Camera3d::default()));
    app
}

fn is_box_seen(app: &mut App) -> bool {
    app.update();
    seen_by(app, CAMERA).contains(&Number(1))
}

#[test]
fn a_wall_hides_nothing_from_a_2d_camera_which_does_not_draw_it() {
    let mut app = square_before_box();
    let seen = |app: &App, camera| {
        app.world().get::<VisibleEntities>(camera).unwrap().get(TypeId::of::<Mesh2d>()).to_vec()
    };
    let camera = app.world_mut().spawn((Camera2d, Camera { order: 1, ..Default::default() })).id();
    let bounds = Aabb { center: Vec3A::ZERO, half_extents: Vec3A::new(0.5, 0.5, 0.0) };
    let flat = app.world_mut().spawn((Mesh2d::default(), bounds, Transform::from_xyz(0.0, 0.0, -20.0))).id();
    assert!(!is_box_seen(&mut app), "the wall hides the box from the 3D camera");
    assert_eq!(seen(&app, camera), [flat], "what the 2D camera sees");

    let other = entity(&mut app, CAMERA).unwrap();
    assert_eq!(seen(&app, other), [], "what the 3D camera sees of 2D");
    app.world_mut().entity_mut(other).remove::<Camera3d>().insert(Camera2d);
    app.update();
    assert_eq!(seen(&app, other), [flat], "what the 3D camera sees of 2D once it is a 2D camera");
}

/// A camera draws the backs of meshes if it is mirrored or inverts culling, and their fronts if both or
/// neither.
#[test]
fn a_wall_hides_nothing_from_a_camera_that_draws_the_backs_of_meshes() {
    for projection in [
        Projection::default(),
        Projection::Orthographic(OrthographicProjection {
            scale: 0.01,
            ..OrthographicProjection::default_3d()
        }),
    ] {
        for case in 0..8 {
            let [mirrored, inverted, turned] = [0, 1, 2].map(|bit| case >> bit & 1 != 0);
            let mut app = square_before_box();
            let camera = entity(&mut app, CAMERA).unwrap();
            let scale = Vec3::new(if mirrored { -1.0 } else { 1.0 }, 1.0, 1.0);
            let own = Camera { invert_culling: inverted, ..Default::default() };
            app.world_mut().entity_mut(camera).insert((
                projection.clone(),
                own,
                Transform::from_scale(scale),
            ));
            if turned {
                let square = entity(&mut app, Number(0)).unwrap();
                app.world_mut().get_mut::<Transform>(square).unwrap().rotate(Quat::from_rotation_y(PI));
            }
            let is_hidden = !turned && mirrored == inverted;
            let name = format!("mirrored {mirrored}, inverted {inverted}, turned {turned}: {projection:?}");
            assert_eq!(!is_box_seen(&mut app), is_hidden, "whether the wall hides the box, {name}");
        }
    }
}

#[test]
fn a_wall_before_an_oblique_near_plane_hides_nothing() {
    for (distance, is_hidden) in [(3.0, true), (7.0, false), (-3.0, false)] {
        let mut app = square_before_box();
        let camera = entity(&mut app, CAMERA).unwrap();
        let normal = Vec3::new(0.2, 0.0, -1.0).normalize();
        let near_clip_plane = Vec4::new(normal.x, normal.y, normal.z, -distance * -normal.z);
        let lens = PerspectiveProjection { near_clip_plane, fov: 0.5, ..Default::default() };
        app.world_mut().entity_mut(camera).insert(Projection::Perspective(lens));
        assert_eq!(
            !is_box_seen(&mut app),
            is_hidden,
            "whether the wall at 5 m hides the box at 10 m with a near plane at {distance} m"
        );
    }
}
