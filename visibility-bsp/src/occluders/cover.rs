//! Maximal rectangles in a group of axis-aligned rectangles of one plane.
//!
//! The sides of the rectangles make a grid. All maximal rectangles of covered cells (those that no other
//! contains) are found row by row, as the largest rectangles under a histogram are. Of these, the ones that
//! add most area are taken greedily until all cells are covered. Areas come from sums over all cells left of
//! and above each corner of the grid (Crow, "Summed-Area Tables for Texture Mapping", 1984), since there may
//! be as many maximal rectangles as cells.

use super::overlaps::Rectangle;
use super::work;
use crate::lazy_queue::Candidate;
use alloc::collections::BinaryHeap;
use alloc::vec::Vec;

/// Maximum number of cells in the grid of a group of connected rectangles. The rectangles of a group with
/// more cells are not joined.
const MAX_CELLS: usize = 1 << 14;
/// Maximum number of joined rectangles made from one group of connected rectangles.
const MAX_PICKS: u32 = 64;

/// A grid whose lines are the sides of a group's rectangles, with the cells that the group covers.
/// Coordinates are in metres along the two axes of the rectangles' plane.
struct Grid {
    /// Coordinates of the lines between columns (entry 0) and between rows (entry 1), ascending, each once.
    lines: [Vec<f64>; 2],
    /// By cell, row by row: true if some rectangle of the group covers the cell, false if none does.
    filled: Vec<bool>,
}

impl Grid {
    /// Builds the grid of a group of rectangles of one plane and marks the covered cells. `None` if the grid
    /// has more than [`MAX_CELLS`] cells.
    fn new(group: &[&Rectangle]) -> Option<Self> {
        let lines = [0, 1].map(|i| {
            let mut lines: Vec<f64> = group.iter().flat_map(|r| [r.low[i], r.high[i]]).collect();
            lines.sort_unstable_by(f64::total_cmp);
            lines.dedup();
            lines
        });
        let cells = (lines[0].len() - 1).checked_mul(lines[1].len() - 1)?;
        if cells > MAX_CELLS {
            return None;
        }
        let mut grid = Self { lines, filled: alloc::vec![false; cells] };
        // By row and column: number of rectangles that begin there minus number that end. Prefix sums of
        // these are the numbers of rectangles that cover each cell.
        let width = grid.columns() + 1;
        let mut layers = alloc::vec![0i32; width * (grid.rows() + 1)];
        for rectangle in group {
            work::step();
            let [columns, rows] = grid.range(rectangle.low, rectangle.high);
            for (row, sign) in [(rows.start, 1), (rows.end, -1)] {
                layers[row * width + columns.start] += sign;
                layers[row * width + columns.end] -= sign;
            }
        }
        for row in 0..grid.rows() {
            let mut sum = 0;
            for column in 0..width {
                sum += layers[row * width + column];
                let above = if row == 0 { 0 } else { layers[(row - 1) * width + column] };
                layers[row * width + column] = above + sum;
                if column + 1 < width {
                    let cell = grid.cell(column, row);
                    grid.filled[cell] = above + sum > 0;
                }
            }
        }
        Some(grid)
    }

    /// Returns the number of columns of cells in the grid.
    fn columns(&self) -> usize {
        self.lines[0].len() - 1
    }

    /// Returns the number of rows of cells in the grid.
    fn rows(&self) -> usize {
        self.lines[1].len() - 1
    }

    /// Returns the index in `filled` of a cell.
    fn cell(&self, column: usize, row: usize) -> usize {
        row * self.columns() + column
    }

    /// Returns the half-open range of columns and then that of rows of the rectangle from corner `low` to
    /// corner `high`. The corners are in metres along the plane's two axes, and must lie on grid lines.
    fn range(&self, low: [f64; 2], high: [f64; 2]) -> [core::ops::Range<usize>; 2] {
        [0, 1].map(|i| {
            let line_index = |x: f64| self.lines[i].partition_point(|&line| line < x);
            line_index(low[i])..line_index(high[i])
        })
    }

    /// Returns every maximal rectangle of covered cells as `[first column, end column, first row, end row]`
    /// (ends exclusive), sorted by first row, then end row, then first column.
    fn largest(&self) -> Vec<[usize; 4]> {
        let (columns, rows) = (self.columns(), self.rows());
        let mut found = Vec::new();
        // By column: number of consecutive covered cells from this row upwards.
        let mut heights = alloc::vec![0usize; columns];
        // By column: number of covered cells in the row below, up to the column.
        let mut filled_below = alloc::vec![0usize; columns + 1];
        // Rectangles that end in this row and still grow to the right, as first column and height; heights
        // ascend.
        let mut open: Vec<(usize, usize)> = Vec::new();
        for row in 0..rows {
            for column in 0..columns {
                work::step();
                heights[column] = if self.filled[row * columns + column] { heights[column] + 1 } else { 0 };
                let below = row + 1 < rows && self.filled[(row + 1) * columns + column];
                filled_below[column + 1] = filled_below[column] + usize::from(below);
            }
            for column in 0..=columns {
                let height = heights.get(column).copied().unwrap_or(0);
                let mut first = column;
                while let Some(&(start, tall)) = open.last()
                    && tall >= height
                {
                    open.pop();
                    first = start;
                    // A rectangle that continues in the row below is found there.
                    if tall > height && filled_below[column] - filled_below[start] < column - start {
                        found.push([start, column, row + 1 - tall, row + 1]);
                    }
                }
                if height > 0 {
                    open.push((first, height));
                }
            }
        }
        found.sort_unstable_by_key(|&[start, _, from, to]| (from, to, start));
        found
    }

    /// Returns the area in square metres of a rectangle of cells, given as by [`largest`](Self::largest).
    fn area(&self, [from, to, low, high]: [usize; 4]) -> f64 {
        (self.lines[0][to] - self.lines[0][from]) * (self.lines[1][high] - self.lines[1][low])
    }

    /// Replaces `sums` by a summed-area table of the cells for which `open` is true: by corner of the grid,
    /// row by row, the area in square metres of the open cells in lower columns and rows.
    fn sum_up(&self, open: &[bool], sums: &mut Vec<f64>) {
        let width = self.columns() + 1;
        sums.clear();
        sums.resize(width * (self.rows() + 1), 0.0);
        for row in 0..self.rows() {
            let mut sum = 0.0;
            for column in 0..self.columns() {
                work::step();
                if open[self.cell(column, row)] {
                    sum += self.area([column, column + 1, row, row + 1]);
                }
                sums[(row + 1) * width + column + 1] = sums[row * width + column + 1] + sum;
            }
        }
    }

    /// Returns the area in square metres of the open cells of a rectangle, by their [sums](Self::sum_up).
    ///
    /// With at most 2^14 cells it is wrong by less than 2^-30 of the area of all open cells. Some maximal
    /// rectangle has at least a 2^-14th of that area, so that one without open cells is never the greatest.
    /// If no cell is open, all areas are exactly 0.
    fn open_area(&self, [from, to, low, high]: [usize; 4], sums: &[f64]) -> f64 {
        work::step();
        let [a, b, c, d] = [(from, low), (to, low), (from, high), (to, high)]
            .map(|(column, row)| sums[row * (self.columns() + 1) + column]);
        (d - b) - (c - a)
    }
}

/// Joins a connected group of rectangles: calls `each` with the minimum corner, the maximum corner and the
/// sources (ascending) of up to 64 larger rectangles within the group's area, greatest added area first.
/// Corners are in metres along the plane's two axes. Beyond 64, a remainder of the area stays uncovered. A
/// single rectangle, or a group whose grid has more than 16,384 cells, is passed on unchanged. Takes time in
/// proportion to the cells, times the number of rectangles passed on.
pub(super) fn join_group(group: &[&Rectangle], mut each: impl FnMut([f64; 2], [f64; 2], Vec<u32>)) {
    let grid = if group.len() > 1 { Grid::new(group) } else { None };
    let Some(grid) = grid else {
        for r in group {
            each(r.low, r.high, alloc::vec![r.source]);
        }
        return;
    };
    let rectangles = grid.largest();
    let mut open = grid.filled.clone();
    let mut sums = Vec::new();
    // At first a rectangle adds its whole area. Of those that add as much, the larger comes first.
    let mut candidates: BinaryHeap<Candidate> = (0..)
        .zip(&rectangles)
        .map(|(number, &rectangle)| {
            let area = grid.area(rectangle);
            Candidate { gain: area, tie_break: area, number, evaluated_at: 0 }
        })
        .collect();
    let mut taken = 0;
    while taken < MAX_PICKS
        && let Some(best) = candidates.pop()
    {
        // The added area of a rectangle only shrinks as others are taken.
        if best.evaluated_at < taken {
            let gain = grid.open_area(rectangles[best.number as usize], &sums);
            candidates.push(Candidate { gain, evaluated_at: taken, ..best });
            continue;
        }
        if !(best.gain > 0.0) {
            break;
        }
        taken += 1;
        let [from, to, low, high] = rectangles[best.number as usize];
        for row in low..high {
            for column in from..to {
                work::step();
                open[grid.cell(column, row)] = false;
            }
        }
        grid.sum_up(&open, &mut sums);
        let min = [grid.lines[0][from], grid.lines[1][low]];
        let max = [grid.lines[0][to], grid.lines[1][high]];
        let meets = |r: &&&Rectangle| (0..2).all(|i| r.low[i] < max[i] && r.high[i] > min[i]);
        let mut sources: Vec<u32> = group.iter().filter(meets).map(|r| r.source).collect();
        sources.sort_unstable();
        sources.dedup();
        each(min, max, sources);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visibility_testing::steps_of;

    #[test]
    fn the_largest_rectangles_are_those_that_no_full_rectangle_contains() {
        let mut random = visibility_testing::Random(7);
        for round in 0..400 {
            let (columns, rows) = (1 + round % 7, 1 + round / 7 % 7);
            let filled: Vec<bool> = (0..columns * rows).map(|_| !random.one_in(5)).collect();
            let lines = [columns, rows].map(|count| (0..=count).map(|i| i as f64).collect());
            let grid = Grid { lines, filled };
            let full = |[left, right, low, high]: [usize; 4]| {
                (low..high).all(|row| (left..right).all(|column| grid.filled[row * columns + column]))
            };
            let mut expected = Vec::new();
            for (low, high) in (0..rows).flat_map(|low| (low + 1..=rows).map(move |high| (low, high))) {
                for (left, right) in
                    (0..columns).flat_map(|left| (left + 1..=columns).map(move |r| (left, r)))
                {
                    let larger = [
                        (left > 0).then(|| [left - 1, right, low, high]),
                        (right < columns).then_some([left, right + 1, low, high]),
                        (low > 0).then(|| [left, right, low - 1, high]),
                        (high < rows).then_some([left, right, low, high + 1]),
                    ];
                    if full([left, right, low, high]) && !larger.into_iter().flatten().any(full) {
                        expected.push([left, right, low, high]);
                    }
                }
            }
            expected.sort_unstable_by_key(|&[left, _, low, high]| (low, high, left));
            assert_eq!(grid.largest(), expected, "{:?}", grid.filled);
        }
    }

    /// Rows of a wall with holes along two diagonals, as rectangles: the wall has about a quarter as many
    /// maximal rectangles as cells.
    fn wall_with_diagonals_of_holes(size: usize) -> Vec<Rectangle> {
        let half = size / 2;
        let mut rectangles = Vec::new();
        for row in 0..size {
            let hole = match row {
                _ if row < half => half - 1 - row,
                _ if row == half => size,
                _ => half + size - row,
            };
            let parts = [[0, hole.min(size)], [(hole + 1).min(size), size]];
            for [from, to] in parts.into_iter().filter(|[from, to]| from < to) {
                let (low, high) = ([from as f64, row as f64], [to as f64, row as f64 + 1.0]);
                rectangles.push(Rectangle { low, high, source: row as u32 });
            }
        }
        rectangles
    }

    #[test]
    fn steps_grow_as_cells_do() {
        let steps = [64, 90, 127].map(|size| {
            let rectangles = wall_with_diagonals_of_holes(size);
            let group: Vec<&Rectangle> = rectangles.iter().collect();
            let (mut joined, mut area) = (0, 0.0);
            let steps = steps_of(|| {
                join_group(&group, |low, high, _| {
                    joined += 1;
                    area += (high[0] - low[0]) * (high[1] - low[1]);
                });
            });
            assert!(joined <= 64 && area >= (size * size / 2) as f64, "{size} rows: {joined} of {area} m2");
            steps as f64
        });
        std::println!("steps for 64, 90 and 127 rows: {steps:?}");
        // Each wall has twice as many cells as the one before.
        assert!(steps[1] < 2.6 * steps[0] && steps[2] < 2.6 * steps[1], "{steps:?}");
    }

    /// Joined rectangles cover the group and nothing else, and each adds area to those before it.
    #[test]
    fn joined_rectangles_cover_the_group() {
        let mut random = visibility_testing::Random(11);
        for round in 0..200 {
            let side = |random: &mut visibility_testing::Random| {
                let from = random.below(6);
                // Coordinates whose differences and products are rounded.
                [from, from + 1 + random.below(3)].map(|x| x as f64 * 0.3 + 0.1)
            };
            let rectangles: Vec<Rectangle> = (0..8)
                .map(|source| {
                    let [x, y] = [side(&mut random), side(&mut random)];
                    Rectangle { low: [x[0], y[0]], high: [x[1], y[1]], source }
                })
                .collect();
            let group: Vec<&Rectangle> = rectangles.iter().collect();
            let holds = |low: [f64; 2], high: [f64; 2], p: [f64; 2]| {
                (0..2).all(|i| low[i] <= p[i] && p[i] <= high[i])
            };
            let middles: Vec<[f64; 2]> =
                (0..81).map(|i| [i % 9, i / 9].map(|x| f64::from(x) * 0.3 + 0.25)).collect();
            let mut covered = alloc::vec![false; middles.len()];
            join_group(&group, |low, high, _| {
                let mut more = 0;
                for (covered, &p) in covered.iter_mut().zip(&middles) {
                    if holds(low, high, p) {
                        more += usize::from(!core::mem::replace(covered, true));
                    }
                }
                assert!(more > 0, "round {round}: a rectangle that adds nothing");
            });
            for (&covered, &p) in covered.iter().zip(&middles) {
                let expected = group.iter().any(|r| holds(r.low, r.high, p));
                assert_eq!(covered, expected, "round {round}: whether {p:?} is covered");
            }
        }
    }

    /// Returns the joined rectangles of a group, and their sources.
    fn joined(group: &[[[f64; 2]; 2]]) -> Vec<([[f64; 2]; 2], Vec<u32>)> {
        let rectangles: Vec<Rectangle> =
            (0..).zip(group).map(|(source, &[low, high])| Rectangle { low, high, source }).collect();
        let mut found = Vec::new();
        join_group(&rectangles.iter().collect::<Vec<_>>(), |low, high, sources| {
            found.push(([low, high], sources));
        });
        found
    }

    #[test]
    fn joined_rectangles_have_the_sources_of_their_area_alone() {
        let [low, left, corner, far] = [
            [[0.0, 0.0], [4.0, 1.0]],
            [[0.0, 1.0], [1.0, 3.0]],
            [[0.0, 0.0], [1.0, 1.0]],
            [[4.0, 0.0], [5.0, 1.0]],
        ];
        let upright = [[0.0, 0.0], [1.0, 3.0]];
        // What touches a rectangle from beside is no part of it.
        assert_eq!(joined(&[low, left]), [(low, [0].into()), (upright, [0, 1].into())], "an angle");
        assert_eq!(joined(&[left, low]), [(low, [1].into()), (upright, [0, 1].into())], "an angle");
        let wide = [[0.0, 0.0], [5.0, 1.0]];
        assert_eq!(
            joined(&[left, low, corner, far]),
            [(wide, [1, 2, 3].into()), (upright, [0, 1, 2].into())],
            "an angle of four"
        );
        let right = [[3.0, 1.0], [4.0, 3.0]];
        let upright = [[3.0, 0.0], [4.0, 3.0]];
        assert_eq!(
            joined(&[low, right, corner]),
            [(low, [0, 2].into()), (upright, [0, 1].into())],
            "an angle"
        );
        assert_eq!(joined(&[left]), [(left, [0].into())], "a single rectangle");
        // Each covers what the other does: one is enough, of which both are sources.
        assert_eq!(joined(&[left, left]), [(left, [0, 1].into())], "one rectangle twice");
    }

    #[test]
    fn groups_whose_grids_are_too_fine_are_not_joined() {
        // Rectangles from a common corner, each lower and longer than the one before.
        let stairs = |count: usize| -> Vec<[[f64; 2]; 2]> {
            (1..=count).map(|i| [[0.0, 0.0], [i as f64, (count + 1 - i) as f64]]).collect()
        };
        assert_eq!(joined(&stairs(128)).len(), 64, "rectangles of a grid of 2^14 cells");
        let more = stairs(129);
        let found = joined(&more);
        assert_eq!(found.len(), 129, "rectangles of a larger grid");
        for (number, (rectangle, sources)) in (0..).zip(&found) {
            assert_eq!(
                (rectangle, &sources[..]),
                (&more[number as usize], &[number][..]),
                "rectangle {number}"
            );
        }
    }
}
