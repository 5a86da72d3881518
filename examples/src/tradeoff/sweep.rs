//! Sweep over every culler at each of its settings, and over some pipelines of several stages.

use super::point::Point;
use crate::walkthrough::cullers::{CullerError, parse};
use crate::walkthrough::judge::over_ideal;
use crate::walkthrough::output::truth;
use crate::walkthrough::{World, judge_with_limits, run_for};
use std::time::Duration;
use visibility_measure::MeasureError;

/// Number of frames and time limits of a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Effort {
    /// Number of frames of each scene, spread evenly over its walks.
    pub frames: usize,
    /// Minimum time for which each point is measured, after one pass over the frames that is not measured.
    pub measure: Duration,
    /// Maximum time for one pass over the frames. A culler that takes longer is given up.
    pub patience: Duration,
}

impl Effort {
    /// Effort for results that are kept: 40 frames, at least 0.4 s per point, at most 60 s per pass.
    pub const FULL: Self =
        Self { frames: 40, measure: Duration::from_millis(400), patience: Duration::from_secs(60) };
    /// Effort for a first look: 6 frames, at least 20 ms per point, at most 0.5 s per pass.
    pub const QUICK: Self =
        Self { frames: 6, measure: Duration::from_millis(20), patience: Duration::from_millis(500) };
}

/// Results of a sweep over one scene; each entry is in exactly one of the three lists.
#[derive(Debug, Default)]
pub struct Sweep {
    /// Measured points, in the order of the entries that were measured.
    pub points: Vec<Point>,
    /// Line of text on the exact answer (visible objects, box limit, ideal), which is the same for all
    /// points.
    pub truth: String,
    /// Entries that do not suit the scene, each with the reason.
    pub left_out: Vec<(String, String)>,
    /// Entries whose first pass over the frames takes longer than [`Effort::patience`].
    pub too_slow: Vec<String>,
}

/// Measures the entries on a world. `progress` is called with the name of each task before it begins. A
/// [preparation](World::prepared) that several cullers share counts in full for each of these cullers.
///
/// # Errors
///
/// Returns [`MeasureError`] when the item buffer cannot draw the world.
pub fn sweep(
    world: &World,
    entries: &[String],
    effort: Effort,
    mut progress: impl FnMut(&str),
) -> Result<Sweep, MeasureError> {
    let mut done = Sweep::default();
    let (mut trials, mut costs) = (Vec::new(), Vec::new());
    for entry in entries {
        progress(entry);
        let (parsed, cost) = world.prepared.cost_of(|| parse(entry, world));
        let pipeline = match parsed {
            Ok(mut made) => made.remove(0).1,
            // An entry with a stage that this build does not know is left out like an entry that does not
            // suit the scene.
            Err(error @ (CullerError::Unsuited { .. } | CullerError::Unknown { .. })) => {
                done.left_out
                    .push((entry.clone(), error.to_string().lines().next().unwrap_or_default().to_owned()));
                continue;
            }
        };
        let Some(trial) = run_for(effort.measure, effort.patience, entry.clone(), pipeline, world) else {
            done.too_slow.push(entry.clone());
            continue;
        };
        costs.push(cost);
        trials.push(trial);
    }
    progress("the exact answer");
    let judgement = judge_with_limits(world, &trials, || ())?;
    let frames = world.views.len() as f64;
    let pixels = f64::from(world.size.0) * f64::from(world.size.1) * frames;
    let visible = [judgement.mean_exact(), judgement.mean_visible_triangles()];
    done.points = (trials.iter().zip(&judgement.verdicts).zip(costs))
        .map(|((trial, verdict), cost)| Point {
            scene: world.source.name.clone(),
            culler: trial.name.clone(),
            accuracy: trial.accuracy.name(),
            frame_us: trial.quantile(0.5),
            p99_us: trial.quantile(0.99),
            objects: trial.mean_visible(),
            visible_objects: visible[0],
            triangles: verdict.reported_triangles as f64 / frames,
            visible_triangles: visible[1],
            false_hidden: verdict.false_hidden,
            wrong_pixels_percent: verdict.wrong_pixels as f64 / pixels * 100.0,
            memory_bytes: cost.bytes,
            preparation_ms: cost.time.as_secs_f64() * 1e3,
            box_limit: judgement.mean_limit(),
            over_ideal: over_ideal(
                trial.quantile(0.5),
                [trial.mean_visible(), verdict.reported_triangles as f64 / frames],
                visible,
            ),
        })
        .collect();
    done.truth = truth(&judgement);
    Ok(done)
}
