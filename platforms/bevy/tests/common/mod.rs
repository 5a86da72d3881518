//! Pairs of equal worlds, one culled by bevy and one by this crate.
#![allow(dead_code, unreachable_pub)]

use bevy_app::{App, TaskPoolPlugin};
use bevy_asset::{AssetApp, AssetPlugin, Assets, Handle, RenderAssetUsages};
use bevy_camera::prelude::*;
use bevy_camera::visibility::VisibleEntities;
use bevy_ecs::prelude::*;
use bevy_image::Image;
use bevy_light::LightPlugin;
use bevy_mesh::{Mesh, Mesh3d, MeshPlugin, PrimitiveTopology};
use bevy_transform::TransformPlugin;
use bevy_transform::prelude::*;
use std::any::TypeId;
use std::collections::BTreeSet;
use visibility_bevy::VisibilityCullingPlugin;

/// Number of an entity, the same in both worlds.
#[derive(Component, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Number(pub u32);

/// Creates an app culled by bevy, or, with the plugin, by this crate.
pub fn app(with_plugin: bool) -> App {
    app_with(with_plugin, |_| {})
}

/// Creates the same app as [`app`], with additional plugins.
pub fn app_with(with_plugin: bool, add_more: impl FnOnce(&mut App)) -> App {
    let mut app = App::new();
    app.add_plugins((
        TaskPoolPlugin::default(),
        AssetPlugin::default(),
        MeshPlugin,
        TransformPlugin,
        bevy_camera::CameraPlugin,
    ));
    app.init_asset::<Image>();
    app.add_plugins(LightPlugin);
    if with_plugin {
        app.add_plugins(VisibilityCullingPlugin);
    }
    add_more(&mut app);
    app.finish();
    app.cleanup();
    // The mesh of `Mesh3d::default`, without positions, so that bevy computes no `Aabb` of it.
    let nothing = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default());
    app.world_mut().resource_mut::<Assets<Mesh>>().insert(&Handle::default(), nothing).unwrap();
    app
}

/// Returns the numbers of entities.
pub fn numbers<'a>(app: &App, entities: impl IntoIterator<Item = &'a Entity>) -> BTreeSet<Number> {
    entities.into_iter().filter_map(|&entity| app.world().get::<Number>(entity).copied()).collect()
}

/// Returns the entity with a number.
pub fn entity(app: &mut App, number: Number) -> Option<Entity> {
    let mut all = app.world_mut().query::<(Entity, &Number)>();
    all.iter(app.world()).find(|(_, own)| **own == number).map(|(entity, _)| entity)
}

/// Returns the numbers of the meshes in a camera's list of visible entities. Asserts that the list is sorted
/// and without repetition.
pub fn seen_by(app: &mut App, camera: Number) -> BTreeSet<Number> {
    let camera = entity(app, camera).unwrap();
    let list = app.world().get::<VisibleEntities>(camera).unwrap().get(TypeId::of::<Mesh3d>());
    assert!(list.is_sorted_by(|a, b| a < b), "bevy's renderer compares sorted lists");
    numbers(app, list)
}

/// Returns the numbers of the entities that are visible in any view.
pub fn seen_by_any(app: &mut App) -> BTreeSet<Number> {
    let mut all = app.world_mut().query::<(&Number, &ViewVisibility)>();
    all.iter(app.world()).filter(|(_, result)| result.get()).map(|(number, _)| *number).collect()
}

/// Returns the components that an entity of class `Mesh3d` needs, with a mesh of no triangles.
pub fn drawn(number: u32, transform: Transform) -> impl Bundle {
    (Number(number), Mesh3d::default(), transform)
}
