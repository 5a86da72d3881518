//! Simulated server of a shooter: players who walk through a level, and other things in it. Used by the
//! program `server`.

pub mod level;
mod ray_tree;

use glam::DVec3;
use level::Level;
use visibility_core::who_sees::Reach;
use visibility_testing::Random;

/// Person who walks from place to place.
#[derive(Clone, Copy, Debug)]
pub struct Walker {
    eye: DVec3,
    /// Index of the place that the walker comes from, then of the place that it walks to.
    from: usize,
    to: usize,
}

impl Walker {
    /// Puts a walker at a random place.
    pub fn new(level: &Level, random: &mut Random) -> Self {
        let place = random.below(level.places.len());
        Self { eye: level.places[place], from: place, to: place }
    }

    /// Returns the position of the walker's eyes in world space.
    pub fn eye(&self) -> DVec3 {
        self.eye
    }

    /// Walks `metres` further, from place to place. Turns back only at a dead end.
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

/// Returns whether one of nine rays from an eye to the middle and the corners of a target is free, which is
/// the test of present servers.
pub fn nine_rays_reach(level: &Level, eye: DVec3, target: &Reach) -> bool {
    let corners = (0..8).map(|i| {
        let side = |axis: usize| if i >> axis & 1 == 0 { target.min[axis] } else { target.max[axis] };
        DVec3::new(side(0), side(1), side(2))
    });
    std::iter::once((target.min + target.max) * 0.5).chain(corners).any(|p| level.is_free(eye, p))
}
