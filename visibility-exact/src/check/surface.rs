//! Check that all segments of a node cross a surface of triangles.

use super::context::Check;
use super::exact_side::{cross, difference, is_before, norm, quick_side};
use super::ring::{distance_from_segment, is_inside};
use crate::half::Half;
use crate::polygon::Polygon;
use crate::sight::Sight;
use crate::triangles::unit_normal;
use alloc::collections::BTreeMap;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

impl Check<'_> {
    pub(super) fn surface_blocks(
        &self,
        sight: &Sight,
        surface: &[u32],
        moved: &[(u32, DVec3)],
        line: [DVec3; 2],
    ) -> bool {
        let all = self.triangles;
        let is_usable = |t: u32| (t as usize) < all.index_limit() && all.occludes(t) && self.faces(sight, t);
        if !surface.iter().all(|&t| is_usable(t))
            || !is_in(&sight.p, &sight.before_p, line[0], self.delta)
            || !is_in(&sight.q, &sight.before_q, line[1], self.delta)
        {
            return false;
        }
        // Without clearance, surfaces may have corners of the target. The whole sample line must then be in
        // front of the plane of the target polygon Q: by rounding, both polygons have points behind the
        // plane, and a line from or to such a point could pass below these corners where other segments do
        // not. The start is in front of the plane if its height is above the error of heights. With delta the
        // error of positions, the end is up to delta behind the plane, so it is moved by 1.25 delta, which is
        // surely more. The end is still nearer to Q than triangles that are apart from Q, by almost 3 delta.
        let from_before = sight.before_q.height(line[0]) > 3.0 * self.delta;
        // With a clearance, segments may pass edges by less than that, and a line that is moved would be none
        // of them.
        let lift = if self.clearance == 0.0 { 1.25 * self.delta } else { 0.0 };
        let line = [line[0], line[1] + sight.before_q.normal * lift];
        let moved: BTreeMap<u32, DVec3> = moved.iter().copied().collect();
        let mut boundary: BTreeMap<[u32; 2], [DVec3; 2]> = BTreeMap::new();
        let mut is_odd = false;
        let mut count = |t: &[DVec3; 3]| {
            let found = crosses(line, t);
            is_odd ^= found == Some(true);
            found.is_some()
        };
        // The boundary consists of the edges that belong to an odd number of the triangles. Each triangle
        // must be clear of the viewcell and target polygons, and the line must certainly cross or miss it.
        for &t in surface {
            let (numbers, corners) = (all.vertices(t), all.corners(t));
            for k in 0..3 {
                let (a, b) = ((numbers[k], corners[k]), (numbers[(k + 1) % 3], corners[(k + 1) % 3]));
                let (a, b) = if a.0 < b.0 { (a, b) } else { (b, a) };
                if boundary.remove(&[a.0, b.0]).is_none() {
                    boundary.insert([a.0, b.0], [a.1, b.1]);
                }
            }
            let tags = numbers.map(|v| self.tag(v));
            let is_clear = self.is_apart(sight, &corners)
                || self.touches_beside(sight, &corners, tags, line[1])
                || self.is_outside(sight, &corners);
            if !is_clear || !count(&corners) {
                return false;
            }
        }
        // Corners of the boundary may be moved by three clearances. No line of sight may meet the moved edge,
        // and the strip between the old and the moved edge belongs to the surface.
        for (&[v, w], &[a, b]) in &boundary {
            let place = |v: u32, x: DVec3| moved.get(&v).copied().unwrap_or(x);
            let (c, d) = (place(v, a), place(w, b));
            // Written so that a NaN is refused.
            let near = |x: DVec3, y: DVec3| x.distance(y) <= 3.0 * self.clearance;
            let edge = [(c, self.tag(v)), (d, self.tag(w))];
            if !near(a, c) || !near(b, d) || !self.is_missed(sight, &edge, from_before, line) {
                return false;
            }
            if (a, b) == (c, d) {
                continue;
            }
            let strip = [a, b, d, c];
            if !(self.is_apart(sight, &strip) || self.is_outside(sight, &strip)) {
                return false;
            }
            // A triangle with two equal corners is not crossed, unless the line may meet it.
            if ![[a, b, d], [a, d, c]].iter().all(&mut count) {
                return false;
            }
        }
        is_odd
    }

    /// Returns whether a triangle occludes for all points of the viewcell polygon: it is two-sided, or the
    /// polygon is before its front.
    ///
    /// The corners of a triangle run counter-clockwise as seen from its front. With a clearance, positions
    /// count as exact. If the triangle's plane is perpendicular to an axis, the height of a point over it is
    /// then the exact difference of two coordinates. In this case a corner of the polygon may lie on the
    /// plane, since segments from there do not cross the plane.
    pub(super) fn faces(&self, sight: &Sight, t: u32) -> bool {
        if self.triangles.front(t).is_none() {
            return true;
        }
        let [a, b, c] = self.triangles.corners(t);
        let axis = (0..3).find(|&k| self.clearance > 0.0 && a[k] == b[k] && a[k] == c[k]);
        // Change of the determinant, twice the triangle's area times the height of x, if each coordinate
        // changes by delta, the error of positions.
        let slack = match axis {
            Some(_) => 0.0,
            None => 2.0 * self.delta * norm(cross(difference(b, a), difference(c, a))),
        };
        let is_on_plane = |x: DVec3| axis.is_some_and(|k| x[k] == a[k]);
        sight.p.corners().iter().all(|&x| is_before(x, [a, b, c], slack) || is_on_plane(x))
    }

    /// Returns whether a triangle touches the target polygon Q at most at Q's boundary, and does not touch
    /// the viewcell polygon. True if the triangle's corners that are not the target's, of which there must be
    /// one, are all in front of Q's plane or all behind it. If they are in front, the triangle's plane must
    /// also be farther than 6 errors of positions from `end`, the end of the sample line, which is at most 3
    /// such errors from Q: lines to the points of Q near `end` then cross the triangle as often as the sample
    /// line.
    pub(super) fn touches_beside(
        &self,
        sight: &Sight,
        corners: &[DVec3; 3],
        tags: [Option<usize>; 3],
        end: DVec3,
    ) -> bool {
        let heights: Vec<f64> =
            (0..3).filter(|&k| tags[k].is_none()).map(|k| sight.before_q.height(corners[k])).collect();
        let margin = 3.0 * self.delta;
        let is_behind = !heights.is_empty() && heights.iter().all(|h| *h < -margin);
        let is_before = !heights.is_empty()
            && heights.iter().all(|h| *h > margin)
            && unit_normal(corners).is_some_and(|n| n.dot(end - corners[0]).abs() > 2.0 * margin);
        let apart_from_p = self.is_apart(&Sight { q: sight.p, before_q: sight.before_p, ..*sight }, corners);
        (is_behind || is_before) && apart_from_p
    }
}

/// Returns whether a segment crosses the inside of a triangle. `None` if it may touch the triangle's
/// boundary, or may have an end in the triangle's plane.
pub(super) fn crosses([p, q]: [DVec3; 2], t: &[DVec3; 3]) -> Option<bool> {
    let sign = |(value, error): (f64, f64)| i32::from(value > error) - i32::from(value < -error);
    let s: [i32; 3] = core::array::from_fn(|k| sign(quick_side(p, q, t[k], t[(k + 1) % 3], 0.0)));
    let ends = [p, q].map(|x| sign(quick_side(x, t[0], t[1], t[2], 0.0)));
    if (s.contains(&1) && s.contains(&-1)) || ends[0] * ends[1] > 0 {
        Some(false)
    } else {
        (!s.contains(&0) && !ends.contains(&0)).then_some(true)
    }
}

/// Returns whether a point is in a convex polygon or at most `delta` metres from it. `plane` has the
/// polygon's plane, with a normal that is right however thin the polygon is. Beyond a sharp corner, a point
/// may be far from the polygon and near the lines of both sides.
fn is_in(polygon: &Polygon, plane: &Half, x: DVec3, delta: f64) -> bool {
    let corners = polygon.corners();
    let normal = plane.normal * polygon.normal().dot(plane.normal).signum();
    let sides = || (0..corners.len()).map(|k| [corners[k], corners[(k + 1) % corners.len()]]);
    normal.dot(x - corners[0]).abs() <= delta
        && (sides().all(|side| is_inside(normal, side, x))
            || sides().any(|side| distance_from_segment(x, side) <= delta)
            // A viewcell may be a point, and so may a side.
            || corners.iter().any(|corner| x.distance(*corner) <= delta))
}
