//! Moving objects: a random subset of the boxes, each of which moves along its own direction.

use crate::workload::{REACH, Random};
use glam::Vec3;
use visibility_core::{Aabb, ObjectId};

/// Number of frames of movement after which culling is compared with culling a rebuilt scene: one second of
/// play.
pub const DRIFT: usize = 60;

/// Numbers of frames of movement after which culling is measured, up to a long run.
pub const LONG: [usize; 6] = [0, 60, 250, 500, 750, 1000];

/// Budget, in blocks per call of `Scene::maintain`, that users are likely to start with.
pub const BUDGET: usize = 256;

/// All boxes of a scene. Some move by a fixed step per frame while the others stand still, as in most games.
#[derive(Clone, Debug)]
pub struct Movers {
    boxes: Vec<Aabb>,
    steps: Vec<Vec3>,
    moved: Vec<(ObjectId, Aabb)>,
}

impl Movers {
    /// Maximum step per frame on each axis, in metres: about the speed of a car in town at 60 frames per
    /// second.
    const STEP: f32 = 0.25;

    /// Selects `count` random boxes to move. `ids` are the scene's ids of all boxes, by the index of the box.
    pub fn new(boxes: Vec<Aabb>, ids: &[ObjectId], count: usize) -> Self {
        let mut random = Random(2);
        let chosen = random.choose(count, boxes.len());
        Self {
            steps: chosen.iter().map(|_| random.point(-Self::STEP, Self::STEP)).collect(),
            moved: chosen.iter().map(|&i| (ids[i as usize], boxes[i as usize])).collect(),
            boxes,
        }
    }

    /// Returns the bounds of all boxes in the present frame, by the index of the box, moving or not.
    pub fn boxes(&self) -> &[Aabb] {
        &self.boxes
    }

    /// Moves each mover by its step. If the centre would leave the workload's cube on an axis, the step on
    /// this axis is reversed first. Returns the ids and new bounds of all movers.
    pub fn step(&mut self) -> &[(ObjectId, Aabb)] {
        for ((id, b), step) in self.moved.iter_mut().zip(&mut self.steps) {
            let center = b.center() + *step;
            let outside = center.abs().cmpgt(Vec3::splat(REACH));
            *step = Vec3::select(outside, -center.signum() * step.abs(), *step);
            *b = Aabb::new(b.min + *step, b.max + *step);
            self.boxes[id.index()] = *b;
        }
        &self.moved
    }
}
