//! Objects placed by a transform: their local boxes and occluder meshes, and what becomes of mesh and
//! triangles when an object moves.
//!
//! An object hides other objects with its occluder mesh, or with its triangles in cullers that use these.
//! Both must be where the object is. A [transform](Scene::set_transform) moves the mesh together with the
//! bounds. A change of the [bounds](Scene::set_bounds) alone does not say how the object moved, so the
//! object loses its mesh. Triangles are in scene coordinates and never move, so the object loses them with
//! each change.

use super::boxes64::{FAN_OUT, lanes};
use super::mesh_bounds::{holds_nearly, image, is_any_outside, is_within};
use super::placement::{MeshOrigin, PlacedMesh};
use super::{MeshId, ObjectId, Scene, SceneError, Scratch, SharedTriangles, Slot, ToAffine, Triangles};
use crate::{Aabb, OccluderMesh};
use glam::Affine3A;

impl Scene {
    /// Sets the box of an object in local coordinates, and the object's bounds to that box
    /// [transformed](Aabb::transformed) by the object's transform. This transform is the one that
    /// [`set_mesh`](Self::set_mesh) or [`set_transform`](Self::set_transform) has set, or the identity if the
    /// object has none. From then on, `set_transform` and `set_mesh` move bounds and mesh together.
    ///
    /// If the object had a different local box before, its shape has changed, so its mesh is removed. If the
    /// object's bounds change, its triangles are removed. An improper or infinite box makes an object that is
    /// never culled. A mesh that reaches out of the local box [hides
    /// nothing](Self::occluders_outside_bounds).
    ///
    /// ```
    /// use visibility_core::{glam::{Affine3A, Vec3}, Aabb, Scene};
    /// let mut scene = Scene::new();
    /// let local = Aabb::from_arrays([-1.0; 3], [1.0; 3]);
    /// let id = scene.insert(local);
    /// scene.set_local_bounds(id, local)?;
    /// scene.set_transform(id, Affine3A::from_translation(Vec3::X * 10.0))?;
    /// assert!(scene.bounds(id)?.contains_point(Vec3::new(11.0, 1.0, 1.0)));
    /// # Ok::<(), visibility_core::scene::SceneError>(())
    /// ```
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene.
    pub fn set_local_bounds(&mut self, id: ObjectId, local: Aabb) -> Result<(), SceneError> {
        self.slot(id)?;
        if self.placements.mesh(id.index).is_some_and(|mesh| mesh.origin == MeshOrigin::Placed) {
            // A prepared mesh has the transform of the triangles, not that of the object.
            self.drop_prepared_mesh(id.index);
        }
        let placement = self.placements.get_or_insert(id.index);
        let given = self.given.get(&id.index).and_then(|given| given.local);
        let local = placement.local.filter(|_| given == Some(local)).unwrap_or(local);
        let bounds = local.transformed(&placement.transform);
        let former = placement.local.replace(local);
        if former != Some(local)
            && let Some(given) = self.given.get_mut(&id.index)
        {
            given.local = None;
        }
        if former.is_some_and(|former| former != local) {
            self.replace_mesh(id.index, None);
        }
        self.move_to(id, bounds);
        if former != Some(local) {
            self.check_mesh(id.index);
        }
        Ok(())
    }

    /// Returns the box of an object in local coordinates. `None` if the bounds of the object are given in
    /// scene coordinates, or if the object is unknown.
    pub fn local_bounds(&self, id: ObjectId) -> Option<Aabb> {
        self.slot(id).ok().and_then(|_| self.placements.get(id.index)?.local)
    }

    /// Returns the transform from the local coordinates of an object, those of its mesh and of its local
    /// bounds, to scene coordinates. The identity if none was set. `None` if the object is unknown.
    pub fn transform(&self, id: ObjectId) -> Option<Affine3A> {
        self.slot(id).ok()?;
        Some(match self.placements.mesh(id.index) {
            Some(mesh) if mesh.origin == MeshOrigin::Placed => self.mesh_transform(id.index, mesh),
            _ => self.own_transform(id.index),
        })
    }

    /// Returns the transform that was set for an object; the identity if none was.
    pub(crate) fn own_transform(&self, index: u32) -> Affine3A {
        self.placements.get(index).map_or(Affine3A::IDENTITY, |placement| placement.transform)
    }

    /// Returns the transform from the coordinates of an object's mesh to scene coordinates.
    fn mesh_transform(&self, index: u32, mesh: PlacedMesh) -> Affine3A {
        match mesh.origin {
            MeshOrigin::Given => self.own_transform(index),
            MeshOrigin::Placed => {
                let triangles = self.triangles.get(index as usize).and_then(Option::as_ref);
                triangles.and_then(SharedTriangles::rounded_transform).unwrap_or(Affine3A::IDENTITY)
            }
            MeshOrigin::InScene => Affine3A::IDENTITY,
        }
    }

    /// Moves an object with [local bounds](Self::set_local_bounds): its bounds and its mesh, from local to
    /// scene coordinates. If `transform` differs from the present transform, the object's triangles are
    /// removed, since they are in scene coordinates, and so is a mesh that was
    /// [prepared](Self::prepare_occluders) from them.
    ///
    /// # Errors
    /// - [`SceneError::UnknownObject`] if `id` is not in the scene.
    /// - [`SceneError::NoLocalBounds`] if the bounds of the object are given in scene coordinates.
    /// - [`SceneError::Transform`] if an element of `transform` is NaN or infinite.
    pub fn set_transform(&mut self, id: ObjectId, transform: Affine3A) -> Result<(), SceneError> {
        self.slot_with_local(id, &transform)?;
        let bounds = self.place(id, transform);
        self.move_to(id, bounds);
        Ok(())
    }

    /// Moves many objects, as [`set_transform`](Self::set_transform) does for one, or none of them on an
    /// error. If an object is listed twice, its last transform counts. The transforms may be in the
    /// [layout](ToAffine) of any math library.
    ///
    /// ```
    /// use visibility_core::{Aabb, Scene};
    /// let mut scene = Scene::new();
    /// let id = scene.insert(Aabb::EMPTY);
    /// scene.set_local_bounds(id, Aabb::from_arrays([-1.0; 3], [1.0; 3]))?;
    /// let columns = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 7.0, 8.0, 9.0];
    /// scene.set_transforms_batch(&[(id, columns)])?;
    /// assert_eq!(scene.bounds(id)?.center().to_array(), [7.0, 8.0, 9.0]);
    /// # Ok::<(), visibility_core::scene::SceneError>(())
    /// ```
    ///
    /// # Errors
    /// The errors of [`set_transform`](Self::set_transform), for the first object of `moved` that has one.
    pub fn set_transforms_batch<T: ToAffine>(&mut self, moved: &[(ObjectId, T)]) -> Result<(), SceneError> {
        let mut scratch = core::mem::replace(&mut self.tree.scratch, Scratch::EMPTY);
        let slots = moved.iter().map(|(id, transform)| self.slot_with_local(*id, &transform.to_affine()));
        let found = self.find_slots(slots, &mut scratch);
        if found.is_ok() {
            let mut placed = core::mem::take(&mut scratch.placed);
            placed.clear();
            placed.extend(moved.iter().map(|(id, transform)| (*id, self.place(*id, transform.to_affine()))));
            self.move_batch(&placed, &mut scratch);
            scratch.placed = placed;
        }
        self.tree.scratch = scratch;
        found
    }

    /// Returns the slot of an object whose transform may be set to `transform`, otherwise the error that
    /// [`set_transform`](Self::set_transform) states.
    fn slot_with_local(&self, id: ObjectId, transform: &Affine3A) -> Result<Slot, SceneError> {
        let slot = self.slot(id)?;
        if self.placements.get(id.index).is_none_or(|placement| placement.local.is_none()) {
            return Err(SceneError::NoLocalBounds(id));
        }
        if transform.is_finite() { Ok(slot) } else { Err(SceneError::Transform(id)) }
    }

    /// Stores the transform of an object with local bounds and removes the object's triangles if the
    /// transform differs from the former. Returns the bounds that the object then has.
    fn place(&mut self, id: ObjectId, transform: Affine3A) -> Aabb {
        let placement = self.placements.get_or_insert(id.index);
        let is_moved = core::mem::replace(&mut placement.transform, transform) != transform;
        let bounds = placement.local.unwrap_or(Aabb::EMPTY).transformed(&transform);
        if !is_moved {
            return self.as_enlarged(id.index, bounds);
        }
        if !self.triangles.is_empty() {
            self.drop_triangles(id.index);
        }
        if let Some(given) = self.given.get_mut(&id.index) {
            given.bounds = None;
        }
        bounds
    }

    /// Sets the bounds of an object that follow from its local bounds, and logs the change.
    fn move_to(&mut self, id: ObjectId, bounds: Aabb) {
        let bounds = self.as_enlarged(id.index, bounds);
        let slot = self.tree.slots[id.index()];
        if self.tree.bounds_in(slot) != bounds {
            self.drop_triangles(id.index);
            self.move_object(slot, id, &bounds);
            if let Some(given) = self.given.get_mut(&id.index) {
                given.bounds = None;
            }
        }
        self.log.push(id, self.generations.len());
    }

    /// Removes the mesh, the triangles and the local box of an object if `bounds` differ from its present
    /// bounds: all three would no longer fit the object.
    pub(super) fn forget_place(&mut self, id: ObjectId, bounds: &Aabb) {
        if self.placements.get(id.index).is_none()
            && self.placements.mesh(id.index).is_none()
            && self.triangles.get(id.index()).is_none_or(Option::is_none)
        {
            return;
        }
        let slot = self.tree.slots[id.index()];
        if self.tree.bounds_in(slot) != *bounds {
            self.drop_triangles(id.index);
            self.replace_mesh(id.index, None);
            self.placements.remove(id.index);
        }
    }

    /// Removes the transform, the local box and the mesh of an object.
    pub(super) fn remove_placement(&mut self, index: u32) {
        self.placements.remove(index);
        if let Some(mesh) = self.placements.mesh(index) {
            self.placements.set_mesh(index, None);
            self.meshes.remove_user(mesh.index);
        }
    }

    /// Removes the triangles of an object, and its mesh if that was made from them.
    fn drop_triangles(&mut self, index: u32) {
        if let Some(triangles) = self.triangles.get_mut(index as usize) {
            *triangles = None;
        }
        self.drop_prepared_mesh(index);
    }

    /// Takes away a mesh that was made from the object's triangles.
    pub(super) fn drop_prepared_mesh(&mut self, index: u32) {
        if self.placements.mesh(index).is_some_and(|mesh| mesh.origin != MeshOrigin::Given) {
            self.replace_mesh(index, None);
        }
    }

    /// Gives an object a mesh or takes it away. A mesh hides nothing until [`check_mesh`](Self::check_mesh)
    /// has found it within the object's bounds.
    pub(super) fn replace_mesh(&mut self, index: u32, mesh: Option<PlacedMesh>) {
        self.count_occluder(index, false);
        let former = self.placements.mesh(index);
        if let Some(mesh) = mesh {
            self.meshes.add_user(mesh.index);
        }
        self.placements.set_mesh(index, mesh);
        if let Some(former) = former {
            self.meshes.remove_user(former.index);
        }
        self.count_occluder(index, true);
    }

    /// Returns whether a stored mesh, placed in scene coordinates, lies within the bounds of an object.
    pub(crate) fn is_mesh_inside(&self, id: ObjectId, mesh: MeshId, transform: &Affine3A) -> bool {
        let (Some(mesh), Ok(slot)) = (self.meshes.at(mesh.index), self.slot(id)) else { return false };
        let given = self.given_bounds(id.index, slot);
        is_within(mesh, transform, &given) && holds_nearly(&given, &image(mesh, transform, &given))
    }

    /// Checks again whether the mesh of an object lies within the object's bounds: in local coordinates if
    /// the object has a local box, which moves together with the mesh, otherwise in scene coordinates. Does
    /// nothing for an object without a mesh.
    fn check_mesh(&mut self, index: u32) {
        let Some(mesh) = self.placements.mesh(index) else { return };
        let slot = self.tree.slots[index as usize];
        let bounds = self.tree.bounds_in(slot);
        let local = self.placements.get(index).and_then(|placement| placement.local);
        let is_local = local.is_some() && mesh.origin == MeshOrigin::Given;
        let (transform, bounds) = match local {
            Some(local) if is_local => (Affine3A::IDENTITY, local),
            _ => (self.mesh_transform(index, mesh), bounds),
        };
        // The box that was given decides, or meshes that move by small steps would enlarge it ever further.
        let given =
            self.given.get(&index).and_then(|given| if is_local { given.local } else { given.bounds });
        let given = given.unwrap_or(bounds);
        let content = self.meshes.at(mesh.index).filter(|mesh| is_within(mesh, &transform, &given));
        let content = content.map(|mesh| image(mesh, &transform, &bounds));
        let content = content.filter(|content| holds_nearly(&given, content) || !given.is_finite());
        let is_inside = content.is_some();
        if is_inside != mesh.is_inside {
            self.replace_mesh(index, Some(PlacedMesh { is_inside, ..mesh }));
        }
        if let Some(content) = content {
            self.enlarge(index, &content, is_local);
        }
    }

    /// Counts an object in (`is_added` true) or out (false) of one of three counts: objects flagged as
    /// occluders without a mesh, flagged objects whose mesh reaches out of their bounds, and objects with a
    /// mesh that are not flagged. Does nothing for any other object.
    pub(super) fn count_occluder(&mut self, index: u32, is_added: bool) {
        let is_flagged = self.tree.payload(self.tree.slots[index as usize]).occluder;
        let count = match (self.placements.mesh(index), is_flagged) {
            (None, true) => &mut self.meshless,
            (Some(mesh), true) if !mesh.is_inside => &mut self.outside,
            (Some(_), false) => &mut self.unflagged,
            _ => return,
        };
        if is_added {
            *count += 1;
        } else {
            *count -= 1;
        }
    }

    /// Replaces the triangles of an object, in scene coordinates, for users that need more than bounds: the
    /// item buffer of `visibility-measure`, occluder preparation, budgets in triangles. The object's bounds
    /// must contain the triangles, up to rounding. A change of the bounds removes the triangles, so set the
    /// bounds first. An occluder mesh prepared from the former triangles is removed.
    ///
    /// Users take the triangles for those of every frame. Set none for an object that animates within its
    /// bounds: bakes and exact cullers then judge it by its box, and would hide its other poses otherwise.
    ///
    /// Objects with the same mesh in several places are given [`SharedTriangles`], each placed by its own
    /// transform: the mesh is then kept once.
    ///
    /// ```
    /// use visibility_core::glam::{DAffine3, DVec3, Vec3};
    /// use visibility_core::{scene::SharedTriangles, Scene};
    /// let tree = SharedTriangles::from([[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    /// let mut scene = Scene::new();
    /// for x in 0..1000 {
    ///     let tree = tree.placed(DAffine3::from_translation(DVec3::X * f64::from(x)));
    ///     let id = scene.insert(tree.bounds());
    ///     scene.set_triangles(id, tree)?;
    /// }
    /// # Ok::<(), visibility_core::scene::SceneError>(())
    /// ```
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene. [`SceneError::Triangles`] if a corner lies
    /// outside of the bounds by more than rounding. NaN corners and improper bounds give no error.
    pub fn set_triangles(
        &mut self,
        id: ObjectId,
        triangles: impl Into<SharedTriangles>,
    ) -> Result<(), SceneError> {
        let (slot, triangles) = (self.slot(id)?, triangles.into());
        if is_any_outside(triangles.view(), &self.given_bounds(id.index, slot)) {
            return Err(SceneError::Triangles(id));
        }
        self.drop_triangles(id.index);
        if self.triangles.len() <= id.index() {
            self.triangles.resize(self.generations.len(), None);
        }
        if !triangles.is_empty() {
            self.hold_triangles(id.index, &triangles);
        }
        self.triangles[id.index()] = (!triangles.is_empty()).then_some(triangles);
        self.log.push(id, self.generations.len());
        Ok(())
    }

    /// Returns the triangles of an object in scene coordinates. Empty if none were set, or if the object has
    /// moved since.
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene.
    #[inline]
    pub fn triangles(&self, id: ObjectId) -> Result<Triangles<'_>, SceneError> {
        self.slot(id)?;
        Ok(self.shared_triangles(id).map_or_else(Triangles::default, SharedTriangles::view))
    }

    /// Returns the triangles of an object, to be shared with other objects or scenes. `None` if the object
    /// has none or is unknown.
    pub fn shared_triangles(&self, id: ObjectId) -> Option<&SharedTriangles> {
        self.slot(id).ok().and_then(|_| self.triangles.get(id.index())?.as_ref())
    }

    /// Stores an occluder mesh, in coordinates of its own, and returns its id. Any number of objects can
    /// share the mesh. It stays until it is [removed](Self::remove_mesh), used or not.
    pub fn add_mesh(&mut self, mesh: OccluderMesh) -> MeshId {
        self.meshes.add(mesh, self.first_generation)
    }

    /// Removes a mesh that [`add_mesh`](Self::add_mesh) stored. The id names no mesh from now on, and a later
    /// mesh may reuse its index with another generation.
    ///
    /// Objects that have the mesh keep it, and hide others with it, until they get another or lose it. The
    /// memory is freed with the last such object, or at once if there is none. A level that streams removes
    /// meshes and objects in any order; a mesh for one object alone can be removed right after
    /// [`set_mesh`](Self::set_mesh).
    ///
    /// ```
    /// use visibility_core::{glam::Affine3A, Aabb, OccluderMesh, Scene};
    /// let bounds = Aabb::from_arrays([0.0; 3], [4.0, 0.2, 3.0]);
    /// let mut scene = Scene::new();
    /// let (wall, mesh) = (scene.insert(bounds), scene.add_mesh(OccluderMesh::cuboid(&bounds)?));
    /// scene.set_mesh(wall, mesh, Affine3A::IDENTITY)?;
    /// scene.remove_mesh(mesh)?;
    /// assert!(scene.remove_mesh(mesh).is_err() && scene.has_mesh(wall));
    /// scene.remove(wall)?;
    /// assert_eq!(scene.mesh_count(), 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`SceneError::UnknownMesh`] if `mesh` is not in the scene.
    pub fn remove_mesh(&mut self, mesh: MeshId) -> Result<(), SceneError> {
        if self.meshes.remove(mesh) { Ok(()) } else { Err(SceneError::UnknownMesh(mesh)) }
    }

    /// Returns the number of meshes that the scene holds: those that were added and not removed, those that
    /// an object keeps, and those that were [prepared](Self::prepare_occluders) from the triangles of an
    /// object that still has them.
    pub fn mesh_count(&self) -> usize {
        self.meshes.count()
    }

    /// Returns the number of objects that have the mesh `mesh`, flagged as occluders or not.
    ///
    /// # Errors
    /// [`SceneError::UnknownMesh`] if `mesh` is not in the scene.
    pub fn mesh_users(&self, mesh: MeshId) -> Result<usize, SceneError> {
        self.meshes.users(mesh).ok_or(SceneError::UnknownMesh(mesh))
    }

    /// Gives an object an occluder mesh, replacing its former one, and the transform from mesh coordinates to
    /// scene coordinates. If the object has [local bounds](Self::set_local_bounds), mesh coordinates are its
    /// local coordinates, and the object is moved as by [`set_transform`](Self::set_transform). Otherwise the
    /// mesh stays where it is until the object's bounds change, which removes it.
    ///
    /// The object occludes only while it is also flagged as an [occluder](Self::set_occluder): to open and
    /// shut a door, switching that flag is enough and takes constant time. Everything that the mesh covers
    /// must also be covered by the object as drawn, or visible objects are hidden. The only check of this is
    /// whether the mesh lies within the object's bounds, up to rounding; it takes at most time linear in the
    /// number of vertices. A mesh outside the bounds, such as one given without its transform, [hides
    /// nothing](Self::occluders_outside_bounds).
    ///
    /// # Errors
    /// [`SceneError::UnknownObject`] if `id` is not in the scene, [`SceneError::UnknownMesh`] if `mesh` is
    /// not, and [`SceneError::Transform`] if an element of `transform` is NaN or infinite.
    pub fn set_mesh(&mut self, id: ObjectId, mesh: MeshId, transform: Affine3A) -> Result<(), SceneError> {
        self.slot(id)?;
        self.meshes.users(mesh).ok_or(SceneError::UnknownMesh(mesh))?;
        if !transform.is_finite() {
            return Err(SceneError::Transform(id));
        }
        let placed = PlacedMesh { index: mesh.index, origin: MeshOrigin::Given, is_inside: false };
        self.replace_mesh(id.index, Some(placed));
        if self.local_bounds(id).is_some() {
            self.check_mesh(id.index);
            return self.set_transform(id, transform);
        }
        self.placements.get_or_insert(id.index).transform = transform;
        self.check_mesh(id.index);
        self.log.push(id, self.generations.len());
        Ok(())
    }

    /// Gives an object an occluder mesh made from its triangles. The mesh is dropped when the triangles
    /// change. `is_placed` true: the mesh is in the coordinates of the triangles before they are placed, and
    /// the transform of the triangles places it; the object has no local bounds. False: the mesh is in scene
    /// coordinates, and no transform is applied.
    pub(crate) fn set_prepared_mesh(&mut self, id: ObjectId, mesh: MeshId, is_placed: bool) {
        let origin = if is_placed { MeshOrigin::Placed } else { MeshOrigin::InScene };
        self.replace_mesh(id.index, Some(PlacedMesh { index: mesh.index, origin, is_inside: false }));
        self.check_mesh(id.index);
        self.log.push(id, self.generations.len());
    }

    /// Returns whether an object has an occluder mesh, flagged as an occluder or not. False for an unknown
    /// object.
    pub fn has_mesh(&self, id: ObjectId) -> bool {
        self.contains(id) && self.placements.mesh(id.index).is_some()
    }

    /// Returns whether an object hides others in frames in which it is drawn: it is flagged as an
    /// [occluder](Self::set_occluder), not [never culled](crate::Object::is_unculled), and does not
    /// [fade](crate::scene::DrawRange::fades) by its [draw range](Self::set_draw_range). For cullers whose
    /// occluders are not the [meshes](Self::occluder). False for an unknown object.
    ///
    /// ```
    /// use visibility_core::{scene::DrawRange, Aabb, Object, Scene};
    /// let mut scene = Scene::new();
    /// let wall = Object { occluder: true, ..Object::new(Aabb::from_arrays([0.0; 3], [1.0; 3])) };
    /// let wall = scene.insert(wall);
    /// assert!(scene.can_occlude(wall));
    /// scene.set_draw_range(wall, DrawRange { end: 100.0, ..DrawRange::ALWAYS })?;
    /// assert!(scene.can_occlude(wall));
    /// scene.set_draw_range(wall, DrawRange { end: 100.0, margin: 20.0, ..DrawRange::ALWAYS })?;
    /// assert!(!scene.can_occlude(wall));
    /// # Ok::<(), visibility_core::scene::SceneError>(())
    /// ```
    pub fn can_occlude(&self, id: ObjectId) -> bool {
        self.slot(id).is_ok_and(|slot| {
            self.tree.occluding(slot.node()) >> slot.lane() & 1 != 0 && !self.tree.is_unculled(slot)
        })
    }

    /// Returns the occluder mesh of an object and the transform from mesh to scene coordinates. `None` if the
    /// object is unknown, has no mesh or [cannot occlude](Self::can_occlude), and if the mesh reaches [out of
    /// the object's bounds](Self::occluders_outside_bounds).
    pub fn occluder(&self, id: ObjectId) -> Option<(&OccluderMesh, Affine3A)> {
        if self.can_occlude(id) { self.mesh_of_occluder(id) } else { None }
    }

    /// Returns the same as [`occluder`](Self::occluder) for an object that is known to be in the scene and to
    /// be able to [occlude](Self::can_occlude). `None` if the object has no mesh, or its mesh is not within
    /// its bounds.
    pub(crate) fn mesh_of_occluder(&self, id: ObjectId) -> Option<(&OccluderMesh, Affine3A)> {
        let mesh = self.placements.mesh(id.index).filter(|mesh| mesh.is_inside)?;
        Some((self.meshes.at(mesh.index)?, self.mesh_transform(id.index, mesh)))
    }

    /// Loads the data of a leaf's occluders into the cache. The processor waits for many cache misses at
    /// once, but reading one occluder after the other would wait for each.
    pub(crate) fn fetch_occluders(&self, ids: &[ObjectId; FAN_OUT], mask: u64) {
        let mut sum = 0;
        for lane in lanes(mask) {
            if let Some((mesh, transform)) = self.mesh_of_occluder(ids[lane]) {
                sum ^= transform.translation.x.to_bits() ^ mesh.fetched();
            }
        }
        core::hint::black_box(sum);
    }

    /// Returns the number of objects that are flagged as [occluders](Self::set_occluder), with a mesh or
    /// without. Takes constant time.
    ///
    /// ```
    /// use visibility_core::{Aabb, Object, Scene};
    /// let mut scene = Scene::new();
    /// let wall = Object { occluder: true, ..Object::new(Aabb::from_arrays([0.0; 3], [1.0; 3])) };
    /// let walls = scene.insert_batch([wall, wall]);
    /// scene.set_occluder(walls[0], false)?;
    /// assert_eq!(scene.occluder_count(), 1);
    /// scene.remove(walls[1])?;
    /// assert_eq!(scene.occluder_count(), 0);
    /// # Ok::<(), visibility_core::scene::SceneError>(())
    /// ```
    pub fn occluder_count(&self) -> usize {
        self.occluders
    }

    /// Returns the number of objects that are flagged as occluders but have no mesh, and so hide nothing from
    /// cullers that use meshes. Objects whose mesh was removed because their bounds changed are counted too.
    /// Takes constant time.
    ///
    /// ```
    /// use visibility_core::{Aabb, Object, Scene};
    /// let mut scene = Scene::new();
    /// scene.insert(Object { occluder: true, ..Object::new(Aabb::from_arrays([0.0; 3], [1.0; 3])) });
    /// assert_eq!(scene.occluders_without_mesh(), 1);
    /// ```
    pub fn occluders_without_mesh(&self) -> usize {
        self.meshless
    }

    /// Returns the number of objects that have an occluder mesh and are not flagged as occluders, so that the
    /// mesh hides nothing, as for an open door or where [`set_occluder`](Self::set_occluder) was forgotten.
    /// Takes constant time.
    pub(crate) fn unflagged_meshes(&self) -> usize {
        self.unflagged
    }

    /// Returns the number of objects that are flagged as occluders and are [never
    /// culled](crate::Object::is_unculled), so that they hide nothing. Takes time in proportion to the
    /// objects that are never culled.
    pub(crate) fn unculled_occluders(&self) -> usize {
        let is_occluder = |(_, id): &(Aabb, ObjectId)| self.object(*id).is_ok_and(|object| object.occluder);
        self.tree.unculled_objects().filter(is_occluder).count()
    }

    /// Returns the number of objects that are flagged as occluders and
    /// [fade](crate::scene::DrawRange::fades), so that they hide nothing. Takes time in proportion to the
    /// number of leaves.
    pub(crate) fn fading_occluders(&self) -> usize {
        let fading = |leaf: usize| (self.tree.occluders[leaf] & !self.tree.occluding(leaf)).count_ones();
        (0..self.tree.node_count()).map(|leaf| fading(leaf) as usize).sum()
    }

    /// Returns the number of objects that are flagged as occluders and have a mesh that reaches out of their
    /// bounds by more than rounding. Such a mesh is not where its object is. It would hide visible objects,
    /// even the object itself, so it is not used. The usual cause is a wrong or missing transform in
    /// [`set_mesh`](Self::set_mesh). Takes constant time.
    ///
    /// ```
    /// use visibility_core::{glam::{Affine3A, Vec3}, Aabb, Object, OccluderMesh, Scene};
    /// let mut scene = Scene::new();
    /// let mesh = scene.add_mesh(OccluderMesh::cuboid(&Aabb::from_arrays([0.0; 3], [8.0; 3]))?);
    /// let bounds = Aabb::from_arrays([40.0, 0.0, 0.0], [48.0, 8.0, 8.0]);
    /// let house = scene.insert(Object { occluder: true, ..Object::new(bounds) });
    /// scene.set_mesh(house, mesh, Affine3A::IDENTITY)?;
    /// assert!(scene.occluders_outside_bounds() == 1 && scene.occluder(house).is_none());
    /// scene.set_mesh(house, mesh, Affine3A::from_translation(Vec3::X * 40.0))?;
    /// assert!(scene.occluders_outside_bounds() == 0 && scene.occluder(house).is_some());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn occluders_outside_bounds(&self) -> usize {
        self.outside
    }
}
