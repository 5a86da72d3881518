//! Where lines of sight begin: in the viewcells that the front of a view reaches into.
//!
//! Nothing before the near plane is drawn, so lines of sight begin on it, not in the eye: an eye close to a wall sees through it. Where part
//! of the front is in no viewcell, nothing is known of what is seen from there.

use super::{Viewcell, Viewcells};
use crate::{Plane, ViewcellId};
use alloc::vec::Vec;
use glam::DVec3;
use smallvec::SmallVec;

type Piece = SmallVec<[DVec3; 12]>;

/// How many pieces a polygon may fall into while viewcells are taken from it.
const MOST_PIECES: u32 = 2000;

impl Viewcells {
    /// Finds the viewcells that a convex polygon reaches into, and whether they cover it, but for gaps of twice the margin. Its corners are
    /// relative to the anchor, a point of the world, and may be off by the margin. What was in `reached` is gone; no allocation once it
    /// is large enough. Takes time in proportion to the logarithm of their number, and to how many there are; a polygon that falls into
    /// thousands of pieces counts as not covered, and so does one with a NaN.
    pub fn reached(
        &self,
        corners: &[DVec3],
        anchor: DVec3,
        margin: f64,
        reached: &mut Vec<ViewcellId>,
    ) -> bool {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &at in corners {
            (min, max) = (min.min(at), max.max(at));
        }
        reached.clear();
        self.for_each_touching(anchor + min - margin, anchor + max + margin, |cell| reached.push(cell));
        let all = self.cells();
        // Only those that the polygon itself reaches into.
        reached.retain(|cell| {
            let mut left = Piece::from_slice(corners);
            for plane in faces(&all[cell.index()], anchor) {
                left = part(&left, &plane, margin);
            }
            !left.is_empty()
        });
        is_covered(corners, reached, all, anchor, margin, &mut { MOST_PIECES })
    }
}

/// Whether viewcells cover a piece, but for gaps of twice the margin. Each in turn takes its part; what lies beyond one of its faces is
/// left to the others. Gives up, with false, when there are too many pieces.
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
    let mut rest: Piece = SmallVec::from_slice(piece);
    for plane in faces(&all[first.index()], anchor) {
        let beyond = |at: &DVec3| plane.signed_distance(*at) < -margin;
        if !rest.iter().any(beyond) {
            continue;
        }
        let outer = part(&rest, &plane.flipped(), -margin);
        if !outer.is_empty() && !is_covered(&outer, others, all, anchor, margin, pieces) {
            return false;
        }
        rest = part(&rest, &plane, margin);
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

/// The part of a convex polygon on the inner side of a plane that is moved out by a margin.
fn part(piece: &[DVec3], plane: &Plane, margin: f64) -> Piece {
    let mut out = Piece::new();
    let height = |at: DVec3| plane.signed_distance(at) + margin;
    for (i, &a) in piece.iter().enumerate() {
        let b = piece[(i + 1) % piece.len()];
        let (ha, hb) = (height(a), height(b));
        if ha >= 0.0 {
            out.push(a);
        }
        if (ha >= 0.0) != (hb >= 0.0) {
            out.push(a + (b - a) * (ha / (ha - hb)));
        }
    }
    out
}
