//! Keeping in memory what can be seen: objects are loaded as they become visible and unloaded some time after
//! they were hidden.
//!
//! The visible set says what appeared and what vanished since the frame before, so a frame costs what
//! changed, not what is there.

use std::collections::{HashMap, VecDeque};
use visibility_core::{ObjectId, Scene, VisibleSet};

/// What a streaming cache did so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Objects loaded.
    pub loads: u64,
    /// Objects unloaded.
    pub unloads: u64,
    /// Objects that were wanted back before their time to be unloaded had come.
    pub spared: u64,
    /// Triangles in memory now.
    pub resident: u64,
    /// The most triangles that were in memory at a time.
    pub peak: u64,
}

/// An object in memory.
#[derive(Clone, Copy)]
struct Resident {
    /// What it takes, as it was when it was loaded.
    size: u64,
    /// The frame in which it was hidden, or `None` while it is visible.
    hidden: Option<u64>,
}

/// Which objects are in memory.
pub struct Cache {
    /// Frames that an object stays after it was hidden: who turns round and back should not load twice.
    patience: u64,
    frame: u64,
    /// What is in memory.
    resident: HashMap<ObjectId, Resident>,
    /// Hidden objects by the frame in which that happened, oldest first.
    waiting: VecDeque<(u64, ObjectId)>,
    traffic: Traffic,
}

impl Cache {
    /// An empty cache that keeps hidden objects for so many frames.
    pub fn new(patience: u64) -> Self {
        Self {
            patience,
            frame: 0,
            resident: HashMap::new(),
            waiting: VecDeque::new(),
            traffic: Traffic::default(),
        }
    }

    /// Takes in what a frame has changed. The set must be one [with changes](VisibleSet::with_changes).
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
            // Unless it has been seen, or seen and hidden again, since.
            if let Some(resident) = self.resident.get(&id).copied().filter(|r| r.hidden == Some(hidden)) {
                self.resident.remove(&id);
                self.traffic.unloads += 1;
                self.traffic.resident -= resident.size;
            }
        }
    }

    /// Whether an object can be drawn.
    pub fn holds(&self, id: ObjectId) -> bool {
        self.resident.contains_key(&id)
    }

    /// What was done so far.
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
        // Then nothing is in view for a while.
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
