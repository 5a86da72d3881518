//! Updates the mirror scene from bevy's change detection. The work is proportional to the changes, plus a
//! scan of the change ticks of all entities.

use crate::camera_view::{affine, world_box};
use crate::mirror::{Described, Followed, VisibilityScene};
use crate::occluder::{Occluder, can_occlude};
use bevy_asset::{AssetEvent, AssetId, Assets};
use bevy_camera::primitives::{Aabb as BevyAabb, Sphere};
use bevy_camera::visibility::{
    InheritedVisibility, NoCpuCulling, NoFrustumCulling, RenderLayers, ViewVisibility, VisibilityClass,
    VisibilityRange,
};
use bevy_ecs::archetype::Archetypes;
use bevy_ecs::change_detection::{ContiguousRef, Tick};
use bevy_ecs::component::ComponentId;
use bevy_ecs::entity::Entities;
use bevy_ecs::entity_disabling::DefaultQueryFilters;
use bevy_ecs::lifecycle::RemovedComponents;
use bevy_ecs::prelude::*;
use bevy_ecs::system::SystemParam;
use bevy_light::{DirectionalLight, NotShadowCaster, RectLight};
use bevy_mesh::morph::MeshMorphWeights;
use bevy_mesh::skinning::SkinnedMesh;
use bevy_mesh::{Mesh, Mesh3d};
use bevy_transform::components::GlobalTransform;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use visibility_core::glam::Affine3A;
use visibility_core::{Aabb, ObjectId};

/// Maximum number of hierarchy nodes that a frame tightens, at about a microsecond each.
const MAINTENANCE_BUDGET: usize = 32;
/// Number of table rows whose change ticks are scanned together.
const ROWS: usize = 128;

/// Readers of removed components that the scene depends on.
#[derive(SystemParam)]
pub(crate) struct Removals<'w, 's> {
    /// Components that every followed entity has. If one was removed, the entity may be gone too.
    required: (
        RemovedComponents<'w, 's, InheritedVisibility>,
        RemovedComponents<'w, 's, ViewVisibility>,
        RemovedComponents<'w, 's, GlobalTransform>,
    ),
    optional: (
        RemovedComponents<'w, 's, BevyAabb>,
        RemovedComponents<'w, 's, Sphere>,
        RemovedComponents<'w, 's, RenderLayers>,
        RemovedComponents<'w, 's, VisibilityClass>,
        RemovedComponents<'w, 's, Mesh3d>,
        RemovedComponents<'w, 's, Occluder>,
        RemovedComponents<'w, 's, NoFrustumCulling>,
        RemovedComponents<'w, 's, VisibilityRange>,
        RemovedComponents<'w, 's, SkinnedMesh>,
        RemovedComponents<'w, 's, MeshMorphWeights>,
        RemovedComponents<'w, 's, NotShadowCaster>,
        RemovedComponents<'w, 's, DirectionalLight>,
        RemovedComponents<'w, 's, RectLight>,
        RemovedComponents<'w, 's, NoCpuCulling>,
    ),
}

impl Removals<'_, '_> {
    fn for_each(&mut self, mut each: impl FnMut(Entity)) {
        let (inherited, view, transform) = &mut self.required;
        inherited.read().for_each(&mut each);
        view.read().for_each(&mut each);
        transform.read().for_each(&mut each);
        let (a, b, c, d, e, f, g, h, i, j, k, l, m, n) = &mut self.optional;
        a.read().for_each(&mut each);
        b.read().for_each(&mut each);
        c.read().for_each(&mut each);
        d.read().for_each(&mut each);
        e.read().for_each(&mut each);
        f.read().for_each(&mut each);
        g.read().for_each(&mut each);
        h.read().for_each(&mut each);
        i.read().for_each(&mut each);
        j.read().for_each(&mut each);
        k.read().for_each(&mut each);
        l.read().for_each(&mut each);
        m.read().for_each(&mut each);
        n.read().for_each(&mut each);
    }
}

/// Entities that were disabled or enabled since the last frame, by [`Disabled`] or by another disabling
/// component of the world. Queries skip disabled entities, so their changes would be missed.
///
/// [`Disabled`]: bevy_ecs::entity_disabling::Disabled
#[derive(Resource, Default)]
pub(crate) struct Toggled {
    entities: Vec<Entity>,
    /// Disabling components that are watched.
    watched: HashSet<ComponentId>,
    /// Whether the last frame began to watch some: what was disabled since then may have been missed.
    is_new: bool,
}

impl Toggled {
    /// Adds observers for disabling components of the world that are not watched yet. Returns whether
    /// entities may have been disabled or enabled unseen.
    fn watch(&mut self, filters: &DefaultQueryFilters, commands: &mut Commands) -> bool {
        let was_new = std::mem::take(&mut self.is_new);
        for id in filters.disabling_ids() {
            if !self.watched.insert(id) {
                continue;
            }
            self.is_new = true;
            let added =
                |event: On<Add<()>>, mut toggled: ResMut<Toggled>| toggled.entities.push(event.entity);
            let removed =
                |event: On<Remove<()>>, mut toggled: ResMut<Toggled>| toggled.entities.push(event.entity);
            commands.spawn(Observer::new(added).with_component(id));
            commands.spawn(Observer::new(removed).with_component(id));
        }
        was_new || self.is_new
    }

    /// Returns whether an entity is disabled. Queries that were made before a disabling component was
    /// registered, as those of this schedule may be, do not leave out its entities.
    fn is_disabled(&self, entity: Entity, entities: &Entities, archetypes: &Archetypes) -> bool {
        let Ok(Some(location)) = entities.get(entity) else { return true };
        let archetype = archetypes.get(location.archetype_id);
        archetype.is_none_or(|archetype| self.watched.iter().any(|&id| archetype.contains(id)))
    }
}

/// Rare components whose addition affects the scene.
type Arrived = Or<(
    Added<NoCpuCulling>,
    Added<NoFrustumCulling>,
    Added<VisibilityRange>,
    Added<NotShadowCaster>,
    Added<DirectionalLight>,
    Added<RectLight>,
    Added<SkinnedMesh>,
    Added<MeshMorphWeights>,
    Changed<Occluder>,
    Changed<Sphere>,
)>;

/// Components of most entities, whose change ticks are read as slices.
type Common<'a> = (
    Entity,
    Ref<'a, GlobalTransform>,
    Ref<'a, InheritedVisibility>,
    Ref<'a, ViewVisibility>,
    Option<Ref<'a, BevyAabb>>,
    Option<Ref<'a, RenderLayers>>,
    Option<Ref<'a, VisibilityClass>>,
    Has<Occluder>,
);

/// Lists that each sync fills and empties. Kept to reuse their memory.
#[derive(Default)]
pub(crate) struct Lists {
    touched: Vec<Entity>,
    moved: Vec<(ObjectId, Aabb)>,
    moved_occluders: Vec<(ObjectId, Affine3A)>,
    /// Mesh assets that have changed, and whether they are gone.
    changed_meshes: HashMap<AssetId<Mesh>, bool>,
}

impl Lists {
    /// Lists an entity whose transform or `Aabb` has changed. `is_reshaped` tells that the `Aabb` changed.
    #[inline]
    fn push_moved(
        &mut self,
        mirror: &VisibilityScene,
        entity: Entity,
        transform: &GlobalTransform,
        aabb: Option<&BevyAabb>,
        occludes: bool,
        is_reshaped: bool,
    ) {
        let transform = transform.affine();
        if !occludes && let (Some(id), Some(aabb)) = (mirror.boxed_object(entity), aabb) {
            self.moved.push((id, world_box(aabb, &transform)));
            return;
        }
        match mirror.object(entity).map(|id| (id, mirror.record(id))) {
            Some((id, record)) if record.is_occluder && !is_reshaped && can_occlude(&transform) => {
                self.moved_occluders.push((id, affine(&transform)));
            }
            // The entity is new to the scene, or must be described again.
            _ => self.touched.push(entity),
        }
    }
}

/// Updates the scene from the entities.
pub(crate) fn sync_scene(
    mut mirror: ResMut<VisibilityScene>,
    mut lists: Local<Lists>,
    mut removals: Removals,
    mut toggled: ResMut<Toggled>,
    arrived: Query<Entity, Arrived>,
    common: Query<Common, Followed>,
    meshed_occluders: Query<Entity, (Changed<Mesh3d>, With<Occluder>)>,
    mut mesh_events: MessageReader<AssetEvent<Mesh>>,
    occluders: Query<(Entity, &Mesh3d), With<Occluder>>,
    described: Query<Described, Followed>,
    every: Query<Entity, Followed>,
    meshes: Res<Assets<Mesh>>,
    disabling: Option<Res<DefaultQueryFilters>>,
    mut commands: Commands,
    (entities, archetypes): (&Entities, &Archetypes),
) {
    let (mirror, lists) = (&mut *mirror, &mut *lists);
    removals.for_each(|entity| lists.touched.push(entity));
    if disabling.is_some_and(|disabling| toggled.watch(&disabling, &mut commands)) {
        let is_disabled = |entity: &Entity| toggled.is_disabled(*entity, entities, archetypes);
        lists.touched.extend(mirror.entities().filter(is_disabled));
        lists.touched.extend(every.iter().filter(|&entity| mirror.object(entity).is_none()));
    }
    lists.touched.append(&mut toggled.entities);
    lists.touched.extend(&arrived);
    lists.touched.extend(&meshed_occluders);
    for event in mesh_events.read() {
        let (AssetEvent::Added { id } | AssetEvent::Modified { id } | AssetEvent::Removed { id }) = event
        else {
            continue;
        };
        mirror.forget_mesh(*id);
        lists.changed_meshes.insert(*id, matches!(event, AssetEvent::Removed { .. }));
    }
    if !lists.changed_meshes.is_empty() {
        for (entity, mesh) in &occluders {
            if let Some(&is_removed) = lists.changed_meshes.get(&mesh.id()) {
                lists.touched.push(entity);
                mirror.set_mesh_removed(mesh.id(), is_removed);
            }
        }
        lists.changed_meshes.clear();
    }
    find_common_changes(mirror, &common, lists);
    // The listed objects are in the scene and have local bounds where needed, so these calls cannot fail.
    let _ = mirror.scene.set_bounds_batch(&lists.moved);
    let _ = mirror.scene.set_transforms_batch(&lists.moved_occluders);
    lists.touched.sort_unstable();
    lists.touched.dedup();
    for entity in lists.touched.drain(..) {
        match described.get(entity) {
            Ok(item) if !toggled.is_disabled(entity, entities, archetypes) => mirror.describe(item, &meshes),
            _ => mirror.remove(entity),
        }
    }
    mirror.insert_fresh();
    mirror.scene.maintain(MAINTENANCE_BUDGET);
    lists.moved.clear();
    lists.moved_occluders.clear();
}

/// Change ticks of a component's column, and the ticks to compare them with.
#[derive(Clone, Copy)]
struct Ticks<'a> {
    /// Change tick of each row of the table. Empty if the table lacks the component.
    ticks: &'a [Tick],
    last_run: Tick,
    this_run: Tick,
}

impl<'a> Ticks<'a> {
    fn changed<T>(column: &ContiguousRef<'a, T>) -> Self {
        let (last_run, this_run) = (column.last_run_tick(), column.this_run_tick());
        Self { ticks: column.changed_ticks_slice(), last_run, this_run }
    }

    fn added<T>(column: &ContiguousRef<'a, T>) -> Self {
        Self { ticks: column.added_ticks_slice(), ..Self::changed(column) }
    }

    /// Returns the number of rows in a range that changed since the last run. Compiles to vector
    /// instructions.
    fn count(&self, rows: Range<usize>) -> usize {
        let rows = self.ticks.get(rows).unwrap_or(&[]);
        rows.iter().filter(|tick| tick.is_newer_than(self.last_run, self.this_run)).count()
    }

    fn is_new(&self, row: usize) -> bool {
        self.ticks.get(row).is_some_and(|tick| tick.is_newer_than(self.last_run, self.this_run))
    }
}

/// Finds the entities with a changed common component. Entities that only moved are listed with their new
/// transform, all others in `touched`.
fn find_common_changes(mirror: &VisibilityScene, common: &Query<Common, Followed>, lists: &mut Lists) {
    let Ok(tables) = common.contiguous_iter() else {
        // Table columns cannot be used if a disabling component of the world is stored in sparse sets.
        return find_by_rows(mirror, common, lists);
    };
    for (entities, transforms, inherited, results, aabbs, layers, classes, occludes) in tables {
        let nothing = Ticks { ticks: &[], ..Ticks::changed(&transforms) };
        let boxed = aabbs.as_ref().map_or(nothing, Ticks::changed);
        let moves = Ticks::changed(&transforms);
        let others = [
            Ticks::changed(&inherited),
            Ticks::added(&results),
            layers.as_ref().map_or(nothing, Ticks::changed),
            classes.as_ref().map_or(nothing, Ticks::changed),
        ];
        for start in (0..entities.len()).step_by(ROWS) {
            let rows = start..entities.len().min(start + ROWS);
            if others.iter().any(|ticks| ticks.count(rows.clone()) > 0) {
                let changed = |&row: &usize| others.iter().any(|ticks| ticks.is_new(row));
                lists.touched.extend(rows.clone().filter(changed).map(|row| entities[row]));
            }
            let (moved, reshaped) = (moves.count(rows.clone()), boxed.count(rows.clone()));
            if moved + reshaped == 0 {
                continue;
            }
            let all_moved = moved == rows.len();
            for row in rows {
                let is_reshaped = reshaped > 0 && boxed.is_new(row);
                if !all_moved && !is_reshaped && !moves.is_new(row) {
                    continue;
                }
                let aabb = aabbs.as_ref().map(|aabbs| &aabbs[row]);
                lists.push_moved(mirror, entities[row], &transforms[row], aabb, occludes, is_reshaped);
            }
        }
    }
}

/// Finds the same changes as [`find_common_changes`], entity by entity.
fn find_by_rows(mirror: &VisibilityScene, common: &Query<Common, Followed>, lists: &mut Lists) {
    for (entity, transform, inherited, result, aabb, layers, classes, occludes) in common {
        if inherited.is_changed()
            || result.is_added()
            || layers.is_some_and(|layers| layers.is_changed())
            || classes.is_some_and(|classes| classes.is_changed())
        {
            lists.touched.push(entity);
        }
        let is_reshaped = aabb.as_ref().is_some_and(|aabb| aabb.is_changed());
        if is_reshaped || transform.is_changed() {
            lists.push_moved(mirror, entity, &transform, aabb.as_deref(), occludes, is_reshaped);
        }
    }
}
