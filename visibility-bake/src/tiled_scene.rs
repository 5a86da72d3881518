//! A level in tiles: what is known of all objects, and the content of those that are asked for.

use crate::object_facts::{ObjectFacts, content_fingerprint};
use crate::part_scene::{Meshes, copy_content};
use crate::tile_tree::TileTree;
use std::sync::OnceLock;
use visibility_core::glam::DVec3;
use visibility_core::pvs::Viewcell;
use visibility_core::{Object, ObjectId, RegionCuller, Scene, VisibleSet};
use visibility_region::ExtendedProjectionCuller;

/// Weight of the objects that occlude in the first sweep from near to far. Each further sweep has twice as
/// much.
const FIRST: u64 = 8192;

/// A level whose objects are sorted into tiles, by place. A bake loads a tile only where it is seen.
pub(crate) struct TiledScene<'a> {
    pub origin: DVec3,
    /// By number. Numbers ascend with the indices of objects.
    pub objects: Vec<ObjectFacts>,
    pub tree: TileTree,
    /// Greatest index of an object plus 1.
    pub index_limit: usize,
    /// Weight of the objects that occlude in the first sweep from near to far.
    pub first: u64,
    scene: &'a Scene,
    /// All objects, tile by tile, and a sweep that is prepared for them: made when it is first asked for.
    whole: OnceLock<PreparedScene>,
}

/// A scene, and a sweep that is prepared for it.
pub(crate) type PreparedScene = (Scene, ExtendedProjectionCuller);

/// Returns a scene with a sweep that is prepared for it, to be cloned for threads.
pub(crate) fn prepared(scene: Scene) -> PreparedScene {
    let mut sweep = ExtendedProjectionCuller::new();
    // From an empty viewcell nothing is visible: the culler only prepares what all threads share.
    let nowhere = Viewcell::from_box(DVec3::ONE, DVec3::ZERO);
    sweep.cull(&scene, &nowhere, &mut VisibleSet::new());
    (scene, sweep)
}

impl<'a> TiledScene<'a> {
    /// Sorts the objects of a scene. Time is linear in the number of triangles.
    pub(crate) fn new(scene: &'a Scene) -> Self {
        let facts = |id: ObjectId| {
            let object = scene.object(id).ok()?;
            let triangles = scene.triangles(id).unwrap_or_default();
            Some(ObjectFacts::new(id.index() as u32, &object, triangles, scene.occluder(id)))
        };
        let objects: Vec<ObjectFacts> = scene.ids().filter_map(facts).collect();
        let tree = TileTree::new(&objects);
        let (origin, index_limit) = (scene.origin(), scene.index_limit());
        Self { origin, objects, tree, index_limit, first: FIRST, scene, whole: OnceLock::new() }
    }

    /// Returns a hash of all that a bake depends on: the origin, and for each object its index, bounds,
    /// layers, cost, flags, triangles and occluder mesh.
    pub(crate) fn fingerprint(&self) -> u64 {
        content_fingerprint(self.origin, &self.objects)
    }

    /// Makes a scene of some objects, by their numbers, in the given order: the first gets index 0. After
    /// them follow others that have nothing but bounds. Objects have triangles, for searches, or occluder
    /// meshes, for sweeps.
    pub(crate) fn scene_of(
        &self,
        numbers: &[u32],
        boxes: impl IntoIterator<Item = Object>,
        with_triangles: bool,
    ) -> Scene {
        let mut part = Scene::new();
        // The origin of a scene is finite, and that of an empty scene may be set.
        let _ = part.set_origin(self.origin);
        let objects = numbers.iter().map(|&at| self.objects[at as usize].object());
        let ids = part.insert_batch(objects.chain(boxes));
        let mut meshes = (!with_triangles).then(Meshes::new);
        for (&at, new) in numbers.iter().zip(ids) {
            if let Some(id) = self.scene.id_at(self.objects[at as usize].index as usize) {
                copy_content(self.scene, id, &mut part, new, with_triangles, meshes.as_mut());
            }
        }
        part
    }

    /// Returns a scene of all objects, tile by tile, with a sweep that is prepared for it.
    pub(crate) fn whole(&self) -> &PreparedScene {
        self.whole.get_or_init(|| prepared(self.scene_of(&self.tree.order, [], false)))
    }
}
