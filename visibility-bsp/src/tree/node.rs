//! Nodes of a tree and the values that stand for leaves.

use visibility_core::glam::{DVec3, Vec3};
use visibility_core::{Aabb, geometry::SidePlane};

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

/// Returns the smallest `f32` box that contains `f64` points, in the points' own space: its sides are those
/// of the points where `f32` has their coordinates. Empty (inverted) without points.
pub(super) fn bounds_of(points: &[DVec3]) -> Aabb {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &p in points {
        (min, max) = (min.min(p), max.max(p));
    }
    let low = |exact: f64| {
        let nearest = exact as f32;
        if f64::from(nearest) <= exact { nearest } else { nearest.next_down() }
    };
    // A number is rounded up by rounding its negative down.
    let low = |corner: DVec3| Vec3::from_array(corner.to_array().map(low));
    Aabb::new(low(min), -low(-max))
}
