//! Where lines of sight begin: in the cells that the front of the view is in.
//!
//! Nothing before the near plane is drawn, so lines of sight begin on it, not in the eye: an eye close to a wall sees through it. The same
//! goes for a clip plane with the eye behind it, and for orthographic views, which have no eye. Where the front of the view lies in one cell,
//! as it nearly always does, that is the cell; where it lies across a portal, it is several. Where part of it is in no cell, nothing is known
//! of what is seen from there.

use super::scene_cells::SceneCells;
use super::side::{Corner, Edge, Side, U, clip};
use super::sight::{Lines, Sight};
use alloc::vec::Vec;
use smallvec::SmallVec;
use visibility_core::glam::{DMat3, DVec3};
use visibility_core::{CellId, ViewcellId};

/// Memory for finding the cells of a front.
#[derive(Clone, Debug, Default)]
pub(super) struct Front {
    corners: Vec<Corner>,
    clipped: Vec<Corner>,
    touching: Vec<ViewcellId>,
}

impl Front {
    /// Calls `each` with the cells that lines of sight begin in, some maybe more than once. False if some begin in none.
    pub(super) fn find(&mut self, cells: &SceneCells, sight: &Sight, mut each: impl FnMut(CellId)) -> bool {
        for place in 0..sight.fronts.len() {
            if !self.is_entered(sight, place) {
                continue;
            }
            let Some(error) = self.cut(sight, place) else { return false };
            if self.corners.is_empty() {
                continue;
            }
            if !self.locate(cells, sight, error, &mut each) {
                return false;
            }
        }
        true
    }

    /// Whether lines of sight may enter the view through one of its front planes: the near plane, or a clip plane that the eye is not surely
    /// on the inner side of.
    fn is_entered(&self, sight: &Sight, place: usize) -> bool {
        let side = &sight.fronts[place];
        match sight.lines {
            Lines::FromAnchor => place == 0 || side.plane.offset <= side.slack + 2.0 * sight.error,
            Lines::Along(direction, turn) => {
                place == 0 || side.plane.normal.dot(direction) >= -(turn + 32.0 * U)
            }
        }
    }

    /// Cuts the polygon in which a front plane meets the view, into `corners`. Returns how far its corners may be off; `None` where the
    /// view meets the plane without end.
    fn cut(&mut self, sight: &Sight, place: usize) -> Option<f64> {
        let front = &sight.fronts[place];
        let [left, right, bottom, top] = &sight.sides;
        self.corners.clear();
        let mut error = 0.0f64;
        for [a, b, c, d] in [
            [left, bottom, right, top],
            [right, bottom, left, top],
            [right, top, left, bottom],
            [left, top, right, bottom],
        ] {
            let at = meet(front, a, b)?;
            // The residuals of the three planes, over their determinant as for the eye of a `Sight`.
            let reach = at.length();
            let residual = |side: &Side| side.plane.signed_distance(at).abs() + side.margin(reach);
            let determinant = front.plane.normal.dot(a.plane.normal.cross(b.plane.normal)).abs();
            let off = 6.0 * residual(front).max(residual(a)).max(residual(b)) / determinant;
            // The corner must be on the opposite sides' inner sides, or it is behind the eye.
            let inside = |side: &Side| side.plane.signed_distance(at) >= -(side.margin(reach) + off);
            if !(off.is_finite() && inside(c) && inside(d)) {
                return None;
            }
            error = error.max(off);
            self.corners.push(Corner { at, edge: Edge::End });
        }
        for other in (0..sight.fronts.len()).filter(|&other| other != place) {
            if !clip(&self.corners, &sight.fronts[other], Edge::End, &mut error, &mut self.clipped) {
                self.corners.clear();
                break;
            }
            core::mem::swap(&mut self.corners, &mut self.clipped);
        }
        Some(error)
    }

    /// Calls `each` with the cells that `corners` reach into. False if they reach where no cell is.
    fn locate(
        &mut self,
        cells: &SceneCells,
        sight: &Sight,
        error: f64,
        each: &mut impl FnMut(CellId),
    ) -> bool {
        let corners: SmallVec<[DVec3; 12]> = self.corners.iter().map(|corner| corner.at).collect();
        let farthest = corners.iter().fold(DVec3::ZERO, |most, at| most.max(at.abs())).max_element();
        let reach = farthest + sight.anchor.abs().max_element();
        let margin = cells.tolerance + error + 32.0 * U * reach;
        let covered = cells.viewcells.reached(&corners, sight.anchor, margin, &mut self.touching);
        self.touching.iter().for_each(|viewcell| each(CellId(viewcell.0)));
        covered
    }
}

/// The point in which three planes meet.
fn meet(a: &Side, b: &Side, c: &Side) -> Option<DVec3> {
    let rows = DMat3::from_cols(a.plane.normal, b.plane.normal, c.plane.normal).transpose();
    let offsets = DVec3::new(a.plane.offset, b.plane.offset, c.plane.offset);
    let at = rows.inverse() * -offsets;
    at.is_finite().then_some(at)
}
