//! Culling for the shadow views of lights: the entities that are drawn into each shadow map.
//!
//! The systems here replace `check_dir_light_mesh_visibility` and `check_point_light_mesh_visibility` of
//! `bevy_light`. They query the hierarchy instead of testing every entity.

use crate::camera_view::{layer_mask, volume};
use crate::cameras::Exceptions;
use crate::entity_lists::EntitySorter;
use crate::mirror::VisibilityScene;
use bevy_camera::primitives::{CascadesFrusta, CubemapFrusta, Frustum, Sphere};
use bevy_camera::visibility::{
    CascadesVisibleEntities, CubemapVisibleEntities, RenderLayers, SetViewVisibility, ViewVisibility,
    VisibleEntities, VisibleEntityRanges, VisibleMeshEntities,
};
use bevy_camera::{Camera, RenderTarget, ShadowLodOrigin};
use bevy_ecs::entity::EntityHashSet;
use bevy_ecs::prelude::*;
use bevy_light::cluster::ClusterVisibilityClass;
use bevy_light::{DirectionalLight, PointLight, SpotLight, get_shadow_lod_origin};
use bevy_transform::components::GlobalTransform;
use std::any::TypeId;
use visibility_core::ObjectId;
use visibility_core::frustum::ConvexVolume;
use visibility_frame::queries::SceneQuery;

/// Memory for culling a shadow view, reused from frame to frame.
#[derive(Default)]
pub(crate) struct Scratch {
    found: Vec<ObjectId>,
    casters: EntitySorter,
}

/// Data that all shadow views of a frame share.
struct ShadowCuller<'a, 'w, 's> {
    mirror: &'a VisibilityScene,
    exceptions: Exceptions<'a, 'w, 's>,
    results: Query<'w, 's, &'static mut ViewVisibility>,
    scratch: &'a mut Scratch,
}

impl ShadowCuller<'_, '_, '_> {
    /// Fills `list` with the casters in a volume that share a layer with the light, sorted, and marks them as
    /// visible. Casters entirely outside of the sphere `reach` are left out. Visibility ranges are measured
    /// from `range_view`.
    fn cull(
        &mut self,
        volume: &ConvexVolume,
        layers: Option<&RenderLayers>,
        reach: Option<&Sphere>,
        range_view: Option<Entity>,
        list: &mut VisibleMeshEntities,
    ) {
        let Scratch { found, casters } = &mut *self.scratch;
        let query = SceneQuery::new(self.mirror.scene()).on_layers(layer_mask(layers));
        query.in_convex(volume, found);
        for &id in found.iter() {
            let record = self.mirror.record(id);
            let is_reached = reach.is_none_or(|reach| self.mirror.is_touched(id, reach));
            if record.casts_shadow && is_reached && self.exceptions.show(record, range_view, layers) {
                casters.push(record.entity);
            }
        }
        casters.take(&mut list.entities);
        list.shrink();
        mark_visible(&mut self.results, &list.entities);
    }
}

/// Culls for each cascade of each directional light that casts shadows.
pub(crate) fn cull_directional_lights(
    mirror: Res<VisibilityScene>,
    mut scratch: Local<Scratch>,
    mut lights: Query<
        (Entity, &DirectionalLight, &CascadesFrusta, &mut CascadesVisibleEntities, Option<&RenderLayers>),
        Without<SpotLight>,
    >,
    results: Query<&'static mut ViewVisibility>,
    ranges: Option<Res<VisibleEntityRanges>>,
    layers: Query<&'static RenderLayers>,
) {
    let exceptions = Exceptions { ranges: ranges.as_deref(), layers: &layers };
    let mut culler = ShadowCuller { mirror: &mirror, exceptions, results, scratch: &mut scratch };
    for (light, settings, frusta, mut visible, own_layers) in &mut lights {
        if !settings.shadow_maps_enabled || !culler.results.get(light).is_ok_and(|result| result.get()) {
            visible.entities.clear();
            continue;
        }
        visible.entities.retain(|view, _| frusta.frusta.contains_key(view));
        for (&view, cascades) in &frusta.frusta {
            let lists = visible.entities.entry(view).or_default();
            lists.resize(cascades.len(), VisibleMeshEntities::default());
            for (frustum, list) in cascades.iter().zip(lists) {
                // No near plane: a caster in front of it still casts a shadow.
                culler.cull(&volume(frustum, false, true), own_layers, None, Some(view), list);
            }
        }
    }
}

/// Culls for the six faces of each point light, and for each spot light, that casts shadows and is visible to
/// some camera.
pub(crate) fn cull_point_and_spot_lights(
    mirror: Res<VisibilityScene>,
    mut scratch: Local<Scratch>,
    mut checked: Local<EntityHashSet>,
    cameras: Query<&VisibleEntities>,
    mut points: Query<(
        &PointLight,
        &GlobalTransform,
        &CubemapFrusta,
        &mut CubemapVisibleEntities,
        Option<&RenderLayers>,
    )>,
    mut spots: Query<(
        &SpotLight,
        &GlobalTransform,
        &Frustum,
        &mut VisibleMeshEntities,
        Option<&RenderLayers>,
    )>,
    results: Query<&'static mut ViewVisibility>,
    mut targets: Query<(Entity, &RenderTarget), With<Camera>>,
    mut origins: Query<Entity, With<ShadowLodOrigin>>,
    mut lights: Query<Entity, Or<(With<PointLight>, With<SpotLight>)>>,
    ranges: Option<Res<VisibleEntityRanges>>,
    layers: Query<&'static RenderLayers>,
) {
    let range_view = get_shadow_lod_origin(
        targets.transmute_lens_filtered(),
        origins.transmute_lens_filtered(),
        lights.transmute_lens_filtered(),
    );
    let exceptions = Exceptions { ranges: ranges.as_deref(), layers: &layers };
    let mut culler = ShadowCuller { mirror: &mirror, exceptions, results, scratch: &mut scratch };
    let reach = |at: &GlobalTransform, radius| Sphere { center: at.translation_vec3a(), radius };
    checked.clear();
    for &light in cameras.iter().flat_map(|visible| visible.get(TypeId::of::<ClusterVisibilityClass>())) {
        if !checked.insert(light) {
            continue;
        }
        if let Ok((settings, at, frusta, mut visible, layers)) = points.get_mut(light)
            && settings.shadow_maps_enabled
        {
            let reach = reach(at, settings.range);
            for (frustum, list) in frusta.iter().zip(visible.iter_mut()) {
                culler.cull(&volume(frustum, true, true), layers, Some(&reach), range_view, list);
            }
        }
        if let Ok((settings, at, frustum, mut list, layers)) = spots.get_mut(light)
            && settings.shadow_maps_enabled
        {
            let reach = reach(at, settings.range);
            culler.cull(&volume(frustum, true, true), layers, Some(&reach), range_view, &mut list);
        }
    }
}

/// Marks entities as visible in some view.
fn mark_visible(results: &mut Query<&mut ViewVisibility>, entities: &[Entity]) {
    let mut results = results.iter_many_mut(entities).matched();
    while let Some(mut result) = results.fetch_next() {
        result.set_visible();
    }
}
