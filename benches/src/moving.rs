//! Objects on the move: a part of the boxes, chosen at random, each drifting its own way.

use crate::workload::{REACH, Random};
use glam::Vec3;
use visibility_core::{Aabb, ObjectId};

/// Frames before culling is compared with culling after a rebuild: a second of play.
pub const DRIFT: usize = 60;

/// After so many frames of movement culling is looked at again.
pub const LONG: [usize; 6] = [0, 60, 250, 500, 750, 1000];

/// The budget for `Scene::maintain` that its users are likely to begin with, in blocks.
pub const BUDGET: usize = 256;

/// Some of the boxes and how far each goes in a frame. Everything else stands still, as in most worlds.
#[derive(Clone, Debug)]
pub struct Movers {
    boxes: Vec<Aabb>,
    steps: Vec<Vec3>,
    moved: Vec<(ObjectId, Aabb)>,
}

impl Movers {
    /// Steps are up to this long on each axis, in metres: at 60 frames a second, a car in town.
    const STEP: f32 = 0.25;

    /// Lets `count` of the boxes move. `ids` are those that a scene gave to all of them, in order.
    pub fn new(boxes: Vec<Aabb>, ids: &[ObjectId], count: usize) -> Self {
        let mut random = Random(2);
        let chosen = random.choose(count, boxes.len());
        Self {
            steps: chosen.iter().map(|_| random.point(-Self::STEP, Self::STEP)).collect(),
            moved: chosen.iter().map(|&i| (ids[i as usize], boxes[i as usize])).collect(),
            boxes,
        }
    }

    /// Where all boxes are now.
    pub fn boxes(&self) -> &[Aabb] {
        &self.boxes
    }

    /// Moves each mover by its step, or back into the cube. Returns which they are and where.
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
