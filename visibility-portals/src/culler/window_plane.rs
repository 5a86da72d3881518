//! The planes that bound the view through portals, each with a bound on its error, and the clipping of
//! portals against these planes.
//!
//! # Why rounding loses no line of sight
//! A window is a list of [`WindowPlane`]s: the planes of the view, and planes through the eye and an edge of
//! a portal of the chain. *Every* line of sight through the chain is on the inner side of each plane. A plane
//! is always computed from a whole edge of an input polygon, never from corners that clipping has computed,
//! so errors do not accumulate along a chain. Clipping only finds out which planes matter, and whether any
//! line is left. Leaving a plane out enlarges the window and is conservative. Two facts remain to be proven:
//! - the error terms of each plane are sufficient: derived at [`WindowPlane::through_edge`] and
//!   [`WindowPlane::of_view`];
//! - clipping calls a polygon empty only if it is empty: derived at [`clip_corners`].

use visibility_core::glam::DVec3;
use visibility_core::{geometry::Plane, view::ViewPlane};

/// Unit round-off of `f64`: 2^-53, the relative error of one rounded operation.
pub(super) const U: f64 = f64::EPSILON / 2.0;

/// A half-space that contains all lines of sight through a window, for points relative to the anchor of a
/// [`PortalView`](super::view_planes::PortalView). Its inner side is the side that the plane's unit normal
/// points to.
///
/// Every point `x` seen through the window satisfies `normal . x + offset >= -(slack + slope |x|)`, with the
/// normal as it is stored. `slack` is an absolute error in world units, `slope` an error per unit of distance
/// from the anchor.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct WindowPlane {
    pub(super) plane: Plane,
    pub(super) slope: f64,
    pub(super) slack: f64,
}

impl WindowPlane {
    /// Returns the half-space of a plane of the view (anchor-relative, normal into the view), with `slope`
    /// and `slack` derived from the plane's error bound.
    pub(super) fn of_view(plane: &ViewPlane) -> Self {
        // With the unit round-off `u` = 2^-53, each component of the normal has a relative error of up to
        // `16u`, which contributes `16u |x|` to the product with a point `x`. Evaluating the product rounds
        // by `4u |x|`, and the sum by `u` of itself. The slope of `32u` covers all three.
        let ViewPlane { plane, error } = *plane;
        Self { plane, slope: 32.0 * U, slack: error + 4.0 * U * plane.offset.abs() }
    }

    /// Returns the half-space bounded by the plane through the eye, which is the anchor, and the edge from
    /// `a` to `b`. The end points are anchor-relative, and each is within `error` world units of its exact
    /// position relative to the exact eye. The inner side is on the left of the edge as seen from the eye for
    /// `sign` 1, on the right for `sign` -1. `None` if the edge is too short, or too nearly in line with the
    /// eye, to bound anything.
    pub(super) fn through_edge(a: DVec3, b: DVec3, sign: f64, error: f64) -> Option<Self> {
        // Let `p` and `q` be the errors of `a` and `b`, at most `error = e` long, and `u` the unit round-off
        // 2^-53. The exact normal is `(a + p) x (b + q)`. It differs from `a x b` by at most `e (|a| + |b| +
        // e)`. The computed product is off by another `4u |a| |b|` and, once it has unit length, by `8u` of
        // itself. For a point at a distance `|x|` from the eye this gives `slope |x|`, plus `e` for the
        // position of the eye.
        let normal = a.cross(b);
        let (length, la, lb) = (normal.length(), a.length(), b.length());
        let off = error * (la + lb + error) + 8.0 * U * la * lb;
        let slope = off / length + 16.0 * U;
        // Written so that a NaN is rejected as well.
        (slope < USELESS).then(|| Self {
            plane: Plane::new(normal * (sign / length), 0.0),
            slope,
            slack: error * (1.0 + slope) + f64::MIN_POSITIVE,
        })
    }

    /// Returns the half-space bounded by the plane that contains the edge from `a` to `b` and is parallel to
    /// the unit vector `direction`, the direction of all lines of sight of an orthographic view. `turn`
    /// bounds the length of the difference between `direction` and the exact direction. The end points are
    /// anchor-relative, and each is within `error` world units of its exact position. As seen along
    /// `direction`, the inner side is on the left of the edge for `sign` 1, on the right for `sign` -1.
    /// `None` if the edge is too short, or too nearly parallel to `direction`, to bound anything.
    pub(super) fn along(
        direction: DVec3,
        turn: f64,
        a: DVec3,
        b: DVec3,
        sign: f64,
        error: f64,
    ) -> Option<Self> {
        // Let `direction'` be the exact direction, `u` the unit round-off 2^-53, and `r` the error of `b -
        // a`, at most `2 error` long. The exact normal is `direction' x (b - a + r)`; the computed normal is
        // off by at most `2 error + |b - a| (turn + 8u)`. For a point `x` this error is multiplied by its
        // distance from the exact `a`, at most `|x| + |a| + error`. The exact `a` is in the exact plane, and
        // off the computed one by `error`.
        let normal = direction.cross(b - a);
        let length = normal.length();
        let off = 2.0 * error + (b - a).length() * (turn + 8.0 * U);
        let slope = off / length + 16.0 * U;
        (slope < USELESS).then(|| {
            let unit = normal * (sign / length);
            let offset = -unit.dot(a);
            let slack = (slope + 8.0 * U) * a.length() + error * (1.0 + slope) + f64::MIN_POSITIVE;
            Self { plane: Plane::new(unit, offset), slope, slack }
        })
    }

    /// Returns the greatest distance, in world units, by which a point on a line of sight through the window
    /// may seem to lie on the outer side of the plane, because of errors. The point is at most `reach` world
    /// units from the anchor.
    pub(super) fn margin(&self, reach: f64) -> f64 {
        self.slack + self.slope * reach
    }

    /// Tests whether a box is certainly on the outer side of the plane, opposite to its normal. The box is
    /// anchor-relative, and its corners are known up to `error` world units. `false` if undecided, touching
    /// or NaN.
    pub(super) fn excludes(&self, min: DVec3, max: DVec3, error: f64) -> bool {
        let n = self.plane.normal;
        let far = DVec3::select(n.cmpge(DVec3::ZERO), max, min);
        let reach = min.abs().max(max.abs());
        // The sum of the absolute coordinates is at least the length. The exact point may be farther off by
        // its error.
        self.plane.signed_distance(far) < -(self.margin(reach.x + reach.y + reach.z + error) + error)
    }
}

/// Maximum [slope](WindowPlane::slope) (error per unit of distance) of a plane that is used. A plane whose
/// error grows by this much or more per unit of distance is too uncertain to bound anything and is left out.
pub(super) const USELESS: f64 = 0.25;

/// A corner of a clipped portal, relative to the anchor of the view, and the source of the edge from this
/// corner to the next.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Corner {
    pub(super) at: DVec3,
    pub(super) edge: EdgeSource,
}

/// The source of an edge of a clipped portal: the portal's own edge, or the plane that cut it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum EdgeSource {
    /// An edge of the portal itself: from the portal vertex of this index to the next vertex.
    Own(u32),
    /// A plane of the window cut the portal along this edge. The value is the plane's index in
    /// `PortalWalk::sides`.
    Window(u32),
    /// The far plane or a clip plane of the view cut the portal along this edge.
    End,
}

/// Clips a convex polygon with anchor-relative `corners` to the inner side of `side`, and replaces `out` by
/// the result. The edge that the cut makes along the plane gets `edge` as its source. `error` bounds the
/// distance between the corners and the exact polygon, in world units; the rounding of clipping is added to
/// it. Returns `false` if the polygon is certainly outside, so that nothing is left; `true` otherwise.
pub(super) fn clip_corners(
    corners: &[Corner],
    side: &WindowPlane,
    edge: EdgeSource,
    error: &mut f64,
    out: &mut alloc::vec::Vec<Corner>,
) -> bool {
    // Let an exact point `x` of the polygon be inside the exact half-space, so that `n . x + o >= -margin`
    // with the stored normal `n`, the stored offset `o` and the plane's margin. The polygon that `corners`
    // span has a point `y` within `error` of `x`, for which `n . y + o >= -(margin + error)`: clipping to the
    // plane moved outwards by that sum keeps `y`. The margin is that of `x`, which may be farther from the
    // anchor than `y` by `error`. Computing the distance of a corner rounds by `8u` (`u` = 2^-53) of its
    // distance from the anchor, its reach. This is added once for the corner that is dropped,
    // and once more for the position of the crossing. The crossing is off the edge by rounding only, `4u` of
    // the reach, which is added to `error`.
    out.clear();
    let reach = corners.iter().fold(0.0, |reach: f64, corner| {
        let at = corner.at.abs();
        reach.max(at.x + at.y + at.z)
    });
    let moved = side.margin(reach + *error) + *error + 16.0 * U * (reach + side.plane.offset.abs());
    let height = |corner: &Corner| side.plane.signed_distance(corner.at) + moved;
    let mut a = match corners.first() {
        Some(first) => (*first, height(first)),
        None => return false,
    };
    let first = a;
    let mut crossed = false;
    for i in 0..corners.len() {
        let b = corners.get(i + 1).map_or(first, |corner| (*corner, height(corner)));
        // A NaN is on neither side, and is kept.
        let (a_out, b_out) = (a.1 < 0.0, b.1 < 0.0);
        if !a_out {
            out.push(a.0);
        }
        if a_out != b_out {
            crossed = true;
            let (inner, outer) = if b_out { (a, b) } else { (b, a) };
            let part = inner.1 / (inner.1 - outer.1);
            let at = inner.0.at + (outer.0.at - inner.0.at) * part;
            out.push(Corner { at, edge: if b_out { edge } else { a.0.edge } });
        }
        a = b;
    }
    if crossed {
        *error += 8.0 * U * reach;
    }
    !out.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integer_vectors::{IntegerVector, Random as Exact};
    use alloc::vec::Vec;
    use visibility_testing::{Random, sign_of_sum};

    /// Returns one of the two unit vectors along `axis`, or a vector of random direction and of a length up
    /// to 1.
    fn off(random: &mut Random, axis: DVec3) -> DVec3 {
        match random.below(3) {
            0 => axis,
            1 => -axis,
            _ => random.vector(1.0).clamp_length_max(1.0),
        }
    }

    /// The error of a plane of the view, which is large here, is part of what is not outside of the plane.
    #[test]
    fn planes_of_the_view_have_its_error() {
        let view = ViewPlane { plane: Plane::new(DVec3::X, 1.0), error: 0.5 };
        let side = WindowPlane::of_view(&view);
        for (x, is_outside) in [(-1.49, false), (-1.51, true)] {
            let at = DVec3::new(x, 0.0, 0.0);
            assert_eq!(side.excludes(at, at, 0.0), is_outside, "a point at {x}");
        }
    }

    /// A polygon and a box are not outside of a plane on whose inner side they have an exact point, off by
    /// the error.
    #[test]
    fn polygons_and_boxes_with_exact_points_inside_are_not_outside() {
        let mut random = Random(2);
        let (mut out, mut met) = (Vec::new(), 0);
        for trial in 0..200_000 {
            let (slope, slack) = (random.range(0.0, USELESS) * random.unit(), 0.1 * random.unit());
            let normal = random.vector(1.0).normalize();
            let plane = Plane::new(normal, random.range(-1.0, 1.0));
            let side = WindowPlane { plane, slope, slack };
            // The anchor's axes are where the sum of coordinates is the distance.
            let axis = DVec3::AXES[random.below(3)];
            let at = (axis - normal * (normal.dot(axis))) * random.range(-3.0, 3.0)
                + normal * random.range(-2.0, 2.0);
            // Half of the points are nearer to the anchor than their error.
            let at = at * if random.one_in(2) { random.unit().powi(4) } else { 1.0 };
            let mut error = random.unit();
            let aside = normal + at.normalize() * random.range(0.0, 0.5);
            let exact = at + off(&mut random, aside.normalize()) * error;
            if side.plane.signed_distance(exact) < -side.margin(exact.length()) {
                continue;
            }
            assert!(!side.excludes(at, at, error), "trial {trial}: a box at {at}, off by {error}, {side:?}");
            let corner = Corner { at, edge: EdgeSource::End };
            let is_left = clip_corners(&[corner; 3], &side, EdgeSource::End, &mut error, &mut out);
            assert!(is_left, "trial {trial}: a polygon at {at}, off by {error}, {side:?}");
            met += 1;
        }
        assert!(met > 10_000, "{met} points are inside");
    }

    /// A corner that is on a plane, or inside of it by less than the rounding of its distance, is kept.
    #[test]
    fn corners_on_a_plane_are_kept_whatever_the_rounding() {
        let (mut random, mut rounded, mut out) = (Random(3), 0, Vec::new());
        for trial in 0..50_000 {
            let (normal, at) = (random.direction(), random.fine_vector(10f64.powi(trial % 9 - 4)));
            let off = f64::from(random.between(-4, 4)) * U * normal.abs().dot(at.abs());
            let plane = Plane::new(normal, off - normal.dot(at));
            let terms = (0..3).map(|k| (normal[k], at[k])).chain([(plane.offset, 1.0)]);
            if sign_of_sum(terms) < 0 {
                continue;
            }
            rounded += u32::from(plane.signed_distance(at) < 0.0);
            let side = WindowPlane { plane, slope: 0.0, slack: 0.0 };
            let corner = Corner { at, edge: EdgeSource::End };
            let is_left = clip_corners(&[corner; 3], &side, EdgeSource::End, &mut 0.0, &mut out);
            assert!(is_left, "trial {trial}: a corner at {at}, {plane:?}");
        }
        assert!(rounded > 50, "{rounded} corners inside seem to be outside");
    }

    /// What clipping adds to the error covers the distance of crossings from the edges that they are on. All
    /// corners are whole numbers of up to 26 bits, and distances are computed in units of 2^-40.
    #[test]
    fn crossings_are_as_near_to_their_edges_as_the_error_says() {
        let (mut random, mut most, mut out) = (Exact(4), 0.0, Vec::new());
        for trial in 0..20_000 {
            let ends = [0; 3].map(|_| random.vector(1 << 26));
            let plane = Plane::new(random.vector(1 << 26).to_f64().normalize_or_zero(), 0.0);
            let side = WindowPlane { plane, slope: 0.0, slack: 0.0 };
            let corners = ends.map(|at| Corner { at: at.to_f64(), edge: EdgeSource::Own(0) });
            let mut error = 0.0;
            clip_corners(&corners, &side, EdgeSource::End, &mut error, &mut out);
            for at in out.iter().map(|corner| corner.at) {
                let whole = IntegerVector((at * (1u64 << 40) as f64).to_array().map(|x| x as i128));
                let off = (0..3).map(|k| {
                    let (a, e) = (ends[k], ends[(k + 1) % 3].minus(ends[k]));
                    let across = whole.minus(a.times(1 << 40)).cross(e);
                    across.to_f64().length() / (e.to_f64().length() * (1u64 << 40) as f64)
                });
                let off = off.fold(f64::INFINITY, f64::min);
                assert!(off <= error + 1e-11, "trial {trial}: {at} is {off} off its edge, error {error}");
                most = f64::max(most, off);
            }
        }
        assert!(most > 1e-9, "a crossing {most} off its edge");
    }
}
