//! Search for the viewcells that a convex polygon reaches into. The polygon is where the lines of sight of a
//! view begin ([`View::for_each_sight_start`](crate::View::for_each_sight_start)).
//!
//! The near plane of an eye close to a wall may reach through the wall into the next viewcell. If part of the
//! polygon is outside all viewcells, the PVS says nothing about that part.

use super::{Viewcell, Viewcells};
use crate::geometry::{Corners, clip_outward};
use crate::pvs::ViewcellId;
use alloc::vec::Vec;
use glam::DVec3;
use smallvec::SmallVec;

/// Greatest number of pieces into which a polygon may be cut by viewcells before the coverage test gives up.
const MAX_PIECES: u32 = 2000;

/// Margin for rounding, in units of the sum of the greatest absolute coordinates of the anchor (`a`) and of
/// the polygon (`r`).
///
/// Let `u = EPSILON / 2`, `a` the anchor, `r` the greatest absolute coordinate of the polygon relative to the
/// anchor, and `n` the unit normal of a viewcell's plane. A plane within reach has an offset of at most `|n .
/// a| + 2 r`. Normalizing the plane and moving it to the anchor rounds the offset and `n . a` by `9u` of
/// their magnitudes: `18u |a| + 18u r` together, where the length `|a|` is up to `3^1/2` times the greatest
/// coordinate. The height of a corner is rounded by `4u` of reach and offset, `12u r`. Each cut puts its
/// corners up to `4u r` off the edge. So `32u` of the anchor and `30u` of the reach are needed, and `4u` more
/// for each cut. The margin is `64u` of both.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

impl Viewcells {
    /// Replaces the content of `reached` by the viewcells that a convex polygon may reach into. Returns true
    /// if these viewcells cover the polygon, except for gaps up to twice the margin wide.
    ///
    /// `corners` are in order around the polygon, in metres relative to `anchor`, a point in world space.
    /// Each corner is within `error` metres of its true position. The margin is `error` plus the
    /// [misplacement](Self::misplacement) of the viewcells plus the rounding of the test itself. Returns
    /// false, with unspecified content of `reached`, for no corners, for a corner that is not finite, and for
    /// a polygon that viewcells cut into thousands of pieces.
    ///
    /// Does not allocate once `reached` is large enough. Time is proportional to the number of viewcells
    /// reached, and logarithmic in the number of all.
    pub fn reached(
        &self,
        corners: &[DVec3],
        anchor: DVec3,
        error: f64,
        reached: &mut Vec<ViewcellId>,
    ) -> bool {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &at in corners {
            (min, max) = (min.min(at), max.max(at));
        }
        reached.clear();
        let reach = min.abs().max(max.abs()).max_element();
        let margin = error + self.misplacement() + ROUNDING * (reach + anchor.abs().max_element());
        // Also refuses NaN, which `min` and `max` ignore.
        if !(margin < f64::INFINITY && corners.iter().all(|corner| corner.is_finite())) {
            return false;
        }
        self.for_each_touching(anchor + min - margin, anchor + max + margin, |cell| reached.push(cell));
        let all = self.cells();
        // Keeps only the viewcells that the polygon itself reaches into, not just its bounding box.
        reached.retain(|cell| {
            let mut left = Corners::from_slice(corners);
            for plane in all[cell.index()].faces(anchor) {
                left = clip_outward(&left, &plane, margin);
            }
            !left.is_empty()
        });
        is_covered(corners, reached, all, anchor, margin, &mut { MAX_PIECES })
    }
}

/// Tests whether the viewcells in `by` cover the convex polygon `piece`, relative to `anchor`, except for
/// gaps up to twice `margin` (metres) wide. Each viewcell in turn takes its part of the polygon; the parts
/// beyond its faces are left to the remaining viewcells. A viewcell of which a face is not known takes no
/// part. `pieces` counts down the number of pieces still allowed; when it is 0, the test gives up and returns
/// false.
fn is_covered(
    piece: &[DVec3],
    by: &[ViewcellId],
    all: &[Viewcell],
    anchor: DVec3,
    margin: f64,
    pieces: &mut u32,
) -> bool {
    let Some((first, others)) = by.split_first() else { return false };
    if *pieces == 0 {
        return false;
    }
    *pieces -= 1;
    if !all[first.index()].has_all_faces() {
        return is_covered(piece, others, all, anchor, margin, pieces);
    }
    let mut rest: Corners = SmallVec::from_slice(piece);
    for plane in all[first.index()].faces(anchor) {
        let beyond = |at: &DVec3| plane.signed_distance(*at) < -margin;
        if !rest.iter().any(beyond) {
            continue;
        }
        let outer = clip_outward(&rest, &plane.flipped(), -margin);
        if !outer.is_empty() && !is_covered(&outer, others, all, anchor, margin, pieces) {
            return false;
        }
        rest = clip_outward(&rest, &plane, margin);
        if rest.is_empty() {
            return true;
        }
    }
    true
}
