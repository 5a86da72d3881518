//! Surfaces of triangles that all segments of a node cross.

use super::context::Check;
use super::exact_side::quick_side;
use crate::polygon::Polygon;
use crate::sight::Sight;
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
        let is_usable = |t: u32| (t as usize) < all.len() && all.occludes(t);
        if !surface.iter().all(|&t| is_usable(t))
            || !is_in(&sight.p, line[0], self.delta)
            || !is_in(&sight.q, line[1], self.delta)
        {
            return false;
        }
        let moved: BTreeMap<u32, DVec3> = moved.iter().copied().collect();
        let mut boundary: BTreeMap<[u32; 2], [DVec3; 2]> = BTreeMap::new();
        let mut crossings = 0;
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
            if !(self.is_apart(sight, &corners)
                || self.touches_beside(sight, &corners, tags)
                || self.is_outside(sight, &corners))
            {
                return false;
            }
            match crosses(line, &corners) {
                Some(crosses) => crossings += u32::from(crosses),
                None => return false,
            }
        }
        for (&[v, w], &[a, b]) in &boundary {
            let place = |v: u32, x: DVec3| moved.get(&v).copied().unwrap_or(x);
            let (c, d) = (place(v, a), place(w, b));
            // A NaN must fail.
            let near = |x: DVec3, y: DVec3| x.distance(y) <= 3.0 * self.clearance;
            if !near(a, c) || !near(b, d) || !self.is_missed(sight, &[(c, self.tag(v)), (d, self.tag(w))]) {
                return false;
            }
            if (a, b) == (c, d) {
                continue;
            }
            if (c != a && self.tag(v).is_some()) || (d != b && self.tag(w).is_some()) {
                return false;
            }
            let strip = [a, b, d, c];
            if !(self.is_apart(sight, &strip) || self.is_outside(sight, &strip)) {
                return false;
            }
            for t in [[a, b, d], [a, d, c]] {
                if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
                    continue;
                }
                match crosses(line, &t) {
                    Some(crosses) => crossings += u32::from(crosses),
                    None => return false,
                }
            }
        }
        crossings % 2 == 1
    }

    /// Returns whether a triangle touches Q at most at its boundary: it has corners of the target triangle,
    /// its other corners are on one side of Q's plane, and it is apart from P.
    pub(super) fn touches_beside(
        &self,
        sight: &Sight,
        corners: &[DVec3; 3],
        tags: [Option<usize>; 3],
    ) -> bool {
        let heights: Vec<f64> =
            (0..3).filter(|&k| tags[k].is_none()).map(|k| sight.before_q.height(corners[k])).collect();
        let margin = 3.0 * self.delta;
        let on_one_side = heights.iter().all(|h| *h > margin) || heights.iter().all(|h| *h < -margin);
        let apart_from_p = self.is_apart(&Sight { q: sight.p, before_q: sight.before_p, ..*sight }, corners);
        (1..3).contains(&heights.len()) && on_one_side && apart_from_p
    }
}

/// Returns whether a segment crosses the inside of a triangle; `None` if it may touch the boundary, or the
/// plane at an end.
pub(super) fn crosses([p, q]: [DVec3; 2], t: &[DVec3; 3]) -> Option<bool> {
    let sign = |(value, error): (f64, f64)| i32::from(value > error) - i32::from(value < -error);
    let s: [i32; 3] = core::array::from_fn(|k| sign(quick_side(p, q, t[k], t[(k + 1) % 3], 0.0)));
    let ends = [p, q].map(|x| sign(quick_side(x, t[0], t[1], t[2], 0.0)));
    let winds = s[0] != 0 && s[0] == s[1] && s[1] == s[2];
    if (s.contains(&1) && s.contains(&-1)) || ends[0] * ends[1] > 0 {
        Some(false)
    } else if winds && ends[0] * ends[1] < 0 {
        Some(true)
    } else {
        None
    }
}

/// Returns whether a point is in a convex polygon, up to `delta`.
fn is_in(polygon: &Polygon, x: DVec3, delta: f64) -> bool {
    let (normal, corners) = (polygon.normal().normalize_or_zero(), polygon.corners());
    normal.dot(x - corners[0]).abs() <= delta
        && (0..corners.len()).all(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            normal.cross(b - a).normalize_or_zero().dot(x - a) >= -delta
        })
}
