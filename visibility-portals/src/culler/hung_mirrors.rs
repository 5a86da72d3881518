//! Mirrors on the boundaries of cells: where they hang, and whether they are covered.

use super::outline::Outline;
use alloc::vec::Vec;
use visibility_core::glam::DVec3;

/// Index of a mirror of a [`SceneCells`](super::scene_cells::SceneCells), in the order of `add_mirror`, from
/// 0.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct MirrorId(pub u32);

/// A planar convex mirror on the boundary of a cell, in world space. Its normal points into the cell.
#[derive(Clone, Debug)]
pub(super) struct Mirror {
    pub(super) outline: Outline,
    pub(super) vertices: Vec<DVec3>,
    /// Index of the next mirror in the list of the cell's mirrors, or `NONE` at the end.
    pub(super) next: u32,
    /// Whether the mirror reflects. `true` for a new mirror; `false` for a covered mirror, which never
    /// yields a reflection.
    pub(super) uncovered: bool,
}
