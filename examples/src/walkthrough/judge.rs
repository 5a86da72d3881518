//! Judge of the cullers: compares the objects that each culler reported with the exact answer, frame by
//! frame.

use super::{Trial, World};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use visibility_core::ObjectId;
use visibility_measure::{Comparison, DrawCost, ItemBuffer, MeasureError};

/// Counts of one pipeline's right and wrong answers, summed over all frames unless said otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// Number of visible objects that were hidden: a lower bound, since an item buffer samples visibility.
    pub false_hidden: u64,
    /// Number of hidden objects whose every visible pixel shows a reported object at equal depth. Such ties
    /// do not count as errors.
    pub tied_hidden: u64,
    /// Number of reported objects without a visible pixel: an upper bound, since an item buffer samples
    /// visibility.
    pub false_visible: u64,
    /// Number of triangles of all reported objects, which an engine would draw.
    pub reported_triangles: u64,
    /// Number of triangles of reported objects without a visible pixel, including those of objects that are
    /// partly visible.
    pub false_visible_triangles: u64,
    /// Number of pixels that are wrong when only the reported objects are drawn.
    pub wrong_pixels: u64,
    /// Indices, ascending, of the visible objects that were hidden, in a list per frame.
    pub hidden: Vec<Vec<u32>>,
}

/// Exact answer of all frames, and the verdict on each pipeline.
pub struct Judgement {
    /// Indices of the visible objects of each frame, ascending. Of objects that tie in all their pixels,
    /// only the object that the picture shows is listed.
    pub exact: Vec<Vec<u32>>,
    /// Box limit of each frame: the number of boxes not hidden by the triangles of all opaque objects. A
    /// culler that only tests boxes cannot report fewer objects. Only [`judge_with_limits`] asks for it.
    pub limits: Option<Vec<usize>>,
    /// Number of triangles with at least one visible pixel, summed over all frames.
    pub visible_triangles: u64,
    /// Verdicts, one per trial, in the order of the trials.
    pub verdicts: Vec<Verdict>,
}

impl Judgement {
    /// Returns the mean number of visible objects per frame; 0 without frames.
    pub fn mean_exact(&self) -> f64 {
        let sum: usize = self.exact.iter().map(Vec::len).sum();
        sum as f64 / self.exact.len().max(1) as f64
    }

    /// Returns the mean box limit per frame, in objects; 0 without frames, NaN if limits were not asked for.
    pub fn mean_limit(&self) -> f64 {
        let Some(limits) = &self.limits else { return f64::NAN };
        limits.iter().sum::<usize>() as f64 / limits.len().max(1) as f64
    }

    /// Returns the mean number of triangles per frame with a visible pixel; 0 without frames.
    pub fn mean_visible_triangles(&self) -> f64 {
        self.visible_triangles as f64 / self.exact.len().max(1) as f64
    }
}

/// Returns the cost over the ideal: the time in microseconds to cull a frame and draw the reported objects,
/// divided by the time to draw only the visible triangles of the visible objects without culling. Drawing
/// times are those of the default [`DrawCost`]. An ideal of less than 1 us, the price of one object, counts
/// as 1 us. Below 1 for cullers that hide visible objects.
pub fn over_ideal(frame_us: f64, reported: [f64; 2], visible: [f64; 2]) -> f64 {
    let draw = |[objects, triangles]: [f64; 2]| DrawCost::default().of(objects, triangles);
    (frame_us + draw(reported)) / draw(visible).max(1.0)
}

/// Result of judging one frame: the exact answer, and the comparison of each trial with it.
struct Judged {
    frame: usize,
    exact: Vec<u32>,
    limit: Option<usize>,
    visible_triangles: u32,
    comparisons: Vec<Comparison>,
}

/// Draws every frame into an item buffer, on as many threads as the machine has, and compares the trials with
/// the pictures. `progress` is called after each frame, from any thread.
///
/// # Errors
///
/// Returns [`MeasureError`] when the item buffer cannot have the world's size or the world has too many
/// triangles.
pub fn judge(world: &World, trials: &[Trial], progress: impl Fn() + Sync) -> Result<Judgement, MeasureError> {
    judge_frames(world, trials, false, progress)
}

/// As [`judge`], with the box limit of each frame, which takes about as long again as the pictures.
///
/// # Errors
///
/// As [`judge`].
pub fn judge_with_limits(
    world: &World,
    trials: &[Trial],
    progress: impl Fn() + Sync,
) -> Result<Judgement, MeasureError> {
    judge_frames(world, trials, true, progress)
}

fn judge_frames(
    world: &World,
    trials: &[Trial],
    with_limits: bool,
    progress: impl Fn() + Sync,
) -> Result<Judgement, MeasureError> {
    let next = AtomicUsize::new(0);
    let scene = &world.scene;
    let is_opaque = |index: u32| {
        scene.id_at(index as usize).is_some_and(|id| scene.object(id).is_ok_and(|object| object.occluder))
    };
    let all_opaque = world.items().all(|object| is_opaque(object.key));
    let worker = || -> Result<Vec<Judged>, MeasureError> {
        let mut buffer = ItemBuffer::new(world.size.0, world.size.1)?;
        let mut surfaces = ItemBuffer::new(world.size.0, world.size.1)?;
        let mut judged = Vec::new();
        loop {
            let frame = next.fetch_add(1, Ordering::Relaxed);
            let Some(view) = world.views.get(frame) else { return Ok(judged) };
            buffer.draw(view, world.origin(), world.items())?;
            let seen = buffer.visible();
            // If coplanar surfaces of several objects tie in a pixel, only the object that the picture shows
            // there counts as visible. Otherwise two coplanar walls would both count.
            let shown = seen.objects().iter().filter(|object| object.visible_triangles > 0);
            let exact: Vec<u32> = shown.map(|object| object.key).collect();
            let limit = if with_limits {
                if !all_opaque {
                    let opaque = world.items().filter(|object| is_opaque(object.key));
                    surfaces.draw(view, world.origin(), opaque)?;
                }
                let surfaces = if all_opaque { &buffer } else { &surfaces };
                let is_seen = |id: ObjectId| exact.binary_search(&(id.index() as u32)).is_ok();
                Some(surfaces.box_limit(scene, is_seen).count())
            } else {
                None
            };
            let comparisons = trials.iter().map(|trial| {
                let mut comparison = Comparison::default();
                seen.compare(|_, key| trial.reported[frame].binary_search(&key).is_ok(), &mut comparison);
                comparison
            });
            judged.push(Judged {
                frame,
                exact,
                limit,
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
    let limits = judged.iter().map(|one| one.limit).collect();
    let exact = judged.into_iter().map(|one| one.exact).collect();
    Ok(Judgement { exact, limits, visible_triangles, verdicts })
}
