//! Portals side by side in one plane, which no line goes through one after the other, also where their
//! coordinates were rounded.
//!
//! Coordinates with few decimals put portals of one plane a little before and behind each other, so that
//! lines along the plane seem to pass from one to the next; in cells with many windows that shows much that
//! nobody sees.
//!
//! # Why no line is lost
//! Let a line stay clear of all edges of two convex polygons by `c`, and let all vertices of both lie within
//! `d < c` of some plane. At an angle `w` to the plane, take the section across the plane along the line, and
//! in it the strip of the line and all that is nearer than `c`. A polygon that the line passes crosses the
//! strip from border to border. On the upper border, at `x` along the plane from where the line meets it, the
//! height is `x tan w + c / cos w`, and the polygon is no higher than `d`: so there
//! `x <= -(c - d cos w) / sin w <= -(c - d)`. On the lower border likewise `x >= c - d`. In sections at `s`
//! beside the line the strip is narrower, `sqrt(c^2 - s^2)`, which for `s` up to `sqrt(c^2 - d^2) >= c - d`
//! leaves at least `x = 0`. Seen along the plane's normal, both polygons hence contain the same points, at
//! least `2 (c - d)` wide whichever way. Polygons that overlap less than that in some direction are passed by
//! no such line.

use alloc::vec::Vec;
use visibility_core::geometry::Plane;
use visibility_core::glam::{DVec2, DVec3};

/// Bound on the rounding of the test below, as a share of the lengths that are compared. The clearance is at
/// least 65,536 times the rounding of a coordinate.
const SLACK: f64 = 0.05;

/// Whether two convex polygons lie side by side near one plane, so that no line passes both of them clear of
/// their edges by `clearance`. `normal` is about that of the plane.
pub(crate) fn lie_side_by_side(a: &[DVec3], b: &[DVec3], normal: DVec3, clearance: f64) -> bool {
    let all = || a.iter().chain(b).copied();
    let Some(plane) = fitted(all(), (a.len() + b.len()) as f64, normal) else { return false };
    let off = all().fold(0.0, |off: f64, p| off.max(plane.signed_distance(p).abs()));
    let least = 2.0 * (clearance * (1.0 - SLACK) - off) * (1.0 - SLACK);
    if least <= 0.0 {
        return false;
    }
    let u = plane.normal.any_orthonormal_vector();
    let v = plane.normal.cross(u);
    let base = a[0];
    let flat = |points: &[DVec3]| -> Vec<DVec2> {
        points.iter().map(|&p| DVec2::new(u.dot(p - base), v.dot(p - base))).collect()
    };
    let (a, b) = (flat(a), flat(b));
    let overlap = |across: DVec2| {
        let range = |points: &[DVec2]| {
            points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), &p| {
                (least.min(across.dot(p)), most.max(across.dot(p)))
            })
        };
        let ((least_a, most_a), (least_b, most_b)) = (range(&a), range(&b));
        most_a.min(most_b) - least_a.max(least_b)
    };
    let edges = |points: &[DVec2]| -> Vec<DVec2> {
        let next = points.iter().cycle().skip(1);
        points.iter().zip(next).filter_map(|(&p, &q)| (q - p).perp().try_normalize()).collect()
    };
    edges(&a).into_iter().chain(edges(&b)).any(|across| overlap(across) < least)
}

/// The plane through points with the least sum of squared distances, measured along a direction; with unit
/// normal. `None` if it is too steep.
fn fitted(points: impl Iterator<Item = DVec3> + Clone, count: f64, along: DVec3) -> Option<Plane> {
    let u = along.any_orthonormal_vector();
    let v = along.cross(u);
    let middle = points.clone().fold(DVec3::ZERO, |sum, p| sum + p) / count;
    let (mut uu, mut uv, mut vv, mut uh, mut vh) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for p in points {
        let (a, b, h) = (u.dot(p - middle), v.dot(p - middle), along.dot(p - middle));
        (uu, uv, vv) = (uu + a * a, uv + a * b, vv + b * b);
        (uh, vh) = (uh + a * h, vh + b * h);
    }
    let determinant = uu * vv - uv * uv;
    let slope_u = (uh * vv - vh * uv) / determinant;
    let slope_v = (vh * uu - uh * uv) / determinant;
    let normal = (along - u * slope_u - v * slope_v).try_normalize()?;
    Some(Plane::through(middle, normal))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window(x: [f64; 2], z: f64) -> Vec<DVec3> {
        [[x[0], 0.0], [x[1], 0.0], [x[1], 2.0], [x[0], 2.0]].map(|[x, y]| DVec3::new(x, y, z)).to_vec()
    }

    #[test]
    fn windows_side_by_side_are_told_from_windows_behind_each_other() {
        let beside =
            |a: &[DVec3], b: &[DVec3]| lie_side_by_side(a, b, DVec3::new(1e-6, 0.0, 1.0).normalize(), 1e-6);
        assert!(beside(&window([0.0, 1.0], 0.0), &window([3.0, 4.0], 5e-7)));
        // They share an edge, and overlap by no more than rounding.
        assert!(beside(&window([0.0, 1.0], 0.0), &window([1.0 - 5e-7, 4.0], 5e-7)));
        // A line passes straight through both.
        assert!(!beside(&window([0.0, 1.0], 0.0), &window([0.5, 4.0], 5e-7)));
        assert!(!beside(&window([0.0, 1.0], 0.0), &window([1.0 - 2e-6, 4.0], 5e-7)));
        // One is as far before the other as lines need to pass from one to the other.
        assert!(!beside(&window([0.0, 1.0], 0.0), &window([1.0, 4.0], 4e-6)));
        assert!(!beside(&window([0.0, 1.0], f64::NAN), &window([1.0, 4.0], 0.0)));
    }
}
