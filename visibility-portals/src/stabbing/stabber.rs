//! The search for a line through a sequence of openings.

use super::floor_plan::FloorPlan;
use super::pluecker::{Edge, Opening, Pluecker, Polytope, edges_of};
use super::rectangle::Rectangle;
use super::stab::Stab;
use alloc::vec::Vec;
use visibility_core::geometry::ConvexPolygon;
use visibility_core::glam::{DVec2, DVec3};

/// Searches for lines through sequences of openings. Allocates nothing once it has seen the longest sequence,
/// except for polygons of more than eight vertices.
///
/// ```
/// use visibility_core::glam::DVec2;
/// use visibility_portals::stabbing::{Stab, Stabber};
/// let mut stabber = Stabber::new(1e-6);
/// // Three doors along x, the left end of each first. The last is too far left for the others.
/// let door = |x, from: f64| [DVec2::new(x, from + 1.0), DVec2::new(x, from)];
/// assert!(matches!(stabber.segments(&[door(0.0, 0.0), door(1.0, 0.5), door(2.0, 1.5)]), Stab::Line(_)));
/// assert!(stabber.segments(&[door(0.0, 0.0), door(1.0, 0.5), door(2.0, 3.5)]).is_no());
/// ```
#[derive(Clone, Debug)]
pub struct Stabber {
    clearance: f64,
    plan: FloorPlan,
    pluecker: Pluecker,
    edges: Vec<Edge>,
    /// By polygon of the sequence: the exclusive end of the polygon's range of edges in `edges`, and the
    /// polygon's unit normal.
    ends: Vec<(usize, DVec3)>,
    /// Segments: rectangles projected along one axis. Each segment is the end that lines pass on their left
    /// and the end that lines pass on their right, in the two coordinates that follow the axis cyclically.
    seen: Vec<[DVec2; 2]>,
    /// By segment in `seen`: the index of the rectangle that was projected to the segment.
    of: Vec<u32>,
    corners: Vec<[DVec3; 4]>,
}

impl Stabber {
    /// Makes a stabber. `clearance` is the distance, in the unit of the coordinates, that lines must keep
    /// from all edges (from all ends of segments), and should be positive. A negative or NaN clearance counts
    /// as 0. With a clearance of 0, [`segments`](Self::segments) always answers [`Stab::Undecided`].
    pub fn new(clearance: f64) -> Self {
        Self {
            // The greater of a NaN and 0 is 0.
            clearance: clearance.max(0.0),
            plan: FloorPlan::default(),
            pluecker: Pluecker::default(),
            edges: Vec::new(),
            ends: Vec::new(),
            seen: Vec::new(),
            of: Vec::new(),
            corners: Vec::new(),
        }
    }

    /// Searches for a line in the plane through all `segments`. Each segment is given by the end that the
    /// line passes on its left and the end that it passes on its right. [`Stab::Undecided`] without segments
    /// and for coordinates that are not finite.
    ///
    /// A linear program in two variables, solved in time linear in the number of segments (Seth Teller and
    /// Carlo Sequin, "Visibility Preprocessing for Interactive Walkthroughs", 1991).
    pub fn segments(&mut self, segments: &[[DVec2; 2]]) -> Stab<[DVec2; 2]> {
        self.plan.stab(segments, self.clearance)
    }

    /// Searches for a line through axis-aligned rectangles, in world space.
    ///
    /// Projected along each axis, the line passes segments. If the segments of one axis allow no
    /// [line](Self::segments), no line passes the rectangles (Teller and Sequin, 1991). Otherwise the answer
    /// is that of [`polygons`](Self::polygons). A certificate from segments names segment ends, two for each
    /// rectangle: index 2 i for the left end of rectangle i, 2 i + 1 for its right end.
    pub fn rectangles(&mut self, rectangles: &[Rectangle]) -> Stab<[DVec3; 2]> {
        for axis in 0..3 {
            self.seen.clear();
            self.of.clear();
            for (i, rectangle) in rectangles.iter().enumerate() {
                if let Some(ends) = rectangle.seen_along(axis) {
                    self.seen.push(ends);
                    self.of.push(i as u32);
                }
            }
            if let Stab::No(certificate) = self.plan.stab(&self.seen, self.clearance) {
                // An end of a projected segment is an edge along the axis, named by its rectangle.
                let of = &self.of;
                return Stab::No(certificate.renumbered(|end| 2 * of[end as usize / 2] + end % 2));
            }
        }
        let mut corners = core::mem::take(&mut self.corners);
        corners.clear();
        corners.extend(rectangles.iter().map(Rectangle::corners));
        let answer = self.polygons(&corners);
        self.corners = corners;
        answer
    }

    /// Searches for a line through planar convex polygons. Each polygon is given by its vertices,
    /// counter-clockwise around the direction in which the line passes.
    ///
    /// A linear program in five variables, solved in time linear in the number of edges: see Durand's survey,
    /// chapter 8, section 3. Only a few lines are tried, so [`Stab::Undecided`] may be returned for a
    /// sequence that has a line. `Stab::Undecided` is also returned for a sequence that has no line although
    /// lines pass any few of the edges, for polygons that are not planar or not convex, and without polygons.
    pub fn polygons<P: AsRef<[DVec3]>>(&mut self, polygons: &[P]) -> Stab<[DVec3; 2]> {
        self.edges.clear();
        self.ends.clear();
        let inset = 0.4 * self.clearance;
        for polygon in polygons {
            let vertices = polygon.as_ref();
            let Some(plane) = ConvexPolygon::new(vertices.iter().copied()).ok().and_then(|p| p.plane())
            else {
                return Stab::Undecided;
            };
            edges_of(vertices.iter().copied(), plane.normal, inset, &mut self.edges);
            self.ends.push((self.edges.len(), plane.normal));
        }
        let (Some(first), Some(last)) = (polygons.first(), polygons.last()) else { return Stab::Undecided };
        let middle = |polygon: &P| {
            let vertices = polygon.as_ref();
            vertices.iter().fold(DVec3::ZERO, |sum, &v| sum + v) / vertices.len() as f64
        };
        let from = middle(first);
        let direction = (middle(last) - from).try_normalize().unwrap_or(self.ends[0].1);
        // The line between the middles of the first and the last polygon often passes all others: it is tried
        // before the linear program.
        if self.is_clear(from, direction) {
            return Stab::Line([from, direction]);
        }
        let Self { pluecker, edges, ends, clearance, .. } = self;
        let opening = |i: usize| {
            let start = if i == 0 { 0 } else { ends[i - 1].0 };
            Opening { edges: &edges[start..ends[i].0], against: false, normal: ends[i].1 }
        };
        let polytope = pluecker.test(opening, ends.len(), (from, direction), *clearance);
        match polytope {
            Polytope::Empty(certificate) => Stab::No(certificate),
            Polytope::Open => {
                let lines = INSIDE_FRACTIONS.map(|inside| self.pluecker.line(from, inside));
                let mut clear = lines.into_iter().flatten().filter(|[p, d]| self.is_clear(*p, *d));
                clear.next().map_or(Stab::Undecided, Stab::Line)
            }
        }
    }

    /// Tests whether a line, given by a point and a direction of any length, certainly passes all edges on
    /// their left side at least the clearance away. `false` if undecided.
    fn is_clear(&self, point: DVec3, direction: DVec3) -> bool {
        self.edges.iter().filter(|edge| edge.a != edge.b).all(|edge| {
            let (e, from) = (edge.b - edge.a, point - edge.a);
            let across = direction.cross(e);
            // The triple product, rounded at each step, is off by less than 20u of the product of the
            // lengths, or of the lengths before the subtractions. Where the test passes, the right side is no
            // greater and is off by no more: 64u covers both.
            let sizes =
                (point.length() + edge.a.length()) * (edge.a.length() + edge.b.length()) * direction.length();
            across.dot(from) >= self.clearance * across.length() + 32.0 * f64::EPSILON * sizes
        })
    }
}

/// Distances from the boundary at which a point of the linear program is searched, in this order until one is
/// found: how far inside each half-space the point must be, as a fraction of the half-space's greatest
/// coefficient.
const INSIDE_FRACTIONS: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];

#[cfg(test)]
mod tests {
    use super::super::floor_plan::is_clear as is_clear_in_plan;
    use super::*;
    use crate::integer_vectors::{IntegerVector, Random};

    /// Returns a clearance that a line just misses: greater by a relative 1e-9 than the line's distance
    /// `product / across` from an edge. For a line on the wrong side (`product` not positive), which misses
    /// any positive clearance, returns 1e-9.
    fn just_missed(product: f64, across: f64) -> f64 {
        if product > 0.0 { product / across * (1.0 + 1e-9) } else { 1e-9 }
    }

    #[test]
    fn lines_that_are_nearly_as_far_off_as_they_have_to_be_are_not_clear() {
        let mut random = Random(6);
        for _ in 0..20_000 {
            let [d, e, a, near] = [1 << 24, 1 << 24, 1 << 20, 4].map(|most| random.vector(most));
            // The point lies far along the plane of the line and the edge, and very little off the plane.
            let from = d.times(random.below(1 << 25)).plus(e.times(random.below(1 << 25))).plus(near);
            let across = d.cross(e);
            let (a, b) = (a.to_f64(), a.plus(e).to_f64());
            let edge = Edge { a, b, shift: DVec3::ZERO, bounds: true };
            let clearance = just_missed(across.dot(near) as f64, across.to_f64().length());
            let stabber = Stabber { edges: alloc::vec![edge], ..Stabber::new(clearance) };
            assert!(!stabber.is_clear(a + from.to_f64(), d.to_f64()), "{d:?} {e:?} {from:?}");
        }
        // A vertical edge 5 ahead and 1 to the right: a clearance smaller by ten times the margin is met.
        let edge = Edge {
            a: DVec3::new(5.0, -1.0, 0.0),
            b: DVec3::new(5.0, -1.0, 1.0),
            shift: DVec3::ZERO,
            bounds: true,
        };
        let is_clear = |clearance| {
            let stabber = Stabber { edges: alloc::vec![edge], ..Stabber::new(clearance) };
            [DVec3::X, DVec3::NEG_X].map(|direction| stabber.is_clear(DVec3::ZERO, direction))
        };
        assert!(
            is_clear(1.0 - 1e-12).contains(&true) && is_clear(1.0) == [false; 2],
            "an edge 1 m off is clear of slightly less than 1 m alone"
        );
    }

    #[test]
    fn a_negative_or_nan_clearance_counts_as_zero() {
        // The line through the middles of the outer doors passes the middle door 0.2 outside.
        let door = |x: f64, y: f64| {
            [[y, 0.0], [y + 1.0, 0.0], [y + 1.0, 1.0], [y, 1.0]].map(|[y, z]| DVec3::new(x, y, z))
        };
        let doors = [door(0.0, 0.0), door(1.0, 0.7), door(2.0, 0.0)];
        for clearance in [-0.5, f64::NEG_INFINITY, f64::NAN] {
            let answer = Stabber::new(clearance).polygons(&doors);
            let Stab::Line([p, d]) = answer else { panic!("{answer:?}") };
            let y = [0.0, 1.0, 2.0].map(|x| p.y + d.y * (x - p.x) / d.x);
            assert!(y[0] <= 1.0 && y[1] >= 0.7 && y[2] <= 1.0, "{clearance}: {y:?}");
            assert_eq!(answer, Stabber::new(0.0).polygons(&doors), "clearance {clearance}: the answer for 0");
        }
    }

    #[test]
    fn lines_of_a_plan_that_are_nearly_as_far_off_as_they_have_to_be_are_not_clear() {
        let mut random = Random(7);
        let flat = |random: &mut Random, most| IntegerVector([random.below(most), random.below(most), 0]);
        for _ in 0..20_000 {
            let [d, p, near] = [1 << 24, 1 << 20, 4].map(|most| flat(&mut random, most));
            let left = d.times(random.below(1 << 27)).plus(near);
            // The right end is far to the right.
            let right = left.plus(IntegerVector([d.0[1], -d.0[0], 0]).times(1 << 8));
            let segments = [[left, right].map(|end| p.plus(end).to_f64().truncate())];
            let clearance = just_missed(d.cross(near).0[2] as f64, d.to_f64().length());
            let line = [p, d].map(|v| v.to_f64().truncate());
            assert!(!is_clear_in_plan(&segments, line, clearance), "{d:?} {left:?}");
        }
        // A clearance smaller by ten times the margin is met.
        let segment = [[DVec2::new(5.0, 1.0), DVec2::new(5.0, -1.0)]];
        assert!(
            is_clear_in_plan(&segment, [DVec2::ZERO, DVec2::X], 1.0 - 1e-13),
            "a segment 1 m off is clear of slightly less than 1 m"
        );
        assert!(
            !is_clear_in_plan(&segment, [DVec2::ZERO, DVec2::X], 1.0),
            "a segment 1 m off is not clear of 1 m"
        );
    }
}
