//! Errors of a PVS.

use super::ViewcellId;
use crate::envelope::EnvelopeError;
use core::fmt;

/// Why a [`Pvs`](super::Pvs) cannot be made or loaded.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum PvsError {
    /// A row given is not ascending, or holds a target that does not exist.
    Target {
        /// The viewcell of the row.
        viewcell: ViewcellId,
        /// The target out of order, or unknown.
        target: u32,
    },
    /// More viewcells, targets or bytes than 32-bit numbers can count.
    TooLarge,
    /// The bytes are damaged, or not those of a stored PVS.
    Envelope(EnvelopeError),
    /// A stored row makes no sense, although the checksum is right: whoever wrote it was wrong.
    Row {
        /// Its viewcell.
        viewcell: ViewcellId,
        /// What is wrong with it.
        problem: &'static str,
    },
}

impl fmt::Display for PvsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Target { viewcell, target } => {
                write!(f, "target {target} of viewcell {} is unknown or out of order", viewcell.0)
            }
            Self::TooLarge => write!(f, "the set is too large for its form"),
            Self::Envelope(error) => write!(f, "{error}"),
            Self::Row { viewcell, problem } => write!(f, "the row of viewcell {}: {problem}", viewcell.0),
        }
    }
}

impl core::error::Error for PvsError {}

impl From<EnvelopeError> for PvsError {
    fn from(error: EnvelopeError) -> Self {
        Self::Envelope(error)
    }
}
