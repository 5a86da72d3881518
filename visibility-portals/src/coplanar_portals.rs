//! Detection of portals that lie side by side in one plane, so that no straight line passes through both,
//! when rounding has moved their vertices off that plane.
//!
//! Coordinates with few decimals put portals of one plane slightly before and behind each other. Lines along
//! the plane then seem to pass from one portal to the next. In cells with many windows this would make many
//! hidden cells count as visible.
//!
//! # Why no line is lost
//! Let a line stay clear of all edges of two convex polygons by `c`, and let all vertices of both polygons
//! lie within `d < c` of some plane. Let the line meet the plane at an angle `w`. Take the section that
//! contains the line and is perpendicular to the plane, and in this section the strip of all points nearer to
//! the line than `c`. A polygon that the line passes crosses the strip from border to border. On the upper
//! border, at `x` along the plane from where the line meets the plane, the height is `x tan w + c / cos w`,
//! and the polygon is no higher than `d`. So the polygon crosses the upper border at `x <= -(c - d cos w) /
//! sin w <= -(c - d)`. It crosses the lower border likewise at `x >= c - d`. In parallel sections at a
//! distance `s` from the line the strip has the half-width `sqrt(c^2 - s^2)`, which for `s` up to `sqrt(c^2 -
//! d^2) >= c - d` leaves at least `x = 0` between the two crossings. Projected along the plane's normal, both
//! polygons therefore contain the same points, of an extent of at least `2 (c - d)` in every direction. No
//! such line passes through two polygons that overlap by less than that in some direction.

use alloc::vec::Vec;
use visibility_core::geometry::Plane;
use visibility_core::glam::{DVec2, DVec3};

/// Bound on the rounding error in [`lie_side_by_side`], as a fraction of the clearance. Coordinates are
/// rounded by at most 1/65,536 of the clearance, so this is ample.
const SLACK: f64 = 0.05;

/// Tests whether two convex polygons lie side by side near one plane, so that no line passes through both and
/// stays clear of their edges by `clearance`. `a` and `b` are their vertices in order. Vertices and clearance
/// are in world units; `normal` is an approximate unit normal of the common plane.
///
/// `true` is certain. `false` if a line may pass, if no plane can be fitted, or for NaN.
pub(crate) fn lie_side_by_side<P: Iterator<Item = DVec3> + Clone>(
    a: P,
    b: P,
    normal: DVec3,
    clearance: f64,
) -> bool {
    let all = || a.clone().chain(b.clone());
    let Some((base, plane)) = a.clone().next().zip(fitted_plane(all(), normal)) else { return false };
    let off = all().fold(0.0, |off: f64, p| off.max(plane.signed_distance(p).abs()));
    let least = 2.0 * (clearance * (1.0 - SLACK) - off) * (1.0 - SLACK);
    if least <= 0.0 {
        return false;
    }
    let u = plane.normal.any_orthonormal_vector();
    let v = plane.normal.cross(u);
    let [a, b] =
        [a, b].map(|p| p.map(|p| DVec2::new(u.dot(p - base), v.dot(p - base))).collect::<Vec<DVec2>>());
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

/// Returns the least-squares plane through `points`, in world space with a unit normal. Distances are
/// measured along the unit vector `along`, so the plane must not be parallel to `along`. `None` if the normal
/// is not finite, for instance for points on one line.
fn fitted_plane(points: impl Iterator<Item = DVec3> + Clone, along: DVec3) -> Option<Plane> {
    let u = along.any_orthonormal_vector();
    let v = along.cross(u);
    let middle = points.clone().fold(DVec3::ZERO, |sum, p| sum + p) / points.clone().count() as f64;
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
        let normal = DVec3::new(1e-6, 0.0, 1.0).normalize();
        let beside =
            |a: &[DVec3], b: &[DVec3]| lie_side_by_side(a.iter().copied(), b.iter().copied(), normal, 1e-6);
        assert!(beside(&window([0.0, 1.0], 0.0), &window([3.0, 4.0], 5e-7)), "windows 2 m apart");
        // The two windows share an edge, and overlap by no more than the rounding.
        assert!(
            beside(&window([0.0, 1.0], 0.0), &window([1.0 - 5e-7, 4.0], 5e-7)),
            "windows that overlap by half of the clearance"
        );
        // A line along z passes through both windows.
        assert!(
            !beside(&window([0.0, 1.0], 0.0), &window([0.5, 4.0], 5e-7)),
            "windows half of which overlap"
        );
        assert!(
            !beside(&window([0.0, 1.0], 0.0), &window([1.0 - 2e-6, 4.0], 5e-7)),
            "windows that overlap by two clearances"
        );
        // The second window lies 4 clearances behind the first, far enough for a line to pass from one to the
        // other.
        assert!(
            !beside(&window([0.0, 1.0], 0.0), &window([1.0, 4.0], 4e-6)),
            "windows in planes 4 clearances apart"
        );
        assert!(!beside(&window([0.0, 1.0], f64::NAN), &window([1.0, 4.0], 0.0)), "a window at NaN");
    }

    /// A square and one that is turned by 45 degrees, of which now the one and now the other has the edge
    /// across which they overlap least. Lines need an overlap of two clearances, 0.2.
    #[test]
    fn the_overlap_of_windows_counts_across_the_edges_of_both() {
        let beside = |a: &[[f64; 2]], b: &[[f64; 2]]| {
            let [a, b] = [a, b].map(|corners| corners.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect());
            let (a, b): (Vec<DVec3>, Vec<DVec3>) = (a, b);
            let of = |a: &[DVec3], b: &[DVec3]| {
                lie_side_by_side(a.iter().copied(), b.iter().copied(), DVec3::Z, 0.1)
            };
            assert_eq!(of(&a, &b), of(&b, &a), "both orders of {a:?} and {b:?}");
            of(&a, &b)
        };
        let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        let diamond = |x: f64, y: f64| [[x - 2.0, y], [x, y - 2.0], [x + 2.0, y], [x, y + 2.0]];
        // The corner of the square, (4, 4), is within a side of the diamond by `inside`.
        for (inside, expected) in [(-1.0, true), (0.0, true), (0.17, true), (0.3, false), (1.0, false)] {
            let by = 1.0 - inside / 2f64.sqrt();
            let moved = diamond(4.0 + by, 4.0 + by);
            assert_eq!(beside(&square, &moved), expected, "a corner {inside} within a side");
        }
        for (x, expected) in
            [(6.0, true), (5.9, true), (5.83, true), (5.7, false), (2.0, false), (-1.9, true)]
        {
            assert_eq!(beside(&square, &diamond(x, 2.0)), expected, "a diamond at {x}");
            assert_eq!(beside(&square, &diamond(2.0, x)), expected, "a diamond at {x} along y");
        }
        assert!(!beside(&square, &[[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0]]), "a window in another");
        let narrow = [[1.0, 1.0], [1.15, 1.0], [1.15, 2.0], [1.0, 2.0]];
        assert!(beside(&square, &narrow), "a window too narrow for a line that keeps the clearance");
    }
}
