//! Ground whose hills occlude: sheets of triangles that face up, in squares of a grid.
//!
//! A *sheet* is a set of triangles that face up and join at edges, each edge between two triangles: hills, a
//! road on them, the roof of a hall. Triangles of different objects join if their corners are bit-identical.
//! A square of the plan that a sheet covers without a border is *unbroken*; it stores the least and the
//! greatest height of the sheet there.
//!
//! # Why a sheet hides
//! Follow the part of a line of sight over unbroken squares, and the point of the sheet below it. At an edge
//! this point passes from one upward triangle to the next, and there are no borders, so its height is
//! continuous. If the line is above the sheet first and below it later, it has crossed a triangle in between,
//! from above, at its front. It does not matter which sheet is the ground: a road under a bridge, two roofs
//! over each other and a ramp that winds over itself are sheets too, because a square's heights are those of
//! all triangles over it.
//!
//! Coarser levels join squares four by four, so that distant squares are large.

use super::frame::UpAxis;
use super::upward_triangles::{GroundObject, Triangle, join, largest, triangles_that_face_up};
use alloc::collections::BTreeMap;
use alloc::vec;
use alloc::vec::Vec;
use visibility_core::Scene;

/// Least difference between the greatest and the least height of a sheet, as a fraction of the lesser side of
/// its bounds on the plan. A floor hides next to nothing.
const MIN_HEIGHT: f64 = 1.0 / 128.0;

/// Wanted number of grid squares in a sheet's bounds on the plan, per triangle of the sheet. A square that a
/// border of the sheet crosses does not occlude, so small squares lose less ground. The side of a square is a
/// power of two, and doubling it leaves a quarter of the squares, so there may be as few as a quarter of the
/// wanted number.
const SQUARES_PER_TRIANGLE: usize = 64;

/// Least and greatest wanted number of grid squares in a sheet's bounds: the number that
/// [`SQUARES_PER_TRIANGLE`] gives is clamped to this range. There may be as few as a quarter of it.
const SQUARES: [usize; 2] = [1 << 10, 1 << 22];

/// Maximum number of levels of squares. Each level joins the squares of the level below four by four.
const LEVELS: usize = 8;

/// Greatest distance on the plan, as a fraction of a square's side, at which a triangle still counts as
/// meeting the square. The errors of a sheet's positions, which [`Sheet::new`] checks, may take a hundredth
/// of it, and those of the points whose squares are looked up nine tenths.
pub(crate) const PAD: f64 = 1e-4;

/// Greatest side of a square in metres, except that it may be up to twice this. Depths of steps are below
/// 2^36 sides, so that their inverses are normal numbers of `f32`.
const MAX_SIDE: f64 = 1e26;

/// Square of the plan: one square of the finest level, or several joined.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Square {
    /// Least height of the sheet over the square in metres, rounded downwards.
    pub(crate) low: f32,
    /// Greatest height of the sheet over the square in metres, rounded upwards.
    pub(crate) high: f32,
    /// Number of the square's list of owners, the objects whose triangles are over the square: the argument
    /// of [`Sheet::owners`]. [`BROKEN`] if the sheet has a border there, or does not cover the square.
    pub(crate) owners: u32,
}

/// Value of [`Square::owners`] for a square that hides nothing: the sheet has a border there, or does not
/// cover the square.
pub(crate) const BROKEN: u32 = u32::MAX;

impl Square {
    const EMPTY: Self = Self { low: f32::INFINITY, high: f32::NEG_INFINITY, owners: BROKEN };
}

/// Squares of one size: `columns` along the plan's x, row by row.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    /// Number of squares along the plan's x.
    pub(crate) columns: usize,
    /// Squares, row by row: the square in column `x` and row `y` is at `y * columns + x`.
    pub(crate) squares: Vec<Square>,
}

/// Heights of a sheet (connected ground that faces up) over the squares of a grid on the plan.
#[derive(Clone, Debug)]
pub(crate) struct Sheet {
    /// Least corner of the first square on the plan, in metres from the scene's origin. A multiple of `side`.
    pub(crate) corner: [f64; 2],
    /// Side of a square of the finest level in metres, a power of two.
    pub(crate) side: f64,
    /// Levels of squares, the finest first: squares of `levels[i]` have a side of `side * 2^i` metres.
    pub(crate) levels: Vec<Level>,
    /// Least height of the ground over all unbroken squares of the finest level, in metres from the scene's
    /// origin. A square is unbroken if the ground covers it without a border.
    pub(crate) bottom: f32,
    /// Greatest height of the ground over all unbroken squares of the finest level, in metres from the
    /// scene's origin.
    pub(crate) top: f32,
    /// For each list of owners (the objects whose triangles meet a square), the exclusive end of its range in
    /// [`objects`](Self::objects). The range begins where that of the list before ends, the first at 0.
    owner_ends: Vec<u32>,
    /// Owners (objects whose triangles meet a square), as indices into [`Terrain::objects`]: all lists that
    /// `owner_ends` delimits, one after another.
    objects: Vec<u32>,
}

/// Sheets of ground of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Terrain {
    pub(crate) sheets: Vec<Sheet>,
    /// Objects with triangles in any of the sheets, in no particular order.
    pub(crate) objects: Vec<GroundObject>,
    /// For each object with triangles in a sheet, by its index in the scene, its position in `objects`.
    places: BTreeMap<usize, u32>,
    /// For each object in `objects`, whether it has changed since the sheets were made. Its triangles then
    /// hide nothing any more.
    lost: Vec<bool>,
}

impl Terrain {
    /// Finds the sheets of the occluders of a scene.
    pub(crate) fn new(scene: &Scene, up: UpAxis) -> Self {
        let (objects, triangles) = triangles_that_face_up(scene, up);
        let borders = join(&triangles);
        let mut sheets: Vec<Sheet> = largest(&triangles, &borders)
            .iter()
            .filter_map(|members| Sheet::new(&triangles, &borders.sides, members))
            .collect();
        // Objects without triangles in a sheet are removed.
        let mut place = vec![u32::MAX; objects.len()];
        let mut kept = Vec::new();
        for object in sheets.iter_mut().flat_map(|sheet| &mut sheet.objects) {
            let to = &mut place[*object as usize];
            if *to == u32::MAX {
                *to = kept.len() as u32;
                kept.push(objects[*object as usize]);
            }
            *object = *to;
        }
        let lost = vec![false; kept.len()];
        let places = kept.iter().zip(0..).map(|(object, place)| (object.id.index(), place)).collect();
        Self { sheets, objects: kept, places, lost }
    }

    /// Records that the object with index `index` in the scene has changed, so that its triangles no longer
    /// occlude.
    pub(crate) fn lose(&mut self, index: usize) {
        if let Some(&place) = self.places.get(&index) {
            self.lost[place as usize] = true;
        }
    }

    /// Returns whether an object, given by its index in `objects`, has changed since the sheets were made.
    pub(crate) fn is_lost(&self, object: usize) -> bool {
        self.lost[object]
    }
}

impl Sheet {
    /// Returns the list of owners with the number `list`, as indices into [`Terrain::objects`]. The owners of
    /// a square are the objects whose triangles are over it.
    pub(crate) fn owners(&self, list: u32) -> &[u32] {
        let list = list as usize;
        let begin = if list == 0 { 0 } else { self.owner_ends[list - 1] as usize };
        &self.objects[begin..self.owner_ends[list] as usize]
    }

    /// Returns the number of different lists of owners (objects whose triangles are over a square).
    pub(crate) fn list_count(&self) -> usize {
        self.owner_ends.len()
    }

    /// Makes the sheet of the triangles whose indices in `triangles` are `members`, by sorting them into the
    /// squares of a grid. `borders` tells of each triangle which of its sides are borders of the sheet.
    /// `None` if the sheet is flat, or if coordinates are too large compared with its extent.
    fn new(triangles: &[Triangle], borders: &[[bool; 3]], members: &[u32]) -> Option<Self> {
        let (mut min, mut max) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let (mut size, mut error) = (0.0f64, 0.0f64);
        members.iter().for_each(|&t| error = error.max(triangles[t as usize].error));
        for corner in members.iter().flat_map(|&t| triangles[t as usize].corners) {
            for axis in 0..2 {
                min[axis] = min[axis].min(corner[axis]);
                max[axis] = max[axis].max(corner[axis]);
            }
            size = corner.iter().fold(size, |size, x| size.max(x.abs()));
        }
        // The side of a square is a power of two, so that computed indices of squares are exact. There are
        // about as many squares as wanted for the number of triangles.
        let wanted = (members.len() * SQUARES_PER_TRIANGLE).clamp(SQUARES[0], SQUARES[1]) as f64;
        let [width, depth] = [max[0] - min[0], max[1] - min[1]];
        let mut side = 1.0f64;
        while width * depth > wanted * side * side && side < MAX_SIDE {
            side *= 2.0;
        }
        while width * depth <= wanted * side * side * 0.25 && side > 1e-30 {
            side *= 0.5;
        }
        // Squares must be much larger than the error of coordinates; otherwise a triangle could be put into a
        // wrong square.
        let error = error + 16.0 * f64::EPSILON * size;
        // False also for NaN and infinite extents.
        let fits = error < 0.01 * PAD * side && width < side * 1e7 && depth < side * 1e7;
        if !fits {
            return None;
        }
        let corner = min.map(|x| floor(x / side) as f64 * side - side);
        let count = |axis: usize| floor((max[axis] - corner[axis]) / side) as usize + 2;
        let (columns, rows) = (count(0), count(1));
        if columns.checked_mul(rows)? > 4 * SQUARES[1] {
            return None;
        }
        let grid = Grid { corner, side, columns, rows };
        let mut squares = vec![Square::EMPTY; columns * rows];
        let mut is_border = vec![false; columns * rows];
        let mut owned: Vec<(u32, u32)> = Vec::new();
        // Each square gets the heights of all triangles that meet it, rounded outwards, and the objects that
        // own them. A square with a border of the sheet hides nothing, since a line of sight could pass the
        // sheet there.
        for &t in members {
            let triangle = &triangles[t as usize];
            let range = HeightRange::new(triangle, error);
            grid.for_each_met(&triangle.corners, PAD, |index, from, to| {
                let [low, high] = range.over(from, to);
                let square = &mut squares[index];
                square.low = square.low.min((low as f32).next_down());
                square.high = square.high.max((high as f32).next_up());
                owned.push((index as u32, triangle.object));
            });
            for (side, _) in borders[t as usize].iter().enumerate().filter(|(_, is_border)| **is_border) {
                let [a, b] = [triangle.corners[side], triangle.corners[(side + 1) % 3]];
                grid.for_each_met(&[a, b, b], 8.0 * PAD, |index, _, _| is_border[index] = true);
            }
        }
        // Equal lists of owners are stored once.
        owned.sort_unstable();
        owned.dedup();
        let mut lists = Lists::default();
        for group in owned.chunk_by(|a, b| a.0 == b.0) {
            let index = group[0].0 as usize;
            let is_finite = squares[index].low.is_finite() && squares[index].high.is_finite();
            if !is_border[index] && is_finite {
                squares[index].owners = lists.number(group.iter().map(|&(_, object)| object).collect());
            }
        }
        let unbroken = || squares.iter().filter(|square| square.owners != BROKEN);
        let bottom = unbroken().map(|square| square.low).fold(f32::INFINITY, f32::min);
        let top = unbroken().map(|square| square.high).fold(f32::NEG_INFINITY, f32::max);
        // A flat sheet hides nothing from eyes above it. If all squares are broken, the test is false too.
        let is_hilly = f64::from(top) - f64::from(bottom) > MIN_HEIGHT * width.min(depth);
        if !is_hilly {
            return None;
        }
        // Coarser levels for distant rings. Each square joins 2 by 2 squares of the level below.
        let mut levels = vec![Level { columns, squares }];
        for _ in 1..LEVELS {
            let last = &levels[levels.len() - 1];
            if last.squares.len() < 16 {
                break;
            }
            let next = last.joined(&mut lists);
            levels.push(next);
        }
        Some(Self { corner, side, levels, bottom, top, owner_ends: lists.ends, objects: lists.objects })
    }
}

impl Level {
    /// Returns the next coarser level, with one square for every four.
    fn joined(&self, lists: &mut Lists) -> Self {
        let rows = self.squares.len() / self.columns;
        let columns = self.columns.div_ceil(2);
        let mut known: BTreeMap<[u32; 4], u32> = BTreeMap::new();
        let mut squares = Vec::with_capacity(columns * rows.div_ceil(2));
        for row in 0..rows.div_ceil(2) {
            for column in 0..columns {
                let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| {
                    let (x, y) = (2 * column + dx, 2 * row + dy);
                    let is_there = x < self.columns && y < rows;
                    if is_there { self.squares[y * self.columns + x] } else { Square::EMPTY }
                });
                let owners = four.map(|square| square.owners);
                squares.push(Square {
                    low: four.iter().map(|s| s.low).fold(f32::INFINITY, f32::min),
                    high: four.iter().map(|s| s.high).fold(f32::NEG_INFINITY, f32::max),
                    owners: match owners {
                        [a, b, c, d] if a == b && b == c && c == d => a,
                        _ if owners.contains(&BROKEN) => BROKEN,
                        _ => *known.entry(owners).or_insert_with(|| lists.union(owners)),
                    },
                });
            }
        }
        Self { columns, squares }
    }
}

/// Lists of owners (the objects whose triangles are over a square) of a sheet under construction. Equal lists
/// are stored once.
#[derive(Default)]
struct Lists {
    /// For each list, the exclusive end of its range in `objects`. The range begins where that of the list
    /// before ends, the first at 0.
    ends: Vec<u32>,
    /// Indices of the objects of all lists, one list after another, ascending within a list.
    objects: Vec<u32>,
    /// Number of each list, its index in `ends`, by the list's objects.
    numbers: BTreeMap<Vec<u32>, u32>,
}

impl Lists {
    /// Returns the number of a list of owners, given by ascending indices of objects. Stores the list if it
    /// is new.
    fn number(&mut self, list: Vec<u32>) -> u32 {
        if let Some(&number) = self.numbers.get(&list) {
            return number;
        }
        self.objects.extend_from_slice(&list);
        let number = self.ends.len() as u32;
        self.ends.push(self.objects.len() as u32);
        self.numbers.insert(list, number);
        number
    }

    /// Returns the number of the union of four lists of owners, given by their numbers. Stores the union if
    /// it is new.
    fn union(&mut self, four: [u32; 4]) -> u32 {
        let mut all = Vec::new();
        for list in four {
            let begin = if list == 0 { 0 } else { self.ends[list as usize - 1] as usize };
            all.extend_from_slice(&self.objects[begin..self.ends[list as usize] as usize]);
        }
        all.sort_unstable();
        all.dedup();
        self.number(all)
    }
}

/// Layout of the squares of a sheet's finest level, row by row.
struct Grid {
    /// Least corner of the first square on the plan, in metres from the scene's origin.
    corner: [f64; 2],
    /// Side of a square in metres.
    side: f64,
    /// Number of squares along the plan's x.
    columns: usize,
    /// Number of squares along the plan's y.
    rows: usize,
}

impl Grid {
    /// Calls `each` with each square that a triangle meets on the plan, when the square is enlarged by `pad`
    /// times its side in all directions. The arguments are the square's index, row by row, and the least and
    /// greatest coordinates of the enlarged square in metres from the scene's origin. Possibly also called
    /// with squares slightly farther away.
    fn for_each_met(
        &self,
        corners: &[[f64; 3]; 3],
        pad: f64,
        mut each: impl FnMut(usize, [f64; 2], [f64; 2]),
    ) {
        let at = |axis: usize| corners.map(|c| (c[axis] - self.corner[axis]) / self.side);
        let (x, y) = (at(0), at(1));
        let least = |of: [f64; 3]| of[0].min(of[1]).min(of[2]) - pad;
        let most = |of: [f64; 3]| of[0].max(of[1]).max(of[2]) + pad;
        let range = |of: [f64; 3], count: usize| {
            let last = count as i64 - 1;
            floor(least(of)).clamp(0, last) as usize..=floor(most(of)).clamp(0, last) as usize
        };
        for row in range(y, self.rows) {
            for column in range(x, self.columns) {
                let (cx, cy) = (column as f64 + 0.5, row as f64 + 0.5);
                // A side of the triangle with the whole square on its outer side separates the two. The bound
                // on rounding is generous, since sides are shorter than 1e7 squares.
                let is_apart = (0..3).any(|i| {
                    let j = (i + 1) % 3;
                    let (dx, dy) = (x[j] - x[i], y[j] - y[i]);
                    let across = dx * (cy - y[i]) - dy * (cx - x[i]);
                    let reach = (dx.abs() + dy.abs()) * (0.5 + 2.0 * pad);
                    // A border edge is a triangle without area, which both of its sides can separate from a
                    // square.
                    let is_segment = x[1] == x[2] && y[1] == y[2];
                    across < -reach || is_segment && across > reach
                });
                if !is_apart {
                    let low = |i: usize, axis: usize| self.corner[axis] + (i as f64 - pad) * self.side;
                    let high = |i: usize, axis: usize| self.corner[axis] + (i as f64 + 1.0 + pad) * self.side;
                    let (from, to) = ([low(column, 0), low(row, 1)], [high(column, 0), high(row, 1)]);
                    each(row * self.columns + column, from, to);
                }
            }
        }
    }
}

/// Bounds of a triangle's height over rectangles of the plan.
struct HeightRange {
    low: f64,
    high: f64,
    /// Least coordinates of the triangle on the plan.
    min: [f64; 2],
    /// Greatest coordinates of the triangle on the plan.
    max: [f64; 2],
    /// First corner of the triangle (on the plan, then its height), and the slopes of the height along the
    /// plan's two axes, in metres per metre. `None` if the triangle is too narrow or too steep for accurate
    /// slopes.
    plane: Option<([f64; 3], [f64; 2])>,
    /// Bound in metres on the error of a height taken from `plane`.
    slack: f64,
}

impl HeightRange {
    /// Makes the range of a triangle. `error` bounds in metres the distance of its corners from the exact
    /// ones.
    fn new(triangle: &Triangle, error: f64) -> Self {
        let [a, b, c] = triangle.corners;
        let least = |axis: usize| a[axis].min(b[axis]).min(c[axis]);
        let most = |axis: usize| a[axis].max(b[axis]).max(c[axis]);
        let (u, v) = ([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]);
        let area = u[0] * v[1] - u[1] * v[0];
        let gradient = [(u[2] * v[1] - v[2] * u[1]) / area, (v[2] * u[0] - u[2] * v[0]) / area];
        let steepness = gradient[0].abs() + gradient[1].abs();
        // A triangle is wide if its least altitude is more than a thousandth of its longest side. If a corner
        // moves by the error, the plane then moves, within the triangle's bounds, by less than four thousand
        // times the error, multiplied by the steepness for errors on the plan.
        let longest = (most(0) - least(0)).max(most(1) - least(1));
        let is_wide = area > 2e-3 * longest * longest && steepness < 1e3;
        Self {
            low: least(2) - error,
            high: most(2) + error,
            min: [least(0) - error, least(1) - error],
            max: [most(0) + error, most(1) + error],
            plane: is_wide.then_some((a, gradient)),
            slack: 1e4 * error * (1.0 + steepness),
        }
    }

    /// Returns bounds of the triangle's height over a rectangle that the triangle meets.
    fn over(&self, from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
        let Some((a, gradient)) = self.plane else { return [self.low, self.high] };
        let (mut low, mut high) = (a[2] - self.slack, a[2] + self.slack);
        for axis in 0..2 {
            let ends = [from[axis].max(self.min[axis]) - a[axis], to[axis].min(self.max[axis]) - a[axis]];
            let [p, q] = ends.map(|end| end * gradient[axis]);
            (low, high) = (low + p.min(q), high + p.max(q));
        }
        [low.max(self.low), high.min(self.high)]
    }
}

/// Returns the greatest whole number that is not greater than `x`. `x` must be below 1e15 in magnitude.
pub(crate) fn floor(x: f64) -> i64 {
    let whole = x.clamp(-1e15, 1e15) as i64;
    whole - i64::from(whole as f64 > x)
}

#[cfg(test)]
mod tests;
