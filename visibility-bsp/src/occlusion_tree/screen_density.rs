//! Distribution of the objects in the image. A shadow is worth the objects that it may hide, and empty sky is
//! worth little.

use crate::clip_projection::ClipProjection;
use crate::shadow::ShadowCorner;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// Number of grid cells along each side of the image.
const CELLS: usize = 32;
/// Number of grid lines along each axis, the image's sides included.
const LINES: usize = CELLS + 1;
/// Weight of objects that are taken to be spread evenly over the image, as a fraction of all objects counted.
/// They add to the worth of every area, since objects extend beyond their centres.
const EVEN: f64 = 0.25;

/// Number of object centres in each cell of a grid over the image. Used only to choose occluders, so rounding
/// is harmless.
#[derive(Clone, Debug, Default)]
pub(super) struct ScreenDensity {
    /// By crossing of grid lines, row by row from the bottom left: the number of object centres below and to
    /// the left of that crossing in the image. Before `finish`: the number of centres in the cell whose top
    /// right corner is the crossing.
    sums: Vec<f32>,
    /// Number of object centres counted so far in this frame: those in the image.
    all: f64,
}

impl ScreenDensity {
    /// Resets all counts to zero, before the objects of a frame are added.
    pub(super) fn clear(&mut self) {
        self.all = 0.0;
        self.sums.clear();
        self.sums.resize(LINES * LINES, 0.0);
    }

    /// Counts an object with this centre in metres relative to `Scene::origin`. A centre outside the image or
    /// NaN is ignored.
    pub(super) fn add(&mut self, projection: &ClipProjection, middle: DVec3) {
        let [x, y, w] = projection.values(middle);
        if w > 0.0 && x.abs() <= w && y.abs() <= w {
            let [column, row] = [x, y].map(|a| (to_cells(a / w) as usize).min(CELLS - 1));
            self.sums[(row + 1) * LINES + column + 1] += 1.0;
            self.all += 1.0;
        }
    }

    /// Turns the counts of cells into sums over all cells below and to the left. Must be called after the
    /// last `add` and before the queries.
    pub(super) fn finish(&mut self) {
        for row in 1..LINES {
            let mut sum = 0.0;
            for column in 1..LINES {
                sum += self.sums[row * LINES + column];
                self.sums[row * LINES + column] = sum + self.sums[(row - 1) * LINES + column];
            }
        }
    }

    /// Returns the number of centres below and to the left of a position `[x, y]` in grid cells from the
    /// bottom left of the image, with the centres of each cell taken as evenly spread.
    fn below(&self, [x, y]: [f64; 2]) -> f64 {
        let [column, row] = [x, y].map(|a| (a as usize).min(CELLS - 1));
        let (s, t) = (x - column as f64, y - row as f64);
        let at = |row: usize, column: usize| f64::from(self.sums[row * LINES + column]);
        let low = at(row, column) * (1.0 - s) + at(row, column + 1) * s;
        let high = at(row + 1, column) * (1.0 - s) + at(row + 1, column + 1) * s;
        low * (1.0 - t) + high * t
    }

    /// Returns the worth of a rectangle of the image (the number of objects that a shadow there may hide),
    /// and the rectangle's area in grid cells. `low` and `high` are the rectangle's corners, in grid cells
    /// from the bottom left of the image.
    fn rectangle(&self, low: [f64; 2], high: [f64; 2]) -> (f64, f64) {
        let count = self.below(high) - self.below([low[0], high[1]]) - self.below([high[0], low[1]])
            + self.below(low);
        let area = (high[0] - low[0]) * (high[1] - low[1]);
        (count.max(0.0) + area * (EVEN * self.all + 1.0) / (CELLS * CELLS) as f64, area)
    }

    /// Returns the worth in objects of a convex part of the image, outlined by clip-space corners: the worth
    /// of the part's bounding rectangle, times the fraction of the rectangle that the part fills. 0 for an
    /// empty part.
    pub(super) fn within(&self, corners: &[ShadowCorner]) -> f32 {
        let flat = |corner: &ShadowCorner| [0, 1].map(|i| to_cells(corner.v[i] / corner.v[2]));
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

    /// Estimates the worth in objects of a polygon from its centre in metres relative to `Scene::origin`, its
    /// radius in metres and its area in square metres as projected towards the eye. `None` if the centre is
    /// behind the eye or the polygon extends over half the image or more.
    pub(super) fn estimate(
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
        let (worth, _) = self
            .rectangle([to_cells(x - across), to_cells(y - up)], [to_cells(x + across), to_cells(y + up)]);
        Some((worth * (area / (4.0 * radius * radius)).min(1.0)) as f32)
    }
}

/// Converts an NDC coordinate from -1 to 1 to a grid position in cells, clamped to the grid.
fn to_cells(a: f64) -> f64 {
    // NaN is mapped to 0.
    if a > -1.0 { (a * 0.5 + 0.5).min(1.0) * CELLS as f64 } else { 0.0 }
}
