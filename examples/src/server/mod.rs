//! A server of a shooter, simulated: players who walk through a level, and things in it. Used by the program
//! `server`.

pub mod level;
mod ray_tree;

use glam::DVec3;
use level::Level;
use visibility_core::who_sees::Reach;
use visibility_testing::Random;

/// Someone who walks from place to place.
#[derive(Clone, Copy, Debug)]
pub struct Walker {
    eye: DVec3,
    /// Place that the walker comes from, and the place that it walks to.
    from: usize,
    to: usize,
}

impl Walker {
    /// Puts a walker at a random place.
    pub fn new(level: &Level, random: &mut Random) -> Self {
        let place = random.below(level.places.len());
        Self { eye: level.places[place], from: place, to: place }
    }

    /// Returns where the walker's eyes are, in world space.
    pub fn eye(&self) -> DVec3 {
        self.eye
    }

    /// Walks so many metres, from place to place, and turns back only where no other way leads on.
    pub fn walk(&mut self, level: &Level, metres: f64, random: &mut Random) {
        let mut left = metres;
        while left > 0.0 {
            let goal = level.places[self.to];
            let distance = self.eye.distance(goal);
            if distance > left {
                self.eye += (goal - self.eye) * (left / distance);
                return;
            }
            (self.eye, left) = (goal, left - distance.max(1e-3));
            let ways = &level.ways[self.to];
            let Some(&(mut next)) = ways.get(random.below(ways.len().max(1))) else { return };
            if next == self.from && ways.len() > 1 {
                next = ways[random.below(ways.len())];
            }
            (self.from, self.to) = (self.to, next);
        }
    }
}

/// Returns whether one of nine rays from an eye reaches a target, its middle or a corner: what servers do
/// today.
pub fn nine_rays_reach(level: &Level, eye: DVec3, target: &Reach) -> bool {
    let corners = (0..8).map(|i| {
        let side = |axis: usize| if i >> axis & 1 == 0 { target.min[axis] } else { target.max[axis] };
        DVec3::new(side(0), side(1), side(2))
    });
    std::iter::once((target.min + target.max) * 0.5).chain(corners).any(|p| level.is_free(eye, p))
}
