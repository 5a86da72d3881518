//! The scene of `visibility-core` that mirrors the entities of a bevy world.

use crate::camera_view::{OTHER_LAYERS, affine, layer_mask, local_box, solid_box, world_box};
use crate::occluder::{Occluder, can_occlude, occluder_of_mesh};
use bevy_asset::{AssetId, Assets};
use bevy_camera::primitives::{Aabb as BevyAabb, Sphere};
use bevy_camera::visibility::{
    InheritedVisibility, NoCpuCulling, NoFrustumCulling, RenderLayers, ViewVisibility, VisibilityClass,
    VisibilityRange,
};
use bevy_ecs::entity::EntityGeneration;
use bevy_ecs::prelude::*;
use bevy_ecs::query::QueryData;
use bevy_light::{DirectionalLight, NotShadowCaster, RectLight};
use bevy_math::Affine3A;
use bevy_mesh::morph::MeshMorphWeights;
use bevy_mesh::skinning::SkinnedMesh;
use bevy_mesh::{Mesh, Mesh3d};
use bevy_transform::components::GlobalTransform;
use std::any::TypeId;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use visibility_core::glam::Vec3;
use visibility_core::scene::MeshId;
use visibility_core::{Aabb, Object, ObjectId, OccluderMesh, Scene};

/// Components of an entity that determine its object in the scene.
#[derive(QueryData)]
pub(crate) struct Described {
    entity: Entity,
    inherited: &'static InheritedVisibility,
    transform: &'static GlobalTransform,
    aabb: Option<&'static BevyAabb>,
    sphere: Option<&'static Sphere>,
    layers: Option<&'static RenderLayers>,
    classes: Option<&'static VisibilityClass>,
    mesh: Option<&'static Mesh3d>,
    occluder: Option<&'static Occluder>,
    never_cull: Has<NoFrustumCulling>,
    range: Has<VisibilityRange>,
    skinned: Has<SkinnedMesh>,
    morphed: Has<MeshMorphWeights>,
    casts_no_shadow: Has<NotShadowCaster>,
    directional_light: Has<DirectionalLight>,
    area_light: Has<RectLight>,
}

impl DescribedItem<'_, '_> {
    /// Returns whether the entity is in view wherever it is. The sun shines everywhere, and bevy gives an
    /// area light no bounds: those of its mesh are not those of its light.
    fn is_never_culled(&self) -> bool {
        self.never_cull || self.directional_light || self.area_light
    }
}

/// Filter for the entities that the scene follows: those that bevy culls on the CPU.
pub(crate) type Followed = (With<ViewVisibility>, Without<NoCpuCulling>);

/// Properties of an entity that culling needs besides its object in the scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Record {
    pub(crate) entity: Entity,
    /// Index into `VisibilityScene::class_lists`.
    pub(crate) classes: u16,
    /// Whether the entity has a `VisibilityRange`. Each view then compares its own distance with the range.
    pub(crate) has_range: bool,
    /// Whether the entity is on a layer above 30. Its `RenderLayers` must then be compared, since masks do
    /// not tell these layers apart.
    pub(crate) has_other_layers: bool,
    pub(crate) casts_shadow: bool,
    /// Whether the object has a transform in the scene, which positions its occluder mesh.
    pub(crate) is_occluder: bool,
    /// Whether the object's bounds are computed from the transform and the entity's `Aabb`.
    pub(crate) has_box: bool,
}

impl Record {
    const NONE: Self = Self {
        entity: Entity::PLACEHOLDER,
        classes: 0,
        has_range: false,
        has_other_layers: false,
        casts_shadow: false,
        is_occluder: false,
        has_box: false,
    };

    /// Returns whether views that find the object by its bounds and layer mask may not show the entity.
    pub(crate) fn must_be_asked(&self) -> bool {
        self.has_range || self.has_other_layers
    }
}

/// Mirror of all entities that bevy culls on the CPU: a [`Scene`] with one object per entity.
///
/// A game can also query the [`scene`](Self::scene) with
/// [`SceneQuery`](visibility_frame::queries::SceneQuery): objects along a ray, in a sphere, nearest to a
/// point.
#[derive(Resource)]
pub struct VisibilityScene {
    pub(crate) scene: Scene,
    /// Object of each entity, by entity index.
    objects: Vec<EntityObject>,
    /// Record of each object's entity, by object index.
    records: Vec<Record>,
    /// For each object, by its index: the entity index if the entity is plain, else [`ASK`]. A plain entity
    /// is of the first generation, has `Mesh3d` as its only class, and is visible in any view that finds its
    /// bounds and layer mask. Most entities are plain, and this list is a quarter of the size of `records`.
    plain: Vec<u32>,
    /// All visibility classes in the world. The first is `Mesh3d`.
    classes: Vec<TypeId>,
    /// Distinct lists of classes of entities, as indices into `classes`. The first list is `Mesh3d` only.
    class_lists: Vec<Vec<u16>>,
    meshes: HashMap<AssetId<Mesh>, Option<MeshId>>,
    /// Mesh assets that are gone, and that entities with an occluder have.
    removed_meshes: HashSet<AssetId<Mesh>>,
    custom_meshes: HashMap<usize, (Arc<OccluderMesh>, MeshId)>,
    /// Occluder meshes of boxes, by the bits of the box's corners.
    box_meshes: HashMap<[u32; 6], MeshId>,
    /// Number of meshes in the scene above which unused meshes are removed.
    mesh_limit: usize,
    /// New entities to be inserted together, with their objects.
    fresh: Vec<(Fresh, Object)>,
}

/// Number of meshes in the scene up to which unused meshes stay in memory.
const FEWEST_MESHES: usize = 64;

/// Value in `VisibilityScene::plain` for an object whose record must be read.
pub(crate) const ASK: u32 = u32::MAX;

impl Default for VisibilityScene {
    fn default() -> Self {
        Self {
            scene: Scene::new(),
            objects: Vec::new(),
            records: Vec::new(),
            plain: Vec::new(),
            classes: vec![TypeId::of::<Mesh3d>()],
            class_lists: vec![vec![0]],
            meshes: HashMap::new(),
            removed_meshes: HashSet::new(),
            custom_meshes: HashMap::new(),
            box_meshes: HashMap::new(),
            mesh_limit: FEWEST_MESHES,
            fresh: Vec::new(),
        }
    }
}

/// Object of the present entity with an entity index.
#[derive(Clone, Copy)]
struct EntityObject {
    /// Id of the object; [`ObjectId::PLACEHOLDER`] if the scene follows no entity with this index.
    id: ObjectId,
    generation: EntityGeneration,
    /// Whether a move of the entity only changes the object's bounds: they are computed from the `Aabb`, and
    /// the entity is no occluder.
    is_boxed: bool,
}

impl EntityObject {
    const NONE: Self =
        Self { id: ObjectId::PLACEHOLDER, generation: EntityGeneration::FIRST, is_boxed: false };
}

struct Fresh {
    record: Record,
    occluder: Option<PlacedOccluder>,
}

/// Occluder mesh of an entity, with the entity's local box and transform.
#[derive(Clone, Copy)]
struct PlacedOccluder {
    mesh: MeshId,
    local: Aabb,
    transform: Affine3A,
}

impl VisibilityScene {
    /// Returns the scene, with the boxes, layers and occluders of all entities.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Returns the object of an entity. `None` if the scene does not follow the entity: it was spawned after
    /// the last [sync](crate::CullingSystems::Sync), lacks `GlobalTransform` or `Visibility`, has
    /// `NoCpuCulling`, or is disabled.
    #[inline]
    pub fn object(&self, entity: Entity) -> Option<ObjectId> {
        let object = self.objects.get(entity.index_u32() as usize)?;
        let is_own = object.generation == entity.generation() && object.id != ObjectId::PLACEHOLDER;
        is_own.then_some(object.id)
    }

    /// Returns the object of an entity if a move only changes the object's bounds, else `None`.
    #[inline]
    pub(crate) fn boxed_object(&self, entity: Entity) -> Option<ObjectId> {
        let object = self.objects.get(entity.index_u32() as usize)?;
        (object.is_boxed && object.generation == entity.generation()).then_some(object.id)
    }

    /// Iterates over all entities that the scene follows.
    pub(crate) fn entities(&self) -> impl Iterator<Item = Entity> {
        self.scene.ids().map(|id| self.record(id).entity)
    }

    /// Returns the entity of an object, or `None` for an object that is not in the scene.
    pub fn entity(&self, id: ObjectId) -> Option<Entity> {
        self.scene.contains(id).then(|| self.records[id.index()].entity)
    }

    /// Returns the record of an object, which must be in the scene.
    #[inline]
    pub(crate) fn record(&self, id: ObjectId) -> &Record {
        &self.records[id.index()]
    }

    /// Returns whether the bounds of an object touch a sphere. True if rounding leaves this undecided.
    pub(crate) fn is_touched(&self, id: ObjectId, sphere: &Sphere) -> bool {
        let Ok(bounds) = self.scene.bounds(id) else { return false };
        if !bounds.is_proper() {
            return true;
        }
        let center = Vec3::from_array(sphere.center.to_array());
        let nearest = center.clamp(bounds.min, bounds.max);
        // Relative rounding errors, in units of epsilon: half for each coordinate of the difference, less
        // than four for the square of its length, and one for the square of the radius.
        let is_apart =
            nearest.distance_squared(center) > sphere.radius * sphere.radius * (1.0 + 8.0 * f32::EPSILON);
        !is_apart
    }

    /// Returns the entity index of a plain object of class `Mesh3d`. [`ASK`] if the record must be read.
    #[inline]
    pub(crate) fn plain(&self, id: ObjectId) -> u32 {
        self.plain[id.index()]
    }

    fn set_record(&mut self, id: ObjectId, record: Record) {
        let is_first = record.entity.generation() == EntityGeneration::FIRST;
        let is_plain = is_first && record.classes == 0 && !record.must_be_asked();
        let (generation, is_boxed) = (record.entity.generation(), record.has_box && !record.is_occluder);
        self.objects[record.entity.index_u32() as usize] = EntityObject { id, generation, is_boxed };
        self.plain[id.index()] = if is_plain { record.entity.index_u32() } else { ASK };
        self.records[id.index()] = record;
    }

    /// Returns all visibility classes in the world, to which records and lists refer by index.
    pub(crate) fn classes(&self) -> &[TypeId] {
        &self.classes
    }

    /// Returns the classes of a record, as indices into [`classes`](Self::classes).
    #[inline]
    pub(crate) fn classes_of(&self, record: &Record) -> &[u16] {
        &self.class_lists[record.classes as usize]
    }

    /// Removes an entity. Does nothing if the scene does not follow it.
    pub(crate) fn remove(&mut self, entity: Entity) {
        let Some(id) = self.object(entity) else { return };
        // The id is known to be in the scene, so this cannot fail.
        let _ = self.scene.remove(id);
        self.records[id.index()] = Record::NONE;
        self.objects[entity.index_u32() as usize] = EntityObject::NONE;
    }

    /// Forgets the occluder made from a mesh asset, so that the next entity makes it again. The memory is
    /// freed with the last object that uses it.
    pub(crate) fn forget_mesh(&mut self, asset: AssetId<Mesh>) {
        if let Some(mesh) = self.meshes.remove(&asset).flatten() {
            // The mesh is known to be in the scene, so this cannot fail.
            let _ = self.scene.remove_mesh(mesh);
        }
    }

    /// Notes whether a mesh asset is gone that entities have: bevy draws these no more.
    pub(crate) fn set_mesh_removed(&mut self, asset: AssetId<Mesh>, is_removed: bool) {
        if is_removed {
            self.removed_meshes.insert(asset);
        } else {
            self.removed_meshes.remove(&asset);
        }
    }

    /// Removes unused occluder meshes once there are twice as many meshes as after the last removal, so that
    /// changing boxes and assets do not fill the memory.
    fn remove_unused_meshes(&mut self) {
        let Self { scene, meshes, custom_meshes, box_meshes, mesh_limit, .. } = self;
        if scene.mesh_count() <= *mesh_limit {
            return;
        }
        let mut stays = |mesh: MeshId| {
            let is_used = scene.mesh_users(mesh).is_ok_and(|users| users > 0);
            if !is_used {
                let _ = scene.remove_mesh(mesh);
            }
            is_used
        };
        meshes.retain(|_, mesh| mesh.is_none_or(&mut stays));
        custom_meshes.retain(|_, (_, mesh)| stays(*mesh));
        box_meshes.retain(|_, mesh| stays(*mesh));
        *mesh_limit = FEWEST_MESHES.max(2 * scene.mesh_count());
    }

    /// Updates the object of an entity. An entity that is new to the scene is inserted later, by
    /// [`insert_fresh`](Self::insert_fresh).
    pub(crate) fn describe(&mut self, item: DescribedItem, meshes: &Assets<Mesh>) {
        let transform = item.transform.affine();
        let layers = if item.inherited.get() { layer_mask(item.layers) } else { 0 };
        // As bevy does, takes the sphere's centre as a point of the world.
        let reach = |sphere: &Sphere| {
            let [min, max] = [sphere.center - sphere.radius, sphere.center + sphere.radius];
            Aabb::from_arrays(min.to_array(), max.to_array())
        };
        let bounds = match (item.aabb, item.sphere) {
            // Improper bounds: in view wherever that is, and found by every query.
            _ if item.is_never_culled() => Aabb::EMPTY,
            (None, None) => Aabb::EMPTY,
            // bevy draws a mesh without a box into every shadow map.
            (None, Some(_)) if item.mesh.is_some() => Aabb::EMPTY,
            (None, Some(sphere)) => reach(sphere),
            (Some(aabb), sphere) => {
                let of_mesh = world_box(aabb, &transform);
                // The sphere is what the entity shines on, if it is a light too.
                sphere.filter(|_| of_mesh.is_proper()).map_or(of_mesh, |sphere| of_mesh.union(&reach(sphere)))
            }
        };
        let occluder = self.occluder(&item, layers, &transform, meshes);
        let has_bounds = item.aabb.is_some() || item.sphere.is_some() && item.mesh.is_none();
        let never_cull = item.is_never_culled() || !has_bounds;
        let object = Object { layers, never_cull, occluder: occluder.is_some(), ..Object::new(bounds) };
        let record = Record {
            entity: item.entity,
            classes: self.class_list(item.classes),
            has_range: item.range,
            has_other_layers: layers & OTHER_LAYERS != 0,
            casts_shadow: item.mesh.is_some() && !item.casts_no_shadow && !item.directional_light,
            is_occluder: occluder.is_some(),
            has_box: item.aabb.is_some() && item.sphere.is_none() && !item.is_never_culled(),
        };
        match self.object(item.entity) {
            Some(id) => self.update(id, record, &object, occluder),
            None => self.fresh.push((Fresh { record, occluder }, object)),
        }
    }

    fn update(&mut self, id: ObjectId, record: Record, object: &Object, occluder: Option<PlacedOccluder>) {
        let Ok(former) = self.scene.object(id) else { return };
        self.set_record(id, record);
        let scene = &mut self.scene;
        // `id` is in the scene and the transform is finite, so the calls below cannot fail.
        if former.layers != object.layers {
            let _ = scene.set_layers(id, object.layers);
        }
        if former.never_cull != object.never_cull {
            let _ = scene.set_never_cull(id, object.never_cull);
        }
        if former.occluder != object.occluder {
            let _ = scene.set_occluder(id, object.occluder);
        }
        match occluder {
            Some(occluder) => place(scene, id, occluder),
            None => {
                let _ = scene.set_bounds(id, object.bounds);
            }
        }
    }

    /// Inserts all entities that [`describe`](Self::describe) found to be new.
    pub(crate) fn insert_fresh(&mut self) {
        let ids = self.scene.insert_batch(self.fresh.iter().map(|(_, object)| *object));
        self.records.resize(self.scene.index_limit(), Record::NONE);
        self.plain.resize(self.scene.index_limit(), ASK);
        let mut fresh = std::mem::take(&mut self.fresh);
        for (id, (Fresh { record, occluder }, _)) in ids.into_iter().zip(fresh.drain(..)) {
            let index = record.entity.index_u32() as usize;
            if self.objects.len() <= index {
                self.objects.resize(index + 1, EntityObject::NONE);
            }
            self.set_record(id, record);
            if let Some(occluder) = occluder {
                place(&mut self.scene, id, occluder);
            }
        }
        self.fresh = fresh;
        // Only now does each new mesh belong to its object, so that it does not count as unused.
        self.remove_unused_meshes();
    }

    /// Returns the occluder of an entity, `None` if it must not occlude.
    fn occluder(
        &mut self,
        item: &DescribedItem,
        layers: u32,
        transform: &Affine3A,
        meshes: &Assets<Mesh>,
    ) -> Option<PlacedOccluder> {
        let (occluder, aabb) = (item.occluder?, item.aabb?);
        // An occluder must be drawn in every view that finds the object on its layers, and at its position in
        // the scene.
        let is_drawn = layers != 0 && layers & OTHER_LAYERS == 0 && !item.range;
        // The object's bounds must be those of the mesh.
        let is_bounded = item.sphere.is_none() && !item.is_never_culled();
        // Assets whose data is kept for the render world alone stay in `Assets`, without the data.
        let exists = |asset: AssetId<Mesh>| meshes.contains(asset) && !self.removed_meshes.contains(&asset);
        let has_asset = item.mesh.is_none_or(|mesh| exists(mesh.id()));
        if !is_drawn || !is_bounded || !has_asset || item.skinned || item.morphed || !can_occlude(transform) {
            return None;
        }
        let local = local_box(aabb);
        let mesh = match occluder {
            Occluder::Mesh => self.mesh_of_asset(item.mesh?.id(), meshes)?,
            Occluder::Box => self.box_mesh(&solid_box(aabb)?)?,
            Occluder::Custom(mesh) => self.custom_mesh(mesh),
        };
        Some(PlacedOccluder { mesh, local, transform: *transform })
    }

    fn mesh_of_asset(&mut self, asset: AssetId<Mesh>, meshes: &Assets<Mesh>) -> Option<MeshId> {
        if let Some(&known) = self.meshes.get(&asset) {
            return known;
        }
        let mesh = occluder_of_mesh(meshes.get(asset)?).map(|mesh| self.scene.add_mesh(mesh));
        self.meshes.insert(asset, mesh);
        mesh
    }

    fn box_mesh(&mut self, local: &Aabb) -> Option<MeshId> {
        let [min, max] = [local.min, local.max].map(|corner| corner.to_array().map(f32::to_bits));
        let corners = [min[0], min[1], min[2], max[0], max[1], max[2]];
        if let Some(&known) = self.box_meshes.get(&corners) {
            return Some(known);
        }
        let mesh = self.scene.add_mesh(OccluderMesh::cuboid(local).ok()?);
        self.box_meshes.insert(corners, mesh);
        Some(mesh)
    }

    fn custom_mesh(&mut self, mesh: &Arc<OccluderMesh>) -> MeshId {
        // The map keeps the mesh alive, so no other mesh can get its address.
        let address = Arc::as_ptr(mesh) as usize;
        let (_, id) = self
            .custom_meshes
            .entry(address)
            .or_insert_with(|| (mesh.clone(), self.scene.add_mesh(OccluderMesh::clone(mesh))));
        *id
    }

    /// Returns the index in `class_lists` of an entity's list of classes. Adds the list if it is new.
    fn class_list(&mut self, classes: Option<&VisibilityClass>) -> u16 {
        let mut list: Vec<u16> = Vec::new();
        for &class in classes.into_iter().flat_map(|classes| classes.iter()) {
            let known = self.classes.iter().position(|&known| known == class);
            let index = known.unwrap_or(self.classes.len());
            if known.is_none() {
                self.classes.push(class);
            }
            // If a class is mentioned twice, bevy lists the entity twice. Here it is listed once.
            if !list.contains(&(index as u16)) {
                list.push(index as u16);
            }
        }
        let known = self.class_lists.iter().position(|known| *known == list);
        known.unwrap_or_else(|| {
            self.class_lists.push(list);
            self.class_lists.len() - 1
        }) as u16
    }
}

/// Sets the occluder mesh of an object, and its bounds computed from its local box.
fn place(scene: &mut Scene, id: ObjectId, occluder: PlacedOccluder) {
    let transform = affine(&occluder.transform);
    // Object and mesh are in the scene and the transform is finite, so these calls cannot fail.
    let _ = scene.set_local_bounds(id, occluder.local);
    let _ = scene.set_mesh(id, occluder.mesh, transform);
}
