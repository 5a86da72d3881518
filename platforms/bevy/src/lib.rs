//! Visibility culling for bevy with the `visibility` crates: [`VisibilityCullingPlugin`] replaces bevy's
//! frustum culling on the CPU.
//!
//! bevy tests every entity against every view, each frame. This plugin keeps the entities in a hierarchy of
//! boxes, follows what changed, and walks the hierarchy for each view. Cameras also cull by occlusion:
//! entities behind an [`Occluder`] are hidden, and therefore neither extracted nor skinned nor drawn. The
//! results are stored where bevy's own systems and its renderer expect them: in `ViewVisibility`, in the
//! `VisibleEntities` of each camera and in the lists of each light.
//!
//! ```
//! use bevy_app::prelude::*;
//! use bevy_camera::prelude::*;
//! use bevy_mesh::Mesh3d;
//! use bevy_transform::prelude::*;
//! use visibility_bevy::{Occluder, VisibilityCullingPlugin};
//!
//! # fn add_plugins_of_bevy(app: &mut App) {
//! #     app.add_plugins((
//! #         bevy_app::TaskPoolPlugin::default(),
//! #         bevy_asset::AssetPlugin::default(),
//! #         bevy_mesh::MeshPlugin,
//! #         bevy_camera::CameraPlugin,
//! #         TransformPlugin,
//! #     ));
//! # }
//! let mut app = App::new();
//! add_plugins_of_bevy(&mut app); // DefaultPlugins, in a game
//! app.add_plugins(VisibilityCullingPlugin);
//! app.world_mut().spawn(Camera3d::default());
//! // A wall: its mesh is also its occluder.
//! app.world_mut().spawn((Mesh3d::default(), Transform::from_xyz(0.0, 0.0, -5.0), Occluder::Mesh));
//! # app.finish();
//! # app.cleanup();
//! # app.update();
//! ```
//!
//! # What is the same as in bevy, and what is not
//! Entities are culled by the axis-aligned world box around their turned local box. bevy tests the turned box
//! itself, and a [`Sphere`](bevy_camera::primitives::Sphere) where there is no box, so a turned box or a
//! sphere at the border of a view may be visible here and hidden in bevy. A mesh with a `Sphere` alone is
//! never culled. A mesh that is a light too is culled by the box around both, and never if it is a
//! `RectLight` or a `DirectionalLight`. Entities wholly nearer than the near plane, or wholly beyond the far
//! plane of an orthographic camera, are hidden here and may be visible in bevy, which leaves them to the
//! graphics card. All else is the same: `InheritedVisibility`, `RenderLayers`, `VisibilityRange`,
//! `NoFrustumCulling`, `NoCpuCulling`, several cameras, and the shadow views of directional, point and spot
//! lights.
//!
//! # What must hold of occluders
//! An entity with an [`Occluder`] must be drawn opaque and cover at least what its occluder covers. See
//! [`Occluder`].

mod baked;
mod camera_view;
mod cameras;
mod changes;
mod entity_lists;
#[cfg(feature = "gizmos")]
pub mod gizmos;
mod lights;
mod mirror;
mod occluder;
mod shared;

pub use baked::{BakedCuller, BakedLevel, BakedObject};
pub use cameras::CullingPipeline;
pub use mirror::VisibilityScene;
pub use occluder::Occluder;
pub use shared::Shared;
pub use visibility_bake::BakedSetError;

use bevy_app::{App, Plugin, PostUpdate};
use bevy_camera::Camera3d;
use bevy_camera::visibility::{VisibilitySystems, check_visibility_cpu_culling, check_visibility_ranges};
use bevy_ecs::prelude::*;
use bevy_ecs::schedule::ScheduleCleanupPolicy;
use bevy_light::{
    LightPlugin, SimulationLightSystems, check_dir_light_mesh_visibility, check_point_light_mesh_visibility,
};
use bevy_mesh::mark_3d_meshes_as_changed_if_their_assets_changed;
use bevy_transform::TransformSystems;

/// Replaces bevy's frustum culling on the CPU, for cameras and for shadow views, by culling with the
/// `visibility` crates. May be added before or after bevy's own plugins.
#[derive(Default, Debug, Clone, Copy)]
pub struct VisibilityCullingPlugin;

/// System sets of the plugin in [`PostUpdate`], within bevy's
/// [`CheckVisibility`](VisibilitySystems::CheckVisibility).
#[derive(SystemSet, Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum CullingSystems {
    /// Updates the [`VisibilityScene`] and the entity states of a [`BakedLevel`] from the entities.
    Sync,
    /// Culls for each camera.
    Cameras,
}

impl Plugin for VisibilityCullingPlugin {
    fn build(&self, app: &mut App) {
        // Fails if cameras exist already. These are culled by their frustum until they are given a pipeline.
        // Other cameras do not draw the meshes by which occluders hide.
        let _ = app.world_mut().try_register_required_components::<Camera3d, CullingPipeline>();
        app.init_resource::<VisibilityScene>()
            .init_resource::<changes::Toggled>()
            .configure_sets(
                PostUpdate,
                (CullingSystems::Sync, CullingSystems::Cameras)
                    .chain()
                    .in_set(VisibilitySystems::CheckVisibility)
                    .after(check_visibility_ranges)
                    // Or a change of a mesh asset would be seen a frame late.
                    .after(mark_3d_meshes_as_changed_if_their_assets_changed),
            )
            .add_systems(
                PostUpdate,
                (
                    (changes::sync_scene, baked::follow_level).chain().in_set(CullingSystems::Sync),
                    cameras::cull_cameras.in_set(CullingSystems::Cameras),
                ),
            );
    }

    /// Removes the systems of bevy that this plugin replaces. Runs after all plugins have added their
    /// systems.
    fn finish(&self, app: &mut App) {
        let policy = ScheduleCleanupPolicy::RemoveSystemsOnly;
        // An error means that there is no such system, so nothing has to be removed.
        let _ = app.remove_systems_in_set(PostUpdate, check_visibility_cpu_culling, policy);
        if !app.is_plugin_added::<LightPlugin>() {
            return;
        }
        let _ = app.remove_systems_in_set(PostUpdate, check_dir_light_mesh_visibility, policy);
        let _ = app.remove_systems_in_set(PostUpdate, check_point_light_mesh_visibility, policy);
        app.add_systems(
            PostUpdate,
            (lights::cull_directional_lights, lights::cull_point_and_spot_lights)
                .in_set(SimulationLightSystems::CheckLightVisibility)
                .after(VisibilitySystems::CalculateBounds)
                .after(TransformSystems::Propagate)
                .after(SimulationLightSystems::UpdateLightFrusta)
                .after(VisibilitySystems::CheckVisibility)
                .before(VisibilitySystems::MarkNewlyHiddenEntitiesInvisible),
        );
    }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
