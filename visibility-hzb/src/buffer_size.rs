//! The sizes that a buffer can have.

use core::fmt;

/// The fewest pixels that a buffer can have on a side.
pub const MIN_SIDE: usize = 16;
/// The most pixels that a buffer can have on a side.
pub const MAX_SIDE: usize = 4096;

/// The error of a buffer size out of range: a side is not between [`MIN_SIDE`] and [`MAX_SIDE`].
///
/// ```
/// use visibility_hzb::{Hzb, SizeError};
/// assert_eq!(Hzb::new(8, 600).err(), Some(SizeError { width: 8, height: 600 }));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SizeError {
    /// Columns asked for.
    pub width: usize,
    /// Rows asked for.
    pub height: usize,
}

impl fmt::Display for SizeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "a buffer has {MIN_SIDE} to {MAX_SIDE} pixels on a side, not {} x {}",
            self.width, self.height
        )
    }
}

impl core::error::Error for SizeError {}
