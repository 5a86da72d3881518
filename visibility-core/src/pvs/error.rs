//! Why a potentially visible set cannot be made or loaded.

use crate::CellId;
use core::fmt;

/// Why a [`Pvs`](super::Pvs) is refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum PvsError {
    /// A row given is not ascending, or names a target that does not exist.
    Target {
        /// The viewcell of the row.
        viewcell: CellId,
        /// The target out of order, or unknown.
        target: u32,
    },
    /// More than 32-bit numbers can count.
    TooLarge,
    /// The bytes do not begin as those of such a set.
    Magic,
    /// Another version of the form.
    Version {
        /// The version found.
        found: u32,
    },
    /// The bytes are fewer or more than they themselves say, or than a header and rows need.
    Length {
        /// How many bytes there are.
        found: u64,
        /// How many there should be, at least.
        expected: u64,
    },
    /// The bytes are not those that were written.
    Checksum,
    /// A row makes no sense, although the checksum is right: whoever wrote it was wrong.
    Row {
        /// Its viewcell.
        viewcell: CellId,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// The header makes no sense, although the checksum is right.
    Header {
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
            Self::Magic => write!(f, "this is not a stored visible set"),
            Self::Version { found } => write!(f, "version {found} of the form is not known here"),
            Self::Length { found, expected } => write!(f, "{found} bytes, where {expected} are expected"),
            Self::Checksum => write!(f, "the checksum is wrong: the bytes were damaged"),
            Self::Row { viewcell, problem } => write!(f, "the row of viewcell {}: {problem}", viewcell.0),
            Self::Header { problem } => write!(f, "the header: {problem}"),
        }
    }
}

impl core::error::Error for PvsError {}
