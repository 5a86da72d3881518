//! Picture of the projection planes of a viewcell: a row for each direction, nearest plane first.

use crate::walkthrough::canvas::{Canvas, Color};
use crate::walkthrough::palette::{INK, PAPER};
use glam::DVec3;
use visibility_region::ProjectionPlane;

const OPEN: Color = [226, 228, 232];
const COVERED: Color = [58, 84, 130];
/// Side of the picture of a map, in pixels: one for a square of pixels of the map.
const SIDE: usize = 128;
/// Greatest number of planes in a row. Of more, evenly many are left out.
const MOST: usize = 8;
/// Distance between pictures, in pixels, and height of a line of text.
const GAP: u32 = 8;
const LINE: u32 = 18;

/// A projection plane with its map, made smaller.
pub struct PlaneMap {
    direction: DVec3,
    distance: f64,
    /// Corner at the first pixel, and sides along rows and columns.
    corner: DVec3,
    sides: [DVec3; 2],
    /// Part of each square of pixels that is covered, row by row.
    covered: Vec<f32>,
}

impl PlaneMap {
    /// Makes a smaller map of a plane.
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
    /// Returns the side, 0 or 1, that is level, and the other. `None` if both are: the plane is level.
    fn level_and_upright(&self, up: DVec3) -> Option<[usize; 2]> {
        let upright = (0..2).find(|&i| self.sides[i].dot(up).abs() > 0.5 * self.sides[i].length())?;
        Some([1 - upright, upright])
    }

    /// Returns the part that is covered of a square, by its places along two sides.
    fn at(&self, [first, second]: [usize; 2], places: [usize; 2]) -> f32 {
        let mut at = [0; 2];
        (at[first], at[second]) = (places[0], places[1]);
        self.covered[at[1] * SIDE + at[0]]
    }

    /// Returns level segments below which a column of squares is covered at some height.
    pub fn covered_segments(&self, up: DVec3) -> Vec<[DVec3; 2]> {
        let Some([level, upright]) = self.level_and_upright(up) else { return Vec::new() };
        let is_covered = |i: &usize| (0..SIDE).any(|j| self.at([level, upright], [*i, j]) == 1.0);
        let at = |i: usize| self.corner + self.sides[level] * (i as f64 / SIDE as f64);
        (0..SIDE).filter(is_covered).map(|i| [at(i), at(i + 1)]).collect()
    }
}

/// Returns some planes of each direction, few enough to draw, nearest first.
pub fn shown(planes: &[PlaneMap]) -> impl Iterator<Item = Vec<&PlaneMap>> {
    planes.chunk_by(|a, b| a.direction == b.direction).map(|row| {
        let count = row.len().min(MOST);
        (0..count).map(|column| &row[column * row.len() / count]).collect()
    })
}

/// Draws maps, those of equal directions in a row, as far as possible with `up` upwards. `None` without maps.
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
            // Where the upright side runs downwards, the picture is turned over.
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
