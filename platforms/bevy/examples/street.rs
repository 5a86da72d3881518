//! A street of houses, the nearer of which occlude the farther. Runs without a window: a game uses
//! `DefaultPlugins` instead of the five plugins below.
use bevy_app::prelude::*;
use bevy_asset::{AssetPlugin, Assets};
use bevy_camera::{CameraPlugin, prelude::*};
use bevy_ecs::prelude::*;
use bevy_mesh::{Mesh, Mesh3d, MeshPlugin};
use bevy_shape::Cuboid;
use bevy_transform::prelude::*;
use visibility_bevy::{Occluder, VisibilityCullingPlugin};

fn main() {
    let bevy = (TaskPoolPlugin::default(), AssetPlugin::default(), MeshPlugin, TransformPlugin, CameraPlugin);
    App::new()
        .add_plugins((bevy, VisibilityCullingPlugin))
        .add_systems(Startup, setup)
        .add_systems(Last, count)
        .run();
}
fn setup(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>) {
    commands.spawn((Camera3d::default(), Transform::from_xyz(5.0, 1.7, 0.0)));
    let house = meshes.add(Cuboid::new(8.0, 12.0, 8.0));
    for (x, z) in (-20..20).flat_map(|x| (1..40).map(move |z| (10.0 * x as f32, -10.0 * z as f32))) {
        commands.spawn((Mesh3d(house.clone()), Transform::from_xyz(x, 6.0, z), Occluder::Mesh));
    }
}
fn count(houses: Query<&ViewVisibility, With<Mesh3d>>) {
    let visible = houses.iter().filter(|house| house.get()).count();
    println!("{visible} of {} houses are visible", houses.iter().count());
}
