//! Streaming cache: objects are loaded when they become visible, or earlier if they are announced, and
//! unloaded some frames after they became hidden.
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
    /// Number of loads of an object before it became visible.
    pub ahead: u64,
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

/// Cache of objects in memory: holds the visible objects, and hidden objects for some more frames.
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
                self.load(scene, id, None);
            }
        }
        for id in visible.newly_hidden() {
            if let Some(resident) = self.resident.get_mut(&id) {
                resident.hidden = Some(self.frame);
                self.waiting.push_back((self.frame, id));
            }
        }
        while let Some(&(hidden, id)) = self.waiting.front() {
            if hidden.saturating_add(self.patience) > self.frame {
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

    /// Loads an object that will become visible, or keeps it in memory. It stays for `patience` frames after
    /// its last announcement. Call this after [`update`](Self::update).
    pub fn announce(&mut self, scene: &Scene, id: ObjectId) {
        match self.resident.get_mut(&id) {
            Some(Resident { hidden: None, .. }) => return,
            Some(resident) => resident.hidden = Some(self.frame),
            None => {
                self.load(scene, id, Some(self.frame));
                self.traffic.ahead += 1;
            }
        }
        self.waiting.push_back((self.frame, id));
    }

    fn load(&mut self, scene: &Scene, id: ObjectId, hidden: Option<u64>) {
        let size = scene.object(id).map_or(0, |object| u64::from(object.cost));
        self.resident.insert(id, Resident { size, hidden });
        self.traffic.loads += 1;
        self.traffic.resident += size;
        self.traffic.peak = self.traffic.peak.max(self.traffic.resident);
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
    use std::sync::Arc;
    use visibility_bake::{BakedSet, Grid};
    use visibility_core::glam::DVec3;
    use visibility_core::pvs::{Prefetch, PvsCuller, Viewcells};
    use visibility_core::{Pipeline, Pose, View};

    #[test]
    fn the_greatest_patience_keeps_everything() {
        let (mut scene, mut visible) = (Scene::new(), VisibleSet::new().with_changes());
        scene.insert(visibility_core::Aabb::from_arrays([5.0, -1.0, -1.0], [6.0, 1.0, 1.0]));
        let mut pipeline = Pipeline::new().with(visibility_core::FrustumCuller::new());
        let mut cache = Cache::new(u64::MAX);
        for x in [1.0, -1.0, 1.0, -1.0] {
            let pose = Pose::look_at(DVec3::ZERO, DVec3::X * x, DVec3::Z);
            let view = View::perspective(pose, 1.0, 1.0, 0.1, 100.0).unwrap();
            pipeline.cull(&scene, &view, &mut visible);
            cache.update(&scene, &visible);
        }
        assert_eq!((cache.traffic().loads, cache.traffic().unloads), (1, 0), "loaded once");
    }

    #[test]
    fn what_a_prefetch_announces_is_there_before_it_becomes_visible() {
        let world = World::new(built_in("office").unwrap(), (64, 36), Some(1)).unwrap();
        let scene = &world.scene;
        // Each viewcell along a straight line sees the objects that are at most 8 metres away.
        let grid = Grid::new(DVec3::ZERO, DVec3::splat(2.0)).unwrap();
        let cells = grid.over(DVec3::ZERO, DVec3::new(20.0, 2.0, 2.0)).unwrap();
        let near = |cell: &visibility_core::pvs::Viewcell| {
            let middle = (cell.min + cell.max) * 0.5;
            let distance = |id| (scene.bounds(id).unwrap().center().as_dvec3() - middle).length();
            let mut row: Vec<u32> =
                scene.ids().filter(|&id| distance(id) < 8.0).map(|id| id.index() as u32).collect();
            row.sort_unstable();
            row
        };
        let rows: Vec<Vec<u32>> = cells.iter().map(near).collect();
        let set = BakedSet::from_rows(scene, Viewcells::new(cells), &rows).unwrap();
        let sets = Arc::new(set.for_scene(scene).unwrap());
        let mut late = Vec::new();
        for seconds in [0.0, 0.5] {
            let mut pipeline = Pipeline::new().with(PvsCuller::new(sets.clone()));
            let (mut visible, mut cache) = (VisibleSet::new().with_changes(), Cache::new(3));
            let (mut prefetch, mut first) = (Prefetch::new(), 0);
            // The path ends before the last viewcells, so that none is announced without being reached.
            for frame in 0..160 {
                let eye = DVec3::new(1.0 + f64::from(frame) * 0.1, 1.0, 1.0);
                let pose = Pose::look_at(eye, eye + DVec3::X, DVec3::Z);
                let view = View::perspective(pose, 1.0, 1.0, 0.01, 100.0).unwrap();
                pipeline.cull(scene, &view, &mut visible);
                cache.update(scene, &visible);
                assert!(
                    visible.iter(scene).all(|id| cache.holds(id)),
                    "frame {frame}: a visible object is not in memory"
                );
                if frame == 0 {
                    first = cache.traffic().loads;
                }
                // One frame is a tenth of a second of movement.
                for arrival in prefetch.search(&sets, eye, DVec3::X, 0.02, seconds) {
                    cache.announce(scene, arrival.object);
                }
            }
            let Traffic { loads, unloads, ahead, .. } = cache.traffic();
            assert!(unloads > 0, "what is passed leaves");
            late.push((loads - ahead - first, ahead));
        }
        assert!(late[0].0 > 50 && late[0].1 == 0, "{late:?}");
        assert_eq!(late[1], (0, late[0].0), "all but the first are there in time, and no others");
    }

    #[test]
    fn what_is_visible_is_always_in_memory_and_the_rest_leaves() {
        let world = World::new(built_in("office").unwrap(), (64, 36), Some(300)).unwrap();
        let mut pipeline = cullers::parse("frustum", &world).unwrap().remove(0).1;
        let (mut visible, mut cache) = (VisibleSet::new().with_changes(), Cache::new(5));
        for view in &world.views {
            pipeline.cull(&world.scene, view, &mut visible);
            cache.update(&world.scene, &visible);
            assert!(
                visible.iter(&world.scene).all(|id| cache.holds(id)),
                "a visible object is not in memory"
            );
        }
        // For six frames, no object is visible.
        let away = world.views[0].with_layers(0);
        for _ in 0..6 {
            pipeline.cull(&world.scene, &away, &mut visible);
            cache.update(&world.scene, &visible);
        }
        let traffic = cache.traffic();
        assert_eq!(
            (traffic.resident, traffic.loads),
            (0, traffic.unloads),
            "after six frames all has left: {traffic:?}"
        );
        assert!(traffic.spared > 0 && traffic.peak > 0 && traffic.loads > 700, "{traffic:?}");
    }
}
