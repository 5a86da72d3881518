//! Edges that no segment of a node meets, and planes between points and polygons.

use super::context::{Check, Corner};
use super::exact_side::{D, dot, quick_side};
use crate::half::Half;
use crate::line_side::U;
use crate::polygon::Polygon;
use crate::sight::Sight;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

impl Check<'_> {
    /// Returns, for each pair of corners of P and Q, the side on which the line between them passes an edge,
    /// with a bound on the side's error. The side is exactly 0 in three cases: the corner of Q is a mixture
    /// of ends of the edge; all four points lie in P's or Q's plane, and that is perpendicular to an axis;
    /// all four count as in Q's plane. Other sides are those that `side` returns.
    pub(super) fn sides<'b>(
        &'b self,
        sight: &'b Sight,
        edge: &'b [Corner; 2],
        side: fn(DVec3, DVec3, DVec3, DVec3, f64) -> (f64, f64),
    ) -> impl Iterator<Item = (f64, f64)> + 'b {
        let [(a, tag_a), (b, tag_b)] = *edge;
        let is_near = |x: DVec3| self.is_near_plane_of_q(sight, x);
        let is_near_edge = is_near(a) && is_near(b);
        let moved = self.moved(sight);
        let ends = tag_a.map_or(0, |k| 1u8 << k) | tag_b.map_or(0, |k| 1 << k);
        sight.p.corners().iter().flat_map(move |&p| {
            sight.q.corners().iter().zip(&sight.q.zero).map(move |(&q, &zero)| {
                let support = 0b111 ^ zero;
                let is_mixture = support & !ends == 0;
                let is_flat = [&sight.before_p, &sight.before_q].into_iter().any(|plane| {
                    let axis = plane.axis();
                    axis.is_some_and(|k| a[k] == p[k] && b[k] == p[k] && q[k] == p[k])
                });
                if is_mixture || is_flat || (is_near_edge && is_near(p) && is_near(q)) {
                    (0.0, 0.0)
                } else {
                    side(p, q, a, b, moved)
                }
            })
        })
    }

    /// Returns the bound on the distance between the given positions and those for which sides of edges are
    /// computed: without a clearance the error of positions; with one, the distance by which points near Q's
    /// plane may be moved into it.
    pub(super) fn moved(&self, sight: &Sight) -> f64 {
        sight.near.map_or(self.delta, |near| 2.0 * near)
    }

    /// Returns whether a point counts as in Q's plane: whether its height over the plane is below `near`, the
    /// limit of the search, and half as much for the errors of heights in the search. False without
    /// clearance.
    pub(super) fn is_near_plane_of_q(&self, sight: &Sight, x: DVec3) -> bool {
        let Half { normal, offset } = sight.before_q;
        let height = dot(normal.to_array().map(D::from), x.to_array().map(D::from)).plus(D::from(offset));
        sight.near.is_some_and(|near| height.hi.abs() < 1.5 * near)
    }

    /// Returns whether all segments pass an edge on one side, apart from those to the boundary of Q that meet
    /// it there.
    pub(super) fn is_on_side(&self, sight: &Sight, edge: &[Corner; 2], sign: f64) -> bool {
        let mut some = false;
        let all = self.sides(sight, edge, quick_side).all(|(value, error)| {
            some |= value != 0.0;
            (value == 0.0 && error == 0.0) || value * sign > error
        });
        all && some
    }

    /// Returns whether no segment meets an edge, by its side or by a plane that separates it from both
    /// polygons. With `from_before`, segments that start behind Q's plane do not count: P holds points behind
    /// it by less than the errors of heights, from where segments pass below corners of the target.
    pub(super) fn is_missed(&self, sight: &Sight, edge: &[Corner; 2], from_before: bool) -> bool {
        let ends = [edge[0].0, edge[1].0];
        let behind = |(x, tag): Corner| tag.is_some() || sight.before_q.height(x) < -3.0 * self.delta;
        self.is_on_side(sight, edge, 1.0)
            || self.is_on_side(sight, edge, -1.0)
            || (from_before && edge.iter().all(|&end| behind(end)))
            || self.is_outside(sight, &ends)
    }

    /// Returns whether a plane separates some points from the convex hull of both polygons.
    pub(super) fn is_outside(&self, sight: &Sight, points: &[DVec3]) -> bool {
        let (p, q) = (sight.p.corners(), sight.q.corners());
        let hull: Vec<DVec3> = p.iter().chain(q).copied().collect();
        let separates = |normal: DVec3| self.separates(normal, points, &hull);
        if separates(sight.p.normal()) || separates(sight.q.normal()) {
            return true;
        }
        [(p, q), (q, p)].into_iter().any(|(one, other)| {
            (0..one.len()).any(|i| {
                let (u, v) = (one[i], one[(i + 1) % one.len()]);
                other.iter().any(|&w| separates((v - u).cross(w - u)))
            })
        })
    }

    /// Returns whether the heights of `points` along `normal` are all above or all below those of `others`,
    /// by more than three times the error of positions.
    ///
    /// Heights in `f64` decide where they do: with components of the normal of at most 1 and coordinates of
    /// at most m, three products and two sums round by at most 9 U m, and the gap between two heights by
    /// 18 U m and once more. Where the gap is within 32 U m of the margin, double-double heights decide: the
    /// answer is always theirs.
    pub(super) fn separates(&self, normal: DVec3, points: &[DVec3], others: &[DVec3]) -> bool {
        let normal = normal.normalize_or_zero();
        let margin = 3.0 * self.delta;
        let gap = |[(a, b), (c, d)]: [(f64, f64); 2]| (a - d).max(c - b);
        let range = |points: &[DVec3], height: &dyn Fn(&DVec3) -> f64| {
            let heights = points.iter().map(height);
            heights.fold((f64::MAX, f64::MIN), |(a, b), h| (a.min(h), b.max(h)))
        };
        let rough = gap([points, others].map(|points| range(points, &|x| normal.dot(*x))));
        let most = points.iter().chain(others).fold(0.0f64, |m, x| m.max(x.abs().max_element()));
        if (rough - margin).abs() > 32.0 * U * most {
            return rough > margin;
        }
        let direction = normal.to_array().map(D::from);
        let height = |x: &DVec3| dot(direction, x.to_array().map(D::from)).hi;
        gap([points, others].map(|points| range(points, &height))) > margin
    }

    /// Returns whether the convex hull of three or four points touches neither P nor Q.
    ///
    /// If a plane separates two convex polytopes at all, one does that is parallel to a face of either or to
    /// a side of each. All of these are tried: every three points make a face, in a plane or not, every two a
    /// side. A polygon's faces are its plane, and those across the plane along its sides. The order of the
    /// points does not matter, so that a strip is apart from whichever end it is looked at.
    pub(super) fn is_apart(&self, sight: &Sight, points: &[DVec3]) -> bool {
        let pairs = || (1..points.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        let side = |i: usize, j: usize| (points[j] - points[i]).normalize_or_zero();
        let apart = |polygon: &Polygon, plane: &Half| {
            let corners = polygon.corners();
            let separates = |normal: DVec3| self.separates(normal, points, corners);
            separates(plane.normal)
                || pairs().any(|(i, j)| (0..i).any(|k| separates(side(i, j).cross(side(i, k)))))
                || (0..corners.len()).any(|i| {
                    let along = (corners[(i + 1) % corners.len()] - corners[i]).normalize_or_zero();
                    separates(plane.normal.cross(along))
                        || pairs().any(|(i, j)| separates(along.cross(side(i, j))))
                })
        };
        apart(&sight.p, &sight.before_p) && apart(&sight.q, &sight.before_q)
    }
}
