//! Frustum and occlusion culling for cameras.

use crate::camera_view::{any_view, camera_view, draws_nearest_fronts, layer_mask};
use crate::entity_lists::EntitySorter;
use crate::mirror::{ASK, Record, VisibilityScene};
use bevy_camera::visibility::{
    NoCpuCulling, RenderLayers, SetViewVisibility, ViewVisibility, VisibleEntities, VisibleEntityRanges,
};
use bevy_camera::{Camera, Camera3d, Projection};
use bevy_ecs::prelude::*;
use bevy_transform::components::GlobalTransform;
use visibility_core::culler::Lack;
use visibility_core::jobs::Jobs;
use visibility_core::pipeline::Explanation;
use visibility_core::view::ViewRegion;
use visibility_core::{Accuracy, CullStats, Culler, FrustumCuller, Pipeline, Scene, View, VisibleSet};
use visibility_hzb::{Hzb, HzbCuller};

/// The cullers of a camera. Every `Camera3d` is given one that culls by frustum and by occlusion. Insert
/// another to choose:
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
///
/// It does not run while the camera has no `Camera3d`, since such a camera draws no `Mesh3d`, nor while it
/// draws the backs of meshes, being mirrored or having `invert_culling` but not both, nor while the eye is
/// beyond the near plane. Then the frustum alone culls.
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
    /// Culls only by the camera's frustum.
    pub fn frustum() -> Self {
        Self::new(Pipeline::new().with(FrustumCuller::new()))
    }

    /// Culls by the frustum, and by [occluders](crate::Occluder) drawn into a z-buffer of `width` by `height`
    /// pixels, clamped to the sizes that [`Hzb::new`] accepts. A larger buffer hides more and takes longer.
    /// The size need not match the picture.
    pub fn occlusion(width: usize, height: usize) -> Self {
        let side = |side: usize| side.clamp(visibility_hzb::MIN_SIDE, visibility_hzb::MAX_SIDE);
        let buffer = Hzb::new(side(width), side(height)).unwrap_or_default();
        Self::frustum().with(WhereOccluders(HzbCuller::new(buffer)))
    }

    /// Culls by a given pipeline. To cull by portals, for example, put a `PortalCuller` of
    /// `visibility-portals` behind a frustum culler. The accuracy is that of the pipeline's cullers.
    pub fn new(pipeline: Pipeline) -> Self {
        Self { pipeline, visible: VisibleSet::new() }
    }

    /// Appends a culler as the last stage.
    pub fn with(mut self, culler: impl Culler + Send + Sync + 'static) -> Self {
        self.pipeline = self.pipeline.with(culler);
        self
    }

    /// Returns the pipeline, with the statistics of its stages in the last frame, and, if it
    /// [explains](Pipeline::set_explaining), the reason why an object is hidden.
    pub fn pipeline(&self) -> &Pipeline {
        &self.pipeline
    }

    /// Returns the pipeline mutably, to freeze it or to make it explain.
    pub fn pipeline_mut(&mut self) -> &mut Pipeline {
        &mut self.pipeline
    }

    /// Returns the objects that the cullers left visible in the last frame. Includes objects out of their
    /// `VisibilityRange`.
    pub fn visible(&self) -> &VisibleSet {
        &self.visible
    }

    /// Iterates over the entities that the camera culled in the last frame, each with the name of its culler.
    /// Empty unless the pipeline [explained](Pipeline::set_explaining) in that frame.
    pub fn culled<'a>(&'a self, scene: &'a VisibilityScene) -> impl Iterator<Item = (Entity, &'a str)> {
        scene.scene().ids().filter_map(|id| match self.pipeline.explain(id) {
            Explanation::RemovedBy(culler) => Some((scene.record(id).entity, culler)),
            _ => None,
        })
    }
}

/// Occlusion culler that does nothing, at no cost, if the scene has no occluders.
struct WhereOccluders(HzbCuller);

impl Culler for WhereOccluders {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn accuracy(&self) -> Accuracy {
        self.0.accuracy()
    }

    fn hides_behind_undrawn(&self) -> bool {
        self.0.hides_behind_undrawn()
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        if scene.occluder_count() > 0 {
            return self.0.cull(scene, view, visible);
        }
        CullStats::default().with_visible(visible.count(scene) as u64)
    }

    fn cull_region(
        &mut self,
        jobs: Option<&dyn Jobs>,
        scene: &Scene,
        region: &ViewRegion,
        visible: &mut VisibleSet,
    ) -> Option<CullStats> {
        if scene.occluder_count() > 0 {
            return self.0.cull_region(jobs, scene, region, visible);
        }
        Some(CullStats::default().with_visible(visible.count(scene) as u64))
    }

    fn answer_holds(&self) -> bool {
        self.0.answer_holds()
    }

    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        self.0.for_each_lack(scene, each);
    }

    fn hides_behind_objects(&self) -> bool {
        self.0.hides_behind_objects()
    }

    fn draws_other_view(&mut self) {
        self.0.draws_other_view();
    }

    fn reset(&mut self) {
        self.0.reset();
    }
}

/// Components that a view must check for each single entity of some kinds.
pub(crate) struct Exceptions<'a, 'w, 's> {
    pub(crate) ranges: Option<&'a VisibleEntityRanges>,
    pub(crate) layers: &'a Query<'w, 's, &'static RenderLayers>,
}

impl Exceptions<'_, '_, '_> {
    /// Returns whether a view shows an entity whose bounds and layer mask it has found in view. `range_view`
    /// is the view from which visibility ranges are measured.
    #[inline]
    pub(crate) fn show(
        &self,
        record: &Record,
        range_view: Option<Entity>,
        view_layers: Option<&RenderLayers>,
    ) -> bool {
        if !record.must_be_asked() {
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

/// Memory for culling, reused from frame to frame.
pub(crate) struct Scratch {
    /// Visible entities, by class index.
    classes: Vec<EntitySorter>,
    /// Visible entities without a class.
    unclassed: EntitySorter,
    list: Vec<Entity>,
    marks: Marks,
    /// Pipeline of cameras that do not cull: it keeps all entities.
    everything: CullingPipeline,
    /// Pipeline of the cameras without one of their own, and of those whose own may not be used. It remembers
    /// nothing, so all of them can share it.
    frustum: CullingPipeline,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            classes: Vec::new(),
            unclassed: EntitySorter::default(),
            list: Vec::new(),
            marks: Marks::default(),
            everything: CullingPipeline::new(Pipeline::new()),
            frustum: CullingPipeline::frustum(),
        }
    }
}

/// Culls for each active camera: fills its lists of visible entities, and marks these entities as visible.
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
        Has<Camera3d>,
        Option<&mut CullingPipeline>,
        &mut VisibleEntities,
    )>,
    mut results: Query<(Entity, &mut ViewVisibility)>,
    ranges: Option<Res<VisibleEntityRanges>>,
    layers: Query<&'static RenderLayers>,
) {
    let Scratch { classes, unclassed, list, marks, everything, frustum } = &mut *scratch;
    let exceptions = Exceptions { ranges: ranges.as_deref(), layers: &layers };
    for (entity, camera, transform, projection, own_layers, culls_nothing, is_3d, mut own, mut visible) in
        &mut cameras
    {
        if !camera.is_active {
            continue;
        }
        let view = projection.and_then(|projection| camera_view(camera, projection, transform).ok());
        let (culling, view) = match (view, own.as_mut()) {
            (Some(view), Some(own)) if !culls_nothing && is_3d && draws_nearest_fronts(camera, &view) => {
                (&mut **own, view)
            }
            (Some(view), _) if !culls_nothing => (&mut *frustum, view),
            // Also if the projection is none: then everything on the camera's layers may be in view.
            _ => (&mut *everything, any_view()),
        };
        let view = view.with_layers(layer_mask(own_layers));
        culling.pipeline.cull(mirror.scene(), &view, &mut culling.visible);
        // Records and entities are read fastest in memory order.
        culling.visible.sort_by_index(mirror.scene());
        classes.resize_with(mirror.classes().len(), EntitySorter::default);
        for &id in culling.visible.ids(mirror.scene()) {
            let index = mirror.plain(id);
            if index != ASK {
                classes[0].push_first(index);
                continue;
            }
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
            marks.add(list);
        }
        unclassed.take(list);
        marks.add(list);
    }
    marks.apply(mirror.scene().len(), &mut results);
}

/// Entities that some view found visible.
#[derive(Default)]
struct Marks {
    /// One bit per entity index.
    bits: Vec<u64>,
    entities: Vec<Entity>,
}

impl Marks {
    fn add(&mut self, entities: &[Entity]) {
        self.entities.extend_from_slice(entities);
    }

    /// Marks the collected entities as visible, and clears the collection. `count` is the approximate number
    /// of entities in the world.
    fn apply(&mut self, count: usize, results: &mut Query<(Entity, &mut ViewVisibility)>) {
        // Looking up one entity takes as long as iterating over about 12.
        if self.entities.len() < count / 12 {
            let mut results = results.iter_many_mut(&self.entities).matched();
            while let Some((_, mut result)) = results.fetch_next() {
                result.set_visible();
            }
        } else {
            let last = self.entities.iter().map(|entity| entity.index_u32()).max().unwrap_or(0);
            self.bits.clear();
            self.bits.resize(last as usize / 64 + 1, 0);
            for entity in &self.entities {
                self.bits[entity.index_u32() as usize / 64] |= 1 << (entity.index_u32() % 64);
            }
            for (entity, mut result) in results.iter_mut() {
                let (word, bit) = (entity.index_u32() as usize / 64, entity.index_u32() % 64);
                if self.bits.get(word).is_some_and(|word| word >> bit & 1 != 0) {
                    result.set_visible();
                }
            }
        }
        self.entities.clear();
    }
}
