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

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_core::{Pose, View, view::Window};

    /// The image of a parallel view along -z, from -1 to 1 on both axes.
    fn projection() -> ClipProjection {
        let pose = Pose::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y);
        let view = View::orthographic(pose, Window::centered(1.0, 1.0), 0.1, 99.0).unwrap();
        ClipProjection::new(&view, DVec3::ZERO)
    }

    /// Returns the density of objects at the middles of cells.
    fn density(cells: &[[usize; 2]]) -> ScreenDensity {
        let (projection, mut density) = (projection(), ScreenDensity::default());
        density.clear();
        for cell in cells {
            let [x, y] = cell.map(|k| (k as f64 + 0.5) / 16.0 - 1.0);
            density.add(&projection, DVec3::new(x, y, -5.0));
        }
        density.finish();
        density
    }

    #[test]
    fn objects_are_counted_in_rectangles_of_cells() {
        let mut random = visibility_testing::Random(61);
        let cells: Vec<[usize; 2]> = (0..200).map(|_| [(); 2].map(|()| random.below(CELLS))).collect();
        let density = density(&cells);
        assert_eq!(density.all, 200.0, "objects in the image");
        for _ in 0..500 {
            let low = [(); 2].map(|()| random.below(CELLS));
            let high = low.map(|from| from + 1 + random.below(CELLS - from));
            let inside = |cell: &&[usize; 2]| (0..2).all(|i| low[i] <= cell[i] && cell[i] < high[i]);
            let count = cells.iter().filter(inside).count() as f64;
            let [from, to] = [low, high].map(|p| p.map(|x| x as f64));
            let area = (to[0] - from[0]) * (to[1] - from[1]);
            let (worth, found) = density.rectangle(from, to);
            assert_eq!(found, area, "area of {low:?} to {high:?}");
            // A quarter of all objects, and one more, are spread over all cells.
            let expected = count + area * 51.0 / 1024.0;
            assert!((worth - expected).abs() < 1e-6, "{worth} of {expected} in {low:?} to {high:?}");
            // The same as an outline.
            let corner = |x: f64, y: f64| {
                let v = [x / 16.0 - 1.0, y / 16.0 - 1.0, 1.0];
                ShadowCorner { p: DVec3::ZERO, v, size: 1.0, edge: 0 }
            };
            let outline = [
                corner(from[0], from[1]),
                corner(to[0], from[1]),
                corner(to[0], to[1]),
                corner(from[0], to[1]),
            ];
            for first in 0..4 {
                let mut outline = outline;
                outline.rotate_left(first);
                let whole = f64::from(density.within(&outline));
                assert!(
                    (whole - expected).abs() < 1e-4 * expected,
                    "{whole} of {expected}, from corner {first}"
                );
                let half = f64::from(density.within(&outline[..3]));
                assert!((half - 0.5 * expected).abs() < 1e-4 * expected, "{half} of half of {expected}");
            }
            assert_eq!(density.within(&outline[..2]), 0.0, "of an edge");
        }
        assert_eq!(density.within(&[]), 0.0, "of nothing");
    }

    #[test]
    fn objects_of_a_cell_are_spread_over_it() {
        let density = density(&[[3, 5]; 16]);
        for (at, expected) in [
            ([3.0, 5.0], 0.0),
            ([4.0, 6.0], 16.0),
            ([3.5, 6.0], 8.0),
            ([4.0, 5.25], 4.0),
            ([3.5, 5.25], 2.0),
            ([3.25, 32.0], 4.0),
            ([32.0, 5.5], 8.0),
            ([32.0, 32.0], 16.0),
            ([0.0, 32.0], 0.0),
        ] {
            assert_eq!(density.below(at), expected, "objects below {at:?}");
        }
    }

    #[test]
    fn objects_outside_of_the_image_do_not_count() {
        let projection = projection();
        let mut density = ScreenDensity::default();
        density.clear();
        for (x, y, count) in [
            (1.0, 1.0, 1.0),
            (-1.0, -1.0, 2.0),
            (1.001, 0.0, 2.0),
            (-1.001, 0.0, 2.0),
            (0.0, 1.001, 2.0),
            (0.0, -1.001, 2.0),
            (f64::NAN, 0.0, 2.0),
            (1.0, -1.0, 3.0),
        ] {
            density.add(&projection, DVec3::new(x, y, -5.0));
            assert_eq!(density.all, count, "objects after {x}, {y}");
        }
        density.finish();
        let (last, all) = (CELLS as f64, [CELLS as f64; 2]);
        for (low, high, count) in [
            ([0.0; 2], all, 3.0),
            ([0.0; 2], [1.0; 2], 1.0),
            ([last - 1.0; 2], all, 1.0),
            ([last - 1.0, 0.0], [last, 1.0], 1.0),
            ([0.0, last - 1.0], [1.0, last], 0.0),
        ] {
            let area = (high[0] - low[0]) * (high[1] - low[1]);
            let worth = density.rectangle(low, high).0 - area * 1.75 / 1024.0;
            assert!((worth - count).abs() < 1e-6, "{worth} of {count} objects from {low:?} to {high:?}");
        }
        // An eye at the origin, and objects before and behind it.
        let pose = Pose::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y);
        let view = View::perspective_off_center(pose, Window::centered(1.0, 1.0), 0.1, 99.0).unwrap();
        let projection = ClipProjection::new(&view, DVec3::ZERO);
        density.clear();
        for (z, count) in [(-5.0, 1.0), (5.0, 1.0), (0.0, 1.0)] {
            density.add(&projection, DVec3::Z * z);
            assert_eq!(density.all, count, "objects after one at {z}");
        }
    }

    #[test]
    fn worth_is_estimated_by_the_square_around_a_sphere() {
        let density = density(&[[16, 16]; 64]);
        let projection = projection();
        let estimate =
            |x, radius, area| density.estimate(&projection, DVec3::new(x, 0.0, -5.0), radius, area);
        // The square is 8 cells wide, around the middle of the image: it has a quarter and more of all cells,
        // and all objects.
        let worth = 64.0 + 64.0 * 17.0 / 1024.0;
        for (area, share) in [(0.25, 1.0), (0.125, 0.5), (9.0, 1.0), (0.0, 0.0)] {
            let found = estimate(0.0, 0.25, area).unwrap();
            assert!((found - worth * share).abs() < 1e-3, "{found} of {worth} times {share}");
        }
        let beside = estimate(-0.5, 0.25, 1.0).unwrap();
        assert!((beside - 64.0 * 17.0 / 1024.0).abs() < 1e-3, "{beside} beside all objects");
        assert!(
            estimate(0.0, 0.99, 1.0).is_some() && estimate(0.0, 1.01, 1.0).is_none(),
            "half of the image"
        );
        let pose = Pose::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y);
        for (wide, high) in [(1.0, 4.0), (4.0, 1.0)] {
            let view = View::perspective_off_center(pose, Window::centered(wide, high), 0.1, 99.0).unwrap();
            let projection = ClipProjection::new(&view, DVec3::ZERO);
            let estimate = |z, radius| density.estimate(&projection, DVec3::Z * z, radius, 1.0);
            assert!(estimate(-2.0, 1.99).is_some() && estimate(-2.0, 2.01).is_none(), "the narrower axis");
            assert!(estimate(2.0, 0.1).is_none() && estimate(0.0, 0.1).is_none(), "behind the eye");
        }
    }
}
