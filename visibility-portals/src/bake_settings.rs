//! Settings and errors of both bakers, and the portals made ready for them.

use crate::directed_portals::DirectedPortals;
use core::fmt;
use visibility_core::cells::CellGraph;

/// Settings of [`CellBaker`](crate::CellBaker) and [`ObjectBaker`](crate::ObjectBaker).
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Settings {
    /// The distance, in world units, that a line must keep from all portal edges to count: a cell is called
    /// hidden only if no such line leads to it. At least 2^-33 of the greatest coordinate, so that rounding
    /// cannot matter.
    pub clearance: f64,
    /// The most chains of portals to look at for one cell. A cell that needs more sees all that is not yet
    /// proven hidden.
    pub steps_per_cell: u64,
    /// Whether chains of portals that separating planes do not exclude are also tested in Pluecker space,
    /// where that decides whether a cell is seen. Sees fewer cells or the same, for somewhat more time.
    ///
    /// Each rejection is certain: a certificate shows that no line passes certain edges of the chain clear
    /// by the clearance. What is kept need not be visible: half-spaces with a point in common may still
    /// miss the quadric of lines (see [`stabbing`](crate::stabbing)), and what they have in common may
    /// be too little for `f64` to tell.
    pub exact: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { clearance: 1e-6, steps_per_cell: u64::MAX, exact: false }
    }
}

impl Settings {
    /// The settings as numbers, for a fingerprint.
    pub(crate) fn numbers(&self) -> [u64; 3] {
        [self.clearance.to_bits(), self.steps_per_cell, self.exact.into()]
    }
}

/// Why a bake cannot begin.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum BakeError {
    /// The clearance is not a positive number, or too small for coordinates of this size.
    Clearance {
        /// The clearance asked for.
        clearance: f64,
        /// The least that the coordinates allow.
        least: f64,
    },
    /// More than 65,536 cells or portals: the bits of all pairs of portals would take more than 2 GiB.
    TooLarge {
        /// How many cells.
        cells: usize,
        /// How many portals.
        portals: usize,
    },
    /// The matrix has another number of cells than the graph.
    Cells {
        /// Cells of the graph.
        graph: usize,
        /// Cells of the matrix.
        matrix: usize,
    },
}

impl fmt::Display for BakeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Clearance { clearance, least } => {
                write!(
                    f,
                    "a clearance of {clearance} is less than {least}, the least for coordinates of this size"
                )
            }
            Self::TooLarge { cells, portals } => {
                write!(f, "{cells} cells and {portals} portals are more than {MOST} of either")
            }
            Self::Cells { graph, matrix } => {
                write!(f, "a matrix of {matrix} cells, where the graph has {graph}")
            }
        }
    }
}

impl core::error::Error for BakeError {}

/// The most cells or portals of a bake: the bits of all pairs of portals then take 2 GiB.
const MOST: usize = 1 << 16;

/// Checks the settings and makes the portals ready.
pub(crate) fn prepare(graph: &CellGraph, settings: &Settings) -> Result<DirectedPortals, BakeError> {
    let (cells, count) = (graph.cell_count(), graph.portals().len());
    if cells > MOST || count > MOST {
        return Err(BakeError::TooLarge { cells, portals: count });
    }
    let portals = DirectedPortals::new(graph, settings.clearance);
    let least = portals.margins.noise * 65_536.0;
    if !(settings.clearance > 0.0 && settings.clearance >= least && settings.clearance.is_finite()) {
        return Err(BakeError::Clearance { clearance: settings.clearance, least });
    }
    Ok(portals)
}
