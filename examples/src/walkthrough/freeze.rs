//! Culling frozen at one frame while the camera moves on, to show which objects that frame contains.

use super::World;
use super::canvas::Canvas;
use super::eye_picture::{self, Shown};
use visibility_core::{Pipeline, Pose, View, VisibleSet};
use visibility_measure::MeasureError;

/// Draws the objects that a frame's culling leaves: from a point behind and above the frame's camera, and
/// from up to three later cameras of the same walk. Each picture comes with the text for its file name.
///
/// # Errors
///
/// Returns [`MeasureError`] when the item buffer cannot draw the world.
pub fn draw(
    world: &World,
    pipeline: &mut Pipeline,
    frame: usize,
) -> Result<Vec<(String, Canvas)>, MeasureError> {
    let mut visible = VisibleSet::new();
    pipeline.cull(&world.scene, &world.views[frame], &mut visible);
    pipeline.freeze();
    let mut pictures = Vec::new();
    let mut draw = |what: String, view: &View| -> Result<(), MeasureError> {
        // As in an engine's loop, each camera culls and draws the visible set. The frozen pipeline ignores
        // the camera and culls for the frozen view.
        pipeline.cull(&world.scene, view, &mut visible);
        let mut drawn: Vec<u32> = visible.iter(&world.scene).map(|id| id.index() as u32).collect();
        drawn.sort_unstable();
        pictures.push((what, eye_picture::draw(world, view, Shown { only: Some(&drawn), marked: None })?));
        Ok(())
    };
    let (pose, walk) = world.poses[frame];
    if let Some(bird) = bird(world, pose) {
        draw("from-above".to_owned(), &bird)?;
    }
    let later = (frame + 1..world.views.len()).filter(|&later| world.poses[later].1 == walk);
    for later in later.step_by(4).take(3) {
        draw(format!("from-{later:04}"), &world.views[later])?;
    }
    pipeline.unfreeze();
    Ok(pictures)
}

/// Returns a view from behind and above a camera, far enough back to show a good part of its frustum. `None`
/// for a scene without finite points, or when no such view can be made.
fn bird(world: &World, pose: Pose) -> Option<View> {
    let (low, high) = world.source.bounds()?;
    let reach = f64::from((high - low).length()) * 0.35;
    let up = world.source.up.as_dvec3();
    let eye = pose.eye - pose.forward * (reach * 0.6) + up * reach;
    let aspect = f64::from(world.size.0) / f64::from(world.size.1);
    let target = pose.eye + pose.forward * (reach * 0.7);
    View::perspective(Pose::look_at(eye, target, up), 1.0, aspect, reach * 1e-3, f64::INFINITY).ok()
}
