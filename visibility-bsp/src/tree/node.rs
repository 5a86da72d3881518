//! Nodes of a tree and the values that stand for leaves.

use visibility_core::geometry::SidePlane;

/// Index that stands for no node or no fragment.
pub(super) const NONE: u32 = u32::MAX;
/// Child value of a leaf, a region without polygons.
pub(super) const EMPTY: u32 = u32::MAX;

/// Tests whether a child value stands for a leaf and not for a node index. False for a node index.
pub(super) const fn is_leaf(child: u32) -> bool {
    child == EMPTY
}

/// A node of a tree: its plane in the tree's coordinates, the list of fragments in the plane, and the two
/// children. Fills one cache line of 64 bytes.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Node {
    /// The dividing plane in the tree's coordinates, with the margin within which points count as on the
    /// plane.
    pub(super) plane: SidePlane,
    /// Children behind and in front of the plane: node indices or [`EMPTY`].
    pub(super) children: [u32; 2],
    /// Index of the first fragment in the plane; [`NONE`] if the plane only divides.
    pub(super) first: u32,
    /// Index of the parent node, [`NONE`] for the root.
    pub(super) parent: u32,
}
