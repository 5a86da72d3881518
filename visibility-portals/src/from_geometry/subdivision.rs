//! What geometry is divided into, and why it cannot be.

use alloc::vec::Vec;
use core::fmt;
use visibility_core::cells::Leak;
use visibility_core::{CellGraph, CellGraphError, CellId, Viewcell, Viewcells};

/// Cells with the portals between them, and where they are.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Subdivision {
    /// Which cells are joined by which portals.
    pub graph: CellGraph,
    /// The bodies of the cells, by their numbers.
    pub viewcells: Vec<Viewcell>,
    /// The cells that reach to the boundary of all that was divided, ascending: the outside.
    pub outside: Vec<CellId>,
}

impl Subdivision {
    /// A way from the cell that a point is in to the outside, if there is one: where a map is meant to be
    /// closed, the portals on it lead to the leak. `None` as well for a point in no cell. Takes time in
    /// proportion to cells and portals.
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
    /// A corner is NaN or infinite.
    NonFinite {
        /// Which wall, polygon or segment, in the order given.
        index: usize,
    },
    /// A box whose greatest corner is less than its least, or a segment that is not along an axis.
    NotAWall {
        /// Which.
        index: usize,
    },
    /// A setting is not a number that can be worked with.
    Setting {
        /// Which.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// There are too many cells or portals.
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

/// A setting that must be a number from zero on.
pub(super) fn checked(what: &'static str, value: f64) -> Result<f64, GeometryError> {
    if value >= 0.0 && value.is_finite() { Ok(value) } else { Err(GeometryError::Setting { what, value }) }
}
