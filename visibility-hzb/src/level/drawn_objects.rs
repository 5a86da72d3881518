//! The objects whose triangles are in levels, in one table for all levels of a z-buffer.

use super::prepared::are_all_on;
use alloc::vec::Vec;
use hashbrown::HashMap;
use visibility_core::ObjectId;
use visibility_occluders::LevelOccluders;

/// The objects of all levels of a z-buffer. The time of a look-up grows with the number and the lengths of
/// distinct lists of layer masks, not with the number of levels.
#[derive(Clone, Debug, Default)]
pub(crate) struct DrawnObjects {
    /// One group for each distinct list of layer masks. The levels of most worlds have one list in common.
    groups: Vec<Group>,
}

/// The objects of the levels with equal lists of layer masks.
#[derive(Clone, Debug)]
struct Group {
    /// [Layer masks](LevelOccluders::layers) of the levels.
    masks: Vec<u32>,
    /// For each object the number of levels that have it, at least 1.
    levels: HashMap<ObjectId, u32>,
}

impl DrawnObjects {
    /// Adds the objects of a level.
    pub(crate) fn add(&mut self, level: &LevelOccluders) {
        let index = self.groups.iter().position(|group| group.masks == level.layers()).unwrap_or_else(|| {
            self.groups.push(Group { masks: level.layers().to_vec(), levels: HashMap::new() });
            self.groups.len() - 1
        });
        let levels = &mut self.groups[index].levels;
        level.objects().iter().for_each(|&id| *levels.entry(id).or_default() += 1);
    }

    /// Removes the objects of a level that [`add`](Self::add) has added.
    pub(crate) fn remove(&mut self, level: &LevelOccluders) {
        let Some(group) = self.groups.iter_mut().find(|group| group.masks == level.layers()) else { return };
        for id in level.objects() {
            if let Some(levels) = group.levels.get_mut(id) {
                *levels -= 1;
                if *levels == 0 {
                    group.levels.remove(id);
                }
            }
        }
        self.groups.retain(|group| !group.levels.is_empty());
    }

    /// Returns whether an object is in a level that is drawn in a view that shows `layers`.
    pub(crate) fn contains(&self, object: ObjectId, layers: u32) -> bool {
        self.groups.iter().any(|group| are_all_on(&group.masks, layers) && group.levels.contains_key(&object))
    }
}
