//! The scene: a store of objects in a hierarchy of bounding boxes, with a log of changes.

mod affine;
mod boxes64;
mod build;
mod changes;
mod cursor;
mod curve;
mod detail;
mod draw_range;
mod enlarged;
mod maintain;
mod mesh_bounds;
mod meshes;
mod moving;
mod object;
mod placement;
mod queue;
mod skinned_bounds;
mod transforms;
mod tree;
mod triangles;

pub use affine::ToAffine;
pub use boxes64::{Boxes64, FAN_OUT, lanes};
pub use changes::Changes;
pub use cursor::SceneCursor;
pub use curve::morton_order;
pub use detail::DetailedObject;
pub use draw_range::DrawRange;
pub use maintain::Maintenance;
#[doc(hidden)]
pub use mesh_bounds::holds_nearly;
use object::is_unculled;
pub use object::{MeshId, Object, ObjectId, SceneError, Triangle};
pub use skinned_bounds::{SkinError, SkinnedBounds};
pub use tree::DetailBounds;
pub(crate) use tree::{NONE, Slot, Token, Tree};
pub use triangles::{SharedTriangles, TriangleIter, Triangles};

use crate::serial::{next_generation, next_range};
use crate::{Aabb, bits::Bits, stamp::Stamp};
use alloc::vec::Vec;
use build::Entry;
use changes::ChangeLog;
use glam::DVec3;
use hashbrown::HashMap;
use meshes::Meshes;
use placement::{GivenBox, Placements};
use queue::Queue;
use tree::{Payload, Scratch};

/// The store of objects: bounds, layers, costs, flags, triangles and occluder meshes, in a hierarchy of
/// bounding boxes that every culler walks.
///
/// Bounds and triangles are in scene coordinates: `f32`, relative to one `f64` [origin](Self::origin) in the
/// world. Objects are changed between frames. Culling only reads the scene, so any number of views and
/// threads can share it.
///
/// # Cost
/// Inserting, removing and moving an object take time logarithmic in the number of objects. Many moves leave
/// the bounds of the hierarchy looser than necessary. [`maintain`](Self::maintain), called once per frame
/// with a budget, tightens them. [`rebuild`](Self::rebuild), best called after loading, builds the best
/// hierarchy. The scene holds about 50 bytes per object, without triangles and meshes.
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
    /// Objects that were flagged as never to be culled, by index.
    never_cull: Bits,
    /// Objects through which the objects behind them are drawn, by index.
    see_through: Bits,
    /// Objects whose triangles are drawn from their front alone, by index.
    one_sided: Bits,
    /// Triangles of each object, indexed by object index: `None` for an object without any. Shorter than the
    /// index range, and empty until an object first gets triangles.
    triangles: Vec<Option<SharedTriangles>>,
    meshes: Meshes,
    placements: Placements,
    /// Boxes of the objects whose box was enlarged to hold their mesh or triangles, as they were before, by
    /// index.
    given: HashMap<u32, GivenBox>,
    /// Number of objects that are flagged as occluders.
    occluders: usize,
    /// Number of objects that are flagged as occluders and have no mesh.
    meshless: usize,
    /// Number of objects that are flagged as occluders and have a mesh that reaches out of their bounds.
    outside: usize,
    /// Number of objects that have a mesh and are not flagged as occluders.
    unflagged: usize,
    /// Generation of the first object of each index. Differs from scene to scene, so that ids of other scenes
    /// are rejected.
    first_generation: u32,
    free: Vec<u32>,
    /// Number of objects whose layer mask is not `u32::MAX`.
    layered: usize,
    /// Number of objects with a draw range.
    ranged: usize,
    log: ChangeLog,
    layout: u64,
}

impl Clone for Scene {
    /// Copies all objects with their ids. The copy counts as another scene: sets, revisions and cursors of
    /// the original are not valid for it.
    fn clone(&self) -> Self {
        Self {
            origin: self.origin,
            tree: self.tree.clone(),
            queue: self.queue.clone(),
            generations: self.generations.clone(),
            costs: self.costs.clone(),
            never_cull: self.never_cull.clone(),
            see_through: self.see_through.clone(),
            one_sided: self.one_sided.clone(),
            triangles: self.triangles.clone(),
            meshes: self.meshes.clone(),
            placements: self.placements.clone(),
            given: self.given.clone(),
            occluders: self.occluders,
            meshless: self.meshless,
            outside: self.outside,
            unflagged: self.unflagged,
            first_generation: next_generation(),
            free: self.free.clone(),
            layered: self.layered,
            ranged: self.ranged,
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
    /// Creates an empty scene whose origin is the origin of the world.
    pub fn new() -> Self {
        Self {
            origin: DVec3::ZERO,
            tree: Tree::new(),
            queue: Queue::default(),
            generations: Vec::new(),
            costs: Vec::new(),
            never_cull: Bits::default(),
            see_through: Bits::default(),
            one_sided: Bits::default(),
            triangles: Vec::new(),
            meshes: Meshes::default(),
            placements: Placements::default(),
            given: HashMap::new(),
            occluders: 0,
            meshless: 0,
            outside: 0,
            unflagged: 0,
            first_generation: next_generation(),
            free: Vec::new(),
            layered: 0,
            ranged: 0,
            log: ChangeLog::new(),
            layout: next_range(),
        }
    }

    /// Returns the point of the world that the scene's bounds and triangles are relative to.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Moves the whole scene so that its origin is at `origin`, a point of the world. Scene-relative bounds,
    /// triangles and transforms stay as they are. [`changes_since`](Self::changes_since) reports that
    /// everything changed, and the [layout](Self::layout) changes, so that a
    /// [`VisibleSet`](crate::VisibleSet) that is not [finished](crate::VisibleSet::is_finished) counts as
    /// holding every object.
    ///
    /// # Errors
    /// [`SceneError::Origin`] if `origin` is NaN or infinite.
    pub fn set_origin(&mut self, origin: DVec3) -> Result<(), SceneError> {
        if !origin.is_finite() {
            return Err(SceneError::Origin);
        }
        self.origin = origin;
        self.log.move_origin();
        self.layout += 1;
        Ok(())
    }

    /// Returns the number of objects.
    pub fn len(&self) -> usize {
        self.generations.len() - self.free.len()
    }

    /// Returns whether the scene has no objects.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns an exclusive upper bound on the [index](ObjectId::index) of every object so far, removed ones
    /// included: the length for arrays indexed by object index.
    pub fn index_limit(&self) -> usize {
        self.generations.len()
    }

    /// Returns whether `id` names an object of this scene; false once the object is removed, and for ids of
    /// another scene within the limits that [`ObjectId`] states.
    pub fn contains(&self, id: ObjectId) -> bool {
        self.slot(id).is_ok()
    }

    /// Iterates over the ids of all objects, by ascending index.
    pub fn ids(&self) -> impl Iterator<Item = ObjectId> + '_ {
        let named =
            self.generations.iter().zip(0..).map(|(&generation, index)| ObjectId { index, generation });
        named.filter(|id| self.tree.slots[id.index()] != Slot::NONE)
    }

    /// Returns the id of the object that has `index` now, or `None` if no object has it. For structures that
    /// store indices, 4 bytes each, instead of ids. An index stored past a [change](Self::changes_since) of
    /// its object may belong to another object.
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

    /// Returns the bounds, layers, cost and flags of an object, as they were given. The box that cullers test
    /// may be larger by rounding: see [`bounds`](Self::bounds).
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene.
    pub fn object(&self, id: ObjectId) -> Result<Object, SceneError> {
        let slot = self.slot(id)?;
        let payload = self.tree.payload(slot);
        Ok(Object {
            bounds: self.given_bounds(id.index, slot),
            layers: payload.layers,
            cost: self.costs[id.index()],
            never_cull: self.never_cull.contains(id.index()),
            occluder: payload.occluder,
            see_through: self.see_through.contains(id.index()),
            one_sided: self.one_sided.contains(id.index()),
        })
    }

    /// Returns the bounds of an object, relative to the scene's origin. These are the bounds that were given,
    /// enlarged by rounding errors so as to hold the object's occluder mesh and triangles where these reach
    /// out of them: a culler that found the box behind the mesh would hide the object behind itself.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene.
    pub fn bounds(&self, id: ObjectId) -> Result<Aabb, SceneError> {
        let slot = self.slot(id)?;
        Ok(self.tree.bounds_in(slot))
    }

    /// Assigns an id to a new object and stores its cost and flags. Returns the properties that the tree
    /// stores beside the bounds. The object has no slot in the tree yet.
    fn register(&mut self, object: &Object) -> Payload {
        let index = self.free.pop().unwrap_or_else(|| {
            self.generations.push(self.first_generation);
            self.costs.push(0);
            self.tree.slots.push(Slot::NONE);
            self.generations.len() as u32 - 1
        });
        let id = ObjectId { index, generation: self.generations[index as usize] };
        self.costs[id.index()] = object.cost;
        mark(&mut self.never_cull, id, object.never_cull);
        mark(&mut self.see_through, id, object.see_through);
        mark(&mut self.one_sided, id, object.one_sided);
        self.layered += usize::from(object.layers != u32::MAX);
        self.occluders += usize::from(object.occluder);
        self.meshless += usize::from(object.occluder);
        Payload { id, layers: object.layers, occluder: object.occluder }
    }

    fn insert_into_tree(&mut self, bounds: &Aabb, payload: Payload) {
        if is_unculled(bounds, self.never_cull.contains(payload.id.index())) {
            self.tree.insert_unculled(bounds, payload);
        } else {
            self.tree.insert(bounds, payload);
        }
        self.layout += 1;
    }

    /// Adds an object and returns its id. An [`Aabb`] alone converts to an object with default properties.
    pub fn insert(&mut self, object: impl Into<Object>) -> ObjectId {
        let object = object.into();
        let payload = self.register(&object);
        self.insert_into_tree(&object.bounds, payload);
        self.log.push(payload.id, self.generations.len());
        payload.id
    }

    /// Adds many objects and returns their ids in the order of `objects`. If there are at least as many new
    /// objects as existing ones, the hierarchy is [rebuilt](Self::rebuild) with all of them, which costs one
    /// sort of the objects; otherwise they are inserted one by one.
    pub fn insert_batch<O: Into<Object>>(&mut self, objects: impl IntoIterator<Item = O>) -> Vec<ObjectId> {
        let count_before = self.len();
        let objects = objects.into_iter();
        let expected = objects.size_hint().0;
        self.generations.reserve(expected);
        self.costs.reserve(expected);
        self.tree.slots.reserve(expected);
        let mut ids = Vec::with_capacity(expected);
        let mut entries = Vec::with_capacity(expected);
        // Objects that are never culled are kept outside the hierarchy. The others are collected first.
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
        // A rebuild sorts all objects once, which is cheaper than as many searches if the batch is at least
        // half of them.
        if entries.len() >= count_before {
            self.tree.rebuild(entries, &self.generations);
            self.queue.clear();
        } else {
            for entry in &entries {
                self.tree.insert_entry(entry, &self.generations);
            }
        }
        // The log holds at most a quarter of all objects. After a larger batch, readers may as well start
        // from the beginning.
        if ChangeLog::is_too_much(ids.len(), self.generations.len()) {
            self.log.invalidate();
        } else {
            ids.iter().for_each(|&id| self.log.push(id, self.generations.len()));
        }
        self.layout += 1;
        ids
    }

    /// Removes an object. Its id becomes unknown, and a later object may reuse its index with another
    /// generation.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene.
    pub fn remove(&mut self, id: ObjectId) -> Result<(), SceneError> {
        let slot = self.slot(id)?;
        let payload = self.tree.payload(slot);
        self.layered -= usize::from(payload.layers != u32::MAX);
        self.occluders -= usize::from(payload.occluder);
        self.count_occluder(id.index, false);
        self.forget_details(id);
        self.tree.remove(slot);
        self.queue.push(slot.node());
        self.generations[id.index()] = id.generation.wrapping_add(1);
        self.free.push(id.index);
        if let Some(triangles) = self.triangles.get_mut(id.index()) {
            *triangles = None;
        }
        self.remove_placement(id.index);
        self.given.remove(&id.index);
        self.log.push(id, self.generations.len());
        self.layout += 1;
        Ok(())
    }

    /// Removes all objects of `ids`, or none of them if one is unknown or repeated.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] with the first id that is not in the scene, or with an id that `ids`
    /// contains twice.
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

    /// Sets the layers of an object, one bit per layer. A view shows objects that share a layer with it.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene.
    pub fn set_layers(&mut self, id: ObjectId, layers: u32) -> Result<(), SceneError> {
        let slot = self.slot(id)?;
        let old = core::mem::replace(&mut self.tree.layers[slot.node()][slot.lane()], layers);
        self.layered = self.layered + usize::from(layers != u32::MAX) - usize::from(old != u32::MAX);
        self.tree.raise_to_object(slot);
        self.raise_children(id);
        self.log.push(id, self.generations.len());
        Ok(())
    }

    /// Sets the cost of drawing an object, in triangles or any other unit, for cullers that have a budget.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene.
    pub fn set_cost(&mut self, id: ObjectId, cost: u32) -> Result<(), SceneError> {
        self.slot(id)?;
        self.costs[id.index()] = cost;
        self.log.push(id, self.generations.len());
        Ok(())
    }

    /// Sets whether an object may be used as an occluder. With `occluder` true the object may hide other
    /// objects; with false it hides nothing.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene.
    pub fn set_occluder(&mut self, id: ObjectId, occluder: bool) -> Result<(), SceneError> {
        let slot = self.slot(id)?;
        let was_occluder = self.tree.payload(slot).occluder;
        self.occluders = self.occluders + usize::from(occluder) - usize::from(was_occluder);
        self.count_occluder(id.index, false);
        let mask = &mut self.tree.occluders[slot.node()];
        *mask = *mask & !(1 << slot.lane()) | u64::from(occluder) << slot.lane();
        self.count_occluder(id.index, true);
        self.log.push(id, self.generations.len());
        Ok(())
    }

    /// Sets whether an object is exempt from culling. With `never_cull` true, the object is visible in every
    /// view of its layers, whatever the cullers find. With false, cullers may remove it.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene.
    pub fn set_never_cull(&mut self, id: ObjectId, never_cull: bool) -> Result<(), SceneError> {
        let (slot, bounds) = (self.slot(id)?, self.bounds(id)?);
        mark(&mut self.never_cull, id, never_cull);
        self.move_object(slot, id, &bounds);
        self.log.push(id, self.generations.len());
        Ok(())
    }

    /// Sets whether objects behind an object are drawn through it (`see_through` true) or not (false): see
    /// [`Object::see_through`].
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene.
    pub fn set_see_through(&mut self, id: ObjectId, see_through: bool) -> Result<(), SceneError> {
        self.slot(id)?;
        mark(&mut self.see_through, id, see_through);
        self.log.push(id, self.generations.len());
        Ok(())
    }

    /// Sets whether an object's triangles are drawn from their front alone (`one_sided` true) or from both
    /// sides (false): see [`Object::one_sided`]. When an object drawn from both sides becomes one-sided, its
    /// mesh is removed if it was [prepared](Self::prepare_occluders) from the triangles. A mesh given by
    /// [`set_mesh`](Self::set_mesh) stays.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene.
    pub fn set_one_sided(&mut self, id: ObjectId, one_sided: bool) -> Result<(), SceneError> {
        self.slot(id)?;
        if one_sided && !self.one_sided.contains(id.index()) {
            self.drop_prepared_mesh(id.index);
        }
        mark(&mut self.one_sided, id, one_sided);
        self.log.push(id, self.generations.len());
        Ok(())
    }

    /// Returns the number of objects that are never culled because their bounds are NaN or inverted, though
    /// they are not [flagged](Object::never_cull) as never culled. Infinite bounds do not count: they say
    /// where the object is. Takes time in proportion to the number of objects that are never culled.
    pub(crate) fn improper_bounds_count(&self) -> usize {
        self.tree
            .unculled_objects()
            .filter(|(bounds, id)| !bounds.is_proper() && !self.never_cull.contains(id.index()))
            .count()
    }

    /// Returns a box that contains the bounds of all objects that can be culled, relative to the scene's
    /// origin. The box may be larger than necessary. `None` if there are no such objects.
    pub fn culled_bounds(&self) -> Option<Aabb> {
        (self.tree.root != NONE).then(|| self.tree.bounds[self.tree.root as usize].hull())
    }

    /// Returns a number for the scene's present state, to pass to [`changes_since`](Self::changes_since)
    /// later. Every change increases it.
    pub fn revision(&self) -> u64 {
        self.log.revision()
    }

    /// Returns the changes since the state that `revision` stands for. [`Changes::Everything`] if the log
    /// does not reach back to that state, or if the revision is of another scene.
    pub fn changes_since(&self, revision: u64) -> Changes<'_> {
        self.log.since(revision)
    }

    /// Builds the hierarchy anew for the objects as they are now, which gives the tightest bounds, at the
    /// cost of sorting all objects. Ids stay valid; the [layout](Self::layout) changes.
    pub fn rebuild(&mut self) {
        self.tree.rebuild(Vec::new(), &self.generations);
        self.queue.clear();
        self.layout += 1;
    }

    /// Improves the hierarchy after moves. Inspects up to `budget` nodes in which something changed and
    /// tightens their bounds. Where the bounds of neighbouring nodes overlap too much, their contents are
    /// redistributed among up to eight nodes at once.
    ///
    /// An inspected node uses 1 of the budget, and each further node of a redistributed group uses 3. A group
    /// of eight therefore needs a budget of 22; a smaller budget makes smaller groups. One unit of budget
    /// costs about a microsecond.
    pub fn maintain(&mut self, budget: usize) -> Maintenance {
        self.tree.maintain(&mut self.queue, budget, &mut self.layout)
    }

    /// Returns the number of bytes in use for the objects and their hierarchy, without triangles and occluder
    /// meshes.
    pub fn memory(&self) -> usize {
        use core::mem::size_of_val;
        self.tree.memory()
            + size_of_val(&self.generations[..])
            + size_of_val(&self.costs[..])
            + self.never_cull.memory()
            + self.see_through.memory()
            + self.one_sided.memory()
            + size_of_val(&self.free[..])
            + self.queue.memory()
            + self.log.memory()
            + self.placements.memory()
            + self.given.len() * size_of::<(u32, GivenBox)>()
    }

    pub(crate) fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Returns the number of the leaf that holds an object and the object's lane (0 to 63) in that leaf.
    /// `None` for an unknown object. For cullers that keep data per [leaf](crate::walk::Block::leaf); valid
    /// until the [layout](Self::layout) changes. Objects that are never culled are in leaves that no walk
    /// visits.
    #[inline]
    pub fn leaf_of(&self, id: ObjectId) -> Option<(usize, usize)> {
        self.slot(id).ok().map(|slot| (slot.node(), slot.lane()))
    }

    /// Returns an exclusive upper bound on all leaf numbers: the length for arrays indexed by leaf.
    pub fn leaf_limit(&self) -> usize {
        self.tree.node_count()
    }

    /// Returns a stamp of the assignment of objects to leaves and lanes. Masks and data indexed by leaf are
    /// valid only while the stamp stays equal. Inserting, removing or rehoming an object, rebuilding, and
    /// setting the origin change it.
    pub fn layout(&self) -> Stamp {
        Stamp::from_count(self.layout)
    }

    /// Returns a mask of the lanes of a leaf whose objects share at least one layer with `layers`; bit i
    /// stands for lane i. `leaf` is the number of a [leaf](crate::walk::Block::leaf); the mask is 0 if it is
    /// not less than [`leaf_limit`](Self::leaf_limit).
    pub fn lanes_on_layers(&self, leaf: usize, layers: u32) -> u64 {
        let Some(&occupied) = self.tree.occupied.get(leaf) else { return 0 };
        if self.layered == 0 && layers != 0 {
            return occupied;
        }
        let of = &self.tree.layers[leaf];
        // In most blocks all objects share a layer with the view.
        if of.iter().fold(u32::MAX, |all, of| all & of) & layers != 0 {
            return occupied;
        }
        let shared = |mask: u64, (lane, &of): (usize, &u32)| mask | u64::from(of & layers != 0) << lane;
        of.iter().enumerate().fold(0, shared) & occupied
    }
}

/// Adds an object to a set of object indices (`value` true) or removes it (false). Adding raises the limit of
/// the set if the object's index is not below it.
fn mark(bits: &mut Bits, id: ObjectId, value: bool) {
    if value {
        bits.grow(id.index() + 1);
    }
    bits.set(id.index(), value);
}
