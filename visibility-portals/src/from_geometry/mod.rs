//! Cells and portals made from geometry.
//!
//! - [`from_walls`] divides space by a kd-tree along the larger walls, for buildings along the axes and for floor plans.
//! - [`from_polygons`] divides it by a BSP tree along the planes of polygons, for everything else.
//!
//! # What is promised
//! Both are conservative: no line that stays farther than the tolerance from all polygons is ever stopped, wherever the cells are. What is opaque is
//! what polygons surely cover; where they leave a gap, the gap is open, and a portal. Polygons too small to divide space by cover nothing but
//! what lies in a plane that was chosen for other reasons. So more and smaller cells make a tighter answer, never a wrong one.
//!
//! Portals narrower than the tolerance are left out: a line through one passes within the tolerance of the portal's edges.

mod bsp;
mod join;
mod kd;
mod leaves;
mod subtract;

pub use bsp::{PolygonSettings, Solid, from_polygons};
pub use kd::{WallSettings, floor_plan, from_walls};

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
    /// A way from the cell that a point is in to the outside, if there is one: where a map is meant to be closed, the portals on it
    /// lead to the leak. `None` as well for a point in no cell. Takes time in proportion to cells and portals.
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
fn checked(what: &'static str, value: f64) -> Result<f64, GeometryError> {
    if value >= 0.0 && value.is_finite() { Ok(value) } else { Err(GeometryError::Setting { what, value }) }
}
