//! Trial of one pipeline over all frames: the time of each frame, and the objects reported.

use super::World;
use std::time::{Duration, Instant};
use visibility_core::{Accuracy, Pipeline, VisibleSet};

/// Recorded answers and times of a pipeline on the frames of a world.
pub struct Trial {
    /// Name of the pipeline, as the user asked for it.
    pub name: String,
    /// Accuracy that the pipeline as a whole promises.
    pub accuracy: Accuracy,
    /// Indices of the reported objects for each frame, ascending.
    pub reported: Vec<Vec<u32>>,
    /// Time of each frame of each timed pass, in microseconds, ascending.
    pub micros: Vec<f64>,
    /// Median time of each frame over the timed passes, in microseconds, in the order of the frames.
    pub frame_micros: Vec<f64>,
}

impl Trial {
    /// Returns the time in microseconds that a fraction `share` of all frames did not exceed: 0.5 gives the
    /// median. 0 without frames.
    pub fn quantile(&self, share: f64) -> f64 {
        let last = self.micros.len().saturating_sub(1) as f64;
        self.micros.get((share * last).round() as usize).copied().unwrap_or(0.0)
    }

    /// Returns the greatest ratio, over all frames, of the culling time to an allowance: 4 times the time of
    /// `frustum`, plus 1 us (the price of an object) for each object that this trial hides and `frustum`
    /// reports. A result of at most 1 means that culling never costs much more than it saves. 0 without
    /// frames.
    pub fn worst_over_gain(&self, frustum: &Self) -> f64 {
        let gained = frustum.reported.iter().zip(&self.reported);
        let may_cost = frustum
            .frame_micros
            .iter()
            .zip(gained)
            .map(|(&micros, (all, left))| 4.0 * micros + all.len().saturating_sub(left.len()) as f64);
        let ratios = self.frame_micros.iter().zip(may_cost).map(|(&micros, may_cost)| micros / may_cost);
        ratios.fold(0.0, f64::max)
    }

    /// Returns the mean number of reported objects per frame; 0 without frames.
    pub fn mean_visible(&self) -> f64 {
        let sum: usize = self.reported.iter().map(Vec::len).sum();
        sum as f64 / self.reported.len().max(1) as f64
    }
}

/// Minimum time over which [`run`] repeats the frames, so that the 99th percentile of a fast culler is not
/// determined by a few interrupts.
const MEASURE: Duration = Duration::from_millis(300);
/// Maximum number of timed passes over the frames.
const PASSES: usize = 200;

/// Runs a pipeline over all frames once, which records the reported objects and warms the caches, and then
/// several times against the clock. Each timed pass begins with a reset pipeline, as after a camera cut, so
/// all timed passes do equal work.
pub fn run(name: String, pipeline: Pipeline, world: &World) -> Trial {
    run_for(MEASURE, Duration::MAX, name, pipeline, world).expect("there is no end to the patience")
}

/// Like [`run`], with the minimum time to measure. Returns `None` if the first pass over the frames takes
/// longer than `patience`.
pub fn run_for(
    measure: Duration,
    patience: Duration,
    name: String,
    mut pipeline: Pipeline,
    world: &World,
) -> Option<Trial> {
    let mut visible = VisibleSet::new();
    let mut reported = Vec::with_capacity(world.views.len());
    let start = Instant::now();
    for view in &world.views {
        if start.elapsed() > patience {
            return None;
        }
        pipeline.cull(&world.scene, view, &mut visible);
        let mut ids: Vec<u32> = visible.iter(&world.scene).map(|id| id.index() as u32).collect();
        ids.sort_unstable();
        reported.push(ids);
    }
    let mut of_frames = vec![Vec::new(); world.views.len()];
    let start = Instant::now();
    for pass in 0..PASSES {
        if pass > 0 && start.elapsed() > measure {
            break;
        }
        pipeline.reset();
        for (view, own) in world.views.iter().zip(&mut of_frames) {
            let begin = Instant::now();
            pipeline.cull(&world.scene, view, &mut visible);
            own.push(begin.elapsed().as_secs_f64() * 1e6);
        }
    }
    let median = |own: &mut Vec<f64>| {
        own.sort_by(f64::total_cmp);
        own.get(own.len() / 2).copied().unwrap_or(0.0)
    };
    let frame_micros = of_frames.iter_mut().map(median).collect();
    let mut micros = of_frames.concat();
    micros.sort_by(f64::total_cmp);
    Some(Trial { name, accuracy: pipeline.accuracy(), reported, micros, frame_micros })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_frame_is_held_against_frustum_and_hidden_objects() {
        let trial = |counts: [u32; 2], frame_micros: [f64; 2]| Trial {
            name: String::new(),
            accuracy: Accuracy::Conservative,
            reported: counts.map(|count| (0..count).collect()).to_vec(),
            micros: Vec::new(),
            frame_micros: frame_micros.to_vec(),
        };
        let frustum = trial([10, 10], [1.0, 2.0]);
        // Allowances: 4 us and 10 objects in the first frame, 8 us and 4 objects in the second.
        assert_eq!(
            trial([0, 6], [7.0, 24.0]).worst_over_gain(&frustum),
            2.0,
            "the second frame costs 2 times what it may"
        );
        assert_eq!(frustum.worst_over_gain(&frustum), 0.25, "the frustum against itself");
    }
}
