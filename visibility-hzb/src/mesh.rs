//! Meshes of any form: the rule of contract 2, mesh by mesh.
//!
//! # The rule
//! Triangles that surely face the eye are drawn (for two-sided meshes, all that surely face either way). An edge is inner if exactly
//! two drawn triangles share
//! it, in opposite directions as drawn; every other edge of a drawn triangle is a contour, and so is the cut where the near plane
//! crosses one. A
//! pixel is covered if its centre is in a drawn triangle or within rounding of one, and no contour comes within rounding of the closed
//! pixel. Its depth is the
//! farthest that any drawn triangle of the mesh has in its quarter of the tile. Then it merges with other meshes, nearest wins.
//!
//! # Why it is sound
//! Let no contour meet a pixel, and one point of the pixel be in a drawn triangle. Walk from that point to any other of the pixel:
//! where the walk
//! leaves a drawn triangle it crosses an edge, or the near plane's cut, which is no contour, so that another drawn triangle begins
//! there. So all of the pixel
//! is covered, and by triangles that meet it, whose depth counts. The centre need only be within a fraction of a pixel of a triangle:
//! then a point of that
//! triangle is in the pixel.
//!
//! # The error bound
//! Corners before the near plane's limit have `x`, `y` and `w` off by at most `e`, so a pixel coordinate `q = x / w` by `(e_x + |q|
//! e_w) / w`, two roundings
//! aside. The greatest such bound over the mesh, doubled, is `slack`. A point of a segment is off by no more than its ends, so contours
//! are widened by `slack`, and by
//! `2^-20` of a pixel for the arithmetic of the walk along rows, whose coordinates are cut to the picture first. Meshes whose slack
//! exceeds a quarter of a pixel are left out.

use crate::lens::{Lens, Placed};
use crate::pyramid::{Rectangle, mask as mask_of};
use crate::shape::{Coverage, Whole, down};
use crate::solid::{Parts, Scratch, cross, cut, dot, less, point};
use crate::tiles::{SIDE, Tiles};
use alloc::vec::Vec;

/// What one mesh does to a tile.
#[derive(Clone, Copy, Debug)]
struct Cell {
    inner: u64,
    contour: u64,
    /// The least nearness of drawn triangles in each quarter.
    least: [f64; 4],
}

const EMPTY: Cell = Cell { inner: 0, contour: 0, least: [f64::INFINITY; 4] };

/// The pixels of each quarter of a tile: upper left, upper right, lower left, lower right.
const QUARTERS: [u64; 4] = [0x0f0f_0f0f, 0xf0f0_f0f0, 0x0f0f_0f0f_0000_0000, 0xf0f0_f0f0_0000_0000];

/// Memory for meshes, one cell a tile; clean between meshes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cells {
    cells: Vec<Cell>,
    /// For each triangle whether it is drawn: 1 or -1 by the way round.
    facing: Vec<i8>,
}

impl Cells {
    pub(crate) fn new(tiles: &Tiles) -> Self {
        Self { cells: alloc::vec![EMPTY; tiles.columns * tiles.rows], facing: Vec::new() }
    }
}

/// Added to widths for the walk's own rounding, in pixels.
const TINY: f64 = 1.0 / 1048576.0;

/// Corners of a triangle after cutting.
struct Cut {
    corners: [[f64; 5]; 4],
    count: usize,
    /// The cut, as the two corners that it made.
    edge: Option<[[f64; 5]; 2]>,
}

/// What is left of a triangle beyond the limit.
fn beyond_near(t: [&[f64; 5]; 3], beyond: f64) -> Cut {
    let mut out = Cut { corners: [[0.0; 5]; 4], count: 0, edge: None };
    let mut made = [[0.0; 5]; 2];
    let mut cuts = 0;
    for i in 0..3 {
        let (a, b) = (t[i], t[(i + 1) % 3]);
        let mut push = |p: [f64; 5]| {
            if out.count < 4 {
                out.corners[out.count] = p;
                out.count += 1;
            }
        };
        if a[4] > beyond {
            push(*a);
        }
        if (a[4] > beyond) != (b[4] > beyond) {
            let p = cut(a, b, beyond);
            push(p);
            made[cuts % 2] = p;
            cuts += 1;
        }
    }
    out.edge = (cuts == 2).then_some(made);
    out
}

/// Draws a mesh.
#[expect(clippy::too_many_arguments)]
pub(crate) fn draw(
    mesh: &Parts,
    placed: &Placed,
    lens: &Lens,
    facing: f64,
    coverage: Coverage,
    scratch: &mut Scratch,
    cells: &mut Cells,
    tiles: &mut Tiles,
) -> f32 {
    scratch.corners.clear();
    scratch.corners.extend(mesh.positions.iter().map(|p| placed.at(p.to_array().map(f64::from))));
    let corners = &scratch.corners;
    let beyond = 1024.0 * placed.error[4];
    let Some(slack) = slack(mesh, corners, placed, beyond) else { return f32::NEG_INFINITY };

    let certain = placed.determinant_error();
    cells.facing.clear();
    for t in mesh.triangles {
        let [a, b, c] = t.map(|i| &corners[i as usize]);
        let height = dot(cross(point(&less(b, a)), point(&less(c, a))), point(a)) * facing;
        let drawn = a[4] > beyond || b[4] > beyond || c[4] > beyond;
        cells.facing.push(match (drawn, mesh.two_sided) {
            (true, _) if height > certain => 1,
            (true, true) if height < -certain => -1,
            _ => 0,
        });
    }

    let mut canvas = Canvas {
        cells: &mut cells.cells,
        columns: tiles.columns,
        size: lens.size,
        slack: slack + TINY,
        used: [usize::MAX, 0, usize::MAX, 0],
        greatest: f64::NEG_INFINITY,
    };
    let ([sx, sy, sw, sn, _], [.., en, _]) = (placed.size, placed.error);
    let products = placed.cross_error(lens.size);
    for (t, facing) in mesh.triangles.iter().zip(&cells.facing) {
        if *facing == 0 {
            continue;
        }
        let whole = t.map(|i| &corners[i as usize]);
        let part = beyond_near(whole, beyond);
        let (second, third) = (less(whole[1], whole[0]), less(whole[2], whole[0]));
        let normal = cross(point(&second), point(&third));
        let height = dot(normal, point(whole[0]));
        let plane = if lens.perspective {
            normal.map(|a| a / height)
        } else {
            let (p, q) = (cross(point(&third), point(whole[0])), cross(point(whole[0]), point(&second)));
            [0, 1, 2].map(|i| (whole[0][3] * normal[i] + second[3] * p[i] + third[3] * q[i]) / height)
        };
        let [width, rows] = lens.size;
        let of_n =
            if lens.perspective { 0.0 } else { 32.0 * en * (width * sy * sw + rows * sx * sw + sx * sy) };
        let size = plane[0].abs() * width + plane[1].abs() * rows + plane[2].abs();
        let error = 2.0 * (4.0 * products * sn + of_n + size * certain) / height.abs();
        canvas.triangle(&part.corners[..part.count], [plane[0], plane[1], plane[2] - error], placed);
        if let Some([a, b]) = &part.edge
            && coverage == Coverage::Conservative
        {
            canvas.contour(a, b);
        }
    }
    if coverage == Coverage::Conservative {
        for edge in mesh.edges {
            let left = cells.facing[edge.left as usize];
            let right = edge.right.map_or(0, |t| cells.facing[t as usize]);
            // Inner if two drawn triangles run through it in opposite directions as drawn.
            if (left == 0 && right == 0) || left == right {
                continue;
            }
            let [a, b] = edge.vertices.map(|i| &corners[i as usize]);
            match (a[4] > beyond, b[4] > beyond) {
                (true, true) => canvas.contour(a, b),
                (true, false) => canvas.contour(a, &cut(a, b, beyond)),
                (false, true) => canvas.contour(b, &cut(a, b, beyond)),
                (false, false) => {}
            }
        }
    }
    canvas.merge(tiles)
}

/// How far rounding can move a pixel coordinate of the mesh, doubled; `None` if that is too far to draw it.
fn slack(mesh: &Parts, corners: &[[f64; 5]], placed: &Placed, beyond: f64) -> Option<f64> {
    let [ex, ey, ew, ..] = placed.error;
    let mut worst: f64 = 0.0;
    let mut one = |c: &[f64; 5]| {
        // A corner at or behind the eye makes it infinite.
        let w = if c[2] > 8.0 * ew { c[2] } else { 0.0 };
        let size = c[0].abs().max(c[1].abs()) / w;
        worst = worst.max((ex + ey + size * ew) / w + 8.0 * f64::EPSILON * size);
    };
    for c in corners.iter().filter(|c| c[4] > beyond) {
        one(c);
    }
    for edge in mesh.edges {
        let [a, b] = edge.vertices.map(|i| &corners[i as usize]);
        if (a[4] > beyond) != (b[4] > beyond) {
            one(&cut(a, b, beyond));
        }
    }
    // NaN is too far as well.
    (worst <= 0.125).then_some(2.0 * worst)
}

struct Canvas<'a> {
    cells: &'a mut [Cell],
    columns: usize,
    size: [f64; 2],
    slack: f64,
    /// First and last columns and rows of tiles that were touched.
    used: [usize; 4],
    /// Nearness that nothing drawn exceeds.
    greatest: f64,
}

/// In pixel coordinates.
fn on_screen(c: &[f64; 5]) -> [f64; 2] {
    [c[0] / c[2], c[1] / c[2]]
}

impl Canvas<'_> {
    /// Whole numbers of pixels or tiles from a range of coordinates: first and end; `None` if the range is off the buffer.
    fn range(low: f64, high: f64, size: f64) -> Option<[usize; 2]> {
        // NaN is off the buffer.
        if !(high >= 0.0 && low < size) {
            return None;
        }
        Some([low.max(0.0) as usize, (high as usize + 1).min(size as usize)])
    }

    fn touch(&mut self, x: [usize; 2], y: [usize; 2]) {
        let [x0, x1, y0, y1] = self.used;
        self.used = [x0.min(x[0]), x1.max(x[1]), y0.min(y[0]), y1.max(y[1])];
    }

    /// Marks the pixels whose centres are in a triangle, or what is left of one, and takes note of its depth in each tile that it meets.
    fn triangle(&mut self, corners: &[[f64; 5]], plane: [f64; 3], placed: &Placed) {
        if corners.len() < 3 {
            return;
        }
        let mut points = [[0.0; 2]; 4];
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let (mut floor, mut ceiling) = (f64::INFINITY, f64::NEG_INFINITY);
        for (out, c) in points.iter_mut().zip(corners) {
            *out = on_screen(c);
            for axis in 0..2 {
                low[axis] = low[axis].min(out[axis]);
                high[axis] = high[axis].max(out[axis]);
            }
            let nearness = c[3] / c[2];
            let margin = 2.0 * (placed.error[3] + nearness.abs() * placed.error[2]) / c[2]
                + 4.0 * f64::EPSILON * nearness.abs();
            floor = floor.min(nearness - margin);
            ceiling = ceiling.max(nearness + margin);
        }
        let points = &points[..corners.len().min(4)];
        let slack = self.slack;
        let Some(lines) = Self::range(low[1] - slack, high[1] + slack, self.size[1]) else { return };
        let Some(across) = Self::range(low[0] - slack, high[0] + slack, self.size[0]) else { return };
        self.greatest = self.greatest.max(ceiling);
        let (tile_rows, tile_columns) =
            ([lines[0] / SIDE, (lines[1] - 1) / SIDE], [across[0] / SIDE, (across[1] - 1) / SIDE]);
        self.touch(tile_columns, tile_rows);
        for row in tile_rows[0]..=tile_rows[1] {
            self.deepen(points, plane, floor, row);
            for line in (row * SIDE).max(lines[0])..((row + 1) * SIDE).min(lines[1]) {
                // Centres in the triangle, or not farther from it than rounding.
                let y = line as f64 + 0.5;
                let Some([left, right]) = span(points, y - slack, y + slack) else { continue };
                let first = (left - slack - 0.5).max(0.0).ceil_();
                let end = (right + slack - 0.5).min(self.size[0] - 1.0).floor_() + 1.0;
                if first < end {
                    self.mark(line, first as usize, end as usize, |cell| &mut cell.inner);
                }
            }
        }
    }

    /// Takes note of the depth of a triangle in each quarter of the tiles of a row that it meets.
    fn deepen(&mut self, points: &[[f64; 2]], [a, b, c]: [f64; 3], floor: f64, row: usize) {
        let (half, slack) = (SIDE / 2, self.slack);
        for band in [2 * row, 2 * row + 1] {
            let (top, bottom) = ((band * half) as f64, ((band + 1) * half) as f64);
            // The columns that it can reach in this band.
            let Some([left, right]) = span(points, top - slack, bottom + slack) else { continue };
            let Some(reach) = Self::range(left - slack, right + slack, self.size[0]) else { continue };
            for column in reach[0] / half..=(reach[1] - 1) / half {
                let x = (column * half) as f64 + if a < 0.0 { half as f64 } else { 0.0 };
                let worst = a * x + b * if b < 0.0 { bottom } else { top } + c;
                // A NaN gives way to the floor.
                let nearness = if worst >= floor { worst } else { floor };
                let quarter =
                    &mut self.cells[row * self.columns + column / 2].least[band % 2 * 2 + column % 2];
                *quarter = quarter.min(nearness);
            }
        }
    }

    /// Marks some pixels of a row.
    fn mark(&mut self, line: usize, first: usize, end: usize, which: impl Fn(&mut Cell) -> &mut u64) {
        let row = line / SIDE;
        let rectangle =
            Rectangle { columns: [first as u32, end as u32], lines: [line as u32, line as u32 + 1] };
        for column in first / SIDE..=(end - 1) / SIDE {
            *which(&mut self.cells[row * self.columns + column]) |= mask_of(&rectangle, column, row);
        }
    }

    /// Marks the pixels that a contour meets, up to rounding.
    fn contour(&mut self, a: &[f64; 5], b: &[f64; 5]) {
        let points = [on_screen(a), on_screen(b)];
        let slack = self.slack;
        let (low, high) = (points[0][1].min(points[1][1]), points[0][1].max(points[1][1]));
        // A contour along the border of a row meets both rows.
        let Some(lines) = Self::range(low - slack, high + slack, self.size[1]) else { return };
        for line in lines[0]..lines[1] {
            let (top, bottom) = (line as f64 - slack, line as f64 + 1.0 + slack);
            let Some([left, right]) = span(&points, top, bottom) else { continue };
            let Some(reach) = Self::range(left - slack, right + slack, self.size[0]) else { continue };
            let tiles = [reach[0] / SIDE, (reach[1] - 1) / SIDE];
            self.touch(tiles, [line / SIDE; 2]);
            self.mark(line, reach[0], reach[1], |cell| &mut cell.contour);
        }
    }

    /// Gives what is covered to the tiles, and cleans up.
    fn merge(self, tiles: &mut Tiles) -> f32 {
        let [x0, x1, y0, y1] = self.used;
        if x0 > x1 || y0 > y1 {
            return f32::NEG_INFINITY;
        }
        for row in y0..=y1 {
            for column in x0..=x1 {
                let tile = row * self.columns + column;
                let Cell { inner, contour, least } = core::mem::replace(&mut self.cells[tile], EMPTY);
                let covered = inner & !contour;
                if covered == 0 {
                    continue;
                }
                for (quarter, least) in least.into_iter().enumerate() {
                    let part = covered & QUARTERS[quarter];
                    if part != 0 && least < f64::INFINITY {
                        tiles.cover(tile, part, down(least));
                    }
                }
            }
        }
        crate::shape::up(self.greatest)
    }
}

/// The columns between which a convex polygon or a segment lies in a range of rows; `None` if it does not reach them.
fn span(points: &[[f64; 2]], top: f64, bottom: f64) -> Option<[f64; 2]> {
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut take = |x: f64| {
        left = left.min(x);
        right = right.max(x);
    };
    for (i, b) in points.iter().enumerate() {
        let a = &points[if i == 0 { points.len() - 1 } else { i - 1 }];
        if b[1] >= top && b[1] <= bottom {
            take(b[0]);
        }
        for y in [top, bottom] {
            if (a[1] < y) != (b[1] < y) {
                // From the nearer end, and never beyond the ends.
                let (p, q) = if (a[1] - y).abs() < (b[1] - y).abs() { (a, b) } else { (b, a) };
                let x = p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0]);
                take(x.clamp(a[0].min(b[0]), a[0].max(b[0])));
            }
        }
    }
    (left <= right).then_some([left, right])
}
