//! Mirrors on the boundaries of cells.

use super::outline::Outline;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// In place of a number: no mirror, no way.
pub(super) const NONE: u32 = u32::MAX;

/// A mirror of [`SceneCells`](super::scene_cells::SceneCells), by its number.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct MirrorId(pub u32);

/// A mirror on the boundary of a cell.
#[derive(Clone, Debug)]
pub(super) struct Mirror {
    pub(super) outline: Outline,
    pub(super) vertices: Vec<DVec3>,
    /// The next mirror of the same cell.
    pub(super) next: u32,
    pub(super) uncovered: bool,
}
