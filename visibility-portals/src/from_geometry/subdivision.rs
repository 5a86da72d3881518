//! The result of dividing space, and the errors.

use alloc::vec::Vec;
use core::fmt;
use visibility_core::cells::Leak;
use visibility_core::{
    cells::{CellGraph, CellGraphError, CellId},
    pvs::{Viewcell, Viewcells},
};

/// Cells, the portals between them, and their bodies.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Subdivision {
    /// Cells and portals.
    pub graph: CellGraph,
    /// The bodies of the cells, in world space; viewcell `i` is that of cell `i`.
    pub viewcells: Vec<Viewcell>,
    /// The cells that touch the boundary of the region that was divided, ascending.
    pub outside: Vec<CellId>,
}

impl Subdivision {
    /// The shortest way, by number of portals, from the cell that a point of the world is in to an outside
    /// cell. On a map that is meant to be closed, it shows where the map is not. `None` if there is no way,
    /// and for a point in no cell. Takes time in proportion to cells and portals.
    pub fn leak(&self, inside: visibility_core::glam::DVec3) -> Option<Leak> {
        let from = Viewcells::new(self.viewcells.iter().cloned())
            .locate(inside)
            .map(|viewcell| CellId(viewcell.0))?;
        self.graph.leak(from, |cell| self.outside.binary_search(&cell).is_ok())
    }
}

/// Why geometry cannot be divided into cells.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum GeometryError {
    /// A coordinate is NaN or infinite.
    NonFinite {
        /// Which wall, polygon or segment, in the order given.
        index: usize,
    },
    /// A box whose greatest corner is less than its least, or a segment that is not along an axis.
    NotAWall {
        /// Which.
        index: usize,
    },
    /// A setting is NaN, infinite, negative, or too small for coordinates of this size.
    Setting {
        /// Name of the setting.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// More cells or portals than a graph can have.
    Graph(CellGraphError),
}

impl fmt::Display for GeometryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NonFinite { index } => write!(f, "a corner of item {index} is not finite"),
            Self::NotAWall { index } => write!(f, "item {index} is not a wall along the axes"),
            Self::Setting { what, value } => write!(f, "{what} cannot be {value}"),
            Self::Graph(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for GeometryError {}

impl From<CellGraphError> for GeometryError {
    fn from(error: CellGraphError) -> Self {
        Self::Graph(error)
    }
}

/// A setting that must be finite and not negative.
pub(super) fn checked(what: &'static str, value: f64) -> Result<f64, GeometryError> {
    if value >= 0.0 && value.is_finite() { Ok(value) } else { Err(GeometryError::Setting { what, value }) }
}
