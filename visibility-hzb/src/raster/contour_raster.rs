//! The coverage of one mesh, tile by tile, before it is merged with other meshes: the pixels that the mesh
//! covers and a lower bound on its depth keys there.
//!
//! Triangles are not filled. Each drawn triangle, oriented in the same sense on the screen, winds once round
//! each point that it covers. The contour is the sum of their directed edges, where opposite edges cancel. So
//! the contour winds round a point as often as triangles cover the point (see
//! [`screen_shape`](crate::setup::screen_shape)). A contour edge that crosses a row of pixel centres changes
//! the winding number of all pixels to its right. Sums along rows give the winding number everywhere. Work
//! therefore grows with contours and tiles, not with triangles or pixels.

use super::parallax::EdgeZone;
use crate::buffer::tile_layout::SIDE;
use crate::buffer::tiles::Tiles;
use crate::lanes::{greatest, least};
use crate::rounding::lower;
use alloc::vec::Vec;

/// A vertex of a drawn triangle: its position on the screen in pixels, and a bound on its depth key.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ScreenVertex {
    /// Column in pixels of the buffer, not rounded to whole pixels.
    pub(crate) x: f64,
    /// Row in pixels of the buffer, downwards, not rounded to whole pixels.
    pub(crate) y: f64,
    /// Lower bound on the vertex's depth key (greater is nearer).
    pub(crate) far: f32,
}

/// Contribution of one mesh to one tile: pixels near its contour, depth keys, and changes of the winding
/// number of its contour from pixel to pixel.
#[derive(Clone, Copy, Debug)]
struct ContourTile {
    /// Mask of the pixels that a contour edge meets or nearly meets. The mesh does not cover these. Bit `8 *
    /// y + x` stands for the pixel at column `x` and row `y` of the tile.
    contour: u64,
    /// Least depth key of the drawn triangles that may meet each quarter of the tile, in the order of
    /// [`QUARTERS`]. Infinity if no triangle does.
    least: [f32; 4],
    /// True if an element of `steps` (changes of the winding number) may differ from zero. False if all
    /// elements are zero.
    stepped: bool,
    /// Changes of the contour's winding number, modulo 256: `steps[x][y]` is the change from the centre of
    /// the pixel at column `x - 1` to that of the pixel at column `x`, in row `y` of the tile. A winding
    /// number of 0 modulo 256 counts as not covered, which is conservative.
    steps: [[u8; SIDE]; SIDE],
}

/// Empty [`ContourTile`]: the mesh contributes nothing to the tile.
const EMPTY: ContourTile =
    ContourTile { contour: 0, least: [f32::INFINITY; 4], stepped: false, steps: [[0; SIDE]; SIDE] };

/// Pixel masks of the quarters (4 x 4 pixels) of a tile: upper left, upper right, lower left, lower right.
/// Bit `8 * y + x` stands for the pixel at column `x` and row `y`.
const QUARTERS: [u64; 4] = [0x0f0f_0f0f, 0xf0f0_f0f0, 0x0f0f_0f0f_0000_0000, 0xf0f0_f0f0_0000_0000];

/// Width and height of a quarter of a tile, in pixels.
const HALF: usize = SIDE / 2;

/// Flatness limit of a triangle: if the depth keys of its corners differ by at most this fraction of the
/// greatest key, the whole triangle gets the depth key of its farthest corner.
const FLAT: f32 = 0.001;

/// Scratch for the coverage and depth that one mesh contributes: one [`ContourTile`] for each tile of the
/// buffer. Between two meshes all are empty.
#[derive(Clone, Debug, Default)]
pub(crate) struct ContourTiles {
    /// Contribution of the mesh to each tile, row by row from the top.
    cells: Vec<ContourTile>,
}

impl ContourTiles {
    /// Creates empty contributions of a mesh, one for each of `tiles`.
    pub(crate) fn new(tiles: &Tiles) -> Self {
        Self { cells: alloc::vec![EMPTY; tiles.columns * tiles.rows] }
    }
}

/// Rasterizer of one mesh: collects triangles and contour edges tile by tile, and finally merges the covered
/// pixels into the buffer.
pub(crate) struct ContourRaster<'a> {
    /// Contribution of the mesh to each tile, row by row from the top.
    cells: &'a mut [ContourTile],
    /// Number of tile columns of the buffer.
    columns: usize,
    /// Width and height of the buffer in pixels.
    size: [f64; 2],
    /// Upper bound on the error of the coordinates of contour vertices on the screen, in pixels. Pixels
    /// within this distance of a contour edge are not covered.
    slack: f64,
    /// First column, last column, first row, last row of the tiles that a contour touched, inclusive. Before
    /// the first contour, each first exceeds its last.
    used: [usize; 4],
}

/// Returns the half-open range of units (pixels, or quarters of tiles) that the interval from `low` to `high`
/// meets, clipped to `0..size`. If `low` is a whole number, the range may begin one unit early. If `high` is
/// a whole number, the range may leave out the unit that only touches `high`. `None` if the interval lies
/// outside `0..size`, or if `low` or `high` is NaN.
#[inline(always)]
fn range(low: f64, high: f64, size: f64) -> Option<[usize; 2]> {
    // The comparison is false for NaN.
    if !(high >= 0.0 && low < size) {
        return None;
    }
    let (first, last) = (floor(greatest(low, 0.0)), floor(least(high, size)));
    Some([first.max(0) as usize, (last + 1).min(size as i32) as usize])
}

/// 1.5 times 2^52. Adding it to an `f64` of magnitude below 2^31 leaves the nearest integer in the low 32
/// bits of the sum. The sum is much faster than a cast, which must saturate.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// Returns the integer nearest to `x`, ties to even. The magnitude of `x` must be below 2^31.
#[inline(always)]
fn nearest(x: f64) -> i32 {
    (x + WHOLE).to_bits() as i32
}

/// Returns the greatest integer not above `x`, or possibly `x - 1` if `x` is a whole number. Callers have
/// already widened their ranges by the slack (the bound on the error of screen coordinates), so a range may
/// begin one unit early.
#[inline(always)]
fn floor(x: f64) -> i32 {
    nearest(x - 0.5)
}

impl<'a> ContourRaster<'a> {
    /// Starts a mesh on empty `cells` of a buffer with `columns` columns of tiles and a width and height of
    /// `size` pixels. `slack` is an upper bound on the error of the coordinates of its vertices, in pixels.
    #[inline(always)]
    pub(crate) fn new(cells: &'a mut ContourTiles, columns: usize, size: [f64; 2], slack: f64) -> Self {
        Self { cells: &mut cells.cells, columns, size, slack, used: [usize::MAX, 0, usize::MAX, 0] }
    }

    /// Extends `used`, the range of tiles that a contour touched, by the columns `x` and rows `y`, each a
    /// first and a last tile, inclusive.
    #[inline(always)]
    fn touch(&mut self, x: [usize; 2], y: [usize; 2]) {
        let [x0, x1, y0, y1] = self.used;
        self.used = [x0.min(x[0]), x1.max(x[1]), y0.min(y[0]), y1.max(y[1])];
    }

    /// Lowers the least depth key of each quarter (4 x 4 pixels) of a tile that a triangle may meet.
    /// `corners` are the three corners of the triangle, or the corners of its part beyond the near plane, on
    /// the screen. `plane` returns the coefficients `a`, `b`, `c` of the triangle's depth key in pixel
    /// coordinates, lowered by its error: the key is `a x + b y + c`. `plane` is called only for triangles
    /// that meet many quarters and whose corners differ in depth.
    #[inline(always)]
    pub(crate) fn lower_depth_keys(&mut self, corners: &[ScreenVertex], plane: impl FnOnce() -> [f64; 3]) {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let (mut floor, mut ceiling) = (f32::INFINITY, f32::NEG_INFINITY);
        for c in corners {
            low = [least(c.x, low[0]), least(c.y, low[1])];
            high = [greatest(c.x, high[0]), greatest(c.y, high[1])];
            floor = least(c.far, floor);
            ceiling = greatest(c.far, ceiling);
        }
        let (slack, half) = (self.slack, 1.0 / HALF as f64);
        let limits = [self.size[0] * half, self.size[1] * half];
        let Some(across) = range((low[0] - slack) * half, (high[0] + slack) * half, limits[0]) else {
            return;
        };
        let Some(down) = range((low[1] - slack) * half, (high[1] + slack) * half, limits[1]) else { return };
        let flat = ceiling - floor <= FLAT * ceiling.abs();
        let few = if flat { 4 } else { 2 };
        if across[1] - across[0] <= few && down[1] - down[0] <= few {
            for band in down[0]..down[1] {
                for column in across[0]..across[1] {
                    self.lower_depth_key(column, band, floor);
                }
            }
            return;
        }
        let [a, b, c] = if flat { [0.0, 0.0, f64::NAN] } else { plane() };
        let ahead = if a < 0.0 { HALF as f64 } else { 0.0 };
        let sides = Sides::of(corners);
        for band in down[0]..down[1] {
            let (top, bottom) = ((band * HALF) as f64, ((band + 1) * HALF) as f64);
            // Columns that the triangle can meet in this band of pixel rows.
            let [left, right] = sides.span(top - slack, bottom + slack);
            let Some(reach) = range((left - slack) * half, (right + slack) * half, limits[0]) else {
                continue;
            };
            let row = b * if b < 0.0 { bottom } else { top } + c;
            for column in reach[0]..reach[1] {
                let worst = lower(a * ((column * HALF) as f64 + ahead) + row);
                // With a NaN plane, the depth key of the farthest corner is used.
                self.lower_depth_key(column, band, if worst >= floor { worst } else { floor });
            }
        }
    }

    /// Lowers the mesh's least depth key in one quarter (4 x 4 pixels) of a tile to at most `depth_key`.
    /// `column` and `band` are the quarter's column and row in units of quarters (4 pixels).
    #[inline(always)]
    fn lower_depth_key(&mut self, column: usize, band: usize, depth_key: f32) {
        let cell = &mut self.cells[band / 2 * self.columns + column / 2];
        let quarter = &mut cell.least[band % 2 * 2 + column % 2];
        *quarter = least(depth_key, *quarter);
    }

    /// Draws a contour edge from `a` to `b` with multiplicity `times`, negative for the opposite direction.
    /// The edge changes the winding numbers of the pixels to its right. If `marked`, pixels whose distance
    /// from the edge is within `self.slack` (in pixels) are not covered. If not, the winding number at their
    /// centres alone decides.
    ///
    /// The column at which the edge meets a row is clamped to the ends of the edge, and otherwise off by at
    /// most 11 units of round-off of the greatest coordinate. 16 such units are part of `self.slack`.
    #[inline(always)]
    pub(crate) fn contour(&mut self, a: &ScreenVertex, b: &ScreenVertex, times: i8, marked: bool) {
        let slack = self.slack;
        let (times, a, b) = if a.y <= b.y { (times, a, b) } else { (-times, b, a) };
        // An edge along the border between two rows of pixels is near both rows.
        let Some(lines) = range(a.y - slack, b.y + slack, self.size[1]) else { return };
        let (least_x, most_x) = if a.x < b.x { (a.x, b.x) } else { (b.x, a.x) };
        let (first, last) = (least_x - slack, most_x + slack);
        let [width, _] = self.size;
        let to_tile =
            |x: f64| (floor(least(greatest(x, 0.0), width)).max(0) as usize / SIDE).min(self.columns - 1);
        // The first pixel centre to the right may be in the next tile.
        self.touch([to_tile(first), to_tile(last + 1.0)], [lines[0] / SIDE, (lines[1] - 1) / SIDE]);
        // An edge to the right of the buffer changes no winding number.
        if !(first < width) {
            return;
        }
        // The slope of a horizontal edge is NaN or infinite. Columns are clamped to the ends of the edge, and
        // no row of centres lies between its ends.
        let slope = (b.x - a.x) / (b.y - a.y);
        let at = |y: f64| {
            let x = a.x + (y - a.y) * slope;
            // NaN becomes the least column.
            let x = if x > least_x { x } else { least_x };
            if x < most_x { x } else { most_x }
        };
        for line in lines[0]..lines[1] {
            let y = line as f64;
            let (row, bit) = (line / SIDE * self.columns, line % SIDE);
            if marked && last >= 0.0 {
                let (top, bottom) = (y - slack, y + 1.0 + slack);
                // If the edge begins or ends within the row, that end bounds its columns.
                let p = if top > a.y { at(top) } else { a.x };
                let q = if bottom < b.y { at(bottom) } else { b.x };
                let (left, right) = if p < q { (p, q) } else { (q, p) };
                if let Some(columns) = range(left - slack, right + slack, width) {
                    self.mark(line, columns);
                }
            }
            let centre = y + 0.5;
            if a.y < centre && centre <= b.y {
                // The first centre to the right of the edge. A centre on the edge may count either way: its
                // pixel is near the edge.
                let column = nearest(least(greatest(at(centre), 0.0), width)) as usize;
                if let Some(cell) = self.cells[row..row + self.columns].get_mut(column / SIDE) {
                    let step = &mut cell.steps[column % SIDE][bit];
                    *step = step.wrapping_add(times as u8);
                    cell.stepped = true;
                }
            }
        }
    }

    /// Leaves out the pixels that come near the zone in which a contour edge appears from the eyes of a ball.
    /// The zone holds the errors of the edge's ends; the slack is for rounding along the zone.
    pub(crate) fn erode(&mut self, zone: &EdgeZone) {
        let slack = self.slack;
        let [width, height] = self.size;
        let [left, right, above, below] = zone.bounds();
        let Some(lines) = range(above - slack, below + slack, height) else { return };
        let Some(columns) = range(left - slack, right + slack, width) else { return };
        self.touch(
            columns.map(|column| (column / SIDE).min(self.columns - 1)),
            [lines[0] / SIDE, (lines[1] - 1) / SIDE],
        );
        for line in lines[0]..lines[1] {
            let y = line as f64;
            let Some([left, right]) = zone.columns(y - slack, y + 1.0 + slack) else { continue };
            let Some([l, r]) = range(left - slack, right + slack, width) else { continue };
            self.mark(line, [l, r]);
        }
    }

    /// Marks the pixels of a line, from the first column to before the last, as near the contour.
    #[inline(always)]
    fn mark(&mut self, line: usize, [l, r]: [usize; 2]) {
        let (row, bit) = (line / SIDE * self.columns, line % SIDE);
        for column in l / SIDE..=(r - 1) / SIDE {
            let start = column * SIDE;
            let (l, r) = (l.max(start) - start, (r - start).min(SIDE));
            self.cells[row + column].contour |= ((0xff_u64 << l) & (0xff >> (SIDE - r))) << (SIDE * bit);
        }
    }

    /// Draws the mesh into `tiles`: covers each of its pixels at the least depth key (the farthest) that the
    /// mesh has in the pixel's quarter of the tile. Empties the [`ContourTile`]s for the next mesh.
    #[inline(always)]
    pub(crate) fn merge(self, tiles: &mut Tiles) {
        let [x0, x1, y0, y1] = self.used;
        if x0 > x1 {
            return;
        }
        for row in y0..=y1 {
            // Winding number modulo 256 in the current column, one byte for each row of pixels.
            let mut count = 0u64;
            for column in x0..=x1 {
                let tile = row * self.columns + column;
                let cell = &mut self.cells[tile];
                let mut inner = nonzero(count) * 0xff;
                if cell.stepped {
                    inner = 0;
                    for (i, steps) in cell.steps.iter_mut().enumerate() {
                        count = add_bytes(count, u64::from_le_bytes(*steps));
                        inner |= nonzero(count) << i;
                    }
                    cell.steps = EMPTY.steps;
                    cell.stepped = false;
                }
                let (covered, parts) = (inner & !cell.contour, cell.least);
                cell.contour = 0;
                cell.least = EMPTY.least;
                if covered == 0 {
                    continue;
                }
                for quarter in 0..4 {
                    // A quarter without triangles has nonzero winding numbers by rounding only.
                    if parts[quarter] < f32::INFINITY {
                        tiles.cover(tile, covered & QUARTERS[quarter], parts[quarter], 0);
                    }
                }
            }
        }
    }
}

/// Returns 1 in each byte of the result whose byte of `bytes` is not zero, else 0.
#[inline(always)]
fn nonzero(bytes: u64) -> u64 {
    const LOW: u64 = 0x7f7f_7f7f_7f7f_7f7f;
    (((bytes & LOW) + LOW) | bytes) >> 7 & 0x0101_0101_0101_0101
}

/// Returns the sums of the eight bytes of `a` and `b`, each modulo 256.
#[inline(always)]
fn add_bytes(a: u64, b: u64) -> u64 {
    const LOW: u64 = 0x7f7f_7f7f_7f7f_7f7f;
    ((a & LOW) + (b & LOW)) ^ ((a ^ b) & !LOW)
}

/// Edges of a convex polygon of up to four corners on the screen, in pixels of the buffer.
struct Sides {
    /// Edges of the polygon. The first `count` are valid.
    sides: [Side; 4],
    /// Number of edges, at most 4.
    count: usize,
}

/// One edge of a polygon, from its upper end to its lower end, in pixels.
#[derive(Clone, Copy, Default)]
struct Side {
    /// Column and row of the upper end, in pixels.
    top: [f64; 2],
    /// Column and row of the lower end, in pixels.
    bottom: [f64; 2],
    /// Change of the column, in pixels, from one row of pixels to the next. Infinite or NaN for a horizontal
    /// edge.
    slope: f64,
}

impl Side {
    /// Returns the edge's column at row `y`, both in pixels, clamped to the columns of its ends.
    #[inline(always)]
    fn at(&self, y: f64) -> f64 {
        let x = self.top[0] + (y - self.top[1]) * self.slope;
        let (low, high) = (least(self.top[0], self.bottom[0]), greatest(self.top[0], self.bottom[0]));
        // NaN becomes the least column.
        least(greatest(x, low), high)
    }
}

impl Sides {
    /// Returns the edges of the polygon with the given corners in order. Corners beyond the fourth are
    /// ignored.
    #[inline(always)]
    fn of(corners: &[ScreenVertex]) -> Self {
        let count = corners.len().min(4);
        let mut sides = [Side::default(); 4];
        for i in 0..count {
            let (a, b) = (&corners[i], &corners[if i == 0 { count - 1 } else { i - 1 }]);
            let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
            sides[i] = Side { top: [a.x, a.y], bottom: [b.x, b.y], slope: (b.x - a.x) / (b.y - a.y) };
        }
        Self { sides, count }
    }

    /// Returns the least and the greatest column, in pixels, of the polygon between the rows `top` and
    /// `bottom`. The least is infinity and the greatest negative infinity if the polygon does not reach these
    /// rows.
    #[inline(always)]
    fn span(&self, top: f64, bottom: f64) -> [f64; 2] {
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for side in &self.sides[..self.count] {
            if side.bottom[1] < top || side.top[1] > bottom {
                continue;
            }
            let p = if top > side.top[1] { side.at(top) } else { side.top[0] };
            let q = if bottom < side.bottom[1] { side.at(bottom) } else { side.bottom[0] };
            left = least(left, least(p, q));
            right = greatest(right, greatest(p, q));
        }
        [left, right]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact_outline::{
        Spot, UNITS, along_borders, centre, coordinate, edges, in_pixels, is_near, meets, winding,
    };
    use crate::random::random;
    use alloc::format;

    /// Rounding that the slack of these tests allows for, in pixels, far below a unit.
    const ROUNDING: f64 = 1e-9;

    /// Returns a vertex at a spot.
    fn vertex(spot: Spot) -> ScreenVertex {
        let [x, y] = in_pixels(spot);
        ScreenVertex { x, y, far: 1.0 }
    }

    /// A pixel is covered if and only if a contour winds round its centre and no edge of it comes within the
    /// slack of the pixel. Vertices are exact, in a buffer of 5 by 3 tiles and around it, many of them at
    /// whole and half pixels.
    #[test]
    fn pixels_are_covered_up_to_the_slack_from_a_contour() {
        let (mut random, mut counts) = (random(21), [0; 2]);
        for trial in 0..1_200 {
            let tiles = &mut Tiles::new(40, 24);
            let mut cells = ContourTiles::new(tiles);
            cells.cells.iter_mut().for_each(|cell| cell.least = [1.0; 4]);
            let marked = trial % 4 != 0;
            let slack = if trial % 3 == 0 { 0 } else { random(0.0, 256.0) as i128 };
            let reach = [4.0, 30.0, 400.0][random(0.0, 3.0) as usize];
            let middle = [random(-10.0, 50.0), random(-10.0, 34.0)];
            let polygon: [Spot; 4] = if trial % 5 < 2 {
                along_borders(&mut random, [5, 3])
            } else {
                core::array::from_fn(|_| middle.map(|at| coordinate(&mut random, at - reach, at + reach)))
            };
            let mut raster = ContourRaster::new(&mut cells, 5, [40.0, 24.0], slack as f64 / 256.0 + ROUNDING);
            for (i, [a, b]) in edges(&polygon).enumerate() {
                // Either direction, with the multiplicity that belongs to it.
                let (a, b, times) = if i % 2 == 0 { (a, b, 1) } else { (b, a, -1) };
                raster.contour(&vertex(a), &vertex(b), times, marked);
            }
            raster.merge(tiles);
            for (x, y) in (0..24).flat_map(|y| (0..40).map(move |x| (x, y))) {
                let is_covered = tiles.pixel(x, y) > f32::NEG_INFINITY;
                let at = centre([x, y]);
                let near = |by: i128| {
                    let [low, high] = [-by, by].map(|by| at.map(|v| v + by));
                    edges(&polygon).any(|[a, b]| {
                        if marked { is_near([a, b], [x, y], by) } else { meets(a, b, low, high) }
                    })
                };
                let is_wound = winding(&polygon, at) != 0;
                let (within, around) = if marked { (near(slack), near(slack + 1)) } else { (false, near(1)) };
                let case = || format!("trial {trial}, pixel {x}, {y} of {polygon:?} with the slack {slack}");
                assert!(!(is_covered && (within || !is_wound && !around)), "{} is covered", case());
                assert!(is_covered || around || !is_wound, "{} is bare", case());
                counts[usize::from(is_covered)] += 1;
            }
            let is_empty =
                |cell: &ContourTile| cell.contour == 0 && cell.steps == EMPTY.steps && !cell.stepped;
            assert!(cells.cells.iter().all(is_empty), "trial {trial}: tiles are left for the next mesh");
        }
        assert!(counts.iter().all(|&count| count > 100_000), "{counts:?} pixels are bare and covered");
    }

    /// Pixels are left out if and only if the zone of an edge comes within the slack of them. The hull of two
    /// rectangles is the union of the rectangles between them.
    #[test]
    fn pixels_are_left_out_up_to_the_slack_from_a_zone() {
        let (mut random, mut counts) = (random(22), [0; 2]);
        for trial in 0..1_200 {
            let mut cells = ContourTiles::new(&Tiles::new(40, 24));
            let slack = random(0.0, 256.0) as i128 * i128::from(trial % 3 != 0);
            let reach = [4.0, 30.0, 400.0][random(0.0, 3.0) as usize];
            let ends: [[i128; 4]; 2] = core::array::from_fn(|_| {
                let [x, y] = [[-10.0, 50.0], [-10.0, 34.0]].map(|[low, high]| {
                    let at = random(low - reach, high + reach);
                    let first = coordinate(&mut random, at, at + 1.0);
                    [first, first + coordinate(&mut random, 0.0, 8.0)]
                });
                [x[0], x[1], y[0], y[1]]
            });
            let ends = if trial % 2 == 0 {
                ends
            } else {
                // Sides of both rectangles near one border between tiles.
                let [a, b, ..] = along_borders(&mut random, [5, 3]);
                let by = [0; 2].map(|_| random(-2_000.0, 2_000.0) as i128);
                [a, b].map(|[x, y]| [x.min(x + by[0]), x.max(x + by[0]), y.min(y + by[1]), y.max(y + by[1])])
            };
            let zone = EdgeZone { ends: ends.map(|end| end.map(|at| at as f64 / 256.0)) };
            let mut raster = ContourRaster::new(&mut cells, 5, [40.0, 24.0], slack as f64 / 256.0 + ROUNDING);
            raster.erode(&zone);
            let [x0, x1, y0, y1] = raster.used;
            for (x, y) in (0..24).flat_map(|y| (0..40).map(move |x| (x, y))) {
                let cell = &cells.cells[y / SIDE * 5 + x / SIDE];
                let is_left_out = cell.contour >> (y % SIDE * SIDE + x % SIDE) & 1 != 0;
                // Each side of the rectangle at the share `t` of the way is linear in `t`. The rectangle
                // meets the open square around the pixel where four such functions exceed 0.
                let near = |by: i128| {
                    let [low, high] = [-by, UNITS + by].map(|by| [x, y].map(|v| v as i128 * UNITS + by));
                    let over = |end: &[i128; 4]| {
                        [high[0] - end[0], end[1] - low[0], high[1] - end[2], end[3] - low[1]]
                    };
                    let [a, b] = [over(&ends[0]), over(&ends[1])];
                    // Fractions: the greatest lower and the least upper limit of `t`.
                    let (mut least, mut most, mut possible) = ([0, 1], [1, 1], true);
                    for (a, b) in a.into_iter().zip(b) {
                        possible &= a > 0 || b > 0;
                        if a <= 0 && b > 0 && -a * least[1] >= least[0] * (b - a) {
                            least = [-a, b - a];
                        } else if b <= 0 && a > 0 && a * most[1] <= most[0] * (a - b) {
                            most = [a, a - b];
                        }
                    }
                    possible && least[0] * most[1] < most[0] * least[1]
                };
                let case = || format!("trial {trial}, pixel {x}, {y} at {ends:?} with the slack {slack}");
                assert!(is_left_out || !near(slack), "{} stays", case());
                assert!(!is_left_out || near(slack + 1), "{} is left out", case());
                let is_in = (x0..=x1).contains(&(x / SIDE)) && (y0..=y1).contains(&(y / SIDE));
                assert!(is_in || !is_left_out, "{} is in no tile of {x0}, {x1}, {y0}, {y1}", case());
                counts[usize::from(is_left_out)] += 1;
            }
        }
        assert!(counts.iter().all(|&count| count > 30_000), "{counts:?} pixels stay and are left out");
    }

    /// Each quarter of a tile within the slack of a triangle, or of its part with four corners, and no other
    /// quarter, is lowered to the least depth key of the plane in the quarter, or to the farthest corner's.
    #[test]
    fn quarters_within_the_slack_of_a_triangle_are_lowered() {
        let (mut random, mut counts) = (random(23), [0; 2]);
        for trial in 0..3_000 {
            let mut cells = ContourTiles::new(&Tiles::new(40, 24));
            let slack = random(0.0, 256.0) as i128 * i128::from(trial % 3 != 0);
            let reach = [4.0, 30.0, 400.0][random(0.0, 3.0) as usize];
            let middle = [random(-10.0, 50.0), random(-10.0, 34.0)];
            let [p, q, r]: [Spot; 3] =
                core::array::from_fn(|_| middle.map(|at| coordinate(&mut random, at - reach, at + reach)));
            let polygon = [p, q, [q[0] + r[0] - p[0], q[1] + r[1] - p[1]], r];
            let polygon = if trial % 2 == 0 { &polygon[..] } else { &[p, q, r] };
            // Steep planes, planes that are nearly flat, and one that is exactly so.
            let size = [0.1, 1e-4, 0.0][random(0.0, 3.0) as usize];
            let [a, b, c] = [random(-size, size), random(-size, size), random(300.0, 600.0)];
            let plane = |x: f64, y: f64| a * x + b * y + c;
            let corners: Vec<ScreenVertex> = polygon
                .iter()
                .map(|&corner| {
                    let corner = vertex(corner);
                    ScreenVertex { far: lower(plane(corner.x, corner.y)), ..corner }
                })
                .collect();
            let floor = corners.iter().fold(f32::INFINITY, |floor, corner| floor.min(corner.far));
            let mut raster = ContourRaster::new(&mut cells, 5, [40.0, 24.0], slack as f64 / 256.0 + ROUNDING);
            raster.lower_depth_keys(&corners, || [a, b, c]);
            let extent = |axis: usize| {
                let all = polygon.iter().map(|corner| corner[axis]);
                let (low, high) = (all.clone().min().unwrap_or(0), all.max().unwrap_or(0));
                (high + slack).min([40, 24][axis] * UNITS) - (low - slack).max(0)
            };
            // All quarters of the box around a triangle that is small in the buffer are lowered.
            let is_small = extent(0).max(extent(1)) <= 16 * UNITS;
            for (x, y) in (0..6).flat_map(|y| (0..10).map(move |x| (x, y))) {
                let near = |by: i128| {
                    let low = [x, y].map(|v| v as i128 * 4 * UNITS - by);
                    let high = low.map(|v| v + 4 * UNITS + 2 * by);
                    let middle = [0, 1].map(|axis| (low[axis] + high[axis]) / 2);
                    edges(polygon).any(|[a, b]| meets(a, b, low, high)) || winding(polygon, middle) != 0
                };
                let key = cells.cells[y / 2 * 5 + x / 2].least[y % 2 * 2 + x % 2];
                let case = || format!("trial {trial}, quarter {x}, {y} of {polygon:?}, slack {slack}: {key}");
                let ends =
                    [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]].map(|end| end.map(|v| v as f64 * 4.0));
                let least = ends.iter().fold(f64::INFINITY, |least, end| least.min(plane(end[0], end[1])));
                let limit = least.max(f64::from(floor));
                assert!(!near(slack) || f64::from(key) <= limit, "{} is above {limit}", case());
                if key < f32::INFINITY {
                    assert!(is_small || near(slack + 1), "{} is lowered", case());
                    // Corners that differ by a thousandth count as equally far.
                    let is_close = f64::from(key) >= limit * 0.998 || is_small && key == floor;
                    assert!(is_close, "{} is far below {limit}", case());
                }
                counts[usize::from(key < f32::INFINITY)] += 1;
            }
        }
        assert!(counts.iter().all(|&count| count > 15_000), "{counts:?} quarters are apart and lowered");
    }

    /// Where no triangle is known, a contour covers nothing: there is no bound on depth.
    #[test]
    fn contours_without_triangles_cover_nothing() {
        let tiles = &mut Tiles::new(40, 24);
        let mut cells = ContourTiles::new(tiles);
        let mut raster = ContourRaster::new(&mut cells, 5, [40.0, 24.0], ROUNDING);
        let corners =
            [[-1, -1], [-1, 25], [41, 25], [41, -1]].map(|spot: Spot| vertex(spot.map(|v| v * UNITS)));
        for i in 0..4 {
            raster.contour(&corners[i], &corners[(i + 1) % 4], 1, true);
        }
        raster.lower_depth_keys(
            &[[0, 0], [0, 4], [4, 0]].map(|spot: Spot| vertex(spot.map(|v| v * UNITS))),
            || [0.0; 3],
        );
        raster.merge(tiles);
        for (x, y) in (0..24).flat_map(|y| (0..40).map(move |x| (x, y))) {
            // The triangle, widened for rounding, meets four quarters of the first tile.
            let expected = if x < 8 && y < 8 { 1.0 } else { f32::NEG_INFINITY };
            assert_eq!(tiles.pixel(x, y), expected, "pixel {x}, {y}");
        }
    }
}
