//! A level in tiles: properties of all objects are in memory, triangles and meshes are loaded on demand.

use crate::level_error::LevelError;
use crate::object_facts::{ObjectFacts, bounds_fingerprint};
use crate::scratch_file::{ContentWriter, LevelFile, Reserved, Working, facts, lock};
use crate::tile_tree::TileTree;
use std::collections::HashMap;
use std::fmt;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard};
use visibility_core::glam::{Affine3A, DVec3};
use visibility_core::level_version::version_of;
use visibility_core::pvs::Viewcell;
use visibility_core::scene::{MeshId, Triangles};
use visibility_core::{Aabb, Object, ObjectId, OccluderMesh, RegionCuller, Scene, VisibleSet};
use visibility_region::ExtendedProjectionCuller;

/// Weight (triangles plus 4 per object) of the occluders in the first sweep from near to far, see
/// [`TiledScene::first_weight`]. Each further sweep adds twice as much as the one before.
const FIRST_WEIGHT: u64 = 8192;

/// Greatest weight (triangles plus 4 per object) of the occluders in the sweep of a group or of a part of it.
/// Where the sweep needs more, the viewcells are halved into two parts. A single viewcell has no limit.
const MAX_WEIGHT: u64 = 1 << 19;

/// Estimated memory in bytes of a scene for sweeps, per unit of weight (triangles plus 4 per object).
const SWEEP_BYTES: u64 = 600;

/// Estimated memory in bytes of a copy of a scene's prepared sweep, per unit of the scene's weight (triangles
/// plus 4 per object).
const COPY_BYTES: u64 = 100;

/// Estimated memory in bytes of a scene with triangles only, per unit of weight (triangles plus 4 per
/// object).
const TRIANGLE_BYTES: u64 = 200;

/// Estimated memory in bytes of a search, per unit of weight (triangles plus 4 per object) of its objects.
const SEARCH_BYTES: u64 = 600;

/// Number of triangles that the search for one viewcell may always copy, if the level is in memory. The
/// search copies the triangles of all objects that the sweep has left. This many take about 2 GB.
const MAX_COPIED: u64 = 1 << 21;

/// A level whose objects are sorted into tiles by their position. A bake loads a tile only where the tile is
/// visible.
///
/// The content of the objects is in a [`Scene`] or in a file. With a file, only as much of it is in memory as
/// a limit allows ([`TiledScene::writer`]). The results of a bake are the same as for a level in memory.
pub struct TiledScene<'a> {
    pub(crate) origin: DVec3,
    /// Properties of each object, ascending by the object's index in the level. The position in this list is
    /// the object's *number*. It differs from the index, since there may be unused indices.
    pub(crate) objects: Vec<ObjectFacts>,
    pub(crate) tree: TileTree,
    /// Greatest index of an object of the level plus 1.
    pub(crate) index_limit: usize,
    /// Weight (triangles plus 4 per object) with which sweeps from near to far begin. Before the first sweep,
    /// the nearest tiles are opened until they have at least this weight together. Then the nearest objects
    /// become occluders until they have at least this weight together.
    pub(crate) first_weight: u64,
    /// Greatest weight (triangles plus 4 per object) of the occluders in the sweep of several viewcells.
    /// Where the sweep needs more, the viewcells are halved. Not used with a limit of time.
    pub(crate) most_weight: u64,
    /// Greatest number of triangles that the search for one viewcell may copy. For a level in memory, this is
    /// the greater of [`MAX_COPIED`] and the number of triangles of the level, with each shared mesh counted
    /// once. For a level in a file it is `u64::MAX`, since its memory is limited in bytes.
    pub(crate) most_copied: u64,
    store: Store<'a>,
    /// Scene of all objects, sorted by tile, with a sweep prepared for it. Made by the first request; `None`
    /// before.
    whole: Mutex<Option<Arc<PreparedScene>>>,
}

impl fmt::Debug for TiledScene<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TiledScene").field("index_limit", &self.index_limit).finish_non_exhaustive()
    }
}

/// Where the objects' triangles and meshes are stored.
enum Store<'a> {
    Scene(&'a Scene),
    File(LevelFile),
}

/// A scene, with a culler prepared for sweeps of it.
pub(crate) struct PreparedScene {
    pub scene: Scene,
    pub sweep: ExtendedProjectionCuller,
    _memory: Option<Reserved>,
}

impl<'a> TiledScene<'a> {
    /// Sorts the objects of a scene into tiles. Time is linear in the number of triangles.
    pub fn new(scene: &'a Scene) -> Self {
        let objects: Vec<ObjectFacts> = scene.ids().filter_map(|id| ObjectFacts::of(scene, id)).collect();
        let (tree, origin, index_limit) = (TileTree::new(&objects), scene.origin(), scene.index_limit());
        let meshes =
            scene.ids().filter_map(|id| scene.triangles(id).ok()).map(|triangles| triangles.mesh().0);
        let meshes: HashMap<_, _> = meshes.map(|mesh| (mesh.as_ptr(), mesh.len() as u64)).collect();
        let most_copied = MAX_COPIED.max(meshes.values().sum());
        let level = Self::with_store(origin, objects, tree, index_limit, Store::Scene(scene));
        Self { most_copied, ..level }
    }

    fn with_store(
        origin: DVec3,
        objects: Vec<ObjectFacts>,
        tree: TileTree,
        index_limit: usize,
        store: Store<'a>,
    ) -> Self {
        let (first_weight, most_weight) = (FIRST_WEIGHT, MAX_WEIGHT);
        let (most_copied, whole) = (u64::MAX, Mutex::default());
        Self { origin, objects, tree, index_limit, first_weight, most_weight, most_copied, store, whole }
    }

    /// Begins a level in a file. An existing file is overwritten. The file is removed when the level is
    /// dropped.
    ///
    /// # Errors
    /// [`LevelError::Origin`] if the origin is not finite, [`LevelError::File`] if the file cannot be
    /// written.
    pub fn writer(path: impl Into<PathBuf>, origin: DVec3) -> Result<TiledSceneWriter, LevelError> {
        if !origin.is_finite() {
            return Err(LevelError::Origin);
        }
        Ok(TiledSceneWriter { origin, objects: Vec::new(), content: ContentWriter::create(path.into())? })
    }

    /// Returns the number of objects.
    pub fn object_count(&self) -> usize {
        self.objects.len()
    }

    /// Returns the greatest index of an object plus 1.
    pub fn index_limit(&self) -> usize {
        self.index_limit
    }

    /// Returns the [cost](Object::cost) of the object with an index. `None` for an unknown index.
    pub fn cost(&self, index: u32) -> Option<u32> {
        let at = self.objects.binary_search_by_key(&index, |object| object.index).ok()?;
        Some(self.objects[at].cost)
    }

    /// Calls `look` with a scene of the objects whose bounds touch a box in world space or are not finite.
    /// The objects have triangles but no occluder meshes, and other indices than in the level.
    ///
    /// # Errors
    /// [`LevelError`] if a level in a file cannot be read, or if the objects exceed its limit of memory.
    pub fn with_scene_around<T>(
        &self,
        min: DVec3,
        max: DVec3,
        look: impl FnOnce(&Scene) -> T,
    ) -> Result<T, LevelError> {
        let (min, max) = (min - self.origin, max - self.origin);
        let touches = |bounds: &Aabb| {
            let is_beyond = bounds.max.as_dvec3().cmplt(min) | max.cmplt(bounds.min.as_dvec3());
            !bounds.is_finite() || !is_beyond.any()
        };
        let order = self.tree.order.iter().copied();
        let numbers: Vec<u32> = order.filter(|&at| touches(&self.objects[at as usize].bounds)).collect();
        let _memory = self.reserve(&numbers, TRIANGLE_BYTES)?;
        Ok(look(&self.scene_with_triangles(&numbers)?))
    }

    /// Returns all objects with their indices, ascending.
    pub(crate) fn objects(&self) -> impl Iterator<Item = (u32, Object)> {
        self.objects.iter().map(|facts| (facts.index, facts.object()))
    }

    /// Returns the version of the level, which equals the [`level_version`](crate::level_version) of a scene
    /// with the same objects.
    pub fn version(&self) -> u64 {
        version_of(self.origin, self.objects.iter().map(|object| (object.index, object.hash)))
    }

    /// Returns a hash of the origin, and of the indices and bounds of the objects.
    pub(crate) fn bounds_fingerprint(&self) -> u64 {
        bounds_fingerprint(self.origin, self.objects.iter().map(|object| (object.index, object.given)))
    }

    /// Makes a scene of the objects with the given numbers, with their triangles. The object of `numbers[0]`
    /// gets index 0, and so on.
    pub(crate) fn scene_with_triangles(&self, numbers: &[u32]) -> Result<Scene, LevelError> {
        let (mut part, ids) = self.scene_of(numbers, []);
        match &self.store {
            Store::Scene(scene) => {
                for (id, new) in self.ids_in(scene, numbers).zip(ids) {
                    if let Some(triangles) = id.and_then(|id| scene.shared_triangles(id)) {
                        let _ = part.set_triangles(new, triangles.clone());
                    }
                }
            }
            Store::File(file) => file.for_each(&self.objects, &self.tree, numbers, |place, content| {
                let _ = part.set_triangles(ids[place], &content.triangles[..]);
            })?,
        }
        Ok(part)
    }

    /// Makes a scene of the objects with the given numbers, with their occluder meshes. The object of
    /// `numbers[0]` gets index 0, and so on. Then adds `boxes`, objects that have only bounds.
    pub(crate) fn scene_with_meshes(
        &self,
        numbers: &[u32],
        boxes: impl IntoIterator<Item = Object>,
    ) -> Result<Scene, LevelError> {
        let (mut part, ids) = self.scene_of(numbers, boxes);
        match &self.store {
            Store::Scene(scene) => {
                // A mesh that several objects share is stored once.
                let mut meshes: HashMap<*const OccluderMesh, MeshId> = HashMap::new();
                for (id, new) in self.ids_in(scene, numbers).zip(ids) {
                    if let Some((mesh, transform)) = id.and_then(|id| scene.occluder(id)) {
                        let shared = *meshes.entry(mesh).or_insert_with(|| part.add_mesh(mesh.clone()));
                        let _ = part.set_mesh(new, shared, transform);
                    }
                }
            }
            Store::File(file) => file.for_each(&self.objects, &self.tree, numbers, |place, content| {
                if let Some((mesh, transform)) = &content.mesh {
                    let mesh = part.add_mesh(mesh.clone());
                    let _ = part.set_mesh(ids[place], mesh, *transform);
                }
            })?,
        }
        Ok(part)
    }

    /// Makes a scene of the objects with the given numbers, without triangles and meshes, and then adds
    /// `boxes`. Returns the scene and the ids of all its objects in this order.
    fn scene_of(&self, numbers: &[u32], boxes: impl IntoIterator<Item = Object>) -> (Scene, Vec<ObjectId>) {
        let mut part = Scene::new();
        // Cannot fail: the origin of a level is finite, and the scene is still empty.
        let _ = part.set_origin(self.origin);
        let objects = numbers.iter().map(|&at| self.objects[at as usize].enlarged_object());
        let ids = part.insert_batch(objects.chain(boxes));
        (part, ids)
    }

    /// Returns the ids that objects have in the level's scene, in the order of `numbers`. `None` for an
    /// object that the scene does not have.
    fn ids_in(&self, scene: &Scene, numbers: &[u32]) -> impl Iterator<Item = Option<ObjectId>> {
        numbers.iter().map(|&at| scene.id_at(self.objects[at as usize].index as usize))
    }

    /// Reserves `bytes` bytes of memory per unit of weight (triangles plus 4 per object) of the objects with
    /// the given numbers, and waits until they are free. `None` for a level in memory, which has no limit.
    fn reserve(&self, numbers: &[u32], bytes: u64) -> Result<Option<Reserved>, LevelError> {
        match &self.store {
            Store::Scene(_) => Ok(None),
            Store::File(file) => {
                let weight: u64 = numbers.iter().map(|&at| self.objects[at as usize].weight()).sum();
                file.reserve(weight * bytes).map(Some)
            }
        }
    }

    /// Calls `sweep` with a scene of the objects with the given numbers, with their occluder meshes, followed
    /// by `boxes`, objects that have only bounds.
    pub(crate) fn with_scene<T>(
        &self,
        numbers: &[u32],
        boxes: impl IntoIterator<Item = Object>,
        sweep: impl FnOnce(&Scene) -> T,
    ) -> Result<T, LevelError> {
        let _memory = self.reserve(numbers, SWEEP_BYTES)?;
        Ok(sweep(&self.scene_with_meshes(numbers, boxes)?))
    }

    /// Reserves the memory for work on one viewcell with the objects with the given numbers: for its search
    /// if `is_search`, otherwise for its sweep, which copies the prepared sweep. `None` for a level in
    /// memory, which has no limit.
    pub(crate) fn reserve_cell(
        &self,
        numbers: &[u32],
        is_search: bool,
    ) -> Result<Option<Reserved>, LevelError> {
        self.reserve(numbers, if is_search { SEARCH_BYTES } else { COPY_BYTES })
    }

    /// Returns a scene of the objects with the given numbers, with their occluder meshes, and a sweep
    /// prepared for the scene. Each thread clones the sweep.
    pub(crate) fn prepared(&self, numbers: &[u32]) -> Result<PreparedScene, LevelError> {
        let _memory = self.reserve(numbers, SWEEP_BYTES)?;
        let scene = self.scene_with_meshes(numbers, [])?;
        let mut sweep = ExtendedProjectionCuller::new();
        // Nothing is visible from an empty viewcell, so the culler only prepares the data that all threads
        // share.
        let nowhere = Viewcell::from_box(DVec3::ONE, DVec3::ZERO);
        sweep.cull(&scene, &nowhere, &mut VisibleSet::new());
        Ok(PreparedScene { scene, sweep, _memory })
    }

    /// Returns the scene of all objects, sorted by tile, with a sweep prepared for it.
    pub(crate) fn whole(&self) -> Result<Arc<PreparedScene>, LevelError> {
        let mut whole = self.lock(&self.whole);
        if let Some(whole) = &*whole {
            return Ok(whole.clone());
        }
        Ok(whole.insert(Arc::new(self.prepared(&self.tree.order)?)).clone())
    }

    /// Returns whether the level is in memory and has at most as many triangles as a search may copy.
    pub(crate) fn may_be_copied(&self) -> bool {
        !self.is_in_file()
            && self.objects.iter().map(|object| u64::from(object.triangles)).sum::<u64>() <= self.most_copied
    }

    /// Returns whether the content of the objects is in a file.
    pub(crate) fn is_in_file(&self) -> bool {
        matches!(self.store, Store::File(_))
    }

    /// Begins a thread's work on a level in a file. With `is_alone`, waits until no other thread works, and
    /// keeps others from beginning; otherwise other threads may work at the same time. See
    /// [`LevelFile::work`]. `None` for a level in memory.
    pub(crate) fn work(&self, is_alone: bool) -> Option<Working<'_>> {
        match &self.store {
            Store::Scene(_) => None,
            Store::File(file) => Some(file.work(is_alone)),
        }
    }

    /// Locks a mutex that another thread may hold while it waits for memory. Only for threads that have
    /// called [`work`](Self::work).
    pub(crate) fn lock<'m, T>(&self, mutex: &'m Mutex<T>) -> MutexGuard<'m, T> {
        match &self.store {
            Store::Scene(_) => lock(mutex),
            Store::File(file) => file.lock(mutex),
        }
    }
}

/// Writes a level to a file, one object at a time, so that the whole level is never in memory.
///
/// ```
/// use visibility_bake::{SandwichBaker, SandwichSettings, TiledScene};
/// use visibility_core::{bake::Bake, glam::DVec3, pvs::{Viewcell, Viewcells}, Aabb, Object};
/// let path = std::env::temp_dir().join(format!("tiles-{}", std::process::id()));
/// let mut level = TiledScene::writer(&path, DVec3::ZERO)?;
/// level.push(&Object::new(Aabb::from_arrays([5.0; 3], [6.0; 3])), &[], None)?;
/// // At most 512 MiB, of which the process has 10 in use.
/// let level = level.finish(512 << 20, 10 << 20)?;
/// let cells = Viewcells::new([Viewcell::from_box(DVec3::ZERO, DVec3::ONE)]);
/// let outcome = Bake::new(SandwichBaker::of_level(level.into(), &cells, SandwichSettings::default())).run();
/// assert_eq!((&*outcome.cells[0].reported(), outcome.error), (&[0][..], None));
/// assert!(!path.exists());
/// # Ok::<(), visibility_bake::LevelError>(())
/// ```
pub struct TiledSceneWriter {
    origin: DVec3,
    objects: Vec<ObjectFacts>,
    content: ContentWriter,
}

impl fmt::Debug for TiledSceneWriter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TiledSceneWriter").field("origin", &self.origin).finish_non_exhaustive()
    }
}

impl TiledSceneWriter {
    /// Appends an object, which gets the next index. `mesh` is its occluder mesh with the transform to level
    /// coordinates; only objects flagged as occluders need one. The flag of an object that is [never
    /// culled](Object::is_unculled) is cleared. For an object of a scene, take `object` and `mesh` from
    /// [`level_object`](visibility_core::level_version::level_object), which also clears the flag of objects
    /// that are not always drawn.
    ///
    /// # Errors
    /// [`LevelError::File`] if the file cannot be written, [`LevelError::TooMany`] if 32 bits cannot count
    /// the objects or the object's triangles.
    pub fn push<'a>(
        &mut self,
        object: &Object,
        triangles: impl Into<Triangles<'a>>,
        mesh: Option<(&OccluderMesh, Affine3A)>,
    ) -> Result<(), LevelError> {
        let triangles = triangles.into();
        let is_unknown = object.one_sided && !triangles.has_certain_fronts();
        let (occluder, one_sided) =
            (object.occluder && !object.is_unculled() && !is_unknown, object.one_sided && !is_unknown);
        let object = Object { occluder, one_sided, ..*object };
        let mesh = mesh.filter(|_| object.occluder);
        let facts = facts(self.objects.len(), &object, triangles, mesh)?;
        self.content.push(triangles, mesh)?;
        self.objects.push(facts);
        Ok(())
    }

    /// Completes the level. The process may use `memory` bytes in all, of which it already uses `in_use`.
    ///
    /// # Errors
    /// [`LevelError::File`] if the file cannot be written, [`LevelError::Memory`] if the limit is too low.
    pub fn finish(self, memory: u64, in_use: u64) -> Result<TiledScene<'static>, LevelError> {
        let Self { origin, mut objects, content } = self;
        objects.shrink_to_fit();
        let (tree, index_limit) = (TileTree::new(&objects), objects.len());
        let store = Store::File(content.finish(&objects, &tree, memory, in_use)?);
        Ok(TiledScene::with_store(origin, objects, tree, index_limit, store))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::glam::Vec3;

    #[test]
    fn parts_have_the_content_of_the_whole() {
        let mut scene = Scene::new();
        scene.set_origin(visibility_core::glam::DVec3::splat(1e6)).unwrap();
        let boxes = (0..9).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 1.0; 3]));
        let ids =
            scene.insert_batch(boxes.map(|bounds| Object { occluder: true, cost: 3, ..Object::new(bounds) }));
        let mesh = scene.add_mesh(OccluderMesh::cuboid(&Aabb::from_arrays([0.2; 3], [0.8; 3])).unwrap());
        for (i, &id) in ids.iter().enumerate() {
            let at = Vec3::splat(i as f32);
            scene.set_triangles(id, [[at, at + Vec3::X, at + Vec3::Y]]).unwrap();
            if i % 3 > 0 {
                scene.set_mesh(id, mesh, Affine3A::from_translation(at)).unwrap();
            }
        }
        let level = TiledScene::new(&scene);
        let other = Object::new(Aabb::from_arrays([0.0; 3], [1.0; 3]));
        let with_triangles = level.scene_with_triangles(&[7, 3, 4]).unwrap();
        let with_meshes = level.scene_with_meshes(&[7, 3, 4], [other]).unwrap();
        assert_eq!([&with_triangles, &with_meshes].map(|part| part.len()), [3, 4], "objects of both parts");
        for part in [&with_triangles, &with_meshes] {
            assert_eq!(part.origin(), scene.origin(), "the origin of the part");
            for (id, new) in [ids[7], ids[3], ids[4]].into_iter().zip(part.ids()) {
                assert_eq!(part.object(new), scene.object(id), "{id} and {new} are the same object");
                let has_triangles = part.len() == 3;
                let triangles = scene.triangles(id).ok().filter(|_| has_triangles).unwrap_or_default();
                assert_eq!(part.triangles(new).unwrap(), triangles, "triangles of {new}");
                assert_eq!(
                    part.occluder(new),
                    scene.occluder(id).filter(|_| !has_triangles),
                    "the occluder of {new}"
                );
            }
        }
    }

    /// Objects of a level in a file occlude if they are flagged so, can be culled, and have certain fronts or
    /// none.
    #[test]
    fn only_certain_occluders_of_a_level_in_a_file_occlude() {
        use visibility_core::glam::{DAffine3, Vec3};
        use visibility_core::scene::SharedTriangles;
        let path = std::env::temp_dir().join(format!("visibility-flags-{}", std::process::id()));
        let bounds = Aabb::from_arrays([0.0; 3], [1.0; 3]);
        let corners = bounds.corners();
        let mesh = OccluderMesh::from_indexed(&corners, &OccluderMesh::CUBOID).unwrap();
        let leaf = SharedTriangles::from([[Vec3::ZERO, Vec3::Y, Vec3::Z]]);
        let flat = leaf.placed(DAffine3::from_scale(DVec3::new(0.0, 1.0, 1.0)));
        assert!(!flat.view().has_certain_fronts(), "fronts of a flattened leaf");
        let mut writer = TiledScene::writer(&path, DVec3::ZERO).unwrap();
        let plain = Object { occluder: true, ..Object::new(bounds) };
        let infinite = Aabb::new(Vec3::ZERO, Vec3::INFINITY);
        // Object, whether its triangles have uncertain fronts, and whether it occludes and is one-sided.
        let all = [
            (plain, false, [true, false]),
            (Object { occluder: false, ..plain }, false, [false, false]),
            (Object { never_cull: true, ..plain }, false, [false, false]),
            (Object { bounds: infinite, ..plain }, false, [false, false]),
            (Object { one_sided: true, ..plain }, false, [true, true]),
            (Object { one_sided: true, ..plain }, true, [false, false]),
            (plain, true, [true, false]),
        ];
        for (object, is_flat, _) in &all {
            let triangles = if *is_flat { flat.view() } else { leaf.view() };
            writer.push(object, triangles, Some((&mesh, Affine3A::IDENTITY))).unwrap();
        }
        let level = writer.finish(1 << 30, 0).unwrap();
        let numbers: Vec<u32> = (0..all.len() as u32).collect();
        let scene = level.scene_with_meshes(&numbers, []).unwrap();
        for (number, (id, (_, _, expected))) in scene.ids().zip(&all).enumerate() {
            let object = scene.object(id).unwrap();
            assert_eq!([object.occluder, object.one_sided], *expected, "flags of object {number}");
            assert_eq!(scene.occluder(id).is_some(), expected[0], "the mesh of object {number}");
        }
        assert!(level.is_in_file() && !level.may_be_copied(), "a level in a file is not copied");
    }

    /// A box next to an object's bounds has the object if they touch, on each side.
    #[test]
    fn scenes_around_boxes_have_what_touches_them() {
        let mut scene = Scene::new();
        scene.insert(Aabb::from_arrays([5.0; 3], [6.0; 3]));
        scene.insert(Aabb::from_arrays([90.0; 3], [f32::INFINITY; 3]));
        let level = TiledScene::new(&scene);
        let count = |min: DVec3, max: DVec3| level.with_scene_around(min, max, |part| part.len()).unwrap();
        for axis in 0..3 {
            for (low, high, expected) in [(6.0, 7.0, 2), (6.001, 7.0, 1), (4.0, 5.0, 2), (4.0, 4.999, 1)] {
                let (mut min, mut max) = (DVec3::splat(5.5), DVec3::splat(5.5));
                (min[axis], max[axis]) = (low, high);
                assert_eq!(count(min, max), expected, "axis {axis}: from {low} to {high}");
            }
        }
    }

    /// A level in memory may be copied if it has no more triangles than a search may copy.
    #[test]
    fn small_levels_may_be_copied() {
        let mut scene = Scene::new();
        let bounds = Aabb::from_arrays([0.0; 3], [1.0; 3]);
        let corners = bounds.corners();
        let sides = OccluderMesh::CUBOID.map(|side| side.map(|at| corners[at as usize]));
        let id = scene.insert(bounds);
        scene.set_triangles(id, sides).unwrap();
        let mut level = TiledScene::new(&scene);
        assert_eq!(level.most_copied, MAX_COPIED, "triangles that a search may copy");
        for (most, expected) in [(12, true), (11, false)] {
            level.most_copied = most;
            assert_eq!(level.may_be_copied(), expected, "12 triangles of {most}");
        }
    }
}
