//! Gizmos that show which entities a camera culled, and by which culler.

use crate::{CullingPipeline, CullingSystems, VisibilityScene};
use bevy_app::{App, Plugin, PostUpdate};
use bevy_color::Color;
use bevy_ecs::prelude::*;
use bevy_gizmos::prelude::Gizmos;
use bevy_math::Vec3A;
use bevy_shape::Aabb3d;
use bevy_transform::components::Transform;

/// Plugin that draws the boxes of entities culled by cameras with [`ShowCulled`]. Needs bevy's own
/// `GizmoPlugin`, which is one of its default plugins.
#[derive(Default, Debug, Clone, Copy)]
pub struct CullingGizmosPlugin;

/// Component of a camera, for which the boxes of culled entities are drawn in the colour of their culler:
/// blue for the first (the frustum), red for the second (occlusion), yellow for any other. Recording the
/// culler of each entity takes time proportional to the number of all entities.
///
/// To look from elsewhere, [freeze](visibility_core::Pipeline::freeze) the camera's
/// [pipeline](CullingPipeline::pipeline_mut) and move the camera.
#[derive(Component, Default, Debug, Clone, Copy)]
pub struct ShowCulled;

const COLORS: [Color; 3] =
    [Color::srgb(0.2, 0.4, 1.0), Color::srgb(1.0, 0.2, 0.2), Color::srgb(1.0, 0.9, 0.2)];

impl Plugin for CullingGizmosPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(
            PostUpdate,
            (start_and_stop.before(CullingSystems::Cameras), draw.after(CullingSystems::Cameras)),
        );
    }
}

fn start_and_stop(
    mut started: Query<&mut CullingPipeline, Added<ShowCulled>>,
    mut stopped: RemovedComponents<ShowCulled>,
    mut others: Query<&mut CullingPipeline, Without<ShowCulled>>,
) {
    for mut culling in &mut started {
        culling.pipeline_mut().set_explaining(true);
    }
    for camera in stopped.read() {
        if let Ok(mut culling) = others.get_mut(camera) {
            culling.pipeline_mut().set_explaining(false);
        }
    }
}

fn draw(scene: Res<VisibilityScene>, cameras: Query<&CullingPipeline, With<ShowCulled>>, mut gizmos: Gizmos) {
    for culling in &cameras {
        for (entity, culler) in culling.culled(&scene) {
            let stage = culling.pipeline().stages().position(|(name, _)| name == culler).unwrap_or(0);
            let bounds = scene.object(entity).and_then(|id| scene.scene().bounds(id).ok());
            if let Some(bounds) = bounds.filter(|bounds| bounds.is_proper()) {
                let [min, max] = [bounds.min, bounds.max].map(|corner| Vec3A::from_array(corner.to_array()));
                gizmos.aabb_3d(Aabb3d { min, max }, Transform::IDENTITY, COLORS[stage.min(2)]);
            }
        }
    }
}
