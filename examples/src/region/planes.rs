//! Picture of the projection planes of a viewcell: a row for each direction, nearest plane first.

use crate::walkthrough::canvas::{Canvas, Color};
use crate::walkthrough::palette::{INK, PAPER};
use glam::DVec3;
use visibility_region::ProjectionPlane;

const OPEN: Color = [226, 228, 232];
const COVERED: Color = [58, 84, 130];
/// Side in pixels of the picture of a map. Each pixel shows a square of pixels of the map.
const SIDE: usize = 128;
/// Maximum number of planes in a row. If there are more, evenly spaced ones are drawn.
const MOST: usize = 8;
/// Distance between pictures, and height of a line of text, in pixels.
const GAP: u32 = 8;
const LINE: u32 = 18;

/// Projection plane with a reduced copy of its occlusion map.
pub struct PlaneMap {
    direction: DVec3,
    distance: f64,
    /// World-space corner at the first pixel, and the two sides of the map as vectors along its rows and
    /// columns.
    corner: DVec3,
    sides: [DVec3; 2],
    /// Covered fraction of each square of pixels, row by row.
    covered: Vec<f32>,
}

impl PlaneMap {
    /// Makes the reduced map of a projection plane.
    pub fn new(plane: &ProjectionPlane<'_>) -> Self {
        let step = ProjectionPlane::SIDE / SIDE;
        let part = |(x, y): (usize, usize)| {
            let pixels =
                (0..step * step).filter(|i| plane.is_covered(x * step + i % step, y * step + i / step));
            pixels.count() as f32 / (step * step) as f32
        };
        let [a, b, _, d] = plane.corners();
        Self {
            direction: plane.direction(),
            distance: plane.distance(),
            corner: a,
            sides: [b - a, d - a],
            covered: (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y))).map(part).collect(),
        }
    }
}

impl PlaneMap {
    /// Returns the index, 0 or 1, of the side that is horizontal, then that of the other side. `None` if both
    /// are horizontal.
    fn level_and_upright(&self, up: DVec3) -> Option<[usize; 2]> {
        let upright = (0..2).find(|&i| self.sides[i].dot(up).abs() > 0.5 * self.sides[i].length())?;
        Some([1 - upright, upright])
    }

    /// Returns the covered fraction of a square, by the side indices and the square's positions along these
    /// sides.
    fn at(&self, [first, second]: [usize; 2], places: [usize; 2]) -> f32 {
        let mut at = [0; 2];
        (at[first], at[second]) = (places[0], places[1]);
        self.covered[at[1] * SIDE + at[0]]
    }

    /// Returns horizontal segments along an edge of the map, in world space: one for each column of squares
    /// with a square that is entirely covered.
    pub fn covered_segments(&self, up: DVec3) -> Vec<[DVec3; 2]> {
        let Some([level, upright]) = self.level_and_upright(up) else { return Vec::new() };
        let is_covered = |i: &usize| (0..SIDE).any(|j| self.at([level, upright], [*i, j]) == 1.0);
        let at = |i: usize| self.corner + self.sides[level] * (i as f64 / SIDE as f64);
        (0..SIDE).filter(is_covered).map(|i| [at(i), at(i + 1)]).collect()
    }
}

/// Returns for each direction a few planes, evenly chosen, nearest first.
pub fn shown(planes: &[PlaneMap]) -> impl Iterator<Item = Vec<&PlaneMap>> {
    planes.chunk_by(|a, b| a.direction == b.direction).map(|row| {
        let count = row.len().min(MOST);
        (0..count).map(|column| &row[column * row.len() / count]).collect()
    })
}

/// Draws maps, with those of one direction in a row, and with `up` upwards if possible. `None` without maps.
pub fn draw(planes: &[PlaneMap], up: DVec3) -> Option<Canvas> {
    let rows: Vec<Vec<&PlaneMap>> = shown(planes).collect();
    let columns = rows.iter().map(Vec::len).max()? as u32;
    let (wide, high) = (SIDE as u32 + GAP, SIDE as u32 + GAP + 2 * LINE);
    let mut canvas = Canvas::new(columns * wide + GAP, rows.len() as u32 * high + LINE + GAP, PAPER);
    for (row, planes) in rows.iter().enumerate() {
        for (column, plane) in planes.iter().enumerate() {
            let [left, top] = [column as u32 * wide + GAP, row as u32 * high + GAP].map(i64::from);
            let DVec3 { x, y, z } = plane.direction;
            let direction = format!("towards {x:.0} {y:.0} {z:.0}");
            if column == 0 {
                canvas.text(left, top, &direction, INK);
            }
            let order = plane.level_and_upright(up).unwrap_or([0, 1]);
            let [width, height] = order.map(|i| plane.sides[i].length());
            // If the vertical side points downwards, the picture is flipped.
            let is_down = plane.sides[order[1]].dot(up) < 0.0;
            let text = format!("{:.1}: {width:.0}x{height:.0}", plane.distance);
            canvas.text(left, top + i64::from(LINE), &text, INK);
            for (i, j) in (0..SIDE).flat_map(|j| (0..SIDE).map(move |i| (i, j))) {
                let part = plane.at(order, [i, j]);
                let (x, y) = (i as i64, if is_down { j } else { SIDE - 1 - j } as i64);
                let mixed = |i: usize| {
                    (f32::from(OPEN[i]) + (f32::from(COVERED[i]) - f32::from(OPEN[i])) * part) as u8
                };
                canvas.set(left + x, top + 2 * i64::from(LINE) + y, [mixed(0), mixed(1), mixed(2)]);
            }
        }
    }
    let text = "maps of the rays blocked before each plane: blue where all of a pixel are. Distance: width x height, in metres";
    canvas.text(GAP.into(), (rows.len() as u32 * high + GAP).into(), text, INK);
    Some(canvas)
}
