//! The objects, and the hierarchy that finds those in view.

mod boxes64;
mod build;
mod changes;
mod cursor;
mod curve;
mod maintain;
mod object;
mod queue;
mod tree;

pub use boxes64::Boxes64;
pub(crate) use boxes64::lanes;
pub use changes::Changes;
pub use cursor::SceneCursor;
pub use maintain::Maintenance;
pub use object::{MeshId, Object, ObjectId, SceneError, Triangle};
pub(crate) use tree::{NONE, Tree};

use crate::serial::next_range;
use crate::{Aabb, OccluderMesh, stamp::Stamp};
use alloc::{boxed::Box, vec::Vec};
use build::Entry;
use changes::ChangeLog;
use glam::{Affine3A, DVec3};
use hashbrown::HashMap;
use queue::Queue;
use tree::{Payload, Scratch, Slot};

/// The store of objects: bounds, layers, costs, flags and triangles, in a hierarchy that every culler walks.
///
/// Bounds and triangles are `f32`, relative to one `f64` [origin](Self::origin). Between frames the scene is
/// told of what changed; while it is culled it is only read, so any number of views and threads can share it.
///
/// # Cost
/// Inserting, removing and moving an object take time logarithmic in the number of objects. Many moves leave
/// the hierarchy looser than it could be: [`maintain`](Self::maintain), called once per frame with a budget,
/// keeps it in shape; [`rebuild`](Self::rebuild), best after loading, makes it as good as it gets. About 50
/// bytes an object.
///
/// ```
/// use visibility_core::{Aabb, Scene};
/// let mut scene = Scene::new();
/// let boxes = (0..100).map(|i| Aabb::from_arrays([i as f32, 0.0, 0.0], [i as f32 + 0.5, 1.0, 1.0]));
/// let ids = scene.insert_batch(boxes);
/// scene.remove(ids[3])?;
/// assert_eq!(scene.len(), 99);
/// assert!(scene.bounds(ids[3]).is_err() && scene.bounds(ids[4]).is_ok());
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
#[derive(Debug)]
pub struct Scene {
    origin: DVec3,
    tree: Tree,
    queue: Queue,
    generations: Vec<u32>,
    costs: Vec<u32>,
    /// A bit per index.
    never_cull: Vec<u64>,
    /// Empty until the first object gets triangles.
    triangles: Vec<Box<[Triangle]>>,
    meshes: Vec<OccluderMesh>,
    /// What an object hides with, by its index.
    instances: HashMap<u32, Instance>,
    free: Vec<u32>,
    /// Objects whose layers are not all set.
    layered: usize,
    log: ChangeLog,
    layout: u64,
}

/// A mesh that an object hides with.
#[derive(Clone, Copy, Debug)]
struct Instance {
    mesh: MeshId,
    transform: Affine3A,
    /// Whether the mesh was made of the object's triangles by [`Scene::prepare_occluders`].
    is_prepared: bool,
}

impl Clone for Scene {
    /// The same objects with the same ids. It is another scene all the same: sets and revisions of this one
    /// say nothing of it.
    fn clone(&self) -> Self {
        Self {
            origin: self.origin,
            tree: self.tree.clone(),
            queue: self.queue.clone(),
            generations: self.generations.clone(),
            costs: self.costs.clone(),
            never_cull: self.never_cull.clone(),
            triangles: self.triangles.clone(),
            meshes: self.meshes.clone(),
            instances: self.instances.clone(),
            free: self.free.clone(),
            layered: self.layered,
            log: ChangeLog::new(),
            layout: next_range(),
        }
    }
}

impl Default for Scene {
    fn default() -> Self {
        Self::new()
    }
}

impl Scene {
    /// An empty scene with its origin at zero.
    pub fn new() -> Self {
        Self {
            origin: DVec3::ZERO,
            tree: Tree::new(),
            queue: Queue::default(),
            generations: Vec::new(),
            costs: Vec::new(),
            never_cull: Vec::new(),
            triangles: Vec::new(),
            meshes: Vec::new(),
            instances: HashMap::new(),
            free: Vec::new(),
            layered: 0,
            log: ChangeLog::new(),
            layout: next_range(),
        }
    }

    /// The point of the world that bounds and triangles are relative to.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Moves the scene as a whole: its origin in the world changes, what is relative to it does not.
    ///
    /// # Errors
    /// [`SceneError::NonFiniteOrigin`].
    pub fn set_origin(&mut self, origin: DVec3) -> Result<(), SceneError> {
        if !origin.is_finite() {
            return Err(SceneError::NonFiniteOrigin);
        }
        self.origin = origin;
        self.log.invalidate();
        Ok(())
    }

    /// Number of objects.
    pub fn len(&self) -> usize {
        self.generations.len() - self.free.len()
    }

    /// Whether there is no object.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One more than the greatest index of any object so far: how long an array by index must be.
    pub fn index_limit(&self) -> usize {
        self.generations.len()
    }

    /// Whether the id names an object of this scene.
    pub fn contains(&self, id: ObjectId) -> bool {
        self.slot(id).is_ok()
    }

    /// All objects, by ascending index.
    pub fn ids(&self) -> impl Iterator<Item = ObjectId> + '_ {
        let named =
            self.generations.iter().zip(0..).map(|(&generation, index)| ObjectId { index, generation });
        named.filter(|id| self.tree.slots[id.index()] != Slot::NONE)
    }

    /// The object that has an index now, if any: for structures that keep four bytes an object. Whoever keeps
    /// an index past a [change](Self::changes_since) of its object may find another one.
    pub fn id_at(&self, index: usize) -> Option<ObjectId> {
        let (&generation, &slot) = (self.generations.get(index)?, self.tree.slots.get(index)?);
        (slot != Slot::NONE).then_some(ObjectId { index: index as u32, generation })
    }

    fn slot(&self, id: ObjectId) -> Result<Slot, SceneError> {
        match (self.generations.get(id.index()), self.tree.slots.get(id.index())) {
            (Some(&generation), Some(&slot)) if generation == id.generation && slot != Slot::NONE => Ok(slot),
            _ => Err(SceneError::UnknownObject(id)),
        }
    }

    /// What the scene knows of an object, but for its triangles.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`], here and in everything below that takes an id.
    pub fn object(&self, id: ObjectId) -> Result<Object, SceneError> {
        let slot = self.slot(id)?;
        let payload = self.tree.payload(slot);
        Ok(Object {
            bounds: self.tree.bounds[slot.node()].get(slot.lane()),
            layers: payload.layers,
            cost: self.costs[id.index()],
            never_cull: self.is_never_culled(id.index()),
            occluder: payload.occluder,
        })
    }

    /// The bounds of an object.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`].
    pub fn bounds(&self, id: ObjectId) -> Result<Aabb, SceneError> {
        let slot = self.slot(id)?;
        Ok(self.tree.bounds[slot.node()].get(slot.lane()))
    }

    fn is_never_culled(&self, index: usize) -> bool {
        self.never_cull[index / 64] >> (index % 64) & 1 != 0
    }

    fn write_never_cull(&mut self, index: usize, value: bool) {
        let word = &mut self.never_cull[index / 64];
        *word = *word & !(1 << (index % 64)) | u64::from(value) << (index % 64);
    }

    /// Gives an object its id and everything but a place.
    fn register(&mut self, object: &Object) -> Payload {
        let index = self.free.pop().unwrap_or_else(|| {
            self.generations.push(0);
            self.costs.push(0);
            self.tree.slots.push(Slot::NONE);
            if self.never_cull.len() * 64 < self.generations.len() {
                self.never_cull.push(0);
            }
            self.generations.len() as u32 - 1
        });
        let id = ObjectId { index, generation: self.generations[index as usize] };
        self.costs[id.index()] = object.cost;
        self.write_never_cull(id.index(), object.never_cull);
        self.layered += usize::from(object.layers != u32::MAX);
        Payload { id, layers: object.layers, occluder: object.occluder }
    }

    fn place(&mut self, bounds: &Aabb, payload: Payload) {
        let never = self.is_never_culled(payload.id.index());
        if (Object { never_cull: never, ..Object::new(*bounds) }).is_unculled() {
            self.tree.insert_unculled(bounds, payload);
        } else {
            self.tree.insert(bounds, payload);
        }
        self.layout += 1;
    }

    /// Adds an object; a box alone is enough.
    pub fn insert(&mut self, object: impl Into<Object>) -> ObjectId {
        let object = object.into();
        let payload = self.register(&object);
        self.place(&object.bounds, payload);
        self.log.push(payload.id, self.generations.len());
        payload.id
    }

    /// Adds many objects and returns their ids in order. Where they outnumber those that are there already,
    /// the hierarchy is [rebuilt](Self::rebuild) with them; its cost is then that of sorting what was
    /// added.
    pub fn insert_batch<O: Into<Object>>(&mut self, objects: impl IntoIterator<Item = O>) -> Vec<ObjectId> {
        let there = self.len();
        let objects = objects.into_iter();
        let expected = objects.size_hint().0;
        self.generations.reserve(expected);
        self.costs.reserve(expected);
        self.tree.slots.reserve(expected);
        let mut ids = Vec::with_capacity(expected);
        let mut entries = Vec::with_capacity(expected);
        for object in objects {
            let object = object.into();
            let payload = self.register(&object);
            ids.push(payload.id);
            if object.is_unculled() {
                self.tree.insert_unculled(&object.bounds, payload);
            } else {
                entries.push(Entry::new(object.bounds, payload));
            }
        }
        if entries.len() >= there {
            self.tree.rebuild(entries, &self.generations);
            self.queue.clear();
        } else {
            for entry in &entries {
                self.tree.insert_entry(entry, &self.generations);
            }
        }
        if ChangeLog::is_too_much(ids.len(), self.generations.len()) {
            self.log.invalidate();
        } else {
            ids.iter().for_each(|&id| self.log.push(id, self.generations.len()));
        }
        self.layout += 1;
        ids
    }

    /// Removes an object. Its id becomes unknown, its index free for another.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`].
    pub fn remove(&mut self, id: ObjectId) -> Result<(), SceneError> {
        let slot = self.slot(id)?;
        self.layered -= usize::from(self.tree.payload(slot).layers != u32::MAX);
        self.tree.remove(slot);
        self.queue.push(slot.node());
        self.generations[id.index()] = id.generation.wrapping_add(1);
        self.free.push(id.index);
        if let Some(triangles) = self.triangles.get_mut(id.index()) {
            *triangles = Box::default();
        }
        self.instances.remove(&id.index);
        self.log.push(id, self.generations.len());
        self.layout += 1;
        Ok(())
    }

    /// Removes many objects, or, if one of them is unknown, none.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`], also for an id given twice.
    pub fn remove_batch(&mut self, ids: &[ObjectId]) -> Result<(), SceneError> {
        for &id in ids {
            self.slot(id)?;
        }
        let mut sorted = ids.to_vec();
        sorted.sort_unstable();
        if let Some(twice) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(SceneError::UnknownObject(twice[0]));
        }
        ids.iter().try_for_each(|&id| self.remove(id))
    }

    /// Says where an object is now, for each that has moved or changed its shape. Its triangles and its
    /// [mesh](Self::set_mesh), if it has any, do not follow by themselves.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`].
    pub fn set_bounds(&mut self, id: ObjectId, bounds: Aabb) -> Result<(), SceneError> {
        let slot = self.slot(id)?;
        self.move_object(slot, id, &bounds);
        self.log.push(id, self.generations.len());
        Ok(())
    }

    fn move_object(&mut self, slot: Slot, id: ObjectId, bounds: &Aabb) {
        let (was, is) =
            (self.tree.is_unculled(slot), !bounds.is_finite() || self.is_never_culled(id.index()));
        if was && is {
            self.tree.bounds[slot.node()].set(slot.lane(), bounds);
        } else if was != is || !self.tree.move_within(slot, bounds) {
            let payload = self.tree.payload(slot);
            self.tree.remove(slot);
            self.place(bounds, payload);
        }
        self.queue.push(slot.node());
    }

    /// As [`set_bounds`](Self::set_bounds) for many objects, or, if one of them is unknown, for none. Where
    /// most blocks are touched, objects are moved block by block, and bounds end as tight as they can be.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`].
    pub fn set_bounds_batch(&mut self, moved: &[(ObjectId, Aabb)]) -> Result<(), SceneError> {
        let mut scratch = core::mem::replace(&mut self.tree.scratch, Scratch::EMPTY);
        scratch.slots.clear();
        let found = moved.iter().try_for_each(|&(id, _)| self.slot(id).map(|slot| scratch.slots.push(slot)));
        if found.is_ok() {
            self.move_all(moved, &mut scratch);
        }
        self.tree.scratch = scratch;
        found?;
        if ChangeLog::is_too_much(moved.len(), self.generations.len()) {
            self.log.invalidate();
        } else {
            moved.iter().for_each(|&(id, _)| self.log.push(id, self.generations.len()));
        }
        Ok(())
    }

    /// Moves objects whose slots are known.
    fn move_all(&mut self, moved: &[(ObjectId, Aabb)], scratch: &mut Scratch) {
        let layout = self.layout;
        if moved.len() >= self.tree.node_count() && moved.len() <= Scratch::MOST {
            self.tree.move_crowd(moved, scratch, &mut self.queue);
            for &place in &scratch.left {
                let (id, bounds) = &moved[place as usize];
                self.move_object(self.tree.slots[id.index()], *id, bounds);
            }
            return;
        }
        for (some, slots) in moved.chunks(32).zip(scratch.slots.chunks(32)) {
            self.tree.fetch(slots);
            for ((id, bounds), &slot) in some.iter().zip(slots) {
                // One that was given a new home may have moved others.
                let slot = if self.layout == layout { slot } else { self.tree.slots[id.index()] };
                self.move_object(slot, *id, bounds);
            }
        }
    }

    /// Puts an object on other layers.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`].
    pub fn set_layers(&mut self, id: ObjectId, layers: u32) -> Result<(), SceneError> {
        let slot = self.slot(id)?;
        let old = core::mem::replace(&mut self.tree.layers[slot.node()][slot.lane()], layers);
        self.layered = self.layered + usize::from(layers != u32::MAX) - usize::from(old != u32::MAX);
        self.log.push(id, self.generations.len());
        Ok(())
    }

    /// Sets what drawing an object costs.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`].
    pub fn set_cost(&mut self, id: ObjectId, cost: u32) -> Result<(), SceneError> {
        self.slot(id)?;
        self.costs[id.index()] = cost;
        self.log.push(id, self.generations.len());
        Ok(())
    }

    /// Sets whether an object may hide others.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`].
    pub fn set_occluder(&mut self, id: ObjectId, occluder: bool) -> Result<(), SceneError> {
        let slot = self.slot(id)?;
        let mask = &mut self.tree.occluders[slot.node()];
        *mask = *mask & !(1 << slot.lane()) | u64::from(occluder) << slot.lane();
        self.log.push(id, self.generations.len());
        Ok(())
    }

    /// Sets whether an object is visible whatever any culler finds.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`].
    pub fn set_never_cull(&mut self, id: ObjectId, never_cull: bool) -> Result<(), SceneError> {
        let bounds = self.bounds(id)?;
        self.write_never_cull(id.index(), never_cull);
        self.set_bounds(id, bounds)
    }

    /// Gives an object its triangles, in scene coordinates, for those who need more than bounds: the item
    /// buffer of `visibility-measure`, occluders, budgets in triangles. The bounds must contain them, and
    /// stay the caller's to set.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`].
    pub fn set_triangles(
        &mut self,
        id: ObjectId,
        triangles: impl Into<Box<[Triangle]>>,
    ) -> Result<(), SceneError> {
        self.slot(id)?;
        if self.triangles.len() <= id.index() {
            self.triangles.resize_with(self.generations.len(), Box::default);
        }
        self.triangles[id.index()] = triangles.into();
        if self.instances.get(&id.index).is_some_and(|instance| instance.is_prepared) {
            self.instances.remove(&id.index);
        }
        self.log.push(id, self.generations.len());
        Ok(())
    }

    /// The triangles of an object; none if it was given none.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`].
    pub fn triangles(&self, id: ObjectId) -> Result<&[Triangle], SceneError> {
        self.slot(id)?;
        Ok(self.triangles.get(id.index()).map_or(&[], |triangles| triangles))
    }

    /// Adds a mesh that objects can hide with, any number of them the same one. It stays for as long as the
    /// scene.
    pub fn add_mesh(&mut self, mesh: OccluderMesh) -> MeshId {
        self.meshes.push(mesh);
        MeshId(self.meshes.len() as u32 - 1)
    }

    /// Gives an object the mesh that it hides with, placed by `transform` in scene coordinates. It hides only
    /// while it is also flagged as an [occluder](Self::set_occluder): a door is opened and shut by that
    /// flag alone, in constant time. What the mesh covers must be covered by what is drawn.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`], [`SceneError::UnknownMesh`] and [`SceneError::NonFiniteTransform`].
    pub fn set_mesh(&mut self, id: ObjectId, mesh: MeshId, transform: Affine3A) -> Result<(), SceneError> {
        self.slot(id)?;
        if mesh.0 as usize >= self.meshes.len() {
            return Err(SceneError::UnknownMesh(mesh));
        }
        if !transform.is_finite() {
            return Err(SceneError::NonFiniteTransform(id));
        }
        self.instances.insert(id.index, Instance { mesh, transform, is_prepared: false });
        self.log.push(id, self.generations.len());
        Ok(())
    }

    /// Gives an object a mesh made of its triangles, which is taken away with them.
    pub(crate) fn set_prepared_mesh(&mut self, id: ObjectId, mesh: MeshId) -> Result<(), SceneError> {
        self.set_mesh(id, mesh, Affine3A::IDENTITY)?;
        if let Some(instance) = self.instances.get_mut(&id.index) {
            instance.is_prepared = true;
        }
        Ok(())
    }

    /// Whether an object has a mesh to hide with, whatever its flag says.
    pub fn has_mesh(&self, id: ObjectId) -> bool {
        self.contains(id) && self.instances.contains_key(&id.index)
    }

    /// The mesh that an object hides with, and where it is: nothing while it is not flagged as an occluder.
    pub fn occluder(&self, id: ObjectId) -> Option<(&OccluderMesh, &Affine3A)> {
        let slot = self.slot(id).ok()?;
        if !self.tree.payload(slot).occluder {
            return None;
        }
        let Instance { mesh, transform, .. } = self.instances.get(&id.index)?;
        Some((&self.meshes[mesh.0 as usize], transform))
    }

    /// A box around all objects that can be culled, maybe larger than need be; `None` if there are none.
    pub fn culled_bounds(&self) -> Option<Aabb> {
        (self.tree.root != NONE).then(|| self.tree.bounds[self.tree.root as usize].hull())
    }

    /// Names the scene's state, to ask later for the changes [since](Self::changes_since).
    pub fn revision(&self) -> u64 {
        self.log.revision()
    }

    /// What has changed since a revision.
    pub fn changes_since(&self, revision: u64) -> Changes<'_> {
        self.log.since(revision)
    }

    /// Builds the hierarchy anew: the best there is for the objects as they are now, at the cost of sorting
    /// them. Ids stay valid.
    pub fn rebuild(&mut self) {
        self.tree.rebuild(Vec::new(), &self.generations);
        self.queue.clear();
        self.layout += 1;
    }

    /// Looks at up to `budget` blocks (of 64 objects) in which something moved: tightens their bounds, and
    /// where blocks have come to lie across one another, deals out their objects among them anew, up to
    /// eight blocks at once. To deal out a block counts as looking at three, so that with a budget below
    /// 22 fewer than eight are dealt out together. A budget of one costs about a microsecond.
    pub fn maintain(&mut self, budget: usize) -> Maintenance {
        self.tree.maintain(&mut self.queue, budget, &mut self.layout)
    }

    /// Bytes held for the objects and their hierarchy, without their triangles.
    pub fn memory(&self) -> usize {
        use core::mem::size_of_val;
        self.tree.memory()
            + size_of_val(&self.generations[..])
            + size_of_val(&self.costs[..])
            + size_of_val(&self.never_cull[..])
            + size_of_val(&self.free[..])
            + self.queue.memory()
            + self.log.memory()
            + self.instances.allocation_size()
    }

    pub(crate) fn tree(&self) -> &Tree {
        &self.tree
    }

    /// The leaf of the hierarchy that an object is in, and its lane there; `None` for an unknown object. For
    /// cullers that keep data beside the [leaves](crate::walk::Block::leaf) that a walk comes to.
    #[inline]
    pub fn leaf_of(&self, id: ObjectId) -> Option<(usize, usize)> {
        self.slot(id).ok().map(|slot| (slot.node(), slot.lane()))
    }

    /// One more than the greatest number of any leaf: how long an array by leaf must be.
    pub fn leaf_limit(&self) -> usize {
        self.tree.node_count()
    }

    /// Changes whenever an object gets another leaf or lane: masks and data by leaf are those of one layout.
    pub fn layout(&self) -> Stamp {
        Stamp::from_count(self.layout)
    }

    /// Those lanes of a leaf whose objects share a layer with `layers`.
    pub(crate) fn lanes_on_layers(&self, leaf: usize, layers: u32) -> u64 {
        let occupied = self.tree.occupied[leaf];
        if self.layered == 0 && layers != 0 {
            return occupied;
        }
        let of = &self.tree.layers[leaf];
        // Most blocks are on all layers, or on one that is asked for.
        if of.iter().fold(u32::MAX, |all, of| all & of) & layers != 0 {
            return occupied;
        }
        let shared = |mask: u64, (lane, &of): (usize, &u32)| mask | u64::from(of & layers != 0) << lane;
        of.iter().enumerate().fold(0, shared) & occupied
    }
}
