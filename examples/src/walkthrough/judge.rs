//! Holds what the cullers reported against the exact answer, frame by frame.

use super::{Trial, World};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use visibility_measure::{Comparison, ItemBuffer, MeasureError};

/// How right one pipeline was on a walk, summed over its frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// Visible objects that were hidden: a lower bound, since an item buffer samples.
    pub false_hidden: u64,
    /// Objects that were hidden and show only in pixels that show a reported object alike: no errors.
    pub tied_hidden: u64,
    /// Objects that were reported and do not show: an upper bound.
    pub false_visible: u64,
    /// Triangles of the reported objects: what would be drawn.
    pub reported_triangles: u64,
    /// Triangles of the objects that do not show, and hidden triangles of visible ones.
    pub false_visible_triangles: u64,
    /// Pixels that are not what they should be when only the reported objects are drawn.
    pub wrong_pixels: u64,
    /// For each frame, the visible objects that were hidden.
    pub hidden: Vec<Vec<u32>>,
}

/// The exact answer of a walk, and how right each pipeline was.
pub struct Judgement {
    /// Visible objects of each frame, by index; of objects that tie for all their pixels, the one that the
    /// image shows.
    pub exact: Vec<Vec<u32>>,
    /// Triangles with a pixel, all frames together.
    pub visible_triangles: u64,
    /// One for each trial, in their order.
    pub verdicts: Vec<Verdict>,
}

impl Judgement {
    /// Visible objects a frame, on average.
    pub fn mean_exact(&self) -> f64 {
        let sum: usize = self.exact.iter().map(Vec::len).sum();
        sum as f64 / self.exact.len().max(1) as f64
    }
}

/// One frame judged.
struct Judged {
    frame: usize,
    exact: Vec<u32>,
    visible_triangles: u32,
    comparisons: Vec<Comparison>,
}

/// Draws every frame into an item buffer, on all processors, and compares. `progress` is called after each
/// frame.
pub fn judge(world: &World, trials: &[Trial], progress: impl Fn() + Sync) -> Result<Judgement, MeasureError> {
    let next = AtomicUsize::new(0);
    let worker = || -> Result<Vec<Judged>, MeasureError> {
        let mut buffer = ItemBuffer::new(world.size.0, world.size.1)?;
        let mut judged = Vec::new();
        loop {
            let frame = next.fetch_add(1, Ordering::Relaxed);
            let Some(view) = world.views.get(frame) else { return Ok(judged) };
            let seen = buffer.draw(view, world.origin(), world.items())?;
            // What the image shows: of objects that tie, one, or walls in one plane would count twice.
            let shown = seen.objects().iter().filter(|object| object.visible_triangles > 0);
            let exact = shown.map(|object| object.key);
            let comparisons = trials.iter().map(|trial| {
                let mut comparison = Comparison::default();
                seen.compare(|_, key| trial.reported[frame].binary_search(&key).is_ok(), &mut comparison);
                comparison
            });
            judged.push(Judged {
                frame,
                exact: exact.collect(),
                visible_triangles: seen.visible_triangles(),
                comparisons: comparisons.collect(),
            });
            progress();
        }
    };
    let workers = thread::available_parallelism().map_or(1, usize::from);
    let results: Vec<_> = thread::scope(|scope| {
        let running: Vec<_> = (0..workers).map(|_| scope.spawn(worker)).collect();
        running.into_iter().map(|handle| handle.join().expect("a worker panicked")).collect()
    });
    let mut judged = Vec::new();
    for result in results {
        judged.extend(result?);
    }
    judged.sort_by_key(|one| one.frame);

    let mut verdicts = vec![Verdict::default(); trials.len()];
    for frame in &mut judged {
        for (verdict, comparison) in verdicts.iter_mut().zip(&mut frame.comparisons) {
            verdict.false_hidden += u64::from(comparison.false_hidden_objects);
            verdict.tied_hidden += u64::from(comparison.tied_hidden_objects);
            verdict.reported_triangles += u64::from(comparison.reported_triangles);
            verdict.false_visible += u64::from(comparison.false_visible_objects);
            verdict.false_visible_triangles += u64::from(comparison.false_visible_triangles);
            verdict.wrong_pixels += u64::from(comparison.wrong_pixels);
            verdict.hidden.push(std::mem::take(&mut comparison.false_hidden_keys));
        }
    }
    let visible_triangles = judged.iter().map(|one| u64::from(one.visible_triangles)).sum();
    let exact = judged.into_iter().map(|one| one.exact).collect();
    Ok(Judgement { exact, visible_triangles, verdicts })
}
