//! Culling for cameras.

use crate::camera_view::{any_view, camera_view, layer_mask};
use crate::entity_lists::EntitySorter;
use crate::mirror::{Record, VisibilityScene};
use bevy_camera::visibility::{
    NoCpuCulling, RenderLayers, SetViewVisibility, ViewVisibility, VisibleEntities, VisibleEntityRanges,
};
use bevy_camera::{Camera, Projection};
use bevy_ecs::prelude::*;
use bevy_transform::components::GlobalTransform;
use visibility_core::pipeline::Explanation;
use visibility_core::{Culler, FrustumCuller, Pipeline, VisibleSet};
use visibility_hzb::{Hzb, HzbCuller};

/// The cullers of a camera. Every camera is given one that culls by frustum and by occlusion. Insert another
/// to choose:
///
/// ```
/// use bevy_camera::Camera3d;
/// use visibility_bevy::CullingPipeline;
/// # let mut world = bevy_ecs::world::World::new();
/// world.spawn((Camera3d::default(), CullingPipeline::frustum()));
/// world.spawn((Camera3d::default(), CullingPipeline::occlusion(1024, 576)));
/// ```
///
/// Any [`Culler`] of the `visibility` crates will do: see [`with`](Self::with).
#[derive(Component, Debug)]
pub struct CullingPipeline {
    pipeline: Pipeline,
    visible: VisibleSet,
}

impl Default for CullingPipeline {
    /// Culls by frustum and by occlusion, in a buffer of 512 x 288 pixels.
    fn default() -> Self {
        Self::occlusion(512, 288)
    }
}

impl CullingPipeline {
    /// Culls by the camera's frustum alone.
    pub fn frustum() -> Self {
        Self::new(Pipeline::new().with(FrustumCuller::new()))
    }

    /// Culls by the frustum, and by [occluders](crate::Occluder) drawn into a z-buffer of this size, in
    /// pixels, clamped to the sizes that [`Hzb::new`] takes. A larger buffer hides more and takes longer. Any
    /// size is right for a picture of any size.
    pub fn occlusion(width: usize, height: usize) -> Self {
        let side = |side: usize| side.clamp(visibility_hzb::MIN_SIDE, visibility_hzb::MAX_SIDE);
        let buffer = Hzb::new(side(width), side(height)).unwrap_or_default();
        Self::frustum().with(HzbCuller::new(buffer))
    }

    /// Culls by a pipeline of the caller's. To cull by portals, for example, put a `PortalCuller` of
    /// `visibility-portals` behind a frustum culler. Its accuracy is up to its cullers.
    pub fn new(pipeline: Pipeline) -> Self {
        Self { pipeline, visible: VisibleSet::new() }
    }

    /// Appends a culler as the last stage.
    pub fn with(mut self, culler: impl Culler + Send + Sync + 'static) -> Self {
        self.pipeline = self.pipeline.with(culler);
        self
    }

    /// Returns the pipeline: what its stages did in the last frame, and, if it
    /// [explains](Pipeline::set_explaining), why an object is hidden.
    pub fn pipeline(&self) -> &Pipeline {
        &self.pipeline
    }

    /// Returns the pipeline, to freeze it or to have it explain.
    pub fn pipeline_mut(&mut self) -> &mut Pipeline {
        &mut self.pipeline
    }

    /// Returns the objects that the cullers left in the last frame. Those out of their `VisibilityRange` are
    /// still among them.
    pub fn visible(&self) -> &VisibleSet {
        &self.visible
    }

    /// Iterates over the entities that the camera culled in the last frame, each with the name of the culler
    /// that did. Nothing unless the pipeline [explained](Pipeline::set_explaining) in that frame.
    pub fn culled<'a>(&'a self, scene: &'a VisibilityScene) -> impl Iterator<Item = (Entity, &'a str)> {
        scene.scene().ids().filter_map(|id| match self.pipeline.explain(id) {
            Explanation::RemovedBy(culler) => Some((scene.record(id).entity, culler)),
            _ => None,
        })
    }
}

/// What views ask about some entities one by one.
pub(crate) struct Exceptions<'a, 'w, 's> {
    pub(crate) ranges: Option<&'a VisibleEntityRanges>,
    pub(crate) layers: &'a Query<'w, 's, &'static RenderLayers>,
}

impl Exceptions<'_, '_, '_> {
    /// Returns whether a view that found an object by box and layer mask shows the entity. `range_view` is
    /// the view that visibility ranges are measured from.
    #[inline]
    pub(crate) fn show(
        &self,
        record: &Record,
        range_view: Option<Entity>,
        view_layers: Option<&RenderLayers>,
    ) -> bool {
        if !record.has_range && !record.has_other_layers {
            return true;
        }
        let in_range = |ranges: &VisibleEntityRanges| {
            range_view.is_some_and(|view| ranges.entity_is_in_range_of_view(record.entity, view))
        };
        let is_on_layers =
            |layers: &RenderLayers| view_layers.unwrap_or(&RenderLayers::layer(0)).intersects(layers);
        (!record.has_range || self.ranges.is_none_or(in_range))
            && (!record.has_other_layers || self.layers.get(record.entity).is_ok_and(is_on_layers))
    }
}

/// Memory of culling, kept from frame to frame.
pub(crate) struct Scratch {
    /// Visible entities, by class index.
    classes: Vec<EntitySorter>,
    /// Visible entities of no class.
    unclassed: EntitySorter,
    list: Vec<Entity>,
    /// For cameras that do not cull.
    everything: CullingPipeline,
    /// For cameras without a pipeline of their own. Remembers nothing, so that all can share it.
    frustum: CullingPipeline,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            classes: Vec::new(),
            unclassed: EntitySorter::default(),
            list: Vec::new(),
            everything: CullingPipeline::new(Pipeline::new()),
            frustum: CullingPipeline::frustum(),
        }
    }
}

/// Culls for each active camera: fills its lists of visible entities, and marks these as visible.
pub(crate) fn cull_cameras(
    mirror: Res<VisibilityScene>,
    mut scratch: Local<Scratch>,
    mut cameras: Query<(
        Entity,
        &Camera,
        &GlobalTransform,
        Option<&Projection>,
        Option<&RenderLayers>,
        Has<NoCpuCulling>,
        Option<&mut CullingPipeline>,
        &mut VisibleEntities,
    )>,
    mut results: Query<&mut ViewVisibility>,
    ranges: Option<Res<VisibleEntityRanges>>,
    layers: Query<&'static RenderLayers>,
) {
    let Scratch { classes, unclassed, list, everything, frustum } = &mut *scratch;
    let exceptions = Exceptions { ranges: ranges.as_deref(), layers: &layers };
    for (entity, camera, transform, projection, own_layers, culls_nothing, mut own, mut visible) in
        &mut cameras
    {
        if !camera.is_active {
            continue;
        }
        let view = projection.and_then(|projection| camera_view(projection, transform).ok());
        let (culling, view) = match (view, own.as_mut()) {
            (Some(view), Some(own)) if !culls_nothing => (&mut **own, view),
            (Some(view), None) if !culls_nothing => (&mut *frustum, view),
            // Also if the projection is none: then everything on the camera's layers may be in view.
            _ => (&mut *everything, any_view()),
        };
        let view = view.with_layers(layer_mask(own_layers));
        culling.pipeline.cull(mirror.scene(), &view, &mut culling.visible);
        classes.resize_with(mirror.classes().len(), EntitySorter::default);
        for &id in culling.visible.ids() {
            let record = mirror.record(id);
            if !exceptions.show(record, Some(entity), own_layers) {
                continue;
            }
            match mirror.classes_of(record) {
                [] => unclassed.push(record.entity),
                some => some.iter().for_each(|&class| classes[class as usize].push(record.entity)),
            }
        }
        visible.clear_all();
        for (&class, entities) in mirror.classes().iter().zip(classes.iter_mut()) {
            let list = visible.get_mut(class);
            entities.take(list);
            mark_visible(&mut results, list);
        }
        unclassed.take(list);
        mark_visible(&mut results, list);
    }
}

/// Marks entities as visible in some view.
pub(crate) fn mark_visible(results: &mut Query<&mut ViewVisibility>, entities: &[Entity]) {
    let mut results = results.iter_many_mut(entities).matched();
    while let Some(mut result) = results.fetch_next() {
        result.set_visible();
    }
}
