//! Streaming cache: objects are loaded when they become visible, and unloaded some frames after they became
//! hidden.
//!
//! The visible set lists the objects that became visible or hidden since the frame before, so the cost of a
//! frame is proportional to the changes and not to the number of objects.

use std::collections::{HashMap, VecDeque};
use visibility_core::{ObjectId, Scene, VisibleSet};

/// Totals of a streaming cache since its creation, and its present size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Number of times that an object was loaded; an object that leaves and returns counts twice.
    pub loads: u64,
    /// Number of times that an object was unloaded.
    pub unloads: u64,
    /// Number of times that an object became visible again while it was still in memory.
    pub spared: u64,
    /// Number of triangles of the objects in memory now.
    pub resident: u64,
    /// Largest number of triangles that were in memory at one time.
    pub peak: u64,
}

/// Record of an object in memory.
#[derive(Clone, Copy)]
struct Resident {
    /// Number of triangles of the object at the time when it was loaded.
    size: u64,
    /// Number of the frame in which the object became hidden, or `None` while it is visible.
    hidden: Option<u64>,
}

/// Cache of objects in memory: holds the visible objects, and hidden objects for some frames more.
pub struct Cache {
    /// Number of frames that an object stays in memory after it became hidden, so that a camera that turns
    /// away and back does not load twice.
    patience: u64,
    frame: u64,
    /// Records of the objects in memory, by object id.
    resident: HashMap<ObjectId, Resident>,
    /// Queue of (frame, object) for each time that an object became hidden, oldest frame first. An entry is
    /// obsolete when the object has become visible since.
    waiting: VecDeque<(u64, ObjectId)>,
    traffic: Traffic,
}

impl Cache {
    /// Creates an empty cache that keeps an object for `patience` frames after it became hidden. With 0 the
    /// object leaves in the frame in which it becomes hidden.
    pub fn new(patience: u64) -> Self {
        Self {
            patience,
            frame: 0,
            resident: HashMap::new(),
            waiting: VecDeque::new(),
            traffic: Traffic::default(),
        }
    }

    /// Advances the cache by one frame: loads the newly visible objects and unloads objects hidden for
    /// `patience` frames. `visible` must have been created by [`VisibleSet::with_changes`] and hold the
    /// result of culling `scene` in this frame.
    pub fn update(&mut self, scene: &Scene, visible: &VisibleSet) {
        self.frame += 1;
        for id in visible.newly_visible() {
            if let Some(resident) = self.resident.get_mut(&id) {
                resident.hidden = None;
                self.traffic.spared += 1;
            } else {
                let size = scene.object(id).map_or(0, |object| u64::from(object.cost));
                self.resident.insert(id, Resident { size, hidden: None });
                self.traffic.loads += 1;
                self.traffic.resident += size;
            }
        }
        self.traffic.peak = self.traffic.peak.max(self.traffic.resident);
        for id in visible.newly_hidden() {
            if let Some(resident) = self.resident.get_mut(&id) {
                resident.hidden = Some(self.frame);
                self.waiting.push_back((self.frame, id));
            }
        }
        while let Some(&(hidden, id)) = self.waiting.front() {
            if hidden + self.patience > self.frame {
                break;
            }
            self.waiting.pop_front();
            // Skips an object that has become visible since, and perhaps hidden again later.
            if let Some(resident) = self.resident.get(&id).copied().filter(|r| r.hidden == Some(hidden)) {
                self.resident.remove(&id);
                self.traffic.unloads += 1;
                self.traffic.resident -= resident.size;
            }
        }
    }

    /// Returns true if the object is in memory, so that it can be drawn.
    pub fn holds(&self, id: ObjectId) -> bool {
        self.resident.contains_key(&id)
    }

    /// Returns the totals since the cache was created.
    pub fn traffic(&self) -> Traffic {
        self.traffic
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in;
    use crate::walkthrough::{World, cullers};

    #[test]
    fn what_is_visible_is_always_in_memory_and_the_rest_leaves() {
        let world = World::new(built_in("office").unwrap(), (64, 36), Some(300)).unwrap();
        let mut pipeline = cullers::parse("frustum", &world).unwrap().remove(0).1;
        let (mut visible, mut cache) = (VisibleSet::with_changes(), Cache::new(5));
        for view in &world.views {
            pipeline.cull(&world.scene, view, &mut visible);
            cache.update(&world.scene, &visible);
            assert!(visible.iter(&world.scene).all(|id| cache.holds(id)));
        }
        // All objects are out of view for six frames.
        let away = world.views[0].with_layers(0);
        for _ in 0..6 {
            pipeline.cull(&world.scene, &away, &mut visible);
            cache.update(&world.scene, &visible);
        }
        let traffic = cache.traffic();
        assert_eq!((traffic.resident, traffic.loads), (0, traffic.unloads));
        assert!(traffic.spared > 0 && traffic.peak > 0 && traffic.loads > 700, "{traffic:?}");
    }
}
