//! Which viewcells a convex polygon reaches into: that in which lines of sight begin
//! ([`View::for_each_sight_start`](crate::View::for_each_sight_start)).
//!
//! An eye close to a wall sees through it, from the next viewcell. Where part of the polygon is in no
//! viewcell, nothing is known of what is seen from there.

use super::{Viewcell, Viewcells};
use crate::geometry::{Corners, clip_outward};
use crate::{geometry::Plane, pvs::ViewcellId};
use alloc::vec::Vec;
use glam::DVec3;
use smallvec::SmallVec;

/// How many pieces a polygon may fall into while viewcells are taken from it.
const MOST_PIECES: u32 = 2000;

/// The margin for rounding, relative to the greatest coordinates `a` of the anchor and `r` of the polygon.
///
/// With `u = EPSILON / 2`: a plane within reach has an offset of at most `|n . a| + 2 r`. To make its normal
/// a unit and to move it to the anchor rounds each of these `9u` of itself: `18u |a| + 18u r`, with `|a|` up
/// to `3^1/2` times the greatest coordinate. The height of a corner rounds by `4u` of reach and offset, `12u
/// r`; each cut puts its corners `4u r` off the edge. So `32u` of the anchor and `30u` of the reach are
/// needed, and `4u` more for each cut; `64u` of both are there.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

impl Viewcells {
    /// Writes to `reached` the viewcells that a convex polygon may reach into. True if they cover it, but for
    /// gaps as wide as twice the margin.
    ///
    /// Corners are in order around the polygon, in metres relative to `anchor`, a point of the world, and
    /// within `error` metres of where they should be. The margin is the error and what rounding adds to it.
    /// False as well, and then `reached` means nothing, for no corner, for one that is not finite, and for a
    /// polygon that viewcells cut into thousands of pieces.
    ///
    /// What was in `reached` is gone. No allocation once it is large enough. Takes time in proportion to the
    /// number of viewcells that are reached, and to the logarithm of all.
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
        let margin = error + ROUNDING * (reach + anchor.abs().max_element());
        // Also refuses NaN, which minima and maxima pass over.
        if !(margin < f64::INFINITY && corners.iter().all(|corner| corner.is_finite())) {
            return false;
        }
        self.for_each_touching(anchor + min - margin, anchor + max + margin, |cell| reached.push(cell));
        let all = self.cells();
        // Only those that the polygon itself reaches into.
        reached.retain(|cell| {
            let mut left = Corners::from_slice(corners);
            for plane in faces(&all[cell.index()], anchor) {
                left = clip_outward(&left, &plane, margin);
            }
            !left.is_empty()
        });
        is_covered(corners, reached, all, anchor, margin, &mut { MOST_PIECES })
    }
}

/// Whether viewcells cover a piece, but for gaps of twice the margin. Each in turn takes its part; what lies
/// beyond one of its faces is left to the others. Gives up, with false, when there are too many pieces.
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
    let mut rest: Corners = SmallVec::from_slice(piece);
    for plane in faces(&all[first.index()], anchor) {
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

/// The planes of a viewcell, with normals to the inside, for points relative to the anchor.
fn faces(cell: &Viewcell, anchor: DVec3) -> impl Iterator<Item = Plane> + '_ {
    let (min, max) = (cell.min - anchor, cell.max - anchor);
    let sides = (0..3).flat_map(move |axis| {
        let normal = DVec3::AXES[axis];
        [Plane::new(normal, -min[axis]), Plane::new(-normal, max[axis])]
    });
    let planes = cell.planes.iter().filter_map(Plane::normalized);
    sides.chain(planes.map(move |plane| Plane::new(plane.normal, plane.signed_distance(anchor))))
}
