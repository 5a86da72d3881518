//! Rasters of heights, and what is refused of them.

use core::fmt;

/// Greatest magnitude of a height, in world units. Beyond it products could overflow.
pub(super) const GREATEST_HEIGHT: f64 = 1e60;

/// Heights at the points of a grid, row after row, borrowed from the caller.
#[derive(Clone, Copy, Debug)]
pub struct HeightRaster<'a, T> {
    heights: &'a [T],
    rows: usize,
    columns: usize,
    cell: [f64; 2],
}

/// Errors of making a [`HeightRaster`] and of [`Viewshed::look`](super::Viewshed::look).
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum ViewshedError {
    /// The number of heights, or of results, is not that of the raster's samples; or there are fewer than two
    /// rows or columns.
    Count {
        /// Number of values given.
        given: usize,
        /// Number of rows.
        rows: usize,
        /// Number of columns.
        columns: usize,
    },
    /// A distance between samples is no number in 1e-30 to 1e30.
    Cell {
        /// Distances given, between rows and between columns, in world units.
        cell: [f64; 2],
    },
    /// The observer is not over the raster, or the ground there has no height.
    Observer {
        /// Position given, as fractional row and column.
        position: [f64; 2],
    },
    /// The observer's height or the target height is no number in 0 to 1e60, or the curvature none in -1e60
    /// to 1e60.
    Height {
        /// The number given.
        height: f64,
    },
    /// The greatest distance is NaN or negative.
    Distance {
        /// The number given, in world units.
        distance: f64,
    },
}

impl<'a, T: Copy + Into<f64>> HeightRaster<'a, T> {
    /// Makes a raster of `rows` times `columns` heights in world units. `cell` holds the distance between
    /// rows and that between columns, in world units. A height that is NaN, infinite or above 1e60 in
    /// absolute
    /// value is missing: its sample is never visible, and it and the edges at it hide nothing.
    ///
    /// # Errors
    /// [`ViewshedError::Count`] if there are not `rows * columns` heights, or fewer than two rows or
    /// columns; [`ViewshedError::Cell`] if
    /// a distance is no number in 1e-30 to 1e30.
    pub fn new(heights: &'a [T], rows: usize, columns: usize, cell: [f64; 2]) -> Result<Self, ViewshedError> {
        if rows < 2 || columns < 2 || rows.checked_mul(columns) != Some(heights.len()) {
            return Err(ViewshedError::Count { given: heights.len(), rows, columns });
        }
        if !cell.iter().all(|side| (1e-30..=1e30).contains(side)) {
            return Err(ViewshedError::Cell { cell });
        }
        Ok(Self { heights, rows, columns, cell })
    }

    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Returns the number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Returns the distance between rows and that between columns, in world units.
    pub fn cell(&self) -> [f64; 2] {
        self.cell
    }

    /// Returns the height of a sample in world units, or `None` if it is missing or there is no such sample.
    pub fn height(&self, row: usize, column: usize) -> Option<f64> {
        if column >= self.columns {
            return None;
        }
        let height: f64 = (*self.heights.get(row.checked_mul(self.columns)?.checked_add(column)?)?).into();
        (height.abs() <= GREATEST_HEIGHT).then_some(height)
    }
}

impl fmt::Display for ViewshedError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Count { given, rows, columns } => {
                write!(
                    f,
                    "{given} values for {rows} rows of {columns} samples; at least 2 by 2 are a surface"
                )
            }
            Self::Cell { cell: [rows, columns] } => {
                write!(f, "a cell of {rows:?} by {columns:?}: its sides must be numbers in 1e-30 to 1e30")
            }
            Self::Observer { position: [row, column] } => write!(
                f,
                "the observer at row {row:?}, column {column:?} is not over the raster, or there is no ground"
            ),
            Self::Height { height } => {
                write!(f, "the height or curvature {height:?} is negative, or no number up to 1e60")
            }
            Self::Distance { distance } => {
                write!(f, "the greatest distance {distance:?} is not a number of at least 0")
            }
        }
    }
}

impl core::error::Error for ViewshedError {}
