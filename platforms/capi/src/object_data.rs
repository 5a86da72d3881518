//! What an engine tells of each object once, and levels of detail and draw lists ask for in every frame.

use std::collections::BTreeMap;
use std::iter::repeat;
use visibility_core::scene::SceneError;
use visibility_core::{ObjectId, Scene};

/// Greatest number of sizes that divide the levels of detail of an object: a level is a byte in the crates.
pub(crate) const MOST_SIZES: usize = 255;

/// Greatest key of an object in draw lists: the sum of a key and a level has 32 bits.
pub(crate) const GREATEST_KEY: u32 = u32::MAX - MOST_SIZES as u32;

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

/// Returns an error if an object is not in the scene.
fn check(scene: &Scene, ids: &[u64]) -> Result<(), SceneError> {
    let unknown = ids.iter().map(|&id| ObjectId::from_bits(id)).find(|&id| !scene.contains(id));
    unknown.map_or(Ok(()), |id| Err(SceneError::UnknownObject(id)))
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

    /// Calls `change` with the entry of each object and its element of `values`. All objects are in the
    /// scene.
    fn change<T>(
        &mut self,
        scene: &Scene,
        ids: &[u64],
        values: impl IntoIterator<Item = T>,
        mut change: impl FnMut(&mut Entry, T),
    ) {
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
    }

    /// Gives objects the same sizes. An error, and no change, if an object is not in the scene.
    pub(crate) fn set_sizes(&mut self, scene: &Scene, ids: &[u64], sizes: &[f32]) -> Result<(), SceneError> {
        check(scene, ids)?;
        let place = if ids.is_empty() { None } else { self.place_of(sizes) };
        self.change(scene, ids, repeat(place), |entry, place| entry.sizes = place);
        Ok(())
    }

    /// Gives each object its key. An error, and no change, if an object is not in the scene.
    pub(crate) fn set_keys(&mut self, scene: &Scene, ids: &[u64], keys: &[u32]) -> Result<(), SceneError> {
        check(scene, ids)?;
        self.change(scene, ids, keys, |entry, &key| entry.key = key);
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

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::Aabb;

    /// Lists of sizes stay as long as the scene, so lists that no object was given are not stored.
    #[test]
    fn refused_sizes_are_not_kept() {
        let (mut scene, mut data) = (Scene::new(), ObjectData::default());
        let id = scene.insert(Aabb::from_arrays([0.0; 3], [1.0; 3])).to_bits();
        assert!(data.set_sizes(&scene, &[id, id + 1], &[9.0]).is_err(), "an unknown object");
        assert!(data.set_sizes(&scene, &[], &[8.0]).is_ok(), "no object");
        assert_eq!((data.lists.len(), data.places.len()), (0, 0), "lists of no object");
        for sizes in [[7.0], [6.0], [7.0]] {
            data.set_sizes(&scene, &[id], &sizes).expect("an object of the scene");
            assert_eq!(data.sizes(ObjectId::from_bits(id)), sizes, "the sizes of the object");
        }
        assert_eq!((data.lists.len(), data.places.len()), (2, 2), "each different list once");
    }
}
