//! Objects that an exact culler must hide, because each of their triangles is occluded by a single triangle
//! of another object.

use super::oracle::{NARROWEST, sight_line};
use visibility_bsp::BspTree;
use visibility_core::View;
use visibility_core::glam::{DMat4, DVec2, DVec3};
use visibility_examples::walkthrough::World;

/// Tests whether an exact culler must hide an object: each of its triangles is behind one triangle of another
/// object, with a margin greater than the width that an exact culler may miss. `object` is an index. False
/// whenever rounding leaves a doubt.
pub(crate) fn surely_hidden(world: &World, view: &View, object: usize) -> bool {
    let (objects, origin) = (&world.source.objects, world.origin());
    let (clip, near) = (view.clip_from(origin), view.planes(origin).as_slice()[4].plane);
    // Objects with an invalid triangle are never hidden by exact cullers and hide nothing.
    let corners = |object: usize| objects[object].triangles.iter().map(|t| t.map(|p| p.as_dvec3()));
    let is_whole = |object: usize| corners(object).len() > 0 && corners(object).all(|t| BspTree::accepts(&t));
    let behind_one = |triangle: [DVec3; 3]| {
        let lines = triangle.map(|p| sight_line(view, origin, p));
        let hides = |other: [DVec3; 3]| {
            lines.iter().flatten().filter(|line| line.surely_meets(other)).count() == 3
                && triangle.iter().all(|&p| inside_by(&clip, p, other) > NARROWEST)
        };
        (0..objects.len()).filter(|&other| other != object && is_whole(other)).flat_map(corners).any(hides)
    };
    let is_beyond_near = |triangle: [DVec3; 3]| triangle.iter().all(|&p| near.signed_distance(p) > 0.0);
    is_whole(object)
        && corners(object).all(|triangle| is_beyond_near(triangle) && behind_one(triangle))
        && width(&clip, corners(object).flatten()) > 10.0 * NARROWEST
}

/// Returns the width of projected points across the line through two far-apart points, in NDC (the picture is
/// 2 wide). NaN if a point is not in front of the eye or all points coincide.
fn width(clip: &DMat4, points: impl Iterator<Item = DVec3> + Clone) -> f64 {
    let places = points.map(|p| in_picture(clip, p));
    let farthest = |from: DVec2| {
        places.clone().fold(from, |best, p| if p.distance(from) > best.distance(from) { p } else { best })
    };
    let a = farthest(places.clone().next().unwrap_or(DVec2::NAN));
    let along = farthest(a) - a;
    places.fold(0.0, |most: f64, p| {
        let off = along.perp_dot(p - a).abs() / along.length();
        if off >= most {
            off
        } else if off < most {
            most
        } else {
            f64::NAN
        }
    })
}

/// Projects a point to NDC; NaN unless the point is in front of the eye.
fn in_picture(clip: &DMat4, p: DVec3) -> DVec2 {
    let at = *clip * p.extend(1.0);
    if at.w > 0.0 { at.truncate().truncate() / at.w } else { DVec2::NAN }
}

/// Returns the distance in NDC by which a projected point is inside a projected triangle, negative outside.
/// NaN unless all four points are in front of the eye.
fn inside_by(clip: &DMat4, point: DVec3, corners: [DVec3; 3]) -> f64 {
    let (at, [a, b, c]) = (in_picture(clip, point), corners.map(|p| in_picture(clip, p)));
    let turn = (b - a).perp_dot(c - a).signum();
    let height = |a: DVec2, b: DVec2| (b - a).perp_dot(at - a) * turn / (b - a).length();
    let heights = [height(a, b), height(b, c), height(c, a)];
    if heights.iter().any(|height| height.is_nan()) {
        f64::NAN
    } else {
        heights.into_iter().fold(f64::INFINITY, f64::min)
    }
}
