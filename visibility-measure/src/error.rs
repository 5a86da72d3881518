//! The error type of this crate.

use core::fmt;

/// Reason why an item buffer cannot be made or filled.
///
/// ```
/// use visibility_measure::{ItemBuffer, MeasureError};
/// let refused = ItemBuffer::new(0, 360).err();
/// assert_eq!(refused, Some(MeasureError::Size { width: 0, height: 360 }));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum MeasureError {
    /// A side is zero or above [`MAX_SIDE`](crate::MAX_SIDE), or memory for the pixels cannot be allocated.
    Size {
        /// Requested number of columns.
        width: u32,
        /// Requested number of rows.
        height: u32,
    },
    /// The number of triangles or of objects exceeds the 32-bit numbers available.
    TooMany {
        /// Index, in the order drawn, of the object that exceeded the limit.
        object: usize,
    },
}

impl fmt::Display for MeasureError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { width, height } => {
                write!(f, "cannot make an item buffer of {width} x {height} pixels")
            }
            Self::TooMany { object } => {
                write!(f, "object {object} brings the number of triangles beyond {}", u32::MAX - 1)
            }
        }
    }
}

impl core::error::Error for MeasureError {}
