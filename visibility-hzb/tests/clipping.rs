//! Contract 2 by clipping: after subtracting from a covered pixel all triangles that are at least as near as
//! the pixel's depth key, no area of the pixel is left.
//!
//! The test shares no arithmetic with the rasterizer: triangles are cut in clip space, projected, and
//! subtracted from the pixel's square as polygons.

use crate::common::{Face, Occluder, covered_pixels, draw, faces, occluder, view};
use visibility_core::glam::{DVec2, DVec3, DVec4};
use visibility_core::{View, view::Depth};
use visibility_hzb::Hzb;
use visibility_testing::{Random, judged, told_enough};

/// Returns the part of a convex polygon where the linear function `inside` is not negative. `mix`
/// interpolates between two corners by a fraction from 0 to 1. Empty if the function is negative at all
/// corners.
fn clip<P: Copy>(polygon: &[P], inside: impl Fn(P) -> f64, mix: impl Fn(P, P, f64) -> P) -> Vec<P> {
    let mut kept = Vec::new();
    for (i, &b) in polygon.iter().enumerate() {
        let a = polygon[(i + polygon.len() - 1) % polygon.len()];
        let (da, db) = (inside(a), inside(b));
        if (da < 0.0) != (db < 0.0) {
            kept.push(mix(a, b, da / (da - db)));
        }
        if db >= 0.0 {
            kept.push(b);
        }
    }
    kept
}

/// Returns the signed area of a polygon, in square pixels.
fn area(polygon: &[DVec2]) -> f64 {
    (0..polygon.len()).map(|i| polygon[i].perp_dot(polygon[(i + 1) % polygon.len()])).sum::<f64>() * 0.5
}

/// Projects a triangle and cuts it at the near plane. Returns its corners as column, row (in pixels) and
/// depth key, ordered so that the signed area is not negative. Empty for the back of a one-sided triangle, or
/// if the whole triangle is nearer than the near plane.
fn project(view: &View, size: [usize; 2], Face { corners, one_sided }: &Face) -> Vec<DVec3> {
    let matrix = view.clip_from(DVec3::ZERO);
    let perspective = matrix.row(3).truncate() != DVec3::ZERO;
    let clip_points = corners.map(|p| matrix * p.extend(1.0));
    let before_near = |p: DVec4| match view.depth() {
        Depth::NegativeOneToOne | Depth::NegativeOneToOneInfinite => p.w + p.z,
        Depth::ZeroToOne | Depth::ZeroToOneInfinite => p.z,
        Depth::Reversed | Depth::ReversedInfinite => p.w - p.z,
    };
    let mut screen: Vec<DVec3> = clip(&clip_points, before_near, |a, b, t| a + (b - a) * t)
        .into_iter()
        .map(|p| {
            let nearness = match (perspective, view.depth().is_reversed()) {
                (true, _) => 1.0 / p.w,
                (false, true) => p.z / p.w,
                (false, false) => -p.z / p.w,
            };
            let (x, y) = ((p.x / p.w + 1.0) * 0.5, (1.0 - p.y / p.w) * 0.5);
            DVec3::new(x * size[0] as f64, y * size[1] as f64, nearness)
        })
        .collect();
    // Facing is decided by the position of the eye in space, not on the screen.
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let front = match view.eye(DVec3::ZERO) {
        visibility_core::view::Eye::Point(eye) => (eye - corners[0]).dot(normal) > 0.0,
        visibility_core::view::Eye::Direction(along) => along.dot(normal) < 0.0,
    };
    if *one_sided && !front {
        screen.clear();
    }
    if area(&screen.iter().map(|p| p.truncate()).collect::<Vec<_>>()) < 0.0 {
        screen.reverse();
    }
    screen
}

/// Appends to `out` the parts of the convex polygon `piece` that lie outside `convex`. Corners of `convex`
/// run in the order of positive area. `convex` is enlarged by 1e-8 pixels, and parts of less than 1e-12
/// square pixels are dropped.
fn subtract(piece: Vec<DVec2>, convex: &[DVec2], out: &mut Vec<Vec<DVec2>>) {
    let mut rest = piece;
    for (i, &b) in convex.iter().enumerate() {
        let a = convex[(i + convex.len() - 1) % convex.len()];
        let Some(along) = (b - a).try_normalize() else { continue };
        let side = |p: DVec2| along.perp_dot(p - a) + 1e-8;
        let outside = clip(&rest, |p| -side(p), |a, b, t| a + (b - a) * t);
        if area(&outside) > 1e-12 {
            out.push(outside);
        }
        rest = clip(&rest, side, |a, b, t| a + (b - a) * t);
        if rest.is_empty() {
            return;
        }
    }
}

/// Asserts for every covered pixel of `hzb` that occluders at least as near as the pixel's depth key cover
/// all of its square. Returns the number of covered pixels. `what` names the case in messages.
fn check(occluders: &[Occluder], view: &View, hzb: &Hzb, what: &str) -> usize {
    let size = [hzb.width(), hzb.height()];
    let screen: Vec<_> =
        faces(occluders).iter().map(|face| project(view, size, face)).filter(|p| p.len() > 2).collect();
    let mut pixels = 0;
    for (column, row, stored) in covered_pixels(hzb) {
        pixels += 1;
        let corner = DVec2::new(column as f64, row as f64);
        let mut left =
            vec![[(0., 0.), (1., 0.), (1., 1.), (0., 1.)].map(|(x, y)| corner + DVec2::new(x, y)).to_vec()];
        for triangle in &screen {
            if left.is_empty() {
                break;
            }
            let low = triangle.iter().fold(DVec3::INFINITY, |m, p| m.min(*p));
            let high = triangle.iter().fold(DVec3::NEG_INFINITY, |m, p| m.max(*p));
            if low.x > corner.x + 1.0 || low.y > corner.y + 1.0 || high.x < corner.x || high.y < corner.y {
                continue;
            }
            // Keeps the part of the triangle that is at least as near as the stored depth key.
            let enough = stored - 1e-7 * stored.abs() - 1e-12;
            let near = clip(triangle, |p| p.z - enough, |a, b, t| a + (b - a) * t);
            let flat: Vec<DVec2> = near.iter().map(|p| p.truncate()).collect();
            if flat.len() < 3 {
                continue;
            }
            let mut next = Vec::new();
            for piece in left {
                subtract(piece, &flat, &mut next);
            }
            left = next;
        }
        let bare: f64 = left.iter().map(|piece| area(piece)).sum();
        assert!(
            bare < 1e-6,
            "{what}: pixel {column},{row}: {bare} of it is bare or farther than {stored}, {view:?}"
        );
    }
    pixels
}

#[test]
fn nothing_of_a_covered_pixel_is_bare() {
    let mut random = Random(11);
    let mut pixels = 0;
    for round in 0..3000 {
        let size = [[40, 24], [17, 33], [64, 16]][random.below(3)];
        let view = view(&mut random);
        let occluders: Vec<_> = (0..random.below(3) + 1).map(|_| occluder(&mut random)).collect();
        let hzb = draw(Hzb::new(size[0], size[1]).unwrap(), &occluders, &view);
        pixels += check(&occluders, &view, &hzb, &format!("round {round}"));
    }
    judged(pixels as u64);
    told_enough(pixels > 100_000, format_args!("too little is covered: {pixels}"));
}
