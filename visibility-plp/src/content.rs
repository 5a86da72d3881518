//! Objects in the cells of a tessellation, and the share of rays that each cell stops.

use crate::index_lists::IndexLists;
use crate::layers::{Layer, Layers, Sides, push_list};
use crate::normal_bins::NormalBins;
use crate::openness::openness_by_index;
use crate::surface_class::{Lean, SurfaceClass, UNKNOWN_LEAN};
use alloc::vec::Vec;
use visibility_core::{
    ObjectId, Scene,
    scene::{Changes, SceneCursor},
    stamp::Stamp,
};

/// Objects in each cell of a tessellation, and the share of rays that each cell stops.
///
/// A *primitive* is an object of the scene, named by its [index](ObjectId::index). For single triangles as
/// primitives, as in the paper, fill a scene with objects of one triangle each. An object is in every cell
/// that one of its triangles meets, or that its bounds meet if the scene has no triangles of it.
///
/// An object without a cell is a *stray*, and cullers count it as visible: it has changed since the cells
/// were filled, or its bounds are not finite.
///
/// A cell holds its objects in layers of like facing direction, area and openness (mean free distance in
/// front of their surfaces). Cullers take those layers first of which most is likely seen.
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
    /// First byte of each cell's list in `lists`, and the end of the last list.
    pub(crate) starts: Vec<u32>,
    /// Lists of all cells, in the format of [`layers`](crate::layers).
    pub(crate) lists: Vec<u8>,
    /// For each cell, the share of rays along x, y and z that it stops, 0 to 255; then 1 if it holds an
    /// object, else 0.
    pub(crate) cover: Vec<[u8; 4]>,
    /// Greatest number of objects in a cell.
    pub(crate) max_count: u32,
    /// Number of sides in all lists together.
    pub(crate) side_count: usize,
    /// [`Scene::index_limit`] of the scene when the cells were filled.
    pub(crate) index_limit: u32,
    /// One bit for each object index: the object is in cells and has not changed since.
    pub(crate) held: Vec<u64>,
    pub(crate) normals: NormalBins,
    strays: Vec<ObjectId>,
    /// Place in the scene's change log up to which changes are taken in.
    cursor: SceneCursor,
    /// Identifies what is in which cell. Strays do not count.
    stamp: Stamp,
}

/// Whether a bit is set. False beyond the end.
pub(crate) fn bit(words: &[u64], index: usize) -> bool {
    words.get(index / 64).is_some_and(|word| word >> (index % 64) & 1 != 0)
}

impl Content {
    /// Fills `cover.len()` cells from pairs of a cell and an object's index, in ascending order of the index.
    /// Pairs that name no cell or no object are left out. `cover` has for each cell the share of rays along
    /// x, y and z that its content stops, from 0 to 255; the fourth byte is ignored.
    ///
    /// A cell may hold only objects that meet its bounds. Otherwise a culler may take a triangle that faces
    /// the eye for one that faces away.
    ///
    /// Cost: O(n log n) in the number of pairs and of the scene's triangles.
    pub fn new(scene: &Scene, pairs: &[(u32, u32)], mut cover: Vec<[u8; 4]>) -> Self {
        let is_known = |&(cell, object): &(u32, u32)| {
            (cell as usize) < cover.len() && scene.id_at(object as usize).is_some()
        };
        let known: Vec<_>;
        let pairs = if pairs.iter().all(is_known) {
            pairs
        } else {
            known = pairs.iter().copied().filter(is_known).collect();
            &known
        };
        let IndexLists { mut starts, mut items } = IndexLists::new(cover.len(), pairs);
        let max_count = starts.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(0);
        let classes = classes_of(scene);
        let mut lists = Vec::new();
        let mut side_count = 0;
        let mut held = alloc::vec![0u64; scene.index_limit().div_ceil(64)];
        for cell in 0..cover.len() {
            let list = &mut items[starts[cell] as usize..starts[cell + 1] as usize];
            starts[cell] = lists.len() as u32;
            for &mut object in &mut *list {
                held[object as usize / 64] |= 1 << (object % 64);
            }
            side_count += push_list(&mut lists, list, &classes);
            cover[cell][3] = u8::from(!list.is_empty());
        }
        starts[cover.len()] = lists.len() as u32;
        lists.shrink_to_fit();
        let mut content = Self {
            starts,
            lists,
            cover,
            max_count,
            side_count,
            index_limit: scene.index_limit() as u32,
            held,
            normals: NormalBins::new(scene),
            strays: Vec::new(),
            cursor: SceneCursor::at(scene),
            stamp: Stamp::new(),
        };
        content.find_strays(scene);
        content
    }

    /// Content from stored arrays, for the scene that they were made from. `Err` says what does not fit
    /// together.
    pub(crate) fn from_arrays(
        scene: &Scene,
        starts: Vec<u32>,
        cover: Vec<[u8; 4]>,
        lists: Vec<u8>,
        held: Vec<u64>,
    ) -> Result<Self, &'static str> {
        let index_limit = scene.index_limit() as u32;
        let mut content = Self {
            starts,
            lists,
            cover,
            max_count: 0,
            side_count: 0,
            index_limit,
            held,
            normals: NormalBins::new(scene),
            strays: Vec::new(),
            cursor: SceneCursor::at(scene),
            stamp: Stamp::new(),
        };
        let cells = content.cover.len();
        let starts = &content.starts;
        let ascending = starts.windows(2).all(|pair| pair[0] <= pair[1]);
        let ends = starts.first() == Some(&0) && starts.last() == Some(&(content.lists.len() as u32));
        if starts.len() != cells + 1 || !ascending || !ends {
            return Err("the lists of cells do not fit together");
        }
        if content.held.len() != scene.index_limit().div_ceil(64) {
            return Err("the marks of objects are of another number of objects");
        }
        let (mut objects, mut side_count) = (Vec::new(), 0);
        for cell in 0..cells as u32 {
            objects.clear();
            let mut sides = content.sides(cell);
            for mut layers in sides.by_ref() {
                side_count += 1;
                for layer in layers.by_ref() {
                    let before = objects.len();
                    objects.extend(layer);
                    if objects.len() == before || !objects[before..].is_sorted_by(|a, b| a < b) {
                        return Err("a layer of a cell is empty or not in order");
                    }
                }
                if layers.byte_count() > 0 {
                    return Err("the layers of a cell do not fit together");
                }
            }
            if sides.byte_count() > 0 {
                return Err("the list of a cell ends too early");
            }
            if objects.iter().any(|&object| object >= content.index_limit) {
                return Err("a cell names an unknown object");
            }
            if content.cover[cell as usize][3] != u8::from(!objects.is_empty()) {
                return Err("a cell says that it holds something, or nothing, and is wrong");
            }
            content.max_count = content.max_count.max(objects.len() as u32);
        }
        content.side_count = side_count;
        content.find_strays(scene);
        Ok(content)
    }

    /// Makes strays of all objects that are not held.
    fn find_strays(&mut self, scene: &Scene) {
        let held = &self.held;
        self.strays = scene.ids().filter(|id| !bit(held, id.index())).collect();
    }

    /// Number of cells.
    #[inline]
    pub fn cell_count(&self) -> usize {
        self.cover.len()
    }

    #[inline]
    fn list(&self, cell: u32) -> &[u8] {
        let cell = cell as usize;
        let range = self.starts.get(cell).zip(self.starts.get(cell + 1));
        range.and_then(|(&start, &end)| self.lists.get(start as usize..end as usize)).unwrap_or(&[])
    }

    /// Objects of a cell by the side that they face. Empty for an unknown cell.
    #[inline]
    pub(crate) fn sides(&self, cell: u32) -> Sides<'_> {
        Sides::new(self.list(cell))
    }

    /// Indices of the objects in a cell, each once, in no particular order. Empty for an unknown cell.
    #[inline]
    pub fn primitives(&self, cell: u32) -> Primitives<'_> {
        Primitives { sides: self.sides(cell), layers: Layers::default(), layer: Layer::default() }
    }

    /// Number of objects in a cell; 0 for an unknown cell. Cost: proportional to that number.
    #[inline]
    pub fn count(&self, cell: u32) -> u32 {
        self.primitives(cell).count() as u32
    }

    /// Whether a cell holds no object, or is unknown.
    #[inline]
    pub fn is_empty(&self, cell: u32) -> bool {
        self.cover.get(cell as usize).is_none_or(|cover| cover[3] == 0)
    }

    /// Greatest number of objects in a cell; 0 without cells.
    pub fn max_count(&self) -> u32 {
        self.max_count
    }

    /// Number of references: pairs of an object and a cell that holds it. Cost: proportional to that number.
    pub fn reference_count(&self) -> u64 {
        (0..self.cell_count() as u32).map(|cell| u64::from(self.count(cell))).sum()
    }

    /// Share of rays along x, y and z that the content of a cell stops, 0 to 1. Zero for an unknown cell.
    #[inline]
    pub fn cover(&self, cell: u32) -> [f64; 3] {
        let [x, y, z, _] = self.cover.get(cell as usize).copied().unwrap_or_default();
        [x, y, z].map(|share| f64::from(share) * (1.0 / 255.0))
    }

    /// Objects without a cell, which cullers count as visible, in ascending order after a
    /// [`sync`](crate::OctreeTessellation::sync). Changes since the last `sync` are not in it yet.
    pub fn strays(&self) -> &[ObjectId] {
        &self.strays
    }

    /// Whether an object is in all cells that it meets, as of the last
    /// [`sync`](crate::OctreeTessellation::sync). Only the index of the id is looked at.
    pub fn holds(&self, id: ObjectId) -> bool {
        bit(&self.held, id.index())
    }

    /// [`Scene::index_limit`] when the cells were filled: one more than the greatest object index.
    pub fn index_limit(&self) -> usize {
        self.index_limit as usize
    }

    /// Identifies what is in which cell: equal stamps, equal cells. A clone has the stamp of its original.
    pub fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// Changes of a scene since the last `sync`. [`Changes::Everything`] for another scene, a clone included.
    pub(crate) fn changes<'a>(&self, scene: &'a Scene) -> Changes<'a> {
        self.cursor.peek(scene)
    }

    /// Makes strays of all objects that have changed since the last call. False if the changes are unknown,
    /// which changes nothing, or if more than an eighth of all objects are strays: then the tessellation
    /// should be rebuilt.
    pub(crate) fn sync(&mut self, scene: &Scene) -> bool {
        let Changes::Objects(changed) = self.changes(scene) else { return false };
        for &id in changed {
            if let Some(word) = self.held.get_mut(id.index() / 64) {
                *word &= !(1 << (id.index() % 64));
            }
        }
        self.strays.extend_from_slice(changed);
        self.strays.retain(|&id| scene.contains(id));
        self.strays.sort_unstable();
        self.strays.dedup();
        self.cursor = SceneCursor::at(scene);
        self.strays.len() <= scene.len() / 8
    }

    /// A clone that is up to date with a scene. If the changes are unknown, all objects are strays.
    pub(crate) fn synced(&self, scene: &Scene) -> Self {
        let mut content = self.clone();
        if let Changes::Everything = content.changes(scene) {
            content.held.fill(0);
        }
        content.sync(scene);
        content.held.resize(scene.index_limit().div_ceil(64), 0);
        content
    }

    /// Heap memory in bytes.
    pub(crate) fn memory(&self) -> usize {
        size_of_val(&self.starts[..])
            + size_of_val(&self.lists[..])
            + size_of_val(&self.cover[..])
            + size_of_val(&self.held[..])
            + self.normals.memory()
            + size_of_val(&self.strays[..])
    }
}

/// Iterator over the indices of the objects in a cell, from [`Content::primitives`].
///
/// ```
/// use visibility_core::Scene;
/// let content = visibility_plp::Content::new(&Scene::new(), &[], vec![[0; 4]]);
/// assert_eq!(content.primitives(0).count(), 0);
/// ```
#[derive(Clone, Debug)]
pub struct Primitives<'a> {
    sides: Sides<'a>,
    layers: Layers<'a>,
    layer: Layer<'a>,
}

impl Iterator for Primitives<'_> {
    type Item = u32;

    #[inline]
    fn next(&mut self) -> Option<u32> {
        loop {
            if let Some(object) = self.layer.next() {
                return Some(object);
            }
            match self.layers.next() {
                Some(layer) => self.layer = layer,
                None => self.layers = self.sides.next()?,
            }
        }
    }
}

/// Class and lean of every object, by index.
fn classes_of(scene: &Scene) -> Vec<(SurfaceClass, Lean)> {
    let openness = openness_by_index(scene);
    let mut classes = alloc::vec![(SurfaceClass::default(), UNKNOWN_LEAN); scene.index_limit()];
    for id in scene.ids() {
        classes[id.index()] = SurfaceClass::of_object(scene, id, openness[id.index()]);
    }
    classes
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Aabb;

    #[test]
    fn lists_of_any_numbers_come_back() {
        let mut scene = Scene::new();
        scene.insert_batch((0..70_000).map(|i| Aabb::from_arrays([i as f32; 3], [i as f32 + 1.0; 3])));
        let objects = [0, 1, 127, 128, 255, 16_383, 16_384, 32_767, 69_999];
        let pairs: Vec<_> = objects.iter().flat_map(|&o| [(1, o), (0, o)]).chain([]).collect();
        let content = Content::new(&scene, &pairs, alloc::vec![[0; 4]; 3]);
        assert_eq!(content.primitives(0).collect::<Vec<_>>(), objects);
        assert_eq!(content.primitives(1).collect::<Vec<_>>(), objects);
        assert_eq!((content.primitives(2).count(), content.primitives(9).count()), (0, 0));
        assert_eq!((content.count(1), content.count(2), content.max_count()), (9, 0, 9));
        assert_eq!(content.strays().len(), 70_000 - objects.len());
    }
}
