//! Errors of making and loading a PVS.

use super::ViewcellId;
use crate::binary_format::FormatError;
use core::fmt;

/// The reason why a [`Pvs`](super::Pvs) cannot be made or loaded.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum PvsError {
    /// A given row, the list of targets visible from one viewcell, is not strictly ascending, or has a target
    /// that is not below the number of targets.
    Target {
        /// Viewcell whose given row is faulty.
        viewcell: ViewcellId,
        /// Target in the row that is not greater than the one before, or not below the number of targets.
        target: u32,
    },
    /// The numbers of viewcells or targets, or the size of the rows in bytes, exceed 32 bits.
    Size,
    /// The bytes are damaged, or are not those of a stored PVS.
    Format(FormatError),
    /// A stored row is inconsistent although the checksum matches: the bytes were forged, or written by
    /// faulty code.
    Row {
        /// Viewcell whose stored row is faulty.
        viewcell: ViewcellId,
        /// Description of the fault in English, in which "it" stands for the row.
        problem: &'static str,
    },
    /// Sets of degrees of visibility do not belong to the PVS, or not to each other.
    Degrees {
        /// Description of the fault in English.
        problem: &'static str,
    },
}

impl fmt::Display for PvsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Target { viewcell, target } => {
                write!(f, "target {target} of viewcell {} is unknown or out of order", viewcell.0)
            }
            Self::Size => write!(f, "the set is too large for its form"),
            Self::Format(error) => write!(f, "{error}"),
            Self::Degrees { problem } => write!(f, "degrees of visibility: {problem}"),
            Self::Row { viewcell, problem } => write!(f, "the row of viewcell {}: {problem}", viewcell.0),
        }
    }
}

impl core::error::Error for PvsError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Format(error) => Some(error),
            _ => None,
        }
    }
}

impl From<FormatError> for PvsError {
    fn from(error: FormatError) -> Self {
        Self::Format(error)
    }
}
