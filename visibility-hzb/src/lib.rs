//! Occlusion culling in image space: a software hierarchical z-buffer that never hides what is visible.
#![no_std]
extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod cuboid;
mod fill;
mod hzb;
mod lens;
mod mesh;
mod pyramid;
mod query;
mod queue;
mod shape;
mod simd;
mod solid;
mod tiles;

pub use hzb::Hzb;
pub use shape::Coverage;
pub use simd::Simd;

/// Culls what a z-buffer finds hidden behind a scene's occluders, after the frustum.
pub type HzbCuller = visibility_core::OcclusionCuller<Hzb>;

use core::fmt;

/// The fewest pixels on a side.
pub const MIN_SIDE: usize = 16;
/// The most pixels on a side.
pub const MAX_SIDE: usize = 4096;

/// A size that is out of range.
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
