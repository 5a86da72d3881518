//! Walk through a forest: which trunks are seen at each step, and an animated picture of the steps.

use super::drawing::Drawing;
use crate::recipes::random::Random;
use std::time::Instant;
use visibility_2d::discs::{Disc, DiscError, DiscView, DiscZone, Discs};

/// Side in metres of the square around each tree.
const SPACING: f64 = 7.0;

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
}

/// Trees of a forest, and the trees seen at each step of a walk through its middle.
#[derive(Clone, Debug)]
pub struct ForestWalk {
    /// Trunks as discs.
    pub trees: Vec<Disc>,
    /// Steps of the walk, in order.
    pub steps: Vec<Step>,
}

impl ForestWalk {
    /// Plants at least `count` trees, one in each square of 7 m, and walks `steps` steps of a quarter of a
    /// metre between them. `radius` is that of the trees, in metres.
    ///
    /// # Errors
    ///
    /// Returns [`DiscError`] for an invalid radius or too many trees.
    pub fn new(count: usize, radius: f64, steps: usize) -> Result<Self, DiscError> {
        let side = (count as f64).sqrt().ceil();
        let random = &mut Random::new(7);
        // Trees get random positions within their squares, so they do not overlap if the squares are large
        // enough.
        let room = (0.5 * SPACING - radius).max(0.0);
        let trees: Vec<_> = (0..(side * side) as usize)
            .map(|k| {
                let at = [k as f64 % side, (k as f64 / side).floor()];
                let center = at.map(|k| (k + 0.5) * SPACING + random.between(-room, room));
                Disc { center, radius }
            })
            .collect();
        let discs = Discs::new(&trees)?;
        let (mut zone, mut seen) = (DiscZone::new(), Vec::new());
        let middle = 0.5 * side * SPACING;
        let steps = (0..steps)
            .map(|k| {
                let along = 0.25 * k as f64;
                let eye = [middle + along, middle + 2.0 * (0.1 * along).sin()];
                let mut times = [0.0; 5];
                for time in &mut times {
                    let start = Instant::now();
                    zone.look(&discs, &DiscView::new(eye), &mut seen);
                    *time = start.elapsed().as_secs_f64() * 1e6;
                }
                times.sort_unstable_by(f64::total_cmp);
                Step { eye, seen: seen.clone(), us: times[2] }
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
