//! Why the cells of a scene cannot be made, or know no such thing.

use super::mirror::MirrorId;
use core::fmt;
use visibility_core::{CellId, PortalId};

/// Why cells, portals and what belongs to them cannot be used.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum SceneCellsError {
    /// Not as many viewcells as there are cells.
    Viewcells {
        /// How many cells.
        cells: usize,
        /// How many viewcells.
        viewcells: usize,
    },
    /// The tolerance is not a number from zero up.
    Tolerance(f64),
    /// Sets of something else, or of another number of cells.
    Pvs {
        /// How many cells.
        cells: usize,
        /// How many viewcells the sets have.
        viewcells: usize,
        /// How many targets they have.
        targets: usize,
    },
    /// There is no such cell.
    UnknownCell(CellId),
    /// There is no such portal.
    UnknownPortal(PortalId),
    /// There is no such mirror.
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
