//! Culling by a baked set: a file of the program `bake`, whose objects are entities.

use crate::mirror::VisibilityScene;
use bevy_asset::{AssetEvent, AssetId};
use bevy_camera::primitives::{Aabb as BevyAabb, Sphere};
use bevy_camera::visibility::{RenderLayers, VisibilityRange};
use bevy_ecs::lifecycle::RemovedComponents;
use bevy_ecs::prelude::*;
use bevy_mesh::{Mesh, Mesh3d};
use bevy_transform::components::GlobalTransform;
use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, PoisonError};
use visibility_bake::{BakedSet, BakedSetError};
use visibility_core::culler::Lack;
use visibility_core::glam::DVec3;
use visibility_core::pvs::{PvsCuller, ScenePvs};
use visibility_core::scene::{Changes, SceneCursor};
use visibility_core::{Aabb, Accuracy, CullStats, Culler, ObjectId, Scene, View, VisibleSet};

/// Tolerance for the position of an entity, as a fraction of the greatest absolute coordinate: 4 mm at a
/// kilometre. It covers the rounding of an entity's box by its centre, half extents and parents' transforms.
const PLACE_TOLERANCE: f32 = 1.0 / (1 << 18) as f32;

/// The index, from 0, of an entity among the objects of a [`BakedLevel`]. The objects of a glTF file are the
/// primitives of its meshes, node by node, each node before its children. Several entities that are parts of
/// one object may share its index.
///
/// The entity must be where the object was baked. It counts as visible from everywhere until its `Aabb` is
/// known, and again once its transform, `Aabb` or `Mesh3d` has changed, or it has become a light. Insert the
/// component anew when the entity is back in its place.
#[derive(Component, Clone, Copy, PartialEq, Eq, Debug)]
pub struct BakedObject(pub u32);

/// Resource with the baked set of a level. A camera culls by the set if its
/// [`CullingPipeline`](crate::CullingPipeline) has the set's [culler](Self::culler). Entities with a
/// [`BakedObject`] are hidden if the set says so; all others are visible. An eye outside of the set's
/// viewcells sees everything.
///
/// What hid others in the bake must stay as it was. Nothing is hidden while an occluder of the bake is no
/// longer as it was baked: its entity is gone, has changed, or is no longer its [`BakedObject`], and no other
/// entity, whose box contains that of the lost one, has taken the place. Nothing is hidden either while an
/// occluder of the bake has a [`VisibilityRange`] or is on a layer above 30. The culler is
/// [approximate](Accuracy::Approximate) while no entity of an occluder has been found yet, since nobody knows
/// whether that wall is drawn; spawn all parts of an occluder in one frame.
///
/// A set belongs to one [version](BakedSet::version) of the level. `bake` prints the version, and the game
/// stores it with the level. The culler of a set whose version was not compared is approximate.
///
/// ```
/// use bevy_camera::Camera3d;
/// use visibility_bevy::{BakedLevel, BakedObject, CullingPipeline};
/// # use visibility_core::{glam::DVec3, pvs::{Viewcell, Viewcells}, Aabb, Scene};
/// # let mut scene = Scene::new();
/// # scene.insert(Aabb::from_arrays([5.0; 3], [6.0; 3]));
/// # let cells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
/// # let file = visibility_bake::BakedSet::from_rows(&scene, cells, &[vec![]])?.to_bytes();
/// # let version = visibility_bake::level_version(&scene);
/// # let mut world = bevy_ecs::world::World::new();
/// // The file that `bake` has written, the version that the level carries, and the boxes of its objects.
/// let level = BakedLevel::read(&file, Some(version), [[[5.0; 3], [6.0; 3]]])?;
/// world.spawn((Camera3d::default(), CullingPipeline::frustum().with(level.culler())));
/// world.insert_resource(level);
/// world.spawn(BakedObject(0)); // with a mesh, in its place
/// # Ok::<(), visibility_bevy::BakedSetError>(())
/// ```
#[derive(Resource)]
pub struct BakedLevel {
    set: BakedSet,
    /// World box of each object in the bake, by index. `None` if the positions of entities are not checked.
    boxes: Option<Vec<Aabb>>,
    shared: Arc<Mutex<Sets>>,
    entities: HashMap<Entity, Place>,
    /// For each baked occluder, by its index: world boxes of the entities that were once in its baked state,
    /// without those that others have replaced since. No entry without boxes.
    lost_occluders: HashMap<u32, Vec<Aabb>>,
    /// Entities of occluders, where they were baked, that some views find and do not draw: for their
    /// `VisibilityRange`, or for layers above 30, which the scene does not tell apart.
    partly_drawn: HashSet<Entity>,
    /// Whether no frame has followed the entities yet.
    is_new: bool,
    cursor: SceneCursor,
}

/// State of an entity with a [`BakedObject`] relative to the bake. Absent while its position is unknown.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Place {
    /// The entity is at its baked position. The fields are its object in the scene, its index in the bake,
    /// and its world box.
    AsBaked(ObjectId, u32, Aabb),
    /// The entity has changed since it was at its baked position.
    Changed,
}

/// Visible sets that the level's cullers use.
#[derive(Clone, Default, Debug)]
pub(crate) enum Sets {
    /// Entities have not been compared with the baked objects yet, so the culler hides nothing.
    #[default]
    Unknown,
    /// An occluder of the bake is not as baked any more, or is not drawn in all views, so the culler hides
    /// nothing.
    WithoutOccluder,
    Of(Arc<ScenePvs>),
}

impl BakedLevel {
    /// Reads the bytes of a file that `bake` has written for a level. `version` is the level's version.
    /// `boxes` has the minimum and maximum corner of each object in world space, by index. An entity counts
    /// as its [`BakedObject`] only if the object's box contains the entity's box, up to rounding. An entity
    /// rotated by other than right angles mostly stays visible, because the box around its rotated `Aabb` is
    /// larger than the box around its mesh. The position of the entity within the box is not checked. Without
    /// a version, an edit inside a box, such as a new door, is not noticed, and the culler is approximate.
    ///
    /// World space must be that of the bake: a set of objects relative to another origin than that of world
    /// space is refused. `bake` takes another origin, and prints it, for content more than 4 km away from
    /// that of its file; move the content there before the bake.
    ///
    /// # Errors
    /// [`BakedSetError::OtherScene`] if the boxes differ in any bit from those that the set was baked from,
    /// or if the set has another origin. [`BakedSetError::OtherVersion`] for another version. Other errors if
    /// the bytes are damaged or of another format.
    pub fn read(
        file: &[u8],
        version: Option<u64>,
        boxes: impl IntoIterator<Item = [[f32; 3]; 2]>,
    ) -> Result<Self, BakedSetError> {
        let boxes: Vec<Aabb> = boxes.into_iter().map(|[min, max]| Aabb::from_arrays(min, max)).collect();
        let mut level = Self::read_unchecked(file)?;
        level.set = level.set.compared(version, DVec3::ZERO, (0..).zip(boxes.iter().copied()))?;
        level.boxes = Some(boxes);
        Ok(level)
    }

    /// Reads the bytes of a file that `bake` has written. Does not check that each entity with a
    /// [`BakedObject`] is at the baked position when its `Aabb` becomes known. Entities that are elsewhere,
    /// or that became visible by an edit, may be hidden although visible: the culler is approximate.
    ///
    /// # Errors
    /// [`BakedSetError`] if the bytes are damaged or of another format.
    pub fn read_unchecked(file: &[u8]) -> Result<Self, BakedSetError> {
        Ok(Self {
            set: BakedSet::from_bytes(file)?,
            boxes: None,
            shared: Arc::default(),
            entities: HashMap::new(),
            lost_occluders: HashMap::new(),
            partly_drawn: HashSet::new(),
            is_new: true,
            cursor: SceneCursor::START,
        })
    }

    /// Makes a culler for the [`CullingPipeline`](crate::CullingPipeline) of one camera. It hides nothing
    /// until this level is inserted as a resource.
    pub fn culler(&self) -> BakedCuller {
        BakedCuller { shared: self.shared.clone(), culler: None, is_checked: self.set.is_checked() }
    }

    /// Returns the set: its viewcells, and the objects visible from each.
    pub fn set(&self) -> &BakedSet {
        &self.set
    }

    /// Returns the number of entities that were at their baked position in the last frame, so that the set
    /// may hide them.
    pub fn placed_count(&self) -> usize {
        self.entities.values().filter(|place| **place != Place::Changed).count()
    }

    /// Returns the state of an entity that is at the baked position of the object with this index. `None`
    /// elsewhere, and while its bounds are unknown.
    fn place(&self, mirror: &VisibilityScene, entity: Entity, index: u32) -> Option<Place> {
        let id = mirror.object(entity)?;
        // Not as long as the entity has no `Aabb`, nor for lights and entities that are never culled.
        let has_box = mirror.record(id).has_box;
        let bounds = mirror.scene().bounds(id).ok().filter(|bounds| has_box && bounds.is_finite())?;
        let is_there = |boxes: &Vec<Aabb>| boxes.get(index as usize).is_some_and(|of| contains(of, &bounds));
        let is_known = (index as usize) < self.set.index_limit();
        (is_known && self.boxes.as_ref().is_none_or(is_there)).then_some(Place::AsBaked(id, index, bounds))
    }

    /// Records where an entity is. At its baked position it replaces the largest lost entity of its object
    /// that its box contains: another part of a wall leaves the gap of the lost one open.
    fn insert(&mut self, entity: Entity, place: Place) {
        self.entities.insert(entity, place);
        let Place::AsBaked(_, index, bounds) = place else { return };
        if let Entry::Occupied(mut lost) = self.lost_occluders.entry(index) {
            let boxes = lost.get_mut();
            let size = |number: &usize| boxes.get(*number).map_or(0.0, |of| (of.max - of.min).element_sum());
            let contained = (0..boxes.len()).filter(|&number| contains(&bounds, &boxes[number]));
            if let Some(number) = contained.max_by(|a, b| f32::total_cmp(&size(a), &size(b))) {
                boxes.swap_remove(number);
            }
            if lost.get().is_empty() {
                lost.remove();
            }
        }
    }

    /// Records that an entity is no longer at its baked position. Returns false for an unrecorded entity.
    fn set_changed(&mut self, entity: Entity) -> bool {
        let Some(place) = self.entities.get_mut(&entity) else { return false };
        self.partly_drawn.remove(&entity);
        if let Place::AsBaked(_, index, bounds) = std::mem::replace(place, Place::Changed)
            && self.set.is_occluder(index)
        {
            self.lost_occluders.entry(index).or_default().push(bounds);
        }
        true
    }

    /// Notes whether an entity is an occluder that some views find and do not draw.
    fn set_partly_drawn(&mut self, mirror: &VisibilityScene, entity: Entity) {
        let is_partly_drawn = matches!(self.entities.get(&entity), Some(&Place::AsBaked(id, index, _))
            if self.set.is_occluder(index) && mirror.record(id).must_be_asked());
        if is_partly_drawn {
            self.partly_drawn.insert(entity);
        } else {
            self.partly_drawn.remove(&entity);
        }
    }

    /// Notes that the entities of these objects are no longer where they were baked.
    fn set_all_changed(&mut self, is_changed: impl Fn(ObjectId) -> bool) {
        let places = self.entities.iter();
        let changed = places.filter(|(_, place)| matches!(place, Place::AsBaked(id, ..) if is_changed(*id)));
        let changed: Vec<Entity> = changed.map(|(&entity, _)| entity).collect();
        for entity in changed {
            self.set_changed(entity);
        }
    }

    /// Forgets an entity. Returns false if the entity is not recorded.
    fn remove(&mut self, entity: Entity) -> bool {
        self.set_changed(entity);
        self.entities.remove(&entity).is_some()
    }
}

/// Returns whether a box contains another, up to a tolerance of [`PLACE_TOLERANCE`].
fn contains(outer: &Aabb, inner: &Aabb) -> bool {
    let greatest = [outer.min, outer.max].map(|corner| corner.abs().max_element());
    let margin = greatest[0].max(greatest[1]) * PLACE_TOLERANCE;
    (outer.min - margin).cmple(inner.min).all() && (outer.max + margin).cmpge(inner.max).all()
}

/// Culler of a [`BakedLevel`] for one camera.
#[derive(Clone, Debug)]
pub struct BakedCuller {
    shared: Arc<Mutex<Sets>>,
    culler: Option<PvsCuller<Arc<ScenePvs>>>,
    /// Whether the set's version was compared with that of the level.
    is_checked: bool,
}

impl BakedCuller {
    fn sets(&self) -> Sets {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Culler for BakedCuller {
    fn name(&self) -> &str {
        "baked"
    }

    fn accuracy(&self) -> Accuracy {
        let is_checked = match self.sets() {
            Sets::Of(sets) => sets.is_checked(),
            _ => self.is_checked,
        };
        if is_checked { Accuracy::Conservative } else { Accuracy::Approximate }
    }

    fn hides_behind_undrawn(&self) -> bool {
        true
    }

    fn cull(&mut self, scene: &Scene, view: &View, visible: &mut VisibleSet) -> CullStats {
        let Sets::Of(sets) = self.sets() else {
            return CullStats::default().with_visible(visible.count(scene) as u64);
        };
        let culler = self.culler.get_or_insert_with(|| PvsCuller::new(sets.clone()));
        *culler.shared_mut() = sets;
        culler.cull(scene, view, visible)
    }

    fn for_each_lack(&self, scene: &Scene, each: &mut dyn FnMut(Lack)) {
        match (&self.culler, self.sets()) {
            (_, Sets::WithoutOccluder) => {
                let what = "objects not culled, an occluder of the bake not being as it was baked";
                each(Lack { what, count: scene.len() });
            }
            (Some(culler), _) => culler.for_each_lack(scene, each),
            (None, _) if !self.is_checked => {
                each(Lack { what: "a set that was not compared with the version of the level", count: 1 });
            }
            (None, _) => {}
        }
    }
}

type Candidate<'a> = (Entity, Ref<'a, BakedObject>, Option<Ref<'a, Mesh3d>>);

type Touched = Or<(
    Changed<BakedObject>,
    Changed<GlobalTransform>,
    Changed<BevyAabb>,
    Changed<Mesh3d>,
    // A light is seen by what it shines on.
    Changed<Sphere>,
)>;

/// Finds the entities that are at their baked positions. Prepares the set for the scene again if there are
/// new ones, or if the scene's change log no longer reaches back. `last` is the shared data of the level of
/// the last frame.
pub(crate) fn follow_level(
    level: Option<ResMut<BakedLevel>>,
    mut last: Local<Option<Arc<Mutex<Sets>>>>,
    mirror: Res<VisibilityScene>,
    touched: Query<Candidate, Touched>,
    all: Query<Candidate>,
    limited: Query<Entity, Or<(Added<VisibilityRange>, Changed<RenderLayers>)>>,
    mut removed: RemovedComponents<BakedObject>,
    mut removed_meshes: RemovedComponents<Mesh3d>,
    mut removed_ranges: RemovedComponents<VisibilityRange>,
    mut removed_layers: RemovedComponents<RenderLayers>,
    mut mesh_events: MessageReader<AssetEvent<Mesh>>,
) {
    let present = level.as_ref().map(|level| level.shared.clone());
    let is_other = last.as_ref().map(Arc::as_ptr) != present.as_ref().map(Arc::as_ptr);
    if is_other && let Some(former) = std::mem::replace(&mut *last, present) {
        // Nobody follows the entities for its cullers any more.
        set(&former, Sets::Unknown);
    }
    let Some(mut level) = level else {
        removed.clear();
        removed_meshes.clear();
        mesh_events.clear();
        return;
    };
    let level = level.bypass_change_detection();
    let scene = mirror.scene();
    let mut is_stale = level.cursor.follow(scene) == Changes::Everything;
    let was_partly_drawn = !level.partly_drawn.is_empty();
    for entity in removed.read() {
        is_stale |= level.remove(entity);
    }
    for entity in removed_meshes.read() {
        is_stale |= level.set_changed(entity);
    }
    let is_new = std::mem::take(&mut level.is_new);
    if is_other && !is_new {
        // While the level was not a resource, changes of entities were not recorded.
        level.set_all_changed(|_| true);
        is_stale = true;
    }
    let lost =
        |event: &AssetEvent<Mesh>| if let AssetEvent::Removed { id } = event { Some(*id) } else { None };
    let lost: HashSet<AssetId<Mesh>> = mesh_events.read().filter_map(lost).collect();
    if !lost.is_empty() {
        // bevy draws them no more.
        let is_lost = |mesh: Option<Ref<Mesh3d>>| mesh.is_some_and(|mesh| lost.contains(&mesh.id()));
        for (entity, ..) in all.iter().filter(|(.., mesh)| is_lost(*mesh)) {
            is_stale |= level.set_changed(entity);
        }
    }
    let mut follow = |(entity, object, mesh): (Entity, Ref<BakedObject>, Option<Ref<Mesh3d>>)| {
        if object.is_changed() {
            is_stale |= level.remove(entity);
        }
        if level.set_changed(entity) {
            // The scene reports a change of the box, but not a change of the mesh inside.
            is_stale |= mesh.is_some_and(|mesh| mesh.is_changed());
        } else if let Some(place) = level.place(&mirror, entity, object.0) {
            level.insert(entity, place);
            level.set_partly_drawn(&mirror, entity);
            is_stale = true;
        }
    };
    if is_new {
        all.iter().for_each(&mut follow);
    } else {
        touched.iter().for_each(&mut follow);
    }
    for entity in limited.iter().chain(removed_ranges.read()).chain(removed_layers.read()) {
        level.set_partly_drawn(&mirror, entity);
    }
    is_stale |= was_partly_drawn && level.partly_drawn.is_empty();
    if is_stale {
        // An entity that left the scene, such as one with `NoCpuCulling`, may no longer be drawn.
        level.set_all_changed(|id| !scene.contains(id));
    }
    let sets = if !level.lost_occluders.is_empty() || !level.partly_drawn.is_empty() {
        Sets::WithoutOccluder
    } else if is_stale {
        let placed = level.entities.values().filter_map(|place| match *place {
            Place::AsBaked(id, index, _) => Some((id, index)),
            Place::Changed => None,
        });
        Sets::Of(Arc::new(level.set.for_objects(scene, placed)))
    } else {
        return;
    };
    set(&level.shared, sets);
}

/// Gives the cullers of a level other sets.
fn set(shared: &Mutex<Sets>, sets: Sets) {
    *shared.lock().unwrap_or_else(PoisonError::into_inner) = sets;
}
