//! Errors in the input of `SceneCells`.

use super::hung_mirrors::MirrorId;
use core::fmt;
use visibility_core::cells::{CellGraphError, CellId, PortalId};

/// Reason why [`SceneCells`](super::scene_cells::SceneCells) cannot be made or changed.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum SceneCellsError {
    /// The number of viewcells given to `SceneCells::new` differs from the number of cells of the graph.
    Viewcells {
        /// Number of cells of the graph.
        cells: usize,
        /// Number of viewcells given.
        viewcells: usize,
    },
    /// The tolerance, which is the value here, is negative, infinite or NaN.
    Tolerance(f64),
    /// The volumes of a portal's cells do not show which way the portal is wound. The value has the details.
    Graph(CellGraphError),
    /// Portals of the graph passed to `new` were wound the wrong way, and have been turned. A PVS of that
    /// graph would hide visible cells.
    Winding {
        /// First portal that was turned.
        first: PortalId,
        /// Number of portals that were turned.
        count: usize,
    },
    /// The targets of the PVS are not cells, or its number of viewcells or of targets differs from the number
    /// of cells of the graph.
    Pvs {
        /// Number of cells of the graph.
        cells: usize,
        /// Number of viewcells of the PVS.
        viewcells: usize,
        /// Number of targets of the PVS.
        targets: usize,
    },
    /// The PVS was made from another graph, or from an earlier state of it.
    OtherGraph,
    /// The graph has no cell of this index.
    UnknownCell(CellId),
    /// The graph has no portal of this index.
    UnknownPortal(PortalId),
    /// No mirror of this index has been added.
    UnknownMirror(MirrorId),
    /// The polygon of the mirror has no area, so it has no plane.
    NoPlane,
}

impl fmt::Display for SceneCellsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Viewcells { cells, viewcells } => {
                write!(f, "{viewcells} viewcells for {cells} cells: each cell needs one")
            }
            Self::Graph(error) => write!(f, "{error}"),
            Self::Winding { first, count } => write!(
                f,
                "portals that were wound the wrong way, {count} with portal {} the first, are not in the PVS: \
                 turn them in the graph before it is baked",
                first.0
            ),
            Self::Tolerance(tolerance) => write!(f, "the tolerance cannot be {tolerance}"),
            Self::Pvs { cells, viewcells, targets } => write!(
                f,
                "sets of {viewcells} viewcells and {targets} targets are not those of {cells} cells from cells"
            ),
            Self::OtherGraph => {
                write!(f, "the sets were baked from other cells and portals, or earlier ones: bake again")
            }
            Self::UnknownCell(cell) => write!(f, "there is no cell {}", cell.0),
            Self::UnknownPortal(portal) => write!(f, "there is no portal {}", portal.0),
            Self::UnknownMirror(mirror) => write!(f, "there is no mirror {}", mirror.0),
            Self::NoPlane => write!(f, "the mirror has no area"),
        }
    }
}

impl core::error::Error for SceneCellsError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Graph(error) => Some(error),
            _ => None,
        }
    }
}
