//! Whether a contender's answer can be used: every box that is surely within all planes of the view must be
//! in it.

use crate::contenders::Contender;
use treeculler::{Frustum, Vec3};
use visibility_core::{Aabb, View, glam::DVec3};

/// Distances below this, in metres, are left to rounding: contenders work in `f32`, on coordinates up to 500.
const TOLERANCE: f64 = 1e-2;

/// What is wrong with an answer, and what it counts.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Verdict {
    /// Boxes reported.
    pub reported: usize,
    /// Boxes that no plane of the view excludes.
    pub exact: usize,
    /// Boxes that are surely in view of all planes and are not reported.
    pub lost: usize,
    /// Boxes that are surely outside a plane and are reported.
    pub extra: usize,
}

/// Holds the indices that a contender reported against the planes of the view in `f64`.
///
/// treeculler also drops boxes beyond the bounds of the frustum's own corners, rightly so: with `corners`,
/// those are not counted as lost.
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

/// Checks a contender in a few frames. Returns how many boxes it reports in one of them, on average.
///
/// # Panics
/// Where it loses a box or reports one too many.
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

fn hull_of_corners(view: &View) -> [DVec3; 2] {
    let points = Frustum::from_modelview_projection(view.clip_from(DVec3::ZERO).to_cols_array_2d()).points;
    let point = |p: &Vec3<f64>| DVec3::new(p.x, p.y, p.z);
    let corner =
        |start: DVec3, better: fn(DVec3, DVec3) -> DVec3| points.iter().map(point).fold(start, better);
    [corner(DVec3::INFINITY, DVec3::min), corner(DVec3::NEG_INFINITY, DVec3::max)]
}
