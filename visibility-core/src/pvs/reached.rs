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
    /// up to about five times the margin of [`reached`](Self::reached), for the same `error` in metres.
    /// `scratch` is memory for the test.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(min: [f64; 3], max: [f64; 3]) -> Viewcell {
        Viewcell::from_box(min.into(), max.into())
    }

    fn reached(cells: &Viewcells, corners: &[[f64; 3]], anchor: DVec3, error: f64) -> (bool, Vec<u32>) {
        let corners: Vec<DVec3> = corners.iter().map(|&corner| corner.into()).collect();
        let mut found = Vec::new();
        let is_covered = cells.reached(&corners, anchor, error, &mut found);
        let mut found: Vec<u32> = found.iter().map(|cell| cell.0).collect();
        found.sort_unstable();
        (is_covered, found)
    }

    /// Two rooms with a gap of 3 m between them, and corners that are off by up to 2 m.
    #[test]
    fn polygons_reach_viewcells_within_the_error() {
        let rooms = Viewcells::new([cell([0.0; 3], [10.0; 3]), cell([13.0, 0.0, 0.0], [20.0, 10.0, 10.0])]);
        let at = |x: f64, error: f64| reached(&rooms, &[[x, 5.0, 5.0]], DVec3::ZERO, error);
        assert_eq!(at(5.0, 0.0), (true, [0].to_vec()), "a point in a room");
        assert_eq!(at(11.5, 0.0), (false, [].to_vec()), "a point in the gap");
        assert_eq!(at(11.5, 2.0), (true, [0, 1].to_vec()), "a point that may be in either");
        assert_eq!(at(8.5, 2.0), (true, [0].to_vec()), "a point that cannot be in the second room");
        assert_eq!(at(11.2, 2.0), (true, [0, 1].to_vec()), "a point 1.8 m before the second room");
        assert_eq!(at(-1.8, 2.0), (true, [0].to_vec()), "a point 1.8 m beside the first room");
        assert_eq!(at(-2.2, 2.0).1, [], "a point 2.2 m beside the first room");
        // An edge across the gap: up to twice the error wide, it counts as covered.
        let edge = |error: f64| reached(&rooms, &[[5.0, 5.0, 5.0], [15.0, 5.0, 5.0]], DVec3::ZERO, error);
        assert_eq!(edge(1.0), (false, [0, 1].to_vec()), "a gap of three errors");
        assert_eq!(edge(1.6), (true, [0, 1].to_vec()), "a gap of less than two errors");
        assert!(edge(2.9).0 && !edge(1.4).0, "about two errors");
    }

    #[test]
    fn polygons_that_are_none_are_not_covered() {
        let room = Viewcells::new([cell([0.0; 3], [10.0; 3])]);
        let of = |corners: &[[f64; 3]], error: f64| reached(&room, corners, DVec3::ZERO, error).0;
        assert!(of(&[[5.0; 3]], 0.0) && !of(&[], 0.0), "a point, and no corners");
        for error in [f64::INFINITY, f64::NAN] {
            assert!(!of(&[[5.0; 3]], error), "an error of {error}");
        }
        for bad in [f64::NAN, f64::INFINITY] {
            assert!(!of(&[[5.0; 3], [5.0, bad, 5.0], [6.0; 3]], 0.0), "a corner of {bad}");
        }
    }

    /// Coordinates of 10^9 m are rounded by 10^-7 m.
    #[test]
    fn the_margin_grows_with_anchor_and_polygon() {
        let far = 1e9;
        let rooms =
            Viewcells::new([cell([-far; 3], [far; 3]), cell([far + 5e-6, -far, -far], [2.0 * far; 3])]);
        let wide = [[0.0; 3], [far, 0.0, 0.0], [far, 1.0, 0.0]];
        assert_eq!(reached(&rooms, &wide, DVec3::ZERO, 0.0).1, [0, 1], "from an anchor nearby");
        let back = [[-far, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(reached(&rooms, &back, DVec3::X * far, 0.0).1, [0, 1], "from an anchor far away");
    }

    /// A room up to x = 0.5 m, a ball of 1 m around the origin that may be off by 0.1 m, and what is beyond.
    fn ball(room: Viewcell, beyond: Option<Viewcell>) -> (bool, Vec<u32>) {
        let cells = Viewcells::new([room].into_iter().chain(beyond));
        let (mut scratch, mut found) = (Vec::new(), Vec::new());
        let is_covered = cells.reached_by_ball(DVec3::ZERO, 1.0, 0.1, &mut scratch, &mut found);
        (is_covered, found.iter().map(|cell| cell.0).collect())
    }

    #[test]
    fn balls_are_covered_if_something_is_beyond_each_face_that_crosses_them() {
        let room = || cell([-5.0; 3], [0.5, 5.0, 5.0]);
        let beyond = |min: f64, top: f64| Some(cell([min, -5.0, -5.0], [5.0, top, 5.0]));
        assert_eq!(ball(cell([-5.0; 3], [5.0; 3]), None), (true, [0].to_vec()), "inside a room");
        assert_eq!(ball(room(), None), (false, [0].to_vec()), "a wall through the ball");
        assert_eq!(ball(room(), beyond(0.5, 5.0)), (true, [0, 1].to_vec()), "two rooms");
        assert!(ball(room(), beyond(0.65, 5.0)).0, "a gap within the margin");
        assert!(!ball(room(), beyond(1.05, 5.0)).0, "a wide gap");
        assert_eq!(ball(room(), beyond(1.08, 5.0)).1, [0, 1], "a room that the ball may reach");
        let before = cell([-5.0; 3], [-0.08, 5.0, 5.0]);
        assert!(ball(before.clone(), beyond(0.08, 5.0)).0, "a middle in a gap of less than two errors");
        assert!(!ball(before, beyond(0.5, 5.0)).0, "a middle in a gap of more than five errors");
        // Walls that the ball may reach, since it may be off.
        assert!(!ball(cell([-5.0; 3], [1.08, 5.0, 5.0]), None).0, "a wall 8 cm beyond the ball");
        assert!(ball(cell([-5.0; 3], [1.12, 5.0, 5.0]), None).0, "a wall 12 cm beyond the ball");
        let moved = cell([-5.0; 3], [-0.05, 5.0, 5.0]);
        assert!(
            ball(moved, Some(cell([-0.05, -5.0, -5.0], [5.0; 3]))).0,
            "a middle on either side of a face"
        );
        // What covers the other side ends beside the ball, or in the middle, with another room beyond a gap.
        assert!(!ball(room(), beyond(0.5, 0.97)).0, "a hole 13 cm high");
        let halves = |gap: f64| {
            let others = [cell([0.5, -5.0, -5.0], [5.0, 0.0, 5.0]), cell([0.5, gap, -5.0], [5.0; 3])];
            let cells = Viewcells::new([room()].into_iter().chain(others));
            cells.reached_by_ball(DVec3::ZERO, 1.0, 0.1, &mut Vec::new(), &mut Vec::new())
        };
        assert!(halves(0.0) && halves(0.15) && !halves(0.25), "gaps up to two errors wide");
        // The face ends at 0.5 m as well, and the other side at 0.45 m.
        let low = cell([-5.0; 3], [0.5, 0.5, 5.0]);
        let above = cell([-5.0, 0.5, -5.0], [5.0, 5.0, 5.0]);
        let three = |top: f64| {
            let cells =
                Viewcells::new([low.clone(), above.clone(), cell([0.5, -5.0, -5.0], [5.0, top, 5.0])]);
            let (mut scratch, mut found) = (Vec::new(), Vec::new());
            cells.reached_by_ball(DVec3::ZERO, 1.0, 0.1, &mut scratch, &mut found)
        };
        assert!(three(0.5) && three(0.45) && !three(0.2), "a corner of three rooms");
    }

    /// Planes that cut nothing off, far from the viewcell or through its face, and planes that are none.
    #[test]
    fn faces_without_extent_need_nothing_beyond_them() {
        let with_plane =
            |plane: Plane| Viewcell { planes: [plane].to_vec(), ..cell([-5.0; 3], [0.2, 5.0, 5.0]) };
        let beyond = || Some(cell([0.2, -5.0, -5.0], [5.0; 3]));
        let idle = Plane::new(-DVec3::X, 0.9);
        assert!(ball(with_plane(idle), beyond()).0, "a plane that cuts nothing off");
        let cutting = Plane::new(-DVec3::Y, 0.3);
        assert!(!ball(with_plane(cutting), beyond()).0, "a plane that cuts through the ball");
        let none = Plane::new(DVec3::ZERO, 1.0);
        assert!(!ball(with_plane(none), beyond()).0, "a plane that is none");
    }
}
