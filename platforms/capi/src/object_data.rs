//! What an engine tells of each object once, and levels of detail and draw lists ask for in every frame.

use crate::error::{Error, border, vis_status};
use crate::pointer::{array, reference};
use crate::scene::{State, vis_scene};
use std::collections::BTreeMap;
use visibility_core::scene::SceneError;
use visibility_core::{ObjectId, Scene};

/// Greatest number of sizes that divide the levels of detail of an object: a level is a byte in the crates.
const MOST_SIZES: usize = 255;

/// Greatest key of an object in draw lists: the sum of a key and a level has 32 bits.
const GREATEST_KEY: u32 = u32::MAX - MOST_SIZES as u32;

/// Data of objects by index. Data of an object that was removed are those of no object.
#[derive(Debug, Default)]
pub(crate) struct ObjectData {
    entries: Vec<Entry>,
    /// Lists of sizes, each once. Lists that no object has any more stay.
    lists: Vec<Box<[f32]>>,
    /// For the bits of each list, its place in `lists`.
    places: BTreeMap<Box<[u32]>, usize>,
}

/// Data of the object `id`.
#[derive(Clone, Copy, Debug)]
struct Entry {
    id: ObjectId,
    /// Place of the object's sizes in `lists`. `None` if it has no sizes.
    sizes: Option<u32>,
    /// Key of the object in draw lists; at most `GREATEST_KEY`.
    key: u32,
}

impl Entry {
    const fn new(id: ObjectId) -> Self {
        Self { id, sizes: None, key: 0 }
    }
}

impl ObjectData {
    fn get(&self, id: ObjectId) -> Option<&Entry> {
        self.entries.get(id.index()).filter(|entry| entry.id == id)
    }

    /// Returns the sizes in pixels that divide the levels of an object; none for an object without any.
    pub(crate) fn sizes(&self, id: ObjectId) -> &[f32] {
        let place = self.get(id).and_then(|entry| entry.sizes);
        place.and_then(|place| self.lists.get(place as usize)).map_or(&[], |list| list)
    }

    /// Returns the key of an object in draw lists; 0 for an object that was given none.
    pub(crate) fn key(&self, id: ObjectId) -> u32 {
        self.get(id).map_or(0, |entry| entry.key)
    }

    /// Calls `change` with the entry of each object and its element of `values`. An error, and no call, if an
    /// object is not in the scene.
    fn change<T>(
        &mut self,
        scene: &Scene,
        ids: &[u64],
        values: impl IntoIterator<Item = T>,
        mut change: impl FnMut(&mut Entry, T),
    ) -> Result<(), SceneError> {
        let unknown = ids.iter().map(|&id| ObjectId::from_bits(id)).find(|&id| !scene.contains(id));
        if let Some(id) = unknown {
            return Err(SceneError::UnknownObject(id));
        }
        if self.entries.len() < scene.index_limit() {
            self.entries.resize(scene.index_limit(), Entry::new(ObjectId::PLACEHOLDER));
        }
        for (&id, value) in ids.iter().zip(values) {
            let id = ObjectId::from_bits(id);
            let Some(entry) = self.entries.get_mut(id.index()) else { continue };
            if entry.id != id {
                *entry = Entry::new(id);
            }
            change(entry, value);
        }
        Ok(())
    }

    /// Returns the place of a list of sizes in `lists`, where it is stored unless it is there already. `None`
    /// for an empty list.
    fn place_of(&mut self, sizes: &[f32]) -> Option<u32> {
        if sizes.is_empty() {
            return None;
        }
        let bits = sizes.iter().map(|size| size.to_bits()).collect();
        let Self { lists, places, .. } = self;
        let place = *places.entry(bits).or_insert_with(|| {
            lists.push(sizes.into());
            lists.len() - 1
        });
        u32::try_from(place).ok()
    }
}

/// Gives `count` objects the same levels of detail, those of their mesh, for `vis_lods_select`: `sizes` are
/// the sizes in pixels that divide the levels, at most 255, positive and finite. With 200 and 50, level 0 is
/// for 200 pixels and more, level 1 for 50 and more, level 2 for all below. Without sizes, as for new
/// objects, the level is 0. If an id is unknown, nothing changes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_lod_sizes(
    scene: *mut vis_scene,
    ids: *const u64,
    count: usize,
    sizes: *const f32,
    size_count: usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, ids) = unsafe { (reference(scene, "scene")?, array(ids, count, "ids")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let sizes = unsafe { array(sizes, size_count, "sizes") }?;
        if sizes.len() > MOST_SIZES {
            return Err(Error::argument(format_args!("{size_count} sizes are more than {MOST_SIZES}")));
        }
        if let Some(wrong) = sizes.iter().position(|&size| !(size > 0.0 && size.is_finite())) {
            let size = sizes[wrong];
            return Err(Error::argument(format_args!("size {wrong} cannot be {size}")));
        }
        let State { scene, data, .. } = &mut *scene.write()?;
        let place = data.place_of(sizes);
        Ok(data.change(scene, ids, std::iter::repeat(place), |entry, place| entry.sizes = place)?)
    })
}

/// Gives `count` objects their keys in draw lists: the number of the mesh, the material, the first level of
/// the mesh, or several of them in one number; at most 4294967040. New objects have key 0. If an id is
/// unknown, nothing changes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vis_scene_set_draw_keys(
    scene: *mut vis_scene,
    ids: *const u64,
    keys: *const u32,
    count: usize,
) -> vis_status {
    border(|| {
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let (scene, ids) = unsafe { (reference(scene, "scene")?, array(ids, count, "ids")?) };
        // SAFETY: by rule P1 of `visibility.h`, each pointer is null or valid to read.
        let keys = unsafe { array(keys, count, "keys") }?;
        if let Some(key) = keys.iter().find(|&&key| key > GREATEST_KEY) {
            return Err(Error::argument(format_args!("the key {key} is more than {GREATEST_KEY}")));
        }
        let State { scene, data, .. } = &mut *scene.write()?;
        Ok(data.change(scene, ids, keys, |entry, &key| entry.key = key)?)
    })
}
