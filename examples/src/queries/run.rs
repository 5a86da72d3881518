//! Frames of a moving camera, culled by queries of a simulated card and judged by an item buffer.

use super::SoftwareCard;
use crate::walkthrough::World;
use crate::{SceneSource, Walk};
use visibility_core::occlusion::{HardwareQueries, LateAnswers};
use visibility_core::view::ViewError;
use visibility_core::{Culler, FrustumCuller, OcclusionCuller, View, VisibleSet};
use visibility_measure::{Comparison, SampledVisibility};

/// Way to use queries.
#[derive(Clone, Copy, Debug)]
pub struct Mode {
    /// Policy for late answers.
    pub late: LateAnswers,
    /// Number of looks ahead at each frame.
    pub looks_ahead: u32,
    /// Number of samples up to which a query counts as hidden.
    pub max_samples: u32,
    /// Number of submissions after which answers arrive, at least 1.
    pub latency: u32,
}

/// Sums over frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Number of frames.
    pub frames: u64,
    /// Number of objects in the frustum.
    pub in_frustum: u64,
    /// Number of objects with a visible pixel.
    pub seen: u64,
    /// Number of objects drawn.
    pub drawn: u64,
    /// Number of objects with a visible pixel that were not drawn.
    pub missing: u64,
    /// Number of pixels that do not show what they should.
    pub wrong_pixels: u64,
    /// Number of queries answered.
    pub queries: u64,
    /// Number of boxes in these queries.
    pub boxes: u64,
}

/// Returns the views of `frames` successive frames of each walk. A walk begins in the middle of its keys. The
/// eye moves `step` metres a frame, or to the next key if this is nearer.
///
/// # Errors
///
/// Returns [`ViewError`] for a camera that is no view.
pub fn successive_views(
    source: &SceneSource,
    frames: usize,
    step: f64,
    size: (u32, u32),
) -> Result<Vec<Vec<View>>, ViewError> {
    let view = |walk: &Walk, position: f64| {
        Some(walk.view(walk.at(position)?, source.near, size).map(|(_, view)| view))
    };
    let walk_views = |walk: &Walk| {
        let mut position = walk.keys.len().saturating_sub(1) as f64 / 2.0;
        let mut next = || {
            let here = position;
            let ends = [here.floor(), here.floor() + 1.0].map(|key| walk.at(key));
            let [Some(a), Some(b)] = ends else { return here };
            // Where both keys have the same eye, or the step is longer than a leg, the next frame is at a
            // key.
            let ahead = here + step / a.eye.distance(b.eye);
            position = if ahead < here.floor() + 1.0 { ahead } else { here.floor() + 1.0 };
            here
        };
        let positions: Vec<f64> = (0..frames).map(|_| next()).collect();
        positions.into_iter().filter_map(|position| view(walk, position)).collect()
    };
    source.walks.iter().map(walk_views).collect()
}

/// Culls and draws the views of each walk by queries, and compares the second half of them with what the item
/// buffer `judged` found visible in each view: the first half fills the memory of the map.
pub fn run(world: &World, walks: &[Vec<View>], judged: &[SampledVisibility], mode: Mode) -> Totals {
    let scene = &world.scene;
    let mut totals = Totals::default();
    let mut visible = VisibleSet::new();
    let mut judged = judged.iter();
    for views in walks {
        let card = SoftwareCard::new(world.size, u64::from(mode.latency));
        let map = HardwareQueries::new(card, mode.late).with_max_samples(mode.max_samples);
        // The card draws what the looks leave. No other occluders are needed.
        let mut culler = OcclusionCuller::new(map).with_price(0);
        for ((frame, view), judged) in views.iter().enumerate().zip(&mut judged) {
            let mut drawn = vec![false; world.source.objects.len()];
            culler.map_mut().device_mut().begin(view, scene.origin());
            let before = culler.map_mut().device_mut().answered();
            let mut in_frustum = 0;
            for look in 0..=mode.looks_ahead {
                visible.fill(scene, view);
                FrustumCuller::new().cull(scene, view, &mut visible);
                in_frustum = visible.count(scene) as u64;
                if look < mode.looks_ahead {
                    culler.look_ahead(scene, view, &mut visible, look);
                } else {
                    culler.cull(scene, view, &mut visible);
                }
                visible.finish(scene);
                let card = culler.map_mut().device_mut();
                for id in visible.iter(scene) {
                    let object = &world.source.objects[id.index()];
                    if !std::mem::replace(&mut drawn[id.index()], true) && !object.see_through {
                        card.draw_triangles(object.triangles.view().iter());
                    }
                }
                card.submit();
            }
            if 2 * frame < views.len() {
                continue;
            }
            let mut comparison = Comparison::default();
            judged.compare(|_, key| drawn[key as usize], &mut comparison);
            let [queries, boxes] = culler.map_mut().device_mut().answered();
            let seen = judged.objects().iter().filter(|object| object.visible_triangles > 0);
            totals.frames += 1;
            totals.in_frustum += in_frustum;
            totals.seen += seen.count() as u64;
            totals.drawn += drawn.iter().filter(|&&is_drawn| is_drawn).count() as u64;
            totals.missing += u64::from(comparison.false_hidden_objects);
            totals.wrong_pixels += u64::from(comparison.wrong_pixels);
            totals.queries += queries - before[0];
            totals.boxes += boxes - before[1];
        }
    }
    totals
}
