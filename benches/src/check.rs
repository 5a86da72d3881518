//! Check of a contender's answer: every box that is surely inside all planes of the view must be in the
//! answer, and no box that is surely outside one.

use crate::contenders::Contender;
use treeculler::{Frustum, Vec3};
use visibility_core::{Aabb, View, glam::DVec3};

/// Distance from a plane in metres within which either answer is accepted, since contenders compute in f32
/// with coordinates up to 500 m.
const TOLERANCE: f64 = 1e-2;

/// Counts of the boxes that a contender reported in one frame, rightly or wrongly.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Verdict {
    /// Number of boxes that the contender reported.
    pub reported: usize,
    /// Number of boxes that no plane of the view excludes in f64: the exact answer.
    pub exact: usize,
    /// Number of boxes that are surely inside all planes of the view and not reported.
    pub lost: usize,
    /// Number of boxes that are surely outside a plane of the view and reported.
    pub extra: usize,
}

/// Compares the indices that a contender reported with the planes of the view in f64.
///
/// treeculler also culls boxes beyond the bounds of the frustum's corners, which is correct. With `corners`,
/// such boxes are not counted as lost.
pub fn check(boxes: &[Aabb], view: &View, reported: &[u32], corners: bool) -> Verdict {
    let planes = view.planes(DVec3::ZERO);
    let mut marked = vec![false; boxes.len()];
    reported.iter().for_each(|&index| marked[index as usize] = true);
    let hull = hull_of_corners(view);
    let mut verdict = Verdict { reported: reported.len(), ..Verdict::default() };
    for (b, marked) in boxes.iter().zip(marked) {
        let (center, half) = (b.center().as_dvec3(), b.half_extent().as_dvec3());
        let distance = planes
            .as_slice()
            .iter()
            .map(|p| p.plane.signed_distance(center) + p.plane.normal.abs().dot(half))
            .fold(f64::INFINITY, f64::min);
        let beyond = corners
            && ((b.min.as_dvec3() + TOLERANCE).cmpgt(hull[1]).any()
                || (b.max.as_dvec3() - TOLERANCE).cmplt(hull[0]).any());
        verdict.exact += usize::from(distance >= 0.0);
        verdict.lost += usize::from(distance > TOLERANCE && !beyond && !marked);
        verdict.extra += usize::from(distance < -TOLERANCE && marked);
    }
    verdict
}

/// Checks a contender in every fifth frame. Returns the mean number of boxes that it reports per frame, or
/// `None` for a contender that does not cull.
///
/// # Panics
///
/// Panics if the contender loses a box or reports one that is surely out of view.
pub fn verify(contender: &mut dyn Contender, boxes: &[Aabb], views: &[View]) -> Option<usize> {
    let (mut sum, mut frames) = (0, 0);
    for frame in (0..views.len()).step_by(5) {
        contender.cull(frame);
        let reported = contender.visible()?;
        let verdict = check(boxes, &views[frame], &reported, contender.uses_corners());
        assert_eq!(
            (verdict.lost, verdict.extra),
            (0, 0),
            "{} in frame {frame}: {verdict:?}",
            contender.name()
        );
        sum += verdict.reported;
        frames += 1;
    }
    Some(sum / frames)
}

/// Returns the minimum and maximum corner of the box around the frustum's eight corners, in world space.
fn hull_of_corners(view: &View) -> [DVec3; 2] {
    let points = Frustum::from_modelview_projection(view.clip_from(DVec3::ZERO).to_cols_array_2d()).points;
    let point = |p: &Vec3<f64>| DVec3::new(p.x, p.y, p.z);
    let corner =
        |start: DVec3, better: fn(DVec3, DVec3) -> DVec3| points.iter().map(point).fold(start, better);
    [corner(DVec3::INFINITY, DVec3::min), corner(DVec3::NEG_INFINITY, DVec3::max)]
}
