//! Limits on the size of a buffer, and the error of a size beyond them.

use core::fmt;

/// Minimum width and minimum height of a buffer, in pixels.
pub const MIN_SIDE: usize = 16;
/// Maximum width and maximum height of a buffer, in pixels.
pub const MAX_SIDE: usize = 4096;

/// Error of a buffer size whose width or height is not in [`MIN_SIDE`]`..=`[`MAX_SIDE`].
///
/// ```
/// let error = visibility_hzb::Hzb::new(8, 600).unwrap_err();
/// assert_eq!([error.width, error.height], [8, 600]);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub struct SizeError {
    /// Requested width in pixels.
    pub width: usize,
    /// Requested height in pixels.
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
