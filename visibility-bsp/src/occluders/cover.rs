//! Maximal rectangles in a group of axis-aligned rectangles of one plane.
//!
//! The sides of the rectangles make a grid. All maximal rectangles of covered cells (those that no other
//! contains) are found row by row, as the largest rectangles under a histogram are. Of these, the ones that
//! add most area are taken greedily until all cells are covered.

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

    /// Returns the length in metres of column `index` (axis 0) or row `index` (axis 1).
    fn size(&self, axis: usize, index: usize) -> f64 {
        self.lines[axis][index + 1] - self.lines[axis][index]
    }
}

/// Joins a connected group of rectangles: calls `each` with the minimum corner, the maximum corner and the
/// sources (ascending) of up to 64 larger rectangles within the group's area, greatest added area first.
/// Corners are in metres along the plane's two axes. Beyond 64, a remainder of the area stays uncovered. A
/// single rectangle, or a group whose grid has more than 16,384 cells, is passed on unchanged.
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
    // The area in square metres that a rectangle adds to those taken, and its whole area.
    let measure = |number: u32, open: &[bool]| {
        let [from, to, low, high] = rectangles[number as usize];
        let (mut new, mut all) = (0.0, 0.0);
        for row in low..high {
            for column in from..to {
                work::step();
                let area = grid.size(0, column) * grid.size(1, row);
                all += area;
                if open[grid.cell(column, row)] {
                    new += area;
                }
            }
        }
        (new, all)
    };
    let mut candidates: BinaryHeap<Candidate> = (0..rectangles.len() as u32)
        .map(|number| {
            let (gain, tie_break) = measure(number, &open);
            Candidate { gain, tie_break, number, evaluated_at: 0 }
        })
        .collect();
    let mut taken = 0;
    while taken < MAX_PICKS
        && let Some(best) = candidates.pop()
    {
        // The added area of a rectangle only shrinks as others are taken.
        if best.evaluated_at < taken {
            let (gain, _) = measure(best.number, &open);
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
                open[grid.cell(column, row)] = false;
            }
        }
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
}
