//! Where in the picture the objects are: a shadow is worth what it may fall on, and empty sky is worth
//! little.

use crate::clip_projection::ClipProjection;
use crate::shadow::Corner;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// Number of cells of the picture along each side.
const CELLS: usize = 32;
const LINES: usize = CELLS + 1;
/// Share of the worth that is spread evenly over the picture, since objects extend beyond their centres.
const EVEN: f64 = 0.25;

/// Number of objects in each part of the picture, counted at their centres. Only for choosing occluders, so
/// rounding does no harm.
#[derive(Clone, Debug, Default)]
pub(super) struct ScreenDensity {
    /// By crossing of the grid's lines, row by row: the number of centres to the left of it and below.
    sums: Vec<f32>,
    all: f64,
}

impl ScreenDensity {
    /// Empties the grid.
    pub(super) fn clear(&mut self) {
        self.all = 0.0;
        self.sums.clear();
        self.sums.resize(LINES * LINES, 0.0);
    }

    /// Counts an object with this centre, if that is in the picture.
    pub(super) fn add(&mut self, projection: &ClipProjection, middle: DVec3) {
        let [x, y, w] = projection.values(middle);
        if w > 0.0 && x.abs() <= w && y.abs() <= w {
            let [column, row] = [x, y].map(|a| (place(a / w) as usize).min(CELLS - 1));
            self.sums[(row + 1) * LINES + column + 1] += 1.0;
            self.all += 1.0;
        }
    }

    /// Turns counts of cells into sums over all cells to the left and below. To be called after the last
    /// `add`.
    pub(super) fn finish(&mut self) {
        for row in 1..LINES {
            let mut sum = 0.0;
            for column in 1..LINES {
                sum += self.sums[row * LINES + column];
                self.sums[row * LINES + column] = sum + self.sums[(row - 1) * LINES + column];
            }
        }
    }

    /// Number of centres to the left of and below a place on the grid, taken as evenly spread over each cell.
    fn below(&self, [x, y]: [f64; 2]) -> f64 {
        let [column, row] = [x, y].map(|a| (a as usize).min(CELLS - 1));
        let (s, t) = (x - column as f64, y - row as f64);
        let at = |row: usize, column: usize| f64::from(self.sums[row * LINES + column]);
        let low = at(row, column) * (1.0 - s) + at(row, column + 1) * s;
        let high = at(row + 1, column) * (1.0 - s) + at(row + 1, column + 1) * s;
        low * (1.0 - t) + high * t
    }

    /// Worth of a rectangle of the grid in objects, and its area in cells.
    fn rectangle(&self, low: [f64; 2], high: [f64; 2]) -> (f64, f64) {
        let count = self.below(high) - self.below([low[0], high[1]]) - self.below([high[0], low[1]])
            + self.below(low);
        let area = (high[0] - low[0]) * (high[1] - low[1]);
        (count.max(0.0) + area * (EVEN * self.all + 1.0) / (CELLS * CELLS) as f64, area)
    }

    /// Worth of a convex part of the picture: that of its bounding rectangle times its share of the
    /// rectangle's area.
    pub(super) fn within(&self, corners: &[Corner]) -> f32 {
        let flat = |corner: &Corner| [0, 1].map(|i| place(corner.v[i] / corner.v[2]));
        let Some((first, rest)) = corners.split_first() else { return 0.0 };
        let first = flat(first);
        let (mut low, mut high, mut before, mut twice) = (first, first, first, 0.0);
        for corner in rest {
            let p = flat(corner);
            for i in 0..2 {
                (low[i], high[i]) = (low[i].min(p[i]), high[i].max(p[i]));
            }
            twice += (before[0] - first[0]) * (p[1] - first[1]) - (before[1] - first[1]) * (p[0] - first[0]);
            before = p;
        }
        let (worth, area) = self.rectangle(low, high);
        if area > 0.0 { (worth * (0.5 * twice.abs() / area).min(1.0)) as f32 } else { 0.0 }
    }

    /// About what a polygon is worth of which only the middle, the radius and the area, as seen from the eye,
    /// are known; none of one that is close, or large.
    pub(super) fn about(
        &self,
        projection: &ClipProjection,
        middle: DVec3,
        radius: f64,
        area: f64,
    ) -> Option<f32> {
        let [x, y, w] = projection.values(middle);
        let [across, up] = projection.scale().map(|scale| radius * scale / w);
        if !(w > 0.0 && across < 1.0 && up < 1.0) {
            return None;
        }
        let (x, y) = (x / w, y / w);
        let (worth, _) =
            self.rectangle([place(x - across), place(y - up)], [place(x + across), place(y + up)]);
        Some((worth * (area / (4.0 * radius * radius)).min(1.0)) as f32)
    }
}

/// Place on the grid, in cells, of a picture coordinate from -1 to 1.
fn place(a: f64) -> f64 {
    // What is not a number is somewhere, too.
    if a > -1.0 { (a * 0.5 + 0.5).min(1.0) * CELLS as f64 } else { 0.0 }
}
