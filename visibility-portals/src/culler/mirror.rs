//! Mirrors on the boundaries of cells.

use super::outline::Outline;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// Marks the end of a linked list of mirrors or paths, and the parent of a path that begins where the eye is.
pub(super) const NONE: u32 = u32::MAX;

/// A mirror of [`SceneCells`](super::scene_cells::SceneCells), by its number.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct MirrorId(pub u32);

/// A mirror on the boundary of a cell; its normal points into the cell.
#[derive(Clone, Debug)]
pub(super) struct Mirror {
    pub(super) outline: Outline,
    pub(super) vertices: Vec<DVec3>,
    /// Index of the next mirror of the same cell, or `NONE`.
    pub(super) next: u32,
    /// Whether it reflects.
    pub(super) uncovered: bool,
}
