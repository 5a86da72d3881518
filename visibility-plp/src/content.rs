//! Object lists of the cells of a tessellation, and the share of rays that each cell's objects stop.

use crate::index_lists::IndexLists;
use crate::layers::{Sides, push_list};
use crate::normal_bins::NormalBins;
use crate::openness::openness_by_index;
use crate::surface_class::{MaxLean, SurfaceClass, UNKNOWN_LEAN, openness_of};
use alloc::vec::Vec;
use core::fmt::Debug;
use visibility_core::bits::Bits;
use visibility_core::{
    ObjectId, Scene,
    scene::{Changes, SceneCursor},
    stamp::Stamp,
};

/// Object lists of the cells of a tessellation, and the share of rays that each cell's objects stop.
///
/// A *primitive* is an object of the scene, named by its [index](ObjectId::index). For single triangles as
/// primitives, as in Klosowski and Silva, 2000, fill a scene with objects of one triangle each. An object is
/// in every cell that one of its triangles meets. An object without triangles is in every cell that its
/// bounds meet.
///
/// A *stray* is an object that is in no cell, since it has changed after the cells were filled or its bounds
/// are not finite. Cullers count strays as visible.
///
/// The objects of a cell are grouped into layers of similar facing direction, area and openness (mean free
/// distance in front of an object's surfaces). Cullers take the layers that are most likely visible first.
///
/// ```
/// use visibility_core::{Aabb, Scene};
/// use visibility_plp::{OctreeTessellation, Tessellation};
/// let mut scene = Scene::new();
/// let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3]));
/// let mut cells = OctreeTessellation::new(&scene);
/// scene.set_bounds(id, Aabb::from_arrays([5.0; 3], [6.0; 3]))?;
/// cells.sync(&scene);
/// assert_eq!(cells.content().strays(), [id]);
/// # Ok::<(), visibility_core::scene::SceneError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Content {
    /// Start of each cell's list in `lists`, in bytes, then the end of the last list: one entry more than
    /// there are cells.
    pub(crate) starts: Vec<usize>,
    /// Encoded object lists of all cells, one after another, in the format of the `layers` module.
    pub(crate) lists: Vec<u8>,
    /// For each cell, the share of rays along x, y and z that its objects stop, 0 to 255; then 1 if the cell
    /// has an object, else 0.
    pub(crate) cover: Vec<[u8; 4]>,
    /// Class of the openness (mean free distance in front of the surfaces) of each object, indexed by object
    /// index.
    openness: Vec<u8>,
    /// Free distance in metres that counts as an openness of 1. Infinite for a scene without extent.
    far: f32,
    /// Largest number of objects in a cell.
    pub(crate) max_count: u32,
    /// Sum over all cells of the number of axis sides (directions along plus or minus x, y or z, or none) by
    /// which the cell's objects are grouped.
    pub(crate) side_count: usize,
    /// [`Scene::index_limit`] of the scene when the cells were filled.
    pub(crate) index_limit: u32,
    /// One bit for each object index. Set while the object is listed in all cells that it meets; cleared for
    /// objects that changed since the cells were filled.
    pub(crate) held: Bits,
    /// Normals of single-triangle objects, in bins. With these, most objects that face away from the eye are
    /// skipped.
    pub(crate) normals: NormalBins,
    /// Objects of the scene that are in no cell, as of the last `sync`.
    strays: Vec<ObjectId>,
    /// Position in the scene's change log up to which `strays` is up to date.
    cursor: SceneCursor,
    /// Identity of the cells' lists. Changes of `strays` do not change the stamp.
    stamp: Stamp,
}

impl Content {
    /// Fills `cover.len()` cells from `pairs` of a cell's number and an object's index. Pairs may come in any
    /// order, each at most once. Pairs with an unknown cell or object are ignored. `cover` has for each cell
    /// the share of rays along x, y and z that its objects stop, 0 to 255; the fourth byte is ignored.
    ///
    /// Each object must meet the bounds of the cells that list it. Otherwise a culler may take a triangle
    /// that faces the eye for one that faces away, and drop it.
    ///
    /// Cost: O(n log n) in the number of pairs and of the scene's triangles.
    pub fn new(scene: &Scene, pairs: &[(u32, u32)], mut cover: Vec<[u8; 4]>) -> Self {
        let cells = cover.len();
        let is_known =
            |&(cell, object): &(u32, u32)| (cell as usize) < cells && scene.id_at(object as usize).is_some();
        let known = pairs.iter().copied().filter(is_known);
        let IndexLists { mut starts, mut items } = IndexLists::new(cells, known);
        let counts = starts.windows(2).map(|pair| pair[1] - pair[0]);
        let max_count = u32::try_from(counts.max().unwrap_or(0)).unwrap_or(u32::MAX);
        let (classes, far) = classes_of(scene);
        let mut lists = Vec::new();
        let mut side_count = 0;
        let mut held = Bits::new(scene.index_limit());
        for cell in 0..cells {
            let list = &mut items[starts[cell]..starts[cell + 1]];
            starts[cell] = lists.len();
            for &mut object in &mut *list {
                held.insert(object as usize);
            }
            side_count += push_list(&mut lists, list, &classes);
            cover[cell][3] = u8::from(!list.is_empty());
        }
        starts[cells] = lists.len();
        lists.shrink_to_fit();
        Self {
            starts,
            lists,
            cover,
            openness: classes.iter().map(|class| class.0.openness).collect(),
            far,
            max_count,
            side_count,
            index_limit: scene.index_limit() as u32,
            normals: NormalBins::new(scene),
            strays: scene.ids().filter(|id| !held.contains(id.index())).collect(),
            held,
            cursor: SceneCursor::at(scene),
            stamp: Stamp::new(),
        }
    }

    /// Returns the number of cells.
    #[inline]
    pub fn cell_count(&self) -> usize {
        self.cover.len()
    }

    /// Returns the free distance in metres that counts as an openness of 1.
    #[inline]
    pub(crate) fn far(&self) -> f32 {
        self.far
    }

    /// Returns the openness of an object when the cells were filled, 0 to 1. 1 for an object that was not
    /// there then.
    #[inline]
    pub(crate) fn openness(&self, id: ObjectId) -> f32 {
        self.openness.get(id.index()).map_or(1.0, |&class| openness_of(class))
    }

    /// Returns the encoded object list of a cell. Empty for an unknown cell.
    #[inline]
    fn list(&self, cell: u32) -> &[u8] {
        let cell = cell as usize;
        let range = self.starts.get(cell).zip(self.starts.get(cell + 1));
        range.and_then(|(&start, &end)| self.lists.get(start..end)).unwrap_or(&[])
    }

    /// Returns the objects of a cell, grouped by the axis side (plus or minus x, y or z) that they face.
    /// Empty for an unknown cell.
    #[inline]
    pub(crate) fn sides(&self, cell: u32) -> Sides<'_> {
        Sides::new(self.list(cell))
    }

    /// Returns the indices of the objects in a cell, each once, in no particular order. Empty for an unknown
    /// cell.
    #[inline]
    pub fn primitives(&self, cell: u32) -> impl Iterator<Item = u32> + Clone + Debug {
        self.sides(cell).flatten().flatten()
    }

    /// Returns the number of objects in a cell; 0 for an unknown cell. Cost: proportional to that number.
    #[inline]
    pub fn count(&self, cell: u32) -> u32 {
        self.primitives(cell).count() as u32
    }

    /// Tests whether a cell has no objects. True for an unknown cell.
    #[inline]
    pub fn is_empty(&self, cell: u32) -> bool {
        self.cover.get(cell as usize).is_none_or(|cover| cover[3] == 0)
    }

    /// Returns the largest number of objects in a cell; 0 without cells.
    pub fn max_count(&self) -> u32 {
        self.max_count
    }

    /// Returns the total number of pairs of an object and a cell that lists the object. Cost: proportional to
    /// that number.
    pub fn reference_count(&self) -> u64 {
        (0..self.cell_count() as u32).map(|cell| u64::from(self.count(cell))).sum()
    }

    /// Returns the share of rays along x, y and z that the objects of a cell stop, each 0 to 1. Zeros for an
    /// unknown cell.
    #[inline]
    pub fn cover(&self, cell: u32) -> [f64; 3] {
        let [x, y, z, _] = self.cover.get(cell as usize).copied().unwrap_or_default();
        [x, y, z].map(|share| f64::from(share) * (1.0 / 255.0))
    }

    /// Returns the objects that are in no cell, in ascending order, as of the last
    /// [`sync`](crate::OctreeTessellation::sync) or build. Cullers count them as visible, and likewise all
    /// objects changed since.
    pub fn strays(&self) -> &[ObjectId] {
        &self.strays
    }

    /// Tests whether an object is in all cells that it meets, as of the last
    /// [`sync`](crate::OctreeTessellation::sync) or build. Ignores the id's generation. False for an index
    /// beyond the [`index_limit`](Self::index_limit).
    pub fn holds(&self, id: ObjectId) -> bool {
        self.held.contains(id.index())
    }

    /// Returns [`Scene::index_limit`] as of the filling of the cells: one more than the largest object index.
    pub fn index_limit(&self) -> usize {
        self.index_limit as usize
    }

    /// Returns the identity of the cells' lists: equal stamps mean equal lists. A clone has its original's
    /// stamp. `sync` keeps the stamp, a rebuild changes the stamp.
    pub fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// Returns the objects of `scene` that changed since the last `sync` or build. [`Changes::Everything`]
    /// for another scene (also for a clone of the scene), and if the change log no longer reaches back.
    pub(crate) fn changes<'a>(&self, scene: &'a Scene) -> Changes<'a> {
        self.cursor.peek(scene)
    }

    /// Adds all objects that changed since the last call to the strays (objects in no cell, which count as
    /// visible), and removes strays that have left the scene. Returns false if the tessellation should be
    /// rebuilt: the changes are unknown (then nothing is modified), or more than an eighth of the scene's
    /// objects are strays.
    pub(crate) fn sync(&mut self, scene: &Scene) -> bool {
        let Changes::Objects(changed) = self.changes(scene) else { return false };
        for &id in changed {
            self.held.remove(id.index());
        }
        self.strays.extend_from_slice(changed);
        self.strays.retain(|&id| scene.contains(id));
        self.strays.sort_unstable();
        self.strays.dedup();
        self.cursor = SceneCursor::at(scene);
        self.strays.len() <= scene.len() / 8
    }

    /// Returns the heap memory of the content in bytes, without spare capacity.
    pub(crate) fn memory(&self) -> usize {
        size_of_val(&self.starts[..])
            + size_of_val(&self.lists[..])
            + size_of_val(&self.cover[..])
            + size_of_val(&self.openness[..])
            + self.held.memory()
            + self.normals.memory()
            + size_of_val(&self.strays[..])
    }
}

/// Returns, by object index, the surface class of every object and the bound on how far its normal leans from
/// the nearest axis. Unused indices hold the default class and [`UNKNOWN_LEAN`]. Also returns the free
/// distance in metres that counts as an openness of 1.
fn classes_of(scene: &Scene) -> (Vec<(SurfaceClass, MaxLean)>, f32) {
    let (openness, far) = openness_by_index(scene);
    let mut classes = alloc::vec![(SurfaceClass::default(), UNKNOWN_LEAN); scene.index_limit()];
    for id in scene.ids() {
        classes[id.index()] = SurfaceClass::of_object(scene, id, openness[id.index()]);
    }
    (classes, far)
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Aabb;

    /// An eighth of the objects may be strays before cells should be made anew.
    #[test]
    fn more_strays_than_an_eighth_are_too_many() {
        let mut scene = Scene::new();
        let unit = Aabb::from_arrays([0.0; 3], [1.0; 3]);
        let ids = scene.insert_batch((0..16).map(|_| unit));
        let pairs: Vec<_> = (0..16).map(|object| (0, object)).collect();
        let mut content = Content::new(&scene, &pairs, alloc::vec![[0; 4]]);
        for (count, expected) in [(1, true), (2, true), (3, false)] {
            scene.set_bounds(ids[count], Aabb::from_arrays([0.0; 3], [2.0; 3])).unwrap();
            assert_eq!(content.sync(&scene), expected, "{count} strays of 16");
        }
    }

    #[test]
    fn lists_of_any_numbers_come_back() {
        let mut scene = Scene::new();
        scene.insert_batch((0..70_000).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 1.0; 3])));
        let objects = [0, 1, 127, 128, 255, 16_383, 16_384, 32_767, 69_999];
        let pairs: Vec<_> =
            objects.iter().flat_map(|&o| [(1, o), (0, o)]).chain([(3, 5), (2, 70_000)]).collect();
        let content = Content::new(&scene, &pairs, alloc::vec![[0; 4]; 3]);
        assert_eq!(content.primitives(0).collect::<Vec<_>>(), objects, "objects of cell 0");
        assert_eq!(content.primitives(1).collect::<Vec<_>>(), objects, "objects of cell 1");
        assert_eq!(
            (content.primitives(2).count(), content.primitives(9).count()),
            (0, 0),
            "objects of a cell without any, and of one that does not exist"
        );
        assert_eq!(
            (content.count(1), content.count(2), content.max_count()),
            (9, 0, 9),
            "counts of cells 1 and 2, and the largest"
        );
        assert_eq!(content.strays().len(), 70_000 - objects.len(), "objects that no cell lists");
    }
}
