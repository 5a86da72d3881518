//! Umbra of a virtual occluder, and the test whether it contains a box.

use super::cell_solids::CellBox;
use super::grow::Grown;
use super::lines::{Point, U, left_of};

/// Umbra of a virtual occluder for a viewcell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Umbra {
    grown: Grown,
    cell: CellBox,
    /// Unit normal of the segment, away from the viewcell.
    normal: [f64; 2],
    /// Position of both ends along `normal`, in metres.
    distance: f64,
}

impl Umbra {
    pub(crate) fn new(grown: &Grown, cell: &CellBox) -> Self {
        let [a, b] = grown.ends;
        let (dx, dy) = (b.x - a.x, b.y - a.y);
        let length = visibility_core::geometry::sqrt(dx * dx + dy * dy);
        let normal = [-dy / length, dx / length];
        // The ends may differ by rounding, so the farther one is used.
        let along = |p: Point| p.x * normal[0] + p.y * normal[1];
        Self { grown: *grown, cell: *cell, normal, distance: along(a).max(along(b)) }
    }

    /// Returns the upright rectangle that is hidden from the viewcell: its two ends on the plan,
    /// `[end][coordinate]`, the left end first as seen from the viewcell, then the heights of its lower and
    /// upper side. All in metres.
    pub(crate) fn rectangle(&self) -> ([[f64; 2]; 2], f64, f64) {
        let Grown { ends, bottom, slope, .. } = self.grown;
        let along = |p: Point| p.x * self.normal[0] + p.y * self.normal[1];
        let corner = self.cell.corners().into_iter().map(along).fold(f64::NEG_INFINITY, f64::max);
        let size = ends.iter().map(|p| p.x.abs() + p.y.abs()).fold(0.0, f64::max);
        let nearest = along(ends[0]).min(along(ends[1])) - corner - 64.0 * U * size - 4.0 * self.grown.error;
        let top = self.cell.max[2] + slope * nearest.max(0.0) * (1.0 - 4.0 * U);
        (ends.map(|p| [p.x, p.y]), bottom, top - 4.0 * U * (top.abs() + self.cell.max[2].abs()))
    }

    /// Returns whether a box, given by its bounds on the plan and its heights, is certainly hidden from the
    /// whole viewcell.
    pub(crate) fn hides(&self, min: [f64; 3], max: [f64; 3]) -> bool {
        // Corner of the box nearest to the segment, along its normal.
        let [nx, ny] = self.normal;
        let nearest = [if nx > 0.0 { min[0] } else { max[0] }, if ny > 0.0 { min[1] } else { max[1] }];
        let size = nearest[0].abs() + nearest[1].abs() + self.distance.abs();
        let gap =
            nearest[0] * nx + nearest[1] * ny - self.distance - 4.0 * self.grown.error - 16.0 * U * size;
        if gap.is_nan() || gap <= 0.0 {
            return false;
        }
        let [a, b] = self.grown.ends;
        let corners = || {
            [[min[0], min[1]], [max[0], min[1]], [max[0], max[1]], [min[0], max[1]]]
                .map(|[x, y]| Point::exact(x, y))
                .into_iter()
        };
        // All lines of sight from the viewcell to the box must pass between the ends.
        let is_between = self
            .cell
            .corners()
            .into_iter()
            .all(|c| corners().all(|p| left_of(p, a, c) >= 0.0 && left_of(p, c, b) >= 0.0));
        is_between && self.is_within_heights([min[0], min[1]], [max[0], max[1]], min[2], max[2], gap)
    }

    /// Returns whether all lines of sight to a box rise by at most the slope and stay above the bottom. `gap`
    /// is the distance in metres on the plan between the box and the segment.
    fn is_within_heights(&self, min: [f64; 2], max: [f64; 2], low: f64, high: f64, gap: f64) -> bool {
        let Grown { slope, bottom, .. } = self.grown;
        let (lowest, highest) = (self.cell.min[2], self.cell.max[2]);
        // Each sum is rounded once.
        let top = slope * self.cell.distance(min, max) * (1.0 - 4.0 * U) + highest;
        let is_below_top = high <= top - 2.0 * U * (top.abs() + highest.abs());
        // At the solids, before the segment, a line of sight is higher than the box's lower end by a share of
        // the eye's height above this end. The share is at least the gap divided by the line's length.
        let reach = |axis: usize| (max[axis] - self.cell.min[axis]).max(self.cell.max[axis] - min[axis]);
        let share = gap / (reach(0) + reach(1)) * (1.0 - 16.0 * U);
        let above = low.min(lowest) + (lowest - low).max(0.0) * share.min(1.0);
        let is_above_bottom =
            above - 8.0 * U * (low.abs() + lowest.abs()) >= bottom || low.min(lowest) >= bottom;
        is_below_top && is_above_bottom
    }
}
