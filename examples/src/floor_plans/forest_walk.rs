//! Walk through a forest: which trunks are seen at each step, and an animated picture of the steps.

use super::drawing::Drawing;
use crate::recipes::random::Random;
use std::f64::consts::TAU;
use std::time::Instant;
use visibility_2d::discs::{Disc, DiscError, DiscView, DiscZone, Discs, KineticZone};

/// Side in metres of the square that each tree has on average, as in the forest of the paper on visible
/// zones. Trees with a radius of more than a third of it have squares with sides of three radii.
const SPACING: f64 = 4.5;

/// Number of steps around the circle of the walk.
pub const STEPS: usize = 1024;

/// Radius in metres of the circle of the walk, for steps of 5 cm.
const CIRCLE: f64 = 0.05 * STEPS as f64 / TAU;

/// Reach in metres of the classes of the zone that is kept from step to step.
pub const REACH: f64 = 4.0;

/// Width in metres of the strip around the walk that the picture shows.
const MARGIN: f64 = 60.0;

/// Duration in seconds of a step in the animation.
const SECONDS: f64 = 0.4;

/// Step of a walk.
#[derive(Clone, Debug)]
pub struct Step {
    /// Position of the eye in metres.
    pub eye: [f64; 2],
    /// Numbers of the trees seen, roughly nearest first.
    pub seen: Vec<u32>,
    /// Time of the query in microseconds, the median of five.
    pub us: f64,
    /// Time in microseconds to move a zone that is kept from step to step.
    pub kept_us: f64,
    /// Elementary steps of this move, and classes that ended in it.
    pub kept_work: [usize; 2],
}

/// Trees of a forest, and the trees seen at each step of a walk in its middle.
#[derive(Clone, Debug)]
pub struct ForestWalk {
    /// Trunks as discs.
    pub trees: Vec<Disc>,
    /// Steps of the walk, in order.
    pub steps: Vec<Step>,
}

/// Returns the side in metres of the square forest of `count` trees.
pub fn side(count: usize, radius: f64) -> f64 {
    (count as f64).sqrt().ceil() * SPACING.max(3.0 * radius)
}

/// Returns the eye at a step of the circular walk around the middle of a forest of this side.
pub fn eye(step: usize, side: f64) -> [f64; 2] {
    let (sin, cos) = (step as f64 * TAU / STEPS as f64).sin_cos();
    [0.5 * side + CIRCLE * cos, 0.5 * side + CIRCLE * sin]
}

/// Plants `count` disjoint trees at random, and fells those on the circle of the walk.
pub fn plant(count: usize, radius: f64) -> Vec<Disc> {
    let (random, side) = (&mut Random::new(1), side(count, radius));
    let squares = (count as f64).sqrt().ceil() as usize;
    let square = side / squares as f64;
    let mut in_square = vec![Vec::<u32>::new(); squares * squares];
    let mut trees: Vec<Disc> = Vec::new();
    while trees.len() < count {
        let center = [0, 1].map(|_| random.between(0.0, side));
        let [x, y] = center.map(|x| ((x / square) as usize).min(squares - 1));
        let near = (x.max(1) - 1..(x + 2).min(squares))
            .flat_map(|x| (y.max(1) - 1..(y + 2).min(squares)).map(move |y| x * squares + y));
        let is_free = near.flat_map(|square| &in_square[square]).all(|&other| {
            let other: Disc = trees[other as usize];
            (other.center[0] - center[0]).hypot(other.center[1] - center[1]) > 2.01 * radius
        });
        if is_free {
            in_square[x * squares + y].push(trees.len() as u32);
            trees.push(Disc { center, radius });
        }
    }
    trees.retain(|tree| {
        let [x, y] = tree.center.map(|x| x - 0.5 * side);
        (x.hypot(y) - CIRCLE).abs() > radius + 0.1
    });
    trees
}

impl ForestWalk {
    /// Plants `count` trees of this radius in metres, without those that are in the way, and walks `steps`
    /// steps of 5 cm on a circle in the middle of the forest.
    ///
    /// # Errors
    ///
    /// Returns [`DiscError`] for an invalid radius or too many trees.
    pub fn new(count: usize, radius: f64, steps: usize) -> Result<Self, DiscError> {
        // An invalid radius is refused before trees are planted by it.
        Discs::new(&[Disc { center: [0.0; 2], radius }])?;
        let (trees, side) = (plant(count, radius), side(count, radius));
        let discs = Discs::new(&trees)?;
        let (mut zone, mut seen) = (DiscZone::new(), Vec::new());
        let mut kept = KineticZone::new(&discs, REACH);
        kept.move_to(eye(0, side));
        let steps = (1..=steps)
            .map(|step| {
                let eye = eye(step, side);
                let mut times = [0.0; 5];
                for time in &mut times {
                    let start = Instant::now();
                    zone.look(&discs, &DiscView::new(eye), &mut seen);
                    *time = start.elapsed().as_secs_f64() * 1e6;
                }
                times.sort_unstable_by(f64::total_cmp);
                let start = Instant::now();
                kept.move_to(eye);
                let kept_us = start.elapsed().as_secs_f64() * 1e6;
                let work = kept.work();
                Step { eye, seen: seen.clone(), us: times[2], kept_us, kept_work: [work.steps, work.ended] }
            })
            .collect();
        Ok(Self { trees, steps })
    }

    /// Draws the trees around the walk. Trees seen at any step are green. One step after another, the picture
    /// shows the eye, and in red the trees that it sees.
    pub fn draw(&self) -> String {
        let mut near: Vec<_> = self.steps.iter().flat_map(|step| step.seen.iter().copied()).collect();
        near.sort_unstable();
        near.dedup();
        let shown = |tree: u32| self.trees[tree as usize];
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for step in &self.steps {
            for axis in 0..2 {
                low[axis] = low[axis].min(step.eye[axis] - MARGIN);
                high[axis] = high[axis].max(step.eye[axis] + MARGIN);
            }
        }
        if self.steps.is_empty() {
            (low, high) = ([0.0; 2], [1.0; 2]);
        }
        let mut drawing = Drawing::new([low, high], false);
        let is_inside = |disc: &Disc| (0..2).all(|k| low[k] < disc.center[k] && disc.center[k] < high[k]);
        for tree in self.trees.iter().filter(|tree| is_inside(tree)) {
            drawing.disc(tree.center, tree.radius, "#d8d8d0");
        }
        for &tree in near.iter().filter(|&&tree| is_inside(&shown(tree))) {
            drawing.disc(shown(tree).center, shown(tree).radius, "#8fb98a");
        }
        drawing.lines(self.steps.windows(2).map(|pair| [pair[0].eye, pair[1].eye]), "stroke:#888");
        let count = self.steps.len();
        for (index, step) in self.steps.iter().enumerate() {
            drawing.begin_frame(index, count, SECONDS);
            for &tree in &step.seen {
                drawing.disc(shown(tree).center, shown(tree).radius, "#c22");
            }
            drawing.lines(step.seen.iter().map(|&tree| [step.eye, shown(tree).center]), "stroke:#c226");
            drawing.dot(step.eye, "#222");
            drawing.end_frame();
        }
        drawing.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_step_sees_the_trees_that_it_has_a_line_to() {
        let walk = ForestWalk::new(2000, 0.5, 4).unwrap();
        for step in &walk.steps {
            // A segment from the eye to the middle of the tree must pass all other trees.
            let is_clear = |tree: usize| {
                let to = [0, 1].map(|k| walk.trees[tree].center[k] - step.eye[k]);
                let length = to[0].hypot(to[1]);
                walk.trees.iter().enumerate().all(|(other, disc)| {
                    let at = [0, 1].map(|k| disc.center[k] - step.eye[k]);
                    let (along, aside) = (
                        (at[0] * to[0] + at[1] * to[1]) / length,
                        (at[0] * to[1] - at[1] * to[0]).abs() / length,
                    );
                    other == tree || !(0.0..length).contains(&along) || aside > disc.radius
                })
            };
            for tree in 0..walk.trees.len() {
                assert!(!is_clear(tree) || step.seen.contains(&(tree as u32)), "tree {tree}");
            }
            assert!(step.seen.len() > 20 && step.seen.len() < 500, "{}", step.seen.len());
        }
        let picture = walk.draw();
        assert_eq!(picture.matches("<g ").count(), 4, "groups: a picture for each step");
        assert_eq!(picture.matches("<g ").count(), picture.matches("</g>").count(), "each group ends");
        assert!(ForestWalk::new(10, f64::NAN, 1).is_err(), "a radius of NaN");
        assert!(ForestWalk::new(0, 1.0, 0).unwrap().draw().starts_with("<svg"), "a forest without trees");
    }
}
