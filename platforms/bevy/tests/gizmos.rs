//! Test that gizmos are drawn for culled entities of a camera while it has `ShowCulled`.
#![cfg(feature = "gizmos")]

mod common;

use bevy_asset::Assets;
use bevy_camera::prelude::*;
use bevy_camera::primitives::Aabb;
use bevy_gizmos::{GizmoAsset, GizmoHandles, GizmoPlugin};
use bevy_math::{Vec3, Vec3A};
use bevy_transform::prelude::*;
use common::*;
use visibility_bevy::Occluder;
use visibility_bevy::gizmos::{CullingGizmosPlugin, ShowCulled};

/// Returns the colours, as bits, of the line ends drawn in the last frame.
fn drawn_colors(app: &mut bevy_app::App) -> Vec<[u32; 3]> {
    app.update();
    let assets = app.world().resource::<Assets<GizmoAsset>>();
    let handles = app.world().resource::<GizmoHandles>().handles();
    let buffers =
        handles.values().flatten().filter_map(|handle| assets.get(handle)).map(|asset| asset.buffer());
    buffers
        .flat_map(|buffer| buffer.list_colors.iter().chain(&buffer.strip_colors))
        // A colour of NaN separates two line strips.
        .filter(|color| !color.red.is_nan())
        .map(|color| [color.red, color.green, color.blue].map(f32::to_bits))
        .collect()
}

#[test]
fn culled_boxes_are_drawn_in_the_colour_of_their_culler() {
    let mut app = app_with(true, |app| {
        app.add_plugins((GizmoPlugin, CullingGizmosPlugin));
    });
    let camera = app.world_mut().spawn((Camera3d::default(), Transform::default())).id();
    let cube = || Aabb { center: Vec3A::ZERO, half_extents: Vec3A::splat(0.5) };
    let wall = Transform::from_xyz(0.0, 0.0, -5.0).with_scale(Vec3::new(8.0, 8.0, 0.2));
    app.world_mut().spawn((drawn(0, wall), cube(), Occluder::Box));
    app.world_mut().spawn((drawn(1, Transform::from_xyz(0.0, 0.0, 10.0)), cube()));
    assert!(drawn_colors(&mut app).is_empty(), "nothing is drawn before it is asked for");
    app.world_mut().entity_mut(camera).insert(ShowCulled);
    let frustum_only = drawn_colors(&mut app);
    assert!(
        !frustum_only.is_empty() && frustum_only.iter().all(|color| *color == frustum_only[0]),
        "one colour, of what the frustum culls: {frustum_only:?}"
    );
    app.world_mut().spawn((drawn(2, Transform::from_xyz(0.0, 0.0, -10.0)), cube()));
    let both = drawn_colors(&mut app);
    assert_eq!(both.len(), 2 * frustum_only.len(), "lines of two culled boxes");
    assert_eq!(
        both.iter().filter(|color| **color == frustum_only[0]).count(),
        frustum_only.len(),
        "lines in the frustum's colour"
    );
    app.world_mut().entity_mut(camera).remove::<ShowCulled>();
    assert!(drawn_colors(&mut app).is_empty(), "lines are drawn after they were turned off");
}
