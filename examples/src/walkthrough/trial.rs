//! Runs one pipeline over all frames: how long each took, and what it reported.

use super::World;
use std::time::{Duration, Instant};
use visibility_core::{Accuracy, Pipeline, VisibleSet};

/// What a pipeline did on a walk.
pub struct Trial {
    /// The name it was asked for by.
    pub name: String,
    /// What it promises.
    pub accuracy: Accuracy,
    /// The objects that it reported, by index, ascending, for each frame.
    pub reported: Vec<Vec<u32>>,
    /// Microseconds a frame, of every frame of every pass, ascending.
    pub micros: Vec<f64>,
}

impl Trial {
    /// Time that a share of all frames stayed within: 0.5 is the median.
    pub fn quantile(&self, share: f64) -> f64 {
        let last = self.micros.len().saturating_sub(1) as f64;
        self.micros.get((share * last).round() as usize).copied().unwrap_or(0.0)
    }

    /// Objects reported a frame, on average.
    pub fn mean_visible(&self) -> f64 {
        let sum: usize = self.reported.iter().map(Vec::len).sum();
        sum as f64 / self.reported.len().max(1) as f64
    }
}

/// The walk is repeated until this much time has been measured, so that the p99 of a fast culler is not that
/// of a few interrupts.
const MEASURE: Duration = Duration::from_millis(300);
/// But no more often than this.
const PASSES: usize = 200;

/// Walks once to see what is reported and to warm up, then several times against the clock. Each pass begins
/// anew, as after a camera cut, so all of them do the same work.
pub fn run(name: String, pipeline: Pipeline, world: &World) -> Trial {
    run_for(MEASURE, Duration::MAX, name, pipeline, world).expect("there is no end to the patience")
}

/// The same, with the time to measure for; `None` if the first walk takes longer than `patience`.
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
    let mut micros = Vec::new();
    let start = Instant::now();
    for pass in 0..PASSES {
        if pass > 0 && start.elapsed() > measure {
            break;
        }
        pipeline.reset();
        for view in &world.views {
            let begin = Instant::now();
            pipeline.cull(&world.scene, view, &mut visible);
            micros.push(begin.elapsed().as_secs_f64() * 1e6);
        }
    }
    micros.sort_by(f64::total_cmp);
    Some(Trial { name, accuracy: pipeline.accuracy(), reported, micros })
}
