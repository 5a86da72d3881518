//! The result of dividing space into cells, and its errors.

use crate::{SceneCells, SceneCellsError};
use alloc::vec::Vec;
use core::fmt;
use visibility_core::cells::Leak;
use visibility_core::{
    cells::{CellGraph, CellGraphError, CellId},
    glam::DVec3,
    pvs::Viewcells,
};

/// The result of dividing space: cells, the portals between them, and the volumes of the cells, all in world
/// space.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Subdivision {
    /// The graph of cells and portals, with portal polygons in world space.
    pub graph: CellGraph,
    /// Volumes of the cells, in world space; viewcell `i` is the volume of cell `i`. They are
    /// [of the divided box](Viewcells::of_divided_box) and misplaced by no more than the tolerance.
    pub viewcells: Viewcells,
    /// Cells that touch the boundary of the divided region, in ascending order.
    pub outside: Vec<CellId>,
}

impl Subdivision {
    /// Returns the path with the fewest portals from the cell that contains the point `inside` (world space)
    /// to an outside cell. On a map that is meant to be closed, the path shows the hole. `None` if no path
    /// leads outside, or if the point lies in no cell. Takes time proportional to the number of cells and
    /// portals.
    pub fn leak(&self, inside: DVec3) -> Option<Leak> {
        let from = self.viewcells.locate(inside).map(|viewcell| CellId(viewcell.0))?;
        self.graph.leak(from, |cell| self.outside.binary_search(&cell).is_ok())
    }

    /// Makes the cells that portal cullers share, with the [usual tolerance](SceneCells::usual_tolerance).
    ///
    /// # Errors
    /// The errors of [`SceneCells::new`].
    pub fn into_scene_cells(self) -> Result<SceneCells, SceneCellsError> {
        let tolerance = SceneCells::usual_tolerance(&self.viewcells);
        SceneCells::new(self.graph, self.viewcells, tolerance)
    }
}

/// Reason why `from_walls`, `from_polygons` or `floor_plan` fails.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum GeometryError {
    /// A coordinate is NaN or infinite.
    Coordinate {
        /// Index of the wall, polygon or segment in the input.
        index: usize,
    },
    /// A box whose minimum corner exceeds its maximum corner along an axis, or a segment of a floor plan that
    /// is parallel to no axis.
    NotAxial {
        /// Index of the wall or segment in the input.
        index: usize,
    },
    /// A setting is NaN, infinite, negative, or too small for coordinates of this size.
    Setting {
        /// Name of the setting, as in "the tolerance".
        what: &'static str,
        /// Value that was refused.
        value: f64,
    },
    /// The number of cells or portals exceeds the limits of a graph.
    Graph(CellGraphError),
}

impl fmt::Display for GeometryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Coordinate { index } => write!(f, "a corner of item {index} is not finite"),
            Self::NotAxial { index } => write!(f, "item {index} is not a wall along the axes"),
            Self::Setting { what, value } => write!(f, "{what} cannot be {value}"),
            Self::Graph(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for GeometryError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Graph(error) => Some(error),
            _ => None,
        }
    }
}

impl From<CellGraphError> for GeometryError {
    fn from(error: CellGraphError) -> Self {
        Self::Graph(error)
    }
}

/// Greatest coordinate. The squared area of a portal between greater ones would overflow, and the portal be
/// no polygon.
const MAX_COORDINATE: f64 = 1e76;

/// Checks the greatest absolute coordinate of cells.
pub(super) fn checked_extent(extent: f64) -> Result<(), GeometryError> {
    let is_good = extent <= MAX_COORDINATE;
    is_good.then_some(()).ok_or(GeometryError::Setting { what: "the greatest coordinate", value: extent })
}

/// Returns `value` if it is finite and not negative.
///
/// # Errors
/// [`GeometryError::Setting`] with the name `what` otherwise.
pub(super) fn checked(what: &'static str, value: f64) -> Result<f64, GeometryError> {
    if value >= 0.0 && value.is_finite() { Ok(value) } else { Err(GeometryError::Setting { what, value }) }
}
