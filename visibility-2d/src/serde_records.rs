//! Serialisation by `serde`, with the checks that the types' users make: `visibility-core` has the macros.

use crate::cdt::{Opacity, PlanView, Wall, WallHit, predicates::checked};
use crate::discs::Disc;
use crate::horizon::UpAxis;
use crate::viewshed::Observer;
use crate::virtual_occluders::VirtualOccluder;

/// Returns a number, or `None` for the infinite number that a limit has by default: formats of text have no
/// infinity.
fn limit(number: f64, default: f64) -> Option<f64> {
    (number != default).then_some(number)
}

/// Returns whether all points have coordinates that a plan takes.
fn are_points<const N: usize>(points: [[f64; 2]; N]) -> bool {
    points.into_iter().all(|point| checked(point, 0).is_ok())
}

visibility_core::__serde_variants!(Opacity as "Opacity" { Opaque, Clear, OneWay });
visibility_core::__serde_variants!(UpAxis as "UpAxis" { Y, Z });
visibility_core::__serde_record!(Wall as "Wall" |w| {
    ends: [[f64; 2]; 2] = w.ends,
    opacity: Opacity = w.opacity,
    low: Option<f64> = limit(w.heights[0], f64::NEG_INFINITY),
    high: Option<f64> = limit(w.heights[1], f64::INFINITY),
} => Wall::new(ends[0], ends[1])
    .with_opacity(opacity)
    .with_heights(low.unwrap_or(f64::NEG_INFINITY), high.unwrap_or(f64::INFINITY)),
    if are_points(w.ends) && w.heights[0] < f64::INFINITY && w.heights[1] > f64::NEG_INFINITY, else
    "a wall has a coordinate that is no number up to 1e60, or heights that are no range");
visibility_core::__serde_record!(PlanView as "PlanView" |v| {
    eye: [f64; 2] = v.eye,
    range: Option<f64> = limit(v.range, f64::INFINITY),
    sector: Option<[[f64; 2]; 2]> = v.sector,
    heights: Option<[f64; 2]> = v.heights,
    through: u32 = v.through,
} => PlanView { eye, range: range.unwrap_or(f64::INFINITY), sector, heights, through },
    if are_points([v.eye]) && v.sector.is_none_or(are_points) && v.range >= 0.0
        && v.heights.is_none_or(|heights| heights.iter().all(|height| height.is_finite())), else
    "a view on a plan has a coordinate that is no number up to 1e60, or a range or height that is none");
visibility_core::__serde_record!(WallHit as "WallHit" |h| { point: [f64; 2] = h.point, wall: Option<u32> = h.wall }
    => WallHit { point, wall }, if are_points([h.point]), else "a coordinate is no number up to 1e60");
visibility_core::__serde_record!(Disc as "Disc" |d| { center: [f64; 2] = d.center, radius: f64 = d.radius }
    => Disc { center, radius }, if d.is_valid(), else "a disc has a coordinate beyond 1e150 or no radius");
visibility_core::__serde_record!(VirtualOccluder as "VirtualOccluder" |o| {
    up: UpAxis = o.up, ends: [[f64; 2]; 2] = o.ends, bottom: f64 = o.bottom, top: f64 = o.top,
} => VirtualOccluder { up, ends, bottom, top },
    if o.ends.as_flattened().iter().chain([&o.bottom, &o.top]).all(|x| x.is_finite()) && o.bottom <= o.top, else
    "a virtual occluder is not finite, or its bottom is above its top");
visibility_core::__serde_record!(Observer as "Observer" |o| {
    row: f64 = o.position[0],
    column: f64 = o.position[1],
    height: f64 = o.height,
    target_height: f64 = o.target_height,
    max_distance: Option<f64> = limit(o.max_distance, f64::INFINITY),
    curvature: f64 = o.curvature,
} => Observer::new(row, column)
    .with_height(height)
    .with_target_height(target_height)
    .with_max_distance(max_distance.unwrap_or(f64::INFINITY))
    .with_curvature(curvature),
    if o.position.iter().all(|x| x.is_finite()) && o.check().is_ok(), else
    "an observer's position, height, distance or curvature is out of range");
