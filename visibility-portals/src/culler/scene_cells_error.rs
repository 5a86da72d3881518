//! Errors of `SceneCells`.

use super::mirror::MirrorId;
use core::fmt;
use visibility_core::cells::{CellId, PortalId};

/// Why [`SceneCells`](super::scene_cells::SceneCells) cannot be made or changed.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum SceneCellsError {
    /// The number of viewcells is not that of the cells.
    Viewcells {
        /// How many cells.
        cells: usize,
        /// How many viewcells.
        viewcells: usize,
    },
    /// The tolerance is negative, infinite or NaN.
    Tolerance(f64),
    /// The PVS has other counts than the graph, or its targets are objects.
    Pvs {
        /// How many cells.
        cells: usize,
        /// How many viewcells the sets have.
        viewcells: usize,
        /// How many targets they have.
        targets: usize,
    },
    /// The graph has no such cell.
    UnknownCell(CellId),
    /// The graph has no such portal.
    UnknownPortal(PortalId),
    /// No such mirror was added.
    UnknownMirror(MirrorId),
    /// The mirror has no area.
    NoPlane,
}

impl fmt::Display for SceneCellsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Viewcells { cells, viewcells } => {
                write!(f, "{viewcells} viewcells for {cells} cells: each cell needs one")
            }
            Self::Tolerance(tolerance) => write!(f, "the tolerance cannot be {tolerance}"),
            Self::Pvs { cells, viewcells, targets } => write!(
                f,
                "sets of {viewcells} viewcells and {targets} targets are not those of {cells} cells from cells"
            ),
            Self::UnknownCell(cell) => write!(f, "there is no cell {}", cell.0),
            Self::UnknownPortal(portal) => write!(f, "there is no portal {}", portal.0),
            Self::UnknownMirror(mirror) => write!(f, "there is no mirror {}", mirror.0),
            Self::NoPlane => write!(f, "the mirror has no area"),
        }
    }
}

impl core::error::Error for SceneCellsError {}
