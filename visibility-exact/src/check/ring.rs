//! Check that a closed loop lies on a convex polygon of occluding triangles.

use super::context::{Check, Corner};
use super::exact_side::is_before;
use crate::line_side::U;
use crate::sight::Sight;
use crate::triangles::unit_normal;
use alloc::collections::BTreeMap;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

impl Check<'_> {
    /// Returns whether the corners of a loop are between the planes of the viewcell polygon P and the target
    /// polygon Q, and within three clearances of a convex polygon of occluding triangles. The same then holds
    /// for a flat surface inside the loop. At least one corner must certainly be in front of Q's plane. A
    /// corner of the loop may lie in Q's plane in three cases: it is a corner of the target triangle; the
    /// plane is perpendicular to an axis, so that heights over it are exact; the corner
    /// [counts](Self::is_near_plane_of_q) as in the plane.
    pub(super) fn is_on_piece(&self, sight: &Sight, number: u32, ring: &[Corner]) -> bool {
        let Some(triangles) = self.triangles.piece_triangles(number) else { return false };
        let corners: Vec<[DVec3; 3]> = triangles.iter().map(|&t| self.triangles.corners(t)).collect();
        let [first, ..] = corners.as_slice() else { return false };
        if !triangles.iter().all(|&t| self.triangles.occludes(t) && self.faces(sight, t)) {
            return false;
        }
        // With a clearance, the viewcell polygon may lie in the plane of a one-sided triangle. Segments from
        // there do not cross the triangle, but pass a loop in that plane.
        let is_before_front = |x: &DVec3| {
            corners
                .iter()
                .zip(triangles)
                .all(|(t, &n)| self.triangles.front(n).is_none() || is_before(*x, *t, 0.0))
        };
        if !sight.p.corners().iter().any(is_before_front) {
            return false;
        }
        let Some(normal) = unit_normal(first) else { return false };
        let flat = corners.iter().flatten().all(|x| normal.dot(*x - first[0]).abs() <= self.delta);
        // Sides that two triangles share cancel. The corners of all triangles must be on the inner side of
        // each other side.
        let mut sides: BTreeMap<[u32; 2], [DVec3; 2]> = BTreeMap::new();
        for (&t, x) in triangles.iter().zip(&corners) {
            let v = self.triangles.vertices(t);
            for k in 0..3 {
                let (key, ends) = ([v[k], v[(k + 1) % 3]], [x[k], x[(k + 1) % 3]]);
                if sides.remove(&[key[1], key[0]]).is_none() {
                    sides.insert(key, ends);
                }
            }
        }
        let is_convex = sides.values().all(|[a, b]| {
            let inwards = normal.cross(*b - *a).normalize_or_zero();
            corners.iter().flatten().all(|x| inwards.dot(*x - *a) >= -self.delta)
        });
        let reach = 3.0 * self.clearance + 2.0 * self.delta;
        let is_near = |x: DVec3| corners.iter().any(|t| distance(x, t) <= reach);
        // Exactly in front of the target polygon's plane, by one coordinate that is not rounded, or so close
        // that the point counts as in the plane.
        let in_front = |x: DVec3| {
            (sight.before_q.axis().is_some() && sight.before_q.height(x) >= 0.0)
                || self.is_near_plane_of_q(sight, x)
        };
        // The plane of the viewcell polygon is perpendicular to an axis, so the sign of a height over it is
        // exact. An occluder behind the plane is inside the viewcell and blocks nothing, since segments start
        // in front of it.
        let in_slab = |(x, tag): Corner| {
            sight.before_p.height(x) >= 0.0
                && (tag.is_some() || sight.before_q.height(x) > 3.0 * self.delta || in_front(x))
        };
        // A loop that lies in the target polygon's plane blocks nothing.
        let leaves_plane = ring.iter().any(|(x, _)| sight.before_q.height(*x) > 3.0 * self.delta);
        let tags_hold = |(x, tag): Corner| {
            tag.is_none_or(|k| {
                let vertex = self.target_vertices.get(k);
                triangles.iter().any(|&t| {
                    (0..3).any(|j| {
                        Some(&self.triangles.vertices(t)[j]) == vertex && self.triangles.corners(t)[j] == x
                    })
                })
            })
        };
        flat && is_convex
            && leaves_plane
            && ring.iter().all(|&corner| is_near(corner.0) && in_slab(corner) && tags_hold(corner))
    }
}

/// Returns the distance of a point from a triangle. For a point over the inside, that is its distance from
/// the triangle's plane.
fn distance(x: DVec3, t: &[DVec3; 3]) -> f64 {
    let sides = [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
    match unit_normal(t) {
        Some(normal) if sides.into_iter().all(|side| is_inside(normal, side, x)) => {
            normal.dot(x - t[0]).abs()
        }
        _ => sides.into_iter().fold(f64::INFINITY, |least, side| least.min(distance_from_segment(x, side))),
    }
}

/// Returns whether a point is certainly on the inner side of a side of a polygon with this unit normal.
///
/// Rounding takes less than 32 units U of the lengths multiplied. Beyond a sharp corner, the exact value may
/// be less than that below 0 for both sides, far from the polygon. Points of the polygon that are nearer to
/// a side than that are within an error of positions of the side.
pub(super) fn is_inside(normal: DVec3, [a, b]: [DVec3; 2], x: DVec3) -> bool {
    normal.cross(b - a).dot(x - a) > 32.0 * U * (b - a).length() * (x - a).length()
}

/// Returns the distance of a point from a segment, NaN for a segment without length.
pub(super) fn distance_from_segment(x: DVec3, [a, b]: [DVec3; 2]) -> f64 {
    let part = ((x - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    x.distance(a + (b - a) * part)
}
