//! Tests whether segments between two polygons meet an edge, and whether a plane separates points from
//! polygons.

use super::context::{Check, Corner};
use super::exact_side::{D, dot, quick_side};
use crate::half::Half;
use crate::polygon::Polygon;
use crate::sight::Sight;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

impl Check<'_> {
    /// Returns, for each pair of a corner of the viewcell polygon P and a corner of the target polygon Q, the
    /// side on which the line between them passes an edge, with a bound on the side's error. The side is
    /// exactly 0 in three cases: the corner of Q is an end of the edge or a mean of its two ends, by their
    /// tags as corners of the target triangle; all four points (two corners and two ends) lie in P's or Q's
    /// plane, and that plane is perpendicular to an axis; all four points count as in Q's plane. In other
    /// cases `side` computes it.
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
        let ends = tagged(tag_a) | tagged(tag_b);
        sight.p.corners().iter().flat_map(move |&p| {
            sight.q.corners().iter().zip(&sight.q.zero).map(move |(&q, &zero)| {
                if is_mixture(zero, ends)
                    || is_flat(sight, [p, q, a, b])
                    || (is_near_edge && is_near(p) && is_near(q))
                {
                    (0.0, 0.0)
                } else {
                    side(p, q, a, b, moved)
                }
            })
        })
    }

    /// Returns a bound in metres, for each coordinate: a given position may be this far from the exact
    /// position for which the sides of edges must hold. Without a clearance, this is the error of positions.
    /// With a clearance, it is the distance by which points near the target polygon's plane may be moved into
    /// the plane.
    pub(super) fn moved(&self, sight: &Sight) -> f64 {
        sight.near.map_or(self.delta, |near| 2.0 * near)
    }

    /// Returns whether a point counts as in the target polygon's plane: whether its distance from the plane
    /// is below 1.5 `near`. The limit is 1.5 `near` because the search decides by `near` itself, with heights
    /// that are wrong by up to half of `near`. False without clearance.
    pub(super) fn is_near_plane_of_q(&self, sight: &Sight, x: DVec3) -> bool {
        let Half { normal, offset } = sight.before_q;
        let height = dot(normal.to_array().map(D::from), x.to_array().map(D::from)).plus(D::from(offset));
        sight.near.is_some_and(|near| height.hi.abs() < 1.5 * near)
    }

    /// Returns whether all segments pass an edge on one side. Segments to the boundary of the target polygon
    /// may meet the edge there.
    pub(super) fn is_on_side(&self, sight: &Sight, edge: &[Corner; 2], sign: f64) -> bool {
        let mut some = false;
        let all = self.sides(sight, edge, quick_side).all(|(value, error)| {
            some |= value != 0.0;
            (value == 0.0 && error == 0.0) || value * sign > error
        });
        all && some
    }

    /// Returns whether the ends of the sample line may count as further corners of P and Q: lines from and to
    /// them pass an edge on a side too. Both ends are only within an error of positions of P and Q. Sides may
    /// be 0 for lines to mixtures of the edge's ends and for four points in a plane, as in
    /// [`sides`](Self::sides), but not for the sample line itself: then no line on the way from it to a
    /// segment meets the edge.
    fn ends_are_on_side(&self, sight: &Sight, edge: &[Corner; 2], line: [DVec3; 2], sign: f64) -> bool {
        let [(a, tag_a), (b, tag_b)] = *edge;
        let ends = tagged(tag_a) | tagged(tag_b);
        let is_in_plane = |p: DVec3, q: DVec3| {
            let points = [p, q, a, b];
            is_flat(sight, points) || points.into_iter().all(|x| self.is_near_plane_of_q(sight, x))
        };
        let passes = |p: DVec3, q: DVec3| {
            let (value, error) = quick_side(p, q, a, b, 0.0);
            value * sign > error
        };
        let mut targets = sight.q.corners().iter().zip(&sight.q.zero);
        passes(line[0], line[1])
            && sight.p.corners().iter().all(|&p| passes(p, line[1]) || is_in_plane(p, line[1]))
            && targets
                .all(|(&q, &zero)| passes(line[0], q) || is_mixture(zero, ends) || is_in_plane(line[0], q))
    }

    /// Returns whether no segment meets an edge, nor the sample line `line` where that shows by sides: by
    /// the sides on which segments pass the edge, or by a plane that separates it from both polygons. With
    /// `from_before`, only segments that start in front of the target polygon's plane count; they do not
    /// meet an edge behind the plane, even if its ends are corners of the target. By the error of heights,
    /// the viewcell polygon may have points behind the plane, and segments from there may meet such an edge.
    pub(super) fn is_missed(
        &self,
        sight: &Sight,
        edge: &[Corner; 2],
        from_before: bool,
        line: [DVec3; 2],
    ) -> bool {
        let ends = [edge[0].0, edge[1].0];
        let is_passed =
            |sign| self.is_on_side(sight, edge, sign) && self.ends_are_on_side(sight, edge, line, sign);
        let behind = |(x, tag): Corner| tag.is_some() || sight.before_q.height(x) < -3.0 * self.delta;
        is_passed(1.0)
            || is_passed(-1.0)
            || (from_before && edge.iter().all(|&end| behind(end)))
            || self.is_outside(sight, &ends)
    }

    /// Returns whether a plane separates some points from the convex hull of the viewcell and target
    /// polygons.
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
    /// With U the unit round-off of `f64`, components of the normal of at most 1 and coordinates of at most
    /// m, three products and two sums round by at most 9 U m, and the gap between two heights by 19 U m. That
    /// is less than a sixth of the error of positions, 128 U m.
    pub(super) fn separates(&self, normal: DVec3, points: &[DVec3], others: &[DVec3]) -> bool {
        let normal = normal.normalize_or_zero();
        let margin = 3.0 * self.delta;
        let [(a, b), (c, d)] = [points, others].map(|points| {
            let heights = points.iter().map(|x| normal.dot(*x));
            heights.fold((f64::MAX, f64::MIN), |(a, b), h| (a.min(h), b.max(h)))
        });
        (a - d).max(c - b) > margin
    }

    /// Returns whether the convex hull of three or four points touches neither the viewcell nor the target
    /// polygon.
    ///
    /// If a plane separates two convex polytopes, one does that is parallel to a face of either or to a side
    /// of each. All such planes are tried: every three of the points count as a face, every two as a side.
    /// The faces of a polygon are its own plane and the planes across it along its sides. The answer does not
    /// depend on the order of the points.
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

/// Returns whether four points lie in the viewcell polygon's or target polygon's plane, exactly since that
/// plane is perpendicular to an axis.
fn is_flat(sight: &Sight, [p, q, a, b]: [DVec3; 4]) -> bool {
    [&sight.before_p, &sight.before_q]
        .into_iter()
        .any(|plane| plane.axis().is_some_and(|k| a[k] == p[k] && b[k] == p[k] && q[k] == p[k]))
}

/// Returns the set of corners of the target triangle, as bits, to which a point with this tag belongs.
fn tagged(tag: Option<usize>) -> u8 {
    tag.map_or(0, |k| 1 << k)
}

/// Returns whether a corner of the target polygon is a mean of the target's corners `ends`. `zero` has the
/// corners that have no weight in it.
fn is_mixture(zero: u8, ends: u8) -> bool {
    0b111 & !zero & !ends == 0
}
