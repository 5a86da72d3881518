//! What cannot be measured, and why.

use core::fmt;

/// Why something cannot be measured.
///
/// ```
/// use visibility_measure::{ItemBuffer, MeasureError};
/// let refused = ItemBuffer::new(0, 360).err();
/// assert_eq!(refused, Some(MeasureError::Size { width: 0, height: 360 }));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum MeasureError {
    /// A side is zero or above [`MAX_SIDE`](crate::MAX_SIDE), or there is no memory for so many pixels.
    Size {
        /// Columns asked for.
        width: u32,
        /// Rows asked for.
        height: u32,
    },
    /// There are more triangles or objects than 32-bit numbers for them.
    TooMany {
        /// Index of the object that went beyond.
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
