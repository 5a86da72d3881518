//! What the bakes of cells and of objects have in common: settings, errors, and portals made ready.

use crate::directed_portals::DirectedPortals;
use core::fmt;
use visibility_core::CellGraph;

/// How a bake works.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Settings {
    /// No pair of cells is called hidden between which a line passes that stays clear of all portal edges by
    /// this distance, in the map's units. It must be well above the rounding of coordinates: at least 2^-33
    /// of the greatest.
    pub clearance: f64,
    /// The most chains of portals to look at for one cell. When it is reached, the cell sees all that is
    /// still possible.
    pub steps_per_cell: u64,
    /// Whether chains of portals through which separating planes leave a way are tested in Pluecker space
    /// too, where that decides whether a cell is seen: never more cells, for somewhat more time.
    ///
    /// What is certain is each rejection: of the edges of a few portals of the chain, a certificate shows
    /// that no line passes all of them clear by the clearance. What is kept need not be visible: half-spaces
    /// that have a point in common may still miss the quadric that lines form ([`stabbing`](crate::stabbing)
    /// says more), and what they have in common by less than `f64` can tell is kept, too.
    pub exact: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { clearance: 1e-6, steps_per_cell: u64::MAX, exact: false }
    }
}

impl Settings {
    /// All of them, for a fingerprint.
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
    /// More portals or cells than the tables of pairs have room for.
    TooLarge {
        /// How many cells.
        cells: usize,
        /// How many portals.
        portals: usize,
    },
    /// A matrix of another number of cells than the graph has.
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

/// The most cells or portals in a bake: its tables then take up to 2 GiB.
const MOST: usize = 1 << 16;

/// The portals made ready, if they can be baked.
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
