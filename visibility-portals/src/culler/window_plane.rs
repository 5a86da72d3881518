//! The planes that bound what is seen through portals, each with a bound on its error, and clipping portals
//! to them.
//!
//! # Why nothing is lost to rounding
//! A window is a list of [`WindowPlane`]s: the planes of the view, and planes through the eye and an edge of
//! a portal of the chain. *Every* line of sight through the chain is on the inner side of each. Planes are
//! always made from a whole edge as it was given, never from corners that clipping has computed, so errors do
//! not add up along a chain. Clipping only finds out which planes matter, and whether any line is left.
//! Leaving a plane out shows more, never less. So two things must be safe:
//! - each plane, by its error terms: derived at [`WindowPlane::through_edge`] and [`WindowPlane::of_view`];
//! - that a polygon is called empty only if it is: derived at [`clip`].

use visibility_core::glam::DVec3;
use visibility_core::{geometry::Plane, view::ViewPlane};

/// Unit round-off of `f64`.
pub(super) const U: f64 = f64::EPSILON / 2.0;

/// A half-space that holds all lines of sight through a window, for points relative to the anchor of a
/// [`PortalView`](super::portal_view::PortalView).
///
/// A point `x` that is seen satisfies `normal . x + offset >= -(slack + slope |x|)`, with the unit normal as
/// it is stored.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct WindowPlane {
    pub(super) plane: Plane,
    pub(super) slope: f64,
    pub(super) slack: f64,
}

impl WindowPlane {
    /// A plane of the view. Its normal's components are within `8 EPSILON` of their size, `16u |x|` in the
    /// product with `x`; evaluating the product rounds by `4u |x|`, the sum by `u` of itself, which the rest
    /// of `32u` covers.
    pub(super) fn of_view(plane: &ViewPlane) -> Self {
        let ViewPlane { plane, error } = *plane;
        Self { plane, slope: 32.0 * U, slack: error + 4.0 * U * plane.offset.abs() }
    }

    /// The plane through the eye, which is the anchor, and an edge from `a` to `b`, both within `error` of
    /// where they truly are as the eye sees them (that includes the error of the eye itself). The normal is
    /// on the left of the edge as seen from the eye; `sign` -1 turns it round. `None` if the edge is too
    /// short, or too near in line with the eye, to bound anything.
    ///
    /// The true normal is `(a + p) x (b + q)` with `|p|, |q| <= error = e`. It is off `a x b` by at most
    /// `e (|a| + |b| + e)`, and the computed product by another `4u |a| |b|` and, once it has unit length,
    /// `8u` of itself. Of a point at `x`, as far as it is from the eye, that makes `slope |x|`, and `e` for
    /// where the eye is.
    pub(super) fn through_edge(a: DVec3, b: DVec3, sign: f64, error: f64) -> Option<Self> {
        let normal = a.cross(b);
        let (length, la, lb) = (normal.length(), a.length(), b.length());
        let off = error * (la + lb + error) + 8.0 * U * la * lb;
        let slope = off / length + 16.0 * U;
        // Written so that a NaN is too short as well.
        (slope < USELESS).then(|| Self {
            plane: Plane::new(normal * (sign / length), 0.0),
            slope,
            slack: error * (1.0 + slope) + f64::MIN_POSITIVE,
        })
    }

    /// As [`through_edge`](Self::through_edge), where the lines of sight run along a unit `direction`, within
    /// `turn` of the true one.
    ///
    /// The true normal is `direction' x (b - a + r)` with `|r| <= 2 error`; it is off by at most
    /// `2 e + |b - a| (turn + 8u)`. Of a point `x`, that counts by its distance from `a`, at most
    /// `|x| + |a|`.
    pub(super) fn along(
        direction: DVec3,
        turn: f64,
        a: DVec3,
        b: DVec3,
        sign: f64,
        error: f64,
    ) -> Option<Self> {
        let normal = direction.cross(b - a);
        let length = normal.length();
        let off = 2.0 * error + (b - a).length() * (turn + 8.0 * U);
        let slope = off / length + 16.0 * U;
        (slope < USELESS).then(|| {
            let unit = normal * (sign / length);
            let offset = -unit.dot(a);
            let slack = slope * a.length() + 2.0 * error + 8.0 * U * a.length() + f64::MIN_POSITIVE;
            Self { plane: Plane::new(unit, offset), slope, slack }
        })
    }

    /// The most that a point at a distance of at most `reach` from the anchor may be beyond the plane and
    /// still be seen.
    pub(super) fn margin(&self, reach: f64) -> f64 {
        self.slack + self.slope * reach
    }

    /// Whether a box is certainly on the outer side. The box is relative to the anchor, and known up to
    /// `error`. False for NaN.
    pub(super) fn excludes(&self, min: DVec3, max: DVec3, error: f64) -> bool {
        let n = self.plane.normal;
        let far = DVec3::select(n.cmpge(DVec3::ZERO), max, min);
        let reach = min.abs().max(max.abs());
        // The sum of coordinates is at least the length.
        self.plane.signed_distance(far) < -(self.margin(reach.x + reach.y + reach.z) + error)
    }
}

/// Planes whose slope is no less than this are left out: they are known too little to bound anything.
const USELESS: f64 = 0.25;

/// A corner of a clipped portal, and what bounds the portal from this corner to the next.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Corner {
    pub(super) at: DVec3,
    pub(super) edge: Edge,
}

/// What bounds a clipped portal.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Edge {
    /// The edge of the portal from this vertex to the next.
    Own(u32),
    /// The plane of the window with this index.
    Window(u32),
    /// The far plane, or a clip plane.
    End,
}

/// The part of a convex polygon inside of a side; `error` is how far the corners may be from the true
/// polygon, and what clipping adds to that is added to it. Whether anything may be left.
///
/// Let a true point `x` of the polygon be inside of the true half-space: the side holds it to
/// `n . x + o >= -margin`. The polygon that `corners` span has a point within `error` of it, for which
/// `n . y + o >= -(margin + error)`: clipping to the plane moved out by that keeps `y`. To compute the
/// distance of a corner rounds by `8u` of its reach, which is added once for the corner that is dropped, and
/// once more for where the crossing is put. That point is off the edge by rounding only, `4u` of the reach:
/// the new `error`.
pub(super) fn clip(
    corners: &[Corner],
    side: &WindowPlane,
    edge: Edge,
    error: &mut f64,
    out: &mut alloc::vec::Vec<Corner>,
) -> bool {
    out.clear();
    let reach = corners.iter().fold(0.0, |reach: f64, corner| {
        let at = corner.at.abs();
        reach.max(at.x + at.y + at.z)
    });
    let moved = side.margin(reach) + *error + 16.0 * U * (reach + side.plane.offset.abs());
    let height = |corner: &Corner| side.plane.signed_distance(corner.at) + moved;
    let mut a = match corners.first() {
        Some(first) => (*first, height(first)),
        None => return false,
    };
    let first = a;
    let mut crossed = false;
    for i in 0..corners.len() {
        let b = corners.get(i + 1).map_or(first, |corner| (*corner, height(corner)));
        // A NaN is on neither side, and kept.
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
