//! Search for the viewcells that a convex polygon reaches into. The polygon is where the lines of sight of a
//! view begin ([`View::for_each_sight_start`](crate::View::for_each_sight_start)).
//!
//! The near plane of an eye close to a wall may reach through the wall into the next viewcell. If part of the
//! polygon is outside all viewcells, the PVS says nothing about that part.

use super::{Viewcell, Viewcells};
use crate::geometry::{Corners, Plane, clip_outward};
use crate::pvs::ViewcellId;
use alloc::vec::Vec;
use glam::DVec3;
use smallvec::SmallVec;

/// Greatest number of steps of [`is_covered`], each of which cuts one piece of a polygon by one viewcell.
/// This number of steps takes some milliseconds.
const MAX_TESTS: u32 = 1 << 14;

/// Greatest number of pieces of a polygon that [`is_covered`] keeps at once: parts outside of the viewcells
/// that they were cut by so far. The pieces take some 26 KB of the stack.
const MAX_LEFT: usize = 64;

/// Margin for rounding, in units of the sum of the greatest absolute coordinates of the anchor (`a`) and of
/// the polygon (`r`).
///
/// Let `u = EPSILON / 2`, `a` the anchor, `r` the greatest absolute coordinate of the polygon relative to the
/// anchor, and `n` the unit normal of a viewcell's plane. A plane that meets the polygon has an offset of at
/// most `|n . a| + 2 r`. Normalizing the plane and moving it to the anchor rounds the offset and `n . a` by
/// `9u` of their magnitudes: `18u |a| + 18u r` together, where the length `|a|` is up to `3^1/2` times the
/// greatest coordinate. The signed distance of a corner from the plane is rounded by `4u` of the magnitudes
/// of corner and offset, `12u r`. Each cut of the polygon by a plane puts the new corners up to `4u r` off
/// the exact edges. So `32u` of the greatest coordinate of `a` and `30u r` are needed, and `4u r` more for
/// each cut. The margin is `64u` of both, and each cut adds its own.
pub(super) const ROUNDING: f64 = 32.0 * f64::EPSILON;

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
        // Refuses NaN corners too, which `min` and `max` above ignore.
        if !(margin < f64::INFINITY && corners.iter().all(|corner| corner.is_finite())) {
            return false;
        }
        self.for_each_touching(anchor + min - margin, anchor + max + margin, |cell| reached.push(cell));
        let all = self.cells();
        // Keeps only the viewcells that the polygon itself reaches into, not just its bounding box.
        reached.retain(|cell| {
            let mut left = Corners::from_slice(corners);
            let mut margin = margin;
            for plane in all[cell.index()].faces(anchor) {
                left = clip_outward(&left, &plane, margin);
                margin += 2.0 * f64::EPSILON * reach;
            }
            !left.is_empty()
        });
        is_covered(corners, reached, all, anchor, margin)
    }

    /// Replaces the content of `reached` by the viewcells that the ball of the given radius, in metres,
    /// around `anchor` may reach into. Returns true if these viewcells cover the ball, except for gaps of
    /// about the margin of [`reached`](Self::reached), for the same `error` in metres. `scratch` is memory
    /// for the test.
    ///
    /// The ball is covered if its middle is, and if beyond each face that crosses it there is a viewcell. The
    /// cube around the ball stands for the ball in this test.
    pub fn reached_by_ball(
        &self,
        anchor: DVec3,
        radius: f64,
        error: f64,
        scratch: &mut Vec<ViewcellId>,
        reached: &mut Vec<ViewcellId>,
    ) -> bool {
        let middle = [DVec3::ZERO];
        self.reached(&middle, anchor, error + radius, reached);
        if !self.reached(&middle, anchor, error, scratch) {
            return false;
        }
        // Corners are up to 4 radii away, and each cut adds its own rounding.
        let reach = 4.0 * radius;
        let margin = error + self.misplacement() + ROUNDING * (2.0 * reach + anchor.abs().max_element());
        reached.iter().all(|cell| {
            let cell = &self.cells()[cell.index()];
            cell.has_all_faces()
                && cell.faces(anchor).enumerate().all(|(number, face)| {
                    let is_crossing = face.offset.abs() < radius + margin;
                    if !is_crossing {
                        return face.offset.is_finite();
                    }
                    let u = face.normal.any_orthonormal_vector() * (2.0 * radius);
                    let v = face.normal.cross(u);
                    let at = face.normal * -face.offset;
                    let mut polygon = Corners::from_slice(&[at - u - v, at + u - v, at + u + v, at - u + v]);
                    let mut margin = margin;
                    for (other, plane) in cell.faces(anchor).enumerate() {
                        if other != number {
                            polygon = clip_outward(&polygon, &plane, margin);
                            margin += 2.0 * f64::EPSILON * reach;
                        }
                    }
                    for axis in DVec3::AXES {
                        for normal in [axis, -axis] {
                            polygon = clip_outward(&polygon, &Plane::new(normal, radius), margin);
                        }
                    }
                    // Moved out of the viewcell by more than its own margin, so that another must be there.
                    polygon.iter_mut().for_each(|corner| *corner -= face.normal * (4.0 * margin));
                    polygon.is_empty() || self.reached(&polygon, anchor, error, scratch)
                })
        })
    }
}

/// Tests whether the viewcells in `by` cover the convex polygon `whole`, relative to `anchor`, except for
/// gaps up to twice `margin` (metres) wide. Each viewcell in turn covers the part of a piece that is inside
/// its faces. The parts beyond its faces are new pieces, to be covered by the next viewcells. A viewcell
/// without [all faces](Viewcell::has_all_faces) covers nothing. Returns false after [`MAX_TESTS`] steps, and
/// if more than [`MAX_LEFT`] pieces are left.
fn is_covered(whole: &[DVec3], by: &[ViewcellId], all: &[Viewcell], anchor: DVec3, margin: f64) -> bool {
    // Pieces not yet covered, each with the place in `by` of the first viewcell not yet tested with it.
    let mut left: SmallVec<[(Corners, usize); MAX_LEFT]> = SmallVec::new();
    left.push((Corners::from_slice(whole), 0));
    let mut tests = MAX_TESTS;
    while let Some((mut piece, at)) = left.pop() {
        let (Some(cell), 1..) = (by.get(at), tests) else { return false };
        tests -= 1;
        let cell = &all[cell.index()];
        if !cell.has_all_faces() {
            left.push((piece, at + 1));
            continue;
        }
        for plane in cell.faces(anchor) {
            if !piece.iter().any(|corner| plane.signed_distance(*corner) < -margin) {
                continue;
            }
            let beyond = clip_outward(&piece, &plane.flipped(), -margin);
            if !beyond.is_empty() {
                if left.len() == MAX_LEFT {
                    return false;
                }
                left.push((beyond, at + 1));
            }
            piece = clip_outward(&piece, &plane, margin);
            if piece.is_empty() {
                break;
            }
        }
    }
    true
}
